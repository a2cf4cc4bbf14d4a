/* probe.c - exports the plant's internal functions for the tests, one leg (one lane) at a time.
 *
 * It is compiled into the shared library with HX_PROBE only. Vectors and matrices are passed as
 * rows of doubles.
 */
#include <math.h>
#include <string.h>

#include "command/command.h"
#include "contact_law.h"
#include "elementary.h"
#include "ground/soil.h"
#include "ground/surface.h"
#include "hexapod/hexapod.h"
#include "kernel.h"
#include "lanes/dynamics.h"
#include "method.h"
#include "robot/robot.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored                                                                     \
    "-Wmissing-prototypes" /* called from Python only: there is no header */
#endif

/* ---- lanes, vectors ---- */

static void put3(hxVec3 a, int lane, double *out) {
  out[0] = hx_lane(a.x, lane), out[1] = hx_lane(a.y, lane), out[2] = hx_lane(a.z, lane);
}

/* Evaluates n numbers pack by pack; n is a multiple of HX_SLOTS. */
HX_API void hx_probe_tanh(const double *x, double *out, int n) {
  for (int i = 0; i < n; i += HX_LANES) hx_store(out + i, hx_tanh(hx_load(x + i)));
}

HX_API void hx_probe_expm1(const double *x, double *out, int n) {
  for (int i = 0; i < n; i += HX_LANES) hx_store(out + i, hx_expm1(hx_load(x + i)));
}

HX_API void hx_probe_angle_from_half(const double *y, const double *x, double *out, int n) {
  for (int i = 0; i < n; i += HX_LANES)
    hx_store(out + i, hx_angle_from_half(hx_load(y + i), hx_load(x + i)));
}

HX_API void hx_probe_elementary(const double *x, double *sine, double *cosine, double *logarithm,
                                int n) {
  for (int i = 0; i < n; i++) {
    hx_sin_cos(x[i], &sine[i], &cosine[i]);
    logarithm[i] = x[i] > -1.0 ? hx_log1p(x[i]) : 0.0;
  }
}

HX_API void hx_probe_power(const double *x, const double *y, double *power, int n) {
  for (int i = 0; i < n; ++i) power[i] = hx_pow(fabs(x[i]), y[i]);
}

/* ---- soil ---- */

/* Writes F_v, its slope, plastic depth, f_n, its elastic part and derivatives, stored energy, shear
 * base and tan phi; row NULL: from the definition. */
HX_API void hx_probe_soil(const hxSoilDefinition *definition, const double *row, double radius,
                          double pad, double plastic, double z, double dz, double out[10]) {
  hxSoil soil;
  if (row)
    hx_soil_from_row(row, radius, pad, &soil);
  else
    hx_soil_compile(definition, radius, pad, &soil);
  hxReal numbers[HX_SOIL_SIZE];
  hxSoils soils;
  for (int i = 0; i < HX_SOIL_SIZE; ++i) numbers[i] = hx_splat(((const double *)&soil)[i]);
  memcpy(&soils, numbers, sizeof soils);
  const hxReal p = hx_splat(plastic), at = hx_splat(z);
  const hxSoilCurves virgin = hx_virgin_force(&soils, at);
  const hxSoilForces f = hx_soil_normal_force(&soils, p, at, hx_splat(dz), virgin);
  const hxReal result[10] = {virgin.force,
                             virgin.slope,
                             plastic_depth(&soils, at, virgin),
                             f.force,
                             f.elastic,
                             f.stiffness,
                             f.viscosity,
                             hx_stored_energy(&soils, p, at, virgin),
                             hx_shear_base(&soils, at),
                             soils.friction};
  for (int i = 0; i < 10; ++i) out[i] = hx_lane(result[i], 0);
}

/* Adds 1500 footprints at x = 0, 1, ... of depths 1, 2, ... mm, then in a call 100 of 2 m at the
 * first places; writes the depths at four places before the call, in it and after it was taken
 * back. */
HX_API void hx_probe_footprints(double depth[3][4]) {
  static const double place[4] = {0.0, 987.0, 988.0, 1499.0};
  static hxFootprint lost[HX_FOOTPRINTS];
  static hxFootprintLog log = {.lost = lost};
  hx_footprints_clear(&log);
  for (int k = 0; k < 1500; ++k)
    hx_footprints_add(&log, &(hxFootprint){k, 0.0, 1e-3 * (k + 1), 0.4});
  hx_footprints_begin(&log);
  for (int i = 0; i < 4; ++i) depth[0][i] = hx_footprints_depth(&log.kept, place[i], 0.0);
  for (int k = 0; k < 100; ++k) hx_footprints_add(&log, &(hxFootprint){k, 0.0, 2.0, 0.4});
  for (int i = 0; i < 4; ++i) depth[1][i] = hx_footprints_depth(&log.kept, place[i], 0.0);
  hx_footprints_take_back(&log);
  for (int i = 0; i < 4; ++i) depth[2][i] = hx_footprints_depth(&log.kept, place[i], 0.0);
}

