/* soil.h - forces of soft ground on a foot (eq. 40-47): virgin curve, unloading, damping and shear;
 * models/soil/law.py is the readable form
 *
 * z is the depth of the foot's lowest point under the undisturbed surface, z_p the plastic depth.
 */
#ifndef HX_SOIL_H
#define HX_SOIL_H

#include "hexapod/hexapod.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Constants of a soil under the feet of a robot, from hxSoilDefinition. They are all numbers, as
 * which the model holds them (HX_SOIL_SIZE of state.h). */
typedef struct hxSoil {
  double law;                /* hxSoilLaw */
  double pad;                /* 1       1: flat pad; 0: sphere */
  double radius;             /* m       of the pad or the sphere */
  double area;               /* m2      A = pi radius^2 */
  double modulus, exponent;  /* bekker: k, n */
  double down, side, ahead;  /* N/m3    granular: resistances per depth */
  double yield, hardening;   /* Pa, Pa/m  mud */
  double cohesion, friction; /* Pa, 1   c, tan phi */
  double per_displacement;   /* 1/m     1/K */
  double unloading;          /* N/m     A Ke */
  double damping;            /* Pa s/m  R */
} hxSoil;

/* Computes the constants of a soil under feet; pad_radius 0: spheres of a radius, m. */
void hx_soil_compile(const hxSoilDefinition *definition, double radius, double pad_radius,
                     hxSoil *soil);

/* Does the same from columns 3 to 15 of a material of a grid's table (table_row of
 * models/soil/law.py). */
void hx_soil_from_row(const double row[13], double radius, double pad_radius, hxSoil *soil);

/* Returns the first of these columns that is not in its range, -1 if there is none. */
int hx_soil_row_error(const double row[13]);

/* Returns the depth that stays when depth z is unloaded, z - F_v(z)/(A Ke) >= 0 (eq. 44). */
double hx_plastic_depth(const hxSoil *soil, double z);

HX_HIDDEN_END

#endif
