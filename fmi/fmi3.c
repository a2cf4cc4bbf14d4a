/* fmi3.c - every function of FMI 3.0, in the standard's order. */
#include "fmi/call.h"

#include <stdlib.h>

#include "fmi3Functions.h"

typedef struct fmi3InstanceData {
  hxInstance base; /* first: a pointer to it is a pointer to this */
  fmi3InstanceEnvironment environment;
  fmi3LogMessageCallback log;
  fmi3IntermediateUpdateCallback intermediate; /* NULL: there are no intermediate updates */
  void *before; /* saved state of the last step with updates; NULL before the first one */
} fmi3InstanceData;

_Static_assert(sizeof(fmi3Float64) == sizeof(double) &&
                   sizeof(fmi3ValueReference) == sizeof(unsigned) &&
                   sizeof(fmi3Int32) == sizeof(int),
               "values are copied as they are");
_Static_assert(fmi3Warning == (int)HX_REPLY_WARNING && fmi3Discard == (int)HX_REPLY_DISCARD &&
                   fmi3Error == (int)HX_REPLY_ERROR,
               "replies are returned as they are");

static void set_flag(fmi3Boolean *place, int value) {
  if (place) *place = value != 0;
}

/* ----------------------------------------------------------------------------------------------
 * log */

static void log_sink(hxInstance *base, hxLogCategory category, const char *text) {
  const fmi3InstanceData *instance = (const fmi3InstanceData *)base;
  if (instance->log)
    instance->log(instance->environment, hx_reply_of_category(category),
                  hx_log_category_names[category], text);
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[]) {
  return hx_call_log_select(c, loggingOn, nCategories, categories);
}

/* ----------------------------------------------------------------------------------------------
 * instances */

const char *fmi3GetVersion(void) { return fmi3Version; }

/* allocates an instance that can log; NULL when out of memory */
static fmi3InstanceData *new_instance(hxInterface interface, fmi3String name, fmi3Boolean loggingOn,
                                      fmi3InstanceEnvironment environment,
                                      fmi3LogMessageCallback log) {
  fmi3InstanceData *instance =
      hx_instance_new(sizeof *instance, 3, interface, name, loggingOn, log_sink);
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

/* All variables may be read in an intermediate update, whatever is required. */
fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate) {
  fmi3InstanceData *instance =
      new_instance(HX_CO_SIMULATION, instanceName, loggingOn, instanceEnvironment, logMessage);
  (void)visible, (void)requiredIntermediateVariables, (void)nRequiredIntermediateVariables;
  if (instance) {
    instance->base.uses_event_mode = eventModeUsed && hx_continuous;
    instance->base.may_return_early = earlyReturnAllowed;
    instance->intermediate = hx_continuous ? intermediateUpdate : NULL;
  }
  if (!open_instance(instance, instantiationToken, resourcePath)) return NULL;
  /* steps save here and allocate nothing */
  if (!instance->intermediate || hx_instance_save(&instance->base, &instance->before) == HX_OK)
    return instance;
  fmi3FreeInstance(instance);
  return NULL;
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

void fmi3FreeInstance(fmi3Instance c) {
  if (c) free(((fmi3InstanceData *)c)->before);
  hx_instance_free(c);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean toleranceDefined,
                                       fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
  const int reply =
      hx_call_set_experiment(c, toleranceDefined, tolerance, startTime, stopTimeDefined, stopTime);
  if (reply != fmi3Error) ((hxInstance *)c)->state.mode = HX_MODE_INITIALIZATION;
  return reply;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return hx_call_exit_initialization(c); }

fmi3Status fmi3EnterEventMode(fmi3Instance c) { return hx_call_enter_event_mode(c); }

fmi3Status fmi3Terminate(fmi3Instance c) { return hx_call_terminate(c); }

fmi3Status fmi3Reset(fmi3Instance c) { return hx_call_reset(c); }

/* ----------------------------------------------------------------------------------------------
 * values */

static fmi3Status get_values(fmi3Instance c, hxCall call, hxType type,
                             const fmi3ValueReference vr[], size_t nvr, void *value, size_t n) {
  if (!hx_call_is_legal_with(c, call, nvr, vr, value)) return fmi3Error;
  return hx_reply(hx_arrays_get(c, type, vr, nvr, value, n));
}

static fmi3Status set_values(fmi3Instance c, hxCall call, hxType type,
                             const fmi3ValueReference vr[], size_t nvr, const void *value,
                             size_t n) {
  if (!hx_call_is_legal_with(c, call, nvr, vr, value)) return fmi3Error;
  return hx_reply(hx_arrays_set(c, type, vr, nvr, value, n));
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                          fmi3Float64 value[], size_t n) {
  return get_values(c, HX_GET_REALS, HX_REAL, vr, nvr, value, n);
}

/* enumerations are Int64 */
fmi3Status fmi3GetInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                        fmi3Int64 value[], size_t n) {
  return get_values(c, HX_GET_INTEGERS, HX_INTEGER, vr, nvr, value, n);
}

