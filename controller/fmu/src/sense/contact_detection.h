/* contact_detection.h - touch-downs and lift-offs from foot force sensors, and sensors that
 * contradict the plan. Python: controller/sense/contact_detection.py. */
#ifndef HX_CONTACT_DETECTION_H
#define HX_CONTACT_DETECTION_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Detects touch-down and lift-off with hysteresis (C23) from normal forces [N]; weight: of the
 * robot [N]. */
void hx_contact_detector_step(double weight, const double normal[HX_LEGS], int touching[HX_LEGS]);

/* Finds the foot sensors that contradict the plan for too long (C34). */
typedef struct hxSensorWatchModel {
  double period; /* s */
  double missing; /* N, when all feet measure less, some sensor reports too little */
  double memory; /* s, time without contradiction until a sensor is trusted again */
} hxSensorWatchModel;

typedef struct hxSensorWatch {
  double contradicted[HX_LEGS]; /* s, duration of the contradiction */
  double left[HX_LEGS]; /* s, time until the sensor is trusted again */
} hxSensorWatch;

void hx_sensor_watch_compile(double weight, double cycle, double period, hxSensorWatchModel *model);

/* Returns whether some sensor contradicts the plan or is not trusted. */
int hx_sensor_watch_busy(const hxSensorWatch *watch);

/* Advances by one period. touching, total: feet that report a force, and the sum of all normal
 * forces [N]; standing: planned to carry their whole share; high: planned well above the ground. */
void hx_sensor_watch_look(const hxSensorWatchModel *model, const int touching[HX_LEGS],
                          double total, const int standing[HX_LEGS], const int high[HX_LEGS],
                          hxSensorWatch *watch);

HX_HIDDEN_END

#endif
