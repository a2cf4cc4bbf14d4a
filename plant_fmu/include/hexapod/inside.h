/* inside.h - how the plant's own files are compiled, whatever an importer's compiler call says. Not
 * for users of hexapod.h. */
#ifndef HEXAPOD_INSIDE_H
#define HEXAPOD_INSIDE_H

/* a*b + c rounds twice on every machine, also on those with fused arithmetic */
#if defined(__clang__)
#pragma clang fp contract(off)
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

/* What is declared between these two stays inside the library; where they are empty nothing is
 * exported unasked. */
#if defined(__GNUC__) && !defined(_WIN32)
#define HX_HIDDEN_BEGIN _Pragma("GCC visibility push(hidden)")
#define HX_HIDDEN_END _Pragma("GCC visibility pop")
#else
#define HX_HIDDEN_BEGIN
#define HX_HIDDEN_END
#endif

#endif
