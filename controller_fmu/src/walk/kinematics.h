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
  int lost; /* the foot is out of reach: these are the nearest angles */
} hxPose;

void hx_leg_solver_compile(const hxControllerDefinition *definition, int leg, hxLegSolver *model);

/* The centre of the foot at joint angles (C11). */
void hx_leg_solver_forward(const hxLegSolver *model, const double angle[HX_JOINTS], double foot[3]);

/* How far the round foot has rolled outwards since the stance (C9) [m]. */
double hx_leg_solver_rolling(const hxLegSolver *model, const double angle[HX_JOINTS]);

/* Inverse kinematics without joint limits (C12): every target gives a pose. */
void hx_leg_solver_pose(const hxLegSolver *model, hxPlane plane, double height, hxPose *pose);

/* Joint speeds [rad/s] of a foot that moves with this velocity, torso frame [m/s] (C13). */
void hx_leg_solver_speeds(const hxLegSolver *model, const hxPose *pose, hxPlane velocity,
                          double rise, double speed[HX_JOINTS]);

/* Angles within the joints' limits and speeds that servos can reach. Returns whether the foot
 * misses its target. */
int hx_leg_solver_solve(const hxLegSolver *model, const hxPose *pose, hxPlane velocity, double rise,
                        double angle[HX_JOINTS], double speed[HX_JOINTS]);

/* Joint accelerations [rad/s2] that lead to the angles of a neighbouring step (C14), `ahead` [s]
 * of this one, negative when it lies before; none without a neighbour. A joint that its limits
 * hold, of angle or of speed, has none, and none has more than reverses the largest speed within
 * that time. */
void hx_leg_solver_accelerations(const hxLegSolver *model, const hxPose *neighbour, double ahead,
                                 const double angle[HX_JOINTS], const double speed[HX_JOINTS],
                                 double acceleration[HX_JOINTS]);

HX_HIDDEN_END

#endif
