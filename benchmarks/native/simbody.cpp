// simbody.cpp - runs a walk in Simbody with the plant's laws (law.h)
//
// The command line is that of the drivers (driver.h).
//
// METHOD: CPodesBDF, RungeKuttaMerson, RungeKutta3, SemiExplicitEuler2, STEP: accuracy;
// SemiExplicitEuler, STEP: step size. An evaluation is realize(Acceleration): kinematics, servos,
// contacts, rotors and the articulated bodies.
//
// The tree is Simbody's: a Free mobiliser for the torso, a Pin for every joint, link frames at
// their joints. The law is one Force::Custom; touch-downs are located by a TriggeredEventHandler,
// which samples the impact speed there. A command's end stops a one-step method (a
// PeriodicEventHandler); the multistep one runs over it under its error control, since a restart at
// order 1 every 5 ms made it 4 x slower.
//
// Simbody has no reflected inertia, and here the rotors outweigh the links. A rotor body behind a
// Constraint::CoordinateCoupler would double the bodies and add 18 constraints; an inertia added to
// the links would be another robot. So the rotors act as what they are, mobility forces -J_r qdd,
// with qdd solved beforehand from Simbody's own operators (see Rotors).
#include <Simbody.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "driver.h"
#include "law.h"

using namespace SimTK;

namespace {

constexpr int base = 6; // the torso's mobilities, the first ones
constexpr int timed_evaluations = 2000;

// ----------------------------------------------------------------------------------------------
// robot

Inertia inertia_of(const double J[6]) { return Inertia(J[0], J[1], J[2], J[3], J[4], J[5]); }

// Simbody's inertias are about the body's origin.
MassProperties mass_properties(double mass, const Vec3 &com, const double J[6]) {
  return MassProperties(mass, com, inertia_of(J).shiftFromMassCenter(com, mass));
}

Vec3 tip_of(const hxLink &link) { return Vec3(link.length, link.offset_y, link.offset_z); }

class Robot {
public:
  MultibodySystem system;
  SimbodyMatterSubsystem matter{system};
  GeneralForceSubsystem forces{system};
  MobilizedBody::Free torso;
  Vec3 foot[HX_LEGS]; // m, foot's centre, tibia's frame

  explicit Robot(const hxDefinition &d) {
    const Body::Rigid body(MassProperties(d.torso.mass, Vec3(0), inertia_of(d.torso.inertia)));
    torso = MobilizedBody::Free(matter.Ground(), Transform(), body, Transform());
    for (int leg = 0; leg < HX_LEGS; ++leg) add_leg(d, leg);
    forces.setNumberOfThreads(1);
    const State &state = system.realizeTopology();
    for (int leg = 0; leg < HX_LEGS; ++leg)
      for (int joint = 0; joint < HX_JOINTS; ++joint) {
        coordinates[leg][joint] = pins[leg][joint].getFirstQIndex(state);
        mobilities[leg][joint] = pins[leg][joint].getFirstUIndex(state);
      }
  }

  const MobilizedBody &link(int leg, int joint) const { return pins[leg][joint]; }
  const MobilizedBody &tibia(int leg) const { return pins[leg][HX_JOINTS - 1]; }
  const Vec3 &axis(int leg, int joint) const { return axes[leg][joint]; } // link's frame
  int coordinate(int leg, int joint) const { return coordinates[leg][joint]; } // of q
  int mobility(int leg, int joint) const { return mobilities[leg][joint]; } // of u

private:
  MobilizedBody::Pin pins[HX_LEGS][HX_JOINTS];
  Vec3 axes[HX_LEGS][HX_JOINTS];
  int coordinates[HX_LEGS][HX_JOINTS], mobilities[HX_LEGS][HX_JOINTS];

