#include "soil.h"

#include <math.h>
#include <string.h>

#include "../elementary.h"

static const double pi = 3.14159265358979323846;

void hx_soil_compile(const hxSoilDefinition *d, double foot_radius, double pad_radius,
                     hxSoil *soil) {
  double sine, cosine;
  memset(soil, 0, sizeof *soil);
  soil->law = d->law;
  soil->pad = pad_radius > 0.0 ? 1.0 : 0.0;
  soil->radius = pad_radius > 0.0 ? pad_radius : foot_radius;
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

void hx_soil_from_row(const double row[13], double foot_radius, double pad_radius, hxSoil *soil) {
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
  hx_soil_compile(&d, foot_radius, pad_radius, soil);
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

/* ---- virgin curves ---- */

/* Returns the integral of (local depth)^n over the foot, and its slope (eq. 41), times a pressure
 * modulus. p = z^n; q = (z - R)^n of a sphere deeper than R. */
static hxSoilCurve columns(const hxSoil *soil, double modulus, double n, double z, double p,
                           double q) {
  if (soil->pad != 0.0) {
    const double force = modulus * (soil->area * p);
    return (hxSoilCurve){force, n * force / z};
  }
  const double R = soil->radius, above = z > R ? z - R : 0.0, one = 1.0 / (n + 1.0),
               two = one / (n + 2.0), scale = 2.0 * pi * modulus;
  const double force = z * p * (R * one - z * two) + above * above * q * two;
  const double slope = p * (R - z * one) + above * q * one;
  return (hxSoilCurve){scale * force, scale * slope};
}

static hxSoilCurve bekker(const hxSoil *soil, double z) {
  const double n = soil->exponent, above = soil->pad != 0.0 ? 0.0 : z - soil->radius;
  const double q = above > 0.0 ? hx_pow(above, n) : 0.0;
  return columns(soil, soil->modulus, n, z, hx_pow(z, n), q);
}

/* eq. 42; e is the depth in radii */
static hxSoilCurve granular(const hxSoil *soil, double z) {
  if (soil->pad != 0.0) return (hxSoilCurve){soil->down * soil->area * z, soil->down * soil->area};
  const double R = soil->radius, e = z / R, o = 1.0 - e, rest = soil->down - soil->side;
  double force, slope;
  if (e <= 1.0) {
    force = soil->side * (0.5 * e * e) +
            rest * (e * e * (0.5 * o * o + (2.0 / 3.0) * o * e + 0.25 * e * e));
    slope = soil->side * e + rest * (e * (o * o + o * e + (1.0 / 3.0) * e * e));
  } else {
    force = soil->side * (e - 0.5) + rest * ((1.0 / 3.0) * (e - 1.0) + 0.25);
    slope = soil->side + (1.0 / 3.0) * rest;
  }
  return (hxSoilCurve){2.0 * pi * R * R * R * force, 2.0 * pi * R * R * slope};
}

/* eq. 43 */
static hxSoilCurve mud(const hxSoil *soil, double z) {
  const hxSoilCurve yield = columns(soil, soil->yield, 0.0, z, 1.0, 1.0);
  const hxSoilCurve hard = columns(soil, soil->hardening, 1.0, z, z, z - soil->radius);
  return (hxSoilCurve){yield.force + hard.force, yield.slope + hard.slope};
}

hxSoilCurve hx_soil_virgin(const hxSoil *soil, double z) {
  if (!(z > 0.0)) return (hxSoilCurve){0.0, 0.0};
  switch ((int)soil->law) {
  case HX_SOIL_BEKKER:
    return bekker(soil, z);
  case HX_SOIL_GRANULAR:
    return granular(soil, z);
  default:
    return mud(soil, z);
  }
}

/* ---- unloading and damping ---- */

double hx_soil_plastic_depth(const hxSoil *soil, double z) {
  return fmax(z - hx_soil_virgin(soil, z).force / soil->unloading, 0.0);
}

/* Returns min(A Ke (z - z_p), F_v(z)) of a foot deeper than z_p, and its slope. */
static hxSoilCurve elastic(const hxSoil *soil, double plastic, double z) {
  const hxSoilCurve line = {soil->unloading * (z - plastic), soil->unloading};
  const hxSoilCurve virgin = hx_soil_virgin(soil, z);
  return virgin.force < line.force ? virgin : line;
}

/* Returns the area of the foot's cross-section at the surface, m2, and its slope by z, m. */
static hxSoilCurve contact_area(const hxSoil *soil, double z) {
  if (soil->pad != 0.0 || z >= soil->radius) return (hxSoilCurve){soil->area, 0.0};
  return (hxSoilCurve){pi * (2.0 * soil->radius - z) * z, 2.0 * pi * (soil->radius - z)};
}

hxSoilForce hx_soil_normal_force(const hxSoil *soil, double plastic, double z, double dz) {
  if (!(z > plastic)) return (hxSoilForce){0.0, 0.0, 0.0, 0.0, 0.0};
  const hxSoilCurve spring = elastic(soil, plastic, z), area = contact_area(soil, z);
  const double viscosity = soil->damping * area.force, force = spring.force + viscosity * dz;
  if (!(force > 0.0)) return (hxSoilForce){0.0, spring.force, spring.slope, 0.0, 0.0};
  return (hxSoilForce){force, spring.force, spring.slope,
                       spring.slope + soil->damping * area.slope * dz, viscosity};
}

double hx_soil_stored_energy(const hxSoil *soil, double plastic, double z) {
  if (!(z > plastic)) return 0.0;
  const double force = elastic(soil, plastic, z).force;
  return force * force / (2.0 * soil->unloading);
}

/* ---- shear ---- */

/* Returns the integral of depth over the foot's profile, m3, and its slope, the profile's area. */
static hxSoilCurve profile_moment(const hxSoil *soil, double z) {
  const double R = soil->radius, c = R - z;
  if (soil->pad != 0.0) return (hxSoilCurve){R * z * z, 2.0 * R * z};
  if (c <= -R) return (hxSoilCurve){pi * R * R * (z - R), pi * R * R};
  const double chord = sqrt((R - c) * (R + c));
  const double segment = R * R * hx_half_turn_angle(chord, c) - c * chord;
  return (hxSoilCurve){(2.0 / 3.0) * (chord * chord * chord) - c * segment, segment};
}

hxSoilCurve hx_soil_shear_base(const hxSoil *soil, double z) {
  const hxSoilCurve area = contact_area(soil, z);
  hxSoilCurve base = {soil->cohesion * area.force, soil->cohesion * area.slope};
  if ((int)soil->law == HX_SOIL_GRANULAR) {
    const hxSoilCurve moment = profile_moment(soil, z);
    base.force += soil->ahead * moment.force, base.slope += soil->ahead * moment.slope;
  }
  return base;
}
