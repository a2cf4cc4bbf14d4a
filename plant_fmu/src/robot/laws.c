/* laws.c - compiles the constants of friction, soil, servo, gear and stops */
#include "robot.h"

#include <math.h>
#include <string.h>

#include "../contact_law.h"
#include "../ground/soil.h"
#include "../ground/surface.h"

static const double load_share = 0.01; /* 1  of the weight; feet with more count their slip */

double hx_weight(const hxDefinition *d) {
  double mass = d->torso.mass;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) mass += d->leg[leg].link[joint].mass;
  return mass * sqrt(d->gravity[0] * d->gravity[0] + d->gravity[1] * d->gravity[1] +
                     d->gravity[2] * d->gravity[2]);
}

/* Copies friction and its choices. Feet without friction resist neither spin nor rolling. */
static void compile_friction(hxModel *model, const hxDefinition *d) {
  const int rubs = hx_friction_kind(d->friction.law).has_friction;
  model->friction_law = d->friction.law, model->mu = d->friction.mu,
  model->slope = d->friction.slope;
  model->presliding = d->friction.presliding, model->bristle_damping = d->friction.bristle_damping;
  model->static_rise = fmax(d->friction.mu_static - d->friction.mu, 0.0),
  model->per_stribeck = 1.0 / d->friction.stribeck_speed;
  model->viscous = rubs ? d->friction.viscous : 0.0;
  model->spin_radius = d->friction.spin_radius, model->rolling_radius = d->friction.rolling_radius;
  /* materials of a grid may have static friction of their own */
  model->velocity_terms = rubs && (model->static_rise > 0.0 || model->viscous > 0.0 ||
                                   d->terrain.kind == HX_TERRAIN_GRID);
  model->spin_friction = rubs && model->spin_radius > 0.0;
  model->roll_friction = rubs && model->rolling_radius > 0.0;
}

/* Computes the constants of the definition's soil; the terrain is known. */
static void compile_soil(hxModel *model, const hxDefinition *d) {
  hxSoil soil;
  model->pad_radius = d->foot_pad_radius;
  hx_soil_compile(&d->soil, d->foot_radius, d->foot_pad_radius, &soil);
  memcpy(model->soil, &soil, sizeof soil);
  const double on_grid = model->terrain ? hx_terrain_shear_displacement(model->terrain) : 0.0;
  model->has_soil = d->soil.law != HX_SOIL_NONE || on_grid > 0.0;
  model->bristle_length = d->friction.presliding;
  if (d->soil.law != HX_SOIL_NONE)
    model->bristle_length = d->soil.shear_displacement;
  else if (on_grid > 0.0 && !hx_friction_kind(d->friction.law).has_bristles)
    model->bristle_length = on_grid;
}

/* Copies the constants of the motors' heat and supply. */
static void compile_supply(hxModel *model, const hxDefinition *d) {
  model->heat =
      (hxHeat){.winding = d->servo.drive == HX_DRIVE_MOTOR ? d->servo.winding_capacity : 0.0,
               .housing = d->servo.housing_capacity,
               .to_housing = 1.0 / d->servo.winding_to_housing,
               .to_air = 1.0 / d->servo.housing_to_air,
               .air = d->servo.air_temperature,
               .start = d->servo.start_temperature,
               .derate = d->servo.derate_temperature,
               .max = d->servo.temperature_max};
  model->voltage = d->servo.voltage, model->duty_max = d->servo.duty_max;
  model->supply_resistance = d->servo.supply_resistance;
  if (d->servo.mode == HX_SERVO_KINEMATIC) return;
  model->bus_period = d->servo.bus_period, model->command_step = d->servo.command_step;
  model->goal_speed = d->servo.goal_speed_max;
  if (d->servo.drive != HX_DRIVE_MOTOR) return;
  model->overload_time = d->servo.overload_time;
  model->overload_left = d->servo.overload_left / d->servo.duty_max;
  model->overload_torque = d->servo.overload_duty / d->servo.duty_max * model->stall_torque;
}

static const double lock_yield =
    1e-3;                             /* rad  of a locked joint, under its motor's largest torque */
static const double lock_time = 2e-3; /* s    damping of a lock over its stiffness */

