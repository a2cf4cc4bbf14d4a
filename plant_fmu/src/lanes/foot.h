/* foot.h - contact of a sphere, of a foot or a body, with compliant ground: kinematics and forces
 * (eq. 14-18) */
#ifndef HX_FOOT_H
#define HX_FOOT_H

#include "../ground/surface.h"
#include "kinematics.h"

/* Distance of a point from the ground, and the ground's normal. */
typedef struct {
  hxReal distance; /* m  signed, > 0 above the ground */
  hxVec3 normal;   /* 1  out of the ground, world axes */
} hxGround;

/* Kinematics of the contact. */
typedef struct {
  hxVec3 arm;           /* m       body's centre of mass to the contact point */
  hxVec3 normal;        /* 1       out of the ground */
  hxReal delta, ddelta; /* m, m/s  penetration, approach speed */
  hxVec3 velocity;      /* m/s     of the body's material at the contact point */
} hxContactKinematics;

/* Normal force and its derivatives. */
typedef struct {
  hxReal force;     /* N    f_n */
  hxReal elastic;   /* N      its elastic part K delta^(3/2) */
  hxReal stiffness; /* N/m  df_n/ddelta */
  hxReal viscosity; /* N s/m  df_n/d(ddelta) */
} hxNormalForce;

/* Tangential force of a foot with bristles (eq. 16-18). */
typedef struct {
  hxVec3 grip;      /* 1    -f_t over f_n */
  hxVec3 rate;      /* m/s  db/dt */
  hxReal stiffness; /* 1/m  grip over b (secant) */
  hxReal damping;   /* s/m  derivative of grip by db/dt */
  hxReal yield; /* 1/s  derivative of db/dt by -b: rate at which sliding bristles are released */
} hxBristle;

typedef struct {
  hxContactKinematics kin;
  hxNormalForce normal;
  hxVec3 slip, force; /* m/s, N  tangential velocity, force of the ground on the body */
  hxReal slip_speed;
  hxReal drag;               /* N s/m   tangential force over slip speed */
  hxReal drag_per_load;      /* s/m     drag over f_n */
  hxBristle bristle;         /* set by the bristle law only */
  hxVec3 response;           /* N  stage's addition to the force (eq. 20) */
  hxVec3 shift, speed_shift; /* m, m/s  of the contact point (eq. 20), without its a */
  hxVec3 bristle_force;      /* N  bristles' part of response (eq. 21) */
} hxContactWork;

static const double spring_limit =
    0.7; /* 1  of the presliding; bristles below it are springs (eq. 16) */

/* Returns whether the contacts of a row stand on bristles; others slide by the tanh law then. */
static inline int has_bristles(const hxModel *model, int row) {
  return model->friction_law == HX_FRICTION_BRISTLE && row == HX_FOOT;
}

/* Copies distance and normal of a grid at one lane's point. The derivative of both by the point
 * belongs to numbers that carry one. */
static inline void put_face(const hxFace *face, const hxNumber point[3], hxNumber distance[1],
                            hxNumber normal[3]) {
  const double *n = face->normal, *m = face->bend;
  const double d[3] = {hx_slope(point[0]), hx_slope(point[1]), hx_slope(point[2])};
  if (!HX_HAS_SLOPES) {
    *distance = face->distance;
    for (int i = 0; i < 3; ++i) normal[i] = n[i];
    return;
  }
  distance[0] = hx_with_slope(face->distance, n[0] * d[0] + n[1] * d[1] + n[2] * d[2]);
  normal[0] = hx_with_slope(n[0], m[0] * d[0] + m[3] * d[1] + m[4] * d[2]);
  normal[1] = hx_with_slope(n[1], m[3] * d[0] + m[1] * d[1] + m[5] * d[2]);
  normal[2] = hx_with_slope(n[2], m[4] * d[0] + m[5] * d[1] + m[2] * d[2]);
}

/* Computes a face of a grid at a point; feet keep the cell that is held for them. */
static inline void query_grid(const hxModel *model, const hxContactState *state, hxFaceKind kind,
                              int slot, const hxNumber point[3], hxFace *face) {
  const double real[3] = {hx_re(point[0]), hx_re(point[1]), hx_re(point[2])},
               none[2] = {-1.0, -1.0},
               held[2] = {hx_re(state->cell[0][slot]), hx_re(state->cell[1][slot])};
  hx_terrain_face(model->terrain, kind, kind == HX_FACE_NEAREST ? none : held, real, HX_HAS_SLOPES,
                  face);
}

/* Returns distance and normal of a grid at a row's points, lane by lane. Without all, open contacts
 * are left far away. */
