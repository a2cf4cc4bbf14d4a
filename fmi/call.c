/* call.c - what the functions of both versions of the standard share: the checks of mode, interface
 * and array arguments that precede each call, and the calls that do the same in both. */
#include "fmi/instance.h"

#include <stdlib.h>

/* ----------------------------------------------------------------------------------------------
 * checks */

static const char *mode_name(int mode) {
  if (mode == HX_MODE_INSTANTIATED) return "before initialization mode";
  if (mode == HX_MODE_INITIALIZATION) return "in initialization mode";
  if (mode == HX_MODE_EVENT) return "in event mode";
  if (mode == HX_MODE_CONTINUOUS) return "in continuous-time mode";
  return mode == HX_MODE_STEP ? "between steps" : "after termination";
}

static const char *interface_name(int interface) {
  return interface == HX_MODEL_EXCHANGE ? "model exchange" : "co-simulation";
}

int hx_call_is_legal(hxInstance *instance, const hxCall *call) {
  if (!instance) return 0;
  const hxInstanceState *state = &instance->state;
  if (!(call->interfaces & state->interface))
    hx_log(instance, HX_LOG_ERROR,
           "%s: got a call of %s, expected one of %s, which was instantiated; nothing was changed",
           call->name, interface_name(call->interfaces), interface_name(state->interface));
  else if (!(call->modes & state->mode))
    hx_log(instance, HX_LOG_ERROR,
           "%s: got a call %s, where the standard does not allow it; nothing was changed",
           call->name, mode_name(state->mode));
  else
    return 1;
  return 0;
}

int hx_call_has_arrays(hxInstance *instance, const hxCall *call, size_t n, const void *array,
                       const void *other) {
  if (n == 0 || (array && other)) return 1;
  hx_log(instance, HX_LOG_ERROR, "%s: got NULL, expected an array of %zu; nothing was changed",
         call->name, n);
  return 0;
}

int hx_call_is_legal_with(hxInstance *instance, const hxCall *call, size_t n, const void *array,
                          const void *other) {
  return hx_call_is_legal(instance, call) && hx_call_has_arrays(instance, call, n, array, other);
}

int hx_call_is_first_order(hxInstance *instance, const hxCall *call, size_t n,
                           const unsigned reference[], const int order[], const double value[]) {
  if (!hx_call_is_legal_with(instance, call, n, reference, value) ||
      !hx_call_has_arrays(instance, call, n, order, order))
    return 0;
  for (size_t i = 0; i < n; i++)
    if (order[i] != 1) {
      hx_log(instance, HX_LOG_ERROR, "%s: got order %d, expected 1; nothing was done", call->name,
             order[i]);
      return 0;
    }
  return 1;
}

/* ----------------------------------------------------------------------------------------------
 * values */

hxStatus hx_call_no_variables(hxInstance *instance, const hxCall *call, size_t n,
                              const char *of_type) {
  if (!hx_call_is_legal(instance, call)) return HX_INVALID_ARGUMENT;
  if (n == 0) return HX_OK;
  hx_log(instance, HX_LOG_ERROR, "%s: got %zu variables, expected none, as this FMU has none%s",
         call->name, n, of_type);
  return HX_INVALID_ARGUMENT;
}

/* ----------------------------------------------------------------------------------------------
 * modes and log */

hxStatus hx_call_log_select(hxInstance *instance, const hxCall *call, int on, size_t n,
                            const char *const category[]) {
  if (!hx_call_is_legal_with(instance, call, n, category, category)) return HX_INVALID_ARGUMENT;
  return hx_log_select(instance, call->name, on, n, category);
}

hxStatus hx_call_enter_mode(hxInstance *instance, const hxCall *call, hxMode mode) {
  if (!hx_call_is_legal(instance, call)) return HX_INVALID_ARGUMENT;
  instance->state.mode = (int)mode;
  return HX_OK;
}

