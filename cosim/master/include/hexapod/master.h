/* master.h - the co-simulation loop of a plant FMU and a controller FMU, with functions of FMI 2.0
 * only.
 *
 * It gives the same numbers as cosim/master/loop.py with a controller FMU: at t_k = start + k h it
 * reads the plant's outputs, calculates the controller, sets the plant's inputs, records, and steps
 * both FMUs to t_k + h. The caller loads, initializes and frees both FMUs and owns all memory: the
 * loop does not allocate or print and has no state outside hxMaster. Different hxMaster may run in
 * different threads if their FMU instances differ.
 *
 * All signals at a time are in one row of numbers, `value`:
 *
 *   plant outputs | plant flags | push | joint commands | insides | controller flags | readings
 *                                \____ plant inputs ___/
 *                                       \__ controller outputs __/
 *
 * Flags are Booleans as 0 and 1; insides are internal signals of the controller; readings are those
 * of the feet's force sensors.
 */
#ifndef HEXAPOD_MASTER_H
#define HEXAPOD_MASTER_H

#include <stddef.h>
#include <stdint.h>

#include "fmi2FunctionTypes.h"

#include "hexapod/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* An initialized instance and its functions. */
typedef struct hxMasterFmu {
  fmi2Component instance;
  fmi2GetRealTYPE *get_real;
  fmi2GetBooleanTYPE *get_boolean;
  fmi2SetRealTYPE *set_real;
  fmi2DoStepTYPE *do_step;
} hxMasterFmu;

/* Variables of an FMU that one call reads or writes; place: index of the first in `value`. */
typedef struct hxMasterBlock {
  const fmi2ValueReference *reference;
  size_t count;
  size_t place;
} hxMasterBlock;

/* Noise, delay and faults of the feet's force sensors, in this order, as in
 * cosim/master/force_sensor.py. The sensors are between the plant and the controller. */
typedef struct hxMasterSensor {
  const double *factor;  /* 1     [steps + 1][forces] noise; NULL: none */
  const int8_t *fault;   /* 1     [steps + 1][feet] hxMasterFault; NULL: none */
  double *memory;        /* N     [delay + 1][forces] latest readings; NULL: no sensor */
  size_t delay;          /* 1     macro-steps by which readings are late */
  size_t feet;           /* 1     number of feet */
  size_t forces;         /* 1     number of forces of all feet, equal for each */
  size_t place;          /* 1     index of the first true force in `value` */
  size_t reading;        /* 1     index of the first reading in `value` */
} hxMasterSensor;

typedef enum hxMasterFault { HX_FAULT_NONE, HX_FAULT_DEAD, HX_FAULT_STUCK } hxMasterFault;

/* The call that failed. */
typedef enum hxMasterCall {
  HX_CALL_NONE,
  HX_CALL_PLANT_GET,
  HX_CALL_PLANT_SET,
  HX_CALL_PLANT_STEP,
  HX_CALL_CONTROLLER_GET,
  HX_CALL_CONTROLLER_SET,
  HX_CALL_CONTROLLER_STEP
} hxMasterCall;

/* Rows that are written to a table together: a cache line of each column. */
enum { HX_MASTER_BLOCK = 8 };

/* Rows of a recording: columns of `value` and the memory they are written to, column by column. All
 * rows are there when a function returns. */
typedef struct hxMasterTable {
  const size_t *column; /* 1     [columns] indices in `value` */
  size_t columns;
  double *first; /*       the first row's first number; NULL: none are written */
  size_t stride; /* 1     numbers from a column to the next; those of a column adjoin */
  size_t rows;   /* 1     number of rows written */
  double *block; /*       [HX_MASTER_BLOCK][columns] rows that are not written yet */
  size_t waiting; /* 1     number of these */
} hxMasterTable;

/* Peak values in recordings that leave out rows: the largest value since the last recorded row.
 * Each of the last `counts` peaks has a counter (of landings): the plant restarts the peak when the
 * counter increases, and the largest value restarts at the first such increase since the last row.
 */
typedef struct hxMasterPeaks {
  const size_t *place; /* 1     [places] indices in `value` */
  size_t places;
  const size_t *count; /* 1     [counts] indices of the counters in `value` */
  size_t counts;
  double *largest;     /*       [places] largest values */
  double *seen, *kept; /* 1     [counts] counters a macro-step ago and at the last row */
} hxMasterPeaks;

typedef struct hxMaster {
  hxMasterFmu plant, controller;
  hxMasterBlock plant_output, plant_flag, plant_input;
  hxMasterBlock controller_output, controller_flag;
  fmi2Boolean *flag; /* memory for the flags of one FMU */
  double *value;     /* the row of values */
  const fmi2ValueReference *controller_input; /* the command, then the measurements */
  double *controller_value;                   /* memory for their values */
  const size_t *sensed; /* 1     [sensed_count] indices of the measurements in `value` */
  size_t command_count, sensed_count;
  hxMasterSensor sensor;
  const double *time; /* s     [steps + 1] */
  const double *command; /*       [steps][command_count] */
  const double *push; /* N, N m  [steps][push_count]; NULL: none */
  size_t push_count;
  size_t push_place;
  double h; /* s     the macro-step */
  hxMasterTable kept; /*       the recording: a row every `every` macro-steps and at the end */
  size_t every;
  hxMasterPeaks peaks; /*       of `kept`; not used while every = 1 */
  hxMasterTable judged; /*       a row every macro-step, for metrics */
  size_t step; /* 1     macro-steps done */
  int call; /* hxMasterCall  the failed call */
  int status; /* fmi2Status    of the failed call */
} hxMaster;

/* Number of the layout of hxMaster and of the structures in it. A change of their members, or of
 * what a member means, increases it. */
#define HX_MASTER_LAYOUT 2

/* Layout and size of hxMaster in this library, with which callers check their own. */
HX_API int hx_master_layout(void);
HX_API size_t hx_master_size(void);

/* Reads the plant at the start. Returns 1; 0 when a call failed, which call and status show. */
HX_API int hx_master_begin(hxMaster *master);

/* Runs until `end` macro-steps are done; a further call continues from there. Returns as
 * hx_master_begin. Values are recorded before the plant steps, so that `judged` shows those that
 * led to a failed step. */
HX_API int hx_master_run(hxMaster *master, size_t end);

/* Records the present values, after the last step. */
HX_API void hx_master_record(hxMaster *master);

#ifdef __cplusplus
}
#endif

#endif
