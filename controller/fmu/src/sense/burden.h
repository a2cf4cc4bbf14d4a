/* burden.h - how much of the robot's weight its servos can carry, and the resulting limits. Python:
 * controller/sense/burden.py. */
#ifndef HX_BURDEN_H
#define HX_BURDEN_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxBurdenModel {
  double most; /* N m, largest torque that a servo may be commanded */
  double fade, follow; /* 1, factors of the smoothings over a period */
} hxBurdenModel;

typedef struct hxBurden {
  double heft; /* 1    measured over modelled weight */
  /* N m, largest torque of a joint that carries the model's weight, over the last gait cycle or so
   */
  double peak;
  /* 1, factor of the support, below 1 so that no servo exceeds its torque limit */
  double strength;
  int overburdened; /* the robot is far too heavy: kinematic control */
} hxBurden;

void hx_burden_compile(const hxControllerDefinition *definition, hxBurdenModel *model);
void hx_burden_reset(hxBurden *burden);

/* Takes the measured over the modelled weight of this period (C32). */
void hx_burden_weigh(const hxBurdenModel *model, double ratio, hxBurden *burden);

/* Advances by one period (C31, C32). needed: largest torque to carry the model's weight [N m];
 * scale: measured over modelled weight, as the support assumes it [1]. */
void hx_burden_step(const hxBurdenModel *model, double needed, double scale, hxBurden *burden);

HX_HIDDEN_END

#endif
