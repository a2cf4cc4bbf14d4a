/* measure.h - measurements of a step: works and losses of joints and contacts; slip, impulses and
 * peaks of feet
 *
 * Works and losses are the impulses of the step's forces times the mean of the speeds at its ends
 * (eq. 27), so that they equal the change of kinetic energy. Other integrals follow the step's
 * path between its ends (hxMoment, eq. 28): angles and depths are cubics through values and rates,
 * sliding velocities are parabolas through values and mean. The loading rate of a landing is taken
 * over a millisecond (eq. 29), because the force's derivative jumps with every command. The
 * results do not depend on how often outputs are read.
 */
#ifndef HX_MEASURE_H
#define HX_MEASURE_H

#include "../contact_law.h"
#include "clearance.h"
#include "dynamics.h"
#include "soil_path.h"

static const double landing_sample = 1e-4; /* s  between two samples of a landing's force */
static const double nearly_sliding = 0.9;  /* 1  of the friction cone */
static const double shortest_bend = 1e-7;  /* s  shorter steps: differences are rounding errors */

/* Nodes of a step at which forces are evaluated, and Simpson's weights: feet use all nodes, motors
 * every second one. */
enum { INTERVALS = 4, MOTOR_STRIDE = 2 };
enum { LANDING_SAMPLES = 200 }; /* samples of a landing, which lasts 20 ms */
static const double foot_weight[INTERVALS + 1] = {1.0 / 12, 4.0 / 12, 2.0 / 12, 4.0 / 12, 1.0 / 12};
static const double motor_weight[INTERVALS + 1] = {1.0 / 6, 0.0, 4.0 / 6, 0.0, 1.0 / 6};

/* Works and losses of a step, J, legs in lanes. */
typedef struct {
  hxReal motor[HX_JOINTS][HX_PACKS];
  hxReal mean_torque[HX_JOINTS][HX_PACKS];                      /* N m  of the motors */
  hxReal contact[HX_PACKS], friction[HX_PACKS], gear[HX_PACKS]; /* of all rows on the tibias */
  hxNumber torso_contact, torso_friction;
} hxStepWorks;

/* A step between two moments. */
typedef struct {
  const hxModel *model;
  const hxContactState *contact;           /* contacts during the step */
  const hxCommand *command[INTERVALS + 1]; /* commands at its nodes */
  double t, h;                             /* s  start and length */
  const hxMoment *from, *to;
  double plastic[HX_SOIL_ROWS][HX_SLOTS]; /* m  plastic depths at its end; set with soil */
  const hxSoilEnds *ends;                 /* set with soil */
} hxPath;

/* ---- moments ---- */

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

/* Contacts whose place on a grid is computed, of a pack of feet: with the ground below them, and
 * with walls beside them; of the tibia's other points. */
typedef struct {
  int below, beside, others;
} hxSearch;

/* Stores a row of walls that no foot touches: its face is far above the level one below the feet,
 * so that all but the depth is that of the feet's first row. */
static inline void far_row_moment(const hxModel *model, int row, int slot, hxMoment *moment) {
  const double *from = (const double *)&moment->contact[HX_FOOT];
  double *to = (double *)&moment->contact[row];
  for (int line = 0; line < HX_CONTACT_LINES; ++line)
    hx_store(&to[line * HX_SLOTS + slot], hx_load(&from[line * HX_SLOTS + slot]));
  hx_store(&moment->contact[row].delta[slot], hx_splat(model->radius[row] - hx_far));
}

HX_RARE void further_moments(const hxModel *model, const hxContactState *state,
                             const hxPlantMotion *motion, int slot, const hxSearch *search,
                             const hxBody *tibia, hxMoment *moment) {
  for (int k = 1; k < model->rows; ++k) {
    const int row = model->row[k], is_of_foot = hx_is_of_foot(row);
    if (is_of_foot && search->beside == HX_CLOSED && !is_used(state, row, slot))
      far_row_moment(model, row, slot, moment);
    else
      row_moment(model, state, motion, NULL, row, slot,
                 is_of_foot ? search->beside : search->others, tibia, moment);
  }
}

/* Returns whether a place, in cells from a cell's corner, is not over the cell. */
static inline int is_off_cell(double x, double y) {
  return x < 0.0 || x > 1.0 || y < 0.0 || y > 1.0;
}

/* Leaves out the search of contacts that feet on blocks certainly do not have: those of open feet
 * that are higher than the ground around them, and walls where no block around a foot is higher
 * than that on which it stands. */
HX_RARE void search_near_blocks(const hxModel *model, const hxContactState *state, int slot,
                                const hxVec3 *centre, hxSearch *search) {
  const hxTerrain *terrain = model->terrain;
  const double per_cell = terrain->per_cell, reach = HX_LEAST_REACH * per_cell;
  const hxReal x = (centre->x - terrain->head.x0) * per_cell,
               y = (centre->y - terrain->head.y0) * per_cell;
  double low[2][HX_LANES], high[2][HX_LANES], z[HX_LANES];
  if (!(model->radius[HX_FOOT] < 0.9 * HX_LEAST_REACH && terrain->head.cell >= HX_LEAST_REACH))
    return;
  hx_store(low[0], x - reach), hx_store(high[0], x + reach);
  hx_store(low[1], y - reach), hx_store(high[1], y + reach);
  hx_store(z, centre->z - model->ground_point[2]);
  int below = 0, beside = 0;
  for (int lane = 0; lane < HX_LANES && slot + lane < HX_LEGS; ++lane) {
    const double ends[4] = {low[0][lane], high[0][lane], low[1][lane], high[1][lane]};
    const double around = hx_terrain_top_between(terrain, ends), col = state->cell[0][slot + lane],
                 own = col >= 0.0 ? hx_terrain_column(terrain, col, state->cell[1][slot + lane])
                                  : around; /* a foot may have left its block in its print */
    if (z[lane] - hx_higher_of(around, own) >= HX_LEAST_REACH) continue;
    below |= (state->closed[HX_FOOT][slot + lane] == 0.0) << lane;
    /* the walls of a block go on beside it for a foot that was dragged off it */
    const int is_off =
        model->has_soil &&
        is_off_cell(low[0][lane] + reach - col, low[1][lane] + reach - state->cell[1][slot + lane]);
    beside |= !(col >= 0.0) || around > own || is_off ? 1 << lane : 0;
  }
  search->below = hx_listed(below), search->beside = hx_listed(beside);
}