hxStatus hx_call_exit_initialization(hxInstance *instance, const hxCall *call) {
  if (!hx_call_is_legal(instance, call) || hx_instance_initialize(instance) != HX_OK)
    return HX_INVALID_ARGUMENT;
  const int events = instance->uses_event_mode || instance->state.interface == HX_MODEL_EXCHANGE;
  instance->state.mode = events ? HX_MODE_EVENT : HX_MODE_STEP;
  hx_log(instance, HX_LOG_EVENT, "initialized at %.17g s", hx_instance_time(instance));
  return HX_OK;
}

hxStatus hx_call_terminate(hxInstance *instance, const hxCall *call) {
  if (!hx_call_is_legal(instance, call)) return HX_INVALID_ARGUMENT;
  if (instance->state.mode != HX_MODE_TERMINATED)
    hx_log(instance, HX_LOG_EVENT, "terminated at %.17g s", hx_instance_time(instance));
  instance->state.mode = HX_MODE_TERMINATED;
  return HX_OK;
}

hxStatus hx_call_reset(hxInstance *instance, const hxCall *call) {
  if (!hx_call_is_legal(instance, call)) return HX_INVALID_ARGUMENT;
  hx_instance_reset(instance);
  return HX_OK;
}

/* ----------------------------------------------------------------------------------------------
 * saved states */

hxStatus hx_call_save(hxInstance *instance, const hxCall *call, void **block) {
  if (!hx_call_is_legal_with(instance, call, 1, block, block)) return HX_INVALID_ARGUMENT;
  return hx_instance_save(instance, block);
}

hxStatus hx_call_restore(hxInstance *instance, const hxCall *call, const void *block) {
  if (!hx_call_is_legal_with(instance, call, 1, block, block)) return HX_INVALID_ARGUMENT;
  return hx_instance_restore(instance, block);
}

hxStatus hx_call_free_state(hxInstance *instance, const hxCall *call, void **block) {
  if (!hx_call_is_legal(instance, call)) return HX_INVALID_ARGUMENT;
  if (block) {
    free(*block);
    *block = NULL;
  }
  return HX_OK;
}

hxStatus hx_call_state_size(hxInstance *instance, const hxCall *call, const void *block,
                            size_t *size) {
  if (!hx_call_is_legal_with(instance, call, 1, block, size)) return HX_INVALID_ARGUMENT;
  *size = hx_instance_state_size();
  return HX_OK;
}

hxStatus hx_call_serialize(hxInstance *instance, const hxCall *call, void *block, void *bytes,
                           size_t n) {
  if (!hx_call_is_legal_with(instance, call, 1, block, bytes)) return HX_INVALID_ARGUMENT;
  return hx_instance_serialize(instance, call->name, block, bytes, n);
}

hxStatus hx_call_deserialize(hxInstance *instance, const hxCall *call, const void *bytes, size_t n,
                             void **block) {
  if (!hx_call_is_legal_with(instance, call, 1, bytes, block)) return HX_INVALID_ARGUMENT;
  return hx_instance_deserialize(instance, bytes, n, block);
}

/* ----------------------------------------------------------------------------------------------
 * model exchange */

hxStatus hx_call_set_time(hxInstance *instance, const hxCall *call, double t) {
  return hx_call_is_legal(instance, call) ? hx_instance_set_time(instance, t) : HX_INVALID_ARGUMENT;
}

hxStatus hx_call_set_states(hxInstance *instance, const hxCall *call, const double x[], size_t n) {
  if (!hx_call_is_legal_with(instance, call, n, x, x)) return HX_INVALID_ARGUMENT;
  return hx_instance_set_states(instance, x, n);
}

hxStatus hx_call_get_row(hxInstance *instance, const hxCall *call, hxGetter *getter, double value[],
                         size_t n) {
  if (!hx_call_is_legal_with(instance, call, n, value, value)) return HX_INVALID_ARGUMENT;
  return getter(instance, value, n);
}
