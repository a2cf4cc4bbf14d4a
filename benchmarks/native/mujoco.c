/* mujoco.c - runs a walk in MuJoCo, with the drivers' command line (driver.h)
 *
 * METHOD: "own-" or "law-", then an integrator of MuJoCo: implicitfast, RK4, Euler, implicit. STEP:
 * its time step. own: MuJoCo's contact, friction and servos as its users have them: a sphere on a
 * plane, elliptic cone, default solref and solimp (about this foot's depth at rest), position
 * actuators with force limits, dry friction of the gears as frictionloss. law: the plant's laws
 * (law.h) as a passive force, MuJoCo's contacts and constraints off.
 */
#include <mujoco/mujoco.h>
#include <string.h>

#include "driver.h"
#include "law.h"

enum { XML_SIZE = 1 << 16 };

typedef struct {
  const hxDefinition *definition;
  mjModel *model;
  mjData *data;
  Law law;
  int own;
  int fresh; /* the next evaluation is a step's first: feet may touch down or lift off */
  LawFoot foot[HX_LEGS];
  const hxInput *input;
  double evaluations;
} MuJoCo;

static MuJoCo *present; /* the callback has no argument of its own */

/* ---- model ---- */

typedef struct {
  char text[XML_SIZE];
  size_t size;
} Xml;

#define ADD(xml, ...)                                                                              \
  ((xml)->size += (size_t)snprintf((xml)->text + (xml)->size, XML_SIZE - (xml)->size, __VA_ARGS__))

static void add_inertial(Xml *xml, double mass, const double com[3], const double J[6]) {
  ADD(xml,
      "<inertial mass='%.17g' pos='%.17g %.17g %.17g' fullinertia='%.17g %.17g %.17g %.17g %.17g "
      "%.17g'/>\n",
      mass, com[0], com[1], com[2], J[0], J[1], J[2], J[3], J[4], J[5]);
}

static void add_foot(Xml *xml, const hxDefinition *d, const hxLink *tibia) {
  ADD(xml,
      "<geom type='sphere' size='%.17g' pos='%.17g %.17g %.17g' friction='%.17g' condim='3'/>\n",
      d->foot_radius, tibia->length, tibia->offset_y, tibia->offset_z, d->friction.mu);
}

static void add_leg(Xml *xml, const hxDefinition *d, int i) {
  const hxLeg *leg = &d->leg[i];
  ADD(xml, "<body pos='%.17g %.17g %.17g' quat='%.17g 0 0 %.17g'>\n", leg->hip_position[0],
      leg->hip_position[1], leg->hip_position[2], cos(0.5 * leg->hip_yaw), sin(0.5 * leg->hip_yaw));
  for (int j = 0; j < HX_JOINTS; ++j) {
    const hxLink *link = &leg->link[j];
    ADD(xml, "<joint name='%d' axis='%.17g %.17g %.17g' armature='%.17g'/>\n", HX_JOINTS * i + j,
        link->axis[0], link->axis[1], link->axis[2], d->servo.rotor_inertia);
    add_inertial(xml, link->mass, link->com, link->inertia);
    if (j + 1 < HX_JOINTS)
      ADD(xml, "<body pos='%.17g %.17g %.17g'>\n", link->length, link->offset_y, link->offset_z);
  }
  add_foot(xml, d, &leg->link[HX_JOINTS - 1]);
  ADD(xml, "</body></body></body>\n");
}

static void add_servos(Xml *xml, const hxDefinition *d) {
  ADD(xml, "<actuator>\n");
  for (int k = 0; k < HX_LEGS * HX_JOINTS; ++k)
    ADD(xml,
        "<position joint='%d' kp='%.17g' kv='%.17g' forcelimited='true' forcerange='%.17g "
        "%.17g'/>\n",
        k, d->servo.kp, d->servo.kd, -d->servo.torque_max, d->servo.torque_max);
  ADD(xml, "</actuator>\n");
}

