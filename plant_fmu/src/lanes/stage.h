/* stage.h - terms that a stage of a linearly implicit method adds to forces and inertia (eq.
 * 19-21); models/stage.py is the readable form */
#ifndef HX_STAGE_H
#define HX_STAGE_H

#include "forces.h"

/* Replaces the derivatives of the forces on feet by those of soil where it touched down on it. */
HX_RARE hxContactSlope with_soil_slope(const hxContactState *state, int slot, hxReal deeper,
                                       const hxContactWork *contact, const hxImplicit *implicit,
                                       hxContactSlope rigid) {
  const hxMask soft = hx_on_soil(state, slot);
  const hxSoilPack ahead = hx_soil_pack(state, slot, deeper, contact->kin.ddelta, NULL);
  hxContactSlope slope = rigid;
  slope.stiffness = hx_select(soft, ahead.stiffness, rigid.stiffness);
  slope.viscosity = hx_select(soft, ahead.viscosity, rigid.viscosity);
  const hxReal relaxation = contact->grip.relaxation, kept = 1.0 + implicit->z * relaxation;
  const hxReal bristle = (ahead.force * ahead.per_load + ahead.hold) / kept;
  slope.drag = hx_select(soft, implicit->z * bristle, rigid.drag);
  slope.bristle = hx_select(soft, bristle, rigid.bristle);
  slope.relaxation = relaxation;
  return slope;
}

/* Returns the derivatives of a row's contact forces, taken at the depth expected a step ahead,
 * because a contact that has just touched down has none yet. */
HX_INLINE hxContactSlope contact_slope(const hxModel *model, const hxContactState *state, int row,
                                       int slot, const hxContactWork *contact,
                                       const hxImplicit *implicit) {
  const hxContactKinematics *kin = &contact->kin;
  const hxReal deeper = kin->delta + implicit->ahead * hx_max(kin->ddelta, hx_splat(0.0));
  const hxNormalForce ahead = hx_normal_force(contact->law, deeper, kin->ddelta);
  hxContactSlope slope = {.stiffness = ahead.stiffness, .viscosity = ahead.viscosity};
  if (has_turning_friction(model, row)) {
    slope.spin = ahead.force * contact->turning.spin;
    slope.roll = ahead.force * contact->turning.roll;
  }
  if (!has_friction_bristles(model, row)) {
    slope.drag = ahead.force * contact->drag_per_load;
    slope.bristle = slope.relaxation = hx_splat(0.0);
    return has_soil(model, row) ? with_soil_slope(state, slot, deeper, contact, implicit, slope)
                                : slope;
  }
  slope.relaxation = contact->grip.relaxation;
  slope.bristle = ahead.force * contact->grip.stiffness / (1.0 + implicit->z * slope.relaxation);
  slope.drag = ahead.force * contact->grip.damping + implicit->z * slope.bristle;
  return has_soil(model, row) ? with_soil_slope(state, slot, deeper, contact, implicit, slope)
                              : slope;
}

/* Stores them for all stages of a step. */
HX_INLINE void keep_contact_slope(const hxModel *model, const hxContactState *state, int pack,
                                  int row, const hxLegWork *leg, hxImplicit *implicit) {
  implicit->slope[pack].contact[row] =
      contact_slope(model, state, row, pack * HX_LANES, &leg->contact[row], implicit);
}

HX_RARE void keep_further_slopes(const hxModel *model, const hxContactState *state, int pack,
                                 const hxLegWork *leg, hxImplicit *implicit) {
  for (int k = 1; k < leg->rows; ++k)
    keep_contact_slope(model, state, pack, leg->row[k], leg, implicit);
}

