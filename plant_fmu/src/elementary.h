/* elementary.h - sine, cosine and logarithm without libm, whose last bits differ between systems
 * and processors */
#ifndef HX_ELEMENTARY_H
#define HX_ELEMENTARY_H

#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Computes sine and cosine to an error below one unit in the last place of 1, for |x| < 1e5; NaN
 * for |x| >= 1e9. */
void hx_sin_cos(double x, double *sine, double *cosine);

/* Returns ln(1 + x), x > -1, to a few units in the last place. */
double hx_log1p(double x);

HX_HIDDEN_END

#endif
