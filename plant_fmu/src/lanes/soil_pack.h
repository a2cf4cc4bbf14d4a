/* soil_pack.h - soil under packs of contacts: forces on lanes by soil_law.h
 *
 * The functions are out of line, so that rigid ground costs the same with and without them.
 */
#ifndef HX_SOIL_PACK_H
#define HX_SOIL_PACK_H

#include "../packs/lanes.h"

#include "../ground/soil_law.h"

_Static_assert(sizeof(hxSoil) == HX_SOIL_SIZE * sizeof(double), "a soil consists of numbers");

/* Returns whether a row of contacts may be on soil: that of feet with the ground below them. */
static inline int has_soil(const hxModel *model, int row) {
  return model->has_soil && row == HX_FOOT;
}

/* Returns which feet touched down on soil. */
static inline hxMask hx_on_soil(const hxContactState *state, int slot) {
  return hx_less(hx_splat(0.0), hx_load(&state->on_soil[slot]));
}

/* Returns the soil on which a foot touched down. */
static inline hxSoil hx_soil_under(const hxContactState *state, int slot) {
  hxSoil soil;
  double numbers[HX_SOIL_SIZE];
  for (int i = 0; i < HX_SOIL_SIZE; ++i) numbers[i] = hx_re(state->soil[i][slot]);
  memcpy(&soil, numbers, sizeof soil);
  return soil;
}

/* Returns whether a foot's contact is closed and on soil. */
static inline int is_in_soil(const hxContactState *state, int slot) {
  return hx_re(state->closed[HX_FOOT][slot]) != 0.0 && hx_re(state->on_soil[slot]) != 0.0;
}

/* Forces of soil on a pack of feet; 0 on those that do not touch it. */
typedef struct {
  hxReal force;                /* N      f_n */
  hxReal stiffness, viscosity; /* N/m, N s/m  its derivatives by depth and sinking speed */
  hxReal storage;              /* N      times the sinking speed: power that is stored */
  hxReal stored;               /* J      that unloading gives back */
  hxReal hold, per_load;       /* N/m, 1/m  shear over the bristle: without load, of the load */
  hxReal per_displacement;     /* 1/m    1/K */
} hxSoilPack;

/* Returns the soils on which a pack of feet touched down. */
static inline hxSoils hx_soils_under(const hxContactState *state, int slot) {
  hxSoils soils;
  hxReal numbers[HX_SOIL_SIZE];
  for (int i = 0; i < HX_SOIL_SIZE; ++i) numbers[i] = hx_load(&state->soil[i][slot]);
  memcpy(&soils, numbers, sizeof soils);
  return soils;
}

/* Returns which feet have a closed contact on soil. */
static inline hxMask hx_in_soil(const hxContactState *state, int slot) {
  return hx_on_soil(state, slot) & hx_less(hx_splat(0.0), hx_load(&state->closed[HX_FOOT][slot]));
}

/* Returns the forces on feet at these depths and sinking speeds; virgin: the virgin curves there,
 * NULL: not known. */
HX_RARE hxSoilPack hx_soil_pack(const hxContactState *state, int slot, hxReal delta, hxReal ddelta,
                                const hxSoilCurves *virgin) {
  const hxReal none = hx_splat(0.0);
  const hxMask in = hx_in_soil(state, slot);
  if (!hx_any(in)) return (hxSoilPack){none, none, none, none, none, none, none, none};
  const hxSoils soil = hx_soils_under(state, slot);
  const hxReal z = hx_select(in, delta, none);
  const hxSoilContacts f = hx_soil_contacts(&soil, hx_load(&state->plastic[slot]), z, ddelta,
                                            virgin ? *virgin : hx_virgin_force(&soil, z));
  return (hxSoilPack){.force = hx_select(in, f.normal.force, none),
                      .stiffness = hx_select(in, f.normal.stiffness, none),
                      .viscosity = hx_select(in, f.normal.viscosity, none),
                      .storage = hx_select(in, f.storage, none),
                      .stored = hx_select(in, f.stored, none),
                      .hold = hx_select(in, f.hold, none),
                      .per_load = hx_select(in, soil.friction * soil.per_displacement, none),
                      .per_displacement = hx_select(in, soil.per_displacement, none)};
}

#endif
