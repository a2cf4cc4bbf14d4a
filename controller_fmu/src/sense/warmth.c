#include "warmth.h"

#include <string.h>

#include "../plane.h"

static const double heat_time = 60.0; /* s, in which a small servo warms up */
/* 1, mean square torque over that of the rating */
static const double cool = 0.8, hot = 1.0;
/* 1, torque needed for the measured weight over torque allowed */
static const double easy = 0.8, hard = 1.0;
static const double most_squeeze =
    0.95; /* 1, weight of the torques when a servo is hot or short of torque */

void hx_warmth_compile(const hxControllerDefinition *definition, hxWarmthModel *model) {
  const double rating = definition->servo.torque_continuous,
               squeeze = definition->parts.support ? definition->parts.squeeze : 0.0;
  model->rating = rating * rating;
  model->squeeze = squeeze;
  model->more = squeeze > 0.0 ? fmax(most_squeeze - squeeze, 0.0) : 0.0;
  model->follow = 1.0 - hx_decay(-definition->period / heat_time);
}

void hx_warmth_reset(const hxWarmthModel *model, hxWarmth *warmth) {
  memset(warmth, 0, sizeof *warmth);
  warmth->squeeze = model->squeeze;
}

void hx_warmth_step(const hxWarmthModel *model, const double torque[HX_LEGS][HX_JOINTS],
                    double needed, hxWarmth *warmth) {
  double worst = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      double *heat = &warmth->heat[leg][joint];
      *heat += model->follow * (torque[leg][joint] * torque[leg][joint] - *heat);
      worst = fmax(worst, *heat);
    }
  const double part =
      fmax((worst / model->rating - cool) / (hot - cool), (needed - easy) / (hard - easy));
  warmth->squeeze = model->squeeze + model->more * hx_clamp(part, 0.0, 1.0);
}