/* Returns the depths of a row of contacts of bodies with centres of mass r, on a grid at most. */
HX_INLINE hxReal depth_bound(const hxModel *model, int row, int slot, hxVec3 r, const hxMat3 *R) {
  const hxVec3 point = hx_add3(r, hx_mul(*R, hx_load_vec3(model->point[row], slot)));
  if (model->terrain_kind == HX_TERRAIN_GRID) return hx_grid_depth_bound(model, row, &point);
  return model->radius[row] - hx_ground(model, NULL, row, slot, 0, point, NULL).distance;
}

/* Returns the largest of these of knees and shanks, from the centre of mass of their tibias. */
HX_INLINE hxReal tibia_depth_bound(const hxModel *model, const hxPlantMotion *motion, int slot,
                                   const hxMat3 *R, hxReal largest) {
  const hxVec3 r = hx_link_vec3(motion, HX_JOINTS - 1, HX_R, slot);
  for (int k = model->foot_rows; k < model->rows; ++k)
    largest = hx_max(largest, depth_bound(model, model->row[k], slot, r, R));
  return largest;
}

/* Returns the largest of these of the torso's points. */
HX_INLINE hxReal torso_depth_bound(const hxModel *model, const hxPlantMotion *motion,
                                   const hxMat3 *R, hxReal largest) {
  const hxVec3 r = hx_torso_vec3(motion, HX_R);
  for (int slot = 0; slot < HX_SLOTS; slot += HX_LANES)
    largest = hx_max(largest, depth_bound(model, HX_TORSO, slot, r, R));
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

/* Computes the shares of feet on blocks. */
HX_RARE void hx_moment_shares(const hxModel *model, const hxContactState *state, hxMoment *moment) {
  hxNumber share[HX_FOOT_ROWS];
  for (int row = HX_FOOT; row < HX_FOOT_ROWS; ++row)
    for (int slot = 0; slot < HX_SLOTS; ++slot) moment->share[row][slot] = 1.0;
  for (int slot = 0; slot < HX_SLOTS; ++slot) {
    hxFootFace face[HX_FOOT_ROWS];
    if (!hx_has_several(state, slot)) continue;
    for (int row = HX_FOOT; row < HX_FOOT_ROWS; ++row) {
      const hxContactMoment *at = &moment->contact[row];
      face[row] = (hxFootFace){at->delta[slot],
                               {at->normal[0][slot], at->normal[1][slot], at->normal[2][slot]}};
    }
    hx_foot_shares(model, state, slot < HX_LEGS ? slot : 0, face, share);
    for (int row = HX_FOOT; row < HX_FOOT_ROWS; ++row) moment->share[row][slot] = share[row];
  }
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
      const hxVec3 s = hx_mul(i.R_WB, hx_load_vec3(m->s_i, slot));
      hx_store(&moment->speed[joint][slot], hx_dot(s, hx_sub3(j.w, i.w)));
    }
    hx_store_vec3(moment->turn, slot, j.w);
    hxSearch search = {all, all, all};
    if (all == HX_NEAR && model->foot_rows > 1) {
      const hxVec3 centre = hx_add3(hx_link_vec3(motion, HX_JOINTS - 1, HX_R, slot),
                                    hx_mul(j.R_WB, hx_load_vec3(model->point[HX_FOOT], slot)));
      search_near_blocks(model, state, slot, &centre, &search);
    }
    row_moment(model, state, motion, &known, HX_FOOT, slot, search.below, &j, moment);
    if (model->rows > 1) further_moments(model, state, motion, slot, &search, &j, moment);
    if (whole) bound = tibia_depth_bound(whole, motion, slot, &j.R_WB, bound);
  }
  if (model->foot_rows > 1) hx_moment_shares(model, state, moment);
  if (model->torso_rows) torso_moment(model, state, motion, all, &torso, moment);
  if (whole && whole->torso_rows) bound = torso_depth_bound(whole, motion, &torso.R_WB, bound);
  if (model->pair_rows) hx_pair_moments(model, motion, moment);
  if (whole && whole->pair_rows) bound = hx_max(bound, hx_deepest_pair(whole, motion));
  moment->stale = 0.0;
  if (model->elastic) {
    memcpy(moment->deflection, motion->deflection, sizeof moment->deflection);
    memcpy(moment->motor_speed, motion->motor_speed, sizeof moment->motor_speed);
  }
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
  if (model->elastic) hx_copy_gears(to, from);
}

/* Returns whether a foot in soil or above the bottom of its print is over a block that is not level
 * with its own: it was dragged there in its print. It keeps its block until it has left the print
 * upwards, so that no edge meets it at the depth of its print. */
HX_RARE int keeps_block(const hxModel *model, const hxContactState *state, int leg,
                        const double centre[3]) {
  double cell[2];
  if (!is_in_soil(state, HX_FOOT, leg) && !(state->plastic[hx_soil_row(HX_FOOT)][leg] > 0.0))
    return 0;
  hx_terrain_cell_at(model->terrain, centre, cell);
  return hx_terrain_column(model->terrain, cell[0], cell[1]) !=
         hx_terrain_column(model->terrain, state->cell[0][leg], state->cell[1][leg]);
}

