/* dynamics.h - eq. 1 solved exactly in O(n): Newton-Euler with multipliers and Baumgarte on the tree of 19 bodies
 *
 * All legs of a pack at once. Points, and the spatial vectors of the sweeps, are from and about the torso's centre of mass. Accelerations are
 * what a body feels, a - g, until they are stored: gravity is then no force at all.
 */
#ifndef HX_DYNAMICS_H
#define HX_DYNAMICS_H

#include "work.h"

/* ---- root to leaf: where everything is and what it feels there ------------------------------------------------------------ */

/* along a leg, up to the present link */
typedef struct {
  hxVec3 c, dc, ddc; /* centre of mass from the torso's by the joints alone, its rate, its second rate without angular accelerations */
  hxMotion6 bias;    /* sums of dw and P x dw */
} hxChain;

/* The drive's acceleration: the rheonomic constraint q = q_ref + qd_ref s + qdd_ref s^2/2,
 * s = t - t_command, with Baumgarte (eq. 14). */
static inline hxReal drive_acceleration(const hxModel *model, const hxCommand *command, double t, int joint, int slot,
                                        const hxJointWork *k) {
  const hxReal angle_ref = hx_load(&command->angle[joint][slot]), speed_ref = hx_load(&command->speed[joint][slot]);
  const hxReal acceleration_ref = hx_load(&command->acceleration[joint][slot]);
  const hxNumber since = t - command->time;
  const hxReal error = k->angle - (angle_ref + since * (speed_ref + (0.5 * since) * acceleration_ref));
  const hxReal slower = k->speed - (speed_ref + since * acceleration_ref);
  return acceleration_ref - 2.0 * model->alpha * slower - model->beta * model->beta * error;
}

/* dw of eq. 10: rows 4 and 5 of D on it are c = gamma - 2 alpha dPhi - beta^2 Phi, s.dw is 0 or the drive's qdd.
 * With x = w_i x w_j taken out, gamma is Phi |w|^2 - w qd of the relative w; what is left is solved in the child's axes. */
static inline hxVec3 joint_bias(const hxModel *model, const hxJointKinematics *kin, hxVec3 w_i, const hxBody *j, hxReal speed,
                                hxReal driven) {
  const hxVec3 w = hx_tmul(j->axes, hx_sub(j->w, w_i)), x = hx_cross(w_i, j->w);
  const hxReal twice = hx_splat(2.0 * model->alpha), rest = hx_dot(w, w) - model->beta * model->beta;
  const hxReal along = driven - hx_dot(kin->s, x), inverse_sz = 1.0 / kin->sz;
  const hxReal c4 = kin->sx * rest - w.x * speed - twice * (kin->sy * w.z - kin->sz * w.y);
  const hxReal c5 = kin->sy * rest - w.y * speed - twice * (kin->sz * w.x - kin->sx * w.z);
  const hxReal dz = kin->sz * along + kin->sy * c4 - kin->sx * c5;
  const hxReal dx = (c5 + kin->sx * dz) * inverse_sz, dy = (kin->sy * dz - c4) * inverse_sz;
  return hx_add(x, hx_mul(j->axes, (hxVec3){dx, dy, dz}));
}

/* a motion about the torso's centre of mass, at c from it */
static inline hxVec3 motion_at(hxMotion6 a, hxVec3 c) { return hx_add(a.lin, hx_cross(a.ang, c)); }

/* Attitude and inertia of a link. */
static inline void link_pass(const hxModel *model, const hxMotion *motion, int joint, int slot, hxJointWork *k) {
  k->body = hx_link_body(motion, joint, slot);
  k->J = hx_rotate_sym3(k->body.axes, hx_load_sym3(model->joint[joint].inertia, slot));
  k->gyroscopic = hx_cross(hx_sym_mul(k->J, k->body.w), k->body.w);
}

