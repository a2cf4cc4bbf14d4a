/* status.h - status codes of the plant and the controller, and the checksum of saved states. */
#ifndef HEXAPOD_STATUS_H
#define HEXAPOD_STATUS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* HX_SHARED: the plant is a shared library of its own; users define it as well. */
#if defined(HX_SHARED) && !defined(_WIN32)
#define HX_API __attribute__((visibility("default")))
#elif defined(HX_SHARED)
#define HX_API __declspec(dllexport)
#elif defined(__GNUC__) && !defined(_WIN32)
#define HX_API                                                                                     \
  __attribute__((visibility("hidden"))) /* hidden: the plant is compiled into another library and  \
                                           stays out of its symbols */
#else
#define HX_API
#endif

enum { HX_MESSAGE_SIZE = 512 };

/* Result of a call. The list is closed; messages say what was got, what was expected and how to
 * fix it. */
typedef enum hxStatus {
  HX_OK = 0,
  HX_INVALID_ARGUMENT, /* a value is outside its range or not finite; nothing changed */
  HX_INVALID_MODEL,    /* the definition describes no possible robot; nothing changed */
  HX_STEP_TOO_SMALL,   /* the error control needs a step below its minimum */
  HX_NOT_FINITE,       /* the motion is not finite any more */
  HX_OUT_OF_MEMORY,
  HX_BAD_STATE /* a saved state is damaged or of another version; nothing changed */
} hxStatus;

/* Returns the version of the library, for example "1.2.3". */
HX_API const char *hx_version(void);
/* Returns the name of a status, for example "invalid argument". */
HX_API const char *hx_status_name(hxStatus status);

/* Returns a checksum of n bytes, the same on every machine. seed: the checksum of the preceding
 * bytes, or 0. */
HX_API uint64_t hx_checksum(uint64_t seed, const void *bytes, size_t n);

#ifdef __cplusplus
}
#endif
#endif
