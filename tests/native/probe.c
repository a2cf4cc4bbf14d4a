/* probe.c - the plant's internal functions for the tests, one leg (one lane) at a time.
 *
 * Compiled into the shared library with HX_PROBE only. Vectors and matrices cross as rows of doubles.
 */
#include <stddef.h>
#include <string.h>

#include "contact.h"
#include "dynamics.h"
#include "friction.h"
#include "hexapod/hexapod.h"
#include "kinematics.h"
#include "method.h"
#include "robot.h"
#include "spatial.h"
#include "terrain.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wmissing-prototypes" /* called from Python only: there is no header */
#endif

/* ---- layout ------------------------------------------------------------------------------------------------------------- */

typedef struct {
  const char *name;
  size_t offset, size;
} ProbeField;

#define FIELD(type, member) {#type "." #member, offsetof(type, member), sizeof(((type *)0)->member)}
#define WHOLE(type) {#type, 0, sizeof(type)}

static const ProbeField fields[] = {
    WHOLE(hxLink),
    WHOLE(hxLeg),
    WHOLE(hxDefinition),
    WHOLE(hxInput),
    WHOLE(hxOutput),
    FIELD(hxLink, mass),
    FIELD(hxLink, length),
    FIELD(hxLink, offset_y),
    FIELD(hxLink, offset_z),
    FIELD(hxLink, com),
    FIELD(hxLink, inertia),
    FIELD(hxLink, axis),
    FIELD(hxLeg, hip_position),
    FIELD(hxLeg, hip_yaw),
    FIELD(hxLeg, link),
    FIELD(hxDefinition, torso.mass),
    FIELD(hxDefinition, torso.com),
    FIELD(hxDefinition, torso.inertia),
    FIELD(hxDefinition, leg),
    FIELD(hxDefinition, foot_radius),
    FIELD(hxDefinition, contact.law),
    FIELD(hxDefinition, contact.stiffness),
    FIELD(hxDefinition, contact.restitution),
    FIELD(hxDefinition, contact.damping_factor),
    FIELD(hxDefinition, contact.impact_speed_floor),
    FIELD(hxDefinition, friction.law),
    FIELD(hxDefinition, friction.mu),
    FIELD(hxDefinition, friction.slope),
    FIELD(hxDefinition, servo.mode),
    FIELD(hxDefinition, servo.kp),
    FIELD(hxDefinition, servo.kd),
    FIELD(hxDefinition, servo.torque_max),
    FIELD(hxDefinition, servo.speed_max),
    FIELD(hxDefinition, servo.rotor_inertia),
    FIELD(hxDefinition, servo.coulomb_friction),
    FIELD(hxDefinition, baumgarte.alpha),
    FIELD(hxDefinition, baumgarte.beta),
    FIELD(hxDefinition, gravity),
    FIELD(hxDefinition, solver.method),
    FIELD(hxDefinition, solver.step),
    FIELD(hxDefinition, solver.tolerance),
    FIELD(hxDefinition, solver.step_max),
    FIELD(hxDefinition, terrain.kind),
    FIELD(hxDefinition, terrain.height),
    FIELD(hxDefinition, terrain.incline),
    FIELD(hxDefinition, terrain.heading),
    FIELD(hxDefinition, initial.position),
    FIELD(hxDefinition, initial.quaternion),
    FIELD(hxDefinition, initial.velocity),
    FIELD(hxDefinition, initial.angular_velocity),
    FIELD(hxDefinition, initial.angle),
    FIELD(hxDefinition, initial.speed),
    FIELD(hxInput, angle_ref),
    FIELD(hxInput, speed_ref),
    FIELD(hxInput, torque_ref),
    FIELD(hxInput, push_force),
    FIELD(hxInput, push_torque),
    FIELD(hxOutput, time),
    FIELD(hxOutput, angle),
    FIELD(hxOutput, speed),
    FIELD(hxOutput, torque),
    FIELD(hxOutput, reaction_force),
    FIELD(hxOutput, reaction_torque),
    FIELD(hxOutput, foot.force),
    FIELD(hxOutput, foot.normal_force),
    FIELD(hxOutput, foot.tangential_force),
    FIELD(hxOutput, foot.position),
    FIELD(hxOutput, foot.velocity),
    FIELD(hxOutput, foot.slip_speed),
    FIELD(hxOutput, foot.penetration),
    FIELD(hxOutput, foot.impact_speed),
    FIELD(hxOutput, foot.contact),
    FIELD(hxOutput, torso.position),
    FIELD(hxOutput, torso.quaternion),
    FIELD(hxOutput, torso.roll),
    FIELD(hxOutput, torso.pitch),
    FIELD(hxOutput, torso.yaw),
    FIELD(hxOutput, torso.velocity),
    FIELD(hxOutput, torso.angular_velocity),
    FIELD(hxOutput, imu.specific_force),
    FIELD(hxOutput, imu.angular_velocity),
    FIELD(hxOutput, energy.kinetic),
    FIELD(hxOutput, energy.potential),
    FIELD(hxOutput, energy.actuator_work),
    FIELD(hxOutput, energy.push_work),
    FIELD(hxOutput, energy.dissipated),
    FIELD(hxOutput, energy.residual),
    FIELD(hxOutput, constraint.position_error),
    FIELD(hxOutput, constraint.velocity_error),
    FIELD(hxOutput, solver.evaluations),
    FIELD(hxOutput, solver.steps),
    FIELD(hxOutput, solver.rejected),
    FIELD(hxOutput, solver.touchdowns),
};

