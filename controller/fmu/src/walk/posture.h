/* posture.h - height, roll and pitch of the torso over its feet (C10): from the walking frame K
 * to the torso frame T. Python: controller/walk/posture.py. */
#ifndef HX_POSTURE_H
#define HX_POSTURE_H

#include "../plane.h"

/* The torso in the walking frame. */
typedef struct hxPosture {
  int level;         /* height, roll, pitch and their rates are all 0: nothing to turn */
  double height;     /* m */
  double R_KT[3][3]; /* 1 */
  double rate;       /* m/s    of the height */
  double w_KT[3];    /* rad/s  of the torso, its axes */
} hxPosture;

/* Sets the torso's posture: first roll about x, then pitch about y [m, rad, per second]. */
static inline void hx_posture_of(hxPosture *posture, const double value[3], const double rate[3]) {
  double cr, sr, cp, sp;
  hx_sine_cosine(value[1], &sr, &cr);
  hx_sine_cosine(value[2], &sp, &cp);
  const double R_KT[3][3] = {{cp, sp * sr, sp * cr}, {0.0, cr, -sr}, {-sp, cp * sr, cp * cr}};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) posture->R_KT[i][j] = R_KT[i][j];
  posture->level = 1;
  for (int i = 0; i < 3; ++i) posture->level &= value[i] == 0.0 && rate[i] == 0.0;
  posture->height = value[0];
  posture->rate = rate[0];
  posture->w_KT[0] = rate[1];
  posture->w_KT[1] = rate[2] * cr;
  posture->w_KT[2] = -rate[2] * sr;
}

/* Compute R_KT p and R_TK p of p = (plane, z), in place. */
static inline void hx_posture_turn(const hxPosture *posture, hxPlane *plane, double *z) {
  const double (*R_KT)[3] = posture->R_KT;
  const double p_T[3] = {plane->x, plane->y, *z};
  double p_K[3];
  if (posture->level) return;
  for (int i = 0; i < 3; ++i)
    p_K[i] = R_KT[i][0] * p_T[0] + R_KT[i][1] * p_T[1] + R_KT[i][2] * p_T[2];
  *plane = hx_plane(p_K[0], p_K[1]);
  *z = p_K[2];
}

static inline void hx_posture_turn_back(const hxPosture *posture, hxPlane *plane, double *z) {
  const double (*R_KT)[3] = posture->R_KT;
  const double p_K[3] = {plane->x, plane->y, *z};
  double p_T[3];
  if (posture->level) return;
  for (int i = 0; i < 3; ++i)
    p_T[i] = R_KT[0][i] * p_K[0] + R_KT[1][i] * p_K[1] + R_KT[2][i] * p_K[2];
  *plane = hx_plane(p_T[0], p_T[1]);
  *z = p_T[2];
}

/* Transforms position and velocity of a foot from the walking frame to the torso frame, in place.
 */
static inline void hx_posture_to_torso(const hxPosture *posture, hxPlane *plane, double *height) {
  /* p_T = R_TK (p_K - height e_z) */
  *height -= posture->height;
  hx_posture_turn_back(posture, plane, height);
}

static inline void hx_posture_feet_to_torso(const hxPosture *posture, hxPlane *plane,
                                            double *height, hxPlane *velocity, double *rise) {
  const double *w = posture->w_KT;
  if (posture->level) return;
  hx_posture_to_torso(posture, plane, height);
  /* v_T = R_TK (v_K - rate e_z) - w_KT x p_T */
  *rise -= posture->rate;
  hx_posture_turn_back(posture, velocity, rise);
  velocity->x -= w[1] * *height - w[2] * plane->y;
  velocity->y -= w[2] * plane->x - w[0] * *height;
  *rise -= w[0] * plane->y - w[1] * plane->x;
}

#endif
