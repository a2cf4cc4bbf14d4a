/* load_plan.h - planned forces on the feet, the solution of the systems that share them, and the
 * planned loads and contacts of one step, which the force laws compare with the sensors (C29).
 * Python: controller/comply/load_plan.py. */
#ifndef HX_LOAD_PLAN_H
#define HX_LOAD_PLAN_H

#include "../plane.h"
#include "../walk/inverse_dynamics.h"

/* Planned forces of the ground on the feet at one step, walking frame. */
typedef struct hxShares {
  double activation[HX_LEGS]; /* 1  in [0, 1] */
  double normal[HX_LEGS];     /* N */
  hxPlane push[HX_LEGS];      /* N */
  hxPlane squeeze[HX_LEGS];   /* N  the part of push by which the legs squeeze each other (C42) */
} hxShares;

/* 1  of the mean square arm: feet on one line share no moment about it */
static const double ridge_share = 1e-9;
/* m2  makes the equations solvable when no foot stands */
static const double least_arm = 1e-12;
static const double least_load = 1e-6; /* N  a smaller load is not shared */

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

/* Planned loads and contacts of one step. */
typedef struct hxLoadPlan {
  double own[HX_LEGS][HX_JOINTS];   /* N m  torques for the legs' own weight and motion */
  double carry[HX_LEGS][HX_JOINTS]; /* N m  torques for the planned load */
  hxShares shares;
  hxPlane feet[HX_LEGS];  /* m    contact points */
  double weight;          /* N  sum of all shares */
  int standing[HX_LEGS];  /* the leg carries its whole share */
  double height[HX_LEGS]; /* m  of the paths above their ends */
  double needed;          /* N m  largest element of carry */
  int swinging[HX_LEGS];
  int awaited[HX_LEGS];    /* the gait clock waits for the foot */
  double descent[HX_LEGS]; /* m  by which the feet come down in a period, at least 0 */
} hxLoadPlan;

/* Computes the rest of a plan whose shares and contacts are set. active: the servos carry the load;
 * otherwise all torques are 0. height, rise: of the feet's paths above the stance [m, m/s]; period:
 * of the controller [s]. */
static inline void hx_plan_load(int active, double period, const hxDemand *demand,
                                const double height[HX_LEGS], const double rise[HX_LEGS],
                                hxLoadPlan *plan) {
  const double supports = active ? 1.0 : 0.0;
  plan->weight = plan->needed = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double f[3] = {plan->shares.push[leg].x, plan->shares.push[leg].y,
                         plan->shares.normal[leg]};
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double *lever = demand->lever[leg][joint];
      plan->own[leg][joint] = supports * demand->torque[leg][joint];
      plan->carry[leg][joint] = -supports * (lever[0] * f[0] + lever[1] * f[1] + lever[2] * f[2]);
      plan->needed = hx_larger(fabs(plan->carry[leg][joint]), plan->needed);
    }
    plan->weight += plan->shares.normal[leg];
    plan->standing[leg] = plan->shares.activation[leg] >= 1.0;
    plan->height[leg] = height[leg];
    plan->descent[leg] = hx_larger(-period * rise[leg], 0.0);
  }
}

#endif
