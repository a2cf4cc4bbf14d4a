/* controller_probe.c - exports the controller's internal functions for the tests. */
#include <string.h>

#include "comply/support.h"
#include "transcendental.h"

HX_API void hx_probe_transcendental(const double *x, const double *y, double *result[6], int n);
HX_API void hx_probe_shares(const hxPlane feet[HX_LEGS], const double activation[HX_LEGS],
                            const double asked[6], double force[HX_LEGS][3]);

/* Computes sine, cosine, e^x - 1, tanh x and x^(2/3), and the angle of (y, x). */
void hx_probe_transcendental(const double *x, const double *y, double *result[6], int n) {
  for (int i = 0; i < n; ++i) {
    hx_sine_cosine(x[i], &result[0][i], &result[1][i]);
    result[2][i] = hx_growth(x[i]);
    result[4][i] = hx_two_thirds(x[i]);
  }
  hx_saturations(n, x, result[3]);
  hx_arcs(n, y, x, result[5]);
}

/* Computes the feet's shares. asked: push x y, weight, moment x y, twist. */
void hx_probe_shares(const hxPlane feet[HX_LEGS], const double activation[HX_LEGS],
                     const double asked[6], double force[HX_LEGS][3]) {
  hxDemand demand;
  hxShares shares;
  memset(&demand, 0, sizeof demand);
  demand.push = hx_plane(asked[0], asked[1]);
  demand.weight = asked[2];
  demand.moment = hx_plane(asked[3], asked[4]);
  demand.twist = asked[5];
  memcpy(shares.activation, activation, sizeof shares.activation);
  hx_support_shares(feet, &demand, &shares);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    force[leg][0] = shares.push[leg].x;
    force[leg][1] = shares.push[leg].y;
    force[leg][2] = shares.normal[leg];
  }
}
