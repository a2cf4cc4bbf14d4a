/* soil_path.h - soil along the path of a step: plastic depths at its end, footprints, forces within
 * it */
#ifndef HX_SOIL_PATH_H
#define HX_SOIL_PATH_H

#include "../contact_law.h"
#include "foot.h"

static const double least_footprint = 1e-6; /* m  shallower ones are not kept */

/* Returns the virgin curves under a row at these depths; 0 where it is not in soil. */
HX_RARE hxSoilCurves hx_virgin_under(const hxContactState *state, int row, int slot, hxReal delta) {
  const hxReal none = hx_splat(0.0);
  const hxMask in = hx_in_soil(state, row, slot);
  if (!hx_any(in)) return (hxSoilCurves){none, none};
  const hxSoils soil = hx_soils_under(state, row, slot);
  return hx_virgin(&soil, hx_select(in, delta, none));
}

/* Virgin curves under the feet at both ends of a step. */
typedef struct {
  hxSoilCurves from[HX_PACKS], to[HX_PACKS];
} hxSoilEnds;

/* Computes those of a step between two moments; those of its start may be known already. */
HX_RARE void hx_soil_ends(const hxContactState *state, const hxMoment *from, const hxMoment *to,
                          int is_start_known, hxSoilEnds *ends) {
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const int slot = pack * HX_LANES;
    if (!is_start_known)
      ends->from[pack] =
          hx_virgin_under(state, HX_FOOT, slot, hx_load(&from->contact[HX_FOOT].delta[slot]));
    ends->to[pack] =
        hx_virgin_under(state, HX_FOOT, slot, hx_load(&to->contact[HX_FOOT].delta[slot]));
  }
}

/* Returns the normal force of feet and its derivatives, with that of soil in place of the force of
 * rigid ground where they touched down on soil (eq. 44, 45); virgin: as in hx_soil_pack. */
HX_RARE hxNormalForce with_soil(const hxContactState *state, int slot, hxReal delta, hxReal ddelta,
                                const hxSoilCurves *virgin, hxNormalForce rigid) {
  const hxReal none = hx_splat(0.0);
  const hxMask soft = hx_on_soil(state, HX_FOOT, slot), in = hx_in_soil(state, HX_FOOT, slot);
  hxSoilForces f = {none, none, none, none, none};
  if (hx_any(in)) {
    const hxSoils soil = hx_soils_under(state, HX_FOOT, slot);
    const hxReal z = hx_select(in, delta, none);
    f = hx_soil_forces(&soil, hx_load(&state->plastic[hx_soil_row(HX_FOOT)][slot]), z, ddelta,
                       virgin ? *virgin : hx_virgin(&soil, z));
  }
  return (hxNormalForce){hx_select(soft, hx_select(in, f.force, none), rigid.force),
                         hx_select(soft, hx_select(in, f.elastic, none), rigid.elastic),
                         hx_select(soft, hx_select(in, f.stiffness, none), rigid.stiffness),
                         hx_select(soft, hx_select(in, f.viscosity, none), rigid.viscosity)};
}

/* Returns the largest depth of the cubic through depths and sinking speeds (per step) at both ends
 * of a step (eq. 28). */
static inline double hx_deepest(double from, double slope_from, double to, double slope_to) {
  if (!(slope_from > 0.0 && slope_to < 0.0)) return fmax(from, to);
  const double rise = to - from, bend = slope_from + slope_to - 2.0 * rise,
               curve = rise - slope_from - bend;
  /* the root in [0, 1] of slope_from + 2 curve x + 3 bend x^2, without cancellation */
  const double root = sqrt(fmax(curve * curve - 3.0 * slope_from * bend, 0.0));
  const double x = curve > 0.0 ? (-curve - root) / (3.0 * bend) : slope_from / (root - curve);
  return fmax(from + x * (slope_from + x * (curve + x * bend)), fmax(from, to));
}

/* Returns the virgin curves at the largest depths on a step's path, which mostly are those of one
 * of its ends; ends NULL: not known. */
