/* test_controller.c - tests the controller through controller.h: standing, saved states, misuse. */
#include <stdlib.h>
#include <string.h>

#include <hexapod/controller.h>

#include "check.h"

/* Runs the controller for some ticks, the last ones with a speed command. */
static void tick(hxController *controller, double vx, int ticks) {
  hxControllerInput input;
  hx_controller_input_default(&input);
  input.command.vx = vx;
  for (int k = 0; k < ticks; ++k)
    CHECK(hx_controller_step(controller, &input, NULL, hx_controller_time(controller) + 0.005) ==
          HX_OK);
}

static void without_a_command_it_holds_the_stance(void) {
  hxController *controller = hx_controller_create();
  hxControllerDefinition definition;
  hxControllerInput input;
  hxControllerOutput told;
  hx_controller_definition_default(&definition);
  hx_controller_input_default(&input);
  hx_controller_output(controller, &input, &told);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      NEAR(told.angle_ref[leg][joint], definition.leg[leg].link[joint].stance, 1e-9);
      NEAR(told.speed_ref[leg][joint], 0.0, 1e-9);
    }
  hx_controller_destroy(controller);
}

static void a_saved_state_goes_on_as_it_would_have(void) {
  hxController *one = hx_controller_create(), *two = hx_controller_create();
  const size_t size = hx_controller_state_size();
  unsigned char *saved = malloc(size), *first = malloc(size), *second = malloc(size);
  hxControllerDefinition definition;
  CHECK(saved && first && second);
  hx_controller_definition_default(&definition);
  for (int control = HX_CONTROL_KINEMATIC; control <= HX_CONTROL_COMPLIANT; ++control)
    for (int pattern = HX_PATTERN_TRIPOD; pattern <= HX_PATTERN_CUSTOM; ++pattern) {
      definition.control = control, definition.gait.pattern = pattern;
      if (pattern != HX_PATTERN_TRIPOD) definition.gait.duty = 5.0 / 6.0;
      CHECK(hx_controller_reset(one, &definition, 0.0) == HX_OK);
      tick(one, 0.05, 100);
      hx_controller_get_state(one, saved);
      tick(one, 0.02, 150);
      hx_controller_get_state(one, first);
      CHECK(hx_controller_set_state(two, saved, size) == HX_OK);
      tick(two, 0.02, 150);
      hx_controller_get_state(two, second);
      CHECK(memcmp(first, second, size) == 0);
    }
  saved[size - 1] ^= 1;
  CHECK(hx_controller_set_state(two, saved, size) == HX_BAD_STATE);
  free(saved), free(first), free(second);
  hx_controller_destroy(one), hx_controller_destroy(two);
}

static void bad_input_changes_nothing(void) {
  hxController *controller = hx_controller_create();
  const size_t size = hx_controller_state_size();
  unsigned char *before = malloc(size), *after = malloc(size);
  hxControllerDefinition definition;
  hxControllerInput input;
  CHECK(before && after);
  tick(controller, 0.05, 10);
  hx_controller_get_state(controller, before);
  hx_controller_input_default(&input);
  input.foot_force[HX_LEGS - 1][2] = nan("");
  CHECK(hx_controller_step(controller, &input, NULL, 1.0) == HX_INVALID_ARGUMENT);
  CHECK(strlen(hx_controller_message(controller)) > 0);
  hx_controller_input_default(&input);
  CHECK(hx_controller_step(controller, &input, NULL, 0.0) == HX_INVALID_ARGUMENT);
  hx_controller_definition_default(&definition);
  definition.gait.duty = 2.0;
  CHECK(hx_controller_reset(controller, &definition, 0.0) != HX_OK);
  hx_controller_get_state(controller, after);
  CHECK(memcmp(before, after, size) == 0);
  free(before), free(after);
  hx_controller_destroy(controller);
}

/* ---- refusals ---- */

