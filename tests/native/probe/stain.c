/* stain.c - overwrites the memory that a plant's next call must write before it reads it. */
#include <stddef.h>
#include <string.h>

#include "kernel.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored                                                                     \
    "-Wmissing-prototypes" /* called from Python only: there is no header */
#endif

/* Overwrites the stack that the next call uses, and the plant's work space. */
HX_API void hx_probe_stain(hxPlant *plant, int byte) {
  volatile char stain[300000];
  for (size_t i = 0; i < sizeof stain; ++i) stain[i] = (char)byte;
  memset(plant->scratch, byte, hx_scratch_size());
  memset(plant->state_before, byte, sizeof *plant->state_before);
}
