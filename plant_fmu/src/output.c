#include "output.h"

#include <math.h>

static void get3(hxVec3 a, int lane, double out[3]) {
  out[0] = hx_lane(a.x, lane);
  out[1] = hx_lane(a.y, lane);
  out[2] = hx_lane(a.z, lane);
}

/* the pack and lane that hold a leg */
static const hxLegWork *leg_work(const hxWork *work, int leg, int *lane) {
  *lane = leg % HX_LANES;
  return &work->pack[leg / HX_LANES];
}

static hxReal body_kinetic(hxReal mass, hxSym3 J, const hxBodyWork *body) {
  return 0.5 * (mass * hx_dot(body->v, body->v) + hx_dot(body->w, hx_sym_mul(J, body->w)));
}

HX_LOCAL double hx_kinetic_energy(const hxModel *model, const hxWork *work) {
  double sum = hx_lane(body_kinetic(hx_splat(model->torso_mass), work->torso_J, &work->torso), 0);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    int lane;
    const hxLegWork *w = leg_work(work, leg, &lane);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxJointWork *k = &w->joint[joint];
      const hxReal rotor = (0.5 * model->rotor_inertia) * k->kin.speed * k->kin.speed;
      sum += hx_lane(body_kinetic(k->mass, k->J, &k->kin.body) + rotor, lane);
    }
  }
  return sum;
}

HX_LOCAL double hx_potential_energy(const hxModel *model, const hxWork *work) {
  const hxVec3 g = hx_splat_vec3(model->gravity);
  double sum = -model->torso_mass * hx_lane(hx_dot(g, work->torso.r), 0);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    int lane;
    const hxLegWork *w = leg_work(work, leg, &lane);
    for (int joint = 0; joint < HX_JOINTS; ++joint) sum -= hx_lane(w->joint[joint].mass * hx_dot(g, w->joint[joint].kin.body.r), lane);
    sum += 0.4 * hx_lane(w->foot.normal.elastic, lane) * fmax(hx_lane(w->foot.kin.delta, lane), 0.0);
  }
  return sum;
}

/* joint on child: force -lambda, torque about the joint's point -(u1 lambda_4 + u2 lambda_5); the motor's torque is not in it */
static void fill_joint(const hxJointWork *k, int lane, int leg, int joint, hxOutput *o) {
  const hxVec3 couple = hx_add_scaled(hx_scale(k->lambda[0], k->kin.u1), k->lambda[1], k->kin.u2);
  o->angle[leg][joint] = hx_lane(k->kin.angle, lane);
  o->speed[leg][joint] = hx_lane(k->kin.speed, lane);
  o->torque[leg][joint] = hx_lane(k->servo.torque, lane);
  get3(hx_neg(k->lambda_lin), lane, o->reaction_force[leg][joint]);
  get3(hx_neg(couple), lane, o->reaction_torque[leg][joint]);
}

static void fill_foot(const hxFootWork *foot, const hxContactState *contact, int lane, int leg, hxOutput *o) {
  get3(foot->force, lane, o->foot.force[leg]);
  get3(foot->kin.point, lane, o->foot.position[leg]);
  get3(foot->kin.velocity, lane, o->foot.velocity[leg]);
  o->foot.normal_force[leg] = hx_lane(foot->normal.force, lane);
  o->foot.tangential_force[leg] = hx_lane(foot->drag * foot->slip_speed, lane);
  o->foot.slip_speed[leg] = hx_lane(foot->slip_speed, lane);
  o->foot.penetration[leg] = hx_lane(foot->kin.delta, lane);
  o->foot.impact_speed[leg] = contact->impact_speed[leg];
  o->foot.contact[leg] = contact->closed[leg] != 0.0;
}