/* Stores the derivatives of a leg's forces for all stages of a step. */
static inline void keep_slopes(const hxModel *model, const hxContactState *state, int pack,
                               const hxLegWork *leg, hxImplicit *implicit) {
  keep_contact_slope(model, state, pack, HX_FOOT, leg, implicit);
  if (leg->rows > 1) keep_further_slopes(model, state, pack, leg, implicit);
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    implicit->slope[pack].motor_stiffness[joint] = leg->joint[joint].servo.stiffness;
    implicit->slope[pack].motor_damping[joint] = leg->joint[joint].servo.damping;
    implicit->slope[pack].gear_drag[joint] = leg->joint[joint].servo.drag;
    if (model->stops) {
      implicit->slope[pack].stop_stiffness[joint] = leg->joint[joint].stop.stiffness;
      implicit->slope[pack].stop_damping[joint] = leg->joint[joint].stop.damping;
    }
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

/* Returns the moment by which spin and rolling friction resist an angular velocity: (spin n n^T +
 * roll (1 - n n^T)) w (eq. 38). */
static inline hxVec3 turning_drag(const hxContactSlope *slope, const hxContactWork *contact,
                                  hxVec3 w) {
  const hxVec3 n = contact->kin.normal;
  return hx_add_scaled(hx_scale(slope->roll, w), (slope->spin - slope->roll) * hx_dot(n, w), n);
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

/* Computes the response G_v dv + G_x dx of a contact to the shift of its body, NULL in the first
 * stage: dx = z v, dv = 0. */
HX_INLINE void contact_response(const hxImplicit *implicit, const hxContactSlope *slope,
                                const hxShift *body, hxContactWork *contact) {
  const hxVec3 n = contact->kin.normal, arm = contact->kin.arm;
  if (!body) {
    contact->shift = hx_scale(hx_splat(implicit->z), contact->kin.velocity);
    contact->speed_shift = hx_zero3();
    contact->response = hx_scale(implicit->z * slope->stiffness * contact->kin.ddelta, n);
    return;
  }
  const hxVec3 x = motion_at(body->x, arm), v = motion_at(body->v, arm);
  contact->shift = x, contact->speed_shift = v;
  const hxReal along =
      (slope->viscosity - slope->drag) * hx_dot(n, v) + slope->stiffness * hx_dot(n, x);
  contact->response = hx_add_scaled(hx_scale(-along, n), -slope->drag, v);
}

/* Adds the response of spin and rolling friction to the shift of the body, NULL in the first
 * stage, to its p. */
HX_RARE void turning_response(const hxContactSlope *slope, const hxShift *body, hxForce6 *p,
                              hxContactWork *contact) {
  contact->turn_response = body ? hx_neg(turning_drag(slope, contact, body->v.ang)) : hx_zero3();
  turn_body(p, contact->turn_response);
}

/* Adds the response of a row to the tibia's p. */
HX_INLINE void row_response(const hxModel *model, const hxImplicit *implicit, int pack, int row,
                            const hxShift *tibia, hxLegWork *leg) {
  hxContactWork *contact = &leg->contact[row];
  const hxContactSlope *slope = &implicit->slope[pack].contact[row];
  hxForce6 *p = &leg->joint[HX_JOINTS - 1].p;
  contact_response(implicit, slope, tibia, contact);
  push_body(p, contact_point(leg, contact), contact->response);
  if (has_turning_friction(model, row)) turning_response(slope, tibia, p, contact);
}

HX_RARE void further_responses(const hxModel *model, const hxImplicit *implicit, int pack,
                               const hxShift *tibia, hxLegWork *leg) {
  for (int k = 1; k < leg->rows; ++k) row_response(model, implicit, pack, leg->row[k], tibia, leg);
}

/* Adds the responses of a leg's contacts to the tibia's p. */
static inline void tibia_response(const hxModel *model, const hxImplicit *implicit, int pack,
                                  const hxShift *tibia, hxLegWork *leg) {
  row_response(model, implicit, pack, HX_FOOT, tibia, leg);
  if (leg->rows > 1) further_responses(model, implicit, pack, tibia, leg);
}

/* Adds G_v dv + G_x dx, the response of joints and contacts to the shifts, to torques and p. */
static inline void leg_response(const hxModel *model, const hxImplicit *implicit,
                                const hxPlantMotion *motion, int pack, hxLegWork *leg) {
  if (!implicit->change) { /* first stage: dx = z v, dv = 0 */
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      hxJointWork *work = &leg->joint[joint];
      work->angle_shift = implicit->z * work->speed, work->speed_shift = hx_splat(0.0);
      work->torque -= joint_stiffness(model, implicit, pack, joint) * work->angle_shift;
    }
    tibia_response(model, implicit, pack, NULL, leg);
    return;
  }
  /* later stages: shifts of joints and contact points, then their forces */
  hxShift i = torso_shift(implicit, motion), j = i;
  for (int joint = 0; joint < HX_JOINTS; ++joint, i = j) {
    hxJointWork *work = &leg->joint[joint];
    j = link_shift(implicit, motion, joint, pack * HX_LANES);
    work->angle_shift = hx_dot(work->sweep.S.ang, hx_sub3(j.x.ang, i.x.ang)),
    work->speed_shift = hx_dot(work->sweep.S.ang, hx_sub3(j.v.ang, i.v.ang));
    work->torque -= joint_stiffness(model, implicit, pack, joint) * work->angle_shift +
                    joint_damping(model, implicit, pack, joint) * work->speed_shift;
  }
  tibia_response(model, implicit, pack, &j, leg);
}

/* Adds to joints and the bodies that carry them what the rotors' angular momenta need (eq. 55). */
HX_RARE void rotor_coupling(const hxModel *model, hxLegWork *leg) {
  const hxNumber spin = model->spin_inertia;
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    hxJointWork *k = &leg->joint[joint];
    const hxVec3 s = k->sweep.S.ang;
    k->rotor.carrier = joint > 0 ? hx_dot(s, leg->joint[joint - 1].bias.ang) : hx_splat(0.0);
    k->torque -= spin * k->rotor.carrier;
    k->sweep.passed = hx_add_scaled(k->sweep.passed, spin * k->driven, s);
  }
}

