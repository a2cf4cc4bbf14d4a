/* method.h - integration methods as coefficients: explicit Runge-Kutta and linearly implicit
 * Rosenbrock-W methods (eq. 19); the step that their error control takes next, of which
 * models/integrator.py is the readable form */
#ifndef HX_METHOD_H
#define HX_METHOD_H

#include <math.h>

#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

enum { HX_STAGES = 7 };

/*   y_i = y_0 + sum_{j<i} a_ij k_j
 *   (1 - h gamma A_i) k_i = h f(t_0 + c_i h, y_i) + h A_i sum_{j<i} g_ij k_j    gamma = 0: explicit
 *   y_1 = y_0 + sum b_i k_i,   error estimate sum e_i k_i                       e = b - b of the
 * embedded method
 *
 * A_i may be anything that changes by O(h) from stage to stage: order 3 then asks for one condition
 * more than a W-method's, sum b_i c_i (gamma + sum_j g_ij) = 0. */
typedef struct hxMethodRow {
  int stages;
  int order; /* one more than the embedded method's */
  double gamma;
  double a[HX_STAGES][HX_STAGES], g[HX_STAGES][HX_STAGES];
  double c[HX_STAGES], b[HX_STAGES], e[HX_STAGES];
} hxMethodRow;

const hxMethodRow *hx_method(int method); /* NULL for an unknown method */

HX_HIDDEN_END

/* x^(-1/n) for x in about [1e-4, 1e4], in plain arithmetic: the same on every machine. Newton on
 * r^-n = x rises to its root. */
static inline double inverse_root(double x, int n) {
  double r = 0.1, before = 0.0;
  for (int i = 0; i < 100 && r > before; ++i) {
    double power = x;
    for (int k = 0; k < n; ++k) power *= r;
    before = r;
    r += r * (1.0 - power) / n;
  }
  return r;
}

/* Factor by which the step may change, from the error of an attempt: 0.9 error^(-1/n), 0.2 to 5
 * (eq. 23). */
static inline double step_factor(const hxMethodRow *method, double error) {
  const int n = method->order;
  double large = 1.0, small = 1.0;
  for (int i = 0; i < n; ++i) large *= 0.9 / 0.2, small *= 0.9 / 5.0;
  if (!(error < large)) return 0.2;
  if (error < small) return 5.0;
  return 0.9 * inverse_root(error, n);
}

/* Returns the step that may follow one of h, s: h step_factor(), at most `most` and at least
 * `least`. The root is computed only where it decides: where the error shows, beyond rounding, on
 * which side of these limits the step lies, the result is that limit, with the same bits. */
static inline double following_step(const hxMethodRow *method, double error, double h, double most,
                                    double least) {
  const double apart = 1e-9, up = (1.0 + apart) * most / (0.9 * h),
               down = (1.0 - apart) * least / (0.9 * h);
  double beyond_most = error, below_least = error; /* 0.9 error^(-1/n) >= x: error (x/0.9)^n <= 1 */
  for (int i = 0; i < method->order; ++i) beyond_most *= up, below_least *= down;
  if (below_least >= 1.0) return least;
  if (beyond_most <= 1.0 && (1.0 + apart) * most <= 5.0 * h) return fmax(most, least);
  return fmax(fmin(most, h * step_factor(method, error)), least);
}

#endif
