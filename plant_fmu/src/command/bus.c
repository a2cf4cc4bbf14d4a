#include <math.h>
#include <string.h>

#include "command.h"

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
