/* kernel_baseline.c - the physics for any processor: two legs per pack, or one where the compiler
 * has no vector types */
#include "../kernel.h"

#include "entry_points.h"

static int always_available(void) { return 1; }

const hxKernel hx_kernel_baseline = HX_KERNEL_TABLE("baseline", always_available);
