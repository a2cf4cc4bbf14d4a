/* one_lane.h - what smooth.h, power.h and soil_law.h need of lanes/lanes.h, with one lane, for
 * sources that no kernel includes */
#ifndef HX_ONE_LANE_H
#define HX_ONE_LANE_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#define HX_LANES 1

/* of lanes.h, too: functions that few grounds need stay out of line */
#if defined(__GNUC__)
#define HX_RARE static __attribute__((noinline))
#else
#define HX_RARE static
#endif

typedef double hxReal;
typedef int64_t hxMask;

static inline hxReal hx_load(const double *slots) { return *slots; }
static inline void hx_store(double *slots, hxReal x) { *slots = x; }
static inline hxReal hx_gather(const double *const *from, int64_t at) { return from[0][at]; }
static inline hxReal hx_splat(double x) { return x; }
static inline hxReal hx_sqrt(hxReal x) { return sqrt(x); }
static inline hxMask hx_less(hxReal a, hxReal b) { return a < b ? -1 : 0; }
static inline hxReal hx_select(hxMask mask, hxReal a, hxReal b) { return mask ? a : b; }
static inline hxReal hx_min(hxReal a, hxReal b) { return b < a ? b : a; }
static inline hxReal hx_max(hxReal a, hxReal b) { return a < b ? b : a; }
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
static inline int hx_any(hxMask mask) { return mask != 0; }

#endif
