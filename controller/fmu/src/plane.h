/* plane.h - points and directions of a plane as complex numbers x + i y, so that a rotation is one
 * product. */
#ifndef HX_PLANE_H
#define HX_PLANE_H

#include <math.h>

#include "hexapod/inside.h"
#include "transcendental.h"

typedef struct hxPlane {
  double x, y;
} hxPlane;

static inline hxPlane hx_plane(double x, double y) { return (hxPlane){x, y}; }
static inline hxPlane hx_plane_add(hxPlane a, hxPlane b) { return (hxPlane){a.x + b.x, a.y + b.y}; }
static inline hxPlane hx_plane_sub(hxPlane a, hxPlane b) { return (hxPlane){a.x - b.x, a.y - b.y}; }
static inline hxPlane hx_scaled(hxPlane a, double k) { return (hxPlane){a.x * k, a.y * k}; }
static inline hxPlane hx_conj(hxPlane a) { return (hxPlane){a.x, -a.y}; }
static inline hxPlane hx_times(hxPlane a, hxPlane b) {
  return (hxPlane){a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x};
}
static inline double hx_square(hxPlane a) { return a.x * a.x + a.y * a.y; }

/* Returns the length of a vector. Not by hypot, which would need glibc 2.35. */
static inline double hx_length(hxPlane a) { return sqrt(hx_square(a)); }

/* Returns e^x for x <= 0, to 1e-16. */
static inline double hx_decay(double x) { return 1.0 + hx_growth(x); }

/* Return Re(a^* b) and Im(a^* b), the dot and the cross product of two vectors. */
static inline double hx_along(hxPlane a, hxPlane b) { return a.x * b.x + a.y * b.y; }
static inline double hx_across(hxPlane a, hxPlane b) { return a.x * b.y - a.y * b.x; }

static inline hxPlane hx_over(hxPlane a, hxPlane b) {
  return hx_scaled(hx_times(a, hx_conj(b)), 1.0 / hx_square(b));
}

/* Returns e^(i angle). */
static inline hxPlane hx_cis(double angle) {
  hxPlane a;
  hx_sine_cosine(angle, &a.y, &a.x);
  return a;
}

static inline double hx_clamp(double x, double low, double high) {
  return x < low ? low : x > high ? high : x;
}

/* Return the larger and the smaller of x and a bound; the bound if x is not a number. Not by fmax
 * and fmin, which are calls. */
static inline double hx_larger(double x, double bound) { return x > bound ? x : bound; }
static inline double hx_smaller(double x, double bound) { return x < bound ? x : bound; }

/* Returns x - floor(x), for |x| < 2^51. Not by floor, which is a call. */
static inline double hx_fraction(double x) {
  const double whole = (x + hx_rounding) - hx_rounding;
  return x - (whole > x ? whole - 1.0 : whole);
}

#endif
