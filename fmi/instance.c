#include "fmi/instance.h"

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* ----------------------------------------------------------------------------------------------
 * log */

void hx_log(hxInstance *instance, hxLogCategory category, const char *format, ...) {
  char text[HX_LOG_SIZE];
  va_list arguments;
  if (!(instance->logged & 1u << category)) return;
  va_start(arguments, format);
  vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  instance->sink(instance, category, text);
}

/* ----------------------------------------------------------------------------------------------
 * opening */

static void return_to_start(hxInstance *instance) {
  const int interface = instance->state.interface;
  memset(&instance->state, 0, sizeof instance->state);
  instance->state.interface = interface;
  instance->state.mode = HX_MODE_INSTANTIATED;
  instance->state.model_stale = 1;
  instance->state.output_stale = instance->state.rate_stale = 1;
  instance->state.stop_time = INFINITY;
  instance->state.variables = instance->start;
}

/* an FMU without readable resources can only be the compiled-in robot's */
static hxStatus check_default_guid(hxInstance *instance, const char *resources) {
  if (strcmp(instance->guid, hx_default_guid) == 0) return HX_OK;
  hx_log(instance, HX_LOG_ERROR,
         "GUID: got '%s', expected '%s', the binary's own, because no start_values.txt was found "
         "in the resources '%s'; "
         "pass the GUID of modelDescription.xml and the URI of the unpacked resources folder",
         instance->guid, hx_default_guid, resources ? resources : "(NULL)");
  return HX_INVALID_ARGUMENT;
}

hxStatus hx_instance_open(hxInstance *instance, const char *guid, const char *resources) {
  int found = 0;
  if (!instance->name[0] || !guid) {
    hx_log(instance, HX_LOG_ERROR, "instantiation: got no %s, expected a text; pass one",
           guid ? "instance name" : "GUID");
    return HX_INVALID_ARGUMENT;
  }
  snprintf(instance->guid, sizeof instance->guid, "%s", guid);
  hx_component_defaults(&instance->start);
  hxStatus status = hx_resources_read(instance, resources, &found);
  if (status == HX_OK && !found) status = check_default_guid(instance, resources);
  if (status != HX_OK) return status;
  instance->component = hx_component_create();
  if (!instance->component) {
    hx_log(instance, HX_LOG_ERROR, "instantiation: out of memory; free some and try again");
    return HX_OUT_OF_MEMORY;
  }
  return_to_start(instance);
  hx_log(instance, HX_LOG_EVENT, "instantiated %s, version %s, start values %s", guid, hx_version(),
         found ? "from the resources" : "compiled in");
  return HX_OK;
}

void hx_instance_close(hxInstance *instance) {
  if (instance->component) hx_component_destroy(instance->component);
  instance->component = NULL;
}

/* ----------------------------------------------------------------------------------------------
 * values */

/* as hx_variable_find, which looks through all sections; here the one given is tried first:
 * neighbours are asked for together */
static inline const hxVariable *row_of(unsigned reference, hxCausality *causality) {
  const hxSection *section = &hx_sections[*causality];
  const unsigned place = reference - section->first;
  return place < section->count ? &section->variable[place]
                                : hx_variable_find(reference, causality);
}

const hxVariable *hx_variable_find(unsigned reference, hxCausality *causality) {
  for (int k = 0; k < HX_CAUSALITIES; k++) {
    const hxSection *section = &hx_sections[k];
    if (reference - section->first < section->count) {
      *causality = (hxCausality)k;
      return &section->variable[reference - section->first];
    }
  }
  return NULL;
}

int hx_variable_takes(const hxVariable *variable, double value) {
  return value >= variable->min && value <= variable->max;
}

static const char *const type_names[] = {
    [HX_REAL] = "Real", [HX_INTEGER] = "Integer or Enumeration", [HX_BOOLEAN] = "Boolean"};

/* says why a reference is none of the type */
static hxStatus refuse_reference(hxInstance *instance, hxType type, unsigned reference,
                                 const hxVariable *variable) {
  if (!variable)
    hx_log(instance, HX_LOG_ERROR,
           "value reference: got %u, expected one of modelDescription.xml; nothing was done",
           reference);
  else
    hx_log(instance, HX_LOG_ERROR, "%s: got a call for %s, expected one for %s; nothing was done",
           variable->name, type_names[type], type_names[variable->type]);
  return HX_INVALID_ARGUMENT;
}

const hxVariable *hx_instance_find(hxInstance *instance, hxType type, unsigned reference,
                                   hxCausality *causality) {
  const hxVariable *variable = hx_variable_find(reference, causality);
  if (variable && variable->type == type) return variable;
  refuse_reference(instance, type, reference, variable);
  return NULL;
}