  // A pin turns about z of its frames, so these have z along the joint's axis.
  void add_leg(const hxDefinition &d, int leg) {
    MobilizedBody parent = torso;
    Vec3 place = Vec3::getAs(d.leg[leg].hip_position) - Vec3::getAs(d.torso.com);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxLink &link = d.leg[leg].link[joint];
      const Rotation zero(joint == 0 ? d.leg[leg].hip_yaw : 0.0, ZAxis);
      const Rotation axis(UnitVec3(Vec3::getAs(link.axis)), ZAxis);
      axes[leg][joint] = axis.z().asVec3();
      const Body::Rigid body(mass_properties(link.mass, Vec3::getAs(link.com), link.inertia));
      pins[leg][joint] =
          MobilizedBody::Pin(parent, Transform(zero * axis, place), body, Transform(axis));
      parent = pins[leg][joint];
      place = tip_of(link);
    }
    foot[leg] = place;
  }
};

// ----------------------------------------------------------------------------------------------
// law

// Data of a run. Event handlers change its discrete state: the command's number and the feet.
struct Setup {
  const Robot &robot;
  const Walk &walk;
  const bool restarts; // at every command
  Law law;
  std::int64_t command = 0;
  LawFoot foot[HX_LEGS] = {};

  Setup(const Robot &r, const Walk &w, bool restart) : robot(r), walk(w), restarts(restart) {
    if (law_compile(&law, &w.definition))
      throw std::runtime_error("walk: another law than the peers'");
  }

  const hxInput &input(double time) const { return walk.input[restarts ? command : number(time)]; }

  // of the command that begins at a time or is in force there
  std::int64_t number(double time) const {
    return std::min(static_cast<std::int64_t>(std::floor(time / walk.h + 1e-9)), walk.n - 1);
  }

  double depth(const State &state, int leg) const {
    return law.radius -
           (robot.tibia(leg).findStationLocationInGround(state, robot.foot[leg])[2] - law.ground);
  }

  // m from the tibia's origin, world axes, and m/s: the foot's lowest point
  Vec3 lowest(const State &state, int leg) const {
    return robot.tibia(leg).getBodyRotation(state) * robot.foot[leg] - Vec3(0, 0, law.radius);
  }
  Vec3 velocity(const State &state, int leg, const Vec3 &arm) const {
    const SpatialVec &V = robot.tibia(leg).getBodyVelocity(state);
    return V[1] + V[0] % arm;
  }

  void close(int leg, double impact_speed) { foot[leg] = {1, law_damping(&law, impact_speed)}; }

  // the time of a lift-off within the step has no effect
  void open_lifted(const State &state) {
    robot.system.realize(state, Stage::Position);
    for (int leg = 0; leg < HX_LEGS; ++leg)
      if (depth(state, leg) < 0.0) foot[leg].closed = 0;
  }

  // feet in the ground are closed as if they had come slowly
  void start(const State &state) {
    command = 0;
    robot.system.realize(state, Stage::Position);
    for (int leg = 0; leg < HX_LEGS; ++leg) {
      foot[leg] = {};
      if (depth(state, leg) > 0.0) close(leg, 0.0);
    }
  }
};

// Adds the rotors' inertia to Simbody's equations, as the mobility forces -J_r qdd of (M + J_r)
// udot = f - bias. M comes from Simbody's composite body inertias: joint k moves all beyond it with
// C_k s_k, of which an inboard joint sees the torque about its own axis.
class Rotors {
public:
  Rotors(const Robot &r, double inertia)
      : robot(r), J(inertia), still(Vector(base + HX_LEGS * HX_JOINTS, 0.0)) {}

  void add_forces(const State &state, const Vector_<SpatialVec> &body_forces,
                  Vector &mobility_forces) {
    if (J == 0.0) return;
    robot.matter.calcResidualForceIgnoringConstraints(state, mobility_forces, body_forces, still,
                                                      residual);
    const double *minus_force = residual.getContiguousScalarData();
    robot.matter.realizeCompositeBodyInertias(state);
    torso = robot.matter.getCompositeBodyInertia(state, robot.torso.getMobilizedBodyIndex())
                .toSpatialMat();
    torso_force = -SpatialVec(Vec3::getAs(minus_force), Vec3::getAs(minus_force + 3));
    for (int leg = 0; leg < HX_LEGS; ++leg) {
      for (int joint = 0; joint < HX_JOINTS; ++joint)
        leg_force[leg][joint] = -minus_force[robot.mobility(leg, joint)];
      find_leg(state, leg);
    }
    solve(mobility_forces);
  }

private:
  const Robot &robot;
  double J;
  Vector still, residual;
  SpatialMat torso; // blocks of M + J_r: the torso's, each leg's, and the one between
  Mat33 leg_block[HX_LEGS];
  SpatialVec between[HX_LEGS][HX_JOINTS];
  SpatialVec torso_force;
  Vec3 leg_force[HX_LEGS];

