/* entry_points.h - functions of a kernel's table, built from the physics on lanes; each kernel_*.c
 * includes it once, at its width */
#include "../kernel.h"
#include "coordinates.h"
#include "dynamics.h"
#include "integrator.h"
#include "output.h"

static const double first_step_size = 1e-4; /* s  first step after a reset */

/* The functions of kernel.h's table, which describes them. */
static void kernel_start(const hxModel *model, double t, hxState *state) {
  static const hxCommand no_command;
  hxWork work;
  state->time = t;
  state->call_start = state->call_input = 0.0;
  state->next_step = state->first_step = fmin(first_step_size, model->step_max);
  state->motion.actuator_work = state->motion.push_work = state->motion.dissipated = 0.0;
  state->evaluations = state->steps = state->rejected = state->touchdowns = 0.0;
  const hxFeet feet = feet_of(model, &state->motion);
  hx_contact_start(model, feet.delta, &state->contact);
  memset(state->motion.bristle, 0, sizeof state->motion.bristle);
  hx_dynamics_forces(model, &state->contact, &no_command, t, &state->motion, 0, &work);
  hx_moment_update(model, state);
  memset(&state->completed, 0, sizeof state->completed);
  memset(&state->measured, 0, sizeof state->measured);
  for (int pack = 0; pack < HX_PACKS; ++pack)
    hx_store(&state->measured.peak_force[pack * HX_LANES], work.pack[pack].foot.normal.force);
  hx_fill_measured_slots(state);
  state->stored_at_start = hx_kinetic_energy(model, &state->motion, &work) +
                           hx_potential_energy(model, &state->motion, &work);
}

static void kernel_derivative(const hxModel *model, const hxState *state, const hxCommand *command,
                              int multipliers, hxPlantMotion *rate) {
  hxRate all;
  hxWork work;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL,
                       multipliers, &work, &all);
  *rate = all.motion;
}

static void kernel_coordinates(const hxModel *model, const hxState *state, const hxCommand *command,
                               hxCoordinates *x, hxCoordinates *rate) {
  hxRate all;
  hxWork work;
  memset(all.motion.bristle, 0, sizeof all.motion.bristle);
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, 0, &work,
                       &all);
  if (x) hx_coordinates_of(&state->motion, &work, x);
  if (rate) hx_coordinates_rate(&all.motion, &work, rate);
}

static void kernel_feet(const hxModel *model, const hxPlantMotion *motion, double delta[HX_SLOTS],
                        double ddelta[HX_SLOTS]) {
  const hxFeet feet = feet_of(model, motion);
  memcpy(delta, feet.delta, sizeof feet.delta);
  memcpy(ddelta, feet.ddelta, sizeof feet.ddelta);
}

static void kernel_switch_contacts(const hxModel *model, const double delta[HX_SLOTS],
                                   const double ddelta[HX_SLOTS], hxState *state) {
  hx_switch_contacts(model, delta, ddelta, state->time, state);
}

/* Computes the impulses h/2 (previous forces + present forces), and keeps the present forces as
 * the previous ones. */
static void trapezoidal_impulses(const hxModel *model, const hxWork *work, double h,
                                 hxCompleted *completed, hxImpulses *impulses) {
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const hxLegWork *leg = &work->pack[pack];
    const int slot = pack * HX_LANES;
    const hxReal half = hx_splat(0.5 * h);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxServo *servo = &leg->joint[joint].servo;
      double *motor = &completed->motor[joint][slot], *gear = &completed->gear[joint][slot];
      impulses->motor[joint][pack] = half * (hx_load(motor) + servo->torque);
      impulses->gear[joint][pack] = half * (hx_load(gear) + servo->friction);
      hx_store(motor, servo->torque);
      hx_store(gear, servo->friction);
      if (model->stops) {
        double *stop = &completed->stop[joint][slot];
        impulses->stop[joint][pack] = half * (hx_load(stop) + leg->joint[joint].stop.torque);
        hx_store(stop, leg->joint[joint].stop.torque);
      }
    }
    impulses->foot[pack] =
        hx_scale(half, hx_add3(hx_load_vec3((const double (*)[HX_SLOTS])completed->foot, slot),
                               leg->foot.force));
    hx_store_vec3(completed->foot, slot, leg->foot.force);
    if (has_turning_friction(model)) {
      const hxVec3 before = hx_load_vec3((const double (*)[HX_SLOTS])completed->moment, slot);
      impulses->moment[pack] = hx_scale(half, hx_add3(before, leg->foot.moment));
      hx_store_vec3(completed->moment, slot, leg->foot.moment);
    }
  }
  completed->known = 1.0;
}

