/* fade.h - lets joint commands go on without a jump when the control changes. Python:
 * controller/walk/fade.py. */
#ifndef HX_FADE_H
#define HX_FADE_H

#include "hexapod/inside.h"
#include "kinematics.h"

HX_HIDDEN_BEGIN

typedef struct hxFadeModel {
  double period; /* s */
  int64_t steps; /* that a transition takes */
} hxFadeModel;

/* What is added to the joint commands of the present control: it goes to 0. */
typedef struct hxFade {
  int64_t left; /* steps of the transition; 0: none */
  /* rad, rad/s, N m   at the begin of the transition; before its first step, the commands that the
   * control before would give at that step */
  double angle[HX_LEGS][HX_JOINTS], speed[HX_LEGS][HX_JOINTS], torque[HX_LEGS][HX_JOINTS];
} hxFade;

void hx_fade_compile(double period, hxFadeModel *model);

/* Begins a transition from the commands of the last step, continued by a period. */
void hx_fade_begin(const hxFadeModel *model, const hxControllerOutput *last, hxFade *fade);

/* Adds to the commands of a step what is left of their distance from those of the control before,
 * during a transition. */
void hx_fade_step(const hxFadeModel *model, const hxLegSolver leg[HX_LEGS], hxFade *fade,
                  hxControllerOutput *output);

HX_HIDDEN_END

#endif
