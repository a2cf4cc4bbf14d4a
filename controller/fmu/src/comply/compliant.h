/* compliant.h - compliant control around its laws, from the sensors to the corrected feet. Python:
 * controller/comply/compliant.py. */
#ifndef HX_COMPLIANT_H
#define HX_COMPLIANT_H

#include "../sense/load_adaptation.h"
#include "../walk/gait_clock.h"
#include "../walk/hold.h"
#include "../walk/swing.h"
#include "force_laws.h"
#include "planned_squeeze.h"
#include "support.h"
#include <string.h>

typedef struct hxCompliantModel {
  double period;     /* s */
  double per_second; /* 1/s   one over the period */
  double leading;    /* steps of the transition of the added velocity */
  hxInverseDynamics dynamics;
  hxSupport support;
  hxPlannedSqueeze squeeze;
  hxForceLawsModel laws;
  hxHoldModel hold;
  hxLoadAdaptationModel adaptation;
} hxCompliantModel;

/* Velocity that steers back to the path, added to the commanded one, with a transition from one
 * value to the next. */
typedef struct hxSteering {
  hxTwist begin, goal;
  int64_t past; /* steps from the start of the transition to the first planned step */
} hxSteering;

typedef struct hxCompliant {
  hxForceLaws laws;
  hxHold hold;
  hxLoadAdaptation adaptation;
  hxSteering steering;
  int64_t count;          /* number of steps */
  double offset[HX_LEGS]; /* m  offsets for early and late touch-downs at the last step */
  int moving;             /* the offsets have just changed */
} hxCompliant;

/* Plan, command and geometry of the present step. */
typedef struct hxPresentStep {
  hxLoadPlan load;
  double climb[HX_LEGS][HX_JOINTS]; /* rad/m  of the joints as a foot rises */
  const double *value;              /* (6) commanded vx vy yaw_rate height roll pitch */
  const hxPosture *posture;
  const hxPlane *plane; /* m  (6) planned feet, walking frame */
  hxPlane torso;        /* m  its way in the walking frame */
  const double *height; /* m  (6) heights of the lowered feet */
  const double *rolled; /* m  (6) outwards from the stance to the positions that the feet aim at */
} hxPresentStep;

/* s  duration of the transition of the added velocity */
static const double steering_time = 0.1;

/* Computes the foot forces in the walking frame (C22) [N]: f_K = R_KT R_TW f_W. */
static inline void hx_sense(const hxControllerInput *input, const hxPosture *posture,
                            double force[HX_LEGS][3]) {
  const double w = input->quaternion[0], x = input->quaternion[1], y = input->quaternion[2],
               z = input->quaternion[3];
  const double xx = x * x, yy = y * y, zz = z * z;
  const double R_WT[3][3] = {{1.0 - 2.0 * (yy + zz), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)},
                             {2.0 * (x * y + w * z), 1.0 - 2.0 * (xx + zz), 2.0 * (y * z - w * x)},
                             {2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (xx + yy)}};
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double *f_W = input->foot_force[leg];
    double f_T[3];
    for (int i = 0; i < 3; ++i)
      f_T[i] = f_W[0] * R_WT[0][i] + f_W[1] * R_WT[1][i] + f_W[2] * R_WT[2][i];
    hxPlane plane = {f_T[0], f_T[1]};
    hx_posture_turn(posture, &plane, &f_T[2]);
    force[leg][0] = plane.x;
    force[leg][1] = plane.y;
    force[leg][2] = f_T[2];
  }
}

static inline void hx_compliant_compile(const hxControllerDefinition *definition,
                                        const hxLegSolver leg[HX_LEGS], hxCompliantModel *model) {
  const double still[HX_LEGS][HX_JOINTS] = {{0.0}}, zero[3] = {0.0};
  hxPose pose[HX_LEGS];
  hxPosture level;
  hxMasses masses;
  hxDemand rest;
  double foot[3];
  model->period = definition->period;
  model->per_second = 1.0 / definition->period;
  model->leading = steering_time / definition->period;
  hx_inverse_dynamics_compile(definition, leg, &model->dynamics);
  for (int k = 0; k < HX_LEGS; ++k) {
    hx_leg_solver_forward(&leg[k], leg[k].stance, foot);
    hx_leg_solver_pose(&leg[k], hx_plane(foot[0], foot[1]), foot[2], &pose[k]);
  }
  hx_posture_of(&level, zero, zero);
  hx_inverse_dynamics_place(&model->dynamics, leg, pose, hx_plane(0.0, 0.0), hx_plane(1.0, 0.0),
                            &level, &masses);
  const hxNeighbours motion = {{NULL, &masses, NULL}, {NULL, pose, NULL}};
  hx_inverse_dynamics_demand(&model->dynamics, leg, &motion, still, &level, 1.0, &rest);
  hx_support_compile(definition, &rest, &model->support);
  const double weight = model->dynamics.total_mass * model->dynamics.gravity;
  hx_force_laws_compile(definition, weight, -model->dynamics.floor, &model->laws);
  hx_planned_squeeze_compile(definition, weight, -model->dynamics.floor, &model->squeeze);
  hx_hold_compile(definition, &model->hold);
  const hxParts *parts = &definition->parts;
  hx_load_adaptation_compile(definition, parts->support ? parts->squeeze : 0.0,
                             parts->support && definition->gait.narrowing > 0.0,
                             &model->adaptation);
}