/* the name of the i-th field, its place and size; NULL past the last */
HX_API const char *hx_probe_field(size_t i, size_t *offset, size_t *size) {
  if (i >= sizeof fields / sizeof fields[0]) return NULL;
  *offset = fields[i].offset, *size = fields[i].size;
  return fields[i].name;
}

HX_API int hx_probe_lanes(void) { return HX_LANES; }

/* ---- lanes, vectors ------------------------------------------------------------------------------------------------------- */

static void put3(hxVec3 a, int lane, double *out) { out[0] = hx_lane(a.x, lane), out[1] = hx_lane(a.y, lane), out[2] = hx_lane(a.z, lane); }

static hxQuat quat(const double p[4]) { return (hxQuat){hx_splat(p[0]), hx_splat(p[1]), hx_splat(p[2]), hx_splat(p[3])}; }

/* packs of legs at a time; n is a multiple of HX_SLOTS */
HX_API void hx_probe_tanh(const double *x, double *out, int n) {
  for (int i = 0; i < n; i += HX_LANES) hx_store(out + i, hx_tanh(hx_load(x + i)));
}

HX_API void hx_probe_expm1(const double *x, double *out, int n) {
  for (int i = 0; i < n; i += HX_LANES) hx_store(out + i, hx_expm1(hx_load(x + i)));
}

HX_API void hx_probe_angle_from_half(const double *y, const double *x, double *out, int n) {
  for (int i = 0; i < n; i += HX_LANES) hx_store(out + i, hx_angle_from_half(hx_load(y + i), hx_load(x + i)));
}

HX_API void hx_probe_select(const double *a, const double *b, double out[3][HX_SLOTS]) {
  for (int i = 0; i < HX_SLOTS; i += HX_LANES) {
    hx_store(&out[0][i], hx_min(hx_load(a + i), hx_load(b + i)));
    hx_store(&out[1][i], hx_max(hx_load(a + i), hx_load(b + i)));
    hx_store(&out[2][i], hx_abs(hx_load(a + i)));
  }
}

HX_API void hx_probe_rotation_matrix(const double p[4], double R[3][3]) {
  const hxMat3 M = hx_rotation_matrix(quat(p));
  put3(M.x, 0, R[0]), put3(M.y, 0, R[1]), put3(M.z, 0, R[2]);
}

HX_API void hx_probe_quaternion_rate(const double p[4], const double w[3], double out[4]) {
  const hxQuat d = hx_quaternion_rate(quat(p), hx_splat_vec3(w));
  out[0] = hx_lane(d.w, 0), out[1] = hx_lane(d.x, 0), out[2] = hx_lane(d.y, 0), out[3] = hx_lane(d.z, 0);
}

HX_API void hx_probe_rotation_of_change(const double p[4], const double dp[4], double out[3]) {
  put3(hx_rotation_of_change(quat(p), quat(dp)), 0, out);
}

HX_API void hx_probe_axis_normals(const double axis[3], double a[3], double b[3]) { hx_axis_normals(axis, a, b); }

static void put_inertia(const hxInertia6 *inertia, double out[6][6]) {
  for (int j = 0; j < 6; ++j) {
    const hxVec3 o = hx_zero3();
    hxMotion6 unit = {o, o};
    hxReal *component[6] = {&unit.ang.x, &unit.ang.y, &unit.ang.z, &unit.lin.x, &unit.lin.y, &unit.lin.z};
    *component[j] = hx_splat(1.0);
    const hxForce6 f = hx_inertia_mul(inertia, unit);
    double column_j[6];
    put3(f.ang, 0, column_j), put3(f.lin, 0, column_j + 3);
    for (int i = 0; i < 6; ++i) out[i][j] = column_j[i];
  }
}

