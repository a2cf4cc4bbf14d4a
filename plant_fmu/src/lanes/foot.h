/* foot.h - contact of a spherical foot with compliant ground: kinematics and forces (eq. 14, 15);
 * friction.h holds the laws of friction */
#ifndef HX_FOOT_H
#define HX_FOOT_H

#include "friction.h"
#include "kinematics.h"

/* Distance of a point from the ground, and the ground's normal. */
typedef struct {
  hxReal distance; /* m  signed, > 0 above the ground */
  hxVec3 normal;   /* 1  out of the ground, world axes */
} hxGround;

/* Kinematics of the contact. */
typedef struct {
  hxVec3 arm;           /* m       tibia's centre of mass to the contact point */
  hxVec3 normal;        /* 1       out of the ground */
  hxReal delta, ddelta; /* m, m/s  penetration, approach speed */
  hxVec3 velocity;      /* m/s     of the foot's material at the contact point */
} hxFootKinematics;

/* Normal force and its derivatives. */
typedef struct {
  hxReal force;     /* N    f_n */
  hxReal elastic;   /* N      its elastic part K delta^(3/2) */
  hxReal stiffness; /* N/m  df_n/ddelta */
  hxReal viscosity; /* N s/m  df_n/d(ddelta) */
} hxNormalForce;

typedef struct {
  hxFootKinematics kin;
  hxNormalForce normal;
  hxVec3 slip, force; /* m/s, N  tangential velocity, force of the ground on the foot */
  hxReal slip_speed;
  hxReal drag;          /* N s/m   tangential force over slip speed */
  hxReal drag_per_load; /* s/m     drag over f_n */
  hxBristle bristle;    /* set by laws with bristles only */
  hxTurningFriction turning; /* set by hx_foot_moment only */
  hxVec3 moment;             /* N m  of spin and rolling friction on the tibia */
} hxFootWork;

/* Returns whether the friction law has bristles. */
static inline int has_bristles(const hxModel *model) {
  return model->friction_law == HX_FRICTION_BRISTLE || model->friction_law == HX_FRICTION_LUGRE;
}

/* Returns whether the feet resist spin or rolling. */
static inline int has_turning_friction(const hxModel *model) {
  return model->spin_friction || model->roll_friction;
}

/* Returns distance and normal of the ground at a point. All other code is independent of the
 * terrain. */
static inline hxGround hx_ground(const hxModel *model, hxVec3 point) {
  if (model->terrain_kind == HX_TERRAIN_FLAT)
    return (hxGround){point.z - model->ground_point[2],
                      {hx_splat(0.0), hx_splat(0.0), hx_splat(1.0)}};
  const hxVec3 n = hx_splat_vec3(model->ground_normal);
  return (hxGround){hx_dot(n, hx_sub3(point, hx_splat_vec3(model->ground_point))), n};
}

/* Returns f_n = K delta^(3/2) (1 + d ddelta) >= 0 of a closed contact (eq. 14), and its
 * derivatives. */
static inline hxNormalForce hx_normal_force(const hxModel *model, hxReal closed, hxReal damping,
                                            hxReal delta, hxReal ddelta) {
  const hxReal zero = hx_splat(0.0);
  const hxReal depth = closed * hx_max(delta, zero);
  const hxReal root = hx_sqrt(depth);
  const hxReal elastic = model->stiffness * depth * root;
  const hxReal factor = 1.0 + damping * ddelta;
  const hxMask pushes = hx_less(zero, factor);
  return (hxNormalForce){
      .force = elastic * hx_max(factor, zero),
      .elastic = elastic,
      .stiffness = hx_select(pushes, closed * (1.5 * model->stiffness) * root * factor, zero),
      .viscosity = hx_select(pushes, elastic * damping, zero),
  };
}

/* Computes contact point, penetration and velocity of the feet from the tibias' motion. */
static inline hxFootKinematics hx_foot_kinematics(const hxModel *model, const hxPlantMotion *motion,
                                                  int slot, const hxBody *tibia) {
  const hxVec3 r = hx_link_vec3(motion, HX_JOINTS - 1, HX_R, slot),
               v = hx_link_vec3(motion, HX_JOINTS - 1, HX_V, slot);
  const hxVec3 to_centre = hx_mul(tibia->axes, hx_load_vec3(model->point_foot, slot));
  const hxGround ground = hx_ground(model, hx_add3(r, to_centre));
  const hxVec3 arm = hx_add_scaled(to_centre, hx_splat(-model->foot_radius), ground.normal);
  const hxVec3 velocity = hx_add3(v, hx_cross(tibia->w, arm));
  return (hxFootKinematics){arm, ground.normal, model->foot_radius - ground.distance,
                            -hx_dot(velocity, ground.normal), velocity};
}

/* Computes the force of the ground on the foot: f_n along the normal, and across it f_t = -mu f_n
 * g(|v_t|) v_t or the bristles' force. All friction laws are chosen by this function. */
static inline void hx_foot_force(const hxModel *model, const hxContactState *contact, int slot,
                                 hxVec3 bristle, hxFootWork *foot) {
  const hxFootKinematics *kin = &foot->kin;
  foot->normal = hx_normal_force(model, hx_load(&contact->closed[slot]),
                                 hx_load(&contact->damping[slot]), kin->delta, kin->ddelta);
  foot->slip = hx_add_scaled(kin->velocity, kin->ddelta, kin->normal);
  foot->slip_speed = hx_sqrt(hx_dot(foot->slip, foot->slip));
  if (has_bristles(model)) {
    const hxReal closed = hx_load(&contact->closed[slot]);
    foot->bristle = model->friction_law == HX_FRICTION_LUGRE
                        ? hx_lugre(model, closed, bristle, foot->slip)
                        : hx_bristle(model, closed, bristle, foot->slip);
    foot->force = hx_scale(foot->normal.force, hx_sub3(kin->normal, foot->bristle.grip));
    return;
  }
  foot->drag_per_load = hx_friction_drag(model, foot->slip_speed);
  foot->drag = foot->normal.force * foot->drag_per_load;
  foot->force = hx_add_scaled(hx_scale(foot->normal.force, kin->normal), -foot->drag, foot->slip);
}

/* Computes the moment of spin and rolling friction on a tibia that turns at w; the foot's normal
 * force is known. */
static inline void hx_foot_moment(const hxModel *model, hxVec3 w, hxFootWork *foot) {
  foot->turning = hx_turning_friction(model, hx_splat(model->foot_radius), foot->kin.normal, w);
  foot->moment = hx_scale(foot->normal.force, foot->turning.moment);
}

/* Returns the power that sliding friction dissipates, W. */
static inline hxReal hx_friction_power(const hxModel *model, const hxFootWork *foot) {
  if (has_bristles(model))
    return foot->normal.force * hx_dot(foot->bristle.grip, foot->slip);
  return foot->drag * foot->slip_speed * foot->slip_speed;
}

#endif
