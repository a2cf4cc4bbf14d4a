/* merged_feet.h - one row of contacts for feet on blocks that have one contact each
 *
 * While some feet stand on tops and others at walls, edges or corners, an evaluation computes a row
 * of contacts for each of these faces, in which most lanes have no contact. If no foot has two,
 * the lanes of one row are enough. Their numbers are those of the rows, to the last bit.
 */
#ifndef HX_MERGED_FEET_H
#define HX_MERGED_FEET_H

#include "foot.h"

/* Contacts of a pack of feet; those of no contact are the first row's. */
struct hxMergedFeet {
  hxMask on[HX_FOOT_ROWS]; /* lanes whose contact is of a row */
  int used[HX_FOOT_ROWS];  /* 1: there are some */
  hxContactLawAt law;
  hxFrictionAt friction;
};

/* Returns a row's constants in the lanes of the mask, and those before elsewhere. */
static inline void merge_row(const hxContactState *state, int row, int slot, hxMergedFeet *merged) {
  const hxMask on = merged->on[row];
  const hxContactLawAt law = hx_law_at(state, row, slot);
  const hxFrictionAt friction = hx_friction_at(state, row, slot);
  merged->law = (hxContactLawAt){hx_select(on, law.closed, merged->law.closed),
                                 hx_select(on, law.damping, merged->law.damping),
                                 hx_select(on, law.stiffness, merged->law.stiffness)};
  merged->friction =
      (hxFrictionAt){hx_select(on, friction.mu, merged->friction.mu),
                     hx_select(on, friction.static_rise, merged->friction.static_rise)};
}

/* Merges the rows of a pack of feet. Returns 0 where a foot has several contacts. */
static inline int merge_pack(const hxContactState *state, int slot, hxMergedFeet *merged) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  hxReal closed = zero;
  for (int row = HX_FOOT; row < HX_FOOT_ROWS; ++row) {
    const hxReal of_row = hx_load(&state->closed[row][slot]);
    merged->on[row] = hx_less(zero, of_row);
    merged->used[row] = hx_any(merged->on[row]);
    closed += of_row;
  }
  if (hx_any(hx_less(one, closed))) return 0;
  merged->law = hx_law_at(state, HX_FOOT, slot);
  merged->friction = hx_friction_at(state, HX_FOOT, slot);
  for (int row = HX_FOOT + 1; row < HX_FOOT_ROWS; ++row)
    if (merged->used[row]) merge_row(state, row, slot, merged);
  return 1;
}

/* Merges the rows of the feet. Returns 0 where they have to stay apart, or where the first row has
 * all contacts: bristles and soil are of that row alone. */
HX_RARE int hx_merge_feet(const hxModel *model, const hxContactState *state,
                          hxMergedFeet merged[HX_PACKS]) {
  int further = 0;
  if (model->rows > model->foot_rows || has_bristles(model, HX_FOOT) ||
      has_turning_friction(model, HX_FOOT))
    return 0;
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    if (!merge_pack(state, pack * HX_LANES, &merged[pack])) return 0;
    for (int row = HX_FOOT + 1; row < HX_FOOT_ROWS; ++row) further |= merged[pack].used[row];
  }
  return further;
}

/* Returns distance and normal of the faces that feet touch. */
static inline hxGround merged_ground(const hxModel *model, const hxContactState *state,
                                     const hxKnown *known, int slot, const hxMergedFeet *merged,
                                     hxVec3 point) {
  hxGround ground;
  for (int row = HX_FOOT; row < HX_FOOT_ROWS; ++row) {
    if (row != HX_FOOT && !merged->used[row]) continue;
    const hxGround of_row = hx_known_or_searched(model, state, known, row, slot, HX_CLOSED, point);
    const hxMask on = merged->on[row];
    ground = row == HX_FOOT ? of_row
                            : (hxGround){hx_select(on, of_row.distance, ground.distance),
                                         select3(on, of_row.normal, ground.normal)};
  }
  return ground;
}

/* Computes kinematics, law and force of the feet's only contacts, as those of the first row. */
HX_RARE void hx_merged_contact(const hxModel *model, const hxContactState *state,
                               const hxPlantMotion *motion, const hxKnown *known, int slot,
                               const hxBody *tibia, hxContactWork *contact) {
  const hxMergedFeet *merged = &known->merged[slot / HX_LANES];
  const hxVec3 r = hx_link_vec3(motion, HX_JOINTS - 1, HX_R, slot),
               v = hx_link_vec3(motion, HX_JOINTS - 1, HX_V, slot),
               to_centre = hx_mul(tibia->R_WB, hx_load_vec3(model->point[HX_FOOT], slot));
  const hxGround ground = merged_ground(model, state, known, slot, merged, hx_add3(r, to_centre));
  contact->kin = hx_kinematics_over(&ground, model->radius[HX_FOOT], to_centre, v, tibia);
  contact->law = merged->law;
  rigid_force(model, HX_FOOT, slot, motion, merged->friction, contact);
}

/* Copies a step's impulses of merged contacts to their rows. */
HX_RARE void hx_part_impulses(const hxMergedFeet merged[HX_PACKS], hxVec3 sum[][HX_PACKS]) {
  const hxVec3 none = hx_zero3();
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    hxVec3 first = sum[HX_FOOT][pack];
    for (int row = HX_FOOT + 1; row < HX_FOOT_ROWS; ++row) {
      sum[row][pack] = select3(merged[pack].on[row], sum[HX_FOOT][pack], none);
      first = select3(merged[pack].on[row], none, first);
    }
    sum[HX_FOOT][pack] = first;
  }
}

#endif
