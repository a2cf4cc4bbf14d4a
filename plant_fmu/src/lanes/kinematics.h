/* kinematics.h - kinematics of bodies and joints, and the constraint equations, of one pack of
 * legs */
#ifndef HX_KINEMATICS_H
#define HX_KINEMATICS_H

#include "spatial.h"

/* Orientation and angular velocity of a body, world axes; the torso is the same in every lane. */
typedef struct {
  hxMat3 R_WB; /* body axes to world axes; its columns x, y, z are the body's axes */
  hxVec3 w;    /* angular velocity */
} hxBody;

/* Geometry of the joint between parent i and child j, world axes unless stated otherwise. */
typedef struct {
  hxVec3 s;          /* joint axis, fixed in the parent */
  hxReal sx, sy, sz; /* s in the child's axes (a, b, their normal): (0, 0, 1) without drift */
  hxVec3 sP_i, sP_j; /* point_i and point_j in world axes */
} hxJointKinematics;

/* Phi (eq. 4) and dPhi/dt = D v (eq. 2): rows 1-3, rows 4-5. */
typedef struct {
  hxVec3 phi_lin, dphi_lin;
  hxReal phi[2], dphi[2];
} hxConstraint;

/* These functions read vectors, quaternions and orientations of the torso and of links. */
static inline hxVec3 hx_torso_vec3(const hxPlantMotion *motion, int row) {
  return hx_splat_vec3(&motion->torso[row]);
}
static inline hxVec3 hx_link_vec3(const hxPlantMotion *motion, int joint, int row, int slot) {
  return hx_load_vec3(&motion->link[joint][row], slot);
}
static inline hxQuat hx_torso_quat(const hxPlantMotion *motion) {
  return hx_splat_quat(&motion->torso[HX_P]);
}
static inline hxQuat hx_link_quat(const hxPlantMotion *motion, int joint, int slot) {
  return hx_load_quat(&motion->link[joint][HX_P], slot);
}

static inline hxBody hx_torso_body(const hxPlantMotion *motion) {
  return (hxBody){hx_rotation_matrix(hx_torso_quat(motion)), hx_torso_vec3(motion, HX_W)};
}

static inline hxBody hx_link_body(const hxPlantMotion *motion, int joint, int slot) {
  return (hxBody){hx_rotation_matrix(hx_link_quat(motion, joint, slot)),
                  hx_link_vec3(motion, joint, HX_W, slot)};
}

/* The parent of a joint is the link before it, or the torso. */
static inline hxVec3 hx_parent_vec3(const hxPlantMotion *motion, int joint, int row, int slot) {
  return joint > 0 ? hx_link_vec3(motion, joint - 1, row, slot) : hx_torso_vec3(motion, row);
}

static inline hxQuat hx_parent_quat(const hxPlantMotion *motion, int joint, int slot) {
  return joint > 0 ? hx_link_quat(motion, joint - 1, slot) : hx_torso_quat(motion);
}

static inline hxBody hx_parent_body(const hxPlantMotion *motion, int joint, int slot) {
  return joint > 0 ? hx_link_body(motion, joint - 1, slot) : hx_torso_body(motion);
}

/* Computes sine and cosine of half the joint angle q from q_0j = conj(q_Wi q_i0) q_Wj: its
 * component along the axis, the child's z, and its real part. */
static inline void hx_joint_half_angle(const hxJointModel *model, int slot, hxQuat q_Wi,
                                       hxQuat q_Wj, hxReal *sine, hxReal *cosine) {
  const hxQuat q_W0 = hx_quat_mul(q_Wi, hx_load_quat(model->q_i0, slot));
  *sine = q_W0.w * q_Wj.z - q_W0.z * q_Wj.w - q_W0.x * q_Wj.y + q_W0.y * q_Wj.x;
  *cosine = q_W0.w * q_Wj.w + q_W0.x * q_Wj.x + q_W0.y * q_Wj.y + q_W0.z * q_Wj.z;
}

