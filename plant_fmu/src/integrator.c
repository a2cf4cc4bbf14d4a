#include "integrator.h"

#include <math.h>
#include <stdio.h>

#include "dynamics.h"
#include "method.h"

static const double step_floor = 1e-11;     /* s  below this the error control gives up */
static const double most_steps[3] = {1e5, 1e5, 1e6}; /* 1, 1/s, 1  a call may take: at least, more for each second, at most */
static const double touch_depth = 1e-10;    /* m  a touch-down is found when the foot is in by less than this */

/* Sizes against which tolerance is relative: 0.1 m, 1 (quaternion), 1 m/s, 10 rad/s, and 0.1 J for the energy audit. */
static const double error_scale[HX_BODY_STATE] = {0.1, 0.1, 0.1, 1, 1, 1, 1, 1, 1, 1, 10, 10, 10};
static const double work_scale = 0.1;

/* Where a step starts, evaluated once however often the step is tried. */
typedef struct {
  const hxModel *model;
  const hxCommand *command;
  const hxContactState *contact;
  const hxMethodRow *method;
  double t;
  double last_step; /* count of steps, kept and rejected, at which the error control gives up */
  const hxMotion *y;
  hxWork work;
  hxMotion rate;
} hxStart;

typedef struct {
  hxMotion y;
  double error; /* of the step over the tolerance; 0 without an estimate */
} hxTrial;

/* y += s x, n a multiple of HX_SLOTS */
static inline void add_range(double *y, double s, const double *x, int n) {
  for (int i = 0; i < n; i += HX_LANES) hx_store(&y[i], hx_load(&y[i]) + s * hx_load(&x[i]));
}

static inline void add_scaled(hxMotion *y, double s, const hxMotion *x) { add_range(y->y, s, x->y, HX_MOTION_SIZE); }

/* the same for the entries first to last - 1 of every body's state: positions (HX_R, HX_V) or velocities (HX_V, HX_BODY_STATE) */
static void add_part(hxMotion *y, double s, const hxMotion *x, int first, int last) {
  for (int i = first; i < last; ++i) y->torso[i] += s * x->torso[i];
  for (int joint = 0; joint < HX_JOINTS; ++joint) add_range(y->link[joint][first], s, x->link[joint][first], (last - first) * HX_SLOTS);
}

static void combine(hxMotion *y, const hxMotion *base, const double *weights, const hxMotion *k, int count) {
  *y = *base;
  for (int j = 0; j < count; ++j)
    if (weights[j] != 0.0) add_scaled(y, weights[j], &k[j]);
}

/* Adds to k = h f what the implicit part of a stage changes; s = sum_{j<i} g_ij k_j. With dv = s + gamma h f and
 * dx = s + gamma h (f + N dv):  W u + D^T mu = h (G_v dv + G_x dx), D u = 0;  k_v = h f_v + u,  k_x = h f_x + h N (s_v + gamma k_v). */
static void implicit_stage(const hxImplicit *implicit, const hxMotion *y, double h, double gamma, const hxMotion *s, hxMotion *k) {
  hxMotion dv = *s, dx, u, carried;
  add_scaled(&dv, gamma, k);
  dx = dv;
  hx_position_rates(y, &dv, &carried);
  add_part(&dx, h * gamma, &carried, HX_R, HX_V);
  hx_implicit_solve(implicit, &dx, &dv, &u);
  add_part(k, h, &u, HX_V, HX_BODY_STATE);
  add_part(&dv, gamma * h, &u, HX_V, HX_BODY_STATE);
  hx_position_rates(y, &dv, &carried);
  add_part(k, h, &carried, HX_R, HX_V);
}

/* largest error over scale; NaN is the caller's to find */
static double error_norm(const hxMotion *error, double tolerance) {
  const double work = fmax(fmax(fabs(error->actuator_work), fabs(error->push_work)), fabs(error->dissipated));
  double worst = work / (tolerance * work_scale);
  for (int i = 0; i < HX_BODY_STATE; ++i) {
    double largest[HX_SLOTS] = {0.0}, e = fabs(error->torso[i]);
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      for (int slot = 0; slot < HX_PACKS * HX_LANES; slot += HX_LANES)
        hx_store(&largest[slot], hx_max(hx_load(&largest[slot]), hx_abs(hx_load(&error->link[joint][i][slot]))));
    for (int leg = 0; leg < HX_LEGS; ++leg) e = fmax(e, largest[leg]);
    worst = fmax(worst, e / (tolerance * error_scale[i]));
  }
  return worst;
}

