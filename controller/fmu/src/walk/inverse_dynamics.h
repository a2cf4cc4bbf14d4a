/* inverse_dynamics.h - torques and ground forces that the planned motion requires. Python:
 * controller/walk/inverse_dynamics.py. */
#ifndef HX_INVERSE_DYNAMICS_H
#define HX_INVERSE_DYNAMICS_H

#include "kinematics.h"
#include "posture.h"
#include <string.h>

typedef struct hxInverseDynamics {
  double period, gravity; /* s, m/s2 */
  double rotor, friction; /* kg m2, N m  of servo and gear */
  double drag;            /* N m s/rad  that a joint's speed takes from its servo */
  double floor;           /* m  height of the ground below the stance, torso frame */
  double torso_mass, torso_inertia;
  double total_mass; /* kg  of torso and links */
  hxPlane torso_com;
  double torso_com_z;
  double mass[HX_LEGS][HX_JOINTS];
  hxPlane com[HX_LEGS]
             [HX_JOINTS]; /* m   along the link and up, from its joint, in the leg's plane */
  double side[HX_LEGS][HX_JOINTS]; /* m   Y of the mass points */
  double yaw_inertia[HX_LEGS];     /* kg m2  of all links about the vertical */
  double pitch_inertia[HX_LEGS][HX_JOINTS];
} hxInverseDynamics;

/* Positions of the mass points at one step. */
typedef struct hxMasses {
  hxPlane point[HX_LEGS][HX_JOINTS];  /* m   U, from where the coxa axis meets the hip */
  hxPlane place[HX_LEGS][HX_JOINTS];  /* m   walking frame */
  double height[HX_LEGS][HX_JOINTS];  /* m */
  hxPlane ground[HX_LEGS][HX_JOINTS]; /* m  relative to the ground, from the start of the walk */
  hxPlane torso_place, torso_ground;  /* m */
  double torso_height;                /* m */
  hxPlane R_WK;                       /* 1   e^(i yaw) of the walking frame */
} hxMasses;

/* Torques and ground forces that a planned motion requires at one step. */
typedef struct hxDemand {
  double torque[HX_LEGS][HX_JOINTS]; /* N m  of the joints for the legs' own weight and motion,
                                        their feet free */
  double lever[HX_LEGS][HX_JOINTS]
              [3]; /* m    J^T: joint torques per force on the contact point, walking frame */
  hxPlane push;    /* N    horizontal force the ground must give the robot, walking frame */
  double weight;   /* N  vertical force of the ground */
  hxPlane moment;  /* N m  sum of p f_n over the feet */
  double twist;    /* N m  sum of Im(p^* f_h), the moment about the vertical */
} hxDemand;

/* Three successive steps. Without one of the neighbours the present step has no acceleration. */
typedef struct hxNeighbours {
  const hxMasses *masses[3]; /* before, now, after */
  const hxPose *pose[3];     /* of all legs */
} hxNeighbours;

/* rad/s  speed at which the gear's dry friction saturates, as in the plant */
static const double gear_speed = 0.05;

static inline void hx_inverse_dynamics_compile(const hxControllerDefinition *definition,
                                               const hxLegSolver leg[HX_LEGS],
                                               hxInverseDynamics *model) {
  const double *g = definition->gravity;
  double foot[3], sum = 0.0;
  model->period = definition->period;
  model->gravity = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
  model->rotor = definition->servo.rotor_inertia;
  model->friction = definition->servo.coulomb_friction;
  model->drag = definition->servo.drag;
  model->torso_mass = model->total_mass = definition->torso.mass;
  model->torso_inertia = definition->torso.inertia_zz;
  model->torso_com = hx_plane(definition->torso.com[0], definition->torso.com[1]);
  model->torso_com_z = definition->torso.com[2];
  for (int k = 0; k < HX_LEGS; ++k) {
    double offset = 0.0;
    hx_leg_solver_forward(&leg[k], leg[k].stance, foot);
    sum += foot[2];
    model->yaw_inertia[k] = 0.0;
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxKnownLink *link = &definition->leg[k].link[joint];
      model->mass[k][joint] = link->mass;
      model->total_mass += link->mass;
      model->com[k][joint] = hx_plane(link->com[0], link->com[2]);
      model->side[k][joint] = link->com[1] + offset;
      model->yaw_inertia[k] += link->inertia_zz;
      model->pitch_inertia[k][joint] = link->inertia_yy;
      offset += link->offset_y;
    }
  }
  model->floor = sum / HX_LEGS - definition->foot_radius;
}

/* ------------------------------------------------------------------------------------- places */

