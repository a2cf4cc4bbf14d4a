/* lanes.h - SIMD packs of legs: hxReal holds HX_LANES doubles, one leg in each lane.
 *
 * All arithmetic on legs uses this type with the operators of C. The width follows the instruction
 * set. The result of a lane does not depend on the width, because every operation is exact IEEE
 * arithmetic lane by lane (no contraction, no libm). The headers in ground, lanes and measure hold
 * the physics on packs; each kernel_*.c includes them once, at its own width.
 */
#ifndef HX_LANES_H
#define HX_LANES_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>
#endif

#include "../elementary.h"
#include "../state.h"

/* Functions of one row of contacts are inline for the feet's first row, HX_INLINE; those for rows
 * that few robots and grounds have are HX_RARE. */
#if defined(__GNUC__)
#define HX_INLINE static inline __attribute__((always_inline))
#else
#define HX_INLINE static inline
#endif

#ifndef HX_TANGENT
typedef double hxNumber; /* number type of the structures of state.h and hexapod.h */

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

#if HX_LANES == 1
typedef double hxReal;
typedef int64_t hxMask;
#else
typedef double hxReal __attribute__((vector_size(8 * HX_LANES)));
typedef int64_t hxMask __attribute__((vector_size(8 * HX_LANES)));
#endif

/* Reorders the lanes of a pack. */
#if defined(__clang__) || __GNUC__ >= 12
#define HX_SHUFFLE(x, ...) __builtin_shufflevector(x, x, __VA_ARGS__)
#else
#define HX_SHUFFLE(x, ...) __builtin_shuffle(x, (hxMask){__VA_ARGS__})
#endif

static inline hxReal hx_load(const double *slots) {
  hxReal x;
  memcpy(&x, slots, sizeof x);
  return x;
}

static inline void hx_store(double *slots, hxReal x) { memcpy(slots, &x, sizeof x); }

/* Returns the numbers at an index from each lane's pointer. */
static inline hxReal hx_gather(const double *const from[HX_LANES], int64_t at) {
#if HX_LANES == 8
  return (hxReal){from[0][at], from[1][at], from[2][at], from[3][at],
                  from[4][at], from[5][at], from[6][at], from[7][at]};
#elif HX_LANES == 4
  return (hxReal){from[0][at], from[1][at], from[2][at], from[3][at]};
#elif HX_LANES == 2
  return (hxReal){from[0][at], from[1][at]};
#else
  return from[0][at];
#endif
}

/* Numbers of complex_step.h have a real part and a derivative; these have no derivative. */
enum { HX_HAS_SLOPES = 0 };
static inline double hx_re(double x) { return x; }
static inline double hx_slope(double x) {
  (void)x;
  return 0.0;
}
static inline double hx_with_slope(double x, double slope) {
  (void)slope;
  return x;
}

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

/* Returns the bits of each lane. */
static inline hxMask hx_bits(hxReal x) {
  hxMask m;
  memcpy(&m, &x, sizeof m);
  return m;
}

/* Returns the lanes that have these bits. */
static inline hxReal hx_from_bits(hxMask m) {
  hxReal x;
  memcpy(&x, &m, sizeof x);
  return x;
}

/* Lane by lane: select = mask ? a : b, min = b < a ? b : a, max = a < b ? b : a. The instructions
 * agree with these formulas, also for NaN and signed zeros. */
#if HX_LANES == 4 && defined(__AVX__)
static inline hxReal hx_select(hxMask mask, hxReal a, hxReal b) {
  return _mm256_blendv_pd(b, a, hx_from_bits(mask));
}
static inline hxReal hx_min(hxReal a, hxReal b) { return _mm256_min_pd(b, a); }
static inline hxReal hx_max(hxReal a, hxReal b) { return _mm256_max_pd(b, a); }
#elif HX_LANES == 8 && defined(__AVX512DQ__)
static inline hxReal hx_select(hxMask mask, hxReal a, hxReal b) {
  return _mm512_mask_blend_pd(_mm512_movepi64_mask((__m512i)mask), b, a);
}
static inline hxReal hx_min(hxReal a, hxReal b) { return _mm512_min_pd(b, a); }
static inline hxReal hx_max(hxReal a, hxReal b) { return _mm512_max_pd(b, a); }
#else
static inline hxReal hx_select(hxMask mask, hxReal a, hxReal b) {
  return hx_from_bits((mask & hx_bits(a)) | (~mask & hx_bits(b)));
}
static inline hxReal hx_min(hxReal a, hxReal b) { return hx_select(hx_less(b, a), b, a); }
static inline hxReal hx_max(hxReal a, hxReal b) { return hx_select(hx_less(a, b), b, a); }
#endif
static inline hxReal hx_clip(hxReal x, hxReal low, hxReal high) {
  return hx_min(hx_max(x, low), high);
}
static inline hxReal hx_abs(hxReal x) { return hx_from_bits(hx_bits(x) & INT64_MAX); }

