/* foot.h - contact of a sphere, of a foot or a body, with compliant ground: kinematics and forces
 * (eq. 14, 15); friction.h holds the laws of friction */
#ifndef HX_FOOT_H
#define HX_FOOT_H

#include "../packs/vec3.h"

#include "../ground/grid_rows.h"
#include "../ground/sharing.h"
#include "friction.h"
#include "kinematics.h"
#include "soil_pack.h"

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

/* Constants of the normal law of a row of contacts, fixed at touch-down; the stiffness of feet on
 * blocks with their shares. */
typedef struct {
  hxReal closed, damping; /* 1, s/m */
  hxReal stiffness;       /* N/m^1.5 */
} hxContactLawAt;

typedef struct {
  hxContactKinematics kin;
  hxContactLawAt law;
  hxNormalForce normal;
  hxVec3 slip, force; /* m/s, N  tangential velocity, force of the ground on the body */
  hxReal slip_speed;
  hxReal drag;               /* N s/m   tangential force over slip speed */
  hxReal drag_per_load;      /* s/m     drag over f_n */
  hxReal stored, hold;       /* J, N/m  of soil: elastic energy, shear without load over bristle */
  hxGrip grip;               /* set by laws with bristles only */
  hxVec3 response;           /* N  stage's addition to the force (eq. 20) */
  hxVec3 shift, speed_shift; /* m, m/s  of the contact point (eq. 20), without its a */
  hxVec3 bristle_force;      /* N  bristles' part of response (eq. 21) */
  hxTurningFriction turning; /* this and the next two: set with spin or rolling friction */
  hxVec3 moment;             /* N m  of spin and rolling friction on the body (eq. 38) */
  hxVec3 turn_response;      /* N m  stage's addition to the moment */
} hxContactWork;

/* Returns whether the friction of a row's contacts on rigid ground has bristles; others slide by
 * the tanh law then. */
static inline int has_friction_bristles(const hxModel *model, int row) {
  return row == HX_FOOT && hx_friction_kind(model->friction_law).has_bristles;
}

/* Returns whether the contacts of a row stand on bristles, those of friction or of soil. */
static inline int has_bristles(const hxModel *model, int row) {
  return has_friction_bristles(model, row) || (row == HX_FOOT && model->has_soil);
}

/* Returns whether the contacts of a row resist spin or rolling: feet do. */
static inline int has_turning_friction(const hxModel *model, int row) {
  return row < HX_FOOT_ROWS && (model->spin_friction || model->roll_friction);
}

/* Returns the constants of a row of contacts, without shares. */
HX_INLINE hxContactLawAt hx_law_at(const hxContactState *state, int row, int slot) {
  return (hxContactLawAt){hx_load(&state->closed[row][slot]), hx_load(&state->damping[row][slot]),
                          hx_load(&state->stiffness[row][slot])};
}

