/* kinematics.h - closed-form kinematics of three-joint legs, torso frame.
 * Python: controller/walk/kinematics.py. */
#ifndef HX_LEG_KINEMATICS_H
#define HX_LEG_KINEMATICS_H

#include "../plane.h"
#include "hexapod/controller.h"
#include <string.h>

/* Constants of one leg. */
typedef struct hxLegSolver {
  double hip[3];                   /* m    torso frame */
  double hip_yaw;                  /* rad */
  hxPlane upright;                 /* 1    e^(-i hip_yaw) */
  double coxa_length, coxa_height; /* m */
  double offset_y;                 /* m    Y, of all links */
  double femur, tibia;             /* m    a, b */
  double femur_tilt, tibia_tilt;   /* rad */
  hxPlane femur_zero, tibia_zero;  /* 1    e^(-i tilt) */
  double angle_min[HX_JOINTS], angle_max[HX_JOINTS];
  double stance[HX_JOINTS]; /* rad */
  double stance_pitch;      /* rad  q_3 - q_2 of the stance */
  double speed_max;         /* rad/s */
  double radius;            /* m    of the foot */
} hxLegSolver;

/* A leg in its plane, torso frame. */
typedef struct hxPose {
  hxPlane point;           /* m    from the coxa axis to the foot, x + i y */
  hxPlane heading;         /* 1    e^(i psi), the leg's outward direction */
  hxPlane foot;            /* m    from the femur joint to the foot, u + i w */
  hxPlane femur, tibia;    /* 1    e^(i A), e^(i B) */
  double angle[HX_JOINTS]; /* rad  without joint limits */
  int lost;                /* the foot is out of reach, and the angles are the nearest ones */
} hxPose;

/* Softness of a leg on its servos, C = J J^T / kp [m/N]. */
typedef struct hxSoftness {
  double outward, sideward, up;
  double splay; /* outward under an upward force */
} hxSoftness;

/* rad or 1  tolerance for round-off at the edge of the reach */
static const double flag_tolerance = 1e-9;
/* 1  floor of sin(gamma), because a straight leg has no finite joint speed */
static const double singular_sine = 0.02;
/* 1  least cos(gamma), because a folded leg of equal links has no direction */
static const double folded_cosine = -1.0 + 1e-12;
static const double radius_floor = 1e-9; /* m2  floor of the squared distance from the coxa axis */

static inline void hx_leg_solver_compile(const hxControllerDefinition *definition, int leg,
                                         hxLegSolver *model) {
  const hxKnownLeg *known = &definition->leg[leg];
  const hxKnownLink *coxa = &known->link[0], *femur = &known->link[1], *tibia = &known->link[2];
  for (int i = 0; i < 3; ++i) model->hip[i] = known->hip_position[i];
  model->hip_yaw = known->hip_yaw;
  model->upright = hx_conj(hx_cis(known->hip_yaw));
  model->coxa_length = coxa->length;
  model->coxa_height = coxa->offset_z;
  model->offset_y = coxa->offset_y + femur->offset_y + tibia->offset_y;
  model->femur = hx_length(hx_plane(femur->length, femur->offset_z));
  model->tibia = hx_length(hx_plane(tibia->length, tibia->offset_z));
  model->femur_tilt = hx_arc(femur->offset_z, femur->length);
  model->tibia_tilt = hx_arc(tibia->offset_z, tibia->length);
  model->femur_zero = hx_conj(hx_cis(model->femur_tilt));
  model->tibia_zero = hx_conj(hx_cis(model->tibia_tilt));
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    model->angle_min[joint] = known->link[joint].angle_min;
    model->angle_max[joint] = known->link[joint].angle_max;
    model->stance[joint] = known->link[joint].stance;
  }
  model->stance_pitch = tibia->stance - femur->stance;
  model->speed_max = definition->servo.speed_max;
  model->radius = definition->foot_radius;
}

/* Computes the centre of the foot from the joint angles (C11). */
static inline void hx_leg_solver_forward(const hxLegSolver *model, const double angle[HX_JOINTS],
                                         double foot[3]) {
  const double a = angle[1] + model->femur_tilt, b = angle[1] - angle[2] + model->tibia_tilt;
  const hxPlane femur = hx_cis(a), tibia = hx_cis(b);
  const double x = model->coxa_length + model->femur * femur.x + model->tibia * tibia.x;
  const double z = model->coxa_height + model->femur * femur.y + model->tibia * tibia.y;
  const hxPlane heading = hx_cis(model->hip_yaw + angle[0]);
  foot[0] = heading.x * x - heading.y * model->offset_y + model->hip[0];
  foot[1] = heading.y * x + heading.x * model->offset_y + model->hip[1];
  foot[2] = z + model->hip[2];
}

