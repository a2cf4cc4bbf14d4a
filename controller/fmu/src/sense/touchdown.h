/* touchdown.h - ground that is met too early or too late (C35, C36). Python:
 * controller/sense/touchdown.py. */
#ifndef HX_TOUCHDOWN_H
#define HX_TOUCHDOWN_H

#include "../plane.h"
#include "hexapod/controller.h"
#include <math.h>

typedef struct hxTouchdown {
  double offset[HX_LEGS]; /* m  by which the paths are raised */
  double late[HX_LEGS];   /* s  for how long the ground has been missing */
  double waited[HX_LEGS]; /* s  for how long the gait clock has waited for the foot */
} hxTouchdown;

/* m  a foot that meets the ground earlier on its way down has met it early */
static const double hx_early = 0.002;
static const double hx_reach_limit = 0.040; /* m  by which a foot is lowered at most */
static const double reach_speed = 0.08;     /* m/s  downwards */
static const double hold_limit = 0.030;     /* m  upwards: the largest step height of the robots */
static const double grace = 0.040; /* s  delay after the planned touch-down that is tolerated */
/* s  of the gait clock, in which a foot that it waits for begins to move down */
static const double search_ramp = 0.025;
static const double return_time = 0.060; /* s  in which an offset decays in the swing */
static const double negligible = 1e-5;   /* m  a smaller offset is set to 0 */

/* Returns whether some foot has an offset or misses the ground. */
static inline int hx_touchdown_busy(const hxTouchdown *touchdown) {
  int busy = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    busy |= touchdown->offset[leg] != 0.0 || touchdown->late[leg] != 0.0;
  return busy;
}

/* Returns the next offset of a foot that returns to its path. */
static inline double faded(double offset, double period) {
  return fabs(offset) > negligible ? offset * hx_decay(-period / return_time) : 0.0;
}

/* Returns the next offset of a foot that has missed the ground for a time, and for which the gait
 * clock has waited [s]. */
static inline double moved(double offset, double late, double waited, double period, int contact,
                           double falling, int swinging) {
  const double part = fmin(waited / search_ramp, 1.0), ramp = part * part,
               pace = reach_speed * (late > grace ? 1.0 : ramp * ramp);
  if (waited > 0.0 || late > grace) return fmax(offset - pace * period, -hx_reach_limit);
  if (swinging && contact && falling > 0.0) return fmin(offset + falling, hold_limit);
  if (swinging && !contact) return faded(offset, period);
  return offset;
}

/* Advances by one period [s] (C36). contact: feet that report a force; falling: distance by which
 * the path of a foot that met the ground early moves down in this period [m], 0 for the others;
 * swinging: legs planned in the air; loaded: legs planned to carry their whole share; searching:
 * feet that the gait clock waits for; open_loop: feet whose sensors have just been doubted. */
static inline void hx_touchdown_step(double period, const int contact[HX_LEGS],
                                     const double falling[HX_LEGS], const int swinging[HX_LEGS],
                                     const int loaded[HX_LEGS], const int searching[HX_LEGS],
                                     const int open_loop[HX_LEGS], hxTouchdown *touchdown) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const int misses = loaded[leg] && !contact[leg] && !open_loop[leg];
    const double offset = touchdown->offset[leg];
    touchdown->late[leg] = misses ? touchdown->late[leg] + period : 0.0;
    touchdown->waited[leg] = searching[leg] ? touchdown->waited[leg] + period : 0.0;
    touchdown->offset[leg] = open_loop[leg]
                                 ? faded(offset, period)
                                 : moved(offset, touchdown->late[leg], touchdown->waited[leg],
                                         period, contact[leg], falling[leg], swinging[leg]);
  }
}

typedef struct hxLandings {
  /* m  height of each foot's path above its end at the last landing; infinite before the first */
  double met[HX_LEGS];
  double before[HX_LEGS]; /* m  the same at the landing before; 0 until then */
  int airborne[HX_LEGS];  /* the foot has left the ground in a swing since */
} hxLandings;

/* Returns the smallest of the other five heights; 0 when it is infinite. */
static inline double least_of_others(const double values[HX_LEGS], int leg) {
  double least = INFINITY;
  for (int other = 0; other < HX_LEGS; ++other)
    if (other != leg) least = fmin(least, values[other]);
  return isfinite(least) ? least : 0.0;
}

static inline void hx_landings_reset(hxLandings *landings) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    landings->met[leg] = INFINITY;
    landings->before[leg] = 0.0;
    landings->airborne[leg] = 0;
  }
}

/* Advances by one period. height: of the paths above their ends [m]. */
static inline void hx_landings_update(const int contact[HX_LEGS], const double height[HX_LEGS],
                                      const int swinging[HX_LEGS], hxLandings *landings) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    if (contact[leg] && landings->airborne[leg]) {
      if (isfinite(landings->met[leg])) landings->before[leg] = landings->met[leg];
      landings->met[leg] = swinging[leg] ? fmax(height[leg], 0.0) : 0.0;
    }
    landings->airborne[leg] = (landings->airborne[leg] || swinging[leg]) && !contact[leg];
  }
}

/* Computes the height at which each foot meets the ground without a bump (C35) [m]; 0 while it is
 * unknown. */
static inline void hx_landings_expected(const hxLandings *landings, const int contact[HX_LEGS],
                                        const double height[HX_LEGS], const int swinging[HX_LEGS],
                                        double expected[HX_LEGS]) {
  double known[HX_LEGS];
  for (int leg = 0; leg < HX_LEGS; ++leg)
    known[leg] = swinging[leg] && !contact[leg] ? fmax(height[leg], 0.0) : landings->met[leg];
  for (int leg = 0; leg < HX_LEGS; ++leg)
    expected[leg] = fmax(least_of_others(known, leg), landings->before[leg]);
}

/* Finds the feet that met the ground early and are still above the height at which feet met it
 * before (C36). */
static inline void hx_landings_early(const hxLandings *landings, const double expected[HX_LEGS],
                                     const double height[HX_LEGS], int early[HX_LEGS]) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double settled = fmax(least_of_others(landings->met, leg), landings->before[leg]);
    early[leg] = landings->met[leg] > expected[leg] + hx_early && height[leg] > settled + hx_early;
  }
}

#endif
