/* fmi2.c - every function of FMI 2.0, co-simulation and model exchange, in the standard's order. */
#include "fmi/instance.h"

#include "fmi2Functions.h"

typedef struct fmi2Instance {
  hxInstance base; /* first: a pointer to it is a pointer to this */
  fmi2CallbackFunctions callbacks;
  fmi2Status step_status; /* of the last fmi2DoStep */
} fmi2Instance;

_Static_assert(sizeof(fmi2Real) == sizeof(double) && sizeof(fmi2Boolean) == sizeof(int),
               "values are copied as they are");

/* ----------------------------------------------------------------------------------------------
 * legal order */

enum {
  EXCHANGING = HX_MODE_EVENT | HX_MODE_CONTINUOUS,
  BEFORE_END = HX_MODE_INSTANTIATED | HX_MODE_INITIALIZATION | HX_MODE_STEP | EXCHANGING,
  ANY_MODE = BEFORE_END | HX_MODE_TERMINATED,
  INITIALIZED = HX_MODE_INITIALIZATION | HX_MODE_STEP | EXCHANGING | HX_MODE_TERMINATED,
  EITHER = HX_CO_SIMULATION | HX_MODEL_EXCHANGE
};

typedef enum fmi2Call {
  SET_DEBUG_LOGGING,
  SETUP_EXPERIMENT,
  ENTER_INITIALIZATION_MODE,
  EXIT_INITIALIZATION_MODE,
  TERMINATE,
  RESET,
  GET_REAL,
  GET_INTEGER,
  GET_BOOLEAN,
  GET_STRING,
  SET_REAL,
  SET_INTEGER,
  SET_BOOLEAN,
  SET_STRING,
  GET_STATE,
  SET_STATE,
  FREE_STATE,
  SERIALIZED_SIZE,
  SERIALIZE,
  DESERIALIZE,
  SET_INPUT_DERIVATIVES,
  GET_OUTPUT_DERIVATIVES,
  DO_STEP,
  CANCEL_STEP,
  GET_STATUS,
  DIRECTIONAL_DERIVATIVE,
  ENTER_EVENT_MODE,
  NEW_DISCRETE_STATES,
  ENTER_CONTINUOUS_TIME_MODE,
  COMPLETED_INTEGRATOR_STEP,
  SET_TIME,
  SET_CONTINUOUS_STATES,
  GET_DERIVATIVES,
  GET_EVENT_INDICATORS,
  GET_CONTINUOUS_STATES,
  GET_NOMINALS
} fmi2Call;

/* The standard's tables of allowed calls (sections 3.2.3 and 4.2.4). Some importers make further
 * calls that do no harm, which are allowed too: they read values before initialization, read states
 * and rates during it, and terminate a terminated instance. */