HX_RARE hxSoilCurves deepest_virgin(const hxSoils *soil, hxMask in, const hxSoilEnds *ends,
                                    int slot, hxReal deepest, hxReal from, hxReal to) {
  const hxMask within = differ(deepest, from) & differ(deepest, to);
  if (!ends || hx_any(in & within)) return hx_virgin(soil, deepest);
  const int pack = slot / HX_LANES;
  return select_curves(differ(deepest, to), ends->from[pack], ends->to[pack]);
}

/* Computes the plastic depths of a row at the end of a step of h, by the largest depth on its path
 * (eq. 44). */
HX_RARE void row_yield(const hxContactState *state, int row, double h, const hxContactMoment *from,
                       const hxContactMoment *to, const hxSoilEnds *ends,
                       double plastic[HX_SLOTS]) {
  double deepest[HX_SLOTS] = {0.0};
  for (int i = 0; i < hx_slots_of(row); ++i)
    if (is_in_soil(state, row, i))
      deepest[i] = hx_deepest(from->delta[i], h * from->ddelta[i], to->delta[i], h * to->ddelta[i]);
  if (row != HX_TORSO) hx_fill_slots(deepest);
  for (int slot = 0; slot < hx_slots_of(row); slot += HX_LANES) {
    const hxMask in = hx_in_soil(state, row, slot);
    const hxSoils soil = hx_soils_under(state, row, slot);
    const hxReal before = hx_load(&state->plastic[hx_soil_row(row)][slot]),
                 z = hx_load(&deepest[slot]);
    if (!hx_any(in)) continue; /* as it was */
    const hxSoilCurves virgin = deepest_virgin(
        &soil, in, ends, slot, z, hx_load(&from->delta[slot]), hx_load(&to->delta[slot]));
    hx_store(&plastic[slot],
             hx_select(in, hx_max(before, hx_plastic_depth(&soil, z, virgin)), before));
  }
  if (row != HX_TORSO) hx_fill_slots(plastic);
}

/* Computes those of all rows of a model; the others keep theirs, because they are open. */
HX_RARE void hx_soil_yield(const hxModel *model, const hxContactState *state, double h,
                           const hxMoment *from, const hxMoment *to, const hxSoilEnds *ends,
                           double plastic[HX_SOIL_ROWS][HX_SLOTS]) {
  memcpy(plastic, state->plastic, sizeof state->plastic);
  for (int k = 0; k < model->listed; ++k) {
    const int row = model->row[k];
    if (has_soil(model, row))
      row_yield(state, row, h, &from->contact[row], &to->contact[row], row == HX_FOOT ? ends : NULL,
                plastic[hx_soil_row(row)]);
  }
}

/* Returns whether the ground at a sphere's centre is soil for a row. */
HX_RARE int is_over_soil(const hxModel *model, int row, const double centre[3]) {
  if (!hx_may_sink_at(model, row, centre)) return 0;
  const double *material = model->terrain ? hx_terrain_material(model->terrain, centre) : NULL;
  hxSoil own;
  memcpy(&own, model->soil[0], sizeof own);
  return material ? material[HX_MATERIAL_SOIL] != 0.0 : (int)own.law != HX_SOIL_NONE;
}

/* Records the footprint that a contact has left upwards, and removes it from the contact. */
static inline void leave_footprint(int row, int slot, hxFootprintLog *log, hxContactState *state) {
  const int soft = hx_soil_row(row);
  if (state->plastic[soft][slot] >= least_footprint)
    hx_footprints_add(log, &(hxFootprint){state->place[soft][0][slot], state->place[soft][1][slot],
                                          state->plastic[soft][slot],
                                          hx_soil_under(state, row, slot).radius});
  state->plastic[soft][slot] = 0.0;
}

/* Holds the cell below a foot that enters a print, and releases that of one that has left its
 * print, touches nothing and is in no other block. */
