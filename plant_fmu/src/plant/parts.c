#include "parts.h"

#include <math.h>

#include "../command/command.h"
#include "hexapod/message.h"

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

void hx_plant_command(const hxPlant *plant, const hxInput *input, hxCommand *command) {
  hx_command_from_input(command, input, plant->state.time);
  hx_bus_command(command, &plant->model, &plant->state);
  hx_command_supply(command, &plant->model, &plant->state);
}
