#include "suspension.h"

#include <math.h>

#include "../plane.h"

/* The matrix exponential in closed form. With sigma = b/2m, omega^2 = k/m and
 * mu^2 = sigma^2 - omega^2:
 *   z(t)  = e^(-sigma t) ((cosh mu t + sigma sinh(mu t)/mu) z + sinh(mu t)/mu z')
 *   z'(t) = e^(-sigma t) (-omega^2 sinh(mu t)/mu z + (cosh mu t - sigma sinh(mu t)/mu) z')
 */
void hx_suspension_discretise(double mass, double damping, double stiffness, double period,
                              hxSuspension *suspension) {
  const double sigma = 0.5 * damping / mass, omega2 = stiffness / mass,
               mu2 = sigma * sigma - omega2;
  const double mu = sqrt(fabs(mu2)), x = mu * period, decay = hx_decay(-sigma * period);
  double even, odd; /* e^(-sigma t) cosh mu t, e^(-sigma t) sinh(mu t)/mu [s] */
  if (mu2 < 0.0) {
    const hxPlane turned = hx_cis(x);
    even = decay * turned.x;
    odd = decay * turned.y / mu;
  } else if (x < 1.0) {
    const double e = hx_growth(x), shrunk = e / (1.0 + e); /* e^x - 1, 1 - e^-x */
    even = decay * (1.0 + 0.5 * e * shrunk);
    odd = decay * (x > 0.0 ? 0.5 * (e + shrunk) / mu : period);
  } else { /* strongly damped: neither exponential may overflow */
    const double slow = hx_decay(-omega2 / (sigma + mu) * period),
                 fast = hx_decay(-(mu + sigma) * period);
    even = 0.5 * (slow + fast);
    odd = 0.5 * (slow - fast) / mu;
  }
  suspension->a[0][0] = even + sigma * odd;
  suspension->a[0][1] = odd;
  suspension->a[1][0] = -omega2 * odd;
  suspension->a[1][1] = even - sigma * odd;
  /* from rest, z approaches f/k as a released spring moves from its deflection to rest */
  suspension->b[0] = (1.0 - suspension->a[0][0]) / stiffness;
  suspension->b[1] = odd / mass;
}