/* One joint and its child: positions, velocities, bias acceleration and the force it takes. */
static inline void joint_pass(const hxModel *model, const hxCommand *command, double t, const hxMotion *motion, int joint, int slot,
                              int reactions, const hxBody *i, hxChain *chain, hxJointWork *k) {
  const hxJointModel *m = &model->joint[joint];
  const hxBody *j = &k->body;
  const hxJointKinematics kin = hx_joint_kinematics(m, slot, i, j);
  const hxVec3 P = hx_add(chain->c, kin.sP_i);
  const hxVec3 dsP_i = hx_cross(i->w, kin.sP_i), dsP_j = hx_cross(j->w, kin.sP_j);
  chain->c = hx_sub(P, kin.sP_j);
  chain->dc = hx_add(chain->dc, hx_sub(dsP_i, dsP_j));
  chain->ddc = hx_add(chain->ddc, hx_sub(hx_cross(i->w, dsP_i), hx_cross(j->w, dsP_j)));
  k->c = chain->c;
  k->sweep.S = (hxMotion6){kin.s, hx_cross(P, kin.s)};
  k->speed = hx_dot(kin.s, hx_sub(j->w, i->w));
  k->driven = model->servo_mode == HX_SERVO_KINEMATIC ? drive_acceleration(model, command, t, joint, slot, k) : hx_splat(0.0);

  /* rows 1-3 of a_k telescope: ddc - 2 alpha (v_j - v_0 - dc) - beta^2 (r_j - r_0 - c) */
  const hxVec3 dw = joint_bias(model, &kin, i->w, j, k->speed, k->driven);
  const hxVec3 drift = hx_sub(hx_sub(hx_link_vec3(motion, joint, HX_R, slot), hx_torso_vec3(motion, HX_R)), chain->c);
  const hxVec3 drift_rate = hx_sub(hx_sub(hx_link_vec3(motion, joint, HX_V, slot), hx_torso_vec3(motion, HX_V)), chain->dc);
  const hxVec3 rows =
      hx_add_scaled(hx_add_scaled(chain->ddc, hx_splat(-2.0 * model->alpha), drift_rate), hx_splat(-model->beta * model->beta), drift);
  chain->bias.ang = hx_add(chain->bias.ang, dw);
  chain->bias.lin = hx_add(chain->bias.lin, hx_cross(P, dw));
  k->bias = (hxMotion6){chain->bias.ang, hx_add(chain->bias.lin, rows)};

  /* p of the child: (J dw + w x (J w), m a) at its centre of mass */
  const hxVec3 lin = hx_scale(hx_load(&m->mass[slot]), motion_at(k->bias, chain->c));
  const hxVec3 ang = hx_sub(hx_sym_mul(k->J, k->bias.ang), k->gyroscopic);
  k->p = (hxForce6){hx_add(ang, hx_cross(chain->c, lin)), lin};
  if (reactions) k->reaction.kin = kin;
}

/* first all half-angles, then all angles: their long chains of operations overlap */
static inline void joint_angles(const hxModel *model, const hxMotion *motion, hxWork *work) {
  hxReal sine[HX_JOINTS * HX_PACKS], cosine[HX_JOINTS * HX_PACKS];
  for (int joint = 0, n = 0; joint < HX_JOINTS; ++joint)
    for (int pack = 0; pack < HX_PACKS; ++pack, ++n) {
      const int slot = pack * HX_LANES;
      hx_joint_half_angle(&model->joint[joint], slot, hx_parent_quat(motion, joint, slot), hx_link_quat(motion, joint, slot), &sine[n],
                          &cosine[n]);
    }
  for (int joint = 0, n = 0; joint < HX_JOINTS; ++joint)
    for (int pack = 0; pack < HX_PACKS; ++pack, ++n) work->pack[pack].joint[joint].angle = hx_angle_from_half(sine[n], cosine[n]);
}

static inline void leg_pass(const hxModel *model, const hxCommand *command, double t, const hxMotion *motion, const hxBody *torso, int slot,
                            int reactions, hxLegWork *leg) {
  const hxVec3 o = hx_zero3();
  hxChain chain = {o, o, o, {o, o}};
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    joint_pass(model, command, t, motion, joint, slot, reactions, joint > 0 ? &leg->joint[joint - 1].body : torso, &chain,
               &leg->joint[joint]);
}

static inline void joint_torque(const hxModel *model, const hxCommand *command, int joint, int slot, hxJointWork *k) {
  k->servo = hx_servo_torque(model, k->angle, k->speed, hx_load(&command->angle[joint][slot]), hx_load(&command->speed[joint][slot]),
                             hx_load(&command->torque[joint][slot]));
  k->torque = model->servo_mode == HX_SERVO_KINEMATIC ? k->servo.friction : k->servo.torque + k->servo.friction;
}

/* where the foot touches, from the torso's centre of mass */
static inline hxVec3 contact_point(const hxLegWork *leg) { return hx_add(leg->joint[HX_JOINTS - 1].c, leg->foot.kin.arm); }

/* a force on the tibia at x: taken off its p */
static inline void push_tibia(hxLegWork *leg, hxVec3 x, hxVec3 force) {
  hxForce6 *p = &leg->joint[HX_JOINTS - 1].p;
  p->lin = hx_sub(p->lin, force);
  p->ang = hx_sub(p->ang, hx_cross(x, force));
}

static inline void leg_foot(const hxModel *model, const hxContactState *contact, const hxMotion *motion, int slot, hxLegWork *leg) {
  leg->foot.kin = hx_foot_kinematics(model, motion, slot, &leg->joint[HX_JOINTS - 1].body);
  hx_foot_force(model, contact, slot, hx_load_vec3(motion->bristle, slot), &leg->foot);
  push_tibia(leg, contact_point(leg), leg->foot.force);
}