  void find_leg(const State &state, int leg) {
    Vec3 place[HX_JOINTS], axis[HX_JOINTS];
    const Vec3 centre = robot.torso.getBodyTransform(state).p();
    for (int k = 0; k < HX_JOINTS; ++k) {
      const MobilizedBody &link = robot.link(leg, k);
      const Transform &X = link.getBodyTransform(state);
      place[k] = X.p();
      axis[k] = X.R() * robot.axis(leg, k);
      const SpatialVec f =
          robot.matter.getCompositeBodyInertia(state, link.getMobilizedBodyIndex()) *
          SpatialVec(axis[k], Vec3(0));
      for (int j = 0; j <= k; ++j)
        leg_block[leg](j, k) = leg_block[leg](k, j) =
            dot(axis[j], f[0] + (place[k] - place[j]) % f[1]);
      leg_block[leg](k, k) += J;
      between[leg][k] = SpatialVec(f[0] + (place[k] - centre) % f[1], f[1]);
    }
  }

  // flat first: SpatialMat's own invert() takes its blocks for numbers that commute
  SpatialVec torso_acceleration() const {
    Mat66 flat;
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j) flat.updSubMat<3, 3>(3 * i, 3 * j) = torso(i, j);
    const Mat66 inverse = flat.invert();
    SpatialVec udot(Vec3(0), Vec3(0));
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j) udot[i] += inverse.getSubMat<3, 3>(3 * i, 3 * j) * torso_force[j];
    return udot;
  }

  // legs eliminated, then the torso, then the legs
  void solve(Vector &mobility_forces) {
    Mat33 inverse[HX_LEGS];
    for (int leg = 0; leg < HX_LEGS; ++leg) {
      inverse[leg] = leg_block[leg].invert();
      for (int j = 0; j < HX_JOINTS; ++j) {
        SpatialVec factor(Vec3(0), Vec3(0));
        for (int k = 0; k < HX_JOINTS; ++k) factor += inverse[leg](j, k) * between[leg][k];
        torso -= between[leg][j] * ~factor;
        torso_force -= leg_force[leg][j] * factor;
      }
    }
    const SpatialVec udot = torso_acceleration();
    for (int leg = 0; leg < HX_LEGS; ++leg) {
      Vec3 force;
      for (int joint = 0; joint < HX_JOINTS; ++joint)
        force[joint] = leg_force[leg][joint] - ~between[leg][joint] * udot;
      const Vec3 qdd = inverse[leg] * force;
      for (int joint = 0; joint < HX_JOINTS; ++joint)
        mobility_forces[robot.mobility(leg, joint)] -= J * qdd[joint];
    }
  }
};

class PlantLaw : public Force::Custom::Implementation {
public:
  explicit PlantLaw(const Setup &s)
      : setup(s), d(s.walk.definition), robot(s.robot), rotors(s.robot, d.servo.rotor_inertia) {}

  void calcForce(const State &state, Vector_<SpatialVec> &body_forces, Vector_<Vec3> &,
                 Vector &mobility_forces) const override {
    const hxInput &input = setup.input(state.getTime());
    add_gravity_and_push(state, input, body_forces);
    add_servos(state, input, mobility_forces);
    for (int leg = 0; leg < HX_LEGS; ++leg)
      if (setup.foot[leg].closed) add_contact(state, leg, body_forces);
    rotors.add_forces(state, body_forces, mobility_forces);
  }

  Real calcPotentialEnergy(const State &) const override { return 0.0; }

private:
  const Setup &setup;
  const hxDefinition &d;
  const Robot &robot;
  mutable Rotors rotors;

