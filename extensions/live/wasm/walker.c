/* walker.c - steps the default robot's plant and controller as the co-simulation master does */
#include "walker.h"

#include <math.h>
#include <string.h>

static const double MACRO_STEP = 0.005; /* s    that of the scenarios */

/* Stages of a change of gait */
typedef enum Stage {
  NO_CHANGE,
  SLOWS,  /* the page has asked for a command that both gaits can follow; the ramp leads there */
  STEPS,  /* legs in the air finish their steps */
  SETTLES /* each leg makes its first step in the next gait */
} Stage;

typedef struct Change {
  Stage stage;
  hxWalk walk;  /* with the gait that comes */
  double since; /* s   time of the request, or the begin of the stage */
  double swing; /* s   of the gait before */
} Change;

static struct {
  hxPlant *plant;
  hxController *controller;
  hxDefinition robot;
  hxControllerDefinition walk;
  hxInput input;
  hxOutput output;
  hxControllerInput seen;
  double commanded; /* s   time of the last change of the command */
  hxControllerOutput command;
  long steps; /* macro-steps since the start */
  hxWalk wanted; /* by the page */
  Change change;
  hxFrame frame;
} walker;

double hx_walker_macro_step(void) { return MACRO_STEP; }
const hxFrame *hx_walker_frame(void) { return &walker.frame; }
hxWalk *hx_walker_wanted(void) { return &walker.wanted; }
hxInput *hx_walker_input(void) { return &walker.input; }

const char *hx_walker_message(void) {
  const char *text = walker.plant ? hx_plant_message(walker.plant) : "out of memory";
  return *text || !walker.controller ? text : hx_controller_message(walker.controller);
}

static void show(void) {
  const hxOutput *out = &walker.output;
  hxFrame *frame = &walker.frame;
  double largest = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    frame->contact[leg] = out->foot.contact[leg];
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      largest = fmax(largest, fabs(out->torque[leg][joint]));
  }
  frame->time = out->time;
  memcpy(frame->position, out->torso.position, sizeof frame->position);
  memcpy(frame->quaternion, out->torso.quaternion, sizeof frame->quaternion);
  memcpy(frame->velocity, out->torso.velocity, sizeof frame->velocity);
  memcpy(frame->rate, out->torso.angular_velocity, sizeof frame->rate);
  memcpy(frame->angle, out->angle, sizeof frame->angle);
  memcpy(frame->force, out->foot.force, sizeof frame->force);
  memcpy(frame->slip_speed, out->foot.slip_speed, sizeof frame->slip_speed);
  frame->largest_torque = largest;
  frame->changing = walker.change.stage == SETTLES ? 2.0 : walker.change.stage != NO_CHANGE;
}

static void read_plant(void) {
  hx_plant_output(walker.plant, &walker.input, &walker.output);
  show();
}

static void choose(const hxWalk *walk) {
  hxGait *gait = &walker.walk.gait;
  walker.walk.control = (int)walk->control;
  gait->pattern = (int)walk->pattern;
  gait->period = walk->period;
  gait->duty = walk->duty;
  gait->step_height = walk->step_height;
  gait->touchdown_speed = walk->touchdown_speed;
}

int hx_walker_start(double friction) {
  if (!walker.plant) walker.plant = hx_plant_create();
  if (!walker.controller) walker.controller = hx_controller_create();
  if (!walker.plant || !walker.controller) return HX_INVALID_ARGUMENT;
  hx_definition_default(&walker.robot);
  hx_controller_definition_default(&walker.walk);
  hx_input_default(&walker.input);
  hx_controller_input_default(&walker.seen);
  memset(&walker.change, 0, sizeof walker.change);
  walker.commanded = 0.0;
  walker.steps = 0;
  walker.robot.friction.mu = friction;
  choose(&walker.wanted);
  int status = hx_plant_reset(walker.plant, &walker.robot, 0.0);
  if (status == HX_OK) status = hx_controller_reset(walker.controller, &walker.walk, 0.0);
  if (status == HX_OK) read_plant();
  return status;
}

void hx_walker_command(double forward, double left, double turn, double height) {
  const hxControllerInput before = walker.seen;
  walker.seen.command.vx = forward;
  walker.seen.command.vy = left;
  walker.seen.command.yaw_rate = turn;
  walker.seen.command.height = height;
  if (memcmp(&before.command, &walker.seen.command, sizeof before.command) != 0)
    walker.commanded = walker.output.time;
}

void hx_walker_push(double x, double y, double z) {
  walker.input.push_force[0] = x;
  walker.input.push_force[1] = y;
  walker.input.push_force[2] = z;
}

