/* planned_squeeze.h - forces by which the standing legs squeeze each other, so that friction
 * carries a part of the servos' load. Python: controller/comply/planned_squeeze.py. */
#ifndef HX_PLANNED_SQUEEZE_H
#define HX_PLANNED_SQUEEZE_H

#include "support.h"

HX_HIDDEN_BEGIN

typedef struct hxPlannedSqueeze {
  double friction; /* 1, coefficient that is believed */
  double torque; /* N m, of a tripod's load at the arm of the torso's height */
} hxPlannedSqueeze;

/* weight: of the robot [N]; depth: of the ground below the torso's origin in the stance [m]. */
void hx_planned_squeeze_compile(const hxControllerDefinition *definition, double weight,
                                double depth, hxPlannedSqueeze *model);

/* Adds the squeeze to shares without one (C42, C43).
 * squeeze: weight of the torques, in [0, 1). */
void hx_planned_squeeze_add(const hxPlannedSqueeze *model, const hxPlane feet[HX_LEGS],
                            const hxDemand *demand, double squeeze, hxShares *shares);

HX_HIDDEN_END

#endif
