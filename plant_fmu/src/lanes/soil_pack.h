/* soil_pack.h - soil under packs of feet: forces on lanes from the scalar functions of soil.h
 *
 * The functions are out of line, so that rigid ground costs the same with and without them.
 */
#ifndef HX_SOIL_PACK_H
#define HX_SOIL_PACK_H

#include "../ground/soil.h"
#include "lanes.h"

_Static_assert(sizeof(hxSoil) == HX_SOIL_SIZE * sizeof(double), "a soil consists of numbers");

/* Returns whether a row of contacts may be on soil. */
static inline int has_soil(const hxModel *model, int row) {
  return row == HX_FOOT && model->has_soil;
}

/* Returns which feet touched down on soil. */
static inline hxMask hx_on_soil(const hxContactState *state, int slot) {
  return hx_less(hx_splat(0.0), hx_load(&state->on_soil[slot]));
}

/* Returns the soil on which a foot touched down. */
static inline hxSoil hx_soil_under(const hxContactState *state, int slot) {
  hxSoil soil;
  double numbers[HX_SOIL_SIZE];
  for (int i = 0; i < HX_SOIL_SIZE; ++i) numbers[i] = hx_re(state->soil[slot][i]);
  memcpy(&soil, numbers, sizeof soil);
  return soil;
}

/* Returns whether a foot is in contact with soil. */
static inline int is_in_soil(const hxContactState *state, int slot) {
  return hx_re(state->closed[HX_FOOT][slot]) != 0.0 && hx_re(state->on_soil[slot]) != 0.0;
}

/* Forces of soil on a pack of feet; 0 on feet that do not touch it. */
typedef struct {
  hxReal force;                /* N      f_n */
  hxReal stiffness, viscosity; /* N/m, N s/m  its derivatives by depth and sinking speed */
  hxReal held;                 /* N      times the sinking speed: power that is stored */
  hxReal stored;               /* J      that unloading gives back */
  hxReal hold, per_load;       /* N/m, 1/m  shear over the bristle: without load, of the load */
  hxReal per_displacement;     /* 1/m    1/K */
} hxSoilPack;

/* Returns the forces on feet at these depths and sinking speeds. */
HX_RARE hxSoilPack hx_soil_pack(const hxContactState *state, int slot, hxReal delta,
                                hxReal ddelta) {
  hxNumber z[HX_LANES], dz[HX_LANES], out[8][HX_LANES];
  memset(out, 0, sizeof out);
  hx_store(z, delta);
  hx_store(dz, ddelta);
  for (int lane = 0; lane < HX_LANES; ++lane) {
    if (!is_in_soil(state, slot + lane)) continue;
    const hxSoil soil = hx_soil_under(state, slot + lane);
    const double plastic = hx_re(state->plastic[slot + lane]), depth = hx_re(z[lane]),
                 speed = hx_re(dz[lane]), slope_z = hx_slope(z[lane]),
                 slope_dz = hx_slope(dz[lane]);
    const hxSoilForce f = hx_soil_normal_force(&soil, plastic, depth, speed);
    /* the depth of shear does not fall below z_p: a foot that leaves the ground within a step
     * keeps its grip to the end of the step */
    const int above = depth < plastic;
    const hxSoilCurve base = hx_soil_shear_base(&soil, above ? plastic : depth);
    const double gains = speed > 0.0 ? f.slope / soil.unloading : 1.0;
    out[0][lane] = hx_with_slope(f.force, f.stiffness * slope_z + f.viscosity * slope_dz);
    out[1][lane] = f.stiffness, out[2][lane] = f.viscosity;
    out[3][lane] = hx_with_slope(f.elastic * gains, f.slope * gains * slope_z);
    out[4][lane] = hx_with_slope(0.5 * f.elastic * f.elastic / soil.unloading,
                                 f.elastic * f.slope / soil.unloading * slope_z);
    out[5][lane] = hx_with_slope(soil.per_displacement * base.force,
                                 above ? 0.0 : soil.per_displacement * base.slope * slope_z);
    out[6][lane] = soil.friction * soil.per_displacement;
    out[7][lane] = soil.per_displacement;
  }
  return (hxSoilPack){.force = hx_load(out[0]),
                      .stiffness = hx_load(out[1]),
                      .viscosity = hx_load(out[2]),
                      .held = hx_load(out[3]),
                      .stored = hx_load(out[4]),
                      .hold = hx_load(out[5]),
                      .per_load = hx_load(out[6]),
                      .per_displacement = hx_load(out[7])};
}

#endif
