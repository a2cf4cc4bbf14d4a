/* load_adaptation.h - squeeze and width of the stance by the load of the servos. Python:
 * controller/sense/load_adaptation.py. */
#ifndef HX_LOAD_ADAPTATION_H
#define HX_LOAD_ADAPTATION_H

#include "../plane.h"
#include "hexapod/controller.h"
#include <string.h>

typedef struct hxLoadAdaptationModel {
  double rating;  /* N2 m2  square of the continuous torque of a servo */
  double squeeze; /* 1  weight on ground on which feet creep, while all servos are cool */
  int narrows;    /* the gait has a narrow stance */
  double follow_work, follow; /* 1  factors of the smoothings over a period */
} hxLoadAdaptationModel;

typedef struct hxLoadAdaptation {
  double work[HX_LEGS][HX_JOINTS]; /* N2 m2  squares of the torques, smoothed over a gait cycle */
  double heat[HX_LEGS][HX_JOINTS]; /* N2 m2  the same, smoothed over a minute */
  double weight_ratio; /* 1  measured over modelled weight, smoothed over a gait cycle */
  double narrowing;    /* 1  part of the way to the narrow stance */
  double squeeze;      /* 1  weight of the torques in the planned squeeze */
} hxLoadAdaptation;

static const double heat_time = 60.0; /* s  in which a small servo warms up */
/* 1  mean square torque over that of the rating */
static const double cool = 0.8, hot = 1.0;
/* 1  torque needed for the measured weight over torque allowed */
static const double easy = 0.8, hard = 1.0;
/* 1  mean square torque of a gait cycle over that of the rating */
static const double over = 1.0, far_over = 1.2;
/* 1  share of the planned squeeze that is held */
static const double creeps = 0.75, holds = 0.82;
/* 1  weight of the torques when it costs nothing or servos need it */
static const double most_squeeze = 0.95;
static const double modelled = 1.1, heavy = 1.2; /* 1  measured over modelled weight */
/* 1  of the set weight of the squeeze, in the narrow stance */
static const double spared = 0.75;

/* squeeze: weight on ground on which feet creep, while all servos are cool, 0 for none [1];
 * narrows: the gait has a narrow stance. */
static inline void hx_load_adaptation_compile(const hxControllerDefinition *definition,
                                              double squeeze, int narrows,
                                              hxLoadAdaptationModel *model) {
  const double rating = definition->servo.torque_continuous;
  model->rating = rating * rating;
  model->squeeze = squeeze;
  model->narrows = narrows;
  model->follow_work = 1.0 - hx_decay(-definition->period / definition->gait.period);
  model->follow = 1.0 - hx_decay(-definition->period / heat_time);
}

static inline void hx_load_adaptation_reset(const hxLoadAdaptationModel *model,
                                            hxLoadAdaptation *adaptation) {
  memset(adaptation, 0, sizeof *adaptation);
  adaptation->weight_ratio = 1.0;
  adaptation->squeeze = model->squeeze;
}

/* Advances weight and narrowing by one period (C53). ratio: measured over modelled weight [1]. */
static inline void hx_load_adaptation_weigh(const hxLoadAdaptationModel *model, double ratio,
                                            hxLoadAdaptation *adaptation) {
  adaptation->weight_ratio += model->follow_work * (ratio - adaptation->weight_ratio);
  if (model->narrows)
    adaptation->narrowing =
        hx_clamp((adaptation->weight_ratio - modelled) / (heavy - modelled), 0.0, 1.0);
}

/* Returns measured over modelled weight, 1 in the wide stance [1] (C53). */
static inline double hx_load_adaptation_planned_weight_ratio(const hxLoadAdaptation *adaptation) {
  return 1.0 + adaptation->narrowing * (adaptation->weight_ratio - 1.0);
}

/* Advances by one period, after hx_load_adaptation_weigh (C45). torque: feed-forward torques [N m];
 * needed: largest torque that the measured weight needs, over the largest that is allowed [1];
 * squeeze_share: of the planned squeeze, that the ground holds [1]. */
static inline void hx_load_adaptation_step(const hxLoadAdaptationModel *model,
                                           const double torque[HX_LEGS][HX_JOINTS], double needed,
                                           double squeeze_share, hxLoadAdaptation *adaptation) {
  double hottest = 0.0, hardest = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double square = torque[leg][joint] * torque[leg][joint];
      double *work = &adaptation->work[leg][joint], *heat = &adaptation->heat[leg][joint];
      *work += model->follow_work * (square - *work);
      *heat += model->follow * (square - *heat);
      hardest = hx_larger(*work, hardest);
      hottest = hx_larger(*heat, hottest);
    }
  const double warm = hx_larger((hottest / model->rating - cool) / (hot - cool),
                                (hardest / model->rating - over) / (far_over - over)),
               part = hx_larger(warm, hx_larger((needed - easy) / (hard - easy),
                                                (squeeze_share - creeps) / (holds - creeps) *
                                                    (1.0 - adaptation->narrowing)));
  const double least = model->squeeze * (1.0 - spared * adaptation->narrowing),
               more = least > 0.0 ? hx_larger(most_squeeze - least, 0.0) : 0.0;
  adaptation->squeeze = least + more * hx_clamp(part, 0.0, 1.0);
}

#endif
