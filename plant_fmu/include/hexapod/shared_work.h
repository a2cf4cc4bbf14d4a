/* shared_work.h - an extension of the FMU's binary for importers that step many instances: those
 * that one thread calls in turn can share a work space.
 *
 * Two thirds of an instance's memory are a work space that carries nothing from one call to the
 * next. Each instance has its own. Instances that use one that the caller lends them leave it in
 * the processor's fastest memory for the next one. Results and saved states have the same bits.
 *
 * Importers look the functions up by name and do without them where a binary has none. They serve
 * instances of both versions of FMI, in any mode.
 *
 * Ownership: the caller allocates and frees the memory. An instance uses it in all later calls, but
 * never frees it, reads nothing from it that an earlier call has left, and keeps its address
 * outside of saved states. The memory must live until each of its instances uses another one or is
 * freed.
 *
 * Threads: two calls must not use the same memory at the same time. One thread may call all
 * instances with one memory, or lend each instance its own memory just before it calls it.
 */
#ifndef HEXAPOD_SHARED_WORK_H
#define HEXAPOD_SHARED_WORK_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { HX_SHARED_WORK_ALIGNMENT = 64 }; /* B  of the memory's address */

/* Returns the bytes from an address to the next one at which a work space may begin. */
static inline size_t hx_shared_work_padding(uintptr_t address) {
  return (size_t)((0 - address) % HX_SHARED_WORK_ALIGNMENT);
}

/* hx_shared_work_size: returns the size of a work space, B; 0: instances have none. */
typedef size_t hxSharedWorkSize(void);

/* hx_shared_work_use: makes an instance use the memory of `size` bytes; NULL: its own again.
 * Returns 0, or another number when the instance is NULL or has no work space, or when the memory
 * is too small or not aligned: then nothing changes and the instance logs why. */
typedef int hxSharedWorkUse(void *instance, void *memory, size_t size);

#ifdef __cplusplus
}
#endif
#endif