/* e^x - 1 for |x| <= 40: x = k ln 2 + r, Taylor to r^13 (remainder 4e-18), then 2^k (e^r - 1) +
 * (2^k - 1) */
static inline hxReal hx_expm1(hxReal x) {
  const double round =
      6755399441055744.0; /* 1.5 * 2^52: adding and subtracting it rounds to an integer */
  const double ln2_high = 6.93147180369123816490e-01,
               ln2_low = 1.90821492927058770002e-10; /* ln 2 in two pieces */
  const hxReal shifted = x * 1.4426950408889634 + round;
  const hxReal k = shifted - round;
  const hxReal r = (x - k * ln2_high) - k * ln2_low;
  const hxReal r2 = r * r;
  const hxReal r4 = r2 * r2;
  const hxReal low = (1.0 + r * (1.0 / 2)) + r2 * ((1.0 / 6) + r * (1.0 / 24));
  const hxReal mid = ((1.0 / 120) + r * (1.0 / 720)) + r2 * ((1.0 / 5040) + r * (1.0 / 40320));
  const hxReal high = ((1.0 / 362880) + r * (1.0 / 3628800)) +
                      r2 * ((1.0 / 39916800) + r * (1.0 / 479001600)) + r4 * (1.0 / 6227020800.0);
  const hxReal expm1_r = r * (low + r4 * (mid + r4 * high));
  const hxMask exponent =
      (hx_bits(shifted) & 0x7ff) + 1023; /* k's low bits, two's complement, biased */
  const hxReal power = hx_from_bits((exponent & 0x7ff) << 52);
  return power * expm1_r + (power - 1.0);
}

/* Returns tanh(x), exact to a few units in the last place. */
static inline hxReal hx_tanh(hxReal x) {
  const hxReal e = hx_expm1(2.0 * hx_clip(x, hx_splat(-20.0), hx_splat(20.0)));
  return e / (e + 2.0);
}

/* Returns tanh(x) / x for x > 0. */
static inline hxReal hx_tanh_ratio(hxReal x) {
  const hxReal e = hx_expm1(2.0 * hx_min(x, hx_splat(20.0)));
  return e / ((e + 2.0) * x);
}

/* Returns the angle 2 atan(y / x) in (-pi, pi] from the half-angle's sine y and cosine x, which
 * may have a common factor. Each halving computes tan(half) = y / (x + |(x, y)|). Two halvings
 * leave |t| <= tan(pi/8), where the minimax polynomial is exact to 1.3e-18. */
static inline hxReal hx_angle_from_half(hxReal y, hxReal x) {
  const hxMask back = hx_less(x, hx_splat(0.0));
  const hxReal y2 = y * y;
  hxReal cosine = hx_abs(x);
  for (int halving = 0; halving < 2; ++halving) cosine = cosine + hx_sqrt(cosine * cosine + y2);
  const hxReal t = hx_select(back, -y, y) / cosine;
  const hxReal z = t * t, z2 = z * z, z4 = z2 * z2;
  const hxReal low = (-0.3333333333333313 + z * 0.19999999999942733) +
                     z2 * (-0.14285714279416978 + z * 0.11111110752667197);
  const hxReal mid = (-0.09090897019166005 + z * 0.07692048884053129) +
                     z2 * (-0.06662990413300302 + z * 0.05847147723724963);
  const hxReal high = (-0.05036270404445784 + z * 0.037993873512197886) - z2 * 0.017835677876676313;
  return 8.0 * (t + t * z * (low + z4 * (mid + z4 * high)));
}

