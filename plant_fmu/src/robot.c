#include "robot.h"

#include <math.h>

#include "contact.h"

static void cross(const double a[3], const double b[3], double out[3]) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

static double normalise(const double *a, int n, double *out) {
  double norm = 0.0;
  for (int i = 0; i < n; ++i) norm += a[i] * a[i];
  norm = sqrt(norm);
  for (int i = 0; i < n; ++i) out[i] = a[i] / norm;
  return norm;
}

static void quat_mul(const double a[4], const double b[4], double out[4]) {
  out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
  out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
}

/* out = R(p) a, p of unit length: a + 2 w (u x a) + 2 u x (u x a) */
static void rotate(const double p[4], const double a[3], double out[3]) {
  double t[3], s[3];
  cross(p + 1, a, t);
  cross(p + 1, t, s);
  for (int i = 0; i < 3; ++i) out[i] = a[i] + 2.0 * (p[0] * t[i] + s[i]);
}

static void link_tip(const hxLink *link, double tip[3]) {
  tip[0] = link->length;
  tip[1] = link->offset_y;
  tip[2] = link->offset_z;
}

void hx_axis_normals(const double axis[3], double a[3], double b[3]) {
  int least = 0;
  for (int i = 1; i < 3; ++i)
    if (fabs(axis[i]) < fabs(axis[least])) least = i;
  double direction[3] = {0.0, 0.0, 0.0}, normal[3];
  direction[least] = 1.0;
  cross(axis, direction, normal);
  normalise(normal, 3, a);
  cross(axis, a, b);
}

/* Joint position in the parent's axes, from the parent's centre of mass. */
static void joint_on_parent(const hxDefinition *d, int leg, int joint, double sP_i[3]) {
  if (joint == 0) {
    for (int i = 0; i < 3; ++i) sP_i[i] = d->leg[leg].hip_position[i] - d->torso.com[i];
  } else {
    const hxLink *parent = &d->leg[leg].link[joint - 1];
    link_tip(parent, sP_i);
    for (int i = 0; i < 3; ++i) sP_i[i] -= parent->com[i];
  }
}

/* The turn from the parent's axes to the child's at angle 0: the hip's yaw for the coxa, none for the others. */
static void zero_turn(const hxDefinition *d, int leg, int joint, double p[4]) {
  const double half = joint == 0 ? 0.5 * d->leg[leg].hip_yaw : 0.0;
  p[0] = cos(half), p[1] = 0.0, p[2] = 0.0, p[3] = sin(half);
}

static void compile_joint(hxJointModel *m, const hxDefinition *d, int leg, int joint, int slot) {
  const hxLink *link = &d->leg[leg].link[joint];
  double s_j[3], s_i[3], a[3], b[3], sP_i[3], p[4];
  normalise(link->axis, 3, s_j);
  hx_axis_normals(s_j, a, b);
  zero_turn(d, leg, joint, p);
  rotate(p, s_j, s_i);
  joint_on_parent(d, leg, joint, sP_i);
  m->mass[slot] = link->mass;
  for (int i = 0; i < 6; ++i) m->inertia[i][slot] = link->inertia[i];
  for (int i = 0; i < 3; ++i) {
    m->s_i[i][slot] = s_i[i];
    m->s_j[i][slot] = s_j[i];
    m->a_j[i][slot] = a[i];
    m->b_j[i][slot] = b[i];
    m->sP_i[i][slot] = sP_i[i];
    m->sP_j[i][slot] = -link->com[i];
  }
  m->zero[0][slot] = p[0];
  m->zero[1][slot] = p[3];
}

static void compile_ground(hxModel *model, const hxDefinition *d) {
  const double incline = d->terrain.kind == HX_TERRAIN_SLOPE ? d->terrain.incline : 0.0;
  model->ground_point[0] = model->ground_point[1] = 0.0;
  model->ground_point[2] = d->terrain.height;
  model->ground_normal[0] = -sin(incline) * cos(d->terrain.heading);
  model->ground_normal[1] = -sin(incline) * sin(d->terrain.heading);
  model->ground_normal[2] = cos(incline);
}

static void compile_settings(hxModel *model, const hxDefinition *d) {
  model->foot_radius = d->foot_radius;
  model->contact_law = d->contact.law, model->stiffness = d->contact.stiffness;
  model->damping_scale = hx_contact(d->contact.law)->scale(d);
  model->impact_speed_floor = d->contact.impact_speed_floor;
  for (int i = 0; i < 3; ++i) model->gravity[i] = d->gravity[i];
  model->alpha = d->baumgarte.alpha, model->beta = d->baumgarte.beta;
  model->friction_law = d->friction.law, model->mu = d->friction.mu, model->slope = d->friction.slope;
  model->servo_mode = d->servo.mode;
  model->kp = d->servo.mode == HX_SERVO_POSITION ? d->servo.kp : 0.0;
  model->kd = d->servo.mode == HX_SERVO_POSITION ? d->servo.kd : 0.0;
  model->torque_max = d->servo.torque_max, model->speed_max = d->servo.speed_max;
  model->rotor_inertia = d->servo.rotor_inertia, model->coulomb_friction = d->servo.coulomb_friction;
  model->terrain_kind = d->terrain.kind;
  model->method = d->solver.method, model->step = d->solver.step;
  model->tolerance = d->solver.tolerance, model->step_max = d->solver.step_max;
}

