/* soil_law.h - forces of soft ground on a pack of feet (eq. 40-47): the kernels include it, and
 * soil.c with one lane, with the same bits for each foot
 *
 * z is the depth of the foot's lowest point under the undisturbed surface, z_p the plastic depth.
 */
#ifndef HX_SOIL_LAW_H
#define HX_SOIL_LAW_H

#include "../packs/lanes.h"
#include "soil.h"

#ifndef HX_TANGENT
#include "../packs/power.h"
#endif

static const double pi = 3.14159265358979323846;

/* The constants of hxSoil, of the soils under a pack of feet. */
typedef struct {
  hxReal law, pad, radius, area;
  hxReal modulus, exponent;
  hxReal down, side, ahead;
  hxReal yield, hardening;
  hxReal cohesion, friction, per_displacement;
  hxReal unloading, damping;
} hxSoils;

/* Forces and their slopes by the depth, N and N/m. */
typedef struct hxSoilCurves {
  hxReal force, slope;
} hxSoilCurves;

/* Normal forces of soil and their derivatives. */
typedef struct {
  hxReal force;     /* N      f_n */
  hxReal elastic;   /* N      its elastic part, on the virgin curve or the unloading line */
  hxReal slope;     /* N/m    the elastic part by z */
  hxReal stiffness; /* N/m    df_n/dz */
  hxReal viscosity; /* N s/m  df_n/d(dz/dt) */
} hxSoilForces;

/* Returns which soils have a law. */
static inline hxMask has_law(const hxSoils *soil, int law) {
  return hx_less(hx_splat(law - 0.5), soil->law) & hx_less(soil->law, hx_splat(law + 0.5));
}

static inline hxSoilCurves select_curves(hxMask mask, hxSoilCurves a, hxSoilCurves b) {
  return (hxSoilCurves){hx_select(mask, a.force, b.force), hx_select(mask, a.slope, b.slope)};
}

/* ---- virgin curves ---- */

/* Returns the integral of (local depth)^n over the foot, and its slope (eq. 41), times a pressure
 * modulus. p = z^n; q = (z - R)^n of a sphere deeper than R. */
static inline hxSoilCurves column_sum(const hxSoils *soil, hxReal modulus, hxReal n, hxReal z,
                                      hxReal p, hxReal q) {
  const hxReal zero = hx_splat(0.0), R = soil->radius, flat = modulus * (soil->area * p);
  const hxReal above = hx_max(z - R, zero), one = 1.0 / (n + 1.0), two = one / (n + 2.0),
               scale = 2.0 * pi * modulus;
  const hxReal force = z * p * (R * one - z * two) + above * above * q * two;
  const hxReal slope = p * (R - z * one) + above * q * one;
  return select_curves(hx_less(zero, soil->pad), (hxSoilCurves){flat, n * flat / z},
                       (hxSoilCurves){scale * force, scale * slope});
}

/* Returns k z^n over the foot (eq. 40). */
static inline hxSoilCurves bekker_sum(const hxSoils *soil, hxReal z) {
  const hxReal n = soil->exponent, zero = hx_splat(0.0), above = z - soil->radius;
  const hxMask full = hx_less(zero, above) & hx_less(soil->pad, hx_splat(0.5));
  const hxReal q = hx_any(full) ? hx_select(full, hx_lanes_pow(above, n), zero) : zero;
  return column_sum(soil, soil->modulus, n, z, hx_lanes_pow(z, n), q);
}

/* Returns force and slope of granular media (eq. 42); e is the depth in radii. */
static inline hxSoilCurves granular_sum(const hxSoils *soil, hxReal z) {
  const hxReal down = soil->down, side = soil->side, R = soil->radius;
  const hxReal e = z / R, o = 1.0 - e, rest = down - side, flat = down * soil->area;
  const hxSoilCurves shallow = {
      side * (0.5 * e * e) + rest * (e * e * (0.5 * o * o + (2.0 / 3.0) * o * e + 0.25 * e * e)),
      side * e + rest * (e * (o * o + o * e + (1.0 / 3.0) * e * e))};
  const hxSoilCurves deep = {side * (e - 0.5) + rest * ((1.0 / 3.0) * (e - 1.0) + 0.25),
                             side + (1.0 / 3.0) * rest};
  const hxSoilCurves at = select_curves(hx_less(hx_splat(1.0), e), deep, shallow);
  return select_curves(
      hx_less(hx_splat(0.0), soil->pad), (hxSoilCurves){flat * z, flat},
      (hxSoilCurves){2.0 * pi * R * R * R * at.force, 2.0 * pi * R * R * at.slope});
}

