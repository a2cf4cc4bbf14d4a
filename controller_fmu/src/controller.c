#include "controller.h"

#include <string.h>

void hx_controller_compile(const hxControllerDefinition *definition, hxControllerModel *model) {
  memset(model, 0, sizeof *model);
  model->period = definition->period;
  model->compliant = definition->control == HX_CONTROL_COMPLIANT;
  for (int k = 0; k < HX_LEGS; ++k) hx_leg_compile(definition, k, &model->leg[k]);
  hx_ramp_compile(definition->gait.period, definition->period, &model->ramp);
  hx_paths_compile(definition, model->leg, &model->paths);
  if (model->compliant) hx_compliant_compile(definition, model->leg, &model->laws);
}

/* ----------------------------------------------------------------------------------------------
 * planning */

static hxRow *row_at(hxControllerState *state, int neighbour) {
  return &state->row[(state->present + neighbour + 3) % 3];
}

/* the command so many steps ahead, posture included; returns the body's motion by it */
static hxTwist look_ahead(const hxControllerModel *model, const hxControllerState *state,
                          int64_t ahead, int64_t number, hxRow *row) {
  hx_ramp_ahead(&model->ramp, &state->ramp, ahead, row->value, row->rate);
  hx_posture_set(&row->posture, row->value + 3, row->rate + 3);
  hxTwist twist = {{row->value[0], row->value[1]}, row->value[2]};
  if (model->compliant) {
    const hxTwist added = hx_compliant_addition(&model->laws, &state->compliant, number);
    twist = (hxTwist){hx_add(twist.velocity, added.velocity), twist.yaw_rate + added.yaw_rate};
  }
  return twist;
}

/* planned feet lowered by what the ground will give way under their loads */
static void lower(const hxControllerModel *model, const hxPaths *paths, hxRow *row) {
  const hxSupportModel *support = &model->laws.support;
  for (int k = 0; k < HX_LEGS; ++k) {
    row->lowering[k] = 0.0;
    if (model->compliant)
      row->activation[k] = hx_support_activation(support, row->steps.phase[k], paths->stayed[k],
                                                 paths->stays[k], paths->walking);
    else
      row->activation[k] = 1.0;
  }
  if (model->compliant && model->laws.laws.parts.support)
    hx_support_lowering(support, row->steps.plane, row->activation, row->lowering);
  for (int k = 0; k < HX_LEGS; ++k) row->height[k] = row->steps.height[k] - row->lowering[k];
}

/* The leg, with the ground rolling off the round foot along the planned path. A tibia that pitches
 * by dB rolls its foot's sphere by -R dB along the leg's outward direction. The shift s changes B
 * itself: s = R (C + s dC/du), C = q_3 - q_2 less that of the stance, is solved by one Newton step.
 */
static void place_leg(const hxLegModel *leg, const hxPosture *posture, hxPlane plane, double height,
                      hxPlane *shift, hxPose *pose) {
  double slope[HX_JOINTS], z = height;
  hxPlane seen = plane;
  hx_posture_see_place(posture, &seen, &z);
  hx_leg_pose(leg, seen, z, pose);
  hx_leg_speeds(leg, pose, pose->heading, 0.0, slope);
  *shift = hx_scaled(pose->heading, hx_leg_rolling(leg, pose->angle) /
                                        (1.0 - leg->radius * (slope[2] - slope[1])));
  seen = hx_add(plane, *shift);
  z = height;
  hx_posture_see_place(posture, &seen, &z);
  hx_leg_pose(leg, seen, z, pose);
}

/* turns a planned step, whose steps are known, into legs */
static void lay_out(const hxControllerModel *model, const hxPaths *paths, hxRow *row) {
  lower(model, paths, row);
  for (int k = 0; k < HX_LEGS; ++k)
    place_leg(&model->leg[k], &row->posture, row->steps.plane[k], row->height[k], &row->shift[k],
              &row->pose[k]);
  if (model->compliant)
    hx_dynamics_place(&model->laws.dynamics, model->leg, row->pose, row->steps.way, row->steps.turn,
                      &row->posture, &row->masses);
}