/* ---- what a linearly implicit stage adds (eq. 15) -------------------------------------------------------------------------- */

/* The slopes of this stage's forces, the contact's where it will be a step ahead: a foot that has just touched down has none yet, and a W
 * without them lets go of the very contact that it is there for. */
static inline void keep_slopes(const hxModel *model, const hxContactState *contact, int pack, const hxLegWork *leg, hxImplicit *implicit) {
  const hxFootWork *foot = &leg->foot;
  const int slot = pack * HX_LANES;
  const hxReal deeper = foot->kin.delta + implicit->ahead * hx_max(foot->kin.ddelta, hx_splat(0.0));
  const hxNormalForce ahead =
      hx_normal_force(model, hx_load(&contact->closed[slot]), hx_load(&contact->damping[slot]), deeper, foot->kin.ddelta);
  implicit->slope[pack].stiffness = ahead.stiffness;
  implicit->slope[pack].viscosity = ahead.viscosity;
  if (has_bristles(model)) {
    implicit->slope[pack].yield = foot->bristle.yield;
    implicit->slope[pack].bristle = ahead.force * foot->bristle.stiffness / (1.0 + implicit->z * foot->bristle.yield);
    implicit->slope[pack].drag = ahead.force * foot->bristle.damping + implicit->z * implicit->slope[pack].bristle;
  } else {
    implicit->slope[pack].drag = ahead.force * foot->drag_per_load;
  }
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    implicit->slope[pack].motor_stiffness[joint] = leg->joint[joint].servo.stiffness;
    implicit->slope[pack].motor_damping[joint] = leg->joint[joint].servo.damping;
    implicit->slope[pack].gear_drag[joint] = leg->joint[joint].servo.drag;
  }
}

/* N m s/rad  of motor and gear together */
static inline hxReal servo_damping(const hxImplicit *implicit, int pack, int joint) {
  return implicit->slope[pack].motor_damping[joint] + implicit->slope[pack].gear_drag[joint];
}

/* displacement and velocity change of a body before this stage's own share: dx = s_x + z (v + s_v), dv = s_v */
typedef struct {
  hxMotion6 x, v;
} hxShift;

static inline hxMotion6 torso_velocity(const hxMotion *m) { return (hxMotion6){hx_torso_vec3(m, HX_W), hx_torso_vec3(m, HX_V)}; }

static inline hxMotion6 link_velocity(const hxMotion *m, int joint, int slot) {
  return (hxMotion6){hx_link_vec3(m, joint, HX_W, slot), hx_link_vec3(m, joint, HX_V, slot)};
}

static inline hxShift shift(double z, hxMotion6 v, hxMotion6 s_x, hxMotion6 s_v) {
  return (hxShift){hx_motion_add_scaled(s_x, hx_splat(z), hx_motion_add(v, s_v)), s_v};
}

static inline hxShift link_shift(const hxImplicit *implicit, const hxMotion *motion, int joint, int slot) {
  const hxMotion *s = &implicit->change->motion;
  const hxMotion6 s_x = {hx_load_vec3(implicit->change->link_turn[joint], slot), hx_link_vec3(s, joint, HX_R, slot)};
  return shift(implicit->z, link_velocity(motion, joint, slot), s_x, link_velocity(s, joint, slot));
}

static inline hxShift torso_shift(const hxImplicit *implicit, const hxMotion *motion) {
  const hxMotion *s = &implicit->change->motion;
  const hxMotion6 s_x = {hx_splat_vec3(implicit->change->torso_turn), hx_torso_vec3(s, HX_R)};
  return shift(implicit->z, torso_velocity(motion), s_x, torso_velocity(s));
}

/* G_v dv + G_x dx: what servos and contact answer the shifts with, added to torques and p */
static inline void leg_response(const hxImplicit *implicit, const hxMotion *motion, int pack, hxLegWork *leg) {
  const hxReal k = implicit->slope[pack].stiffness, drag = implicit->slope[pack].drag, rest = implicit->slope[pack].viscosity - drag;
  const hxVec3 n = leg->foot.kin.normal, arm = leg->foot.kin.arm;
  if (!implicit->change) { /* dx = z v, dv = 0 */
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      hxJointWork *work = &leg->joint[joint];
      work->turned = implicit->z * work->speed, work->sped = hx_splat(0.0);
      work->torque -= implicit->slope[pack].motor_stiffness[joint] * work->turned;
    }
    leg->foot_moved = hx_scale(hx_splat(implicit->z), leg->foot.kin.velocity), leg->foot_sped = hx_zero3();
    leg->response = hx_scale(implicit->z * k * leg->foot.kin.ddelta, n);
    push_tibia(leg, contact_point(leg), leg->response);
    return;
  }
  hxShift i = torso_shift(implicit, motion), j = i;
  for (int joint = 0; joint < HX_JOINTS; ++joint, i = j) {
    hxJointWork *work = &leg->joint[joint];
    j = link_shift(implicit, motion, joint, pack * HX_LANES);
    work->turned = hx_dot(work->sweep.S.ang, hx_sub(j.x.ang, i.x.ang)), work->sped = hx_dot(work->sweep.S.ang, hx_sub(j.v.ang, i.v.ang));
    work->torque -= implicit->slope[pack].motor_stiffness[joint] * work->turned + servo_damping(implicit, pack, joint) * work->sped;
  }
  const hxVec3 x = motion_at(j.x, arm), v = motion_at(j.v, arm);
  leg->foot_moved = x, leg->foot_sped = v;
  const hxReal along = rest * hx_dot(n, v) + k * hx_dot(n, x);
  leg->response = hx_add_scaled(hx_scale(-along, n), -drag, v);
  push_tibia(leg, contact_point(leg), leg->response);
}

