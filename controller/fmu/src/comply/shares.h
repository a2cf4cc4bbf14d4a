/* shares.h - the planned forces on the feet, and the solution of the systems that share them.
 * Python: controller/comply/shares.py. */
#ifndef HX_SHARES_H
#define HX_SHARES_H

#include "../plane.h"
#include "../walk/inverse_dynamics.h"

/* Planned forces of the ground on the feet at one step, walking frame. */
typedef struct hxShares {
  double activation[HX_LEGS]; /* 1  in [0, 1] */
  double normal[HX_LEGS];     /* N */
  hxPlane push[HX_LEGS];      /* N */
  hxPlane squeeze[HX_LEGS];   /* N, the part of push by which the legs squeeze each other (C42) */
} hxShares;

/* 1, of the mean square arm: feet on one line share no moment about it */
static const double ridge_share = 1e-9;
/* m2, makes the equations solvable when no foot stands */
static const double least_arm = 1e-12;
static const double least_load = 1e-6; /* N, a smaller load is not shared */

/* Returns the indentation [m] of the ground under a load [N], (f_n/K)^(2/3) (C21). */
static inline double hx_indentation(double load, double stiffness) {
  return hx_two_thirds(load / stiffness);
}

/* Solves S x = b for symmetric, positive semidefinite S (00 01 02 11 12 22) by L D L^T; a ridge on
 * the diagonal makes S definite. */
static inline void hx_shares_solve(const double S[6], const double b[3], double x[3]) {
  const double ridge = ridge_share * (S[0] + S[3] + S[5]) + least_arm;
  const double d0 = S[0] + ridge, l10 = S[1] / d0, l20 = S[2] / d0;
  const double d1 = S[3] + ridge - l10 * S[1], l21 = (S[4] - l20 * S[1]) / d1;
  const double d2 = S[5] + ridge - l20 * S[2] - l21 * l21 * d1;
  const double y1 = b[1] - l10 * b[0], y2 = b[2] - l20 * b[0] - l21 * y1;
  x[2] = y2 / d2;
  x[1] = y1 / d1 - l21 * x[2];
  x[0] = b[0] / d0 - l10 * x[1] - l20 * x[2];
}

#endif
