/* kernel_avx2.c - the physics with four legs per pack, for AVX2 */
#include "../kernel.h"

#if HX_HAS_X86_KERNELS

/* The pragmas enable AVX2 without compiler options, so that an importer who compiles the sources
 * by a plain call gets it too. */
#include <immintrin.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2")
#endif

#define HX_LANES 4

#include "entry_points.h"

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

static int has_avx2(void) { return __builtin_cpu_supports("avx2"); }

const hxKernel hx_kernel_avx2 = HX_KERNEL_TABLE("avx2", has_avx2);

#else
typedef int hx_no_avx2_kernel; /* ISO C forbids an empty file */
#endif
