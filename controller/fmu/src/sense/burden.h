/* burden.h - how much of the robot's weight its servos can carry, and the resulting limits. Python:
 * controller/sense/burden.py. */
#ifndef HX_BURDEN_H
#define HX_BURDEN_H

#include "../plane.h"
#include "hexapod/controller.h"

typedef struct hxBurdenModel {
  double most;         /* N m  largest torque that a servo may be commanded */
  double fade, follow; /* 1  factors of the smoothings over a period */
} hxBurdenModel;

typedef struct hxBurden {
  double heft; /* 1    measured over modelled weight */
  /* N m  largest torque of a joint that carries the model's weight, over the last gait cycle or so
   */
  double peak;
  /* 1  factor of the support, below 1 so that no servo exceeds its torque limit */
  double strength;
  int overburdened; /* the robot is far too heavy: kinematic control */
} hxBurden;

/* 1  of the time in which the support follows the weight, for the measured weight */
static const double quick = 0.2;
/* 1  part of the needed torque that servos may give */
static const double no_support = 0.54, full_support = 0.84;
/* 1  of the allowed torque, needed to carry the measured weight */
static const double support_helps = 1.35, support_fails = 1.5;
/* 1  measured over modelled weight; values outside are not taken as weights */
static const double lightest = 0.5, heaviest = 4.0;

static inline void hx_burden_compile(const hxControllerDefinition *definition,
                                     hxBurdenModel *model) {
  model->most = definition->gains.limits.torque;
  model->fade = hx_decay(-definition->period / definition->gait.period);
  model->follow =
      1.0 - hx_decay(-definition->period / (quick * definition->gains.support.weight_time));
}

static inline void hx_burden_reset(hxBurden *burden) { *burden = (hxBurden){1.0, 0.0, 1.0, 0}; }

/* Takes the measured over the modelled weight of this period (C32). */
static inline void hx_burden_weigh(const hxBurdenModel *model, double ratio, hxBurden *burden) {
  burden->heft += model->follow * (hx_clamp(ratio, lightest, heaviest) - burden->heft);
}

/* Advances by one period (C31, C32). needed: largest torque to carry the model's weight [N m];
 * scale: measured over modelled weight, as the support assumes it [1]. */
static inline void hx_burden_step(const hxBurdenModel *model, double needed, double scale,
                                  hxBurden *burden) {
  burden->peak = hx_larger(needed, model->fade * burden->peak);
  burden->overburdened = burden->heft * burden->peak >
                         model->most * (burden->overburdened ? support_helps : support_fails);
  const double allowed = model->most / hx_larger(scale * burden->peak, model->most);
  burden->strength = hx_smaller(
      allowed, hx_larger(full_support * (allowed - no_support) / (full_support - no_support), 0.0));
}

#endif
