/* integrator.h - time integration with error control that ends a step at every touch-down;
 * models/integrator.py is the readable form */
#ifndef HX_INTEGRATOR_H
#define HX_INTEGRATOR_H

#include "hexapod/message.h"
#include "step.h"

static const double step_floor = 1e-11; /* s  the error control fails below this step */
/* 1, 1/s, 1  limits of a call's steps, so that every call ends: base, per second, highest; of fixed
 * steps, and of attempts under error control */
static const double step_limits[3] = {1e5, 1e5, 1e6}, attempt_limits[3] = {2e4, 1e5, 1e6};
/* m, m per tolerance  a touch-down is located to this depth */
static const double touch_depth[2] = {1e-10, 1e-6};

/* ---- touch-down ---- */

/* Returns the larger of a depth and the deepest open contact's of a row, m. */
HX_INLINE double deepest_open_of(const hxContactState *contact, const hxDepths *depths, int row,
                                 int slots, double depth) {
  for (int slot = 0; slot < slots; ++slot)
    if (contact->closed[row][slot] == 0.0 && depths->delta[row][slot] > depth)
      depth = depths->delta[row][slot];
  return depth;
}

/* Returns the penetration of the deepest open contact of a model's rows, or how far a foot has left
 * its cell, m. */
static double deepest_open(const hxModel *model, const hxStart *start, const hxDepths *depths) {
  double depth = deepest_open_of(start->contact, depths, HX_FOOT, HX_LEGS, -HUGE_VAL);
  for (int k = 1; k < model->rows; ++k)
    depth = deepest_open_of(start->contact, depths, model->row[k], HX_LEGS, depth);
  if (model->torso_rows) depth = deepest_open_of(start->contact, depths, HX_TORSO, HX_SLOTS, depth);
  for (int k = model->listed - model->pair_rows; k < model->listed; ++k)
    depth = deepest_open_of(start->contact, depths, model->row[k], HX_LEGS, depth);
  for (int leg = 0; model->terrain && leg < HX_LEGS; ++leg)
    depth = fmax(depth, depths->outside[leg]);
  return depth;
}

/* Returns where on [0, 1] the cubic with these ends and slopes (per unit) reaches a level between
 * its ends (eq. 24), by bisection. */
static double cubic_crossing(double from, double slope_from, double to, double slope_to,
                             double level) {
  const double rise = to - from, bend = slope_from + slope_to - 2.0 * rise,
               curve = rise - slope_from - bend;
  double low = 0.0, high = 1.0;
  while (high - low > 1e-14) {
    const double x = 0.5 * (low + high);
    if (from + x * (slope_from + x * (curve + x * bend)) > level)
      high = x;
    else
      low = x;
  }
  return high;
}

/* Returns the first x at which an open contact of a row reaches a level; 1: none. */
static double first_crossing(const hxStart *start, int row, double h, const hxDepths *low,
                             const hxDepths *high, double level) {
  double first = 1.0;
  for (int slot = 0; slot < hx_slots_of(row); ++slot)
    if (start->contact->closed[row][slot] == 0.0 && high->delta[row][slot] > level) {
      const double x = cubic_crossing(low->delta[row][slot], h * low->ddelta[row][slot],
                                      high->delta[row][slot], h * high->ddelta[row][slot], level);
      first = x < first ? x : first;
    }
  return first;
}

/* Returns the first x at which a foot leaves its cell by a level; 1: none. */
static double first_exit(const hxDepths *low, const hxDepths *high, double level) {
  double first = 1.0;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    if (high->outside[leg] > level)
      first = fmin(first, (level - low->outside[leg]) / (high->outside[leg] - low->outside[leg]));
  return first;
}

/* Returns the time at which the first open contact reaches half the touch depth, by the cubics
 * through depths and speeds at two times. */
static double expected_touch(const hxStart *start, double t_low, const hxDepths *low, double t_high,
                             const hxDepths *high) {
  const double h = t_high - t_low, level = 0.5 * start->touch_depth;
  const hxModel *model = start->model;
  double first = 1.0;
  for (int k = 0; k < model->listed; ++k)
    first = fmin(first, first_crossing(start, model->row[k], h, low, high, level));
  if (model->terrain) first = fmin(first, first_exit(low, high, level));
  return t_low + first * h;
}

/* Shortens a step that ends below the ground to one that ends on it: each guess is a step of its
 * own; every third halves what is left, in case the cubics converge slowly. */
