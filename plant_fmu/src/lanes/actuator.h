/* actuator.h - the servo of a joint: PD control with feed-forward, torque-speed line or motor,
 * friction of motor and gear, and the joint's stops */
#ifndef HX_ACTUATOR_H
#define HX_ACTUATOR_H

#include "../packs/vec3.h"

#ifndef HX_TANGENT
#include "../packs/power.h"
#endif

typedef struct {
  hxReal torque;    /* N m        motor on child */
  hxReal friction;  /* N m        gear on child */
  hxReal stiffness; /* N m/rad    -d torque/d angle, 0 where the torque is clipped */
  hxReal damping;   /* N m s/rad  -d torque/d speed */
  hxReal drag;      /* N m s/rad  -d friction/d speed */
} hxServo;

/* The motor (eq. 12, 48): clip(kp (q_ref - q) + kd (qd_ref - qd) + tau_ff) to its limits. */
typedef struct {
  hxReal torque;    /* N m        motor on child */
  hxReal wanted;    /* N m  before the limits */
  hxReal low, high; /* N m  limits at this speed */
  hxReal load;      /* 1    speed over the no-load speed, of the torque-speed line */
} hxMotor;

/* What a motor gets from its supply: the voltage over servo.voltage, and this times the share of
 * the duty limit that heat leaves (eq. 52, 53); and the share of its limits that a fault leaves. */
typedef struct {
  hxReal supply, limit, strength; /* 1 */
} hxPower;

/* Returns these of a joint's motor. */
static inline hxPower hx_power_of(const hxCommand *command, int joint, int slot) {
  const hxReal supply = hx_splat(command->supply);
  return (hxPower){supply, supply * hx_load(&command->duty[joint][slot]),
                   1.0 - hx_load(&command->weakness[joint][slot])};
}

/* Returns the torque and the limits of a motor whose voltage is limited (eq. 48). The back-EMF
 * lowers the torque of a given voltage; in torque mode the voltage makes up for it. */
static inline hxMotor motor_torque(const hxModel *model, hxReal speed, hxReal wanted,
                                   hxPower power) {
  const hxReal brake = model->back_emf * speed, stall = model->stall_torque * power.limit;
  const hxReal most = hx_splat(model->current_torque);
  const hxReal high = power.strength * hx_clip(most, -stall - brake, stall - brake),
               low = power.strength * hx_clip(-most, -stall - brake, stall - brake);
  if (model->servo_mode != HX_SERVO_TORQUE) wanted = wanted * power.supply - brake;
  return (hxMotor){hx_clip(wanted, low, high), wanted, low, high, hx_splat(0.0)};
}

/* Returns the motor's torque and its limits (eq. 12, 48). */
static inline hxMotor hx_servo_torque(const hxModel *model, hxReal angle, hxReal speed,
                                      hxReal angle_ref, hxReal speed_ref, hxReal torque_ref,
                                      hxPower power) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  const hxReal wanted =
      model->kp * (angle_ref - angle) + model->kd * (speed_ref - speed) + torque_ref;
  if (model->servo_drive == HX_DRIVE_MOTOR) return motor_torque(model, speed, wanted, power);
  const hxReal load = speed * (1.0 / model->speed_max);
  const hxReal most = model->torque_max * power.strength;
  const hxReal high = most * hx_clip(1.0 - load, zero, one);
  const hxReal low = -most * hx_clip(1.0 + load, zero, one);
  return (hxMotor){hx_clip(wanted, low, high), wanted, low, high, load};
}

/* Returns the motor's torque, the gear's Coulomb friction and their derivatives (eq. 12, 48). */
static inline hxServo hx_servo_slopes(const hxModel *model, hxReal angle, hxReal speed,
                                      hxReal angle_ref, hxReal speed_ref, hxReal torque_ref,
                                      hxPower power) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  const hxMotor motor =
      hx_servo_torque(model, angle, speed, angle_ref, speed_ref, torque_ref, power);
  const hxMask free = hx_less(motor.low, motor.wanted) & hx_less(motor.wanted, motor.high);
  /* falling: the torque is limited by the sloping part of the torque-speed line, or the voltage */
  const hxMask falling =
      model->servo_drive == HX_DRIVE_MOTOR
          ? ~free & hx_less(hx_abs(motor.torque), model->current_torque * power.strength)
          : ~free & hx_less(zero, motor.torque * motor.load) & hx_less(hx_abs(motor.load), one);
  const hxReal gain = model->servo_drive == HX_DRIVE_MOTOR ? power.supply : one;
  const hxReal t = hx_tanh(speed * model->per_gear_speed);
  return (hxServo){
      .torque = motor.torque,
      .friction = -model->coulomb_friction * t,
      .stiffness = hx_select(free, model->kp * gain, zero),
      .damping = hx_select(free, model->kd * gain + model->emf_damping,
                           hx_select(falling, model->limit_damping * power.strength, zero)),
      .drag = (model->coulomb_friction / model->gear_speed) * (1.0 - t * t),
  };
}