/* Copies the places of feet, and of bodies where the ground has materials or soil, and computes how
 * far feet are outside of their cells. */
HX_RARE void places_on_grid(const hxModel *model, const hxContactState *state,
                            const hxMoment *moment, hxDepths *depths) {
  const int cells = hx_has_cells(model), materials = model->terrain->material || model->has_soil;
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
    if (depths->outside[leg] > 0.0 && model->has_soil && keeps_block(model, state, leg, centre))
      depths->outside[leg] = -hx_far;
  }
}

/* Copies penetration and approach speed of all contacts. */
static inline void hx_depths_of_moment(const hxModel *model, const hxContactState *state,
                                       const hxMoment *moment, hxDepths *depths) {
  for (int k = 0; k < model->listed; ++k) {
    const hxContactMoment *contact = &moment->contact[model->row[k]];
    memcpy(depths->delta[model->row[k]], contact->delta, sizeof contact->delta);
    memcpy(depths->ddelta[model->row[k]], contact->ddelta, sizeof contact->ddelta);
  }
  if (model->has_soil) hx_depths_on_soil(model, state, depths);
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

/* Copies leg 0 into the unused slots of integrals and peaks. */
static inline void hx_fill_integral_slots(hxState *state) {
  fill_lines(&state->measured, HX_MEASURED_LINES);
}

/* Copies leg 0 into the unused slots of all measurements. */
static inline void hx_fill_measured_slots(const hxModel *model, hxState *state) {
  hx_fill_moment_slots(model, state);
  hx_fill_integral_slots(state);
}

/* Sets whether each foot touches the ground, by any of its rows. */
static inline void feet_on_ground(const hxModel *model, const hxContactState *contact,
                                  int touches[HX_SLOTS]) {
  for (int slot = 0; slot < HX_SLOTS; ++slot) {
    touches[slot] = 0;
    for (int k = 0; k < model->foot_rows; ++k)
      touches[slot] |= contact->closed[model->row[k]][slot] != 0.0;
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

/* Finds the side of the torso's box that faces the ground at each corner. */
HX_RARE void hx_torso_sides(const hxPlantMotion *motion, const hxMoment *at, hxDepths *depths) {
  const hxMat3 R_WB = hx_torso_body(motion).R_WB;
  const hxNumber(*normal)[HX_SLOTS] = at->contact[HX_TORSO].normal;
  for (int slot = 0; slot < HX_SLOTS; ++slot) {
    const hxVec3 n = hx_splat_vec3((hxNumber[]){normal[0][slot], normal[1][slot], normal[2][slot]});
    const hxVec3 n_B = hx_tmul(R_WB, n);
    const double x = fabs(hx_re(hx_lane(n_B.x, 0))), y = fabs(hx_re(hx_lane(n_B.y, 0))),
                 z = fabs(hx_re(hx_lane(n_B.z, 0)));
    const int side = y > x ? 1 : 0;
    depths->side[slot] = z > fmax(x, y) ? 2 : side;
  }
}

/* Switches the contacts that are due at time t, records footprints and starts the measurement of
 * landings; returns whether contacts switched. Depths are relative to those at which they
 * touch the ground; `at` is the moment of time t. */
static inline int hx_switch_contacts(const hxModel *model, hxDepths *depths, double t,
                                     const hxMoment *at, hxFootprintLog *footprints,
                                     hxState *state) {
  if (model->has_soil) hx_soil_switch(model, at, depths, footprints, &state->contact);
  if (!hx_contact_is_due(model, depths, &state->contact)) return 0;
  if (model->has_soil && model->torso_rows) hx_torso_sides(&state->motion, at, depths);
  int before[HX_SLOTS], after[HX_SLOTS];
  feet_on_ground(model, &state->contact, before);
  if (model->foot_rows > 1) {
    const hxContactState was = state->contact;
    state->touchdowns += hx_contact_switch(model, depths, &state->contact);
    hx_contact_continue_impacts(model, at, &was, &state->contact);
  } else {
    state->touchdowns += hx_contact_switch(model, depths, &state->contact);
  }
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

/* ---- works and losses (eq. 27) ---- */

/* Returns the mean of two values. */
static inline hxReal mean_of(const double *from, const double *to) {
  return 0.5 * (hx_load(from) + hx_load(to));
}

static inline hxVec3 mean_vec3(const double (*from)[HX_SLOTS], const double (*to)[HX_SLOTS],
                               int slot) {
  return hx_scale(hx_splat(0.5), hx_add3(hx_load_vec3(from, slot), hx_load_vec3(to, slot)));
}

/* Returns whether the feet of a step's path share forces among their rows. */
static inline int has_shares(const hxPath *path, int row) {
  return path->model->foot_rows > 1 && hx_is_of_foot(row);
}

/* Returns the elastic energy 2/5 K delta^(5/2) of closed contacts, J. */
static inline hxReal stored_in_contact(hxContactLawAt law, const double *delta) {
  const hxReal depth = hx_max(hx_load(delta), hx_splat(0.0));
  return law.closed * (0.4 * law.stiffness) * (depth * depth) * hx_sqrt(depth);
}

/* Returns the approach velocity ddelta n. */
static inline hxVec3 approach_of(const hxContactMoment *moment, int slot) {
  return hx_scale(hx_load(&moment->ddelta[slot]),
                  hx_load_vec3((const double (*)[HX_SLOTS])moment->normal, slot));
}

/* Returns the growth of the energy stored in a row of contacts, in soil where they touched down on
 * it, J. */
HX_RARE hxReal growth_with_soil(const hxPath *path, int row, int slot, hxReal rigid) {
  const hxContactState *state = path->contact;
  const int soft = hx_soil_row(row);
  const hxMask in = hx_in_soil(state, row, slot);
  if (!hx_any(in)) return rigid;
  const hxSoils soil = hx_soils_under(state, row, slot);
  const hxReal from = hx_load(&path->from->contact[row].delta[slot]),
               to = hx_load(&path->to->contact[row].delta[slot]);
  const int pack = slot / HX_LANES, is_foot = row == HX_FOOT;
  const hxSoilCurves virgin_from = is_foot ? path->ends->from[pack] : hx_virgin(&soil, from),
                     virgin_to = is_foot ? path->ends->to[pack] : hx_virgin(&soil, to);
  return hx_select(
      in,
      hx_stored_energy(&soil, hx_load(&path->plastic[soft][slot]), to, virgin_to) -
          hx_stored_energy(&soil, hx_load(&state->plastic[soft][slot]), from, virgin_from),
      rigid);
}

/* Computes what a row of contacts and its friction lose in a step with these impulses (eq. 27). */
HX_INLINE void contact_works(const hxPath *path, int row, int slot, hxVec3 impulse, hxReal *contact,
                             hxReal *friction) {
  const hxContactMoment *from = &path->from->contact[row], *to = &path->to->contact[row];
  const hxContactLawAt law = hx_law_at(path->contact, row, slot);
  const hxVec3 slip = mean_vec3(from->slip, to->slip, slot);
  const hxVec3 approach =
      hx_scale(hx_splat(0.5), hx_add3(approach_of(from, slot), approach_of(to, slot)));
  const hxReal taken = hx_dot(impulse, approach);
  hxReal before = stored_in_contact(law, &from->delta[slot]),
         after = stored_in_contact(law, &to->delta[slot]);
  if (has_shares(path, row)) {
    before *= hx_load(&path->from->share[row][slot]);
    after *= hx_load(&path->to->share[row][slot]);
  }
  hxReal stored = after - before;
  if (has_soil(path->model, row)) stored = growth_with_soil(path, row, slot, stored);
  *contact = taken - stored;
  *friction = -hx_dot(impulse, slip);
}

HX_RARE void add_further_works(const hxPath *path, int pack, const hxImpulses *impulse,
                               hxStepWorks *works) {
  for (int k = 1; k < path->model->rows; ++k) {
    const int row = path->model->row[k];
    hxReal contact, friction;
    contact_works(path, row, pack * HX_LANES, impulse->contact[row][pack], &contact, &friction);
    works->contact[pack] += contact, works->friction[pack] += friction;
  }
}

/* Sums the losses of the torso's contacts. */
HX_RARE void torso_works(const hxPath *path, const hxImpulses *impulse, hxStepWorks *works) {
  hxReal contact[HX_TORSO_PACKS], friction[HX_TORSO_PACKS];
  for (int pack = 0; pack < HX_TORSO_PACKS; ++pack)
    contact_works(path, HX_TORSO, pack * HX_LANES, impulse->torso[pack], &contact[pack],
                  &friction[pack]);
  works->torso_contact = hx_sum_slots(contact);
  works->torso_friction = hx_sum_slots(friction);
}

/* Adds the losses of contacts between legs. */
HX_RARE void add_pair_works(const hxPath *path, const hxImpulses *impulse, hxStepWorks *works) {
  for (int row = HX_PAIR; row < HX_ROWS; ++row)
    for (int pack = 0; pack < HX_PACKS; ++pack) {
      hxReal contact, friction;
      contact_works(path, row, pack * HX_LANES, impulse->pair[row - HX_PAIR][pack], &contact,
                    &friction);
      works->contact[pack] += contact, works->friction[pack] += friction;
    }
}

/* Returns the energy that a joint's stops store, J. */
static inline hxReal stored_in_stop(const hxModel *model, int joint, int slot, hxReal angle) {
  const hxReal x = hx_overrun(model, joint, slot, angle);
  return (0.5 * model->stop_stiffness) * (x * x);
}

/* Adds what the stops of a pack of legs lose in a step: their work on the joints less what they
 * store. */
HX_RARE void add_stop_works(const hxPath *path, const hxImpulses *impulse, int pack,
                            hxStepWorks *works) {
  const int slot = pack * HX_LANES;
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    const hxReal speed = mean_of(&path->from->speed[joint][slot], &path->to->speed[joint][slot]);
    const hxReal before = hx_load(&path->from->angle[joint][slot]),
                 after = hx_load(&path->to->angle[joint][slot]);
    const hxReal stored = stored_in_stop(path->model, joint, slot, after) -
                          stored_in_stop(path->model, joint, slot, before);
    works->gear[pack] -= impulse->stop[joint][pack] * speed + stored;
  }
}

/* Returns the mean of the rotor's speeds at both ends, which with a rigid gear are the joint's. */
static inline hxReal mean_motor_speed(const hxPath *path, int joint, int slot) {
  return path->model->elastic
             ? mean_of(&path->from->motor_speed[joint][slot], &path->to->motor_speed[joint][slot])
             : mean_of(&path->from->speed[joint][slot], &path->to->speed[joint][slot]);
}

/* Adds what the dampers of the elastic gears of a pack of legs lose in a step: the work on the
 * gears less what they store. */
HX_RARE void add_spring_works(const hxPath *path, const hxImpulses *impulse, int pack,
                              hxStepWorks *works) {
  const int slot = pack * HX_LANES;
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    const hxReal faster = mean_motor_speed(path, joint, slot) -
                          mean_of(&path->from->speed[joint][slot], &path->to->speed[joint][slot]);
    const hxReal before = hx_load(&path->from->deflection[joint][slot]),
                 after = hx_load(&path->to->deflection[joint][slot]);
    const hxReal stored = hx_gear_energy(path->model, after) - hx_gear_energy(path->model, before);
    works->gear[pack] += impulse->spring[joint][pack] * faster - stored;
  }
}

/* Adds what spin and rolling friction of a pack of feet lose in a step. */
HX_RARE void add_turning_works(const hxPath *path, const hxImpulses *impulse, int pack,
                               hxStepWorks *works) {
  const hxVec3 turn = mean_vec3(path->from->turn, path->to->turn, pack * HX_LANES);
  for (int k = 0; k < path->model->foot_rows; ++k)
    works->friction[pack] -= hx_dot(impulse->moment[path->model->row[k]][pack], turn);
}

/* Computes works and losses of a step from its impulses (eq. 27). */
static inline void hx_step_works(const hxPath *path, const hxImpulses *impulse,
                                 hxStepWorks *works) {
  const hxReal per_step = hx_splat(1.0 / path->h);
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const int slot = pack * HX_LANES;
    works->gear[pack] = hx_splat(0.0);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxReal speed = mean_motor_speed(path, joint, slot);
      works->motor[joint][pack] = impulse->motor[joint][pack] * speed;
      works->mean_torque[joint][pack] = impulse->motor[joint][pack] * per_step;
      works->gear[pack] -= impulse->gear[joint][pack] * speed;
    }
    contact_works(path, HX_FOOT, slot, impulse->contact[HX_FOOT][pack], &works->contact[pack],
                  &works->friction[pack]);
    if (path->model->rows > 1) add_further_works(path, pack, impulse, works);
    if (path->model->stops) add_stop_works(path, impulse, pack, works);
    if (path->model->elastic) add_spring_works(path, impulse, pack, works);
    if (has_turning_friction(path->model, HX_FOOT)) add_turning_works(path, impulse, pack, works);
  }
  works->torso_contact = works->torso_friction = 0.0;
  if (path->model->torso_rows) torso_works(path, impulse, works);
  if (path->model->pair_rows) add_pair_works(path, impulse, works);
}

