/* inverse_dynamics.h - torques and ground forces that the planned motion requires. Python:
 * controller/walk/inverse_dynamics.py. */
#ifndef HX_INVERSE_DYNAMICS_H
#define HX_INVERSE_DYNAMICS_H

#include "../comply/posture.h"
#include "hexapod/inside.h"
#include "kinematics.h"

HX_HIDDEN_BEGIN

typedef struct hxInverseDynamics {
  double period, gravity; /* s, m/s2 */
  double rotor, friction; /* kg m2, N m  of servo and gear */
  double floor; /* m, height of the ground below the stance, torso frame */
  double torso_mass, torso_inertia;
  double total_mass; /* kg, of torso and links */
  hxPlane torso_com;
  double torso_com_z;
  double mass[HX_LEGS][HX_JOINTS];
  hxPlane com[HX_LEGS]
             [HX_JOINTS]; /* m   along the link and up, from its joint, in the leg's plane */
  double side[HX_LEGS][HX_JOINTS]; /* m   Y of the mass points */
  double yaw_inertia[HX_LEGS]; /* kg m2  of all links about the vertical */
  double pitch_inertia[HX_LEGS][HX_JOINTS];
} hxInverseDynamics;

/* Positions of the mass points at one step. */
typedef struct hxMasses {
  hxPlane point[HX_LEGS][HX_JOINTS]; /* m   U, from where the coxa axis meets the hip */
  hxPlane place[HX_LEGS][HX_JOINTS]; /* m   walking frame */
  double height[HX_LEGS][HX_JOINTS]; /* m */
  hxPlane ground[HX_LEGS][HX_JOINTS]; /* m, relative to the ground, from the start of the walk */
  hxPlane torso_place, torso_ground; /* m */
  double torso_height; /* m */
  hxPlane turn; /* 1   e^(i yaw) of the walking frame */
} hxMasses;

/* Torques and ground forces that a planned motion requires at one step. */
typedef struct hxDemand {
  double torque[HX_LEGS][HX_JOINTS]; /* N m  of the joints for the legs' own weight and motion,
                                        their feet free */
  double lever[HX_LEGS][HX_JOINTS]
              [3]; /* m    J^T: joint torques per force on the contact point, walking frame */
  hxPlane push; /* N    horizontal force the ground must give the robot, walking frame */
  double weight; /* N, vertical force of the ground */
  hxPlane moment; /* N m, sum of p f_n over the feet */
  double twist; /* N m, sum of Im(p^* f_h), the moment about the vertical */
} hxDemand;

/* Three successive steps. Without one of the neighbours the present step has no acceleration. */
typedef struct hxNeighbours {
  const hxMasses *masses[3]; /* before, now, after */
  const hxPose *pose[3]; /* of all legs */
} hxNeighbours;

void hx_inverse_dynamics_compile(const hxControllerDefinition *definition,
                                 const hxLegSolver leg[HX_LEGS], hxInverseDynamics *model);

void hx_inverse_dynamics_place(const hxInverseDynamics *model, const hxLegSolver leg[HX_LEGS],
                               const hxPose pose[HX_LEGS], hxPlane way, hxPlane turn,
                               const hxPosture *posture, hxMasses *masses);

/* laden: measured over modelled weight [1]. The planned loads are scaled by it (C30), but a payload
 * needs no push for the legs, and more for the torso (C56). */
void hx_inverse_dynamics_demand(const hxInverseDynamics *model, const hxLegSolver leg[HX_LEGS],
                                const hxNeighbours *motion, const double speed[HX_LEGS][HX_JOINTS],
                                const hxPosture *posture, double laden, hxDemand *demand);

HX_HIDDEN_END

#endif
