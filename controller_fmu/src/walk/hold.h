/* hold.h - slow loops on what the standing legs say about the torso: its posture and the way it has
 * walked. Python: controller/walk/hold.py. */
#ifndef HX_HOLD_H
#define HX_HOLD_H

#include "../plane.h"
#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxHoldModel {
  int64_t every; /* steps between two looks */
  double time; /* s  between two looks */
  int posture, path;
  double attitude_step, height_step; /* 1  of the integrals, a look */
  double smooth; /* 1  of the ground's inclination, a look */
  double angle_limit, height_limit, path_rate, speed_limit, turn_limit;
} hxHoldModel;

/* What is seen at a look. Feet in the walking frame. */
typedef struct hxSight {
  hxPlane plane[HX_LEGS]; /* m    where the encoders see the contact points */
  double height[HX_LEGS]; /* m    and the feet's centres */
  hxPlane planned[HX_LEGS]; /* m    where they were planned */
  double planned_height[HX_LEGS]; /* m */
  double load[HX_LEGS]; /* 1    thirds of the weight */
  double tilt[2]; /* rad  roll and pitch beyond the commanded ones */
  double yaw; /* rad */
  hxPlane velocity; /* m/s  commanded, walking frame */
  double yaw_rate; /* rad/s */
} hxSight;

typedef struct hxHold {
  double lift[HX_LEGS]; /* m      of the feet */
  hxPlane velocity; /* m/s    added to the commanded one */
  double yaw_rate; /* rad/s  added to the commanded one */
  hxPlane way; /* m      lost */
  double heading; /* rad    lost */
  int ground_known, looked;
  double ground[2]; /* rad    inclination */
  double angle[2], height; /* rad, m of the corrections */
  hxPlane foot[HX_LEGS]; /* m      at the last look, turned by the yaw */
  double load[HX_LEGS], yaw; /* 1, rad at the last look */
} hxHold;

void hx_hold_compile(const hxControllerDefinition *definition, hxHoldModel *model);

/* Brings the corrections up to date. */
void hx_hold_look(const hxHoldModel *model, const hxSight *seen, hxHold *hold);

HX_HIDDEN_END

#endif
