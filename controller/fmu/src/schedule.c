/* schedule.c - the public functions of a controller: ticks at their times, saved states, refusals.
 */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "hexapod/message.h"
#include "hexapod/range_check.h"
#include "state.h"

/* A saved state. The FMI layer's header identifies it; the checksum protects the indices of models
 * and gaits in it from bytes that another program has written. */
typedef struct {
  uint64_t checksum; /* of what follows */
  hxControllerDefinition definition;
  hxControllerModel model[2];
  hxControllerState state;
} hxSaved;

/* 1  of a period: a tick that is later than the present time by less than this is due */
static const double clock_tolerance = 0.01;

static uint64_t checksum(const hxSaved *saved) {
  return hx_checksum(0, &saved->definition, sizeof *saved - offsetof(hxSaved, definition));
}

static hxStatus refuse(hxController *controller, hxStatus status, const char *text) {
  hx_print(controller->message, HX_MESSAGE_SIZE, "%s", text);
  return status;
}

static hxControllerState *present(hxController *controller) {
  return &controller->state[controller->present];
}
static const hxControllerState *state_of(const hxController *controller) {
  return &controller->state[controller->present];
}

const char *hx_controller_message(const hxController *controller) { return controller->message; }
double hx_controller_time(const hxController *controller) { return state_of(controller)->time; }

hxController *hx_controller_create(void) {
  hxController *controller = calloc(1, sizeof *controller);
  hxControllerDefinition definition;
  if (!controller) return NULL;
  hx_controller_definition_default(&definition);
  hx_controller_reset(controller, &definition, 0.0);
  return controller;
}

void hx_controller_destroy(hxController *controller) { free(controller); }

hxStatus hx_controller_reset(hxController *controller, const hxControllerDefinition *definition,
                             double t) {
  char message[HX_MESSAGE_SIZE];
  if (!isfinite(t))
    return refuse(controller, HX_INVALID_ARGUMENT,
                  "start time: got a number that is not finite, expected a finite time in s");
  const hxStatus status = hx_controller_definition_check(definition, message);
  if (status != HX_OK) return refuse(controller, status, message);
  controller->definition = *definition;
  memset(controller->model, 0, sizeof controller->model);
  hx_controller_compile(definition, &controller->model[0]);
  hx_controller_begin(&controller->model[0], t, present(controller));
  controller->is_ahead = 0;
  controller->message[0] = '\0';
  return HX_OK;
}

/* Returns the model of the present gait. */
static const hxControllerModel *model_of(const hxController *controller) {
  return &controller->model[state_of(controller)->model];
}

const hxGait *hx_controller_gait(const hxController *controller) {
  return &controller->definition.gait;
}

/* Begins a change to the gait of the legs in service, with one that comes back (C58).
 * returning_leg: as in the state. */
static void change(hxController *controller, int returning_leg) {
  hxControllerState *state = present(controller);
  hxControllerDefinition definition = controller->definition;
  int absent[HX_LEGS];
  memcpy(absent, state->plan.absence.legs, sizeof absent);
  if (returning_leg) absent[returning_leg - 1] = 0;
  hx_gait_without(&definition.gait, (const int *)absent, state->plan.ramp.target[0] < 0.0);
  hx_controller_compile(&definition, &controller->model[1 - state->model]);
  hx_controller_change(controller->model, returning_leg, state);
}

hxStatus hx_controller_change_gait(hxController *controller, const hxGait *gait) {
  char message[HX_MESSAGE_SIZE];
  const hxGait before = controller->definition.gait;
  controller->definition.gait = *gait;
  const hxStatus status = hx_controller_definition_check(&controller->definition, message);
  if (status != HX_OK) {
    controller->definition.gait = before;
    return refuse(controller, status, message);
  }
  hx_walk_plan_end(&present(controller)->plan);
  change(controller, 0);
  controller->is_ahead = 0;
  return HX_OK;
}

int hx_controller_control(const hxController *controller) { return controller->definition.control; }

/* Compiles a model again, under the definition's control and in the model's own gait. */
static void compile_again(const hxController *controller, hxControllerModel *model) {
  hxControllerDefinition definition = controller->definition;
  definition.gait = model->gait;
  hx_controller_compile(&definition, model);
}

/* Begins the walk anew under the present model, at the present time. */
static void begin_again(hxController *controller) {
  hxControllerState *state = present(controller);
  const int model = state->model;
  const double time = state->time; /* steps that were too short for a tick may have passed */
  hx_controller_begin(model_of(controller), state->start, state);
  state->time = time;
  state->model = model;
}

