/* choice.c - kernel.c with a choice for tests: a build with the probe has it instead of kernel.c */
#define hx_kernel hx_fastest_kernel
#include "../../../plant_fmu/src/kernel.c"
#undef hx_kernel

const hxKernel *hx_kernel(void);

static int first = 0; /* place of the first kernel that may be chosen */

const hxKernel *hx_kernel(void) { return first > 0 ? hx_kernels[first] : hx_fastest_kernel(); }

/* Makes all plants use the i-th kernel, 0: the fastest. Returns its name, or NULL without a change
 * where there is none or the processor does not support it. */
HX_API const char *hx_probe_choose_kernel(int i);

HX_API const char *hx_probe_choose_kernel(int i) {
  for (int k = 0; k <= i; ++k)
    if (!hx_kernels[k]) return NULL;
  if (i > 0 && !hx_kernels[i]->is_supported()) return NULL;
  first = i;
  return hx_kernel()->name;
}
