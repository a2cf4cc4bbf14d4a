#include "kernel.h"

#include <stddef.h>

#include "kernel_avx2.h"
#include "kernel_functions.h"

static int anywhere(void) { return 1; }

static const hxKernel baseline = HX_KERNEL_TABLE("baseline", anywhere);

const hxKernel *const hx_kernels[] = {
#if HX_HAS_AVX2_KERNEL
    &hx_kernel_avx2,
#endif
    &baseline,
    NULL,
};

const hxKernel *hx_kernel(void) {
  const hxKernel *const *kernel = hx_kernels;
  while (!(*kernel)->runs_here()) ++kernel;
  return *kernel;
}
