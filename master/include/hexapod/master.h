/* master.h - the co-simulation loop: a plant FMU and a controller FMU, macro-step by macro-step,
 * through functions of FMI 2.0 alone.
 *
 * It does what cosim/master/loop.py does with a controller FMU, in the same order and with the same
 * numbers: at t_k = start + k h read the plant's outputs -> controller -> set the plant's inputs ->
 * record -> both step to t_k + h. Whoever calls it has loaded, initialised and will free both FMUs,
 * and owns all memory: nothing here allocates, prints or has a state of its own. Different hxMaster
 * may run in different threads if their instances differ.
 *
 * All signals of a moment stand in one row of numbers, `value`:
 *
 *   plant outputs | plant flags | push | joint commands | insides | controller flags | readings
 *                                \____ plant inputs ___/
 *                                       \__ controller outputs __/
 *
 * Flags are Booleans as 0 and 1; insides what the controller shows of itself; readings what the
 * feet's force sensors say.
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

/* An initialised instance and the functions it is driven by. */
typedef struct hxMasterFmu {
  fmi2Component instance;
  fmi2GetRealTYPE *get_real;
  fmi2GetBooleanTYPE *get_boolean;
  fmi2SetRealTYPE *set_real;
  fmi2DoStepTYPE *do_step;
} hxMasterFmu;

/* Variables of an FMU that are moved in one call; the first one's place in the row of values. */
typedef struct hxMasterBlock {
  const fmi2ValueReference *reference;
  size_t count;
  size_t place;
} hxMasterBlock;

/* What is wrong with the feet's force sensors, as cosim/master/force_sensor.py has it. They are
 * between the plant and the controller; a fault is what comes out last, after noise and delay. */
typedef struct hxMasterSensor {
  const double *factor;  /* 1     [steps + 1][forces] of the noise; NULL: none */
  const int8_t *fault;   /* 1     [steps + 1][feet] hxMasterFault; NULL: none */
  double *memory; /* N     [delay + 1][forces] room for the latest readings; NULL: no sensor,
                     readings are not made */
  size_t delay; /* 1     macro-steps by which readings are late */
  size_t feet;
  size_t forces; /* 1     of all feet, the same number for each */
  size_t place; /* 1     of the first true force in the row of values */
  size_t reading; /* 1     of the first reading there */
} hxMasterSensor;

typedef enum hxMasterFault { HX_FAULT_NONE, HX_FAULT_DEAD, HX_FAULT_STUCK } hxMasterFault;

/* What an FMU was asked when it refused. */
typedef enum hxMasterCall {
  HX_CALL_NONE,
  HX_CALL_PLANT_GET,
  HX_CALL_PLANT_SET,
  HX_CALL_PLANT_STEP,
  HX_CALL_CONTROLLER_GET,
  HX_CALL_CONTROLLER_SET,
  HX_CALL_CONTROLLER_STEP
} hxMasterCall;

/* Rows of a recording: places in the row of values, and where they are written. */
typedef struct hxMasterTable {
  const size_t *column; /* 1     [columns] places of what is recorded in the row of values */
  size_t columns;
  double *row; /*       rows, `stride` numbers apart, of which the first `columns` are written;
                  NULL: none are */
  size_t stride;
  size_t rows; /* 1     written */
} hxMasterTable;

/* Values of peaks, folded where rows are left out: the largest since the last row. Of the last
 * `counts` places each has a counter: the peak begins anew when that moves on, and so does the
 * largest, when it does for the first time since the last row. */
typedef struct hxMasterPeaks {
  const size_t *place; /* 1     [places] in the row of values */
  size_t places;
  const size_t *count; /* 1     [counts] places of the counters there */
  size_t counts;
  double *largest; /*       [places] room */
  double *seen, *kept; /* 1     [counts] room: the counters a macro-step ago and at the last row */
} hxMasterPeaks;

typedef struct hxMaster {
  hxMasterFmu plant, controller;
  hxMasterBlock plant_output, plant_flag, plant_input;
  hxMasterBlock controller_output, controller_flag;
  fmi2Boolean *flag; /* room for the flags of either */
  double *value; /* the row of values */
  const fmi2ValueReference *controller_input; /* first the command, then what is sensed */
  double *controller_value; /* room for their values */
  const size_t *sensed; /* 1     [sensed_count] places of what is sensed in the row of values */
  size_t command_count, sensed_count;
  hxMasterSensor sensor;
  const double *time; /* s     [steps + 1] */
  const double *command; /*       [steps][command_count] */
  const double *push; /* N, N m  [steps][push_count]; NULL: never any */
  size_t push_count;
  size_t push_place;
  double h; /* s     the macro-step */
  hxMasterTable
      kept; /*       the recording: a row for every `every` macro-steps, and one at the end */
  size_t every;
  hxMasterPeaks peaks; /*       of the rows kept; without effect while every = 1 */
  hxMasterTable judged; /*       a row for each macro-step */
  size_t step; /* 1     macro-steps done */
  int call; /* hxMasterCall  the one that was refused */
  int status; /* fmi2Status    and with what */
} hxMaster;

/* Size of hxMaster, for callers that lay it out themselves. */
HX_API size_t hx_master_size(void);

/* Reads the plant at the start. Returns 1, or 0 when an FMU refused: then call and status say what.
 */
HX_API int hx_master_begin(hxMaster *master);

/* Goes on until `end` macro-steps are done; called again, goes on from there. Returns as
 * hx_master_begin; a row is recorded before the plant steps, so what led to a refused step is
 * there, in the table of all macro-steps at least. */
HX_API int hx_master_run(hxMaster *master, size_t end);

/* Records the present moment: the last row, when all steps are done. */
HX_API void hx_master_record(hxMaster *master);

#ifdef __cplusplus
}
#endif

#endif
