/* foot_measure.h - measurements of a foot along a step: slip, impulse and peaks (eq. 28), loading
 * rate of a landing (eq. 29), use of the friction cone (eq. 30) */
#ifndef HX_FOOT_MEASURE_H
#define HX_FOOT_MEASURE_H

#include "works.h"

static const double landing_sample = 1e-4; /* s  between two samples of a landing's force */
static const double nearly_sliding = 0.9;  /* 1  of the friction cone */

/* Returns the velocity at x in [0, 1] by the parabola through both ends with this mean (eq. 28). */
static inline hxVec3 parabola(hxVec3 from, hxVec3 to, hxVec3 mean, double x) {
  const hxVec3 ends = hx_add_scaled(hx_scale(hx_splat(1.0 - x * (4.0 - 3.0 * x)), from),
                                    hx_splat(x * (3.0 * x - 2.0)), to);
  return hx_add_scaled(ends, hx_splat(6.0 * x * (1.0 - x)), mean);
}

/* Returns the part of a across the normal. */
static inline hxVec3 along_ground(hxVec3 a, hxVec3 normal) {
  return hx_add_scaled(a, -hx_dot(normal, a), normal);
}

/* Returns the share of an interval in which a linearly changing force exceeds a limit, and the
 * middle of that part. */
static inline hxReal share_above(hxReal from, hxReal to, double limit, hxReal *middle) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  const hxReal a = from - limit, b = to - limit;
  const hxReal crossing = hx_abs(a) / hx_max(hx_abs(a) + hx_abs(b), hx_splat(1e-300));
  const hxMask first = hx_less(zero, a), last = hx_less(zero, b);
  const hxReal low = hx_select(first, zero, hx_select(last, crossing, one));
  const hxReal high = hx_select(last, one, hx_select(first, crossing, low));
  *middle = 0.5 * (low + high);
  return high - low;
}

/* A contact of feet along a step, legs in lanes. */
typedef struct {
  hxVec3 slip_from, slip_to, mean_slip;     /* m/s */
  hxReal delta, slope_from, rise, slope_to; /* m  the cubic of the depth */
  hxReal share, share_rise;                 /* 1  on blocks */
  hxContactLawAt law;
  int row, slot;
} hxFootPath;

/* Returns the path of a row of feet. */
HX_INLINE hxFootPath foot_path(const hxPath *path, int row, int slot) {
  const hxContactMoment *from = &path->from->contact[row], *to = &path->to->contact[row];
  const hxReal h = hx_splat(path->h), per_step = hx_splat(1.0 / path->h);
  const hxVec3 way = hx_sub3(hx_load_vec3(to->centre, slot), hx_load_vec3(from->centre, slot));
  const hxVec3 along = along_ground(way, mean_vec3(from->normal, to->normal, slot));
  const hxReal delta = hx_load(&from->delta[slot]);
  const int shares = has_shares(path, row);
  const hxReal share = shares ? hx_load(&path->from->share[row][slot]) : hx_splat(1.0);
  return (hxFootPath){
      .slip_from = hx_load_vec3(from->slip, slot),
      .slip_to = hx_load_vec3(to->slip, slot),
      .mean_slip = hx_add3(hx_scale(per_step, along), mean_vec3(from->roll, to->roll, slot)),
      .delta = delta,
      .slope_from = h * hx_load(&from->ddelta[slot]),
      .rise = hx_load(&to->delta[slot]) - delta,
      .slope_to = h * hx_load(&to->ddelta[slot]),
      .share = share,
      .share_rise = shares ? hx_load(&path->to->share[row][slot]) - share : hx_splat(0.0),
      .law = hx_law_at(path->contact, row, slot),
      .row = row,
      .slot = slot};
}

/* Normal force of feet, its rate and the sliding speed at a point of a step. */
typedef struct {
  hxReal force, rate, speed;
} hxFootInstant;

/* Returns the virgin curves under feet at an end of a step, NULL within it. */
static inline const hxSoilCurves *virgin_at(const hxPath *path, int slot, double x) {
  return x == 0.0   ? &path->ends->from[slot / HX_LANES]
         : x == 1.0 ? &path->ends->to[slot / HX_LANES]
                    : NULL;
}

/* Computes them for a row of feet at x in [0, 1]. */
HX_INLINE hxFootInstant foot_at(const hxPath *path, const hxFootPath *foot, double x) {
  const hxReal per_step = hx_splat(1.0 / path->h);
  const hxReal bends = path->h < shortest_bend ? hx_splat(0.0) : per_step * per_step;
  const hxCubic depth =
      cubic(foot->delta, foot->slope_from, foot->rise, foot->slope_to, hx_splat(x));
  const hxReal approach = per_step * depth.rate;
  hxContactLawAt law = foot->law;
  if (has_shares(path, foot->row)) law.stiffness *= foot->share + x * foot->share_rise;
  hxNormalForce f = hx_normal_force(law, depth.value, approach);
  if (has_soil(path->model, foot->row))
    f = contact_load(path->contact, foot->slot, depth.value, approach,
                     virgin_at(path, foot->slot, x), f);
  const hxVec3 slip = parabola(foot->slip_from, foot->slip_to, foot->mean_slip, x);
  return (hxFootInstant){f.force, f.stiffness * approach + f.viscosity * (bends * depth.second),
                         hx_sqrt(hx_dot(slip, slip))};
}

