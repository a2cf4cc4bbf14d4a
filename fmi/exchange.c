/* exchange.c - an instance for solvers of others: continuous states, events, derivatives. */
#include "fmi/instance.h"

#include <math.h>
#include <string.h>

static double *state_of(struct hxVariables *variables) {
  return (double *)(void *)((char *)variables + hx_continuous->state);
}
static double *rate_of(struct hxVariables *variables) {
  return (double *)(void *)((char *)variables + hx_continuous->rate);
}

/* whether an array has as many places as there are; complains if not */
static hxStatus check_count(hxInstance *instance, const char *what, size_t got, size_t expected) {
  if (got == expected) return HX_OK;
  hx_log(instance, HX_LOG_ERROR, "%s: got %zu places, expected %zu; nothing was done", what, got,
         expected);
  return HX_INVALID_ARGUMENT;
}

static size_t indicator_count(void) { return hx_continuous ? hx_continuous->indicators : 0; }

hxStatus hx_instance_check_finite(hxInstance *instance, const double number[], size_t n,
                                  const char *what) {
  for (size_t i = 0; i < n; i++)
    if (!isfinite(number[i])) {
      hx_log(instance, HX_LOG_DISCARD,
             "%s: got a state at which they are not finite, expected one of the robot; try a "
             "smaller step",
             what);
      return HX_NOT_FINITE;
    }
  return HX_OK;
}

/* ----------------------------------------------------------------------------------------------
 * states */

/* the component at the state of the variables, at a time */
static hxStatus put(hxInstance *instance, double t) {
  const hxStatus status = hx_continuous->set(instance->component, &instance->state.variables, t);
  if (status != HX_OK)
    hx_log(instance, HX_LOG_DISCARD, "continuous states: %s; nothing was set, try a smaller step",
           hx_component_message(instance->component));
  hx_stale(instance);
  return status;
}

hxStatus hx_instance_set_time(hxInstance *instance, double t) {
  if (isfinite(t)) return put(instance, t);
  hx_log(instance, HX_LOG_ERROR,
         "time: got a number that is not finite, expected seconds; nothing was set");
  return HX_INVALID_ARGUMENT;
}

hxStatus hx_instance_get_states(hxInstance *instance, double x[], size_t n) {
  const hxStatus status = check_count(instance, "continuous states", n, hx_state_count);
  if (status != HX_OK || n == 0) return status;
  if (instance->state.model_stale && hx_instance_initialize(instance) != HX_OK)
    return HX_INVALID_ARGUMENT;
  memcpy(x, state_of(&instance->state.variables), n * sizeof *x);
  return HX_OK;
}

hxStatus hx_instance_set_states(hxInstance *instance, const double x[], size_t n) {
  const struct hxVariables before = instance->state.variables;
  hxStatus status = check_count(instance, "continuous states", n, hx_state_count);
  if (status != HX_OK || n == 0) return status;
  memcpy(state_of(&instance->state.variables), x, n * sizeof *x);
  status = put(instance, hx_instance_time(instance));
  if (status != HX_OK) instance->state.variables = before;
  return status;
}

hxStatus hx_instance_get_rates(hxInstance *instance, double rate[], size_t n) {
  hxStatus status = check_count(instance, "derivatives", n, hx_state_count);
  if (status != HX_OK || n == 0) return status;
  status = hx_instance_refresh(instance, 0, 1);
  if (status == HX_OK)
    status =
        hx_instance_check_finite(instance, rate_of(&instance->state.variables), n, "derivatives");
  if (status == HX_OK) memcpy(rate, rate_of(&instance->state.variables), n * sizeof *rate);
  return status;
}

hxStatus hx_instance_get_nominals(hxInstance *instance, double nominal[], size_t n) {
  const hxStatus status = check_count(instance, "nominal values", n, hx_state_count);
  for (size_t i = 0; i < n && status == HX_OK; i++) nominal[i] = hx_states[i].nominal;
  return status;
}

hxStatus hx_instance_completed_step(hxInstance *instance) {
  if (!hx_continuous) return HX_OK;
  if (instance->state.model_stale && hx_instance_initialize(instance) != HX_OK)
    return HX_INVALID_ARGUMENT;
  hx_continuous->completed(instance->component, &instance->state.variables);
  hx_stale(instance);
  return HX_OK;
}

/* ----------------------------------------------------------------------------------------------
 * events */

hxStatus hx_instance_get_indicators(hxInstance *instance, double indicator[], size_t n) {
  const hxStatus status = check_count(instance, "event indicators", n, indicator_count());
  if (status != HX_OK || n == 0) return status;
  if (instance->state.model_stale && hx_instance_initialize(instance) != HX_OK)
    return HX_INVALID_ARGUMENT;
  hx_continuous->indicate(instance->component, indicator);
  return HX_OK;
}

hxStatus hx_instance_update(hxInstance *instance, int *states_changed) {
  *states_changed =
      hx_continuous ? hx_continuous->update(instance->component, &instance->state.variables) : 0;
  hx_stale(instance);
  return HX_OK;
}

/* ----------------------------------------------------------------------------------------------
 * derivatives */

/* place of a continuous state, by the reference of the variable that shows it; hx_state_count if it
 * is none */
static size_t state_place(unsigned reference) {
  size_t i = 0;
  while (i < hx_state_count && hx_states[i].reference != reference) i++;
  return i;
}

static double *place_in(struct hxVariables *variables, const hxVariable *variable) {
  return (double *)(void *)((char *)variables + variable->offset);
}

/* the place of a known's change: an input or a continuous state; NULL, with a message, for others
 */
