// pinocchio.cpp - runs a walk in Pinocchio with the plant's laws (law.h)
//
// The command line is that of the drivers (driver.h).
//
// METHOD: rk4, semi-implicit. STEP: step size. An evaluation is kinematics, servos, six contacts
// and ABA with external forces.
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/kinematics.hpp>

#include <pinocchio/multibody.hpp>

#include "driver.h"
#include "law.h"

namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Vector24 = Eigen::Matrix<double, 24, 1>;
using Vector25 = Eigen::Matrix<double, 25, 1>;

struct State {
  Vector25 q; // position, quaternion x y z w, angles along the joints' own axes
  Vector24 v; // torso axes, then speeds
};

struct Engine {
  pinocchio::Model model;
  std::unique_ptr<pinocchio::Data> data;
  std::vector<pinocchio::Force> external;
  const hxDefinition *definition = nullptr;
  Law law{};
  LawFoot foot[HX_LEGS]{};
  pinocchio::JointIndex joint[HX_LEGS][HX_JOINTS]{};
  double sign[HX_LEGS][HX_JOINTS]{}; // -1 where Pinocchio's joint turns about the opposite axis
  State state;
  double time = 0.0, step = 0.0, evaluations = 0.0;
  bool rk4 = true;
  bool fresh = true; // the next evaluation is a step's first: feet may touch down or lift off
};

Vector3d vector(const double *x) { return Vector3d(x[0], x[1], x[2]); }

pinocchio::Inertia inertia(double mass, const double *com, const double *J) {
  Matrix3d about_com;
  about_com << J[0], J[3], J[4], J[3], J[1], J[5], J[4], J[5], J[2];
  return pinocchio::Inertia(mass, vector(com), about_com);
}

// Returns the fast joint type for an axis of the frame (reversed for a negative axis), or the
// general one.
pinocchio::JointIndex add_joint(Engine &engine, pinocchio::JointIndex parent,
                                const pinocchio::SE3 &placement, const Vector3d &axis, double *sign,
                                const std::string &name) {
  int k = 0;
  axis.cwiseAbs().maxCoeff(&k);
  *sign = 1.0;
  if (axis.cwiseAbs()[k] < axis.norm())
    return engine.model.addJoint(parent, pinocchio::JointModelRevoluteUnaligned(axis), placement,
                                 name);
  *sign = axis[k] < 0.0 ? -1.0 : 1.0;
  if (k == 0) return engine.model.addJoint(parent, pinocchio::JointModelRX(), placement, name);
  if (k == 1) return engine.model.addJoint(parent, pinocchio::JointModelRY(), placement, name);
  return engine.model.addJoint(parent, pinocchio::JointModelRZ(), placement, name);
}

void add_leg(Engine &engine, pinocchio::JointIndex torso, int i) {
  const hxLeg &leg = engine.definition->leg[i];
  pinocchio::SE3 placement(Eigen::AngleAxisd(leg.hip_yaw, Vector3d::UnitZ()).toRotationMatrix(),
                           vector(leg.hip_position));
  pinocchio::JointIndex parent = torso;
  for (int j = 0; j < HX_JOINTS; ++j) {
    const hxLink &link = leg.link[j];
    const std::string name = std::to_string(HX_JOINTS * i + j);
    parent = engine.joint[i][j] =
        add_joint(engine, parent, placement, vector(link.axis), &engine.sign[i][j], name);
    engine.model.appendBodyToJoint(parent, inertia(link.mass, link.com, link.inertia),
                                   pinocchio::SE3::Identity());
    placement =
        pinocchio::SE3(Matrix3d::Identity(), Vector3d(link.length, link.offset_y, link.offset_z));
  }
}