static const hxCall calls[] = {
    [SET_DEBUG_LOGGING] = {"fmi2SetDebugLogging", ANY_MODE, EITHER},
    [SETUP_EXPERIMENT] = {"fmi2SetupExperiment", HX_MODE_INSTANTIATED, EITHER},
    [ENTER_INITIALIZATION_MODE] = {"fmi2EnterInitializationMode", HX_MODE_INSTANTIATED, EITHER},
    [EXIT_INITIALIZATION_MODE] = {"fmi2ExitInitializationMode", HX_MODE_INITIALIZATION, EITHER},
    [TERMINATE] = {"fmi2Terminate", HX_MODE_STEP | EXCHANGING | HX_MODE_TERMINATED, EITHER},
    [RESET] = {"fmi2Reset", ANY_MODE, EITHER},
    [GET_REAL] = {"fmi2GetReal", ANY_MODE, EITHER},
    [GET_INTEGER] = {"fmi2GetInteger", ANY_MODE, EITHER},
    [GET_BOOLEAN] = {"fmi2GetBoolean", ANY_MODE, EITHER},
    [GET_STRING] = {"fmi2GetString", ANY_MODE, EITHER},
    [SET_REAL] = {"fmi2SetReal", BEFORE_END, EITHER},
    [SET_INTEGER] = {"fmi2SetInteger", BEFORE_END, EITHER},
    [SET_BOOLEAN] = {"fmi2SetBoolean", BEFORE_END, EITHER},
    [SET_STRING] = {"fmi2SetString", BEFORE_END, EITHER},
    [GET_STATE] = {"fmi2GetFMUstate", ANY_MODE, EITHER},
    [SET_STATE] = {"fmi2SetFMUstate", ANY_MODE, EITHER},
    [FREE_STATE] = {"fmi2FreeFMUstate", ANY_MODE, EITHER},
    [SERIALIZED_SIZE] = {"fmi2SerializedFMUstateSize", ANY_MODE, EITHER},
    [SERIALIZE] = {"fmi2SerializeFMUstate", ANY_MODE, EITHER},
    [DESERIALIZE] = {"fmi2DeSerializeFMUstate", ANY_MODE, EITHER},
    [SET_INPUT_DERIVATIVES] = {"fmi2SetRealInputDerivatives", BEFORE_END, HX_CO_SIMULATION},
    [GET_OUTPUT_DERIVATIVES] = {"fmi2GetRealOutputDerivatives", HX_MODE_STEP | HX_MODE_TERMINATED,
                                HX_CO_SIMULATION},
    [DO_STEP] = {"fmi2DoStep", HX_MODE_STEP, HX_CO_SIMULATION},
    [CANCEL_STEP] = {"fmi2CancelStep", HX_MODE_STEP, HX_CO_SIMULATION},
    [GET_STATUS] = {"fmi2GetXXXStatus", ANY_MODE, HX_CO_SIMULATION},
    [DIRECTIONAL_DERIVATIVE] = {"fmi2GetDirectionalDerivative", INITIALIZED, EITHER},
    [ENTER_EVENT_MODE] = {"fmi2EnterEventMode", HX_MODE_CONTINUOUS, HX_MODEL_EXCHANGE},
    [NEW_DISCRETE_STATES] = {"fmi2NewDiscreteStates", HX_MODE_EVENT, HX_MODEL_EXCHANGE},
    [ENTER_CONTINUOUS_TIME_MODE] = {"fmi2EnterContinuousTimeMode", HX_MODE_EVENT,
                                    HX_MODEL_EXCHANGE},
    [COMPLETED_INTEGRATOR_STEP] = {"fmi2CompletedIntegratorStep", HX_MODE_CONTINUOUS,
                                   HX_MODEL_EXCHANGE},
    [SET_TIME] = {"fmi2SetTime", EXCHANGING, HX_MODEL_EXCHANGE},
    [SET_CONTINUOUS_STATES] = {"fmi2SetContinuousStates", HX_MODE_CONTINUOUS, HX_MODEL_EXCHANGE},
    [GET_DERIVATIVES] = {"fmi2GetDerivatives", INITIALIZED, HX_MODEL_EXCHANGE},
    [GET_EVENT_INDICATORS] = {"fmi2GetEventIndicators", INITIALIZED, HX_MODEL_EXCHANGE},
    [GET_CONTINUOUS_STATES] = {"fmi2GetContinuousStates", INITIALIZED, HX_MODEL_EXCHANGE},
    [GET_NOMINALS] = {"fmi2GetNominalsOfContinuousStates", ANY_MODE, HX_MODEL_EXCHANGE},
};

/* the instance if the call is legal now; otherwise logs and returns NULL */
static fmi2Instance *enter(fmi2Component component, fmi2Call call) {
  return hx_call_is_legal(component, &calls[call]) ? component : NULL;
}

static fmi2Status status_of(hxStatus status) {
  if (status == HX_OK) return fmi2OK;
  return status == HX_STEP_TOO_SMALL || status == HX_NOT_FINITE ? fmi2Discard : fmi2Error;
}

/* ----------------------------------------------------------------------------------------------
 * log */

/* the importer's logger interprets the text as a printf format, and # as a variable reference */
static void log_sink(hxInstance *base, hxLogCategory category, const char *text) {
  static const fmi2Status status[] = {fmi2Error, fmi2Discard, fmi2Warning, fmi2OK, fmi2OK};
  const fmi2Instance *instance = (const fmi2Instance *)base;
  char escaped[2 * HX_LOG_SIZE], *out = escaped;
  if (!instance->callbacks.logger) return;
  for (; *text; text++) {
    if (*text == '%' || *text == '#') *out++ = *text;
    *out++ = *text;
  }
  *out = '\0';
  instance->callbacks.logger(instance->callbacks.componentEnvironment, base->name, status[category],
                             hx_log_category_names[category], escaped);
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
  return status_of(
      hx_call_log_select(c, &calls[SET_DEBUG_LOGGING], loggingOn, nCategories, categories));
}

/* ----------------------------------------------------------------------------------------------
 * instances */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean loggingOn) {
  const hxInterface interface = fmuType == fmi2CoSimulation ? HX_CO_SIMULATION : HX_MODEL_EXCHANGE;
  fmi2Instance *instance =
      hx_instance_new(sizeof *instance, interface, instanceName, loggingOn, log_sink);
  (void)visible;
  if (!instance) return NULL;
  if (functions) instance->callbacks = *functions;
  hxStatus status = HX_INVALID_ARGUMENT;
  if (fmuType == fmi2CoSimulation || (fmuType == fmi2ModelExchange && hx_continuous))
    status = hx_instance_open(&instance->base, fmuGUID, fmuResourceLocation);
  else
    hx_log(&instance->base, HX_LOG_ERROR,
           "fmi2Instantiate: got interface type %d, expected one of the model description's; "
           "nothing was instantiated",
           (int)fmuType);
  if (status == HX_OK) return instance;
  hx_instance_free(&instance->base); /* not fmi2FreeInstance: it may be another library's */
  return NULL;
}