static hxSym3 take_sym3(const double S[3][3]) {
  return (hxSym3){hx_splat(S[0][0]), hx_splat(S[1][1]), hx_splat(S[2][2]), hx_splat(S[0][1]), hx_splat(S[0][2]), hx_splat(S[1][2])};
}

/* (the inertia of a body with mass, J at c, and of a block A at c, as seen from the origin) - s U U^T; angular part first */
HX_API void hx_probe_inertia(double mass, const double J[3][3], const double A[3][3], const double c[3], double s, const double U[6],
                             double out[6][6]) {
  hxInertia6 inertia = hx_rigid_inertia(hx_splat(mass), take_sym3(J), hx_splat_vec3(c));
  const hxInertia6 block = hx_inertia_at(take_sym3(A), hx_splat_vec3(c));
  hx_inertia_add(&inertia, &block);
  hx_inertia_downdate(&inertia, hx_splat(s), (hxForce6){hx_splat_vec3(U), hx_splat_vec3(U + 3)});
  put_inertia(&inertia, out);
}

/* ---- laws -------------------------------------------------------------------------------------------------------------------- */

HX_API double hx_probe_exact_restitution_chi(double e) { return hx_exact_restitution_chi(e); }

HX_API double hx_probe_contact_damping(const hxPlant *plant, double impact_speed) {
  return hx_contact(plant->model.contact_law)->damping(&plant->model, impact_speed);
}

/* out: force, elastic part, stiffness, viscosity */
HX_API void hx_probe_normal_force(const hxPlant *plant, double closed, double damping, double delta, double ddelta, double out[4]) {
  const hxNormalForce f = hx_normal_force(&plant->model, hx_splat(closed), hx_splat(damping), hx_splat(delta), hx_splat(ddelta));
  out[0] = hx_lane(f.force, 0), out[1] = hx_lane(f.elastic, 0), out[2] = hx_lane(f.stiffness, 0), out[3] = hx_lane(f.viscosity, 0);
}

HX_API double hx_probe_friction(const hxPlant *plant, double speed) {
  return hx_lane(hx_friction(plant->model.friction_law)->per_speed(&plant->model, hx_splat(speed)), 0);
}

/* command: angle, speed, torque; out: torque, friction, stiffness, damping */
HX_API void hx_probe_servo(const hxPlant *plant, double angle, double speed, const double command[3], double out[4]) {
  const hxServo servo =
      hx_servo_torque(&plant->model, hx_splat(angle), hx_splat(speed), hx_splat(command[0]), hx_splat(command[1]), hx_splat(command[2]));
  out[0] = hx_lane(servo.torque, 0), out[1] = hx_lane(servo.friction, 0);
  out[2] = hx_lane(servo.stiffness, 0), out[3] = hx_lane(servo.damping, 0);
}

/* out: distance, normal */
HX_API void hx_probe_ground(const hxPlant *plant, const double point[3], double out[4]) {
  const hxGround ground = hx_terrain(plant->model.terrain_kind)->ground(&plant->model, hx_splat_vec3(point));
  out[0] = hx_lane(ground.distance, 0);
  put3(ground.normal, 0, out + 1);
}

/* the plant's contacts after a switch; state: closed, damping, impact speed */
HX_API int hx_probe_contact_switch(hxPlant *plant, const double delta[HX_LEGS], const double ddelta[HX_LEGS], double state[3][HX_LEGS]) {
  double slots[2][HX_SLOTS] = {{0}};
  hxContactState *contact = &plant->state.contact;
  memcpy(slots[0], delta, HX_LEGS * sizeof(double));
  memcpy(slots[1], ddelta, HX_LEGS * sizeof(double));
  const int touchdowns = hx_contact_switch(&plant->model, slots[0], slots[1], contact);
  memcpy(state[0], contact->closed, HX_LEGS * sizeof(double));
  memcpy(state[1], contact->damping, HX_LEGS * sizeof(double));
  memcpy(state[2], contact->impact_speed, HX_LEGS * sizeof(double));
  return touchdowns;
}

/* ---- the plant as it is now ---------------------------------------------------------------------------------------------------- */

static void evaluate(hxPlant *plant, const hxInput *input, double age, hxWork *work, hxMotion *rate) {
  hxCommand command;
  hx_command_from_input(&command, input, plant->state.time - age);
  hx_dynamics_evaluate(&plant->model, &plant->state.contact, &command, plant->state.time, &plant->state.motion, 1, work, rate);
}

