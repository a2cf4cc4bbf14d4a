/* forces.h - kinematics of bodies and joints at (t, y), and the forces on them
 *
 * Every function processes all legs of a pack at once. Points and spatial vectors are relative to
 * the torso's centre of mass. Accelerations are a - g until they are stored, so that gravity needs
 * no force.
 */
#ifndef HX_FORCES_H
#define HX_FORCES_H

#include "clearance.h"
#include "work.h"

/* ---- root to leaf: kinematics and forces ---- */

/* Sums along a leg, up to the present link. */
typedef struct {
  hxVec3 c, dc, ddc; /* centre of mass from the torso's by the joints alone, its first rate, its
                        second rate without angular accelerations */
  hxMotion6 bias;    /* sums of dw and P x dw */
} hxChain;

/* Returns the acceleration of a kinematic drive: the rheonomic constraint q = q_ref + qd_ref s +
 * qdd_ref s^2/2, s = t - t_command, with Baumgarte terms (eq. 13). */
static inline hxReal drive_acceleration(const hxModel *model, const hxCommand *command, double t,
                                        int joint, int slot, const hxJointWork *k) {
  const hxReal angle_ref = hx_load(&command->angle[joint][slot]),
               speed_ref = hx_load(&command->speed[joint][slot]);
  const hxReal acceleration_ref = hx_load(&command->acceleration[joint][slot]);
  const hxNumber since = t - command->time;
  const hxReal error =
      k->angle - (angle_ref + since * (speed_ref + (0.5 * since) * acceleration_ref));
  const hxReal slower = k->speed - (speed_ref + since * acceleration_ref);
  return acceleration_ref - 2.0 * model->alpha * slower - model->beta * model->beta * error;
}

/* Returns dw of eq. 9: rows 4 and 5 of D dw are c (eq. 7), and s.dw is 0 or the drive's qdd.
 * Without x = w_i x w_j, gamma (eq. 3) is Phi |w|^2 - w qd of the relative angular
 * velocity w_ij_j; the rest is solved in the child's axes. */
static inline hxVec3 joint_bias(const hxModel *model, const hxJointKinematics *kin, hxVec3 w_i,
                                const hxBody *j, hxReal speed, hxReal driven) {
  const hxMat3 *R_Wj = &j->R_WB;
  const hxVec3 w_ij_j = hx_tmul(*R_Wj, hx_sub3(j->w, w_i)), x = hx_cross(w_i, j->w);
  const hxReal twice = hx_splat(2.0 * model->alpha),
               rest = hx_dot(w_ij_j, w_ij_j) - model->beta * model->beta;
  const hxReal along = driven - hx_dot(kin->s, x), inverse_sz = 1.0 / kin->sz;
  const hxReal c4 =
      kin->sx * rest - w_ij_j.x * speed - twice * (kin->sy * w_ij_j.z - kin->sz * w_ij_j.y);
  const hxReal c5 =
      kin->sy * rest - w_ij_j.y * speed - twice * (kin->sz * w_ij_j.x - kin->sx * w_ij_j.z);
  const hxReal dz = kin->sz * along + kin->sy * c4 - kin->sx * c5;
  const hxReal dx = (c5 + kin->sx * dz) * inverse_sz, dy = (kin->sy * dz - c4) * inverse_sz;
  const hxVec3 d_j = {dx, dy, dz};
  return hx_add3(x, hx_mul(*R_Wj, d_j));
}

/* Returns the linear part at c of a motion about the torso's centre of mass. */
static inline hxVec3 motion_at(hxMotion6 a, hxVec3 c) { return hx_add3(a.lin, hx_cross(a.ang, c)); }

/* Computes orientation, inertia in world axes and gyroscopic torque of a link. */
static inline void link_pass(const hxModel *model, const hxPlantMotion *motion, int joint, int slot,
                             hxJointWork *k) {
  k->body = hx_link_body(motion, joint, slot);
  k->J = hx_rotate_sym3(k->body.R_WB, hx_load_sym3(model->joint[joint].inertia, slot));
  k->gyroscopic = hx_cross(hx_sym_mul(k->J, k->body.w), k->body.w);
}

