#include "state.h"

#include <string.h>

void hx_controller_compile(const hxControllerDefinition *definition, hxControllerModel *model) {
  memset(model, 0, sizeof *model);
  model->period = definition->period;
  model->gait = definition->gait;
  model->compliant = definition->control == HX_CONTROL_COMPLIANT;
  model->paper = definition->control == HX_CONTROL_PAPER;
  for (int k = 0; k < HX_LEGS; ++k) hx_leg_solver_compile(definition, k, &model->leg[k]);
  hx_command_ramp_compile(definition->gait.period, definition->period, &model->ramp);
  hx_foot_paths_compile(definition, model->leg, &model->paths);
  if (model->compliant) {
    hx_compliant_compile(definition, model->leg, &model->laws);
    model->paths.handover = model->laws.support.handover;
  }
  if (model->paper) hx_paper_compile(definition, &model->corrections);
  hx_fade_compile(definition->period, &model->fade);
}

/* ----------------------------------------------------------------------------------- planning */

/* Index of a planned step: -1 is the previous one, 0 the present one, 1 the next one. */
static hxPlannedStep *step_at(hxControllerState *state, int neighbour) {
  return &state->step[(state->present + neighbour + 3) % 3];
}

/* Computes the command a number of periods ahead, including the posture, and returns the motion of
 * the body. number: periods since the section began. */
static hxTwist look_ahead(const hxControllerModel *model, const hxControllerState *state,
                          int64_t ahead, int64_t number, hxPlannedStep *step) {
  hx_command_ramp_ahead(&model->ramp, &state->ramp, ahead, step->value, step->rate);
  hx_posture_of(&step->posture, step->value + 3, step->rate + 3);
  hxTwist twist = {{step->value[0], step->value[1]}, step->value[2]};
  if (model->compliant) {
    const hxTwist added = hx_compliant_addition(&model->laws, &state->compliant, number);
    twist =
        (hxTwist){hx_plane_add(twist.velocity, added.velocity), twist.yaw_rate + added.yaw_rate};
  }
  return twist;
}

/* Computes the activations of the legs, and lowers the feet by the depth to which the ground will
 * deform under their loads. The feet are seen from the torso that sways. */
static void lower(const hxControllerModel *model, const hxFootPaths *paths, hxPlannedStep *step) {
  const hxSupport *support = &model->laws.support;
  for (int k = 0; k < HX_LEGS; ++k) {
    step->lowering[k] = 0.0;
    if (paths->awaited[k])
      step->activation[k] = 0.0;
    else if (model->compliant)
      step->activation[k] = hx_support_activation(support, step->feet.phase[k], paths->stayed[k],
                                                  paths->stays[k], paths->walking);
    else
      step->activation[k] = 1.0;
  }
  if (model->compliant && model->laws.laws.parts.support)
    hx_support_lowering(support, step->plane, step->activation, step->lowering);
  for (int k = 0; k < HX_LEGS; ++k) step->height[k] = step->feet.height[k] - step->lowering[k];
}

/* Computes the poses of legs whose contact points are shifted from the planned feet. */
static void reach_all(const hxLegSolver leg[HX_LEGS], const hxPlane shift[HX_LEGS],
                      hxPlannedStep *step) {
  hxPlane seen[HX_LEGS];
  double z[HX_LEGS];
  for (int k = 0; k < HX_LEGS; ++k) {
    seen[k] = hx_plane_add(step->plane[k], shift[k]);
    z[k] = step->height[k];
    hx_posture_see_place(&step->posture, &seen[k], &z[k]);
  }
  hx_leg_solver_poses(leg, (const hxPlane *)seen, (const double *)z, step->pose);
}

/* Computes by how far the feet's contact points shift because their spheres roll (C9), and the
 * poses of the legs. A tibia that pitches by dB rolls the sphere by -R dB along the outward
 * direction of the leg. The shift s changes B itself: s = R (C + s dC/du) is solved by one Newton
 * step. What is rolled on the way to another position than that of the stance is no shift. */
