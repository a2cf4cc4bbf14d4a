/* controller_probe.c - exports the controller's internal functions for the tests. */
#include <string.h>

#include "comply/support.h"
#include "sense/health.h"
#include "transcendental.h"

HX_API void hx_probe_transcendental(const double *x, const double *y, double *result[6], int n);
HX_API void hx_probe_shares(const hxPlane feet[HX_LEGS], const double activation[HX_LEGS],
                            const double asked[6], double force[HX_LEGS][3]);

HX_API void hx_probe_unexplained(const double model[5], const double joint[8], double *share);

/* Computes the share of the largest torque that nothing explains. model: stiffness, drag, rotor,
 * largest torque, period; joint: the arguments of `unexplained`. */
void hx_probe_unexplained(const double model[5], const double joint[8], double *share) {
  const hxHealthModel m = {.stiffness = model[0],
                           .drag = model[1],
                           .rotor = model[2],
                           .most = model[3],
                           .period = model[4]};
  *share = unexplained(&m, joint[0], joint[1], joint[2], joint[3], joint[4], joint[5], joint[6],
                       joint[7]);
}

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