/* Computes position, velocity, bias acceleration and bias force of a joint's child. */
static inline void joint_pass(const hxModel *model, const hxCommand *command, double t,
                              const hxPlantMotion *motion, int joint, int slot, int reactions,
                              const hxBody *i, hxChain *chain, hxJointWork *k) {
  const hxJointModel *m = &model->joint[joint];
  const hxBody *j = &k->body;
  const hxJointKinematics kin = hx_joint_kinematics(m, slot, i, j);
  const hxVec3 P = hx_add3(chain->c, kin.sP_i);
  const hxVec3 dsP_i = hx_cross(i->w, kin.sP_i), dsP_j = hx_cross(j->w, kin.sP_j);
  chain->c = hx_sub3(P, kin.sP_j);
  chain->dc = hx_add3(chain->dc, hx_sub3(dsP_i, dsP_j));
  chain->ddc = hx_add3(chain->ddc, hx_sub3(hx_cross(i->w, dsP_i), hx_cross(j->w, dsP_j)));
  k->c = chain->c;
  k->sweep.S = (hxMotion6){kin.s, hx_cross(P, kin.s)};
  k->speed = hx_dot(kin.s, hx_sub3(j->w, i->w));
  k->driven = model->servo_mode == HX_SERVO_KINEMATIC
                  ? drive_acceleration(model, command, t, joint, slot, k)
                  : hx_splat(0.0);

  /* rows 1-3 of a_k, summed along the leg: ddc - 2 alpha (v_j - v_0 - dc) - beta^2 (r_j - r_0 - c)
   */
  const hxVec3 dw = joint_bias(model, &kin, i->w, j, k->speed, k->driven);
  const hxVec3 drift = hx_sub3(
      hx_sub3(hx_link_vec3(motion, joint, HX_R, slot), hx_torso_vec3(motion, HX_R)), chain->c);
  const hxVec3 drift_rate = hx_sub3(
      hx_sub3(hx_link_vec3(motion, joint, HX_V, slot), hx_torso_vec3(motion, HX_V)), chain->dc);
  const hxVec3 rows =
      hx_add_scaled(hx_add_scaled(chain->ddc, hx_splat(-2.0 * model->alpha), drift_rate),
                    hx_splat(-model->beta * model->beta), drift);
  chain->bias.ang = hx_add3(chain->bias.ang, dw);
  chain->bias.lin = hx_add3(chain->bias.lin, hx_cross(P, dw));
  k->bias = (hxMotion6){chain->bias.ang, hx_add3(chain->bias.lin, rows)};

  /* p of the child: (J dw + w x (J w), m a) at its centre of mass */
  const hxVec3 lin = hx_scale(hx_load(&m->mass[slot]), motion_at(k->bias, chain->c));
  const hxVec3 ang = hx_sub3(hx_sym_mul(k->J, k->bias.ang), k->gyroscopic);
  k->p = (hxForce6){hx_add3(ang, hx_cross(chain->c, lin)), lin};
  if (reactions) k->reaction.kin = kin;
}

/* Reads all joint angles from the moment of the motion. */
static inline void known_angles(const hxMoment *moment, hxWork *work) {
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int pack = 0; pack < HX_PACKS; ++pack)
      work->pack[pack].joint[joint].angle = hx_load(&moment->angle[joint][pack * HX_LANES]);
}

/* Computes all joint angles. All half-angles come first, so that their long chains of operations
 * overlap. */
static inline void joint_angles(const hxModel *model, const hxPlantMotion *motion, hxWork *work) {
  hxReal sine[HX_JOINTS * HX_PACKS], cosine[HX_JOINTS * HX_PACKS];
  for (int joint = 0, n = 0; joint < HX_JOINTS; ++joint)
    for (int pack = 0; pack < HX_PACKS; ++pack, ++n) {
      const int slot = pack * HX_LANES;
      hx_joint_half_angle(&model->joint[joint], slot, hx_parent_quat(motion, joint, slot),
                          hx_link_quat(motion, joint, slot), &sine[n], &cosine[n]);
    }
  for (int joint = 0, n = 0; joint < HX_JOINTS; ++joint)
    for (int pack = 0; pack < HX_PACKS; ++pack, ++n)
      work->pack[pack].joint[joint].angle = hx_angle_from_half(sine[n], cosine[n]);
}

/* Computes all joints of a leg, hip to foot. */
static inline void leg_pass(const hxModel *model, const hxCommand *command, double t,
                            const hxPlantMotion *motion, const hxBody *torso, int slot,
                            int reactions, hxLegWork *leg) {
  const hxVec3 o = hx_zero3();
  hxChain chain = {o, o, o, {o, o}};
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    joint_pass(model, command, t, motion, joint, slot, reactions,
               joint > 0 ? &leg->joint[joint - 1].body : torso, &chain, &leg->joint[joint]);
}

