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

/* Returns the duty of a leg's motor under a command at the last moment, and in *speed the speed of
 * its joint. */
static double motor_duty(const hxCommand *command, const hxModel *model, const hxState *state,
                         int joint, int leg, double *speed) {
  const double angle = state->moment.angle[joint][leg], w = state->moment.speed[joint][leg];
  const double share = 1.0 - command->weakness[joint][leg],
               per_torque = model->duty_max / model->stall_torque;
  const double limit = share * model->duty_max * command->duty[joint][leg];
  const double free = (1.0 - share) * per_torque * model->back_emf * w; /* without a current */
  double wanted = model->kp * (command->angle[joint][leg] - angle) +
                  model->kd * (command->speed[joint][leg] - w) + command->torque[joint][leg];
  if (model->servo_mode == HX_SERVO_TORQUE) wanted += model->back_emf * w;
  *speed = w;
  const double most = model->current_torque, back = model->back_emf * w;
  wanted = fmax(back - most, fmin(back + most, wanted));
  return fmax(free - limit, fmin(free + limit, wanted * model->duty_max / model->stall_torque));
}

/* Returns the voltage of the supply over servo.voltage, at most 1 (eq. 53): with the duties d, the
 * current is the sum of d (d V - k_t w)/R. */
static double supply_share(const hxCommand *command, const hxModel *model, const hxState *state) {
  const double ratio = model->supply_resistance / model->resistance;
  double squares = 0.0, back = 0.0, speed;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double duty = motor_duty(command, model, state, joint, leg, &speed);
      squares += duty * duty, back += duty * speed;
    }
  const double emf = model->torque_constant * back / model->voltage;
  return fmin(1.0, (1.0 + ratio * emf) / (1.0 + ratio * squares));
}

void hx_command_supply(hxCommand *command, const hxModel *model, const hxState *state) {
  const hxHeat *heat = &model->heat;
  const double per_kelvin = 1.0 / (heat->max - heat->derate);
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int slot = 0; slot < HX_SLOTS; ++slot) {
      const double left = (heat->max - state->measured.winding[joint][slot]) * per_kelvin;
      command->duty[joint][slot] = heat->winding > 0.0 ? fmax(0.0, fmin(1.0, left)) : 1.0;
      if (model->overload_time > 0.0 &&
          fabs(state->firmware.loaded[joint][slot]) > model->overload_time)
        command->duty[joint][slot] *= model->overload_left;
    }
  const int sags = model->supply_resistance > 0.0 && model->servo_drive == HX_DRIVE_MOTOR &&
                   model->servo_mode != HX_SERVO_KINEMATIC;
  command->supply = sags ? supply_share(command, model, state) : 1.0;
}

/* ------------------------------------------------------------------------------------------- bus
 */

static const double bus_margin = 1e-9; /* s  transmissions this early or late are on time */

int hx_has_bus(const hxModel *model) {
  return model->bus_period > 0.0 || model->command_step > 0.0;
}

/* Returns the time of the next transmission, s; without a period the present time. */
static double next_sending(const hxModel *model, const hxState *state) {
  return model->bus_period > 0.0 ? state->bus.start + state->bus.sent * model->bus_period
                                 : state->time;
}

void hx_bus_command(hxCommand *command, const hxModel *model, const hxState *state) {
  if (!hx_has_bus(model)) return;
  if (state->time < next_sending(model, state) - bus_margin) {
    memcpy(command->angle, state->bus.angle, sizeof command->angle);
    memcpy(command->speed, state->bus.speed, sizeof command->speed);
    memcpy(command->torque, state->bus.torque, sizeof command->torque);
    return;
  }
  const double step = model->command_step;
  for (int i = 0; step > 0.0 && i < HX_JOINTS * HX_SLOTS; ++i) {
    double *angle = &command->angle[i / HX_SLOTS][i % HX_SLOTS];
    *angle = step * floor(*angle / step + 0.5);
  }
}

void hx_bus_send(hxCommand *command, const hxModel *model, hxState *state) {
  hx_bus_command(command, model, state);
  memcpy(state->bus.angle, command->angle, sizeof command->angle);
  memcpy(state->bus.speed, command->speed, sizeof command->speed);
  memcpy(state->bus.torque, command->torque, sizeof command->torque);
  if (model->bus_period > 0.0 && state->time >= next_sending(model, state) - bus_margin)
    state->bus.sent =
        floor((state->time + bus_margin - state->bus.start) / model->bus_period) + 1.0;
}

double hx_bus_end(const hxModel *model, const hxState *state, double t_end) {
  if (!(model->bus_period > 0.0)) return t_end;
  const double next = next_sending(model, state);
  return next > state->time && next < t_end - bus_margin ? next : t_end;
}

/* ------------------------------------------------------------------------------------- firmware
 */

void hx_setpoints(hxCommand *command, const hxModel *model, const hxState *state) {
  const hxFirmware *firmware = &state->firmware;
  if (!(model->goal_speed > 0.0)) return;
  for (int i = 0; i < HX_JOINTS * HX_SLOTS; ++i)
    command->angle[i / HX_SLOTS][i % HX_SLOTS] =
        firmware->angle[i / HX_SLOTS][i % HX_SLOTS] +
        firmware->rate[i / HX_SLOTS][i % HX_SLOTS] * (state->time - firmware->time);
}

void hx_follow_goals(hxCommand *command, const hxModel *model, hxState *state, double t_end,
                     hxCommand *ramp) {
  hxFirmware *firmware = &state->firmware;
  const double most = model->goal_speed, h = t_end - state->time;
  hxCommand now = *command;
  if (!(most > 0.0)) return;
  hx_setpoints(&now, model, state);
  for (int i = 0; i < HX_JOINTS * HX_SLOTS; ++i) {
    const int joint = i / HX_SLOTS, slot = i % HX_SLOTS;
    const double left = command->angle[joint][slot] - now.angle[joint][slot];
    const double rate = h > 0.0 ? fmax(-most, fmin(most, left / h)) : 0.0;
    firmware->rate[joint][slot] = ramp->angle[joint][slot] = rate;
  }
  memcpy(command->angle, now.angle, sizeof command->angle);
  memcpy(firmware->angle, now.angle, sizeof firmware->angle);
  firmware->time = state->time;
}

void hx_count_overload(const hxCommand *command, const hxModel *model, hxState *state, double h) {
  if (!(model->overload_time > 0.0)) return;
  for (int i = 0; i < HX_JOINTS * HX_SLOTS; ++i) {
    const int joint = i / HX_SLOTS, slot = i % HX_SLOTS;
    const double wanted =
        model->kp * (command->angle[joint][slot] - state->moment.angle[joint][slot]) +
        model->kd * (command->speed[joint][slot] - state->moment.speed[joint][slot]) +
        command->torque[joint][slot];
    double *loaded = &state->firmware.loaded[joint][slot];
    const double side = copysign(1.0, wanted);
    *loaded = fabs(wanted) >= model->overload_torque ? side * (fmax(side * *loaded, 0.0) + h) : 0.0;
  }
}