void build(Engine &engine) {
  const hxDefinition &d = *engine.definition;
  const auto torso = engine.model.addJoint(0, pinocchio::JointModelFreeFlyer(),
                                           pinocchio::SE3::Identity(), "torso");
  engine.model.appendBodyToJoint(torso, inertia(d.torso.mass, d.torso.com, d.torso.inertia),
                                 pinocchio::SE3::Identity());
  for (int i = 0; i < HX_LEGS; ++i) add_leg(engine, torso, i);
  engine.model.gravity.linear(vector(d.gravity));
  engine.model.armature.tail(HX_LEGS * HX_JOINTS).setConstant(d.servo.rotor_inertia);
  engine.data = std::make_unique<pinocchio::Data>(engine.model);
  engine.external.assign(static_cast<std::size_t>(engine.model.njoints), pinocchio::Force::Zero());
}

// Centre [m] and velocity of the lowest point of a foot, and the arm of that point from the tibia's
// joint, world axes.
void foot_motion(const Engine &engine, int i, Vector3d &centre, Vector3d &arm, Vector3d &velocity) {
  const hxLink &tibia = engine.definition->leg[i].link[HX_JOINTS - 1];
  const auto joint = engine.joint[i][HX_JOINTS - 1];
  const pinocchio::SE3 &placement = engine.data->oMi[joint];
  arm = placement.rotation() * Vector3d(tibia.length, tibia.offset_y, tibia.offset_z);
  centre = placement.translation() + arm;
  arm[2] -= engine.law.radius;
  const pinocchio::Motion &local = engine.data->v[joint];
  velocity =
      placement.rotation() * local.linear() + (placement.rotation() * local.angular()).cross(arm);
}

void feel_ground(Engine &engine, int i) {
  Vector3d centre, arm, velocity, force;
  foot_motion(engine, i, centre, arm, velocity);
  const auto joint = engine.joint[i][HX_JOINTS - 1];
  const double depth = engine.law.radius - (centre[2] - engine.law.ground);
  if (engine.fresh) law_switch(&engine.law, &engine.foot[i], depth, -velocity[2]);
  engine.external[joint].setZero();
  if (law_foot(&engine.law, &engine.foot[i], centre.data(), velocity.data(), force.data()) <= 0.0)
    return;
  const Matrix3d &R = engine.data->oMi[joint].rotation();
  engine.external[joint].linear() = R.transpose() * force;
  engine.external[joint].angular() = R.transpose() * arm.cross(force);
}

Vector24 servo_torques(const Engine &engine, const State &state, const hxInput &input) {
  Vector24 torque = Vector24::Zero();
  for (int i = 0; i < HX_LEGS; ++i)
    for (int j = 0; j < HX_JOINTS; ++j) {
      const int k = HX_JOINTS * i + j;
      const double sign = engine.sign[i][j];
      torque[6 + k] =
          sign * law_servo(&engine.law, sign * state.q[7 + k], sign * state.v[6 + k],
                           input.angle_ref[i][j], input.speed_ref[i][j], input.torque_ref[i][j]);
    }
  return torque;
}

// dv/dt
Vector24 acceleration(Engine &engine, const State &state, const hxInput &input) {
  pinocchio::forwardKinematics(engine.model, *engine.data, state.q, state.v);
  for (int i = 0; i < HX_LEGS; ++i) feel_ground(engine, i);
  engine.fresh = false;
  engine.evaluations += 1.0;
  return pinocchio::aba(engine.model, *engine.data, state.q, state.v,
                        servo_torques(engine, state, input), engine.external);
}

// dq/dt
Vector25 position_rate(const Vector25 &q, const Vector24 &v) {
  const Quaterniond turn(q[6], q[3], q[4], q[5]);
  const Quaterniond spin = turn * Quaterniond(0.0, v[3], v[4], v[5]);
  Vector25 rate;
  rate.head<3>() = turn.toRotationMatrix() * v.head<3>();
  rate.segment<4>(3) = 0.5 * spin.coeffs();
  rate.tail<18>() = v.tail<18>();
  return rate;
}

State moved(const State &from, double h, const Vector25 &dq, const Vector24 &dv) {
  State to{from.q + h * dq, from.v + h * dv};
  to.q.segment<4>(3).normalize();
  return to;
}

