/* foot.h - contact of a sphere, of a foot or a body, with compliant ground: kinematics and forces
 * (eq. 14, 15); friction.h holds the laws of friction */
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

typedef struct {
  hxContactKinematics kin;
  hxNormalForce normal;
  hxVec3 slip, force; /* m/s, N  tangential velocity, force of the ground on the body */
  hxReal slip_speed;
  hxReal drag;               /* N s/m   tangential force over slip speed */
  hxReal drag_per_load;      /* s/m     drag over f_n */
  hxBristle bristle;         /* set by laws with bristles only */
  hxVec3 response;           /* N  stage's addition to the force (eq. 20) */
  hxVec3 shift, speed_shift; /* m, m/s  of the contact point (eq. 20), without its a */
  hxVec3 bristle_force;      /* N  bristles' part of response (eq. 21) */
  hxTurningFriction turning; /* this and the next two: set with spin or rolling friction */
  hxVec3 moment;             /* N m  of spin and rolling friction on the body (eq. 34) */
  hxVec3 turn_response;      /* N m  stage's addition to the moment */
} hxContactWork;

/* Returns whether the contacts of a row stand on bristles; bodies slide by the tanh law then. */
static inline int has_bristles(const hxModel *model, int row) {
  return row < HX_FOOT_ROWS &&
         (model->friction_law == HX_FRICTION_BRISTLE || model->friction_law == HX_FRICTION_LUGRE);
}

/* Returns whether the contacts of a row resist spin or rolling: feet do. */
static inline int has_turning_friction(const hxModel *model, int row) {
  return row < HX_FOOT_ROWS && (model->spin_friction || model->roll_friction);
}

/* Returns distance and normal of the ground at a point. All other code is independent of the
 * terrain. */
HX_INLINE hxGround hx_ground(const hxModel *model, hxVec3 point) {
  if (model->terrain_kind == HX_TERRAIN_FLAT)
    return (hxGround){point.z - model->ground_point[2],
                      {hx_splat(0.0), hx_splat(0.0), hx_splat(1.0)}};
  const hxVec3 n = hx_splat_vec3(model->ground_normal);
  return (hxGround){hx_dot(n, hx_sub3(point, hx_splat_vec3(model->ground_point))), n};
}

/* Returns f_n = K delta^(3/2) (1 + d ddelta) >= 0 of a closed contact (eq. 14), and its
 * derivatives. */
HX_INLINE hxNormalForce hx_normal_force(const hxModel *model, hxReal closed, hxReal damping,
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

/* Computes contact point, penetration and velocity of a row of contacts from the motion of their
 * bodies: centres of mass r, their velocities v, orientations and angular velocities. */
HX_INLINE hxContactKinematics hx_contact_kinematics(const hxModel *model, int row, int slot,
                                                    hxVec3 r, hxVec3 v, const hxBody *body) {
  const hxNumber radius = model->radius[row];
  const hxVec3 to_centre = hx_mul(body->axes, hx_load_vec3(model->point[row], slot));
  const hxGround ground = hx_ground(model, hx_add3(r, to_centre));
  const hxVec3 arm = hx_add_scaled(to_centre, hx_splat(-radius), ground.normal);
  const hxVec3 velocity = hx_add3(v, hx_cross(body->w, arm));
  return (hxContactKinematics){arm, ground.normal, radius - ground.distance,
                               -hx_dot(velocity, ground.normal), velocity};
}

/* Returns the kinematics of a row of contacts on the tibias. */
HX_INLINE hxContactKinematics hx_tibia_contact(const hxModel *model, const hxPlantMotion *motion,
                                               int row, int slot, const hxBody *tibia) {
  return hx_contact_kinematics(model, row, slot, hx_link_vec3(motion, HX_JOINTS - 1, HX_R, slot),
                               hx_link_vec3(motion, HX_JOINTS - 1, HX_V, slot), tibia);
}

/* Returns the kinematics of the torso's contacts. */
static inline hxContactKinematics
hx_torso_contact(const hxModel *model, const hxPlantMotion *motion, int slot, const hxBody *torso) {
  return hx_contact_kinematics(model, HX_TORSO, slot, hx_torso_vec3(motion, HX_R),
                               hx_torso_vec3(motion, HX_V), torso);
}

/* Computes the force of the ground on a row of contacts: f_n along the normal, and across it f_t =
 * -mu f_n g(|v_t|) v_t or the bristles' force. All friction laws are chosen by this function. */
HX_INLINE void hx_contact_force(const hxModel *model, const hxContactState *state, int row,
                                int slot, const hxPlantMotion *motion, hxContactWork *contact) {
  const hxContactKinematics *kin = &contact->kin;
  const hxReal closed = hx_load(&state->closed[row][slot]);
  contact->normal =
      hx_normal_force(model, closed, hx_load(&state->damping[row][slot]), kin->delta, kin->ddelta);
  contact->slip = hx_add_scaled(kin->velocity, kin->ddelta, kin->normal);
  contact->slip_speed = hx_sqrt(hx_dot(contact->slip, contact->slip));
  if (has_bristles(model, row)) {
    const hxVec3 b = hx_load_vec3(motion->bristle, slot);
    contact->bristle = model->friction_law == HX_FRICTION_LUGRE
                           ? hx_lugre(model, closed, b, contact->slip)
                           : hx_bristle(model, closed, b, contact->slip);
    contact->force = hx_scale(contact->normal.force, hx_sub3(kin->normal, contact->bristle.grip));
    return;
  }
  contact->drag_per_load = hx_friction_drag(model, contact->slip_speed);
  contact->drag = contact->normal.force * contact->drag_per_load;
  contact->force =
      hx_add_scaled(hx_scale(contact->normal.force, kin->normal), -contact->drag, contact->slip);
}

/* Computes the moment of spin and rolling friction on bodies that turn at w; the normal forces are
 * known. */
HX_RARE void hx_contact_moment(const hxModel *model, int row, const hxVec3 *w,
                               hxContactWork *contact) {
  contact->turning =
      hx_turning_friction(model, hx_splat(model->radius[row]), contact->kin.normal, *w);
  contact->moment = hx_scale(contact->normal.force, contact->turning.moment);
}

/* Returns the power that sliding friction dissipates, W. */
static inline hxReal hx_friction_power(const hxModel *model, int row,
                                       const hxContactWork *contact) {
  if (has_bristles(model, row))
    return contact->normal.force * hx_dot(contact->bristle.grip, contact->slip);
  return contact->drag * contact->slip_speed * contact->slip_speed;
}

#endif
