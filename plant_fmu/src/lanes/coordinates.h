/* coordinates.h - conversion between a motion of bodies and minimal coordinates: the torso's
 * state, joint angles and speeds, and their rates */
#ifndef HX_COORDINATES_H
#define HX_COORDINATES_H

#include "work.h"

/* Copies one joint's column of a [leg][joint] table into slots. */
static inline void gather_joint(const hxNumber (*table)[HX_JOINTS], int joint,
                                hxNumber slots[HX_SLOTS]) {
  for (int leg = 0; leg < HX_LEGS; ++leg) slots[leg] = table[leg][joint];
  hx_fill_slots(slots);
}

/* Copies the lanes of one joint into its column of a [leg][joint] table. */
static inline void scatter_joint(hxReal x, int joint, int slot, hxNumber (*table)[HX_JOINTS]) {
  for (int lane = 0; lane < HX_LANES && slot + lane < HX_LEGS; ++lane)
    table[slot + lane][joint] = hx_lane(x, lane);
}

/* Places a link on its joint: q_Wj = q_Wi q_i0 q_0j, the last by q about the child's z, w_j = w_i +
 * qd s; r_j and v_j follow from the joint's point, which both bodies share. */
static inline void place_link(const hxModel *model, int joint, int slot, hxReal angle, hxReal speed,
                              hxPlantMotion *motion) {
  const hxJointModel *m = &model->joint[joint];
  const hxReal zero = hx_splat(0.0);
  hxReal sine, cosine;
  hx_lanes_sin_cos(0.5 * angle, &sine, &cosine);
  const hxQuat q_Wi = hx_parent_quat(motion, joint, slot), q_i0 = hx_load_quat(m->q_i0, slot);
  const hxQuat q_W0 = hx_quat_mul(q_Wi, q_i0), q_0j = {cosine, zero, zero, sine};
  hx_store_quat(&motion->link[joint][HX_P], slot, hx_quat_mul(q_W0, q_0j));
  const hxBody i = hx_parent_body(motion, joint, slot);
  const hxMat3 R_Wi = i.R_WB;
  const hxVec3 s = hx_mul(R_Wi, hx_load_vec3(m->s_i, slot)), w_j = hx_add_scaled(i.w, speed, s);
  hx_store_vec3(&motion->link[joint][HX_W], slot, w_j);
  const hxBody j = hx_link_body(motion, joint, slot);
  const hxJointKinematics k = hx_joint_kinematics(m, slot, &i, &j);
  const hxVec3 r_i = hx_parent_vec3(motion, joint, HX_R, slot),
               v_i = hx_parent_vec3(motion, joint, HX_V, slot);
  hx_store_vec3(&motion->link[joint][HX_R], slot, hx_sub3(hx_add3(r_i, k.sP_i), k.sP_j));
  hx_store_vec3(&motion->link[joint][HX_V], slot,
                hx_sub3(hx_add3(v_i, hx_cross(i.w, k.sP_i)), hx_cross(w_j, k.sP_j)));
}

/* Computes the motion of all bodies at these coordinates; joints are satisfied exactly. */
static inline void hx_motion_from_coordinates(const hxModel *model, const hxCoordinates *x,
                                              hxPlantMotion *motion) {
  memset(motion, 0, sizeof *motion);
  memcpy(&motion->torso[HX_R], x->position, sizeof x->position);
  memcpy(&motion->torso[HX_P], x->quaternion, sizeof x->quaternion);
  memcpy(&motion->torso[HX_V], x->velocity, sizeof x->velocity);
  memcpy(&motion->torso[HX_W], x->angular_velocity, sizeof x->angular_velocity);
  motion->actuator_work = x->actuator_work, motion->push_work = x->push_work,
  motion->dissipated = x->dissipated;
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    hxNumber angle[HX_SLOTS], speed[HX_SLOTS];
    gather_joint(x->angle, joint, angle);
    gather_joint(x->speed, joint, speed);
    for (int slot = 0; slot < HX_PACKS * HX_LANES; slot += HX_LANES)
      place_link(model, joint, slot, hx_load(&angle[slot]), hx_load(&speed[slot]), motion);
    for (int i = 0; i < HX_BODY_STATE; ++i) hx_fill_slots(motion->link[joint][i]);
  }
  for (int i = 0; i < 3; ++i) {
    for (int leg = 0; leg < HX_LEGS; ++leg) motion->bristle[i][leg] = x->bristle[leg][i];
    hx_fill_slots(motion->bristle[i]);
  }
}

/* Copies the torso's state, the works and the bristles of a motion, or of its rate. */
static inline void copy_common(const hxPlantMotion *motion, hxCoordinates *x) {
  memcpy(x->position, &motion->torso[HX_R], sizeof x->position);
  memcpy(x->quaternion, &motion->torso[HX_P], sizeof x->quaternion);
  memcpy(x->velocity, &motion->torso[HX_V], sizeof x->velocity);
  memcpy(x->angular_velocity, &motion->torso[HX_W], sizeof x->angular_velocity);
  x->actuator_work = motion->actuator_work, x->push_work = motion->push_work,
  x->dissipated = motion->dissipated;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int i = 0; i < 3; ++i) x->bristle[leg][i] = motion->bristle[i][leg];
}

/* Reads the coordinates of the motion that work was evaluated at. Joints that have drifted are
 * given by their angle and speed. */
static inline void hx_coordinates_of(const hxPlantMotion *motion, const hxWork *work,
                                     hxCoordinates *x) {
  copy_common(motion, x);
  for (int pack = 0; pack < HX_PACKS; ++pack)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxJointWork *k = &work->pack[pack].joint[joint];
      scatter_joint(k->angle, joint, pack * HX_LANES, x->angle);
      scatter_joint(k->speed, joint, pack * HX_LANES, x->speed);
    }
}

/* Computes the rates of the coordinates from dy/dt and the evaluation that gave it. */
static inline void hx_coordinates_rate(const hxPlantMotion *rate, const hxWork *work,
                                       hxCoordinates *dx) {
  copy_common(rate, dx);
  for (int pack = 0; pack < HX_PACKS; ++pack)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxJointWork *k = &work->pack[pack].joint[joint];
      scatter_joint(k->speed, joint, pack * HX_LANES, dx->angle);
      scatter_joint(k->qdd, joint, pack * HX_LANES, dx->speed);
    }
}

#endif
