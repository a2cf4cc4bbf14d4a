/* plant.c - a plant's life: create, reset, output, destroy. plant/ has the rest.
 *
 * A macro-step is hx_plant_step in plant/advance.c. state.h says what it writes, in which order. If
 * a part of it fails, the state before the call is restored.
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "command/command.h"
#include "ground/footprints.h"
#include "hexapod/message.h"
#include "hexapod/shared_work.h"
#include "kernel.h"
#include "plant/parts.h"
#include "robot/robot.h"

hxStatus hx_plant_fail(hxPlant *plant, hxStatus status, const char *text) {
  hx_print(plant->message, HX_MESSAGE_SIZE, "%s", text);
  return status;
}

void hx_plant_derive_feet(hxPlant *plant) {
  plant->feet = plant->model;
  plant->feet.rows = plant->feet.listed = plant->model.foot_rows;
  plant->feet.torso_rows = plant->feet.pair_rows = 0;
}

double hx_largest(double so_far, const void *first, size_t n) {
  const double *entry = first;
  for (size_t i = 0; first && i < n; ++i)
    if (!isnan(so_far) && !(fabs(entry[i]) <= so_far)) so_far = fabs(entry[i]);
  return so_far;
}

int hx_is_attitude(const double q[4]) {
  return q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] > 1e-6;
}

void hx_plant_command(const hxPlant *plant, const hxInput *input, hxCommand *command) {
  hx_command_from_input(command, input, plant->state.time);
  hx_held_commands(command, &plant->model, &plant->state);
  hx_setpoints(command, &plant->model, &plant->state);
  hx_supply_power(command, &plant->model, &plant->state);
}

const char *hx_plant_message(const hxPlant *plant) { return plant->message; }
double hx_plant_time(const hxPlant *plant) { return plant->state.time; }

/* The default reset uses the block: pages of the plant's own work space are left untouched. */
hxPlant *hx_plant_create(void) {
  const size_t size = HX_WORK_ALIGNMENT + hx_work_size();
  unsigned char *block = malloc(size);
  hxPlant *plant = block ? malloc(sizeof *plant + size) : NULL;
  hxDefinition definition;
  if (plant) {
    memset(plant, 0, sizeof *plant);
    hx_plant_use_work(plant, block + hx_shared_work_padding((uintptr_t)block), hx_work_size());
    hx_definition_default(&definition);
    hx_plant_reset(plant, &definition, 0.0);
    hx_plant_use_work(plant, NULL, 0);
  }
  free(block);
  return plant;
}

void hx_plant_destroy(hxPlant *plant) { free(plant); }

void hx_plant_set_terrain(hxPlant *plant, const hxTerrain *terrain) { plant->terrain = terrain; }

hxStatus hx_plant_reset(hxPlant *plant, const hxDefinition *definition, double t) {
  char message[HX_MESSAGE_SIZE];
  double body[HX_BODIES][HX_BODY_STATE];
  if (!isfinite(t))
    return hx_plant_fail(
        plant, HX_INVALID_ARGUMENT,
        "start time: got a number that is not finite, expected a finite time in s");
  hxStatus status = hx_definition_check(definition, message);
  if (status == HX_OK) status = hx_plant_check_terrain(plant, definition, message);
  if (status != HX_OK) return hx_plant_fail(plant, status, message);
  plant->before = plant->model;
  *plant->state_before = plant->state;
  memset(&plant->model, 0, sizeof plant->model);
  memset(&plant->state, 0, sizeof plant->state);
  hx_model_compile(&plant->model, definition, plant->terrain);
  hx_initial_bodies(definition, body);
  hx_motion_from_bodies(&plant->model, (const double (*)[HX_BODY_STATE])body, &plant->state.motion);
  hx_kernel()->start(&plant->model, t, &plant->state, plant->scratch);
  /* the cells of feet on blocks are known now */
  status = hx_plant_check_start(plant, message);
  if (status != HX_OK) {
    plant->model = plant->before;
    plant->state = *plant->state_before;
    hx_plant_derive_feet(plant);
    return hx_plant_fail(plant, status, message);
  }
  hx_plant_derive_feet(plant);
  hx_footprints_clear(&plant->footprints);
  plant->message[0] = '\0';
  return HX_OK;
}

void hx_plant_output_groups(hxPlant *plant, const hxInput *input, unsigned groups,
                            hxOutput *output) {
  hxCommand command;
  hx_plant_command(plant, input, &command);
  hx_kernel()->output(&plant->model, &plant->state, &command, groups, plant->scratch, output);
  if (!(groups & HX_OUTPUT_MOTION)) return;
  output->footprints = plant->footprints.kept.count;
  if (plant->model.servo_drive == HX_DRIVE_MOTOR)
    output->supply_voltage = command.supply * plant->model.voltage;
}

void hx_plant_output(hxPlant *plant, const hxInput *input, hxOutput *output) {
  hx_plant_output_groups(plant, input, HX_OUTPUT_ALL, output);
}

size_t hx_plant_footprints(const hxPlant *plant, hxFootprint *footprint, size_t capacity) {
  const hxFootprints *kept = &plant->footprints.kept;
  const size_t number = (size_t)hx_footprints_number(kept), first = (size_t)kept->count - number;
  for (size_t k = 0; k < number && k < capacity; ++k)
    footprint[k] = kept->footprint[(first + k) % HX_FOOTPRINTS];
  return number;
}

void hx_plant_get_bodies(const hxPlant *plant, double body[HX_BODIES][HX_BODY_STATE]) {
  hx_bodies_from_motion(&plant->model, &plant->state.motion, body);
}

void hx_plant_get_torso(const hxPlant *plant, double torso[HX_BODY_STATE]) {
  memcpy(torso, plant->state.motion.torso, sizeof plant->state.motion.torso);
}

hxStatus hx_plant_set_bodies(hxPlant *plant, const double body[HX_BODIES][HX_BODY_STATE]) {
  if (!isfinite(hx_largest(0.0, body, HX_BODIES * HX_BODY_STATE)))
    return hx_plant_fail(plant, HX_INVALID_ARGUMENT,
                         "body state: got a number that is not finite, expected finite numbers");
  for (int k = 0; k < HX_BODIES; ++k)
    if (!hx_is_attitude(body[k] + HX_P))
      return hx_plant_fail(plant, HX_INVALID_ARGUMENT,
                           "body state: got a quaternion of zeros, expected one of length 1; set "
                           "all bodies' quaternions");
  hx_motion_from_bodies(&plant->model, body, &plant->state.motion);
  hx_kernel()->start(&plant->model, plant->state.time, &plant->state, plant->scratch);
  return HX_OK;
}

void hx_plant_accelerations(hxPlant *plant, const hxInput *input, double acceleration[HX_BODIES][6],
                            double multiplier[HX_BODIES - 1][HX_MULTIPLIERS],
                            double drive_torque[HX_BODIES - 1]) {
  hxCommand command;
  hx_plant_command(plant, input, &command);
  hx_kernel()->accelerations(&plant->model, &plant->state, &command, plant->scratch, acceleration,
                             multiplier, drive_torque);
}
