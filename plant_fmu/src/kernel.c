#include "kernel.h"

#include <stddef.h>

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
  size_t size = hx_tangent_scratch();
  for (const hxKernel *const *kernel = hx_kernels; *kernel; ++kernel)
    if ((*kernel)->scratch > size) size = (*kernel)->scratch;
  return size;
}
