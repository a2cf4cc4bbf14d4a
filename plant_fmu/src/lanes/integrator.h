/* integrator.h - time integration with error control that ends a step at every touch-down;
 * models/integrator.py is the readable form */
#ifndef HX_INTEGRATOR_H
#define HX_INTEGRATOR_H

#include "../contact_law.h"
#include "../measure/measure.h"
#include "../method.h"
#include "hexapod/message.h"

static const double step_floor = 1e-11; /* s  the error control fails below this step */
/* 1, 1/s, 1  limits of a call's steps, so that every call ends: base, per second, highest; of fixed
 * steps, and of attempts under error control */
static const double step_limits[3] = {1e5, 1e5, 1e6}, attempt_limits[3] = {2e4, 1e5, 1e6};
static const double touch_depth[2] = {
    1e-10, 1e-6}; /* m, m per tolerance  a touch-down is located to this depth */

/* Scales of the error norm (eq. 22): 0.1 m, 1 (quaternion), 1 m/s and 10 rad/s. */
static const double error_scale[HX_BODY_STATE] = {0.1, 0.1, 0.1, 1, 1, 1, 1, 1, 1, 1, 10, 10, 10};
static const double bristle_scale = 10.0;                       /* 1  in preslidings */
static const double deflection_scale = 0.1, motor_scale = 10.0; /* rad, rad/s  of elastic gears */

typedef struct {
  hxPlantMotion y;
  hxImpulses impulses;
  double error;  /* error of the step over the tolerance; 0 without an estimate */
  int is_finite; /* 1: all numbers of y are finite */
} hxTrial;

/* Work space of a call. It belongs to the instance's memory, because threads of importers may have
 * small stacks. Nothing in it is read by a later call. */
typedef struct {
  hxWork work;
  hxRate rate;
  /* of a step */
  hxRate k[HX_STAGES], change;
  hxImplicit implicit;
  hxPlantMotion y;
  hxTrial trial, nearer;
  hxMoment end;
  hxModel tops;                 /* the model with one row of feet */
  hxPatchNodes nodes[HX_PACKS]; /* around the feet, of a call */
  hxSoilEnds soil;              /* of the last step */
  int is_soil_known;            /* 1: soil.from belongs to the present depths of feet */
  double last_evaluation;       /* number at which the call's limit is spent */
} hxScratch;

/* Start of a step and the data that all its trials share. */
typedef struct {
  const hxModel *model;   /* with all rows of contacts */
  const hxModel *near;    /* without the rows of bodies and pairs while none of them touches */
  const hxModel *pressed; /* the same with one row of feet while no other touches the ground */
  const hxCommand *command, *ramp; /* command and its change per second; ramp NULL: constant */
  const hxContactState *contact;
  const hxMethodRow *method;
  double t;
  double touch; /* m  largest depth of a contact that has just touched down */
  const hxPlantMotion *y;
  hxFootprintLog *footprints;
  hxScratch *scratch;
} hxStart;

/* Computes penetration and approach speed of all contacts. */
static inline void hx_depths_of(const hxModel *model, const hxContactState *state,
                                const hxPlantMotion *motion, hxDepths *depths) {
  hxMoment moment;
  hx_moment_and_bound(model, NULL, state, motion, HX_ALL, NULL, &moment);
  hx_depths_of_moment(model, state, &moment, depths);
}

/* ---- one step ---- */

/* Computes base + sum w_j k_j of one pack of entries over n rates, in their order. */
HX_INLINE hxReal combined(hxReal base, const hxReal *w, const hxRate *k, int n, int entry) {
  hxReal sum = base;
  for (int j = 0; j < n; ++j) sum += w[j] * hx_load(&k[j].y[entry]);
  return sum;
}

/* Computes the products h w_j of n weights. */
HX_INLINE void weights_of(hxReal *w, double h, const double *weights, int n) {
  for (int j = 0; j < n; ++j) w[j] = hx_splat(h * weights[j]);
}

/* Combines the entries from `first` to before `end` of a stage's arguments. w_change NULL: none. */
HX_INLINE void stage_entries(const hxPlantMotion *from, const hxReal *w_y, const hxReal *w_change,
                             const hxRate *k, int n, int first, int end, hxPlantMotion *y,
                             hxRate *change) {
  for (int i = first; i < end; i += HX_LANES) {
    const int place = i - HX_TURN_SIZE;
    hx_store(&y->y[place], combined(hx_load(&from->y[place]), w_y, k, n, i));
    if (w_change) hx_store(&change->y[i], combined(hx_splat(0.0), w_change, k, n, i));
  }
}

