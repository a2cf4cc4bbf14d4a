/* sway.h - sway of the torso against the swinging legs (C57). Python: controller/comply/sway.py. */
#ifndef HX_SWAY_H
#define HX_SWAY_H

#include "../walk/inverse_dynamics.h"
#include "../walk/trajectory.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxSway {
  double forward, aside; /* 1    way of the torso over that of a foot; 0 where the part is off */
  hxPlane home; /* m    sum of the feet in the stance */
} hxSway;

void hx_sway_compile(const hxControllerDefinition *definition, const hxLegSolver leg[HX_LEGS],
                     const hxInverseDynamics *dynamics, hxSway *model);

/* Computes the way of the torso in the walking frame, and its rate [m, m/s]. */
void hx_sway_of(const hxSway *model, const hxPlannedFeet *feet, hxPlane *way, hxPlane *rate);

HX_HIDDEN_END

#endif
