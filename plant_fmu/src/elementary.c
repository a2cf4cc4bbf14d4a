/* elementary.c - series for sine, cosine and logarithm; the power is that of packs/power.h */
#include "elementary.h"

#include <math.h>

#define HX_LANES 1
#include "packs/power.h"

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

double hx_ln(double x) {
  const double ln2 = 0.6931471805599453;
  int exponent;
  double m = frexp(x, &exponent);
  if (m < 0.7071067811865476) m *= 2.0, exponent--;
  return exponent * ln2 + log_of_ratio((m - 1.0) / (m + 1.0));
}

double hx_log1p(double x) { return fabs(x) < 0.25 ? log_of_ratio(x / (2.0 + x)) : hx_ln(1.0 + x); }

double hx_pow(double x, double y) { return hx_lanes_pow(x, y); }
