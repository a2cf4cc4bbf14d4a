#include "kinematics.h"

static hxBodyWork load_link(const double (*m)[HX_SLOTS], int slot) {
  hxBodyWork body;
  body.r = hx_load_vec3(&m[HX_R], slot);
  body.p = (hxQuat){hx_load(&m[HX_P][slot]), hx_load(&m[HX_P + 1][slot]), hx_load(&m[HX_P + 2][slot]), hx_load(&m[HX_P + 3][slot])};
  body.v = hx_load_vec3(&m[HX_V], slot);
  body.w = hx_load_vec3(&m[HX_W], slot);
  body.R = hx_rotation_matrix(body.p);
  return body;
}

HX_LOCAL hxBodyWork hx_torso_work(const hxMotion *motion) {
  const double *m = motion->torso;
  hxBodyWork body;
  body.r = hx_splat_vec3(&m[HX_R]);
  body.p = (hxQuat){hx_splat(m[HX_P]), hx_splat(m[HX_P + 1]), hx_splat(m[HX_P + 2]), hx_splat(m[HX_P + 3])};
  body.v = hx_splat_vec3(&m[HX_V]);
  body.w = hx_splat_vec3(&m[HX_W]);
  body.R = hx_rotation_matrix(body.p);
  return body;
}

/* q from the half-angle in p_rel = conj(p_i zero) p_j, of which the real part and the part along the axis are needed */
static hxReal joint_angle(const hxJointModel *model, int slot, hxQuat p_i, hxQuat p_j) {
  const hxReal w = hx_load(&model->zero[0][slot]), z = hx_load(&model->zero[1][slot]);
  const hxQuat from = {w * p_i.w - z * p_i.z, w * p_i.x + z * p_i.y, w * p_i.y - z * p_i.x, w * p_i.z + z * p_i.w};
  const hxVec3 u_i = {from.x, from.y, from.z}, u_j = {p_j.x, p_j.y, p_j.z};
  const hxVec3 u = hx_sub(hx_sub(hx_scale(from.w, u_j), hx_scale(p_j.w, u_i)), hx_cross(u_i, u_j));
  return hx_angle_from_half(hx_dot(u, hx_load_vec3(model->s_j, slot)), from.w * p_j.w + hx_dot(u_i, u_j));
}

HX_LOCAL void hx_joint_kinematics(const hxJointModel *model, const hxMotion *motion, int joint, int slot, const hxBodyWork *i,
                                  hxJointKinematics *k) {
  k->body = load_link(motion->link[joint], slot);
  const hxBodyWork *j = &k->body;
  k->sP_i = hx_mul(i->R, hx_load_vec3(model->sP_i, slot));
  k->sP_j = hx_mul(j->R, hx_load_vec3(model->sP_j, slot));
  k->s = hx_mul(i->R, hx_load_vec3(model->s_i, slot));
  const hxVec3 a = hx_mul(j->R, hx_load_vec3(model->a_j, slot));
  const hxVec3 b = hx_mul(j->R, hx_load_vec3(model->b_j, slot));
  const hxVec3 w_rel = hx_sub(j->w, i->w);
  k->angle = joint_angle(model, slot, i->p, j->p);
  k->speed = hx_dot(k->s, w_rel);

  /* Phi = (r_j + s_j^P - r_i - s_i^P, a.s, b.s) */
  k->phi_lin = hx_sub(hx_add(j->r, k->sP_j), hx_add(i->r, k->sP_i));
  k->phi[0] = hx_dot(a, k->s), k->phi[1] = hx_dot(b, k->s);

  /* the basis (u1, u2, s) in which a joint sees relative rotation, and its dual: (b x s) x s = (b.s) s - b, s x (a x s) = a - (a.s) s */
  k->u1 = hx_cross(a, k->s);
  k->u2 = hx_cross(b, k->s);
  k->u2_s = hx_sub(hx_scale(k->phi[1], k->s), b);
  k->s_u1 = hx_add_scaled(a, -k->phi[0], k->s);
  k->inverse_det = 1.0 / hx_dot(k->u1, k->u2_s);

  /* its rate */
  const hxVec3 dsP_i = hx_cross(i->w, k->sP_i), dsP_j = hx_cross(j->w, k->sP_j);
  k->dphi_lin = hx_sub(hx_add(j->v, dsP_j), hx_add(i->v, dsP_i));
  k->dphi[0] = hx_dot(k->u1, w_rel), k->dphi[1] = hx_dot(k->u2, w_rel);

  /* gamma, eq. 3; its triple products written out in dot products:
   * -s.(w_j x da) - a.(w_i x ds) - 2 da.ds = (a.s) |w_j - w_i|^2 - (s.w_j)(a.w_j) - (a.w_i)(s.w_i) + 2 (s.w_j)(a.w_i) */
  const hxReal s_wj = hx_dot(k->s, j->w), s_wi = hx_dot(k->s, i->w), w2 = hx_dot(w_rel, w_rel);
  const hxReal twice = 2.0 * s_wj - s_wi;
  k->gamma_lin = hx_sub(hx_cross(dsP_j, j->w), hx_cross(dsP_i, i->w));
  k->gamma[0] = k->phi[0] * w2 - s_wj * hx_dot(a, j->w) + twice * hx_dot(a, i->w);
  k->gamma[1] = k->phi[1] * w2 - s_wj * hx_dot(b, j->w) + twice * hx_dot(b, i->w);
}

