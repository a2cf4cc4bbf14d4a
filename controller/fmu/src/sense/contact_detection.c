#include "contact_detection.h"

#include <math.h>

/* 1, of the weight: a foot with more touches down, a foot with less lifts off */
static const double touch = 0.02, lift = 0.005;
/* s, a force of this duration on a foot in mid-swing is a contradiction */
static const double airborne_time = 0.06;
/* s, no force for this time on a foot that should carry load is a contradiction; both exceed the
 * delay of the sensors */
static const double absent_time = 0.10;
static const double missing_share = 0.92; /* 1  of the weight */
static const double memory_cycles = 1.5; /* 1  gait cycles */

void hx_contact_detector_step(double weight, const double normal[HX_LEGS], int touching[HX_LEGS]) {
  for (int leg = 0; leg < HX_LEGS; ++leg)
    touching[leg] = normal[leg] > (touching[leg] ? lift * weight : touch * weight);
}

void hx_sensor_watch_compile(double weight, double cycle, double period,
                             hxSensorWatchModel *model) {
  model->period = period;
  model->missing = missing_share * weight;
  model->memory = memory_cycles * cycle;
}

int hx_sensor_watch_busy(const hxSensorWatch *watch) {
  int busy = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    busy |= watch->contradicted[leg] != 0.0 || watch->left[leg] != 0.0;
  return busy;
}

void hx_sensor_watch_look(const hxSensorWatchModel *model, const int touching[HX_LEGS],
                          double total, const int standing[HX_LEGS], const int high[HX_LEGS],
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
