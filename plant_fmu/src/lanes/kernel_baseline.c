/* kernel_baseline.c - the physics on lanes for any processor: two legs at a time, or one where the
 * compiler has no vectors */
#include "../kernel.h"

#include "entry_points.h"

static int anywhere(void) { return 1; }

const hxKernel hx_kernel_baseline = HX_KERNEL_TABLE("baseline", anywhere);