void hx_model_compile(hxModel *model, const hxDefinition *d) {
  model->torso_mass = d->torso.mass;
  for (int i = 0; i < 6; ++i) model->torso_inertia[i] = d->torso.inertia[i];
  for (int slot = 0; slot < HX_SLOTS; ++slot) {
    const int leg = slot < HX_LEGS ? slot : 0;
    for (int joint = 0; joint < HX_JOINTS; ++joint) compile_joint(&model->joint[joint], d, leg, joint, slot);
    const hxLink *tibia = &d->leg[leg].link[HX_JOINTS - 1];
    double tip[3];
    link_tip(tibia, tip);
    for (int i = 0; i < 3; ++i) model->foot_centre[i][slot] = tip[i] - tibia->com[i];
  }
  compile_ground(model, d);
  compile_settings(model, d);
}

/* Child from parent through a joint at an angle and speed: p_j = p_i zero turn(angle), velocities by rigid-body motion. */
static void place_child(const hxDefinition *d, int leg, int joint, const double parent[HX_BODY_STATE], double child[HX_BODY_STATE]) {
  const hxLink *link = &d->leg[leg].link[joint];
  const double half = 0.5 * d->initial.angle[leg][joint], speed = d->initial.speed[leg][joint];
  double axis[3], zero[4], turned[4], p[4], s[3], sP_i[3], sP_j[3], com[3], arm[3], w_arm[3];
  normalise(link->axis, 3, axis);
  const double turn[4] = {cos(half), sin(half) * axis[0], sin(half) * axis[1], sin(half) * axis[2]};
  zero_turn(d, leg, joint, zero);
  quat_mul(parent + HX_P, zero, turned);
  quat_mul(turned, turn, p);
  normalise(p, 4, child + HX_P);
  rotate(child + HX_P, axis, s);
  joint_on_parent(d, leg, joint, arm);
  rotate(parent + HX_P, arm, sP_i);
  for (int i = 0; i < 3; ++i) com[i] = -link->com[i];
  rotate(child + HX_P, com, sP_j);
  cross(parent + HX_W, sP_i, arm);
  for (int i = 0; i < 3; ++i) child[HX_W + i] = parent[HX_W + i] + speed * s[i];
  cross(child + HX_W, sP_j, w_arm);
  for (int i = 0; i < 3; ++i) {
    child[HX_R + i] = parent[HX_R + i] + sP_i[i] - sP_j[i];
    child[HX_V + i] = parent[HX_V + i] + arm[i] - w_arm[i];
  }
}

void hx_initial_bodies(const hxDefinition *d, double body[HX_BODIES][HX_BODY_STATE]) {
  for (int i = 0; i < 3; ++i) {
    body[0][HX_R + i] = d->initial.position[i];
    body[0][HX_V + i] = d->initial.velocity[i];
    body[0][HX_W + i] = d->initial.angular_velocity[i];
  }
  normalise(d->initial.quaternion, 4, &body[0][HX_P]);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double *parent = body[0];
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      double *child = body[1 + HX_JOINTS * leg + joint];
      place_child(d, leg, joint, parent, child);
      parent = child;
    }
  }
}

void hx_motion_from_bodies(hxMotion *motion, const double body[HX_BODIES][HX_BODY_STATE]) {
  for (int i = 0; i < HX_BODY_STATE; ++i) {
    motion->torso[i] = body[0][i];
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      for (int leg = 0; leg < HX_LEGS; ++leg) motion->link[joint][i][leg] = body[1 + HX_JOINTS * leg + joint][i];
      hx_fill_slots(motion->link[joint][i]);
    }
  }
}

void hx_bodies_from_motion(const hxMotion *motion, double body[HX_BODIES][HX_BODY_STATE]) {
  for (int i = 0; i < HX_BODY_STATE; ++i) {
    body[0][i] = motion->torso[i];
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      for (int leg = 0; leg < HX_LEGS; ++leg) body[1 + HX_JOINTS * leg + joint][i] = motion->link[joint][i][leg];
  }
}

void hx_command_from_input(hxCommand *command, const hxInput *input, double time) {
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    for (int leg = 0; leg < HX_LEGS; ++leg) {
      command->angle[joint][leg] = input->angle_ref[leg][joint];
      command->speed[joint][leg] = input->speed_ref[leg][joint];
      command->torque[joint][leg] = input->torque_ref[leg][joint];
    }
    hx_fill_slots(command->angle[joint]);
    hx_fill_slots(command->speed[joint]);
    hx_fill_slots(command->torque[joint]);
  }
  for (int i = 0; i < 3; ++i) {
    command->push_force[i] = input->push_force[i];
    command->push_torque[i] = input->push_torque[i];
  }
  command->time = time;
}
