/* exchange.c - model exchange and derivatives: continuous states, events, directional derivatives;
 * and an extension: instances use a work space of the importer's, see hexapod/shared_work.h.
 * Instances of model exchange exist only where hx_continuous does. */
#include "fmi/instance.h"

#include <math.h>
#include <string.h>

#include "hexapod/shared_work.h"

static double *state_of(struct hxVariables *variables) {
  return (double *)(void *)((char *)variables + hx_continuous->state);
}
static double *rate_of(struct hxVariables *variables) {
  return (double *)(void *)((char *)variables + hx_continuous->rate);
}

/* checks the length of an array */
static hxStatus check_count(hxInstance *instance, const char *what, size_t got, size_t expected) {
  if (got == expected) return HX_OK;
  hx_log(instance, HX_LOG_ERROR, "%s: got %zu places, expected %zu; nothing was done", what, got,
         expected);
  return HX_INVALID_ARGUMENT;
}

/* ----------------------------------------------------------------------------------------------
 * states */

/* sets the component to the states in the variables, at time t [s] */
static hxStatus set_component(hxInstance *instance, double t) {
  const hxStatus status = hx_continuous->set(instance->component, &instance->state.variables, t);
  if (status == HX_OK)
    hx_mark_stale(instance);
  else
    hx_log(instance, HX_LOG_DISCARD, "continuous states: %s; nothing was set, try a smaller step",
           hx_component_message(instance->component));
  return status;
}

hxStatus hx_instance_set_time(hxInstance *instance, double t) {
  if (isfinite(t)) return set_component(instance, t);
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
  status = set_component(instance, hx_instance_time(instance));
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
  if (instance->state.model_stale && hx_instance_initialize(instance) != HX_OK)
    return HX_INVALID_ARGUMENT;
  hx_continuous->completed(instance->component, &instance->state.variables);
  hx_mark_stale(instance);
  return HX_OK;
}

/* ----------------------------------------------------------------------------------------------
 * events */

hxStatus hx_instance_get_indicators(hxInstance *instance, double indicator[], size_t n) {
  const hxStatus status = check_count(instance, "event indicators", n, hx_continuous->indicators);
  if (status != HX_OK || n == 0) return status;
  if (instance->state.model_stale && hx_instance_initialize(instance) != HX_OK)
    return HX_INVALID_ARGUMENT;
  hx_continuous->indicate(instance->component, indicator);
  return HX_OK;
}

hxStatus hx_instance_update(hxInstance *instance, int *states_changed) {
  const int tuned = instance->state.tuned;
  const hxStatus status = hx_instance_tune(instance);
  if (status != HX_OK) return status;
  *states_changed = hx_continuous->update(instance->component, &instance->state.variables) || tuned;
  hx_mark_stale(instance);
  return HX_OK;
}

/* ----------------------------------------------------------------------------------------------
 * derivatives */

/* index of the continuous state that a reference belongs to; hx_state_count if there is none */
static size_t state_index(unsigned reference) {
  size_t i = 0;
  while (i < hx_state_count && hx_states[i].reference != reference) i++;
  return i;
}

/* the address of the change of an input, a continuous state or a tunable parameter; for others logs
 * and returns NULL */
static double *known_place(hxInstance *instance, unsigned reference, struct hxVariables *change) {
  hxCausality causality;
  const hxVariable *variable = hx_variable_of_type(instance, HX_REAL, reference, &causality);
  const size_t state = state_index(reference);
  if (!variable) return NULL;
  if (causality == HX_INPUT || (causality == HX_PARAMETER && variable->tunable))
    return hx_variable_place(change, variable);
  if (state < hx_state_count) return state_of(change) + state;
  hx_log(instance, HX_LOG_ERROR,
         "directional derivative: got the known %s, expected an input, a continuous state or a "
         "tunable parameter; nothing was done",
         variable->name);
  return NULL;
}

/* the address of an output's or a rate's derivative; for others logs and returns NULL */
static const double *unknown_place(hxInstance *instance, unsigned reference,
                                   struct hxVariables *result) {
  hxCausality causality;
  const hxVariable *variable = hx_variable_of_type(instance, HX_REAL, reference, &causality);
  if (!variable) return NULL;
  if (causality == HX_OUTPUT || causality == HX_LOCAL) return hx_variable_place(result, variable);
  hx_log(instance, HX_LOG_ERROR,
         "directional derivative: got the unknown %s, expected an output or a derivative; nothing "
         "was done",
         variable->name);
  return NULL;
}

/* checks that the unknowns are outputs or rates */
static hxStatus check_unknowns(hxInstance *instance, const unsigned unknown[], size_t n) {
  struct hxVariables result;
  for (size_t i = 0; i < n; i++)
    if (!unknown_place(instance, unknown[i], &result)) return HX_INVALID_ARGUMENT;
  return HX_OK;
}

/* Calculates derivatives of valid unknowns along a change of input and state. With in_time the
 * change is a rate over time, so that outputs that are integrals over time change too. */
