/* fmi2.c - FMI 2.0 for co-simulation: every function of the standard, in its order. No physics. */
#include "fmi/instance.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

typedef struct fmi2Instance {
  hxInstance base; /* first: a pointer to it is a pointer to this */
  fmi2CallbackFunctions callbacks;
  fmi2Status step_status; /* of the last fmi2DoStep */
} fmi2Instance;

_Static_assert(sizeof(fmi2Real) == sizeof(double) && sizeof(fmi2Boolean) == sizeof(int), "values are copied as they are");

/* ---------------------------------------------------------------------------------------------- legal order */

enum {
  ANY_MODE = HX_MODE_INSTANTIATED | HX_MODE_INITIALIZATION | HX_MODE_STEP | HX_MODE_TERMINATED,
  BEFORE_END = HX_MODE_INSTANTIATED | HX_MODE_INITIALIZATION | HX_MODE_STEP
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
  UNSUPPORTED
} fmi2Call;

/* The standard's table of allowed calls (section 4.2.4), but for two liberties that importers take and that harm nothing:
 * values are read before initialisation, and a terminated instance is terminated again. */
static const struct {
  const char *name;
  int modes;
} calls[] = {
    [SET_DEBUG_LOGGING] = {"fmi2SetDebugLogging", ANY_MODE},
    [SETUP_EXPERIMENT] = {"fmi2SetupExperiment", HX_MODE_INSTANTIATED},
    [ENTER_INITIALIZATION_MODE] = {"fmi2EnterInitializationMode", HX_MODE_INSTANTIATED},
    [EXIT_INITIALIZATION_MODE] = {"fmi2ExitInitializationMode", HX_MODE_INITIALIZATION},
    [TERMINATE] = {"fmi2Terminate", HX_MODE_STEP | HX_MODE_TERMINATED},
    [RESET] = {"fmi2Reset", ANY_MODE},
    [GET_REAL] = {"fmi2GetReal", ANY_MODE},
    [GET_INTEGER] = {"fmi2GetInteger", ANY_MODE},
    [GET_BOOLEAN] = {"fmi2GetBoolean", ANY_MODE},
    [GET_STRING] = {"fmi2GetString", ANY_MODE},
    [SET_REAL] = {"fmi2SetReal", BEFORE_END},
    [SET_INTEGER] = {"fmi2SetInteger", BEFORE_END},
    [SET_BOOLEAN] = {"fmi2SetBoolean", BEFORE_END},
    [SET_STRING] = {"fmi2SetString", BEFORE_END},
    [GET_STATE] = {"fmi2GetFMUstate", ANY_MODE},
    [SET_STATE] = {"fmi2SetFMUstate", ANY_MODE},
    [FREE_STATE] = {"fmi2FreeFMUstate", ANY_MODE},
    [SERIALIZED_SIZE] = {"fmi2SerializedFMUstateSize", ANY_MODE},
    [SERIALIZE] = {"fmi2SerializeFMUstate", ANY_MODE},
    [DESERIALIZE] = {"fmi2DeSerializeFMUstate", ANY_MODE},
    [SET_INPUT_DERIVATIVES] = {"fmi2SetRealInputDerivatives", BEFORE_END},
    [GET_OUTPUT_DERIVATIVES] = {"fmi2GetRealOutputDerivatives", HX_MODE_STEP | HX_MODE_TERMINATED},
    [DO_STEP] = {"fmi2DoStep", HX_MODE_STEP},
    [CANCEL_STEP] = {"fmi2CancelStep", HX_MODE_STEP},
    [GET_STATUS] = {"fmi2GetXXXStatus", ANY_MODE},
    [UNSUPPORTED] = {"a function of another interface", ANY_MODE},
};

static const char *mode_name(int mode) {
  if (mode == HX_MODE_INSTANTIATED) return "before fmi2EnterInitializationMode";
  if (mode == HX_MODE_INITIALIZATION) return "in initialization mode";
  return mode == HX_MODE_STEP ? "between steps" : "after fmi2Terminate";
}

/* the instance of a call that is legal now; NULL, with a message, otherwise */
static fmi2Instance *enter(fmi2Component component, fmi2Call call) {
  fmi2Instance *instance = component;
  if (!instance) return NULL;
  if (!(calls[call].modes & instance->base.state.mode)) {
    hx_log(&instance->base, HX_LOG_ERROR, "%s: got a call %s, where the standard does not allow it; nothing was changed", calls[call].name,
           mode_name(instance->base.state.mode));
    return NULL;
  }
  return instance;
}

static fmi2Status status_of(hxStatus status) {
  if (status == HX_OK) return fmi2OK;
  return status == HX_STEP_TOO_SMALL || status == HX_NOT_FINITE ? fmi2Discard : fmi2Error;
}

