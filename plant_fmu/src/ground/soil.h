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

/* Shape of what sinks. */
typedef struct {
  double radius; /* m  of the sphere */
  double
      pad_radius; /* m  of a flat round pad in its place, or of a disc of a pad's area; 0: none */
  double breadth; /* m  b of eq. 40; 0: the radius */
} hxSoilShape;

/* A force and its slope by the depth, N and N/m. */
typedef struct {
  double force, slope;
} hxSoilCurve;

/* Normal force of soil and its derivatives. */
typedef struct {
  double force;     /* N      f_n */
  double elastic;   /* N      its elastic part, on the virgin curve or the unloading line */
  double slope;     /* N/m    the elastic part by z */
  double stiffness; /* N/m    df_n/dz */
  double viscosity; /* N s/m  df_n/d(dz/dt) */
} hxSoilForce;

/* Forces of soil on a foot in contact with it. */
typedef struct {
  hxSoilForce normal;
  hxSoilCurve held;   /* N     times the sinking speed: power that is stored; its slope by z */
  hxSoilCurve stored; /* J, N  energy that unloading gives back */
  hxSoilCurve hold;   /* N/m   shear over the bristle without load */
} hxSoilContact;

/* Computes the constants of a soil under a shape. */
void hx_soil_compile(const hxSoilDefinition *definition, const hxSoilShape *shape, hxSoil *soil);

/* Does the same from columns 3 to 15 of a material of a grid's table (table_row of
 * models/soil/law.py). */
void hx_soil_from_row(const double row[13], const hxSoilShape *shape, hxSoil *soil);

/* Returns the first of these columns that is not in its range, -1 if there is none. */
int hx_soil_row_error(const double row[13]);

/* Returns F_v(z), the force of a first monotone loading, and its slope (eq. 40-43). */
hxSoilCurve hx_soil_virgin(const hxSoil *soil, double z);

/* Returns the depth that stays when depth z is unloaded, z - F_v(z)/(A Ke) >= 0 (eq. 44). */
double hx_soil_plastic_depth(const hxSoil *soil, double z);

/* Returns f_n of a foot at depth z that sinks at dz (eq. 44, 45); 0 where z <= z_p. */
hxSoilForce hx_soil_normal_force(const hxSoil *soil, double plastic, double z, double dz);

/* Returns the energy that unloading gives back, J. */
double hx_soil_stored_energy(const hxSoil *soil, double plastic, double z);

/* Returns the shear force that does not depend on the load, and its slope by the depth (eq. 46):
 * cohesion, and in granular media the resistance of the profile. */
hxSoilCurve hx_soil_shear_base(const hxSoil *soil, double z);

/* Returns the forces on a foot at depth z that sinks at dz. */
hxSoilContact hx_soil_contact(const hxSoil *soil, double plastic, double z, double dz);

HX_HIDDEN_END

#endif
