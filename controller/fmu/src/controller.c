/* controller.c - joint commands from body command and measurement, once per period. Python:
 * controller/controller.py. */
#include "state.h"

#include <string.h>

void hx_controller_compile(const hxControllerDefinition *definition, hxControllerModel *model) {
  memset(model, 0, sizeof *model);
  model->gait = definition->gait;
  model->paper = definition->control == HX_CONTROL_PAPER;
  hx_walk_plan_compile(definition, &model->plan);
  if (model->paper) hx_paper_compile(definition, &model->corrections);
  model->watches_servos = definition->control != HX_CONTROL_KINEMATIC;
  hx_fade_compile(definition->period, &model->fade);
  hx_health_compile(definition, &model->health);
}

/* ----------------------------------------------------------------- change of gait and control */

void hx_controller_adopt(hxControllerModel model[2], hxControllerState *state) {
  hxControllerModel *next = &model[1 - state->model];
  if (!state->is_changing_gait || !hx_walk_plan_ended(&state->plan)) return;
  hx_walk_plan_adopt(&next->plan, &model[state->model].plan, state->returning_leg - 1,
                     &state->plan);
  state->model = 1 - state->model;
  state->is_changing_gait = state->returning_leg = 0;
}

void hx_controller_change(hxControllerModel model[2], int returning_leg, hxControllerState *state) {
  state->is_changing_gait = 1;
  state->gait_is_outdated = 0;
  state->returning_leg = returning_leg;
  hx_controller_adopt(model, state);
}

void hx_controller_exchange(hxControllerModel *model, const hxFootPathsModel *before,
                            hxControllerState *state) {
  const hxStepPlanner *planner = &model->plan.planner;
  hxControllerOutput *output = &state->output;
  hx_walk_plan_carry(&model->plan, before, &state->plan);
  hx_fade_begin(&model->fade, output, &state->fade);
  if (planner->is_compliant) hx_compliant_reset(&planner->compliant, &state->compliant);
  memset(&state->paper, 0, sizeof state->paper);
  memset(&state->health, 0, sizeof state->health);
  memset(output->shift, 0, sizeof output->shift);
  memset(output->lift, 0, sizeof output->lift);
  memset(output->fallback, 0, sizeof output->fallback);
  memset(output->doubted, 0, sizeof output->doubted);
}

/* ------------------------------------------------------------------------------------- joints */

/* Computes joint commands that move the feet along their paths (C10 to C14). */
static void follow_paths(const hxControllerModel *model, hxControllerState *state) {
  const hxLegSolver *leg = model->plan.planner.leg;
  hxWalkPlan *plan = &state->plan;
  const hxPlannedStep *now = hx_walk_plan_step(plan, 0);
  hxControllerOutput *output = &state->output;
  double time;
  const hxPlannedStep *neighbour = hx_walk_plan_neighbour(&model->plan, plan, &time);
  memset(output->torque_ref, 0, sizeof output->torque_ref);
  for (int k = 0; k < HX_LEGS; ++k) {
    hxPlane plane, velocity;
    double height, rise;
    hx_walk_plan_foot(&model->plan, plan, k, &plane, &height, &velocity, &rise);
    output->unreachable[k] = hx_leg_solver_solve(&leg[k], &now->pose[k], velocity, rise,
                                                 output->angle_ref[k], output->speed_ref[k]);
    output->swinging[k] = plan->paths.clock.swinging[k];
    hx_walk_plan_centre(plan, k, output->planned[k]);
    hx_leg_solver_accelerations(&leg[k], neighbour ? &neighbour->pose[k] : NULL, time,
                                output->angle_ref[k], output->speed_ref[k],
                                output->acceleration_ref[k]);
  }
}

/* Corrects the paths by the deviations of the feet, and the commands with them (C49). */
static void correct_paths(const hxControllerModel *model, const hxControllerInput *input,
                          hxControllerState *state) {
  const hxLegSolver *leg = model->plan.planner.leg;
  hxWalkPlan *plan = &state->plan;
  hxControllerOutput *output = &state->output;
  hxPaper *paper = &state->paper;
  hxPosture level;
  hxPaperStep step = {hx_walk_plan_step(plan, 0)->pose,
                      (const double (*)[3])output->planned,
                      {0.0},
                      {0.0},
                      NULL,
                      input->angle,
                      {{0.0}}};
  hxPlane plane[HX_LEGS], velocity[HX_LEGS];
  double height[HX_LEGS];
  int swinging[HX_LEGS];
  memset(&level, 0, sizeof level);
  level.level = 1;
  hx_sense(input, &level, step.force);
  step.swinging = swinging;
  for (int k = 0; k < HX_LEGS; ++k) {
    swinging[k] = plan->paths.clock.swinging[k] || plan->absence.legs[k];
    hx_walk_plan_foot(&model->plan, plan, k, &plane[k], &height[k], &velocity[k], &step.rise[k]);
    step.height[k] = hx_walk_plan_lift(&model->plan, plan, k);
  }
  hx_paper_step(&model->corrections, leg, &step, paper);
  for (int k = 0; k < HX_LEGS; ++k) {
    output->unreachable[k] =
        hx_paper_actuate(paper, &leg[k], k, plane[k], height[k], velocity[k], step.rise[k],
                         output->angle_ref[k], output->speed_ref[k]);
    output->shift[k][0] = paper->shift[k].x;
    output->shift[k][1] = paper->shift[k].y;
    output->lift[k] = paper->lift[k];
  }
}

