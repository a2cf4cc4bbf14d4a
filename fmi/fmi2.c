/* fmi2.c - every function of FMI 2.0, co-simulation and model exchange, in the standard's order. */
#include "fmi/call.h"

#include "fmi2Functions.h"

typedef struct fmi2Instance {
  hxInstance base; /* first: a pointer to it is a pointer to this */
  fmi2CallbackFunctions callbacks;
  fmi2Status step_status; /* of the last fmi2DoStep */
} fmi2Instance;

_Static_assert(sizeof(fmi2Real) == sizeof(double) && sizeof(fmi2Boolean) == sizeof(int),
               "values are copied as they are");
_Static_assert(fmi2Warning == (int)HX_REPLY_WARNING && fmi2Discard == (int)HX_REPLY_DISCARD &&
                   fmi2Error == (int)HX_REPLY_ERROR,
               "replies are returned as they are");

/* ----------------------------------------------------------------------------------------------
 * log */

/* the importer's logger interprets the text as a printf format, and # as a variable reference */
static void log_sink(hxInstance *base, hxLogCategory category, const char *text) {
  const fmi2Instance *instance = (const fmi2Instance *)base;
  char escaped[2 * HX_LOG_SIZE], *out = escaped;
  if (!instance->callbacks.logger) return;
  for (; *text; text++) {
    if (*text == '%' || *text == '#') *out++ = *text;
    *out++ = *text;
  }
  *out = '\0';
  instance->callbacks.logger(instance->callbacks.componentEnvironment, base->name,
                             hx_reply_of_category(category), hx_log_category_names[category],
                             escaped);
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
  return hx_call_log_select(c, loggingOn, nCategories, categories);
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
      hx_instance_new(sizeof *instance, 2, interface, instanceName, loggingOn, log_sink);
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
  return hx_call_set_experiment(c, toleranceDefined, tolerance, startTime, stopTimeDefined,
                                stopTime);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  return hx_call_enter_mode(c, HX_INITIALIZE, HX_MODE_INITIALIZATION);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return hx_call_exit_initialization(c); }

fmi2Status fmi2Terminate(fmi2Component c) { return hx_call_terminate(c); }

fmi2Status fmi2Reset(fmi2Component c) {
  const int reply = hx_call_reset(c);
  if (reply == fmi2OK) ((fmi2Instance *)c)->step_status = fmi2OK;
  return reply;
}

/* ----------------------------------------------------------------------------------------------
 * values */

static fmi2Status get_values(fmi2Component c, hxCall call, hxType type,
                             const fmi2ValueReference vr[], size_t nvr, void *value) {
  if (!hx_call_is_legal_with(c, call, nvr, vr, value)) return fmi2Error;
  return hx_reply(hx_instance_get(c, type, vr, nvr, value));
}

