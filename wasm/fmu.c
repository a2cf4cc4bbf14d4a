/* fmu.c - an FMU as a WebAssembly component, after the draft layered standard fmi-ls-wasm
 *
 * Each exported function is one or several functions of the draft's interface co-simulation, in the
 * canonical ABI of the component model; cosim/export/wit.py says which. A list or text comes as
 * its place and its number of elements. It was allocated by cabi_realloc, and the function frees
 * it. A result that is more than one number is written to `answer`, whose address is returned; a
 * list in it is freed by cabi_post when the importer has read it.
 */
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "fmi/instance.h"
#include "fmi3Functions.h"
#include "memory_files.h"

#define EXPORT(name) __attribute__((export_name(name)))
#define IMPORT(name) __attribute__((import_module("host"), import_name(name)))

/* what the draft's resource co-simulation-instance stands for */
typedef struct hxHandle {
  fmi3Instance instance;
  char *name;
} hxHandle;

typedef struct hxText {
  char *bytes;
  size_t size;
} hxText;

typedef struct hxRequest {
  fmi3ValueReference reference;
  uint32_t order;
} hxRequest;

typedef struct hxStepResult {
  double last_successful_time;
  bool event_handling_needed, terminate_simulation, early_return;
} hxStepResult;

typedef struct hxStatesInfo {
  bool new_states_needed, terminate, nominals_changed, values_changed, next_event_defined;
  double next_event_time;
} hxStatesInfo;

/* A result, option or text, as the canonical ABI lays it out. */
static union {
  hxText text;
  struct {
    uint8_t is_error;
    union {
      hxText list;
      uint8_t status;
    } is;
  } list;
  struct {
    uint8_t is_error;
    union {
      hxStepResult step;
      hxStatesInfo states;
      uint8_t status;
    } is;
  } record;
  struct {
    uint8_t is_some;
    int handle;
  } option;
} answer;

_Static_assert(sizeof(void *) == 4 && sizeof(fmi3Boolean) == 1, "the ABI of wasm32");

IMPORT("log")
void hx_host_log(const char *name, size_t name_size, int status, const char *category,
                 size_t category_size, const char *message, size_t message_size);
IMPORT("new") int hx_host_handle(hxHandle *handle);

/* ----------------------------------------------------------------------------------------------
 * memory */

EXPORT("cabi_realloc") void *hx_abi_realloc(void *old, size_t old_size, size_t align, size_t size) {
  (void)old_size, (void)align;
  void *place = realloc(old, size ? size : 1);
  if (!place) __builtin_trap(); /* the ABI has no other way to tell */
  return place;
}

EXPORT("cabi_post") void hx_abi_post(const void *result) {
  (void)result;
  if (!answer.list.is_error) free(answer.list.is.list.bytes);
}

EXPORT("resources") void *hx_abi_resources(size_t size) { return hx_memory_block(size); }

/* a text with a final zero; frees the given one */
static char *take_text(char *bytes, size_t size) {
  char *text = hx_abi_realloc(bytes, size, 1, size + 1);
  text[size] = '\0';
  return text;
}

static void free_texts(hxText *list, size_t count) {
  for (size_t k = 0; k < count; ++k) free(list[k].bytes);
  free(list);
}

/* ----------------------------------------------------------------------------------------------
 * results */

static const void *list_of(fmi3Status status, void *items, size_t count) {
  answer.list.is_error = status > fmi3Warning;
  if (answer.list.is_error) {
    free(items);
    answer.list.is.status = (uint8_t)status;
  } else
    answer.list.is.list = (hxText){items, count};
  return &answer;
}

static const void *record_of(fmi3Status status) {
  answer.record.is_error = status > fmi3Warning;
  if (answer.record.is_error) answer.record.is.status = (uint8_t)status;
  return &answer;
}

