/* plan.h - plans the steps of a walk: three of them, before, at and after the present one. Python:
 * controller/plan.py. */
#ifndef HX_PLAN_H
#define HX_PLAN_H

#include "planned_step.h"
#include "walk/pace.h"

typedef struct hxWalkPlanModel {
  double period; /* s */
  hxStepPlanner planner;
  hxCommandRampModel ramp;
  hxPaceModel pace;
  hxFootPathsModel paths;
  hxAbsenceModel absent;
} hxWalkPlanModel;

typedef struct hxWalkPlan {
  hxPace pace;
  hxCommandRamp ramp; /* of the share of the command that the joints can follow */
  hxFootPaths paths;
  hxAbsence absence;
  int64_t at;   /* the present step, counted from the begin of its section */
  int64_t last; /* the step at which the ramp ends, where a new section begins */
  int cut;      /* the present step is the last of its section: a leg lifts off or touches down */
  int has_before, has_after; /* the neighbours of the present step are planned */
  int present;               /* index of the present step in `step`, a ring buffer */
  hxPlannedStep step[3];
} hxWalkPlan;

static inline void hx_walk_plan_compile(const hxControllerDefinition *definition,
                                        hxWalkPlanModel *model) {
  model->period = definition->period;
  hx_step_planner_compile(definition, &model->planner);
  hx_command_ramp_compile(definition->gait.period, definition->period, &model->ramp);
  hx_foot_paths_compile(definition, model->planner.leg, &model->paths);
  hx_pace_compile(&model->paths, &model->pace);
  if (model->planner.is_compliant)
    model->paths.clock.handover = model->planner.compliant.support.handover;
  hx_absence_compile(model->paths.home, model->paths.clock.handover * definition->gait.period,
                     model->period, &model->absent);
}

/* Index of a planned step: -1 is the previous one, 0 the present one, 1 the next one. */
static inline hxPlannedStep *hx_walk_plan_step(hxWalkPlan *plan, int neighbour) {
  return &plan->step[(plan->present + neighbour + 3) % 3];
}

/* -------------------------------------------------------------------------------- the command */

/* Aims at the share of a command that the joints can follow in the gait (C59). Returns whether the
 * plan no longer applies. */
HX_RARE int set_pace(const hxWalkPlanModel *model, const double command[HX_COMMANDS],
                     hxWalkPlan *plan) {
  hxStride stride = {.leg = model->planner.leg,
                     .model = &model->paths,
                     .paths = &plan->paths,
                     .absence = &plan->absence};
  double target[HX_COMMANDS];
  hx_pace_follow(&model->pace, &stride, command, &plan->pace, target);
  return hx_command_ramp_aim(&model->ramp, target, &plan->ramp);
}

/* Leads the body to a command, as far as the joints can follow it. Returns as set_pace(). */
static inline int hx_walk_plan_aim(const hxWalkPlanModel *model, const double command[HX_COMMANDS],
                                   hxWalkPlan *plan) {
  int same = 1;
  for (int i = 0; i < HX_COMMANDS; ++i) same &= command[i] == plan->pace.asked[i];
  return !same && set_pace(model, command, plan);
}

/* ------------------------------------------------------------------------------------- a step */

/* Computes the command a number of periods ahead, including the posture, and returns the motion of
 * the body. number: periods since the section began. */
static inline hxTwist look_ahead(const hxWalkPlanModel *model, const hxCompliant *compliant,
                                 const hxWalkPlan *plan, int64_t ahead, int64_t number,
                                 hxPlannedStep *step) {
  hx_command_ramp_ahead(&model->ramp, &plan->ramp, ahead, step->value, step->rate);
  const hxPlane drift = hx_absence_drift(&model->absent, &plan->absence, ahead);
  step->value[0] += drift.x;
  step->value[1] += drift.y;
  hx_posture_of(&step->posture, step->value + 3, step->rate + 3);
  const hxTwist twist = {{step->value[0], step->value[1]}, step->value[2]};
  if (!model->planner.is_compliant) return twist;
  const hxTwist added = hx_compliant_addition(&model->planner.compliant, compliant, number);
  return (hxTwist){hx_plane_add(twist.velocity, added.velocity), twist.yaw_rate + added.yaw_rate};
}

/* Places the legs for planned feet. ahead: periods from the present step. */
static inline void lay_out(const hxWalkPlanModel *model, const hxCompliant *compliant,
                           const hxWalkPlan *plan, int64_t ahead, hxPlannedStep *step) {
  hx_step_planner_lay_out(&model->planner, &plan->paths.clock, compliant, &model->absent,
                          &plan->absence, ahead, step);
}