/* Returns the walk in the gait that holds or comes. */
static hxWalk next_walk(void) {
  const hxGait *gait = &walker.walk.gait;
  if (walker.change.stage == SLOWS) return walker.change.walk;
  return (hxWalk){walker.walk.control, gait->pattern,     gait->period,
                  gait->duty,          gait->step_height, gait->touchdown_speed};
}

static int is_same_gait(const hxWalk *a, const hxWalk *b) {
  return a->pattern == b->pattern && a->period == b->period && a->duty == b->duty &&
         a->step_height == b->step_height && a->touchdown_speed == b->touchdown_speed;
}

int hx_walker_change(void) {
  const int control = (int)walker.wanted.control;
  const hxWalk next = next_walk();
  if (control != walker.walk.control) {
    const int status = hx_controller_change_control(walker.controller, control);
    if (status != HX_OK) return status;
    walker.walk.control = control;
  }
  if (!is_same_gait(&walker.wanted, &next)) {
    walker.change.stage = SLOWS;
    walker.change.since = walker.output.time;
  }
  walker.change.walk = walker.wanted;
  return HX_OK;
}

int hx_walker_set_friction(double friction) {
  hxDefinition next = walker.robot;
  memcpy(next.initial.position, walker.output.torso.position, sizeof next.initial.position);
  memcpy(next.initial.quaternion, walker.output.torso.quaternion, sizeof next.initial.quaternion);
  memcpy(next.initial.velocity, walker.output.torso.velocity, sizeof next.initial.velocity);
  memcpy(next.initial.angular_velocity, walker.output.torso.angular_velocity,
         sizeof next.initial.angular_velocity);
  memcpy(next.initial.angle, walker.output.angle, sizeof next.initial.angle);
  memcpy(next.initial.speed, walker.output.speed, sizeof next.initial.speed);
  next.friction.mu = friction;
  const int status = hx_plant_reset(walker.plant, &next, walker.output.time);
  if (status == HX_OK) walker.robot = next;
  return status;
}

/* Goes through the stages of a change of gait, during which the robot walks on. */
static int change_gait(void) {
  Change *change = &walker.change;
  const hxGait *gait = &walker.walk.gait;
  const double now = walker.output.time;
  /* the ramp to the last command takes a gait period; a command may change all the time */
  const double slow = now - fmin(change->since, walker.commanded);
  if (change->stage == SLOWS && slow >= gait->period) {
    change->swing = gait->period * (1.0 - gait->duty);
    choose(&change->walk);
    change->stage = STEPS;
    change->since = now;
    return hx_controller_change_gait(walker.controller, gait);
  }
  if (change->stage == STEPS && now - change->since >= change->swing) {
    change->stage = SETTLES;
    change->since = now;
  }
  if (change->stage == SETTLES && now - change->since >= change->swing + gait->period)
    change->stage = NO_CHANGE;
  return HX_OK;
}

/* Writes the joint commands to the plant's input. */
static void drive(void) {
  memcpy(walker.input.angle_ref, walker.command.angle_ref, sizeof walker.input.angle_ref);
  memcpy(walker.input.speed_ref, walker.command.speed_ref, sizeof walker.input.speed_ref);
  memcpy(walker.input.torque_ref, walker.command.torque_ref, sizeof walker.input.torque_ref);
}

/* Calculates the joint commands of this macro-step. */
static int control(double t_end) {
  hxControllerInput *seen = &walker.seen;
  memcpy(seen->angle, walker.output.angle, sizeof seen->angle);
  memcpy(seen->foot_force, walker.output.foot.force, sizeof seen->foot_force);
  memcpy(seen->quaternion, walker.output.torso.quaternion, sizeof seen->quaternion);
  hx_controller_output(walker.controller, seen, &walker.command);
  return hx_controller_step(walker.controller, seen, NULL, t_end);
}

static int macro_step(void) {
  const double t_end = (double)(walker.steps + 1) * MACRO_STEP;
  int status = change_gait();
  if (status == HX_OK) status = control(t_end);
  if (status != HX_OK) return status;
  drive();
  status = hx_plant_step(walker.plant, &walker.input, t_end);
  if (status != HX_OK) return status;
  ++walker.steps;
  read_plant();
  return HX_OK;
}

int hx_walker_advance(int steps) {
  for (int k = 0; k < steps; ++k) {
    const int status = macro_step();
    if (status != HX_OK) return status;
  }
  return HX_OK;
}

const hxOutput *hx_walker_replay(double t_end) {
  if (hx_plant_step(walker.plant, &walker.input, t_end) != HX_OK) return NULL;
  read_plant();
  return &walker.output;
}