fmi3Status fmi3GetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                          fmi3Boolean value[], size_t n) {
  return get_values(c, HX_GET_BOOLEANS, HX_BOOLEAN, vr, nvr, value, n);
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                          const fmi3Float64 value[], size_t n) {
  return set_values(c, HX_SET_REALS, HX_REAL, vr, nvr, value, n);
}

fmi3Status fmi3SetInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                        const fmi3Int64 value[], size_t n) {
  return set_values(c, HX_SET_INTEGERS, HX_INTEGER, vr, nvr, value, n);
}

fmi3Status fmi3SetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                          const fmi3Boolean value[], size_t n) {
  return set_values(c, HX_SET_BOOLEANS, HX_BOOLEAN, vr, nvr, value, n);
}

/* types that no variable has */
#define NO_VARIABLES_OF(Type)                                                                      \
  fmi3Status fmi3Get##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,              \
                           fmi3##Type value[], size_t n) {                                         \
    (void)vr, (void)value, (void)n;                                                                \
    return hx_call_no_variables(c, __func__, nvr);                                                 \
  }                                                                                                \
  fmi3Status fmi3Set##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,              \
                           const fmi3##Type value[], size_t n) {                                   \
    (void)vr, (void)value, (void)n;                                                                \
    return hx_call_no_variables(c, __func__, nvr);                                                 \
  }

NO_VARIABLES_OF(Float32)
NO_VARIABLES_OF(Int8)
NO_VARIABLES_OF(UInt8)
NO_VARIABLES_OF(Int16)
NO_VARIABLES_OF(UInt16)
NO_VARIABLES_OF(Int32)
NO_VARIABLES_OF(UInt32)
NO_VARIABLES_OF(UInt64)
NO_VARIABLES_OF(String)

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, size_t size[],
                         fmi3Binary value[], size_t n) {
  (void)vr, (void)size, (void)value, (void)n;
  return hx_call_no_variables(c, __func__, nvr);
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                         const size_t size[], const fmi3Binary value[], size_t n) {
  (void)vr, (void)size, (void)value, (void)n;
  return hx_call_no_variables(c, __func__, nvr);
}

/* ----------------------------------------------------------------------------------------------
 * dependencies */

/* Dependencies of single elements are not offered: see providesPerElementDependencies. */
fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t *n) {
  (void)vr, (void)n;
  return hx_call_not_offered(c, __func__);
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent,
                                       size_t elementIndicesOfDependent[],
                                       fmi3ValueReference independents[],
                                       size_t elementIndicesOfIndependents[],
                                       fmi3DependencyKind dependencyKinds[], size_t nDependencies) {
  (void)dependent, (void)elementIndicesOfDependent, (void)independents,
      (void)elementIndicesOfIndependents, (void)dependencyKinds;
  (void)nDependencies;
  return hx_call_not_offered(c, __func__);
}

