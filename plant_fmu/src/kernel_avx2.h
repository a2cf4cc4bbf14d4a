/* kernel_avx2.h - whether the compiler can build the AVX2 kernel beside the baseline */
#ifndef HX_KERNEL_AVX2_H
#define HX_KERNEL_AVX2_H

#if defined(__GNUC__) && defined(__x86_64__) && !defined(HX_BASELINE_ONLY)
#define HX_HAS_AVX2_KERNEL 1
extern const struct hxKernel hx_kernel_avx2;
#else
#define HX_HAS_AVX2_KERNEL 0
#endif

#endif