/* The paths of further closed contacts of a pack of feet. */
typedef struct {
  int count;
  hxFootPath foot[HX_FOOT_ROWS - 1];
} hxFurtherPaths;

HX_RARE void further_paths(const hxPath *path, int slot, hxFurtherPaths *further) {
  for (int k = 1; k < path->model->foot_rows; ++k)
    if (is_used(path->contact, path->model->row[k], slot))
      further->foot[further->count++] = foot_path(path, path->model->row[k], slot);
}

/* Adds them to the first row's; the sliding speed is that of the largest force. */
HX_RARE hxFootInstant with_further_feet(const hxPath *path, const hxFurtherPaths *further, double x,
                                        hxFootInstant sum) {
  hxReal largest = sum.force;
  for (int k = 0; k < further->count; ++k) {
    const hxFootInstant now = foot_at(path, &further->foot[k], x);
    sum.speed = hx_select(hx_less(largest, now.force), now.speed, sum.speed);
    largest = hx_max(largest, now.force);
    sum.force += now.force, sum.rate += now.rate;
  }
  return sum;
}

/* Measures one pack of feet: slip under load, impulse, peaks (eq. 28). */
HX_INLINE void measure_feet(const hxPath *path, int slot, hxMeasured *measured) {
  const hxModel *model = path->model;
  const hxReal zero = hx_splat(0.0), h = hx_splat(path->h);
  const hxFootPath foot = foot_path(path, HX_FOOT, slot);
  hxReal peak = hx_load(&measured->peak_force[slot]),
         steepest = hx_load(&measured->peak_rate[slot]);
  hxReal impulse = zero, slipped = zero;
  hxReal last_force = zero, last_speed = zero;
  hxFurtherPaths further;
  further.count = 0;
  if (model->foot_rows > 1) further_paths(path, slot, &further);
  /* impulse, peaks and slip under load by Simpson's rule (eq. 28) */
  for (int node = 0; node <= INTERVALS; ++node) {
    const double x = (double)node / INTERVALS;
    hxFootInstant now = foot_at(path, &foot, x);
    if (further.count) now = with_further_feet(path, &further, x, now);
    peak = hx_max(peak, now.force);
    steepest = hx_max(steepest, now.rate);
    impulse += hx_splat(path->h * foot_weight[node]) * now.force;
    if (node > 0) {
      hxReal middle;
      const hxReal share = share_above(last_force, now.force, model->load_threshold, &middle);
      slipped += (h * (1.0 / INTERVALS)) * share * (last_speed + middle * (now.speed - last_speed));
    }
    last_force = now.force, last_speed = now.speed;
  }
  hx_store(&measured->peak_force[slot], peak);
  hx_store(&measured->peak_rate[slot], steepest);
  hx_store(&measured->impulse[slot], hx_load(&measured->impulse[slot]) + impulse);
  hx_store(&measured->slip_distance[slot], hx_load(&measured->slip_distance[slot]) + slipped);
}

/* Returns the shares of a leg's contact at x in [0, 1] of a step, samples in lanes. */
HX_INLINE hxReal share_within(const hxPath *path, int row, int leg, hxReal x) {
  const double from = path->from->share[row][leg], to = path->to->share[row][leg];
  return from + x * (to - from);
}

/* Returns the normal forces of a leg's contact with soil, N, samples in lanes. */
HX_RARE hxReal soil_within(const hxPath *path, int leg, const hxReal *depth, const hxReal *rate) {
  hxSoils soil;
  hxReal numbers[HX_SOIL_SIZE];
  for (int i = 0; i < HX_SOIL_SIZE; ++i) numbers[i] = hx_splat(path->contact->soil[i][leg]);
  memcpy(&soil, numbers, sizeof soil);
  return hx_soil_normal_force(&soil, hx_splat(path->contact->plastic[leg]), *depth, *rate / path->h,
                              hx_virgin_force(&soil, *depth))
      .force;
}

/* Returns the normal forces of a leg's contact at x in [0, 1] of a step, N, samples in lanes. */
HX_INLINE hxReal force_within(const hxPath *path, int row, int leg, hxReal x) {
  const hxContactMoment *from = &path->from->contact[row], *to = &path->to->contact[row];
  const double h = path->h, delta = from->delta[leg];
  const hxCubic depth = cubic(hx_splat(delta), hx_splat(h * from->ddelta[leg]),
                              hx_splat(to->delta[leg] - delta), hx_splat(h * to->ddelta[leg]), x);
  const hxContactState *contact = path->contact;
  if (has_soil(path->model, row) && is_in_soil(contact, leg))
    return soil_within(path, leg, &depth.value, &depth.rate);
  hxContactLawAt law = {hx_splat(contact->closed[row][leg]), hx_splat(contact->damping[row][leg]),
                        hx_splat(contact->stiffness[row][leg])};
  if (has_shares(path, row)) law.stiffness *= share_within(path, row, leg, x);
  return hx_normal_force(law, depth.value, hx_splat(1.0 / h) * depth.rate).force;
}