/* ----------------------------------------------------------------------------------------------
 * saved states */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) { return hx_call_save(c, state); }

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) { return hx_call_restore(c, state); }

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
  return hx_call_free_state(c, state);
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
  return hx_call_state_size(c, state, size);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[],
                                 size_t size) {
  return hx_call_serialize(c, state, bytes, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size,
                                   fmi3FMUState *state) {
  return hx_call_deserialize(c, bytes, size, state);
}

/* ----------------------------------------------------------------------------------------------
 * derivatives */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[],
                                        size_t nUnknowns, const fmi3ValueReference knowns[],
                                        size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                        fmi3Float64 sensitivity[], size_t nSensitivity) {
  if (!hx_call_is_legal_with(c, HX_DIRECTIONAL, nUnknowns, unknowns, sensitivity)) return fmi3Error;
  if (!hx_call_has_arrays(c, HX_DIRECTIONAL, nKnowns, knowns, seed)) return fmi3Error;
  return hx_reply(hx_arrays_directional(c, unknowns, nUnknowns, knowns, nKnowns, seed, nSeed,
                                        sensitivity, nSensitivity));
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[],
                                    size_t nUnknowns, const fmi3ValueReference knowns[],
                                    size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                    fmi3Float64 sensitivity[], size_t nSensitivity) {
  if (!hx_call_is_legal_with(c, HX_ADJOINT, nUnknowns, unknowns, seed)) return fmi3Error;
  if (!hx_call_has_arrays(c, HX_ADJOINT, nKnowns, knowns, sensitivity)) return fmi3Error;
  return hx_reply(hx_arrays_adjoint(c, unknowns, nUnknowns, knowns, nKnowns, seed, nSeed,
                                    sensitivity, nSensitivity));
}

/* ----------------------------------------------------------------------------------------------
 * configuration, clocks */

/* There are no structural parameters. */
fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) { return hx_call_not_offered(c, __func__); }

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) { return hx_call_not_offered(c, __func__); }

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                                  fmi3Float64 interval[], fmi3IntervalQualifier qualifier[]) {
  (void)vr, (void)interval, (void)qualifier;
  return hx_call_no_variables(c, __func__, nvr);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                                   fmi3UInt64 counter[], fmi3UInt64 resolution[],
                                   fmi3IntervalQualifier qualifier[]) {
  (void)vr, (void)counter, (void)resolution, (void)qualifier;
  return hx_call_no_variables(c, __func__, nvr);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clockReference,
                                      fmi3Float64 activationTime) {
  (void)clockReference, (void)activationTime;
  return hx_call_not_offered(c, __func__);
}

#define NO_CLOCKS(Name, Type)                                                                      \
  fmi3Status fmi3##Name(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, Type value[]) { \
    (void)vr, (void)value;                                                                         \
    return hx_call_no_variables(c, __func__, nvr);                                                 \
  }
#define NO_CLOCK_FRACTIONS(Name, Type)                                                             \
  fmi3Status fmi3##Name(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, Type counter[], \
                        Type resolution[]) {                                                       \
    (void)vr, (void)counter, (void)resolution;                                                     \
    return hx_call_no_variables(c, __func__, nvr);                                                 \
  }

NO_CLOCKS(GetClock, fmi3Clock)
NO_CLOCKS(SetClock, const fmi3Clock)
NO_CLOCKS(GetShiftDecimal, fmi3Float64)
NO_CLOCKS(SetIntervalDecimal, const fmi3Float64)
NO_CLOCKS(SetShiftDecimal, const fmi3Float64)
NO_CLOCK_FRACTIONS(GetShiftFraction, fmi3UInt64)
NO_CLOCK_FRACTIONS(SetIntervalFraction, const fmi3UInt64)
NO_CLOCK_FRACTIONS(SetShiftFraction, const fmi3UInt64)

/* ----------------------------------------------------------------------------------------------
 * events */

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) { return hx_call_not_offered(c, __func__); }

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation,
                                    fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged,
                                    fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime) {
  int changed;
  const int reply = hx_call_update(c, &changed);
  if (reply != fmi3OK) return reply;
  set_flag(discreteStatesNeedUpdate, 0);
  set_flag(terminateSimulation, 0);
  set_flag(nominalsOfContinuousStatesChanged, 0);
  set_flag(valuesOfContinuousStatesChanged, changed);
  set_flag(nextEventTimeDefined, 0);
  if (nextEventTime) *nextEventTime = 0.0;
  return fmi3OK;
}

