/* sensors.c - errors of sensors and servos. */
#include "hexapod/sensors.h"

#include <math.h>
#include <string.h>

/* ----------------------------------------------------------------------------------------------
 * sensors */

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

/* ----------------------------------------------------------------------------------------------
 * servos */

static void break_one(const hxServos *servos, size_t i, int fault, double *row) {
  const double angle = row[servos->angle[i]];
  double *stuck_at = servos->stuck_at + i;
  if (fault != HX_FAULT_STUCK) *stuck_at = (double)NAN;
  if (fault == HX_FAULT_NONE) return;
  if (fault == HX_FAULT_STUCK && isnan(*stuck_at)) *stuck_at = angle;
  /* a servo without torque follows its joint, so that its own law gives none */
  const int stuck = fault == HX_FAULT_STUCK;
  row[servos->angle_ref[i]] = stuck ? *stuck_at : angle;
  row[servos->speed_ref[i]] = stuck ? 0.0 : row[servos->speed[i]];
  row[servos->torque_ref[i]] = 0.0;
  row[servos->acceleration_ref[i]] = 0.0;
}

void hx_servos_break(const hxServos *servos, size_t moment, double *row) {
  const int some = moment < servos->moments;
  for (size_t i = 0; i < servos->count; ++i)
    break_one(servos, i, some ? servos->fault[moment * servos->count + i] : HX_FAULT_NONE, row);
}
