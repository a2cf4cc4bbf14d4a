/* moment.h - what is measured at the end of a step (hxMoment): angles, speeds and contacts;
 * switches contacts and begins the measurement of landings */
#ifndef HX_MOMENT_H
#define HX_MOMENT_H

#include "../contact_law.h"
#include "../lanes/clearance.h"
#include "../lanes/dynamics.h"
#include "../lanes/soil_path.h"

enum { LANDING_SAMPLES = 200 }; /* samples of a landing, which lasts 20 ms */

/* Stores a row of contacts of bodies with centres of mass r and angular velocities w. */
HX_INLINE void store_contact_moment(const hxModel *model, const hxContactKinematics *kin, int row,
                                    int slot, hxVec3 r, hxVec3 w, hxContactMoment *moment) {
  const hxVec3 to_point = hx_scale(hx_splat(-model->radius[row]), kin->normal);
  hx_store_vec3(moment->centre, slot, hx_add3(r, hx_sub3(kin->arm, to_point)));
  hx_store_vec3(moment->normal, slot, kin->normal);
  hx_store_vec3(moment->slip, slot, hx_add_scaled(kin->velocity, kin->ddelta, kin->normal));
  hx_store_vec3(moment->roll, slot, hx_cross(w, to_point));
  hx_store(&moment->delta[slot], kin->delta);
  hx_store(&moment->ddelta[slot], kin->ddelta);
}

/* Stores a row of contacts on the tibias. */
HX_INLINE void row_moment(const hxModel *model, const hxContactState *state,
                          const hxPlantMotion *motion, const hxKnown *known, int row, int slot,
                          int all, const hxBody *tibia, hxMoment *moment) {
  const hxContactKinematics kin =
      hx_tibia_contact(model, state, motion, known, row, slot, all, tibia);
  store_contact_moment(model, &kin, row, slot, hx_link_vec3(motion, HX_JOINTS - 1, HX_R, slot),
                       tibia->w, &moment->contact[row]);
}

HX_RARE void further_moments(const hxModel *model, const hxContactState *state,
                             const hxPlantMotion *motion, const hxKnown *known, int slot, int all,
                             const hxBody *tibia, hxMoment *moment) {
  for (int k = 1; k < model->rows; ++k)
    row_moment(model, state, motion, known, model->row[k], slot, all, tibia, moment);
}

/* Returns the depths of a row of contacts of bodies with centres of mass r, on a grid at most. */
HX_INLINE hxReal depth_bound(const hxModel *model, int row, int slot, hxVec3 r,
                             const hxMat3 *R_WB) {
  const hxVec3 point = hx_add3(r, hx_mul(*R_WB, hx_load_vec3(model->point_B[row], slot)));
  if (model->terrain_kind == HX_TERRAIN_GRID) return hx_grid_depth_bound(model, row, &point);
  return model->radius[row] - hx_ground(model, NULL, row, slot, 0, point, NULL).distance;
}

/* Returns the largest of these of knees and shanks, from the centre of mass of their tibias. */
HX_INLINE hxReal tibia_depth_bound(const hxModel *model, const hxPlantMotion *motion, int slot,
                                   const hxMat3 *R_WB, hxReal largest) {
  const hxVec3 r = hx_link_vec3(motion, HX_JOINTS - 1, HX_R, slot);
  for (int k = model->foot_rows; k < model->rows; ++k)
    largest = hx_max(largest, depth_bound(model, model->row[k], slot, r, R_WB));
  return largest;
}

/* Returns the largest of these of the torso's points. */
HX_INLINE hxReal torso_depth_bound(const hxModel *model, const hxPlantMotion *motion,
                                   const hxMat3 *R_WB, hxReal largest) {
  const hxVec3 r = hx_torso_vec3(motion, HX_R);
  for (int slot = 0; slot < HX_SLOTS; slot += HX_LANES)
    largest = hx_max(largest, depth_bound(model, HX_TORSO, slot, r, R_WB));
  return largest;
}

