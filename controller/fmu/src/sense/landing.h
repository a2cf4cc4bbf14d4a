/* landing.h - heights above the ends of their paths at which feet meet the ground. Python:
 * controller/sense/landing.py. */
#ifndef HX_LANDING_H
#define HX_LANDING_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxLandings {
  /* m, height of each foot's path above its end at the last landing; infinite before the first one
   */
  double met[HX_LEGS];
  double before[HX_LEGS]; /* m, the same at the landing before; 0 until then */
  int flew[HX_LEGS]; /* the foot has left the ground in a swing since */
} hxLandings;

void hx_landings_reset(hxLandings *landings);

/* Advances by one period. height: of the paths above their ends [m]. */
void hx_landings_look(const int touching[HX_LEGS], const double height[HX_LEGS],
                      const int swinging[HX_LEGS], hxLandings *landings);

/* Computes the height at which each foot meets the ground without a bump (C35) [m]; 0 while it is
 * unknown. */
void hx_landings_expected(const hxLandings *landings, const int touching[HX_LEGS],
                          const double height[HX_LEGS], const int swinging[HX_LEGS],
                          double expected[HX_LEGS]);

/* Finds the feet that met the ground early and are still above the height at which feet met it
 * before (C36). */
void hx_landings_early(const hxLandings *landings, const double expected[HX_LEGS],
                       const double height[HX_LEGS], int early[HX_LEGS]);

HX_HIDDEN_END

#endif
