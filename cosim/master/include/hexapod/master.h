/* master.h - the co-simulation loop of a plant FMU and a controller FMU, with functions of FMI 2.0
 * only.
 *
 * It gives the same numbers as cosim/master/loop.py with a controller FMU. The caller loads,
 * initializes and frees both FMUs and owns all memory: the loop does not allocate or print and has
 * no state outside hxMaster. Different hxMaster may run in different threads if their FMU instances
 * differ.
 */
#ifndef HEXAPOD_MASTER_H
#define HEXAPOD_MASTER_H

#include <stddef.h>
#include <stdint.h>

#include "hexapod/macro_step.h"
#include "hexapod/sensors.h"
#include "hexapod/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A parameter of the plant that gets a value before a macro-step. */
typedef struct hxTuning {
  size_t step;
  double value;
  unsigned reference;
} hxTuning;

/* A run of macro-steps: what differs from one macro-step to the next, and where rows go. */
typedef struct hxMaster {
  hxStepper stepper;
  hxSensors feet, joints, torso;
  const double *time;    /* s     [steps + 1] */
  const double *command; /*       [steps][command_count] */
  const double *push;    /* [steps][push_count] pushes, before them faults of servos; NULL: none */
  size_t push_count;
  size_t push_place;      /* 1     index in the row */
  const hxTuning *tuning; /*     [tunings] in order of steps */
  size_t tunings, tuned;  /* 1     their number, and how many were made */
  const uint8_t *lost; /* 1     [steps] whether the plant keeps its last joint commands; NULL: no */
  size_t drive_place;  /* 1     index of the first joint command in the row */
  size_t drive_count;  /* 1     joint commands */
  double *drive;       /*       [drive_count] the last joint commands */
  const size_t *column; /* 1     [columns] indices in the row of the values to record */
  size_t columns;
  double *record;  /*       where the next row is written, which adjoins the one before */
  size_t recorded; /* 1     number of rows written */
  size_t step;     /* 1     macro-steps done */
} hxMaster;

/* Number of the layout of hxMaster and of the structures in it. A change of their members, or of
 * what a member means, increases it. */
#define HX_MASTER_LAYOUT 5

/* Layout and size of hxMaster in this library, with which callers check their own. */
HX_API int hx_master_layout(void);
HX_API size_t hx_master_size(void);

/* Reads the plant at the start. Returns 1; 0 when a call failed, which stepper.call and
 * stepper.status show. */
HX_API int hx_master_begin(hxMaster *master);

/* Runs until `end` macro-steps are done; a further call continues from there. Returns as
 * hx_master_begin. */
HX_API int hx_master_run(hxMaster *master, size_t end);

/* Records the present values, after the last step. */
HX_API void hx_master_record(hxMaster *master);

#ifdef __cplusplus
}
#endif

#endif
