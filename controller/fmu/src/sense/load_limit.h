/* load_limit.h - how much of the robot's weight its servos can carry, and the resulting limits.
 * Python: controller/sense/load_limit.py. */
#ifndef HX_LOAD_LIMIT_H
#define HX_LOAD_LIMIT_H

#include "../plane.h"
#include "hexapod/controller.h"

typedef struct hxLoadLimitModel {
  double most;         /* N m  largest torque that a servo may be commanded */
  double fade, follow; /* 1  factors of the smoothings over a period */
} hxLoadLimitModel;

typedef struct hxLoadLimit {
  double weight_ratio; /* 1    measured over modelled weight */
  /* N m  largest torque of a joint that carries the model's weight, over about a gait cycle */
  double peak;
  /* 1  factor of the support, below 1 so that no servo exceeds its torque limit */
  double strength;
  int overloaded; /* the robot is far too heavy: kinematic control */
} hxLoadLimit;

/* 1  of the time in which the support follows the weight, for the measured weight */
static const double quick = 0.2;
/* 1  part of the needed torque that servos may give */
static const double no_support = 0.54, full_support = 0.84;
/* 1  of the allowed torque, needed to carry the measured weight */
static const double support_helps = 1.35, support_fails = 1.5;
/* 1  measured over modelled weight; values outside are not taken as weights */
static const double lightest = 0.5, heaviest = 4.0;

static inline void hx_load_limit_compile(const hxControllerDefinition *definition,
                                         hxLoadLimitModel *model) {
  model->most = definition->gains.limits.torque;
  model->fade = hx_decay(-definition->period / definition->gait.period);
  model->follow =
      1.0 - hx_decay(-definition->period / (quick * definition->gains.support.weight_time));
}

static inline void hx_load_limit_reset(hxLoadLimit *limit) {
  *limit = (hxLoadLimit){1.0, 0.0, 1.0, 0};
}

/* Takes the measured over the modelled weight of this period (C32). */
static inline void hx_load_limit_weigh(const hxLoadLimitModel *model, double ratio,
                                       hxLoadLimit *limit) {
  limit->weight_ratio +=
      model->follow * (hx_clamp(ratio, lightest, heaviest) - limit->weight_ratio);
}

/* Advances by one period (C31, C32). needed: largest torque to carry the model's weight [N m];
 * scale: measured over modelled weight, as the support assumes it [1]. */
static inline void hx_load_limit_step(const hxLoadLimitModel *model, double needed, double scale,
                                      hxLoadLimit *limit) {
  limit->peak = hx_larger(needed, model->fade * limit->peak);
  limit->overloaded = limit->weight_ratio * limit->peak >
                      model->most * (limit->overloaded ? support_helps : support_fails);
  const double allowed = model->most / hx_larger(scale * limit->peak, model->most);
  limit->strength = hx_smaller(
      allowed, hx_larger(full_support * (allowed - no_support) / (full_support - no_support), 0.0));
}

#endif
