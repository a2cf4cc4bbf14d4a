/* sensors.c - errors of sensors. */
#include "hexapod/sensors.h"

#include <string.h>

/* remembers the numbers of this moment, with their noise */
static void remember(const hxSensors *sensors, size_t moment, const double *row) {
  const size_t n = sensors->count * sensors->size;
  double *newest = sensors->memory + moment % sensors->slots * n;
  for (size_t i = 0; i < n; ++i) newest[i] = row[sensors->place[i]];
  if (!sensors->factor) return;
  const double *factor =
      sensors->factor + moment % sensors->moments * sensors->count * sensors->noisy;
  for (size_t i = 0; i < sensors->count; ++i)
    for (size_t j = 0; j < sensors->noisy; ++j) newest[i * sensors->size + j] *= *factor++;
}

/* returns the numbers of a sensor that are `delay` macro-steps old */
static const double *delayed(const hxSensors *sensors, size_t i, size_t moment, size_t delay) {
  const size_t then = moment > delay ? moment - delay : 0;
  return sensors->memory + (then % sensors->slots * sensors->count + i) * sensors->size;
}

/* returns the numbers that a sensor reads; NULL: its last reading */
static const double *numbers_of(const hxSensors *sensors, size_t i, size_t moment) {
  const size_t place = moment * sensors->count + i;
  const int faulty = sensors->fault && moment < sensors->moments;
  switch (faulty ? sensors->fault[place] : HX_FAULT_NONE) {
  case HX_FAULT_DEAD:
    return sensors->dead;
  case HX_FAULT_NAN:
    return sensors->nan;
  case HX_FAULT_STUCK:
    return moment ? NULL : delayed(sensors, i, moment, 0);
  case HX_FAULT_LATE:
    return delayed(sensors, i, moment, sensors->delay + (size_t)sensors->late[place]);
  default:
    return delayed(sensors, i, moment, sensors->delay);
  }
}

void hx_sensors_read(const hxSensors *sensors, size_t moment, double *row) {
  const size_t *reading = sensors->reading;
  if (!sensors->count) return;
  remember(sensors, moment, row);
  for (size_t i = 0; i < sensors->count; ++i, reading += sensors->size) {
    const double *number = numbers_of(sensors, i, moment);
    for (size_t j = 0; number && j < sensors->size; ++j) row[reading[j]] = number[j];
  }
}