/* ---- joints ---- */

/* Cubic through values and rates (per step) at both ends, x in [0, 1]: value, first and second
 * derivative. */
typedef struct {
  hxReal value, rate, second;
} hxCubic;

static inline hxCubic cubic(hxReal from, hxReal slope_from, hxReal rise, hxReal slope_to,
                            hxReal x) {
  const hxReal bend = slope_from + slope_to - 2.0 * rise, curve = rise - slope_from - bend;
  return (hxCubic){from + x * (slope_from + x * (curve + x * bend)),
                   slope_from + x * (2.0 * curve + (3.0 * x) * bend),
                   2.0 * curve + (6.0 * x) * bend};
}

/* Warms winding and housing of a joint's servo by the heat of a step, J (eq. 52), by the
 * trapezoidal rule: 2 C (T_m - T_0)/h = powers at the mean temperatures T_m. */
static inline void warm_servo(const hxPath *path, int joint, int slot, hxReal copper, hxReal gear,
                              hxMeasured *measured) {
  const hxHeat *heat = &path->model->heat;
  const double twice = 2.0 / path->h, g = heat->to_housing, k = heat->to_air;
  const double a = twice * heat->winding + g, b = twice * heat->housing + g + k;
  const double inverse = 1.0 / (a * b - g * g), per_step = 1.0 / path->h;
  const hxReal winding = hx_load(&measured->winding[joint][slot]),
               housing = hx_load(&measured->housing[joint][slot]);
  const hxReal of_winding = per_step * copper + (twice * heat->winding) * winding;
  const hxReal of_housing = per_step * gear + (twice * heat->housing) * housing + k * heat->air;
  const hxReal mean_winding = inverse * (b * of_winding + g * of_housing),
               mean_housing = inverse * (g * of_winding + a * of_housing);
  hx_store(&measured->winding[joint][slot], 2.0 * mean_winding - winding);
  hx_store(&measured->housing[joint][slot], 2.0 * mean_housing - housing);
}

