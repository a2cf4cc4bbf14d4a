#include "planned_squeeze.h"

/* 1, share of its friction that a foot is planned to use at most */
static const double most_friction = 0.7;
/* N, floor of a change of a force that a factor is divided by */
static const double least_push = 1e-12;
/* N, a foot with less takes no part; floor of the sum of loads */
static const double least_load = 1e-6;
/* 1, of C42 with new weights, and the part of each change that is made */
enum { HX_REPEATS = 12 };
static const double step = 0.25;
static const double least_norm = 1e-9; /* N m, floor of the norm of all torques */

/* Forces and geometry of one plan. */
typedef struct hxArch {
  const hxDemand *demand;
  const hxShares *shares;
  double price; /* N2 m2, of the use of friction */
  hxPlane arm[HX_LEGS]; /* m, of the feet about the centre of load */
} hxArch;

void hx_planned_squeeze_compile(const hxControllerDefinition *definition, double weight,
                                double depth, hxPlannedSqueeze *model) {
  const double tripod_share = 1.0 / 3.0; /* 1, of the weight: the load of the comparison */
  model->friction = definition->friction;
  model->minmax = definition->parts.minmax_torque;
  model->torque = depth * tripod_share * weight;
}

/* Computes xx, xy, yy of (J J^T + price/f_n^2)^-1, 0 without a load (C42). count: weights of the
 * servos; price [N2 m2]. */
static void yielding(const double lever[HX_JOINTS][3], const double count[HX_JOINTS], double normal,
                     double price, double B[3]) {
  const double n = normal * normal;
  double xx = 0.0, xy = 0.0, yy = 0.0;
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    const double *row = lever[joint];
    xx += count[joint] * row[0] * row[0];
    xy += count[joint] * row[0] * row[1];
    yy += count[joint] * row[1] * row[1];
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
static hxPlane wanted(const double lever[HX_JOINTS][3], const double torque[HX_JOINTS],
                      const double count[HX_JOINTS], double normal, const double B[3]) {
  double gx = 0.0, gy = 0.0;
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    /* for the horizontal force */
    const double left = count[joint] * (torque[joint] - lever[joint][2] * normal);
    gx += lever[joint][0] * left;
    gy += lever[joint][1] * left;
  }
  return hx_plane(B[0] * gx + B[1] * gy, B[1] * gx + B[2] * gy);
}

/* Subtracts the sum and the moment of changes of forces, by multipliers. arm: of the feet about the
 * centre of load [m]. */
static void balance(const hxPlane arm[HX_LEGS], const double B[HX_LEGS][3],
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
  hx_support_solve(S, needed, x);
  for (int k = 0; k < HX_LEGS; ++k) {
    change[k].x -= B[k][0] * x[0] + B[k][1] * x[1] + tx[k] * x[2];
    change[k].y -= B[k][1] * x[0] + B[k][2] * x[1] + ty[k] * x[2];
  }
}

/* Computes the changes of the forces of C42 with weights of the servos. */
static void best(const hxArch *arch, const double count[HX_LEGS][HX_JOINTS],
                 hxPlane change[HX_LEGS]) {
  double B[HX_LEGS][3];
  for (int k = 0; k < HX_LEGS; ++k) {
    const double (*lever)[3] = arch->demand->lever[k];
    const double normal = arch->shares->normal[k];
    yielding(lever, count[k], normal, arch->price, B[k]);
    const hxPlane chosen = wanted(lever, arch->demand->torque[k], count[k], normal, B[k]);
    change[k] = hx_plane_sub(chosen, arch->shares->push[k]);
  }
  balance(arch->arm, (const double (*)[3])B, change);
}

/* Computes the weights of the servos under changed forces (C56): the sixth power of each torque
 * over the 8-norm of all. */
static void weigh(const hxArch *arch, const hxPlane change[HX_LEGS],
                  double count[HX_LEGS][HX_JOINTS]) {
  /* three equal torques, those of a tripod's femurs, count as much as in the sum of squares */
  const double like_squares = sqrt(sqrt(27.0));
  double sum = 0.0;
  for (int k = 0; k < HX_LEGS; ++k) {
    const hxPlane f = hx_plane_add(arch->shares->push[k], change[k]);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double *row = arch->demand->lever[k][joint];
      const double carried = row[0] * f.x + row[1] * f.y + row[2] * arch->shares->normal[k];
      const double torque = arch->demand->torque[k][joint] - carried, square = torque * torque;
      count[k][joint] = square;
      sum += square * square * (square * square);
    }
  }
  const double norm = sqrt(sqrt(sqrt(sum))), unit = hx_larger(norm * norm, least_norm * least_norm);
  for (int k = 0; k < HX_LEGS; ++k)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double part = count[k][joint] / unit;
      count[k][joint] = like_squares * part * part * part;
    }
}

/* Lowers the largest torques, beginning with the changes of the least sum of squares (C56). */
static void lower_largest(const hxArch *arch, hxPlane change[HX_LEGS]) {
  double count[HX_LEGS][HX_JOINTS];
  hxPlane nearer[HX_LEGS];
  for (int i = 0; i < HX_REPEATS; ++i) {
    weigh(arch, (const hxPlane *)change, count);
    best(arch, (const double (*)[HX_JOINTS])count, nearer);
    for (int k = 0; k < HX_LEGS; ++k)
      change[k] = hx_plane_add(change[k], hx_scaled(hx_plane_sub(nearer[k], change[k]), step));
  }
}

/* Returns the factor on all changes that keeps each foot within its friction (C43). */
static double limit(const hxPlannedSqueeze *model, const hxShares *shares,
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

void hx_planned_squeeze_add(const hxPlannedSqueeze *model, const hxPlane feet[HX_LEGS],
                            const hxDemand *demand, double squeeze, hxShares *shares) {
  if (!(squeeze > 0.0) || !(model->friction > 0.0)) return;
  const double used = model->torque / model->friction;
  hxArch arch = {demand, shares, (1.0 / squeeze - 1.0) * used * used, {{0.0, 0.0}}};
  double equal[HX_LEGS][HX_JOINTS], total = 0.0;
  hxPlane change[HX_LEGS], centre = {0.0, 0.0};
  for (int k = 0; k < HX_LEGS; ++k) {
    total += shares->normal[k];
    centre = hx_plane_add(centre, hx_scaled(feet[k], shares->normal[k]));
  }
  centre = hx_scaled(centre, 1.0 / hx_larger(total, least_load));
  for (int k = 0; k < HX_LEGS; ++k) {
    arch.arm[k] = hx_plane_sub(feet[k], centre);
    for (int joint = 0; joint < HX_JOINTS; ++joint) equal[k][joint] = 1.0;
  }
  best(&arch, (const double (*)[HX_JOINTS])equal, change);
  if (model->minmax) lower_largest(&arch, change);
  const double factor = limit(model, shares, change);
  for (int k = 0; k < HX_LEGS; ++k) {
    shares->squeeze[k] = hx_scaled(change[k], factor);
    shares->push[k] = hx_plane_add(shares->push[k], shares->squeeze[k]);
  }
}
