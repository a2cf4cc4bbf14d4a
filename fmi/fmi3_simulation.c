/* fmi3_simulation.c - FMI 3.0: events, model exchange and co-simulation. */
#include "fmi/fmi3_calls.h"

/* ----------------------------------------------------------------------------------------------
 * events */

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) {
  return hx_fmi3_not_supported(c, "fmi3EvaluateDiscreteStates");
}

/* Model exchange: handles touch-downs and lift-offs; one iteration is enough. Co-simulation: the
 * last step has already handled them. There are no time events. */
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation,
                                    fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged,
                                    fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime) {
  hxInstance *instance = hx_fmi3_enter(c, UPDATE_DISCRETE_STATES);
  int changed = 0;
  if (!instance) return fmi3Error;
  const int exchange = instance->state.interface == HX_MODEL_EXCHANGE;
  const hxStatus status = exchange ? hx_instance_update(instance, &changed) : HX_OK;
  hx_fmi3_set_flag(discreteStatesNeedUpdate, 0);
  hx_fmi3_set_flag(terminateSimulation, 0);
  hx_fmi3_set_flag(nominalsOfContinuousStatesChanged, 0);
  hx_fmi3_set_flag(valuesOfContinuousStatesChanged, changed);
  hx_fmi3_set_flag(nextEventTimeDefined, 0);
  if (nextEventTime) *nextEventTime = 0.0;
  return hx_fmi3_status(status);
}

/* ----------------------------------------------------------------------------------------------
 * model exchange */

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) {
  return hx_fmi3_status(
      hx_call_enter_mode(c, &hx_fmi3_calls[ENTER_CONTINUOUS_TIME_MODE], HX_MODE_CONTINUOUS));
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode,
                                       fmi3Boolean *terminateSimulation) {
  (void)noSetFMUStatePriorToCurrentPoint;
  hxInstance *instance = hx_fmi3_enter(c, COMPLETED_INTEGRATOR_STEP);
  if (!instance) return fmi3Error;
  hx_fmi3_set_flag(enterEventMode, 0);
  hx_fmi3_set_flag(terminateSimulation, 0);
  return hx_fmi3_status(hx_instance_completed_step(instance));
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) {
  return hx_fmi3_status(hx_call_set_time(c, &hx_fmi3_calls[SET_TIME], time));
}

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) {
  return hx_fmi3_status(hx_call_set_states(c, &hx_fmi3_calls[SET_CONTINUOUS_STATES], x, n));
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 dx[], size_t n) {
  return hx_fmi3_status(
      hx_call_get_row(c, &hx_fmi3_calls[GET_RATES], hx_instance_get_rates, dx, n));
}

fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 z[], size_t n) {
  return hx_fmi3_status(
      hx_call_get_row(c, &hx_fmi3_calls[GET_EVENT_INDICATORS], hx_instance_get_indicators, z, n));
}

fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) {
  return hx_fmi3_status(
      hx_call_get_row(c, &hx_fmi3_calls[GET_CONTINUOUS_STATES], hx_instance_get_states, x, n));
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 nominal[], size_t n) {
  return hx_fmi3_status(
      hx_call_get_row(c, &hx_fmi3_calls[GET_NOMINALS], hx_instance_get_nominals, nominal, n));
}

static fmi3Status get_number(fmi3Instance c, size_t *place, size_t number) {
  if (!hx_call_is_legal_with(c, &hx_fmi3_calls[GET_NUMBER], 1, place, place)) return fmi3Error;
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
  return hx_fmi3_status(hx_call_enter_mode(c, &hx_fmi3_calls[ENTER_STEP_MODE], HX_MODE_STEP));
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                                    const fmi3Int32 order[], fmi3Float64 value[], size_t n) {
  if (!hx_call_is_first_order(c, &hx_fmi3_calls[GET_OUTPUT_DERIVATIVES], nvr, vr, order, value))
    return fmi3Error;
  return hx_fmi3_status(hx_arrays_get_output_rates(c, vr, nvr, value, n));
}

/* Returns early where discrete variables change, if the importer allows it; requests event mode, if
 * the importer uses it. */
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
  hxInstance *instance = hx_fmi3_enter(c, DO_STEP);
  const double t = currentCommunicationPoint, h = communicationStepSize;
  int event = 0;
  (void)noSetFMUStatePriorToCurrentPoint;
  if (!instance) return fmi3Error;
  const hxStatus status =
      hx_instance_step_to_event(instance, t, h, instance->may_return_early, &event);
  const double reached = hx_instance_time(instance);
  hx_fmi3_set_flag(eventHandlingNeeded, event && instance->uses_event_mode);
  hx_fmi3_set_flag(terminateSimulation, 0);
  hx_fmi3_set_flag(earlyReturn, event && reached < t + h);
  if (lastSuccessfulTime) *lastSuccessfulTime = reached;
  return hx_fmi3_status(status);
}
