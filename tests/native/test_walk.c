/* test_walk.c - tests plant and controller as two C libraries in one loop: under both controls the
 * robot walks as commanded, and a second walk has the same bits. */
#include <string.h>

#include <hexapod/controller.h>
#include <hexapod/hexapod.h>

#include "check.h"

static const double h = 0.005, duration = 4.0; /* s */
static const double speed = 0.08;              /* m/s */

static void sense(const hxOutput *seen, hxControllerInput *sensed) {
  memcpy(sensed->angle, seen->angle, sizeof sensed->angle);
  memcpy(sensed->foot_force, seen->foot.force, sizeof sensed->foot_force);
  memcpy(sensed->quaternion, seen->torso.quaternion, sizeof sensed->quaternion);
}

/* results of the walk */
static hxOutput walk(int control) {
  hxPlant *plant = hx_plant_create();
  hxController *controller = hx_controller_create();
  hxControllerDefinition definition;
  hxControllerInput sensed;
  hxControllerOutput joints;
  hxInput input;
  hxOutput seen;
  memset(&seen, 0, sizeof seen);
  hx_controller_definition_default(&definition);
  definition.control = control;
  CHECK(hx_controller_reset(controller, &definition, 0.0) == HX_OK);
  hx_controller_input_default(&sensed);
  hx_input_default(&input);
  sensed.command.vx = speed;
  for (int k = 0; k < (int)(duration / h); ++k) {
    const double t_end = (k + 1) * h;
    hx_plant_output(plant, &input, &seen);
    sense(&seen, &sensed);
    hx_controller_output(controller, &sensed, &joints);
    memcpy(input.angle_ref, joints.angle_ref, sizeof input.angle_ref);
    memcpy(input.speed_ref, joints.speed_ref, sizeof input.speed_ref);
    memcpy(input.torque_ref, joints.torque_ref, sizeof input.torque_ref);
    CHECK(hx_controller_step(controller, &sensed, NULL, t_end) == HX_OK);
    CHECK(hx_plant_step(plant, &input, t_end) == HX_OK);
  }
  hx_plant_output(plant, &input, &seen);
  hx_controller_destroy(controller);
  hx_plant_destroy(plant);
  return seen;
}

int main(void) {
  for (int control = HX_CONTROL_KINEMATIC; control <= HX_CONTROL_COMPLIANT; ++control) {
    const hxOutput seen = walk(control), again = walk(control);
    NEAR(seen.time, duration, 1e-12);
    CHECK(seen.torso.position[0] > 0.7 * speed * duration &&
          seen.torso.position[0] < speed * duration);
    NEAR(seen.torso.position[1], 0.0, 0.01);
    NEAR(seen.torso.position[2], 0.13, 0.01);
    NEAR(seen.torso.roll, 0.0, 0.02);
    NEAR(seen.torso.pitch, 0.0, 0.02);
    CHECK(seen.solver.touchdowns > 12.0);
    CHECK(memcmp(&seen, &again, sizeof seen) == 0);
  }
  return failures;
}