/* Computes the torques of motor, gear and stops on a joint (eq. 12, 39). */
static inline void joint_torques(const hxModel *model, const hxCommand *command, int joint,
                                 int slot, hxJointWork *k) {
  k->servo =
      hx_servo_slopes(model, k->angle, k->speed, hx_load(&command->angle[joint][slot]),
                      hx_load(&command->speed[joint][slot]), hx_load(&command->torque[joint][slot]),
                      hx_power_of(command, joint, slot));
  k->torque = model->servo_mode == HX_SERVO_KINEMATIC ? k->servo.friction
                                                      : k->servo.torque + k->servo.friction;
  if (model->stops) {
    k->stop = hx_stop_torque(model, joint, slot, k->angle, k->speed);
    k->torque += k->stop.torque;
  }
}

/* Computes what the change of direction of the rotors' angular momenta needs of the bodies that
 * carry them, h w_i x s (eq. 54): links get it as a part of p. */
HX_RARE void rotor_moments(const hxModel *model, const hxBody *torso, hxLegWork *leg) {
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    hxJointWork *k = &leg->joint[joint];
    const hxVec3 w = joint > 0 ? leg->joint[joint - 1].body.w : torso->w;
    const hxVec3 moment = hx_scale(model->spin_inertia * k->speed, hx_cross(w, k->sweep.S.ang));
    k->sweep.passed = joint > 0 ? hx_zero3() : moment;
    if (joint > 0) leg->joint[joint - 1].p.ang = hx_add3(leg->joint[joint - 1].p.ang, moment);
  }
}

/* Computes the friction of a leg's motors and gears under the torques of all but these on the
 * joints (eq. 49-51), tip to hip; the forces on the links are complete. The torque of a kinematic
 * drive is not known yet: its friction is that of a motor which balances the external torque. */
HX_RARE void gear_frictions(const hxModel *model, int slot, hxLegWork *leg) {
  const hxVec3 up = hx_neg(hx_splat_vec3(model->gravity));
  hxForce6 p = {hx_zero3(), hx_zero3()};
  for (int joint = HX_JOINTS - 1; joint >= 0; --joint) {
    hxJointWork *k = &leg->joint[joint];
    const hxVec3 lin = hx_scale(hx_load(&model->joint[joint].mass[slot]), up);
    p = hx_force_add(p, hx_force_add(k->p, (hxForce6){hx_cross(k->c, lin), lin}));
    hxReal external = -hx_power(p, k->sweep.S);
    if (model->stops) external += k->stop.torque;
    const int kinematic = model->servo_mode == HX_SERVO_KINEMATIC;
    if (kinematic) k->servo.torque = -external;
    hx_measured_friction(model, &k->speed, &external, &k->servo);
    k->torque = kinematic ? k->servo.friction : k->servo.torque + k->servo.friction;
    if (model->stops) k->torque += k->stop.torque;
  }
}

static inline hxMotion6 torso_velocity(const hxPlantMotion *m) {
  return (hxMotion6){hx_torso_vec3(m, HX_W), hx_torso_vec3(m, HX_V)};
}

static inline hxMotion6 link_velocity(const hxPlantMotion *m, int joint, int slot) {
  return (hxMotion6){hx_link_vec3(m, joint, HX_W, slot), hx_link_vec3(m, joint, HX_V, slot)};
}

/* Returns the point of a contact on the tibia, relative to the torso's centre of mass. */
static inline hxVec3 contact_point(const hxLegWork *leg, const hxContactWork *contact) {
  return hx_add3(leg->joint[HX_JOINTS - 1].c, contact->kin.arm);
}

/* Applies a force to a body at x: p -= (x x force, force). */
static inline void push_body(hxForce6 *p, hxVec3 x, hxVec3 force) {
  p->lin = hx_sub3(p->lin, force);
  p->ang = hx_sub3(p->ang, hx_cross(x, force));
}

/* Applies a moment to a body. */
static inline void turn_body(hxForce6 *p, hxVec3 moment) { p->ang = hx_sub3(p->ang, moment); }

/* Computes kinematics and law of a row of contacts on the tibia. */
HX_INLINE void leg_contact(const hxModel *model, const hxContactState *state,
                           const hxPlantMotion *motion, const hxKnown *known, int row, int slot,
                           int all, hxLegWork *leg) {
  hxContactWork *contact = &leg->contact[row];
  contact->kin = hx_tibia_contact(model, state, motion, known, row, slot, all,
                                  &leg->joint[HX_JOINTS - 1].body);
  contact->law = hx_law_at(state, row, slot);
}