/* Returns the friction coefficients of a row of contacts, fixed at touch-down. */
HX_INLINE hxFrictionAt hx_friction_at(const hxContactState *state, int row, int slot) {
  return (hxFrictionAt){hx_load(&state->mu[row][slot]), hx_load(&state->static_rise[row][slot])};
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

/* Returns a where the mask is set, b elsewhere. */
static inline hxVec3 select3(hxMask mask, hxVec3 a, hxVec3 b) {
  return (hxVec3){hx_select(mask, a.x, b.x), hx_select(mask, a.y, b.y), hx_select(mask, a.z, b.z)};
}

/* Returns the elastic energy 2/5 K delta^(5/2) of a row of contacts, J. */
static inline hxReal elastic_energy(const hxContactWork *contact) {
  return 0.4 * contact->normal.elastic * hx_max(contact->kin.delta, hx_splat(0.0));
}

/* Replaces the normal force of a row by that of soil where it touched down on it. */
HX_INLINE void replace_load(hxMask soft, const hxSoilPack *f, hxContactWork *contact) {
  contact->stored = hx_select(soft, f->stored, elastic_energy(contact));
  contact->normal.force = hx_select(soft, f->force, contact->normal.force);
  contact->normal.elastic = hx_select(soft, f->storage, contact->normal.elastic);
}

/* Replaces the forces on feet by those of soil where they touched down on it: f_n along the normal
 * and the shear -(T_0 + f_n tan phi) b/K across it (eq. 44-47). */
HX_RARE void replace_by_soil(const hxModel *model, const hxContactState *state, int slot,
                             const hxPlantMotion *motion, const hxSoilCurves *virgin,
                             hxContactWork *contact) {
  const hxMask soft = hx_on_soil(state, slot);
  const hxContactKinematics *kin = &contact->kin;
  const hxSoilPack f = hx_soil_pack(state, slot, kin->delta, kin->ddelta, virgin);
  const hxVec3 b = hx_load_vec3(motion->bristle, slot), none = hx_zero3();
  const hxReal zero = hx_splat(0.0), relaxation = f.per_displacement * contact->slip_speed;
  const hxGrip rigid = has_friction_bristles(model, HX_FOOT)
                           ? contact->grip
                           : (hxGrip){none, none, zero, zero, zero};
  const hxVec3 grip = hx_scale(f.per_load, b),
               rate = hx_scale(hx_load(&state->closed[HX_FOOT][slot]),
                               hx_add_scaled(contact->slip, -relaxation, b));
  const hxVec3 force = hx_add_scaled(hx_scale(f.force, hx_sub3(kin->normal, grip)), -f.hold, b);
  replace_load(soft, &f, contact);
  contact->hold = f.hold;
  contact->force = select3(soft, force, contact->force);
  contact->grip = (hxGrip){.traction = select3(soft, grip, rigid.traction),
                           .rate = select3(soft, rate, rigid.rate),
                           .stiffness = hx_select(soft, f.per_load, rigid.stiffness),
                           .damping = hx_select(soft, zero, rigid.damping),
                           .relaxation = hx_select(soft, relaxation, rigid.relaxation)};
}

/* What is known of contacts before they are computed; NULL: nothing. */
typedef struct {
  const hxMoment *moment;     /* of the same motion: angles, and places of all contacts on a grid */
  hxPatchNodes *nodes;        /* around the feet of an earlier motion, pack by pack */
  const hxSoilCurves *virgin; /* under the feet at the same depths, pack by pack */
} hxKnown;

/* Return what is known of a pack of a row; NULL: nothing. Points of numbers with derivatives are
 * computed one by one. */
#ifdef HX_TANGENT
static inline hxPatchNodes *known_nodes(const hxKnown *known, int row, int slot) {
  (void)known, (void)row, (void)slot;
  return NULL;
}
#else
static inline hxPatchNodes *known_nodes(const hxKnown *known, int row, int slot) {
  return known && known->nodes && row < HX_FOOT_ROWS ? &known->nodes[slot / HX_LANES] : NULL;
}
#endif
static inline const hxSoilCurves *known_virgin(const hxKnown *known, int row, int slot) {
  return known && known->virgin && row == HX_FOOT ? &known->virgin[slot / HX_LANES] : NULL;
}

/* Returns distance and normal of a grid at a row's points from the moment of the same motion. */
HX_INLINE hxGround known_ground(const hxModel *model, const hxMoment *moment, int row, int slot) {
  const hxContactMoment *contact = &moment->contact[row];
  return (hxGround){model->radius[row] - hx_load(&contact->delta[slot]),
                    hx_load_vec3(contact->normal, slot)};
}

/* Returns distance and normal of the ground at a row's points: as known, or searched. */
HX_INLINE hxGround hx_known_or_searched(const hxModel *model, const hxContactState *state,
                                        const hxKnown *known, int row, int slot, int all,
                                        hxVec3 point) {
  const int is_known = known && known->moment && model->terrain_kind == HX_TERRAIN_GRID;
  return is_known ? known_ground(model, known->moment, row, slot)
                  : hx_ground(model, state, row, slot, all, point, known_nodes(known, row, slot));
}

/* Computes contact point, penetration and velocity of contacts over this ground. */
HX_INLINE hxContactKinematics hx_kinematics_over(const hxGround *ground, hxNumber radius,
                                                 hxVec3 to_centre, hxVec3 v, const hxBody *body) {
  const hxVec3 arm = hx_add_scaled(to_centre, hx_splat(-radius), ground->normal);
  const hxVec3 velocity = hx_add3(v, hx_cross(body->w, arm));
  return (hxContactKinematics){arm, ground->normal, radius - ground->distance,
                               -hx_dot(velocity, ground->normal), velocity};
}

/* Computes contact point, penetration and velocity of a row of contacts from the motion of their
 * bodies: centres of mass r, their velocities v, orientations and angular velocities. */
HX_INLINE hxContactKinematics hx_contact_kinematics(const hxModel *model,
                                                    const hxContactState *state,
                                                    const hxKnown *known, int row, int slot,
                                                    int all, hxVec3 r, hxVec3 v,
                                                    const hxBody *body) {
  const hxVec3 to_centre = hx_mul(body->R_WB, hx_load_vec3(model->point_B[row], slot));
  const hxGround ground =
      hx_known_or_searched(model, state, known, row, slot, all, hx_add3(r, to_centre));
  return hx_kinematics_over(&ground, model->radius[row], to_centre, v, body);
}

/* Returns the kinematics of a row of contacts on the tibias. */
HX_INLINE hxContactKinematics hx_tibia_contact(const hxModel *model, const hxContactState *state,
                                               const hxPlantMotion *motion, const hxKnown *known,
                                               int row, int slot, int all, const hxBody *tibia) {
  return hx_contact_kinematics(model, state, known, row, slot, all,
                               hx_link_vec3(motion, HX_JOINTS - 1, HX_R, slot),
                               hx_link_vec3(motion, HX_JOINTS - 1, HX_V, slot), tibia);
}

/* Returns the kinematics of the torso's contacts. */
static inline hxContactKinematics hx_torso_contact(const hxModel *model,
                                                   const hxContactState *state,
                                                   const hxPlantMotion *motion, int slot, int all,
                                                   const hxBody *torso) {
  return hx_contact_kinematics(model, state, NULL, HX_TORSO, slot, all, hx_torso_vec3(motion, HX_R),
                               hx_torso_vec3(motion, HX_V), torso);
}

/* Depth and normal of a face that a foot may touch. */
typedef struct {
  hxNumber delta, normal[3]; /* m, 1 */
} hxFootFace;

/* Returns whether a foot has more than one closed contact. */
static inline int hx_has_several(const hxContactState *state, int slot) {
  double closed = 0.0;
  for (int row = HX_FOOT; row < HX_FOOT_ROWS; ++row) closed += hx_re(state->closed[row][slot]);
  return closed > 1.0;
}

/* Computes the shares of a foot's closed contacts with rigid blocks; others have the share 1. */
HX_RARE void hx_foot_shares(const hxModel *model, const hxContactState *state, int slot,
                            const hxFootFace face[HX_FOOT_ROWS], hxNumber share[HX_FOOT_ROWS]) {
  hxSharers of = {.count = 0};
  hxNumber found[HX_SHARERS];
  int row_of[HX_SHARERS];
  for (int row = HX_FOOT; row < HX_FOOT_ROWS; ++row) {
    share[row] = 1.0;
    if (hx_re(state->closed[row][slot]) == 0.0 || !(hx_re(face[row].delta) > 0.0)) continue;
    row_of[of.count] = row;
    of.depth[of.count] = face[row].delta;
    for (int i = 0; i < 3; ++i) of.normal[of.count][i] = face[row].normal[i];
    ++of.count;
  }
  if (of.count < 2) return;
  hx_contact_shares(&of, hx_re(model->radius[HX_FOOT]), found);
  for (int i = 0; i < of.count; ++i) share[row_of[i]] = found[i];
}

/* Computes the force of rigid ground on a row of contacts: f_n along the normal, and across it f_t
 * = -mu f_n g(|v_t|) v_t or the bristles' force. */
HX_INLINE void rigid_force(const hxModel *model, int row, int slot, const hxPlantMotion *motion,
                           hxFrictionAt at, hxContactWork *contact) {
  const hxContactKinematics *kin = &contact->kin;
  contact->normal = hx_normal_force(contact->law, kin->delta, kin->ddelta);
  contact->slip = hx_add_scaled(kin->velocity, kin->ddelta, kin->normal);
  contact->slip_speed = hx_sqrt(hx_dot(contact->slip, contact->slip));
  if (has_friction_bristles(model, row)) {
    const hxReal closed = contact->law.closed;
    const hxVec3 b = hx_load_vec3(motion->bristle, slot);
    contact->grip = hx_friction_grip(model, at, closed, b, contact->slip);
    contact->force = hx_scale(contact->normal.force, hx_sub3(kin->normal, contact->grip.traction));
    return;
  }
  contact->drag_per_load = hx_friction_drag(model, at, contact->slip_speed);
  contact->drag = contact->normal.force * contact->drag_per_load;
  contact->force =
      hx_add_scaled(hx_scale(contact->normal.force, kin->normal), -contact->drag, contact->slip);
}

/* Computes the force of the ground on a row of contacts. */
HX_INLINE void hx_contact_force(const hxModel *model, const hxContactState *state, int row,
                                int slot, const hxPlantMotion *motion, const hxSoilCurves *virgin,
                                hxContactWork *contact) {
  rigid_force(model, row, slot, motion, hx_friction_at(state, row, slot), contact);
  if (has_soil(model, row)) replace_by_soil(model, state, slot, motion, virgin, contact);
}

/* Computes the moment of spin and rolling friction on bodies that turn at w; the normal forces are
 * known. */
HX_RARE void hx_contact_moment(const hxModel *model, const hxContactState *state, int row, int slot,
                               const hxVec3 *w, hxContactWork *contact) {
  contact->turning = hx_turning_moment(model, hx_friction_at(state, row, slot),
                                       hx_splat(model->radius[row]), contact->kin.normal, *w);
  contact->moment = hx_scale(contact->normal.force, contact->turning.moment);
}

/* Returns the power that sliding friction dissipates, W. */
static inline hxReal hx_friction_power(const hxModel *model, int row,
                                       const hxContactWork *contact) {
  if (has_soil(model, row)) return -hx_dot(contact->force, contact->slip);
  if (has_friction_bristles(model, row))
    return contact->normal.force * hx_dot(contact->grip.traction, contact->slip);
  return contact->drag * contact->slip_speed * contact->slip_speed;
}

#endif
