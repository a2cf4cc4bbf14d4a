#include "robot.h"

#include <math.h>
#include <string.h>

#include "contact_law.h"
#include "elementary.h"
#include "ground/soil.h"
#include "ground/surface.h"
#include "validation.h"

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

/* Computes out = R(p) a, p of unit length: a + 2 w (u x a) + 2 u x (u x a). */
static void rotate(const double p[4], const double a[3], double out[3]) {
  double t[3], s[3];
  cross(p + 1, a, t);
  cross(p + 1, t, s);
  for (int i = 0; i < 3; ++i) out[i] = a[i] + 2.0 * (p[0] * t[i] + s[i]);
}

/* Copies the position of the next joint or the foot in link axes. */
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

/* Computes the joint's point from the parent's centre of mass, in the parent link's axes. */
static void joint_on_parent(const hxDefinition *d, int leg, int joint, double point[3]) {
  if (joint == 0) {
    for (int i = 0; i < 3; ++i) point[i] = d->leg[leg].hip_position[i] - d->torso.com[i];
  } else {
    const hxLink *parent = &d->leg[leg].link[joint - 1];
    link_tip(parent, point);
    for (int i = 0; i < 3; ++i) point[i] -= parent->com[i];
  }
}

/* Computes the rotation from the parent's to the child's axes at angle 0: the hip's yaw for the
 * coxa, identity for the others. */
static void zero_turn(const hxDefinition *d, int leg, int joint, double p[4]) {
  const double half = joint == 0 ? 0.5 * d->leg[leg].hip_yaw : 0.0;
  hx_sin_cos(half, &p[3], &p[0]);
  p[1] = p[2] = 0.0;
}

/* Computes the quaternion of a right-handed frame from its axes, by the largest component
 * (Shepperd). */
static void quat_from_axes(const double x[3], const double y[3], const double z[3], double p[4]) {
  const double squares[4] = {1.0 + x[0] + y[1] + z[2], 1.0 + x[0] - y[1] - z[2],
                             1.0 - x[0] + y[1] - z[2], 1.0 - x[0] - y[1] + z[2]};
  int largest = 0;
  for (int i = 1; i < 4; ++i)
    if (squares[i] > squares[largest]) largest = i;
  const double columns[4][4] = {{squares[0], y[2] - z[1], z[0] - x[2], x[1] - y[0]},
                                {y[2] - z[1], squares[1], y[0] + x[1], x[2] + z[0]},
                                {z[0] - x[2], y[0] + x[1], squares[2], z[1] + y[2]},
                                {x[1] - y[0], x[2] + z[0], z[1] + y[2], squares[3]}};
  normalise(columns[largest], 4, p);
}

/* Computes the rotation from a link's axes to its joint's (x = a, y = b, z = axis); identity for
 * the torso. */
static void joint_frame(const hxDefinition *d, int leg, int joint, double p[4]) {
  double s[3], a[3], b[3];
  p[0] = 1.0, p[1] = p[2] = p[3] = 0.0;
  if (joint < 0) return;
  normalise(d->leg[leg].link[joint].axis, 3, s);
  hx_axis_normals(s, a, b);
  quat_from_axes(a, b, s, p);
}

static void conjugate(const double p[4], double out[4]) {
  out[0] = p[0];
  for (int i = 1; i < 4; ++i) out[i] = -p[i];
}

/* Computes xx yy zz xy xz yz of R(p)^T S R(p). */
static void inertia_in_frame(const double S[6], const double p[4], double out[6]) {
  static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
  double axis[3][3], moved[3][3];
  for (int i = 0; i < 3; ++i) {
    const double unit[3] = {i == 0, i == 1, i == 2};
    rotate(p, unit, axis[i]);
    const double *a = axis[i];
    moved[i][0] = S[0] * a[0] + S[3] * a[1] + S[4] * a[2];
    moved[i][1] = S[3] * a[0] + S[1] * a[1] + S[5] * a[2];
    moved[i][2] = S[4] * a[0] + S[5] * a[1] + S[2] * a[2];
  }
  for (int k = 0; k < 6; ++k) {
    const double *a = axis[row[k]], *m = moved[column[k]];
    out[k] = a[0] * m[0] + a[1] * m[1] + a[2] * m[2];
  }
}

