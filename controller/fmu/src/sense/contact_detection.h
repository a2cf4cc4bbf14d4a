/* contact_detection.h - touch-downs and lift-offs from foot force sensors, and sensors that
 * contradict the plan. Python: controller/sense/contact_detection.py. */
#ifndef HX_CONTACT_DETECTION_H
#define HX_CONTACT_DETECTION_H

#include "hexapod/controller.h"
#include <math.h>

/* Finds the foot sensors that contradict the plan for too long (C34). */
typedef struct hxSensorWatchModel {
  double period;  /* s */
  double missing; /* N, when all feet measure less, some sensor reports too little */
  double memory;  /* s, time without contradiction until a sensor is trusted again */
} hxSensorWatchModel;

typedef struct hxSensorWatch {
  double contradicted[HX_LEGS]; /* s, duration of the contradiction */
  double left[HX_LEGS];         /* s, time until the sensor is trusted again */
} hxSensorWatch;

/* 1, of the weight: a foot with more touches down, a foot with less lifts off */
static const double touch_share = 0.02, lift_share = 0.005;
/* s, a force of this duration on a foot in mid-swing is a contradiction */
static const double airborne_time = 0.06;
/* s, no force for this time on a foot that should carry load is a contradiction; both exceed the
 * delay of the sensors */
static const double absent_time = 0.10;
static const double missing_share = 0.92; /* 1  of the weight */
static const double memory_cycles = 1.5;  /* 1  gait cycles */

/* Detects touch-down and lift-off with hysteresis (C23) from normal forces [N]; weight: of the
 * robot [N]. */
static inline void hx_contact_detector_step(double weight, const double normal[HX_LEGS],
                                            int touching[HX_LEGS]) {
  for (int leg = 0; leg < HX_LEGS; ++leg)
    touching[leg] = normal[leg] > (touching[leg] ? lift_share * weight : touch_share * weight);
}

static inline void hx_sensor_watch_compile(double weight, double cycle, double period,
                                           hxSensorWatchModel *model) {
  model->period = period;
  model->missing = missing_share * weight;
  model->memory = memory_cycles * cycle;
}

/* Returns whether some sensor contradicts the plan or is not trusted. */
static inline int hx_sensor_watch_busy(const hxSensorWatch *watch) {
  int busy = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    busy |= watch->contradicted[leg] != 0.0 || watch->left[leg] != 0.0;
  return busy;
}

/* Advances by one period. touching, total: feet that report a force, and the sum of all normal
 * forces [N]; standing: planned to carry their whole share; high: planned well above the ground. */
static inline void hx_sensor_watch_look(const hxSensorWatchModel *model,
                                        const int touching[HX_LEGS], double total,
                                        const int standing[HX_LEGS], const int high[HX_LEGS],
                                        hxSensorWatch *watch) {
  const int missing = total < model->missing;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const int up = high[leg];
    const int wrong = (touching[leg] && up) || (missing && standing[leg] && !touching[leg]);
    watch->contradicted[leg] = wrong ? watch->contradicted[leg] + model->period : 0.0;
    const int too_long = watch->contradicted[leg] > (up ? airborne_time : absent_time);
    watch->left[leg] = too_long ? model->memory : fmax(watch->left[leg] - model->period, 0.0);
  }
}

#endif