void fmi2FreeInstance(fmi2Component c) { hx_instance_free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
  fmi2Instance *instance = enter(c, SETUP_EXPERIMENT);
  const char *name = calls[SETUP_EXPERIMENT].name;
  if (!instance || hx_instance_set_experiment(&instance->base, name, startTime, stopTimeDefined,
                                              stopTime) != HX_OK)
    return fmi2Error;
  return hx_instance_check_tolerance(&instance->base, name, toleranceDefined, tolerance)
             ? fmi2OK
             : fmi2Warning;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  return status_of(
      hx_call_enter_mode(c, &calls[ENTER_INITIALIZATION_MODE], HX_MODE_INITIALIZATION));
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  return status_of(hx_call_exit_initialization(c, &calls[EXIT_INITIALIZATION_MODE]));
}

fmi2Status fmi2Terminate(fmi2Component c) {
  return status_of(hx_call_terminate(c, &calls[TERMINATE]));
}

fmi2Status fmi2Reset(fmi2Component c) {
  fmi2Instance *instance = enter(c, RESET);
  if (!instance) return fmi2Error;
  hx_instance_reset(&instance->base);
  instance->step_status = fmi2OK;
  return fmi2OK;
}

/* ----------------------------------------------------------------------------------------------
 * values */

static fmi2Status get_values(fmi2Component c, fmi2Call call, hxType type,
                             const fmi2ValueReference vr[], size_t nvr, void *value) {
  if (!hx_call_is_legal_with(c, &calls[call], nvr, vr, value)) return fmi2Error;
  return status_of(hx_instance_get(c, type, vr, nvr, value));
}

static fmi2Status set_values(fmi2Component c, fmi2Call call, hxType type,
                             const fmi2ValueReference vr[], size_t nvr, const void *value) {
  if (!hx_call_is_legal_with(c, &calls[call], nvr, vr, value)) return fmi2Error;
  return hx_instance_set(c, type, vr, nvr, value) == HX_OK ? fmi2OK : fmi2Error;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
  return get_values(c, GET_REAL, HX_REAL, vr, nvr, value);
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[]) {
  return get_values(c, GET_INTEGER, HX_INTEGER, vr, nvr, value);
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Boolean value[]) {
  return get_values(c, GET_BOOLEAN, HX_BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         fmi2String value[]) {
  (void)vr, (void)value;
  return status_of(hx_call_no_variables(c, &calls[GET_STRING], nvr, " of type String"));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
  return set_values(c, SET_REAL, HX_REAL, vr, nvr, value);
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[]) {
  return set_values(c, SET_INTEGER, HX_INTEGER, vr, nvr, value);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[]) {
  return set_values(c, SET_BOOLEAN, HX_BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         const fmi2String value[]) {
  (void)vr, (void)value;
  return status_of(hx_call_no_variables(c, &calls[SET_STRING], nvr, " of type String"));
}

/* ----------------------------------------------------------------------------------------------
 * saved states */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
  return status_of(hx_call_save(c, &calls[GET_STATE], FMUstate));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
  return status_of(hx_call_restore(c, &calls[SET_STATE], FMUstate));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
  return status_of(hx_call_free_state(c, &calls[FREE_STATE], FMUstate));
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
  return status_of(hx_call_state_size(c, &calls[SERIALIZED_SIZE], FMUstate, size));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                 size_t size) {
  return status_of(hx_call_serialize(c, &calls[SERIALIZE], FMUstate, serializedState, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
  return status_of(hx_call_deserialize(c, &calls[DESERIALIZE], serializedState, size, FMUstate));
}

/* ----------------------------------------------------------------------------------------------
 * co-simulation */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
  fmi2Instance *instance = enter(c, DO_STEP);
  (void)noSetFMUStatePriorToCurrentPoint;
  if (!instance) return fmi2Error;
  instance->step_status = status_of(
      hx_instance_step(&instance->base, currentCommunicationPoint, communicationStepSize));
  return instance->step_status;
}

fmi2Status fmi2CancelStep(fmi2Component c) {
  fmi2Instance *instance = enter(c, CANCEL_STEP);
  if (instance)
    hx_log(&instance->base, HX_LOG_ERROR,
           "fmi2CancelStep: got a call, expected none, as steps are finished when fmi2DoStep "
           "returns");
  return fmi2Error;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
  if (!hx_call_is_first_order(c, &calls[SET_INPUT_DERIVATIVES], nvr, vr, order, value))
    return fmi2Error;
  return status_of(hx_instance_set_input_rates(c, vr, nvr, value));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
  if (!hx_call_is_first_order(c, &calls[GET_OUTPUT_DERIVATIVES], nvr, vr, order, value))
    return fmi2Error;
  return status_of(hx_instance_get_output_rates(c, vr, nvr, value));
}

/* refuses a kind of status that has no value of the requested type */
static fmi2Status no_status(fmi2Instance *instance, fmi2StatusKind kind) {
  if (!instance) return fmi2Error;
  hx_log(&instance->base, HX_LOG_DISCARD,
         "fmi2GetXXXStatus: got kind %d, which has no value of this type here; nothing was "
         "returned",
         (int)kind);
  return fmi2Discard;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
  fmi2Instance *instance = enter(c, GET_STATUS);
  if (!instance || !value || s != fmi2DoStepStatus) return no_status(instance, s);
  *value = instance->step_status;
  return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
  fmi2Instance *instance = enter(c, GET_STATUS);
  if (!instance || !value || s != fmi2LastSuccessfulTime) return no_status(instance, s);
  *value = hx_instance_time(&instance->base);
  return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
  (void)value;
  return no_status(enter(c, GET_STATUS), s);
}

/* The FMU never requests the end of the simulation. */
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
  fmi2Instance *instance = enter(c, GET_STATUS);
  if (!instance || !value || s != fmi2Terminated) return no_status(instance, s);
  *value = fmi2False;
  return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
  (void)value;
  return no_status(enter(c, GET_STATUS), s);
}

/* ----------------------------------------------------------------------------------------------
 * derivatives */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                        size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
  if (!hx_call_is_legal_with(c, &calls[DIRECTIONAL_DERIVATIVE], nUnknown, vUnknown_ref, dvUnknown))
    return fmi2Error;
  if (!hx_call_has_arrays(c, &calls[DIRECTIONAL_DERIVATIVE], nKnown, vKnown_ref, dvKnown))
    return fmi2Error;
  return status_of(
      hx_instance_directional(c, vUnknown_ref, nUnknown, vKnown_ref, nKnown, dvKnown, dvUnknown));
}

