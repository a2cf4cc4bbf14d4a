/* dynamics.h - exact O(n) solution of eq. 1: Newton-Euler equations with multipliers and Baumgarte
 * terms on the tree of 19 bodies
 *
 * forces.h computes the forces; stage.h turns dy/dt into the stage of a linearly implicit method.
 * Conventions are those of forces.h.
 */
#ifndef HX_DYNAMICS_H
#define HX_DYNAMICS_H

#include "stage.h"

/* ---- the sweeps (eq. 10) and the multipliers (eq. 11) ---- */

/* Returns 1/d of eq. 10, d = S.U + the joint's own resistance; 0 for a kinematic drive. */
static inline hxReal sweep_inverse(const hxModel *model, const hxSweep *sweep, hxReal resists) {
  return model->servo_mode == HX_SERVO_KINEMATIC ? hx_splat(0.0)
                                                 : 1.0 / (hx_power(sweep->U, sweep->S) + resists);
}

/* Returns the inertia of a link about the torso's centre of mass. */
static inline hxRigid6 link_inertia(const hxModel *model, const hxJointWork *k, int joint,
                                    int slot) {
  return hx_rigid_inertia(hx_load(&model->joint[joint].mass[slot]), k->J, k->c);
}

/* Adds the coupling of a rotor and its parent to U (eq. 55). */
HX_RARE void couple_rotor(const hxModel *model, hxSweep *sweep) {
  sweep->U.ang = hx_add_scaled(sweep->U.ang, hx_splat(model->spin_inertia), sweep->S.ang);
}

/* Adds the link's own inertia, computes U = I S, and passes I - U U^T/d to the parent
 * (eq. 10). */
static inline void sweep_sum(const hxModel *model, const hxRigid6 *own, hxReal resists,
                             hxSweep *sweep, hxInertia6 *I) {
  hx_inertia_add_rigid(I, own);
  sweep->U = hx_inertia_mul(I, sweep->S);
  sweep->inverse_d = sweep_inverse(model, sweep, resists);
  if (model->spin) couple_rotor(model, sweep);
  hx_inertia_downdate(I, sweep->inverse_d, sweep->U);
}

/* Adds the contacts of a tibia with several rows of them to its inertia, and passes it on. */
HX_RARE void sweep_rows(const hxModel *model, const hxImplicit *implicit, int pack,
                        const hxRigid6 *own, const hxReal *resists, hxLegWork *leg, hxInertia6 *I) {
  row_inertia(model, implicit, pack, HX_FOOT, leg, I);
  for (int k = 1; k < leg->rows; ++k) {
    hxInertia6 row;
    row_inertia(model, implicit, pack, leg->row[k], leg, &row);
    *I = hx_inertia_add(I, &row);
  }
  sweep_sum(model, own, *resists, &leg->joint[HX_JOINTS - 1].sweep, I);
}

/* Computes U = I S of a link with all it carries, and passes I - U U^T/d to the parent (eq. 10). */
static inline void sweep_inertia(const hxModel *model, const hxImplicit *implicit, int joint,
                                 int pack, hxLegWork *leg, hxInertia6 *I) {
  hxJointWork *k = &leg->joint[joint];
  hxSweep *sweep = &k->sweep;
  const hxRigid6 own = link_inertia(model, k, joint, pack * HX_LANES);
  hxReal resists = hx_splat(model->rotor_inertia);
  if (implicit) {
    const double z = implicit->z;
    resists += z * joint_damping(model, implicit, pack, joint) +
               (z * z) * joint_stiffness(model, implicit, pack, joint);
    if (joint == HX_JOINTS - 1 && leg->rows > 1) {
      sweep_rows(model, implicit, pack, &own, &resists, leg, I);
      return;
    }
    if (joint == HX_JOINTS - 1) row_inertia(model, implicit, pack, HX_FOOT, leg, I);
  } else if (joint == HX_JOINTS - 1 && model->spin) {
    memset(I, 0, sizeof *I);
  } else if (joint == HX_JOINTS - 1) {
    sweep->U = hx_rigid_mul(&own, sweep->S);
    sweep->inverse_d = sweep_inverse(model, sweep, resists);
    *I = hx_rigid_downdate(&own, sweep->inverse_d, sweep->U);
    return;
  }
  sweep_sum(model, &own, resists, sweep, I);
}