/* -------------------------------------------------------------------------------- lost legs */

/* Takes legs that are lost out of service, before the present step is planned (C57). */
static void watch(const hxControllerModel *model, const hxControllerInput *input,
                  hxControllerState *state) {
  hxPosture level;
  double force[HX_LEGS][3];
  int lifted[HX_LEGS], lost[HX_LEGS], bearing[HX_LEGS];
  memset(&level, 0, sizeof level);
  level.level = 1;
  hx_sense(input, &level, force);
  const hxPlannedStep *now = hx_walk_plan_step(&state->plan, 0);
  for (int k = 0; k < HX_LEGS; ++k)
    lifted[k] = state->plan.paths.clock.swinging[k] && now->feet.rise[k] > 0.0;
  hx_health_step(&model->health, model->plan.planner.leg, input->angle, (const double (*)[3])force,
                 &state->output, lifted, &state->health);
  for (int k = 0; k < HX_LEGS; ++k) {
    lost[k] = hx_health_lost(&state->health, k);
    bearing[k] = hx_health_bearing(&state->health, k);
  }
  if (!hx_walk_plan_lose(&model->plan, lost, bearing, &state->output, &state->plan)) return;
  state->gait_is_outdated = 1;
  state->is_changing_gait = state->returning_leg = 0;
}

/* Folds legs out of service away, and takes back one that works again (C58). */
static void fold(const hxControllerModel *model, const hxControllerInput *input,
                 hxControllerState *state) {
  const int leg = hx_absence_fold(&model->plan.absent, model->plan.planner.leg, input->angle,
                                  (const int (*)[HX_JOINTS])state->health.faulty,
                                  (const int (*)[HX_JOINTS])state->health.locked,
                                  &state->plan.absence, &state->output);
  memcpy(state->output.absent, state->plan.absence.legs, sizeof state->output.absent);
  memcpy(state->output.outrun, state->plan.pace.outrun, sizeof state->output.outrun);
  memcpy(state->output.faulty, state->health.faulty, sizeof state->output.faulty);
  if (leg < 0 || state->returning_leg) return;
  state->returning_leg = leg + 1;
  state->gait_is_outdated = 1;
  hx_walk_plan_end(&state->plan);
}

/* -------------------------------------------------------------------------------------- ticks */

void hx_controller_begin(const hxControllerModel *model, double t, hxControllerState *state) {
  const hxStepPlanner *planner = &model->plan.planner;
  memset(state, 0, sizeof *state);
  state->start = state->time = t;
  if (planner->is_compliant) hx_compliant_reset(&planner->compliant, &state->compliant);
  hx_walk_plan_reset(&model->plan, &state->compliant, &state->plan);
  follow_paths(model, state);
}

void hx_controller_tick(const hxControllerModel *model, const hxControllerInput *input,
                        hxControllerState *state) {
  const hxStepPlanner *planner = &model->plan.planner;
  const double command[HX_COMMANDS] = {input->command.vx,       input->command.vy,
                                       input->command.yaw_rate, input->command.height,
                                       input->command.roll,     input->command.pitch};
  const int command_changed = hx_walk_plan_aim(&model->plan, command, &state->plan);
  hxPresentStep present;
  /* the first tick commands the stance, whatever the input */
  if (state->tick > 0 && model->watches_servos) watch(model, input, state);
  if (state->tick > 0)
    hx_walk_plan_advance(&model->plan, command_changed, &state->compliant, &state->plan);
  ++state->tick;
  follow_paths(model, state);
  if (model->paper) correct_paths(model, input, state);
  if (planner->is_compliant) {
    hx_walk_plan_present_step(&model->plan, &state->compliant, state->output.speed_ref,
                              &state->plan, &present);
    hx_compliant_step(&planner->compliant, planner->leg, &present, input, &state->compliant,
                      &state->output);
  }
  if (state->fade.left) hx_fade_step(&model->fade, planner->leg, &state->fade, &state->output);
  fold(model, input, state);
}
