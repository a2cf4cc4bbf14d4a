/* call.h - the functions of FMI 2.0 and 3.0: their legal order, and what both versions share.
 *
 * A reply is the status that a function of the standard returns; both versions number it alike.
 */
#ifndef HEXAPOD_FMI_CALL_H
#define HEXAPOD_FMI_CALL_H

#include "fmi/instance.h"

HX_HIDDEN_BEGIN

enum { HX_REPLY_OK, HX_REPLY_WARNING, HX_REPLY_DISCARD, HX_REPLY_ERROR };

/* Sets of modes and interfaces in which a call may be legal. */
enum {
  HX_RUNNING = HX_MODE_STEP | HX_MODE_EVENT | HX_MODE_CONTINUOUS,
  HX_BEFORE_END = HX_MODE_INSTANTIATED | HX_MODE_INITIALIZATION | HX_RUNNING,
  HX_ANY_MODE = HX_BEFORE_END | HX_MODE_TERMINATED,
  HX_INITIALIZED = HX_MODE_INITIALIZATION | HX_RUNNING | HX_MODE_TERMINATED,
  HX_AFTER_STEP = HX_MODE_STEP | HX_MODE_TERMINATED,
  HX_EITHER = HX_CO_SIMULATION | HX_MODEL_EXCHANGE
};

/* The legal order of the calls: each with its names in FMI 2.0 and 3.0, modes and interfaces (FMI
 * 2.0, sections 3.2.3 and 4.2.4; FMI 3.0, sections 2.3, 3.2 and 4.2). Some importers make further
 * calls that do no harm, which are allowed too: they read values before initialization, read states
 * and rates during it, and terminate a terminated instance. */
#define HX_CALLS(X)                                                                                \
  X(SET_DEBUG_LOGGING, SetDebugLogging, SetDebugLogging, ANY_MODE, EITHER)                         \
  X(SET_UP, SetupExperiment, EnterInitializationMode, MODE_INSTANTIATED, EITHER)                   \
  X(INITIALIZE, EnterInitializationMode, EnterInitializationMode, MODE_INSTANTIATED, EITHER)       \
  X(EXIT_INITIALIZATION, ExitInitializationMode, ExitInitializationMode, MODE_INITIALIZATION,      \
    EITHER)                                                                                        \
  X(TERMINATE, Terminate, Terminate, RUNNING | HX_MODE_TERMINATED, EITHER)                         \
  X(RESET, Reset, Reset, ANY_MODE, EITHER)                                                         \
  X(GET_REALS, GetReal, GetFloat64, ANY_MODE | HX_MODE_INTERMEDIATE, EITHER)                       \
  X(GET_INTEGERS, GetInteger, GetInt64, ANY_MODE | HX_MODE_INTERMEDIATE, EITHER)                   \
  X(GET_BOOLEANS, GetBoolean, GetBoolean, ANY_MODE | HX_MODE_INTERMEDIATE, EITHER)                 \
  X(SET_REALS, SetReal, SetFloat64, BEFORE_END | HX_MODE_INTERMEDIATE, EITHER)                     \
  X(SET_INTEGERS, SetInteger, SetInt64, BEFORE_END, EITHER)                                        \
  X(SET_BOOLEANS, SetBoolean, SetBoolean, BEFORE_END, EITHER)                                      \
  X(GET_STATE, GetFMUstate, GetFMUState, ANY_MODE, EITHER)                                         \
  X(SET_STATE, SetFMUstate, SetFMUState, ANY_MODE, EITHER)                                         \
  X(FREE_STATE, FreeFMUstate, FreeFMUState, ANY_MODE, EITHER)                                      \
  X(STATE_SIZE, SerializedFMUstateSize, SerializedFMUStateSize, ANY_MODE, EITHER)                  \
  X(SERIALIZE, SerializeFMUstate, SerializeFMUState, ANY_MODE, EITHER)                             \
  X(DESERIALIZE, DeSerializeFMUstate, DeserializeFMUState, ANY_MODE, EITHER)                       \
  X(DIRECTIONAL, GetDirectionalDerivative, GetDirectionalDerivative,                               \
    INITIALIZED | HX_MODE_INTERMEDIATE, EITHER)                                                    \
  X(ADJOINT, None, GetAdjointDerivative, INITIALIZED | HX_MODE_INTERMEDIATE, EITHER)               \
  X(SET_INPUT_RATES, SetRealInputDerivatives, None, BEFORE_END, CO_SIMULATION)                     \
  X(GET_OUTPUT_RATES, GetRealOutputDerivatives, GetOutputDerivatives,                              \
    AFTER_STEP | HX_MODE_INTERMEDIATE, CO_SIMULATION)                                              \
  X(DO_STEP, DoStep, DoStep, MODE_STEP, CO_SIMULATION)                                             \
  X(GET_STATUS, GetXXXStatus, None, ANY_MODE, CO_SIMULATION)                                       \
  X(ENTER_STEP_MODE, None, EnterStepMode, MODE_EVENT, CO_SIMULATION)                               \
  X(ENTER_EVENT_MODE, EnterEventMode, EnterEventMode, MODE_STEP | HX_MODE_CONTINUOUS, EITHER)      \
  X(UPDATE, NewDiscreteStates, UpdateDiscreteStates, MODE_EVENT, EITHER)                           \
  X(ENTER_CONTINUOUS_TIME_MODE, EnterContinuousTimeMode, EnterContinuousTimeMode, MODE_EVENT,      \
    MODEL_EXCHANGE)                                                                                \
  X(COMPLETED_STEP, CompletedIntegratorStep, CompletedIntegratorStep, MODE_CONTINUOUS,             \
    MODEL_EXCHANGE)                                                                                \
  X(SET_TIME, SetTime, SetTime, MODE_EVENT | HX_MODE_CONTINUOUS, MODEL_EXCHANGE)                   \
  X(SET_STATES, SetContinuousStates, SetContinuousStates, MODE_CONTINUOUS, MODEL_EXCHANGE)         \
  X(GET_STATES, GetContinuousStates, GetContinuousStates, INITIALIZED, MODEL_EXCHANGE)             \
  X(GET_RATES, GetDerivatives, GetContinuousStateDerivatives, INITIALIZED, MODEL_EXCHANGE)         \
  X(GET_INDICATORS, GetEventIndicators, GetEventIndicators, INITIALIZED, MODEL_EXCHANGE)           \
  X(GET_NOMINALS, GetNominalsOfContinuousStates, GetNominalsOfContinuousStates, ANY_MODE,          \
    MODEL_EXCHANGE)                                                                                \
  X(GET_NUMBER, None, GetNumberOfXXX, ANY_MODE, MODEL_EXCHANGE)