/* Computes u = torque - S.p, and passes p + U u/d to the parent (eq. 10). */
static inline void sweep_force(const hxModel *model, hxJointWork *k, hxForce6 *p) {
  hxSweep *sweep = &k->sweep;
  *p = hx_force_add(*p, k->p);
  sweep->u = k->torque - hx_power(*p, sweep->S);
  *p = hx_force_add_scaled(*p, sweep->inverse_d * sweep->u, sweep->U);
  if (model->spin) p->ang = hx_add3(p->ang, sweep->passed);
}

/* Computes the acceleration of a rotor from those of its joint and of the body that carries it
 * (eq. 54). */
HX_RARE void rotor_motion(hxReal qdd, const hxMotion6 *a, hxJointWork *k) {
  k->rotor.carrier += hx_dot(k->sweep.S.ang, a->ang);
  k->rotor.acceleration = qdd + k->driven;
}

/* Computes qdd = (u - U.a)/d, and passes a + S qdd to the child, without its bias: the second sweep
 * (eq. 8). */
static inline void sweep_motion(const hxModel *model, hxJointWork *k, hxMotion6 *a) {
  const hxSweep *sweep = &k->sweep;
  const hxReal qdd = sweep->inverse_d * (sweep->u - hx_power(sweep->U, *a));
  if (model->spin) rotor_motion(qdd, a, k);
  *a = hx_motion_add_scaled(*a, qdd, sweep->S);
  k->qdd = qdd + k->driven;
  const hxMotion6 felt = hx_motion_add(*a, k->bias);
  k->acceleration = (hxMotion6){felt.ang, motion_at(felt, k->c)};
}

/* Computes the multipliers from leaf to root (eq. 11): D_kk^T lambda_k = g_k - M_k dv_k - sum over
 * children c of D_ck^T lambda_c. About the joint's point the torque is -(u1 lambda_4 + u2 lambda_5)
 * and the component along the axis, with u1 = a x s, u2 = b x s. */
static inline void leg_multipliers(const hxModel *model, const hxImplicit *implicit, int pack,
                                   int pairs, hxLegWork *leg) {
  const int slot = pack * HX_LANES;
  /* at the link's centre of mass: from the ground, then from the child and from other legs */
  hxForce6 handed = row_wrench(model, implicit, pack, HX_FOOT, leg);
  if (leg->rows > 1) handed = hx_force_add(handed, further_wrenches(model, implicit, pack, leg));
  for (int joint = HX_JOINTS - 1; joint >= 0; --joint) {
    hxJointWork *k = &leg->joint[joint];
    const hxJointKinematics *kin = &k->reaction.kin;
    if (pairs && joint > 0) handed = hx_force_add(handed, leg->by_legs[joint - 1]);
    const hxVec3 lin =
        hx_add_scaled(handed.lin, -hx_load(&model->joint[joint].mass[slot]), k->acceleration.lin);
    const hxVec3 ang =
        hx_sub3(hx_add3(k->gyroscopic, handed.ang), hx_sym_mul(k->J, k->acceleration.ang));
    const hxVec3 about_joint = hx_sub3(ang, hx_cross(kin->sP_j, lin));
    const hxReal along = hx_dot(about_joint, kin->s), inverse_sz = 1.0 / kin->sz;
    if (model->servo_mode == HX_SERVO_KINEMATIC) { /* the drive's torque is a multiplier (eq. 13) */
      k->torque = model->rotor_inertia * k->qdd - along;
      if (model->spin) k->torque += model->spin_inertia * k->rotor.carrier;
      k->servo.torque = k->torque - k->servo.friction;
    }
    k->reaction.lambda_lin = lin;
    k->reaction.lambda[0] = (along * kin->sy - hx_dot(about_joint, k->body.R_WB.y)) * inverse_sz;
    k->reaction.lambda[1] = (hx_dot(about_joint, k->body.R_WB.x) - along * kin->sx) * inverse_sz;
    handed = (hxForce6){hx_add3(about_joint, hx_cross(kin->sP_i, lin)), lin};
    if (model->spin && joint > 0) { /* the rotor's momentum is the parent's to change (eq. 54) */
      const hxVec3 turned = hx_cross(leg->joint[joint - 1].body.w, kin->s);
      const hxVec3 change =
          hx_add3(hx_scale(k->rotor.acceleration, kin->s), hx_scale(k->speed, turned));
      handed.ang = hx_add_scaled(handed.ang, hx_splat(-model->spin_inertia), change);
    }
  }
}

