/* check.h - assertions of the native tests: CHECK a condition, NEAR a number. */
#ifndef HX_TESTS_CHECK_H
#define HX_TESTS_CHECK_H

#include <math.h>
#include <stdio.h>

static int failures;

static inline void check(int holds, const char *what, const char *file, int line) {
  if (holds) return;
  fprintf(stderr, "%s:%d: not so: %s\n", file, line, what);
  ++failures;
}

static inline void near(double got, double expected, double tolerance, const char *what,
                        const char *file, int line) {
  if (fabs(got - expected) <= tolerance) return;
  fprintf(stderr, "%s:%d: %s: got %.17g, expected %.17g within %g\n", file, line, what, got,
          expected, tolerance);
  ++failures;
}

#define CHECK(condition) check((condition) != 0, #condition, __FILE__, __LINE__)
#define NEAR(got, expected, tolerance) near(got, expected, tolerance, #got, __FILE__, __LINE__)

#endif
