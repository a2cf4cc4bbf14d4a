/* support.h - shares of the feet: the planned weight and acceleration of the robot, distributed
 * over the standing feet. Python: controller/comply/support.py. */
#ifndef HX_SUPPORT_H
#define HX_SUPPORT_H

#include "../walk/inverse_dynamics.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxSupport {
  double duty, handover; /* cycles; hand-overs of a leg never overlap, whatever the gait */
  double stiffness; /* N/m^1.5 */
  double rest_weight; /* N, that the robot requires in its stance */
  hxPlane rest_moment; /* N m */
  double rest_depth; /* m, penetration of a foot in the stance */
} hxSupport;

/* Planned forces of the ground on the feet at one step, walking frame. */
typedef struct hxShares {
  double activation[HX_LEGS]; /* 1  in [0, 1] */
  double normal[HX_LEGS]; /* N */
  hxPlane push[HX_LEGS]; /* N */
  hxPlane squeeze[HX_LEGS]; /* N, the part of push by which the legs squeeze each other (C42) */
} hxShares;

/* Solves S x = b for symmetric, positive semidefinite S (00 01 02 11 12 22) by L D L^T; a ridge on
 * the diagonal makes S definite. */
void hx_support_solve(const double S[6], const double b[3], double x[3]);

void hx_support_compile(const hxControllerDefinition *definition, const hxDemand *rest,
                        hxSupport *model);

/* Returns the activation of a leg at a gait phase (C18), in [0, 1]. stayed, stays: the foot had no
 * step to make at its last lift-off, or will have none at its next one. */
double hx_support_activation(const hxSupport *model, double phase, int stayed, int stays,
                             int walking);

/* Returns the indentation [m] of the ground under a load [N], (f_n/K)^(2/3) (C21). */
double hx_indentation(double load, double stiffness);

/* Returns by how much the feet must be lower than planned, so that the torso keeps its height over
 * ground that deforms (C21) [m]. */
void hx_support_lowering(const hxSupport *model, const hxPlane feet[HX_LEGS],
                         const double activation[HX_LEGS], double lowering[HX_LEGS]);

/* Computes the shares of feet in the walking frame (C19, C20); activations are given. */
void hx_support_shares(const hxPlane feet[HX_LEGS], const hxDemand *demand, hxShares *shares);

HX_HIDDEN_END

#endif
