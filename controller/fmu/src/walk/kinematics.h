/* kinematics.h - closed-form kinematics of three-joint legs, torso frame.
 * Python: controller/walk/kinematics.py. */
#ifndef HX_LEG_KINEMATICS_H
#define HX_LEG_KINEMATICS_H

#include "../plane.h"
#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Constants of one leg. */
typedef struct hxLegSolver {
  double hip[3]; /* m    torso frame */
  double hip_yaw; /* rad */
  hxPlane upright; /* 1    e^(-i hip_yaw) */
  double coxa_length, coxa_height; /* m */
  double offset_y; /* m    Y, of all links */
  double femur, tibia; /* m    a, b */
  double femur_tilt, tibia_tilt; /* rad */
  hxPlane femur_zero, tibia_zero; /* 1    e^(-i tilt) */
  double angle_min[HX_JOINTS], angle_max[HX_JOINTS];
  double stance[HX_JOINTS]; /* rad */
  double stance_pitch; /* rad  q_3 - q_2 of the stance */
  double speed_max; /* rad/s */
  double radius; /* m    of the foot */
} hxLegSolver;

/* A leg in its plane, torso frame. */
typedef struct hxPose {
  hxPlane point; /* m    from the coxa axis to the foot, x + i y */
  hxPlane heading; /* 1    e^(i psi), the leg's outward direction */
  hxPlane foot; /* m    from the femur joint to the foot, u + i w */
  hxPlane femur, tibia; /* 1    e^(i A), e^(i B) */
  double angle[HX_JOINTS]; /* rad  without joint limits */
  int lost; /* the foot is out of reach, and the angles are the nearest ones */
} hxPose;

/* Softness of a leg on its servos, C = J J^T / kp [m/N]. */
typedef struct hxSoftness {
  double outward, sideward, up;
  double splay; /* outward under an upward force */
} hxSoftness;

void hx_leg_solver_compile(const hxControllerDefinition *definition, int leg, hxLegSolver *model);

/* Computes the centre of the foot from the joint angles (C11). */
void hx_leg_solver_forward(const hxLegSolver *model, const double angle[HX_JOINTS], double foot[3]);

/* Returns how far the spherical foot has rolled outwards since the stance (C9) [m]. */
double hx_leg_solver_rolling(const hxLegSolver *model, const double angle[HX_JOINTS]);

/* Solves the inverse kinematics without joint limits (C12). Every target gives a pose. */
void hx_leg_solver_pose(const hxLegSolver *model, hxPlane plane, double height, hxPose *pose);

/* The same of all legs at once, which is faster. */
void hx_leg_solver_poses(const hxLegSolver model[HX_LEGS], const hxPlane plane[HX_LEGS],
                         const double height[HX_LEGS], hxPose pose[HX_LEGS]);

/* Computes the joint speeds [rad/s] of a foot with this velocity, torso frame [m/s] (C13). */
void hx_leg_solver_speeds(const hxLegSolver *model, const hxPose *pose, hxPlane velocity,
                          double rise, double speed[HX_JOINTS]);

/* Limits angles to the joints' limits and speeds to those of the servos. Returns whether the foot
 * misses its target. */
int hx_leg_solver_solve(const hxLegSolver *model, const hxPose *pose, hxPlane velocity, double rise,
                        double angle[HX_JOINTS], double speed[HX_JOINTS]);

/* Computes the joint accelerations [rad/s2] that lead to the angles of a neighbouring step (C14).
 * ahead: time to the neighbour [s], negative for the previous step; without a neighbour they are 0.
 * A joint at a limit of angle or speed has none. None is larger than that which reverses the
 * largest speed within this time. */
void hx_leg_solver_accelerations(const hxLegSolver *model, const hxPose *neighbour, double ahead,
                                 const double angle[HX_JOINTS], const double speed[HX_JOINTS],
                                 double acceleration[HX_JOINTS]);

/* Returns the softness of a leg whose servos have the stiffness kp [N m/rad] (C25). */
hxSoftness hx_leg_solver_softness(const hxLegSolver *model, const hxPose *pose, double kp);

HX_HIDDEN_END

#endif