static void write_model(Xml *xml, const hxDefinition *d, int own, const char *integrator,
                        double step) {
  xml->size = 0;
  ADD(xml,
      "<mujoco><compiler angle='radian'/>\n<option timestep='%.17g' integrator='%s' "
      "cone='elliptic' gravity='%.17g %.17g %.17g'>",
      step, integrator, d->gravity[0], d->gravity[1], d->gravity[2]);
  if (!own) ADD(xml, "<flag contact='disable' constraint='disable'/>");
  ADD(xml, "</option>\n<default><joint frictionloss='%.17g'/></default>\n<worldbody>\n",
      own ? d->servo.coulomb_friction : 0.0);
  ADD(xml,
      "<geom type='plane' size='0 0 1' pos='0 0 %.17g' friction='%.17g' "
      "condim='3'/>\n<body>\n<freejoint align='false'/>\n",
      d->terrain.height, d->friction.mu);
  add_inertial(xml, d->torso.mass, d->torso.com, d->torso.inertia);
  for (int i = 0; i < HX_LEGS; ++i) add_leg(xml, d, i);
  ADD(xml, "</body>\n</worldbody>\n");
  if (own) add_servos(xml, d);
  ADD(xml, "</mujoco>\n");
}

static mjModel *load(const Xml *xml) {
  char error[1000] = "";
  mjVFS files;
  mj_defaultVFS(&files);
  mj_addBufferVFS(&files, "robot.xml", xml->text, (int)xml->size);
  mjModel *model = mj_loadXML("robot.xml", &files, error, sizeof error);
  mj_deleteVFS(&files);
  if (!model) fprintf(stderr, "%s\n", error);
  return model;
}

/* ---- the plant's law as a passive force ---- */

static void cross(const mjtNum *a, const mjtNum *b, mjtNum *c) { mju_cross(c, a, b); }

/* J^T f of a force at a point of leg i: the torso's six entries (rotation in its own axes) and the
 * leg's three hinges */
static void push(const mjModel *m, mjData *d, int i, const mjtNum point[3], const mjtNum force[3]) {
  mjtNum arm[3], torque[3], local[3];
  mju_sub3(arm, point, d->xpos + 3);
  cross(arm, force, torque);
  mju_mulMatTVec3(local, d->xmat + 9, torque);
  mju_addTo3(d->qfrc_passive, force);
  mju_addTo3(d->qfrc_passive + 3, local);
  for (int j = 0; j < HX_JOINTS; ++j) {
    const int joint = 1 + HX_JOINTS * i + j;
    mju_sub3(arm, point, d->xanchor + 3 * joint);
    cross(arm, force, torque);
    d->qfrc_passive[m->jnt_dofadr[joint]] += mju_dot3(d->xaxis + 3 * joint, torque);
  }
}

static void feel_ground(const mjModel *m, mjData *d, MuJoCo *self, int i) {
  const hxLink *tibia = &self->definition->leg[i].link[HX_JOINTS - 1];
  const int body = 1 + HX_JOINTS * (i + 1);
  const mjtNum tip[3] = {tibia->length, tibia->offset_y, tibia->offset_z};
  mjtNum centre[3], point[3], arm[3], velocity[3];
  double force[3];
  mju_mulMatVec3(centre, d->xmat + 9 * body, tip);
  mju_addTo3(centre, d->xpos + 3 * body);
  mju_copy3(point, centre);
  point[2] -= self->law.radius;
  mju_sub3(arm, point, d->subtree_com + 3 * m->body_rootid[body]);
  cross(d->cvel + 6 * body, arm, velocity);
  mju_addTo3(velocity, d->cvel + 6 * body + 3);
  if (self->fresh)
    law_switch(&self->law, &self->foot[i], self->law.radius - (centre[2] - self->law.ground),
               -velocity[2]);
  if (law_foot(&self->law, &self->foot[i], centre, velocity, force) > 0.0)
    push(m, d, i, point, force);
}

static void drive(mjData *d, const MuJoCo *self, int i) {
  const hxInput *input = self->input;
  for (int j = 0; j < HX_JOINTS; ++j) {
    const int k = HX_JOINTS * i + j;
    d->qfrc_passive[6 + k] +=
        law_servo(&self->law, d->qpos[7 + k], d->qvel[6 + k], input->angle_ref[i][j],
                  input->speed_ref[i][j], input->torque_ref[i][j]);
  }
}