hxStatus hx_controller_change_control(hxController *controller, int control) {
  char message[HX_MESSAGE_SIZE];
  hxControllerState *state = present(controller);
  const hxFootPathsModel paths = model_of(controller)->plan.paths;
  const int before = controller->definition.control;
  controller->definition.control = control;
  const hxStatus status = hx_controller_definition_check(&controller->definition, message);
  if (status != HX_OK) {
    controller->definition.control = before;
    return refuse(controller, status, message);
  }
  compile_again(controller, &controller->model[state->model]);
  if (state->is_changing_gait) compile_again(controller, &controller->model[1 - state->model]);
  if (state->tick > 0) {
    hx_controller_exchange(&controller->model[state->model], &paths, state);
  } else {
    begin_again(controller);
  }
  controller->is_ahead = 0;
  return HX_OK;
}

static double next_tick(const hxController *controller) {
  const hxControllerState *state = state_of(controller);
  return state->start + (double)state->tick * model_of(controller)->plan.period;
}

static int is_finite(const hxControllerOutput *output) {
  double sum = 0.0; /* the sum is not finite if any number is not */
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      sum += 0.0 * output->angle_ref[leg][joint] + 0.0 * output->speed_ref[leg][joint] +
             0.0 * output->torque_ref[leg][joint] + 0.0 * output->acceleration_ref[leg][joint];
  return sum == 0.0;
}

/* Computes the state after the next tick under an input in the place of the other state, unless it
 * is there, and returns it. Inputs consist of doubles only. */
static const hxControllerState *tick_ahead(hxController *controller,
                                           const hxControllerInput *input) {
  hxControllerState *next = &controller->state[1 - controller->present];
  if (controller->is_ahead && memcmp(&controller->input, input, sizeof *input) == 0) return next;
  controller->is_ahead = 1;
  controller->input = *input;
  *next = *state_of(controller);
  hx_controller_tick(model_of(controller), input, next);
  return next;
}

void hx_controller_output(hxController *controller, const hxControllerInput *input,
                          hxControllerOutput *output) {
  const hxControllerState *state = state_of(controller);
  const int due =
      next_tick(controller) - state->time <= clock_tolerance * model_of(controller)->plan.period;
  *output = due ? tick_ahead(controller, input)->output : state->output;
}

/* Executes the next tick; the first one of a step leaves the state before it as the other one. */
static void tick(hxController *controller, const hxControllerInput *input, int first) {
  if (first) {
    tick_ahead(controller, input);
    controller->present = 1 - controller->present;
  } else {
    hx_controller_tick(model_of(controller), input, present(controller));
  }
  controller->is_ahead = 0;
}

hxStatus hx_controller_step(hxController *controller, const hxControllerInput *input,
                            const hxControllerInput *rate, double t_end) {
  enum { REALS = sizeof *input / sizeof(double) };
  const int before = controller->present;
  const double start = state_of(controller)->time;
  hxStatus status = hx_check_end(start, t_end, controller->message);
  if (status == HX_OK) status = hx_controller_input_check(input, controller->message);
  if (status != HX_OK) return status;
  while (t_end - next_tick(controller) > clock_tolerance * model_of(controller)->plan.period) {
    hxControllerInput ramped;
    if (rate) hx_ramp(input, rate, fmax(next_tick(controller) - start, 0.0), REALS, &ramped);
    tick(controller, rate ? &ramped : input, controller->present == before);
    if (is_finite(&state_of(controller)->output)) {
      if (state_of(controller)->gait_is_outdated)
        change(controller, state_of(controller)->returning_leg);
      hx_controller_adopt(controller->model, present(controller));
      continue;
    }
    controller->present = before;
    return refuse(
        controller, HX_NOT_FINITE,
        "joint commands: got numbers that are not finite, expected a command that legs can follow");
  }
  present(controller)->time = t_end;
  return HX_OK;
}

size_t hx_controller_state_size(void) { return sizeof(hxSaved); }

void hx_controller_get_state(const hxController *controller, void *bytes) {
  hxSaved saved;
  memset(&saved, 0, sizeof saved);
  memcpy(&saved.definition, &controller->definition, sizeof saved.definition);
  memcpy(saved.model, controller->model, sizeof saved.model);
  memcpy(&saved.state, state_of(controller), sizeof saved.state);
  saved.checksum = checksum(&saved);
  memcpy(bytes, &saved, sizeof saved);
}

hxStatus hx_controller_set_state(hxController *controller, const void *bytes) {
  hxSaved saved;
  memcpy(&saved, bytes, sizeof saved);
  if (saved.checksum != checksum(&saved))
    return refuse(
        controller, HX_BAD_STATE,
        "saved state: got a damaged one, expected one whose checksum is right; save it again");
  memcpy(&controller->definition, &saved.definition, sizeof saved.definition);
  memcpy(controller->model, saved.model, sizeof saved.model);
  memcpy(present(controller), &saved.state, sizeof saved.state);
  controller->is_ahead = 0;
  return HX_OK;
}
