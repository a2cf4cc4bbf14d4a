/* contact_law.c - damping at touch-down (models/contact/law.py) and the switching of contacts
 * (models/contact/switching.py) */
#include "contact_law.h"

#include <math.h>
#include <string.h>

#include "elementary.h"
#include "ground/soil.h"
#include "ground/surface.h"

double hx_exact_restitution_chi(double e) {
  if (e >= 1.0) return 0.0;
  /* g(chi) = ln(1 + chi) - ln(1 - chi e) - chi (1 + e) falls from 0, then rises to infinity at 1/e:
   * one root in between */
  double low = 0.0, high = 1.0 / e;
  for (int i = 0; i < 200; ++i) {
    const double chi = 0.5 * (low + high);
    if (chi <= low || chi >= high) break;
    if (hx_log1p(chi) - hx_log1p(-chi * e) - chi * (1.0 + e) < 0.0)
      low = chi;
    else
      high = chi;
  }
  return 0.5 * (low + high);
}

/* ---- constants of the laws: chi (eq. 14), of hertz and constant_damping d, s/m ---- */

static double exact_restitution(const hxDefinition *d) {
  return hx_exact_restitution_chi(d->contact.restitution);
}
static double flores(const hxDefinition *d) {
  return 8.0 * (1.0 - d->contact.restitution) / (5.0 * d->contact.restitution);
}
static double lankarani_nikravesh(const hxDefinition *d) {
  return 0.75 * (1.0 - d->contact.restitution * d->contact.restitution);
}
static double hunt_crossley(const hxDefinition *d) { return 1.5 * (1.0 - d->contact.restitution); }
static double constant_damping(const hxDefinition *d) { return 1.5 * d->contact.damping_factor; }
static double hertz(const hxDefinition *d) {
  (void)d;
  return 0.0;
}

/* Returns d = chi / v0; the floor of v0 avoids a division by zero at slow touch-downs. */
static double over_impact_speed(const hxModel *model, double impact_speed) {
  return model->damping_scale / fmax(impact_speed, model->impact_speed_floor);
}

static double independent_of_speed(const hxModel *model, double impact_speed) {
  (void)impact_speed;
  return model->damping_scale;
}

static const hxContactRow contact_rows[] = {
    [HX_CONTACT_EXACT_RESTITUTION] = {exact_restitution, over_impact_speed},
    [HX_CONTACT_FLORES] = {flores, over_impact_speed},
    [HX_CONTACT_LANKARANI_NIKRAVESH] = {lankarani_nikravesh, over_impact_speed},
    [HX_CONTACT_HUNT_CROSSLEY] = {hunt_crossley, over_impact_speed},
    [HX_CONTACT_CONSTANT_DAMPING] = {constant_damping, independent_of_speed},
    [HX_CONTACT_HERTZ] = {hertz, independent_of_speed},
};

const hxContactRow *hx_contact(int law) {
  return law >= 1 && law < (int)(sizeof contact_rows / sizeof contact_rows[0]) ? &contact_rows[law]
                                                                               : NULL;
}

/* Returns d of eq. 14 of a contact that touches down at this speed, s/m. */
static double contact_damping(const hxModel *model, double impact_speed) {
  return hx_contact(model->contact_law)->damping(model, impact_speed);
}

/* Sets stiffness and friction of a contact to those of the ground of a material, NULL: of the
 * definition. A material with a kinetic coefficient of its own has no static rise unless it says
 * so. */
static void set_ground(const hxModel *model, const double *material, int row, int slot,
                       hxContactState *contact) {
  double stiffness = model->stiffness, mu = model->mu, mu_static = model->mu + model->static_rise;
  if (material && !isnan(material[HX_MATERIAL_STIFFNESS]))
    stiffness = material[HX_MATERIAL_STIFFNESS];
  if (material && !isnan(material[HX_MATERIAL_MU])) mu = mu_static = material[HX_MATERIAL_MU];
  if (material && !isnan(material[HX_MATERIAL_MU_STATIC]))
    mu_static = material[HX_MATERIAL_MU_STATIC];
  contact->stiffness[row][slot] = stiffness;
  contact->mu[row][slot] = mu;
  contact->static_rise[row][slot] = material ? fmax(mu_static - mu, 0.0) : model->static_rise;
}

