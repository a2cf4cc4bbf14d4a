/* planned_squeeze.h - forces by which the standing legs squeeze each other, so that friction
 * carries a part of the servos' load. Python: controller/comply/planned_squeeze.py. */
#ifndef HX_PLANNED_SQUEEZE_H
#define HX_PLANNED_SQUEEZE_H

#include "load_plan.h"

typedef struct hxPlannedSqueeze {
  double friction; /* 1  coefficient that is believed */
  double torque;   /* N m  of a tripod's load at the arm of the torso's height */
} hxPlannedSqueeze;

/* 1  share of its friction that a foot is planned to use at most */
static const double most_friction = 0.7;
/* N  floor of a change of a force that a factor is divided by */
static const double least_push = 1e-12;

/* weight: of the robot [N]; depth: of the ground below the torso's origin in the stance [m]. */
static inline void hx_planned_squeeze_compile(const hxControllerDefinition *definition,
                                              double weight, double depth,
                                              hxPlannedSqueeze *model) {
  const double tripod_share = 1.0 / 3.0; /* 1  of the weight: the load of the comparison */
  model->friction = definition->friction;
  model->torque = depth * tripod_share * weight;
}

/* Computes xx, xy, yy of (J J^T + price/f_n^2)^-1, 0 without a load (C42). price: of the use of
 * friction [N2 m2]. */
static inline void yielding(const double lever[HX_JOINTS][3], double normal, double price,
                            double B[3]) {
  const double n = normal * normal;
  double xx = 0.0, xy = 0.0, yy = 0.0;
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    const double *row = lever[joint];
    xx += row[0] * row[0];
    xy += row[0] * row[1];
    yy += row[1] * row[1];
  }
  xx = n * xx + price;
  xy = n * xy;
  yy = n * yy + price;
  const double part = n / (xx * yy - xy * xy);
  B[0] = part * yy;
  B[1] = -part * xy;
  B[2] = part * xx;
}

/* Returns the horizontal force [N] that a leg by itself would choose. */
static inline hxPlane wanted(const double lever[HX_JOINTS][3], const double torque[HX_JOINTS],
                             double normal, const double B[3]) {
  double gx = 0.0, gy = 0.0;
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    /* for the horizontal force */
    const double left = torque[joint] - lever[joint][2] * normal;
    gx += lever[joint][0] * left;
    gy += lever[joint][1] * left;
  }
  return hx_plane(B[0] * gx + B[1] * gy, B[1] * gx + B[2] * gy);
}

/* Subtracts the sum and the moment of changes of forces, by multipliers. arm: of the feet about the
 * centre of load [m]. */
static inline void balance(const hxPlane arm[HX_LEGS], const double B[HX_LEGS][3],
                           hxPlane change[HX_LEGS]) {
  double S[6] = {0.0}, needed[3] = {0.0}, x[3], tx[HX_LEGS], ty[HX_LEGS];
  for (int k = 0; k < HX_LEGS; ++k) {
    tx[k] = B[k][1] * arm[k].x - B[k][0] * arm[k].y;
    ty[k] = B[k][2] * arm[k].x - B[k][1] * arm[k].y;
    S[0] += B[k][0];
    S[1] += B[k][1];
    S[2] += tx[k];
    S[3] += B[k][2];
    S[4] += ty[k];
    S[5] += ty[k] * arm[k].x - tx[k] * arm[k].y;
    needed[0] += change[k].x;
    needed[1] += change[k].y;
    needed[2] += hx_across(arm[k], change[k]);
  }
  hx_shares_solve(S, needed, x);
  for (int k = 0; k < HX_LEGS; ++k) {
    change[k].x -= B[k][0] * x[0] + B[k][1] * x[1] + tx[k] * x[2];
    change[k].y -= B[k][1] * x[0] + B[k][2] * x[1] + ty[k] * x[2];
  }
}

/* Returns the factor on all changes that keeps each foot within its friction (C43). */
static inline double limit(const hxPlannedSqueeze *model, const hxShares *shares,
                           const hxPlane change[HX_LEGS]) {
  double factor = 1.0;
  for (int k = 0; k < HX_LEGS; ++k) {
    const double most = most_friction * model->friction * shares->normal[k];
    if (shares->normal[k] > least_load)
      factor = hx_smaller(factor, (most - hx_length(shares->push[k])) /
                                      hx_larger(hx_length(change[k]), least_push));
  }
  return hx_larger(factor, 0.0);
}

/* Adds the squeeze to shares without one (C42, C43).
 * squeeze: weight of the torques, in [0, 1). */
static inline void hx_planned_squeeze_add(const hxPlannedSqueeze *model,
                                          const hxPlane feet[HX_LEGS], const hxDemand *demand,
                                          double squeeze, hxShares *shares) {
  if (!(squeeze > 0.0) || !(model->friction > 0.0)) return;
  const double used = model->torque / model->friction, price = (1.0 / squeeze - 1.0) * used * used;
  double B[HX_LEGS][3], total = 0.0;
  hxPlane arm[HX_LEGS], change[HX_LEGS], centre = {0.0, 0.0};
  for (int k = 0; k < HX_LEGS; ++k) {
    total += shares->normal[k];
    centre = hx_plane_add(centre, hx_scaled(feet[k], shares->normal[k]));
  }
  centre = hx_scaled(centre, 1.0 / hx_larger(total, least_load));
  for (int k = 0; k < HX_LEGS; ++k) {
    const double (*lever)[3] = demand->lever[k];
    arm[k] = hx_plane_sub(feet[k], centre);
    yielding(lever, shares->normal[k], price, B[k]);
    const hxPlane chosen = wanted(lever, demand->torque[k], shares->normal[k], B[k]);
    change[k] = hx_plane_sub(chosen, shares->push[k]);
  }
  balance((const hxPlane *)arm, (const double (*)[3])B, change);
  const double factor = limit(model, shares, change);
  for (int k = 0; k < HX_LEGS; ++k) {
    shares->squeeze[k] = hx_scaled(change[k], factor);
    shares->push[k] = hx_plane_add(shares->push[k], shares->squeeze[k]);
  }
}

#endif