/* Returns how fast a rotor behind an elastic gear turns at x in [0, 1], rad per step; rise: of the
 * joint's angle. */
HX_RARE hxReal motor_rate(const hxPath *path, int joint, int slot, hxReal rise, double x) {
  const hxReal h = hx_splat(path->h);
  const hxReal deflected =
      hx_load(&path->to->deflection[joint][slot]) - hx_load(&path->from->deflection[joint][slot]);
  return cubic(hx_splat(0.0), h * hx_load(&path->from->motor_speed[joint][slot]), rise + deflected,
               h * hx_load(&path->to->motor_speed[joint][slot]), hx_splat(x))
      .rate;
}

/* Measures one joint: positive and negative work, whose difference is the step's work, and the
 * integral of the squared torque, which it returns, N2 m2 s. */
static inline hxReal measure_joint(const hxPath *path, int joint, int slot, hxReal work,
                                   hxReal mean_torque, hxMeasured *measured) {
  const hxModel *model = path->model;
  const hxReal zero = hx_splat(0.0), h = hx_splat(path->h), per_step = hx_splat(1.0 / path->h);
  const hxReal angle = hx_load(&path->from->angle[joint][slot]),
               rise = within_turn(hx_load(&path->to->angle[joint][slot]) - angle);
  const hxReal slope_from = h * hx_load(&path->from->speed[joint][slot]),
               slope_to = h * hx_load(&path->to->speed[joint][slot]);
  hxReal positive = zero, negative = zero, squared = zero;
  for (int node = 0; node <= INTERVALS; node += MOTOR_STRIDE) {
    const hxCommand *command = path->command[node];
    const hxCubic q = cubic(angle, slope_from, rise, slope_to, hx_splat((double)node / INTERVALS));
    const hxReal speed =
        per_step *
        (model->elastic ? motor_rate(path, joint, slot, rise, (double)node / INTERVALS) : q.rate);
    const hxReal weight = hx_splat(path->h * motor_weight[node]);
    hxReal torque = mean_torque; /* a kinematic drive has no torque law */
    if (model->servo_mode != HX_SERVO_KINEMATIC)
      torque =
          hx_motor_torque(model, within_turn(q.value), speed, hx_load(&command->angle[joint][slot]),
                          hx_load(&command->speed[joint][slot]),
                          hx_load(&command->torque[joint][slot]), hx_power_of(command, joint, slot))
              .torque;
    positive += weight * hx_max(torque * speed, zero);
    negative += weight * hx_max(-(torque * speed), zero);
    squared += weight * (torque * torque);
  }
  /* the difference from the step's work goes to the larger part */
  const hxReal rest = work - (positive - negative);
  const hxMask drives = hx_less(negative, positive);
  positive += hx_select(drives, rest, zero);
  negative -= hx_select(drives, zero, rest);
  const hxReal below = hx_min(positive, negative); /* no part becomes negative */
  const hxReal excess = hx_min(below, zero);
  hx_store(&measured->positive_work[joint][slot],
           hx_load(&measured->positive_work[joint][slot]) + (positive - excess));
  hx_store(&measured->negative_work[joint][slot],
           hx_load(&measured->negative_work[joint][slot]) + (negative - excess));
  hx_store(&measured->torque_squared[joint][slot],
           hx_load(&measured->torque_squared[joint][slot]) + squared);
  return squared;
}