/* Takes one sample of a leg's landing: the force and its rise over the window that ends there. */
HX_INLINE void take_landing_sample(int leg, int n, double force, hxMeasured *measured) {
  double *oldest = &measured->landing_force[n % HX_RISE_SAMPLES][leg];
  const double rate = (force - *oldest) / (HX_RISE_SAMPLES * landing_sample);
  measured->landing_rate[leg] = fmax(measured->landing_rate[leg], rate);
  measured->landing_left[leg] -= 1.0;
  *oldest = force;
}

/* Takes the samples of a leg's landing that lie within a step, several at once in lanes: forces at
 * times t_n after touch-down and their rise over the window that ends there (eq. 29). Forces before
 * touch-down are 0. */
static inline void measure_landing(const hxPath *path, int leg, hxMeasured *measured) {
  while (measured->landing_left[leg] > 0.0) {
    const int first = LANDING_SAMPLES + 1 - (int)measured->landing_left[leg];
    double x[HX_LANES], sample[HX_LANES];
    for (int lane = 0; lane < HX_LANES; ++lane)
      x[lane] = (measured->landed_at[leg] + (first + lane) * landing_sample - path->t) / path->h;
    if (x[0] > 1.0) return;
    const hxReal at = hx_max(hx_load(x), hx_splat(0.0));
    hxReal force = hx_splat(0.0);
    for (int k = 0; k < path->model->foot_rows; ++k)
      if (k == 0 || path->contact->closed[path->model->row[k]][leg] != 0.0)
        force += force_within(path, path->model->row[k], leg, at);
    hx_store(sample, force);
    for (int lane = 0; lane < HX_LANES && measured->landing_left[leg] > 0.0; ++lane) {
      if (x[lane] > 1.0) return;
      take_landing_sample(leg, first + lane, sample[lane], measured);
    }
  }
}

/* ---- the friction cone ---- */

/* Returns the real-valued bin index of a share |f_t|/(mu f_n); its whole part is the bin. Bin i
 * begins at 0.9 (i/30)^2, so bins are finer for small shares; the last bin holds all shares above
 * 0.9. */
static inline hxReal hx_cone_place(hxReal share) {
  const double last = HX_CONE_BINS - 1;
  return hx_min(last * hx_sqrt((1.0 / nearly_sliding) * share), hx_splat(last));
}

static inline int hx_has_cone(const hxModel *model) {
  return (model->mu > 0.0 && hx_friction_kind(model->friction_law).has_friction) || model->has_soil;
}

/* Returns the largest impulse of friction, on soil of shear (eq. 46), under a normal impulse. */
HX_RARE hxReal cone_with_soil(const hxPath *path, int slot, hxReal along, hxReal rigid) {
  const hxMask in = hx_in_soil(path->contact, slot);
  if (!hx_any(in)) return rigid;
  const hxReal from = hx_load(&path->from->contact[HX_FOOT].delta[slot]),
               to = hx_load(&path->to->contact[HX_FOOT].delta[slot]);
  const hxSoils soil = hx_soils_under(path->contact, slot);
  const hxReal z = hx_max(0.5 * (from + to), hx_splat(0.0));
  return hx_select(in, soil.friction * along + path->h * hx_shear_base(&soil, z), rigid);
}

HX_INLINE hxReal cone(const hxPath *path, int row, int slot, hxReal along) {
  const hxReal rigid = hx_load(&path->contact->mu[row][slot]) * along;
  return has_soil(path->model, row) ? cone_with_soil(path, slot, along, rigid) : rigid;
}

/* Adds the step to the time of a row of feet under load, by the share of the cone that its
 * impulses use (eq. 30). */
static inline void measure_cone(const hxPath *path, int row, const hxImpulses *impulse,
                                hxMeasured *measured) {
  const hxContactMoment *from = &path->from->contact[row], *to = &path->to->contact[row];
  double place[HX_SLOTS], pressed[HX_SLOTS];
  if (!hx_has_cone(path->model)) return;
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const int slot = pack * HX_LANES;
    const hxVec3 normal = mean_vec3(from->normal, to->normal, slot);
    const hxReal along = hx_dot(impulse->contact[row][pack], normal);
    const hxVec3 across = hx_add_scaled(impulse->contact[row][pack], -along, normal);
    const hxReal share =
        hx_sqrt(hx_dot(across, across)) / hx_max(cone(path, row, slot, along), hx_splat(1e-300));
    hx_store(&place[slot], hx_cone_place(share));
    hx_store(&pressed[slot], along);
  }
  for (int leg = 0; leg < HX_LEGS; ++leg)
    if (pressed[leg] > path->h * path->model->load_threshold)
      measured->cone_time[(int)place[leg]] += path->h;
}

#endif