HX_API double hx_probe_atan2(double y, double x) { return hx_atan2(y, x); }

static hxSym3 take_sym3(const double S[3][3]) {
  return (hxSym3){hx_splat(S[0][0]), hx_splat(S[1][1]), hx_splat(S[2][2]),
                  hx_splat(S[0][1]), hx_splat(S[0][2]), hx_splat(S[1][2])};
}

static hxMotion6 unit_motion(int j) {
  double x[6] = {0.0};
  x[j] = 1.0;
  return (hxMotion6){hx_splat_vec3(x), hx_splat_vec3(x + 3)};
}

static void put_column(hxForce6 f, int j, double out[6][6]) {
  double column[6];
  put3(f.ang, 0, column), put3(f.lin, 0, column + 3);
  for (int i = 0; i < 6; ++i) out[i][j] = column[i];
}

/* Computes four 6 x 6 inertias about the origin, angular part first: of a body with mass and J at
 * c; of the body less s U U^T, by two functions; of these plus a block A at c; and the inverse of
 * the last, column by column. */
HX_API void hx_probe_inertia(double mass, const double J[3][3], const double A[3][3],
                             const double c[3], double s, const double U[6], double out[4][6][6]) {
  const hxRigid6 body = hx_rigid_inertia(hx_splat(mass), take_sym3(J), hx_splat_vec3(c));
  const hxForce6 force = {hx_splat_vec3(U), hx_splat_vec3(U + 3)};
  const hxInertia6 lessened = hx_rigid_downdate(&body, hx_splat(s), force);
  hxInertia6 whole = hx_inertia_at(take_sym3(A), hx_splat_vec3(c));
  hx_inertia_add_rigid(&whole, &body);
  hx_inertia_downdate(&whole, hx_splat(s), force);
  for (int j = 0; j < 6; ++j) {
    const hxMotion6 unit = unit_motion(j);
    put_column(hx_rigid_mul(&body, unit), j, out[0]);
    put_column(hx_inertia_mul(&lessened, unit), j, out[1]);
    put_column(hx_inertia_mul(&whole, unit), j, out[2]);
    const hxMotion6 a = hx_inertia_solve(&whole, (hxForce6){unit.ang, unit.lin});
    put_column((hxForce6){a.ang, a.lin}, j, out[3]);
  }
}

/* ---- laws ---- */

HX_API double hx_probe_exact_restitution_chi(double e) { return hx_exact_restitution_chi(e); }

HX_API double hx_probe_contact_damping(const hxPlant *plant, double impact_speed) {
  return hx_contact(plant->model.contact_law)->damping(&plant->model, impact_speed);
}

/* Computes the normal force. out: force, elastic part, stiffness, viscosity. */
HX_API void hx_probe_normal_force(const hxPlant *plant, double closed, double damping, double delta,
                                  double ddelta, double out[4]) {
  const hxContactLawAt law = {hx_splat(closed), hx_splat(damping),
                              hx_splat(plant->model.stiffness)};
  const hxNormalForce f = hx_normal_force(law, hx_splat(delta), hx_splat(ddelta));
  out[0] = hx_lane(f.force, 0), out[1] = hx_lane(f.elastic, 0), out[2] = hx_lane(f.stiffness, 0),
  out[3] = hx_lane(f.viscosity, 0);
}

/* Friction over load of the plant's law at a slip velocity, and at a deflection of its bristles.
 * out: -f_t/f_n, db/dt, its slopes stiffness, damping, yield */
HX_API void hx_probe_sliding(const hxPlant *plant, const double slip[3], const double b[3],
                             double out[9]) {
  const hxModel *model = &plant->model;
  const hxVec3 v = hx_splat_vec3(slip), z = hx_splat_vec3(b);
  const hxReal one = hx_splat(1.0), zero = hx_splat(0.0);
  const hxFrictionAt at = {hx_splat(model->mu), hx_splat(model->static_rise)};
  const hxReal drag = hx_friction_drag(model, at, hx_sqrt(hx_dot(v, v)));
  hxGrip f = {hx_scale(drag, v), hx_zero3(), zero, drag, zero};
  if (hx_friction_kind(model->friction_law).has_bristles)
    f = hx_friction_grip(model, at, one, z, v);
  put3(f.traction, 0, out), put3(f.rate, 0, out + 3);
  out[6] = hx_lane(f.stiffness, 0), out[7] = hx_lane(f.damping, 0),
  out[8] = hx_lane(f.relaxation, 0);
}

