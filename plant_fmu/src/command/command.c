/* command.c - commands of servos, a bus' transmissions, setpoints of a firmware, overload, and the
 * supply's voltage; models/actuator.py and models/servos are the readable form */
#include "command.h"

#include <math.h>
#include <string.h>

void hx_command_from_input(hxCommand *command, const hxInput *input, double time) {
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int slot = 0; slot < HX_SLOTS; ++slot) {
      const int leg = slot < HX_LEGS ? slot : 0;
      command->angle[joint][slot] = input->angle_ref[leg][joint];
      command->speed[joint][slot] = input->speed_ref[leg][joint];
      command->torque[joint][slot] = input->torque_ref[leg][joint];
      command->acceleration[joint][slot] = input->acceleration_ref[leg][joint];
      command->weakness[joint][slot] = input->weakness[leg][joint];
    }
  for (int i = 0; i < 3; ++i) {
    command->push_force[i] = input->push_force[i];
    command->push_torque[i] = input->push_torque[i];
  }
  command->supply = 0.0;
  memset(command->duty, 0, sizeof command->duty);
  command->time = time;
}

/* Returns the torque that the servo's law wants at the last moment, N m (eq. 48). */
static double wanted_torque(const hxCommand *command, const hxModel *model, const hxMoment *at,
                            int joint, int slot) {
  return model->kp * (command->angle[joint][slot] - at->angle[joint][slot]) +
         model->kd * (command->speed[joint][slot] - at->speed[joint][slot]) +
         command->torque[joint][slot];
}

/* Returns the share of the duty limit that is left at the temperature of a winding, K (eq. 52). */
static double duty_share(const hxHeat *heat, double winding) {
  const double per_kelvin = 1.0 / (heat->max - heat->derate);
  return heat->winding > 0.0 ? fmax(0.0, fmin(1.0, (heat->max - winding) * per_kelvin)) : 1.0;
}

/* Returns the share of the duty limit that the overload protection leaves after a time of the duty
 * above the overload limit, s (eq. 58). */
static double overload_share(const hxModel *model, double loaded) {
  const int limited = model->overload_time > 0.0 && fabs(loaded) > model->overload_time;
  return limited ? model->overload_left : 1.0;
}

/* Returns the duty of a motor under a command at the last moment, as far as limits of duty and
 * current allow it (eq. 53). */
static double motor_duty(const hxCommand *command, const hxModel *model, const hxMoment *at,
                         int joint, int slot) {
  const double w = at->speed[joint][slot], back = model->back_emf * w, most = model->current_torque;
  const double strength = 1.0 - command->weakness[joint][slot],
               per_torque = model->duty_max / model->stall_torque;
  const double limit = strength * model->duty_max * command->duty[joint][slot];
  const double idle = (1.0 - strength) * per_torque * model->back_emf * w; /* without a current */
  double wanted = wanted_torque(command, model, at, joint, slot);
  if (model->servo_mode == HX_SERVO_TORQUE) wanted += back;
  wanted = fmax(back - most, fmin(back + most, wanted));
  return fmax(idle - limit, fmin(idle + limit, wanted * model->duty_max / model->stall_torque));
}

/* Returns the voltage of the supply over servo.voltage, at most 1 (eq. 53): with the duties d, the
 * current is the sum of d (d V - k_t w)/R. */
static double supply_share(const hxCommand *command, const hxModel *model, const hxMoment *at) {
  const double ratio = model->supply_resistance / model->resistance;
  double squares = 0.0, back = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double duty = motor_duty(command, model, at, joint, leg);
      squares += duty * duty, back += duty * at->speed[joint][leg];
    }
  const double emf = model->torque_constant * back / model->voltage;
  return fmin(1.0, (1.0 + ratio * emf) / (1.0 + ratio * squares));
}