static void normalise_quaternions(hxMotion *m) {
  double *p = &m->torso[HX_P];
  const double scale = 1.0 / sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3]);
  for (int i = 0; i < 4; ++i) p[i] *= scale;
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int slot = 0; slot < HX_PACKS * HX_LANES; slot += HX_LANES) {
      double (*q)[HX_SLOTS] = &m->link[joint][HX_P];
      const hxReal w = hx_load(&q[0][slot]), x = hx_load(&q[1][slot]), y = hx_load(&q[2][slot]), z = hx_load(&q[3][slot]);
      const hxReal s = 1.0 / hx_sqrt(w * w + x * x + y * y + z * z);
      hx_store(&q[0][slot], s * w), hx_store(&q[1][slot], s * x), hx_store(&q[2][slot], s * y), hx_store(&q[3][slot], s * z);
    }
}

static void fill_motion_slots(hxMotion *m) {
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int i = 0; i < HX_BODY_STATE; ++i) hx_fill_slots(m->link[joint][i]);
}

/* One step of the method from a start, kept or not. */
static void try_step(hxStart *start, double h, hxState *state, hxTrial *trial) {
  const hxMethodRow *m = start->method;
  hxMotion k[HX_STAGES], y, zero;
  hxImplicit implicit;
  hxWork work;
  memset(&zero, 0, sizeof zero);
  if (m->gamma > 0.0) {
    hx_foot_ahead(start->model, start->contact, h, &start->work);
    hx_implicit_factorise(start->model, &start->work, h * m->gamma, &implicit);
  }
  for (int i = 0; i < m->stages; ++i) {
    k[i] = start->rate;
    if (i > 0) {
      combine(&y, start->y, m->a[i], k, i);
      hx_dynamics_evaluate(start->model, start->contact, start->command, start->t + m->c[i] * h, &y, 0, &work, &k[i]);
      state->evaluations += 1.0;
    }
    for (int j = 0; j < HX_MOTION_SIZE; j += HX_LANES) hx_store(&k[i].y[j], h * hx_load(&k[i].y[j]));
    if (m->gamma > 0.0) {
      combine(&y, &zero, m->g[i], k, i);
      implicit_stage(&implicit, start->y, h, m->gamma, &y, &k[i]);
    }
  }
  combine(&trial->y, start->y, m->b, k, m->stages);
  combine(&y, &zero, m->e, k, m->stages);
  trial->error = m->error_order > 0 && start->model->step == 0.0 ? error_norm(&y, start->model->tolerance) : 0.0;
  normalise_quaternions(&trial->y);
  fill_motion_slots(&trial->y);
}

/* how deep the deepest open foot is in the ground */
static double open_depth(const hxStart *start, const hxMotion *y) {
  double delta[HX_SLOTS], ddelta[HX_SLOTS], depth = -HUGE_VAL;
  hx_feet(start->model, y, delta, ddelta);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    if (start->contact->closed[leg] == 0.0 && delta[leg] > depth) depth = delta[leg];
  return depth;
}

/* Shortens a step that ends below the ground to one that ends on it: false position on the step itself, with Illinois' weights, which are
 * depths but for being halved where the same side moves twice. */
static double find_touchdown(hxStart *start, double h, hxState *state, hxTrial *trial) {
  double low = 0.0, high = h, depth = open_depth(start, &trial->y);
  double weight_low = open_depth(start, start->y), weight_high = depth;
  int side = 0;
  while (depth > touch_depth && high - low > step_floor) {
    double middle = low + (high - low) * weight_low / (weight_low - weight_high);
    if (!(middle > low && middle < high)) middle = 0.5 * (low + high);
    hxTrial nearer;
    try_step(start, middle, state, &nearer);
    const double found = open_depth(start, &nearer.y);
    if (found > 0.0) {
      high = middle, depth = weight_high = found, *trial = nearer;
      weight_low *= side == 1 ? 0.5 : 1.0, side = 1;
    } else {
      low = middle, weight_low = found;
      weight_high *= side == -1 ? 0.5 : 1.0, side = -1;
    }
  }
  return high;
}

/* Factor by which the step may change, from the error of an attempt. */
static double step_factor(const hxMethodRow *method, double error) {
  if (isnan(error)) return 0.2;
  const double factor = 0.9 * pow(error, -1.0 / (method->error_order + 1));
  return fmin(5.0, fmax(0.2, factor));
}

/* Steps that a call over a time may take: no call runs on for ever. */
static double steps_allowed(double time) { return fmin(most_steps[0] + most_steps[1] * time, most_steps[2]); }

