/* method.h - integration methods as coefficients: explicit Runge-Kutta and linearly implicit
 * Rosenbrock-W methods (eq. 19) */
#ifndef HX_METHOD_H
#define HX_METHOD_H

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
  int order;
  int error_order; /* order of the embedded method; 0: none, fixed step only */
  double gamma;
  double a[HX_STAGES][HX_STAGES], g[HX_STAGES][HX_STAGES];
  double c[HX_STAGES], b[HX_STAGES], e[HX_STAGES];
} hxMethodRow;

const hxMethodRow *hx_method(int method); /* NULL for an unknown method */

HX_HIDDEN_END

#endif
