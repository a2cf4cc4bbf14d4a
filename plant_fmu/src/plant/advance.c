/* advance.c - hx_plant_step: a call in parts, from one transmission of the bus to the next */
#include <math.h>
#include <string.h>

#include "../command/command.h"
#include "../kernel.h"
#include "../robot/robot.h"
#include "hexapod/message.h"
#include "hexapod/range_check.h"
#include "hexapod/status.h"
#include "parts.h"

/* Returns the command of a rate, NULL for a rate of zero; *finite: all its numbers are finite. */
static const hxCommand *ramp_from_rate(const hxInput *rate, hxCommand *command, int *finite) {
  const double size = hx_largest(0.0, rate, sizeof *rate / sizeof(double));
  *finite = isfinite(size);
  if (!rate || size == 0.0) return NULL;
  hx_command_from_input(command, rate, 0.0);
  return command;
}

/* Returns a fingerprint of an input: 52 bits of a checksum, never 0. */
static double input_fingerprint(const hxInput *input) {
  return 1.0 + (double)(hx_checksum(1, input, sizeof *input) >> 12);
}

/* Sets what the motors get in a call's command; a call that resumes another has what that had. */
static void supply_motors(hxPlant *plant, int resumes, hxCommand *command) {
  hxState *state = &plant->state;
  if (!resumes) {
    hx_supply_power(command, &plant->model, state);
    state->supply = command->supply;
    memcpy(state->duty, command->duty, sizeof state->duty);
  }
  command->supply = state->supply;
  memcpy(command->duty, state->duty, sizeof command->duty);
}

static const double most_parts = 1e6; /* 1  transmissions of the bus within a call */

/* Returns whether a call to t_end is possible, else writes why not. */
static hxStatus check_end(hxPlant *plant, double t_end) {
  const double time = plant->state.time, period = plant->model.bus_period;
  const hxStatus status = hx_check_end(time, t_end, plant->message);
  if (status != HX_OK) return status;
  if (!(period > 0.0 && (t_end - time) / period > most_parts)) return HX_OK;
  hx_print(plant->message, HX_MESSAGE_SIZE,
           "servo.bus_period: got %.3g s, which makes %.3g transmissions in this call, expected at "
           "most %.3g; raise servo.bus_period or make shorter calls",
           period, (t_end - time) / period, most_parts);
  return HX_INVALID_ARGUMENT;
}

/* A call: its inputs, their fingerprint or 0, and its start, s. */
typedef struct {
  const hxInput *input;
  const hxCommand *ramp; /* NULL: constant */
  double fingerprint, start;
} hxStepCall;

/* Lets setpoints follow a part's command until t_end, s; a part that resumes another goes on. */
static void follow_goals(hxPlant *plant, int resumes, double t_end, hxCommand *command,
                         hxCommand *ramp) {
  const hxFirmware *firmware = &plant->state.firmware;
  if (!(plant->model.goal_speed > 0.0)) return;
  if (!resumes) hx_follow_goals(command, &plant->model, &plant->state, t_end);
  memcpy(command->angle, firmware->angle, sizeof command->angle);
  memcpy(ramp->angle, firmware->rate, sizeof ramp->angle);
}

/* Moves a command along its change per second up to a time, s. */
static void move_command(hxCommand *command, const hxCommand *ramp, double time) {
  hx_ramp(command, ramp, time - command->time, sizeof *command / sizeof(double), command);
  command->time = time;
}

/* Sets a part's command, and in *ramp its change per second; servos on a bus hold theirs. Returns
 * the part's end, at most t_end, s. */
static double part_command(hxPlant *plant, const hxStepCall *call, int resumes, double t_end,
                           hxCommand *command, hxCommand *ramp) {
  hxState *state = &plant->state;
  const double begin = resumes ? state->call_start : state->time;
  const int has_bus = hx_has_bus(&plant->model);
  hx_command_from_input(command, call->input, has_bus ? call->start : begin);
  if (has_bus) {
    move_command(command, ramp, state->time);
    command->time = begin;
    hx_bus_send(command, &plant->model, state);
    memset(ramp, 0, HX_JOINT_COMMANDS);
  }
  const double end = hx_bus_end(&plant->model, state, t_end);
  follow_goals(plant, resumes, end, command, ramp);
  supply_motors(plant, resumes, command);
  return end;
}