/* Why a step of h from t cannot be had. */
static hxStatus give_up(const hxTrial *trial, double t, double h, char *message) {
  const int lost = isnan(trial->error);
  snprintf(message, HX_MESSAGE_SIZE,
           lost ? "the motion is not finite any more at t = %.9g s (step %.3g s); check masses, stiffness and inputs, or let the error "
                  "control choose the step (solver.step = 0)"
                : "the error control gives up at t = %.9g s (step %.3g s), where it finds no step that takes the motion on in reasonable "
                  "time; check the inputs for extreme values, raise solver.tolerance or use a linearly implicit solver.method",
           t, h);
  return lost ? HX_NOT_FINITE : HX_STEP_TOO_SMALL;
}

static int all_finite(const hxMotion *y) {
  hxReal sum = hx_splat(0.0);
  for (int i = 0; i < HX_MOTION_SIZE; i += HX_LANES) sum = sum + 0.0 * hx_load(&y->y[i]);
  double total = 0.0;
  for (int lane = 0; lane < HX_LANES; ++lane) total += hx_lane(sum, lane);
  return total == 0.0;
}

/* One accepted step of at most h_max, shortened by the error control and by touch-downs; *taken is its length. */
static hxStatus advance(hxStart *start, double h_max, hxState *state, double *taken, char *message) {
  const hxModel *model = start->model;
  hxTrial trial;
  hx_dynamics_evaluate(model, start->contact, start->command, start->t, start->y, 0, &start->work, &start->rate);
  state->evaluations += 1.0;
  double h = model->step > 0.0 ? h_max : fmin(h_max, state->next_step);
  trial.error = 0.0;
  for (;;) {
    if (model->step == 0.0 && state->steps + state->rejected >= start->last_step) return give_up(&trial, start->t, h, message);
    try_step(start, h, state, &trial);
    if (!all_finite(&trial.y)) trial.error = NAN;
    if (trial.error <= 1.0) break;
    state->rejected += 1.0;
    h *= fmin(step_factor(start->method, trial.error), 0.9);
    if (h < step_floor || (model->step > 0.0 && isnan(trial.error))) return give_up(&trial, start->t, h, message);
  }
  if (model->step == 0.0) {
    const double next = fmin(model->step_max, h * step_factor(start->method, fmax(trial.error, 1e-10)));
    /* a step cut short by the end of the interval says little against a longer one */
    state->next_step = h < h_max ? next : fmax(next, state->next_step);
  }
  *taken = open_depth(start, &trial.y) > 0.0 ? find_touchdown(start, h, state, &trial) : h;
  state->motion = trial.y;
  state->steps += 1.0;
  return HX_OK;
}

static void switch_contacts(const hxModel *model, hxState *state) {
  double delta[HX_SLOTS], ddelta[HX_SLOTS];
  hx_feet(model, &state->motion, delta, ddelta);
  state->touchdowns += hx_contact_switch(model, delta, ddelta, &state->contact);
}

/* From state->time to t_end; the last step lands on it exactly. */
static hxStatus run_to(const hxModel *model, const hxCommand *command, double t_end, hxState *state, char *message) {
  hxMotion y;
  hxStart start; /* 30 kB: not cleared, evaluated anew at every step */
  start.model = model, start.command = command, start.contact = &state->contact, start.method = hx_method(model->method), start.y = &y;
  start.last_step = state->steps + state->rejected + steps_allowed(t_end - state->time);
  while (state->time < t_end) {
    const double left = t_end - state->time;
    double taken;
    y = state->motion;
    start.t = state->time;
    const hxStatus status = advance(&start, left, state, &taken, message);
    if (status != HX_OK) return status;
    const double t = state->time + taken;
    state->time = taken >= left || t_end - t < step_floor ? t_end : t;
    switch_contacts(model, state);
  }
  return HX_OK;
}

HX_LOCAL hxStatus hx_integrate(const hxModel *model, const hxCommand *command, double t_end, hxState *state, char *message) {
  if (model->step == 0.0) return run_to(model, command, t_end, state, message);
  const double t_start = state->time;
  const double count = fmax(1.0, ceil((t_end - t_start) / model->step - 1e-9));
  if (count > steps_allowed(t_end - t_start)) {
    snprintf(message, HX_MESSAGE_SIZE,
             "solver.step: got %.3g s, which makes %.0f steps of this call, expected at most %.0f; raise solver.step "
             "or make shorter calls",
             model->step, count, steps_allowed(t_end - t_start));
    return HX_STEP_TOO_SMALL;
  }
  for (double i = 1.0; i <= count; i += 1.0) {
    const double t = i < count ? t_start + (t_end - t_start) * (i / count) : t_end;
    const hxStatus status = run_to(model, command, t, state, message);
    if (status != HX_OK) return status;
  }
  return HX_OK;
}