/* what the bristles' own shift s_b + z db/dt, shared out by how they let go, takes off the foot's force (eq. 20) */
static inline void bristle_response(const hxImplicit *implicit, int pack, hxLegWork *leg) {
  const hxVec3 own = hx_scale(hx_splat(implicit->z), leg->foot.bristle.rate);
  const hxVec3 moved = implicit->change ? hx_add(hx_load_vec3(implicit->change->motion.bristle, pack * HX_LANES), own) : own;
  leg->bristle_force = hx_scale(implicit->slope[pack].bristle, moved);
  leg->response = hx_sub(leg->response, leg->bristle_force);
  push_tibia(leg, contact_point(leg), hx_neg(leg->bristle_force));
}

/* The contact's share of W: B = across 1 + along n n^T at the contact point, z c_t and z c_n + z^2 k_n - z c_t. */
typedef struct {
  hxVec3 n;
  hxReal across, along;
} hxContactBlock;

static inline hxContactBlock contact_block(const hxImplicit *implicit, int pack, const hxLegWork *leg) {
  const double z = implicit->z;
  const hxReal across = z * implicit->slope[pack].drag;
  const hxReal along = z * implicit->slope[pack].viscosity + z * z * implicit->slope[pack].stiffness - across;
  return (hxContactBlock){leg->foot.kin.normal, across, along};
}

/* B a: what an acceleration of the contact point takes off the foot's force in a stage */
static inline hxVec3 contact_resistance(const hxContactBlock *B, hxVec3 a) {
  return hx_add_scaled(hx_scale(B->across, a), B->along * hx_dot(B->n, a), B->n);
}

/* B as part of the tibia's inertia; what the bias acceleration meets of it goes to p */
static inline hxInertia6 contact_inertia(const hxModel *model, const hxImplicit *implicit, int pack, hxLegWork *leg) {
  const hxContactBlock B = contact_block(implicit, pack, leg);
  const hxVec3 n = B.n, x = contact_point(leg), an = hx_scale(B.along, n);
  const hxVec3 bias = hx_add(motion_at(leg->joint[HX_JOINTS - 1].bias, x), hx_splat_vec3(model->gravity));
  push_tibia(leg, x, hx_neg(contact_resistance(&B, bias)));
  return hx_inertia_at((hxSym3){B.across + an.x * n.x, B.across + an.y * n.y, B.across + an.z * n.z, an.x * n.y, an.x * n.z, an.y * n.z},
                       x);
}

/* acceleration of the contact point's material */
static inline hxVec3 foot_acceleration(const hxModel *model, const hxLegWork *leg) {
  return hx_add(motion_at(leg->joint[HX_JOINTS - 1].acceleration, leg->foot.kin.arm), hx_splat_vec3(model->gravity));
}

/* db/dt of a stage (eq. 20): k = (f + s_v + z a - yield s_b)/(1 + z yield) along the ground, f what the law says */
static inline hxVec3 bristle_rate(const hxModel *model, const hxContactState *contact, const hxImplicit *implicit, int pack,
                                  const hxLegWork *leg) {
  hxVec3 rate = leg->foot.bristle.rate;
  if (!implicit) return rate;
  const hxVec3 n = leg->foot.kin.normal, dv = hx_add_scaled(leg->foot_sped, hx_splat(implicit->z), foot_acceleration(model, leg));
  const hxReal yield = implicit->slope[pack].yield, closed = hx_load(&contact->closed[pack * HX_LANES]);
  rate = hx_add_scaled(rate, closed, hx_add_scaled(dv, -hx_dot(n, dv), n));
  if (implicit->change) rate = hx_add_scaled(rate, -yield, hx_load_vec3(implicit->change->motion.bristle, pack * HX_LANES));
  return hx_scale(1.0 / (1.0 + implicit->z * yield), rate);
}