static fmi2Status set_values(fmi2Component c, hxCall call, hxType type,
                             const fmi2ValueReference vr[], size_t nvr, const void *value) {
  if (!hx_call_is_legal_with(c, call, nvr, vr, value)) return fmi2Error;
  return hx_reply(hx_instance_set(c, type, vr, nvr, value));
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
  return get_values(c, HX_GET_REALS, HX_REAL, vr, nvr, value);
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[]) {
  return get_values(c, HX_GET_INTEGERS, HX_INTEGER, vr, nvr, value);
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Boolean value[]) {
  return get_values(c, HX_GET_BOOLEANS, HX_BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         fmi2String value[]) {
  (void)vr, (void)value;
  return hx_call_no_variables(c, __func__, nvr);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
  return set_values(c, HX_SET_REALS, HX_REAL, vr, nvr, value);
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[]) {
  return set_values(c, HX_SET_INTEGERS, HX_INTEGER, vr, nvr, value);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[]) {
  return set_values(c, HX_SET_BOOLEANS, HX_BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         const fmi2String value[]) {
  (void)vr, (void)value;
  return hx_call_no_variables(c, __func__, nvr);
}

/* ----------------------------------------------------------------------------------------------
 * saved states */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
  return hx_call_save(c, FMUstate);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
  return hx_call_restore(c, FMUstate);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
  return hx_call_free_state(c, FMUstate);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
  return hx_call_state_size(c, FMUstate, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                 size_t size) {
  return hx_call_serialize(c, FMUstate, serializedState, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
  return hx_call_deserialize(c, serializedState, size, FMUstate);
}

/* ----------------------------------------------------------------------------------------------
 * co-simulation */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
  fmi2Instance *instance = c;
  (void)noSetFMUStatePriorToCurrentPoint;
  if (!hx_call_is_legal(c, HX_DO_STEP)) return fmi2Error;
  instance->step_status =
      hx_reply(hx_instance_step(c, currentCommunicationPoint, communicationStepSize));
  return instance->step_status;
}

fmi2Status fmi2CancelStep(fmi2Component c) { return hx_call_not_offered(c, __func__); }

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
  if (!hx_call_is_legal(c, HX_SET_INPUT_RATES)) return fmi2Error;
  if (!hx_continuous) return hx_call_not_offered(c, __func__); /* canInterpolateInputs */
  if (!hx_call_is_first_order(c, HX_SET_INPUT_RATES, nvr, vr, order, value)) return fmi2Error;
  return hx_reply(hx_instance_set_input_rates(c, vr, nvr, value));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
  if (!hx_call_is_first_order(c, HX_GET_OUTPUT_RATES, nvr, vr, order, value)) return fmi2Error;
  return hx_reply(hx_instance_get_output_rates(c, vr, nvr, value));
}

/* the instance if its status may be asked for now; otherwise logs and returns NULL */
static fmi2Instance *enter_status(fmi2Component c) {
  return hx_call_is_legal(c, HX_GET_STATUS) ? c : NULL;
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
  fmi2Instance *instance = enter_status(c);
  if (!instance || !value || s != fmi2DoStepStatus) return no_status(instance, s);
  *value = instance->step_status;
  return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
  fmi2Instance *instance = enter_status(c);
  if (!instance || !value || s != fmi2LastSuccessfulTime) return no_status(instance, s);
  *value = hx_instance_time(&instance->base);
  return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
  (void)value;
  return no_status(enter_status(c), s);
}

/* The FMU never requests the end of the simulation. */
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
  fmi2Instance *instance = enter_status(c);
  if (!instance || !value || s != fmi2Terminated) return no_status(instance, s);
  *value = fmi2False;
  return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
  (void)value;
  return no_status(enter_status(c), s);
}

/* ----------------------------------------------------------------------------------------------
 * derivatives */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                        size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
  if (!hx_call_is_legal_with(c, HX_DIRECTIONAL, nUnknown, vUnknown_ref, dvUnknown))
    return fmi2Error;
  if (!hx_call_has_arrays(c, HX_DIRECTIONAL, nKnown, vKnown_ref, dvKnown)) return fmi2Error;
  return hx_reply(
      hx_instance_directional(c, vUnknown_ref, nUnknown, vKnown_ref, nKnown, dvKnown, dvUnknown));
}

/* ----------------------------------------------------------------------------------------------
 * model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component c) { return hx_call_enter_event_mode(c); }

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo) {
  int changed;
  const int reply = hx_call_update(c, &changed);
  if (reply != fmi2OK) return reply;
  if (eventInfo) *eventInfo = (fmi2EventInfo){.valuesOfContinuousStatesChanged = changed};
  return reply;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
  return hx_call_enter_mode(c, HX_ENTER_CONTINUOUS_TIME_MODE, HX_MODE_CONTINUOUS);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
  (void)noSetFMUStatePriorToCurrentPoint;
  const int reply = hx_call_completed_step(c);
  if (reply != fmi2OK) return reply;
  if (enterEventMode) *enterEventMode = fmi2False;
  if (terminateSimulation) *terminateSimulation = fmi2False;
  return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) { return hx_call_set_time(c, time); }

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) {
  return hx_call_set_states(c, x, nx);
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) {
  return hx_call_get_row(c, HX_GET_RATES, hx_instance_get_rates, derivatives, nx);
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni) {
  return hx_call_get_row(c, HX_GET_INDICATORS, hx_instance_get_indicators, eventIndicators, ni);
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) {
  return hx_call_get_row(c, HX_GET_STATES, hx_instance_get_states, x, nx);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx) {
  return hx_call_get_row(c, HX_GET_NOMINALS, hx_instance_get_nominals, x_nominal, nx);
}
