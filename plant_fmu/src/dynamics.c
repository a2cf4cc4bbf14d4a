#include "dynamics.h"

#include "friction.h"
#include "terrain.h"

/* ---- forces ------------------------------------------------------------------------------------------------------------ */

/* f_n of eq. 4 along the normal, f_t = -mu f_n g(|v_t|) v_t of eq. 5 across it */
static void foot_force(const hxModel *model, const hxContactState *contact, int slot, hxFootWork *foot) {
  const hxFootKinematics *kin = &foot->kin;
  foot->normal = hx_normal_force(model, hx_load(&contact->closed[slot]), hx_load(&contact->damping[slot]), kin->delta, kin->ddelta);
  foot->slip = hx_add_scaled(kin->velocity, kin->ddelta, kin->normal);
  foot->slip_speed = hx_sqrt(hx_dot(foot->slip, foot->slip));
  foot->drag = model->mu * foot->normal.force * hx_friction(model->friction_law)->per_speed(model, foot->slip_speed);
  foot->force = hx_add_scaled(hx_scale(foot->normal.force, kin->normal), -foot->drag, foot->slip);
}

/* gravity m g and the gyroscopic torque -w x (J w) */
static void link_force(const hxModel *model, hxJointWork *k) {
  const hxVec3 w = k->kin.body.w;
  k->applied.lin = hx_scale(k->mass, hx_splat_vec3(model->gravity));
  k->applied.ang = hx_cross(hx_sym_mul(k->J, w), w);
}

/* a_k of eq. 10: u1.dw = c4, u2.dw = c5, s.dw = 0 (or the drive's qdd); c = gamma - 2 alpha dPhi - beta^2 Phi */
static hxMotion6 joint_bias(const hxModel *model, const hxJointWork *k) {
  const hxJointKinematics *kin = &k->kin;
  const double alpha2 = 2.0 * model->alpha, beta2 = model->beta * model->beta;
  const hxVec3 c_lin = hx_add_scaled(hx_add_scaled(kin->gamma_lin, hx_splat(-alpha2), kin->dphi_lin), hx_splat(-beta2), kin->phi_lin);
  const hxReal c4 = kin->inverse_det * (kin->gamma[0] - alpha2 * kin->dphi[0] - beta2 * kin->phi[0]);
  const hxReal c5 = kin->inverse_det * (kin->gamma[1] - alpha2 * kin->dphi[1] - beta2 * kin->phi[1]);
  const hxVec3 dw = hx_add_scaled(hx_add_scaled(hx_scale(c4, kin->u2_s), c5, kin->s_u1), k->driven, kin->s);
  return (hxMotion6){dw, hx_add(hx_cross(k->P, dw), c_lin)};
}

/* Servo torque, or the acceleration of the rheonomic constraint q = q_ref + qd_ref (t - t_command) with Baumgarte. */
static void joint_actuation(const hxModel *model, const hxCommand *command, double t, int joint, int slot, hxJointWork *k) {
  const hxReal angle_ref = hx_load(&command->angle[joint][slot]), speed_ref = hx_load(&command->speed[joint][slot]);
  k->servo = hx_servo_torque(model, k->kin.angle, k->kin.speed, angle_ref, speed_ref, hx_load(&command->torque[joint][slot]));
  k->driven = hx_splat(0.0);
  k->torque = k->servo.torque + k->servo.friction;
  if (model->servo_mode == HX_SERVO_KINEMATIC) {
    const hxReal error = k->kin.angle - (angle_ref + speed_ref * (t - command->time));
    k->driven = -2.0 * model->alpha * (k->kin.speed - speed_ref) - model->beta * model->beta * error;
    k->torque = k->servo.friction;
  }
}

static void leg_kinematics(const hxModel *model, const hxMotion *motion, int slot, const hxBodyWork *torso, hxLegWork *leg) {
  const hxBodyWork *parent = torso;
  hxVec3 c = hx_zero3();
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    hxJointWork *k = &leg->joint[joint];
    const hxJointModel *m = &model->joint[joint];
    hx_joint_kinematics(m, motion, joint, slot, parent, &k->kin);
    k->mass = hx_load(&m->mass[slot]);
    k->J = hx_rotate_sym3(k->kin.body.R, hx_load_sym3(m->inertia, slot));
    k->P = hx_add(c, k->kin.sP_i);
    k->c = c = hx_sub(k->P, k->kin.sP_j);
    k->sweep.S = (hxMotion6){k->kin.s, hx_cross(k->P, k->kin.s)};
    parent = &k->kin.body;
  }
  hx_foot_kinematics(model, slot, parent, &leg->foot.kin);
}