static void an_impossible_definition_is_refused_by_its_name(void) {
  hxController *controller = hx_controller_create();
  hxControllerDefinition definition;
  hx_controller_definition_default(&definition);
  CHECK(hx_controller_reset(controller, &definition, nan("")) == HX_INVALID_ARGUMENT);
  CHECK(strstr(hx_controller_message(controller), "start time: got a number that is not finite"));
  hxKnownLink *femur = &definition.leg[0].link[1];
  for (int side = -1; side <= 1; side += 2) {
    const double stance = femur->stance;
    femur->stance = side < 0 ? femur->angle_min - 0.01 : femur->angle_max + 0.01;
    CHECK(hx_controller_reset(controller, &definition, 0.0) == HX_INVALID_MODEL);
    CHECK(strstr(hx_controller_message(controller), "LF.femur.stance: got"));
    femur->stance = stance;
  }
  femur->stance = femur->angle_max + 0.01; /* of two problems the first one is told */
  definition.leg[HX_LEGS - 1].link[1].stance = femur->stance;
  CHECK(hx_controller_reset(controller, &definition, 0.0) == HX_INVALID_MODEL);
  CHECK(strstr(hx_controller_message(controller), "LF.femur.stance: got"));
  hx_controller_definition_default(&definition);
  femur->length = femur->offset_z = 0.0;
  CHECK(hx_controller_reset(controller, &definition, 0.0) == HX_INVALID_MODEL);
  CHECK(strstr(hx_controller_message(controller), "LF.femur.length: got 0"));
  hx_controller_destroy(controller);
}

/* Magic, version and size are in the first 16 bytes. */
static void a_state_of_another_version_is_refused(void) {
  hxController *controller = hx_controller_create();
  const size_t size = hx_controller_state_size();
  unsigned char *before = malloc(size), *after = malloc(size);
  CHECK(before && after);
  tick(controller, 0.05, 10);
  hx_controller_get_state(controller, before);
  for (size_t place = 0; place < 16; ++place) {
    before[place] ^= 1;
    CHECK(hx_controller_set_state(controller, before, size) == HX_BAD_STATE);
    before[place] ^= 1;
  }
  CHECK(hx_controller_set_state(controller, before, size - 1) == HX_BAD_STATE);
  hx_controller_get_state(controller, after);
  CHECK(memcmp(before, after, size) == 0);
  free(before), free(after);
  hx_controller_destroy(controller);
}

/* ---- parts and gaits ---- */

/* Walks with forces on the feet and returns the last joint commands. */
static hxControllerOutput walked(hxController *controller,
                                 const hxControllerDefinition *definition) {
  hxControllerInput input;
  hxControllerOutput told;
  hx_controller_input_default(&input);
  input.command.vx = 0.05;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int axis = 0; axis < 3; ++axis)
      input.foot_force[leg][axis] = axis == 2 ? 8.0 + 2.0 * leg : 3.0;
  CHECK(hx_controller_reset(controller, definition, 0.0) == HX_OK);
  for (int k = 1; k <= 150; ++k)
    CHECK(hx_controller_step(controller, &input, NULL, 0.005 * k) == HX_OK);
  hx_controller_output(controller, &input, &told);
  return told;
}

static int is_same_command(const hxControllerOutput *a, const hxControllerOutput *b) {
  return memcmp(a->angle_ref, b->angle_ref, sizeof a->angle_ref) == 0;
}

static void without_its_parts_the_paper_s_control_is_the_kinematic_one(void) {
  hxController *controller = hx_controller_create();
  hxControllerDefinition definition;
  hx_controller_definition_default(&definition);
  definition.control = HX_CONTROL_KINEMATIC;
  const hxControllerOutput kinematic = walked(controller, &definition);
  definition.control = HX_CONTROL_PAPER;
  for (int parts = 0; parts < 8; ++parts) {
    definition.parts.paper_share = parts & 1;
    definition.parts.paper_pid = parts >> 1 & 1;
    definition.parts.paper_suspension = parts >> 2;
    const hxControllerOutput paper = walked(controller, &definition);
    CHECK(is_same_command(&paper, &kinematic) == (parts == 0));
  }
  hx_controller_destroy(controller);
}

int main(void) {
  without_a_command_it_holds_the_stance();
  a_saved_state_goes_on_as_it_would_have();
  bad_input_changes_nothing();
  an_impossible_definition_is_refused_by_its_name();
  a_state_of_another_version_is_refused();
  without_its_parts_the_paper_s_control_is_the_kinematic_one();
  return failures;
}