static double find_touchdown(const hxStart *start, double h, hxState *state, hxTrial *trial,
                             hxDepths *depths) {
  double low = 0.0, high = h;
  hxDepths found, depths_low;
  hx_depths_of(start->model, start->contact, start->y, &depths_low);
  for (int guess = 1;
       deepest_open(start->model, start, depths) > start->touch_depth && high - low > step_floor;
       ++guess) {
    double middle = guess % 3 ? expected_touch(start, low, &depths_low, high, depths) : low;
    if (!(middle > low && middle < high)) middle = 0.5 * (low + high);
    hxTrial *nearer = &start->scratch->nearer;
    try_step(start, middle, state, nearer);
    hx_depths_of(start->model, start->contact, &nearer->y, &found);
    if (deepest_open(start->model, start, &found) > 0.0)
      high = middle, *depths = found, *trial = *nearer;
    else
      low = middle, depths_low = found;
  }
  return high;
}

/* ---- error control ---- */

/* Returns the largest number of steps in a call over a time, s. */
static double steps_allowed(const double limits[3], double time) {
  return fmin(limits[0] + limits[1] * time, limits[2]);
}

/* Returns the largest number of evaluations in a call over a time, s: those of its attempts; of
 * fixed steps twice as many, because touch-downs are located by further ones. */
static double evaluations_allowed(const hxModel *model, double time) {
  const double attempts = model->step > 0.0 ? 2.0 * steps_allowed(step_limits, time)
                                            : steps_allowed(attempt_limits, time);
  return hx_method(model->method)->stages * attempts;
}

/* Writes that the call's limit is spent, and returns the status. */
static hxStatus limit_spent(const hxState *state, double t, double h, char *message) {
  hx_print(message, HX_MESSAGE_SIZE,
           "the call's limit of evaluations is spent at t = %.9g s (step %.3g s, %.0f evaluations "
           "since the start); check masses, stiffness and inputs for extreme values, make shorter "
           "calls, raise solver.tolerance or use a linearly implicit solver.method",
           t, h, state->evaluations);
  return HX_STEP_TOO_SMALL;
}

/* Writes why no step of h from t succeeds, and returns the status. */
static hxStatus step_failure(const hxTrial *trial, double t, double h, char *message) {
  const int lost = isnan(trial->error);
  hx_print(message, HX_MESSAGE_SIZE,
           lost ? "the motion is not finite any more at t = %.9g s (step %.3g s); check masses, "
                  "stiffness and inputs, or let the error control choose the step (solver.step = 0)"
                : "the error control finds no step that meets the tolerance at t = %.9g s (step "
                  "%.3g s); check the inputs for extreme values, raise solver.tolerance or use a "
                  "linearly implicit solver.method",
           t, h);
  return lost ? HX_NOT_FINITE : HX_STEP_TOO_SMALL;
}

/* ---- measures of a step ---- */

/* Returns the work of the push: its impulses times the mean of the torso's velocities at both ends
 * (eq. 27). */
static double push_work(const hxImpulses *impulses, const hxPlantMotion *from,
                        const hxPlantMotion *to) {
  double work = 0.0;
  for (int i = 0; i < 6; ++i)
    work += impulses->push[i] * (0.5 * (from->torso[HX_V + i] + to->torso[HX_V + i]));
  return work;
}

/* Adds the works of an accepted step of h to the motion at its end, and its integrals and peaks to
 * the state; its moment has the rows of the model `seen`. */
static void measure_step(const hxStart *start, const hxModel *seen, double h, const hxMoment *end,
                         hxState *state, hxTrial *trial) {
  hxStepWorks works;
  hxCommand command[INTERVALS + 1];
  hxReal work[HX_PACKS];
  hxPath path = {.model = start->near,
                 .contact = start->contact,
                 .t = start->t,
                 .h = h,
                 .from = &state->moment,
                 .to = end};
  for (int node = 0; node <= INTERVALS; ++node)
    path.command[node] =
        command_at(start, start->t + h * ((double)node / INTERVALS), &command[node]);
  if (start->model->has_soil) {
    hxSoilEnds *ends = &start->scratch->soil;
    path.ends = ends;
    hx_soil_ends(start->contact, &state->moment, end, start->scratch->is_soil_known, ends);
    hx_yield_soil(start->contact, h, &state->moment, end, ends, path.plastic);
  }
  hx_step_works(&path, &trial->impulses, &works);
  hxMeasured *measured = &state->measured;
  hx_measure_path(&path, &trial->impulses, &works, measured);
  for (int pack = 0; pack < HX_PACKS; ++pack)
    work[pack] = (works.motor[0][pack] + works.motor[1][pack]) + works.motor[2][pack];
  trial->y.actuator_work += hx_lane(hx_sum_legs(work), 0);
  trial->y.push_work += push_work(&trial->impulses, start->y, &trial->y);
  trial->y.dissipated = (measured->contact_loss + measured->friction_loss) + measured->gear_loss;
  hx_copy_moment(seen, &state->moment, end);
  if (!start->model->has_soil) return;
  memcpy(state->contact.plastic, path.plastic, sizeof path.plastic);
  memcpy(start->scratch->soil.from, start->scratch->soil.to, sizeof start->scratch->soil.to);
}

