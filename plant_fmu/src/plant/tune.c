/* tune.c - changes tunable parameters between steps, and counts the work that this takes */
#include <string.h>

#include "../contact_law.h"
#include "../kernel.h"
#include "../robot/robot.h"
#include "parts.h"

/* Returns what the energy audit does not explain, J. */
static double residual(hxPlant *plant) {
  static const hxInput no_input;
  hxOutput output;
  hx_plant_output_groups(plant, &no_input, HX_OUTPUT_AUDIT, &output);
  return output.energy.residual;
}

/* Returns whether the centres of mass lie elsewhere than in the model before. */
static int centres_moved(const hxModel *before, const hxModel *now) {
  int moved = 0;
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    const hxJointModel *a = &before->joint[joint], *b = &now->joint[joint];
    moved |= memcmp(a->point_i, b->point_i, sizeof a->point_i) != 0 ||
             memcmp(a->point_j, b->point_j, sizeof a->point_j) != 0;
  }
  return moved;
}

/* Moves the torso's state from one centre of mass to another. */
static void move_centre(const hxModel *before, const hxModel *now, hxCoordinates *x) {
  double from[3], shift[3], drift[3];
  for (int i = 0; i < 3; ++i)
    from[i] = before->joint[0].point_i[i][0] - now->joint[0].point_i[i][0];
  hx_vector_rotate(x->quaternion, from, shift);
  hx_vector_cross(x->angular_velocity, shift, drift);
  for (int i = 0; i < 3; ++i) x->position[i] += shift[i], x->velocity[i] += drift[i];
}

hxStatus hx_plant_tune(hxPlant *plant, const hxDefinition *definition) {
  char message[HX_MESSAGE_SIZE];
  hxCoordinates x;
  hxDepths depths;
  const hxStatus status = hx_definition_check(definition, message);
  if (status != HX_OK) return hx_plant_fail(plant, status, message);
  hxState *state = &plant->state;
  hxModel *model = &plant->model, *before = &plant->before;
  const double error = residual(plant);
  hx_plant_get_coordinates(plant, &x);
  *before = *model;
  memset(model, 0, sizeof *model);
  hx_model_compile(model, definition, before->terrain);
  if (centres_moved(before, model)) {
    move_centre(before, model, &x);
    hx_kernel()->place(model, &x, &state->motion);
  }
  hx_kernel()->depths(model, &state->contact, &state->motion, &depths);
  hx_contact_tune(model, &depths, &state->contact);
  hx_plant_derive_stops(plant);
  state->moment.stale = 1.0;
  state->call_input = 0.0;
  state->parameter_work += residual(plant) - error;
  return HX_OK;
}
