/* command.h - turns steps of the body command into smooth changes (C1). Python:
 * controller/walk/command.py. */
#ifndef HX_COMMAND_H
#define HX_COMMAND_H

#include "../plane.h"
#include <string.h>

enum { HX_COMMANDS = 6 }; /* vx vy yaw_rate height roll pitch */

/* Smooths steps of the command (C1): a cubic from the present value and rate to the new value with
 * rate 0. */
typedef struct hxCommandRampModel {
  double duration, period; /* s */
  int64_t end;             /* steps that a change takes */
} hxCommandRampModel;

typedef struct hxCommandRamp {
  double target[HX_COMMANDS];
  double cubic[4][HX_COMMANDS];
  int64_t steps; /* periods since the target was set */
} hxCommandRamp;

static inline void hx_command_ramp_compile(double duration, double period,
                                           hxCommandRampModel *model) {
  model->duration = duration;
  model->period = period;
  model->end = (int64_t)(duration / period);
  while ((double)model->end * period < duration) ++model->end;
}

static inline void hx_command_ramp_reset(const hxCommandRampModel *model, hxCommandRamp *ramp) {
  memset(ramp, 0, sizeof *ramp);
  ramp->steps = model->end;
}

static inline int hx_command_ramp_settled(const hxCommandRampModel *model,
                                          const hxCommandRamp *ramp) {
  return ramp->steps >= model->end;
}

/* Returns whether the body is commanded to move, not only to change its posture. */
static inline int hx_command_ramp_moves(const hxCommandRamp *ramp) {
  return ramp->target[0] != 0.0 || ramp->target[1] != 0.0 || ramp->target[2] != 0.0;
}

/* Sets the cubic from a value and rate to the target at rest (C1). */
static inline void bend(double duration, const double value[HX_COMMANDS],
                        const double rate[HX_COMMANDS], hxCommandRamp *ramp) {
  for (int i = 0; i < HX_COMMANDS; ++i) {
    const double gap = ramp->target[i] - value[i], slope = rate[i] * duration;
    ramp->cubic[0][i] = value[i];
    ramp->cubic[1][i] = slope;
    ramp->cubic[2][i] = 3.0 * gap - 2.0 * slope;
    ramp->cubic[3][i] = slope - 2.0 * gap;
  }
}

/* Computes the command a number of periods ahead, and its rate per second. */
static inline void hx_command_ramp_ahead(const hxCommandRampModel *model, const hxCommandRamp *ramp,
                                         int64_t steps, double value[HX_COMMANDS],
                                         double rate[HX_COMMANDS]) {
  const int64_t number = ramp->steps + steps;
  const double x = (double)number * model->period / model->duration;
  const int under_way = number < model->end;
  for (int i = 0; i < HX_COMMANDS; ++i) {
    const double c0 = ramp->cubic[0][i], c1 = ramp->cubic[1][i], c2 = ramp->cubic[2][i],
                 c3 = ramp->cubic[3][i];
    value[i] = under_way ? c0 + x * (c1 + x * (c2 + x * c3)) : ramp->target[i];
    rate[i] = under_way ? (c1 + x * (2.0 * c2 + 3.0 * x * c3)) / model->duration : 0.0;
  }
}

/* Sets the command to go to. Returns whether it is a new one. */
static inline int hx_command_ramp_aim(const hxCommandRampModel *model,
                                      const double target[HX_COMMANDS], hxCommandRamp *ramp) {
  double value[HX_COMMANDS], rate[HX_COMMANDS];
  int same = 1;
  for (int i = 0; i < HX_COMMANDS; ++i) same &= target[i] == ramp->target[i];
  if (same) return 0;
  hx_command_ramp_ahead(model, ramp, 0, value, rate);
  memcpy(ramp->target, target, sizeof ramp->target);
  bend(model->duration, value, rate, ramp);
  ramp->steps = 0;
  return 1;
}

/* Continues the change of another ramp, from its present value and rate, in the model's own time.
 */
static inline void hx_command_ramp_carry(const hxCommandRampModel *model,
                                         const hxCommandRampModel *before, hxCommandRamp *ramp) {
  double value[HX_COMMANDS], rate[HX_COMMANDS];
  hx_command_ramp_ahead(before, ramp, 0, value, rate);
  ramp->steps = hx_command_ramp_settled(before, ramp) ? model->end : 0;
  bend(model->duration, value, rate, ramp);
}

#endif
