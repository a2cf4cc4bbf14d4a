/* lanes.h - several legs at once: hxReal is HX_LANES doubles, one leg each.
 *
 * All arithmetic on legs goes through this type, with the operators of C. The width follows the instruction set; each lane's
 * result does not depend on it, because every operation here is exact IEEE arithmetic lane by lane (no contraction, no libm).
 */
#ifndef HX_LANES_H
#define HX_LANES_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#ifndef HX_LANES
#if !defined(__GNUC__)
#define HX_LANES 1
#elif defined(__AVX512F__)
#define HX_LANES 8
#elif defined(__AVX__)
#define HX_LANES 4
#else
#define HX_LANES 2
#endif
#endif

/* Linkage of the functions on lanes: ordinary in files compiled by themselves, static where a kernel includes them (kernel_avx2.c). */
#ifndef HX_LOCAL
#define HX_LOCAL
#endif

enum { HX_SLOTS = 8 }; /* legs in memory, padded: slots past the last leg mirror leg 0 */

#if HX_LANES == 1
typedef double hxReal;
typedef int64_t hxMask;
#else
typedef double hxReal __attribute__((vector_size(8 * HX_LANES)));
typedef int64_t hxMask __attribute__((vector_size(8 * HX_LANES)));
#endif

static inline hxReal hx_load(const double *slots) {
  hxReal x;
  memcpy(&x, slots, sizeof x);
  return x;
}

static inline void hx_store(double *slots, hxReal x) { memcpy(slots, &x, sizeof x); }

#if HX_LANES == 1
static inline hxReal hx_splat(double x) { return x; }
static inline double hx_lane(hxReal x, int lane) {
  (void)lane;
  return x;
}
static inline hxMask hx_less(hxReal a, hxReal b) { return a < b ? -1 : 0; }
static inline hxReal hx_sqrt(hxReal x) { return sqrt(x); }
#else
static inline hxReal hx_splat(double x) { return x - (hxReal){0.0}; }
static inline double hx_lane(hxReal x, int lane) { return x[lane]; }
static inline hxMask hx_less(hxReal a, hxReal b) { return (hxMask)(a < b); }
static inline hxReal hx_sqrt(hxReal x) {
  hxReal y;
  for (int lane = 0; lane < HX_LANES; ++lane) y[lane] = sqrt(x[lane]);
  return y;
}
#endif

static inline hxMask hx_bits(hxReal x) {
  hxMask m;
  memcpy(&m, &x, sizeof m);
  return m;
}

static inline hxReal hx_from_bits(hxMask m) {
  hxReal x;
  memcpy(&x, &m, sizeof x);
  return x;
}

/* mask ? a : b, lane by lane */
static inline hxReal hx_select(hxMask mask, hxReal a, hxReal b) { return hx_from_bits((mask & hx_bits(a)) | (~mask & hx_bits(b))); }

static inline hxReal hx_min(hxReal a, hxReal b) { return hx_select(hx_less(b, a), b, a); }
static inline hxReal hx_max(hxReal a, hxReal b) { return hx_select(hx_less(a, b), b, a); }
static inline hxReal hx_clip(hxReal x, hxReal low, hxReal high) { return hx_min(hx_max(x, low), high); }
static inline hxReal hx_abs(hxReal x) { return hx_max(x, -x); }

/* e^x - 1 for |x| <= 40: x = k ln 2 + r, Taylor to r^13 (remainder 4e-18), then 2^k (e^r - 1) + (2^k - 1) */
static inline hxReal hx_expm1(hxReal x) {
  const double round = 6755399441055744.0; /* 1.5 * 2^52: adding and taking it away rounds to an integer */
  const double ln2_high = 6.93147180369123816490e-01, ln2_low = 1.90821492927058770002e-10; /* ln 2 in two pieces */
  const hxReal shifted = x * 1.4426950408889634 + round;
  const hxReal k = shifted - round;
  const hxReal r = (x - k * ln2_high) - k * ln2_low;
  const hxReal r2 = r * r;
  const hxReal r4 = r2 * r2;
  const hxReal low = (1.0 + r * (1.0 / 2)) + r2 * ((1.0 / 6) + r * (1.0 / 24));
  const hxReal mid = ((1.0 / 120) + r * (1.0 / 720)) + r2 * ((1.0 / 5040) + r * (1.0 / 40320));
  const hxReal high = ((1.0 / 362880) + r * (1.0 / 3628800)) + r2 * ((1.0 / 39916800) + r * (1.0 / 479001600)) + r4 * (1.0 / 6227020800.0);
  const hxReal expm1_r = r * (low + r4 * (mid + r4 * high));
  const hxMask exponent = (hx_bits(shifted) & 0x7ff) + 1023; /* k's low bits, two's complement, biased */
  const hxReal power = hx_from_bits((exponent & 0x7ff) << 52);
  return power * expm1_r + (power - 1.0);
}

/* tanh(x), exact to a few units in the last place */
static inline hxReal hx_tanh(hxReal x) {
  const hxReal e = hx_expm1(2.0 * hx_clip(x, hx_splat(-20.0), hx_splat(20.0)));
  return e / (e + 2.0);
}

/* The angle 2 atan(y / x) of a half-angle's sine y and cosine x, up to a common factor; in (-pi, pi].
 * Each tan(half) = y / (x + |(x, y)|); three halvings leave |t| <= tan(pi/16), where the odd series to t^23 is exact to 1e-17. */
static inline hxReal hx_angle_from_half(hxReal y, hxReal x) {
  const hxMask back = hx_less(x, hx_splat(0.0));
  const hxReal y2 = y * y;
  hxReal cosine = hx_abs(x);
  for (int halving = 0; halving < 3; ++halving) cosine = cosine + hx_sqrt(cosine * cosine + y2);
  const hxReal t = hx_select(back, -y, y) / cosine;
  const hxReal z = t * t;
  hxReal series = hx_splat(-1.0 / 23);
  for (int n = 21; n > 1; n -= 2) series = ((n / 2) % 2 ? -1.0 : 1.0) / n + z * series;
  return 16.0 * (t + t * z * series);
}

#endif