/* Computes the axis and the points of a joint from the orientations of parent and child. */
static inline hxJointKinematics hx_joint_kinematics(const hxJointModel *model, int slot,
                                                    const hxBody *i, const hxBody *j) {
  const hxMat3 *R_Wi = &i->R_WB, *R_Wj = &j->R_WB;
  const hxVec3 s = hx_mul(*R_Wi, hx_load_vec3(model->s_i, slot));
  return (hxJointKinematics){s,
                             hx_dot(R_Wj->x, s),
                             hx_dot(R_Wj->y, s),
                             hx_dot(R_Wj->z, s),
                             hx_mul(*R_Wi, hx_load_vec3(model->point_i, slot)),
                             hx_mul(*R_Wj, hx_load_vec3(model->point_j, slot))};
}

/* Computes Phi = (r_j + s_j^P - r_i - s_i^P, a.s, b.s) and its rate; rows 4 and 5 of the rate are
 * (a x s).(w_j - w_i) and (b x s).(w_j - w_i). */
static inline hxConstraint hx_joint_constraint(const hxModel *model, const hxPlantMotion *motion,
                                               int joint, int slot) {
  const hxBody i = hx_parent_body(motion, joint, slot), j = hx_link_body(motion, joint, slot);
  const hxVec3 r_i = hx_parent_vec3(motion, joint, HX_R, slot),
               v_i = hx_parent_vec3(motion, joint, HX_V, slot);
  const hxJointKinematics k = hx_joint_kinematics(&model->joint[joint], slot, &i, &j);
  const hxMat3 R_Wj = j.R_WB;
  const hxVec3 w_ij_j = hx_tmul(R_Wj, hx_sub3(j.w, i.w)); /* child's axes */
  const hxVec3 v_j = hx_link_vec3(motion, joint, HX_V, slot);
  return (hxConstraint){
      .phi_lin =
          hx_sub3(hx_add3(hx_link_vec3(motion, joint, HX_R, slot), k.sP_j), hx_add3(r_i, k.sP_i)),
      .dphi_lin = hx_sub3(hx_add3(v_j, hx_cross(j.w, k.sP_j)), hx_add3(v_i, hx_cross(i.w, k.sP_i))),
      .phi = {k.sx, k.sy},
      .dphi = {k.sy * w_ij_j.z - k.sz * w_ij_j.y, k.sz * w_ij_j.x - k.sx * w_ij_j.z}};
}

/* Projects a link onto its joint. The smallest rotation q_WV aligns the child's z with the axis, a
 * translation restores the joint's point, and velocities keep only the rotation about the axis. */
static inline void project_link(const hxModel *model, int joint, int slot, hxPlantMotion *motion) {
  const hxBody i = hx_parent_body(motion, joint, slot), drifted = hx_link_body(motion, joint, slot);
  const hxVec3 r_i = hx_parent_vec3(motion, joint, HX_R, slot),
               v_i = hx_parent_vec3(motion, joint, HX_V, slot);
  const hxMat3 R_Wi = i.R_WB;
  const hxVec3 s = hx_mul(R_Wi, hx_load_vec3(model->joint[joint].s_i, slot)), z = drifted.R_WB.z;
  const hxReal twice = 1.0 + hx_dot(z, s), scale = 1.0 / hx_sqrt(2.0 * twice);
  const hxVec3 u = hx_scale(scale, hx_cross(z, s));
  const hxQuat q_WV = {scale * twice, u.x, u.y, u.z}, q_Vj = hx_link_quat(motion, joint, slot);
  hx_store_quat(&motion->link[joint][HX_P], slot, hx_quat_mul(q_WV, q_Vj));
  const hxVec3 w_j = hx_add_scaled(i.w, hx_dot(s, hx_sub3(drifted.w, i.w)), s);
  hx_store_vec3(&motion->link[joint][HX_W], slot, w_j);
  const hxBody j = hx_link_body(motion, joint, slot);
  const hxJointKinematics k = hx_joint_kinematics(&model->joint[joint], slot, &i, &j);
  hx_store_vec3(&motion->link[joint][HX_R], slot, hx_sub3(hx_add3(r_i, k.sP_i), k.sP_j));
  hx_store_vec3(&motion->link[joint][HX_V], slot,
                hx_sub3(hx_add3(v_i, hx_cross(i.w, k.sP_i)), hx_cross(w_j, k.sP_j)));
}

/* Projects all links onto their joints, hip to foot. */
static inline void hx_project(const hxModel *model, hxPlantMotion *motion) {
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int slot = 0; slot < HX_PACKS * HX_LANES; slot += HX_LANES)
      project_link(model, joint, slot, motion);
}

#endif