/* Returns force and slope of mud (eq. 43). */
static inline hxSoilCurves mud_sum(const hxSoils *soil, hxReal z) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  const hxSoilCurves yield = column_sum(soil, soil->yield, zero, z, one, one);
  const hxSoilCurves hard = column_sum(soil, soil->hardening, one, z, z, z - soil->radius);
  return (hxSoilCurves){yield.force + hard.force, yield.slope + hard.slope};
}

/* Returns F_v(z), the force of a first monotone loading, and its slope (eq. 40-43). */
static inline hxSoilCurves hx_virgin_force(const hxSoils *soil, hxReal z) {
  const hxReal zero = hx_splat(0.0);
  const hxMask deep = hx_less(zero, z), is_bekker = deep & has_law(soil, HX_SOIL_BEKKER),
               is_granular = deep & has_law(soil, HX_SOIL_GRANULAR),
               is_mud = deep & has_law(soil, HX_SOIL_MUD);
  hxSoilCurves virgin = {zero, zero};
  if (hx_any(is_bekker)) virgin = select_curves(is_bekker, bekker_sum(soil, z), virgin);
  if (hx_any(is_granular)) virgin = select_curves(is_granular, granular_sum(soil, z), virgin);
  if (hx_any(is_mud)) virgin = select_curves(is_mud, mud_sum(soil, z), virgin);
  return virgin;
}

/* ---- unloading and damping ---- */

/* Returns the depths that stay when z is unloaded, with the virgin curve there (eq. 44). */
static inline hxReal plastic_depth(const hxSoils *soil, hxReal z, hxSoilCurves virgin) {
  return hx_max(z - virgin.force / soil->unloading, hx_splat(0.0));
}

/* Returns min(A Ke (z - z_p), F_v(z)) of feet deeper than z_p, and its slope (eq. 44). */
static inline hxSoilCurves elastic_force(const hxSoils *soil, hxReal plastic, hxReal z,
                                         hxSoilCurves virgin) {
  const hxSoilCurves line = {soil->unloading * (z - plastic), soil->unloading};
  return select_curves(hx_less(virgin.force, line.force), virgin, line);
}

/* Returns which feet that sink at dz press the soil further. At the end of each step that does, the
 * line reaches the curve (eq. 44), so that rounding decides which of them is less. */
static inline hxMask hx_is_yielding(const hxSoils *soil, hxReal plastic, hxReal z, hxReal dz,
                                    hxReal virgin) {
  const double margin = 1e-8; /* m: links are off their joints by less */
  const hxReal line = soil->unloading * (z - plastic + margin);
  return hx_less(hx_splat(0.0), dz) & ~hx_less(line, virgin);
}

/* Returns A(z) of eq. 45, the area of the foot's cross-section at the surface, m2, and its slope by
 * z, m. */
static inline hxSoilCurves contact_area(const hxSoils *soil, hxReal z) {
  const hxReal zero = hx_splat(0.0), R = soil->radius;
  const hxMask part = hx_less(z, R) & hx_less(soil->pad, hx_splat(0.5));
  return select_curves(part, (hxSoilCurves){pi * (2.0 * R - z) * z, 2.0 * pi * (R - z)},
                       (hxSoilCurves){soil->area, zero});
}

/* Returns f_n of feet at depth z that sink at dz, with the virgin curve at z (eq. 44, 45); 0 where
 * z <= z_p. */