/* Computes the contact force of a row and applies it to the tibia. */
HX_INLINE void push_leg(const hxModel *model, const hxContactState *state,
                        const hxPlantMotion *motion, const hxKnown *known, int row, int slot,
                        hxLegWork *leg) {
  hxJointWork *tibia = &leg->joint[HX_JOINTS - 1];
  hxContactWork *contact = &leg->contact[row];
  hx_contact_force(model, state, row, slot, motion, known_virgin(known, row, slot), contact);
  push_body(&tibia->p, contact_point(leg, contact), contact->force);
  if (has_turning_friction(model, row)) {
    hx_contact_moment(model, state, row, slot, &tibia->body.w, contact);
    turn_body(&tibia->p, contact->moment);
  }
}

/* Returns whether a row has a closed contact in a pack. */
#ifdef HX_TANGENT
static inline int is_used(const hxContactState *state, int row, int slot) {
  int used = 0;
  for (int lane = 0; lane < HX_LANES; ++lane) used |= hx_re(state->closed[row][slot + lane]) != 0.0;
  return used;
}
#else
static inline int is_used(const hxContactState *state, int row, int slot) {
  return hx_any(hx_less(hx_splat(0.0), hx_load(&state->closed[row][slot])));
}
#endif

/* Multiplies the stiffness of feet on blocks by the shares of their contacts. */
HX_RARE void share_feet(const hxModel *model, const hxContactState *state, int slot,
                        hxLegWork *leg) {
  hxNumber share[HX_FOOT_ROWS], shares[HX_FOOT_ROWS][HX_LANES];
  int several = 0;
  for (int lane = 0; lane < HX_LANES; ++lane) several |= hx_has_several(state, slot + lane) << lane;
  if (!several) return; /* all shares are 1 */
  for (int lane = 0; lane < HX_LANES; ++lane) {
    hxFootFace face[HX_FOOT_ROWS] = {0};
    for (int row = HX_FOOT; row < HX_FOOT_ROWS; ++row) shares[row][lane] = 1.0;
    if (!(several >> lane & 1)) continue;
    for (int k = 0; k < leg->rows && hx_is_of_foot(leg->row[k]); ++k) {
      const hxContactKinematics *kin = &leg->contact[leg->row[k]].kin;
      face[leg->row[k]] = (hxFootFace){hx_lane(kin->delta, lane),
                                       {hx_lane(kin->normal.x, lane), hx_lane(kin->normal.y, lane),
                                        hx_lane(kin->normal.z, lane)}};
    }
    hx_foot_shares(model, state, slot + lane, face, share);
    for (int row = HX_FOOT; row < HX_FOOT_ROWS; ++row) shares[row][lane] = share[row];
  }
  for (int k = 0; k < leg->rows && hx_is_of_foot(leg->row[k]); ++k)
    leg->contact[leg->row[k]].law.stiffness *= hx_load(shares[leg->row[k]]);
}

HX_RARE void further_contacts(const hxModel *model, const hxContactState *state,
                              const hxPlantMotion *motion, const hxKnown *known, int slot, int all,
                              hxLegWork *leg) {
  for (int k = 1; k < model->rows; ++k)
    if (all || is_used(state, model->row[k], slot)) {
      leg->row[leg->rows++] = model->row[k];
      leg_contact(model, state, motion, known, model->row[k], slot, all, leg);
    }
  if (model->foot_rows > 1 && leg->rows > 1) share_feet(model, state, slot, leg);
}

HX_RARE void push_further(const hxModel *model, const hxContactState *state,
                          const hxPlantMotion *motion, int slot, hxLegWork *leg) {
  for (int k = 1; k < leg->rows; ++k) push_leg(model, state, motion, NULL, leg->row[k], slot, leg);
}

/* Computes the contact forces of a leg; without all, only those of rows with closed contacts. */
static inline void leg_contacts(const hxModel *model, const hxContactState *state,
                                const hxPlantMotion *motion, const hxKnown *known, int slot,
                                int all, hxLegWork *leg) {
  leg->rows = 1, leg->row[0] = HX_FOOT;
  leg_contact(model, state, motion, known, HX_FOOT, slot, all, leg);
  if (model->rows > 1) further_contacts(model, state, motion, known, slot, all, leg);
  push_leg(model, state, motion, known, HX_FOOT, slot, leg);
  if (leg->rows > 1) push_further(model, state, motion, slot, leg);
}