/* Returns how far the spherical foot has rolled outwards since the stance (C9) [m]. */
static inline double hx_leg_solver_rolling(const hxLegSolver *model,
                                           const double angle[HX_JOINTS]) {
  return model->radius * (angle[2] - angle[1] - model->stance_pitch);
}

/* Computes the joint torques that carry a force on the foot's centre, -J^T f [N m] (C57). force:
 * torso axes [N]. */
static inline void hx_leg_solver_load_torques(const hxLegSolver *model,
                                              const double angle[HX_JOINTS], const double force[3],
                                              double torque[HX_JOINTS]) {
  const double a = angle[1] + model->femur_tilt, b = angle[1] - angle[2] + model->tibia_tilt;
  const hxPlane tibia = hx_scaled(hx_cis(b), model->tibia),
                arm = hx_plane_add(hx_scaled(hx_cis(a), model->femur), tibia),
                plane =
                    hx_times(hx_plane(force[0], force[1]), hx_cis(-(model->hip_yaw + angle[0]))),
                foot = {model->coxa_length + arm.x, model->offset_y}, inner = {plane.x, force[2]};
  torque[0] = -hx_across(foot, plane);
  torque[1] = -hx_across(arm, inner);
  torque[2] = hx_across(tibia, inner);
}

/* Cosine and sine of the angles of a leg's joints, before tilts are added. */
typedef struct hxBends {
  double x[HX_JOINTS], y[HX_JOINTS];
} hxBends;

/* Computes a pose without its angles. */
static inline void linkage(const hxLegSolver *model, hxPlane plane, double height, hxPose *pose,
                           hxBends *bends) {
  const double a = model->femur, b = model->tibia, side = model->offset_y;
  const hxPlane point = hx_plane_sub(plane, hx_plane(model->hip[0], model->hip[1]));
  /* rho^2 = x^2 + y^2 - Y^2;  e^(i psi) = (x + i y)/(rho + i Y) */
  const double square = point.x * point.x + point.y * point.y - side * side;
  const double rho = sqrt(square < radius_floor ? radius_floor : square);
  pose->point = point;
  pose->heading = hx_over(point, hx_plane(rho, side));
  pose->foot = hx_plane(rho - model->coxa_length, height - model->hip[2] - model->coxa_height);
  /* cos gamma = (u^2 + w^2 - a^2 - b^2)/(2 a b);  e^(i B) = (u + i w)/(b + a e^(i gamma)) */
  const double wanted = (hx_square(pose->foot) - a * a - b * b) / (2.0 * a * b);
  const double cosine = hx_clamp(wanted, folded_cosine, 1.0);
  const hxPlane knee = hx_plane(cosine, sqrt(1.0 - cosine * cosine));
  pose->tibia = hx_over(pose->foot, hx_plane(b + a * knee.x, a * knee.y));
  pose->femur = hx_times(pose->tibia, knee);
  const hxPlane coxa = hx_times(pose->heading, model->upright),
                femur = hx_times(pose->femur, model->femur_zero);
  *bends = (hxBends){{coxa.x, femur.x, cosine},
                     {coxa.y, femur.y, sqrt((1.0 - cosine) * (1.0 + cosine))}};
  pose->lost = !(square >= radius_floor && fabs(wanted - cosine) <= flag_tolerance);
}

/* Sets the angles of a pose. */
static inline void give_angles(const hxLegSolver *model, const double angle[HX_JOINTS],
                               hxPose *pose) {
  pose->angle[0] = angle[0];
  pose->angle[1] = angle[1];
  pose->angle[2] = angle[2] - model->femur_tilt + model->tibia_tilt;
}

/* Solves the inverse kinematics without joint limits (C12). Every target gives a pose. */
static inline void hx_leg_solver_pose(const hxLegSolver *model, hxPlane plane, double height,
                                      hxPose *pose) {
  double angle[HX_JOINTS];
  hxBends bends;
  linkage(model, plane, height, pose, &bends);
  hx_arcs(HX_JOINTS, bends.y, bends.x, angle);
  give_angles(model, angle, pose);
}