static inline void hx_inverse_dynamics_place(const hxInverseDynamics *model,
                                             const hxLegSolver leg[HX_LEGS],
                                             const hxPose pose[HX_LEGS], hxPlane way, hxPlane R_WK,
                                             const hxPosture *posture, hxMasses *masses) {
  masses->R_WK = R_WK;
  for (int k = 0; k < HX_LEGS; ++k) {
    const hxPose *p = &pose[k];
    const hxPlane joint = hx_plane(leg[k].coxa_length, leg[k].coxa_height),
                  hip = hx_plane(leg[k].hip[0], leg[k].hip[1]);
    const hxPlane knee = hx_plane_add(joint, hx_scaled(p->femur, leg[k].femur));
    hxPlane *point = masses->point[k];
    point[0] = model->com[k][0];
    point[1] =
        hx_plane_add(joint, hx_times(p->femur, hx_times(leg[k].femur_zero, model->com[k][1])));
    point[2] =
        hx_plane_add(knee, hx_times(p->tibia, hx_times(leg[k].tibia_zero, model->com[k][2])));
    for (int link = 0; link < HX_JOINTS; ++link) {
      hxPlane place =
          hx_plane_add(hip, hx_times(p->heading, hx_plane(point[link].x, model->side[k][link])));
      double height = leg[k].hip[2] + point[link].y;
      hx_posture_turn(posture, &place, &height);
      masses->place[k][link] = place;
      masses->height[k][link] = height + posture->height;
      masses->ground[k][link] = hx_plane_add(way, hx_times(masses->R_WK, place));
    }
  }
  masses->torso_place = model->torso_com;
  masses->torso_height = model->torso_com_z;
  hx_posture_turn(posture, &masses->torso_place, &masses->torso_height);
  masses->torso_height += posture->height;
  masses->torso_ground = hx_plane_add(way, hx_times(masses->R_WK, masses->torso_place));
}

/* ------------------------------------------------------------------------------------- forces */

/* Returns the second difference of three steps. */
static inline double acceleration(double before, double now, double after, double period) {
  return (after - 2.0 * now + before) / (period * period);
}

static inline hxPlane plane_acceleration(hxPlane before, hxPlane now, hxPlane after,
                                         double period) {
  return hx_plane(acceleration(before.x, now.x, after.x, period),
                  acceleration(before.y, now.y, after.y, period));
}

/* Adds m (a + g) of a point, walking frame, to the demand on the ground (C16). */
static inline void add_force(hxPlane push, double lift, hxPlane place, double height, double floor,
                             hxDemand *demand) {
  demand->push = hx_plane_add(demand->push, push);
  demand->weight += lift;
  demand->moment = hx_plane_add(
      demand->moment, hx_plane_sub(hx_scaled(place, lift), hx_scaled(push, height - floor)));
  demand->twist += hx_across(place, push);
}

/* Adds the forces that the torso needs to the demand (C16, C56). */
static inline void demand_torso(const hxInverseDynamics *model, const hxNeighbours *motion,
                                double ratio, hxDemand *demand) {
  const hxMasses *now = motion->masses[1], *before = motion->masses[0], *after = motion->masses[2];
  hxPlane a = {0.0, 0.0}, spin = {0.0, 0.0};
  double up = 0.0;
  if (before && after) {
    a = plane_acceleration(before->torso_ground, now->torso_ground, after->torso_ground,
                           model->period);
    up = acceleration(before->torso_height, now->torso_height, after->torso_height, model->period);
    spin = plane_acceleration(before->R_WK, now->R_WK, after->R_WK, model->period);
  }
  const double pushed = (model->torso_mass + (ratio - 1.0) * model->total_mass) / ratio;
  const hxPlane push = hx_times(hx_scaled(a, pushed), hx_conj(now->R_WK));
  add_force(push, model->torso_mass * (up + model->gravity), now->torso_place, now->torso_height,
            model->floor, demand);
  demand->twist += model->torso_inertia * hx_across(now->R_WK, spin);
}

/* Adds m (a + g) of the links of a leg to the demand (C16, C56), and returns it in the torso
 * frame. */
static inline void demand_links(const hxInverseDynamics *model, const hxNeighbours *motion, int leg,
                                const hxPosture *posture, double ratio, hxPlane push[HX_JOINTS],
                                double lift[HX_JOINTS], hxDemand *demand) {
  const hxMasses *now = motion->masses[1], *before = motion->masses[0], *after = motion->masses[2];
  for (int link = 0; link < HX_JOINTS; ++link) {
    const double mass = model->mass[leg][link];
    hxPlane a = {0.0, 0.0};
    double up = 0.0;
    if (before && after) {
      a = plane_acceleration(before->ground[leg][link], now->ground[leg][link],
                             after->ground[leg][link], model->period);
      up = acceleration(before->height[leg][link], now->height[leg][link], after->height[leg][link],
                        model->period);
    }
    push[link] = hx_times(hx_scaled(a, mass), hx_conj(now->R_WK));
    lift[link] = mass * (up + model->gravity);
    add_force(hx_scaled(push[link], 1.0 / ratio), lift[link], now->place[leg][link],
              now->height[leg][link], model->floor, demand);
    hx_posture_turn_back(posture, &push[link], &lift[link]);
  }
}