/* Plans to stand in the stance. */
static inline void hx_walk_plan_reset(const hxWalkPlanModel *model, const hxCompliant *compliant,
                                      hxWalkPlan *plan) {
  hxPlannedStep *step = hx_walk_plan_step(plan, 0);
  hx_command_ramp_reset(&model->ramp, &plan->ramp);
  plan->cut = 1;
  hx_absence_reset(&model->absent, &plan->absence);
  hx_foot_paths_reset(&model->paths, &plan->paths, &step->feet);
  look_ahead(model, compliant, plan, 0, 0, step);
  lay_out(model, compliant, plan, 0, step);
}

/* Plans the step a number of periods after the section began. before: the step before it. */
static inline void plan_step(const hxWalkPlanModel *model, const hxCompliant *compliant,
                             const hxWalkPlan *plan, int64_t number, const hxPlannedStep *before,
                             hxPlannedStep *step) {
  const hxTwist twist = look_ahead(model, compliant, plan, 1, number, step);
  hx_foot_paths_walk(&model->paths, &plan->paths, number, twist, &before->feet, &step->feet);
  lay_out(model, compliant, plan, 1, step);
}

/* ----------------------------------------------------------------------------------- sections */

/* Notes which feet have met the ground on their way down (C51), and narrows the stance: the steps
 * of a commanded motion aim at the stance that the weight asks for (C53). */
static inline void follow_sensors(const hxWalkPlanModel *model, const hxCompliant *compliant,
                                  hxWalkPlan *plan) {
  const hxPlannedFeet *feet = &hx_walk_plan_step(plan, 0)->feet;
  hxFootPaths *paths = &plan->paths;
  for (int k = 0; k < HX_LEGS; ++k)
    paths->met[k] = paths->clock.swinging[k] && feet->rise[k] < 0.0 &&
                    hx_force_laws_meets(&model->planner.compliant.laws, k, &compliant->laws);
  if (hx_command_ramp_moves(&plan->ramp)) paths->narrowing = compliant->adaptation.narrowing;
}

/* Returns whether the gait clock waits for feet at the ends of their swings (C50). It does not
 * without two legs, because a foot may then have no load to carry. */
static inline int waits(const hxWalkPlanModel *model, const hxCompliant *compliant,
                        const hxWalkPlan *plan) {
  const hxGaitClock *clock = &plan->paths.clock;
  int landing[HX_LEGS], absent = 0;
  for (int k = 0; k < HX_LEGS; ++k) absent += clock->absent[k];
  if (!model->planner.is_compliant || absent > 1) return 0;
  hx_gait_clock_landing(&model->paths.clock, clock, plan->at, landing);
  return hx_force_laws_waits(&model->planner.compliant.laws, landing, clock->waiting,
                             &compliant->laws);
}

/* Begins a new section at the present step, and plans the next step. waiting: the gait clock stands
 * still in it. */
static inline void plan_afresh(const hxWalkPlanModel *model, int waiting, hxCompliant *compliant,
                               hxWalkPlan *plan) {
  const int moves = hx_command_ramp_moves(&plan->ramp),
            settled = hx_command_ramp_settled(&model->ramp, &plan->ramp);
  hxPlannedStep *first = hx_walk_plan_step(plan, 0);
  const hxPlannedFeet now = first->feet;
  if (model->planner.is_compliant)
    hx_compliant_steer(&model->planner.compliant, plan->at, moves, plan->cut, compliant);
  const hxTwist twist = look_ahead(model, compliant, plan, 0, 0, first);
  if (waiting)
    hx_foot_paths_hold(&model->paths, &now, plan->at, twist, &plan->paths, &first->feet);
  else
    hx_foot_paths_plan(&model->paths, &now, plan->at, moves || !settled, twist, &plan->paths,
                       &first->feet);
  lay_out(model, compliant, plan, 0, first);
  plan->last = moves || settled ? INT64_MAX : model->ramp.end - plan->ramp.steps;
  plan->at = 0;
  plan_step(model, compliant, plan, 1, first, hx_walk_plan_step(plan, 1));
}

/* Makes the planned step the present one, and plans the step after it. command_changed: the plan no
 * longer applies, and a new section begins. */
static inline void hx_walk_plan_advance(const hxWalkPlanModel *model, int command_changed,
                                        hxCompliant *compliant, hxWalkPlan *plan) {
  const int due = command_changed || !plan->has_after;
  if (model->planner.is_compliant) follow_sensors(model, compliant, plan);
  if (due || plan->paths.clock.waiting) {
    const int waiting = waits(model, compliant, plan);
    if (due || !waiting) plan_afresh(model, waiting, compliant, plan);
  }
  plan->present = (plan->present + 1) % 3;
  ++plan->at;
  ++plan->ramp.steps;
  ++plan->absence.since;
  const int64_t next = plan->at + 1;
  int reached = hx_gait_clock_reach(&model->paths.clock, &plan->paths.clock, next);
  for (int k = 0; k < HX_LEGS; ++k)
    reached &=
        !hx_foot_paths_down(&model->paths, &plan->paths, &hx_walk_plan_step(plan, 0)->feet, k);
  plan->has_before = 1;
  plan->has_after = reached && next <= plan->last;
  plan->cut = !reached && next <= plan->last;
  if (plan->has_after)
    plan_step(model, compliant, plan, next, hx_walk_plan_step(plan, 0), hx_walk_plan_step(plan, 1));
}