static void kernel_measure(const hxModel *model, const hxCommand *command, hxState *state) {
  hxMoment end;
  hxWork work;
  hxRate rate;
  hxImpulses impulses;
  hxStepWorks works;
  const int known = state->completed.known != 0.0;
  const double h = state->time - state->moment.time;
  hxPath path = {.model = model,
                 .contact = &state->contact,
                 .t = state->moment.time,
                 .h = h,
                 .from = &state->moment,
                 .to = &end};
  for (int node = 0; node <= INTERVALS; ++node) path.command[node] = command;
  memset(&end, 0, sizeof end);
  hx_moment_of(model, &state->motion, &end);
  end.time = state->time;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, 1, &work,
                       &rate);
  trapezoidal_impulses(model, &work, h, &state->completed, &impulses);
  if (!known)
    trapezoidal_impulses(
        model, &work, h, &state->completed,
        &impulses); /* the first step has no previous forces: they equal the present ones */
  hx_reset_peaks(&state->measured);
  if (h > 0.0) {
    hx_step_works(&path, &impulses, &works);
    hx_measure_path(&path, &impulses, &works, &state->measured);
  }
  state->moment = end;
  hx_fill_measured_slots(state);
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    hx_fill_slots(state->completed.motor[joint]);
    hx_fill_slots(state->completed.gear[joint]);
    hx_fill_slots(state->completed.stop[joint]);
  }
  for (int i = 0; i < 3; ++i) {
    hx_fill_slots(state->completed.foot[i]);
    hx_fill_slots(state->completed.moment[i]);
  }
}

static void kernel_output(const hxModel *model, const hxState *state, const hxCommand *command,
                          hxOutput *output) {
  hxRate rate;
  hxWork work;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, 1, &work,
                       &rate);
  hx_output_fill(model, state, &work, output);
}

static void kernel_integral_rates(const hxModel *model, const hxState *state,
                                  const hxCommand *command, hxOutput *rate) {
  hxRate all;
  hxWork work;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, 1, &work,
                       &all);
  hx_integral_rates_fill(model, &work, rate);
}

static void kernel_accelerations(const hxModel *model, const hxState *state,
                                 const hxCommand *command, double acceleration[HX_BODIES][6],
                                 double multiplier[HX_BODIES - 1][HX_MULTIPLIERS],
                                 double drive_torque[HX_BODIES - 1]) {
  hxRate rate;
  hxWork work;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, 1, &work,
                       &rate);
  hx_accelerations_fill(&work, &rate.motion, acceleration, multiplier, drive_torque);
}

#define HX_KERNEL_TABLE(title, test)                                                               \
  {.name = title,                                                                                  \
   .is_supported = test,                                                                           \
   .start = kernel_start,                                                                          \
   .integrate = hx_integrate,                                                                      \
   .derivative = kernel_derivative,                                                                \
   .place = hx_motion_from_coordinates,                                                            \
   .coordinates = kernel_coordinates,                                                              \
   .feet = kernel_feet,                                                                            \
   .switch_contacts = kernel_switch_contacts,                                                      \
   .measure = kernel_measure,                                                                      \
   .output = kernel_output,                                                                        \
   .integral_rates = kernel_integral_rates,                                                        \
   .accelerations = kernel_accelerations}