/* Computes the joint torques of a leg (C15) from the forces on its links, torso frame. rubs: share
 * of the gears' dry friction that acts; speed: of the joints [rad/s]. */
static inline void demand_torques(const hxInverseDynamics *model, const hxLegSolver *leg,
                                  const hxNeighbours *motion, int k, const hxPlane push[HX_JOINTS],
                                  const double lift[HX_JOINTS], const double rubs[HX_JOINTS],
                                  const double speed[HX_JOINTS], double torque[HX_JOINTS]) {
  const hxPose *now = &motion->pose[1][k];
  const hxPlane *point = motion->masses[1]->point[k],
                joint = hx_plane(leg->coxa_length, leg->coxa_height);
  double turning[HX_JOINTS] = {0.0};
  for (int i = 0; i < HX_JOINTS; ++i) {
    if (motion->pose[0] && motion->pose[2])
      turning[i] = acceleration(motion->pose[0][k].angle[i], now->angle[i],
                                motion->pose[2][k].angle[i], model->period);
    torque[i] = model->rotor * turning[i] + model->friction * rubs[i] + model->drag * speed[i];
  }
  hxPlane inner[HX_JOINTS];
  for (int i = 0; i < HX_JOINTS; ++i) {
    /* tau_1 = sum Im((u + i Y)^* F_h e^-i psi) */
    const hxPlane along = hx_times(push[i], hx_conj(now->heading));
    torque[0] += hx_across(hx_plane(point[i].x, model->side[k][i]), along);
    inner[i] = hx_plane(along.x, lift[i]);
  }
  torque[0] += turning[0] * model->yaw_inertia[k];
  /* tau_2 = sum Im((U - U_femur)^* P)  tau_3 = -Im((U - U_knee)^* P) */
  const double upper = turning[1] * model->pitch_inertia[k][1],
               lower = (turning[1] - turning[2]) * model->pitch_inertia[k][2];
  const hxPlane femur = hx_plane_sub(point[1], joint), whole = hx_plane_sub(point[2], joint);
  const hxPlane tibia = hx_plane_sub(whole, hx_scaled(now->femur, leg->femur));
  torque[1] += hx_across(femur, inner[1]) + hx_across(whole, inner[2]) + upper + lower;
  torque[2] -= hx_across(tibia, inner[2]) + lower;
}

/* Computes J^T of the contact point (C17), a row for each joint. */
static inline void lever_of(const hxLegSolver *leg, const hxPose *pose, const hxPosture *posture,
                            double lever[HX_JOINTS][3]) {
  const hxPlane femur = hx_plane_sub(pose->foot, hx_plane(0.0, leg->radius));
  const hxPlane tibia = hx_plane_sub(femur, hx_scaled(pose->femur, leg->femur)),
                arm[HX_JOINTS] = {{0.0, 0.0}, femur, {-tibia.x, -tibia.y}};
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    hxPlane row = joint == 0 ? hx_plane(-pose->point.y, pose->point.x)
                             : hx_scaled(pose->heading, -arm[joint].y);
    double up = arm[joint].x;
    hx_posture_turn(posture, &row, &up);
    lever[joint][0] = row.x;
    lever[joint][1] = row.y;
    lever[joint][2] = up;
  }
}

/* weight_ratio: measured over modelled weight [1]. The planned loads are scaled by it (C30), but a
 * payload needs no push for the legs, and more for the torso (C56). */
static inline void
hx_inverse_dynamics_demand(const hxInverseDynamics *model, const hxLegSolver leg[HX_LEGS],
                           const hxNeighbours *motion, const double speed[HX_LEGS][HX_JOINTS],
                           const hxPosture *posture, double weight_ratio, hxDemand *demand) {
  hxPlane push[HX_JOINTS];
  double lift[HX_JOINTS];
  double rubs[HX_LEGS * HX_JOINTS];
  memset(demand, 0, sizeof *demand);
  for (int i = 0; i < HX_LEGS * HX_JOINTS; ++i)
    rubs[i] = speed[i / HX_JOINTS][i % HX_JOINTS] / gear_speed;
  hx_saturations(HX_LEGS * HX_JOINTS, rubs, rubs);
  for (int k = 0; k < HX_LEGS; ++k) {
    demand_links(model, motion, k, posture, weight_ratio, push, lift, demand);
    demand_torques(model, &leg[k], motion, k, push, lift, &rubs[k * HX_JOINTS], speed[k],
                   demand->torque[k]);
    lever_of(&leg[k], &motion->pose[1][k], posture, demand->lever[k]);
  }
  demand_torso(model, motion, weight_ratio, demand);
}

#endif
