/* power.h - powers of a pack of numbers in plain arithmetic: the kernels include it, and
 * elementary.c with one lane, with the same bits for each number */
#ifndef HX_POWER_H
#define HX_POWER_H

#include <math.h>
#include <stdint.h>

#include "lanes.h"

/* Sums n terms of a polynomial in pairs of pairs, whose chains of operations overlap; n is a
 * multiple of 4. */
static inline hxReal hx_polynomial(const double *c, int n, hxReal x) {
  const hxReal x2 = x * x, x4 = x2 * x2;
  hxReal sum = hx_splat(0.0);
  for (int i = n - 4; i >= 0; i -= 4)
    sum = sum * x4 + ((c[i] + c[i + 1] * x) + (c[i + 2] + c[i + 3] * x) * x2);
  return sum;
}

/* Returns ln(m) of m in [1/sqrt 2, sqrt 2]: 2 s + 2 s^3 (1/3 + s^2/5 + ...), s = (m-1)/(m+1). */
static inline hxReal log_near_one(hxReal m) {
  static const double c[12] = {1.0 / 3,  1.0 / 5,  1.0 / 7,  1.0 / 9,  1.0 / 11, 1.0 / 13,
                               1.0 / 15, 1.0 / 17, 1.0 / 19, 1.0 / 21, 1.0 / 23, 1.0 / 25};
  const hxReal s = (m - 1.0) / (m + 1.0), w = s * s;
  return 2.0 * s + 2.0 * s * w * hx_polynomial(c, 12, w);
}

/* Returns e^r - 1 for |r| <= 0.35: r + r^2 (1/2! + r/3! + ...). */
static inline hxReal expm1_near_zero(hxReal r) {
  static const double c[12] = {1.0 / 2,          1.0 / 6,           1.0 / 24,
                               1.0 / 120,        1.0 / 720,         1.0 / 5040,
                               1.0 / 40320,      1.0 / 362880,      1.0 / 3628800.0,
                               1.0 / 39916800.0, 1.0 / 479001600.0, 1.0 / 6227020800.0};
  return r + r * r * hx_polynomial(c, 12, r);
}

/* Returns the rounding error of a b, from the upper and lower halves of both (Dekker). */
static inline hxReal product_error(hxReal a, hxReal b, hxReal product) {
  const double split = 134217729.0; /* 2^27 + 1 */
  const hxReal a_high = split * a - (split * a - a), a_low = a - a_high;
  const hxReal b_high = split * b - (split * b - b), b_low = b - b_high;
  return ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
}

/* Returns the powers x^y of finite numbers, as hx_pow does. x = 2^e m; x^y = 2^k e^r with k ln 2 +
 * r = y (e ln 2 + ln m), whose large part is kept exactly. */
static inline hxReal hx_lanes_pow(hxReal x, hxReal y) {
  /* ln 2 in two parts; the first has 42 bits, so that its product with an exponent is exact */
  const double ln2_high = 0x1.62e42fefa3800p-1, ln2_low = 0x1.ef35793c76730p-45;
  /* 1.5 * 2^52: adding it rounds to an integer, which is in the last bits of the sum */
  const double round = 6755399441055744.0;
  const int64_t fraction = INT64_C(0xfffffffffffff), exponent_of_one = INT64_C(0x3ff) << 52,
                exponent_of_2_52 = INT64_C(0x433) << 52;
  const double least_below = 0x0.fffffffffffffp-1022; /* the number before DBL_MIN */
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0), infinite = hx_splat(HUGE_VAL);
  const hxMask bits = hx_bits(x);
  /* e and m in [1/sqrt 2, sqrt 2] */
  hxReal m = hx_from_bits((bits & fraction) | exponent_of_one);
  hxReal e = hx_from_bits((bits >> 52) | exponent_of_2_52) - (4503599627370496.0 + 1023.0);
  const hxMask above = hx_less(hx_splat(1.4142135623730951), m);
  m = hx_select(above, 0.5 * m, m), e += hx_select(above, one, zero);
  /* k and r */
  const hxReal high = e * ln2_high, low = e * ln2_low + log_near_one(m);
  const hxReal product = y * high, rest = product_error(y, high, product) + y * low;
  const hxReal place = (product + rest) * 1.4426950408889634 + 0.5,
               nearest = (place + round) - round;
  const hxReal k = nearest - hx_select(hx_less(place, nearest), one, zero);
  const hxReal r = ((product - k * ln2_high) - k * ln2_low) + rest;
  const hxReal scale = hx_from_bits(((hx_bits(k + round) + 1023) & 0x7ff) << 52);
  hxReal power = scale + scale * expm1_near_zero(r);
  power = hx_select(hx_less(k, hx_splat(-1022.0)), zero, power);
  power = hx_select(hx_less(hx_splat(1022.0), k), infinite, power);
  const hxReal of_zero =
      hx_select(hx_less(zero, y), zero, hx_select(hx_less(y, zero), infinite, one));
  return hx_select(hx_less(hx_splat(least_below), x), power, of_zero);
}

#endif