static void place_legs(const hxLegSolver leg[HX_LEGS], hxPlannedStep *step) {
  const hxPlane none[HX_LEGS] = {{0.0, 0.0}};
  reach_all(leg, none, step);
  for (int k = 0; k < HX_LEGS; ++k) {
    const hxPose *pose = &step->pose[k];
    double slope[HX_JOINTS];
    hx_leg_solver_speeds(&leg[k], pose, pose->heading, 0.0, slope);
    const double rolls = hx_leg_solver_rolling(&leg[k], pose->angle) - step->feet.rolled[k];
    step->shift[k] =
        hx_scaled(pose->heading, rolls / (1.0 - leg[k].radius * (slope[2] - slope[1])));
  }
  reach_all(leg, (const hxPlane *)step->shift, step);
}

/* Computes the poses of the legs and the point masses for a torso that has moved by its sway. */
static void stand(const hxControllerModel *model, const hxControllerState *state,
                  hxPlannedStep *step) {
  for (int k = 0; k < HX_LEGS; ++k) step->plane[k] = hx_plane_sub(step->feet.plane[k], step->sway);
  lower(model, &state->paths, step);
  place_legs(model->leg, step);
  if (!model->compliant) return;
  const hxPlane turn = hx_cis(step->feet.turn);
  hx_inverse_dynamics_place(&model->laws.dynamics, model->leg, step->pose,
                            hx_plane_add(step->feet.way, hx_times(turn, step->sway)), turn,
                            &step->posture, &step->masses);
}

/* Computes sway, poses of the legs and point masses for planned feet. */
static void lay_out(const hxControllerModel *model, const hxControllerState *state,
                    hxPlannedStep *step) {
  const hxSway *sway = &model->laws.sway;
  const hxLoadAdaptation *adaptation = &state->compliant.adaptation;
  step->sway = hx_plane(0.0, 0.0);
  if (model->compliant && hx_sway_acts(sway, adaptation)) {
    step->sway = hx_sway_guess(sway, &step->feet, adaptation);
    stand(model, state, step);
    step->sway = hx_sway_of(sway, &model->laws.dynamics, step->sway, &step->masses, adaptation);
  }
  stand(model, state, step);
}

/* Plans the step a number of periods after the section began; `ahead`: periods after the present
 * command. */
static void plan_step(const hxControllerModel *model, const hxControllerState *state,
                      int64_t number, int64_t ahead, const hxPlannedStep *before,
                      hxPlannedStep *step) {
  const hxTwist twist = look_ahead(model, state, ahead, number, step);
  hx_foot_paths_walk(&model->paths, &state->paths, number, twist, &before->feet, &step->feet);
  lay_out(model, state, step);
}

/* Notes which feet have met the ground on their way down (C51). */
static void note_contacts(const hxControllerModel *model, hxControllerState *state) {
  const hxPlannedFeet *feet = &step_at(state, 0)->feet;
  hxFootPaths *paths = &state->paths;
  for (int k = 0; k < HX_LEGS; ++k)
    paths->met[k] = model->compliant && paths->swinging[k] && feet->rise[k] < 0.0 &&
                    hx_compliance_meets(&model->laws.laws, k, &state->compliant.laws);
}

/* Aims the steps of a commanded motion at the stance that the weight asks for (C53). */
static void narrow(const hxControllerModel *model, hxControllerState *state) {
  if (model->compliant && hx_command_ramp_moves(&state->ramp))
    state->paths.narrowing = state->compliant.adaptation.narrowing;
}

/* Returns whether the gait clock waits for feet at the ends of their swings (C50). */
static int waits(const hxControllerModel *model, const hxControllerState *state) {
  int landing[HX_LEGS];
  if (!model->compliant) return 0;
  hx_foot_paths_landing(&model->paths, &state->paths, state->at, landing);
  return hx_compliance_waits(&model->laws.laws, landing, state->paths.held, &state->compliant.laws);
}

/* Begins a new section at the present step, and plans the next step. waiting: the gait clock stands
 * still in it. */
