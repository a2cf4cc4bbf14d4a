#include "hexapod/status.h"

const char *hx_status_name(hxStatus status) {
  static const char *const names[] = {
      [HX_OK] = "ok",
      [HX_INVALID_ARGUMENT] = "invalid argument",
      [HX_INVALID_MODEL] = "invalid model",
      [HX_STEP_TOO_SMALL] = "step too small",
      [HX_NOT_FINITE] = "not finite",
      [HX_OUT_OF_MEMORY] = "out of memory",
      [HX_BAD_STATE] = "bad state",
  };
  const unsigned index = (unsigned)status;
  return index < sizeof names / sizeof names[0] ? names[index] : "unknown status";
}
