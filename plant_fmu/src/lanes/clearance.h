/* clearance.h - distances between the femurs and tibias of neighbouring legs, as capsules, and the
 * forces between those that touch (eq. 56); models/contact/bodies.py and models/contact/forces.py
 * are the readable forms */
#ifndef HX_CLEARANCE_H
#define HX_CLEARANCE_H

#include "work.h"

enum { HX_CHAIN = 3 }; /* points of a leg: the joints of femur and tibia, the foot's centre */

static const double hx_parallel = 1e-12; /* 1  squared sine below which lines are parallel */

/* Returns the squared distance of the line between a and b at shares s and t of their lengths. */
HX_INLINE hxReal chord(hxVec3 apart, hxVec3 a, hxVec3 b, hxReal s, hxReal t) {
  const hxVec3 d = hx_add_scaled(hx_add_scaled(apart, s, a), -t, b);
  return hx_dot(d, d);
}

/* Returns x/y, or 0 for y = 0. */
HX_INLINE hxReal ratio(hxReal x, hxReal y) {
  const hxReal zero = hx_splat(0.0);
  const hxMask some = hx_less(zero, y);
  return hx_select(some, x / hx_select(some, y, hx_splat(1.0)), zero);
}

/* The points p + s a and q + t b of two lines that are nearest to each other, s and t in [0, 1] */
typedef struct {
  hxReal s, t;
  hxReal square; /* m2  squared distance */
} hxNearestShares;

/* Replaces the nearest points by those at s and t if these are nearer. */
HX_INLINE void take_nearer(hxVec3 apart, hxVec3 a, hxVec3 b, hxReal s, hxReal t,
                           hxNearestShares *nearest) {
  const hxReal square = chord(apart, a, b, s, t);
  const hxMask nearer = hx_less(square, nearest->square);
  nearest->s = hx_select(nearer, s, nearest->s);
  nearest->t = hx_select(nearer, t, nearest->t);
  nearest->square = hx_select(nearer, square, nearest->square);
}

/* Finds the nearest points of the lines p + s a and q + t b, apart = p - q. The squared distance is
 * convex in s and t, so its minimum is on an edge of the square, where an end of one line is
 * nearest to a point of the other, or at the common normal within it. */
static inline hxNearestShares hx_nearest_shares(hxVec3 apart, hxVec3 a, hxVec3 b) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  const hxReal aa = hx_dot(a, a), bb = hx_dot(b, b), ab = hx_dot(a, b);
  const hxReal ar = hx_dot(a, apart), br = hx_dot(b, apart), det = aa * bb - ab * ab;
  const hxReal s0 = hx_clip(ratio(-ar, aa), zero, one), s1 = hx_clip(ratio(ab - ar, aa), zero, one);
  const hxReal t0 = hx_clip(ratio(br, bb), zero, one), t1 = hx_clip(ratio(ab + br, bb), zero, one);
  hxNearestShares nearest = {s0, zero, chord(apart, a, b, s0, zero)};
  take_nearer(apart, a, b, s1, one, &nearest);
  take_nearer(apart, a, b, zero, t0, &nearest);
  take_nearer(apart, a, b, one, t1, &nearest);
  const hxMask crosses = hx_less(hx_parallel * aa * bb, det);
  const hxReal inverse = 1.0 / hx_select(crosses, det, one);
  const hxReal s = hx_clip((ab * br - bb * ar) * inverse, zero, one),
               t = hx_clip((aa * br - ab * ar) * inverse, zero, one);
  take_nearer(apart, a, b, hx_select(crosses, s, s0), hx_select(crosses, t, zero), &nearest);
  return nearest;
}

/* Stores the points of a pack of legs, world axes. */
static inline void leg_chain(const hxModel *model, const hxPlantMotion *motion, int slot,
                             hxMat3 R_WF, hxMat3 R_WS, hxNumber chain[HX_CHAIN][3][HX_SLOTS]) {
  const hxVec3 femur = hx_link_vec3(motion, 1, HX_R, slot),
               tibia = hx_link_vec3(motion, 2, HX_R, slot);
  const hxVec3 hip_F = hx_load_vec3(model->joint[1].point_j, slot),
               knee_S = hx_load_vec3(model->point_B[HX_KNEE], slot),
               foot_S = hx_load_vec3(model->point_B[HX_FOOT], slot);
  const hxVec3 point[HX_CHAIN] = {hx_add3(femur, hx_mul(R_WF, hip_F)),
                                  hx_add3(tibia, hx_mul(R_WS, knee_S)),
                                  hx_add3(tibia, hx_mul(R_WS, foot_S))};
  for (int k = 0; k < HX_CHAIN; ++k) hx_store_vec3(chain[k], slot, point[k]);
}

