/* burden.h - how much of the robot's weight its servos can carry, and what follows from it.
 * Python: controller/sense/burden.py. */
#ifndef HX_BURDEN_H
#define HX_BURDEN_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxBurdenModel {
  double most; /* N m  that a servo may be asked for */
  double fade, follow; /* 1    of the smoothings, over a period */
} hxBurdenModel;

typedef struct hxBurden {
  double heft; /* 1    measured over modelled weight */
  /* N m  largest torque that any joint is asked for to carry the model's weight, of late */
  double peak;
  /* 1  less than 1: of the support, so that no servo is asked for more than it may */
  double strength;
  double freedom; /* 1    of the squeeze that the slip PID may take away */
  int overburdened; /* far too heavy: kinematic control */
} hxBurden;

void hx_burden_compile(const hxControllerDefinition *definition, hxBurdenModel *model);
void hx_burden_reset(hxBurden *burden);

/* Takes the measured over the modelled weight of this period (C31). */
void hx_burden_weigh(const hxBurdenModel *model, double ratio, hxBurden *burden);

/* One period on (C31, C32). needed: largest torque to carry the model's weight [N m]; scale:
 * measured over modelled weight, as the support believes it [1]. */
void hx_burden_step(const hxBurdenModel *model, double needed, double scale, hxBurden *burden);

HX_HIDDEN_END

#endif
