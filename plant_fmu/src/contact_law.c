#include "contact_law.h"

#include <math.h>
#include <string.h>

#include "elementary.h"

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

/* The constants chi of the laws (eq. 14); hertz and constant: damping, s/m. */
static double exact(const hxDefinition *d) {
  return hx_exact_restitution_chi(d->contact.restitution);
}
static double flores(const hxDefinition *d) {
  return 8.0 * (1.0 - d->contact.restitution) / (5.0 * d->contact.restitution);
}
static double lankarani_nikravesh(const hxDefinition *d) {
  return 0.75 * (1.0 - d->contact.restitution * d->contact.restitution);
}
static double hunt_crossley(const hxDefinition *d) { return 1.5 * (1.0 - d->contact.restitution); }
static double constant(const hxDefinition *d) { return 1.5 * d->contact.damping_factor; }
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
    [HX_CONTACT_EXACT_RESTITUTION] = {exact, over_impact_speed},
    [HX_CONTACT_FLORES] = {flores, over_impact_speed},
    [HX_CONTACT_LANKARANI_NIKRAVESH] = {lankarani_nikravesh, over_impact_speed},
    [HX_CONTACT_HUNT_CROSSLEY] = {hunt_crossley, over_impact_speed},
    [HX_CONTACT_CONSTANT_DAMPING] = {constant, independent_of_speed},
    [HX_CONTACT_HERTZ] = {hertz, independent_of_speed},
};

const hxContactRow *hx_contact(int law) {
  return law >= 1 && law < (int)(sizeof contact_rows / sizeof contact_rows[0]) ? &contact_rows[law]
                                                                               : NULL;
}

/* Closes a contact and fixes its damping by the impact speed, m/s. */
static void close_contact(const hxModel *model, hxContactState *contact, int row, int slot,
                          double impact_speed) {
  contact->closed[row][slot] = 1.0;
  contact->impact_speed[row][slot] = impact_speed;
  contact->damping[row][slot] = hx_contact(model->contact_law)->damping(model, impact_speed);
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
}

void hx_contact_start(const hxModel *model, const hxDepths *depths, hxContactState *contact) {
  memset(contact, 0, sizeof *contact);
  for (int k = 0; k < model->rows + model->torso_rows; ++k) {
    const int row = model->row[k];
    for (int slot = 0; slot < hx_slots_of(row); ++slot)
      if (depths->delta[row][slot] > 0.0) close_contact(model, contact, row, slot, 0.0);
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
  for (int k = 0; k < model->rows + model->torso_rows; ++k) {
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
  for (int k = 0; k < model->rows + model->torso_rows; ++k) {
    const int row = model->row[k];
    for (int slot = 0; slot < hx_slots_of(row); ++slot) {
      const int closed = contact->closed[row][slot] != 0.0;
      if (!closed && depths->delta[row][slot] > 0.0) {
        close_contact(model, contact, row, slot, depths->ddelta[row][slot]);
        ++touchdowns;
      } else if (closed && depths->delta[row][slot] <= 0.0) {
        open_contact(contact, row, slot);
      }
    }
    fill_contact_slots(contact, row);
  }
  return touchdowns;
}
