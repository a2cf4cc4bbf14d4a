/* stage.h - terms that a stage of a linearly implicit method adds to forces and inertia (eq.
 * 19-21); models/stage.py is the readable form */
#ifndef HX_STAGE_H
#define HX_STAGE_H

#include "forces.h"

/* Stores the derivatives of the forces for all stages of a step. The contact's are taken at the
 * depth expected a step ahead, because a foot that has just touched down has none yet. */
static inline void keep_slopes(const hxModel *model, const hxContactState *contact, int pack,
                               const hxLegWork *leg, hxImplicit *implicit) {
  const hxFootWork *foot = &leg->foot;
  const int slot = pack * HX_LANES;
  const hxReal deeper = foot->kin.delta + implicit->ahead * hx_max(foot->kin.ddelta, hx_splat(0.0));
  const hxNormalForce ahead =
      hx_normal_force(model, hx_load(&contact->closed[slot]), hx_load(&contact->damping[slot]),
                      deeper, foot->kin.ddelta);
  implicit->slope[pack].stiffness = ahead.stiffness;
  implicit->slope[pack].viscosity = ahead.viscosity;
  if (has_bristles(model)) {
    implicit->slope[pack].yield = foot->bristle.yield;
    implicit->slope[pack].bristle =
        ahead.force * foot->bristle.stiffness / (1.0 + implicit->z * foot->bristle.yield);
    implicit->slope[pack].drag =
        ahead.force * foot->bristle.damping + implicit->z * implicit->slope[pack].bristle;
  } else {
    implicit->slope[pack].drag = ahead.force * foot->drag_per_load;
  }
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    implicit->slope[pack].motor_stiffness[joint] = leg->joint[joint].servo.stiffness;
    implicit->slope[pack].motor_damping[joint] = leg->joint[joint].servo.damping;
    implicit->slope[pack].gear_drag[joint] = leg->joint[joint].servo.drag;
    if (model->stops) {
      implicit->slope[pack].stop_stiffness[joint] = leg->joint[joint].stop.stiffness;
      implicit->slope[pack].stop_damping[joint] = leg->joint[joint].stop.damping;
    }
  }
  if (has_turning_friction(model)) {
    implicit->slope[pack].spin = ahead.force * foot->turning.spin;
    implicit->slope[pack].roll = ahead.force * foot->turning.roll;
  }
}

/* Returns the damping of motor, gear and stop together, N m s/rad. */
static inline hxReal joint_damping(const hxModel *model, const hxImplicit *implicit, int pack,
                                   int joint) {
  const hxReal servo =
      implicit->slope[pack].motor_damping[joint] + implicit->slope[pack].gear_drag[joint];
  return model->stops ? servo + implicit->slope[pack].stop_damping[joint] : servo;
}

/* Returns the stiffness of motor and stop together, N m/rad. */
static inline hxReal joint_stiffness(const hxModel *model, const hxImplicit *implicit, int pack,
                                     int joint) {
  const hxReal servo = implicit->slope[pack].motor_stiffness[joint];
  return model->stops ? servo + implicit->slope[pack].stop_stiffness[joint] : servo;
}

/* Returns the moment by which spin and rolling friction resist an angular velocity, per unit of
 * it: spin n n^T + roll (1 - n n^T) (eq. 34). */
static inline hxVec3 turning_drag(const hxImplicit *implicit, int pack, const hxLegWork *leg,
                                  hxVec3 w) {
  const hxReal spin = implicit->slope[pack].spin, roll = implicit->slope[pack].roll;
  const hxVec3 n = leg->foot.kin.normal;
  return hx_add_scaled(hx_scale(roll, w), (spin - roll) * hx_dot(n, w), n);
}

/* Displacement and velocity change of a body without this stage's own acceleration: dx = s_x + z
 * (v + s_v), dv = s_v. */
typedef struct {
  hxMotion6 x, v;
} hxShift;

/* Returns dx and dv of a body with velocity v. */
static inline hxShift shift(double z, hxMotion6 v, hxMotion6 s_x, hxMotion6 s_v) {
  return (hxShift){hx_motion_add_scaled(s_x, hx_splat(z), hx_motion_add(v, s_v)), s_v};
}

/* Returns the shift of a link. */
static inline hxShift link_shift(const hxImplicit *implicit, const hxPlantMotion *motion, int joint,
                                 int slot) {
  const hxPlantMotion *s = &implicit->change->motion;
  const hxMotion6 s_x = {hx_load_vec3(implicit->change->link_turn[joint], slot),
                         hx_link_vec3(s, joint, HX_R, slot)};
  return shift(implicit->z, link_velocity(motion, joint, slot), s_x, link_velocity(s, joint, slot));
}