/* Computes the contact forces of the torso and applies them. */
HX_RARE void torso_contacts(const hxModel *model, const hxContactState *state,
                            const hxPlantMotion *motion, int all, hxWork *work) {
  for (int slot = 0; slot < HX_SLOTS; slot += HX_LANES)
    work->torso_rows |= all || is_used(state, HX_TORSO, slot);
  if (!work->torso_rows) return;
  for (int pack = 0; pack < HX_TORSO_PACKS; ++pack) {
    hxContactWork *contact = &work->torso_contact[pack];
    const int slot = pack * HX_LANES;
    contact->kin = hx_torso_contact(model, state, motion, slot, all, &work->torso);
    contact->law = hx_law_at(state, HX_TORSO, slot);
    hx_contact_force(model, state, HX_TORSO, slot, motion, NULL, contact);
    work->torso_p[pack] = (hxForce6){hx_zero3(), hx_zero3()};
    push_body(&work->torso_p[pack], contact->kin.arm, contact->force);
  }
}

/* Applies what other legs exert on a femur or tibia. */
static inline void push_link(hxJointWork *link, const hxForce6 *wrench) {
  push_body(&link->p, link->c, wrench->lin);
  turn_body(&link->p, wrench->ang);
}

/* Computes the forces between neighbouring legs and applies them. */
HX_RARE void leg_pairs(const hxModel *model, const hxContactState *state,
                       const hxPlantMotion *motion, int all, hxWork *work) {
  for (int row = HX_PAIR; row < HX_ROWS; ++row)
    for (int slot = 0; slot < HX_PACKS * HX_LANES; slot += HX_LANES)
      work->pair_rows |= all || is_used(state, row, slot);
  if (!work->pair_rows) return;
  hx_pair_wrenches(model, state, motion, work);
  for (int pack = 0; pack < HX_PACKS; ++pack)
    for (int line = 0; line < HX_LINES; ++line)
      push_link(&work->pack[pack].joint[1 + line], &work->pack[pack].by_legs[line]);
}

/* Computes orientation and inertia of the torso. */
HX_INLINE void torso_pass(const hxModel *model, const hxPlantMotion *motion, hxWork *work) {
  const hxNumber *J = model->torso_inertia;
  const hxSym3 J_B = {hx_splat(J[0]), hx_splat(J[1]), hx_splat(J[2]),
                      hx_splat(J[3]), hx_splat(J[4]), hx_splat(J[5])};
  work->torso = hx_torso_body(motion);
  work->torso_J = hx_rotate_sym3(work->torso.R_WB, J_B);
}

/* Computes positions, velocities and forces at (t, y). Fills work except for the sweeps; with
 * reactions it also keeps what the multipliers need. What is known of angles and contacts is not
 * computed again. */
static inline void hx_dynamics_forces(const hxModel *model, const hxContactState *contact,
                                      const hxCommand *command, double t,
                                      const hxPlantMotion *motion, const hxKnown *known,
                                      int reactions, int all, hxWork *work) {
  torso_pass(model, motion, work);
  if (known && known->moment)
    known_angles(known->moment, work);
  else
    joint_angles(model, motion, work);
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int pack = 0; pack < HX_PACKS; ++pack)
      link_pass(model, motion, joint, pack * HX_LANES, &work->pack[pack].joint[joint]);
  for (int pack = 0; pack < HX_PACKS; ++pack)
    leg_pass(model, command, t, motion, &work->torso, pack * HX_LANES, reactions,
             &work->pack[pack]);
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int pack = 0; pack < HX_PACKS; ++pack)
      joint_torques(model, command, joint, pack * HX_LANES, &work->pack[pack].joint[joint]);
  for (int pack = 0; pack < HX_PACKS; ++pack)
    leg_contacts(model, contact, motion, known, pack * HX_LANES, all, &work->pack[pack]);
  for (int pack = 0; model->spin && pack < HX_PACKS; ++pack)
    rotor_moments(model, &work->torso, &work->pack[pack]);
  work->pair_rows = 0;
  if (model->pair_rows) leg_pairs(model, contact, motion, all, work);
  for (int pack = 0; model->measured_friction && pack < HX_PACKS; ++pack)
    gear_frictions(model, pack * HX_LANES, &work->pack[pack]);
  work->torso_rows = 0;
  if (model->torso_rows) torso_contacts(model, contact, motion, all, work);
}

#endif
