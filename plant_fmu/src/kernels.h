/* kernels.h - the kernels there are: whether the compiler can build those of wider instruction sets
 * beside the baseline */
#ifndef HX_KERNELS_H
#define HX_KERNELS_H

#include "kernel.h"

HX_HIDDEN_BEGIN

extern const hxKernel hx_kernel_baseline;

/* not by GCC for Windows, which aligns the stack to 16 bytes and then stores wider vectors there as
 * if aligned (its bug 54412) */
#if defined(__GNUC__) && defined(__x86_64__) && !defined(HX_BASELINE_ONLY) &&                      \
    (defined(__clang__) || !defined(_WIN32))
#define HX_HAS_X86_KERNELS 1
extern const hxKernel hx_kernel_avx2, hx_kernel_avx512;
#else
#define HX_HAS_X86_KERNELS 0
#endif

HX_HIDDEN_END

#endif