/* Keeps the slopes of the torso's contacts in the first stage, and adds their responses to p. */
HX_RARE void torso_response(const hxModel *model, const hxContactState *state,
                            const hxPlantMotion *motion, hxImplicit *implicit, hxWork *work) {
  hxShift shifted;
  if (implicit->change) shifted = torso_shift(implicit, motion);
  for (int pack = 0; pack < HX_TORSO_PACKS; ++pack) {
    hxContactWork *contact = &work->torso_contact[pack];
    hxContactSlope *slope = &implicit->torso_slope[pack];
    if (!implicit->change)
      *slope = contact_slope(model, state, HX_TORSO, pack * HX_LANES, contact, implicit);
    contact_response(implicit, slope, implicit->change ? &shifted : NULL, contact);
    push_body(&work->torso_p[pack], contact->kin.arm, contact->response);
  }
}

/* Subtracts the bristles' response to their own shift s_b + z db/dt from the forces of a row of
 * feet (eq. 21). */
HX_INLINE void bristle_response(const hxImplicit *implicit, int pack, int row, hxLegWork *leg) {
  hxContactWork *contact = &leg->contact[row];
  const hxVec3 own = hx_scale(hx_splat(implicit->z), contact->grip.rate);
  const hxVec3 moved =
      implicit->change
          ? hx_add3(hx_load_vec3(implicit->change->motion.bristle, pack * HX_LANES), own)
          : own;
  contact->bristle_force = hx_scale(implicit->slope[pack].contact[row].bristle, moved);
  contact->response = hx_sub3(contact->response, contact->bristle_force);
  push_body(&leg->joint[HX_JOINTS - 1].p, contact_point(leg, contact),
            hx_neg(contact->bristle_force));
}

/* The contact's part of W at the contact point: B = across 1 + along n n^T, with across = z c_t
 * and along = z c_n + z^2 k_n - z c_t. */
