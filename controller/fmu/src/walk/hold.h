/* hold.h - slow loops that correct the torso's posture and path from the positions of the standing
 * feet. Python: controller/walk/hold.py. */
#ifndef HX_HOLD_H
#define HX_HOLD_H

#include "../plane.h"
#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxHoldModel {
  int64_t every; /* steps between two updates */
  double time; /* s, between two updates */
  int posture, path;
  double attitude_step, height_step; /* 1, factors of the integrals for one update */
  double smooth; /* 1, factor of the ground's inclination for one update */
  double angle_limit, height_limit, path_rate, speed_limit, turn_limit;
} hxHoldModel;

/* Measurements for one update. Feet are in the walking frame. */
typedef struct hxSight {
  hxPlane plane[HX_LEGS]; /* m, contact points from the measured joint angles */
  double height[HX_LEGS]; /* m, of the feet's centres */
  hxPlane planned[HX_LEGS]; /* m, planned positions */
  double planned_height[HX_LEGS]; /* m */
  double load[HX_LEGS]; /* 1    thirds of the weight */
  double tilt[2]; /* rad, roll and pitch minus the commanded ones */
  double yaw; /* rad */
  hxPlane velocity; /* m/s  commanded, walking frame */
  double yaw_rate; /* rad/s */
} hxSight;

typedef struct hxHold {
  double lift[HX_LEGS]; /* m      of the feet */
  hxPlane velocity; /* m/s    added to the commanded one */
  double yaw_rate; /* rad/s  added to the commanded one */
  hxPlane way; /* m, lost displacement */
  double heading; /* rad, lost heading */
  int ground_known, looked;
  double ground[2]; /* rad    inclination */
  double angle[2], height; /* rad, m of the corrections */
  hxPlane foot[HX_LEGS]; /* m, at the last update, turned by the yaw */
  double load[HX_LEGS], yaw; /* 1, rad, at the last update */
} hxHold;

void hx_hold_compile(const hxControllerDefinition *definition, hxHoldModel *model);

/* Updates the corrections. */
void hx_hold_look(const hxHoldModel *model, const hxSight *seen, hxHold *hold);

HX_HIDDEN_END

#endif
