/* soil.c - constants of a soil, and its plastic depth for one foot by the kernels' soil_law.h */
#include "soil.h"

#include <math.h>
#include <string.h>

#include "../elementary.h"

#define HX_LANES 1
#include "soil_law.h"

_Static_assert(sizeof(hxSoils) == sizeof(hxSoil), "a soil consists of the same numbers");

void hx_soil_compile(const hxSoilDefinition *d, double radius, double pad_radius, hxSoil *soil) {
  double sine, cosine;
  memset(soil, 0, sizeof *soil);
  soil->law = d->law;
  soil->pad = pad_radius > 0.0 ? 1.0 : 0.0;
  soil->radius = pad_radius > 0.0 ? pad_radius : radius;
  soil->area = pi * (soil->radius * soil->radius);
  soil->modulus = d->cohesive_modulus / soil->radius + d->frictional_modulus;
  soil->exponent = d->exponent;
  soil->down = d->resistance * d->alpha_down;
  soil->side = d->resistance * d->alpha_side;
  soil->ahead = d->resistance * d->alpha_ahead;
  soil->yield = d->yield_pressure, soil->hardening = d->hardening;
  hx_sin_cos(d->friction_angle, &sine, &cosine);
  soil->cohesion = d->cohesion, soil->friction = sine / cosine;
  soil->per_displacement = 1.0 / d->shear_displacement;
  soil->unloading = soil->area * d->stiffness;
  soil->damping = d->damping;
}

void hx_soil_from_row(const double row[13], double radius, double pad_radius, hxSoil *soil) {
  const int law = HX_SOIL_NONE + (int)row[0];
  const hxSoilDefinition d = {.law = law,
                              .frictional_modulus = row[1],
                              .cohesive_modulus = row[2],
                              .exponent = row[3],
                              .resistance = row[1],
                              .alpha_down = row[2],
                              .alpha_side = row[9],
                              .alpha_ahead = row[3],
                              .yield_pressure = row[1],
                              .hardening = row[2],
                              .cohesion = row[4],
                              .shear_displacement = row[6],
                              .stiffness = row[7],
                              .damping = row[8]};
  if (law == HX_SOIL_NONE) {
    memset(soil, 0, sizeof *soil);
    soil->law = law;
    return;
  }
  hx_soil_compile(&d, radius, pad_radius, soil);
  soil->friction = row[5];
}

int hx_soil_row_error(const double row[13]) {
  enum { EXPONENT = 3, DISPLACEMENT = 6, STIFFNESS = 7, LAST = 9 };
  if (!(row[0] == 0.0 || row[0] == 1.0 || row[0] == 2.0 || row[0] == 3.0)) return 0;
  for (int i = 1; row[0] != 0.0 && i <= LAST; ++i) {
    const int above = i == DISPLACEMENT || i == STIFFNESS || (i == EXPONENT && row[0] == 1.0);
    if (!(row[i] >= 0.0 && row[i] < 1e300) || (above && row[i] == 0.0)) return i;
  }
  return -1;
}

double hx_plastic_depth(const hxSoil *soil, double z) {
  hxSoils soils;
  memcpy(&soils, soil, sizeof soils);
  return plastic_depth(&soils, z, hx_virgin_force(&soils, z));
}
