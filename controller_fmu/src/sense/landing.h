/* landing.h - how high above the ends of their paths feet meet the ground.
 * Python: controller/sense/landing.py. */
#ifndef HX_LANDING_H
#define HX_LANDING_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxLandings {
  /* m  height of each foot's path over its end when it last came down; infinite until it first
   * has */
  double met[HX_LEGS];
  double before[HX_LEGS]; /* m  and the time before that; 0 until then */
  int flew[HX_LEGS]; /* it has been off the ground in a swing since */
} hxLandings;

void hx_landings_reset(hxLandings *landings);

/* One period on. height: of the paths over their ends [m]. */
void hx_landings_look(const int touching[HX_LEGS], const double height[HX_LEGS],
                      const int swinging[HX_LEGS], hxLandings *landings);

/* Where each foot meets the ground without any bump (C35) [m]; 0 while nothing tells. */
void hx_landings_expected(const hxLandings *landings, const int touching[HX_LEGS],
                          const double height[HX_LEGS], const int swinging[HX_LEGS],
                          double expected[HX_LEGS]);

/* Feet that met the ground early and are still above where feet met it before (C36). */
void hx_landings_early(const hxLandings *landings, const double expected[HX_LEGS],
                       const double height[HX_LEGS], int early[HX_LEGS]);

HX_HIDDEN_END

#endif
