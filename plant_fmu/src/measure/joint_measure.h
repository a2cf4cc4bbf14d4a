/* joint_measure.h - measurements of a joint along a step (eq. 28): positive and negative work,
 * squared torque, heat of its servo */
#ifndef HX_JOINT_MEASURE_H
#define HX_JOINT_MEASURE_H

#include "works.h"

/* Warms winding and housing of a joint's servo by the heat of a step, J (eq. 52), by the
 * trapezoidal rule: 2 C (T_m - T_0)/h = powers at the mean temperatures T_m. */
static inline void warm_servo(const hxPath *path, int joint, int slot, hxReal copper, hxReal gear,
                              hxMeasured *measured) {
  const hxHeat *heat = &path->model->heat;
  const double twice = 2.0 / path->h, g = heat->to_housing, k = heat->to_air;
  const double a = twice * heat->winding + g, b = twice * heat->housing + g + k;
  const double inverse = 1.0 / (a * b - g * g), per_step = 1.0 / path->h;
  const hxReal winding = hx_load(&measured->winding[joint][slot]),
               housing = hx_load(&measured->housing[joint][slot]);
  const hxReal of_winding = per_step * copper + (twice * heat->winding) * winding;
  const hxReal of_housing = per_step * gear + (twice * heat->housing) * housing + k * heat->air;
  const hxReal mean_winding = inverse * (b * of_winding + g * of_housing),
               mean_housing = inverse * (g * of_winding + a * of_housing);
  hx_store(&measured->winding[joint][slot], 2.0 * mean_winding - winding);
  hx_store(&measured->housing[joint][slot], 2.0 * mean_housing - housing);
}

/* Measures one joint: positive and negative work, whose difference is the step's work, and the
 * integral of the squared torque, which it returns, N2 m2 s. */
static inline hxReal measure_joint(const hxPath *path, int joint, int slot, hxReal work,
                                   hxReal mean_torque, hxMeasured *measured) {
  const hxModel *model = path->model;
  const hxReal zero = hx_splat(0.0), h = hx_splat(path->h), per_step = hx_splat(1.0 / path->h);
  const hxReal angle = hx_load(&path->from->angle[joint][slot]),
               rise = within_turn(hx_load(&path->to->angle[joint][slot]) - angle);
  const hxReal slope_from = h * hx_load(&path->from->speed[joint][slot]),
               slope_to = h * hx_load(&path->to->speed[joint][slot]);
  hxReal positive = zero, negative = zero, squared = zero;
  for (int node = 0; node <= INTERVALS; node += MOTOR_STRIDE) {
    const hxCommand *command = path->command[node];
    const hxCubic q = cubic(angle, slope_from, rise, slope_to, hx_splat((double)node / INTERVALS));
    const hxReal speed = per_step * q.rate;
    const hxReal weight = hx_splat(path->h * motor_weight[node]);
    hxReal torque = mean_torque; /* a kinematic drive has no torque law */
    if (model->servo_mode != HX_SERVO_KINEMATIC)
      torque =
          hx_servo_torque(model, within_turn(q.value), speed, hx_load(&command->angle[joint][slot]),
                          hx_load(&command->speed[joint][slot]),
                          hx_load(&command->torque[joint][slot]), hx_power_of(command, joint, slot))
              .torque;
    positive += weight * hx_max(torque * speed, zero);
    negative += weight * hx_max(-(torque * speed), zero);
    squared += weight * (torque * torque);
  }
  /* the difference from the step's work goes to the larger part */
  const hxReal rest = work - (positive - negative);
  const hxMask drives = hx_less(negative, positive);
  positive += hx_select(drives, rest, zero);
  negative -= hx_select(drives, zero, rest);
  const hxReal below = hx_min(positive, negative); /* no part becomes negative */
  const hxReal excess = hx_min(below, zero);
  hx_store(&measured->positive_work[joint][slot],
           hx_load(&measured->positive_work[joint][slot]) + (positive - excess));
  hx_store(&measured->negative_work[joint][slot],
           hx_load(&measured->negative_work[joint][slot]) + (negative - excess));
  hx_store(&measured->torque_squared[joint][slot],
           hx_load(&measured->torque_squared[joint][slot]) + squared);
  return squared;
}

/* Warms the servos of a pack of legs; squared: integrals of their squared torques. */
HX_RARE void warm_servos(const hxPath *path, int pack, const hxImpulses *impulse,
                         const hxReal squared[HX_JOINTS], hxMeasured *measured) {
  const hxModel *model = path->model;
  const double per_square = model->resistance / (model->torque_constant * model->torque_constant);
  const int slot = pack * HX_LANES;
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    const hxReal speed = mean_speed(path, joint, slot);
    const hxReal gear = -impulse->gear[joint][pack] * speed;
    warm_servo(path, joint, slot, per_square * squared[joint], gear, measured);
  }
}

#endif