/* Keeps where the feet's nearest points on a smooth grid are. In the next step they have moved
 * little, so that one evaluation of the surface finds them. */
static void keep_nearest_points(const hxModel *model, hxState *state) {
  const hxContactMoment *foot = &state->moment.contact[HX_FOOT];
  if (!model->terrain || hx_has_cells(model)) return;
  for (int i = 0; i < 2; ++i)
    for (int slot = 0; slot < HX_PACKS * HX_LANES; ++slot)
      state->contact.nearest[i][slot] =
          foot->normal[i][slot] * (foot->delta[slot] - model->radius[HX_FOOT]);
}

/* Computes moment and depths at the end of a trial, and returns the model whose rows they contain:
 * those of bodies are left out where neither they nor an open foot can touch the ground. */
static const hxModel *end_of_step(const hxStart *start, const hxPlantMotion *y, hxMoment *end,
                                  hxDepths *depths) {
  const hxModel *whole = start->model, *seen = start->near;
  if (seen != whole) {
    const double bound =
        hx_moment_and_bound(seen, whole, start->contact, y, HX_NEAR, start->scratch->nodes, end);
    hx_depths_of_moment(seen, start->contact, end, depths);
    if (!(bound > 0.0 || deepest_open(seen, start, depths) > 0.0)) return seen;
  }
  hx_moment_of(whole, start->contact, y, end);
  hx_depths_of_moment(whole, start->contact, end, depths);
  return whole;
}

/* Advances the state by one accepted step of at most h_max, shortened by the error control and by
 * touch-downs; *taken is its length, *event whether contacts switched at its end. */
static hxStatus advance_step(const hxStart *start, double h_max, double *next_step, hxState *state,
                             double *taken, int *event, char *message) {
  const hxModel *model = start->model;
  hxTrial *trial = &start->scratch->trial;
  /* equal steps; 1e-9: rounding adds no step */
  const double count = ceil(fmax(1.0, h_max / *next_step - 1e-9));
  double h = model->step > 0.0 ? h_max : h_max / count;
  trial->error = 0.0;
  for (;;) {
    if (state->evaluations >= start->scratch->last_evaluation)
      return limit_spent(state, start->t, h, message);
    try_step(start, h, state, trial);
    if (!trial->is_finite) trial->error = NAN;
    if (trial->error <= 1.0) break;
    state->rejected += 1.0;
    h *= fmin(step_factor(start->method, trial->error), 0.9);
    if (h < step_floor || (model->step > 0.0 && isnan(trial->error)))
      return step_failure(trial, start->t, h, message);
  }
  if (model->step == 0.0) {
    /* a step limited by the end of the interval must not reduce the next step */
    const double least = h < h_max ? 0.0 : state->next_step;
    *next_step = state->next_step =
        following_step(start->method, trial->error, h, model->step_max, least);
  }
  /* shorten the step to the first touch-down, measure it, switch contacts */
  hxMoment *end = &start->scratch->end;
  hxDepths depths;
  *taken = h;
  const hxModel *seen = end_of_step(start, &trial->y, end, &depths);
  if (seen == model && deepest_open(model, start, &depths) > 0.0) {
    *taken = find_touchdown(start, h, state, trial, &depths);
    hx_moment_of(model, start->contact, &trial->y, end);
  }
  end->time = start->t + *taken;
  if (*taken < h_max || !start->is_last) hx_keep_state(model, state, start->events);
  if (start->command->time == start->t && !start->events->continues)
    hx_reset_peaks(&state->measured);
  measure_step(start, seen, *taken, end, state, trial);
  state->motion = trial->y;
  state->steps += 1.0;
  if (hx_has_cells(model)) hx_cross_cells(seen, &depths, state);
  keep_nearest_points(model, state);
  if (model->has_soil) hx_depths_of_moment(seen, &state->contact, &state->moment, &depths);
  *event = hx_switch_contacts(seen, &depths, start->t + *taken, &state->moment,
                              start->events->footprints, state);
  if (*event && model->foot_rows > 1) hx_moment_shares(model, &state->contact, &state->moment);
  start->scratch->is_soil_known = model->has_soil && !*event;
  return HX_OK;
}

