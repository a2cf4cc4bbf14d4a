/* kernel.c - chooses the kernel of this processor, and divides a plant's work space */
#include "kernel.h"

#include <stddef.h>
#include <stdint.h>

#include "hexapod/message.h"
#include "hexapod/shared_work.h"
#include "tangent.h"

const hxKernel *const hx_kernels[] = {
#if HX_HAS_X86_KERNELS
    &hx_kernel_avx512,
    &hx_kernel_avx2,
#endif
    &hx_kernel_baseline,
    NULL,
};

const hxKernel *hx_kernel(void) {
  const hxKernel *const *kernel = hx_kernels;
  while (!(*kernel)->is_supported()) ++kernel;
  return *kernel;
}

size_t hx_scratch_size(void) {
  size_t size = hx_derivative_scratch();
  for (const hxKernel *const *kernel = hx_kernels; *kernel; ++kernel)
    if ((*kernel)->scratch > size) size = (*kernel)->scratch;
  return size;
}

_Static_assert((int)HX_WORK_ALIGNMENT == (int)HX_SHARED_WORK_ALIGNMENT,
               "importers and users of hexapod.h allocate the same work space");

/* What a call that fails restores. */
typedef struct {
  hxState state;
  hxFootprint lost[HX_FOOTPRINTS];
} hxBefore;

/* Returns the part of a work space that holds what was before a call, bytes. */
static size_t before_size(void) {
  return sizeof(hxBefore) + hx_shared_work_padding(sizeof(hxBefore));
}

size_t hx_work_size(void) { return before_size() + hx_scratch_size(); }

hxStatus hx_plant_use_work(hxPlant *plant, void *memory, size_t size) {
  unsigned char *own = (unsigned char *)plant + sizeof *plant, *work = memory;
  if (!work) work = own + hx_shared_work_padding((uintptr_t)own);
  if (memory && (size < hx_work_size() || hx_shared_work_padding((uintptr_t)memory))) {
    hx_print(plant->message, HX_MESSAGE_SIZE,
             "work space: got %zu bytes at an address that is %zu bytes above a multiple of %d, "
             "expected at least %zu bytes at a multiple; nothing was changed, allocate aligned "
             "memory of hx_work_size() bytes",
             size, (size_t)((uintptr_t)memory % HX_WORK_ALIGNMENT), HX_WORK_ALIGNMENT,
             hx_work_size());
    return HX_INVALID_ARGUMENT;
  }
  hxBefore *before = (hxBefore *)(void *)work;
  plant->state_before = &before->state;
  plant->footprints.lost = before->lost;
  plant->scratch = work + before_size();
  return HX_OK;
}
