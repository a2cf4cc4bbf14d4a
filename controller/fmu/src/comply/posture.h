/* posture.h - height, roll and pitch of the torso over its feet (C10): from the walking frame K
 * to the torso frame T. Python: controller/comply/posture.py. */
#ifndef HX_POSTURE_H
#define HX_POSTURE_H

#include "../plane.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* The torso in the walking frame. */
typedef struct hxPosture {
  int level; /* height, roll, pitch and their rates are all 0: nothing to turn */
  double height; /* m */
  double rotation[3][3]; /* 1      R_KT */
  double rate; /* m/s    of the height */
  double spin[3]; /* rad/s  w_KT, torso axes */
} hxPosture;

/* Sets the torso's posture: first roll about x, then pitch about y [m, rad, per second]. */
void hx_posture_of(hxPosture *posture, const double value[3], const double rate[3]);

/* Compute R_KT p and R_TK p of p = (plane, z), in place. */
void hx_posture_turn(const hxPosture *posture, hxPlane *plane, double *z);
void hx_posture_turn_back(const hxPosture *posture, hxPlane *plane, double *z);

/* Transforms position and velocity of a foot from the walking frame to the torso frame, in place.
 */
void hx_posture_see_place(const hxPosture *posture, hxPlane *plane, double *height);
void hx_posture_see(const hxPosture *posture, hxPlane *plane, double *height, hxPlane *velocity,
                    double *rise);

HX_HIDDEN_END

#endif