hxStatus hx_instance_refresh(hxInstance *instance, int output, int rate) {
  hxInstanceState *state = &instance->state;
  if (state->model_stale) {
    const hxStatus status = hx_instance_initialize(instance);
    if (status != HX_OK) return status;
  }
  if (output && state->output_stale) {
    hx_component_output(instance->component, &state->variables);
    state->output_stale = 0;
  }
  if (rate && state->rate_stale) {
    hx_continuous->rates(instance->component, &state->variables);
    state->rate_stale = 0;
  }
  return HX_OK;
}

/* brings what is asked for up to date */
static hxStatus prepare_get(hxInstance *instance, hxType type, const unsigned reference[],
                            size_t n) {
  hxCausality causality = HX_OUTPUT;
  int needs_output = 0, needs_rate = 0;
  for (size_t i = 0; i < n; i++) {
    const hxVariable *variable = row_of(reference[i], &causality);
    if (!variable || variable->type != type)
      return refuse_reference(instance, type, reference[i], variable);
    needs_output |= causality == HX_OUTPUT;
    needs_rate |= causality == HX_LOCAL;
  }
  return needs_output || needs_rate ? hx_instance_refresh(instance, needs_output, needs_rate)
                                    : HX_OK;
}

/* values that exist, all of them numbers, or else none */
static hxStatus get_reals(hxInstance *instance, const unsigned reference[], size_t n,
                          double value[]) {
  const char *variables = (const char *)&instance->state.variables;
  hxCausality causality = HX_OUTPUT;
  for (size_t i = 0; i < n; i++) {
    const hxVariable *variable = row_of(reference[i], &causality);
    const double *number = (const double *)(const void *)(variables + variable->offset);
    if (!isfinite(*number)) return hx_instance_check_finite(instance, number, 1, variable->name);
  }
  for (size_t i = 0; i < n; i++)
    memcpy(value + i, variables + row_of(reference[i], &causality)->offset, sizeof *value);
  return HX_OK;
}

hxStatus hx_instance_get(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                         void *value) {
  const char *variables = (const char *)&instance->state.variables;
  hxCausality causality = HX_OUTPUT;
  const hxStatus status = prepare_get(instance, type, reference, n);
  if (status != HX_OK) return status;
  if (type == HX_REAL) return get_reals(instance, reference, n, value);
  for (size_t i = 0; i < n; i++)
    memcpy((int *)value + i, variables + row_of(reference[i], &causality)->offset, sizeof(int));
  return HX_OK;
}

static double value_at(hxType type, const void *value, size_t i) {
  return type == HX_REAL ? ((const double *)value)[i] : (double)((const int *)value)[i];
}

/* whether one value may be set now */
static hxStatus check_set(hxInstance *instance, const hxVariable *variable, hxCausality causality,
                          double value) {
  if (causality == HX_OUTPUT || causality == HX_LOCAL) {
    hx_log(
        instance, HX_LOG_ERROR,
        "%s: got a value for what is calculated, expected an input or a parameter; nothing was set",
        variable->name);
    return HX_INVALID_ARGUMENT;
  }
  if (causality == HX_PARAMETER &&
      !(instance->state.mode & (HX_MODE_INSTANTIATED | HX_MODE_INITIALIZATION))) {
    hx_log(instance, HX_LOG_ERROR,
           "%s: got a value after initialisation, expected it before, as it is fixed; nothing was "
           "set, reset first",
           variable->name);
    return HX_INVALID_ARGUMENT;
  }
  if (!hx_variable_takes(variable, value)) {
    hx_log(instance, HX_LOG_ERROR,
           "%s: got %.17g, expected a finite number in [%g, %g] %s; nothing was set, correct the "
           "value",
           variable->name, value, variable->min, variable->max, variable->unit);
    return HX_INVALID_ARGUMENT;
  }
  return HX_OK;
}

hxStatus hx_instance_check_set(hxInstance *instance, hxType type, const unsigned reference[],
                               size_t n, const void *value) {
  hxCausality causality = HX_INPUT;
  for (size_t i = 0; i < n; i++) {
    const hxVariable *variable = row_of(reference[i], &causality);
    if (!variable || variable->type != type)
      return refuse_reference(instance, type, reference[i], variable);
    const hxStatus status = check_set(instance, variable, causality, value_at(type, value, i));
    if (status != HX_OK) return status;
  }
  return HX_OK;
}

hxStatus hx_instance_set(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                         const void *value) {
  char *variables = (char *)&instance->state.variables;
  hxCausality causality = HX_INPUT;
  const hxStatus status = hx_instance_check_set(instance, type, reference, n, value);
  if (status != HX_OK) return status;
  for (size_t i = 0; i < n; i++) {
    const hxVariable *variable = row_of(reference[i], &causality);
    const int number = type == HX_REAL ? 0 : ((const int *)value)[i],
              stored = type == HX_BOOLEAN ? number != 0 : number; /* true may be -1 */
    if (type == HX_REAL)
      memcpy(variables + variable->offset, (const double *)value + i, sizeof(double));
    else
      memcpy(variables + variable->offset, &stored, sizeof(int));
    instance->state.model_stale |= causality == HX_PARAMETER;
    hx_stale(instance);
  }
  return HX_OK;
}

