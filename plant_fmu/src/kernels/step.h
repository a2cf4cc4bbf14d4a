/* step.h - one step of a method from a start, and its error (eq. 19 to 22); models/step.py
 * and models/stage.py are the readable form */
#ifndef HX_STEP_H
#define HX_STEP_H

#include "../contact_law.h"
#include "../measure/measure.h"
#include "../method.h"

/* Scales of the error norm (eq. 22): 0.1 m, 1 (quaternion), 1 m/s and 10 rad/s. */
static const double error_scale[HX_BODY_STATE] = {0.1, 0.1, 0.1, 1, 1, 1, 1, 1, 1, 1, 10, 10, 10};
static const double bristle_scale = 10.0; /* 1  in preslidings */

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
  hxPatchNodes nodes[HX_PACKS]; /* around the feet, of a call */
  hxSoilEnds soil;              /* of the last step */
  int is_soil_known;            /* 1: soil.from belongs to the present depths of feet */
  double last_evaluation;       /* number at which the call's limit is spent */
} hxScratch;

/* Start of a step and the data that all its trials share. */
typedef struct {
  const hxModel *model; /* with all rows of contacts */
  const hxModel *near;  /* without the rows of bodies and pairs while none of them touches */
  const hxCommand *command, *ramp; /* command and its change per second; ramp NULL: constant */
  const hxContactState *contact;
  const hxMethodRow *method;
  double t;
  double touch_depth; /* m  largest depth of a contact that has just touched down */
  const hxPlantMotion *y;
  hxEvents *events;
  int is_last; /* 1: the call ends with this interval */
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
 * compiler. Bristles only where the model has them. */
HX_INLINE void stage_of_n(const hxModel *model, const hxPlantMotion *from, double h,
                          const double *a, const double *g, const hxRate *k, int n,
                          hxPlantMotion *y, hxRate *change) {
  enum { BRISTLES = HX_TURN_SIZE + HX_BODIES_SIZE };
  const int end = has_bristles(model, HX_FOOT) ? BRISTLES + HX_BRISTLE_SIZE : BRISTLES;
  hxReal w_y[HX_STAGES], weights[HX_STAGES];
  const hxReal *w_change = g ? weights : NULL;
  weights_of(w_y, h, a, n);
  if (g) weights_of(weights, h, g, n);
  for (int i = 0; g && i < HX_TURN_SIZE; i += HX_LANES)
    hx_store(&change->y[i], combined(hx_splat(0.0), weights, k, n, i));
  stage_entries(from, w_y, w_change, k, n, HX_TURN_SIZE, end, y, change);
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

/* Computes the same of the bristles. Where they do not move, because the model has no law for them,
 * they stay. */
HX_INLINE void end_of_bristles(const hxModel *model, const hxPlantMotion *from, const hxReal *b,
                               const hxReal *e, int n, int estimates, const hxRate *k,
                               hxPlantMotion *y, hxStepEnd *found) {
  const int move = has_bristles(model, HX_FOOT);
  const double scale = bristle_scale * model->bristle_length;
  for (int i = 0; i < HX_BRISTLE_SIZE; i += HX_LANES) {
    const int at = HX_BODIES_SIZE + i;
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
  hxStepEnd found = {hx_splat(0.0), hx_splat(0.0), 0.0};
  hxReal b[HX_STAGES], e[HX_STAGES];
  weights_of(b, h, m->b, n);
  weights_of(e, h, m->e, n);
  end_of_bodies(from, b, e, n, estimates, k, y, &found);
  end_of_bristles(model, from, b, e, n, estimates, k, y, &found);
  return found;
}

/* Calls step_of_n with the number of stages as a constant. */
static inline hxStepEnd end_step(const hxModel *model, const hxPlantMotion *from, double h,
                                 const hxMethodRow *m, int estimates, const hxRate *k,
                                 hxPlantMotion *y) {
  switch (m->stages) {
  case 2:
    return step_of_n(model, from, h, m, 2, estimates, k, y);
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

/* Returns the command at time t, with drives in kinematic mode as of move_drive. */
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
  const hxModel *model = start->near;
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
    hx_dynamics_evaluate(model, start->contact, command, t, i > 0 ? y : start->y, &known, stage,
                         HX_RATES, work, &k[i]);
    hx_add_impulses(model, command, stage, work, h * m->b[i], &trial->impulses);
    state->evaluations += 1.0;
  }
  /* y_1 = y_0 + sum b_i k_i, error = |sum e_i k_i| */
  const int estimates = model->step == 0.0;
  hxStepEnd end = end_step(model, start->y, h, m, estimates, k, &trial->y);
  trial->error = estimates ? error_norm(model, &end) : 0.0;
  /* measure_step() adds those of the accepted step */
  trial->y.actuator_work = start->y->actuator_work;
  trial->y.push_work = start->y->push_work, trial->y.dissipated = start->y->dissipated;
  normalise_quaternions(&trial->y, &end.zeros);
  trial->is_finite = is_zero(end.zeros);
  if (model->projection == HX_PROJECTION_STEP) {
    hx_project(model, &trial->y);
    trial->is_finite = all_finite(&trial->y);
  }
}

#endif
