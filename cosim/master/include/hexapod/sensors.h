/* sensors.h - errors of sensors, which lie between the plant and the controller. Both
 * loops, in C and in Python, call them (cosim/master/sensors.py).
 *
 * Values are in the row of a macro-step (macro_step.h); "moment" counts macro-steps from 0. */
#ifndef HEXAPOD_SENSORS_H
#define HEXAPOD_SENSORS_H

#include <stddef.h>
#include <stdint.h>

#include "hexapod/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Faults of a sensor. */
typedef enum hxFault {
  HX_FAULT_NONE,
  HX_FAULT_DEAD,  /* reads what a sensor without a signal reads */
  HX_FAULT_STUCK, /* repeats its last reading */
  HX_FAULT_NAN,   /* reads no numbers */
  HX_FAULT_LATE   /* reads what was true some macro-steps ago */
} hxFault;

/* Equal sensors, each of which reads `size` numbers. Noise comes first, then the delay, then the
 * faults. Until there are readings as old as a delay, the first one is used. */
typedef struct hxSensors {
  size_t count;          /* 1     sensors; 0: none have errors */
  size_t size;           /* 1     numbers of each */
  const size_t *place;   /* 1     [count][size] indices of the true numbers in the row */
  const size_t *reading; /* 1     [count][size] indices of the readings in the row */
  const double *factor;  /* 1     [moments][count][noisy] noise; NULL: none */
  size_t noisy;          /* 1     numbers of each that have noise, the first ones */
  size_t delay;          /* 1     macro-steps by which all readings are late */
  const int8_t *fault;   /* 1     [moments][count] hxFault; NULL: none */
  const int32_t *late;   /* 1     [moments][count] macro-steps, where the fault is HX_FAULT_LATE */
  size_t moments;        /* 1     after them noise repeats, and there are no faults */
  const double *dead, *nan; /*   [size] readings with these faults */
  double *memory;           /*       [slots][count][size] latest numbers, without faults */
  size_t slots;             /* 1     more than the longest delay */
} hxSensors;

/* Computes the readings of a moment from the true numbers. */
HX_API void hx_sensors_read(const hxSensors *sensors, size_t moment, double *row);

#ifdef __cplusplus
}
#endif

#endif