static void leg_forces(const hxModel *model, const hxContactState *contact, const hxCommand *command, double t, int slot, hxLegWork *leg) {
  hxMotion6 bias = {hx_zero3(), hx_zero3()};
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    hxJointWork *k = &leg->joint[joint];
    link_force(model, k);
    joint_actuation(model, command, t, joint, slot, k);
    k->bias = bias = hx_motion_add(bias, joint_bias(model, k));
  }
  foot_force(model, contact, slot, &leg->foot);
  hxForce6 *tibia = &leg->joint[HX_JOINTS - 1].applied;
  tibia->lin = hx_add(tibia->lin, leg->foot.force);
  tibia->ang = hx_add(tibia->ang, hx_cross(leg->foot.kin.arm, leg->foot.force));
}

/* ---- the sweeps of eq. 11-12, all about the torso's centre of mass ---------------------------------------------------------- */

/* U = I S, d = S.U + what the joint itself resists with; leaves I - U U^T/d, what the parent carries */
static void sweep_inertia(hxSweep *sweep, hxInertia6 *I, hxReal joint_inertia, int driven) {
  sweep->U = hx_inertia_mul(I, sweep->S);
  sweep->inverse_d = driven ? hx_splat(0.0) : 1.0 / (hx_power(sweep->U, sweep->S) + joint_inertia);
  hx_inertia_downdate(I, sweep->inverse_d, sweep->U);
}

/* u = torque - S.p; leaves p + U u/d, what the parent is handed */
static hxReal sweep_force(const hxSweep *sweep, hxForce6 *p, hxReal torque) {
  const hxReal u = torque - hx_power(*p, sweep->S);
  *p = hx_force_add_scaled(*p, sweep->inverse_d * u, sweep->U);
  return u;
}

/* qdd = (u - U.a)/d; leaves a + S qdd, the child's acceleration but for its bias */
static hxReal sweep_motion(const hxSweep *sweep, hxMotion6 *a, hxReal u) {
  const hxReal qdd = sweep->inverse_d * (u - hx_power(sweep->U, *a));
  *a = hx_motion_add_scaled(*a, qdd, sweep->S);
  return qdd;
}

/* a motion about the torso's centre of mass, at c from it */
static hxMotion6 motion_at(hxMotion6 a, hxVec3 c) { return (hxMotion6){a.ang, hx_add(a.lin, hx_cross(a.ang, c))}; }

/* a torque and a force at c, about the torso's centre of mass */
static hxForce6 force_at(hxForce6 f, hxVec3 c) { return (hxForce6){hx_add(f.ang, hx_cross(c, f.lin)), f.lin}; }

static void leg_sweep_inertia(const hxModel *model, hxLegWork *leg, hxInertia6 *I) {
  const int driven = model->servo_mode == HX_SERVO_KINEMATIC;
  for (int joint = HX_JOINTS - 1; joint >= 0; --joint) {
    hxJointWork *k = &leg->joint[joint];
    k->inertia = hx_rigid_inertia(k->mass, k->J, k->c);
    if (joint == HX_JOINTS - 1)
      *I = k->inertia;
    else
      hx_inertia_add(I, &k->inertia);
    sweep_inertia(&k->sweep, I, hx_splat(model->rotor_inertia), driven);
  }
}

/* p of a link: what its bias acceleration takes less what is applied */
static hxForce6 link_bias_force(const hxJointWork *k) {
  const hxMotion6 a = motion_at(k->bias, k->c);
  const hxForce6 at_com = {hx_sub(hx_sym_mul(k->J, a.ang), k->applied.ang), hx_sub(hx_scale(k->mass, a.lin), k->applied.lin)};
  return force_at(at_com, k->c);
}

static hxForce6 leg_sweep_force(hxLegWork *leg) {
  hxForce6 p = {hx_zero3(), hx_zero3()};
  for (int joint = HX_JOINTS - 1; joint >= 0; --joint) {
    hxJointWork *k = &leg->joint[joint];
    p = hx_force_add(p, link_bias_force(k));
    k->u = sweep_force(&k->sweep, &p, k->torque);
  }
  return p;
}

static void leg_sweep_motion(hxLegWork *leg, hxMotion6 a) {
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    hxJointWork *k = &leg->joint[joint];
    k->qdd = sweep_motion(&k->sweep, &a, k->u) + k->driven;
    k->acceleration = motion_at(hx_motion_add(a, k->bias), k->c);
  }
}

