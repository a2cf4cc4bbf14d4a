#include "planned_squeeze.h"

/* 1, share of its friction that a foot is planned to use at most */
static const double most_friction = 0.7;
/* N, floor of a change of a force that a factor is divided by */
static const double least_push = 1e-12;
static const double least_load = 1e-6; /* N, a smaller load gives no factor */

void hx_planned_squeeze_compile(double friction, double weight, double depth,
                                hxPlannedSqueeze *model) {
  const double tripod_share = 1.0 / 3.0; /* 1, of the weight */
  model->friction = friction;
  model->torque = depth * tripod_share * weight;
}

/* Computes xx, xy, yy of (J J^T + price/f_n^2)^-1, 0 without a load (C42). price [N2 m2]. */
static void yielding(const double lever[HX_JOINTS][3], double normal, double price, double B[3]) {
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

/* Returns the factor on all changes that keeps each foot within its friction (C43). */
static double limit(const hxPlannedSqueeze *model, const hxShares *shares,
                    const hxPlane change[HX_LEGS]) {
  double factor = 1.0;
  for (int k = 0; k < HX_LEGS; ++k) {
    if (!(shares->normal[k] > least_load)) continue;
    const double room = most_friction * model->friction * shares->normal[k] -
                        sqrt(hx_square(shares->push[k]));
    factor = fmin(factor, room / fmax(sqrt(hx_square(change[k])), least_push));
  }
  return fmax(factor, 0.0);
}

void hx_planned_squeeze_add(const hxPlannedSqueeze *model, const hxPlane feet[HX_LEGS],
                            const hxDemand *demand, double squeeze, hxShares *shares) {
  if (!(squeeze > 0.0) || !(model->friction > 0.0)) return;
  const double used = model->torque / model->friction, price = (1.0 / squeeze - 1.0) * used * used;
  double B[HX_LEGS][3], T[HX_LEGS][2], S[6] = {0.0}, needed[3] = {0.0}, x[3], total = 0.0;
  hxPlane change[HX_LEGS], centre = {0.0, 0.0};
  for (int k = 0; k < HX_LEGS; ++k) {
    total += shares->normal[k];
    centre = hx_plane_add(centre, hx_scaled(feet[k], shares->normal[k]));
  }
  centre = hx_scaled(centre, 1.0 / fmax(total, least_load));
  for (int k = 0; k < HX_LEGS; ++k) {
    const double (*lever)[3] = demand->lever[k];
    const hxPlane arm = hx_plane_sub(feet[k], centre);
    double gx = 0.0, gy = 0.0;
    yielding(lever, shares->normal[k], price, B[k]);
    /* torques that remain for the horizontal forces */
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double left = demand->torque[k][joint] - lever[joint][2] * shares->normal[k];
      gx += lever[joint][0] * left;
      gy += lever[joint][1] * left;
    }
    const hxPlane wanted = {B[k][0] * gx + B[k][1] * gy, B[k][1] * gx + B[k][2] * gy};
    change[k] = hx_plane_sub(wanted, shares->push[k]);
    /* multipliers of the sums of forces and of moments about the centre of the load */
    T[k][0] = B[k][1] * arm.x - B[k][0] * arm.y;
    T[k][1] = B[k][2] * arm.x - B[k][1] * arm.y;
    S[0] += B[k][0];
    S[1] += B[k][1];
    S[2] += T[k][0];
    S[3] += B[k][2];
    S[4] += T[k][1];
    S[5] += T[k][1] * arm.x - T[k][0] * arm.y;
    needed[0] += change[k].x;
    needed[1] += change[k].y;
    needed[2] += hx_across(arm, change[k]);
  }
  hx_support_solve(S, needed, x);
  for (int k = 0; k < HX_LEGS; ++k) {
    change[k].x -= B[k][0] * x[0] + B[k][1] * x[1] + T[k][0] * x[2];
    change[k].y -= B[k][1] * x[0] + B[k][2] * x[1] + T[k][1] * x[2];
  }
  const double factor = limit(model, shares, change);
  for (int k = 0; k < HX_LEGS; ++k)
    shares->push[k] = hx_plane_add(shares->push[k], hx_scaled(change[k], factor));
}
