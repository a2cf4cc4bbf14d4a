/* elementary.h - sine, cosine, logarithm and power without libm, whose last bits
 * differ between systems and processors */
#ifndef HX_ELEMENTARY_H
#define HX_ELEMENTARY_H

#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Computes sine and cosine to an error below one unit in the last place of 1, for |x| < 1e5; NaN
 * for |x| >= 1e9. */
void hx_sin_cos(double x, double *sine, double *cosine);

/* Return ln(x), x > 0, and ln(1 + x), x > -1, to a few units in the last place. */
double hx_ln(double x);
double hx_log1p(double x);

/* Returns x^y to a few units in the last place, x >= 0 and |y| <= 16. Numbers below the least
 * normal one count as 0; results beyond the range are 0 or infinite. */
double hx_pow(double x, double y);

HX_HIDDEN_END

#endif