  void add_gravity_and_push(const State &state, const hxInput &in,
                            Vector_<SpatialVec> &body_forces) const {
    const Vec3 g = Vec3::getAs(d.gravity);
    for (MobilizedBodyIndex b(1); b < robot.matter.getNumBodies(); ++b) {
      const MobilizedBody &body = robot.matter.getMobilizedBody(b);
      const MassProperties &m = body.getBodyMassProperties(state);
      const Vec3 weight = m.getMass() * g;
      body_forces[b] +=
          SpatialVec((body.getBodyRotation(state) * m.getMassCenter()) % weight, weight);
    }
    body_forces[robot.torso.getMobilizedBodyIndex()] +=
        SpatialVec(Vec3::getAs(in.push_torque), Vec3::getAs(in.push_force));
  }

  void add_servos(const State &state, const hxInput &in, Vector &mobility_forces) const {
    const double *q = state.getQ().getContiguousScalarData(),
                 *u = state.getU().getContiguousScalarData();
    for (int leg = 0; leg < HX_LEGS; ++leg)
      for (int joint = 0; joint < HX_JOINTS; ++joint) {
        const int i = robot.mobility(leg, joint);
        mobility_forces[i] +=
            law_servo(&setup.law, q[robot.coordinate(leg, joint)], u[i], in.angle_ref[leg][joint],
                      in.speed_ref[leg][joint], in.torque_ref[leg][joint]);
      }
  }

  void add_contact(const State &state, int leg, Vector_<SpatialVec> &body_forces) const {
    const MobilizedBody &tibia = robot.tibia(leg);
    const Vec3 arm = setup.lowest(state, leg),
               centre = tibia.getBodyOriginLocation(state) + arm + Vec3(0, 0, setup.law.radius);
    const Vec3 velocity = setup.velocity(state, leg, arm);
    Vec3 force;
    law_foot(&setup.law, &setup.foot[leg], &centre[0], &velocity[0], &force[0]);
    body_forces[tibia.getMobilizedBodyIndex()] += SpatialVec(arm % force, force);
  }
};

// ----------------------------------------------------------------------------------------------
// events

class TouchDown : public TriggeredEventHandler {
public:
  TouchDown(Setup &s, int l) : TriggeredEventHandler(Stage::Position), setup(s), leg(l) {
    getTriggerInfo().setTriggerOnFallingSignTransition(false);
  }

  Real getValue(const State &state) const override { return setup.depth(state, leg); }

  void handleEvent(State &state, Real, bool &) const override {
    setup.robot.system.realize(state, Stage::Velocity);
    setup.close(leg, -setup.velocity(state, leg, setup.lowest(state, leg))[2]);
    state.invalidateAllCacheAtOrAbove(Stage::Dynamics);
  }

private:
  Setup &setup;
  int leg;
};

// Every h.
class NextCommand : public PeriodicEventHandler {
public:
  explicit NextCommand(Setup &s) : PeriodicEventHandler(s.walk.h), setup(s) {}

  void handleEvent(State &state, Real, bool &) const override {
    setup.command = setup.number(state.getTime());
    state.invalidateAllCacheAtOrAbove(Stage::Dynamics);
  }

private:
  Setup &setup;
};

// ----------------------------------------------------------------------------------------------
// run

struct Method {
  const char *name;
  bool fixed_step, multistep;
  std::unique_ptr<Integrator> (*make)(const System &system, double step);
};

template <class T> std::unique_ptr<Integrator> error_controlled(const System &system, double) {
  return std::make_unique<T>(system);
}

template <class T> std::unique_ptr<Integrator> fixed(const System &system, double step) {
  return std::make_unique<T>(system, step);
}

const Method methods[] = {
    {"CPodesBDF", false, true, error_controlled<CPodesIntegrator>},
    {"RungeKuttaMerson", false, false, error_controlled<RungeKuttaMersonIntegrator>},
    {"RungeKutta3", false, false, error_controlled<RungeKutta3Integrator>},
    {"SemiExplicitEuler2", false, false, error_controlled<SemiExplicitEuler2Integrator>},
    {"SemiExplicitEuler", true, false, fixed<SemiExplicitEulerIntegrator>},
};

const Method &method_of(const std::string &name) {
  std::string known;
  for (const Method &m : methods) {
    if (name == m.name) return m;
    known += std::string(" ") + m.name;
  }
  throw std::runtime_error("method: got " + name + ", expected one of" + known);
}

