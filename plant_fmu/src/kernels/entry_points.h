/* entry_points.h - functions of a kernel's table, built from the physics on lanes; each kernel_*.c
 * includes it once, at its width */
#include "../kernel.h"
#include "../lanes/coordinates.h"
#include "../lanes/dynamics.h"
#include "integrator.h"
#include "output.h"

static const double first_step_size = 1e-4; /* s  first step after a reset */

/* The functions of kernel.h's table, which describes them. */
static void kernel_start(const hxModel *model, double t, hxState *state, void *scratch) {
  static const hxCommand no_command;
  hxWork *work = &((hxScratch *)scratch)->work;
  state->time = t;
  state->call_start = state->call_input = 0.0;
  state->next_step = state->first_step = fmin(first_step_size, model->step_max);
  state->motion.actuator_work = state->motion.push_work = state->motion.dissipated = 0.0;
  state->evaluations = state->steps = state->rejected = state->touchdowns = 0.0;
  hxDepths depths;
  hx_contact_release(&state->contact);
  hx_depths_of(model, &state->contact, &state->motion, &depths);
  hx_contact_start(model, &depths, &state->contact);
  memset(state->motion.bristle, 0, sizeof state->motion.bristle);
  hx_dynamics_forces(model, &state->contact, &no_command, t, &state->motion, NULL, 0, 1, work);
  hx_moment_update(model, state);
  memset(&state->completed, 0, sizeof state->completed);
  memset(&state->measured, 0, sizeof state->measured);
  memset(&state->bus, 0, sizeof state->bus);
  state->bus.start = t;
  memset(&state->firmware, 0, sizeof state->firmware);
  state->firmware.time = t;
  for (int i = 0; i < HX_JOINTS * HX_SLOTS; ++i)
    state->measured.winding[i / HX_SLOTS][i % HX_SLOTS] =
        state->measured.housing[i / HX_SLOTS][i % HX_SLOTS] = model->heat.start;
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    hxReal force = work->pack[pack].contact[HX_FOOT].normal.force;
    for (int k = 1; k < model->foot_rows; ++k)
      force += work->pack[pack].contact[model->row[k]].normal.force;
    hx_store(&state->measured.peak_force[pack * HX_LANES], force);
  }
  hx_fill_measured_slots(model, state);
  memcpy(state->firmware.angle, state->moment.angle, sizeof state->firmware.angle);
  state->stored_at_start = hx_kinetic_energy(model, &state->motion, work) +
                           hx_potential_energy(model, &state->motion, work);
}

static void kernel_derivative(const hxModel *model, const hxState *state, const hxCommand *command,
                              int multipliers, void *memory, hxPlantMotion *rate) {
  hxScratch *scratch = memory;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, NULL,
                       multipliers ? HX_WITH_MULTIPLIERS : HX_RATES, &scratch->work,
                       &scratch->rate);
  *rate = scratch->rate.motion;
}

static void kernel_coordinates(const hxModel *model, const hxState *state, const hxCommand *command,
                               void *memory, hxCoordinates *x, hxCoordinates *rate) {
  hxScratch *scratch = memory;
  hxPlantMotion *motion_rate = &scratch->rate.motion;
  memset(motion_rate->bristle, 0, sizeof motion_rate->bristle);
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, NULL,
                       HX_RATES, &scratch->work, &scratch->rate);
  if (x) hx_coordinates_of(&state->motion, &scratch->work, x);
  if (rate) hx_coordinates_rate(motion_rate, &scratch->work, rate);
}

static void kernel_switch_contacts(const hxModel *model, hxDepths *depths,
                                   hxFootprintLog *footprints, hxState *state) {
  hxMoment at;
  if (model->has_soil || model->foot_rows > 1)
    hx_moment_of(model, &state->contact, &state->motion, &at);
  if (!hx_switch_contacts(model, depths, state->time, &at, footprints, state) &&
      has_bristles(model, HX_FOOT))
    hx_contact_slacken(&state->contact, &state->motion); /* the importer may have set bristles */
}

/* Computes the impulse h/2 (previous force + present force), and keeps the present force as the
 * previous one. */
static hxVec3 vec3_impulse(hxVec3 force, hxReal half, int slot, double (*previous)[HX_SLOTS]) {
  const hxVec3 before = hx_load_vec3((const double (*)[HX_SLOTS])previous, slot);
  hx_store_vec3(previous, slot, force);
  return hx_scale(half, hx_add3(before, force));
}

/* Computes the same of the stops of a leg. */
static void stop_impulses(const hxLegWork *leg, hxReal half, int pack, hxCompleted *completed,
                          hxImpulses *impulses) {
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    double *previous = &completed->stop[joint][pack * HX_LANES];
    const hxReal torque = leg->joint[joint].stop.torque;
    impulses->stop[joint][pack] = half * (hx_load(previous) + torque);
    hx_store(previous, torque);
  }
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
    }
    if (model->stops) stop_impulses(leg, half, pack, completed, impulses);
    for (int k = 0; k < model->rows; ++k) {
      const int row = model->row[k];
      impulses->contact[row][pack] =
          vec3_impulse(leg->contact[row].force, half, slot, completed->contact[row]);
      if (has_turning_friction(model, row))
        impulses->moment[row][pack] =
            vec3_impulse(leg->contact[row].moment, half, slot, completed->moment[row]);
    }
  }
  for (int pack = 0; model->torso_rows && pack < HX_TORSO_PACKS; ++pack)
    impulses->torso[pack] = vec3_impulse(work->torso_contact[pack].force, hx_splat(0.5 * h),
                                         pack * HX_LANES, completed->contact[HX_TORSO]);
  for (int pair = 0; model->pair_rows && pair < HX_PAIR_ROWS; ++pair)
    for (int pack = 0; pack < HX_PACKS; ++pack)
      impulses->pair[pair][pack] =
          vec3_impulse(work->pair[pair][pack].force, hx_splat(0.5 * h), pack * HX_LANES,
                       completed->contact[HX_PAIR + pair]);
  completed->known = 1.0;
}