/* ---- the torso ---- */

/* Sums n consecutive numbers of each pack's struct over the legs; the sums are in every lane. */
static inline void sum_packs(const hxReal *first, size_t stride, int n, hxReal *sum) {
  for (int i = 0; i < n; ++i) {
    hxReal x[HX_PACKS];
    for (int k = 0; k < HX_PACKS; ++k) x[k] = first[(size_t)k * stride + (size_t)i];
    sum[i] = hx_sum_legs(x);
  }
}

/* Adds the sum of n consecutive numbers of each pack's struct over the torso's contacts to the
 * first leg's numbers. */
static inline void add_slots(const hxReal *first, int n, hxReal *sum) {
  for (int i = 0; i < n; ++i) {
    hxReal x[HX_TORSO_PACKS];
    hxNumber lanes[HX_LANES] = {0.0};
    for (int k = 0; k < HX_TORSO_PACKS; ++k) x[k] = first[k * n + i];
    lanes[0] = hx_sum_slots(x);
    sum[i] += hx_load(lanes);
  }
}

/* Adds p and the blocks of the torso's contacts to what the first leg passes to the torso. */
HX_RARE void add_torso_contacts(const hxModel *model, const hxImplicit *implicit, hxWork *work,
                                hxInertia6 *I, hxForce6 *p) {
  enum { INERTIA = sizeof(hxInertia6) / sizeof(hxReal), FORCE = sizeof(hxForce6) / sizeof(hxReal) };
  hxInertia6 blocks[HX_TORSO_PACKS];
  for (int pack = 0; implicit && pack < HX_TORSO_PACKS; ++pack) {
    const hxContactWork *contact = &work->torso_contact[pack];
    const hxContactBlock B = contact_block(implicit, &implicit->torso_slope[pack], contact);
    blocks[pack] =
        contact_inertia(&B, contact->kin.arm, hx_splat_vec3(model->gravity), &work->torso_p[pack]);
  }
  if (implicit) add_slots(&blocks->C.xx, INERTIA, &I->C.xx);
  add_slots(&work->torso_p->ang.x, FORCE, &p->ang.x);
}

/* Solves the torso's row of eq. 1 with what the legs pass to it (eq. 10):
 * (I + sum of legs) (dv - g) = push and gyroscopic torque - sum of legs. */
static inline hxMotion6 torso_acceleration(const hxModel *model, const hxCommand *command,
                                           const hxWork *work, const hxInertia6 *I,
                                           const hxForce6 *p) {
  enum { INERTIA = sizeof(hxInertia6) / sizeof(hxReal), FORCE = sizeof(hxForce6) / sizeof(hxReal) };
  const hxReal m = hx_splat(model->torso_mass), o = hx_splat(0.0);
  const hxVec3 gyroscopic = hx_cross(hx_sym_mul(work->torso_J, work->torso.w), work->torso.w);
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
  const hxVec3 torque =
      hx_sub3(hx_add3(hx_splat_vec3(command->push_torque), gyroscopic), legs.f.ang);
  return hx_inertia_solve(
      &A.I, (hxForce6){torque, hx_sub3(hx_splat_vec3(command->push_force), legs.f.lin)});
}

/* ---- dy/dt ---- */

/* Returns the acceleration a from a - g. */
static inline hxMotion6 with_gravity(const hxModel *model, hxMotion6 felt) {
  return (hxMotion6){felt.ang, hx_add3(felt.lin, hx_splat_vec3(model->gravity))};
}

/* Stores the torso's rates. Positions advance with nu of eq. 20: v + z dv + s_v in a linearly
 * implicit stage, else v. */
