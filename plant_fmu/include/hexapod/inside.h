/* inside.h - compiler settings and symbol visibility of the library's own files. Users of
 * hexapod.h do not need it. */
#ifndef HEXAPOD_INSIDE_H
#define HEXAPOD_INSIDE_H

/* No fused multiply-add: a*b + c rounds twice on every machine, so that results are identical. */
#if defined(__clang__)
#pragma clang fp contract(off)
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

/* Declarations between these two macros are hidden from users of the library. They are empty where
 * a compiler exports only what is marked. */
#if defined(__GNUC__) && !defined(_WIN32)
#define HX_HIDDEN_BEGIN _Pragma("GCC visibility push(hidden)")
#define HX_HIDDEN_END _Pragma("GCC visibility pop")
#else
#define HX_HIDDEN_BEGIN
#define HX_HIDDEN_END
#endif

/* Functions that few robots, grounds and periods need stay out of line, so that the rest costs the
 * same with and without them. */
#if defined(__GNUC__)
#define HX_RARE static __attribute__((noinline, unused))
#else
#define HX_RARE static
#endif

#endif
