/* load_plan.h - planned loads and contacts of one step, which the force laws compare with the
 * sensors (C29). Python: controller/comply/load_plan.py. */
#ifndef HX_LOAD_PLAN_H
#define HX_LOAD_PLAN_H

#include "shares.h"

/* Planned loads and contacts of one step. */
typedef struct hxLoadPlan {
  double own[HX_LEGS][HX_JOINTS];   /* N m  torques for the legs' own weight and motion */
  double carry[HX_LEGS][HX_JOINTS]; /* N m, torques for the planned load */
  hxShares shares;
  hxPlane feet[HX_LEGS];  /* m    contact points */
  double weight;          /* N, sum of all shares */
  int standing[HX_LEGS];  /* the leg carries its whole share */
  double height[HX_LEGS]; /* m, of the paths above their ends */
  double needed;          /* N m, largest element of carry */
  int swinging[HX_LEGS];
  int awaited[HX_LEGS];    /* the gait clock waits for the foot */
  double descent[HX_LEGS]; /* m, by which the feet come down in a period, at least 0 */
  int overspeed;           /* the plan exceeds the speed limit of some joint */
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
