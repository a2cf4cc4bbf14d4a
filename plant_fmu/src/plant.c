#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check.h"
#include "dynamics.h"
#include "integrator.h"
#include "output.h"
#include "robot.h"

static const double first_step = 1e-4; /* s  tried after a reset */

/* A saved state: the plant's model and state behind what it takes to recognise them. */
typedef struct {
  uint64_t magic, version, size, checksum;
  hxModel model;
  hxState state;
} hxSaved;

static const uint64_t magic = 0x74616c5064507868u; /* "hxPdPlat" */
static const uint64_t saved_version = 1;

/* FNV-1a over the model and the state */
static uint64_t checksum(const hxSaved *saved) {
  const unsigned char *bytes = (const unsigned char *)&saved->model;
  uint64_t hash = 1469598103934665603u;
  for (size_t i = 0; i < sizeof *saved - offsetof(hxSaved, model); ++i) hash = (hash ^ bytes[i]) * 1099511628211u;
  return hash;
}

static hxStatus refuse(hxPlant *plant, hxStatus status, const char *text) {
  snprintf(plant->message, HX_MESSAGE_SIZE, "%s", text);
  return status;
}

/* Contacts, energy and counters of a motion that starts here and now. */
static void start_motion(const hxModel *model, hxState *state, double t) {
  static const hxCommand no_command;
  double delta[HX_SLOTS], ddelta[HX_SLOTS];
  hxMotion rate;
  hxWork work;
  state->time = t;
  state->next_step = fmin(first_step, model->step_max);
  state->motion.actuator_work = state->motion.push_work = state->motion.dissipated = 0.0;
  state->evaluations = state->steps = state->rejected = state->touchdowns = 0.0;
  hx_feet(model, &state->motion, delta, ddelta);
  hx_contact_start(model, delta, &state->contact);
  hx_dynamics_evaluate(model, &state->contact, &no_command, t, &state->motion, 0, &work, &rate);
  state->stored_at_start = hx_kinetic_energy(model, &work) + hx_potential_energy(model, &work);
}

const char *hx_plant_message(const hxPlant *plant) { return plant->message; }
double hx_plant_time(const hxPlant *plant) { return plant->state.time; }

hxPlant *hx_plant_create(void) {
  hxPlant *plant = calloc(1, sizeof *plant);
  hxDefinition definition;
  if (!plant) return NULL;
  hx_definition_default(&definition);
  hx_plant_reset(plant, &definition, 0.0);
  return plant;
}

void hx_plant_destroy(hxPlant *plant) { free(plant); }

hxStatus hx_plant_reset(hxPlant *plant, const hxDefinition *definition, double t) {
  char message[HX_MESSAGE_SIZE];
  double body[HX_BODIES][HX_BODY_STATE];
  if (!isfinite(t)) return refuse(plant, HX_INVALID_ARGUMENT, "start time: got a number that is not finite, expected seconds");
  const hxStatus status = hx_definition_check(definition, message);
  if (status != HX_OK) return refuse(plant, status, message);
  memset(&plant->model, 0, sizeof plant->model);
  memset(&plant->state, 0, sizeof plant->state);
  hx_model_compile(&plant->model, definition);
  hx_initial_bodies(definition, body);
  hx_motion_from_bodies(&plant->state.motion, body);
  start_motion(&plant->model, &plant->state, t);
  plant->message[0] = '\0';
  return HX_OK;
}

hxStatus hx_plant_step(hxPlant *plant, const hxInput *input, double t_end) {
  const hxState before = plant->state;
  hxCommand command;
  if (!(t_end >= plant->state.time && t_end <= DBL_MAX)) {
    snprintf(plant->message, HX_MESSAGE_SIZE, "end of step: got %.17g s, expected a finite time of at least %.17g s", t_end,
             plant->state.time);
    return HX_INVALID_ARGUMENT;
  }
  hxStatus status = hx_input_check(input, plant->message);
  if (status != HX_OK) return status;
  hx_command_from_input(&command, input, plant->state.time);
  status = hx_integrate(&plant->model, &command, t_end, &plant->state, plant->message);
  if (status != HX_OK) plant->state = before;
  return status;
}