/* Computes the constants of a leg's joint in slots: all vectors in joint axes. */
static void compile_joint(hxJointModel *m, const hxDefinition *d, int leg, int joint, int slot) {
  const hxLink *link = &d->leg[leg].link[joint];
  double frame_i[4], frame_j[4], to_i[4], to_j[4], turn[4], from[4], zero[4], s_j[3], axis[3],
      s_i[3], point[3], point_i[3], point_j[3], inertia[6];
  joint_frame(d, leg, joint - 1, frame_i);
  joint_frame(d, leg, joint, frame_j);
  conjugate(frame_i, to_i);
  conjugate(frame_j, to_j);
  zero_turn(d, leg, joint, turn);
  quat_mul(to_i, turn, from);
  quat_mul(from, frame_j, zero);
  normalise(link->axis, 3, s_j);
  rotate(turn, s_j, axis); /* axis and point: in the parent link's axes */
  rotate(to_i, axis, s_i);
  joint_on_parent(d, leg, joint, point);
  rotate(to_i, point, point_i);
  for (int i = 0; i < 3; ++i) point[i] = -link->com[i];
  rotate(to_j, point, point_j);
  inertia_in_frame(link->inertia, frame_j, inertia);
  m->mass[slot] = link->mass;
  for (int i = 0; i < 6; ++i) m->inertia[i][slot] = inertia[i];
  for (int i = 0; i < 3; ++i)
    m->s_i[i][slot] = s_i[i], m->point_i[i][slot] = point_i[i], m->point_j[i][slot] = point_j[i];
  for (int i = 0; i < 4; ++i) m->zero[i][slot] = zero[i], m->frame[i][slot] = frame_j[i];
  m->middle[slot] = 0.5 * (link->angle_min + link->angle_max);
  m->half_range[slot] = 0.5 * (link->angle_max - link->angle_min);
}

/* Computes a point and the normal of the ground. */
static void compile_ground(hxModel *model, const hxDefinition *d) {
  const double incline = d->terrain.kind == HX_TERRAIN_SLOPE ? d->terrain.incline : 0.0;
  model->ground_point[0] = model->ground_point[1] = 0.0;
  model->ground_point[2] = d->terrain.height;
  double rise, level, sideways, ahead;
  hx_sin_cos(incline, &rise, &level);
  hx_sin_cos(d->terrain.heading, &sideways, &ahead);
  model->ground_normal[0] = -rise * ahead;
  model->ground_normal[1] = -rise * sideways;
  model->ground_normal[2] = level;
}

static const double load_share =
    0.01; /* 1  of the robot's weight; feet with a larger load count their slip */

/* Returns the weight of all bodies, N. */
static double weight_of(const hxDefinition *d) {
  double mass = d->torso.mass;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) mass += d->leg[leg].link[joint].mass;
  return mass * sqrt(d->gravity[0] * d->gravity[0] + d->gravity[1] * d->gravity[1] +
                     d->gravity[2] * d->gravity[2]);
}

/* Copies friction and its choices. Feet without friction resist neither spin nor rolling. */
static void compile_friction(hxModel *model, const hxDefinition *d) {
  const int rubs = d->friction.law != HX_FRICTION_NONE;
  model->friction_law = d->friction.law, model->mu = d->friction.mu,
  model->slope = d->friction.slope;
  model->presliding = d->friction.presliding, model->bristle_damping = d->friction.bristle_damping;
  model->static_rise = fmax(d->friction.mu_static - d->friction.mu, 0.0),
  model->per_stribeck = 1.0 / d->friction.stribeck_speed;
  model->viscous = rubs ? d->friction.viscous : 0.0;
  model->spin_radius = d->friction.spin_radius, model->rolling_radius = d->friction.rolling_radius;
  /* materials of a grid may have static friction of their own */
  model->velocity_terms = rubs && (model->static_rise > 0.0 || model->viscous > 0.0 ||
                                   d->terrain.kind == HX_TERRAIN_GRID);
  model->spin_friction = rubs && model->spin_radius > 0.0;
  model->roll_friction = rubs && model->rolling_radius > 0.0;
}

/* Returns whether bristles of friction hold the feet on rigid ground. */
static int has_friction_bristles(const hxDefinition *d) {
  return d->friction.law == HX_FRICTION_BRISTLE || d->friction.law == HX_FRICTION_LUGRE;
}