/* Returns atan2(y, x), 0 at the origin. The half-angle has the sine y and the cosine x + r, or r -
 * x and |y| where x + r cancels. */
static inline double hx_atan2(double y, double x) {
  const double r = sqrt(x * x + y * y);
  if (r == 0.0) return 0.0;
  const double sine = x < 0.0 ? copysign(r - x, y) : y, cosine = x < 0.0 ? fabs(y) : x + r;
  return hx_lane(hx_angle_from_half(hx_splat(sine), hx_splat(cosine)), 0);
}

/* Returns the angle in [-pi/2, pi/2] whose sine is x. */
static inline double hx_asin(double x) {
  return hx_atan2(x, sqrt(fmax(0.0, (1.0 - x) * (1.0 + x))));
}

/* Computes sine and cosine of each lane with hx_sin_cos. */
static inline void hx_lanes_sin_cos(hxReal x, hxReal *sine, hxReal *cosine) {
  double s[HX_LANES], c[HX_LANES];
  hx_store(s, x);
  for (int i = 0; i < HX_LANES; ++i) hx_sin_cos(s[i], &s[i], &c[i]);
  *sine = hx_load(s), *cosine = hx_load(c);
}

/* Returns whether a mask is set in any lane. */
#if HX_LANES == 8 && defined(__AVX512DQ__)
static inline int hx_any(hxMask mask) { return _mm512_movepi64_mask((__m512i)mask) != 0; }
#elif HX_LANES == 4 && defined(__AVX__)
static inline int hx_any(hxMask mask) { return _mm256_movemask_pd(hx_from_bits(mask)) != 0; }
#else
static inline int hx_any(hxMask mask) {
  int64_t lanes[HX_LANES], any = 0;
  memcpy(lanes, &mask, sizeof lanes);
  for (int i = 0; i < HX_LANES; ++i) any |= lanes[i];
  return any != 0;
}
#endif

/* Returns the largest of all lanes. */
static inline double hx_largest_lane(hxReal x) {
  double lanes[HX_LANES], largest;
  hx_store(lanes, x);
  largest = lanes[0];
  for (int i = 1; i < HX_LANES; ++i) largest = lanes[i] > largest ? lanes[i] : largest;
  return largest;
}

#else
#include "complex_step.h"
#endif

enum {
  HX_PACKS = (HX_LEGS + HX_LANES - 1) / HX_LANES
}; /* packs that hold all legs, HX_LANES legs in each */

/* Returns the sum over eight slots, in an order that does not depend on the width. */
static inline hxNumber hx_sum_slots(const hxReal pack[HX_SLOTS / HX_LANES]) {
  hxNumber x[HX_SLOTS];
  for (int p = 0; p < HX_SLOTS / HX_LANES; ++p) hx_store(&x[p * HX_LANES], pack[p]);
  return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

/* Returns the sum over the legs, in every lane. The order of additions does not depend on the
 * width: ((x0 + x4) + x2) + ((x1 + x5) + x3). */
#if HX_LANES == 2
static inline hxReal hx_sum_legs(const hxReal pack[HX_PACKS]) {
  const hxReal x = (pack[0] + pack[2]) + pack[1];
  return x + HX_SHUFFLE(x, 1, 0);
}
#elif HX_LANES == 4
static inline hxReal hx_sum_legs(const hxReal pack[HX_PACKS]) {
  const hxMask legs = {-1, -1, 0, 0};
  const hxReal x =
      pack[0] +
      hx_select(legs, pack[1], hx_splat(-0.0)); /* adding -0 changes no value, not even -0 */
  const hxReal halves = x + HX_SHUFFLE(x, 2, 3, 0, 1);
  return halves + HX_SHUFFLE(halves, 1, 0, 3, 2);
}
#else
static inline hxReal hx_sum_legs(const hxReal pack[HX_PACKS]) {
  hxNumber x[HX_SLOTS];
  for (int p = 0; p < HX_PACKS; ++p) hx_store(&x[p * HX_LANES], pack[p]);
  return hx_splat(((x[0] + x[4]) + x[2]) + ((x[1] + x[5]) + x[3]));
}
#endif

#endif