HX_RARE hxGround hx_grid(const hxModel *model, const hxContactState *state, int row, int slot,
                         int all, const hxVec3 *point) {
  static const hxFaceKind kind[HX_ROWS] = {HX_FACE_TOP,    HX_FACE_WALL,    HX_FACE_SIDE,
                                           HX_FACE_CORNER, HX_FACE_NEAREST, HX_FACE_NEAREST,
                                           HX_FACE_NEAREST};
  hxNumber at[3][HX_LANES], distance[HX_LANES], normal[3][HX_LANES];
  hx_store(at[0], point->x), hx_store(at[1], point->y), hx_store(at[2], point->z);
  for (int lane = 0; lane < HX_LANES; ++lane) {
    const int place = slot + lane, mirrors = row != HX_TORSO && place >= HX_LEGS && slot == 0;
    const hxNumber p[3] = {at[0][lane], at[1][lane], at[2][lane] - model->ground_point[2]};
    hxNumber n[3];
    if (mirrors) {
      distance[lane] = distance[0];
      for (int i = 0; i < 3; ++i) normal[i][lane] = normal[i][0];
      continue;
    }
    hxFace face = {.distance = hx_far, .normal = {0.0, 0.0, 1.0}};
    if (all || hx_re(state->closed[row][place]) != 0.0)
      query_grid(model, state, kind[row], place, p, &face);
    put_face(&face, p, &distance[lane], n);
    for (int i = 0; i < 3; ++i) normal[i][lane] = n[i];
  }
  return (hxGround){hx_load(distance),
                    {hx_load(normal[0]), hx_load(normal[1]), hx_load(normal[2])}};
}

/* Returns distance and normal of the ground at the points of a row of contacts. All other code is
 * independent of the terrain. */
HX_INLINE hxGround hx_ground(const hxModel *model, const hxContactState *state, int row, int slot,
                             int all, hxVec3 point) {
  if (model->terrain_kind == HX_TERRAIN_FLAT)
    return (hxGround){point.z - model->ground_point[2],
                      {hx_splat(0.0), hx_splat(0.0), hx_splat(1.0)}};
  if (model->terrain_kind == HX_TERRAIN_GRID) return hx_grid(model, state, row, slot, all, &point);
  const hxVec3 n = hx_splat_vec3(model->ground_normal);
  return (hxGround){hx_dot(n, hx_sub3(point, hx_splat_vec3(model->ground_point))), n};
}

/* Returns g of f_t = -mu f_n g(|v_t|) v_t (eq. 15): tanh(k_t v) / v, whose limit at rest is k_t.
 * The series k_t (1 - (k_t v)^2 / 3) is exact below k_t v = 1e-5. */
HX_INLINE hxReal hx_friction(const hxModel *model, hxReal speed) {
  if (model->friction_law == HX_FRICTION_NONE) return hx_splat(0.0);
  const hxReal x = model->slope * speed;
  const hxMask slow = hx_less(x, hx_splat(1e-5));
  return model->slope * hx_select(slow, 1.0 - x * x * (1.0 / 3.0),
                                  hx_tanh_ratio(hx_select(slow, hx_splat(1.0), x)));
}

/* Elasto-plastic bristles (eq. 16, 17) with u = b/b_max in the unit disc: db/dt = v - Y (v.u)+
 * u/|u|.
 *
 * The friction force is the share w = u (3 - u.u)/2 + d room/|(room, d)| of mu f_n, with the
 * damping d = 3/2 tau db/dt / b_max. The spring leaves room = 1 - |u| (3 - u.u)/2 to the damping,
 * so that w stays within the disc too, and w is C1 at |u| = 1, where a foot slides.
 *
 * The friction coefficient falls with the sliding speed p of the bristles: mu(p) = mu + (mu_s -
 * mu)/(1 + (p/v_s)^2) (eq. 18).
 */
HX_INLINE hxBristle hx_bristle(const hxModel *model, const hxContactState *state, int row, int slot,
                               hxVec3 b, hxVec3 slip) {
  const hxReal closed = hx_load(&state->closed[row][slot]);
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  const hxNumber per_length = 1.0 / model->presliding;
  const hxVec3 u = hx_scale(hx_splat(per_length), b);
  const hxReal size = hx_sqrt(hx_dot(u, u)), within = hx_min(size, one);
  const hxReal s = hx_clip((size - spring_limit) * (1.0 / (1.0 - spring_limit)), zero, one);
  const hxReal release_rate = s * s * (3.0 - 2.0 * s) * hx_max(hx_dot(slip, u), zero) /
                              hx_max(size, hx_splat(spring_limit));
  const hxVec3 rate = hx_scale(closed, hx_add_scaled(slip, -release_rate, u));
  const hxVec3 d = hx_scale(hx_splat(1.5 * model->bristle_damping * per_length), rate);
  const hxReal spring = (1.5 - 0.5 * within * within) / hx_max(size, one);
  const hxReal room = 1.0 - spring * size;
  const hxReal share =
      room / hx_sqrt(room * room + hx_dot(d, d) +
                     1e-30); /* 1e-30: without room and motion the share is 0, not 0/0 */
  const hxVec3 w = hx_add_scaled(hx_scale(spring, u), share, d);
  const hxReal sliding = hx_splat(model->per_stribeck) * release_rate * size;
  const hxReal mu = hx_load(&state->mu[row][slot]) +
                    hx_load(&state->static_rise[row][slot]) / (1.0 + sliding * sliding);
  return (hxBristle){
      .grip = hx_scale(mu, w),
      .rate = rate,
      .stiffness = (mu * per_length) * spring,
      .damping = (1.5 * mu * model->bristle_damping * per_length) * share,
      .yield = per_length * release_rate,
  };
}