/* Multipliers leaf to root: D_kk^T lambda_k = g_k - M_k dv_k - sum over children c of D_ck^T lambda_c. */
static void leg_multipliers(const hxModel *model, hxLegWork *leg) {
  hxForce6 handed = {hx_zero3(), hx_zero3()}; /* by the child on this link: -D_ck^T lambda_c and the axis torque's reaction */
  for (int joint = HX_JOINTS - 1; joint >= 0; --joint) {
    hxJointWork *k = &leg->joint[joint];
    const hxJointKinematics *kin = &k->kin;
    const hxVec3 lin = hx_add_scaled(hx_add(k->applied.lin, handed.lin), -k->mass, k->acceleration.lin);
    const hxVec3 ang = hx_sub(hx_add(k->applied.ang, handed.ang), hx_sym_mul(k->J, k->acceleration.ang));
    const hxVec3 about_joint = hx_sub(ang, hx_cross(kin->sP_j, lin));
    hxReal axis_torque = k->torque - model->rotor_inertia * k->qdd;
    k->lambda_lin = lin;
    k->lambda[0] = kin->inverse_det * hx_dot(about_joint, kin->u2_s);
    k->lambda[1] = kin->inverse_det * hx_dot(about_joint, kin->s_u1);
    if (model->servo_mode == HX_SERVO_KINEMATIC) {
      axis_torque = -kin->inverse_det * hx_dot(about_joint, hx_cross(kin->u1, kin->u2));
      k->torque = axis_torque + model->rotor_inertia * k->qdd;
      k->servo.torque = k->torque - k->servo.friction;
    }
    const hxVec3 couple = hx_add_scaled(hx_add_scaled(hx_scale(k->lambda[0], kin->u1), k->lambda[1], kin->u2), -axis_torque, kin->s);
    handed = (hxForce6){hx_add(hx_cross(kin->sP_i, lin), couple), lin};
  }
}

/* ---- the torso -------------------------------------------------------------------------------------------------------------- */

static void scatter_sym3(hxSym3 S, double (*out)[HX_SLOTS], int slot) {
  hx_store(&out[0][slot], S.xx), hx_store(&out[1][slot], S.yy), hx_store(&out[2][slot], S.zz);
  hx_store(&out[3][slot], S.xy), hx_store(&out[4][slot], S.xz), hx_store(&out[5][slot], S.yz);
}

/* the 21 entries of an inertia, legs innermost: C, A, then H by rows */
static void scatter_inertia(const hxInertia6 *I, double out[21][HX_SLOTS], int slot) {
  scatter_sym3(I->C, out, slot);
  scatter_sym3(I->A, out + 6, slot);
  hx_store_vec3(out + 12, slot, I->H.x);
  hx_store_vec3(out + 15, slot, I->H.y);
  hx_store_vec3(out + 18, slot, I->H.z);
}

static void scatter_force(hxForce6 f, double out[6][HX_SLOTS], int slot) {
  hx_store_vec3(out, slot, f.ang);
  hx_store_vec3(out + 3, slot, f.lin);
}

/* always leg 0 to leg 5: the sum must not depend on the lane width */
static double sum_legs(const double slots[HX_SLOTS]) {
  double sum = slots[0];
  for (int leg = 1; leg < HX_LEGS; ++leg) sum += slots[leg];
  return sum;
}

/* L D L^T of the torso's own inertia and what the legs hang on it */
static void torso_factorise(double mass, hxSym3 J, const double legs[21][HX_SLOTS], hxTorsoFactor *factor) {
  static const int sym[3][3] = {{0, 3, 4}, {3, 1, 5}, {4, 5, 2}};
  double A[6][6], sum[21];
  for (int i = 0; i < 21; ++i) sum[i] = sum_legs(legs[i]);
  const double own[6] = {hx_lane(J.xx, 0), hx_lane(J.yy, 0), hx_lane(J.zz, 0), hx_lane(J.xy, 0), hx_lane(J.xz, 0), hx_lane(J.yz, 0)};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      A[i][j] = own[sym[i][j]] + sum[sym[i][j]];
      A[3 + i][3 + j] = (i == j ? mass : 0.0) + sum[6 + sym[i][j]];
      A[3 + j][i] = sum[12 + 3 * i + j];
    }
  for (int j = 0; j < 6; ++j) {
    double d = A[j][j];
    for (int k = 0; k < j; ++k) d -= factor->L[j][k] * A[j][k];
    factor->inverse_d[j] = 1.0 / d;
    for (int i = j + 1; i < 6; ++i) {
      for (int k = 0; k < j; ++k) A[i][j] -= factor->L[j][k] * A[i][k];
      factor->L[i][j] = A[i][j] * factor->inverse_d[j];
    }
  }
}

