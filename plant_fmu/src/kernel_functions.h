/* kernel_functions.h - a kernel's functions from the files on lanes: included once in each kernel's file, after them */
#include <math.h>

#include "dynamics.h"
#include "integrator.h"
#include "kernel.h"
#include "output.h"

static const double first_step = 1e-4; /* s  tried after a reset */

static void kernel_start(const hxModel *model, double t, hxState *state) {
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

static void kernel_output(const hxModel *model, const hxState *state, const hxCommand *command, hxOutput *output) {
  hxMotion rate;
  hxWork work;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, 1, &work, &rate);
  hx_output_fill(model, state, &work, output);
}

static void kernel_accelerations(const hxModel *model, const hxState *state, const hxCommand *command, double acceleration[HX_BODIES][6],
                                 double multiplier[HX_BODIES - 1][HX_MULTIPLIERS], double drive_torque[HX_BODIES - 1]) {
  hxMotion rate;
  hxWork work;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, 1, &work, &rate);
  hx_accelerations_fill(&work, &rate, acceleration, multiplier, drive_torque);
}

#define HX_KERNEL_TABLE(title, test)                                                                                                       \
  {.name = title,                                                                                                                          \
   .runs_here = test,                                                                                                                      \
   .start = kernel_start,                                                                                                                  \
   .integrate = hx_integrate,                                                                                                              \
   .output = kernel_output,                                                                                                                \
   .accelerations = kernel_accelerations}