/* Returns whether a contact of the model's rows from `first` to before `end` is closed. */
static int is_pressed(const hxModel *model, const hxContactState *contact, int first, int end) {
  double closed = 0.0;
  for (int k = first; k < end; ++k)
    for (int slot = 0; slot < hx_slots_of(model->row[k]); ++slot)
      closed += contact->closed[model->row[k]][slot];
  return closed > 0.0;
}

/* Advances from state->time to t_end; the last step ends on t_end exactly. A call that an event
 * interrupted continues with the same steps. */
static hxStatus run_to(const hxModel *model, const hxCommand *command, const hxCommand *ramp,
                       double t_end, hxEvents *events, hxState *state, hxScratch *scratch,
                       char *message) {
  hxStart start = {.model = model,
                   .command = command,
                   .ramp = ramp,
                   .contact = &state->contact,
                   .method = hx_method(model->method),
                   .y = &state->motion,
                   .events = events,
                   .is_last = t_end == events->t_end,
                   .scratch = scratch};
  const int rows = model->listed, foot_rows = model->foot_rows;
  const hxModel *feet = rows > foot_rows ? events->feet : model;
  start.touch_depth = fmax(touch_depth[0], touch_depth[1] * model->tolerance);
  /* new inputs cause a larger error than the last step's */
  double first = fmin(state->first_step, state->next_step);
  double *next_step = command->time < state->time ? &state->next_step : &first;
  while (state->time < t_end && !hx_ends_here(events)) {
    const double left = t_end - state->time;
    double taken;
    int event = 0;
    start.t = state->time;
    start.near = is_pressed(model, &state->contact, foot_rows, rows) ? model : feet;
    const hxStatus status = advance_step(&start, left, next_step, state, &taken, &event, message);
    if (status != HX_OK) return status;
    if (next_step == &first) state->first_step = first, next_step = &state->next_step;
    const double t = state->time + taken;
    state->time = taken >= left || t_end - t < step_floor ? t_end : t;
    events->found |= event;
    events->ended = events->stop == 2;
    /* a call that is interrupted here continues without patches: the whole call does so, too */
    for (int pack = 0; event && pack < HX_PACKS; ++pack) hx_forget_patches(&scratch->nodes[pack]);
  }
  return HX_OK;
}

/* Advances to t_end in equal steps of at most solver.step. */
static hxStatus run_fixed(const hxModel *model, const hxCommand *command, const hxCommand *ramp,
                          double t_end, hxEvents *events, hxState *state, hxScratch *scratch,
                          char *message) {
  const double t_start = command->time;
  const double count = fmax(1.0, ceil((t_end - t_start) / model->step - 1e-9));
  const double allowed = steps_allowed(step_limits, t_end - t_start);
  if (count > allowed) {
    hx_print(message, HX_MESSAGE_SIZE,
             "solver.step: got %.3g s, which makes %.0f steps of this call, expected at most %.0f; "
             "raise solver.step or make shorter calls",
             model->step, count, allowed);
    return HX_STEP_TOO_SMALL;
  }
  for (double i = 1.0; i <= count && !hx_ends_here(events); i += 1.0) {
    const double t = i < count ? t_start + (t_end - t_start) * (i / count) : t_end;
    const hxStatus status = run_to(model, command, ramp, t, events, state, scratch, message);
    if (status != HX_OK) return status;
  }
  return HX_OK;
}

/* Advances the state to t_end exactly, or to an event. After a failure the state lies between the
 * two times and the message gives the reason. */
static hxStatus hx_integrate(const hxModel *model, const hxCommand *command, const hxCommand *ramp,
                             double t_end, hxEvents *events, hxState *state, void *scratch,
                             char *message) {
  if (command->time == state->time) state->call_evaluations = state->evaluations;
  ((hxScratch *)scratch)->last_evaluation =
      state->call_evaluations + evaluations_allowed(model, t_end - command->time);
  for (int pack = 0; pack < HX_PACKS; ++pack) hx_forget_nodes(&((hxScratch *)scratch)->nodes[pack]);
  ((hxScratch *)scratch)->is_soil_known = 0;
  if (state->moment.stale != 0.0) hx_moment_update(model, state);
  keep_nearest_points(model, state);
  const hxStatus status = (model->step == 0.0 ? run_to : run_fixed)(
      model, command, ramp, t_end, events, state, scratch, message);
  memset(state->contact.nearest, 0, sizeof state->contact.nearest);
  /* off grids, whose points are searched leg by leg, packs that cover all slots have filled them */
  if (HX_PACKS * HX_LANES < HX_SLOTS || model->terrain) {
    fill_motion_slots(&state->motion);
    hx_fill_moment_slots(model, state);
  }
  fill_lines(&state->measured, HX_MEASURED_LINES);
  return status;
}

#endif