/* Stores the torso's contacts. */
HX_RARE void torso_moment(const hxModel *model, const hxContactState *state,
                          const hxPlantMotion *motion, int all, const hxBody *torso,
                          hxMoment *moment) {
  for (int slot = 0; slot < HX_SLOTS; slot += HX_LANES) {
    const hxContactKinematics kin = hx_torso_contact(model, state, motion, slot, all, torso);
    store_contact_moment(model, &kin, HX_TORSO, slot, hx_torso_vec3(motion, HX_R), torso->w,
                         &moment->contact[HX_TORSO]);
  }
}

/* Computes the shares of feet on blocks. Slots past the last leg mirror leg 0 here too, since only
 * some kernels have them. */
HX_RARE void hx_moment_shares(const hxModel *model, const hxContactState *state, hxMoment *moment) {
  hxNumber share[HX_FOOT_ROWS];
  for (int row = HX_FOOT; row < HX_FOOT_ROWS; ++row)
    for (int slot = 0; slot < HX_SLOTS; ++slot) moment->share[row][slot] = 1.0;
  for (int slot = 0; slot < HX_LEGS; ++slot) {
    hxFootFace face[HX_FOOT_ROWS];
    if (!hx_has_several(state, slot)) continue;
    for (int row = HX_FOOT; row < HX_FOOT_ROWS; ++row) {
      const hxContactMoment *at = &moment->contact[row];
      face[row] = (hxFootFace){at->delta[slot],
                               {at->normal[0][slot], at->normal[1][slot], at->normal[2][slot]}};
    }
    hx_foot_shares(model, state, slot, face, share);
    for (int row = HX_FOOT; row < HX_FOOT_ROWS; ++row) moment->share[row][slot] = share[row];
  }
  for (int row = HX_FOOT; row < HX_FOOT_ROWS; ++row)
    for (int slot = HX_LEGS; slot < HX_SLOTS; ++slot)
      moment->share[row][slot] = moment->share[row][0];
}

/* Stores the contacts between legs at one end of a step. */
HX_RARE void hx_pair_moments(const hxModel *model, const hxPlantMotion *motion, hxMoment *moment) {
  hxLegLines own, next;
  leg_lines(model, motion, &own, &next);
  for (int row = HX_PAIR; row < HX_ROWS; ++row)
    for (int slot = 0; slot < HX_PACKS * HX_LANES; slot += HX_LANES) {
      hxContactMoment *to = &moment->contact[row];
      hxVec3 next_arm;
      const hxContactKinematics kin = pair_contact(model, &own, &next, row, slot, &next_arm);
      hx_store_vec3(to->centre, slot, hx_add3(chain_point(own.r[own_line(row)], slot), kin.arm));
      hx_store_vec3(to->normal, slot, kin.normal);
      hx_store_vec3(to->slip, slot, hx_add_scaled(kin.velocity, kin.ddelta, kin.normal));
      hx_store_vec3(to->roll, slot, hx_zero3());
      hx_store(&to->delta[slot], kin.delta);
      hx_store(&to->ddelta[slot], kin.ddelta);
    }
}

/* Returns the largest depths of contacts between legs, m, legs in lanes. */
HX_RARE hxReal hx_deepest_pair(const hxModel *model, const hxPlantMotion *motion) {
  hxLegLines own, next;
  hxReal deepest = hx_splat(-HUGE_VAL);
  leg_lines(model, motion, &own, &next);
  for (int row = HX_PAIR; row < HX_ROWS; ++row)
    for (int slot = 0; slot < HX_PACKS * HX_LANES; slot += HX_LANES) {
      hxVec3 next_arm;
      deepest = hx_max(deepest, pair_contact(model, &own, &next, row, slot, &next_arm).delta);
    }
  return deepest;
}

/* Computes angles, speeds and contacts of a motion, on a grid those that `all` says. With `whole`,
 * the model whose rows of bodies `model` leaves out, it returns the largest depth that one of their
 * contacts may have, m. `nodes`: as in hxKnown. */