static inline hxSoilForces hx_soil_normal_force(const hxSoils *soil, hxReal plastic, hxReal z,
                                                hxReal dz, hxSoilCurves virgin) {
  const hxReal zero = hx_splat(0.0);
  const hxMask in_contact = hx_less(plastic, z);
  if (!hx_any(in_contact)) return (hxSoilForces){zero, zero, zero, zero, zero};
  const hxMask yields = hx_is_yielding(soil, plastic, z, dz, virgin.force);
  const hxSoilCurves area = contact_area(soil, z);
  hxSoilCurves spring = elastic_force(soil, plastic, z, virgin);
  if (HX_HAS_SLOPES) spring = select_curves(yields, virgin, spring); /* for its derivative */
  const hxReal viscosity = soil->damping * area.force, force = spring.force + viscosity * dz;
  const hxMask pushes = in_contact & hx_less(zero, force);
  const hxReal along = hx_select(yields, virgin.slope, spring.slope);
  return (hxSoilForces){.force = hx_select(pushes, force, zero),
                        .elastic = hx_select(in_contact, spring.force, zero),
                        .slope = hx_select(in_contact, along, zero),
                        .stiffness =
                            hx_select(pushes, spring.slope + soil->damping * area.slope * dz, zero),
                        .viscosity = hx_select(pushes, viscosity, zero)};
}

/* Returns the energy that unloading gives back, F^2/(2 A Ke) with F of eq. 44, J. */
static inline hxReal hx_stored_energy(const hxSoils *soil, hxReal plastic, hxReal z,
                                      hxSoilCurves virgin) {
  const hxMask in_contact = hx_less(plastic, z);
  if (!hx_any(in_contact)) return hx_splat(0.0);
  const hxReal force = elastic_force(soil, plastic, z, virgin).force;
  return hx_select(in_contact, force * force / (2.0 * soil->unloading), hx_splat(0.0));
}

/* ---- shear ---- */

/* Returns the integral of depth over the foot's profile of eq. 46, m3. */
static inline hxReal profile_moment(const hxSoils *soil, hxReal z) {
  const hxReal R = soil->radius, c = R - z;
  const hxMask pad = hx_less(hx_splat(0.0), soil->pad), part = ~pad & hx_less(-R, c);
  const hxReal full = hx_select(pad, R * z * z, pi * R * R * (z - R));
  if (!hx_any(part)) return full;
  const hxReal chord = hx_sqrt((R - c) * (R + c));
  /* the angle in [0, pi] with the sine chord/R and the cosine c/R, from its half */
  const hxMask above = hx_less(c, hx_splat(0.0));
  const hxReal angle =
      hx_angle_from_half(hx_select(above, R - c, chord), hx_select(above, chord, R + c));
  const hxReal segment = R * R * angle - c * chord;
  return hx_select(part, (2.0 / 3.0) * (chord * chord * chord) - c * segment, full);
}

/* Returns the shear force that does not depend on the load (eq. 46): cohesion, and in granular
 * media the resistance of the profile. */
static inline hxReal hx_shear_base(const hxSoils *soil, hxReal z) {
  const hxMask is_granular = has_law(soil, HX_SOIL_GRANULAR);
  const hxReal base = soil->cohesion * contact_area(soil, z).force;
  if (!hx_any(is_granular)) return base;
  return hx_select(is_granular, base + soil->ahead * profile_moment(soil, z), base);
}

/* ---- both ---- */

/* Forces on feet in contact with soil. */
typedef struct {
  hxSoilForces normal;
  hxReal storage; /* N    times the sinking speed: power that is stored */
  hxReal stored;  /* J    energy that unloading gives back */
  hxReal hold;    /* N/m  shear over the bristle without load */
} hxSoilContacts;

/* Returns the forces on feet at these depths and sinking speeds. */
static inline hxSoilContacts hx_soil_contacts(const hxSoils *soil, hxReal plastic, hxReal z,
                                              hxReal dz, hxSoilCurves virgin) {
  const hxReal zero = hx_splat(0.0);
  const hxSoilForces f = hx_soil_normal_force(soil, plastic, z, dz, virgin);
  /* the depth of shear does not fall below z_p: a foot that leaves the ground within a step keeps
   * its grip to the end of the step */
  const hxMask above = hx_less(z, plastic);
  const hxReal base = hx_shear_base(soil, hx_select(above, plastic, z));
  const hxReal gains = hx_select(hx_less(zero, dz), f.slope / soil->unloading, hx_splat(1.0));
  return (hxSoilContacts){.normal = f,
                          .storage = f.elastic * gains,
                          .stored = 0.5 * f.elastic * f.elastic / soil->unloading,
                          .hold = soil->per_displacement * base};
}

#endif