/* Returns the shift of the torso. */
static inline hxShift torso_shift(const hxImplicit *implicit, const hxPlantMotion *motion) {
  const hxPlantMotion *s = &implicit->change->motion;
  const hxMotion6 s_x = {hx_splat_vec3(implicit->change->torso_turn), hx_torso_vec3(s, HX_R)};
  return shift(implicit->z, torso_velocity(motion), s_x, torso_velocity(s));
}

/* Adds the response of spin and rolling friction to a shift dv of the tibia to p. */
static inline void turning_response(const hxImplicit *implicit, int pack, hxVec3 dw,
                                    hxLegWork *leg) {
  leg->turn_response = hx_neg(turning_drag(implicit, pack, leg, dw));
  turn_tibia(leg, leg->turn_response);
}

/* Adds G_v dv + G_x dx, the response of joints and contact to the shifts, to torques and p. */
static inline void leg_response(const hxModel *model, const hxImplicit *implicit,
                                const hxPlantMotion *motion, int pack, hxLegWork *leg) {
  const hxReal k = implicit->slope[pack].stiffness, drag = implicit->slope[pack].drag,
               rest = implicit->slope[pack].viscosity - drag;
  const hxVec3 n = leg->foot.kin.normal, arm = leg->foot.kin.arm;
  if (!implicit->change) { /* first stage: dx = z v, dv = 0 */
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      hxJointWork *work = &leg->joint[joint];
      work->angle_shift = implicit->z * work->speed, work->speed_shift = hx_splat(0.0);
      work->torque -= joint_stiffness(model, implicit, pack, joint) * work->angle_shift;
    }
    leg->foot_shift = hx_scale(hx_splat(implicit->z), leg->foot.kin.velocity),
    leg->foot_speed_shift = hx_zero3();
    leg->response = hx_scale(implicit->z * k * leg->foot.kin.ddelta, n);
    leg->turn_response = hx_zero3();
    push_tibia(leg, contact_point(leg), leg->response);
    return;
  }
  /* later stages: shifts of joints and contact point, then their forces */
  hxShift i = torso_shift(implicit, motion), j = i;
  for (int joint = 0; joint < HX_JOINTS; ++joint, i = j) {
    hxJointWork *work = &leg->joint[joint];
    j = link_shift(implicit, motion, joint, pack * HX_LANES);
    work->angle_shift = hx_dot(work->sweep.S.ang, hx_sub3(j.x.ang, i.x.ang)),
    work->speed_shift = hx_dot(work->sweep.S.ang, hx_sub3(j.v.ang, i.v.ang));
    work->torque -= joint_stiffness(model, implicit, pack, joint) * work->angle_shift +
                    joint_damping(model, implicit, pack, joint) * work->speed_shift;
  }
  const hxVec3 x = motion_at(j.x, arm), v = motion_at(j.v, arm);
  leg->foot_shift = x, leg->foot_speed_shift = v;
  const hxReal along = rest * hx_dot(n, v) + k * hx_dot(n, x);
  leg->response = hx_add_scaled(hx_scale(-along, n), -drag, v);
  push_tibia(leg, contact_point(leg), leg->response);
  if (has_turning_friction(model)) turning_response(implicit, pack, j.v.ang, leg);
}

/* Subtracts the bristles' response to their own shift s_b + z db/dt from the foot's force (eq.
 * 21). */
static inline void bristle_response(const hxImplicit *implicit, int pack, hxLegWork *leg) {
  const hxVec3 own = hx_scale(hx_splat(implicit->z), leg->foot.bristle.rate);
  const hxVec3 moved =
      implicit->change
          ? hx_add3(hx_load_vec3(implicit->change->motion.bristle, pack * HX_LANES), own)
          : own;
  leg->bristle_force = hx_scale(implicit->slope[pack].bristle, moved);
  leg->response = hx_sub3(leg->response, leg->bristle_force);
  push_tibia(leg, contact_point(leg), hx_neg(leg->bristle_force));
}

/* The contact's part of W at the contact point: B = across 1 + along n n^T, with across = z c_t
 * and along = z c_n + z^2 k_n - z c_t. */
typedef struct {
  hxVec3 n;
  hxReal across, along;
} hxContactBlock;

static inline hxContactBlock contact_block(const hxImplicit *implicit, int pack,
                                           const hxLegWork *leg) {
  const double z = implicit->z;
  const hxReal across = z * implicit->slope[pack].drag;
  const hxReal along =
      z * implicit->slope[pack].viscosity + z * z * implicit->slope[pack].stiffness - across;
  return (hxContactBlock){leg->foot.kin.normal, across, along};
}