/* Computes the arguments of a stage, y = y_0 + h sum a_j k_j, and for a linearly implicit method
 * change = h sum g_j k_j (g NULL: none), in one pass over n rates. n is a constant for the
 * compiler. Bristles and elastic gears only where the model has them. */
HX_INLINE void stage_of_n(const hxModel *model, const hxPlantMotion *from, double h,
                          const double *a, const double *g, const hxRate *k, int n,
                          hxPlantMotion *y, hxRate *change) {
  enum { BRISTLES = HX_TURN_SIZE + HX_BODIES_SIZE, GEARS = BRISTLES + HX_BRISTLE_SIZE };
  const int end = has_bristles(model, HX_FOOT) ? GEARS : BRISTLES;
  hxReal w_y[HX_STAGES], weights[HX_STAGES];
  const hxReal *w_change = g ? weights : NULL;
  weights_of(w_y, h, a, n);
  if (g) weights_of(weights, h, g, n);
  for (int i = 0; g && i < HX_TURN_SIZE; i += HX_LANES)
    hx_store(&change->y[i], combined(hx_splat(0.0), weights, k, n, i));
  stage_entries(from, w_y, w_change, k, n, HX_TURN_SIZE, end, y, change);
  if (model->elastic)
    stage_entries(from, w_y, w_change, k, n, GEARS, GEARS + HX_GEAR_SIZE, y, change);
}

/* Calls stage_of_n with n as a constant. */
static inline void stage_arguments(const hxModel *model, const hxPlantMotion *from, double h,
                                   const double *a, const double *g, const hxRate *k, int n,
                                   hxPlantMotion *y, hxRate *change) {
  switch (n) {
  case 1:
    stage_of_n(model, from, h, a, g, k, 1, y, change);
    break;
  case 2:
    stage_of_n(model, from, h, a, g, k, 2, y, change);
    break;
  case 3:
    stage_of_n(model, from, h, a, g, k, 3, y, change);
    break;
  default:
    stage_of_n(model, from, h, a, g, k, n, y, change);
  }
}

/* Returns the larger number; a if b is NaN. */
static inline double larger_of(double a, double b) { return b > a ? b : a; }

/* What the pass over a step's end finds: 0 times all its numbers, and the largest error over its
 * scale (eq. 22). NaN is ignored by the largest error; the sum shows it. */
typedef struct {
  hxReal zeros, links;
  double torso;
} hxStepEnd;

/* Returns the larger of an error over its scale and the largest so far. */
HX_INLINE hxReal larger_error(hxReal largest, double scale, hxReal error) {
  return hx_max(largest, scale * hx_abs(error));
}

/* Computes the end of the torso's and the links' step and their errors. */
HX_INLINE void end_of_bodies(const hxPlantMotion *from, const hxReal *b, const hxReal *e, int n,
                             int estimates, const hxRate *k, hxPlantMotion *y, hxStepEnd *found) {
  double error[HX_TORSO_SIZE] = {0.0};
  for (int i = 0; i < HX_TORSO_SIZE; i += HX_LANES) {
    hx_store(&y->y[i], combined(hx_load(&from->y[i]), b, k, n, HX_TURN_SIZE + i));
    if (estimates) hx_store(&error[i], combined(hx_splat(0.0), e, k, n, HX_TURN_SIZE + i));
    found->zeros += 0.0 * hx_load(&y->y[i]);
  }
  for (int i = 0; i < HX_BODY_STATE; ++i)
    found->torso = larger_of(found->torso, 1.0 / error_scale[i] * fabs(error[i]));
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int i = 0; i < HX_BODY_STATE; ++i)
      for (int slot = 0; slot < HX_SLOTS; slot += HX_LANES) {
        const int at = HX_TORSO_SIZE + (joint * HX_BODY_STATE + i) * HX_SLOTS + slot;
        const hxReal end = combined(hx_load(&from->y[at]), b, k, n, HX_TURN_SIZE + at);
        hx_store(&y->y[at], end);
        found->zeros += 0.0 * end;
        if (estimates && slot < HX_PACKS * HX_LANES)
          found->links = larger_error(found->links, 1.0 / error_scale[i],
                                      combined(hx_splat(0.0), e, k, n, HX_TURN_SIZE + at));
      }
}

/* Computes the same of `size` entries from `first` on, whose errors have one scale. Where they do
 * not move, because the model has no law for them, they stay. */
