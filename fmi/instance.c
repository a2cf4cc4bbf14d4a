/* instance.c - an instance: opening and closing, values, start time, initialization, reset. */
#include "fmi/instance.h"

#include <math.h>
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

void *hx_instance_new(size_t size, hxInterface interface, const char *name, int logging,
                      hxLogSink *sink) {
  hxInstance *instance = calloc(1, size);
  if (!instance) return NULL;
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

hxStatus hx_instance_refresh(hxInstance *instance, unsigned groups, int rate) {
  hxInstanceState *state = &instance->state;
  if (state->model_stale) {
    const hxStatus status = hx_instance_initialize(instance);
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

/* Places of the first variables of a call. The table of variables is larger than the fastest
 * memory, so each row is looked up once. */
enum { KNOWN_PLACES = 512 };
typedef struct {
  unsigned offset[KNOWN_PLACES];
} hxPlaces;

/* the groups of an output */
static unsigned groups_of(unsigned reference) {
  return hx_output_groups[reference - hx_sections[HX_OUTPUT].first];
}

/* checks the references and updates the outputs or rates that are asked for */
static hxStatus prepare_get(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                            hxPlaces *places) {
  hxCausality causality = HX_OUTPUT;
  unsigned groups = 0;
  int needs_rate = 0;
  for (size_t i = 0; i < n; i++) {
    const hxVariable *variable = row_of(instance, type, reference[i], &causality);
    if (!variable) return HX_INVALID_ARGUMENT;
    if (i < KNOWN_PLACES) places->offset[i] = (unsigned)variable->offset;
    if (causality == HX_OUTPUT) groups |= groups_of(reference[i]);
    needs_rate |= causality == HX_LOCAL;
  }
  return groups || needs_rate ? hx_instance_refresh(instance, groups, needs_rate) : HX_OK;
}

/* the place of a valid reference in the variables */
static void *place_of(hxInstance *instance, hxType type, const unsigned reference[], size_t i,
                      const hxPlaces *places) {
  hxCausality causality = HX_OUTPUT;
  const size_t offset = i < KNOWN_PLACES ? places->offset[i]
                                         : row_of(instance, type, reference[i], &causality)->offset;
  return (char *)&instance->state.variables + offset;
}

/* copies values of valid references; none when one of them is not finite */
static hxStatus get_reals(hxInstance *instance, const unsigned reference[], size_t n,
                          const hxPlaces *places, double value[]) {
  hxCausality causality = HX_OUTPUT;
  for (size_t i = 0; i < n; i++) {
    const double *number = place_of(instance, HX_REAL, reference, i, places);
    if (!isfinite(*number))
      return hx_instance_check_finite(instance, number, 1,
                                      row_of(instance, HX_REAL, reference[i], &causality)->name);
  }
  for (size_t i = 0; i < n; i++)
    memcpy(value + i, place_of(instance, HX_REAL, reference, i, places), sizeof *value);
  return HX_OK;
}

hxStatus hx_instance_get(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                         void *value) {
  hxPlaces places;
  const hxStatus status = prepare_get(instance, type, reference, n, &places);
  if (status != HX_OK) return status;
  if (type == HX_REAL) return get_reals(instance, reference, n, &places, value);
  for (size_t i = 0; i < n; i++)
    memcpy((int *)value + i, place_of(instance, type, reference, i, &places), sizeof(int));
  return HX_OK;
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
           "%s: got a value after initialisation, expected it before, as it is fixed; nothing was "
           "set, reset first",
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

/* checks all references and values; sets the places, and *parameters if one is a parameter */
static hxStatus check_all(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                          const void *value, hxPlaces *places, int *parameters) {
  hxCausality causality = HX_INPUT;
  *parameters = 0;
  for (size_t i = 0; i < n; i++) {
    const hxVariable *variable = row_of(instance, type, reference[i], &causality);
    if (!variable) return HX_INVALID_ARGUMENT;
    const hxStatus status = check_set(instance, variable, causality, value_at(type, value, i));
    if (status != HX_OK) return status;
    if (i < KNOWN_PLACES) places->offset[i] = (unsigned)variable->offset;
    *parameters |= causality == HX_PARAMETER;
  }
  return HX_OK;
}

hxStatus hx_instance_check_set(hxInstance *instance, hxType type, const unsigned reference[],
                               size_t n, const void *value) {
  hxPlaces places;
  int parameters;
  return check_all(instance, type, reference, n, value, &places, &parameters);
}

hxStatus hx_instance_set(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                         const void *value) {
  hxPlaces places;
  int parameters;
  const hxStatus status = check_all(instance, type, reference, n, value, &places, &parameters);
  if (status != HX_OK || n == 0) return status;
  for (size_t i = 0; i < n; i++) {
    void *place = place_of(instance, type, reference, i, &places);
    const int number = type == HX_REAL ? 0 : ((const int *)value)[i],
              stored = type == HX_BOOLEAN ? number != 0 : number; /* true may be -1 */
    if (type == HX_REAL)
      memcpy(place, (const double *)value + i, sizeof(double));
    else
      memcpy(place, &stored, sizeof(int));
  }
  instance->state.model_stale |= parameters && !is_between_steps(instance);
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