static void torso_solve(const hxTorsoFactor *factor, const double b[6], double x[6]) {
  for (int i = 0; i < 6; ++i) {
    x[i] = b[i];
    for (int k = 0; k < i; ++k) x[i] -= factor->L[i][k] * x[k];
  }
  for (int i = 5; i >= 0; --i) {
    x[i] *= factor->inverse_d[i];
    for (int k = i + 1; k < 6; ++k) x[i] -= factor->L[k][i] * x[k];
  }
}

/* torque and force on the torso's centre of mass: push, gravity, gyroscopic */
static void torso_forces(const hxModel *model, const hxCommand *command, hxWork *work) {
  const hxVec3 gyroscopic = hx_cross(hx_sym_mul(work->torso_J, work->torso.w), work->torso.w);
  const double g[3] = {hx_lane(gyroscopic.x, 0), hx_lane(gyroscopic.y, 0), hx_lane(gyroscopic.z, 0)};
  for (int i = 0; i < 3; ++i) {
    work->torso_applied[i] = command->push_torque[i] + g[i];
    work->torso_applied[3 + i] = command->push_force[i] + model->torso_mass * model->gravity[i];
  }
}

static void torso_kinematics(const hxModel *model, const hxMotion *motion, hxWork *work) {
  const double *J = model->torso_inertia;
  const hxSym3 body = {hx_splat(J[0]), hx_splat(J[1]), hx_splat(J[2]), hx_splat(J[3]), hx_splat(J[4]), hx_splat(J[5])};
  work->torso = hx_torso_work(motion);
  work->torso_J = hx_rotate_sym3(work->torso.R, body);
}

static hxMotion6 torso_motion(const double x[6]) { return (hxMotion6){hx_splat_vec3(x), hx_splat_vec3(x + 3)}; }

/* ---- dy/dt ------------------------------------------------------------------------------------------------------------------ */

static void store_rates(const hxMotion *motion, const hxWork *work, hxMotion *rate) {
  hx_position_rates(motion, motion, rate);
  for (int i = 0; i < 3; ++i) {
    rate->torso[HX_V + i] = work->torso_acceleration[3 + i];
    rate->torso[HX_W + i] = work->torso_acceleration[i];
  }
  for (int pack = 0; pack < HX_PACKS; ++pack)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxMotion6 a = work->pack[pack].joint[joint].acceleration;
      hx_store_vec3(&rate->link[joint][HX_V], pack * HX_LANES, a.lin);
      hx_store_vec3(&rate->link[joint][HX_W], pack * HX_LANES, a.ang);
    }
}

/* power of the motors and of everything that dissipates: gears, contact damping, friction */
static void store_powers(const hxCommand *command, const hxMotion *motion, const hxWork *work, hxMotion *rate) {
  double actuator[HX_SLOTS], dissipated[HX_SLOTS];
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const hxLegWork *leg = &work->pack[pack];
    const hxFootWork *foot = &leg->foot;
    hxReal in = hx_splat(0.0);
    hxReal out = (foot->normal.force - foot->normal.elastic) * foot->kin.ddelta + foot->drag * hx_dot(foot->slip, foot->slip);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      in = in + leg->joint[joint].servo.torque * leg->joint[joint].kin.speed;
      out = out - leg->joint[joint].servo.friction * leg->joint[joint].kin.speed;
    }
    hx_store(&actuator[pack * HX_LANES], in);
    hx_store(&dissipated[pack * HX_LANES], out);
  }
  rate->actuator_work = sum_legs(actuator);
  rate->dissipated = sum_legs(dissipated);
  rate->push_work = 0.0;
  for (int i = 0; i < 3; ++i)
    rate->push_work += command->push_force[i] * motion->torso[HX_V + i] + command->push_torque[i] * motion->torso[HX_W + i];
}