/* Advances the plant by a part of a call: to its end, or to the next transmission of the bus. If an
 * event interrupted the last part and the input is the same, the step sequence of that part
 * continues, so that the motion does not depend on the interruption. */
static hxStatus advance_part(hxPlant *plant, const hxStepCall *call, double t_end,
                             hxEvents *events) {
  hxState *state = &plant->state;
  hxCommand command, ramp;
  const int resumes = state->call_input != 0.0 && state->call_input == call->fingerprint &&
                      state->call_start < state->time;
  const int moves = call->ramp || plant->model.goal_speed > 0.0;
  const double begin = state->time;
  memset(&ramp, 0, sizeof ramp);
  if (call->ramp) ramp = *call->ramp;
  const double end = part_command(plant, call, resumes, t_end, &command, &ramp);
  const hxStatus status = hx_kernel()->integrate(&plant->model, &command, moves ? &ramp : NULL, end,
                                                 events, state, plant->scratch, plant->message);
  const int interrupted = state->time < end;
  state->call_input = interrupted ? call->fingerprint : 0.0;
  state->call_start = interrupted ? command.time : 0.0;
  if (plant->model.overload_time > 0.0) {
    move_command(&command, &ramp, state->time);
    hx_count_overload(&command, &plant->model, state, state->time - begin);
  }
  return status;
}

/* Returns whether a call may change before its first step what steps change: by locks, or because
 * coordinates were set. */
static int changes_before_steps(const hxPlant *plant, const hxInput *input) {
  const double locks = hx_largest(0.0, input->lock, HX_LEGS * HX_JOINTS);
  return (plant->model.stops & 2) || locks > 0.0 || plant->state.moment.stale != 0.0;
}

/* Advances the plant. */
static hxStatus advance(hxPlant *plant, const hxInput *input, const hxInput *rate, double t_end,
                        hxEvents *events) {
  hxState *before = plant->state_before;
  hxCommand change;
  int finite;
  const hxCommand *ramp = ramp_from_rate(rate, &change, &finite);
  if (!finite)
    return hx_plant_fail(
        plant, HX_INVALID_ARGUMENT,
        "rates of inputs: got a number that is not finite, expected finite rates per second");
  hxStatus status = check_end(plant, t_end);
  if (status == HX_OK) status = hx_input_check(input, plant->message);
  if (status != HX_OK) return status;
  memcpy(before, &plant->state, HX_CALL_SIZE);
  const int compared = !ramp && (events->stop || before->call_input != 0.0);
  const hxStepCall call = {input, ramp, compared ? input_fingerprint(input) : 0.0, before->time};
  hx_footprints_begin(&plant->footprints);
  events->footprints = &plant->footprints;
  events->feet = &plant->feet;
  events->t_end = t_end, events->before = before;
  if (changes_before_steps(plant, input)) hx_keep_state(&plant->model, &plant->state, events);
  const int locks = hx_plant_update_locks(plant, input);
  do {
    status = advance_part(plant, &call, t_end, events);
    events->continues = 1;
  } while (status == HX_OK && plant->state.time < t_end && !hx_ends_here(events));
  if (status == HX_OK) return HX_OK;
  memcpy(&plant->state, before, HX_CALL_SIZE);
  if (!events->before) hx_copy_state(&plant->model, &plant->state, before);
  if (locks) hx_plant_derive_stops(plant);
  hx_footprints_take_back(&plant->footprints);
  return status;
}

hxStatus hx_plant_step(hxPlant *plant, const hxInput *input, double t_end) {
  return hx_plant_step_ramp(plant, input, NULL, t_end);
}

hxStatus hx_plant_step_ramp(hxPlant *plant, const hxInput *input, const hxInput *rate,
                            double t_end) {
  return advance(plant, input, rate, t_end, &(hxEvents){.stop = 0});
}

hxStatus hx_plant_step_to_event(hxPlant *plant, const hxInput *input, double t_end, int stop,
                                int *event) {
  hxEvents events = {.stop = stop};
  const hxStatus status = advance(plant, input, NULL, t_end, &events);
  *event = events.found && status == HX_OK;
  return status;
}
