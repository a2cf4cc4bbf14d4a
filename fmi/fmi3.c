/* fmi3.c - FMI 3.0: legal order, log and instances. The other functions of the standard are in
 * fmi3_values.c and fmi3_simulation.c, in its order. */
#include "fmi/fmi3_calls.h"

#include <stdint.h>

typedef struct fmi3InstanceData {
  hxInstance base; /* first: a pointer to it is a pointer to this */
  fmi3InstanceEnvironment environment;
  fmi3LogMessageCallback log;
} fmi3InstanceData;

_Static_assert(sizeof(fmi3Float64) == sizeof(double) &&
                   sizeof(fmi3ValueReference) == sizeof(unsigned) &&
                   sizeof(fmi3Int32) == sizeof(int),
               "values are copied as they are");

/* ----------------------------------------------------------------------------------------------
 * legal order */

enum {
  RUNNING = HX_MODE_STEP | HX_MODE_EVENT | HX_MODE_CONTINUOUS,
  BEFORE_END = HX_MODE_INSTANTIATED | HX_MODE_INITIALIZATION | RUNNING,
  ANY_MODE = BEFORE_END | HX_MODE_TERMINATED,
  INITIALIZED = HX_MODE_INITIALIZATION | RUNNING | HX_MODE_TERMINATED,
  EITHER = HX_CO_SIMULATION | HX_MODEL_EXCHANGE
};

/* The standard's tables of allowed calls (sections 2.3, 3.2 and 4.2), and the further calls that
 * fmi2.c allows. */
const hxCall hx_fmi3_calls[] = {
    [SET_DEBUG_LOGGING] = {"fmi3SetDebugLogging", ANY_MODE, EITHER},
    [ENTER_INITIALIZATION_MODE] = {"fmi3EnterInitializationMode", HX_MODE_INSTANTIATED, EITHER},
    [EXIT_INITIALIZATION_MODE] = {"fmi3ExitInitializationMode", HX_MODE_INITIALIZATION, EITHER},
    [ENTER_EVENT_MODE] = {"fmi3EnterEventMode", HX_MODE_STEP | HX_MODE_CONTINUOUS, EITHER},
    [TERMINATE] = {"fmi3Terminate", RUNNING | HX_MODE_TERMINATED, EITHER},
    [RESET] = {"fmi3Reset", ANY_MODE, EITHER},
    [GET_FLOAT64] = {"fmi3GetFloat64", ANY_MODE, EITHER},
    [GET_INT64] = {"fmi3GetInt64", ANY_MODE, EITHER},
    [GET_BOOLEAN] = {"fmi3GetBoolean", ANY_MODE, EITHER},
    [GET_OTHER] = {"fmi3Get of a type that no variable here has", ANY_MODE, EITHER},
    [SET_FLOAT64] = {"fmi3SetFloat64", BEFORE_END, EITHER},
    [SET_INT64] = {"fmi3SetInt64", BEFORE_END, EITHER},
    [SET_BOOLEAN] = {"fmi3SetBoolean", BEFORE_END, EITHER},
    [SET_OTHER] = {"fmi3Set of a type that no variable here has", BEFORE_END, EITHER},
    [GET_STATE] = {"fmi3GetFMUState", ANY_MODE, EITHER},
    [SET_STATE] = {"fmi3SetFMUState", ANY_MODE, EITHER},
    [FREE_STATE] = {"fmi3FreeFMUState", ANY_MODE, EITHER},
    [SERIALIZED_SIZE] = {"fmi3SerializedFMUStateSize", ANY_MODE, EITHER},
    [SERIALIZE] = {"fmi3SerializeFMUState", ANY_MODE, EITHER},
    [DESERIALIZE] = {"fmi3DeserializeFMUState", ANY_MODE, EITHER},
    [DIRECTIONAL_DERIVATIVE] = {"fmi3GetDirectionalDerivative", INITIALIZED, EITHER},
    [CLOCKS] = {"a function for clocks", ANY_MODE, EITHER},
    [UPDATE_DISCRETE_STATES] = {"fmi3UpdateDiscreteStates", HX_MODE_EVENT, EITHER},
    [ENTER_CONTINUOUS_TIME_MODE] = {"fmi3EnterContinuousTimeMode", HX_MODE_EVENT,
                                    HX_MODEL_EXCHANGE},
    [COMPLETED_INTEGRATOR_STEP] = {"fmi3CompletedIntegratorStep", HX_MODE_CONTINUOUS,
                                   HX_MODEL_EXCHANGE},
    [SET_TIME] = {"fmi3SetTime", HX_MODE_EVENT | HX_MODE_CONTINUOUS, HX_MODEL_EXCHANGE},
    [SET_CONTINUOUS_STATES] = {"fmi3SetContinuousStates", HX_MODE_CONTINUOUS, HX_MODEL_EXCHANGE},
    [GET_RATES] = {"fmi3GetContinuousStateDerivatives", INITIALIZED, HX_MODEL_EXCHANGE},
    [GET_EVENT_INDICATORS] = {"fmi3GetEventIndicators", INITIALIZED, HX_MODEL_EXCHANGE},
    [GET_CONTINUOUS_STATES] = {"fmi3GetContinuousStates", INITIALIZED, HX_MODEL_EXCHANGE},
    [GET_NOMINALS] = {"fmi3GetNominalsOfContinuousStates", ANY_MODE, HX_MODEL_EXCHANGE},
    [GET_NUMBER] = {"fmi3GetNumberOfXXX", ANY_MODE, HX_MODEL_EXCHANGE},
    [ENTER_STEP_MODE] = {"fmi3EnterStepMode", HX_MODE_EVENT, HX_CO_SIMULATION},
    [GET_OUTPUT_DERIVATIVES] = {"fmi3GetOutputDerivatives", HX_MODE_STEP | HX_MODE_TERMINATED,
                                HX_CO_SIMULATION},
    [DO_STEP] = {"fmi3DoStep", HX_MODE_STEP, HX_CO_SIMULATION},
    [UNSUPPORTED] = {"a function that is not offered", ANY_MODE, EITHER},
};