/* ----------------------------------------------------------------------------------------------
 * time */

double hx_instance_time(const hxInstance *instance) {
  return instance->state.model_stale ? instance->state.start_time
                                     : hx_component_time(instance->component);
}

hxStatus hx_instance_set_experiment(hxInstance *instance, const char *call, double start,
                                    int stop_defined, double stop) {
  if (!isfinite(start) || (stop_defined && !(stop >= start))) {
    hx_log(instance, HX_LOG_ERROR,
           "%s: got %g s to %g s, expected a finite start and a stop not before it; nothing was "
           "changed",
           call, start, stop_defined ? stop : start);
    return HX_INVALID_ARGUMENT;
  }
  if (fabs(start) > hx_latest_start) {
    hx_log(instance, HX_LOG_ERROR,
           "%s: got a start at %.17g s, expected one within %g s of 0, as a later clock is too "
           "coarse for the plant's "
           "steps; nothing was changed, count time from a later origin",
           call, start, hx_latest_start);
    return HX_INVALID_ARGUMENT;
  }
  instance->state.start_time = start;
  instance->state.stop_time = stop_defined ? stop : INFINITY;
  instance->state.model_stale = 1;
  return HX_OK;
}

/* the plant's accuracy is its own parameter, so that results do not depend on an importer's
 * settings */
int hx_instance_note_tolerance(hxInstance *instance, const char *call, int defined,
                               double tolerance) {
  if (!defined || (tolerance > 0.0 && tolerance < 1.0)) return 1;
  hx_log(instance, HX_LOG_WARNING,
         "%s: got tolerance %g, expected one in ]0, 1[; ignored, solver.tolerance holds", call,
         tolerance);
  return 0;
}

hxStatus hx_instance_initialize(hxInstance *instance) {
  const hxStatus status = hx_component_reset(instance->component, &instance->state.variables,
                                             instance->state.start_time);
  if (status != HX_OK) {
    hx_log(instance, HX_LOG_ERROR,
           "parameters: %s; nothing was initialised, correct them and try again",
           hx_component_message(instance->component));
    return status;
  }
  instance->state.model_stale = 0;
  if (hx_continuous) hx_continuous->get(instance->component, &instance->state.variables);
  hx_stale(instance);
  return HX_OK;
}

static const double longest_step = 100.0; /* s */

/* How far an importer's clock may be from ours: rounding of sums of some thousand steps (ours
 * follows the importer's, so that longer ones do not pile up); and from the stop time, which it may
 * reach by a sum of all its steps, some ten million. */
static const double few_steps = 1e4 * DBL_EPSILON, all_steps = 1e-9; /* 1  relative */

/* never so much that a step would be a different one, but for the last bits */
static double clock_tolerance(double t, double h, double sums) {
  const double last_bits = 4.0 * DBL_EPSILON * fmax(1.0, fabs(t));
  return fmax(last_bits, fmin(1e-9 + sums * fabs(t), 0.5 * h));
}

/* whether there can be such a step */
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

/* what is left to do after the component's step: its input is that of its end */
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
  hx_stale(instance);
  return HX_OK;
}

/* The component goes from its own time to t + h, so that the importer's clock is adopted and errors
 * do not pile up; an extra step of rounding size may end where it began or before our own time: it
 * is done. */
hxStatus hx_instance_step(hxInstance *instance, double t, double h) {
  const hxInput *rate = instance->state.ramped ? &instance->state.input_rate : NULL;
  hxInput end;
  hxStatus status = check_step(instance, t, h);
  if (status != HX_OK || t + h <= hx_instance_time(instance)) return status;
  status = hx_instance_ramp_end(instance, h, &end);
  if (status != HX_OK) return status;
  return finish_step(
      instance, t, h, &end,
      hx_component_step(instance->component, &instance->state.variables, rate, t + h));
}

hxStatus hx_instance_step_to_event(hxInstance *instance, double t, double h, int stop, int *event) {
  const struct hxVariables *variables = &instance->state.variables;
  *event = 0;
  if (!hx_continuous || instance->state.ramped) return hx_instance_step(instance, t, h);
  const hxStatus status = check_step(instance, t, h);
  if (status != HX_OK || t + h <= hx_instance_time(instance)) return status;
  return finish_step(instance, t, h, &variables->input,
                     hx_continuous->step(instance->component, variables, t + h, stop, event));
}

/* the component goes back as well, so that saved states of a reset instance and of a new one are
 * the same bytes */
void hx_instance_reset(hxInstance *instance) {
  struct hxVariables defaults;
  return_to_start(instance);
  hx_component_defaults(&defaults);
  hx_component_reset(instance->component, &defaults, 0.0);
  hx_log(instance, HX_LOG_EVENT, "reset");
}
