/* landing.h - heights above the ends of their paths at which feet meet the ground. Python:
 * controller/sense/landing.py. */
#ifndef HX_LANDING_H
#define HX_LANDING_H

#include "hexapod/controller.h"
#include "touchdown.h"
#include <math.h>

typedef struct hxLandings {
  /* m, height of each foot's path above its end at the last landing; infinite before the first one
   */
  double met[HX_LEGS];
  double before[HX_LEGS]; /* m, the same at the landing before; 0 until then */
  int flew[HX_LEGS];      /* the foot has left the ground in a swing since */
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
    landings->flew[leg] = 0;
  }
}

/* Advances by one period. height: of the paths above their ends [m]. */
static inline void hx_landings_look(const int touching[HX_LEGS], const double height[HX_LEGS],
                                    const int swinging[HX_LEGS], hxLandings *landings) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    if (touching[leg] && landings->flew[leg]) {
      if (isfinite(landings->met[leg])) landings->before[leg] = landings->met[leg];
      landings->met[leg] = swinging[leg] ? fmax(height[leg], 0.0) : 0.0;
    }
    landings->flew[leg] = (landings->flew[leg] || swinging[leg]) && !touching[leg];
  }
}

/* Computes the height at which each foot meets the ground without a bump (C35) [m]; 0 while it is
 * unknown. */
static inline void hx_landings_expected(const hxLandings *landings, const int touching[HX_LEGS],
                                        const double height[HX_LEGS], const int swinging[HX_LEGS],
                                        double expected[HX_LEGS]) {
  double known[HX_LEGS];
  for (int leg = 0; leg < HX_LEGS; ++leg)
    known[leg] = swinging[leg] && !touching[leg] ? fmax(height[leg], 0.0) : landings->met[leg];
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
