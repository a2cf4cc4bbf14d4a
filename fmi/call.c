/* call.c - checks of mode, interface and array arguments that precede each call of the standard. */
#include "fmi/instance.h"

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

int hx_call_is_first_order(hxInstance *instance, const hxCall *call, size_t n, const int order[]) {
  for (size_t i = 0; i < n; i++)
    if (order[i] != 1) {
      hx_log(instance, HX_LOG_ERROR, "%s: got order %d, expected 1; nothing was done", call->name,
             order[i]);
      return 0;
    }
  return 1;
}
