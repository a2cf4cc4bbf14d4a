#include "contact_law.h"

#include <math.h>

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

/* Closes a foot and fixes its damping by the impact speed, m/s. */
static void close_foot(const hxModel *model, hxContactState *contact, int leg,
                       double impact_speed) {
  contact->closed[leg] = 1.0;
  contact->impact_speed[leg] = impact_speed;
  contact->damping[leg] = hx_contact(model->contact_law)->damping(model, impact_speed);
}

static void open_foot(hxContactState *contact, int leg) {
  contact->closed[leg] = 0.0;
  contact->damping[leg] = 0.0;
}

static void fill_contact_slots(hxContactState *contact) {
  hx_fill_slots(contact->closed);
  hx_fill_slots(contact->damping);
  hx_fill_slots(contact->impact_speed);
}

void hx_contact_start(const hxModel *model, const double delta[HX_SLOTS], hxContactState *contact) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    open_foot(contact, leg);
    contact->impact_speed[leg] = 0.0;
    if (delta[leg] > 0.0) close_foot(model, contact, leg, 0.0);
  }
  fill_contact_slots(contact);
}

void hx_contact_slacken(const hxContactState *contact, hxPlantMotion *motion) {
  for (int i = 0; i < 3; ++i) {
    for (int leg = 0; leg < HX_LEGS; ++leg)
      if (contact->closed[leg] == 0.0) motion->bristle[i][leg] = 0.0;
    hx_fill_slots(motion->bristle[i]);
  }
}

int hx_contact_switch(const hxModel *model, const double delta[HX_SLOTS],
                      const double ddelta[HX_SLOTS], hxContactState *contact) {
  int touchdowns = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    if (contact->closed[leg] == 0.0 && delta[leg] > 0.0) {
      close_foot(model, contact, leg, ddelta[leg]);
      ++touchdowns;
    } else if (contact->closed[leg] != 0.0 && delta[leg] <= 0.0) {
      open_foot(contact, leg);
    }
  }
  fill_contact_slots(contact);
  return touchdowns;
}