void rk4_step(Engine &engine, const hxInput &input, double h) {
  const State &s = engine.state;
  const Vector24 a1 = acceleration(engine, s, input);
  const Vector25 v1 = position_rate(s.q, s.v);
  const State s2 = moved(s, 0.5 * h, v1, a1);
  const Vector24 a2 = acceleration(engine, s2, input);
  const Vector25 v2 = position_rate(s2.q, s2.v);
  const State s3 = moved(s, 0.5 * h, v2, a2);
  const Vector24 a3 = acceleration(engine, s3, input);
  const Vector25 v3 = position_rate(s3.q, s3.v);
  const State s4 = moved(s, h, v3, a3);
  const Vector24 a4 = acceleration(engine, s4, input);
  const Vector25 v4 = position_rate(s4.q, s4.v);
  engine.state = moved(s, h / 6.0, v1 + 2.0 * (v2 + v3) + v4, a1 + 2.0 * (a2 + a3) + a4);
}

void semi_implicit_step(Engine &engine, const hxInput &input, double h) {
  const Vector24 a = acceleration(engine, engine.state, input);
  const Vector24 after = engine.state.v + h * a;
  engine.state = moved(engine.state, h, position_rate(engine.state.q, after), a);
}

int prepare(void *self, const Recording *walk, const char *method, double step) {
  Engine &engine = *static_cast<Engine *>(self);
  engine.rk4 = std::strcmp(method, "rk4") == 0;
  if (!engine.rk4 && std::strcmp(method, "semi-implicit") != 0) {
    std::fprintf(stderr, "method %s: expected rk4 or semi-implicit\n", method);
    return 1;
  }
  engine.definition = &walk->definition;
  engine.step = step;
  build(engine);
  return law_compile(&engine.law, &walk->definition);
}

// walks start at rest
int start(void *self) {
  Engine &engine = *static_cast<Engine *>(self);
  const hxDefinition &d = *engine.definition;
  const double *p = d.initial.quaternion;
  const Quaterniond turn = Quaterniond(p[0], p[1], p[2], p[3]).normalized();
  engine.state.q.head<3>() = vector(d.initial.position) - turn * vector(d.torso.com);
  engine.state.q.segment<4>(3) = turn.coeffs();
  engine.state.v.setZero();
  for (int i = 0; i < HX_LEGS; ++i) {
    engine.foot[i] = LawFoot{};
    for (int j = 0; j < HX_JOINTS; ++j)
      engine.state.q[7 + HX_JOINTS * i + j] = engine.sign[i][j] * d.initial.angle[i][j];
  }
  engine.time = engine.evaluations = 0.0;
  return 0;
}

int advance(void *self, const hxInput *input, double t_end) {
  Engine &engine = *static_cast<Engine *>(self);
  const double begin = engine.time;
  const int count = static_cast<int>(std::lround((t_end - begin) / engine.step));
  const double h = (t_end - begin) / count;
  for (int k = 0; k < count; ++k) {
    engine.fresh = true;
    if (engine.rk4)
      rk4_step(engine, *input, h);
    else
      semi_implicit_step(engine, *input, h);
  }
  engine.time = t_end;
  return !engine.state.v.allFinite();
}

void torso(void *self, double position[3]) {
  const Engine &engine = *static_cast<Engine *>(self);
  const Vector25 &q = engine.state.q;
  const Vector3d r =
      q.head<3>() + Quaterniond(q[6], q[3], q[4], q[5]) * vector(engine.definition->torso.com);
  std::memcpy(position, r.data(), sizeof(double) * 3);
}

double evaluations(void *self) { return static_cast<Engine *>(self)->evaluations; }

void evaluate(void *self, const hxInput *input, int count) {
  Engine &engine = *static_cast<Engine *>(self);
  volatile double sink = 0.0;
  for (int i = 0; i < count; ++i) sink = sink + acceleration(engine, engine.state, *input)[0];
}

} // namespace

int main(int argc, char **argv) {
  static const Driver driver = {prepare, start, advance, torso, evaluations, evaluate};
  Engine engine;
  return driver_main(argc, argv, &driver, &engine);
}
