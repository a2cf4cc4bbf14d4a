/* robot.c - the default robot with its controller, for a page that steps them without a server
 *
 * extensions/live/static_page.py compiles it to WebAssembly together with the cores of plant and
 * controller and with the macro-step that all loops in C share. There is one robot in a module. SI
 * units, frames and orders as in hexapod.h. Functions return 0, or the status of a failure that
 * hx_page_message explains.
 */
#include <stddef.h>
#include <string.h>

#include "hexapod/controller.h"
#include "hexapod/hexapod.h"
#include "hexapod/macro_step.h"

enum {
  ANGLES = HX_LEGS * HX_JOINTS,
  FORCES = HX_LEGS * 3,
  DRIVES = 3 * ANGLES, /* angle_ref, speed_ref, torque_ref */
  INPUTS = DRIVES + 3, /* and push_force: the begin of hxInput */
  COMMANDS = 6,        /* vx, vy, yaw_rate, height, roll, pitch */
  SENSED = ANGLES + FORCES + 4,
  /* the row of values, which viewer/robot.ts reads */
  ANGLE = 1, /* after the time: joint angles, speeds, torques */
  FORCE = ANGLE + 3 * ANGLES,
  SLIP = FORCE + FORCES,  /* slip speeds */
  TORSO = SLIP + HX_LEGS, /* position, quaternion, roll, pitch, yaw, velocities */
  INPUT = TORSO + 16,
  VALUES = INPUT + INPUTS
};

static const double macro_step = 0.005; /* s    that of the scenarios */

static hxPlant *plant;
static hxController *controller;
static hxDefinition definition;
static hxControllerDefinition walk;
static hxInput input;
static hxOutput output;
static hxControllerInput seen;
static hxControllerOutput joints;
static double value[VALUES], given[COMMANDS + SENSED], command[COMMANDS];
static double gait[5];        /* pattern, period, duty, step height, touch-down speed */
static unsigned shown[INPUT]; /* indices of the plant's outputs in the row, among its doubles */
static size_t sensed[SENSED];
static hxStepper stepper;
static long steps; /* macro-steps since the start */

/* ----------------------------------------------------------------------------------------------
 * plant and controller as the macro-step calls them; their structures begin with these doubles */

static int get_plant(void *instance, const unsigned *reference, size_t count, double *to) {
  hx_plant_output(instance, &input, &output);
  for (size_t i = 0; i < count; ++i) to[i] = ((const double *)&output)[reference[i]];
  return 0;
}

static int set_plant(void *instance, const unsigned *reference, size_t count, const double *from) {
  (void)instance, (void)reference;
  memcpy(&input, from, count * sizeof *from);
  return 0;
}

static int get_controller(void *instance, const unsigned *reference, size_t count, double *to) {
  (void)reference;
  hx_controller_output(instance, &seen, &joints);
  memcpy(to, &joints, count * sizeof *to);
  return 0;
}

static int set_controller(void *instance, const unsigned *reference, size_t count,
                          const double *from) {
  (void)instance, (void)reference;
  memcpy(&seen, from, count * sizeof *from);
  return 0;
}

/* Returns the end of the macro-step: a product, so that times do not drift. */
static double step_end(void) { return (double)(steps + 1) * macro_step; }

/* FMI accepts a status of 1, a warning; ours are errors from 1 on. */
static int fmi_status(int status) { return status == HX_OK ? 0 : status + 1; }

static int step_plant(void *instance, double t, double h, int no_prior_state) {
  (void)t, (void)h, (void)no_prior_state;
  return fmi_status(hx_plant_step(instance, &input, step_end()));
}

static int step_controller(void *instance, double t, double h, int no_prior_state) {
  (void)t, (void)h, (void)no_prior_state;
  return fmi_status(hx_controller_step(instance, &seen, NULL, step_end()));
}

/* Lists which doubles of the plant's outputs are in the row, and which of these are measured. */
static void list_variables(void) {
  static const struct {
    size_t offset, count;
  } part[] = {{offsetof(hxOutput, time), FORCE},
              {offsetof(hxOutput, foot.force), FORCES},
              {offsetof(hxOutput, foot.slip_speed), HX_LEGS},
              {offsetof(hxOutput, torso.position), INPUT - TORSO}};
  unsigned *next = shown;
  for (size_t k = 0; k < sizeof part / sizeof *part; ++k)
    for (size_t i = 0; i < part[k].count; ++i)
      *next++ = (unsigned)(part[k].offset / sizeof(double) + i);
  for (size_t i = 0; i < ANGLES; ++i) sensed[i] = ANGLE + i;
  for (size_t i = 0; i < FORCES; ++i) sensed[ANGLES + i] = FORCE + i;
  for (size_t i = 0; i < 4; ++i) sensed[ANGLES + FORCES + i] = TORSO + 3 + i;
}