static inline double hx_moment_and_bound(const hxModel *model, const hxModel *whole,
                                         const hxContactState *state, const hxPlantMotion *motion,
                                         int all, hxPatchNodes *nodes, hxMoment *moment) {
  const hxKnown known = {.nodes = nodes};
  const hxBody torso = hx_torso_body(motion);
  hxReal bound = hx_splat(-HUGE_VAL);
  for (int slot = 0; slot < HX_PACKS * HX_LANES; slot += HX_LANES) {
    hxBody i = torso, j = torso;
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxJointModel *m = &model->joint[joint];
      hxReal sine, cosine;
      i = j;
      j = hx_link_body(motion, joint, slot);
      hx_joint_half_angle(m, slot, hx_parent_quat(motion, joint, slot),
                          hx_link_quat(motion, joint, slot), &sine, &cosine);
      hx_store(&moment->angle[joint][slot], hx_angle_from_half(sine, cosine));
      const hxMat3 R_Wi = i.R_WB;
      const hxVec3 s = hx_mul(R_Wi, hx_load_vec3(m->s_i, slot));
      hx_store(&moment->speed[joint][slot], hx_dot(s, hx_sub3(j.w, i.w)));
    }
    hx_store_vec3(moment->w, slot, j.w);
    row_moment(model, state, motion, &known, HX_FOOT, slot, all, &j, moment);
    if (model->rows > 1) further_moments(model, state, motion, &known, slot, all, &j, moment);
    if (whole) bound = tibia_depth_bound(whole, motion, slot, &j.R_WB, bound);
  }
  if (model->foot_rows > 1) hx_moment_shares(model, state, moment);
  if (model->torso_rows) torso_moment(model, state, motion, all, &torso, moment);
  if (whole && whole->torso_rows) bound = torso_depth_bound(whole, motion, &torso.R_WB, bound);
  if (model->pair_rows) hx_pair_moments(model, motion, moment);
  if (whole && whole->pair_rows) bound = hx_max(bound, hx_deepest_pair(whole, motion));
  moment->stale = 0.0;
  return hx_largest_lane(bound);
}

/* Computes the same without a bound. */
static inline void hx_moment_of(const hxModel *model, const hxContactState *state,
                                const hxPlantMotion *motion, hxMoment *moment) {
  hx_moment_and_bound(model, NULL, state, motion, HX_NEAR, NULL, moment);
}

/* Copies a moment, of contacts those of the model's rows. */
static inline void hx_copy_moment(const hxModel *model, hxMoment *to, const hxMoment *from) {
  memcpy(to, from, offsetof(hxMoment, contact[1]));
  for (int k = 1; k < model->listed; ++k) to->contact[model->row[k]] = from->contact[model->row[k]];
  if (model->foot_rows > 1) memcpy(to->share, from->share, sizeof to->share);
}

/* Copies the places of feet, and of bodies where the ground has materials, and computes how
 * far feet are outside of their cells. */
HX_RARE void places_on_grid(const hxModel *model, const hxContactState *state,
                            const hxMoment *moment, hxDepths *depths) {
  const int cells = hx_has_cells(model), materials = model->terrain->material != NULL;
  const hxNumber(*foot)[HX_SLOTS] = moment->contact[HX_FOOT].centre;
  memcpy(depths->centre[HX_FOOT], foot, sizeof depths->centre[HX_FOOT]);
  for (int k = 1; materials && k < model->rows + model->torso_rows; ++k)
    memcpy(depths->centre[model->row[k]], moment->contact[model->row[k]].centre,
           sizeof depths->centre[HX_FOOT]);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double centre[3] = {foot[0][leg], foot[1][leg], foot[2][leg]},
                 cell[2] = {state->cell[0][leg], state->cell[1][leg]};
    depths->outside[leg] =
        cells && cell[0] >= 0.0 ? hx_terrain_outside(model->terrain, centre, cell) : -hx_far;
  }
}

/* Copies approach speeds and penetrations, those of feet below the depth where they touch soil. */
static inline void hx_depths_of_moment(const hxModel *model, const hxContactState *state,
                                       const hxMoment *moment, hxDepths *depths) {
  for (int k = 0; k < model->listed; ++k) {
    const hxContactMoment *contact = &moment->contact[model->row[k]];
    memcpy(depths->delta[model->row[k]], contact->delta, sizeof contact->delta);
    memcpy(depths->ddelta[model->row[k]], contact->ddelta, sizeof contact->ddelta);
  }
  for (int slot = 0; model->has_soil && slot < HX_SLOTS; ++slot)
    depths->delta[HX_FOOT][slot] -= state->plastic[slot];
  if (model->terrain) places_on_grid(model, state, moment, depths);
}