/* ground on foot, as a stage's accelerations contain it */
static inline hxVec3 stage_force(const hxModel *model, const hxImplicit *implicit, int pack, const hxLegWork *leg) {
  if (!implicit) return leg->foot.force;
  const hxContactBlock B = contact_block(implicit, pack, leg);
  return hx_sub(hx_add(leg->foot.force, leg->response), contact_resistance(&B, foot_acceleration(model, leg)));
}

/* ---- the sweeps of eq. 11-12 ----------------------------------------------------------------------------------------------- */

/* 1/d, d = S.U + what the joint itself resists with */
static inline hxReal sweep_inverse(const hxModel *model, const hxSweep *sweep, hxReal resists) {
  return model->servo_mode == HX_SERVO_KINEMATIC ? hx_splat(0.0) : 1.0 / (hx_power(sweep->U, sweep->S) + resists);
}

static inline hxRigid6 link_inertia(const hxModel *model, const hxJointWork *k, int joint, int slot) {
  return hx_rigid_inertia(hx_load(&model->joint[joint].mass[slot]), k->J, k->c);
}

/* U = I S of a link with all it carries; leaves I - U U^T/d, what the parent carries */
static inline void sweep_inertia(const hxModel *model, const hxImplicit *implicit, int joint, int pack, hxLegWork *leg, hxInertia6 *I) {
  hxJointWork *k = &leg->joint[joint];
  hxSweep *sweep = &k->sweep;
  const hxRigid6 own = link_inertia(model, k, joint, pack * HX_LANES);
  hxReal resists = hx_splat(model->rotor_inertia);
  if (implicit) {
    const double z = implicit->z;
    resists += z * servo_damping(implicit, pack, joint) + (z * z) * implicit->slope[pack].motor_stiffness[joint];
    if (joint == HX_JOINTS - 1) *I = contact_inertia(model, implicit, pack, leg);
  } else if (joint == HX_JOINTS - 1) {
    sweep->U = hx_rigid_mul(&own, sweep->S);
    sweep->inverse_d = sweep_inverse(model, sweep, resists);
    *I = hx_rigid_downdate(&own, sweep->inverse_d, sweep->U);
    return;
  }
  hx_inertia_add_rigid(I, &own);
  sweep->U = hx_inertia_mul(I, sweep->S);
  sweep->inverse_d = sweep_inverse(model, sweep, resists);
  hx_inertia_downdate(I, sweep->inverse_d, sweep->U);
}

/* u = torque - S.p; leaves p + U u/d, what the parent is handed */
static inline void sweep_force(hxJointWork *k, hxForce6 *p) {
  hxSweep *sweep = &k->sweep;
  *p = hx_force_add(*p, k->p);
  sweep->u = k->torque - hx_power(*p, sweep->S);
  *p = hx_force_add_scaled(*p, sweep->inverse_d * sweep->u, sweep->U);
}

/* qdd = (u - U.a)/d; leaves a + S qdd, the child's acceleration but for its bias */
static inline void sweep_motion(hxJointWork *k, hxMotion6 *a) {
  const hxSweep *sweep = &k->sweep;
  const hxReal qdd = sweep->inverse_d * (sweep->u - hx_power(sweep->U, *a));
  *a = hx_motion_add_scaled(*a, qdd, sweep->S);
  k->qdd = qdd + k->driven;
  const hxMotion6 felt = hx_motion_add(*a, k->bias);
  k->acceleration = (hxMotion6){felt.ang, motion_at(felt, k->c)};
}

/* Multipliers leaf to root: D_kk^T lambda_k = g_k - M_k dv_k - sum over children c of D_ck^T lambda_c.
 * About the joint's point the torque is -(u1 lambda_4 + u2 lambda_5) and the axis's, u1 = a x s, u2 = b x s. */
static inline void leg_multipliers(const hxModel *model, const hxImplicit *implicit, int pack, hxLegWork *leg) {
  const hxVec3 ground = stage_force(model, implicit, pack, leg);
  const int slot = pack * HX_LANES;
  hxForce6 handed = {hx_cross(leg->foot.kin.arm, ground), ground}; /* at the link's centre of mass: by the ground, then by the child */
  for (int joint = HX_JOINTS - 1; joint >= 0; --joint) {
    hxJointWork *k = &leg->joint[joint];
    const hxJointKinematics *kin = &k->reaction.kin;
    const hxVec3 lin = hx_add_scaled(handed.lin, -hx_load(&model->joint[joint].mass[slot]), k->acceleration.lin);
    const hxVec3 ang = hx_sub(hx_add(k->gyroscopic, handed.ang), hx_sym_mul(k->J, k->acceleration.ang));
    const hxVec3 about_joint = hx_sub(ang, hx_cross(kin->sP_j, lin));
    const hxReal along = hx_dot(about_joint, kin->s), inverse_sz = 1.0 / kin->sz;
    if (model->servo_mode == HX_SERVO_KINEMATIC) {
      k->torque = model->rotor_inertia * k->qdd - along;
      k->servo.torque = k->torque - k->servo.friction;
    }
    k->reaction.lambda_lin = lin;
    k->reaction.lambda[0] = (along * kin->sy - hx_dot(about_joint, k->body.axes.y)) * inverse_sz;
    k->reaction.lambda[1] = (hx_dot(about_joint, k->body.axes.x) - along * kin->sx) * inverse_sz;
    handed = (hxForce6){hx_add(about_joint, hx_cross(kin->sP_i, lin)), lin};
  }
}