hxInstance *hx_fmi3_enter(fmi3Instance c, fmi3Call call) {
  return hx_call_is_legal(c, &hx_fmi3_calls[call]) ? c : NULL;
}

fmi3Status hx_fmi3_status(hxStatus status) {
  if (status == HX_OK) return fmi3OK;
  return status == HX_STEP_TOO_SMALL || status == HX_NOT_FINITE ? fmi3Discard : fmi3Error;
}

fmi3Status hx_fmi3_not_supported(fmi3Instance c, const char *name) {
  hxInstance *instance = hx_fmi3_enter(c, UNSUPPORTED);
  if (instance)
    hx_log(instance, HX_LOG_ERROR,
           "%s: got a call, expected none, as the model description does not offer it", name);
  return fmi3Error;
}

fmi3Status hx_fmi3_no_variables(fmi3Instance c, fmi3Call call, size_t n) {
  return hx_fmi3_status(hx_call_no_variables(c, &hx_fmi3_calls[call], n, ""));
}

void hx_fmi3_set_flag(fmi3Boolean *place, int value) {
  if (place) *place = value != 0;
}

/* ----------------------------------------------------------------------------------------------
 * log */

static void log_sink(hxInstance *base, hxLogCategory category, const char *text) {
  static const fmi3Status status[] = {fmi3Error, fmi3Discard, fmi3Warning, fmi3OK, fmi3OK};
  const fmi3InstanceData *instance = (const fmi3InstanceData *)base;
  if (instance->log)
    instance->log(instance->environment, status[category], hx_log_category_names[category], text);
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[]) {
  return hx_fmi3_status(
      hx_call_log_select(c, &hx_fmi3_calls[SET_DEBUG_LOGGING], loggingOn, nCategories, categories));
}

/* ----------------------------------------------------------------------------------------------
 * instances */

const char *fmi3GetVersion(void) { return fmi3Version; }

/* allocates an instance that can log; NULL when out of memory */
static fmi3InstanceData *new_instance(hxInterface interface, fmi3String name, fmi3Boolean loggingOn,
                                      fmi3InstanceEnvironment environment,
                                      fmi3LogMessageCallback log) {
  fmi3InstanceData *instance =
      hx_instance_new(sizeof *instance, interface, name, loggingOn, log_sink);
  if (!instance) return NULL;
  instance->environment = environment;
  instance->log = log;
  return instance;
}

