/* fade.h - lets joint commands go on without a jump when the control changes. Python:
 * controller/walk/fade.py. */
#ifndef HX_FADE_H
#define HX_FADE_H

#include "kinematics.h"

typedef struct hxFadeModel {
  double period; /* s */
  int64_t steps; /* that a transition takes */
} hxFadeModel;

/* What is added to the joint commands of the present control: it goes to 0. */
typedef struct hxFade {
  int64_t left; /* steps of the transition; 0: none */
  /* rad, rad/s, N m   at the begin of the transition; before its first step, the commands that the
   * control before would give at that step */
  double angle[HX_LEGS][HX_JOINTS], speed[HX_LEGS][HX_JOINTS], torque[HX_LEGS][HX_JOINTS];
} hxFade;

static const double fade_time = 0.4; /* s  duration of a transition */

static inline void hx_fade_compile(double period, hxFadeModel *model) {
  const double steps = fmax(nearbyint(fade_time / period), 1.0);
  model->period = period;
  model->steps = (int64_t)steps;
}

/* Begins a transition from the commands of the last step, continued by a period. */
HX_RARE void hx_fade_begin(const hxFadeModel *model, const hxControllerOutput *last, hxFade *fade) {
  fade->left = model->steps;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double speed = last->speed_ref[leg][joint];
      fade->angle[leg][joint] = last->angle_ref[leg][joint] + speed * model->period;
      fade->speed[leg][joint] = speed;
      fade->torque[leg][joint] = last->torque_ref[leg][joint];
    }
}

/* Computes the distances of the commands of the control before from those of the present one. */
HX_RARE void compare(const hxControllerOutput *output, hxFade *fade) {
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      fade->angle[leg][joint] -= output->angle_ref[leg][joint];
      fade->speed[leg][joint] -= output->speed_ref[leg][joint];
      fade->torque[leg][joint] -= output->torque_ref[leg][joint];
    }
}

/* Adds to the commands of a step what is left of their distance from those of the control before,
 * during a transition. */
HX_RARE void hx_fade_step(const hxFadeModel *model, const hxLegSolver leg[HX_LEGS], hxFade *fade,
                          hxControllerOutput *output) {
  if (fade->left == model->steps) compare(output, fade);
  /* the cubic of C1 from a distance and its rate to 0, and its derivatives */
  const double time = (double)model->steps * model->period,
               x = (double)(model->steps - fade->left) / (double)model->steps, rest = 1.0 - x;
  const double part = rest * rest * (1.0 + 2.0 * x), slope = x * rest * rest * time;
  const double part_rate = -6.0 * x * rest / time, slope_rate = rest * (1.0 - 3.0 * x);
  const double part_bend = (12.0 * x - 6.0) / (time * time), slope_bend = (6.0 * x - 4.0) / time;
  for (int k = 0; k < HX_LEGS; ++k)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double gap = fade->angle[k][joint], rate = fade->speed[k][joint];
      const double angle = output->angle_ref[k][joint] + part * gap + slope * rate;
      output->angle_ref[k][joint] =
          hx_clamp(angle, leg[k].angle_min[joint], leg[k].angle_max[joint]);
      output->speed_ref[k][joint] += part_rate * gap + slope_rate * rate;
      output->torque_ref[k][joint] += part * fade->torque[k][joint];
      output->acceleration_ref[k][joint] += part_bend * gap + slope_bend * rate;
    }
  --fade->left;
}

#endif
