/* planned_step.h - places the legs for the planned feet of one step. Python:
 * controller/planned_step.py. */
#ifndef HX_PLANNED_STEP_H
#define HX_PLANNED_STEP_H

#include "comply/compliant.h"
#include "comply/sway.h"
#include "walk/command.h"
#include "walk/foot_paths.h"
#include <string.h>

/* One planned step. It depends on the command alone. Feet are in the walking frame. */
typedef struct hxPlannedStep {
  double value[HX_COMMANDS],
      rate[HX_COMMANDS]; /* vx vy yaw_rate height roll pitch, and per second */
  hxPosture posture;
  hxPlannedFeet feet;
  hxPlane torso;              /* m  way of the torso from its nominal place (C54) */
  hxPlane plane[HX_LEGS];     /* m  of the feet from the torso, rolling */
  double activation[HX_LEGS]; /* 1 */
  double lowering[HX_LEGS];   /* m  deformation of the ground */
  double height[HX_LEGS];     /* m  of the lowered feet */
  hxPlane shift[HX_LEGS];     /* m  of contact points, by rolling */
  hxPose pose[HX_LEGS];
  hxMasses masses;
} hxPlannedStep;

/* Constants of the plan of a step. */
typedef struct hxStepPlanner {
  int is_compliant; /* compliant control, which lowers feet */
  hxLegSolver leg[HX_LEGS];
  hxCompliantModel compliant; /* if is_compliant */
  hxSway sway;
} hxStepPlanner;

static inline void hx_step_planner_compile(const hxControllerDefinition *definition,
                                           hxStepPlanner *model) {
  model->is_compliant = definition->control == HX_CONTROL_COMPLIANT;
  for (int k = 0; k < HX_LEGS; ++k) hx_leg_solver_compile(definition, k, &model->leg[k]);
  if (!model->is_compliant) return;
  hx_compliant_compile(definition, model->leg, &model->compliant);
  hx_sway_compile(definition, model->leg, &model->compliant.dynamics, &model->sway);
}

/* Computes the poses of the legs for the feet from the torso. */
static inline void reach_all(const hxLegSolver leg[HX_LEGS], hxPlannedStep *step) {
  hxPlane seen[HX_LEGS];
  double z[HX_LEGS];
  for (int k = 0; k < HX_LEGS; ++k) {
    seen[k] = step->plane[k];
    z[k] = step->height[k];
    hx_posture_to_torso(&step->posture, &seen[k], &z[k]);
  }
  hx_leg_solver_poses(leg, (const hxPlane *)seen, (const double *)z, step->pose);
}

/* Computes by how far the feet's contact points shift because their spheres roll (C9), and the
 * poses of the legs. A tibia that pitches by dB rolls the sphere by -R dB along the outward
 * direction of the leg. The shift s changes B itself: s = R (C + s dC/du) is solved by one Newton
 * step. What is rolled on the way to another position than that of the stance is no shift. */
static inline void place_legs(const hxLegSolver leg[HX_LEGS], hxPlannedStep *step) {
  reach_all(leg, step);
  for (int k = 0; k < HX_LEGS; ++k) {
    const hxPose *pose = &step->pose[k];
    double slope[HX_JOINTS];
    hx_leg_solver_speeds(&leg[k], pose, pose->heading, 0.0, slope);
    const double rolls = hx_leg_solver_rolling(&leg[k], pose->angle) - step->feet.rolled[k];
    step->shift[k] =
        hx_scaled(pose->heading, rolls / (1.0 - leg[k].radius * (slope[2] - slope[1])));
    step->plane[k] = hx_plane_add(step->plane[k], step->shift[k]);
  }
  reach_all(leg, step);
}

/* Computes the poses of the legs and the point masses for a torso that has moved. presence: factors
 * on the activations. */
static inline void stand(const hxStepPlanner *model, const hxGaitClock *clock,
                         const double presence[HX_LEGS], hxPlannedStep *step) {
  memcpy(step->activation, presence, sizeof step->activation);
  for (int k = 0; k < HX_LEGS; ++k) step->plane[k] = hx_plane_sub(step->feet.plane[k], step->torso);
  if (model->is_compliant) {
    hx_compliant_lowered(&model->compliant, clock, step->feet.phase, step->plane, step->activation,
                         step->lowering);
  } else {
    memset(step->lowering, 0, sizeof step->lowering);
  }
  for (int k = 0; k < HX_LEGS; ++k) step->height[k] = step->feet.height[k] - step->lowering[k];
  place_legs(model->leg, step);
  if (!model->is_compliant) return;
  const hxPlane R_WK = hx_cis(step->feet.turn);
  hx_inverse_dynamics_place(&model->compliant.dynamics, model->leg, step->pose,
                            hx_plane_add(step->feet.way, hx_times(R_WK, step->torso)), R_WK,
                            &step->posture, &step->masses);
}

/* Computes way of the torso, poses of the legs and point masses for planned feet. clock: of the
 * gait, in the section of the step; ahead: periods from the present step. */
static inline void hx_step_planner_lay_out(const hxStepPlanner *model, const hxGaitClock *clock,
                                           const hxCompliant *compliant,
                                           const hxAbsenceModel *absent, const hxAbsence *absence,
                                           int64_t ahead, hxPlannedStep *step) {
  const hxSway *sway = &model->sway;
  const double narrowing = compliant->adaptation.narrowing;
  const hxPlane away = hx_absence_torso(absent, absence, ahead);
  double presence[HX_LEGS];
  for (int k = 0; k < HX_LEGS; ++k) presence[k] = hx_absence_presence(absent, absence, k, ahead);
  step->torso = away;
  if (model->is_compliant && hx_sway_acts(sway, narrowing)) {
    const double weight_ratio = hx_load_adaptation_planned_weight_ratio(&compliant->adaptation);
    step->torso = hx_sway_guess(sway, &step->feet, weight_ratio);
    stand(model, clock, presence, step);
    step->torso = hx_plane_add(away, hx_scaled(hx_sway_of(sway, &model->compliant.dynamics,
                                                          step->torso, &step->masses, weight_ratio),
                                               narrowing));
  }
  stand(model, clock, presence, step);
}

/* Returns the weight that moves with the torso over the modelled one [1] (C53). */
static inline double hx_step_planner_weight_ratio(const hxStepPlanner *model,
                                                  const hxCompliant *compliant) {
  return model->sway.active ? hx_load_adaptation_planned_weight_ratio(&compliant->adaptation) : 1.0;
}

#endif