/* Warms the servos of a pack of legs; squared: integrals of their squared torques. */
HX_RARE void warm_servos(const hxPath *path, int pack, const hxImpulses *impulse,
                         const hxReal squared[HX_JOINTS], hxMeasured *measured) {
  const hxModel *model = path->model;
  const double per_square = model->resistance / (model->torque_constant * model->torque_constant);
  const int slot = pack * HX_LANES;
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    const hxReal speed = mean_motor_speed(path, joint, slot);
    const hxReal gear = -impulse->gear[joint][pack] * speed;
    warm_servo(path, joint, slot, per_square * squared[joint], gear, measured);
  }
}

/* ---- feet ---- */

/* Returns the velocity at x in [0, 1] by the parabola through both ends that has the given mean. */
static inline hxVec3 sliding(hxVec3 from, hxVec3 to, hxVec3 mean, double x) {
  const hxVec3 ends = hx_add_scaled(hx_scale(hx_splat(1.0 - x * (4.0 - 3.0 * x)), from),
                                    hx_splat(x * (3.0 * x - 2.0)), to);
  return hx_add_scaled(ends, hx_splat(6.0 * x * (1.0 - x)), mean);
}

/* Returns the part of a across the normal. */
static inline hxVec3 along_ground(hxVec3 a, hxVec3 normal) {
  return hx_add_scaled(a, -hx_dot(normal, a), normal);
}

/* Returns the share of an interval in which a linearly changing force exceeds a limit, and the
 * middle of that part. */
static inline hxReal share_above(hxReal from, hxReal to, double limit, hxReal *middle) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  const hxReal a = from - limit, b = to - limit;
  const hxReal crossing = hx_abs(a) / hx_max(hx_abs(a) + hx_abs(b), hx_splat(1e-300));
  const hxMask first = hx_less(zero, a), last = hx_less(zero, b);
  const hxReal low = hx_select(first, zero, hx_select(last, crossing, one));
  const hxReal high = hx_select(last, one, hx_select(first, crossing, low));
  *middle = 0.5 * (low + high);
  return high - low;
}

/* A contact of feet along a step, legs in lanes. */
typedef struct {
  hxVec3 slip_from, slip_to, mean_slip;     /* m/s */
  hxReal delta, slope_from, rise, slope_to; /* m  the cubic of the depth */
  hxReal share, share_rise;                 /* 1  on blocks */
  hxContactLawAt law;
  int row, slot;
} hxFootPath;

/* Returns the path of a row of feet. */
HX_INLINE hxFootPath foot_path(const hxPath *path, int row, int slot) {
  const hxContactMoment *from = &path->from->contact[row], *to = &path->to->contact[row];
  const hxReal h = hx_splat(path->h), per_step = hx_splat(1.0 / path->h);
  const hxVec3 way = hx_sub3(hx_load_vec3(to->centre, slot), hx_load_vec3(from->centre, slot));
  const hxVec3 along = along_ground(way, mean_vec3(from->normal, to->normal, slot));
  const hxReal delta = hx_load(&from->delta[slot]);
  const int shares = has_shares(path, row);
  const hxReal share = shares ? hx_load(&path->from->share[row][slot]) : hx_splat(1.0);
  return (hxFootPath){
      .slip_from = hx_load_vec3(from->slip, slot),
      .slip_to = hx_load_vec3(to->slip, slot),
      .mean_slip = hx_add3(hx_scale(per_step, along), mean_vec3(from->roll, to->roll, slot)),
      .delta = delta,
      .slope_from = h * hx_load(&from->ddelta[slot]),
      .rise = hx_load(&to->delta[slot]) - delta,
      .slope_to = h * hx_load(&to->ddelta[slot]),
      .share = share,
      .share_rise = shares ? hx_load(&path->to->share[row][slot]) - share : hx_splat(0.0),
      .law = hx_law_at(path->contact, row, slot),
      .row = row,
      .slot = slot};
}

/* Normal force of feet, its rate and the sliding speed at a point of a step. */
typedef struct {
  hxReal force, rate, speed;
} hxFootInstant;

/* Returns the virgin curves under feet at an end of a step, NULL within it. */
static inline const hxSoilCurves *virgin_at(const hxPath *path, int slot, double x) {
  return x == 0.0   ? &path->ends->from[slot / HX_LANES]
         : x == 1.0 ? &path->ends->to[slot / HX_LANES]
                    : NULL;
}