HX_INLINE void end_of_entries(const hxPlantMotion *from, const hxReal *b, const hxReal *e, int n,
                              int estimates, const hxRate *k, int first, int size, int move,
                              double scale, hxPlantMotion *y, hxStepEnd *found) {
  for (int i = 0; i < size; i += HX_LANES) {
    const int at = first + i;
    hxReal end = hx_load(&from->y[at]);
    if (move) end = combined(end, b, k, n, HX_TURN_SIZE + at);
    hx_store(&y->y[at], end);
    found->zeros += 0.0 * end;
    if (move && estimates && i % HX_SLOTS < HX_PACKS * HX_LANES)
      found->links = larger_error(found->links, 1.0 / scale,
                                  combined(hx_splat(0.0), e, k, n, HX_TURN_SIZE + at));
  }
}

/* Computes y_1 = y_0 + h sum b_j k_j and the error h sum e_j k_j in one pass over n rates; n is a
 * constant for the compiler. */
HX_INLINE hxStepEnd step_of_n(const hxModel *model, const hxPlantMotion *from, double h,
                              const hxMethodRow *m, int n, int estimates, const hxRate *k,
                              hxPlantMotion *y) {
  enum {
    BRISTLES = HX_BODIES_SIZE,
    DEFLECTIONS = BRISTLES + HX_BRISTLE_SIZE,
    SPEEDS = DEFLECTIONS + HX_GEAR_SIZE / 2
  };
  hxStepEnd found = {hx_splat(0.0), hx_splat(0.0), 0.0};
  hxReal b[HX_STAGES], e[HX_STAGES];
  weights_of(b, h, m->b, n);
  weights_of(e, h, m->e, n);
  end_of_bodies(from, b, e, n, estimates, k, y, &found);
  end_of_entries(from, b, e, n, estimates, k, BRISTLES, HX_BRISTLE_SIZE,
                 has_bristles(model, HX_FOOT), bristle_scale * model->bristle_length, y, &found);
  end_of_entries(from, b, e, n, estimates, k, DEFLECTIONS, HX_GEAR_SIZE / 2, model->elastic,
                 deflection_scale, y, &found);
  end_of_entries(from, b, e, n, estimates, k, SPEEDS, HX_GEAR_SIZE / 2, model->elastic, motor_scale,
                 y, &found);
  return found;
}

/* Calls step_of_n with the number of stages as a constant. */
static inline hxStepEnd end_step(const hxModel *model, const hxPlantMotion *from, double h,
                                 const hxMethodRow *m, int estimates, const hxRate *k,
                                 hxPlantMotion *y) {
  switch (m->stages) {
  case 2:
    return step_of_n(model, from, h, m, 2, estimates, k, y);
  case 3:
    return step_of_n(model, from, h, m, 3, estimates, k, y);
  case 4:
    return step_of_n(model, from, h, m, 4, estimates, k, y);
  default:
    return step_of_n(model, from, h, m, m->stages, estimates, k, y);
  }
}

/* Returns the largest error over scale and tolerance. */
static inline double error_norm(const hxModel *model, const hxStepEnd *found) {
  return larger_of(found->torso, hx_largest_lane(found->links)) / model->tolerance;
}

/* Returns whether the sum of all lanes is 0. */
static inline int is_zero(hxReal x) {
  double lanes[HX_LANES], total = 0.0;
  hx_store(lanes, x);
  for (int lane = 0; lane < HX_LANES; ++lane) total += lanes[lane];
  return total == 0.0;
}

/* Returns whether all numbers of a motion are finite: 0 x is NaN otherwise. */
HX_RARE int all_finite(const hxPlantMotion *y) {
  hxReal sum = hx_splat(0.0);
  for (int i = 0; i < HX_MOTION_SIZE; i += HX_LANES) sum += 0.0 * hx_load(&y->y[i]);
  return is_zero(sum);
}

/* Scales all quaternions to unit length; adds 0 times their scales to `zeros`. */
static inline void normalise_quaternions(hxPlantMotion *m, hxReal *zeros) {
  double *p = &m->torso[HX_P];
  const double scale = 1.0 / sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3]);
  *zeros += hx_splat(0.0 * scale);
  for (int i = 0; i < 4; ++i) p[i] *= scale;
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int slot = 0; slot < HX_PACKS * HX_LANES; slot += HX_LANES) {
      const hxQuat q = hx_link_quat(m, joint, slot);
      const hxReal s = 1.0 / hx_sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
      *zeros += 0.0 * s;
      hx_store_quat(&m->link[joint][HX_P], slot, (hxQuat){s * q.w, s * q.x, s * q.y, s * q.z});
    }
}