static inline void store_torso_rate(const hxModel *model, const hxPlantMotion *motion,
                                    const hxImplicit *implicit, const hxWork *work, hxRate *rate) {
  const hxMotion6 dv = with_gravity(model, work->torso_acceleration);
  hxMotion6 nu = torso_velocity(motion);
  if (implicit) nu = hx_motion_add_scaled(nu, hx_splat(implicit->z), dv);
  if (implicit && implicit->change)
    nu = hx_motion_add(nu, torso_velocity(&implicit->change->motion));
  const hxVec3 v = nu.lin, w = nu.ang;
  const hxQuat dp = hx_quaternion_rate(hx_torso_quat(motion), w);
  const hxReal entries[HX_BODY_STATE] = {v.x,      v.y,      v.z,      dp.w,     dp.x,
                                         dp.y,     dp.z,     dv.lin.x, dv.lin.y, dv.lin.z,
                                         dv.ang.x, dv.ang.y, dv.ang.z};
  for (int i = 0; i < HX_BODY_STATE; ++i) rate->motion.torso[i] = hx_lane(entries[i], 0);
  rate->torso_turn[0] = hx_lane(w.x, 0), rate->torso_turn[1] = hx_lane(w.y, 0),
  rate->torso_turn[2] = hx_lane(w.z, 0);
  for (int i = 3; i < 8; ++i) rate->torso_turn[i] = 0.0;
}

/* Stores a link's rates, with nu of eq. 20 as for the torso. */
static inline void store_link_rate(const hxModel *model, const hxPlantMotion *motion,
                                   const hxImplicit *implicit, int joint, int slot,
                                   const hxJointWork *k, hxRate *rate) {
  const hxMotion6 dv = with_gravity(model, k->acceleration);
  hxMotion6 nu = link_velocity(motion, joint, slot);
  if (implicit) nu = hx_motion_add_scaled(nu, hx_splat(implicit->z), dv);
  if (implicit && implicit->change)
    nu = hx_motion_add(nu, link_velocity(&implicit->change->motion, joint, slot));
  hxNumber(*to)[HX_SLOTS] = rate->motion.link[joint];
  hx_store_vec3(&to[HX_R], slot, nu.lin);
  hx_store_quat(&to[HX_P], slot, hx_quaternion_rate(hx_link_quat(motion, joint, slot), nu.ang));
  hx_store_vec3(&to[HX_V], slot, dv.lin);
  hx_store_vec3(&to[HX_W], slot, dv.ang);
  hx_store_vec3(rate->link_turn[joint], slot, nu.ang);
}

/* Copies leg 0 into the unused slots of a motion's links. */
static inline void fill_motion_slots(hxPlantMotion *motion) {
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int i = 0; i < HX_BODY_STATE; ++i) hx_fill_slots(motion->link[joint][i]);
}

/* Copies leg 0 into the slots that no pack of this width covers. */
static inline void fill_rate_slots(hxRate *rate) {
  if (HX_PACKS * HX_LANES >= HX_SLOTS) return;
  fill_motion_slots(&rate->motion);
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int i = 0; i < 3; ++i) hx_fill_slots(rate->link_turn[joint][i]);
}

/* Stores db/dt of all feet. */
static inline void store_bristle_rates(const hxModel *model, const hxContactState *contact,
                                       const hxImplicit *implicit, const hxWork *work,
                                       hxPlantMotion *rate) {
  for (int pack = 0; pack < HX_PACKS; ++pack)
    hx_store_vec3(rate->bristle, pack * HX_LANES,
                  stage_bristle_rate(model, contact, implicit, pack, &work->pack[pack]));
  for (int i = 0; i < 3 && HX_PACKS * HX_LANES < HX_SLOTS; ++i) hx_fill_slots(rate->bristle[i]);
}

/* Powers that contact damping, friction, and gears with stops of all legs dissipate, W. */
typedef struct {
  hxNumber contact, friction, gear;
} hxLossPowers;

/* Returns the power that the damping of a row of contacts dissipates, W. */
HX_INLINE hxReal damping_power(const hxContactWork *contact) {
  return (contact->normal.force - contact->normal.elastic) * contact->kin.ddelta;
}

/* Adds the powers that the torso's contacts dissipate. */
HX_RARE void add_torso_losses(const hxModel *model, const hxWork *work, hxLossPowers *losses) {
  hxReal contact[HX_TORSO_PACKS], friction[HX_TORSO_PACKS];
  for (int pack = 0; pack < HX_TORSO_PACKS; ++pack) {
    contact[pack] = damping_power(&work->torso_contact[pack]);
    friction[pack] = hx_friction_power(model, HX_TORSO, &work->torso_contact[pack]);
  }
  losses->contact += hx_sum_slots(contact);
  losses->friction += hx_sum_slots(friction);
}

