/* call.c - what the functions of both versions of the standard share: the checks of mode, interface
 * and array arguments that precede each call, and the calls that do the same in both. */
#include "fmi/call.h"

#include <stdlib.h>

typedef struct hxCallRow {
  const char *name[2];   /* in FMI 2.0 and 3.0 */
  int modes, interfaces; /* in which the call is legal, as masks */
} hxCallRow;

#define ROW(Id, Two, Three, Modes, Interfaces)                                                     \
  {{"fmi2" #Two, "fmi3" #Three}, HX_##Modes, HX_##Interfaces},
static const hxCallRow rows[] = {HX_CALLS(ROW)};

static const char *name_of(const hxInstance *instance, hxCall call) {
  return rows[call].name[instance->version - 2];
}

/* ----------------------------------------------------------------------------------------------
 * replies */

int hx_reply(hxStatus status) {
  if (status == HX_OK) return HX_REPLY_OK;
  return status == HX_STEP_TOO_SMALL || status == HX_NOT_FINITE ? HX_REPLY_DISCARD : HX_REPLY_ERROR;
}

int hx_reply_of_category(hxLogCategory category) {
  static const int reply[] = {HX_REPLY_ERROR, HX_REPLY_DISCARD, HX_REPLY_WARNING, HX_REPLY_OK,
                              HX_REPLY_OK};
  return reply[category];
}

/* ----------------------------------------------------------------------------------------------
 * checks */

static const char *mode_name(int mode) {
  if (mode == HX_MODE_INSTANTIATED) return "before initialization mode";
  if (mode == HX_MODE_INITIALIZATION) return "in initialization mode";
  if (mode == HX_MODE_EVENT) return "in event mode";
  if (mode == HX_MODE_CONTINUOUS) return "in continuous-time mode";
  if (mode == HX_MODE_INTERMEDIATE) return "in an intermediate update";
  return mode == HX_MODE_STEP ? "between steps" : "after termination";
}

static const char *interface_name(int interface) {
  return interface == HX_MODEL_EXCHANGE ? "model exchange" : "co-simulation";
}

int hx_call_is_legal(hxInstance *instance, hxCall call) {
  if (!instance) return 0;
  const hxCallRow *row = &rows[call];
  const hxInstanceState *state = &instance->state;
  if (!(row->interfaces & state->interface))
    hx_log(instance, HX_LOG_ERROR,
           "%s: got a call of %s, expected one of %s, which was instantiated; nothing was changed",
           name_of(instance, call), interface_name(row->interfaces),
           interface_name(state->interface));
  else if (!(row->modes & state->mode))
    hx_log(instance, HX_LOG_ERROR,
           "%s: got a call %s, where the standard does not allow it; nothing was changed",
           name_of(instance, call), mode_name(state->mode));
  else
    return 1;
  return 0;
}

int hx_call_has_arrays(hxInstance *instance, hxCall call, size_t n, const void *array,
                       const void *other) {
  if (n == 0 || (array && other)) return 1;
  hx_log(instance, HX_LOG_ERROR, "%s: got NULL, expected an array of %zu; nothing was changed",
         name_of(instance, call), n);
  return 0;
}

int hx_call_is_legal_with(hxInstance *instance, hxCall call, size_t n, const void *array,
                          const void *other) {
  return hx_call_is_legal(instance, call) && hx_call_has_arrays(instance, call, n, array, other);
}

int hx_call_is_first_order(hxInstance *instance, hxCall call, size_t n, const unsigned reference[],
                           const int order[], const double value[]) {
  if (!hx_call_is_legal_with(instance, call, n, reference, value) ||
      !hx_call_has_arrays(instance, call, n, order, order))
    return 0;
  for (size_t i = 0; i < n; i++)
    if (order[i] != 1) {
      hx_log(instance, HX_LOG_ERROR, "%s: got order %d, expected 1; nothing was done",
             name_of(instance, call), order[i]);
      return 0;
    }
  return 1;
}

int hx_call_not_offered(hxInstance *instance, const char *name) {
  if (instance)
    hx_log(instance, HX_LOG_ERROR,
           "%s: got a call, expected none, as the model description does not offer it", name);
  return HX_REPLY_ERROR;
}

int hx_call_no_variables(hxInstance *instance, const char *name, size_t n) {
  if (instance && n == 0) return HX_REPLY_OK;
  if (instance)
    hx_log(instance, HX_LOG_ERROR,
           "%s: got %zu variables, expected none, as this FMU has none of this type", name, n);
  return HX_REPLY_ERROR;
}

/* ----------------------------------------------------------------------------------------------
 * modes and log */

int hx_call_log_select(hxInstance *instance, int on, size_t n, const char *const category[]) {
  if (!hx_call_is_legal_with(instance, HX_SET_DEBUG_LOGGING, n, category, category))
    return HX_REPLY_ERROR;
  return hx_reply(
      hx_log_select(instance, name_of(instance, HX_SET_DEBUG_LOGGING), on, n, category));
}

int hx_call_set_experiment(hxInstance *instance, int tolerance_defined, double tolerance,
                           double start, int stop_defined, double stop) {
  if (!hx_call_is_legal(instance, HX_SET_UP)) return HX_REPLY_ERROR;
  const char *name = name_of(instance, HX_SET_UP);
  if (hx_instance_set_experiment(instance, name, start, stop_defined, stop) != HX_OK)
    return HX_REPLY_ERROR;
  return hx_instance_check_tolerance(instance, name, tolerance_defined, tolerance)
             ? HX_REPLY_OK
             : HX_REPLY_WARNING;
}

int hx_call_enter_mode(hxInstance *instance, hxCall call, hxMode mode) {
  if (!hx_call_is_legal(instance, call)) return HX_REPLY_ERROR;
  instance->state.mode = (int)mode;
  return HX_REPLY_OK;
}

int hx_call_enter_event_mode(hxInstance *instance) {
  if (!hx_call_is_legal(instance, HX_ENTER_EVENT_MODE)) return HX_REPLY_ERROR;
  if (instance->state.mode == HX_MODE_STEP && !instance->uses_event_mode) {
    hx_log(instance, HX_LOG_ERROR,
           "%s: got a call, expected none, as there are no events or eventModeUsed was false; "
           "nothing was changed",
           name_of(instance, HX_ENTER_EVENT_MODE));
    return HX_REPLY_ERROR;
  }
  instance->state.mode = HX_MODE_EVENT;
  return HX_REPLY_OK;
}

int hx_call_exit_initialization(hxInstance *instance) {
  if (!hx_call_is_legal(instance, HX_EXIT_INITIALIZATION) ||
      hx_instance_initialize(instance) != HX_OK)
    return HX_REPLY_ERROR;
  const int events = instance->uses_event_mode || instance->state.interface == HX_MODEL_EXCHANGE;
  instance->state.mode = events ? HX_MODE_EVENT : HX_MODE_STEP;
  hx_log(instance, HX_LOG_EVENT, "initialized at %.17g s", hx_instance_time(instance));
  return HX_REPLY_OK;
}

int hx_call_terminate(hxInstance *instance) {
  if (!hx_call_is_legal(instance, HX_TERMINATE)) return HX_REPLY_ERROR;
  if (instance->state.mode != HX_MODE_TERMINATED)
    hx_log(instance, HX_LOG_EVENT, "terminated at %.17g s", hx_instance_time(instance));
  instance->state.mode = HX_MODE_TERMINATED;
  return HX_REPLY_OK;
}

int hx_call_reset(hxInstance *instance) {
  if (!hx_call_is_legal(instance, HX_RESET)) return HX_REPLY_ERROR;
  hx_instance_reset(instance);
  return HX_REPLY_OK;
}

/* ----------------------------------------------------------------------------------------------
 * saved states */

int hx_call_save(hxInstance *instance, void **block) {
  if (!hx_call_is_legal_with(instance, HX_GET_STATE, 1, block, block)) return HX_REPLY_ERROR;
  return hx_reply(hx_instance_save(instance, block));
}

int hx_call_restore(hxInstance *instance, const void *block) {
  if (!hx_call_is_legal_with(instance, HX_SET_STATE, 1, block, block)) return HX_REPLY_ERROR;
  return hx_reply(hx_instance_restore(instance, block));
}

int hx_call_free_state(hxInstance *instance, void **block) {
  if (!hx_call_is_legal(instance, HX_FREE_STATE)) return HX_REPLY_ERROR;
  if (block) {
    free(*block);
    *block = NULL;
  }
  return HX_REPLY_OK;
}

int hx_call_state_size(hxInstance *instance, const void *block, size_t *size) {
  if (!hx_call_is_legal_with(instance, HX_STATE_SIZE, 1, block, size)) return HX_REPLY_ERROR;
  *size = hx_instance_state_size();
  return HX_REPLY_OK;
}

int hx_call_serialize(hxInstance *instance, void *block, void *bytes, size_t n) {
  if (!hx_call_is_legal_with(instance, HX_SERIALIZE, 1, block, bytes)) return HX_REPLY_ERROR;
  return hx_reply(
      hx_instance_serialize(instance, name_of(instance, HX_SERIALIZE), block, bytes, n));
}

int hx_call_deserialize(hxInstance *instance, const void *bytes, size_t n, void **block) {
  if (!hx_call_is_legal_with(instance, HX_DESERIALIZE, 1, bytes, block)) return HX_REPLY_ERROR;
  return hx_reply(hx_instance_deserialize(instance, bytes, n, block));
}

/* ----------------------------------------------------------------------------------------------
 * events and model exchange */

int hx_call_update(hxInstance *instance, int *states_changed) {
  *states_changed = 0;
  if (!hx_call_is_legal(instance, HX_UPDATE)) return HX_REPLY_ERROR;
  if (instance->state.interface == HX_CO_SIMULATION) return HX_REPLY_OK;
  return hx_reply(hx_instance_update(instance, states_changed));
}

int hx_call_completed_step(hxInstance *instance) {
  if (!hx_call_is_legal(instance, HX_COMPLETED_STEP)) return HX_REPLY_ERROR;
  return hx_reply(hx_instance_completed_step(instance));
}

int hx_call_set_time(hxInstance *instance, double t) {
  if (!hx_call_is_legal(instance, HX_SET_TIME)) return HX_REPLY_ERROR;
  return hx_reply(hx_instance_set_time(instance, t));
}

int hx_call_set_states(hxInstance *instance, const double x[], size_t n) {
  if (!hx_call_is_legal_with(instance, HX_SET_STATES, n, x, x)) return HX_REPLY_ERROR;
  return hx_reply(hx_instance_set_states(instance, x, n));
}

int hx_call_get_row(hxInstance *instance, hxCall call, hxGetter *getter, double value[], size_t n) {
  if (!hx_call_is_legal_with(instance, call, n, value, value)) return HX_REPLY_ERROR;
  return hx_reply(getter(instance, value, n));
}