/* Computes a kinematic drive's command some time after it was given. The rate of an input replaces
 * the input one derivative above it (eq. 13). */
static void move_drive(const hxCommand *from, const hxCommand *rate, double elapsed, int joint,
                       int slot, hxCommand *now) {
  const int given = rate->speed[joint][slot] != 0.0;
  const double a = given ? rate->speed[joint][slot] : from->acceleration[joint][slot];
  const double jerk = given ? 0.0 : rate->acceleration[joint][slot];
  now->acceleration[joint][slot] = a + elapsed * jerk;
  now->speed[joint][slot] = from->speed[joint][slot] + elapsed * (a + 0.5 * elapsed * jerk);
  if (rate->angle[joint][slot] != 0.0) return;
  now->angle[joint][slot] =
      from->angle[joint][slot] +
      elapsed * (from->speed[joint][slot] + elapsed * (0.5 * a + elapsed * (1.0 / 6.0) * jerk));
}

/* Returns the command at time t; in kinematic mode drives extrapolate as in eq. 13. */
static const hxCommand *command_at(const hxStart *start, double t, hxCommand *now) {
  enum { SIZE = sizeof(hxCommand) / sizeof(double) };
  const double *from = (const double *)start->command, *rate = (const double *)start->ramp;
  double *to = (double *)now;
  if (!start->ramp) return start->command;
  const double elapsed = t - start->command->time;
  for (int i = 0; i < SIZE; ++i) to[i] = from[i] + elapsed * rate[i];
  for (int i = 0; i < HX_JOINTS * HX_SLOTS && start->model->servo_mode == HX_SERVO_KINEMATIC; ++i)
    move_drive(start->command, start->ramp, elapsed, i / HX_SLOTS, i % HX_SLOTS, now);
  now->time = t;
  return now;
}

