#include "actuator.h"

static const double gear_speed = 0.05; /* rad/s, where the gear's dry friction saturates */

HX_LOCAL hxServo hx_servo_torque(const hxModel *model, hxReal angle, hxReal speed, hxReal angle_ref, hxReal speed_ref, hxReal torque_ref) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  const hxReal wanted = model->kp * (angle_ref - angle) + model->kd * (speed_ref - speed) + torque_ref;
  const hxReal load = speed * (1.0 / model->speed_max);
  const hxReal high = model->torque_max * hx_clip(1.0 - load, zero, one);
  const hxReal low = -model->torque_max * hx_clip(1.0 + load, zero, one);
  const hxReal torque = hx_clip(wanted, low, high);
  const hxMask free = hx_less(low, wanted) & hx_less(wanted, high);
  const hxReal t = hx_tanh(speed * (1.0 / gear_speed));
  return (hxServo){
      .torque = torque,
      .friction = -model->coulomb_friction * t,
      .stiffness = hx_select(free, hx_splat(model->kp), zero),
      .damping = hx_select(free, hx_splat(model->kd), zero) + (model->coulomb_friction / gear_speed) * (1.0 - t * t),
  };
}