/* ----------------------------------------------------------------- change of gait and control */

/* Lets the legs finish their steps and begin no other (C55). */
static inline void hx_walk_plan_end(hxWalkPlan *plan) {
  plan->has_after = 0;
  plan->paths.clock.ending = plan->paths.clock.walking;
}

/* Returns whether all legs stand and carry their whole loads. */
static inline int hx_walk_plan_ended(hxWalkPlan *plan) {
  int ended = hx_gait_clock_ended(&plan->paths.clock);
  if (!plan->paths.clock.walking) return 1;
  for (int k = 0; k < HX_LEGS; ++k)
    ended &= plan->paths.clock.absent[k] || hx_walk_plan_step(plan, 0)->activation[k] >= 1.0;
  return ended;
}

/* Takes lost legs out of service (C58). Those that stand and are bearing, that is can bear a load,
 * wait until no other leg swings. last: the last commands. Returns whether any is new. */
static inline int hx_walk_plan_lose(const hxWalkPlanModel *model, const int lost[HX_LEGS],
                                    const int bearing[HX_LEGS], const hxControllerOutput *last,
                                    hxWalkPlan *plan) {
  hxGaitClock *clock = &plan->paths.clock;
  int gone[HX_LEGS], swings = 0, waits = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) swings |= clock->swinging[leg] && !lost[leg];
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const int stands = bearing[leg] && !clock->swinging[leg] && !plan->absence.legs[leg],
              stays = lost[leg] && stands && swings && hx_absence_has_room(&plan->absence);
    gone[leg] = lost[leg] && !stays;
    waits |= stays;
  }
  const int new = hx_absence_change(&model->absent, gone, last, &plan->absence);
  if (new || (waits && !hx_gait_clock_drops(clock))) {
    memcpy(clock->absent, plan->absence.legs, sizeof clock->absent);
    hx_gait_clock_drop(clock);
    hx_walk_plan_end(plan);
  }
  return new;
}

/* Goes on with the standing feet and the command in another gait (C55). before: the model of the
 * gait so far; returning_leg: a leg that is back in service (C58), -1: none. */
HX_RARE void hx_walk_plan_adopt(hxWalkPlanModel *model, const hxWalkPlanModel *before,
                                int returning_leg, hxWalkPlan *plan) {
  hx_command_ramp_carry(&model->ramp, &before->ramp, &plan->ramp);
  if (returning_leg >= 0) hx_absence_take_back(&model->absent, returning_leg, &plan->absence);
  memcpy(plan->paths.clock.absent, plan->absence.legs, sizeof plan->absence.legs);
  hx_foot_paths_join(&model->paths, &plan->paths, &hx_walk_plan_step(plan, 0)->feet, returning_leg);
  plan->has_after = 0;
  plan->at = 0;
  plan->last = INT64_MAX;
  plan->cut = 1;
  set_pace(model, plan->pace.asked, plan);
}

/* Goes on in the phase of the plan under another control, in the same gait. before: the paths'
 * model under the control before. */
HX_RARE void hx_walk_plan_carry(hxWalkPlanModel *model, const hxFootPathsModel *before,
                                hxWalkPlan *plan) {
  hxGaitClockModel *clock = &model->paths.clock;
  memcpy(clock->offset, before->clock.offset, sizeof clock->offset);
  memcpy(clock->late, before->clock.late, sizeof clock->late);
  memset(plan->paths.met, 0, sizeof plan->paths.met);
  if (!model->planner.is_compliant) plan->paths.narrowing = 0.0;
  plan->has_after = 0;
  plan->cut = 1;
}

/* --------------------------------------------------------------------------- the present step */

/* Returns the rate of a quantity at the present step, one-sided at the end of a section. */
static inline double rate_of(const hxWalkPlan *plan, double before, double now, double after,
                             double period) {
  if (plan->has_after && plan->has_before) return (after - before) / (2.0 * period);
  return plan->has_before ? (now - before) / period : 0.0;
}

/* Returns the rate of a vector of a plane at the present step. */
static inline hxPlane rate_of_plane(const hxWalkPlan *plan, hxPlane before, hxPlane now,
                                    hxPlane after, double period) {
  return hx_plane(rate_of(plan, before.x, now.x, after.x, period),
                  rate_of(plan, before.y, now.y, after.y, period));
}