/* Adds the powers that contacts between legs dissipate. */
HX_RARE void add_pair_losses(const hxModel *model, const hxWork *work, hxLossPowers *losses) {
  for (int pair = 0; pair < HX_PAIR_ROWS; ++pair) {
    hxReal contact[HX_PACKS], friction[HX_PACKS];
    for (int pack = 0; pack < HX_PACKS; ++pack) {
      contact[pack] = damping_power(&work->pair[pair][pack]);
      friction[pack] = hx_friction_power(model, HX_PAIR + pair, &work->pair[pair][pack]);
    }
    losses->contact += hx_lane(hx_sum_legs(contact), 0);
    losses->friction += hx_lane(hx_sum_legs(friction), 0);
  }
}

/* Returns the power that spin and rolling friction of all rows of a leg's foot dissipates, W. */
HX_RARE hxReal turning_power(const hxLegWork *leg) {
  hxReal power = hx_splat(0.0);
  for (int k = 0; k < leg->rows; ++k)
    if (leg->row[k] < HX_FOOT_ROWS)
      power -= hx_dot(leg->contact[leg->row[k]].moment, leg->joint[HX_JOINTS - 1].body.w);
  return power;
}

/* Returns the sums of the powers that all contacts, friction and gears dissipate. */
static inline hxLossPowers hx_loss_powers(const hxModel *model, const hxWork *work) {
  hxReal contact[HX_PACKS], friction[HX_PACKS], gear[HX_PACKS];
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const hxLegWork *leg = &work->pack[pack];
    contact[pack] = damping_power(&leg->contact[HX_FOOT]);
    friction[pack] = hx_friction_power(model, HX_FOOT, &leg->contact[HX_FOOT]);
    if (has_turning_friction(model, HX_FOOT)) friction[pack] += turning_power(leg);
    gear[pack] = hx_splat(0.0);
    for (int k = 1; k < leg->rows; ++k) {
      contact[pack] += damping_power(&leg->contact[leg->row[k]]);
      friction[pack] += hx_friction_power(model, leg->row[k], &leg->contact[leg->row[k]]);
    }
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      gear[pack] -= leg->joint[joint].servo.friction * leg->joint[joint].speed;
      if (model->stops) gear[pack] += leg->joint[joint].stop.damped * leg->joint[joint].speed;
    }
  }
  hxLossPowers losses = {hx_lane(hx_sum_legs(contact), 0), hx_lane(hx_sum_legs(friction), 0),
                         hx_lane(hx_sum_legs(gear), 0)};
  if (work->torso_rows) add_torso_losses(model, work, &losses);
  if (work->pair_rows) add_pair_losses(model, work, &losses);
  return losses;
}

/* Stores the powers of motors, pushes and losses. They are rates for an importer's solver: a step
 * of this integrator computes its works from its impulses (eq. 27). */
static inline void store_powers(const hxModel *model, const hxCommand *command,
                                const hxPlantMotion *motion, const hxWork *work,
                                hxPlantMotion *rate) {
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
    rate->push_work += command->push_force[i] * motion->torso[HX_V + i] +
                       command->push_torque[i] * motion->torso[HX_W + i];
}

/* Impulses of a step's forces, summed over its stages. Shape [joint][pack] and [pack], legs in
 * lanes. */
typedef struct {
  hxReal motor[HX_JOINTS][HX_PACKS];       /* N m s        motors on their joints */
  hxReal gear[HX_JOINTS][HX_PACKS];        /* N m s        gear friction on the joints */
  hxNumber push[6];                        /* N s, N m s   force, then torque on the torso */
  hxVec3 contact[HX_TIBIA_ROWS][HX_PACKS]; /* N s    ground on feet and tibias */
  hxVec3 torso[HX_TORSO_PACKS];            /* N s    ground on the torso's points */
  hxReal stop[HX_JOINTS][HX_PACKS];        /* N m s  stops on the joints */
  hxVec3 moment[HX_FOOT_ROWS][HX_PACKS];   /* N m s  spin and rolling friction on tibias */
  hxVec3 pair[HX_PAIR_ROWS][HX_PACKS];     /* N s    each leg's next leg on it */
} hxImpulses;

/* Sets the impulses to 0; those of other contacts than feet, of stops and of moments only where
 * the model has some. */
