/* instance.c - an instance: opening and closing, values, start time, initialization, reset. */
#include "fmi/instance.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "hexapod/message.h"

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

/* Without start_values.txt the FMU is the compiled-in robot's, so the GUID must be the binary's. */
static hxStatus check_default_guid(hxInstance *instance, const char *resources) {
  if (strcmp(instance->guid, hx_default_guid) == 0) return HX_OK;
  hx_log(instance, HX_LOG_ERROR,
         "GUID: got '%s', expected '%s', the binary's own, because no start_values.txt was found "
         "in the resources '%s'; "
         "pass the GUID of modelDescription.xml and the URI of the unpacked resources folder",
         instance->guid, hx_default_guid, resources ? resources : "(NULL)");
  return HX_INVALID_ARGUMENT;
}

void *hx_instance_new(size_t size, int version, hxInterface interface, const char *name,
                      int logging, hxLogSink *sink) {
  hxInstance *instance = calloc(1, size);
  if (!instance) return NULL;
  instance->version = version;
  instance->sink = sink;
  instance->logged = logging ? ~0u : HX_LOG_ALWAYS;
  instance->state.interface = (int)interface;
  if (name) hx_print(instance->name, sizeof instance->name, "%s", name);
  return instance;
}

hxStatus hx_instance_open(hxInstance *instance, const char *guid, const char *resources) {
  int found = 0;
  if (!instance->name[0] || !guid) {
    hx_log(instance, HX_LOG_ERROR, "instantiation: got no %s, expected a text; pass one",
           guid ? "instance name" : "GUID");
    return HX_INVALID_ARGUMENT;
  }
  hx_print(instance->guid, sizeof instance->guid, "%s", guid);
  hx_component_defaults(&instance->start);
  hxStatus status = hx_resources_read(instance, resources, &found);
  if (status == HX_OK && !found) status = check_default_guid(instance, resources);
  if (status != HX_OK) return status;
  instance->component = hx_component_create();
  if (!instance->component) {
    hx_log(instance, HX_LOG_ERROR, "instantiation: out of memory; free some and try again");
    return HX_OUT_OF_MEMORY;
  }
  char *folder;
  status = hx_resources_folder(resources, &folder);
  if (status == HX_OK) status = hx_component_set_resources(instance->component, folder);
  free(folder);
  if (status != HX_OK) {
    hx_log(instance, HX_LOG_ERROR, "resources: out of memory; free some and try again");
    return status;
  }
  return_to_start(instance);
  hx_log(instance, HX_LOG_EVENT, "instantiated %s, version %s, start values %s", guid, hx_version(),
         found ? "from the resources" : "compiled in");
  return HX_OK;
}

void hx_instance_free(hxInstance *instance) {
  if (!instance) return;
  if (instance->component) hx_component_destroy(instance->component);
  free(instance);
}

/* ----------------------------------------------------------------------------------------------
 * values */

/* Updates groups of outputs. When an importer has read other groups at this time, all that are left
 * are calculated, so that two calculations are enough for any number of its calls. */
static void refresh_output(hxInstance *instance, unsigned groups) {
  hxInstanceState *state = &instance->state;
  if (state->output_stale) instance->fresh = 0;
  if (!(groups & ~instance->fresh)) return;
  if (instance->fresh) groups = HX_ALL_GROUPS;
  hx_component_output(instance->component, &state->variables, groups & ~instance->fresh);
  instance->fresh |= groups;
  state->output_stale = 0;
}

hxStatus hx_instance_tune(hxInstance *instance) {
  hxInstanceState *state = &instance->state;
  if (!state->tuned) return HX_OK;
  const hxStatus status = hx_continuous->tune(instance->component, &state->variables);
  if (status != HX_OK) {
    hx_log(instance, HX_LOG_ERROR, "%s; the parameters are not in force, correct them",
           hx_component_message(instance->component));
    return status;
  }
  state->tuned = 0;
  hx_mark_stale(instance);
  return HX_OK;
}