State initial_state(const Robot &robot, const hxDefinition &d) {
  State state = robot.system.getDefaultState();
  const auto &at = d.initial;
  robot.torso.setQToFitTransform(
      state, Transform(Rotation(Quaternion(Vec4::getAs(at.quaternion))), Vec3::getAs(at.position)));
  robot.torso.setUToFitVelocity(
      state, SpatialVec(Vec3::getAs(at.angular_velocity), Vec3::getAs(at.velocity)));
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      state.updQ()[robot.coordinate(leg, joint)] = at.angle[leg][joint];
      state.updU()[robot.mobility(leg, joint)] = at.speed[leg][joint];
    }
  return state;
}

struct Run {
  double seconds;
  int evaluations;
  std::vector<double> path; // m, x y z of every moment
};

void record(const Robot &robot, const State &state, std::vector<double> &path) {
  robot.system.realize(state, Stage::Position);
  const Vec3 &r = robot.torso.getBodyOriginLocation(state);
  path.insert(path.end(), &r[0], &r[0] + 3);
}

Run walk_once(const Method &method, double step, Setup &setup, const State &first) {
  const Robot &robot = setup.robot;
  setup.start(first);
  const std::unique_ptr<Integrator> integrator = method.make(robot.system, step);
  if (!method.fixed_step) integrator->setAccuracy(step);
  TimeStepper stepper(robot.system, *integrator);
  stepper.initialize(first);
  Run run{};
  const double begin = seconds_now();
  const int before = robot.system.getNumRealizationsOfThisStage(Stage::Acceleration);
  record(robot, stepper.getState(), run.path);
  for (std::int64_t k = 1; k <= setup.walk.n; ++k) {
    stepper.stepTo(static_cast<double>(k) * setup.walk.h);
    setup.open_lifted(stepper.getState());
    record(robot, stepper.getState(), run.path);
  }
  run.seconds = seconds_now() - begin;
  run.evaluations = robot.system.getNumRealizationsOfThisStage(Stage::Acceleration) - before;
  return run;
}

// Evaluates at another state each time, so that no cached result is used.
double microseconds_per_evaluation(Setup &setup, State state) {
  setup.start(state);
  const double begin = seconds_now();
  for (int i = 0; i < timed_evaluations; ++i) {
    state.updQ() += 1e-9;
    state.updU() += 1e-9;
    setup.robot.system.realize(state, Stage::Acceleration);
  }
  return 1e6 * (seconds_now() - begin) / timed_evaluations;
}

void run(char **argv) {
  Walk walk{};
  if (walk_read(argv[1], &walk)) throw std::runtime_error("no walk");
  const Method &method = method_of(argv[2]);
  const int repeats = std::stoi(argv[4]);
  Robot robot(walk.definition);
  Setup setup(robot, walk, !method.multistep);
  Force::Custom law(robot.forces,
                    new PlantLaw(setup)); // the system owns it, as it does the handlers
  for (int leg = 0; leg < HX_LEGS; ++leg) robot.system.addEventHandler(new TouchDown(setup, leg));
  if (setup.restarts) robot.system.addEventHandler(new NextCommand(setup));
  robot.system.realizeTopology();
  const State first = initial_state(robot, walk.definition);
  Run last{};
  std::string seconds;
  for (int i = 0; i < repeats; ++i) {
    last = walk_once(method, std::stod(argv[3]), setup, first);
    seconds += (i > 0 ? ", " : "") + std::to_string(last.seconds);
  }
  const double each = microseconds_per_evaluation(setup, first);
  if (path_write(argv[5], last.path.data(), walk.n)) throw std::runtime_error("no path written");
  std::printf("{\"seconds\": [%s], \"evaluations\": %d, \"microseconds_per_evaluation\": %.6f}\n",
              seconds.c_str(), last.evaluations, each);
}

} // namespace

int main(int argc, char **argv) {
  if (argc != 6) {
    std::fprintf(stderr, "usage: simbody WALK METHOD STEP REPEATS PATH_OUT\n");
    return 2;
  }
  try {
    run(argv);
  } catch (const std::exception &e) {
    std::fprintf(stderr, "simbody: %s\n", e.what());
    return 1;
  }
  return 0;
}
