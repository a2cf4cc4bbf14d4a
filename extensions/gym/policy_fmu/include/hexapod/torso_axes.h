/* torso_axes.h - vectors in torso axes, as environments and policies observe them. */
#ifndef HEXAPOD_TORSO_AXES_H
#define HEXAPOD_TORSO_AXES_H

/* Computes v = R^T u, with the rotation R of the quaternion p = [w x y z], torso to world. */
static inline void hx_torso_axes(const double p[4], const double u[3], double v[3]) {
  const double w = p[0], *q = p + 1;
  const double c[3] = {u[1] * q[2] - u[2] * q[1], u[2] * q[0] - u[0] * q[2],
                       u[0] * q[1] - u[1] * q[0]}; /* u x q */
  const double d[3] = {c[1] * q[2] - c[2] * q[1], c[2] * q[0] - c[0] * q[2],
                       c[0] * q[1] - c[1] * q[0]}; /* (u x q) x q */
  for (int i = 0; i < 3; ++i) v[i] = u[i] + 2.0 * (w * c[i] + d[i]);
}

#endif