static const double pi = 3.14159265358979323846;

/* Sets the pads as which a corner of the torso's box sinks into soil on the box's sides along x, y
 * and z: a disc of a quarter of the side, whose b of eq. 40 is the side's smaller edge; the sphere,
 * where that is not smaller. */
static void set_corner_pads(hxModel *model, const hxDefinition *d) {
  const double *half = d->body.torso_box, corner = d->body.corner_radius;
  for (int side = 0; side < 3; ++side) {
    const double a = half[side == 0 ? 1 : 0], b = half[side == 2 ? 1 : 2], square = a * b / pi;
    const int shape = hx_soil_shape(HX_TORSO, side), is_pad = square > corner * corner;
    model->pad_radius[shape] = is_pad ? sqrt(square) : 0.0;
    model->breadth[shape] = is_pad ? 2.0 * fmin(a, b) : 0.0;
  }
}

/* Computes the constants of the definition's soil; the terrain is known. */
static void compile_soil(hxModel *model, const hxDefinition *d) {
  const double corner = d->body.corner_radius;
  const double radius[HX_SOIL_SHAPES] = {
      d->foot_radius, d->body.knee_radius, d->body.shank_radius, corner, corner, corner};
  model->pad_radius[0] = d->foot_pad_radius;
  set_corner_pads(model, d);
  for (int shape = 0; shape < HX_SOIL_SHAPES; ++shape) {
    const hxSoilShape is = {radius[shape], model->pad_radius[shape], model->breadth[shape]};
    hxSoil soil;
    hx_soil_compile(&d->soil, &is, &soil);
    memcpy(model->soil[shape], &soil, sizeof soil);
  }
  const double on_grid = model->terrain ? hx_terrain_shear_displacement(model->terrain) : 0.0;
  model->has_soil = d->soil.law != HX_SOIL_NONE || on_grid > 0.0;
  model->bristle_length = d->friction.presliding;
  if (d->soil.law != HX_SOIL_NONE)
    model->bristle_length = d->soil.shear_displacement;
  else if (on_grid > 0.0 && !has_friction_bristles(d))
    model->bristle_length = on_grid;
}

static const double bus_margin = 1e-9; /* s  transmissions this early or late are on time */

int hx_has_bus(const hxModel *model) {
  return model->bus_period > 0.0 || model->command_step > 0.0;
}

/* Returns the time of the next transmission, s; without a period the present time. */
static double next_sending(const hxModel *model, const hxState *state) {
  return model->bus_period > 0.0 ? state->bus.start + state->bus.sent * model->bus_period
                                 : state->time;
}

void hx_bus_command(hxCommand *command, const hxModel *model, const hxState *state) {
  if (!hx_has_bus(model)) return;
  if (state->time < next_sending(model, state) - bus_margin) {
    memcpy(command->angle, state->bus.angle, sizeof command->angle);
    memcpy(command->speed, state->bus.speed, sizeof command->speed);
    memcpy(command->torque, state->bus.torque, sizeof command->torque);
    return;
  }
  const double step = model->command_step;
  for (int i = 0; step > 0.0 && i < HX_JOINTS * HX_SLOTS; ++i) {
    double *angle = &command->angle[i / HX_SLOTS][i % HX_SLOTS];
    *angle = step * floor(*angle / step + 0.5);
  }
}

void hx_bus_send(hxCommand *command, const hxModel *model, hxState *state) {
  hx_bus_command(command, model, state);
  memcpy(state->bus.angle, command->angle, sizeof command->angle);
  memcpy(state->bus.speed, command->speed, sizeof command->speed);
  memcpy(state->bus.torque, command->torque, sizeof command->torque);
  if (model->bus_period > 0.0 && state->time >= next_sending(model, state) - bus_margin)
    state->bus.sent =
        floor((state->time + bus_margin - state->bus.start) / model->bus_period) + 1.0;
}

double hx_bus_end(const hxModel *model, const hxState *state, double t_end) {
  if (!(model->bus_period > 0.0)) return t_end;
  const double next = next_sending(model, state);
  return next > state->time && next < t_end - bus_margin ? next : t_end;
}