static void apply_law(const mjModel *m, mjData *d) {
  MuJoCo *self = present;
  for (int i = 0; i < HX_LEGS; ++i) {
    drive(d, self, i);
    feel_ground(m, d, self, i);
  }
  self->fresh = 0;
}

/* ---- driver ---- */

static int prepare(void *self, const Recording *walk, const char *method, double step) {
  static Xml xml;
  MuJoCo *mujoco = self;
  const char *integrator = method + 4;
  mujoco->own = strncmp(method, "own-", 4) == 0;
  if (!mujoco->own && strncmp(method, "law-", 4) != 0) {
    fprintf(stderr, "method %s: expected own-INTEGRATOR or law-INTEGRATOR\n", method);
    return 1;
  }
  mujoco->definition = &walk->definition;
  write_model(&xml, &walk->definition, mujoco->own, integrator, step);
  mujoco->model = load(&xml);
  if (!mujoco->model || law_compile(&mujoco->law, &walk->definition)) return 1;
  mujoco->data = mj_makeData(mujoco->model);
  present = mujoco;
  if (!mujoco->own) mjcb_passive = apply_law;
  return mujoco->data == NULL;
}

static void set_pose(const hxDefinition *definition, mjData *d) {
  mjtNum offset[3], quaternion[4];
  mju_copy4(quaternion, definition->initial.quaternion);
  mju_normalize4(quaternion);
  mju_rotVecQuat(offset, definition->torso.com, quaternion);
  mju_sub3(d->qpos, definition->initial.position, offset);
  mju_copy4(d->qpos + 3, quaternion);
  for (int i = 0; i < HX_LEGS; ++i)
    mju_copy3(d->qpos + 7 + HX_JOINTS * i, definition->initial.angle[i]);
}

/* walks start at rest: the velocities stay zero */
static int start(void *self) {
  static const hxInput none;
  MuJoCo *mujoco = self;
  mj_resetData(mujoco->model, mujoco->data);
  set_pose(mujoco->definition, mujoco->data);
  memset(mujoco->foot, 0, sizeof mujoco->foot);
  mujoco->input = &none, mujoco->evaluations = 0.0;
  mujoco->fresh = 1; /* feet at rest in the ground close with an approach speed of 0 */
  mj_forward(mujoco->model, mujoco->data);
  return 0;
}

static void set_servos(MuJoCo *mujoco, const hxInput *input) {
  const double lead = mujoco->definition->servo.kd /
                      mujoco->definition->servo.kp; /* s  puts kd speed_ref into the position */
  if (!mujoco->own) return;
  for (int i = 0; i < HX_LEGS; ++i)
    for (int j = 0; j < HX_JOINTS; ++j)
      mujoco->data->ctrl[HX_JOINTS * i + j] =
          input->angle_ref[i][j] + lead * input->speed_ref[i][j];
}

static int advance(void *self, const hxInput *input, double t_end) {
  MuJoCo *mujoco = self;
  const double step = mujoco->model->opt.timestep;
  const int stages = mujoco->model->opt.integrator == mjINT_RK4 ? 4 : 1;
  mujoco->input = input;
  set_servos(mujoco, input);
  while (mujoco->data->time < t_end - 0.5 * step) {
    mujoco->fresh = 1;
    mj_step(mujoco->model, mujoco->data);
    mujoco->evaluations += stages;
  }
  return mujoco->data->warning[mjWARN_BADQACC].number > 0 ||
         mujoco->data->warning[mjWARN_BADQPOS].number > 0;
}

static void torso(void *self, double position[3]) {
  const MuJoCo *mujoco = self;
  mju_rotVecQuat(position, mujoco->definition->torso.com, mujoco->data->qpos + 3);
  mju_addTo3(position, mujoco->data->qpos);
}

static double evaluations(void *self) { return ((MuJoCo *)self)->evaluations; }

static void evaluate(void *self, const hxInput *input, int count) {
  MuJoCo *mujoco = self;
  mujoco->input = input;
  set_servos(mujoco, input);
  for (int i = 0; i < count; ++i) mj_forward(mujoco->model, mujoco->data);
}

int main(int argc, char **argv) {
  static const Driver driver = {prepare, start, advance, torso, evaluations, evaluate};
  static MuJoCo mujoco;
  return driver_main(argc, argv, &driver, &mujoco);
}