/* Stores the points of all legs, world axes. */
static inline void leg_chains(const hxModel *model, const hxPlantMotion *motion, const hxWork *work,
                              hxNumber chain[HX_CHAIN][3][HX_SLOTS]) {
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const hxJointWork *joint = work->pack[pack].joint;
    leg_chain(model, motion, pack * HX_LANES, joint[1].body.R_WB, joint[2].body.R_WB, chain);
  }
}

/* Stores the points of each leg's next neighbour. */
static inline void next_chains(hxNumber chain[HX_CHAIN][3][HX_SLOTS],
                               hxNumber next[HX_CHAIN][3][HX_SLOTS]) {
  for (int k = 0; k < HX_CHAIN; ++k)
    for (int i = 0; i < 3; ++i)
      for (int slot = 0; slot < HX_SLOTS; ++slot) next[k][i][slot] = chain[k][i][hx_next_leg(slot)];
}

static inline hxVec3 chain_point(hxNumber point[3][HX_SLOTS], int slot) {
  return (hxVec3){hx_load(&point[0][slot]), hx_load(&point[1][slot]), hx_load(&point[2][slot])};
}

/* Computes the least distance of each leg's femur and tibia from those of its two neighbours, less
 * the radii of both capsules. */
static inline void hx_clearances(const hxModel *model, const hxPlantMotion *motion,
                                 const hxWork *work, hxNumber clearance[HX_LEGS]) {
  const hxNumber radius[2] = {model->radius[HX_KNEE], model->radius[HX_SHANK]};
  hxNumber chain[HX_CHAIN][3][HX_SLOTS], next[HX_CHAIN][3][HX_SLOTS], gap[HX_SLOTS];
  leg_chains(model, motion, work, chain);
  next_chains(chain, next);
  for (int slot = 0; slot < HX_PACKS * HX_LANES; slot += HX_LANES) {
    hxReal least = hx_splat(1e9);
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j) {
        const hxVec3 p = chain_point(chain[i], slot), q = chain_point(next[j], slot);
        const hxVec3 a = hx_sub3(chain_point(chain[i + 1], slot), p),
                     b = hx_sub3(chain_point(next[j + 1], slot), q);
        const hxReal distance = hx_sqrt(hx_nearest_shares(hx_sub3(p, q), a, b).square);
        least = hx_min(least, distance - (radius[i] + radius[j]));
      }
    hx_store(&gap[slot], least);
  }
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const hxNumber one = gap[leg], other = gap[hx_previous_leg(leg)];
    clearance[leg] = hx_re(other) < hx_re(one) ? other : one;
  }
}

/* ---- contacts between legs ---- */

/* Lines and motion of the femurs and tibias of all legs, world axes. */
typedef struct {
  hxNumber chain[HX_CHAIN][3][HX_SLOTS];                       /* m */
  hxNumber r[HX_LINES][3][HX_SLOTS];                           /* m  centres of mass */
  hxNumber v[HX_LINES][3][HX_SLOTS], w[HX_LINES][3][HX_SLOTS]; /* m/s, rad/s */
} hxLegLines;

/* Computes them, and those of each leg's next neighbour. */
HX_RARE void leg_lines(const hxModel *model, const hxPlantMotion *motion, hxLegLines *own,
                       hxLegLines *next) {
  enum { ROWS = sizeof *own / (HX_SLOTS * sizeof(hxNumber)) };
  for (int slot = 0; slot < HX_PACKS * HX_LANES; slot += HX_LANES) {
    hxBody body[HX_LINES];
    for (int k = 0; k < HX_LINES; ++k) {
      body[k] = hx_link_body(motion, 1 + k, slot);
      hx_store_vec3(own->r[k], slot, hx_link_vec3(motion, 1 + k, HX_R, slot));
      hx_store_vec3(own->v[k], slot, hx_link_vec3(motion, 1 + k, HX_V, slot));
      hx_store_vec3(own->w[k], slot, body[k].w);
    }
    leg_chain(model, motion, slot, body[0].R_WB, body[1].R_WB, own->chain);
  }
  const hxNumber *from = own->chain[0][0];
  hxNumber *to = next->chain[0][0];
  for (int row = 0; row < ROWS; ++row)
    for (int slot = 0; slot < HX_PACKS * HX_LANES; ++slot)
      to[row * HX_SLOTS + slot] = from[row * HX_SLOTS + hx_next_leg(slot)];
}

/* Returns which line of a leg, and which of its next leg, a row of pairs belongs to. */
static inline int own_line(int row) { return (row - HX_PAIR) / HX_LINES; }
static inline int next_line(int row) { return (row - HX_PAIR) % HX_LINES; }

