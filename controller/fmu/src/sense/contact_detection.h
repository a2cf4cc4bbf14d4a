/* contact_detection.h - touch-downs and lift-offs from foot force sensors. Python:
 * controller/sense/contact_detection.py. */
#ifndef HX_CONTACT_DETECTION_H
#define HX_CONTACT_DETECTION_H

#include "hexapod/controller.h"
#include <math.h>

/* 1  of the weight: a foot with more touches down, a foot with less lifts off */
static const double contact_share = 0.02, lift_share = 0.005;
/* Detects touch-down and lift-off with hysteresis (C23) from normal forces [N]; weight: of the
 * robot [N]. */
static inline void hx_contact_detector_step(double weight, const double normal[HX_LEGS],
                                            int contact[HX_LEGS]) {
  for (int leg = 0; leg < HX_LEGS; ++leg)
    contact[leg] = normal[leg] > (contact[leg] ? lift_share * weight : contact_share * weight);
}

#endif