/* ---- the torso -------------------------------------------------------------------------------------------------------------- */

static inline void torso_pass(const hxModel *model, const hxMotion *motion, hxWork *work) {
  const hxNumber *J = model->torso_inertia;
  const hxSym3 body = {hx_splat(J[0]), hx_splat(J[1]), hx_splat(J[2]), hx_splat(J[3]), hx_splat(J[4]), hx_splat(J[5])};
  work->torso = hx_torso_body(motion);
  work->torso_J = hx_rotate_sym3(work->torso.axes, body);
}

/* sums over the legs, in every lane: of n numbers that stand one after the other in each pack's struct */
static inline void sum_packs(const hxReal *first, size_t stride, int n, hxReal *sum) {
  for (int i = 0; i < n; ++i) {
    hxReal x[HX_PACKS];
    for (int k = 0; k < HX_PACKS; ++k) x[k] = first[(size_t)k * stride + (size_t)i];
    sum[i] = hx_sum_legs(x);
  }
}

/* (I + sum of legs) (dv - g) = push and gyroscopic torque - sum of legs */
static inline hxMotion6 torso_acceleration(const hxModel *model, const hxCommand *command, const hxWork *work, const hxInertia6 *I,
                                           const hxForce6 *p) {
  const hxReal m = hx_splat(model->torso_mass), o = hx_splat(0.0);
  const hxVec3 gyroscopic = hx_cross(hx_sym_mul(work->torso_J, work->torso.w), work->torso.w);
  enum { INERTIA = sizeof(hxInertia6) / sizeof(hxReal), FORCE = sizeof(hxForce6) / sizeof(hxReal) };
  union {
    hxReal entry[INERTIA];
    hxInertia6 I;
  } A;
  union {
    hxReal entry[FORCE];
    hxForce6 f;
  } legs;
  sum_packs(&I->C.xx, INERTIA, INERTIA, A.entry);
  sum_packs(&p->ang.x, FORCE, FORCE, legs.entry);
  A.I.C = hx_sym_add(work->torso_J, A.I.C);
  A.I.A = hx_sym_add((hxSym3){m, m, m, o, o, o}, A.I.A);
  const hxVec3 torque = hx_sub(hx_add(hx_splat_vec3(command->push_torque), gyroscopic), legs.f.ang);
  return hx_inertia_solve(&A.I, (hxForce6){torque, hx_sub(hx_splat_vec3(command->push_force), legs.f.lin)});
}

/* ---- dy/dt ------------------------------------------------------------------------------------------------------------------ */

/* a - g as the acceleration it is */
static inline hxMotion6 from_felt(const hxModel *model, hxMotion6 felt) {
  return (hxMotion6){felt.ang, hx_add(felt.lin, hx_splat_vec3(model->gravity))};
}

/* nu of eq. 16, what positions advance with: v + z dv + s_v in a linearly implicit stage, else v */
static inline void store_torso_rate(const hxModel *model, const hxMotion *motion, const hxImplicit *implicit, const hxWork *work,
                                    hxRate *rate) {
  const hxMotion6 dv = from_felt(model, work->torso_acceleration);
  hxMotion6 nu = torso_velocity(motion);
  if (implicit) nu = hx_motion_add_scaled(nu, hx_splat(implicit->z), dv);
  if (implicit && implicit->change) nu = hx_motion_add(nu, torso_velocity(&implicit->change->motion));
  const hxVec3 v = nu.lin, w = nu.ang;
  const hxQuat dp = hx_quaternion_rate(hx_torso_quat(motion), w);
  const hxReal entries[HX_BODY_STATE] = {v.x, v.y, v.z, dp.w, dp.x, dp.y, dp.z, dv.lin.x, dv.lin.y, dv.lin.z, dv.ang.x, dv.ang.y, dv.ang.z};
  for (int i = 0; i < HX_BODY_STATE; ++i) rate->motion.torso[i] = hx_lane(entries[i], 0);
  rate->torso_turn[0] = hx_lane(w.x, 0), rate->torso_turn[1] = hx_lane(w.y, 0), rate->torso_turn[2] = hx_lane(w.z, 0);
  for (int i = 3; i < 8; ++i) rate->torso_turn[i] = 0.0;
}