hxStatus hx_instance_refresh(hxInstance *instance, unsigned groups, int rate) {
  hxInstanceState *state = &instance->state;
  if (state->model_stale) {
    const hxStatus status = hx_instance_initialize(instance);
    if (status != HX_OK) return status;
  }
  if (state->tuned && state->interface == HX_CO_SIMULATION) {
    const hxStatus status = hx_instance_tune(instance);
    if (status != HX_OK) return status;
  }
  if (groups) refresh_output(instance, groups);
  if (rate && state->rate_stale) {
    hx_continuous->rates(instance->component, &state->variables);
    state->rate_stale = 0;
  }
  return HX_OK;
}

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

/* As hx_variable_of_type, but tries the given section first: importers ask for neighbouring
 * references together. */
static inline const hxVariable *row_of(hxInstance *instance, hxType type, unsigned reference,
                                       hxCausality *causality) {
  const hxSection *section = &hx_sections[*causality];
  const unsigned index = reference - section->first;
  if (index < section->count && section->variable[index].type == type)
    return &section->variable[index];
  return hx_variable_of_type(instance, type, reference, causality);
}

/* the groups of an output */
static unsigned groups_of(unsigned reference) {
  return hx_output_groups[reference - hx_sections[HX_OUTPUT].first];
}

/* the place of a valid reference in the variables */
static void *place_of(hxInstance *instance, hxType type, unsigned reference) {
  hxCausality causality = HX_OUTPUT;
  return (char *)&instance->state.variables + row_of(instance, type, reference, &causality)->offset;
}

/* checks references, and finds the groups of outputs that they need, and whether they need rates */
static hxStatus look_up(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                        unsigned *groups, int *needs_rate) {
  hxCausality causality = HX_OUTPUT;
  *groups = 0, *needs_rate = 0;
  for (size_t i = 0; i < n; i++) {
    if (!row_of(instance, type, reference[i], &causality)) return HX_INVALID_ARGUMENT;
    if (causality == HX_OUTPUT) *groups |= groups_of(reference[i]);
    *needs_rate |= causality == HX_LOCAL;
  }
  return HX_OK;
}

/* The same of Reals, at most HX_KNOWN_OUTPUTS. */
static hxStatus look_up_reals(hxInstance *instance, const unsigned reference[], size_t n) {
  hxKnownOutputs *known = &instance->outputs;
  if (known->n == n && memcmp(known->reference, reference, n * sizeof *reference) == 0)
    return HX_OK;
  known->n = 0;
  const hxStatus status =
      look_up(instance, HX_REAL, reference, n, &known->groups, &known->needs_rate);
  if (status != HX_OK) return status;
  hxCausality causality = HX_OUTPUT;
  for (size_t i = 0; i < n; i++) {
    known->reference[i] = reference[i];
    known->offset[i] = row_of(instance, HX_REAL, reference[i], &causality)->offset;
  }
  known->n = n;
  return HX_OK;
}

/* checks that Reals with valid references are finite */
static hxStatus check_finite(hxInstance *instance, const unsigned reference[], size_t n) {
  hxStatus status = HX_OK;
  for (size_t i = 0; i < n && status == HX_OK; i++) {
    hxCausality causality = HX_OUTPUT;
    const char *name = row_of(instance, HX_REAL, reference[i], &causality)->name;
    const double *number = place_of(instance, HX_REAL, reference[i]);
    status = hx_instance_check_finite(instance, number, 1, name);
  }
  return status;
}

/* copies the values of known outputs; none when one of them is not finite */
static hxStatus get_known(hxInstance *instance, double value[]) {
  const hxKnownOutputs *known = &instance->outputs;
  const char *variables = (const char *)&instance->state.variables;
  /* all bits of the exponent are set in NaN and inf: adding 1 to it carries into the sign */
  const uint64_t one = (uint64_t)1 << 52;
  uint64_t found = 0;
  for (size_t i = 0; i < known->n; i++) {
    uint64_t bits;
    memcpy(&bits, variables + known->offset[i], sizeof bits);
    found |= (bits & INT64_MAX) + one;
  }
  const hxStatus status = found >> 63 ? check_finite(instance, known->reference, known->n) : HX_OK;
  for (size_t i = 0; status == HX_OK && i < known->n; i++)
    memcpy(value + i, variables + known->offset[i], sizeof *value);
  return status;
}