/* whether n elements may be at a place; complains if not */
static int given(fmi2Instance *instance, fmi2Call call, size_t n, const void *array, const void *other) {
  if (n == 0 || (array && other)) return 1;
  hx_log(&instance->base, HX_LOG_ERROR, "%s: got NULL, expected an array of %zu; nothing was changed", calls[call].name, n);
  return 0;
}

/* ---------------------------------------------------------------------------------------------- log */

/* the importer's logger reads printf format, and # as a reference to a variable */
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
  instance->callbacks.logger(instance->callbacks.componentEnvironment, base->name, status[category], hx_log_category_names[category],
                             escaped);
}

/* what is passed on: refusals and discarded steps always, the rest when the importer wants it */
static const unsigned always_logged = 1u << HX_LOG_ERROR | 1u << HX_LOG_DISCARD;

static int find_category(const char *name) {
  for (int k = 0; k < HX_LOG_CATEGORIES; k++)
    if (name && strcmp(name, hx_log_category_names[k]) == 0) return k;
  return -1;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories, const fmi2String categories[]) {
  fmi2Instance *instance = enter(c, SET_DEBUG_LOGGING);
  unsigned chosen = nCategories == 0 ? ~0u : 0;
  if (!instance || !given(instance, SET_DEBUG_LOGGING, nCategories, categories, categories)) return fmi2Error;
  for (size_t i = 0; i < nCategories; i++) {
    const int k = find_category(categories[i]);
    if (k < 0) {
      hx_log(&instance->base, HX_LOG_ERROR,
             "fmi2SetDebugLogging: got category '%s', expected one of modelDescription.xml; nothing was changed",
             categories[i] ? categories[i] : "(NULL)");
      return fmi2Error;
    }
    chosen |= k == HX_LOG_ALL ? ~0u : 1u << k;
  }
  const unsigned logged = instance->base.logged;
  instance->base.logged = (loggingOn ? chosen : logged & ~chosen) | always_logged;
  return fmi2OK;
}

/* ---------------------------------------------------------------------------------------------- life */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID, fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn) {
  fmi2Instance *instance = calloc(1, sizeof *instance);
  (void)visible;
  if (!instance) return NULL;
  if (functions) instance->callbacks = *functions;
  instance->base.sink = log_sink;
  instance->base.logged = loggingOn ? ~0u : always_logged;
  if (instanceName) snprintf(instance->base.name, sizeof instance->base.name, "%s", instanceName);
  hxStatus status = HX_INVALID_ARGUMENT;
  if (fmuType == fmi2CoSimulation)
    status = hx_instance_open(&instance->base, fmuGUID, fmuResourceLocation);
  else
    hx_log(&instance->base, HX_LOG_ERROR, "fmi2Instantiate: got model exchange, expected co-simulation; nothing was instantiated");
  if (status == HX_OK) return instance;
  fmi2FreeInstance(instance);
  return NULL;
}

void fmi2FreeInstance(fmi2Component c) {
  fmi2Instance *instance = c;
  if (!instance) return;
  hx_instance_close(&instance->base);
  free(instance);
}

/* the plant's accuracy is its own parameter, so that results do not depend on an importer's settings */
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
  fmi2Instance *instance = enter(c, SETUP_EXPERIMENT);
  if (!instance) return fmi2Error;
  if (!isfinite(startTime) || (stopTimeDefined && !(stopTime >= startTime))) {
    hx_log(&instance->base, HX_LOG_ERROR,
           "fmi2SetupExperiment: got %g s to %g s, expected a finite start and a stop not before it; nothing was changed", startTime,
           stopTimeDefined ? stopTime : startTime);
    return fmi2Error;
  }
  if (fabs(startTime) > hx_latest_start) {
    hx_log(&instance->base, HX_LOG_ERROR,
           "fmi2SetupExperiment: got a start at %.17g s, expected one within %g s of 0, as a later clock is too coarse for the plant's "
           "steps; nothing was changed, count time from a later origin",
           startTime, hx_latest_start);
    return fmi2Error;
  }
  instance->base.state.start_time = startTime;
  instance->base.state.stop_time = stopTimeDefined ? stopTime : INFINITY;
  instance->base.state.model_stale = 1;
  if (!toleranceDefined || (tolerance > 0.0 && tolerance < 1.0)) return fmi2OK;
  hx_log(&instance->base, HX_LOG_WARNING, "fmi2SetupExperiment: got tolerance %g, expected one in ]0, 1[; ignored, solver.tolerance holds",
         tolerance);
  return fmi2Warning;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  fmi2Instance *instance = enter(c, ENTER_INITIALIZATION_MODE);
  if (!instance) return fmi2Error;
  instance->base.state.mode = HX_MODE_INITIALIZATION;
  return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  fmi2Instance *instance = enter(c, EXIT_INITIALIZATION_MODE);
  if (!instance || hx_instance_initialize(&instance->base) != HX_OK) return fmi2Error;
  instance->base.state.mode = HX_MODE_STEP;
  hx_log(&instance->base, HX_LOG_EVENT, "initialized at %.17g s", hx_instance_time(&instance->base));
  return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
  fmi2Instance *instance = enter(c, TERMINATE);
  if (!instance) return fmi2Error;
  if (instance->base.state.mode == HX_MODE_STEP)
    hx_log(&instance->base, HX_LOG_EVENT, "terminated at %.17g s", hx_instance_time(&instance->base));
  instance->base.state.mode = HX_MODE_TERMINATED;
  return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
  fmi2Instance *instance = enter(c, RESET);
  if (!instance) return fmi2Error;
  hx_instance_reset(&instance->base);
  instance->step_status = fmi2OK;
  return fmi2OK;
}

