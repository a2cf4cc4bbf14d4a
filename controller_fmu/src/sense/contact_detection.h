/* contact_detection.h - what the foot force sensors say, and whether they can be believed.
 * Python: controller/sense/contact_detection.py. */
#ifndef HX_CONTACT_DETECTION_H
#define HX_CONTACT_DETECTION_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Touch-down and lift-off with hysteresis (C23) under normal forces [N]; weight: of the robot
 * [N]. */
void hx_contact_detector_step(double weight, const double normal[HX_LEGS], int touching[HX_LEGS]);

/* Which foot sensors contradict the plan for too long (C34). */
typedef struct hxSensorWatchModel {
  double period; /* s */
  double missing; /* N  less than this from all feet, and some force is not being reported */
  double memory; /* s  without contradiction until a sensor is believed again */
} hxSensorWatchModel;

typedef struct hxSensorWatch {
  double contradicted[HX_LEGS]; /* s  for how long */
  double left[HX_LEGS]; /* s  until it is believed again */
} hxSensorWatch;

void hx_sensor_watch_compile(double weight, double cycle, double period, hxSensorWatchModel *model);

/* Whether some sensor contradicts the plan or is not believed. */
int hx_sensor_watch_busy(const hxSensorWatch *watch);

/* One period on. touching, total: feet that report a force and the sum of all normal forces [N];
 * standing: planned to carry their whole share; high: planned well above the ground. */
void hx_sensor_watch_look(const hxSensorWatchModel *model, const int touching[HX_LEGS],
                          double total, const int standing[HX_LEGS], const int high[HX_LEGS],
                          hxSensorWatch *watch);

HX_HIDDEN_END

#endif
