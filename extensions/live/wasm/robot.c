/* robot.c - the default robot with its controller, for a page that steps them without a server.
 * static_page.py compiles it to WebAssembly with plant, controller and the macro-step of all loops.
 * Units, frames and orders as in hexapod.h. Functions return 0, or the status of a failure. */
#include <stddef.h>
#include <string.h>

#include "hexapod/controller.h"
#include "hexapod/hexapod.h"
#include "hexapod/macro_step.h"

/* both components define their version under the same name */
#define hx_version hx_controller_version
#include "controller_defaults.h"

enum {
  ANGLES = HX_LEGS * HX_JOINTS,
  DRIVES = 3 * ANGLES, /* angle_ref, speed_ref, torque_ref */
  INPUTS = DRIVES + 3, /* and push_force: the begin of hxInput */
  COMMANDS = 6,        /* vx, vy, yaw_rate, height, roll, pitch */
  SENSED = 2 * ANGLES + 4,
  /* the row of values, which viewer/local.ts reads */
  ANGLE = 1, /* after the time: joint angles, speeds, torques */
  FORCE = ANGLE + 3 * ANGLES,
  SLIP = FORCE + 3 * HX_LEGS, /* slip speeds */
  TORSO = SLIP + HX_LEGS,     /* position, quaternion, roll, pitch, yaw, velocities */
  INPUT = TORSO + 16,
  VALUES = INPUT + INPUTS
};
enum { REAL = sizeof(double), TORSO_END = offsetof(hxOutput, torso.contact_force) };
_Static_assert(offsetof(hxOutput, positive_work) == FORCE * REAL, "angles to torques");
_Static_assert(TORSO_END - offsetof(hxOutput, torso) == (INPUT - TORSO) * REAL, "torso");
_Static_assert(offsetof(hxInput, push_force) == DRIVES * REAL, "joint commands");

static hxPlant *plant;
static hxController *controller;
static hxDefinition definition;
static hxControllerDefinition walk;
static hxInput input;
static hxOutput output;
static hxControllerInput measured;
static double value[VALUES];
static double given[sizeof(hxControllerInput) / sizeof(double)];
static size_t sensed[SENSED];
static long steps; /* macro-steps since the start */

/* Plant and controller as the macro-step calls them. An instance is the component's inputs, which
 * begin with the doubles that are set, as the outputs do with those that are read. */
static int get_plant(void *instance, const unsigned *reference, size_t count, double *to) {
  (void)reference, (void)count;
  hx_plant_output(plant, instance, &output);
  memcpy(to, &output, FORCE * sizeof *to);
  memcpy(to + FORCE, output.foot.force, sizeof output.foot.force);
  memcpy(to + SLIP, output.foot.slip_speed, sizeof output.foot.slip_speed);
  memcpy(to + TORSO, &output.torso, (INPUT - TORSO) * sizeof *to);
  return 0;
}

static int get_controller(void *instance, const unsigned *reference, size_t count, double *to) {
  (void)reference;
  hxControllerOutput joints;
  hx_controller_output(controller, instance, &joints);
  memcpy(to, &joints, count * sizeof *to);
  return 0;
}

static int set_inputs(void *instance, const unsigned *reference, size_t count, const double *from) {
  (void)reference;
  memcpy(instance, from, count * sizeof *from);
  return 0;
}

/* FMI accepts a status of 1, a warning; ours are errors from 1 on. */
static int do_step(void *instance, double t, double h, int no_prior_state) {
  (void)no_prior_state;
  const int status = instance == &input ? hx_plant_step(plant, instance, t + h)
                                        : hx_controller_step(controller, instance, NULL, t + h);
  return status == HX_OK ? 0 : status + 1;
}

static hxStepper stepper = {
    .plant = {&input, get_plant, NULL, set_inputs, do_step},
    .controller = {&measured, get_controller, NULL, set_inputs, do_step},
    .plant_output = {NULL, INPUT, 0},
    .plant_input = {NULL, INPUTS, INPUT},
    .controller_output = {NULL, DRIVES, INPUT},
    .sensed = sensed,
    .command_count = COMMANDS,
    .sensed_count = SENSED,
    .given = given,
    .value = value,
};

/* Allocates the robot. The page calls this and all functions below. */
HX_API int hx_page_create(void) {
  plant = hx_plant_create();
  controller = hx_controller_create();
  hx_controller_definition_default(&walk);
  stepper.h = walk.period;
  for (size_t i = 0; i < ANGLES; ++i) {
    sensed[i] = ANGLE + i;
    sensed[ANGLES + i] = FORCE + i;
  }
  for (size_t i = 0; i < 4; ++i) sensed[2 * ANGLES + i] = TORSO + 3 + i; /* the quaternion */
  return plant && controller ? HX_OK : HX_INVALID_ARGUMENT;
}

/* Memory of the row of values. */
HX_API double *hx_page_values(void) { return value; }

/* Changes the gait while the robot walks, and sets that of the next start. */
HX_API int hx_page_gait(int pattern, double period, double duty, double step_height,
                        double touchdown_speed) {
  walk.gait.pattern = pattern;
  walk.gait.period = period;
  walk.gait.duty = duty;
  walk.gait.step_height = step_height;
  walk.gait.touchdown_speed = touchdown_speed;
  return hx_controller_change_gait(controller, &walk.gait);
}

/* Places the robot at its start. */
HX_API int hx_page_start(int control, double friction) {
  hx_definition_default(&definition);
  hx_input_default(&input);
  hx_controller_input_default(&measured);
  memcpy(value + INPUT, &input, INPUTS * sizeof *value);
  steps = 0;
  definition.friction.mu = friction;
  walk.control = control;
  int status = hx_plant_reset(plant, &definition, 0.0);
  if (status == HX_OK) status = hx_controller_reset(controller, &walk, 0.0);
  if (status == HX_OK) hx_read_plant(&stepper);
  return status;
}

/* Advances by macro-steps under a body command and a force on the torso. */
HX_API int hx_page_advance(int count, double vx, double vy, double yaw_rate, double height,
                           double x, double y, double z) {
  const double command[COMMANDS] = {vx, vy, yaw_rate, height}, force[] = {x, y, z};
  memcpy(value + INPUT + DRIVES, force, sizeof force);
  for (const long end = steps + count; steps < end; ++steps)
    if (!hx_macro_step(&stepper, (double)steps * stepper.h, command, NULL, NULL, NULL))
      return stepper.status;
  return HX_OK;
}

/* Makes a leg's servos limp, or healthy again. */
HX_API int hx_page_leg(int leg) {
  if (leg < 0 || leg >= HX_LEGS) return HX_INVALID_ARGUMENT;
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    input.weakness[leg][joint] = 1.0 - input.weakness[leg][joint];
  return HX_OK;
}

/* Changes the control, or the friction coefficient, while the robot walks. */
HX_API int hx_page_control(int next) { return hx_controller_change_control(controller, next); }
HX_API int hx_page_friction(double friction) {
  definition.friction.mu = friction;
  return hx_plant_tune(plant, &definition);
}