HX_LOCAL void hx_dynamics_evaluate(const hxModel *model, const hxContactState *contact, const hxCommand *command, double t,
                                   const hxMotion *motion, int multipliers, hxWork *work, hxMotion *rate) {
  double inertia[21][HX_SLOTS], force[6][HX_SLOTS], b[6];
  hxTorsoFactor factor;
  torso_kinematics(model, motion, work);
  torso_forces(model, command, work);

  /* leaf to root, all legs at once */
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const int slot = pack * HX_LANES;
    hxLegWork *leg = &work->pack[pack];
    leg_kinematics(model, motion, slot, &work->torso, leg);
    leg_forces(model, contact, command, t, slot, leg);
    hxInertia6 I;
    leg_sweep_inertia(model, leg, &I);
    scatter_inertia(&I, inertia, slot);
    scatter_force(leg_sweep_force(leg), force, slot);
  }

  /* the torso's 6 x 6: (I + sum of legs) dv = applied - sum of legs */
  torso_factorise(model->torso_mass, work->torso_J, inertia, &factor);
  for (int i = 0; i < 6; ++i) b[i] = work->torso_applied[i] - sum_legs(force[i]);
  torso_solve(&factor, b, work->torso_acceleration);

  /* root to leaf */
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    leg_sweep_motion(&work->pack[pack], torso_motion(work->torso_acceleration));
    if (multipliers || model->servo_mode == HX_SERVO_KINEMATIC) leg_multipliers(model, &work->pack[pack]);
  }
  store_rates(motion, work, rate);
  store_powers(command, motion, work, rate);
}

/* ---- the linearly implicit solve -------------------------------------------------------------------------------------------- */

HX_LOCAL void hx_foot_ahead(const hxModel *model, const hxContactState *contact, double h, hxWork *work) {
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const int slot = pack * HX_LANES;
    hxFootWork *foot = &work->pack[pack].foot;
    const hxReal deeper = foot->kin.delta + h * hx_max(foot->kin.ddelta, hx_splat(0.0));
    foot->normal = hx_normal_force(model, hx_load(&contact->closed[slot]), hx_load(&contact->damping[slot]), deeper, foot->kin.ddelta);
    foot->drag = model->mu * foot->normal.force * hx_friction(model->friction_law)->per_speed(model, foot->slip_speed);
  }
}

/* contact: (z c_n + z^2 k_n) n n^T + z c_t (1 - n n^T) at the contact point x from the torso's centre of mass; z = h gamma */
static hxInertia6 contact_inertia(const hxFootWork *foot, hxVec3 x, double z) {
  const hxVec3 n = foot->kin.normal;
  const hxReal t = z * foot->drag;
  const hxReal d = z * foot->normal.viscosity + z * z * foot->normal.stiffness - t;
  const hxSym3 A = {t + d * n.x * n.x, t + d * n.y * n.y, t + d * n.z * n.z, d * n.x * n.y, d * n.x * n.z, d * n.y * n.z};
  return hx_inertia_at(A, x);
}

HX_LOCAL void hx_implicit_factorise(const hxModel *model, const hxWork *work, double h_gamma, hxImplicit *implicit) {
  const int driven = model->servo_mode == HX_SERVO_KINEMATIC;
  double inertia[21][HX_SLOTS];
  implicit->torso_p = work->torso.p;
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const hxLegWork *leg = &work->pack[pack];
    hxImplicitLeg *to = &implicit->pack[pack];
    hxInertia6 I = contact_inertia(&leg->foot, hx_add(leg->joint[HX_JOINTS - 1].c, leg->foot.kin.arm), h_gamma);
    for (int joint = HX_JOINTS - 1; joint >= 0; --joint) {
      const hxJointWork *k = &leg->joint[joint];
      const hxReal servo = h_gamma * k->servo.damping + (h_gamma * h_gamma) * k->servo.stiffness;
      hx_inertia_add(&I, &k->inertia);
      to->joint[joint].sweep.S = k->sweep.S;
      sweep_inertia(&to->joint[joint].sweep, &I, model->rotor_inertia + servo, driven);
      to->joint[joint].p = k->kin.body.p;
      to->joint[joint].c = k->c;
      to->joint[joint].stiffness = k->servo.stiffness;
      to->joint[joint].damping = k->servo.damping;
    }
    scatter_inertia(&I, inertia, pack * HX_LANES);
    to->arm = leg->foot.kin.arm;
    to->normal = leg->foot.kin.normal;
    to->stiffness = leg->foot.normal.stiffness;
    to->viscosity = leg->foot.normal.viscosity;
    to->drag = leg->foot.drag;
  }
  torso_factorise(model->torso_mass, work->torso_J, inertia, &implicit->torso);
}