/* updates what is asked for */
static hxStatus update(hxInstance *instance, unsigned groups, int needs_rate) {
  return groups || needs_rate ? hx_instance_refresh(instance, groups, needs_rate) : HX_OK;
}

/* reads Reals, at most HX_KNOWN_OUTPUTS of them */
static hxStatus get_reals(hxInstance *instance, const unsigned reference[], size_t n,
                          double value[]) {
  hxStatus status = look_up_reals(instance, reference, n);
  if (status == HX_OK)
    status = update(instance, instance->outputs.groups, instance->outputs.needs_rate);
  return status == HX_OK ? get_known(instance, value) : status;
}

hxStatus hx_instance_get(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                         void *value) {
  unsigned groups;
  int needs_rate;
  if (n == 0) return HX_OK; /* the arrays may be NULL */
  if (type == HX_REAL && n <= HX_KNOWN_OUTPUTS) return get_reals(instance, reference, n, value);
  hxStatus status = look_up(instance, type, reference, n, &groups, &needs_rate);
  if (status == HX_OK) status = update(instance, groups, needs_rate);
  if (status == HX_OK && type == HX_REAL) status = check_finite(instance, reference, n);
  const size_t size = type == HX_REAL ? sizeof(double) : sizeof(int);
  for (size_t i = 0; status == HX_OK && i < n; i++)
    memcpy((char *)value + i * size, place_of(instance, type, reference[i]), size);
  return status;
}

static double value_at(hxType type, const void *value, size_t i) {
  return type == HX_REAL ? ((const double *)value)[i] : (double)((const int *)value)[i];
}

/* whether tunable parameters may be set, which the next step follows */
static int is_between_steps(const hxInstance *instance) {
  return (instance->state.mode & (HX_MODE_STEP | HX_MODE_EVENT)) != 0;
}

/* checks that one value may be set in the present mode */
static hxStatus check_set(hxInstance *instance, const hxVariable *variable, hxCausality causality,
                          double value) {
  if (causality == HX_OUTPUT || causality == HX_LOCAL) {
    hx_log(instance, HX_LOG_ERROR,
           "%s: got a value for what is calculated, expected an input or a parameter; nothing was "
           "set",
           variable->name);
    return HX_INVALID_ARGUMENT;
  }
  if (causality == HX_PARAMETER && !(variable->tunable && is_between_steps(instance)) &&
      !(instance->state.mode & (HX_MODE_INSTANTIATED | HX_MODE_INITIALIZATION))) {
    hx_log(instance, HX_LOG_ERROR,
           variable->tunable
               ? "%s: got a value within a step, expected it between steps, in step mode or event "
                 "mode, as it is a parameter; nothing was set, set it there"
               : "%s: got a value after initialisation, expected it before, as it is fixed; "
                 "nothing was set, reset first",
           variable->name);
    return HX_INVALID_ARGUMENT;
  }
  if (!hx_variable_in_range(variable, value)) {
    hx_log(instance, HX_LOG_ERROR,
           "%s: got %.17g, expected a finite number in [%g, %g]%s%s; nothing was set, correct "
           "the value",
           variable->name, value, variable->min, variable->max, hx_unit_gap(variable->unit),
           variable->unit);
    return HX_INVALID_ARGUMENT;
  }
  return HX_OK;
}

/* checks all references and values; sets *causalities to a mask of those of the variables */
static hxStatus check_all(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                          const void *value, unsigned *causalities) {
  hxCausality causality = HX_INPUT;
  *causalities = 0;
  for (size_t i = 0; i < n; i++) {
    const hxVariable *variable = row_of(instance, type, reference[i], &causality);
    if (!variable) return HX_INVALID_ARGUMENT;
    const hxStatus status = check_set(instance, variable, causality, value_at(type, value, i));
    if (status != HX_OK) return status;
    *causalities |= 1u << causality;
  }
  return HX_OK;
}

hxStatus hx_instance_check_set(hxInstance *instance, hxType type, const unsigned reference[],
                               size_t n, const void *value) {
  unsigned causalities;
  return check_all(instance, type, reference, n, value, &causalities);
}