/* ----------------------------------------------------------------------------------------------
 * model exchange */

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) {
  return hx_call_enter_mode(c, HX_ENTER_CONTINUOUS_TIME_MODE, HX_MODE_CONTINUOUS);
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode,
                                       fmi3Boolean *terminateSimulation) {
  (void)noSetFMUStatePriorToCurrentPoint;
  const int reply = hx_call_completed_step(c);
  if (reply != fmi3OK) return reply;
  set_flag(enterEventMode, 0);
  set_flag(terminateSimulation, 0);
  return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) { return hx_call_set_time(c, time); }

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) {
  return hx_call_set_states(c, x, n);
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 dx[], size_t n) {
  return hx_call_get_row(c, HX_GET_RATES, hx_instance_get_rates, dx, n);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 z[], size_t n) {
  return hx_call_get_row(c, HX_GET_INDICATORS, hx_instance_get_indicators, z, n);
}

fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) {
  return hx_call_get_row(c, HX_GET_STATES, hx_instance_get_states, x, n);
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 nominal[], size_t n) {
  return hx_call_get_row(c, HX_GET_NOMINALS, hx_instance_get_nominals, nominal, n);
}

static fmi3Status get_number(fmi3Instance c, size_t *place, size_t number) {
  if (!hx_call_is_legal_with(c, HX_GET_NUMBER, 1, place, place)) return fmi3Error;
  *place = number;
  return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) {
  return get_number(c, n, hx_continuous ? hx_continuous->indicators : 0);
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) {
  return get_number(c, n, hx_state_count);
}

/* ----------------------------------------------------------------------------------------------
 * co-simulation */

fmi3Status fmi3EnterStepMode(fmi3Instance c) {
  return hx_call_enter_mode(c, HX_ENTER_STEP_MODE, HX_MODE_STEP);
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                                    const fmi3Int32 order[], fmi3Float64 value[], size_t n) {
  if (!hx_call_is_first_order(c, HX_GET_OUTPUT_RATES, nvr, vr, order, value)) return fmi3Error;
  return hx_reply(hx_arrays_get_output_rates(c, vr, nvr, value, n));
}

/* Lets the importer read outputs and set inputs where a step of the solver has ended. Sets *end to
 * where the importer asks to return early. */
static void update_intermediate(fmi3InstanceData *instance, double *end) {
  hxInstance *base = &instance->base;
  const double now = hx_instance_time(base);
  fmi3Boolean requested = 0;
  fmi3Float64 early = now;
  base->state.mode = HX_MODE_INTERMEDIATE;
  instance->intermediate(instance->environment, now, 1, 1, 1, base->may_return_early != 0,
                         &requested, &early);
  base->state.mode = HX_MODE_STEP;
  if (requested && base->may_return_early && early < *end) *end = early > now ? early : now;
}

/* Steps from t to *end, with an intermediate update after each step of the solver before it. */
static hxStatus step_in_parts(fmi3InstanceData *instance, double t, double *end, int *event) {
  hxInstance *base = &instance->base;
  hxStatus status = hx_instance_save(base, &instance->before);
  for (double now = t; status == HX_OK && now < *end; now = hx_instance_time(base)) {
    int found = 0;
    status = hx_instance_step_to_event(base, now, *end - now, 2, &found);
    *event |= found;
    if (found && base->may_return_early) break;
    if (status == HX_OK && hx_instance_time(base) < *end) update_intermediate(instance, end);
  }
  if (status != HX_OK) hx_instance_restore(base, instance->before);
  return status;
}

/* Returns early where discrete variables change, if the importer allows it; requests event mode, if
 * the importer uses it. */
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
  hxInstance *instance = c;
  const double t = currentCommunicationPoint, h = communicationStepSize;
  double end = t + h;
  int event = 0;
  (void)noSetFMUStatePriorToCurrentPoint;
  if (!hx_call_is_legal(c, HX_DO_STEP)) return fmi3Error;
  const hxStatus status =
      ((fmi3InstanceData *)c)->intermediate
          ? step_in_parts(c, t, &end, &event)
          : hx_instance_step_to_event(instance, t, h, instance->may_return_early, &event);
  const double reached = hx_instance_time(instance);
  set_flag(eventHandlingNeeded, event && instance->uses_event_mode);
  set_flag(terminateSimulation, 0);
  set_flag(earlyReturn, (event || end < t + h) && reached < t + h);
  if (lastSuccessfulTime) *lastSuccessfulTime = reached;
  return hx_reply(status);
}