/* Returns exp(-|speed/w_s|^a), the share of the Stribeck terms (eq. 50). */
static inline hxReal stribeck_share(const hxModel *model, hxReal speed) {
  const hxReal power =
      hx_lanes_pow(hx_abs(speed) * model->per_stribeck_speed, hx_splat(model->stribeck_exponent));
  return 1.0 + hx_expm1(-hx_min(power, hx_splat(40.0)));
}

/* Returns the quadratic term of eq. 50, where the external torque opposes the motor's. */
static inline hxReal quadratic_friction(const hxModel *model, hxReal motor, hxReal external) {
  const hxReal zero = hx_splat(0.0), m = hx_abs(motor), e = hx_abs(external);
  const hxReal weaker = hx_select(hx_less(m, e), model->quadratic_motor * (m * m), zero);
  const hxReal squares = hx_select(hx_less(e, m), model->quadratic_external * (e * e), weaker);
  return hx_select(hx_less(motor * external, zero), squares, zero);
}

/* Returns |a m - b e| of shares a, b >= 0. Where both are 0, its derivatives are those by shares
 * that rise. */
static inline hxReal load_friction(hxNumber a, hxReal m, hxNumber b, hxReal e) {
  if (HX_HAS_SLOPES && hx_re(a) == 0.0 && hx_re(b) == 0.0) return a * hx_abs(m) + b * hx_abs(e);
  return hx_abs(a * m - b * e);
}

/* Sets the friction of a motor and its gear and its derivative, under the external torque on the
 * joint (eq. 49, 50); the motor's torque is set. */
HX_RARE void hx_measured_friction(const hxModel *model, const hxReal *speed, const hxReal *external,
                                  hxServo *servo) {
  const hxReal motor = servo->torque, t = hx_tanh(*speed * model->per_gear_speed);
  hxReal budget = model->coulomb_friction +
                  load_friction(model->motor_load, motor, model->external_load, *external);
  if (model->stribeck) {
    const hxReal load =
        load_friction(model->stribeck_motor, motor, model->stribeck_external, *external);
    budget += stribeck_share(model, *speed) *
              (model->gear_stribeck + load + quadratic_friction(model, motor, *external));
  }
  servo->friction = -(budget * t) - model->gear_viscous * *speed;
  servo->drag = (budget * model->per_gear_speed) * (1.0 - t * t) + model->gear_viscous;
}

/* Returns the current of a motor, A; 0 with the torque-speed line, whose motor is unknown. */
static inline hxReal hx_motor_current(const hxModel *model, hxReal torque) {
  return model->servo_drive == HX_DRIVE_MOTOR ? torque * (1.0 / model->torque_constant)
                                              : hx_splat(0.0);
}

/* Returns the power that a motor takes from its supply, voltage times current, W. */
static inline hxReal hx_electrical_power(const hxModel *model, hxReal torque, hxReal speed) {
  const hxReal current = hx_motor_current(model, torque);
  return model->servo_drive == HX_DRIVE_MOTOR
             ? torque * speed + model->resistance * (current * current)
             : hx_splat(0.0);
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
  const hxStops *stop = &model->joint[joint].stop;
  const hxReal half = hx_load(&stop->half_range[slot]);
  const hxReal from_middle = within_turn(angle - hx_load(&stop->middle[slot]));
  return from_middle - hx_clip(from_middle, -half, half);
}

/* Returns the energy that a joint's stops store, k x^2/2, J. */
static inline hxReal hx_stop_energy(const hxModel *model, int joint, int slot, hxReal angle) {
  const hxReal x = hx_overrun(model, joint, slot, angle);
  return (0.5 * hx_load(&model->joint[joint].stop.stiffness[slot])) * (x * x);
}

/* Returns the torque of the stops, -(k x + c qd), the damper's part limited to the spring's, so
 * that a stop takes and releases a joint without a jump and does not pull (eq. 39). */
static inline hxStop hx_stop_torque(const hxModel *model, int joint, int slot, hxReal angle,
                                    hxReal speed) {
  const hxReal zero = hx_splat(0.0), k = hx_load(&model->joint[joint].stop.stiffness[slot]),
               c = hx_load(&model->joint[joint].stop.damping[slot]);
  const hxReal x = hx_overrun(model, joint, slot, angle);
  const hxReal spring = k * x, limit = hx_abs(spring), wanted = c * speed;
  const hxReal damped = hx_clip(wanted, -limit, limit);
  const hxMask touches = hx_less(zero, limit), free = hx_less(hx_abs(wanted), limit);
  /* a limited damper doubles the spring on the way in and cancels it on the way out */
  const hxReal limited = hx_select(hx_less(zero, x * speed), 2.0 * k, zero);
  return (hxStop){
      .torque = -(spring + damped),
      .damped = damped,
      .stiffness = hx_select(touches, hx_select(free, k, limited), zero),
      .damping = hx_select(free, c, zero),
  };
}

#endif