/* sets Real inputs that are known if all values are in range; returns whether it did */
static int set_known(hxInstance *instance, const unsigned reference[], size_t n,
                     const double value[]) {
  const hxKnownInputs *known = &instance->inputs;
  char *variables = (char *)&instance->state.variables;
  int outside = 0;
  if (known->n != n || n == 0 || memcmp(known->reference, reference, n * sizeof *reference) != 0)
    return 0;
  for (size_t i = 0; i < n; i++)
    outside |= !(value[i] >= known->min[i]) | !(value[i] <= known->max[i]);
  if (outside) return 0;
  for (size_t i = 0; i < n; i++) memcpy(variables + known->offset[i], value + i, sizeof *value);
  hx_mark_stale(instance);
  return 1;
}

/* keeps what the table says of Real inputs */
static void keep_inputs(hxInstance *instance, const unsigned reference[], size_t n) {
  hxKnownInputs *known = &instance->inputs;
  hxCausality causality = HX_INPUT;
  known->n = n;
  for (size_t i = 0; i < n; i++) {
    const hxVariable *variable = row_of(instance, HX_REAL, reference[i], &causality);
    known->reference[i] = reference[i];
    known->offset[i] = variable->offset;
    known->min[i] = variable->min;
    known->max[i] = variable->max;
  }
}

hxStatus hx_instance_set(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                         const void *value) {
  unsigned causalities;
  if (type == HX_REAL && set_known(instance, reference, n, value)) return HX_OK;
  const hxStatus status = check_all(instance, type, reference, n, value, &causalities);
  if (status != HX_OK || n == 0) return status;
  for (size_t i = 0; i < n; i++) {
    void *place = place_of(instance, type, reference[i]);
    const int number = type == HX_REAL ? 0 : ((const int *)value)[i],
              stored = type == HX_BOOLEAN ? number != 0 : number; /* true may be -1 */
    if (type == HX_REAL)
      memcpy(place, (const double *)value + i, sizeof(double));
    else
      memcpy(place, &stored, sizeof(int));
  }
  if (type == HX_REAL && n <= HX_KNOWN_INPUTS && causalities == 1u << HX_INPUT)
    keep_inputs(instance, reference, n);
  const int parameters = (causalities & 1u << HX_PARAMETER) != 0;
  instance->state.model_stale |= parameters && !is_between_steps(instance);
  instance->state.tuned |= parameters && is_between_steps(instance) && hx_continuous;
  hx_mark_stale(instance);
  return HX_OK;
}

/* ----------------------------------------------------------------------------------------------
 * time and initialization */

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

/* The importer's tolerance is ignored: the plant's accuracy is its own parameter, so that results
 * do not depend on an importer's settings. */
int hx_instance_check_tolerance(hxInstance *instance, const char *call, int defined,
                                double tolerance) {
  if (!defined || (tolerance > 0.0 && tolerance < 1.0)) return 1;
  hx_log(instance, HX_LOG_WARNING,
         "%s: got tolerance %g, expected one in ]0, 1[; ignored, solver.tolerance holds", call,
         tolerance);
  return 0;
}

hxStatus hx_instance_initialize(hxInstance *instance) {
  hxInstanceState *state = &instance->state;
  hxStatus status = HX_OK;
  if (hx_continuous && state->interface == HX_MODEL_EXCHANGE)
    status = hx_continuous->check(instance->component, &state->variables);
  if (status == HX_OK)
    status = hx_component_reset(instance->component, &state->variables, state->start_time);
  if (status != HX_OK) {
    hx_log(instance, HX_LOG_ERROR,
           "parameters: %s; nothing was initialised, correct them and try again",
           hx_component_message(instance->component));
    return status;
  }
  state->model_stale = 0;
  if (hx_continuous) hx_continuous->get(instance->component, &state->variables);
  hx_mark_stale(instance);
  return HX_OK;
}

/* The component is reset to its defaults too, so that the saved states of a reset instance and of a
 * new one are the same bytes. */
void hx_instance_reset(hxInstance *instance) {
  struct hxVariables defaults;
  return_to_start(instance);
  hx_component_defaults(&defaults);
  hx_component_reset(instance->component, &defaults, 0.0);
  hx_log(instance, HX_LOG_EVENT, "reset");
}