/* the step `number` after where the planning began, `ahead` of the present command, into the row
 * after `before` */
static void plan_step(const hxControllerModel *model, const hxControllerState *state,
                      int64_t number, int64_t ahead, const hxRow *before, hxRow *row) {
  const hxTwist twist = look_ahead(model, state, ahead, number, row);
  hx_paths_walk(&model->paths, &state->paths, number, twist, &before->steps, &row->steps);
  lay_out(model, &state->paths, row);
}

/* begins to plan from the present step on: it becomes the one before */
static void plan_afresh(const hxControllerModel *model, hxControllerState *state) {
  const int moves = hx_ramp_moves(&state->ramp),
            settled = hx_ramp_settled(&model->ramp, &state->ramp);
  hxRow *first = row_at(state, 0);
  const hxSteps now = first->steps;
  if (model->compliant)
    hx_compliant_steer(&model->laws, state->at, moves, state->cut, &state->compliant);
  const hxTwist twist = look_ahead(model, state, 0, 0, first);
  hx_paths_plan(&model->paths, &now, state->at, moves || !settled, twist, &state->paths,
                &first->steps);
  lay_out(model, &state->paths, first);
  state->last = moves || settled ? INT64_MAX : model->ramp.end - state->ramp.steps;
  state->at = 0;
  plan_step(model, state, 1, 1, first, row_at(state, 1));
}

/* to the next step, as the command plans it, and a look at the one after it */
static void advance(const hxControllerModel *model, int told, hxControllerState *state) {
  if (told || !state->has_after) plan_afresh(model, state);
  state->present = (state->present + 1) % 3;
  ++state->at;
  ++state->ramp.steps;
  const int64_t next = state->at + 1;
  const int reached = hx_paths_reach(&model->paths, &state->paths, next);
  state->has_before = 1;
  state->has_after = reached && next <= state->last;
  state->cut = !reached && next <= state->last;
  if (state->has_after) plan_step(model, state, next, 1, row_at(state, 0), row_at(state, 1));
}

/* ----------------------------------------------------------------------------------------------
 * joints */

/* rate of a quantity at the present step, one-sided where a neighbour is missing */
static double rate_of(const hxControllerState *state, double before, double now, double after,
                      double period) {
  if (state->has_after && state->has_before) return (after - before) / (2.0 * period);
  return state->has_before ? (now - before) / period : 0.0;
}

/* the foot's centre as the command plans it: on its path, rolling, not lowered into the ground */
static void show_planned(const hxRow *now, int k, double planned[3]) {
  hxPlane plane = hx_add(now->steps.plane[k], now->shift[k]);
  double height = now->steps.height[k];
  hx_posture_see_place(&now->posture, &plane, &height);
  planned[0] = plane.x;
  planned[1] = plane.y;
  planned[2] = height;
}

static void follow_paths(const hxControllerModel *model, hxControllerState *state) {
  const hxRow *before = row_at(state, -1), *now = row_at(state, 0), *after = row_at(state, 1);
  hxControllerOutput *output = &state->output;
  for (int k = 0; k < HX_LEGS; ++k) {
    const hxPlane *old = &before->shift[k], *here = &now->shift[k], *next = &after->shift[k];
    const hxPlane rolling = {rate_of(state, old->x, here->x, next->x, model->period),
                             rate_of(state, old->y, here->y, next->y, model->period)};
    hxPlane plane = hx_add(now->steps.plane[k], *here),
            velocity = hx_add(now->steps.velocity[k], rolling);
    double height = now->height[k];
    double rise = now->steps.rise[k] - rate_of(state, before->lowering[k], now->lowering[k],
                                               after->lowering[k], model->period);
    hx_posture_see(&now->posture, &plane, &height, &velocity, &rise);
    output->unreachable[k] = hx_leg_solve(&model->leg[k], &now->pose[k], velocity, rise,
                                          output->angle_ref[k], output->speed_ref[k]);
    output->swinging[k] = state->paths.swinging[k];
    show_planned(now, k, output->planned[k]);
    const hxPose *neighbour = state->has_after    ? &after->pose[k]
                              : state->has_before ? &before->pose[k]
                                                  : NULL;
    hx_leg_accelerations(&model->leg[k], neighbour,
                         state->has_after ? model->period : -model->period, output->angle_ref[k],
                         output->speed_ref[k], output->acceleration_ref[k]);
  }
}

