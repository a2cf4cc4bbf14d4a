/* kernel_functions.h - a kernel's functions from the physics on lanes: included once in each kernel's file, at its width */
#include "kernel.h"
#include "lanes/coordinates.h"
#include "lanes/dynamics.h"
#include "lanes/integrator.h"
#include "lanes/output.h"

static const double cautious_step = 1e-4; /* s  tried after a reset */

static void kernel_start(const hxModel *model, double t, hxState *state) {
  static const hxCommand no_command;
  hxWork work;
  state->time = t;
  state->call_start = state->call_input = 0.0;
  state->next_step = state->first_step = fmin(cautious_step, model->step_max);
  state->motion.actuator_work = state->motion.push_work = state->motion.dissipated = 0.0;
  state->evaluations = state->steps = state->rejected = state->touchdowns = 0.0;
  const hxFeet feet = feet_of(model, &state->motion);
  hx_contact_start(model, feet.delta, &state->contact);
  memset(state->motion.bristle, 0, sizeof state->motion.bristle);
  hx_dynamics_forces(model, &state->contact, &no_command, t, &state->motion, 0, &work);
  state->stored_at_start = hx_kinetic_energy(model, &state->motion, &work) + hx_potential_energy(model, &state->motion, &work);
}

static void kernel_derivative(const hxModel *model, const hxState *state, const hxCommand *command, int multipliers, hxMotion *rate) {
  hxRate all;
  hxWork work;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, multipliers, &work, &all);
  *rate = all.motion;
}

static void kernel_coordinates(const hxModel *model, const hxState *state, const hxCommand *command, hxCoordinates *x,
                               hxCoordinates *rate) {
  hxRate all;
  hxWork work;
  memset(all.motion.bristle, 0, sizeof all.motion.bristle);
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, 0, &work, &all);
  if (x) hx_coordinates_of(&state->motion, &work, x);
  if (rate) hx_coordinates_rate(&all.motion, &work, rate);
}

static void kernel_feet(const hxModel *model, const hxMotion *motion, double delta[HX_SLOTS], double ddelta[HX_SLOTS]) {
  const hxFeet feet = feet_of(model, motion);
  memcpy(delta, feet.delta, sizeof feet.delta);
  memcpy(ddelta, feet.ddelta, sizeof feet.ddelta);
}

static void kernel_output(const hxModel *model, const hxState *state, const hxCommand *command, hxOutput *output) {
  hxRate rate;
  hxWork work;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, 1, &work, &rate);
  hx_output_fill(model, state, &work, output);
}

static void kernel_accelerations(const hxModel *model, const hxState *state, const hxCommand *command, double acceleration[HX_BODIES][6],
                                 double multiplier[HX_BODIES - 1][HX_MULTIPLIERS], double drive_torque[HX_BODIES - 1]) {
  hxRate rate;
  hxWork work;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, 1, &work, &rate);
  hx_accelerations_fill(&work, &rate.motion, acceleration, multiplier, drive_torque);
}

#define HX_KERNEL_TABLE(title, test)                                                                                                       \
  {.name = title,                                                                                                                          \
   .runs_here = test,                                                                                                                      \
   .start = kernel_start,                                                                                                                  \
   .integrate = hx_integrate,                                                                                                              \
   .derivative = kernel_derivative,                                                                                                        \
   .place = hx_motion_from_coordinates,                                                                                                    \
   .coordinates = kernel_coordinates,                                                                                                      \
   .feet = kernel_feet,                                                                                                                    \
   .output = kernel_output,                                                                                                                \
   .accelerations = kernel_accelerations}
