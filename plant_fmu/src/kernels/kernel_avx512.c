/* kernel_avx512.c - the physics with all legs in one pack, for AVX-512 */
#include "../kernel.h"

#if HX_HAS_X86_KERNELS

/* The pragmas enable AVX-512 without compiler options, so that an importer who compiles the
 * sources by a plain call gets it too. */
#include <immintrin.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx512f,avx512dq,avx512vl"))),                 \
                             apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx512f,avx512dq,avx512vl")
#endif

#define HX_LANES 8

#include "entry_points.h"

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

static int has_avx512(void) {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
         __builtin_cpu_supports("avx512vl");
}

const hxKernel hx_kernel_avx512 = HX_KERNEL_TABLE("avx512", has_avx512);

#else
typedef int hx_no_avx512_kernel; /* ISO C forbids an empty file */
#endif