/* ---------------------------------------------------------------------------------------------- values */

static fmi2Status get_values(fmi2Component c, fmi2Call call, hxType type, const fmi2ValueReference vr[], size_t nvr, void *value) {
  fmi2Instance *instance = enter(c, call);
  if (!instance || !given(instance, call, nvr, vr, value)) return fmi2Error;
  return hx_instance_get(&instance->base, type, vr, nvr, value) == HX_OK ? fmi2OK : fmi2Error;
}

static fmi2Status set_values(fmi2Component c, fmi2Call call, hxType type, const fmi2ValueReference vr[], size_t nvr, const void *value) {
  fmi2Instance *instance = enter(c, call);
  if (!instance || !given(instance, call, nvr, vr, value)) return fmi2Error;
  return hx_instance_set(&instance->base, type, vr, nvr, value) == HX_OK ? fmi2OK : fmi2Error;
}

/* there are no String variables, so none can be meant */
static fmi2Status no_strings(fmi2Component c, fmi2Call call, size_t nvr) {
  fmi2Instance *instance = enter(c, call);
  if (instance && nvr == 0) return fmi2OK;
  if (instance)
    hx_log(&instance->base, HX_LOG_ERROR, "%s: got %zu variables, expected none, as this FMU has none of type String", calls[call].name,
           nvr);
  return fmi2Error;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]) {
  return get_values(c, GET_REAL, HX_REAL, vr, nvr, value);
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[]) {
  return get_values(c, GET_INTEGER, HX_INTEGER, vr, nvr, value);
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[]) {
  return get_values(c, GET_BOOLEAN, HX_BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]) {
  (void)vr, (void)value;
  return no_strings(c, GET_STRING, nvr);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
  return set_values(c, SET_REAL, HX_REAL, vr, nvr, value);
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[]) {
  return set_values(c, SET_INTEGER, HX_INTEGER, vr, nvr, value);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[]) {
  return set_values(c, SET_BOOLEAN, HX_BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[]) {
  (void)vr, (void)value;
  return no_strings(c, SET_STRING, nvr);
}

/* ---------------------------------------------------------------------------------------------- saved states */

/* the block a pointer points to, made if there is none yet; NULL when out of memory */
static void *state_block(fmi2Instance *instance, fmi2FMUstate *FMUstate) {
  if (!*FMUstate) *FMUstate = calloc(1, hx_instance_state_size());
  if (!*FMUstate) hx_log(&instance->base, HX_LOG_ERROR, "saved state: out of memory; free some and try again");
  return *FMUstate;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
  fmi2Instance *instance = enter(c, GET_STATE);
  if (!instance || !given(instance, GET_STATE, 1, FMUstate, FMUstate) || !state_block(instance, FMUstate)) return fmi2Error;
  hx_instance_save(&instance->base, *FMUstate);
  return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
  fmi2Instance *instance = enter(c, SET_STATE);
  if (!instance || !given(instance, SET_STATE, 1, FMUstate, FMUstate)) return fmi2Error;
  return status_of(hx_instance_restore(&instance->base, FMUstate));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
  if (!enter(c, FREE_STATE)) return fmi2Error;
  if (FMUstate) {
    free(*FMUstate);
    *FMUstate = NULL;
  }
  return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
  fmi2Instance *instance = enter(c, SERIALIZED_SIZE);
  if (!instance || !given(instance, SERIALIZED_SIZE, 1, FMUstate, size)) return fmi2Error;
  *size = hx_instance_state_size();
  return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size) {
  fmi2Instance *instance = enter(c, SERIALIZE);
  if (!instance || !given(instance, SERIALIZE, 1, FMUstate, serializedState)) return fmi2Error;
  if (size < hx_instance_state_size()) {
    hx_log(&instance->base, HX_LOG_ERROR, "fmi2SerializeFMUstate: got room for %zu bytes, expected %zu; nothing was written", size,
           hx_instance_state_size());
    return fmi2Error;
  }
  if (hx_instance_seal(&instance->base, FMUstate) != HX_OK) return fmi2Error;
  memcpy(serializedState, FMUstate, hx_instance_state_size());
  return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size, fmi2FMUstate *FMUstate) {
  fmi2Instance *instance = enter(c, DESERIALIZE);
  if (!instance || !given(instance, DESERIALIZE, 1, serializedState, FMUstate)) return fmi2Error;
  if (hx_instance_check(&instance->base, serializedState, size) != HX_OK || !state_block(instance, FMUstate)) return fmi2Error;
  memcpy(*FMUstate, serializedState, hx_instance_state_size());
  return fmi2OK;
}

/* ---------------------------------------------------------------------------------------------- co-simulation */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
  fmi2Instance *instance = enter(c, DO_STEP);
  (void)noSetFMUStatePriorToCurrentPoint;
  if (!instance) return fmi2Error;
  instance->step_status = status_of(hx_instance_step(&instance->base, currentCommunicationPoint, communicationStepSize));
  return instance->step_status;
}

