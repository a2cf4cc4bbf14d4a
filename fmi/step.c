/* step.c - steps of co-simulation, and the rates of inputs over the next step. */
#include "fmi/instance.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "hexapod/message.h"

/* ----------------------------------------------------------------------------------------------
 * rates of inputs */

/* The number of a Real input. */
static double *number_of(hxInput *input, const hxVariable *variable) {
  const size_t offset = variable->offset - offsetof(struct hxVariables, input);
  return (double *)(void *)((char *)input + offset);
}

hxStatus hx_instance_set_input_rates(hxInstance *instance, const unsigned reference[], size_t n,
                                     const double rate[]) {
  hxInput ramp;
  hxCausality causality;
  if (instance->state.ramped)
    ramp = instance->state.input_rate;
  else
    memset(&ramp, 0, sizeof ramp);
  for (size_t i = 0; i < n; i++) {
    const hxVariable *variable = hx_variable_of_type(instance, HX_REAL, reference[i], &causality);
    if (!variable) return HX_INVALID_ARGUMENT;
    if (causality != HX_INPUT || !isfinite(rate[i])) {
      hx_log(instance, HX_LOG_ERROR,
             "derivative of %s: got %g, expected a finite number for an input; nothing was set",
             variable->name, rate[i]);
      return HX_INVALID_ARGUMENT;
    }
    *number_of(&ramp, variable) = rate[i];
  }
  instance->state.input_rate = ramp;
  instance->state.ramped = 1;
  return HX_OK;
}

/* Calculates the input at the end of the next step of size h. Refuses rates that take an input out
 * of its range. */
static hxStatus ramp_end(hxInstance *instance, double h, hxInput *end) {
  const hxSection *inputs = &hx_sections[HX_INPUT];
  *end = instance->state.variables.input;
  if (!instance->state.ramped) return HX_OK;
  for (unsigned i = 0; i < inputs->count; i++) {
    const hxVariable *variable = &inputs->variable[i];
    if (variable->type != HX_REAL) continue;
    const double rate = *number_of(&instance->state.input_rate, variable);
    double *value = number_of(end, variable);
    if (rate == 0.0) continue;
    *value += h * rate;
    if (!hx_variable_in_range(variable, *value)) {
      hx_log(instance, HX_LOG_ERROR,
             "%s: got a derivative that takes it to %g, expected one that leaves it in [%g, "
             "%g]%s%s; the state is unchanged",
             variable->name, *value, variable->min, variable->max, hx_unit_gap(variable->unit),
             variable->unit);
      return HX_INVALID_ARGUMENT;
    }
  }
  return HX_OK;
}

/* ----------------------------------------------------------------------------------------------
 * steps */

static const double longest_step = 100.0; /* s */

/* Relative differences that are allowed between the importer's clock and the component's, and
 * between the importer's clock and the stop time. The importer may sum up its steps: the rounding
 * errors of some thousand steps accumulate before the component's clock follows, those of all steps
 * (some ten million) before the stop time. */
static const double few_steps = 1e4 * DBL_EPSILON, all_steps = 1e-9; /* 1 */

/* The allowed difference [s]: at most half a step, but at least the last bits of the time. */
static double clock_tolerance(double t, double h, double sums) {
  const double last_bits = 4.0 * DBL_EPSILON * fmax(1.0, fabs(t));
  return fmax(last_bits, fmin(1e-9 + sums * fabs(t), 0.5 * h));
}

/* checks start, size and end of a step */
static hxStatus check_step(hxInstance *instance, double t, double h) {
  const double now = hx_instance_time(instance);
  if (!(h > 0.0 && h <= longest_step)) {
    hx_log(instance, HX_LOG_ERROR,
           "communication step size: got %.17g s, expected more than 0 and at most %g; the state "
           "is unchanged, make it several steps",
           h, longest_step);
    return HX_INVALID_ARGUMENT;
  }
  if (!(fabs(t - now) <= clock_tolerance(now, h, few_steps))) {
    hx_log(instance, HX_LOG_ERROR,
           "communication point: got %.17g s, expected %.17g, where the last step ended; the state "
           "is unchanged, "
           "restore a saved state to go back",
           t, now);
    return HX_INVALID_ARGUMENT;
  }
  if (t + h > instance->state.stop_time + clock_tolerance(now, h, all_steps)) {
    hx_log(instance, HX_LOG_ERROR,
           "communication step size: got %.17g s at %.17g s, expected a step that ends by the "
           "experiment's stop time, %.17g s; the state is "
           "unchanged, shorten the step or set up a longer experiment",
           h, t, instance->state.stop_time);
    return HX_INVALID_ARGUMENT;
  }
  return HX_OK;
}

/* logs a failed step of the component; stores the input at the end of a successful one */
static hxStatus finish_step(hxInstance *instance, double t, double h, const hxInput *end,
                            hxStatus status) {
  if (status == HX_INVALID_ARGUMENT) {
    hx_log(instance, HX_LOG_ERROR, "step from %.17g s by %.17g s: %s; the state is unchanged", t, h,
           hx_component_message(instance->component));
    return status;
  }
  if (status != HX_OK) {
    hx_log(instance, HX_LOG_DISCARD,
           "step from %.17g s by %.17g s: %s; the state is unchanged, try a smaller step or a "
           "gentler input",
           t, h, hx_component_message(instance->component));
    return status;
  }
  instance->state.variables.input = *end;
  if (!instance->state.ramped)
    memset(&instance->state.input_rate, 0, sizeof instance->state.input_rate);
  instance->state.ramped = 0;
  hx_mark_stale(instance);
  return HX_OK;
}

/* The component steps from its own time to t + h, so that it adopts the importer's clock and
 * rounding errors do not accumulate. A step of rounding size that ends at or before the component's
 * time succeeds without doing anything. */
hxStatus hx_instance_step(hxInstance *instance, double t, double h) {
  const hxInput *rate = instance->state.ramped ? &instance->state.input_rate : NULL;
  hxInput end;
  hxStatus status = check_step(instance, t, h);
  if (status == HX_OK) status = hx_instance_tune(instance);
  if (status != HX_OK || t + h <= hx_instance_time(instance)) return status;
  status = ramp_end(instance, h, &end);
  if (status != HX_OK) return status;
  return finish_step(
      instance, t, h, &end,
      hx_component_step(instance->component, &instance->state.variables, rate, t + h));
}

hxStatus hx_instance_step_to_event(hxInstance *instance, double t, double h, int stop, int *event) {
  const struct hxVariables *variables = &instance->state.variables;
  *event = 0;
  if (!hx_continuous || instance->state.ramped) return hx_instance_step(instance, t, h);
  hxStatus status = check_step(instance, t, h);
  if (status == HX_OK) status = hx_instance_tune(instance);
  if (status != HX_OK || t + h <= hx_instance_time(instance)) return status;
  return finish_step(instance, t, h, &variables->input,
                     hx_continuous->step(instance->component, variables, t + h, stop, event));
}
