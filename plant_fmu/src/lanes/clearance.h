/* clearance.h - distances between the femurs and tibias of neighbouring legs, as capsules;
 * models/body/clearance.py is the readable form */
#ifndef HX_CLEARANCE_H
#define HX_CLEARANCE_H

#include "work.h"

enum { HX_CHAIN = 3 }; /* points of a leg: the joints of femur and tibia, the foot's centre */

/* The neighbours of legs around the torso: LF LM LR RR RM RF. Slots past the last leg repeat leg
 * 0. */
static const int hx_next_leg[HX_SLOTS] = {1, 2, 5, 0, 3, 4, 1, 1};
static const int hx_previous_leg[HX_LEGS] = {3, 0, 1, 4, 5, 2};

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

/* Returns the distance between the lines p + s a and q + t b with s, t in [0, 1]. The squared
 * distance is convex in s and t, so its minimum is on an edge of the square, where an end of one
 * line is nearest to a point of the other, or at the common normal within it. */
static inline hxReal hx_line_distance(hxVec3 p, hxVec3 a, hxVec3 q, hxVec3 b) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  const hxVec3 r = hx_sub3(p, q);
  const hxReal aa = hx_dot(a, a), bb = hx_dot(b, b), ab = hx_dot(a, b);
  const hxReal ar = hx_dot(a, r), br = hx_dot(b, r), det = aa * bb - ab * ab;
  const hxReal s0 = hx_clip(ratio(-ar, aa), zero, one), s1 = hx_clip(ratio(ab - ar, aa), zero, one);
  const hxReal t0 = hx_clip(ratio(br, bb), zero, one), t1 = hx_clip(ratio(ab + br, bb), zero, one);
  hxReal least = hx_min(hx_min(chord(r, a, b, s0, zero), chord(r, a, b, s1, one)),
                        hx_min(chord(r, a, b, zero, t0), chord(r, a, b, one, t1)));
  const hxMask crosses = hx_less(hx_parallel * aa * bb, det);
  const hxReal inverse = 1.0 / hx_select(crosses, det, one);
  const hxReal s = hx_clip((ab * br - bb * ar) * inverse, zero, one),
               t = hx_clip((aa * br - ab * ar) * inverse, zero, one);
  least = hx_select(crosses, hx_min(least, chord(r, a, b, s, t)), least);
  return hx_sqrt(least);
}

/* Stores the points of all legs, world axes. */
static inline void leg_chains(const hxModel *model, const hxPlantMotion *motion, const hxWork *work,
                              hxNumber chain[HX_CHAIN][3][HX_SLOTS]) {
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const int slot = pack * HX_LANES;
    const hxJointWork *joint = work->pack[pack].joint;
    const hxVec3 femur = hx_link_vec3(motion, 1, HX_R, slot),
                 tibia = hx_link_vec3(motion, 2, HX_R, slot);
    const hxMat3 R_WF = joint[1].body.R_WB, R_WT = joint[2].body.R_WB;
    const hxVec3 point[HX_CHAIN] = {
        hx_add3(femur, hx_mul(R_WF, hx_load_vec3(model->joint[1].point_j, slot))),
        hx_add3(tibia, hx_mul(R_WT, hx_load_vec3(model->point[HX_KNEE], slot))),
        hx_add3(tibia, hx_mul(R_WT, hx_load_vec3(model->point[HX_FOOT], slot)))};
    for (int k = 0; k < HX_CHAIN; ++k) hx_store_vec3(chain[k], slot, point[k]);
  }
}

/* Stores the points of each leg's next neighbour. */
static inline void next_chains(hxNumber chain[HX_CHAIN][3][HX_SLOTS],
                               hxNumber next[HX_CHAIN][3][HX_SLOTS]) {
  for (int k = 0; k < HX_CHAIN; ++k)
    for (int i = 0; i < 3; ++i)
      for (int slot = 0; slot < HX_SLOTS; ++slot) next[k][i][slot] = chain[k][i][hx_next_leg[slot]];
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
        least = hx_min(least, hx_line_distance(p, a, q, b) - (radius[i] + radius[j]));
      }
    hx_store(&gap[slot], least);
  }
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const hxNumber one = gap[leg], other = gap[hx_previous_leg[leg]];
    clearance[leg] = hx_re(other) < hx_re(one) ? other : one;
  }
}

#endif
