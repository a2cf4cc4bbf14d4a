/* sway.h - sway of the torso against the swinging legs (C54). Python: controller/comply/sway.py. */
#ifndef HX_SWAY_H
#define HX_SWAY_H

#include "../walk/foot_paths.h"
#include "../walk/inverse_dynamics.h"

typedef struct hxSway {
  int active;            /* the part is on */
  double forward, aside; /* 1    share of the mass that moves with all feet; 0 without the part */
  double mass;           /* kg    of the robot */
  hxPlane home;          /* m    sum of the feet in the stance */
  hxPlane rest;          /* kg m    sum of m p of all links in the stance */
} hxSway;

/* m  by which all feet are moved to find the mass that moves with them */
static const double reach = 1e-3;

/* Returns the sum of m p of all links with all feet moved from the stance [kg m]. */
static inline hxPlane moment_of(const hxInverseDynamics *dynamics, const hxLegSolver leg[HX_LEGS],
                                hxPlane step) {
  const double zero[3] = {0.0};
  hxPlane sum = {0.0, 0.0};
  hxPose pose[HX_LEGS];
  hxPosture level;
  hxMasses masses;
  double foot[3];
  for (int k = 0; k < HX_LEGS; ++k) {
    hx_leg_solver_forward(&leg[k], leg[k].stance, foot);
    hx_leg_solver_pose(&leg[k], hx_plane_add(hx_plane(foot[0], foot[1]), step), foot[2], &pose[k]);
  }
  hx_posture_of(&level, zero, zero);
  hx_inverse_dynamics_place(dynamics, leg, pose, hx_plane(0.0, 0.0), hx_plane(1.0, 0.0), &level,
                            &masses);
  for (int k = 0; k < HX_LEGS; ++k)
    for (int link = 0; link < HX_JOINTS; ++link)
      sum = hx_plane_add(sum, hx_scaled(masses.place[k][link], dynamics->mass[k][link]));
  return sum;
}

/* Returns the share of the mass that moves with all feet, in a direction of length `reach`. */
static inline double share_of(const hxInverseDynamics *dynamics, const hxLegSolver leg[HX_LEGS],
                              hxPlane way) {
  const hxPlane moved =
      hx_plane_sub(moment_of(dynamics, leg, way), moment_of(dynamics, leg, hx_scaled(way, -1.0)));
  const double carried = hx_along(way, moved) / (2.0 * reach * reach);
  return carried / dynamics->total_mass;
}

static inline void hx_sway_compile(const hxControllerDefinition *definition,
                                   const hxLegSolver leg[HX_LEGS],
                                   const hxInverseDynamics *dynamics, hxSway *model) {
  double foot[3];
  model->active = definition->parts.sway;
  model->mass = dynamics->total_mass;
  model->home = model->rest = hx_plane(0.0, 0.0);
  for (int k = 0; k < HX_LEGS; ++k) {
    hx_leg_solver_forward(&leg[k], leg[k].stance, foot);
    model->home = hx_plane_add(model->home, hx_plane(foot[0], foot[1]));
  }
  model->forward = model->aside = 0.0;
  if (!model->active) return;
  model->forward = share_of(dynamics, leg, hx_plane(reach, 0.0));
  model->aside = share_of(dynamics, leg, hx_plane(0.0, reach));
  model->rest = moment_of(dynamics, leg, hx_plane(0.0, 0.0));
}

/* Returns whether the torso sways. narrowing: part of the way to the narrow stance [1]. */
static inline int hx_sway_acts(const hxSway *model, double narrowing) {
  return model->active && narrowing > 0.0;
}

/* Returns the way of the torso that gives the robot another sum of m p [kg m]. ratio: measured over
 * modelled weight [1]. */
static inline hxPlane yield_to(const hxSway *model, hxPlane moment, double ratio) {
  return hx_plane(moment.x / (model->mass * (ratio - model->forward)),
                  moment.y / (model->mass * (ratio - model->aside)));
}

/* Returns nearly the whole way of the torso in the walking frame, by the shares [m]. */
static inline hxPlane hx_sway_guess(const hxSway *model, const hxPlannedFeet *feet,
                                    double weight_ratio) {
  const double mass = model->mass / HX_LEGS;
  hxPlane away = hx_scaled(model->home, -1.0);
  for (int k = 0; k < HX_LEGS; ++k) away = hx_plane_add(away, feet->plane[k]);
  away = hx_plane(model->forward * mass * away.x, model->aside * mass * away.y);
  return hx_scaled(yield_to(model, away, weight_ratio), -1.0);
}

/* Returns the way of the torso in the walking frame [m] (C54). masses: of a torso that has moved by
 * the guess. */
static inline hxPlane hx_sway_of(const hxSway *model, const hxInverseDynamics *dynamics,
                                 hxPlane guess, const hxMasses *masses, double weight_ratio) {
  hxPlane moved = hx_plane_sub(hx_scaled(guess, weight_ratio * model->mass), model->rest);
  for (int k = 0; k < HX_LEGS; ++k)
    for (int link = 0; link < HX_JOINTS; ++link)
      moved = hx_plane_add(moved, hx_scaled(masses->place[k][link], dynamics->mass[k][link]));
  return hx_plane_sub(guess, yield_to(model, moved, weight_ratio));
}

#endif
