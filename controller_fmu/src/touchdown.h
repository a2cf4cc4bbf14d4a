/* touchdown.h - ground that is met too early or too late. Python: controller/touchdown.py. */
#ifndef HX_TOUCHDOWN_H
#define HX_TOUCHDOWN_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

extern const double
    hx_early; /* m  a foot that meets the ground with more of its way down to go has met it early */

typedef struct hxTouchdown {
  double offset[HX_LEGS]; /* m  by which paths are raised */
  double late[HX_LEGS]; /* s  for how long the ground has been missed */
} hxTouchdown;

/* What is planned and felt of a foot. */
typedef struct hxMeeting {
  int touching; /* it reports a force */
  double falling; /* m  how far its path, well above its end, comes down in this period */
  int swinging; /* planned in the air */
  int loaded; /* planned to carry its whole share */
} hxMeeting;

/* Whether there is something to look after. */
int hx_touchdown_busy(const hxTouchdown *touchdown);

/* One period [s]. */
void hx_touchdown_step(double period, const hxMeeting meeting[HX_LEGS], hxTouchdown *touchdown);

HX_HIDDEN_END

#endif