void hx_supply_power(hxCommand *command, const hxModel *model, const hxState *state) {
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int slot = 0; slot < HX_SLOTS; ++slot)
      command->duty[joint][slot] = duty_share(&model->heat, state->measured.winding[joint][slot]) *
                                   overload_share(model, state->firmware.loaded[joint][slot]);
  const int sags = model->supply_resistance > 0.0 && model->servo_drive == HX_DRIVE_MOTOR &&
                   model->servo_mode != HX_SERVO_KINEMATIC;
  command->supply = sags ? supply_share(command, model, &state->moment) : 1.0;
}

/* ---- bus ---- */

static const double bus_margin = 1e-9; /* s  transmissions this early or late are on time */

int hx_has_bus(const hxModel *model) {
  return model->bus_period > 0.0 || model->command_step > 0.0;
}

/* Returns the time of the next transmission, s; without a period the present time. */
static double next_sending(const hxModel *model, const hxState *state) {
  return model->bus_period > 0.0 ? state->bus.start + state->bus.sent * model->bus_period
                                 : state->time;
}

void hx_held_commands(hxCommand *command, const hxModel *model, const hxState *state) {
  if (!hx_has_bus(model)) return;
  if (state->time < next_sending(model, state) - bus_margin) {
    memcpy(command, &state->bus, HX_JOINT_COMMANDS);
    return;
  }
  const double step = model->command_step;
  for (int i = 0; step > 0.0 && i < HX_JOINTS * HX_SLOTS; ++i) {
    double *angle = &command->angle[i / HX_SLOTS][i % HX_SLOTS];
    *angle = step * floor(*angle / step + 0.5);
  }
}

void hx_bus_send(hxCommand *command, const hxModel *model, hxState *state) {
  hx_held_commands(command, model, state);
  memcpy(&state->bus, command, HX_JOINT_COMMANDS);
  if (model->bus_period > 0.0 && state->time >= next_sending(model, state) - bus_margin)
    state->bus.sent =
        floor((state->time + bus_margin - state->bus.start) / model->bus_period) + 1.0;
}

double hx_bus_end(const hxModel *model, const hxState *state, double t_end) {
  if (!(model->bus_period > 0.0)) return t_end;
  const double next = next_sending(model, state);
  return next > state->time && next < t_end - bus_margin ? next : t_end;
}

/* ---- firmware ---- */

/* Returns the speed, rad/s, at which a setpoint follows a commanded angle for a time h, s
 * (eq. 57). */
static double setpoint_rate(const hxModel *model, double setpoint, double goal, double h) {
  const double most = model->goal_speed;
  return h > 0.0 ? fmax(-most, fmin(most, (goal - setpoint) / h)) : 0.0;
}

void hx_setpoints(hxCommand *command, const hxModel *model, const hxState *state) {
  const hxFirmware *firmware = &state->firmware;
  if (!(model->goal_speed > 0.0)) return;
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int slot = 0; slot < HX_SLOTS; ++slot)
      command->angle[joint][slot] = firmware->angle[joint][slot] +
                                    firmware->rate[joint][slot] * (state->time - firmware->time);
}

void hx_follow_goals(const hxCommand *goal, const hxModel *model, hxState *state, double t_end) {
  hxFirmware *firmware = &state->firmware;
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int slot = 0; slot < HX_SLOTS; ++slot) {
      double *setpoint = &firmware->angle[joint][slot], *rate = &firmware->rate[joint][slot];
      *setpoint += *rate * (state->time - firmware->time);
      *rate = setpoint_rate(model, *setpoint, goal->angle[joint][slot], t_end - state->time);
    }
  firmware->time = state->time;
}

void hx_count_overload(const hxCommand *command, const hxModel *model, hxState *state, double h) {
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int slot = 0; slot < HX_SLOTS; ++slot) {
      const double wanted = wanted_torque(command, model, &state->moment, joint, slot);
      double *loaded = &state->firmware.loaded[joint][slot];
      const double side = copysign(1.0, wanted);
      *loaded =
          fabs(wanted) >= model->overload_torque ? side * (fmax(side * *loaded, 0.0) + h) : 0.0;
    }
}
