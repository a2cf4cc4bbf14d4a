#include "elementary.h"

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

/* 1 - z/(n(n+1)) (1 - z/((n+2)(n+3)) (1 - ...)): sin(r)/r from n = 2, cos(r) from n = 1, z = r^2;
 * nine terms for |r| <= pi/4 */
static double alternating_series(double z, int first) {
  double sum = 1.0;
  for (int n = first + 16; n >= first; n -= 2) sum = 1.0 - z * sum / (n * (n + 1.0));
  return sum;
}

/* x = k pi/2 + r with |r| <= pi/4, then k quarter turns */
void hx_sin_cos(double x, double *sine, double *cosine) {
  if (!(fabs(x) < 1e9)) { /* the quarter turn is not determined any more */
    *sine = *cosine = NAN;
    return;
  }
  /* pi/2 in three pieces, the first two of 33 bits: k times them is exact */
  const double high = 0x1.921fb544p+0, mid = 0x1.0b4611a6p-34, low = 0x1.3198a2e037073p-69;
  const double k = floor(x * 0.6366197723675814 + 0.5);
  const double r = ((x - k * high) - k * mid) - k * low;
  const double s = r * alternating_series(r * r, 2), c = alternating_series(r * r, 1);
  const int quarter = (int)(k - 4.0 * floor(0.25 * k));
  const double turned[4][2] = {{s, c}, {c, -s}, {-s, -c}, {-c, s}};
  *sine = turned[quarter][0], *cosine = turned[quarter][1];
}

/* ln((1 + s) / (1 - s)) = 2 s (1 + s^2/3 + s^4/5 + ...), |s| <= 0.172 */
static double log_of_ratio(double s) {
  double sum = 0.0;
  for (int n = 23; n >= 1; n -= 2) sum = 1.0 / n + s * s * sum;
  return 2.0 * s * sum;
}

double hx_log1p(double x) {
  const double ln2 = 0.6931471805599453;
  int exponent;
  if (fabs(x) < 0.25) return log_of_ratio(x / (2.0 + x));
  double m = frexp(1.0 + x, &exponent);
  if (m < 0.7071067811865476) m *= 2.0, exponent--;
  return exponent * ln2 + log_of_ratio((m - 1.0) / (m + 1.0));
}

/* ln 2 in two parts; the first has 42 bits, so that its product with an exponent is exact */
static const double ln2_high = 0x1.62e42fefa3800p-1, ln2_low = 0x1.ef35793c76730p-45;

/* Sums n terms of a polynomial in pairs of pairs, whose chains of operations overlap; n is a
 * multiple of 4. */
static inline double polynomial(const double *c, int n, double x) {
  const double x2 = x * x, x4 = x2 * x2;
  double sum = 0.0;
  for (int i = n - 4; i >= 0; i -= 4)
    sum = sum * x4 + ((c[i] + c[i + 1] * x) + (c[i + 2] + c[i + 3] * x) * x2);
  return sum;
}

/* Returns ln(m) of m in [1/sqrt 2, sqrt 2]: 2 s + 2 s^3 (1/3 + s^2/5 + ...), s = (m-1)/(m+1). */
static inline double log_near_one(double m) {
  static const double c[12] = {1.0 / 3,  1.0 / 5,  1.0 / 7,  1.0 / 9,  1.0 / 11, 1.0 / 13,
                               1.0 / 15, 1.0 / 17, 1.0 / 19, 1.0 / 21, 1.0 / 23, 1.0 / 25};
  const double s = (m - 1.0) / (m + 1.0), w = s * s;
  return 2.0 * s + 2.0 * s * w * polynomial(c, 12, w);
}

/* Returns e^r - 1 for |r| <= 0.35: r + r^2 (1/2! + r/3! + ...). */
static inline double expm1_near_zero(double r) {
  static const double c[12] = {1.0 / 2,          1.0 / 6,           1.0 / 24,
                               1.0 / 120,        1.0 / 720,         1.0 / 5040,
                               1.0 / 40320,      1.0 / 362880,      1.0 / 3628800.0,
                               1.0 / 39916800.0, 1.0 / 479001600.0, 1.0 / 6227020800.0};
  return r + r * r * polynomial(c, 12, r);
}

/* Returns the rounding error of a b, from the upper and lower halves of both (Dekker). */
static inline double product_error(double a, double b, double product) {
  const double split = 134217729.0; /* 2^27 + 1 */
  const double a_high = split * a - (split * a - a), a_low = a - a_high;
  const double b_high = split * b - (split * b - b), b_low = b - b_high;
  return ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
}

/* Returns 2^k, |k| <= 1022. */
static inline double power_of_two(int64_t k) {
  const int64_t bits = (k + 1023) << 52;
  double x;
  memcpy(&x, &bits, sizeof x);
  return x;
}

/* x = 2^e m; x^y = 2^k e^r with k ln 2 + r = y (e ln 2 + ln m), whose large part is kept exactly
 */
double hx_pow(double x, double y) {
  int64_t bits;
  if (!(x >= DBL_MIN)) return y > 0.0 ? 0.0 : y < 0.0 ? HUGE_VAL : 1.0;
  memcpy(&bits, &x, sizeof bits);
  int64_t exponent = (bits >> 52) - 1023;
  double m = x * power_of_two(exponent < 1023 ? -exponent : -1022);
  if (exponent == 1023) m *= 0.5;
  if (m > 1.4142135623730951) m *= 0.5, ++exponent;
  const double high = (double)exponent * ln2_high;
  const double low = (double)exponent * ln2_low + log_near_one(m);
  const double product = y * high;
  const double rest = product_error(y, high, product) + y * low;
  const double k = floor((product + rest) * 1.4426950408889634 + 0.5);
  if (k > 1022.0) return HUGE_VAL;
  if (k < -1022.0) return 0.0;
  const double r = ((product - k * ln2_high) - k * ln2_low) + rest;
  const double scale = power_of_two((int64_t)k);
  return scale + scale * expm1_near_zero(r);
}

/* Three halvings of the angle, tan(half) = y / (x + |(x, y)|), leave |t| <= tan(pi/8); the fourth
 * leaves t <= 0.199, where eleven terms of the series are exact. */
double hx_half_turn_angle(double y, double x) {
  static const double c[12] = {-1.0 / 3,  1.0 / 5,  -1.0 / 7,  1.0 / 9,  -1.0 / 11, 1.0 / 13,
                               -1.0 / 15, 1.0 / 17, -1.0 / 19, 1.0 / 21, -1.0 / 23, 1.0 / 25};
  const double r = sqrt(x * x + y * y);
  if (r == 0.0) return 0.0;
  /* sine and cosine of the half-angle, without cancellation */
  const double sine = x < 0.0 ? r - x : y;
  double cosine = x < 0.0 ? y : x + r;
  for (int halving = 0; halving < 3; ++halving) cosine += sqrt(cosine * cosine + sine * sine);
  const double t = sine / cosine, w = t * t;
  return 16.0 * (t + t * w * polynomial(c, 12, w));
}