/* Moment of spin and rolling friction over load at an angular velocity. out: moment, its slopes
 * about the normal and across it */
HX_API void hx_probe_turning(const hxPlant *plant, const double normal[3], const double w[3],
                             double out[5]) {
  const hxFrictionAt at = {hx_splat(plant->model.mu), hx_splat(plant->model.static_rise)};
  const hxTurningFriction f =
      hx_turning_moment(&plant->model, at, hx_splat(plant->model.radius[HX_FOOT]),
                        hx_splat_vec3(normal), hx_splat_vec3(w));
  put3(f.moment, 0, out);
  out[3] = hx_lane(f.spin, 0), out[4] = hx_lane(f.roll, 0);
}

/* Stops of a joint. out: torque, the damper's part, stiffness, damping */
HX_API void hx_probe_stop(const hxPlant *plant, int leg, int joint, double angle, double speed,
                          double out[4]) {
  const int lane = leg % HX_LANES;
  const hxStop stop =
      hx_stop_torque(&plant->model, joint, leg - lane, hx_splat(angle), hx_splat(speed));
  out[0] = hx_lane(stop.torque, lane), out[1] = hx_lane(stop.damped, lane);
  out[2] = hx_lane(stop.stiffness, lane), out[3] = hx_lane(stop.damping, lane);
}

/* Computes the friction of motor and gear under a motor torque and an external torque. out:
 * friction, drag */
HX_API void hx_probe_gear(const hxPlant *plant, double speed, double motor, double external,
                          double out[2]) {
  const hxReal w = hx_splat(speed), load = hx_splat(external);
  hxServo servo = {.torque = hx_splat(motor)};
  hx_measured_friction(&plant->model, &w, &load, &servo);
  out[0] = hx_lane(servo.friction, 0), out[1] = hx_lane(servo.drag, 0);
}

/* Computes a servo. command: angle, speed, torque, supply, strength; out: torque, friction,
 * stiffness, damping. */
HX_API void hx_probe_servo(const hxPlant *plant, double angle, double speed,
                           const double command[5], double out[4]) {
  const hxReal supply = hx_splat(command[3]);
  const hxServo servo = hx_servo_slopes(
      &plant->model, hx_splat(angle), hx_splat(speed), hx_splat(command[0]), hx_splat(command[1]),
      hx_splat(command[2]), (hxPower){supply, supply, hx_splat(command[4])});
  out[0] = hx_lane(servo.torque, 0), out[1] = hx_lane(servo.friction, 0);
  out[2] = hx_lane(servo.stiffness, 0), out[3] = hx_lane(servo.damping + servo.drag, 0);
}

/* A face of a grid at a point, kind: an hxFaceKind; out: distance, normal, its
 * derivative by the point xx yy zz xy xz yz. */
HX_API void hx_probe_face(const hxTerrain *terrain, int kind, const double point[3],
                          double out[10]) {
  const double none[2] = {-1.0, -1.0};
  hxFace face;
  hx_terrain_face(terrain, (hxFaceKind)kind, none, point, 1, &face);
  out[0] = face.distance;
  memcpy(out + 1, face.normal, sizeof face.normal);
  memcpy(out + 4, face.bend, sizeof face.bend);
}

/* The shares of contacts of a sphere; normal: rows of three. */
HX_API void hx_probe_shares(int count, const double *depth, const double *normal, double radius,
                            double *out) {
  hxSharers of = {.count = count};
  memcpy(of.depth, depth, (size_t)count * sizeof *depth);
  memcpy(of.normal, normal, (size_t)count * sizeof of.normal[0]);
  hx_contact_shares(&of, radius, out);
}

/* The upper bound of a sphere's depth in a grid; out: one number. */
HX_API void hx_probe_depth_bound(const hxTerrain *terrain, const double centre[3], double radius,
                                 double out[1]) {
  static hxModel model;
  const hxVec3 point = hx_splat_vec3(centre);
  model.terrain = terrain, model.radius[HX_FOOT] = radius;
  out[0] = hx_lane(hx_grid_depth_bound(&model, HX_FOOT, &point), 0);
}