/* Hands contacts over between rows at the end of an importer's step. */
static void settle_cells(const hxModel *model, hxState *state) {
  hxDepths depths;
  hx_depths_of_moment(model, &state->contact, &state->moment, &depths);
  hx_cross_cells(model, &depths, state);
}

static void kernel_measure(const hxModel *model, const hxCommand *command, hxState *state,
                           void *memory) {
  hxScratch *scratch = memory;
  hxMoment *end = &scratch->end;
  hxImpulses impulses;
  hxStepWorks works;
  const int known = state->completed.known != 0.0;
  const double h = state->time - state->moment.time;
  hxPath path = {.model = model,
                 .contact = &state->contact,
                 .t = state->moment.time,
                 .h = h,
                 .from = &state->moment,
                 .to = end};
  for (int node = 0; node <= INTERVALS; ++node) path.command[node] = command;
  hx_moment_of(model, &state->contact, &state->motion, end);
  end->time = state->time;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, NULL,
                       HX_WITH_OPEN_CONTACTS, &scratch->work, &scratch->rate);
  if (model->has_soil) {
    path.ends = &scratch->soil;
    hx_soil_ends(&state->contact, &state->moment, end, 0, &scratch->soil);
    hx_yield_soil(&state->contact, h, &state->moment, end, path.ends, path.plastic);
  }
  trapezoidal_impulses(model, &scratch->work, h, &state->completed, &impulses);
  /* the first step has no previous forces: they equal the present ones */
  if (!known) trapezoidal_impulses(model, &scratch->work, h, &state->completed, &impulses);
  hx_reset_peaks(&state->measured);
  if (h > 0.0) {
    hx_step_works(&path, &impulses, &works);
    hx_measure_path(&path, &impulses, &works, &state->measured);
  }
  if (model->has_soil) memcpy(state->contact.plastic, path.plastic, sizeof path.plastic);
  hx_copy_moment(model, &state->moment, end);
  if (hx_has_cells(model)) settle_cells(model, state);
  hx_fill_measured_slots(model, state);
  fill_lines(&state->completed, HX_COMPLETED_LINES);
  for (int k = 0; k < model->listed; ++k)
    if (model->row[k] != HX_TORSO) fill_lines(state->completed.contact[model->row[k]], 3);
}

/* Returns whether a group of outputs depends on accelerations. */
static int needs_accelerations(const hxModel *model, unsigned groups) {
  if (groups & HX_OUTPUT_REACTIONS) return 1;
  return (groups & ~(unsigned)HX_OUTPUT_MOTION) &&
         (model->servo_mode == HX_SERVO_KINEMATIC || model->spin);
}

static void kernel_output(const hxModel *model, const hxState *state, const hxCommand *command,
                          unsigned groups, void *memory, hxOutput *output) {
  hxScratch *scratch = memory;
  hxWork *work = &scratch->work;
  if (needs_accelerations(model, groups))
    hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, NULL,
                         HX_WITH_OPEN_CONTACTS, work, &scratch->rate);
  else if (groups & ~(unsigned)HX_OUTPUT_MOTION)
    hx_dynamics_forces(model, &state->contact, command, state->time, &state->motion, NULL, 0, 1,
                       work);
  else
    torso_pass(model, &state->motion, work);
  hx_output_fill(model, state, work, groups, output);
}

static void kernel_integral_rates(const hxModel *model, const hxState *state,
                                  const hxCommand *command, void *memory, hxOutput *rate) {
  hxScratch *scratch = memory;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, NULL,
                       HX_WITH_OPEN_CONTACTS, &scratch->work, &scratch->rate);
  hx_integral_rates_fill(model, &state->contact, &scratch->work, rate);
}

static void kernel_accelerations(const hxModel *model, const hxState *state,
                                 const hxCommand *command, void *memory,
                                 double acceleration[HX_BODIES][6],
                                 double multiplier[HX_BODIES - 1][HX_MULTIPLIERS],
                                 double drive_torque[HX_BODIES - 1]) {
  hxScratch *scratch = memory;
  hx_dynamics_evaluate(model, &state->contact, command, state->time, &state->motion, NULL, NULL,
                       HX_WITH_MULTIPLIERS, &scratch->work, &scratch->rate);
  hx_accelerations_fill(&scratch->work, &scratch->rate.motion, acceleration, multiplier,
                        drive_torque);
}

#define HX_KERNEL_TABLE(title, test)                                                               \
  {.name = title,                                                                                  \
   .is_supported = test,                                                                           \
   .scratch = sizeof(hxScratch),                                                                   \
   .start = kernel_start,                                                                          \
   .integrate = hx_integrate,                                                                      \
   .derivative = kernel_derivative,                                                                \
   .place = hx_motion_from_coordinates,                                                            \
   .coordinates = kernel_coordinates,                                                              \
   .depths = hx_depths_of,                                                                         \
   .switch_contacts = kernel_switch_contacts,                                                      \
   .measure = kernel_measure,                                                                      \
   .output = kernel_output,                                                                        \
   .integral_rates = kernel_integral_rates,                                                        \
   .accelerations = kernel_accelerations}