/* ----------------------------------------------------------------------------------------------
 * model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
  return status_of(hx_call_enter_mode(c, &calls[ENTER_EVENT_MODE], HX_MODE_EVENT));
}

/* Handles touch-downs and lift-offs. One iteration is enough, and there are no time events. */
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo) {
  fmi2Instance *instance = enter(c, NEW_DISCRETE_STATES);
  int changed;
  if (!instance || !hx_call_has_arrays(c, &calls[NEW_DISCRETE_STATES], 1, eventInfo, eventInfo))
    return fmi2Error;
  const hxStatus status = hx_instance_update(&instance->base, &changed);
  *eventInfo = (fmi2EventInfo){.valuesOfContinuousStatesChanged = changed};
  return status_of(status);
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
  return status_of(hx_call_enter_mode(c, &calls[ENTER_CONTINUOUS_TIME_MODE], HX_MODE_CONTINUOUS));
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
  fmi2Instance *instance = enter(c, COMPLETED_INTEGRATOR_STEP);
  (void)noSetFMUStatePriorToCurrentPoint;
  if (!instance || !hx_call_has_arrays(c, &calls[COMPLETED_INTEGRATOR_STEP], 1, enterEventMode,
                                       terminateSimulation))
    return fmi2Error;
  *enterEventMode = *terminateSimulation = fmi2False;
  return status_of(hx_instance_completed_step(&instance->base));
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
  return status_of(hx_call_set_time(c, &calls[SET_TIME], time));
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) {
  return status_of(hx_call_set_states(c, &calls[SET_CONTINUOUS_STATES], x, nx));
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) {
  return status_of(
      hx_call_get_row(c, &calls[GET_DERIVATIVES], hx_instance_get_rates, derivatives, nx));
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni) {
  return status_of(hx_call_get_row(c, &calls[GET_EVENT_INDICATORS], hx_instance_get_indicators,
                                   eventIndicators, ni));
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) {
  return status_of(
      hx_call_get_row(c, &calls[GET_CONTINUOUS_STATES], hx_instance_get_states, x, nx));
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx) {
  return status_of(
      hx_call_get_row(c, &calls[GET_NOMINALS], hx_instance_get_nominals, x_nominal, nx));
}