/* Switches the plant's contacts and returns them. state: closed, damping, impact speed. */
HX_API int hx_probe_contact_switch(hxPlant *plant, const double delta[HX_LEGS],
                                   const double ddelta[HX_LEGS], double state[3][HX_LEGS]) {
  hxDepths depths;
  hxContactState *contact = &plant->state.contact;
  memcpy(depths.delta[HX_FOOT], delta, HX_LEGS * sizeof(double));
  memcpy(depths.ddelta[HX_FOOT], ddelta, HX_LEGS * sizeof(double));
  memset(depths.centre, 0, sizeof depths.centre);
  const int touchdowns = hx_contact_switch(&plant->model, &depths, contact);
  memcpy(state[0], contact->closed[HX_FOOT], HX_LEGS * sizeof(double));
  memcpy(state[1], contact->damping[HX_FOOT], HX_LEGS * sizeof(double));
  memcpy(state[2], contact->impact_speed[HX_FOOT], HX_LEGS * sizeof(double));
  return touchdowns;
}

/* ---- present state of the plant ---- */

static void evaluate(hxPlant *plant, const hxInput *input, double age, hxImplicit *implicit,
                     hxWork *work, hxRate *rate) {
  hxCommand command;
  hx_command_from_input(&command, input, plant->state.time - age);
  hx_supply_power(&command, &plant->model, &plant->state);
  hx_dynamics_evaluate(&plant->model, &plant->state.contact, &command, plant->state.time,
                       &plant->state.motion, NULL, implicit, 1, work, rate);
}

/* Computes a joint. out: Phi 5, dPhi 5, s, s_i^P, s_j^P, angle, speed, inertia xx yy zz xy xz yz.
 */
HX_API void hx_probe_joint(hxPlant *plant, const hxInput *input, int leg, int joint,
                           double out[27]) {
  hxWork work;
  hxRate rate;
  evaluate(plant, input, 0.0, NULL, &work, &rate);
  const int lane = leg % HX_LANES;
  const hxJointWork *w = &work.pack[leg / HX_LANES].joint[joint];
  const hxJointKinematics *k = &w->reaction.kin;
  const hxConstraint constraint =
      hx_joint_constraint(&plant->model, &plant->state.motion, joint, leg - lane);
  put3(constraint.phi_lin, lane, out), put3(constraint.dphi_lin, lane, out + 5);
  for (int i = 0; i < 2; ++i)
    out[3 + i] = hx_lane(constraint.phi[i], lane), out[8 + i] = hx_lane(constraint.dphi[i], lane);
  put3(k->s, lane, out + 10), put3(k->sP_i, lane, out + 13), put3(k->sP_j, lane, out + 16);
  out[19] = hx_lane(w->angle, lane), out[20] = hx_lane(w->speed, lane);
  const hxReal J[6] = {w->J.xx, w->J.yy, w->J.zz, w->J.xy, w->J.xz, w->J.yz};
  for (int i = 0; i < 6; ++i) out[21 + i] = hx_lane(J[i], lane);
}

/* Computes dy/dt under a command that is `age` seconds old: of the bodies, and the powers of
 * motors, push and dissipation. */
HX_API void hx_probe_rate(hxPlant *plant, const hxInput *input, double age,
                          double body[HX_BODIES][HX_BODY_STATE], double power[3]) {
  hxWork work;
  hxRate rate;
  evaluate(plant, input, age, NULL, &work, &rate);
  hx_bodies_from_motion(&plant->model, &rate.motion, body);
  power[0] = rate.motion.actuator_work, power[1] = rate.motion.push_work,
  power[2] = rate.motion.dissipated;
}

static void fill_bristles(const double z[HX_LEGS][3], hxPlantMotion *motion) {
  for (int i = 0; i < 3; ++i) {
    for (int leg = 0; leg < HX_LEGS; ++leg) motion->bristle[i][leg] = z[leg][i];
    hx_fill_slots(motion->bristle[i]);
  }
}

/* Sets the bristles and computes their rates db/dt. */
HX_API void hx_probe_bristles(hxPlant *plant, const hxInput *input, const double z[HX_LEGS][3],
                              double rate[HX_LEGS][3]) {
  hxWork work;
  hxRate all;
  fill_bristles(z, &plant->state.motion);
  evaluate(plant, input, 0.0, NULL, &work, &all);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int i = 0; i < 3; ++i) rate[leg][i] = all.motion.bristle[i][leg];
}