/* Copies the constants of the motors' heat and supply. */
static void compile_supply(hxModel *model, const hxDefinition *d) {
  model->heat =
      (hxHeat){.winding = d->servo.drive == HX_DRIVE_MOTOR ? d->servo.winding_capacity : 0.0,
               .housing = d->servo.housing_capacity,
               .to_housing = 1.0 / d->servo.winding_to_housing,
               .to_air = 1.0 / d->servo.housing_to_air,
               .air = d->servo.air_temperature,
               .start = d->servo.start_temperature,
               .derate = d->servo.derate_temperature,
               .max = d->servo.temperature_max};
  model->voltage = d->servo.voltage, model->duty_max = d->servo.duty_max;
  model->supply_resistance = d->servo.supply_resistance;
  if (d->servo.mode == HX_SERVO_KINEMATIC) return;
  model->bus_period = d->servo.bus_period, model->command_step = d->servo.command_step;
}

/* Computes the constants of the servos' motors, and of the joints' stops. */
static void compile_servo(hxModel *model, const hxDefinition *d) {
  const int follows = d->servo.mode == HX_SERVO_POSITION, motor = d->servo.drive == HX_DRIVE_MOTOR;
  model->servo_mode = d->servo.mode, model->servo_drive = d->servo.drive;
  model->kp = follows ? d->servo.kp : 0.0, model->kd = follows ? d->servo.kd : 0.0;
  model->torque_max = d->servo.torque_max, model->speed_max = d->servo.speed_max;
  model->free_damping = model->kd, model->limit_damping = model->torque_max / model->speed_max;
  model->torque_constant = d->servo.torque_constant, model->resistance = d->servo.resistance;
  model->rotor_inertia = d->servo.rotor_inertia;
  if (motor) {
    const double per_volt = d->servo.torque_constant / d->servo.resistance;
    model->stall_torque = per_volt * d->servo.duty_max * d->servo.voltage;
    model->back_emf = d->servo.torque_constant * per_volt;
    model->limit_damping = model->back_emf;
    if (follows) model->free_damping = model->kd + model->back_emf;
  }
  compile_supply(model, d);
  model->stop_stiffness = d->servo.stop_stiffness, model->stop_damping = d->servo.stop_damping;
  model->stops = d->servo.mode != HX_SERVO_KINEMATIC && d->servo.stop_stiffness > 0.0;
}

/* Copies the constants of elastic gears and of the rotors' angular momentum (eq. 54-57). Kinematic
 * drives move their joints themselves: their gears are rigid. */
static void compile_rotor(hxModel *model, const hxDefinition *d) {
  const double edge = 0.1; /* 1  of half of the play: half of the way on which the teeth engage */
  model->spin = d->servo.gear_ratio != 0.0;
  if (model->spin) model->spin_inertia = d->servo.rotor_inertia / d->servo.gear_ratio;
  if (!hx_has_elastic_gears(d)) return;
  model->elastic = d->servo.backlash > 0.0 ? 2 : 1;
  model->gear_stiffness = d->servo.gear_stiffness, model->gear_damping = d->servo.gear_damping;
  model->half_play = 0.5 * d->servo.backlash;
  model->tooth_edge = edge * model->half_play;
}

/* Returns whether the gears have Stribeck terms, and in *measured whether they have more than
 * Coulomb friction. */
static int gear_terms(const hxDefinition *d, int *measured) {
  const int stribeck =
      d->servo.stribeck_friction > 0.0 || d->servo.stribeck_motor_load_friction > 0.0 ||
      d->servo.stribeck_external_load_friction > 0.0 || d->servo.quadratic_motor_friction > 0.0 ||
      d->servo.quadratic_external_friction > 0.0;
  *measured = stribeck || d->servo.viscous_friction > 0.0 || d->servo.motor_load_friction > 0.0 ||
              d->servo.external_load_friction > 0.0;
  return stribeck;
}