/* Sets the soil of a foot's contact to that of a material, NULL: of the definition. */
static void set_soil(const hxModel *model, const double *material, int slot,
                     hxContactState *contact) {
  hxSoil soil;
  double numbers[HX_SOIL_SIZE];
  if (material)
    hx_soil_from_row(material + HX_MATERIAL_SOIL, model->radius[HX_FOOT], model->pad_radius, &soil);
  else
    memcpy(&soil, model->soil, sizeof soil);
  contact->on_soil[slot] = (int)soil.law != HX_SOIL_NONE ? 1.0 : 0.0;
  memcpy(numbers, &soil, sizeof soil);
  for (int i = 0; i < HX_SOIL_SIZE; ++i) contact->soil[i][slot] = numbers[i];
}

/* Copies the centre of a row's sphere. */
static void centre_of(const hxDepths *depths, int row, int slot, double centre[3]) {
  for (int i = 0; i < 3; ++i)
    centre[i] = depths->centre[hx_is_of_foot(row) ? HX_FOOT : row][i][slot];
}

/* Returns the material under a sphere. */
static const double *material_under(const hxModel *model, const hxDepths *depths, int row,
                                    int slot) {
  double centre[3];
  if (!model->terrain || hx_is_of_pair(row)) return NULL;
  centre_of(depths, row, slot, centre);
  return hx_terrain_material(model->terrain, centre);
}

/* Closes a contact: fixes its damping by the impact speed, m/s, and its ground by its place. */
static void close_contact(const hxModel *model, const hxDepths *depths, int row, int slot,
                          double impact_speed, hxContactState *contact) {
  const double *material = material_under(model, depths, row, slot);
  set_ground(model, material, row, slot, contact);
  if (model->has_soil && row == HX_FOOT) set_soil(model, material, slot, contact);
  contact->closed[row][slot] = 1.0;
  contact->impact_speed[row][slot] = impact_speed;
  contact->damping[row][slot] = contact_damping(model, impact_speed);
}

static void open_contact(hxContactState *contact, int row, int slot) {
  contact->closed[row][slot] = 0.0;
  contact->damping[row][slot] = 0.0;
}

/* Copies leg 0 into the unused slots of a row on the tibias. */
static void fill_contact_slots(hxContactState *contact, int row) {
  if (row == HX_TORSO) return;
  hx_fill_slots(contact->closed[row]);
  hx_fill_slots(contact->damping[row]);
  hx_fill_slots(contact->impact_speed[row]);
  hx_fill_slots(contact->stiffness[row]);
  hx_fill_slots(contact->mu[row]);
  hx_fill_slots(contact->static_rise[row]);
  if (row != HX_FOOT) return;
  hx_fill_slots(contact->on_soil);
  for (int i = 0; i < HX_SOIL_SIZE; ++i) hx_fill_slots(contact->soil[i]);
}

/* Holds the cells of feet that touch the ground and releases those of others. */
static void hold_cells(const hxModel *model, const hxDepths *depths, hxContactState *contact) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    int in_contact = 0;
    for (int k = HX_FOOT; hx_is_of_foot(k); ++k) in_contact |= contact->closed[k][leg] != 0.0;
    double centre[3];
    centre_of(depths, HX_FOOT, leg, centre);
    double cell[2] = {contact->cell[0][leg], contact->cell[1][leg]};
    if (in_contact && cell[0] < 0.0) hx_terrain_cell_at(model->terrain, centre, cell);
    for (int i = 0; i < 2; ++i) contact->cell[i][leg] = in_contact ? cell[i] : -1.0;
  }
  for (int i = 0; i < 2; ++i) hx_fill_slots(contact->cell[i]);
}

int hx_has_cells(const hxModel *model) {
  return model->terrain && hx_terrain_surface(model->terrain) == HX_SURFACE_BLOCKS;
}

void hx_contact_release(hxContactState *contact) {
  memset(contact, 0, sizeof *contact);
  for (int slot = 0; slot < HX_SLOTS; ++slot)
    contact->cell[0][slot] = contact->cell[1][slot] = -1.0;
}