HX_RARE void hold_block_of_print(const hxModel *model, int row, int slot, const double centre[3],
                                 hxContactState *state) {
  if (row != HX_FOOT || !hx_has_cells(model)) return;
  int touches = state->plastic[hx_soil_row(HX_FOOT)][slot] > 0.0;
  for (int k = HX_FOOT; hx_is_of_foot(k); ++k) touches |= state->closed[k][slot] != 0.0;
  touches = touches || hx_is_inside_blocks(model, state, slot, centre);
  double cell[2] = {state->cell[0][slot], state->cell[1][slot]};
  if (touches && cell[0] < 0.0) hx_terrain_cell_at(model->terrain, centre, cell);
  for (int i = 0; i < 2; ++i) {
    state->cell[i][slot] = touches ? cell[i] : -1.0;
    hx_fill_slots(state->cell[i]);
  }
}

/* Keeps where a contact has lost its print's bottom; a foot that keeps its block, over that. */
HX_RARE void keep_place(const hxModel *model, int row, int slot, const double centre[3],
                        hxContactState *state) {
  double *x = &state->place[hx_soil_row(row)][0][slot],
         *y = &state->place[hx_soil_row(row)][1][slot];
  const double cell[2] = {state->cell[0][slot], state->cell[1][slot]};
  *x = centre[0], *y = centre[1];
  if (row != HX_FOOT || !hx_has_cells(model) || cell[0] < 0.0) return;
  double below[2];
  hx_terrain_cell_at(model->terrain, centre, below);
  if (hx_terrain_column(model->terrain, below[0], below[1]) !=
      hx_terrain_column(model->terrain, cell[0], cell[1]))
    hx_terrain_move_into(model->terrain, cell, x, y);
}

/* Records the footprints of a row, and looks up those that it enters. */
HX_RARE void row_soil_switch(const hxModel *model, int row, const hxContactMoment *at,
                             hxDepths *depths, hxFootprintLog *log, hxContactState *state) {
  const int soft = hx_soil_row(row);
  double *delta = depths->delta[row];
  for (int slot = 0; slot < hx_slots_of(row); ++slot) {
    double *plastic = &state->plastic[soft][slot];
    const double z = delta[slot] + *plastic, x = at->centre[0][slot], y = at->centre[1][slot],
                 centre[3] = {x, y, at->centre[2][slot]};
    if (state->closed[row][slot] != 0.0) {
      if (delta[slot] <= 0.0) keep_place(model, row, slot, centre, state);
      continue;
    }
    const double before = *plastic;
    if (z <= 0.0) leave_footprint(row, slot, log, state);
    if (z > 0.0 && before == 0.0 && is_over_soil(model, row, centre))
      *plastic = hx_footprints_depth(&log->kept, model->terrain, x, y);
    const int holds = row == HX_FOOT && state->cell[0][slot] >= 0.0 && *plastic == 0.0;
    if (*plastic != before || holds) hold_block_of_print(model, row, slot, centre, state);
    delta[slot] = z - *plastic;
  }
  if (row == HX_TORSO) return;
  hx_fill_slots(state->plastic[soft]);
  hx_fill_slots(state->place[soft][0]);
  hx_fill_slots(state->place[soft][1]);
  hx_fill_slots(delta);
}

/* Records the footprints that contacts leave upwards, and looks up those that they enter from
 * above; depths are relative to the plastic depths and follow them. An open contact under the
 * undisturbed surface is above its footprint, whose bottom it may touch again: a footprint is
 * complete when the contact has left it, and is where it was lost last. Rigid ground beside a
 * footprint has none. Rows that a model leaves out are above the ground. */
HX_RARE void hx_soil_switch(const hxModel *model, const hxMoment *at, hxDepths *depths,
                            hxFootprintLog *log, hxContactState *state) {
  int seen = 0;
  for (int k = 0; k < model->listed; ++k)
    if (has_soil(model, model->row[k])) {
      const int row = model->row[k];
      row_soil_switch(model, row, &at->contact[row], depths, log, state);
      seen |= 1 << row;
    }
  for (int row = HX_KNEE; row <= HX_TORSO; ++row)
    for (int slot = 0; !(seen >> row & 1) && slot < HX_SLOTS; ++slot)
      if (slot < hx_slots_of(row))
        leave_footprint(row, slot, log, state);
      else
        state->plastic[hx_soil_row(row)][slot] = 0.0;
}

#endif
