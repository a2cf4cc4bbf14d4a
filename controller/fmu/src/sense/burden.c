#include "burden.h"

#include "../plane.h"

/* 1, of the time in which the support follows the weight, for the measured weight */
static const double quick = 0.2;
/* 1, part of the needed torque that servos may give */
static const double no_support = 0.54, full_support = 0.84;
/* 1, of the allowed torque, needed to carry the measured weight */
static const double support_helps = 1.35, support_fails = 1.5;
/* 1, measured over modelled weight; values outside are not taken as weights */
static const double lightest = 0.5, heaviest = 4.0;

void hx_burden_compile(const hxControllerDefinition *definition, hxBurdenModel *model) {
  model->most = definition->gains.limits.torque;
  model->fade = hx_decay(-definition->period / definition->gait.period);
  model->follow =
      1.0 - hx_decay(-definition->period / (quick * definition->gains.support.weight_time));
}

void hx_burden_reset(hxBurden *burden) { *burden = (hxBurden){1.0, 0.0, 1.0, 0}; }

void hx_burden_weigh(const hxBurdenModel *model, double ratio, hxBurden *burden) {
  burden->heft += model->follow * (hx_clamp(ratio, lightest, heaviest) - burden->heft);
}

void hx_burden_step(const hxBurdenModel *model, double needed, double scale, hxBurden *burden) {
  burden->peak = hx_larger(needed, model->fade * burden->peak);
  burden->overburdened = burden->heft * burden->peak >
                         model->most * (burden->overburdened ? support_helps : support_fails);
  const double allowed = model->most / hx_larger(scale * burden->peak, model->most);
  burden->strength = hx_smaller(
      allowed, hx_larger(full_support * (allowed - no_support) / (full_support - no_support), 0.0));
}
