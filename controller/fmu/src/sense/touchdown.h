/* touchdown.h - ground that is met too early or too late (C36). Python:
 * controller/sense/touchdown.py. */
#ifndef HX_TOUCHDOWN_H
#define HX_TOUCHDOWN_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

extern const double
    hx_early; /* m, a foot that meets the ground earlier on its way down has met it early */

extern const double hx_reach_limit; /* m, by which a foot is lowered at most */

typedef struct hxTouchdown {
  double offset[HX_LEGS]; /* m, by which the paths are raised */
  double late[HX_LEGS]; /* s, for how long the ground has been missing */
} hxTouchdown;

/* Returns whether some foot has an offset or misses the ground. */
int hx_touchdown_busy(const hxTouchdown *touchdown);

/* Advances by one period [s] (C36). touching: feet that report a force; falling: distance by which
 * the path of a foot that met the ground early moves down in this period [m], 0 for the others;
 * swinging: legs planned in the air; loaded: legs planned to carry their whole share; searching:
 * feet that the gait clock waits for; doubted: feet whose sensors are not trusted. */
void hx_touchdown_step(double period, const int touching[HX_LEGS], const double falling[HX_LEGS],
                       const int swinging[HX_LEGS], const int loaded[HX_LEGS],
                       const int searching[HX_LEGS], const int doubted[HX_LEGS],
                       hxTouchdown *touchdown);

HX_HIDDEN_END

#endif