static inline void hx_compliant_reset(const hxCompliantModel *model, hxCompliant *compliant) {
  memset(compliant, 0, sizeof *compliant);
  hx_force_laws_reset(&compliant->laws);
  hx_load_adaptation_reset(&model->adaptation, &compliant->adaptation);
}

/* Computes the planned loads of a step whose feet and contacts are set (C19, C20, C42). The moment
 * of the demand becomes that about the measured centre of mass. height, rise: as for
 * hx_plan_load. */
static inline void hx_compliant_plan(const hxCompliantModel *model, const hxCompliant *compliant,
                                     const double height[HX_LEGS], const double rise[HX_LEGS],
                                     hxDemand *demand, hxLoadPlan *plan) {
  demand->moment = hx_plane_add(demand->moment, hx_scaled(compliant->laws.lean, demand->weight));
  hx_support_shares(plan->feet, demand, &plan->shares);
  hx_planned_squeeze_add(&model->squeeze, plan->feet, demand, compliant->adaptation.squeeze,
                         &plan->shares);
  hx_plan_load(model->support.active, model->period, demand, height, rise, plan);
}

/* Computes the activations of the legs and the lowering of their feet [m] by the depth to which the
 * ground will deform under their loads. phase: of the legs; plane: feet, walking frame [m]; clock:
 * of the gait, in the section of the step; activation: factors of the legs before. */
static inline void hx_compliant_lowered(const hxCompliantModel *model, const hxGaitClock *clock,
                                        const double phase[HX_LEGS], const hxPlane plane[HX_LEGS],
                                        double activation[HX_LEGS], double lowering[HX_LEGS]) {
  for (int k = 0; k < HX_LEGS; ++k)
    activation[k] =
        clock->awaited[k]
            ? 0.0
            : activation[k] * hx_support_activation(&model->support, phase[k], clock->stayed[k],
                                                    clock->stays[k], clock->walking);
  hx_support_lowering(&model->support, plane, activation, lowering);
}

/* ----------------------------------------------------------------------------------- steering */

/* Returns what is added to the commanded velocity a number of periods after the first planned step
 * (C40). */
static inline hxTwist hx_compliant_addition(const hxCompliantModel *model,
                                            const hxCompliant *compliant, int64_t steps) {
  const hxSteering *s = &compliant->steering;
  const double part = hx_smaller((double)(s->past + steps) / model->leading, 1.0);
  return (hxTwist){hx_plane_add(s->begin.velocity,
                                hx_scaled(hx_plane_sub(s->goal.velocity, s->begin.velocity), part)),
                   s->begin.yaw_rate + (s->goal.yaw_rate - s->begin.yaw_rate) * part};
}

/* Called before new steps are planned: takes over the corrections of the slow loops, when a leg
 * lifts off or touches down (afresh), and at a stop (not moves) (C40). steps: periods since the
 * last planning. */
static inline void hx_compliant_steer(const hxCompliantModel *model, int64_t steps, int moves,
                                      int afresh, hxCompliant *compliant) {
  hxSteering *s = &compliant->steering;
  const hxTwist none = {{0.0, 0.0}, 0.0},
                lost = {compliant->hold.velocity, compliant->hold.yaw_rate};
  s->past += steps;
  const int added =
      s->goal.velocity.x != 0.0 || s->goal.velocity.y != 0.0 || s->goal.yaw_rate != 0.0;
  if (!afresh && (moves || !added)) return;
  s->begin = hx_compliant_addition(model, compliant, 0);
  s->goal = moves ? lost : none;
  s->past = 0;
}