/* Copies the constants of the gears' friction (eq. 49, 50). */
static void compile_gear(hxModel *model, const hxDefinition *d) {
  model->stribeck = gear_terms(d, &model->measured_friction);
  model->coulomb_friction = d->servo.coulomb_friction;
  model->gear_speed = d->servo.friction_speed, model->per_gear_speed = 1.0 / model->gear_speed;
  model->gear_viscous = d->servo.viscous_friction;
  model->gear_stribeck = d->servo.stribeck_friction;
  model->motor_load = d->servo.motor_load_friction;
  model->external_load = d->servo.external_load_friction;
  model->stribeck_motor = d->servo.stribeck_motor_load_friction;
  model->stribeck_external = d->servo.stribeck_external_load_friction;
  model->quadratic_motor = d->servo.quadratic_motor_friction;
  model->quadratic_external = d->servo.quadratic_external_friction;
  model->per_stribeck_speed = 1.0 / d->servo.stribeck_speed;
  model->stribeck_exponent = d->servo.stribeck_exponent;
}

/* Copies laws and settings, with derived constants. */
static void compile_settings(hxModel *model, const hxDefinition *d) {
  model->contact_law = d->contact.law, model->stiffness = d->contact.stiffness;
  model->damping_scale = hx_contact(d->contact.law)->scale(d);
  model->impact_speed_floor = d->contact.impact_speed_floor;
  for (int i = 0; i < 3; ++i) model->gravity[i] = d->gravity[i];
  model->alpha = d->baumgarte.alpha, model->beta = d->baumgarte.beta;
  compile_friction(model, d);
  compile_servo(model, d);
  compile_gear(model, d);
  compile_rotor(model, d);
  model->terrain_kind = d->terrain.kind;
  model->method = d->solver.method, model->step = d->solver.step;
  model->tolerance = d->solver.tolerance, model->step_max = d->solver.step_max,
  model->projection = d->solver.projection;
  compile_soil(model, d);
  model->load_threshold = load_share * weight_of(d);
}

/* Sets the point of a row of contacts on the tibia, given in link axes from the tibia's joint. */
static void set_tibia_point(hxModel *model, const hxDefinition *d, int leg, int slot, int row,
                            const double from_joint[3]) {
  const double *com = d->leg[leg].link[HX_JOINTS - 1].com;
  double frame[4], to_joint[4], from_com[3], point[3];
  for (int i = 0; i < 3; ++i) from_com[i] = from_joint[i] - com[i];
  joint_frame(d, leg, HX_JOINTS - 1, frame);
  conjugate(frame, to_joint);
  rotate(to_joint, from_com, point);
  for (int i = 0; i < 3; ++i) model->point[row][i][slot] = point[i];
}

/* Computes the centres of a leg's contacts: the foot at the tibia's tip, the knee at its joint,
 * the shank between them. */
static void compile_tibia_points(hxModel *model, const hxDefinition *d, int leg, int slot) {
  static const double joint[3] = {0.0, 0.0, 0.0};
  double tip[3], shank[3];
  link_tip(&d->leg[leg].link[HX_JOINTS - 1], tip);
  for (int i = 0; i < 3; ++i) shank[i] = d->body.shank_position * tip[i];
  for (int row = HX_FOOT; hx_is_of_foot(row); ++row) set_tibia_point(model, d, leg, slot, row, tip);
  set_tibia_point(model, d, leg, slot, HX_KNEE, joint);
  set_tibia_point(model, d, leg, slot, HX_SHANK, shank);
}

/* Computes the place of a corner of the torso's box; bit i of the slot chooses the corner's side
 * along axis i. */
static void compile_torso_point(hxModel *model, const hxDefinition *d, int slot) {
  for (int i = 0; i < 3; ++i) {
    const double half = d->body.torso_box[i], side = slot >> i & 1 ? half : -half;
    model->point[HX_TORSO][i][slot] = d->body.torso_centre[i] + side - d->torso.com[i];
  }
}

/* Lists the rows of contacts between legs, the last ones. */
static void compile_pairs(hxModel *model, const hxDefinition *d) {
  const double radius[2] = {d->body.knee_radius, d->body.shank_radius};
  model->pair_rows = d->body.self_contact == HX_SELF_FORCE ? HX_PAIR_ROWS : 0;
  for (int pair = 0; pair < HX_PAIR_ROWS; ++pair)
    model->radius[HX_PAIR + pair] = radius[pair / 2] + radius[pair % 2];
  for (int pair = 0; pair < model->pair_rows; ++pair) model->row[model->listed++] = HX_PAIR + pair;
}