static hxStatus differentiate(hxInstance *instance, const struct hxVariables *change, int in_time,
                              const unsigned unknown[], size_t n, double value[]) {
  struct hxVariables result;
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

/* checks that the component has continuous states */
static hxStatus need_states(hxInstance *instance, const char *what) {
  if (hx_continuous) return HX_OK;
  hx_log(instance, HX_LOG_ERROR,
         "%s: got a call, expected none, as the model description does not offer it", what);
  return HX_INVALID_ARGUMENT;
}

/* Checks that parameters which were set and are not in force yet allow derivatives. */
static hxStatus check_parameters(hxInstance *instance) {
  const hxStatus status =
      instance->state.model_stale
          ? hx_continuous->check(instance->component, &instance->state.variables)
          : HX_OK;
  if (status != HX_OK)
    hx_log(instance, HX_LOG_ERROR, "%s; nothing was done",
           hx_component_message(instance->component));
  return status;
}

/* Sums the changes of the knowns; refuses unknown ones and sums that are not finite. */
static hxStatus sum_changes(hxInstance *instance, const unsigned known[], size_t n,
                            const double change[], struct hxVariables *direction) {
  memset(direction, 0, sizeof *direction);
  for (size_t i = 0; i < n; i++) {
    double *place = known_place(instance, known[i], direction);
    if (!place) return HX_INVALID_ARGUMENT;
    *place += change[i];
    if (isfinite(*place)) continue;
    hx_log(instance, HX_LOG_ERROR,
           "derivatives: got a direction that is not finite, expected finite numbers; nothing was "
           "done");
    return HX_INVALID_ARGUMENT;
  }
  return HX_OK;
}

/* All arguments are checked before parameters that were set initialize the component. */
hxStatus hx_instance_directional(hxInstance *instance, const unsigned unknown[], size_t n_unknown,
                                 const unsigned known[], size_t n_known, const double change[],
                                 double result[]) {
  struct hxVariables direction;
  hxStatus status = need_states(instance, "directional derivative");
  if (status == HX_OK) status = check_unknowns(instance, unknown, n_unknown);
  if (status == HX_OK) status = sum_changes(instance, known, n_known, change, &direction);
  if (status == HX_OK) status = check_parameters(instance);
  if (status == HX_OK) status = hx_instance_refresh(instance, 0, 0);
  return status == HX_OK ? differentiate(instance, &direction, 0, unknown, n_unknown, result)
                         : status;
}

/* Column by column: a column costs as much as a directional derivative, and its numbers are those
 * of it. value: memory for n_unknown numbers. */
hxStatus hx_instance_adjoint(hxInstance *instance, const unsigned unknown[], size_t n_unknown,
                             const unsigned known[], size_t n_known, const double seed[],
                             double value[], double result[]) {
  const double one = 1.0;
  hxStatus status = HX_OK;
  for (size_t i = 0; i < n_known && status == HX_OK; i++) {
    status = hx_instance_directional(instance, unknown, n_unknown, &known[i], 1, &one, value);
    result[i] = 0.0;
    for (size_t k = 0; k < n_unknown && status == HX_OK; k++) result[i] += seed[k] * value[k];
  }
  return status == HX_OK ? hx_instance_check_finite(instance, result, n_known, "adjoint derivative")
                         : status;
}

/* Time derivatives: the states change at their rates, the inputs at those of the last step. */
hxStatus hx_instance_get_output_rates(hxInstance *instance, const unsigned reference[], size_t n,
                                      double rate[]) {
  struct hxVariables flow;
  hxStatus status = need_states(instance, "derivatives of outputs");
  if (status == HX_OK) status = check_unknowns(instance, reference, n);
  if (status == HX_OK) status = check_parameters(instance);
  if (status == HX_OK) status = hx_instance_refresh(instance, 0, 1);
  if (status != HX_OK) return status;
  memset(&flow, 0, sizeof flow);
  memcpy(state_of(&flow), rate_of(&instance->state.variables), hx_state_count * sizeof(double));
  flow.input = instance->state.input_rate;
  return differentiate(instance, &flow, 1, reference, n, rate);
}

/* ----------------------------------------------------------------------------------------------
 * work space */

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

EXPORT size_t hx_shared_work_size(void);
EXPORT int hx_shared_work_use(void *instance, void *memory, size_t size);

size_t hx_shared_work_size(void) { return hx_continuous ? hx_continuous->work_size() : 0; }

int hx_shared_work_use(void *c, void *memory, size_t size) {
  hxInstance *instance = c;
  if (!instance || !instance->component) return HX_INVALID_ARGUMENT;
  if (!hx_continuous) {
    hx_log(instance, HX_LOG_ERROR,
           "hx_shared_work_use: got a call, expected none, as hx_shared_work_size() is 0; nothing "
           "was changed, leave it out");
    return HX_INVALID_ARGUMENT;
  }
  const hxStatus status = hx_continuous->use_work(instance->component, memory, size);
  if (status != HX_OK)
    hx_log(instance, HX_LOG_ERROR, "%s", hx_component_message(instance->component));
  return status;
}
