/* bodies.c - states of all bodies from the joints' angles, and from and to the plant's motion;
 * models/kinematics.py is the readable form */
#include <string.h>

#include "../elementary.h"
#include "robot.h"

/* Computes the child's state from the parent's: q_WL = q_WP q_P0 q_0L(angle), 0 the child's axes at
 * angle 0; velocities by rigid-body motion. */
static void place_child(const hxDefinition *d, int leg, int joint,
                        const double parent[HX_BODY_STATE], double child[HX_BODY_STATE]) {
  const hxLink *link = &d->leg[leg].link[joint];
  const double half = 0.5 * d->initial.angle[leg][joint], speed = d->initial.speed[leg][joint];
  const double *q_WP = parent + HX_P;
  double s_L[3], q_P0[4], q_W0[4], q_WL[4], s[3], point_P[3], point_L[3], sP_i[3], sP_j[3],
      dsP_i[3], dsP_j[3], sine, cosine;
  hx_vector_normalise(link->axis, 3, s_L);
  hx_sin_cos(half, &sine, &cosine);
  const double q_0L[4] = {cosine, sine * s_L[0], sine * s_L[1], sine * s_L[2]};
  hx_zero_turn(d, leg, joint, q_P0);
  hx_quaternion_product(q_WP, q_P0, q_W0);
  hx_quaternion_product(q_W0, q_0L, q_WL);
  hx_vector_normalise(q_WL, 4, child + HX_P);
  hx_vector_rotate(child + HX_P, s_L, s);
  hx_joint_on_parent(d, leg, joint, point_P);
  hx_vector_rotate(q_WP, point_P, sP_i);
  for (int i = 0; i < 3; ++i) point_L[i] = -link->com[i];
  hx_vector_rotate(child + HX_P, point_L, sP_j);
  hx_vector_cross(parent + HX_W, sP_i, dsP_i);
  for (int i = 0; i < 3; ++i) child[HX_W + i] = parent[HX_W + i] + speed * s[i];
  hx_vector_cross(child + HX_W, sP_j, dsP_j);
  for (int i = 0; i < 3; ++i) {
    child[HX_R + i] = parent[HX_R + i] + sP_i[i] - sP_j[i];
    child[HX_V + i] = parent[HX_V + i] + dsP_i[i] - dsP_j[i];
  }
}

void hx_initial_bodies(const hxDefinition *d, double body[HX_BODIES][HX_BODY_STATE]) {
  for (int i = 0; i < 3; ++i) {
    body[0][HX_R + i] = d->initial.position[i];
    body[0][HX_V + i] = d->initial.velocity[i];
    body[0][HX_W + i] = d->initial.angular_velocity[i];
  }
  hx_vector_normalise(d->initial.quaternion, 4, &body[0][HX_P]);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double *parent = body[0];
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      double *child = body[1 + HX_JOINTS * leg + joint];
      place_child(d, leg, joint, parent, child);
      parent = child;
    }
  }
}

void hx_motion_from_bodies(const hxModel *model, const double body[HX_BODIES][HX_BODY_STATE],
                           hxPlantMotion *motion) {
  memcpy(motion->torso, body[0], sizeof motion->torso);
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    double (*to)[HX_SLOTS] = motion->link[joint];
    for (int leg = 0; leg < HX_LEGS; ++leg) {
      const double *from = body[1 + HX_JOINTS * leg + joint], *q_WL = from + HX_P;
      double q_Lj[4], q_Wj[4];
      for (int i = 0; i < 4; ++i) q_Lj[i] = model->joint[joint].q_Lj[i][leg];
      hx_quaternion_product(q_WL, q_Lj, q_Wj);
      for (int i = 0; i < HX_BODY_STATE; ++i) to[i][leg] = from[i];
      for (int i = 0; i < 4; ++i) to[HX_P + i][leg] = q_Wj[i];
    }
    for (int i = 0; i < HX_BODY_STATE; ++i) hx_fill_slots(to[i]);
  }
}

void hx_bodies_from_motion(const hxModel *model, const hxPlantMotion *motion,
                           double body[HX_BODIES][HX_BODY_STATE]) {
  memcpy(body[0], motion->torso, sizeof motion->torso);
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int leg = 0; leg < HX_LEGS; ++leg) {
      double *to = body[1 + HX_JOINTS * leg + joint], *q_Wj = to + HX_P;
      double q_Lj[4], q_jL[4], q_WL[4];
      for (int i = 0; i < HX_BODY_STATE; ++i) to[i] = motion->link[joint][i][leg];
      for (int i = 0; i < 4; ++i) q_Lj[i] = model->joint[joint].q_Lj[i][leg];
      hx_quaternion_conjugate(q_Lj, q_jL);
      hx_quaternion_product(q_Wj, q_jL, q_WL);
      memcpy(to + HX_P, q_WL, sizeof q_WL);
    }
}
