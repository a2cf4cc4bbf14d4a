/* fmi3_calls.h - what the files of FMI 3.0 share: the calls, their legal order, results */
#ifndef HX_FMI3_CALLS_H
#define HX_FMI3_CALLS_H

#include "fmi/instance.h"

#include "fmi3Functions.h"

HX_HIDDEN_BEGIN

typedef enum fmi3Call {
  SET_DEBUG_LOGGING,
  ENTER_INITIALIZATION_MODE,
  EXIT_INITIALIZATION_MODE,
  ENTER_EVENT_MODE,
  TERMINATE,
  RESET,
  GET_FLOAT64,
  GET_INT64,
  GET_BOOLEAN,
  GET_OTHER,
  SET_FLOAT64,
  SET_INT64,
  SET_BOOLEAN,
  SET_OTHER,
  GET_STATE,
  SET_STATE,
  FREE_STATE,
  SERIALIZED_SIZE,
  SERIALIZE,
  DESERIALIZE,
  DIRECTIONAL_DERIVATIVE,
  CLOCKS,
  UPDATE_DISCRETE_STATES,
  ENTER_CONTINUOUS_TIME_MODE,
  COMPLETED_INTEGRATOR_STEP,
  SET_TIME,
  SET_CONTINUOUS_STATES,
  GET_RATES,
  GET_EVENT_INDICATORS,
  GET_CONTINUOUS_STATES,
  GET_NOMINALS,
  GET_NUMBER,
  ENTER_STEP_MODE,
  GET_OUTPUT_DERIVATIVES,
  DO_STEP,
  UNSUPPORTED
} fmi3Call;

/* The legal order of the calls. */
extern const hxCall hx_fmi3_calls[];

/* Returns the instance if the call is legal now; otherwise logs and returns NULL. */
hxInstance *hx_fmi3_enter(fmi3Instance c, fmi3Call call);

fmi3Status hx_fmi3_status(hxStatus status);

/* Refuses a function that the FMU does not offer. It exists because importers load every function
 * of the standard. */
fmi3Status hx_fmi3_not_supported(fmi3Instance c, const char *name);

/* Answers a call for types that no variable has, or for clocks. */
fmi3Status hx_fmi3_no_variables(fmi3Instance c, fmi3Call call, size_t n);

/* Sets a flag if the importer wants it. */
void hx_fmi3_set_flag(fmi3Boolean *place, int value);

HX_HIDDEN_END

#endif
