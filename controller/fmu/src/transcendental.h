/* transcendental.h - sine, cosine, arc tangent, exponential, hyperbolic tangent and cube root
 * without libm, whose last bits differ between systems and which computes one number at a time. */
#ifndef HX_TRANSCENDENTAL_H
#define HX_TRANSCENDENTAL_H

#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* 1.5 * 2^52: adding and subtracting it rounds to a whole number, which the sum's last bits are */
static const double hx_rounding = 6755399441055744.0;

/* Computes sine and cosine to an error below one unit in the last place of 1, for |x| < 1e5. */
void hx_sine_cosine(double x, double *sine, double *cosine);

/* Returns atan2(y, x) to a few units in the last place, 0 at the origin. y^2 and x^2 need not be
 * representable. */
double hx_arc(double y, double x);

/* Computes hx_arc of each of n pairs. */
void hx_arcs(int n, const double y[], const double x[], double angle[]);

/* Returns e^x - 1 to a few units in the last place, for x <= 40. */
double hx_growth(double x);

/* Computes tanh of each of n numbers to a few units in the last place. */
void hx_saturations(int n, const double x[], double tanh_x[]);

/* Returns x^(2/3) to a few units in the last place, x >= 0; 0 for x < 1e-200. */
double hx_two_thirds(double x);

HX_HIDDEN_END

#endif