static double *known_place(hxInstance *instance, unsigned reference, struct hxVariables *change) {
  hxCausality causality;
  const hxVariable *variable = hx_instance_find(instance, HX_REAL, reference, &causality);
  const size_t state = state_place(reference);
  if (!variable) return NULL;
  if (causality == HX_INPUT) return place_in(change, variable);
  if (state < hx_state_count) return state_of(change) + state;
  hx_log(instance, HX_LOG_ERROR,
         "directional derivative: got the known %s, expected an input or a continuous state; "
         "nothing was done",
         variable->name);
  return NULL;
}

/* the derivative of an unknown, an output or a rate; NULL, with a message, for others */
static const double *unknown_place(hxInstance *instance, unsigned reference,
                                   struct hxVariables *result) {
  hxCausality causality;
  const hxVariable *variable = hx_instance_find(instance, HX_REAL, reference, &causality);
  if (!variable) return NULL;
  if (causality == HX_OUTPUT || causality == HX_LOCAL) return place_in(result, variable);
  hx_log(instance, HX_LOG_ERROR,
         "directional derivative: got the unknown %s, expected an output or a derivative; nothing "
         "was done",
         variable->name);
  return NULL;
}

/* Derivatives of some unknowns along a change of input and state; in_time: the change is that of a
 * second, which integrals of the past see too. */
static hxStatus differentiate(hxInstance *instance, const struct hxVariables *change, int in_time,
                              const unsigned unknown[], size_t n, double value[]) {
  struct hxVariables result;
  for (size_t i = 0; i < n; i++)
    if (!unknown_place(instance, unknown[i], &result)) return HX_INVALID_ARGUMENT;
  const hxStatus status =
      hx_continuous->tangent(instance->component, &instance->state.variables, change, &result);
  if (status != HX_OK)
    hx_log(instance, HX_LOG_ERROR, "%s; nothing was done",
           hx_component_message(instance->component));
  if (status == HX_OK && in_time)
    hx_continuous->integrals(instance->component, &instance->state.variables, &result);
  for (size_t i = 0; i < n && status == HX_OK; i++)
    value[i] = *unknown_place(instance, unknown[i], &result);
  return status;
}

static hxStatus need_states(hxInstance *instance, const char *what) {
  if (!hx_continuous) {
    hx_log(instance, HX_LOG_ERROR,
           "%s: got a call, expected none, as the model description does not offer it", what);
    return HX_INVALID_ARGUMENT;
  }
  return instance->state.model_stale ? hx_instance_initialize(instance) : HX_OK;
}

hxStatus hx_instance_directional(hxInstance *instance, const unsigned unknown[], size_t n_unknown,
                                 const unsigned known[], size_t n_known, const double change[],
                                 double result[]) {
  struct hxVariables direction;
  const hxStatus status = need_states(instance, "directional derivative");
  if (status != HX_OK) return status;
  memset(&direction, 0, sizeof direction);
  for (size_t i = 0; i < n_known; i++) {
    double *place = known_place(instance, known[i], &direction);
    if (!place) return HX_INVALID_ARGUMENT;
    *place += change[i];
  }
  return differentiate(instance, &direction, 0, unknown, n_unknown, result);
}

hxStatus hx_instance_set_input_rates(hxInstance *instance, const unsigned reference[], size_t n,
                                     const double rate[]) {
  struct hxVariables ramp;
  hxCausality causality;
  if (instance->state.ramped)
    ramp.input = instance->state.input_rate;
  else
    memset(&ramp.input, 0, sizeof ramp.input);
  for (size_t i = 0; i < n; i++) {
    const hxVariable *variable = hx_instance_find(instance, HX_REAL, reference[i], &causality);
    if (!variable) return HX_INVALID_ARGUMENT;
    if (causality != HX_INPUT || !isfinite(rate[i])) {
      hx_log(instance, HX_LOG_ERROR,
             "derivative of %s: got %g, expected a finite number for an input; nothing was set",
             variable->name, rate[i]);
      return HX_INVALID_ARGUMENT;
    }
    *place_in(&ramp, variable) = rate[i];
  }
  instance->state.input_rate = ramp.input;
  instance->state.ramped = 1;
  return HX_OK;
}

hxStatus hx_instance_ramp_end(hxInstance *instance, double h, hxInput *end) {
  struct hxVariables *variables = &instance->state.variables, ramp, after;
  const hxSection *inputs = &hx_sections[HX_INPUT];
  ramp.input = instance->state.input_rate;
  after.input = variables->input;
  for (unsigned i = 0; i < inputs->count && instance->state.ramped; i++) {
    const hxVariable *variable = &inputs->variable[i];
    const double rate = variable->type == HX_REAL ? *place_in(&ramp, variable) : 0.0;
    if (rate == 0.0) continue;
    *place_in(&after, variable) += h * rate;
    if (!hx_variable_takes(variable, *place_in(&after, variable))) {
      hx_log(instance, HX_LOG_ERROR,
             "%s: got a derivative that takes it to %g, expected one that leaves it in [%g, %g] "
             "%s; the state is unchanged",
             variable->name, *place_in(&after, variable), variable->min, variable->max,
             variable->unit);
      return HX_INVALID_ARGUMENT;
    }
  }
  *end = after.input;
  return HX_OK;
}

/* along the flow: the state changes by its rates, the input by those given for the last step */
hxStatus hx_instance_get_output_rates(hxInstance *instance, const unsigned reference[], size_t n,
                                      double rate[]) {
  struct hxVariables flow;
  hxStatus status = need_states(instance, "derivatives of outputs");
  if (status == HX_OK) status = hx_instance_refresh(instance, 0, 1);
  if (status != HX_OK) return status;
  memset(&flow, 0, sizeof flow);
  memcpy(state_of(&flow), rate_of(&instance->state.variables), hx_state_count * sizeof(double));
  flow.input = instance->state.input_rate;
  return differentiate(instance, &flow, 1, reference, n, rate);
}