/* what the present step asks of the laws */
static void ask(const hxControllerModel *model, hxControllerState *state, hxStance *stance) {
  const hxRow *now = row_at(state, 0);
  const int inside = state->has_before && state->has_after;
  const hxRow *before = inside ? row_at(state, -1) : NULL,
              *after = inside ? row_at(state, 1) : NULL;
  const hxMotion motion = {
      {before ? &before->masses : NULL, &now->masses, after ? &after->masses : NULL},
      {before ? before->pose : NULL, now->pose, after ? after->pose : NULL}};
  const hxControllerOutput *output = &state->output;
  hxPlan *plan = &stance->plan;
  hxPlane *feet = plan->feet;
  double height[HX_LEGS];
  hxDemand demand;
  hx_dynamics_demand(&model->laws.dynamics, model->leg, &motion, output->speed_ref, &now->posture,
                     &demand);
  plan->hurried = 0;
  for (int k = 0; k < HX_LEGS; ++k) {
    feet[k] = hx_add(now->steps.plane[k], now->shift[k]);
    height[k] = now->steps.height[k] - model->paths.home_height[k];
    plan->shares.activation[k] = now->activation[k];
    plan->swinging[k] = state->paths.swinging[k];
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      plan->hurried |= fabs(output->speed_ref[k][joint]) >= model->leg[k].speed_max;
    hx_leg_speeds(&model->leg[k], &now->pose[k], hx_plane(0.0, 0.0), 1.0, stance->climb[k]);
  }
  hx_support_shares(feet, &demand, &plan->shares);
  hx_compliance_plan(&model->laws.laws, &demand, height, now->steps.rise, plan);
  stance->value = now->value;
  stance->posture = &now->posture;
  stance->plane = now->steps.plane;
  stance->height = now->height;
}

/* ----------------------------------------------------------------------------------------------
 * ticks */

void hx_controller_begin(const hxControllerModel *model, double t, hxControllerState *state) {
  hxRow *row;
  memset(state, 0, sizeof *state);
  state->start = state->time = t;
  state->cut = 1;
  hx_ramp_reset(&model->ramp, &state->ramp);
  if (model->compliant) hx_compliant_reset(&state->compliant);
  row = row_at(state, 0);
  hx_paths_reset(&model->paths, &state->paths, &row->steps);
  look_ahead(model, state, 0, 0, row);
  lay_out(model, &state->paths, row);
  follow_paths(model, state);
}

void hx_controller_tick(const hxControllerModel *model, const hxControllerInput *input,
                        hxControllerState *state) {
  const double command[HX_COMMANDS] = {input->command.vx,       input->command.vy,
                                       input->command.yaw_rate, input->command.height,
                                       input->command.roll,     input->command.pitch};
  const int told = hx_ramp_aim(&model->ramp, command, &state->ramp);
  hxStance stance;
  /* the first tick is the stance itself, whatever is commanded */
  if (state->tick > 0) advance(model, told, state);
  ++state->tick;
  follow_paths(model, state);
  if (!model->compliant) return;
  ask(model, state, &stance);
  hx_compliant_step(&model->laws, model->leg, &stance, input, &state->compliant, &state->output);
}