/* Sets the plastic depths of feet that begin in soil, as if they had been pressed into it. */
static void start_in_soil(const hxDepths *depths, hxContactState *contact) {
  for (int slot = 0; slot < HX_LEGS; ++slot) {
    hxSoil soil;
    double numbers[HX_SOIL_SIZE];
    for (int i = 0; i < HX_SOIL_SIZE; ++i) numbers[i] = contact->soil[i][slot];
    memcpy(&soil, numbers, sizeof soil);
    if (contact->closed[HX_FOOT][slot] != 0.0 && contact->on_soil[slot] != 0.0)
      contact->plastic[slot] = hx_plastic_depth(&soil, depths->delta[HX_FOOT][slot]);
  }
  hx_fill_slots(contact->plastic);
}

void hx_contact_start(const hxModel *model, const hxDepths *depths, hxContactState *contact) {
  hx_contact_release(contact);
  for (int row = 0; row < HX_ROWS; ++row)
    for (int slot = 0; slot < HX_SLOTS; ++slot) set_ground(model, NULL, row, slot, contact);
  for (int k = 0; k < model->listed; ++k) {
    const int row = model->row[k];
    for (int slot = 0; slot < hx_slots_of(row); ++slot)
      if (depths->delta[row][slot] > 0.0) close_contact(model, depths, row, slot, 0.0, contact);
    fill_contact_slots(contact, row);
    if (model->has_soil && row == HX_FOOT) start_in_soil(depths, contact);
  }
  if (hx_has_cells(model)) hold_cells(model, depths, contact);
}

void hx_contact_tune(const hxModel *model, const hxDepths *depths, hxContactState *contact) {
  for (int k = 0; k < model->listed; ++k) {
    const int row = model->row[k];
    for (int slot = 0; slot < hx_slots_of(row); ++slot) {
      const double *material = material_under(model, depths, row, slot);
      const double impact_speed = contact->impact_speed[row][slot];
      if (contact->closed[row][slot] == 0.0) continue;
      set_ground(model, material, row, slot, contact);
      contact->damping[row][slot] = contact_damping(model, impact_speed);
      if (row == HX_FOOT && contact->on_soil[slot] != 0.0) set_soil(model, material, slot, contact);
    }
    fill_contact_slots(contact, row);
  }
}

void hx_contact_slacken(const hxContactState *contact, hxPlantMotion *motion) {
  for (int i = 0; i < 3; ++i) {
    for (int leg = 0; leg < HX_LEGS; ++leg)
      if (contact->closed[HX_FOOT][leg] == 0.0) motion->bristle[i][leg] = 0.0;
    hx_fill_slots(motion->bristle[i]);
  }
}

int hx_contact_is_due(const hxModel *model, const hxDepths *depths, const hxContactState *contact) {
  int due = 0;
  for (int k = 0; k < model->listed; ++k) {
    const double *closed = contact->closed[model->row[k]], *delta = depths->delta[model->row[k]];
    for (int leg = 0; leg < HX_LEGS; ++leg) due |= (closed[leg] != 0.0) != (delta[leg] > 0.0);
    if (model->row[k] == HX_TORSO)
      for (int slot = HX_LEGS; slot < HX_SLOTS; ++slot)
        due |= (closed[slot] != 0.0) != (delta[slot] > 0.0);
  }
  return due;
}

int hx_contact_switch(const hxModel *model, const hxDepths *depths, hxContactState *contact) {
  int touchdowns = 0;
  for (int k = 0; k < model->listed; ++k) {
    const int row = model->row[k];
    for (int slot = 0; slot < hx_slots_of(row); ++slot) {
      const int closed = contact->closed[row][slot] != 0.0;
      if (!closed && depths->delta[row][slot] > 0.0) {
        close_contact(model, depths, row, slot, depths->ddelta[row][slot], contact);
        ++touchdowns;
      } else if (closed && depths->delta[row][slot] <= 0.0) {
        open_contact(contact, row, slot);
      }
    }
    fill_contact_slots(contact, row);
  }
  if (hx_has_cells(model)) hold_cells(model, depths, contact);
  return touchdowns;
}