static inline void hx_clear_impulses(const hxModel *model, hxImpulses *sum) {
  memset(sum, 0, offsetof(hxImpulses, contact) + sizeof sum->contact[HX_FOOT]);
  if (model->rows > 1) memset(&sum->contact[1], 0, sizeof sum->contact - sizeof sum->contact[0]);
  if (model->torso_rows) memset(sum->torso, 0, sizeof sum->torso);
  if (model->stops) memset(sum->stop, 0, sizeof sum->stop);
  if (has_turning_friction(model, HX_FOOT)) memset(sum->moment, 0, sizeof sum->moment);
  if (model->pair_rows) memset(sum->pair, 0, sizeof sum->pair);
}

/* Adds a stage's impulses of the stops of a leg. */
HX_RARE void add_stop_impulses(const hxImplicit *implicit, int pack, const hxLegWork *leg, double w,
                               hxImpulses *sum) {
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    const hxJointWork *k = &leg->joint[joint];
    hxReal torque = k->stop.torque;
    if (implicit) {
      const double z = implicit->z;
      torque -= implicit->slope[pack].stop_stiffness[joint] * (k->angle_shift + (z * z) * k->qdd) +
                implicit->slope[pack].stop_damping[joint] * (k->speed_shift + z * k->qdd);
    }
    sum->stop[joint][pack] += w * torque;
  }
}

/* Adds a stage's impulses of the spin and rolling friction of a leg. */
HX_RARE void add_moment_impulses(const hxImplicit *implicit, int pack, const hxLegWork *leg,
                                 double w, hxImpulses *sum) {
  for (int k = 0; k < leg->rows && leg->row[k] < HX_FOOT_ROWS; ++k) {
    hxVec3 *moment = &sum->moment[leg->row[k]][pack];
    const hxVec3 stage = row_stage_moment(implicit, pack, leg->row[k], leg);
    *moment = hx_add_scaled(*moment, hx_splat(w), stage);
  }
}

/* Adds a stage's impulses of a row of contacts on the tibias. */
HX_INLINE void add_row_impulse(const hxModel *model, const hxImplicit *implicit, int pack, int row,
                               const hxLegWork *leg, hxReal w, hxImpulses *sum) {
  hxVec3 *contact = &sum->contact[row][pack];
  *contact = hx_add_scaled(*contact, w, row_stage_force(model, implicit, pack, row, leg));
}

/* Adds a stage's impulses of all other contacts than the feet's first row. */
HX_RARE void add_further_impulses(const hxModel *model, const hxImplicit *implicit,
                                  const hxWork *work, double weight, hxImpulses *sum) {
  const hxReal w = hx_splat(weight);
  for (int pack = 0; pack < HX_PACKS; ++pack)
    for (int k = 1; k < work->pack[pack].rows; ++k)
      add_row_impulse(model, implicit, pack, work->pack[pack].row[k], &work->pack[pack], w, sum);
  for (int pack = 0; work->torso_rows && pack < HX_TORSO_PACKS; ++pack)
    sum->torso[pack] =
        hx_add_scaled(sum->torso[pack], w,
                      stage_force(model, implicit, implicit ? &implicit->torso_slope[pack] : NULL,
                                  work->torso_acceleration, &work->torso_contact[pack]));
  for (int pair = 0; work->pair_rows && pair < HX_PAIR_ROWS; ++pair)
    for (int pack = 0; pack < HX_PACKS; ++pack)
      sum->pair[pair][pack] = hx_add_scaled(sum->pair[pair][pack], w, work->pair[pair][pack].force);
}

/* Adds a stage's impulses (eq. 27): weight times the forces that the stage's accelerations contain,
 * with their linearly implicit parts. */
static inline void hx_add_impulses(const hxModel *model, const hxCommand *command,
                                   const hxImplicit *implicit, const hxWork *work, double weight,
                                   hxImpulses *sum) {
  const hxReal w = hx_splat(weight);
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const hxLegWork *leg = &work->pack[pack];
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxJointWork *k = &leg->joint[joint];
      hxReal motor = k->servo.torque, gear = k->servo.friction;
      /* the torque of a kinematic drive is a multiplier, which contains these parts */
      if (implicit && model->servo_mode != HX_SERVO_KINEMATIC) {
        const double z = implicit->z;
        const hxReal angle_shift = k->angle_shift + (z * z) * k->qdd,
                     speed_shift = k->speed_shift + z * k->qdd;
        motor -= implicit->slope[pack].motor_stiffness[joint] * angle_shift +
                 implicit->slope[pack].motor_damping[joint] * speed_shift;
        gear -= implicit->slope[pack].gear_drag[joint] * speed_shift;
      }
      sum->motor[joint][pack] += w * motor;
      sum->gear[joint][pack] += w * gear;
    }
    add_row_impulse(model, implicit, pack, HX_FOOT, leg, w, sum);
    if (model->stops) add_stop_impulses(implicit, pack, leg, weight, sum);
    if (has_turning_friction(model, HX_FOOT)) add_moment_impulses(implicit, pack, leg, weight, sum);
  }
  if (model->listed > 1) add_further_impulses(model, implicit, work, weight, sum);
  for (int i = 0; i < 3; ++i) {
    sum->push[i] += weight * command->push_force[i];
    sum->push[3 + i] += weight * command->push_torque[i];
  }
}