/* Computes one step of the method and its error; the state changes only in its counters. */
static void try_step(const hxStart *start, double h, hxState *state, hxTrial *trial) {
  const hxMethodRow *m = start->method;
  const hxModel *model = start->pressed;
  hxImplicit *implicit = &start->scratch->implicit;
  hxRate *k = start->scratch->k, *change = &start->scratch->change;
  hxPlantMotion *y = &start->scratch->y;
  hxWork *work = &start->scratch->work;
  hxCommand now;
  implicit->z = h * m->gamma, implicit->ahead = h;
  implicit->change = NULL; /* the first stage sets all slopes that later stages read */
  hx_clear_impulses(model, &trial->impulses);
  /* stages: y_i = y_0 + sum a_ij k_j, k_i by eq. 19 */
  for (int i = 0; i < m->stages; ++i) {
    const double t = start->t + m->c[i] * h;
    if (i > 0) {
      stage_arguments(model, start->y, h, m->a[i], m->gamma > 0.0 ? m->g[i] : NULL, k, i, y,
                      change);
      implicit->change = change;
    }
    const hxCommand *command = command_at(start, t, &now);
    hxImplicit *stage = m->gamma > 0.0 ? implicit : NULL;
    const hxKnown known = {i > 0 ? NULL : &state->moment, start->scratch->nodes,
                           i == 0 && start->scratch->is_soil_known ? start->scratch->soil.from
                                                                   : NULL};
    hx_dynamics_evaluate(model, start->contact, command, t, i > 0 ? y : start->y, &known, stage, 0,
                         work, &k[i]);
    hx_add_impulses(model, command, stage, work, h * m->b[i], &trial->impulses);
    state->evaluations += 1.0;
  }
  /* y_1 = y_0 + sum b_i k_i, error = |sum e_i k_i| */
  const int estimates = m->error_order > 0 && model->step == 0.0;
  hxStepEnd end = end_step(model, start->y, h, m, estimates, k, &trial->y);
  trial->error = estimates ? error_norm(model, &end) : 0.0;
  trial->y.actuator_work =
      start->y->actuator_work; /* measure_step() adds those of the accepted step */
  trial->y.push_work = start->y->push_work, trial->y.dissipated = start->y->dissipated;
  normalise_quaternions(&trial->y, &end.zeros);
  trial->is_finite = is_zero(end.zeros);
  if (model->projection == HX_PROJECTION_STEP) {
    hx_project(model, &trial->y);
    trial->is_finite = all_finite(&trial->y);
  }
}

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
  const double h = t_high - t_low, level = 0.5 * start->touch;
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
       deepest_open(start->model, start, depths) > start->touch && high - low > step_floor;
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
  hxPath path = {.model = start->pressed,
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
    hx_soil_yield(start->pressed, start->contact, h, &state->moment, end, ends, path.plastic);
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
static hxStatus advance(const hxStart *start, double h_max, double *next_step, hxState *state,
                        double *taken, int *event, char *message) {
  const hxModel *model = start->model;
  hxTrial *trial = &start->scratch->trial;
  double h = model->step > 0.0
                 ? h_max
                 : h_max / ceil(fmax(1.0, h_max / *next_step -
                                              1e-9)); /* equal steps; 1e-9: rounding adds no step */
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
  measure_step(start, seen, *taken, end, state, trial);
  state->motion = trial->y;
  state->steps += 1.0;
  if (hx_has_cells(model)) hx_cross_cells(seen, &depths, state);
  keep_nearest_points(model, state);
  if (model->has_soil) hx_depths_of_moment(seen, &state->contact, &state->moment, &depths);
  *event = hx_switch_contacts(seen, &depths, start->t + *taken, &state->moment, start->footprints,
                              state);
  if (*event && model->foot_rows > 1) hx_moment_shares(model, &state->contact, &state->moment);
  start->scratch->is_soil_known = model->has_soil && !*event && !hx_has_cells(model);
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

/* Returns the model with its first row of feet only, of those on blocks. Open contacts exert no
 * force, so steps without their rows have the same bits. */
HX_RARE const hxModel *first_row(const hxModel *model, hxModel *first) {
  *first = *model;
  first->rows = first->foot_rows = first->listed = 1;
  first->torso_rows = first->pair_rows = 0;
  return first;
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
                   .footprints = events->footprints,
                   .scratch = scratch};
  const int rows = model->listed, foot_rows = model->foot_rows;
  const hxModel *all_feet = rows > foot_rows ? events->feet : model,
                *first_feet = foot_rows > 1 ? first_row(model, &scratch->tops) : all_feet;
  start.touch = fmax(touch_depth[0], touch_depth[1] * model->tolerance);
  double first = fmin(state->first_step,
                      state->next_step); /* new inputs cause a larger error than the last step's */
  double *next_step = command->time < state->time ? &state->next_step : &first;
  while (state->time < t_end && !(events->stop && events->found)) {
    const double left = t_end - state->time;
    double taken;
    int event = 0;
    start.t = state->time;
    start.near = start.pressed = model;
    if (!is_pressed(model, &state->contact, foot_rows, rows)) {
      start.near = all_feet;
      start.pressed = is_pressed(model, &state->contact, 1, foot_rows) ? all_feet : first_feet;
    }
    const hxStatus status = advance(&start, left, next_step, state, &taken, &event, message);
    if (status != HX_OK) return status;
    if (next_step == &first) state->first_step = first, next_step = &state->next_step;
    const double t = state->time + taken;
    state->time = taken >= left || t_end - t < step_floor ? t_end : t;
    events->found |= event;
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
             "raise solver.step "
             "or make shorter calls",
             model->step, count, allowed);
    return HX_STEP_TOO_SMALL;
  }
  for (double i = 1.0; i <= count && !(events->stop && events->found); i += 1.0) {
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
  ((hxScratch *)scratch)->last_evaluation =
      state->evaluations + evaluations_allowed(model, t_end - command->time);
  for (int pack = 0; pack < HX_PACKS; ++pack) hx_forget_nodes(&((hxScratch *)scratch)->nodes[pack]);
  ((hxScratch *)scratch)->is_soil_known = 0;
  if (state->moment.stale != 0.0) hx_moment_update(model, state);
  keep_nearest_points(model, state);
  if (command->time == state->time && t_end > state->time && !events->continues)
    hx_reset_peaks(&state->measured);
  const hxStatus status = (model->step == 0.0 ? run_to : run_fixed)(
      model, command, ramp, t_end, events, state, scratch, message);
  memset(state->contact.nearest, 0, sizeof state->contact.nearest);
  /* off grids, whose points are searched leg by leg, packs that cover all slots have filled them */
  if (HX_PACKS * HX_LANES < HX_SLOTS || model->terrain) {
    fill_motion_slots(&state->motion);
    hx_fill_moment_slots(model, state);
  }
  hx_fill_integral_slots(state);
  return status;
}

#endif
