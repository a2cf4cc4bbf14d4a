/* foot_law.h - the linear part of a foot's laws: the slip PID along x and along y, the virtual
 * suspension and the smoothing of the load. Python: controller/foot_law.py. */
#ifndef HX_FOOT_LAW_H
#define HX_FOOT_LAW_H

#include "hexapod/inside.h"
#include "plane.h"
#include "slip_pid.h"
#include "suspension.h"

HX_HIDDEN_BEGIN

typedef struct hxFootLawModel {
  hxSlipPid pid;
  hxSuspension suspension;
  double keep; /* 1  of the smoothed load, over a period */
} hxFootLawModel;

/* What a foot's laws are to give way to. */
typedef struct hxFootInput {
  hxPlane push;    /* N  tangential */
  double excess;   /* N  normal */
  double load;     /* 1  thirds of the weight */
} hxFootInput;

typedef struct hxFootLaw {
  hxSlipState x, y;
  hxPlane answer;           /* N       of the PID */
  double deflection, rate;  /* m, m/s  of the suspension */
  double load;              /* 1       smoothed */
} hxFootLaw;

void hx_foot_law_compile(const hxControllerDefinition *definition, hxFootLawModel *model);

/* One period on. */
void hx_foot_law_step(const hxFootLawModel *model, const hxFootInput *input, hxFootLaw *law);

HX_HIDDEN_END

#endif