static inline void store_link_rate(const hxModel *model, const hxMotion *motion, const hxImplicit *implicit, int joint, int slot,
                                   const hxJointWork *k, hxRate *rate) {
  const hxMotion6 dv = from_felt(model, k->acceleration);
  hxMotion6 nu = link_velocity(motion, joint, slot);
  if (implicit) nu = hx_motion_add_scaled(nu, hx_splat(implicit->z), dv);
  if (implicit && implicit->change) nu = hx_motion_add(nu, link_velocity(&implicit->change->motion, joint, slot));
  hxNumber(*to)[HX_SLOTS] = rate->motion.link[joint];
  hx_store_vec3(&to[HX_R], slot, nu.lin);
  hx_store_quat(&to[HX_P], slot, hx_quaternion_rate(hx_link_quat(motion, joint, slot), nu.ang));
  hx_store_vec3(&to[HX_V], slot, dv.lin);
  hx_store_vec3(&to[HX_W], slot, dv.ang);
  hx_store_vec3(rate->link_turn[joint], slot, nu.ang);
}

static inline void fill_motion_slots(hxMotion *motion) {
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int i = 0; i < HX_BODY_STATE; ++i) hx_fill_slots(motion->link[joint][i]);
}

/* Slots that no pack of this width covers go with leg 0, as in every motion. */
static inline void fill_rate_slots(hxRate *rate) {
  if (HX_PACKS * HX_LANES >= HX_SLOTS) return;
  fill_motion_slots(&rate->motion);
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int i = 0; i < 3; ++i) hx_fill_slots(rate->link_turn[joint][i]);
}

static inline void store_bristle_rates(const hxModel *model, const hxContactState *contact, const hxImplicit *implicit, const hxWork *work,
                                       hxMotion *rate) {
  for (int pack = 0; pack < HX_PACKS; ++pack)
    hx_store_vec3(rate->bristle, pack * HX_LANES, bristle_rate(model, contact, implicit, pack, &work->pack[pack]));
  for (int i = 0; i < 3 && HX_PACKS * HX_LANES < HX_SLOTS; ++i) hx_fill_slots(rate->bristle[i]);
}

/* W  what contact damping, friction and gears of all legs take */
typedef struct {
  hxNumber contact, friction, gear;
} hxLossPowers;

static inline hxLossPowers hx_loss_powers(const hxModel *model, const hxWork *work) {
  hxReal contact[HX_PACKS], friction[HX_PACKS], gear[HX_PACKS];
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const hxLegWork *leg = &work->pack[pack];
    const hxNormalForce *f = &leg->foot.normal;
    contact[pack] = (f->force - f->elastic) * leg->foot.kin.ddelta;
    friction[pack] = hx_friction_power(model, &leg->foot);
    gear[pack] = hx_splat(0.0);
    for (int joint = 0; joint < HX_JOINTS; ++joint) gear[pack] -= leg->joint[joint].servo.friction * leg->joint[joint].speed;
  }
  return (hxLossPowers){hx_lane(hx_sum_legs(contact), 0), hx_lane(hx_sum_legs(friction), 0), hx_lane(hx_sum_legs(gear), 0)};
}

/* Powers of motors and pushes, and what contact damping, friction and gears take. They are rates for the
 * solvers of others: a step of ours takes its works from its impulses (eq. 22). */
static inline void store_powers(const hxModel *model, const hxCommand *command, const hxMotion *motion, const hxWork *work,
                                hxMotion *rate) {
  const hxLossPowers losses = hx_loss_powers(model, work);
  hxReal actuator[HX_PACKS];
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const hxJointWork *joint = work->pack[pack].joint;
    actuator[pack] = hx_splat(0.0);
    for (int k = 0; k < HX_JOINTS; ++k) actuator[pack] += joint[k].servo.torque * joint[k].speed;
  }
  rate->actuator_work = hx_lane(hx_sum_legs(actuator), 0);
  rate->dissipated = (losses.contact + losses.friction) + losses.gear;
  rate->push_work = 0.0;
  for (int i = 0; i < 3; ++i)
    rate->push_work += command->push_force[i] * motion->torso[HX_V + i] + command->push_torque[i] * motion->torso[HX_W + i];
}

/* Impulses of a step's forces, summed over its stages. Shape [joint][pack] and [pack], legs in lanes. */
typedef struct {
  hxReal motor[HX_JOINTS][HX_PACKS]; /* N m s  motors on their joints */
  hxReal gear[HX_JOINTS][HX_PACKS];  /* N m s  gear friction on the joints */
  hxVec3 foot[HX_PACKS];             /* N s    ground on feet */
  hxNumber push[6];                  /* N s, N m s  force, then torque on the torso */
} hxImpulses;

