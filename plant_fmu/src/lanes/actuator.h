/* actuator.h - the servo of a joint: PD control with feed-forward, torque-speed line, gear
 * friction, and the joint's stops */
#ifndef HX_ACTUATOR_H
#define HX_ACTUATOR_H

#include "vec3.h"

typedef struct {
  hxReal torque;    /* N m        motor on child */
  hxReal friction;  /* N m        gear on child */
  hxReal stiffness; /* N m/rad    -d torque/d angle, 0 where the torque is clipped */
  hxReal damping;   /* N m s/rad  -d torque/d speed */
  hxReal drag;      /* N m s/rad  -d friction/d speed */
} hxServo;

static const double hx_gear_speed =
    0.05; /* rad/s  speed at which the gear's dry friction saturates */

/* The motor (eq. 12): clip(kp (q_ref - q) + kd (qd_ref - qd) + tau_ff) to the torque-speed line. */
typedef struct {
  hxReal torque;    /* N m        motor on child */
  hxReal wanted;    /* N m  before the limits */
  hxReal low, high; /* N m  limits at this speed */
  hxReal load;      /* 1    speed over the no-load speed */
} hxMotor;

/* Returns the motor's torque and its limits (eq. 12). */
static inline hxMotor hx_motor_torque(const hxModel *model, hxReal angle, hxReal speed,
                                      hxReal angle_ref, hxReal speed_ref, hxReal torque_ref) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  const hxReal wanted =
      model->kp * (angle_ref - angle) + model->kd * (speed_ref - speed) + torque_ref;
  const hxReal load = speed * (1.0 / model->speed_max);
  const hxReal high = model->torque_max * hx_clip(1.0 - load, zero, one);
  const hxReal low = -model->torque_max * hx_clip(1.0 + load, zero, one);
  return (hxMotor){hx_clip(wanted, low, high), wanted, low, high, load};
}

/* Returns the motor's torque, the gear's -tau_c tanh(qd / 0.05) and their derivatives (eq. 12). */
static inline hxServo hx_servo_torque(const hxModel *model, hxReal angle, hxReal speed,
                                      hxReal angle_ref, hxReal speed_ref, hxReal torque_ref) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  const hxMotor motor = hx_motor_torque(model, angle, speed, angle_ref, speed_ref, torque_ref);
  const hxMask free = hx_less(motor.low, motor.wanted) & hx_less(motor.wanted, motor.high);
  /* falling: the torque is limited by the sloping part of the torque-speed line */
  const hxMask falling =
      ~free & hx_less(zero, motor.torque * motor.load) & hx_less(hx_abs(motor.load), one);
  const hxReal t = hx_tanh(speed * (1.0 / hx_gear_speed));
  return (hxServo){
      .torque = motor.torque,
      .friction = -model->coulomb_friction * t,
      .stiffness = hx_select(free, hx_splat(model->kp), zero),
      .damping =
          hx_select(free, hx_splat(model->kd),
                    hx_select(falling, hx_splat(model->torque_max / model->speed_max), zero)),
      .drag = (model->coulomb_friction / hx_gear_speed) * (1.0 - t * t),
  };
}

static const double half_turn = 3.14159265358979323846;

/* Returns the angle in [-pi, pi], of an angle at most one turn outside. */
static inline hxReal within_turn(hxReal angle) {
  const hxReal low = hx_select(hx_less(hx_splat(half_turn), angle), angle - 2.0 * half_turn, angle);
  return hx_select(hx_less(low, hx_splat(-half_turn)), low + 2.0 * half_turn, low);
}

/* A joint's stops (eq. 39). */
typedef struct {
  hxReal torque;    /* N m        stop on child */
  hxReal damped;    /* N m        the damper's part of -torque */
  hxReal stiffness; /* N m/rad    -d torque/d angle */
  hxReal damping;   /* N m s/rad  -d torque/d speed */
} hxStop;

/* Returns how far a joint is past its stops, rad: > 0 above angle_max, < 0 below angle_min. It is
 * measured from the middle between the stops, so that a joint may pass pi. */
static inline hxReal hx_overrun(const hxModel *model, int joint, int slot, hxReal angle) {
  const hxReal half = hx_load(&model->joint[joint].half_range[slot]);
  const hxReal from_middle = within_turn(angle - hx_load(&model->joint[joint].middle[slot]));
  return from_middle - hx_clip(from_middle, -half, half);
}

/* Returns the torque of the stops, -(k x + c qd), the damper's part limited to the spring's, so
 * that a stop takes and releases a joint without a jump and does not pull (eq. 39). */
static inline hxStop hx_stop_torque(const hxModel *model, int joint, int slot, hxReal angle,
                                    hxReal speed) {
  const hxReal zero = hx_splat(0.0), k = hx_splat(model->stop_stiffness);
  const hxReal x = hx_overrun(model, joint, slot, angle);
  const hxReal spring = k * x, limit = hx_abs(spring), wanted = model->stop_damping * speed;
  const hxReal damped = hx_clip(wanted, -limit, limit);
  const hxMask touches = hx_less(zero, limit), free = hx_less(hx_abs(wanted), limit);
  /* a limited damper doubles the spring on the way in and cancels it on the way out */
  const hxReal limited = hx_select(hx_less(zero, x * speed), 2.0 * k, zero);
  return (hxStop){
      .torque = -(spring + damped),
      .damped = damped,
      .stiffness = hx_select(touches, hx_select(free, k, limited), zero),
      .damping = hx_select(free, hx_splat(model->stop_damping), zero),
  };
}

#endif