void hx_plant_output(hxPlant *plant, const hxInput *input, hxOutput *output) {
  hxCommand command;
  hxMotion rate;
  hxWork work;
  hx_command_from_input(&command, input, plant->state.time);
  hx_dynamics_evaluate(&plant->model, &plant->state.contact, &command, plant->state.time, &plant->state.motion, 1, &work, &rate);
  hx_output_fill(&plant->model, &plant->state, &work, output);
}

size_t hx_plant_state_size(void) { return sizeof(hxSaved); }

void hx_plant_get_state(const hxPlant *plant, void *bytes) {
  hxSaved saved = {.magic = magic, .version = saved_version, .size = sizeof saved, .model = plant->model, .state = plant->state};
  saved.checksum = checksum(&saved);
  memcpy(bytes, &saved, sizeof saved);
}

hxStatus hx_plant_set_state(hxPlant *plant, const void *bytes, size_t size) {
  hxSaved saved;
  if (size != sizeof saved) return refuse(plant, HX_BAD_STATE, "saved state: its size is not that of this version's states; save it again");
  memcpy(&saved, bytes, sizeof saved);
  if (saved.magic != magic || saved.version != saved_version || saved.size != sizeof saved)
    return refuse(plant, HX_BAD_STATE, "saved state: not one of this version; save it again with this version");
  if (saved.checksum != checksum(&saved))
    return refuse(plant, HX_BAD_STATE, "saved state: damaged, its checksum does not match; save it again");
  plant->model = saved.model;
  plant->state = saved.state;
  return HX_OK;
}

void hx_plant_get_bodies(const hxPlant *plant, double body[HX_BODIES][HX_BODY_STATE]) { hx_bodies_from_motion(&plant->state.motion, body); }

hxStatus hx_plant_set_bodies(hxPlant *plant, const double body[HX_BODIES][HX_BODY_STATE]) {
  for (int b = 0; b < HX_BODIES; ++b)
    for (int i = 0; i < HX_BODY_STATE; ++i)
      if (!isfinite(body[b][i])) return refuse(plant, HX_INVALID_ARGUMENT, "body state: got a number that is not finite");
  hx_motion_from_bodies(&plant->state.motion, body);
  start_motion(&plant->model, &plant->state, plant->state.time);
  return HX_OK;
}

void hx_plant_accelerations(hxPlant *plant, const hxInput *input, double acceleration[HX_BODIES][6],
                            double multiplier[HX_BODIES - 1][HX_MULTIPLIERS], double drive_torque[HX_BODIES - 1]) {
  hxCommand command;
  hxMotion rate;
  hxWork work;
  double body[HX_BODIES][HX_BODY_STATE];
  hx_command_from_input(&command, input, plant->state.time);
  hx_dynamics_evaluate(&plant->model, &plant->state.contact, &command, plant->state.time, &plant->state.motion, 1, &work, &rate);
  hx_bodies_from_motion(&rate, body);
  for (int b = 0; b < HX_BODIES; ++b) memcpy(acceleration[b], &body[b][HX_V], 6 * sizeof(double));
  for (int j = 0; j < HX_BODIES - 1; ++j) {
    const int leg = j / HX_JOINTS, lane = leg % HX_LANES;
    const hxJointWork *k = &work.pack[leg / HX_LANES].joint[j % HX_JOINTS];
    const hxReal row[HX_MULTIPLIERS] = {k->lambda_lin.x, k->lambda_lin.y, k->lambda_lin.z, k->lambda[0], k->lambda[1]};
    for (int i = 0; i < HX_MULTIPLIERS; ++i) multiplier[j][i] = hx_lane(row[i], lane);
    drive_torque[j] = hx_lane(k->servo.torque, lane);
  }
}