/* a link's displacement (from dx, its quaternion change as a rotation) and velocity change (from dv) */
static void link_changes(const hxMotion *dx, const hxMotion *dv, int joint, int slot, hxQuat p, hxMotion6 *x, hxMotion6 *v) {
  const double (*mx)[HX_SLOTS] = dx->link[joint], (*mv)[HX_SLOTS] = dv->link[joint];
  const hxQuat dp = {hx_load(&mx[HX_P][slot]), hx_load(&mx[HX_P + 1][slot]), hx_load(&mx[HX_P + 2][slot]), hx_load(&mx[HX_P + 3][slot])};
  *x = (hxMotion6){hx_rotation_of_change(p, dp), hx_load_vec3(&mx[HX_R], slot)};
  *v = (hxMotion6){hx_load_vec3(&mv[HX_W], slot), hx_load_vec3(&mv[HX_V], slot)};
}

static void torso_changes(const hxImplicit *implicit, const hxMotion *dx, const hxMotion *dv, hxMotion6 *x, hxMotion6 *v) {
  const double *mx = dx->torso, *mv = dv->torso;
  const hxQuat dp = {hx_splat(mx[HX_P]), hx_splat(mx[HX_P + 1]), hx_splat(mx[HX_P + 2]), hx_splat(mx[HX_P + 3])};
  *x = (hxMotion6){hx_rotation_of_change(implicit->torso_p, dp), hx_splat_vec3(&mx[HX_R])};
  *v = (hxMotion6){hx_splat_vec3(&mv[HX_W]), hx_splat_vec3(&mv[HX_V])};
}

/* G_v dv + G_x dx: the forces that contact and servos answer the changes with; the foot's about the torso's centre of mass */
static hxForce6 leg_response(const hxImplicit *implicit, int pack, const hxMotion *dx, const hxMotion *dv, hxReal torque[HX_JOINTS]) {
  const hxImplicitLeg *leg = &implicit->pack[pack];
  hxMotion6 x_i, v_i, x_j, v_j;
  torso_changes(implicit, dx, dv, &x_i, &v_i);
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    const hxVec3 s = leg->joint[joint].sweep.S.ang;
    link_changes(dx, dv, joint, pack * HX_LANES, leg->joint[joint].p, &x_j, &v_j);
    torque[joint] = -(leg->joint[joint].stiffness * hx_dot(s, hx_sub(x_j.ang, x_i.ang)) +
                      leg->joint[joint].damping * hx_dot(s, hx_sub(v_j.ang, v_i.ang)));
    x_i = x_j, v_i = v_j;
  }
  const hxVec3 n = leg->normal, x = motion_at(x_j, leg->arm).lin, v = motion_at(v_j, leg->arm).lin;
  const hxReal along = (leg->viscosity - leg->drag) * hx_dot(n, v) + leg->stiffness * hx_dot(n, x);
  const hxVec3 force = hx_add_scaled(hx_scale(-along, n), -leg->drag, v);
  return force_at((hxForce6){hx_zero3(), force}, hx_add(leg->joint[HX_JOINTS - 1].c, leg->arm));
}

HX_LOCAL void hx_implicit_solve(const hxImplicit *implicit, const hxMotion *dx, const hxMotion *dv, hxMotion *u) {
  double force[6][HX_SLOTS], b[6], x[6];
  hxReal along[HX_PACKS][HX_JOINTS];
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    hxReal torque[HX_JOINTS];
    const hxForce6 foot = leg_response(implicit, pack, dx, dv, torque);
    hxForce6 p = {hx_neg(foot.ang), hx_neg(foot.lin)};
    for (int joint = HX_JOINTS - 1; joint >= 0; --joint)
      along[pack][joint] = sweep_force(&implicit->pack[pack].joint[joint].sweep, &p, torque[joint]);
    scatter_force(p, force, pack * HX_LANES);
  }
  for (int i = 0; i < 6; ++i) b[i] = -sum_legs(force[i]);
  torso_solve(&implicit->torso, b, x);
  for (int i = 0; i < 3; ++i) u->torso[HX_W + i] = x[i], u->torso[HX_V + i] = x[3 + i];
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    hxMotion6 a = torso_motion(x);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      sweep_motion(&implicit->pack[pack].joint[joint].sweep, &a, along[pack][joint]);
      const hxMotion6 link = motion_at(a, implicit->pack[pack].joint[joint].c);
      hx_store_vec3(&u->link[joint][HX_V], pack * HX_LANES, link.lin);
      hx_store_vec3(&u->link[joint][HX_W], pack * HX_LANES, link.ang);
    }
  }
}
