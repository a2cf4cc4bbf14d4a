/* transcendental.c - reduces arguments exactly and evaluates rational functions and polynomials */
#include "transcendental.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

static inline int64_t bits_of(double x) {
  int64_t bits;
  memcpy(&bits, &x, sizeof bits);
  return bits;
}

static inline double from_bits(int64_t bits) {
  double x;
  memcpy(&x, &bits, sizeof x);
  return x;
}

/* x = k pi/2 + r with |r| <= pi/4, Taylor to r^17 and r^16 (remainders 1e-19 and 2e-18), then k
 * quarter turns */
void hx_sine_cosine(double x, double *sine, double *cosine) {
  /* pi/2 in three pieces, the first two of 33 bits: k times them is exact */
  const double high = 0x1.921fb544p+0, mid = 0x1.0b4611a6p-34, low = 0x1.3198a2e037073p-69;
  const double shifted = x * 0.6366197723675814 + hx_rounding, k = shifted - hx_rounding;
  const double r = ((x - k * high) - k * mid) - k * low;
  const double z = r * r, z2 = z * z, z4 = z2 * z2;
  const double odd = ((-1.0 / 6) + z * (1.0 / 120)) + z2 * ((-1.0 / 5040) + z * (1.0 / 362880)),
               odd_end = ((-1.0 / 39916800) + z * (1.0 / 6227020800.0)) +
                         z2 * ((-1.0 / 1307674368000.0) + z * (1.0 / 355687428096000.0));
  const double even = ((1.0 / 24) + z * (-1.0 / 720)) + z2 * ((1.0 / 40320) + z * (-1.0 / 3628800)),
               even_end =
                   ((1.0 / 479001600) + z * (-1.0 / 87178291200.0)) + z2 * (1.0 / 20922789888000.0);
  const double s = r + r * (z * (odd + z4 * odd_end));
  /* 1 - z/2 is rounded, and its error is added to the rest */
  const double half = 0.5 * z, most = 1.0 - half;
  const double c = most + (((1.0 - most) - half) + z2 * (even + z4 * even_end));
  const int64_t quarter = bits_of(shifted), swap = -(quarter & 1),
                differ = (bits_of(s) ^ bits_of(c)) & swap;
  /* sine: s, c, -s, -c; cosine: c, -s, -c, s */
  *sine = from_bits((bits_of(s) ^ differ) ^ (int64_t)((uint64_t)(quarter & 2) << 62));
  *cosine = from_bits((bits_of(c) ^ differ) ^ (int64_t)((uint64_t)((quarter + 1) & 2) << 62));
}

/* The tangent t of the angle to the nearer axis or, beyond tan(pi/8), to the diagonal; minimax
 * polynomial, exact to 1.3e-18. */
static inline double arc(double y, double x) {
  const double quarter = 1.5707963267948966, tan_eighth = 0.41421356237309503;
  const double right = fabs(x), up = fabs(y);
  const int steep = up > right;
  const double most = steep ? up : right, least = steep ? right : up;
  const int wide = least > tan_eighth * most;
  const double over = wide ? least - most : least, whole = wide ? least + most : most;
  const double t = over / (whole == 0.0 ? 1.0 : whole), z = t * t, z2 = z * z, z4 = z2 * z2;
  const double low = (-0.3333333333333313 + z * 0.19999999999942733) +
                     z2 * (-0.14285714279416978 + z * 0.11111110752667197);
  const double mid = (-0.09090897019166005 + z * 0.07692048884053129) +
                     z2 * (-0.06662990413300302 + z * 0.05847147723724963);
  const double high = (-0.05036270404445784 + z * 0.037993873512197886) - z2 * 0.017835677876676313;
  const double angle = (wide ? 0.5 * quarter : 0.0) + (t + t * z * (low + z4 * (mid + z4 * high)));
  const double from_x = steep ? quarter - angle : angle,
               all = x < 0.0 ? 2.0 * quarter - from_x : from_x;
  return copysign(all, y);
}

double hx_arc(double y, double x) { return arc(y, x); }

void hx_arcs(int n, const double y[], const double x[], double angle[]) {
  for (int i = 0; i < n; ++i) angle[i] = arc(y[i], x[i]);
}

/* e^x - 1: x = k ln 2 + r, Taylor to r^13 (remainder 4e-18), then 2^k (e^r - 1) + (2^k - 1) */
static inline double growth(double x) {
  const double ln2_high = 6.93147180369123816490e-01,
               ln2_low = 1.90821492927058770002e-10; /* ln 2 in two pieces */
  const double least = x < -40.0 ? -40.0 : x;
  const double shifted = least * 1.4426950408889634 + hx_rounding, k = shifted - hx_rounding;
  const double r = (least - k * ln2_high) - k * ln2_low;
  const double r2 = r * r, r4 = r2 * r2;
  const double low = (1.0 + r * (1.0 / 2)) + r2 * ((1.0 / 6) + r * (1.0 / 24));
  const double mid = ((1.0 / 120) + r * (1.0 / 720)) + r2 * ((1.0 / 5040) + r * (1.0 / 40320));
  const double high = ((1.0 / 362880) + r * (1.0 / 3628800)) +
                      r2 * ((1.0 / 39916800) + r * (1.0 / 479001600)) + r4 * (1.0 / 6227020800.0);
  const double part = r * (low + r4 * (mid + r4 * high));
  const uint64_t exponent = ((uint64_t)bits_of(shifted) + 1023) & 0x7ff;
  const double power = from_bits((int64_t)(exponent << 52));
  return power * part + (power - 1.0);
}

double hx_growth(double x) { return growth(x); }

void hx_saturations(int n, const double x[], double tanh_x[]) {
  for (int i = 0; i < n; ++i) {
    const double above = x[i] < -20.0 ? -20.0 : x[i], within = above > 20.0 ? 20.0 : above;
    const double e = growth(2.0 * within);
    tanh_x[i] = e / (e + 2.0);
  }
}

/* x y with y = x^(-1/3), by Newton's method from a third of the exponent and of the mantissa, 3 %
 * off: each step squares the error and doubles it */
double hx_two_thirds(double x) {
  if (x < 1e-200) return 0.0;
  double y = from_bits(0x553ef0ff289dd796 - bits_of(x) / 3);
  for (int i = 0; i < 4; ++i) y = y * (4.0 - x * (y * y * y)) * (1.0 / 3.0);
  return x * y;
}