static void fill_torso(const hxModel *model, const hxMotion *motion, const hxWork *work, hxOutput *o) {
  const double *m = motion->torso;
  const hxMat3 R = work->torso.R;
  double Rx[3], Ry[3], Rz[3];
  get3(R.x, 0, Rx), get3(R.y, 0, Ry), get3(R.z, 0, Rz);
  for (int i = 0; i < 3; ++i) {
    o->torso.position[i] = m[HX_R + i];
    o->torso.velocity[i] = m[HX_V + i];
    o->torso.angular_velocity[i] = m[HX_W + i];
  }
  for (int i = 0; i < 4; ++i) o->torso.quaternion[i] = m[HX_P + i];
  o->torso.roll = atan2(Rz[1], Rz[2]);
  o->torso.pitch = asin(fmin(1.0, fmax(-1.0, -Rz[0])));
  o->torso.yaw = atan2(Ry[0], Rx[0]);
  const hxVec3 felt = hx_sub(hx_splat_vec3(work->torso_acceleration + 3), hx_splat_vec3(model->gravity));
  get3(hx_tmul(R, felt), 0, o->imu.specific_force);
  get3(hx_tmul(R, work->torso.w), 0, o->imu.angular_velocity);
}

/* norms of Phi and dPhi/dt over all joints */
static void fill_constraint(const hxWork *work, hxOutput *o) {
  double position = 0.0, velocity = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    int lane;
    const hxLegWork *w = leg_work(work, leg, &lane);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxJointKinematics *k = &w->joint[joint].kin;
      position += hx_lane(hx_dot(k->phi_lin, k->phi_lin) + k->phi[0] * k->phi[0] + k->phi[1] * k->phi[1], lane);
      velocity += hx_lane(hx_dot(k->dphi_lin, k->dphi_lin) + k->dphi[0] * k->dphi[0] + k->dphi[1] * k->dphi[1], lane);
    }
  }
  o->constraint.position_error = sqrt(position);
  o->constraint.velocity_error = sqrt(velocity);
}

static void fill_energy(const hxModel *model, const hxState *state, const hxWork *work, hxOutput *o) {
  const hxMotion *m = &state->motion;
  o->energy.kinetic = hx_kinetic_energy(model, work);
  o->energy.potential = hx_potential_energy(model, work);
  o->energy.actuator_work = m->actuator_work;
  o->energy.push_work = m->push_work;
  o->energy.dissipated = m->dissipated;
  o->energy.residual = o->energy.kinetic + o->energy.potential - state->stored_at_start - m->actuator_work - m->push_work + m->dissipated;
}

HX_LOCAL void hx_output_fill(const hxModel *model, const hxState *state, const hxWork *work, hxOutput *o) {
  o->time = state->time;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    int lane;
    const hxLegWork *w = leg_work(work, leg, &lane);
    for (int joint = 0; joint < HX_JOINTS; ++joint) fill_joint(&w->joint[joint], lane, leg, joint, o);
    fill_foot(&w->foot, &state->contact, lane, leg, o);
  }
  fill_torso(model, &state->motion, work, o);
  fill_energy(model, state, work, o);
  fill_constraint(work, o);
  o->solver.evaluations = state->evaluations;
  o->solver.steps = state->steps;
  o->solver.rejected = state->rejected;
  o->solver.touchdowns = state->touchdowns;
}

HX_LOCAL void hx_accelerations_fill(const hxWork *work, const hxMotion *rate, double acceleration[HX_BODIES][6],
                                    double multiplier[HX_BODIES - 1][HX_MULTIPLIERS], double drive_torque[HX_BODIES - 1]) {
  for (int i = 0; i < 6; ++i) acceleration[0][i] = rate->torso[HX_V + i];
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    int lane;
    const hxLegWork *w = leg_work(work, leg, &lane);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxJointWork *k = &w->joint[joint];
      const int row = HX_JOINTS * leg + joint;
      for (int i = 0; i < 6; ++i) acceleration[1 + row][i] = rate->link[joint][HX_V + i][leg];
      get3(k->lambda_lin, lane, multiplier[row]);
      for (int i = 0; i < 2; ++i) multiplier[row][3 + i] = hx_lane(k->lambda[i], lane);
      drive_torque[row] = hx_lane(k->servo.torque, lane);
    }
  }
}