/* Lists the rows of contacts that the model computes. */
static void compile_rows(hxModel *model, const hxDefinition *d) {
  const double *box = d->body.torso_box;
  const int on = d->body.contact == HX_BODY_ON;
  const int knees = on && d->body.knee_radius > 0.0, shanks = on && d->body.shank_radius > 0.0;
  for (int row = HX_FOOT; hx_is_of_foot(row); ++row) model->radius[row] = d->foot_radius;
  model->radius[HX_KNEE] = d->body.knee_radius;
  model->radius[HX_SHANK] = d->body.shank_radius;
  model->radius[HX_TORSO] = d->body.corner_radius;
  model->row[model->rows++] = HX_FOOT;
  for (int row = HX_WALL; hx_has_cells(model) && hx_is_of_foot(row); ++row)
    model->row[model->rows++] = row;
  model->foot_rows = model->rows;
  if (knees) model->row[model->rows++] = HX_KNEE;
  if (shanks) model->row[model->rows++] = HX_SHANK;
  model->torso_rows = on && (box[0] > 0.0 || box[1] > 0.0 || box[2] > 0.0);
  model->listed = model->rows + model->torso_rows;
  if (model->torso_rows) model->row[model->rows] = HX_TORSO;
  compile_pairs(model, d);
}

void hx_model_compile(hxModel *model, const hxDefinition *d, const hxTerrain *terrain) {
  model->terrain = d->terrain.kind == HX_TERRAIN_GRID ? terrain : NULL;
  model->torso_mass = d->torso.mass;
  for (int i = 0; i < 6; ++i) model->torso_inertia[i] = d->torso.inertia[i];
  for (int slot = 0; slot < HX_SLOTS; ++slot) {
    const int leg = slot < HX_LEGS ? slot : 0;
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      compile_joint(&model->joint[joint], d, leg, joint, slot);
    compile_tibia_points(model, d, leg, slot);
    compile_torso_point(model, d, slot);
  }
  compile_rows(model, d);
  compile_ground(model, d);
  compile_settings(model, d);
}

/* Computes the child's state from the parent's: p_j = p_i zero turn(angle), velocities by
 * rigid-body motion. */
static void place_child(const hxDefinition *d, int leg, int joint,
                        const double parent[HX_BODY_STATE], double child[HX_BODY_STATE]) {
  const hxLink *link = &d->leg[leg].link[joint];
  const double half = 0.5 * d->initial.angle[leg][joint], speed = d->initial.speed[leg][joint];
  double axis[3], zero[4], turned[4], p[4], s[3], point_i[3], point_j[3], sP_i[3], sP_j[3],
      dsP_i[3], dsP_j[3], sine, cosine;
  normalise(link->axis, 3, axis);
  hx_sin_cos(half, &sine, &cosine);
  const double turn[4] = {cosine, sine * axis[0], sine * axis[1], sine * axis[2]};
  zero_turn(d, leg, joint, zero);
  quat_mul(parent + HX_P, zero, turned);
  quat_mul(turned, turn, p);
  normalise(p, 4, child + HX_P);
  rotate(child + HX_P, axis, s);
  joint_on_parent(d, leg, joint, point_i);
  rotate(parent + HX_P, point_i, sP_i);
  for (int i = 0; i < 3; ++i) point_j[i] = -link->com[i];
  rotate(child + HX_P, point_j, sP_j);
  cross(parent + HX_W, sP_i, dsP_i);
  for (int i = 0; i < 3; ++i) child[HX_W + i] = parent[HX_W + i] + speed * s[i];
  cross(child + HX_W, sP_j, dsP_j);
  for (int i = 0; i < 3; ++i) {
    child[HX_R + i] = parent[HX_R + i] + sP_i[i] - sP_j[i];
    child[HX_V + i] = parent[HX_V + i] + dsP_i[i] - dsP_j[i];
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

/* Copies the rotation from a link's axes to its joint's. */
static void frame_of(const hxModel *model, int leg, int joint, double p[4]) {
  for (int i = 0; i < 4; ++i) p[i] = model->joint[joint].frame[i][leg];
}

void hx_motion_from_bodies(const hxModel *model, const double body[HX_BODIES][HX_BODY_STATE],
                           hxPlantMotion *motion) {
  memcpy(motion->torso, body[0], sizeof motion->torso);
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    double (*to)[HX_SLOTS] = motion->link[joint];
    for (int leg = 0; leg < HX_LEGS; ++leg) {
      const double *from = body[1 + HX_JOINTS * leg + joint];
      double frame[4], p[4];
      frame_of(model, leg, joint, frame);
      quat_mul(from + HX_P, frame, p);
      for (int i = 0; i < HX_BODY_STATE; ++i) to[i][leg] = from[i];
      for (int i = 0; i < 4; ++i) to[HX_P + i][leg] = p[i];
    }
    for (int i = 0; i < HX_BODY_STATE; ++i) hx_fill_slots(to[i]);
  }
}

void hx_bodies_from_motion(const hxModel *model, const hxPlantMotion *motion,
                           double body[HX_BODIES][HX_BODY_STATE]) {
  memcpy(body[0], motion->torso, sizeof motion->torso);
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int leg = 0; leg < HX_LEGS; ++leg) {
      double *to = body[1 + HX_JOINTS * leg + joint], frame[4], back[4], p[4];
      for (int i = 0; i < HX_BODY_STATE; ++i) to[i] = motion->link[joint][i][leg];
      frame_of(model, leg, joint, frame);
      conjugate(frame, back);
      quat_mul(to + HX_P, back, p);
      memcpy(to + HX_P, p, sizeof p);
    }
}