/* Computes them for a row of feet at x in [0, 1]. */
HX_INLINE hxFootInstant foot_at(const hxPath *path, const hxFootPath *foot, double x) {
  const hxReal per_step = hx_splat(1.0 / path->h);
  const hxReal bends = path->h < shortest_bend ? hx_splat(0.0) : per_step * per_step;
  const hxCubic depth =
      cubic(foot->delta, foot->slope_from, foot->rise, foot->slope_to, hx_splat(x));
  const hxReal approach = per_step * depth.rate;
  hxContactLawAt law = foot->law;
  if (has_shares(path, foot->row)) law.stiffness *= foot->share + x * foot->share_rise;
  hxNormalForce f = hx_normal_force(law, depth.value, approach);
  if (has_soil(path->model, foot->row))
    f = with_soil(path->contact, foot->slot, depth.value, approach, virgin_at(path, foot->slot, x),
                  f);
  const hxVec3 slip = sliding(foot->slip_from, foot->slip_to, foot->mean_slip, x);
  return (hxFootInstant){f.force, f.stiffness * approach + f.viscosity * (bends * depth.second),
                         hx_sqrt(hx_dot(slip, slip))};
}

/* Adds further closed contacts of the same feet; the sliding speed is that of the largest force. */
HX_RARE hxFootInstant with_further_feet(const hxPath *path, int slot, double x, hxFootInstant sum) {
  hxReal largest = sum.force;
  for (int k = 1; k < path->model->foot_rows; ++k) {
    if (!is_used(path->contact, path->model->row[k], slot)) continue;
    const hxFootPath foot = foot_path(path, path->model->row[k], slot);
    const hxFootInstant now = foot_at(path, &foot, x);
    sum.speed = hx_select(hx_less(largest, now.force), now.speed, sum.speed);
    largest = hx_max(largest, now.force);
    sum.force += now.force, sum.rate += now.rate;
  }
  return sum;
}

/* Measures one pack of feet: slip under load, impulse, peaks (eq. 28). */
HX_INLINE void measure_feet(const hxPath *path, int slot, hxMeasured *measured) {
  const hxModel *model = path->model;
  const hxReal zero = hx_splat(0.0), h = hx_splat(path->h);
  const hxFootPath foot = foot_path(path, HX_FOOT, slot);
  hxReal peak = hx_load(&measured->peak_force[slot]),
         steepest = hx_load(&measured->peak_rate[slot]);
  hxReal impulse = zero, slipped = zero;
  hxReal last_force = zero, last_speed = zero;
  /* impulse, peaks and slip under load by Simpson's rule (eq. 28) */
  for (int node = 0; node <= INTERVALS; ++node) {
    const double x = (double)node / INTERVALS;
    hxFootInstant now = foot_at(path, &foot, x);
    if (model->foot_rows > 1) now = with_further_feet(path, slot, x, now);
    peak = hx_max(peak, now.force);
    steepest = hx_max(steepest, now.rate);
    impulse += hx_splat(path->h * foot_weight[node]) * now.force;
    if (node > 0) {
      hxReal middle;
      const hxReal share = share_above(last_force, now.force, model->load_threshold, &middle);
      slipped += (h * (1.0 / INTERVALS)) * share * (last_speed + middle * (now.speed - last_speed));
    }
    last_force = now.force, last_speed = now.speed;
  }
  hx_store(&measured->peak_force[slot], peak);
  hx_store(&measured->peak_rate[slot], steepest);
  hx_store(&measured->impulse[slot], hx_load(&measured->impulse[slot]) + impulse);
  hx_store(&measured->slip_distance[slot], hx_load(&measured->slip_distance[slot]) + slipped);
}

/* Returns the shares of a leg's contact at x in [0, 1] of a step, samples in lanes. */
HX_INLINE hxReal share_within(const hxPath *path, int row, int leg, hxReal x) {
  const double from = path->from->share[row][leg], to = path->to->share[row][leg];
  return from + x * (to - from);
}

/* Returns the normal forces of a leg's contact with soil, N, samples in lanes. */
HX_RARE hxReal soil_within(const hxPath *path, int row, int leg, const hxReal *depth,
                           const hxReal *rate) {
  hxSoils soil;
  hxReal numbers[HX_SOIL_SIZE];
  const int soft = hx_soil_row(row);
  for (int i = 0; i < HX_SOIL_SIZE; ++i) numbers[i] = hx_splat(path->contact->soil[soft][i][leg]);
  memcpy(&soil, numbers, sizeof soil);
  return hx_soil_forces(&soil, hx_splat(path->contact->plastic[soft][leg]), *depth, *rate / path->h,
                        hx_virgin(&soil, *depth))
      .force;
}

/* Returns the normal forces of a leg's contact at x in [0, 1] of a step, N, samples in lanes. */
HX_INLINE hxReal force_within(const hxPath *path, int row, int leg, hxReal x) {
  const hxContactMoment *from = &path->from->contact[row], *to = &path->to->contact[row];
  const double h = path->h, delta = from->delta[leg];
  const hxCubic depth = cubic(hx_splat(delta), hx_splat(h * from->ddelta[leg]),
                              hx_splat(to->delta[leg] - delta), hx_splat(h * to->ddelta[leg]), x);
  const hxContactState *contact = path->contact;
  if (has_soil(path->model, row) && is_in_soil(contact, row, leg))
    return soil_within(path, row, leg, &depth.value, &depth.rate);
  hxContactLawAt law = {hx_splat(contact->closed[row][leg]), hx_splat(contact->damping[row][leg]),
                        hx_splat(contact->stiffness[row][leg])};
  if (has_shares(path, row)) law.stiffness *= share_within(path, row, leg, x);
  return hx_normal_force(law, depth.value, hx_splat(1.0 / h) * depth.rate).force;
}

/* Takes one sample of a leg's landing: the force and its rise over the window that ends there. */
HX_INLINE void take_landing_sample(int leg, int n, double force, hxMeasured *measured) {
  double *oldest = &measured->landing_force[n % HX_RISE_SAMPLES][leg];
  const double rate = (force - *oldest) / (HX_RISE_SAMPLES * landing_sample);
  measured->landing_rate[leg] = fmax(measured->landing_rate[leg], rate);
  measured->landing_left[leg] -= 1.0;
  *oldest = force;
}

