/* work.c - an extension: instances use a work space of the importer's, see hexapod/shared_work.h.
 */
#include "fmi/instance.h"

#include "hexapod/shared_work.h"

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