HX_LOCAL void hx_foot_kinematics(const hxModel *model, int slot, const hxBodyWork *tibia, hxFootKinematics *foot) {
  const hxVec3 to_centre = hx_mul(tibia->R, hx_load_vec3(model->foot_centre, slot));
  const hxGround ground = hx_terrain(model->terrain_kind)->ground(model, hx_add(tibia->r, to_centre));
  foot->normal = ground.normal;
  foot->arm = hx_add_scaled(to_centre, hx_splat(-model->foot_radius), ground.normal);
  foot->point = hx_add(tibia->r, foot->arm);
  foot->velocity = hx_add(tibia->v, hx_cross(tibia->w, foot->arm));
  foot->delta = model->foot_radius - ground.distance;
  foot->ddelta = -hx_dot(foot->velocity, ground.normal);
}

HX_LOCAL void hx_feet(const hxModel *model, const hxMotion *motion, double delta[HX_SLOTS], double ddelta[HX_SLOTS]) {
  for (int slot = 0; slot < HX_PACKS * HX_LANES; slot += HX_LANES) {
    const hxBodyWork tibia = load_link(motion->link[HX_JOINTS - 1], slot);
    hxFootKinematics foot;
    hx_foot_kinematics(model, slot, &tibia, &foot);
    hx_store(&delta[slot], foot.delta);
    hx_store(&ddelta[slot], foot.ddelta);
  }
}

/* torso and links alike: dr = v, dp = (0, w) p / 2 */
static void position_rates(const double (*p)[HX_SLOTS], const double (*m)[HX_SLOTS], double (*d)[HX_SLOTS]) {
  memcpy(d[HX_R], m[HX_V], 3 * sizeof m[0]);
  for (int slot = 0; slot < HX_PACKS * HX_LANES; slot += HX_LANES) {
    const hxQuat at = {hx_load(&p[HX_P][slot]), hx_load(&p[HX_P + 1][slot]), hx_load(&p[HX_P + 2][slot]), hx_load(&p[HX_P + 3][slot])};
    const hxQuat dp = hx_quaternion_rate(at, hx_load_vec3(&m[HX_W], slot));
    hx_store(&d[HX_P][slot], dp.w), hx_store(&d[HX_P + 1][slot], dp.x);
    hx_store(&d[HX_P + 2][slot], dp.y), hx_store(&d[HX_P + 3][slot], dp.z);
  }
}

HX_LOCAL void hx_position_rates(const hxMotion *at, const hxMotion *velocities, hxMotion *rate) {
  const double *p = at->torso, *m = velocities->torso;
  const hxQuat torso = {hx_splat(p[HX_P]), hx_splat(p[HX_P + 1]), hx_splat(p[HX_P + 2]), hx_splat(p[HX_P + 3])};
  const hxQuat dp = hx_quaternion_rate(torso, hx_splat_vec3(&m[HX_W]));
  memcpy(&rate->torso[HX_R], &m[HX_V], 3 * sizeof m[0]);
  rate->torso[HX_P] = hx_lane(dp.w, 0), rate->torso[HX_P + 1] = hx_lane(dp.x, 0);
  rate->torso[HX_P + 2] = hx_lane(dp.y, 0), rate->torso[HX_P + 3] = hx_lane(dp.z, 0);
  for (int joint = 0; joint < HX_JOINTS; ++joint) position_rates(at->link[joint], velocities->link[joint], rate->link[joint]);
}