static void connect(void) {
  list_variables();
  stepper = (hxStepper){
      .plant = {plant, get_plant, NULL, set_plant, step_plant},
      .controller = {controller, get_controller, NULL, set_controller, step_controller},
      .plant_output = {shown, INPUT, 0},
      .plant_input = {NULL, INPUTS, INPUT},
      .controller_output = {NULL, DRIVES, INPUT},
      .sensed = sensed,
      .command_count = COMMANDS,
      .sensed_count = SENSED,
      .given = given,
      .value = value,
      .h = macro_step,
  };
}

/* ----------------------------------------------------------------------------------------------
 * what the page calls */

/* Memory of the row of values, and that which the page writes: the force on the torso, the body
 * command, and the gait of the next start or change. */
HX_API double *hx_page_values(void) { return value; }
HX_API double *hx_page_push(void) { return value + INPUT + DRIVES; }
HX_API double *hx_page_command(void) { return command; }
HX_API double *hx_page_gait(void) { return gait; }

HX_API const char *hx_page_message(void) {
  if (!plant || !controller) return "out of memory";
  const char *text = hx_plant_message(plant);
  return *text ? text : hx_controller_message(controller);
}

static void take_gait(hxGait *to) {
  to->pattern = (int)gait[0];
  to->period = gait[1];
  to->duty = gait[2];
  to->step_height = gait[3];
  to->touchdown_speed = gait[4];
}

/* Allocates the robot once and places it at its start. */
HX_API int hx_page_start(int control, double friction) {
  if (!plant) plant = hx_plant_create();
  if (!controller) controller = hx_controller_create();
  if (!plant || !controller) return HX_INVALID_ARGUMENT;
  connect();
  hx_definition_default(&definition);
  hx_controller_definition_default(&walk);
  hx_input_default(&input);
  hx_controller_input_default(&seen);
  memcpy(value + INPUT, &input, INPUTS * sizeof *value);
  steps = 0;
  definition.friction.mu = friction;
  walk.control = control;
  take_gait(&walk.gait);
  int status = hx_plant_reset(plant, &definition, 0.0);
  if (status == HX_OK) status = hx_controller_reset(controller, &walk, 0.0);
  if (status == HX_OK) hx_read_plant(&stepper);
  return status;
}

/* Advances by macro-steps. */
HX_API int hx_page_advance(int count) {
  for (int k = 0; k < count; ++k) {
    if (!hx_macro_step(&stepper, (double)steps * macro_step, command, NULL, NULL, NULL))
      return stepper.status;
    ++steps;
  }
  return HX_OK;
}

/* Changes the control while the robot walks. */
HX_API int hx_page_change_control(int control) {
  return hx_controller_change_control(controller, control);
}

/* Changes to the gait that hx_page_gait has, while the robot walks. */
HX_API int hx_page_change_gait(void) {
  hxGait next = *hx_controller_gait(controller);
  take_gait(&next);
  return hx_controller_change_gait(controller, &next);
}

/* Changes the friction coefficient: the plant begins again in its present pose and motion. */
HX_API int hx_page_change_friction(double friction) {
  hxDefinition next = definition;
  memcpy(next.initial.position, output.torso.position, sizeof next.initial.position);
  memcpy(next.initial.quaternion, output.torso.quaternion, sizeof next.initial.quaternion);
  memcpy(next.initial.velocity, output.torso.velocity, sizeof next.initial.velocity);
  memcpy(next.initial.angular_velocity, output.torso.angular_velocity,
         sizeof next.initial.angular_velocity);
  memcpy(next.initial.angle, output.angle, sizeof next.initial.angle);
  memcpy(next.initial.speed, output.speed, sizeof next.initial.speed);
  next.friction.mu = friction;
  const int status = hx_plant_reset(plant, &next, output.time);
  if (status == HX_OK) definition = next;
  return status;
}

/* Steps the plant alone to t_end under the inputs in the row and returns its outputs; NULL: failed.
 * For comparisons with the native plant. */
HX_API const hxOutput *hx_page_replay(double t_end) {
  set_plant(plant, NULL, INPUTS, value + INPUT);
  if (hx_plant_step(plant, &input, t_end) != HX_OK) return NULL;
  hx_plant_output(plant, &input, &output);
  return &output;
}
