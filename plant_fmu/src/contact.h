/* contact.h - normal force f_n = K delta^(3/2) (1 + d ddelta) >= 0 (eq. 4), with d fixed at touch-down by the law */
#ifndef HX_CONTACT_H
#define HX_CONTACT_H

#include "state.h"
#include "vec3.h"

/* One row per hxContactLaw; the only place a law is chosen. */
typedef struct {
  double (*scale)(const hxDefinition *definition);              /* the law's constant, compiled into the model */
  double (*damping)(const hxModel *model, double impact_speed); /* d, s/m, at touch-down */
} hxContactRow;

typedef struct {
  hxReal force;     /* N    f_n */
  hxReal elastic;   /* N    its part that is stored: K delta^(3/2) */
  hxReal stiffness; /* N/m  df_n/ddelta */
  hxReal viscosity; /* N s/m  df_n/d(ddelta) */
} hxNormalForce;

HX_LOCAL const hxContactRow *hx_contact(int law); /* NULL when there is no such law */

/* chi of the law that gives back exactly the restitution e: chi (1 + e) = ln[(1 + chi)/(1 - chi e)]; e in (0, 1]. */
HX_LOCAL double hx_exact_restitution_chi(double e);

HX_LOCAL hxNormalForce hx_normal_force(const hxModel *model, hxReal closed, hxReal damping, hxReal delta, hxReal ddelta);

/* The contact states of a motion that starts here: feet in the ground are closed and count as put down slowly. */
HX_LOCAL void hx_contact_start(const hxModel *model, const double delta[HX_SLOTS], hxContactState *contact);

/* Touch-down of open feet in the ground, lift-off of closed ones out of it; returns the number of touch-downs. */
HX_LOCAL int hx_contact_switch(const hxModel *model, const double delta[HX_SLOTS], const double ddelta[HX_SLOTS], hxContactState *contact);

#endif