/* Sets the state's moment from its motion and time. */
static inline void hx_moment_update(const hxModel *model, hxState *state) {
  hx_moment_of(model, &state->contact, &state->motion, &state->moment);
  state->moment.time = state->time;
}

/* Resets the peaks, which are those of one call. */
static inline void hx_reset_peaks(hxMeasured *measured) {
  memset(measured->peak_force, 0, sizeof measured->peak_force);
  memset(measured->peak_rate, 0, sizeof measured->peak_rate);
}

/* Copies leg 0 into the unused slots of the first lines of a structure. */
static inline void fill_lines(void *structure, size_t lines) {
  double *first = structure;
  for (size_t line = 0; line < lines; ++line) hx_fill_slots(&first[line * HX_SLOTS]);
}

/* Copies leg 0 into the unused slots of the last step's end. */
static inline void hx_fill_moment_slots(const hxModel *model, hxState *state) {
  fill_lines(&state->moment, HX_MOMENT_LINES);
  for (int k = 0; k < model->listed; ++k)
    if (model->row[k] != HX_TORSO)
      fill_lines(&state->moment.contact[model->row[k]], HX_CONTACT_LINES);
}

/* Copies leg 0 into the unused slots of all measurements. */
static inline void hx_fill_measured_slots(const hxModel *model, hxState *state) {
  hx_fill_moment_slots(model, state);
  fill_lines(&state->measured, HX_MEASURED_LINES);
}

/* Sets whether each foot is in contact with the ground, by any of its rows. */
static inline void feet_on_ground(const hxModel *model, const hxContactState *contact,
                                  int in_contact[HX_SLOTS]) {
  for (int slot = 0; slot < HX_SLOTS; ++slot) {
    in_contact[slot] = 0;
    for (int k = 0; k < model->foot_rows; ++k)
      in_contact[slot] |= contact->closed[model->row[k]][slot] != 0.0;
  }
}

/* Starts the measurement of a landing at time t. */
static inline void start_landing(int slot, double t, hxMeasured *measured) {
  measured->landings[slot] += 1.0;
  measured->landed_at[slot] = t;
  measured->landing_left[slot] = LANDING_SAMPLES;
  measured->landing_rate[slot] = 0.0;
  for (int i = 0; i < HX_RISE_SAMPLES; ++i) measured->landing_force[i][slot] = 0.0;
}

/* Switches the contacts that are due at time t, records footprints and starts the measurement of
 * landings; returns whether contacts switched. Depths are relative to those at which they
 * touch the ground; `at` is the moment of time t. */
static inline int hx_switch_contacts(const hxModel *model, hxDepths *depths, double t,
                                     const hxMoment *at, hxFootprintLog *footprints,
                                     hxState *state) {
  if (model->has_soil) hx_soil_switch(model, at, depths, footprints, &state->contact);
  if (!hx_contact_is_due(model, depths, &state->contact)) return 0;
  int before[HX_SLOTS], after[HX_SLOTS];
  const hxContactState was = state->contact;
  state->touchdowns += hx_contact_switch(model, depths, &state->contact);
  if (model->foot_rows > 1) hx_contact_continue_impacts(model, at, &was, &state->contact);
  feet_on_ground(model, &was, before);
  feet_on_ground(model, &state->contact, after);
  for (int slot = 0; slot < HX_SLOTS; ++slot)
    if (after[slot] && !before[slot]) start_landing(slot, t, &state->measured);
  if (has_bristles(model, HX_FOOT)) hx_contact_slacken(&state->contact, &state->motion);
  return 1;
}

/* Hands the contacts of feet that have left their cells over to the rows that they continue in;
 * depths and moment become those over the new cells. */
HX_RARE void hx_cross_cells(const hxModel *model, hxDepths *depths, hxState *state) {
  const int crossed = hx_contact_cross(model, depths, &state->contact);
  if (!crossed) return;
  const hxMoment before = state->moment;
  hx_moment_of(model, &state->contact, &state->motion, &state->moment);
  hx_contact_hand_over(&before, &state->moment, crossed, &state->contact);
  hx_moment_shares(model, &state->contact, &state->moment);
  if (has_bristles(model, HX_FOOT)) hx_contact_slacken(&state->contact, &state->motion);
  hx_depths_of_moment(model, &state->contact, &state->moment, depths);
}

#endif
