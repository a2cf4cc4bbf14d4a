/* support.h - shares of the feet: the planned weight and acceleration of the robot, distributed
 * over the standing feet. Python: controller/comply/support.py. */
#ifndef HX_SUPPORT_H
#define HX_SUPPORT_H

#include "../walk/inverse_dynamics.h"
#include "load_plan.h"
#include <string.h>

typedef struct hxSupport {
  int active;            /* the part is on: feet are lowered, and servos carry the load */
  double duty, handover; /* cycles; hand-overs of a leg never overlap, whatever the gait */
  double stiffness;      /* N/m^1.5 */
  double rest_weight;    /* N  that the robot requires in its stance */
  hxPlane rest_moment;   /* N m */
  double rest_depth;     /* m  penetration of a foot in the stance */
} hxSupport;

/* m2  of the feet about their centre: feet that are closer take no moment about the vertical */
static const double least_spread = 1e-4;

/* Returns a transition from 0 to 1 over [0, 1] with continuous rate and acceleration. */
static inline double smooth(double x) {
  const double y = hx_clamp(x, 0.0, 1.0);
  return y * y * y * (10.0 + y * (6.0 * y - 15.0));
}

static inline void hx_support_compile(const hxControllerDefinition *definition,
                                      const hxDemand *rest, hxSupport *model) {
  const hxGait *gait = &definition->gait;
  const double handover = definition->gains.support.handover_time / gait->period;
  model->active = definition->parts.support;
  model->duty = gait->duty;
  model->handover = hx_smaller(handover, hx_smaller(gait->duty, 1.0 - gait->duty));
  model->stiffness = definition->contact_stiffness;
  model->rest_weight = rest->weight;
  model->rest_moment = rest->moment;
  model->rest_depth = hx_indentation(rest->weight / HX_LEGS, model->stiffness);
}

/* Returns the activation of a leg at a gait phase (C18), in [0, 1]. stayed, stays: the foot had no
 * step to make at its last lift-off, or will have none at its next one. */
static inline double hx_support_activation(const hxSupport *model, double phase, int stayed,
                                           int stays, int walking) {
  /* a leg that stayed at its position has not given up its load and does not take it up again */
  if (!walking || (stayed && phase >= model->duty)) return 1.0;
  const double half = 0.5 * model->handover,
               since = hx_fraction(phase + half); /* cycles since the activation began to rise */
  const double rising = stayed ? 1.0 : smooth(since / model->handover);
  const double falling = stays ? 1.0 : smooth((model->duty + 2.0 * half - since) / model->handover);
  return hx_smaller(rising, falling);
}

/* Computes the vertical shares (C19): the sums of f_n and of p f_n are weight and moment; no share
 * is negative. */
static inline void share_normal(const hxPlane feet[HX_LEGS], const double activation[HX_LEGS],
                                double weight, hxPlane moment, double normal[HX_LEGS]) {
  const double needed[3] = {weight, moment.x, moment.y};
  double S[6] = {0.0}, x[3];
  for (int k = 0; k < HX_LEGS; ++k) {
    const double a = activation[k], ax = a * feet[k].x, ay = a * feet[k].y;
    S[0] += a;
    S[1] += ax;
    S[2] += ay;
    S[3] += ax * feet[k].x;
    S[4] += ax * feet[k].y;
    S[5] += ay * feet[k].y;
  }
  hx_shares_solve(S, needed, x);
  for (int k = 0; k < HX_LEGS; ++k) {
    const double share = activation[k] * (x[0] + x[1] * feet[k].x + x[2] * feet[k].y);
    normal[k] = share < 0.0 ? 0.0 : share;
  }
}

/* Returns by how much the feet must be lower than planned, so that the torso keeps its height over
 * ground that deforms (C21) [m]. */
static inline void hx_support_lowering(const hxSupport *model, const hxPlane feet[HX_LEGS],
                                       const double activation[HX_LEGS], double lowering[HX_LEGS]) {
  double normal[HX_LEGS];
  memset(lowering, 0, sizeof normal);
  if (!model->active) return;
  share_normal(feet, activation, model->rest_weight, model->rest_moment, normal);
  for (int k = 0; k < HX_LEGS; ++k)
    lowering[k] = hx_indentation(normal[k], model->stiffness) - model->rest_depth;
}

/* Computes the shares of feet in the walking frame (C19, C20); activations are given. */
static inline void hx_support_shares(const hxPlane feet[HX_LEGS], const hxDemand *demand,
                                     hxShares *shares) {
  double part[HX_LEGS], total = 0.0, spread = 0.0;
  hxPlane arm[HX_LEGS], centre = {0.0, 0.0};
  share_normal(feet, shares->activation, demand->weight, demand->moment, shares->normal);
  for (int k = 0; k < HX_LEGS; ++k) total += shares->normal[k];
  for (int k = 0; k < HX_LEGS; ++k) {
    part[k] = shares->normal[k] / (total < least_load ? least_load : total);
    centre = hx_plane_add(centre, hx_scaled(feet[k], part[k]));
  }
  for (int k = 0; k < HX_LEGS; ++k) {
    arm[k] = hx_plane_sub(feet[k], centre);
    spread += part[k] * hx_square(arm[k]);
  }
  /* f_h = (f_n/sum f_n) (F_h + i w (p - c)) (C20) */
  const double w =
      spread < least_spread ? 0.0 : (demand->twist - hx_across(centre, demand->push)) / spread;
  for (int k = 0; k < HX_LEGS; ++k) shares->squeeze[k] = hx_plane(0.0, 0.0);
  for (int k = 0; k < HX_LEGS; ++k)
    shares->push[k] =
        hx_scaled(hx_plane_add(demand->push, hx_plane(-w * arm[k].y, w * arm[k].x)), part[k]);
}

#endif