/* Computes a row of contacts between legs (eq. 56): the normal points from the next leg's line to
 * the leg's, the point is in the middle of the overlap, the velocity is that of the leg's material
 * relative to the next leg's; *next_arm: from the centre of mass of the next leg's body to the
 * point, m. */
static inline hxContactKinematics pair_contact(const hxModel *model, hxLegLines *own,
                                               hxLegLines *next, int row, int slot,
                                               hxVec3 *next_arm) {
  const int i = own_line(row), j = next_line(row);
  const hxVec3 p = chain_point(own->chain[i], slot), q = chain_point(next->chain[j], slot);
  const hxVec3 a = hx_sub3(chain_point(own->chain[i + 1], slot), p),
               b = hx_sub3(chain_point(next->chain[j + 1], slot), q), apart = hx_sub3(p, q);
  const hxNearestShares at = hx_nearest_shares(apart, a, b);
  const hxVec3 d = hx_add_scaled(hx_add_scaled(apart, at.s, a), -at.t, b);
  const hxReal distance = hx_sqrt(at.square), delta = model->radius[row] - distance;
  const hxVec3 normal = hx_scale(ratio(hx_splat(1.0), distance), d);
  const hxReal inwards = 0.5 * delta - model->radius[HX_KNEE + i];
  const hxVec3 point = hx_add_scaled(hx_add_scaled(p, at.s, a), inwards, normal);
  const hxVec3 arm = hx_sub3(point, chain_point(own->r[i], slot));
  *next_arm = hx_sub3(point, chain_point(next->r[j], slot));
  const hxVec3 velocity = hx_add3(chain_point(own->v[i], slot),
                                  hx_cross(chain_point(own->w[i], slot), arm)),
               other = hx_add3(chain_point(next->v[j], slot),
                               hx_cross(chain_point(next->w[j], slot), *next_arm));
  const hxVec3 relative = hx_sub3(velocity, other);
  return (hxContactKinematics){arm, normal, delta, -hx_dot(relative, normal), relative};
}

/* Numbers of hxForce6 in slots, to be read by the next leg. */
typedef struct {
  hxNumber ang[3][HX_SLOTS], lin[3][HX_SLOTS];
} hxHandedForces;

/* Adds what a row of pairs exerts to the forces on the legs; the next leg gets the opposite force
 * at the same point. */
static inline void add_pair_forces(int row, const hxVec3 next_arm[HX_PACKS], hxWork *work) {
  hxHandedForces to_next, from_previous;
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const hxContactWork *contact = &work->pair[row - HX_PAIR][pack];
    hxForce6 *own = &work->pack[pack].by_legs[own_line(row)];
    const hxForce6 wrench = {hx_cross(contact->kin.arm, contact->force), contact->force};
    *own = hx_force_add(*own, wrench);
    const hxVec3 back = hx_neg(contact->force);
    hx_store_vec3(to_next.ang, pack * HX_LANES, hx_cross(next_arm[pack], back));
    hx_store_vec3(to_next.lin, pack * HX_LANES, back);
  }
  for (int i = 0; i < 3; ++i)
    for (int slot = 0; slot < HX_PACKS * HX_LANES; ++slot) {
      from_previous.ang[i][slot] = to_next.ang[i][hx_previous_leg(slot)];
      from_previous.lin[i][slot] = to_next.lin[i][hx_previous_leg(slot)];
    }
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    hxForce6 *next = &work->pack[pack].by_legs[next_line(row)];
    *next = hx_force_add(*next, (hxForce6){chain_point(from_previous.ang, pack * HX_LANES),
                                           chain_point(from_previous.lin, pack * HX_LANES)});
  }
}

/* Computes all contacts between legs and what they exert on femurs and tibias (eq. 56). */
HX_RARE void hx_pair_wrenches(const hxModel *model, const hxContactState *state,
                              const hxPlantMotion *motion, hxWork *work) {
  hxLegLines own, next;
  leg_lines(model, motion, &own, &next);
  for (int pack = 0; pack < HX_PACKS; ++pack)
    for (int line = 0; line < HX_LINES; ++line)
      work->pack[pack].by_legs[line] = (hxForce6){hx_zero3(), hx_zero3()};
  for (int row = HX_PAIR; row < HX_ROWS; ++row) {
    hxVec3 next_arm[HX_PACKS];
    for (int pack = 0; pack < HX_PACKS; ++pack) {
      hxContactWork *contact = &work->pair[row - HX_PAIR][pack];
      const int slot = pack * HX_LANES;
      contact->kin = pair_contact(model, &own, &next, row, slot, &next_arm[pack]);
      contact->law = hx_law_at(state, row, slot);
      hx_contact_force(model, state, row, slot, motion, NULL, contact);
    }
    add_pair_forces(row, next_arm, work);
  }
}

#endif