/* The same of all legs at once, which is faster. */
static inline void hx_leg_solver_poses(const hxLegSolver model[HX_LEGS],
                                       const hxPlane plane[HX_LEGS], const double height[HX_LEGS],
                                       hxPose pose[HX_LEGS]) {
  double x[HX_LEGS][HX_JOINTS], y[HX_LEGS][HX_JOINTS], angle[HX_LEGS][HX_JOINTS];
  for (int k = 0; k < HX_LEGS; ++k) {
    hxBends bends;
    linkage(&model[k], plane[k], height[k], &pose[k], &bends);
    memcpy(x[k], bends.x, sizeof bends.x);
    memcpy(y[k], bends.y, sizeof bends.y);
  }
  hx_arcs(HX_LEGS * HX_JOINTS, y[0], x[0], angle[0]);
  for (int k = 0; k < HX_LEGS; ++k) give_angles(&model[k], angle[k], &pose[k]);
}

/* Computes the joint speeds [rad/s] of a foot with this velocity, torso frame [m/s] (C13). */
static inline void hx_leg_solver_speeds(const hxLegSolver *model, const hxPose *pose,
                                        hxPlane velocity, double rise, double speed[HX_JOINTS]) {
  const hxPlane v = hx_times(velocity, hx_conj(pose->heading));
  const double turn = v.y / (pose->foot.x + model->coxa_length);
  const hxPlane left = hx_plane(v.x + model->offset_y * turn, rise);
  const double sine = hx_across(pose->tibia, pose->femur);
  const double lever = -model->femur * (sine < singular_sine ? singular_sine : sine);
  speed[0] = turn;
  speed[1] = hx_along(left, pose->tibia) / lever;
  speed[2] = hx_along(left, pose->foot) / (lever * model->tibia);
}

/* Limits angles to the joints' limits and speeds to those of the servos. Returns whether the foot
 * misses its target. */
static inline int hx_leg_solver_solve(const hxLegSolver *model, const hxPose *pose,
                                      hxPlane velocity, double rise, double angle[HX_JOINTS],
                                      double speed[HX_JOINTS]) {
  int missed = pose->lost;
  hx_leg_solver_speeds(model, pose, velocity, rise, speed);
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    angle[joint] = hx_clamp(pose->angle[joint], model->angle_min[joint], model->angle_max[joint]);
    /* a joint that its limit holds has no speed */
    const int limited = !(fabs(pose->angle[joint] - angle[joint]) <= flag_tolerance);
    speed[joint] = limited ? 0.0 : hx_clamp(speed[joint], -model->speed_max, model->speed_max);
    missed |= limited;
  }
  return missed;
}

/* Computes the joint accelerations [rad/s2] that lead to the angles of a neighbouring step (C14).
 * ahead: time to the neighbour [s], negative for the previous step; without a neighbour they are 0.
 * A joint at a limit of angle or speed has none. None is larger than that which reverses the
 * largest speed within this time. */
static inline void hx_leg_solver_accelerations(const hxLegSolver *model, const hxPose *neighbour,
                                               double ahead, const double angle[HX_JOINTS],
                                               const double speed[HX_JOINTS],
                                               double acceleration[HX_JOINTS]) {
  const double most = 2.0 * model->speed_max / fabs(ahead);
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    const double low = model->angle_min[joint], high = model->angle_max[joint];
    const int limited =
        angle[joint] <= low || angle[joint] >= high || fabs(speed[joint]) >= model->speed_max;
    acceleration[joint] = 0.0;
    if (limited || !neighbour) continue;
    const double way =
        hx_clamp(neighbour->angle[joint], low, high) - angle[joint] - ahead * speed[joint];
    acceleration[joint] = hx_clamp(2.0 * way / (ahead * ahead), -most, most);
  }
}

/* Returns the softness of a leg whose servos have the stiffness kp [N m/rad] (C25). */
static inline hxSoftness hx_leg_solver_softness(const hxLegSolver *model, const hxPose *pose,
                                                double kp) {
  /* rates of the foot, outward + i up, by the femur's and by the tibia's joint */
  const hxPlane femur = {-pose->foot.y, pose->foot.x},
                tibia = {model->tibia * pose->tibia.y, -model->tibia * pose->tibia.x};
  const double reach = pose->foot.x + model->coxa_length;
  return (hxSoftness){
      .outward = (femur.x * femur.x + tibia.x * tibia.x + model->offset_y * model->offset_y) / kp,
      .sideward = reach * reach / kp,
      .up = (femur.y * femur.y + tibia.y * tibia.y) / kp,
      .splay = (femur.x * femur.y + tibia.x * tibia.y) / kp,
  };
}

#endif