/* Constants of the normal law of a row of contacts, fixed at touch-down. */
typedef struct {
  hxReal closed, damping; /* 1, s/m */
  hxReal stiffness;       /* N/m^1.5 */
} hxContactLawAt;

HX_INLINE hxContactLawAt hx_law_at(const hxContactState *state, int row, int slot) {
  return (hxContactLawAt){hx_load(&state->closed[row][slot]), hx_load(&state->damping[row][slot]),
                          hx_load(&state->stiffness[row][slot])};
}

/* Returns f_n = K delta^(3/2) (1 + d ddelta) >= 0 of a closed contact (eq. 14), and its
 * derivatives. */
HX_INLINE hxNormalForce hx_normal_force(hxContactLawAt law, hxReal delta, hxReal ddelta) {
  const hxReal zero = hx_splat(0.0);
  const hxReal depth = law.closed * hx_max(delta, zero);
  const hxReal root = hx_sqrt(depth);
  const hxReal elastic = law.stiffness * depth * root;
  const hxReal factor = 1.0 + law.damping * ddelta;
  const hxMask pushes = hx_less(zero, factor);
  return (hxNormalForce){
      .force = elastic * hx_max(factor, zero),
      .elastic = elastic,
      .stiffness = hx_select(pushes, law.closed * (1.5 * law.stiffness) * root * factor, zero),
      .viscosity = hx_select(pushes, elastic * law.damping, zero),
  };
}

/* Computes contact point, penetration and velocity of a row of contacts from the motion of their
 * bodies: centres of mass r, their velocities v, orientations and angular velocities. */
HX_INLINE hxContactKinematics hx_contact_kinematics(const hxModel *model,
                                                    const hxContactState *state, int row, int slot,
                                                    int all, hxVec3 r, hxVec3 v,
                                                    const hxBody *body) {
  const hxNumber radius = model->radius[row];
  const hxVec3 to_centre = hx_mul(body->R_WB, hx_load_vec3(model->point[row], slot));
  const hxGround ground = hx_ground(model, state, row, slot, all, hx_add3(r, to_centre));
  const hxVec3 arm = hx_add_scaled(to_centre, hx_splat(-radius), ground.normal);
  const hxVec3 velocity = hx_add3(v, hx_cross(body->w, arm));
  return (hxContactKinematics){arm, ground.normal, radius - ground.distance,
                               -hx_dot(velocity, ground.normal), velocity};
}

/* Returns the kinematics of a row of contacts on the tibias. */
HX_INLINE hxContactKinematics hx_tibia_contact(const hxModel *model, const hxContactState *state,
                                               const hxPlantMotion *motion, int row, int slot,
                                               int all, const hxBody *tibia) {
  return hx_contact_kinematics(model, state, row, slot, all,
                               hx_link_vec3(motion, HX_JOINTS - 1, HX_R, slot),
                               hx_link_vec3(motion, HX_JOINTS - 1, HX_V, slot), tibia);
}

/* Returns the kinematics of the torso's contacts. */
static inline hxContactKinematics hx_torso_contact(const hxModel *model,
                                                   const hxContactState *state,
                                                   const hxPlantMotion *motion, int slot, int all,
                                                   const hxBody *torso) {
  return hx_contact_kinematics(model, state, HX_TORSO, slot, all, hx_torso_vec3(motion, HX_R),
                               hx_torso_vec3(motion, HX_V), torso);
}

/* Computes the force of the ground on a row of contacts: f_n along the normal, and across it f_t =
 * -mu f_n g(|v_t|) v_t or the bristles' force. All friction laws are chosen by this function. */
HX_INLINE void hx_contact_force(const hxModel *model, const hxContactState *state, int row,
                                int slot, const hxPlantMotion *motion, hxContactWork *contact) {
  const hxContactKinematics *kin = &contact->kin;
  contact->normal = hx_normal_force(hx_law_at(state, row, slot), kin->delta, kin->ddelta);
  contact->slip = hx_add_scaled(kin->velocity, kin->ddelta, kin->normal);
  contact->slip_speed = hx_sqrt(hx_dot(contact->slip, contact->slip));
  if (has_bristles(model, row)) {
    contact->bristle =
        hx_bristle(model, state, row, slot, hx_load_vec3(motion->bristle, slot), contact->slip);
    contact->force = hx_scale(contact->normal.force, hx_sub3(kin->normal, contact->bristle.grip));
    return;
  }
  contact->drag_per_load = hx_load(&state->mu[row][slot]) * hx_friction(model, contact->slip_speed);
  contact->drag = contact->normal.force * contact->drag_per_load;
  contact->force =
      hx_add_scaled(hx_scale(contact->normal.force, kin->normal), -contact->drag, contact->slip);
}

/* Returns the power that friction dissipates, W. */
static inline hxReal hx_friction_power(const hxModel *model, int row,
                                       const hxContactWork *contact) {
  if (has_bristles(model, row))
    return contact->normal.force * hx_dot(contact->bristle.grip, contact->slip);
  return contact->drag * contact->slip_speed * contact->slip_speed;
}

#endif