/* Frees an instance, which may be NULL, and returns NULL. An exported function of the same purpose
 * could be another library's when the importer loads symbols globally. */
static fmi3Instance give_up(fmi3InstanceData *instance) {
  hx_instance_free(instance ? &instance->base : NULL);
  return NULL;
}

static fmi3Instance open_instance(fmi3InstanceData *instance, fmi3String token,
                                  fmi3String resources) {
  if (instance && hx_instance_open(&instance->base, token, resources) == HX_OK) return instance;
  return give_up(instance);
}

static fmi3Instance refuse_kind(fmi3InstanceData *instance, const char *kind) {
  if (instance)
    hx_log(&instance->base, HX_LOG_ERROR,
           "instantiation: got %s, expected an interface of the model description; nothing was "
           "instantiated",
           kind);
  return give_up(instance);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible,
                                          fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage) {
  fmi3InstanceData *instance =
      new_instance(HX_MODEL_EXCHANGE, instanceName, loggingOn, instanceEnvironment, logMessage);
  (void)visible;
  return hx_state_count > 0 ? open_instance(instance, instantiationToken, resourcePath)
                            : refuse_kind(instance, "model exchange");
}

/* There are no intermediate updates, so the variables required for them are ignored. */
fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate) {
  fmi3InstanceData *instance =
      new_instance(HX_CO_SIMULATION, instanceName, loggingOn, instanceEnvironment, logMessage);
  (void)visible, (void)requiredIntermediateVariables, (void)nRequiredIntermediateVariables,
      (void)intermediateUpdate;
  if (instance) {
    instance->base.uses_event_mode = eventModeUsed && hx_continuous;
    instance->base.may_return_early = earlyReturnAllowed;
  }
  return open_instance(instance, instantiationToken, resourcePath);
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
    fmi3LockPreemptionCallback lockPreemption, fmi3UnlockPreemptionCallback unlockPreemption) {
  (void)instantiationToken, (void)resourcePath, (void)visible, (void)clockUpdate,
      (void)lockPreemption, (void)unlockPreemption;
  return refuse_kind(
      new_instance(HX_CO_SIMULATION, instanceName, loggingOn, instanceEnvironment, logMessage),
      "scheduled execution");
}

void fmi3FreeInstance(fmi3Instance c) { hx_instance_free(c); }

/* An invalid tolerance gives a warning only, since it is not used. */
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean toleranceDefined,
                                       fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
  hxInstance *instance = hx_fmi3_enter(c, ENTER_INITIALIZATION_MODE);
  const char *name = hx_fmi3_calls[ENTER_INITIALIZATION_MODE].name;
  if (!instance ||
      hx_instance_set_experiment(instance, name, startTime, stopTimeDefined, stopTime) != HX_OK)
    return fmi3Error;
  instance->state.mode = HX_MODE_INITIALIZATION;
  return hx_instance_check_tolerance(instance, name, toleranceDefined, tolerance) ? fmi3OK
                                                                                  : fmi3Warning;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
  return hx_fmi3_status(hx_call_exit_initialization(c, &hx_fmi3_calls[EXIT_INITIALIZATION_MODE]));
}

fmi3Status fmi3EnterEventMode(fmi3Instance c) {
  hxInstance *instance = hx_fmi3_enter(c, ENTER_EVENT_MODE);
  if (!instance) return fmi3Error;
  if (instance->state.mode == HX_MODE_STEP && !instance->uses_event_mode) {
    hx_log(instance, HX_LOG_ERROR,
           "fmi3EnterEventMode: got a call, expected none, as there are no events or eventModeUsed "
           "was false; nothing was changed");
    return fmi3Error;
  }
  instance->state.mode = HX_MODE_EVENT;
  return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance c) {
  return hx_fmi3_status(hx_call_terminate(c, &hx_fmi3_calls[TERMINATE]));
}

fmi3Status fmi3Reset(fmi3Instance c) {
  return hx_fmi3_status(hx_call_reset(c, &hx_fmi3_calls[RESET]));
}