/* number of elements of all variables; 0 for unknown ones, which are refused later */
static size_t element_count(const fmi3ValueReference vr[], size_t n) {
  size_t count = 0;
  for (size_t k = 0; k < n; ++k) {
    hxCausality causality;
    const hxVariable *variable = hx_variable_find(vr[k], &causality);
    count += variable ? variable->array_rows : vr[k] == hx_time_reference;
  }
  return count;
}

/* ----------------------------------------------------------------------------------------------
 * instances */

static void log_message(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                        fmi3String message) {
  const hxHandle *handle = environment;
  hx_host_log(handle->name, strlen(handle->name), (int)status, category, strlen(category), message,
              strlen(message));
}

EXPORT("get-version") const void *hx_abi_get_version(void) {
  static char version[] = fmi3Version;
  answer.text = (hxText){version, sizeof version - 1};
  return &answer;
}

EXPORT("free-instance") void hx_abi_free_instance(hxHandle *handle) {
  fmi3FreeInstance(handle->instance);
  free(handle->name);
  free(handle);
}

EXPORT("instantiate")
const void *hx_abi_instantiate(char *name, size_t name_size, char *token, size_t token_size,
                               char *path, size_t path_size, int visible, int logging, int events,
                               int early, fmi3ValueReference *required, size_t n_required) {
  hxHandle *handle = hx_abi_realloc(NULL, 0, 8, sizeof *handle);
  handle->name = take_text(name, name_size);
  token = take_text(token, token_size);
  path = take_text(path, path_size);
  /* the resources are in the module, whether or not the importer has a folder of them */
  handle->instance = fmi3InstantiateCoSimulation(
      handle->name, token, path_size ? path : "/", visible != 0, logging != 0, events != 0,
      early != 0, required, n_required, handle, log_message, NULL);
  free(token);
  free(path);
  free(required);
  answer.option.is_some = handle->instance != NULL;
  if (handle->instance)
    answer.option.handle = hx_host_handle(handle);
  else
    hx_abi_free_instance(handle);
  return &answer;
}

EXPORT("set-debug-logging")
int hx_abi_set_debug_logging(hxHandle *handle, int on, hxText *categories, size_t n) {
  const char **names = hx_abi_realloc(NULL, 0, 4, n * sizeof *names);
  for (size_t k = 0; k < n; ++k)
    names[k] = categories[k].bytes = take_text(categories[k].bytes, categories[k].size);
  const fmi3Status status = fmi3SetDebugLogging(handle->instance, on != 0, n, names);
  free(names);
  free_texts(categories, n);
  return (int)status;
}

EXPORT("enter-initialization-mode")
int hx_abi_enter_initialization(hxHandle *handle, int has_tolerance, double tolerance, double start,
                                int has_stop, double stop) {
  return (int)fmi3EnterInitializationMode(handle->instance, has_tolerance != 0, tolerance, start,
                                          has_stop != 0, stop);
}

#define WITHOUT_ARGUMENTS(name, Function)                                                          \
  EXPORT(name) int hx_abi_##Function(hxHandle *handle) { return (int)Function(handle->instance); }

WITHOUT_ARGUMENTS("exit-initialization-mode", fmi3ExitInitializationMode)
WITHOUT_ARGUMENTS("enter-event-mode", fmi3EnterEventMode)
WITHOUT_ARGUMENTS("terminate", fmi3Terminate)
WITHOUT_ARGUMENTS("reset", fmi3Reset)
WITHOUT_ARGUMENTS("enter-configuration-mode", fmi3EnterConfigurationMode)
WITHOUT_ARGUMENTS("exit-configuration-mode", fmi3ExitConfigurationMode)
WITHOUT_ARGUMENTS("evaluate-discrete-states", fmi3EvaluateDiscreteStates)
WITHOUT_ARGUMENTS("enter-step-mode", fmi3EnterStepMode)

/* ----------------------------------------------------------------------------------------------
 * values */