/* ------------------------------------------------------------------------------------ sensors */

/* Passes the measured positions of the standing feet to the slow loops. */
static inline void update_hold(const hxCompliantModel *model, const hxLegSolver leg[HX_LEGS],
                               const hxPresentStep *present, const hxControllerInput *input,
                               hxCompliant *compliant) {
  const double w = input->quaternion[0], x = input->quaternion[1], y = input->quaternion[2],
               z = input->quaternion[3];
  hxHoldInput seen;
  double foot[3];
  for (int k = 0; k < HX_LEGS; ++k) {
    const double *angle = input->angle[k];
    hx_leg_solver_forward(&leg[k], angle, foot);
    seen.plane[k] = hx_plane(foot[0], foot[1]);
    seen.height[k] = foot[2];
    hx_posture_turn(present->posture, &seen.plane[k], &seen.height[k]);
    const double rolls = hx_leg_solver_rolling(&leg[k], angle) - present->rolled[k];
    const hxPlane rolled = hx_scaled(hx_cis(leg[k].hip_yaw + angle[0]), rolls);
    seen.plane[k] = hx_plane_add(hx_plane_sub(seen.plane[k], rolled), present->torso);
    seen.height[k] += present->value[3];
    seen.planned[k] = present->plane[k];
    seen.planned_height[k] = present->height[k];
    seen.load[k] = compliant->laws.load[k];
  }
  const double rise = hx_clamp(2.0 * (w * y - z * x), -1.0, 1.0);
  seen.tilt[0] = hx_arc(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)) - present->value[4];
  seen.tilt[1] = hx_arc(rise, sqrt((1.0 - rise) * (1.0 + rise))) - present->value[5];
  seen.yaw = hx_arc(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
  seen.velocity = hx_plane(present->value[0], present->value[1]);
  seen.yaw_rate = present->value[2];
  hx_hold_update(&model->hold, &seen, &compliant->hold);
}

/* --------------------------------------------------------------------------------------- step */

/* Computes the joint angles of a leg with the foot raised (C41). */
static inline void correct(const hxLegSolver *leg, const double climb[HX_JOINTS], double raised,
                           double angle[HX_JOINTS]) {
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    angle[joint] = hx_clamp(angle[joint] + climb[joint] * raised, leg->angle_min[joint],
                            leg->angle_max[joint]);
}

/* Advances by one period: corrects the joint commands of this step in place (C41). */
static inline void hx_compliant_step(const hxCompliantModel *model, const hxLegSolver leg[HX_LEGS],
                                     const hxPresentStep *present, const hxControllerInput *input,
                                     hxCompliant *compliant, hxControllerOutput *output) {
  hxForceLaws *laws = &compliant->laws;
  double force[HX_LEGS][3];
  hx_sense(input, present->posture, force);
  hx_force_laws_step(&model->laws, &present->load, force, laws);
  if (compliant->count % model->hold.every == 0) {
    if (laws->trust.level == 1.0)
      update_hold(model, leg, present, input, compliant);
    else
      memset(&compliant->hold, 0, sizeof compliant->hold);
  }
  ++compliant->count;
  int busy;
  const double *offsets = hx_force_laws_raised(laws, &busy);
  for (int k = 0; k < HX_LEGS; ++k) {
    const double offset = offsets[k], raised = offset + compliant->hold.lift[k];
    correct(&leg[k], present->climb[k], raised, output->angle_ref[k]);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      double *speed = &output->speed_ref[k][joint];
      if (busy || compliant->moving)
        *speed = hx_clamp(*speed + present->climb[k][joint] *
                                       ((offset - compliant->offset[k]) * model->per_second),
                          -leg[k].speed_max, leg[k].speed_max);
      output->torque_ref[k][joint] = laws->torque[k][joint];
    }
    if (busy || compliant->moving) compliant->offset[k] = offset;
    output->fallback[k] = laws->fallback;
    output->doubted[k] = laws->doubted[k];
    output->shift[k][0] = output->shift[k][1] = 0.0;
    output->lift[k] = raised;
  }
  if (busy || compliant->moving) compliant->moving = busy;
  const double needed = hx_force_laws_needed(&model->laws, laws);
  hx_load_adaptation_weigh(&model->adaptation, laws->limit.weight_ratio, &compliant->adaptation);
  hx_load_adaptation_step(&model->adaptation, (const double (*)[HX_JOINTS])laws->torque, needed,
                          laws->squeeze_share, &compliant->adaptation);
}

#endif