fmi2Status fmi2CancelStep(fmi2Component c) {
  fmi2Instance *instance = enter(c, CANCEL_STEP);
  if (instance)
    hx_log(&instance->base, HX_LOG_ERROR, "fmi2CancelStep: got a call, expected none, as steps are finished when fmi2DoStep returns");
  return fmi2Error;
}

/* inputs are held over a step and outputs are not differentiated: canInterpolateInputs and maxOutputDerivativeOrder say so */
static fmi2Status no_derivatives(fmi2Component c, fmi2Call call, size_t nvr) {
  fmi2Instance *instance = enter(c, call);
  if (instance && nvr == 0) return fmi2OK;
  if (instance)
    hx_log(&instance->base, HX_LOG_ERROR, "%s: got %zu derivatives, expected none, as the model description declares", calls[call].name,
           nvr);
  return fmi2Error;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[],
                                       const fmi2Real value[]) {
  (void)vr, (void)order, (void)value;
  return no_derivatives(c, SET_INPUT_DERIVATIVES, nvr);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[],
                                        fmi2Real value[]) {
  (void)vr, (void)order, (void)value;
  return no_derivatives(c, GET_OUTPUT_DERIVATIVES, nvr);
}

/* a kind of status that the type asked for does not have */
static fmi2Status no_status(fmi2Instance *instance, fmi2StatusKind kind) {
  if (!instance) return fmi2Error;
  hx_log(&instance->base, HX_LOG_DISCARD, "fmi2GetXXXStatus: got kind %d, which has no value of this type here; nothing was returned",
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

/* the plant never asks to end the simulation */
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

/* ---------------------------------------------------------------------------------------------- not supported */

/* importers bind every function of the standard, so all are here */
static fmi2Status not_supported(fmi2Component c, const char *name) {
  fmi2Instance *instance = enter(c, UNSUPPORTED);
  if (instance) hx_log(&instance->base, HX_LOG_ERROR, "%s: got a call, expected none, as the model description does not offer it", name);
  return fmi2Error;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
  (void)vUnknown_ref, (void)nUnknown, (void)vKnown_ref, (void)nKnown, (void)dvKnown, (void)dvUnknown;
  return not_supported(c, "fmi2GetDirectionalDerivative");
}

fmi2Status fmi2EnterEventMode(fmi2Component c) { return not_supported(c, "fmi2EnterEventMode"); }

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo) {
  (void)eventInfo;
  return not_supported(c, "fmi2NewDiscreteStates");
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return not_supported(c, "fmi2EnterContinuousTimeMode"); }

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint, fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
  (void)noSetFMUStatePriorToCurrentPoint, (void)enterEventMode, (void)terminateSimulation;
  return not_supported(c, "fmi2CompletedIntegratorStep");
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
  (void)time;
  return not_supported(c, "fmi2SetTime");
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) {
  (void)x, (void)nx;
  return not_supported(c, "fmi2SetContinuousStates");
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) {
  (void)derivatives, (void)nx;
  return not_supported(c, "fmi2GetDerivatives");
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni) {
  (void)eventIndicators, (void)ni;
  return not_supported(c, "fmi2GetEventIndicators");
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) {
  (void)x, (void)nx;
  return not_supported(c, "fmi2GetContinuousStates");
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx) {
  (void)x_nominal, (void)nx;
  return not_supported(c, "fmi2GetNominalsOfContinuousStates");
}
