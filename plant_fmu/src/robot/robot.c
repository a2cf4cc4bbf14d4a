/* robot.c - compiles a definition into a model: joints, inertias, points and rows of contacts */
#include "robot.h"

#include "../contact_law.h"
#include "../elementary.h"

/* Computes xx yy zz xy xz yz of R(p)^T S R(p). */
static void inertia_in_frame(const double S[6], const double p[4], double out[6]) {
  static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
  double axis[3][3], moved[3][3];
  for (int i = 0; i < 3; ++i) {
    const double unit[3] = {i == 0, i == 1, i == 2};
    hx_vector_rotate(p, unit, axis[i]);
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
  /* P, L: axes of the links; i, j: axes of their states. q_PL and q_ij are those at angle 0 */
  double q_Pi[4], q_Lj[4], q_iP[4], q_jL[4], q_PL[4], q_iL[4], q_ij[4], s_L[3], s_P[3], s_i[3],
      point_P[3], point_L[3], point_i[3], point_j[3], J_j[6];
  hx_joint_frame(d, leg, joint - 1, q_Pi);
  hx_joint_frame(d, leg, joint, q_Lj);
  hx_quaternion_conjugate(q_Pi, q_iP);
  hx_quaternion_conjugate(q_Lj, q_jL);
  hx_zero_turn(d, leg, joint, q_PL);
  hx_quaternion_product(q_iP, q_PL, q_iL);
  hx_quaternion_product(q_iL, q_Lj, q_ij);
  hx_vector_normalise(link->axis, 3, s_L);
  hx_vector_rotate(q_PL, s_L, s_P);
  hx_vector_rotate(q_iP, s_P, s_i);
  hx_joint_on_parent(d, leg, joint, point_P);
  hx_vector_rotate(q_iP, point_P, point_i);
  for (int i = 0; i < 3; ++i) point_L[i] = -link->com[i];
  hx_vector_rotate(q_jL, point_L, point_j);
  inertia_in_frame(link->inertia, q_Lj, J_j);
  m->mass[slot] = link->mass;
  for (int i = 0; i < 6; ++i) m->inertia[i][slot] = J_j[i];
  for (int i = 0; i < 3; ++i)
    m->s_i[i][slot] = s_i[i], m->point_i[i][slot] = point_i[i], m->point_j[i][slot] = point_j[i];
  for (int i = 0; i < 4; ++i) m->q_i0[i][slot] = q_ij[i], m->q_Lj[i][slot] = q_Lj[i];
  m->own_stop.middle[slot] = 0.5 * (link->angle_min + link->angle_max);
  m->own_stop.half_range[slot] = 0.5 * (link->angle_max - link->angle_min);
  m->own_stop.stiffness[slot] = d->servo.stop_stiffness;
  m->own_stop.damping[slot] = d->servo.stop_damping;
  m->stop = m->own_stop;
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

/* Sets the point of a row of contacts on the tibia, given in link axes from the tibia's joint. */
static void set_tibia_point(hxModel *model, const hxDefinition *d, int leg, int slot, int row,
                            const double from_joint[3]) {
  const double *com = d->leg[leg].link[HX_JOINTS - 1].com;
  double q_Lj[4], q_jL[4], point_L[3], point_j[3]; /* from the centre of mass */
  for (int i = 0; i < 3; ++i) point_L[i] = from_joint[i] - com[i];
  hx_joint_frame(d, leg, HX_JOINTS - 1, q_Lj);
  hx_quaternion_conjugate(q_Lj, q_jL);
  hx_vector_rotate(q_jL, point_L, point_j);
  for (int i = 0; i < 3; ++i) model->point_B[row][i][slot] = point_j[i];
}

/* Computes the centres of a leg's contacts: the foot at the tibia's tip, the knee at its joint,
 * the shank between them. */
static void compile_tibia_points(hxModel *model, const hxDefinition *d, int leg, int slot) {
  static const double joint[3] = {0.0, 0.0, 0.0};
  double tip[3], shank[3];
  hx_link_tip(&d->leg[leg].link[HX_JOINTS - 1], tip);
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
    model->point_B[HX_TORSO][i][slot] = d->body.torso_centre[i] + side - d->torso.com[i];
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
  hx_laws_compile(model, d);
}