typedef struct {
  hxVec3 n;
  hxReal across, along;
} hxContactBlock;

HX_INLINE hxContactBlock contact_block(const hxImplicit *implicit, const hxContactSlope *slope,
                                       const hxContactWork *contact) {
  const double z = implicit->z;
  const hxReal across = z * slope->drag;
  const hxReal along = z * slope->viscosity + z * z * slope->stiffness - across;
  return (hxContactBlock){contact->kin.normal, across, along};
}

/* Returns B a, by which an acceleration of the contact point reduces the contact's force. */
HX_INLINE hxVec3 contact_resistance(const hxContactBlock *B, hxVec3 a) {
  return hx_add_scaled(hx_scale(B->across, a), B->along * hx_dot(B->n, a), B->n);
}

/* Returns B at x as a part of the body's inertia, and adds its product with the acceleration that
 * the body has without its spatial acceleration to p. */
HX_INLINE hxInertia6 contact_inertia(const hxContactBlock *B, hxVec3 x, hxVec3 bias, hxForce6 *p) {
  const hxVec3 n = B->n, an = hx_scale(B->along, n);
  push_body(p, x, hx_neg(contact_resistance(B, bias)));
  return hx_inertia_at((hxSym3){B->across + an.x * n.x, B->across + an.y * n.y,
                                B->across + an.z * n.z, an.x * n.y, an.x * n.z, an.y * n.z},
                       x);
}

/* Adds the part z turning_drag of W to the inertia of a body, and its product with the body's
 * angular bias acceleration to p. */
HX_RARE void add_turning_inertia(const hxImplicit *implicit, const hxContactSlope *slope,
                                 const hxContactWork *contact, const hxVec3 *bias, hxForce6 *p,
                                 hxInertia6 *I) {
  const hxReal z = hx_splat(implicit->z);
  const hxReal roll = z * slope->roll, more = z * slope->spin - roll;
  const hxVec3 n = contact->kin.normal, a = hx_scale(more, n);
  I->C = hx_sym_add(I->C, (hxSym3){roll + a.x * n.x, roll + a.y * n.y, roll + a.z * n.z, a.x * n.y,
                                   a.x * n.z, a.y * n.z});
  turn_body(p, hx_scale(-z, turning_drag(slope, contact, *bias)));
}

/* Sets I to the block of a row as a part of the tibia's inertia. */
HX_INLINE void row_inertia(const hxModel *model, const hxImplicit *implicit, int pack, int row,
                           hxLegWork *leg, hxInertia6 *I) {
  hxJointWork *tibia = &leg->joint[HX_JOINTS - 1];
  const hxContactWork *contact = &leg->contact[row];
  const hxContactSlope *slope = &implicit->slope[pack].contact[row];
  const hxContactBlock B = contact_block(implicit, slope, contact);
  const hxVec3 x = contact_point(leg, contact);
  const hxVec3 bias = hx_add3(motion_at(tibia->bias, x), hx_splat_vec3(model->gravity));
  *I = contact_inertia(&B, x, bias, &tibia->p);
  if (has_turning_friction(model, row))
    add_turning_inertia(implicit, slope, contact, &tibia->bias.ang, &tibia->p, I);
}

/* Returns the acceleration of the material at a contact point, from the body's acceleration a - g
 * at its centre of mass. */
HX_INLINE hxVec3 contact_acceleration(const hxModel *model, hxMotion6 felt,
                                      const hxContactWork *contact) {
  return hx_add3(motion_at(felt, contact->kin.arm), hx_splat_vec3(model->gravity));
}

/* Returns db/dt of a stage (eq. 21): k = (f + s_v + z a - beta s_b)/(1 + z beta) along the ground,
 * where f is the bristle law's rate and beta the bristles' relaxation rate. */
