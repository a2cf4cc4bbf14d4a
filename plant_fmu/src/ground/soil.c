#include "soil.h"

#include <math.h>
#include <string.h>

#include "../elementary.h"
#include "one_lane.h"

#include "soil_law.h" /* behind the numbers that it computes with */

_Static_assert(sizeof(hxSoils) == sizeof(hxSoil), "a soil consists of the same numbers");

void hx_soil_compile(const hxSoilDefinition *d, const hxSoilShape *shape, hxSoil *soil) {
  double sine, cosine;
  memset(soil, 0, sizeof *soil);
  soil->law = d->law;
  soil->pad = shape->pad_radius > 0.0 ? 1.0 : 0.0;
  soil->radius = shape->pad_radius > 0.0 ? shape->pad_radius : shape->radius;
  const double breadth = shape->breadth > 0.0 ? shape->breadth : soil->radius;
  soil->area = pi * (soil->radius * soil->radius);
  soil->modulus = d->cohesive_modulus / breadth + d->frictional_modulus;
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

void hx_soil_from_row(const double row[13], const hxSoilShape *shape, hxSoil *soil) {
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
  hx_soil_compile(&d, shape, soil);
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

/* ---- one foot ---- */

/* Returns the pack that holds one soil. */
static hxSoils only(const hxSoil *soil) {
  hxSoils soils;
  memcpy(&soils, soil, sizeof soils);
  return soils;
}

static hxSoilCurve curve_of(hxSoilCurves only) { return (hxSoilCurve){only.force, only.slope}; }

static hxSoilForce force_of(hxSoilForces only) {
  return (hxSoilForce){only.force, only.elastic, only.slope, only.stiffness, only.viscosity};
}

hxSoilCurve hx_soil_virgin(const hxSoil *soil, double z) {
  const hxSoils soils = only(soil);
  return curve_of(hx_virgin(&soils, z));
}

double hx_soil_plastic_depth(const hxSoil *soil, double z) {
  const hxSoils soils = only(soil);
  return hx_plastic_depth(&soils, z, hx_virgin(&soils, z));
}

hxSoilForce hx_soil_normal_force(const hxSoil *soil, double plastic, double z, double dz) {
  const hxSoils soils = only(soil);
  return force_of(hx_soil_forces(&soils, plastic, z, dz, hx_virgin(&soils, z)));
}

double hx_soil_stored_energy(const hxSoil *soil, double plastic, double z) {
  const hxSoils soils = only(soil);
  return hx_stored_energy(&soils, plastic, z, hx_virgin(&soils, z));
}

hxSoilCurve hx_soil_shear_base(const hxSoil *soil, double z) {
  const hxSoils soils = only(soil);
  return curve_of(hx_shear_base(&soils, z));
}

/* Returns the second derivative of the integral of eq. 41, times a pressure modulus, z > 0. */
static double bend_of_columns(const hxSoil *soil, double modulus, double n, double z) {
  const double R = soil->radius, p = hx_pow(z, n);
  if (soil->pad > 0.0) {
    const double bend = n * (n - 1.0); /* 0: z * z may be 0, too */
    return bend == 0.0 ? 0.0 : modulus * soil->area * bend * p / (z * z);
  }
  const double above = z > R ? hx_pow(z - R, n) : 0.0;
  return 2.0 * pi * modulus * (p * (n * R / z - 1.0) + above);
}

/* Returns the second derivative of F_v, N/m2, z > 0. */
static double virgin_bend(const hxSoil *soil, double z) {
  const double R = soil->radius, rest = fmax(1.0 - z / R, 0.0);
  if ((int)soil->law == HX_SOIL_BEKKER)
    return bend_of_columns(soil, soil->modulus, soil->exponent, z);
  if ((int)soil->law == HX_SOIL_MUD)
    return bend_of_columns(soil, soil->yield, 0.0, z) +
           bend_of_columns(soil, soil->hardening, 1.0, z);
  if (soil->pad > 0.0 || rest == 0.0) return 0.0;
  return 2.0 * pi * R * (soil->side + (soil->down - soil->side) * (rest * rest));
}

hxSoilContact hx_soil_contact(const hxSoil *soil, double plastic, double z, double dz) {
  const hxSoils soils = only(soil);
  const hxSoilCurves virgin = hx_virgin(&soils, z);
  const hxSoilContacts at = hx_soil_contacts(&soils, plastic, z, dz, virgin);
  hxSoilForce normal = force_of(at.normal);
  hxSoilCurve held = curve_of(at.held);
  if (plastic < z && hx_is_yielding(&soils, plastic, z, dz, virgin.force)) {
    held.slope += normal.elastic * virgin_bend(soil, z) / soil->unloading;
    if (normal.force > 0.0)
      normal.stiffness += normal.slope - elastic(&soils, plastic, z, virgin).slope;
  }
  return (hxSoilContact){normal, held, curve_of(at.stored), curve_of(at.hold)};
}
