/* frames.c - vectors, quaternions and the frames of joints, while a definition is compiled;
 * models/kinematics.py is the readable form */
#include "robot.h"

#include <math.h>

#include "../elementary.h"

void hx_vector_cross(const double a[3], const double b[3], double out[3]) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

double hx_vector_normalise(const double *a, int n, double *out) {
  double norm = 0.0;
  for (int i = 0; i < n; ++i) norm += a[i] * a[i];
  norm = sqrt(norm);
  for (int i = 0; i < n; ++i) out[i] = a[i] / norm;
  return norm;
}

void hx_quaternion_product(const double a[4], const double b[4], double out[4]) {
  out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
  out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
}

void hx_vector_rotate(const double p[4], const double a[3], double out[3]) {
  double t[3], s[3];
  hx_vector_cross(p + 1, a, t);
  hx_vector_cross(p + 1, t, s);
  for (int i = 0; i < 3; ++i) out[i] = a[i] + 2.0 * (p[0] * t[i] + s[i]);
}

void hx_quaternion_conjugate(const double p[4], double out[4]) {
  out[0] = p[0];
  for (int i = 1; i < 4; ++i) out[i] = -p[i];
}

void hx_link_tip(const hxLink *link, double tip[3]) {
  tip[0] = link->length;
  tip[1] = link->offset_y;
  tip[2] = link->offset_z;
}

void hx_axis_normals(const double axis[3], double a[3], double b[3]) {
  int least = 0;
  for (int i = 1; i < 3; ++i)
    if (fabs(axis[i]) < fabs(axis[least])) least = i;
  double direction[3] = {0.0, 0.0, 0.0}, normal[3];
  direction[least] = 1.0;
  hx_vector_cross(axis, direction, normal);
  hx_vector_normalise(normal, 3, a);
  hx_vector_cross(axis, a, b);
}

void hx_joint_on_parent(const hxDefinition *d, int leg, int joint, double point[3]) {
  if (joint == 0) {
    for (int i = 0; i < 3; ++i) point[i] = d->leg[leg].hip_position[i] - d->torso.com[i];
  } else {
    const hxLink *parent = &d->leg[leg].link[joint - 1];
    hx_link_tip(parent, point);
    for (int i = 0; i < 3; ++i) point[i] -= parent->com[i];
  }
}

void hx_zero_turn(const hxDefinition *d, int leg, int joint, double q_PL[4]) {
  const double half = joint == 0 ? 0.5 * d->leg[leg].hip_yaw : 0.0;
  hx_sin_cos(half, &q_PL[3], &q_PL[0]);
  q_PL[1] = q_PL[2] = 0.0;
}

/* Computes the quaternion of a right-handed frame from its axes, by the largest component
 * (Shepperd). */
static void quat_from_axes(const double x[3], const double y[3], const double z[3], double p[4]) {
  const double squares[4] = {1.0 + x[0] + y[1] + z[2], 1.0 + x[0] - y[1] - z[2],
                             1.0 - x[0] + y[1] - z[2], 1.0 - x[0] - y[1] + z[2]};
  int largest = 0;
  for (int i = 1; i < 4; ++i)
    if (squares[i] > squares[largest]) largest = i;
  const double columns[4][4] = {{squares[0], y[2] - z[1], z[0] - x[2], x[1] - y[0]},
                                {y[2] - z[1], squares[1], y[0] + x[1], x[2] + z[0]},
                                {z[0] - x[2], y[0] + x[1], squares[2], z[1] + y[2]},
                                {x[1] - y[0], x[2] + z[0], z[1] + y[2], squares[3]}};
  hx_vector_normalise(columns[largest], 4, p);
}

void hx_joint_frame(const hxDefinition *d, int leg, int joint, double q_Lj[4]) {
  double s[3], a[3], b[3];
  q_Lj[0] = 1.0, q_Lj[1] = q_Lj[2] = q_Lj[3] = 0.0;
  if (joint < 0) return;
  hx_vector_normalise(d->leg[leg].link[joint].axis, 3, s);
  hx_axis_normals(s, a, b);
  quat_from_axes(a, b, s, q_Lj);
}