/* Writes the changes s_x and s_v, rows of the bodies (linear, angular), into a rate. */
static void put_change(const double s_x[HX_BODIES][6], const double s_v[HX_BODIES][6],
                       hxRate *change) {
  memset(change, 0, sizeof *change);
  for (int i = 0; i < 3; ++i) {
    change->motion.torso[HX_R + i] = s_x[0][i], change->torso_turn[i] = s_x[0][3 + i];
    change->motion.torso[HX_V + i] = s_v[0][i], change->motion.torso[HX_W + i] = s_v[0][3 + i];
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      for (int slot = 0; slot < HX_SLOTS; ++slot) {
        const int body = 1 + HX_JOINTS * (slot < HX_LEGS ? slot : 0) + joint;
        double (*link)[HX_SLOTS] = change->motion.link[joint];
        link[HX_R + i][slot] = s_x[body][i], change->link_turn[joint][i][slot] = s_x[body][3 + i];
        link[HX_V + i][slot] = s_v[body][i], link[HX_W + i][slot] = s_v[body][3 + i];
      }
  }
}

/* Computes k/h of a stage (eq. 19) with h gamma = z after the changes s_x and s_v (rows linear,
 * angular): the rates of the bodies, and the angular velocities of their quaternions' rates. The
 * derivatives of the forces are those at this state for a step of length `ahead`. */
HX_API void hx_probe_stage(hxPlant *plant, const hxInput *input, double z, double ahead,
                           const double s_x[HX_BODIES][6], const double s_v[HX_BODIES][6],
                           double body[HX_BODIES][HX_BODY_STATE], double turn[HX_BODIES][3]) {
  hxWork work;
  hxRate rate, change;
  hxImplicit implicit = {.z = z, .ahead = ahead};
  evaluate(plant, input, 0.0, &implicit, &work, &rate);
  put_change(s_x, s_v, &change);
  implicit.change = &change;
  evaluate(plant, input, 0.0, &implicit, &work, &rate);
  hx_bodies_from_motion(&plant->model, &rate.motion, body);
  for (int i = 0; i < 3; ++i) {
    turn[0][i] = rate.torso_turn[i];
    for (int b = 1; b < HX_BODIES; ++b)
      turn[b][i] = rate.link_turn[(b - 1) % HX_JOINTS][i][(b - 1) / HX_JOINTS];
  }
}

/* Copies what the servos' firmware and bus hold, of joints and legs: setpoints, their speeds, times
 * above the overload limit, shares of the duty limits in the last call, commanded angles. */
HX_API void hx_probe_firmware(const hxPlant *plant, double out[5][HX_JOINTS][HX_SLOTS]) {
  const hxState *state = &plant->state;
  memcpy(out[0], state->firmware.angle, sizeof out[0]);
  memcpy(out[1], state->firmware.rate, sizeof out[1]);
  memcpy(out[2], state->firmware.loaded, sizeof out[2]);
  memcpy(out[3], state->duty, sizeof out[3]);
  memcpy(out[4], state->bus.angle, sizeof out[4]);
}

/* Computes dy/dt with the i-th kernel. Returns its name, or NULL when there is none or the
 * processor does not support it. */
HX_API const char *hx_probe_kernel(int i, hxPlant *plant, const hxInput *input,
                                   double body[HX_BODIES][HX_BODY_STATE]) {
  hxCommand command;
  hxPlantMotion rate;
  for (int k = 0; k <= i; ++k)
    if (!hx_kernels[k]) return NULL;
  if (!hx_kernels[i]->is_supported()) return NULL;
  hx_command_from_input(&command, input, plant->state.time);
  hx_supply_power(&command, &plant->model, &plant->state);
  hx_kernels[i]->derivative(&plant->model, &plant->state, &command, 1, plant->scratch, &rate);
  hx_bodies_from_motion(&plant->model, &rate, body);
  return hx_kernels[i]->name;
}

/* Copies a row of the methods. shape: stages, order; others as in hxMethodRow. */
HX_API void hx_probe_method(int method, int shape[2], double *gamma, double a[HX_STAGES][HX_STAGES],
                            double g[HX_STAGES][HX_STAGES], double c[HX_STAGES],
                            double b[HX_STAGES], double e[HX_STAGES]) {
  const hxMethodRow *row = hx_method(method);
  shape[0] = row->stages, shape[1] = row->order;
  *gamma = row->gamma;
  memcpy(a, row->a, sizeof row->a), memcpy(g, row->g, sizeof row->g);
  memcpy(c, row->c, sizeof row->c), memcpy(b, row->b, sizeof row->b),
      memcpy(e, row->e, sizeof row->e);
}