static void plan_afresh(const hxControllerModel *model, int waiting, hxControllerState *state) {
  const int moves = hx_command_ramp_moves(&state->ramp),
            settled = hx_command_ramp_settled(&model->ramp, &state->ramp);
  hxPlannedStep *first = step_at(state, 0);
  const hxPlannedFeet now = first->feet;
  if (model->compliant)
    hx_compliant_steer(&model->laws, state->at, moves, state->cut, &state->compliant);
  const hxTwist twist = look_ahead(model, state, 0, 0, first);
  if (waiting)
    hx_foot_paths_hold(&model->paths, &now, state->at, twist, &state->paths, &first->feet);
  else
    hx_foot_paths_plan(&model->paths, &now, state->at, moves || !settled, twist, &state->paths,
                       &first->feet);
  lay_out(model, state, first);
  state->last = moves || settled ? INT64_MAX : model->ramp.end - state->ramp.steps;
  state->at = 0;
  plan_step(model, state, 1, 1, first, step_at(state, 1));
}

/* Advances to the planned next step and plans the one after it. command_changed: so
 * the plan is void. */
static void advance(const hxControllerModel *model, int command_changed, hxControllerState *state) {
  const int due = command_changed || !state->has_after;
  note_contacts(model, state);
  narrow(model, state);
  if (due || state->paths.held) {
    const int waiting = waits(model, state);
    if (due || !waiting) plan_afresh(model, waiting, state);
  }
  state->present = (state->present + 1) % 3;
  ++state->at;
  ++state->ramp.steps;
  const int64_t next = state->at + 1;
  const int reached = hx_foot_paths_reach(&model->paths, &state->paths, next);
  state->has_before = 1;
  state->has_after = reached && next <= state->last;
  state->cut = !reached && next <= state->last;
  if (state->has_after) plan_step(model, state, next, 1, step_at(state, 0), step_at(state, 1));
}

/* ----------------------------------------------------------------------------- change of gait */

void hx_controller_adopt(hxControllerModel model[2], hxControllerState *state) {
  hxControllerModel *next = &model[1 - state->model];
  hxPlannedStep *now = step_at(state, 0);
  int ready = state->changing;
  if (state->paths.walking) {
    ready &= hx_foot_paths_ended(&state->paths);
    for (int k = 0; k < HX_LEGS; ++k) ready &= now->activation[k] >= 1.0;
  }
  if (!ready) return;
  hx_command_ramp_carry(&next->ramp, &model[state->model].ramp, &state->ramp);
  hx_foot_paths_join(&next->paths, &state->paths, &now->feet);
  state->model = 1 - state->model;
  state->changing = state->has_after = 0;
  state->at = 0;
  state->last = INT64_MAX;
  state->cut = 1;
}

void hx_controller_change(hxControllerModel model[2], hxControllerState *state) {
  state->changing = 1;
  state->has_after = 0;
  state->paths.ending = state->paths.walking;
  hx_controller_adopt(model, state);
}

/* -------------------------------------------------------------------------- change of control */

void hx_controller_exchange(hxControllerModel *model, const hxFootPathsModel *before,
                            hxControllerState *state) {
  hxControllerOutput *output = &state->output;
  hx_fade_begin(&model->fade, output, &state->fade);
  hx_foot_paths_carry(&model->paths, before, &state->paths);
  if (model->compliant)
    hx_compliant_reset(&model->laws, &state->compliant);
  else
    state->paths.narrowing = 0.0;
  memset(&state->paper, 0, sizeof state->paper);
  memset(output->shift, 0, sizeof output->shift);
  memset(output->lift, 0, sizeof output->lift);
  memset(output->fallback, 0, sizeof output->fallback);
  state->has_after = 0;
  state->cut = 1;
}

/* ------------------------------------------------------------------------------------- joints */

/* Returns the rate of a quantity at the present step, one-sided at the end of a section. */
static double rate_of(const hxControllerState *state, double before, double now, double after,
                      double period) {
  if (state->has_after && state->has_before) return (after - before) / (2.0 * period);
  return state->has_before ? (now - before) / period : 0.0;
}