#define HX_CALL_ID(Id, Two, Three, Modes, Interfaces) HX_##Id,
typedef enum hxCall { HX_CALLS(HX_CALL_ID) } hxCall;
#undef HX_CALL_ID

int hx_reply(hxStatus status);

/* The reply that belongs to a category of log messages. */
int hx_reply_of_category(hxLogCategory category);

/* Checks of a call: that it is legal now, which it never is for NULL; that arrays of n > 0 elements
 * are not NULL; both; and that all of n derivatives are of order 1. They return 1, or log and
 * return 0. */
int hx_call_is_legal(hxInstance *instance, hxCall call);
int hx_call_has_arrays(hxInstance *instance, hxCall call, size_t n, const void *array,
                       const void *other);
int hx_call_is_legal_with(hxInstance *instance, hxCall call, size_t n, const void *array,
                          const void *other);
int hx_call_is_first_order(hxInstance *instance, hxCall call, size_t n, const unsigned reference[],
                           const int order[], const double value[]);

/* Refuses a function that the FMU does not offer. It exists because importers load every function
 * of the standard. */
int hx_call_not_offered(hxInstance *instance, const char *name);

/* Answers a function for types that no variable has: only n = 0 variables are right. */
int hx_call_no_variables(hxInstance *instance, const char *name, size_t n);

/* Calls that do the same in both versions: they check, do what the functions of like names in
 * instance.h do, and return the reply. */
int hx_call_log_select(hxInstance *instance, int on, size_t n, const char *const category[]);

/* Sets start and stop time; an invalid tolerance gives a warning only, since it is not used. */
int hx_call_set_experiment(hxInstance *instance, int tolerance_defined, double tolerance,
                           double start, int stop_defined, double stop);
int hx_call_enter_mode(hxInstance *instance, hxCall call, hxMode mode);
int hx_call_enter_event_mode(hxInstance *instance);
int hx_call_exit_initialization(hxInstance *instance);
int hx_call_terminate(hxInstance *instance);
int hx_call_reset(hxInstance *instance);

int hx_call_save(hxInstance *instance, void **block);
int hx_call_restore(hxInstance *instance, const void *block);
int hx_call_free_state(hxInstance *instance, void **block);
int hx_call_state_size(hxInstance *instance, const void *block, size_t *size);
int hx_call_serialize(hxInstance *instance, void *block, void *bytes, size_t n);
int hx_call_deserialize(hxInstance *instance, const void *bytes, size_t n, void **block);

/* Handles the events of model exchange: touch-downs and lift-offs, in one iteration. A step of
 * co-simulation has already handled its own. There are no time events. */
int hx_call_update(hxInstance *instance, int *states_changed);
int hx_call_completed_step(hxInstance *instance);
int hx_call_set_time(hxInstance *instance, double t);
int hx_call_set_states(hxInstance *instance, const double x[], size_t n);

/* Calls a function of exchange.c that reads an array of n doubles. */
typedef hxStatus hxGetter(hxInstance *instance, double value[], size_t n);
int hx_call_get_row(hxInstance *instance, hxCall call, hxGetter *getter, double value[], size_t n);

HX_HIDDEN_END

#endif
