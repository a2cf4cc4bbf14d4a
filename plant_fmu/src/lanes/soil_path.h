/* soil_path.h - soil along the path of a step: plastic depths at its end, footprints, forces within
 * it */
#ifndef HX_SOIL_PATH_H
#define HX_SOIL_PATH_H

#include "../contact_law.h"
#include "foot.h"

static const double least_footprint = 1e-6; /* m  shallower ones are not kept */

/* Returns the virgin curves under feet at these depths; 0 where they are not in soil. */
HX_RARE hxSoilCurves hx_virgin_under(const hxContactState *state, int slot, hxReal delta) {
  const hxReal none = hx_splat(0.0);
  const hxMask in = hx_in_soil(state, slot);
  if (!hx_any(in)) return (hxSoilCurves){none, none};
  const hxSoils soil = hx_soils_under(state, slot);
  return hx_virgin_force(&soil, hx_select(in, delta, none));
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
      ends->from[pack] = hx_virgin_under(state, slot, hx_load(&from->contact[HX_FOOT].delta[slot]));
    ends->to[pack] = hx_virgin_under(state, slot, hx_load(&to->contact[HX_FOOT].delta[slot]));
  }
}

/* Returns the normal force of feet and its derivatives: that of rigid ground (eq. 14), or of soil
 * where they touched down on it (eq. 45); virgin: as in hx_soil_pack. */
HX_RARE hxNormalForce contact_load(const hxContactState *state, int slot, hxReal delta,
                                   hxReal ddelta, const hxSoilCurves *virgin, hxNormalForce rigid) {
  const hxReal none = hx_splat(0.0);
  const hxMask soft = hx_on_soil(state, slot), in = hx_in_soil(state, slot);
  hxSoilForces f = {none, none, none, none, none};
  if (hx_any(in)) {
    const hxSoils soil = hx_soils_under(state, slot);
    const hxReal z = hx_select(in, delta, none);
    f = hx_soil_normal_force(&soil, hx_load(&state->plastic[slot]), z, ddelta,
                             virgin ? *virgin : hx_virgin_force(&soil, z));
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
 * of its ends. */
HX_RARE hxSoilCurves deepest_virgin(const hxSoils *soil, hxMask in, const hxSoilEnds *ends,
                                    int slot, hxReal deepest, hxReal from, hxReal to) {
  const hxMask within = differ(deepest, from) & differ(deepest, to);
  if (hx_any(in & within)) return hx_virgin_force(soil, deepest);
  const int pack = slot / HX_LANES;
  return select_curves(differ(deepest, to), ends->from[pack], ends->to[pack]);
}

/* Computes the plastic depths of feet at the end of a step of h, by the largest depth on its path
 * (eq. 44). */
HX_RARE void hx_yield_soil(const hxContactState *state, double h, const hxMoment *from,
                           const hxMoment *to, const hxSoilEnds *ends, double plastic[HX_SLOTS]) {
  const hxContactMoment *a = &from->contact[HX_FOOT], *b = &to->contact[HX_FOOT];
  double deepest[HX_SLOTS] = {0.0};
  for (int i = 0; i < HX_LEGS; ++i)
    if (is_in_soil(state, i))
      deepest[i] = hx_deepest(a->delta[i], h * a->ddelta[i], b->delta[i], h * b->ddelta[i]);
  hx_fill_slots(deepest);
  memcpy(plastic, state->plastic, sizeof state->plastic);
  for (int slot = 0; slot < HX_LEGS; slot += HX_LANES) {
    const hxMask in = hx_in_soil(state, slot);
    const hxSoils soil = hx_soils_under(state, slot);
    const hxReal before = hx_load(&state->plastic[slot]), z = hx_load(&deepest[slot]);
    if (!hx_any(in)) continue; /* as it was */
    const hxSoilCurves virgin = deepest_virgin(&soil, in, ends, slot, z, hx_load(&a->delta[slot]),
                                               hx_load(&b->delta[slot]));
    hx_store(&plastic[slot],
             hx_select(in, hx_max(before, plastic_depth(&soil, z, virgin)), before));
  }
  hx_fill_slots(plastic);
}

/* Returns whether the ground at a foot's centre is soil. */
HX_RARE int is_over_soil(const hxModel *model, const double centre[3]) {
  const double *material = model->terrain ? hx_terrain_material(model->terrain, centre) : NULL;
  hxSoil own;
  memcpy(&own, model->soil, sizeof own);
  return material ? material[HX_MATERIAL_SOIL] != 0.0 : (int)own.law != HX_SOIL_NONE;
}

/* Records the footprints that feet leave upwards, and looks up those that they enter from above;
 * depths are relative to the plastic depths and follow them. An open contact under the undisturbed
 * surface is above its footprint, whose bottom it may touch again: a footprint is complete when the
 * foot has left it, and is where it was lost last. Rigid ground beside a footprint has none. */
HX_RARE void hx_soil_switch(const hxModel *model, const hxMoment *at, hxDepths *depths,
                            hxFootprintLog *log, hxContactState *state) {
  double *delta = depths->delta[HX_FOOT];
  for (int slot = 0; slot < HX_LEGS; ++slot) {
    double *plastic = &state->plastic[slot], *x = &state->place[0][slot],
           *y = &state->place[1][slot];
    const hxNumber(*of)[HX_SLOTS] = at->contact[HX_FOOT].centre;
    const double z = delta[slot] + *plastic, centre[3] = {of[0][slot], of[1][slot], of[2][slot]};
    if (state->closed[HX_FOOT][slot] != 0.0) {
      if (delta[slot] <= 0.0) *x = centre[0], *y = centre[1];
      continue;
    }
    if (z <= 0.0) {
      if (*plastic >= least_footprint)
        hx_footprints_add(log, &(hxFootprint){*x, *y, *plastic, hx_soil_under(state, slot).radius});
      *plastic = 0.0;
    } else if (*plastic == 0.0 && is_over_soil(model, centre)) {
      *plastic = hx_footprints_depth(&log->kept, centre[0], centre[1]);
    }
    delta[slot] = z - *plastic;
  }
  hx_fill_slots(state->plastic);
  hx_fill_slots(state->place[0]);
  hx_fill_slots(state->place[1]);
  hx_fill_slots(delta);
}

#endif