/* Computes the centre of a foot as the command plans it: on its path, rolling, not lowered. */
static void show_planned(const hxPlannedStep *now, int k, double planned[3]) {
  hxPlane plane = hx_plane_add(now->plane[k], now->shift[k]);
  double height = now->feet.height[k];
  hx_posture_see_place(&now->posture, &plane, &height);
  planned[0] = plane.x;
  planned[1] = plane.y;
  planned[2] = height;
}

/* Computes a foot of the present step with rolling and lowering, walking frame [m, m/s]. */
static void planned_foot(const hxControllerModel *model, hxControllerState *state, int k,
                         hxPlane *plane, double *height, hxPlane *velocity, double *rise) {
  const hxPlannedStep *before = step_at(state, -1), *now = step_at(state, 0),
                      *after = step_at(state, 1);
  const hxPlane *old = &before->shift[k], *here = &now->shift[k], *next = &after->shift[k];
  const hxPlane rolling = {rate_of(state, old->x, here->x, next->x, model->period),
                           rate_of(state, old->y, here->y, next->y, model->period)},
                swaying = {
                    rate_of(state, before->sway.x, now->sway.x, after->sway.x, model->period),
                    rate_of(state, before->sway.y, now->sway.y, after->sway.y, model->period)};
  *plane = hx_plane_add(now->plane[k], *here);
  *velocity = hx_plane_add(hx_plane_sub(now->feet.velocity[k], swaying), rolling);
  *height = now->height[k];
  *rise = now->feet.rise[k] -
          rate_of(state, before->lowering[k], now->lowering[k], after->lowering[k], model->period);
}

/* Computes joint commands that move the feet along their paths (C10 to C14). */
static void follow_paths(const hxControllerModel *model, hxControllerState *state) {
  const hxPlannedStep *before = step_at(state, -1), *now = step_at(state, 0),
                      *after = step_at(state, 1);
  hxControllerOutput *output = &state->output;
  memset(output->torque_ref, 0, sizeof output->torque_ref);
  for (int k = 0; k < HX_LEGS; ++k) {
    hxPlane plane, velocity;
    double height, rise;
    planned_foot(model, state, k, &plane, &height, &velocity, &rise);
    hx_posture_see(&now->posture, &plane, &height, &velocity, &rise);
    output->unreachable[k] = hx_leg_solver_solve(&model->leg[k], &now->pose[k], velocity, rise,
                                                 output->angle_ref[k], output->speed_ref[k]);
    output->swinging[k] = state->paths.swinging[k];
    show_planned(now, k, output->planned[k]);
    const hxPose *neighbour = state->has_after    ? &after->pose[k]
                              : state->has_before ? &before->pose[k]
                                                  : NULL;
    hx_leg_solver_accelerations(
        &model->leg[k], neighbour, state->has_after ? model->period : -model->period,
        output->angle_ref[k], output->speed_ref[k], output->acceleration_ref[k]);
  }
}

/* Corrects the paths by the deviations of the feet, and the commands with them (C49). */
static void correct_paths(const hxControllerModel *model, const hxControllerInput *input,
                          hxControllerState *state) {
  const hxPlannedStep *now = step_at(state, 0);
  hxControllerOutput *output = &state->output;
  hxPaper *paper = &state->paper;
  hxPosture level;
  hxPaperStep step = {now->pose,
                      (const double (*)[3])output->planned,
                      {0.0},
                      {0.0},
                      state->paths.swinging,
                      input->angle,
                      {{0.0}}};
  hxPlane plane[HX_LEGS], velocity[HX_LEGS];
  double height[HX_LEGS];
  memset(&level, 0, sizeof level);
  level.level = 1;
  hx_sense(input, &level, step.force);
  for (int k = 0; k < HX_LEGS; ++k) {
    planned_foot(model, state, k, &plane[k], &height[k], &velocity[k], &step.rise[k]);
    hx_posture_see(&now->posture, &plane[k], &height[k], &velocity[k], &step.rise[k]);
    step.height[k] = now->feet.height[k] - model->paths.home_height[k];
  }
  hx_paper_step(&model->corrections, model->leg, &step, paper);
  for (int k = 0; k < HX_LEGS; ++k) {
    output->unreachable[k] =
        hx_paper_actuate(paper, &model->leg[k], k, plane[k], height[k], velocity[k], step.rise[k],
                         output->angle_ref[k], output->speed_ref[k]);
    output->shift[k][0] = paper->shift[k].x;
    output->shift[k][1] = paper->shift[k].y;
    output->lift[k] = paper->lift[k];
  }
}

