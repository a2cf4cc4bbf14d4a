/* soil_path.h - soil along the path of a step: plastic depths at its end, footprints, forces within
 * it */
#ifndef HX_SOIL_PATH_H
#define HX_SOIL_PATH_H

#include "foot.h"

static const double least_footprint = 1e-6; /* m  shallower ones are not kept */

/* Returns the normal force of feet, with that of soil in place of the force of rigid ground where
 * they touched down on soil (eq. 44, 45). The elastic part is that whose power is stored. */
HX_RARE hxNormalForce with_soil(const hxContactState *state, int slot, hxReal delta, hxReal ddelta,
                                hxNormalForce rigid) {
  const hxMask soft = hx_on_soil(state, slot);
  const hxSoilPack f = hx_soil_pack(state, slot, delta, ddelta);
  return (hxNormalForce){
      hx_select(soft, f.force, rigid.force), hx_select(soft, f.held, rigid.elastic),
      hx_select(soft, f.stiffness, rigid.stiffness), hx_select(soft, f.viscosity, rigid.viscosity)};
}

/* Returns the largest depth of the cubic through depths and sinking speeds (per step) at both ends
 * of a step (eq. 28). */
static inline double hx_deepest(double from, double slope_from, double to, double slope_to) {
  if (!(slope_from > 0.0 && slope_to < 0.0)) return fmax(from, to);
  const double rise = to - from, bend = slope_from + slope_to - 2.0 * rise,
               curve = rise - slope_from - bend;
  double low = 0.0, high = 1.0;
  for (int i = 0; i < 40; ++i) {
    const double x = 0.5 * (low + high);
    if (slope_from + x * (2.0 * curve + 3.0 * x * bend) > 0.0)
      low = x;
    else
      high = x;
  }
  return fmax(from + low * (slope_from + low * (curve + low * bend)), fmax(from, to));
}

/* Computes the plastic depths at the end of a step of h, by the largest depth on its path (eq. 44).
 */
HX_RARE void hx_soil_yield(const hxContactState *state, double h, const hxContactMoment *from,
                           const hxContactMoment *to, double plastic[HX_SLOTS]) {
  double deepest[HX_SLOTS] = {0.0};
  for (int leg = 0; leg < HX_LEGS; ++leg)
    if (is_in_soil(state, leg))
      deepest[leg] =
          hx_deepest(from->delta[leg], h * from->ddelta[leg], to->delta[leg], h * to->ddelta[leg]);
  hx_fill_slots(deepest);
  for (int slot = 0; slot < HX_SLOTS; slot += HX_LANES) {
    const hxMask in = hx_in_soil(state, slot);
    const hxSoils soil = hx_soils_under(state, slot);
    const hxReal before = hx_load(&state->plastic[slot]),
                 now = hx_any(in) ? hx_plastic_depth(&soil, hx_load(&deepest[slot])) : before;
    hx_store(&plastic[slot], hx_select(in, hx_max(before, now), before));
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

/* Records the footprints that feet leave upwards, and looks up those that feet enter from above;
 * depths are relative to the plastic depths and follow them. An open foot under the undisturbed
 * surface is above its footprint, whose bottom it may touch again: a footprint is complete when
 * the foot has left it, and is where the foot lost contact with it last. Rigid ground beside a
 * footprint has none. */
HX_RARE void hx_soil_switch(const hxModel *model, const hxContactMoment *feet, hxDepths *depths,
                            hxFootprintLog *log, hxContactState *state) {
  double *delta = depths->delta[HX_FOOT];
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    double *plastic = &state->plastic[leg],
           *place[2] = {&state->place[0][leg], &state->place[1][leg]};
    const double z = delta[leg] + *plastic, x = feet->centre[0][leg], y = feet->centre[1][leg],
                 centre[3] = {x, y, feet->centre[2][leg]};
    if (state->closed[HX_FOOT][leg] != 0.0) {
      if (delta[leg] <= 0.0) *place[0] = x, *place[1] = y;
      continue;
    }
    if (z <= 0.0 && *plastic >= least_footprint)
      hx_footprints_add(
          log, &(hxFootprint){*place[0], *place[1], *plastic, hx_soil_under(state, leg).radius});
    if (z <= 0.0) *plastic = 0.0;
    if (z > 0.0 && *plastic == 0.0 && is_over_soil(model, centre))
      *plastic = hx_footprints_depth(&log->kept, x, y);
    delta[leg] = z - *plastic;
  }
  hx_fill_slots(state->plastic);
  hx_fill_slots(state->place[0]);
  hx_fill_slots(state->place[1]);
  hx_fill_slots(delta);
}

#endif