static inline hxVec3 stage_bristle_rate(const hxModel *model, const hxContactState *state,
                                        const hxImplicit *implicit, int pack,
                                        const hxLegWork *leg) {
  const hxContactWork *contact = &leg->contact[HX_FOOT];
  hxVec3 rate = contact->grip.rate;
  if (!implicit) return rate;
  const hxMotion6 felt = leg->joint[HX_JOINTS - 1].acceleration;
  const hxVec3 n = contact->kin.normal,
               dv = hx_add_scaled(contact->speed_shift, hx_splat(implicit->z),
                                  contact_acceleration(model, felt, contact));
  const hxReal relaxation = implicit->slope[pack].contact[HX_FOOT].relaxation;
  hxReal closed = hx_load(&state->closed[HX_FOOT][pack * HX_LANES]);
  if (!has_friction_bristles(model, HX_FOOT)) /* rigid ground beside soil has no bristles */
    closed *= hx_load(&state->on_soil[pack * HX_LANES]);
  rate = hx_add_scaled(rate, closed, hx_add_scaled(dv, -hx_dot(n, dv), n));
  if (implicit->change)
    rate = hx_add_scaled(rate, -relaxation,
                         hx_load_vec3(implicit->change->motion.bristle, pack * HX_LANES));
  return hx_scale(1.0 / (1.0 + implicit->z * relaxation), rate);
}

/* Returns the force of the ground on a body at a contact that a stage's accelerations contain;
 * implicit NULL: the force itself. */
HX_INLINE hxVec3 stage_force(const hxModel *model, const hxImplicit *implicit,
                             const hxContactSlope *slope, hxMotion6 felt,
                             const hxContactWork *contact) {
  if (!implicit) return contact->force;
  const hxContactBlock B = contact_block(implicit, slope, contact);
  return hx_sub3(hx_add3(contact->force, contact->response),
                 contact_resistance(&B, contact_acceleration(model, felt, contact)));
}

/* Returns the same of a row of contacts on the tibias. */
HX_INLINE hxVec3 row_stage_force(const hxModel *model, const hxImplicit *implicit, int pack,
                                 int row, const hxLegWork *leg) {
  return stage_force(model, implicit, implicit ? &implicit->slope[pack].contact[row] : NULL,
                     leg->joint[HX_JOINTS - 1].acceleration, &leg->contact[row]);
}

/* Returns the moment of spin and rolling friction on the tibia that a stage's accelerations
 * contain. */
static inline hxVec3 row_stage_moment(const hxImplicit *implicit, int pack, int row,
                                      const hxLegWork *leg) {
  const hxContactWork *contact = &leg->contact[row];
  if (!implicit) return contact->moment;
  const hxVec3 drag = turning_drag(&implicit->slope[pack].contact[row], contact,
                                   leg->joint[HX_JOINTS - 1].acceleration.ang);
  return hx_add_scaled(hx_add3(contact->moment, contact->turn_response), hx_splat(-implicit->z),
                       drag);
}

/* Returns force and moment of the ground on the tibia at a row's point, about its centre of
 * mass. */
HX_INLINE hxForce6 row_wrench(const hxModel *model, const hxImplicit *implicit, int pack, int row,
                              const hxLegWork *leg) {
  const hxVec3 ground = row_stage_force(model, implicit, pack, row, leg);
  hxForce6 wrench = {hx_cross(leg->contact[row].kin.arm, ground), ground};
  if (has_turning_friction(model, row))
    wrench.ang = hx_add3(wrench.ang, row_stage_moment(implicit, pack, row, leg));
  return wrench;
}

HX_RARE hxForce6 further_wrenches(const hxModel *model, const hxImplicit *implicit, int pack,
                                  const hxLegWork *leg) {
  hxForce6 sum = {hx_zero3(), hx_zero3()};
  for (int k = 1; k < leg->rows; ++k)
    sum = hx_force_add(sum, row_wrench(model, implicit, pack, leg->row[k], leg));
  return sum;
}

#endif
