/* contact_law.h - what damps a contact (eq. 14): fixed at touch-down by the law and the speed of
 * impact, held until lift-off */
#ifndef HX_CONTACT_LAW_H
#define HX_CONTACT_LAW_H

#include "state.h"

HX_HIDDEN_BEGIN

/* One row per hxContactLaw; the only place a law is chosen. */
typedef struct {
  double (*scale)(const hxDefinition *definition); /* the law's constant, compiled into the model */
  double (*damping)(const hxModel *model, double impact_speed); /* d, s/m, at touch-down */
} hxContactRow;

const hxContactRow *hx_contact(int law); /* NULL when there is no such law */

/* chi of the law that gives back exactly the restitution e: chi (1 + e) = ln[(1 + chi)/(1 - chi
 * e)]; e in (0, 1]. */
double hx_exact_restitution_chi(double e);

/* The contact states of a motion that starts here: feet in the ground are closed and count as put
 * down slowly. */
void hx_contact_start(const hxModel *model, const double delta[HX_SLOTS], hxContactState *contact);

/* The bristles of open feet are slack (eq. 16). */
void hx_contact_slacken(const hxContactState *contact, hxPlantMotion *motion);

/* Touch-down of open feet in the ground, lift-off of closed ones out of it; returns the number of
 * touch-downs. */
int hx_contact_switch(const hxModel *model, const double delta[HX_SLOTS],
                      const double ddelta[HX_SLOTS], hxContactState *contact);

HX_HIDDEN_END

#endif