/* Returns B a, the force by which an acceleration of the contact point reduces the foot's force. */
static inline hxVec3 contact_resistance(const hxContactBlock *B, hxVec3 a) {
  return hx_add_scaled(hx_scale(B->across, a), B->along * hx_dot(B->n, a), B->n);
}

/* Adds the part z turning_drag of W to the tibia's inertia, and its product with the bias
 * acceleration to p. */
static inline void add_turning_inertia(const hxImplicit *implicit, int pack, hxLegWork *leg,
                                       hxInertia6 *I) {
  const hxReal z = hx_splat(implicit->z);
  const hxReal roll = z * implicit->slope[pack].roll,
               more = z * implicit->slope[pack].spin - roll;
  const hxVec3 n = leg->foot.kin.normal, a = hx_scale(more, n);
  const hxVec3 bias = turning_drag(implicit, pack, leg, leg->joint[HX_JOINTS - 1].bias.ang);
  I->C = hx_sym_add(I->C, (hxSym3){roll + a.x * n.x, roll + a.y * n.y, roll + a.z * n.z, a.x * n.y,
                                   a.x * n.z, a.y * n.z});
  turn_tibia(leg, hx_scale(-z, bias));
}

/* Returns B as a part of the tibia's inertia, and adds its product with the bias acceleration to
 * p. */
static inline hxInertia6 contact_inertia(const hxModel *model, const hxImplicit *implicit, int pack,
                                         hxLegWork *leg) {
  const hxContactBlock B = contact_block(implicit, pack, leg);
  const hxVec3 n = B.n, x = contact_point(leg), an = hx_scale(B.along, n);
  const hxVec3 bias =
      hx_add3(motion_at(leg->joint[HX_JOINTS - 1].bias, x), hx_splat_vec3(model->gravity));
  push_tibia(leg, x, hx_neg(contact_resistance(&B, bias)));
  hxInertia6 I =
      hx_inertia_at((hxSym3){B.across + an.x * n.x, B.across + an.y * n.y, B.across + an.z * n.z,
                             an.x * n.y, an.x * n.z, an.y * n.z},
                    x);
  if (has_turning_friction(model)) add_turning_inertia(implicit, pack, leg, &I);
  return I;
}

/* Returns the acceleration of the foot's material at the contact point. */
static inline hxVec3 foot_acceleration(const hxModel *model, const hxLegWork *leg) {
  return hx_add3(motion_at(leg->joint[HX_JOINTS - 1].acceleration, leg->foot.kin.arm),
                 hx_splat_vec3(model->gravity));
}

/* Returns db/dt of a stage (eq. 21): k = (f + s_v + z a - yield s_b)/(1 + z yield) along the
 * ground, where f is the bristle law's rate. */
static inline hxVec3 bristle_rate(const hxModel *model, const hxContactState *contact,
                                  const hxImplicit *implicit, int pack, const hxLegWork *leg) {
  hxVec3 rate = leg->foot.bristle.rate;
  if (!implicit) return rate;
  const hxVec3 n = leg->foot.kin.normal,
               dv = hx_add_scaled(leg->foot_speed_shift, hx_splat(implicit->z),
                                  foot_acceleration(model, leg));
  const hxReal yield = implicit->slope[pack].yield,
               closed = hx_load(&contact->closed[pack * HX_LANES]);
  rate = hx_add_scaled(rate, closed, hx_add_scaled(dv, -hx_dot(n, dv), n));
  if (implicit->change)
    rate = hx_add_scaled(rate, -yield,
                         hx_load_vec3(implicit->change->motion.bristle, pack * HX_LANES));
  return hx_scale(1.0 / (1.0 + implicit->z * yield), rate);
}

/* Returns the force of the ground on the foot that a stage's accelerations contain. */
static inline hxVec3 stage_force(const hxModel *model, const hxImplicit *implicit, int pack,
                                 const hxLegWork *leg) {
  if (!implicit) return leg->foot.force;
  const hxContactBlock B = contact_block(implicit, pack, leg);
  return hx_sub3(hx_add3(leg->foot.force, leg->response),
                 contact_resistance(&B, foot_acceleration(model, leg)));
}

/* Returns the moment of spin and rolling friction on the tibia that a stage's accelerations
 * contain. */
static inline hxVec3 stage_moment(const hxImplicit *implicit, int pack, const hxLegWork *leg) {
  if (!implicit) return leg->foot.moment;
  const hxVec3 a = leg->joint[HX_JOINTS - 1].acceleration.ang;
  return hx_add_scaled(hx_add3(leg->foot.moment, leg->turn_response), hx_splat(-implicit->z),
                       turning_drag(implicit, pack, leg, a));
}

#endif