#define ACCESS(get_name, set_name, Type)                                                           \
  EXPORT(get_name)                                                                                 \
  const void *hx_abi_get_##Type(hxHandle *handle, fmi3ValueReference *vr, size_t n) {              \
    const size_t count = element_count(vr, n);                                                     \
    fmi3##Type *values = hx_abi_realloc(NULL, 0, 8, count * sizeof *values);                       \
    const fmi3Status status = fmi3Get##Type(handle->instance, vr, n, values, count);               \
    free(vr);                                                                                      \
    return list_of(status, values, count);                                                         \
  }                                                                                                \
  EXPORT(set_name)                                                                                 \
  int hx_abi_set_##Type(hxHandle *handle, fmi3ValueReference *vr, size_t n, fmi3##Type *values,    \
                        size_t count) {                                                            \
    const fmi3Status status = fmi3Set##Type(handle->instance, vr, n, values, count);               \
    free(vr);                                                                                      \
    free(values);                                                                                  \
    return (int)status;                                                                            \
  }

ACCESS("get-float64", "set-float64", Float64)
ACCESS("get-int64", "set-int64", Int64)
ACCESS("get-boolean", "set-boolean", Boolean)

/* of types that no variable has; the elements of a set list have no allocations of their own */
EXPORT("get-other")
const void *hx_abi_get_other(hxHandle *handle, fmi3ValueReference *vr, size_t n) {
  const fmi3Status status = fmi3GetFloat32(handle->instance, vr, n, NULL, 0);
  free(vr);
  return list_of(status, NULL, 0);
}

EXPORT("set-other")
int hx_abi_set_other(hxHandle *handle, fmi3ValueReference *vr, size_t n, void *values,
                     size_t count) {
  const fmi3Status status = fmi3SetFloat32(handle->instance, vr, n, values, count);
  free(vr);
  free(values);
  return (int)status;
}

EXPORT("set-texts")
int hx_abi_set_texts(hxHandle *handle, fmi3ValueReference *vr, size_t n, hxText *values,
                     size_t count) {
  const fmi3Status status = fmi3SetString(handle->instance, vr, n, NULL, count);
  free(vr);
  free_texts(values, count);
  return (int)status;
}

/* of clocks, of which there are none */
EXPORT("get-clock")
const void *hx_abi_get_clock(hxHandle *handle, fmi3ValueReference *vr, size_t n) {
  const fmi3Status status = fmi3GetClock(handle->instance, vr, n, NULL);
  free(vr);
  return list_of(status, NULL, 0);
}

EXPORT("set-clock")
int hx_abi_set_clock(hxHandle *handle, fmi3ValueReference *vr, size_t n, void *values,
                     size_t count) {
  const fmi3Status status = fmi3SetClock(handle->instance, vr, n, NULL);
  (void)count;
  free(vr);
  free(values);
  return (int)status;
}

/* ----------------------------------------------------------------------------------------------
 * dependencies, derivatives */

EXPORT("get-number-of-variable-dependencies")
const void *hx_abi_get_dependency_count(hxHandle *handle, fmi3ValueReference vr) {
  size_t count = 0;
  return record_of(fmi3GetNumberOfVariableDependencies(handle->instance, vr, &count));
}

EXPORT("get-variable-dependencies")
const void *hx_abi_get_dependencies(hxHandle *handle, fmi3ValueReference vr) {
  return list_of(fmi3GetVariableDependencies(handle->instance, vr, NULL, NULL, NULL, NULL, 0), NULL,
                 0);
}

EXPORT("get-directional-derivative")
const void *hx_abi_get_directional(hxHandle *handle, fmi3ValueReference *unknowns,
                                   size_t n_unknowns, fmi3ValueReference *knowns, size_t n_knowns,
                                   double *seed, size_t n_seed) {
  const size_t count = element_count(unknowns, n_unknowns);
  double *found = hx_abi_realloc(NULL, 0, 8, count * sizeof *found);
  const fmi3Status status = fmi3GetDirectionalDerivative(
      handle->instance, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, found, count);
  free(unknowns);
  free(knowns);
  free(seed);
  return list_of(status, found, count);
}