/* A stage's share: the forces as the stage's accelerations contain them, with their linearly implicit parts. */
static inline void hx_add_impulses(const hxModel *model, const hxCommand *command, const hxImplicit *implicit, const hxWork *work,
                                   double weight, hxImpulses *sum) {
  const hxReal w = hx_splat(weight);
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const hxLegWork *leg = &work->pack[pack];
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxJointWork *k = &leg->joint[joint];
      hxReal motor = k->servo.torque, gear = k->servo.friction;
      if (implicit && model->servo_mode != HX_SERVO_KINEMATIC) { /* a drive's torque is a multiplier, which has it all */
        const double z = implicit->z;
        const hxReal turned = k->turned + (z * z) * k->qdd, sped = k->sped + z * k->qdd;
        motor -= implicit->slope[pack].motor_stiffness[joint] * turned + implicit->slope[pack].motor_damping[joint] * sped;
        gear -= implicit->slope[pack].gear_drag[joint] * sped;
      }
      sum->motor[joint][pack] += w * motor;
      sum->gear[joint][pack] += w * gear;
    }
    sum->foot[pack] = hx_add_scaled(sum->foot[pack], w, stage_force(model, implicit, pack, leg));
  }
  for (int i = 0; i < 3; ++i) {
    sum->push[i] += weight * command->push_force[i];
    sum->push[3 + i] += weight * command->push_torque[i];
  }
}

/* Positions, velocities and forces at (t, y); work is filled up to the sweeps, with what the multipliers take if they are wanted. */
static inline void hx_dynamics_forces(const hxModel *model, const hxContactState *contact, const hxCommand *command, double t,
                                      const hxMotion *motion, int reactions, hxWork *work) {
  torso_pass(model, motion, work);
  joint_angles(model, motion, work);
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int pack = 0; pack < HX_PACKS; ++pack) link_pass(model, motion, joint, pack * HX_LANES, &work->pack[pack].joint[joint]);
  for (int pack = 0; pack < HX_PACKS; ++pack)
    leg_pass(model, command, t, motion, &work->torso, pack * HX_LANES, reactions, &work->pack[pack]);
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int pack = 0; pack < HX_PACKS; ++pack) joint_torque(model, command, joint, pack * HX_LANES, &work->pack[pack].joint[joint]);
  for (int pack = 0; pack < HX_PACKS; ++pack) leg_foot(model, contact, motion, pack * HX_LANES, &work->pack[pack]);
}

/* Everything at (t, y): work, and dy/dt into rate. With implicit, rate is k/h of that stage (eq. 15) instead. The multipliers are found when
 * asked for, and in kinematic mode. */
static void hx_dynamics_evaluate(const hxModel *model, const hxContactState *contact, const hxCommand *command, double t,
                                 const hxMotion *motion, hxImplicit *implicit, int multipliers, hxWork *work, hxRate *rate) {
  hxInertia6 I[HX_PACKS];
  hxForce6 p[HX_PACKS];
  const int reactions = multipliers || model->servo_mode == HX_SERVO_KINEMATIC;
  hx_dynamics_forces(model, contact, command, t, motion, reactions, work);
  for (int pack = 0; implicit && pack < HX_PACKS; ++pack) {
    if (!implicit->change) keep_slopes(model, contact, pack, &work->pack[pack], implicit);
    leg_response(implicit, motion, pack, &work->pack[pack]);
    if (has_bristles(model)) bristle_response(implicit, pack, &work->pack[pack]);
  }

  /* leaf to root, the torso, root to leaf; packs side by side, for one's operations fill the other's waits */
  for (int joint = HX_JOINTS - 1; joint >= 0; --joint)
    for (int pack = 0; pack < HX_PACKS; ++pack) sweep_inertia(model, implicit, joint, pack, &work->pack[pack], &I[pack]);
  for (int pack = 0; pack < HX_PACKS; ++pack) p[pack] = (hxForce6){hx_zero3(), hx_zero3()};
  for (int joint = HX_JOINTS - 1; joint >= 0; --joint)
    for (int pack = 0; pack < HX_PACKS; ++pack) sweep_force(&work->pack[pack].joint[joint], &p[pack]);
  work->torso_acceleration = torso_acceleration(model, command, work, I, p);
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    hxMotion6 a = work->torso_acceleration;
    for (int joint = 0; joint < HX_JOINTS; ++joint) sweep_motion(&work->pack[pack].joint[joint], &a);
    if (reactions) leg_multipliers(model, implicit, pack, &work->pack[pack]);
  }
  store_torso_rate(model, motion, implicit, work, rate);
  for (int pack = 0; pack < HX_PACKS; ++pack)
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      store_link_rate(model, motion, implicit, joint, pack * HX_LANES, &work->pack[pack].joint[joint], rate);
  if (has_bristles(model)) store_bristle_rates(model, contact, implicit, work, &rate->motion);
  fill_rate_slots(rate);
  if (!implicit)
    store_powers(model, command, motion, work, &rate->motion);
  else
    rate->motion.actuator_work = rate->motion.push_work = rate->motion.dissipated = 0.0;
}

#endif