void hx_command_from_input(hxCommand *command, const hxInput *input, double time) {
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int slot = 0; slot < HX_SLOTS; ++slot) {
      const int leg = slot < HX_LEGS ? slot : 0;
      command->angle[joint][slot] = input->angle_ref[leg][joint];
      command->speed[joint][slot] = input->speed_ref[leg][joint];
      command->torque[joint][slot] = input->torque_ref[leg][joint];
      command->acceleration[joint][slot] = input->acceleration_ref[leg][joint];
    }
  for (int i = 0; i < 3; ++i) {
    command->push_force[i] = input->push_force[i];
    command->push_torque[i] = input->push_torque[i];
  }
  command->supply = 0.0;
  memset(command->duty, 0, sizeof command->duty);
  command->time = time;
}

/* Returns the duty of a leg's motor under a command at the last moment, and in *speed the speed of
 * its joint. */
static double motor_duty(const hxCommand *command, const hxModel *model, const hxState *state,
                         int joint, int leg, double *speed) {
  const double angle = state->moment.angle[joint][leg], w = state->moment.speed[joint][leg];
  const double limit = model->duty_max * command->duty[joint][leg];
  double wanted = model->kp * (command->angle[joint][leg] - angle) +
                  model->kd * (command->speed[joint][leg] - w) + command->torque[joint][leg];
  if (model->servo_mode == HX_SERVO_TORQUE) wanted += model->back_emf * w;
  *speed = w;
  return fmax(-limit, fmin(limit, wanted * model->duty_max / model->stall_torque));
}

/* Returns the voltage of the supply over servo.voltage, at most 1 (eq. 53): with the duties d, the
 * current is the sum of d (d V - k_t w)/R. */
static double supply_share(const hxCommand *command, const hxModel *model, const hxState *state) {
  const double ratio = model->supply_resistance / model->resistance;
  double squares = 0.0, back = 0.0, speed;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double duty = motor_duty(command, model, state, joint, leg, &speed);
      squares += duty * duty, back += duty * speed;
    }
  const double emf = model->torque_constant * back / model->voltage;
  return fmin(1.0, (1.0 + ratio * emf) / (1.0 + ratio * squares));
}

void hx_command_supply(hxCommand *command, const hxModel *model, const hxState *state) {
  const hxHeat *heat = &model->heat;
  const double per_kelvin = 1.0 / (heat->max - heat->derate);
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    for (int slot = 0; slot < HX_SLOTS; ++slot) {
      const double left = (heat->max - state->measured.winding[joint][slot]) * per_kelvin;
      command->duty[joint][slot] = heat->winding > 0.0 ? fmax(0.0, fmin(1.0, left)) : 1.0;
    }
  const int sags = model->supply_resistance > 0.0 && model->servo_drive == HX_DRIVE_MOTOR &&
                   model->servo_mode != HX_SERVO_KINEMATIC;
  command->supply = sags ? supply_share(command, model, state) : 1.0;
}