/* Fills what the present step requires of compliant control (C15 to C20). */
static void ask(const hxControllerModel *model, hxControllerState *state, hxStance *stance) {
  const hxPlannedStep *now = step_at(state, 0);
  const int inside = state->has_before && state->has_after;
  const hxPlannedStep *before = inside ? step_at(state, -1) : NULL,
                      *after = inside ? step_at(state, 1) : NULL;
  const hxNeighbours motion = {
      {before ? &before->masses : NULL, &now->masses, after ? &after->masses : NULL},
      {before ? before->pose : NULL, now->pose, after ? after->pose : NULL}};
  const hxControllerOutput *output = &state->output;
  hxPlan *plan = &stance->plan;
  hxPlane *feet = plan->feet;
  double height[HX_LEGS];
  hxDemand demand;
  hx_inverse_dynamics_demand(
      &model->laws.dynamics, model->leg, &motion, output->speed_ref, &now->posture,
      hx_sway_laden(&model->laws.sway, &state->compliant.adaptation), &demand);
  plan->overspeed = 0;
  for (int k = 0; k < HX_LEGS; ++k) {
    feet[k] = hx_plane_add(now->plane[k], now->shift[k]);
    height[k] = now->feet.height[k] - model->paths.home_height[k];
    plan->shares.activation[k] = now->activation[k];
    plan->swinging[k] = state->paths.swinging[k];
    plan->awaited[k] = state->paths.awaited[k];
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      plan->overspeed |= fabs(output->speed_ref[k][joint]) >= model->leg[k].speed_max;
    hx_leg_solver_speeds(&model->leg[k], &now->pose[k], hx_plane(0.0, 0.0), 1.0, stance->climb[k]);
  }
  hx_compliant_shares(&model->laws, &state->compliant, feet, &demand, &plan->shares);
  hx_compliance_plan(&model->laws.laws, &demand, height, now->feet.rise, plan);
  stance->value = now->value;
  stance->posture = &now->posture;
  stance->plane = now->feet.plane;
  stance->sway = now->sway;
  stance->height = now->height;
  stance->rolled = now->feet.rolled;
}

/* -------------------------------------------------------------------------------------- ticks */

void hx_controller_begin(const hxControllerModel *model, double t, hxControllerState *state) {
  hxPlannedStep *step;
  memset(state, 0, sizeof *state);
  state->start = state->time = t;
  state->cut = 1;
  hx_command_ramp_reset(&model->ramp, &state->ramp);
  if (model->compliant) hx_compliant_reset(&model->laws, &state->compliant);
  step = step_at(state, 0);
  hx_foot_paths_reset(&model->paths, &state->paths, &step->feet);
  look_ahead(model, state, 0, 0, step);
  lay_out(model, state, step);
  follow_paths(model, state);
}

void hx_controller_tick(const hxControllerModel *model, const hxControllerInput *input,
                        hxControllerState *state) {
  const double command[HX_COMMANDS] = {input->command.vx,       input->command.vy,
                                       input->command.yaw_rate, input->command.height,
                                       input->command.roll,     input->command.pitch};
  const int command_changed = hx_command_ramp_aim(&model->ramp, command, &state->ramp);
  hxStance stance;
  /* the first tick commands the stance, whatever the input */
  if (state->tick > 0) advance(model, command_changed, state);
  ++state->tick;
  follow_paths(model, state);
  if (model->paper) correct_paths(model, input, state);
  if (model->compliant) {
    ask(model, state, &stance);
    hx_compliant_step(&model->laws, model->leg, &stance, input, &state->compliant, &state->output);
  }
  if (state->fade.left) hx_fade_step(&model->fade, model->leg, &state->fade, &state->output);
}
