/* sway.h - sway of the torso against the swinging legs (C57). Python: controller/comply/sway.py. */
#ifndef HX_SWAY_H
#define HX_SWAY_H

#include "../sense/warmth.h"
#include "../walk/inverse_dynamics.h"
#include "../walk/trajectory.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxSway {
  int active; /* the part is on */
  double forward, aside; /* 1    share of the mass that moves with all feet; 0 without the part */
  hxPlane home; /* m    sum of the feet in the stance */
} hxSway;

void hx_sway_compile(const hxControllerDefinition *definition, const hxLegSolver leg[HX_LEGS],
                     const hxInverseDynamics *dynamics, hxSway *model);

/* Returns the weight that sways over the modelled one [1]. */
double hx_sway_laden(const hxSway *model, const hxWarmth *warmth);

/* Computes the way of the torso in the walking frame, and its rate under a constant weight, which
 * changes slowly [m, m/s]. */
void hx_sway_of(const hxSway *model, const hxPlannedFeet *feet, const hxWarmth *warmth,
                hxPlane *way, hxPlane *rate);

HX_HIDDEN_END

#endif