EXPORT("get-adjoint-derivative")
const void *hx_abi_get_adjoint(hxHandle *handle, fmi3ValueReference *unknowns, size_t n_unknowns,
                               fmi3ValueReference *knowns, size_t n_knowns, double *seed,
                               size_t n_seed) {
  const fmi3Status status = fmi3GetAdjointDerivative(handle->instance, unknowns, n_unknowns, knowns,
                                                     n_knowns, seed, n_seed, NULL, 0);
  free(unknowns);
  free(knowns);
  free(seed);
  return list_of(status, NULL, 0);
}

/* The draft has this function, FMI 3.0 does not. */
EXPORT("set-input-derivatives")
int hx_abi_set_input_derivatives(hxHandle *handle, hxRequest *requests, size_t n, double *values,
                                 size_t count) {
  (void)count;
  free(requests);
  free(values);
  if (n == 0) return (int)fmi3OK;
  hx_log(handle->instance, HX_LOG_ERROR,
         "set-input-derivatives: got %zu requests, expected none, as FMI 3.0 has no derivatives of "
         "inputs; nothing was set",
         n);
  return (int)fmi3Error;
}

EXPORT("get-output-derivatives")
const void *hx_abi_get_output_derivatives(hxHandle *handle, hxRequest *requests, size_t n) {
  fmi3ValueReference *vr = hx_abi_realloc(NULL, 0, 4, n * sizeof *vr);
  fmi3Int32 *order = hx_abi_realloc(NULL, 0, 4, n * sizeof *order);
  for (size_t k = 0; k < n; ++k) {
    vr[k] = requests[k].reference;
    order[k] = (fmi3Int32)requests[k].order;
  }
  const size_t count = element_count(vr, n);
  double *values = hx_abi_realloc(NULL, 0, 8, count * sizeof *values);
  const fmi3Status status = fmi3GetOutputDerivatives(handle->instance, vr, n, order, values, count);
  free(requests);
  free(vr);
  free(order);
  return list_of(status, values, count);
}

/* ----------------------------------------------------------------------------------------------
 * saved states */

EXPORT("get-fmu-state") const void *hx_abi_get_state(hxHandle *handle) {
  fmi3FMUState state = NULL;
  size_t size = 0;
  void *bytes = NULL;
  fmi3Status status = fmi3GetFMUState(handle->instance, &state);
  if (status == fmi3OK) status = fmi3SerializedFMUStateSize(handle->instance, state, &size);
  if (status == fmi3OK) {
    bytes = hx_abi_realloc(NULL, 0, 1, size);
    status = fmi3SerializeFMUState(handle->instance, state, bytes, size);
  }
  if (state) fmi3FreeFMUState(handle->instance, &state);
  return list_of(status, bytes, size);
}

EXPORT("set-fmu-state") int hx_abi_set_state(hxHandle *handle, uint8_t *bytes, size_t size) {
  fmi3FMUState state = NULL;
  fmi3Status status = fmi3DeserializeFMUState(handle->instance, bytes, size, &state);
  if (status == fmi3OK) status = fmi3SetFMUState(handle->instance, state);
  if (state) fmi3FreeFMUState(handle->instance, &state);
  free(bytes);
  return (int)status;
}

/* ----------------------------------------------------------------------------------------------
 * steps */

EXPORT("update-discrete-states") const void *hx_abi_update_states(hxHandle *handle) {
  hxStatesInfo *info = &answer.record.is.states;
  return record_of(fmi3UpdateDiscreteStates(
      handle->instance, &info->new_states_needed, &info->terminate, &info->nominals_changed,
      &info->values_changed, &info->next_event_defined, &info->next_event_time));
}

EXPORT("do-step")
const void *hx_abi_do_step(hxHandle *handle, double time, double size, int no_earlier_state) {
  hxStepResult *result = &answer.record.is.step;
  return record_of(fmi3DoStep(handle->instance, time, size, no_earlier_state != 0,
                              &result->event_handling_needed, &result->terminate_simulation,
                              &result->early_return, &result->last_successful_time));
}
