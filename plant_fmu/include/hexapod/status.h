/* status.h - what a call of the plant or of the controller came to, and how bytes are told from
 * damaged ones. */
#ifndef HEXAPOD_STATUS_H
#define HEXAPOD_STATUS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* HX_SHARED: the plant is a shared library of its own, here and where it is used. */
#if defined(HX_SHARED) && !defined(_WIN32)
#define HX_API __attribute__((visibility("default")))
#elif defined(HX_SHARED)
#define HX_API __declspec(dllexport)
#elif defined(__GNUC__) && !defined(_WIN32)
#define HX_API                                                                                     \
  __attribute__((                                                                                  \
      visibility("hidden"))) /* compiled into something else: not among that one's symbols */
#else
#define HX_API
#endif

enum { HX_MESSAGE_SIZE = 512 };

/* What a call came to. The list is closed; the message says got, expected, fix. */
typedef enum hxStatus {
  HX_OK = 0,
  HX_INVALID_ARGUMENT,  /* a value outside its range, or not finite; nothing changed */
  HX_INVALID_MODEL,     /* a definition no robot can have; nothing changed */
  HX_STEP_TOO_SMALL,    /* the error control asks for a step below its floor */
  HX_NOT_FINITE,        /* the motion has left the numbers */
  HX_OUT_OF_MEMORY,
  HX_BAD_STATE          /* a saved state that is damaged or of another version; nothing changed */
} hxStatus;

HX_API const char *hx_version(void);
HX_API const char *hx_status_name(hxStatus status);

/* A number that tells damaged bytes from intact ones, on every machine the same; seed: of what came
 * before, or 0. */
HX_API uint64_t hx_checksum(uint64_t seed, const void *bytes, size_t n);

#ifdef __cplusplus
}
#endif
#endif