/* Takes the samples of a leg's landing that lie within a step, several at once in lanes: forces at
 * times t_n after touch-down and their rise over the window that ends there (eq. 29). Forces before
 * touch-down are 0. */
static inline void measure_landing(const hxPath *path, int leg, hxMeasured *measured) {
  while (measured->landing_left[leg] > 0.0) {
    const int first = LANDING_SAMPLES + 1 - (int)measured->landing_left[leg];
    double x[HX_LANES], sample[HX_LANES];
    for (int lane = 0; lane < HX_LANES; ++lane)
      x[lane] = (measured->landed_at[leg] + (first + lane) * landing_sample - path->t) / path->h;
    if (x[0] > 1.0) return;
    const hxReal at = hx_max(hx_load(x), hx_splat(0.0));
    hxReal force = hx_splat(0.0);
    for (int k = 0; k < path->model->foot_rows; ++k)
      force += force_within(path, path->model->row[k], leg, at);
    hx_store(sample, force);
    for (int lane = 0; lane < HX_LANES && measured->landing_left[leg] > 0.0; ++lane) {
      if (x[lane] > 1.0) return;
      take_landing_sample(leg, first + lane, sample[lane], measured);
    }
  }
}

/* ---- the friction cone ---- */

/* Returns the real-valued bin index of a share |f_t|/(mu f_n); its whole part is the bin. Bin i
 * begins at 0.9 (i/30)^2, so bins are finer for small shares; the last bin holds all shares above
 * 0.9. */
static inline hxReal hx_cone_place(hxReal share) {
  const double last = HX_CONE_BINS - 1;
  return hx_min(last * hx_sqrt((1.0 / nearly_sliding) * share), hx_splat(last));
}

static inline int hx_has_cone(const hxModel *model) {
  return (model->mu > 0.0 && model->friction_law != HX_FRICTION_NONE) || model->has_soil;
}

/* Returns the largest impulse of friction, on soil of shear (eq. 46), under a normal impulse. */
HX_RARE hxReal cone_with_soil(const hxPath *path, int slot, hxReal along, hxReal rigid) {
  const hxMask in = hx_in_soil(path->contact, HX_FOOT, slot);
  if (!hx_any(in)) return rigid;
  const hxReal from = hx_load(&path->from->contact[HX_FOOT].delta[slot]),
               to = hx_load(&path->to->contact[HX_FOOT].delta[slot]);
  const hxSoils soil = hx_soils_under(path->contact, HX_FOOT, slot);
  const hxReal z = hx_max(0.5 * (from + to), hx_splat(0.0));
  return hx_select(in, soil.friction * along + path->h * hx_shear_base(&soil, z).force, rigid);
}

HX_INLINE hxReal cone(const hxPath *path, int row, int slot, hxReal along) {
  const hxReal rigid = hx_load(&path->contact->mu[row][slot]) * along;
  return has_soil(path->model, row) ? cone_with_soil(path, slot, along, rigid) : rigid;
}

/* Adds the step to the time of a row of feet under load, by the share of the cone that its
 * impulses use. */
static inline void measure_cone(const hxPath *path, int row, const hxImpulses *impulse,
                                hxMeasured *measured) {
  const hxContactMoment *from = &path->from->contact[row], *to = &path->to->contact[row];
  double place[HX_SLOTS], pressed[HX_SLOTS];
  if (!hx_has_cone(path->model)) return;
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const int slot = pack * HX_LANES;
    const hxVec3 normal = mean_vec3(from->normal, to->normal, slot);
    const hxReal along = hx_dot(impulse->contact[row][pack], normal);
    const hxVec3 across = hx_add_scaled(impulse->contact[row][pack], -along, normal);
    const hxReal share =
        hx_sqrt(hx_dot(across, across)) / hx_max(cone(path, row, slot, along), hx_splat(1e-300));
    hx_store(&place[slot], hx_cone_place(share));
    hx_store(&pressed[slot], along);
  }
  for (int leg = 0; leg < HX_LEGS; ++leg)
    if (pressed[leg] > path->h * path->model->load_threshold)
      measured->cone_time[(int)place[leg]] += path->h;
}

/* ---- the whole step ---- */

/* Returns whether a row of feet has a closed contact. */
static inline int is_row_used(const hxContactState *contact, int row) {
  int used = 0;
  for (int pack = 0; pack < HX_PACKS; ++pack) used |= is_used(contact, row, pack * HX_LANES);
  return used;
}

/* Adds the measurements of a step. */
static inline void hx_measure_path(const hxPath *path, const hxImpulses *impulse,
                                   const hxStepWorks *works, hxMeasured *measured) {
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    hxReal squared[HX_JOINTS];
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      squared[joint] = measure_joint(path, joint, pack * HX_LANES, works->motor[joint][pack],
                                     works->mean_torque[joint][pack], measured);
    if (path->model->heat.winding > 0.0) warm_servos(path, pack, impulse, squared, measured);
    measure_feet(path, pack * HX_LANES, measured);
  }
  for (int leg = 0; leg < HX_LEGS; ++leg) measure_landing(path, leg, measured);
  for (int k = 0; k < path->model->foot_rows; ++k)
    if (k == 0 || is_row_used(path->contact, path->model->row[k]))
      measure_cone(path, path->model->row[k], impulse, measured);
  measured->contact_loss += hx_lane(hx_sum_legs(works->contact), 0) + works->torso_contact;
  measured->friction_loss += hx_lane(hx_sum_legs(works->friction), 0) + works->torso_friction;
  measured->gear_loss += hx_lane(hx_sum_legs(works->gear), 0);
}

#endif
