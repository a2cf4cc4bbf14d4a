/* foot_law.h - the linear part of the laws of a foot: the slip PID along x and along y, the virtual
 * suspension and the smoothed load. Python: controller/comply/foot_law.py. */
#ifndef HX_FOOT_LAW_H
#define HX_FOOT_LAW_H

#include "../plane.h"
#include "hexapod/inside.h"
#include "slip_pid.h"
#include "suspension.h"

HX_HIDDEN_BEGIN

typedef struct hxFootLawModel {
  hxSlipPidModel pid;
  hxSuspension suspension;
  double keep; /* 1, factor of the smoothed load over a period */
} hxFootLawModel;

typedef struct hxFootLaw {
  hxSlipPid x, y;
  hxPlane answer; /* N       of the PID */
  double deflection, rate; /* m, m/s  of the suspension */
  double load; /* 1       smoothed */
} hxFootLaw;

void hx_foot_law_compile(const hxControllerDefinition *definition, hxFootLawModel *model);

/* Advances the law by one period. push, excess: tangential and normal force to which the foot
 * yields [N] (C25, C26); load: measured, in thirds of the weight [1] (C27). */
void hx_foot_law_step(const hxFootLawModel *model, hxPlane push, double excess, double load,
                      hxFootLaw *law);

HX_HIDDEN_END

#endif