/* What an evaluation computes: dy/dt; the multipliers (in kinematic mode always); open contacts */
typedef enum { HX_RATES, HX_WITH_MULTIPLIERS, HX_WITH_OPEN_CONTACTS } hxWanted;

/* Evaluates the equations of motion at (t, y): fills work, and stores dy/dt in rate; with implicit,
 * k/h of that stage (eq. 19) instead. known: what is known of the motion, or NULL. */
static void hx_dynamics_evaluate(const hxModel *model, const hxContactState *contact,
                                 const hxCommand *command, double t, const hxPlantMotion *motion,
                                 const hxKnown *known, hxImplicit *implicit, hxWanted wanted,
                                 hxWork *work, hxRate *rate) {
  hxInertia6 I[HX_PACKS];
  hxForce6 p[HX_PACKS];
  const int reactions = wanted != HX_RATES || model->servo_mode == HX_SERVO_KINEMATIC;
  hx_dynamics_forces(model, contact, command, t, motion, known, reactions,
                     wanted == HX_WITH_OPEN_CONTACTS, work);
  /* the stage's response to the shifts (eq. 20, 21) */
  for (int pack = 0; implicit && pack < HX_PACKS; ++pack) {
    if (!implicit->change) keep_slopes(model, contact, pack, &work->pack[pack], implicit);
    leg_response(model, implicit, motion, pack, &work->pack[pack]);
    if (has_bristles(model, HX_FOOT)) bristle_response(implicit, pack, HX_FOOT, &work->pack[pack]);
  }
  if (implicit && work->torso_rows) torso_response(model, contact, motion, implicit, work);

  for (int pack = 0; model->spin && pack < HX_PACKS; ++pack)
    rotor_coupling(model, &work->pack[pack]);

  /* sweeps: leaf to root, the torso, root to leaf. Packs alternate, so that the operations of one
   * overlap the latency of the other. */
  for (int joint = HX_JOINTS - 1; joint >= 0; --joint)
    for (int pack = 0; pack < HX_PACKS; ++pack)
      sweep_inertia(model, implicit, joint, pack, &work->pack[pack], &I[pack]);
  for (int pack = 0; pack < HX_PACKS; ++pack) p[pack] = (hxForce6){hx_zero3(), hx_zero3()};
  for (int joint = HX_JOINTS - 1; joint >= 0; --joint)
    for (int pack = 0; pack < HX_PACKS; ++pack)
      sweep_force(model, &work->pack[pack].joint[joint], &p[pack]);
  if (work->torso_rows) add_torso_contacts(model, implicit, work, I, p);
  work->torso_acceleration = torso_acceleration(model, command, work, I, p);
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    hxMotion6 a = work->torso_acceleration;
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      sweep_motion(model, &work->pack[pack].joint[joint], &a);
    if (reactions) leg_multipliers(model, implicit, pack, work->pair_rows, &work->pack[pack]);
  }
  /* dy/dt, or k/h of the stage */
  store_torso_rate(model, motion, implicit, work, rate);
  for (int pack = 0; pack < HX_PACKS; ++pack)
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      store_link_rate(model, motion, implicit, joint, pack * HX_LANES,
                      &work->pack[pack].joint[joint], rate);
  if (has_bristles(model, HX_FOOT))
    store_bristle_rates(model, contact, implicit, work, &rate->motion);
  fill_rate_slots(rate);
  if (!implicit)
    store_powers(model, command, motion, work, &rate->motion);
  else
    rate->motion.actuator_work = rate->motion.push_work = rate->motion.dissipated = 0.0;
}

#endif