/* out: Phi 5, dPhi 5, gamma 5, s, u1, u2, s_i^P, s_j^P, angle, speed, inertia xx yy zz xy xz yz */
HX_API void hx_probe_joint(hxPlant *plant, const hxInput *input, int leg, int joint, double out[38]) {
  hxWork work;
  hxMotion rate;
  evaluate(plant, input, 0.0, &work, &rate);
  const int lane = leg % HX_LANES;
  const hxJointWork *w = &work.pack[leg / HX_LANES].joint[joint];
  const hxJointKinematics *k = &w->kin;
  put3(k->phi_lin, lane, out), put3(k->dphi_lin, lane, out + 5), put3(k->gamma_lin, lane, out + 10);
  for (int i = 0; i < 2; ++i) {
    out[3 + i] = hx_lane(k->phi[i], lane);
    out[8 + i] = hx_lane(k->dphi[i], lane);
    out[13 + i] = hx_lane(k->gamma[i], lane);
  }
  put3(k->s, lane, out + 15), put3(k->u1, lane, out + 18), put3(k->u2, lane, out + 21);
  put3(k->sP_i, lane, out + 24), put3(k->sP_j, lane, out + 27);
  out[30] = hx_lane(k->angle, lane), out[31] = hx_lane(k->speed, lane);
  const hxReal J[6] = {w->J.xx, w->J.yy, w->J.zz, w->J.xy, w->J.xz, w->J.yz};
  for (int i = 0; i < 6; ++i) out[32 + i] = hx_lane(J[i], lane);
}

/* out: point, velocity, normal, penetration, approach speed, force on the foot, stiffness, viscosity, drag; the last three as a step
 * of length `ahead` takes them */
HX_API void hx_probe_foot(hxPlant *plant, const hxInput *input, int leg, double ahead, double out[17]) {
  hxWork work;
  hxMotion rate;
  evaluate(plant, input, 0.0, &work, &rate);
  const int lane = leg % HX_LANES;
  hx_foot_ahead(&plant->model, &plant->state.contact, ahead, &work);
  const hxFootWork *foot = &work.pack[leg / HX_LANES].foot;
  put3(foot->kin.point, lane, out), put3(foot->kin.velocity, lane, out + 3), put3(foot->kin.normal, lane, out + 6);
  out[9] = hx_lane(foot->kin.delta, lane), out[10] = hx_lane(foot->kin.ddelta, lane);
  put3(foot->force, lane, out + 11);
  out[14] = hx_lane(foot->normal.stiffness, lane), out[15] = hx_lane(foot->normal.viscosity, lane), out[16] = hx_lane(foot->drag, lane);
}

/* dy/dt under a command given `age` seconds ago: bodies, and the powers of motors, push and everything that dissipates */
HX_API void hx_probe_rate(hxPlant *plant, const hxInput *input, double age, double body[HX_BODIES][HX_BODY_STATE], double power[3]) {
  hxWork work;
  hxMotion rate;
  evaluate(plant, input, age, &work, &rate);
  hx_bodies_from_motion(&rate, body);
  power[0] = rate.actuator_work, power[1] = rate.push_work, power[2] = rate.dissipated;
}

/* u of W u + D^T mu = G_v dv + G_x dx, D u = 0, for h gamma = z; rows of u: linear, angular */
HX_API void hx_probe_implicit(hxPlant *plant, const hxInput *input, double z, const double dx[HX_BODIES][HX_BODY_STATE],
                              const double dv[HX_BODIES][HX_BODY_STATE], double u[HX_BODIES][6]) {
  hxWork work;
  hxMotion rate, motion[3];
  hxImplicit implicit;
  double body[HX_BODIES][HX_BODY_STATE];
  memset(motion, 0, sizeof motion);
  evaluate(plant, input, 0.0, &work, &rate);
  hx_motion_from_bodies(&motion[0], dx);
  hx_motion_from_bodies(&motion[1], dv);
  hx_implicit_factorise(&plant->model, &work, z, &implicit);
  hx_implicit_solve(&implicit, &motion[0], &motion[1], &motion[2]);
  hx_bodies_from_motion(&motion[2], body);
  for (int b = 0; b < HX_BODIES; ++b) memcpy(u[b], &body[b][HX_V], 6 * sizeof(double));
}

/* shape: stages, order, error order; the rest as in hxMethodRow */
HX_API void hx_probe_method(int method, int shape[3], double *gamma, double a[HX_STAGES][HX_STAGES], double g[HX_STAGES][HX_STAGES],
                            double c[HX_STAGES], double b[HX_STAGES], double e[HX_STAGES]) {
  const hxMethodRow *row = hx_method(method);
  shape[0] = row->stages, shape[1] = row->order, shape[2] = row->error_order;
  *gamma = row->gamma;
  memcpy(a, row->a, sizeof row->a), memcpy(g, row->g, sizeof row->g);
  memcpy(c, row->c, sizeof row->c), memcpy(b, row->b, sizeof row->b), memcpy(e, row->e, sizeof row->e);
}