/* Returns the square of the difference of two contacts' normals. */
static double squared_turn(const hxContactMoment *a, const hxContactMoment *b, int leg) {
  double square = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double d = a->normal[i][leg] - b->normal[i][leg];
    square += d * d;
  }
  return square;
}

/* Returns whether a row of a leg at one side of a border is the same contact as a row at the other
 * side: the same depth along the same normal. */
static int is_same(const hxContactMoment *a, const hxContactMoment *b, int leg) {
  const double slack = 1e-6; /* m and 1; the border is found to 1e-10 m */
  return fabs(a->delta[leg] - b->delta[leg]) < slack && squared_turn(a, b, leg) < slack;
}

/* Returns whether the nearest points of two rows of a leg are so close on the foot that one impact
 * presses both: a step between them is lower than the first is deep. */
static int is_one_impact(const hxModel *model, const hxContactMoment *a, const hxContactMoment *b,
                         int leg) {
  return squared_turn(a, b, leg) * model->radius[HX_FOOT] <= 4.0 * a->delta[leg];
}

void hx_contact_continue_impacts(const hxModel *model, const hxMoment *at,
                                 const hxContactState *before, hxContactState *contact) {
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int to = HX_FOOT; hx_is_of_foot(to); ++to) {
      double deepest = 0.0;
      if (contact->closed[to][leg] == 0.0 || before->closed[to][leg] != 0.0) continue;
      for (int from = HX_FOOT; hx_is_of_foot(from); ++from)
        if (before->closed[from][leg] != 0.0 && at->contact[from].delta[leg] > deepest &&
            is_one_impact(model, &at->contact[from], &at->contact[to], leg)) {
          deepest = at->contact[from].delta[leg];
          contact->damping[to][leg] = before->damping[from][leg];
          contact->impact_speed[to][leg] = before->impact_speed[from][leg];
        }
    }
  for (int row = HX_FOOT; hx_is_of_foot(row); ++row) fill_contact_slots(contact, row);
}

/* Copies the contact of a row of a leg to another row. */
static void copy_contact(const hxContactState *from, int row_from, int row_to, int leg,
                         hxContactState *to) {
  to->closed[row_to][leg] = from->closed[row_from][leg];
  to->damping[row_to][leg] = from->damping[row_from][leg];
  to->impact_speed[row_to][leg] = from->impact_speed[row_from][leg];
  to->stiffness[row_to][leg] = from->stiffness[row_from][leg];
  to->mu[row_to][leg] = from->mu[row_from][leg];
  to->static_rise[row_to][leg] = from->static_rise[row_from][leg];
}

int hx_contact_cross(const hxModel *model, const hxDepths *depths, hxContactState *contact) {
  int crossed = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    double centre[3];
    centre_of(depths, HX_FOOT, leg, centre);
    double cell[2];
    if (contact->cell[0][leg] < 0.0 || depths->outside[leg] <= 0.0) continue;
    hx_terrain_cell_at(model->terrain, centre, cell);
    contact->cell[0][leg] = cell[0], contact->cell[1][leg] = cell[1];
    crossed |= 1 << leg;
  }
  for (int i = 0; i < 2; ++i) hx_fill_slots(contact->cell[i]);
  return crossed;
}

void hx_contact_hand_over(const hxMoment *before, const hxMoment *after, int crossed,
                          hxContactState *contact) {
  const hxContactState was = *contact;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int to = HX_FOOT; hx_is_of_foot(to) && crossed >> leg & 1; ++to) {
      double share = -1.0;
      open_contact(contact, to, leg);
      for (int from = HX_FOOT; hx_is_of_foot(from); ++from)
        if (was.closed[from][leg] != 0.0 && before->share[from][leg] > share &&
            is_same(&before->contact[from], &after->contact[to], leg)) {
          share = before->share[from][leg];
          copy_contact(&was, from, to, leg, contact);
        }
    }
  for (int row = HX_FOOT; hx_is_of_foot(row); ++row) fill_contact_slots(contact, row);
}
