/* suspension.h - the virtual suspension m z'' + b z' + k z = f of a foot (C26).
 * Python: controller/comply/suspension.py. */
#ifndef HX_SUSPENSION_H
#define HX_SUSPENSION_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Coefficients of x(k+1) = a x(k) + b f(k) for x = (z, z'), exact for a force that is constant over
 * a period. */
typedef struct hxSuspension {
  double a[2][2], b[2];
} hxSuspension;

void hx_suspension_discretise(double mass, double damping, double stiffness, double period,
                              hxSuspension *suspension);

HX_HIDDEN_END

#endif
