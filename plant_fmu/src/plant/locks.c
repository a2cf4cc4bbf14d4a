/* locks.c - faults that hold a joint where it is: stops that close at its angle */
#include <math.h>
#include <string.h>

#include "parts.h"

/* Returns the energy in a joint's stops at an angle, J. */
static double stored(const hxStops *stop, int slot, double angle) {
  static const double turn = 6.283185307179586476925;
  const double past = fabs(remainder(angle - stop->middle[slot], turn)) - stop->half_range[slot];
  return past > 0.0 ? 0.5 * stop->stiffness[slot] * past * past : 0.0;
}

void hx_plant_derive_stops(hxPlant *plant) {
  hxModel *model = &plant->model;
  model->stops &= 1;
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    hxStops *stop = &model->joint[joint].stop;
    *stop = model->joint[joint].own_stop;
    for (int slot = 0; slot < HX_SLOTS; ++slot) {
      if (plant->state.locked[joint][slot] == 0.0) continue;
      stop->middle[slot] = plant->state.locked_angle[joint][slot], stop->half_range[slot] = 0.0;
      stop->stiffness[slot] = model->lock_stiffness, stop->damping[slot] = model->lock_damping;
      model->stops |= 2;
    }
  }
  hx_plant_derive_feet(plant);
}

/* Returns whether an input asks for other locks than there are. */
static int locks_change(const hxPlant *plant, const hxInput *input) {
  static const double none[HX_LEGS][HX_JOINTS];
  int changed = 0;
  if (!(plant->model.stops & 2) && memcmp(input->lock, none, sizeof none) == 0) return 0;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      changed |= (input->lock[leg][joint] >= 0.5) != (plant->state.locked[joint][leg] != 0.0);
  return changed && plant->model.servo_mode != HX_SERVO_KINEMATIC;
}

int hx_plant_update_locks(hxPlant *plant, const hxInput *input) {
  hxState *state = &plant->state;
  hxCoordinates now;
  double lost = 0.0; /* J */
  if (!locks_change(plant, input)) return 0;
  hx_plant_get_coordinates(plant, &now);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double angle = now.angle[leg][joint], lock = input->lock[leg][joint] >= 0.5;
      lost += stored(&plant->model.joint[joint].stop, leg, angle);
      if (lock > state->locked[joint][leg]) state->locked_angle[joint][leg] = angle;
      state->locked[joint][leg] = lock;
    }
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    hx_fill_slots(state->locked[joint]), hx_fill_slots(state->locked_angle[joint]);
  hx_plant_derive_stops(plant);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      lost -= stored(&plant->model.joint[joint].stop, leg, now.angle[leg][joint]);
  state->measured.gear_loss += lost;
  state->motion.dissipated += lost;
  return 1;
}
