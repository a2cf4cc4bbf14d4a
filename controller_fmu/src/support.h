/* support.h - who carries what: the planned weight and acceleration of the robot, shared out over the standing feet.
 * Python: controller/support.py. */
#ifndef HX_SUPPORT_H
#define HX_SUPPORT_H

#include "hexapod/inside.h"
#include "inverse_dynamics.h"

HX_HIDDEN_BEGIN

typedef struct hxSupport {
  double duty, handover; /* cycles  a leg's hand-overs never overlap, whatever the gait */
  double stiffness; /* N/m^1.5 */
  double rest_weight; /* N       what the robot asks for in its stance */
  hxPlane rest_moment; /* N m */
  double rest_depth; /* m       a foot presses in by in the stance */
} hxSupport;

/* Planned forces of the ground on the feet at one step, walking frame. */
typedef struct hxShares {
  double activation[HX_LEGS]; /* 1  in [0, 1] */
  double normal[HX_LEGS]; /* N */
  hxPlane push[HX_LEGS]; /* N */
} hxShares;

void hx_support_compile(const hxControllerDefinition *definition, const hxDemand *rest,
                        hxSupport *model);

/* 1 while the leg stands, 0 in the air, in between over the hand-over.
 * stayed, stays: it had nowhere to step when it was to lift off last, or will have nowhere to when it is next. */
double hx_support_activation(const hxSupport *model, double phase, int stayed, int stays,
                             int walking);

/* m  how much lower than planned the feet must be for the torso to keep its height over the ground that gives way */
void hx_support_lowering(const hxSupport *model, const hxPlane feet[HX_LEGS],
                         const double activation[HX_LEGS], double lowering[HX_LEGS]);

/* Shares of feet in the walking frame; activations are given. */
void hx_support_shares(const hxPlane feet[HX_LEGS], const hxDemand *demand, hxShares *shares);

HX_HIDDEN_END

#endif