/* Computes the constants of the servos' motors, and of the joints' stops and locks. */
static void compile_servo(hxModel *model, const hxDefinition *d) {
  const int follows = d->servo.mode == HX_SERVO_POSITION, motor = d->servo.drive == HX_DRIVE_MOTOR;
  model->servo_mode = d->servo.mode, model->servo_drive = d->servo.drive;
  model->kp = follows ? d->servo.kp : 0.0, model->kd = follows ? d->servo.kd : 0.0;
  model->torque_max = d->servo.torque_max, model->speed_max = d->servo.speed_max;
  model->emf_damping = 0.0, model->limit_damping = model->torque_max / model->speed_max;
  model->torque_constant = d->servo.torque_constant, model->resistance = d->servo.resistance;
  model->rotor_inertia = d->servo.rotor_inertia;
  model->current_torque = 1e300; /* without a limit it changes no bit */
  if (motor) {
    if (d->servo.current_max > 0.0)
      model->current_torque = d->servo.torque_constant * d->servo.current_max;
    const double per_volt = d->servo.torque_constant / d->servo.resistance;
    model->stall_torque = per_volt * d->servo.duty_max * d->servo.voltage;
    model->back_emf = d->servo.torque_constant * per_volt;
    model->limit_damping = model->back_emf;
    if (follows) model->emf_damping = model->back_emf;
  }
  compile_supply(model, d);
  model->lock_stiffness = (motor ? model->stall_torque : model->torque_max) / lock_yield;
  model->lock_damping = lock_time * model->lock_stiffness;
  model->stops = d->servo.mode != HX_SERVO_KINEMATIC && d->servo.stop_stiffness > 0.0;
}

/* Returns whether the gears have Stribeck terms, and in *measured whether they have more than
 * Coulomb friction. */
static int gear_terms(const hxDefinition *d, int *measured) {
  const int stribeck =
      d->servo.stribeck_friction > 0.0 || d->servo.stribeck_motor_load_friction > 0.0 ||
      d->servo.stribeck_external_load_friction > 0.0 || d->servo.quadratic_motor_friction > 0.0 ||
      d->servo.quadratic_external_friction > 0.0;
  *measured = stribeck || d->servo.viscous_friction > 0.0 || d->servo.motor_load_friction > 0.0 ||
              d->servo.external_load_friction > 0.0;
  return stribeck;
}

/* Copies the constants of the gears' friction. */
static void compile_gear(hxModel *model, const hxDefinition *d) {
  model->stribeck = gear_terms(d, &model->measured_friction);
  model->coulomb_friction = d->servo.coulomb_friction;
  model->gear_speed = d->servo.friction_speed, model->per_gear_speed = 1.0 / model->gear_speed;
  model->gear_viscous = d->servo.viscous_friction;
  model->gear_stribeck = d->servo.stribeck_friction;
  model->motor_load = d->servo.motor_load_friction;
  model->external_load = d->servo.external_load_friction;
  model->stribeck_motor = d->servo.stribeck_motor_load_friction;
  model->stribeck_external = d->servo.stribeck_external_load_friction;
  model->quadratic_motor = d->servo.quadratic_motor_friction;
  model->quadratic_external = d->servo.quadratic_external_friction;
  model->per_stribeck_speed = 1.0 / d->servo.stribeck_speed;
  model->stribeck_exponent = d->servo.stribeck_exponent;
}

void hx_laws_compile(hxModel *model, const hxDefinition *d) {
  model->contact_law = d->contact.law, model->stiffness = d->contact.stiffness;
  model->damping_scale = hx_contact(d->contact.law)->scale(d);
  model->impact_speed_floor = d->contact.impact_speed_floor;
  for (int i = 0; i < 3; ++i) model->gravity[i] = d->gravity[i];
  model->alpha = d->baumgarte.alpha, model->beta = d->baumgarte.beta;
  compile_friction(model, d);
  compile_servo(model, d);
  compile_gear(model, d);
  model->spin = d->servo.gear_ratio != 0.0;
  if (model->spin) model->spin_inertia = d->servo.rotor_inertia / d->servo.gear_ratio;
  model->terrain_kind = d->terrain.kind;
  model->method = d->solver.method, model->step = d->solver.step;
  model->tolerance = d->solver.tolerance, model->step_max = d->solver.step_max,
  model->projection = d->solver.projection;
  compile_soil(model, d);
  model->load_threshold = load_share * hx_weight(d);
}
