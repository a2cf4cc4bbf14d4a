/* sway.h - sway of the torso against the swinging legs (C54). Python: controller/comply/sway.py. */
#ifndef HX_SWAY_H
#define HX_SWAY_H

#include "../sense/load_adaptation.h"
#include "../walk/inverse_dynamics.h"
#include "../walk/trajectory.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxSway {
  int active; /* the part is on */
  double forward, aside; /* 1    share of the mass that moves with all feet; 0 without the part */
  double mass; /* kg    of the robot */
  hxPlane home; /* m    sum of the feet in the stance */
  hxPlane rest; /* kg m    sum of m p of all links in the stance */
} hxSway;

void hx_sway_compile(const hxControllerDefinition *definition, const hxLegSolver leg[HX_LEGS],
                     const hxInverseDynamics *dynamics, hxSway *model);

/* Returns whether the torso sways. */
int hx_sway_acts(const hxSway *model, const hxLoadAdaptation *adaptation);

/* Returns the weight that sways over the modelled one [1]. */
double hx_sway_laden(const hxSway *model, const hxLoadAdaptation *adaptation);

/* Returns nearly the whole way of the torso in the walking frame, by the shares [m]. */
hxPlane hx_sway_guess(const hxSway *model, const hxPlannedFeet *feet, const hxLoadAdaptation *adaptation);

/* Returns the way of the torso in the walking frame [m] (C54). masses: of a torso that has moved by
 * the guess. */
hxPlane hx_sway_of(const hxSway *model, const hxInverseDynamics *dynamics, hxPlane guess,
                   const hxMasses *masses, const hxLoadAdaptation *adaptation);

HX_HIDDEN_END

#endif