/* Computes the centre of a foot as the command plans it: on its path, rolling, not lowered. */
static inline void hx_walk_plan_centre(hxWalkPlan *plan, int k, double centre[3]) {
  const hxPlannedStep *now = hx_walk_plan_step(plan, 0);
  hxPlane plane = now->plane[k];
  double height = now->feet.height[k];
  hx_posture_to_torso(&now->posture, &plane, &height);
  centre[0] = plane.x;
  centre[1] = plane.y;
  centre[2] = height;
}

/* Computes a foot of the present step with rolling and lowering, torso frame [m, m/s]. */
static inline void hx_walk_plan_foot(const hxWalkPlanModel *model, hxWalkPlan *plan, int k,
                                     hxPlane *plane, double *height, hxPlane *velocity,
                                     double *rise) {
  const double period = model->period;
  const hxPlannedStep *before = hx_walk_plan_step(plan, -1), *now = hx_walk_plan_step(plan, 0),
                      *after = hx_walk_plan_step(plan, 1);
  const hxPlane rolling =
                    rate_of_plane(plan, before->shift[k], now->shift[k], after->shift[k], period),
                swaying = rate_of_plane(plan, before->torso, now->torso, after->torso, period);
  *plane = now->plane[k];
  *velocity = hx_plane_add(hx_plane_sub(now->feet.velocity[k], swaying), rolling);
  *height = now->height[k];
  *rise = now->feet.rise[k] -
          rate_of(plan, before->lowering[k], now->lowering[k], after->lowering[k], period);
  hx_posture_feet_to_torso(&now->posture, plane, height, velocity, rise);
}

/* Returns the height of the path of a foot over the stance [m]. */
static inline double hx_walk_plan_lift(const hxWalkPlanModel *model, hxWalkPlan *plan, int k) {
  if (plan->paths.clock.absent[k]) return 0.0;
  return hx_walk_plan_step(plan, 0)->feet.height[k] - model->paths.home_height[k];
}

/* Returns the step after (else before) the present one, NULL when there is none, and its time from
 * there in *time [s]. */
static inline const hxPlannedStep *hx_walk_plan_neighbour(const hxWalkPlanModel *model,
                                                          hxWalkPlan *plan, double *time) {
  *time = plan->has_after ? model->period : -model->period;
  if (plan->has_after) return hx_walk_plan_step(plan, 1);
  return plan->has_before ? hx_walk_plan_step(plan, -1) : NULL;
}

/* Returns the masses and poses of the three steps; at the ends of sections, of one alone. */
static inline hxNeighbours hx_walk_plan_motion(hxWalkPlan *plan) {
  const hxPlannedStep *before = hx_walk_plan_step(plan, -1), *now = hx_walk_plan_step(plan, 0),
                      *after = hx_walk_plan_step(plan, 1);
  if (!plan->has_before || !plan->has_after)
    return (hxNeighbours){{NULL, &now->masses, NULL}, {NULL, now->pose, NULL}};
  return (hxNeighbours){{&before->masses, &now->masses, &after->masses},
                        {before->pose, now->pose, after->pose}};
}

/* Fills the planned loads and the geometry of the present step for the laws (C15 to C20). speed: of
 * the joints [rad/s]. */
static inline void hx_walk_plan_present_step(const hxWalkPlanModel *model,
                                             const hxCompliant *compliant,
                                             double speed[HX_LEGS][HX_JOINTS], hxWalkPlan *plan,
                                             hxPresentStep *present) {
  const hxStepPlanner *planner = &model->planner;
  const hxPlannedStep *now = hx_walk_plan_step(plan, 0);
  const hxNeighbours motion = hx_walk_plan_motion(plan);
  hxLoadPlan *load = &present->load;
  double height[HX_LEGS];
  hxDemand demand;
  hx_inverse_dynamics_demand(&planner->compliant.dynamics, planner->leg, &motion,
                             (const double (*)[HX_JOINTS])speed, &now->posture,
                             hx_step_planner_weight_ratio(planner, compliant), &demand);
  for (int k = 0; k < HX_LEGS; ++k) {
    load->feet[k] = now->plane[k];
    height[k] = hx_walk_plan_lift(model, plan, k);
    load->shares.activation[k] = now->activation[k];
    load->swinging[k] = plan->paths.clock.swinging[k];
    load->awaited[k] = plan->paths.clock.awaited[k];
    hx_leg_solver_speeds(&planner->leg[k], &now->pose[k], hx_plane(0.0, 0.0), 1.0,
                         present->climb[k]);
  }
  hx_compliant_plan(&planner->compliant, compliant, height, now->feet.rise, &demand, load);
  present->value = now->value;
  present->posture = &now->posture;
  present->plane = now->feet.plane;
  present->torso = now->torso;
  present->height = now->height;
  present->rolled = now->feet.rolled;
}

#endif
