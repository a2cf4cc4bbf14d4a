/* test_plant.c - tests the plant through hexapod.h: laws of motion, equal bits after repeating and
 * restoring, refusals, and every choice of law. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <hexapod/hexapod.h>

#include "check.h"

enum { LF, LM, LR, RF, RM, RR };
enum { COXA, FEMUR, TIBIA };

static const double g = 9.81; /* m/s2 */

static double weight_on_feet(const hxOutput *seen) {
  double sum = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) sum += seen->foot.normal_force[leg];
  return sum;
}

static hxOutput seen_by(hxPlant *plant, const hxInput *input) {
  hxOutput seen;
  memset(&seen, 0, sizeof seen);
  hx_plant_output(plant, input, &seen);
  return seen;
}

static void walk_in_place(hxPlant *plant, double t_end) {
  hxInput input;
  hx_input_default(&input);
  for (int k = 0; hx_plant_time(plant) < t_end; ++k) {
    input.angle_ref[k % HX_LEGS][FEMUR] += k % 2 ? -0.02 : 0.02;
    CHECK(hx_plant_step(plant, &input, fmin(t_end, hx_plant_time(plant) + 0.005)) == HX_OK);
  }
}

/* Makes motors without torque and gears without friction, so that only gravity acts on a robot in
 * the air. */
static hxDefinition falling_robot(void) {
  hxDefinition robot;
  hx_definition_default(&robot);
  robot.servo.mode = HX_SERVO_TORQUE;
  robot.servo.coulomb_friction = 0.0;
  robot.initial.position[2] += 1.0;
  return robot;
}

/* ---- laws ---- */

static void standing_feet_carry_the_weight(void) {
  hxPlant *plant = hx_plant_create();
  hxInput input;
  hx_input_default(&input);
  CHECK(hx_plant_step(plant, &input, 1.0) == HX_OK);
  CHECK(hx_plant_time(plant) == 1.0);
  const hxOutput seen = seen_by(plant, &input);
  NEAR(weight_on_feet(&seen), 5.6 * g, 1e-6);
  for (int leg = 0; leg < HX_LEGS; ++leg) CHECK(seen.foot.contact[leg] == 1);
  hx_plant_destroy(plant);
}

static void everything_falls_at_the_same_rate(void) {
  hxPlant *plant = hx_plant_create();
  const hxDefinition robot = falling_robot();
  const double z = robot.initial.position[2], t = 0.3;
  double acceleration[HX_BODIES][6], multiplier[HX_BODIES - 1][HX_MULTIPLIERS],
      torque[HX_BODIES - 1];
  hxInput input;
  hx_input_default(&input);
  CHECK(hx_plant_reset(plant, &robot, 0.0) == HX_OK);
  hx_plant_accelerations(plant, &input, acceleration, multiplier, torque);
  for (int body = 0; body < HX_BODIES; ++body) {
    NEAR(acceleration[body][2], -g, 1e-10);
    for (int k = 0; k < 6; ++k)
      if (k != 2) NEAR(acceleration[body][k], 0.0, 1e-10);
  }
  CHECK(hx_plant_step(plant, &input, t) == HX_OK);
  const hxOutput seen = seen_by(plant, &input);
  NEAR(seen.torso.position[2], z - 0.5 * g * t * t, 1e-9);
  NEAR(seen.torso.velocity[2], -g * t, 1e-9);
  NEAR(seen.energy.kinetic, 0.5 * 5.6 * g * g * t * t, 1e-7);
  NEAR(seen.energy.residual, 0.0, 1e-7);
  hx_plant_destroy(plant);
}

static void rates_are_the_derivatives_of_coordinates(void) {
  hxPlant *plant = hx_plant_create();
  hxCoordinates before, after, rate;
  hxInput input;
  hx_input_default(&input);
  input.push_force[0] = 5.0;
  CHECK(hx_plant_step(plant, &input, 0.1) == HX_OK);
  hx_plant_get_coordinates(plant, &before);
  hx_plant_rates(plant, &input, &rate);
  CHECK(hx_plant_step(plant, &input, 0.1 + 1e-6) == HX_OK);
  hx_plant_get_coordinates(plant, &after);
  for (int i = 0; i < 3; ++i)
    NEAR((after.position[i] - before.position[i]) / 1e-6, rate.position[i], 1e-4);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      NEAR((after.angle[leg][joint] - before.angle[leg][joint]) / 1e-6, rate.angle[leg][joint],
           1e-4);
      NEAR(rate.angle[leg][joint], before.speed[leg][joint], 1e-12);
    }
  CHECK(hx_plant_set_coordinates(plant, 0.1, &before) == HX_OK);
  hx_plant_get_coordinates(plant, &after);
  for (size_t k = 0; k < HX_COORDINATES; ++k)
    NEAR(((const double *)&after)[k], ((const double *)&before)[k], 1e-12);
  hx_plant_destroy(plant);
}

/* ---- equal bits ---- */

static void a_saved_state_goes_on_as_it_would_have(void) {
  hxPlant *one = hx_plant_create(), *two = hx_plant_create();
  const size_t size = hx_plant_state_size();
  unsigned char *saved = malloc(size), *end_of_one = malloc(size), *end_of_two = malloc(size);
  CHECK(saved && end_of_one && end_of_two);
  walk_in_place(one, 0.1);
  hx_plant_get_state(one, saved);
  walk_in_place(one, 0.2);
  CHECK(hx_plant_set_state(two, saved, size) == HX_OK);
  walk_in_place(two, 0.2);
  hx_plant_get_state(one, end_of_one);
  hx_plant_get_state(two, end_of_two);
  CHECK(memcmp(end_of_one, end_of_two, size) == 0);
  saved[size / 2] ^= 1;
  CHECK(hx_plant_set_state(two, saved, size) == HX_BAD_STATE);
  CHECK(hx_plant_set_state(two, saved, size - 1) == HX_BAD_STATE);
  hx_plant_get_state(two, end_of_one);
  CHECK(memcmp(end_of_one, end_of_two, size) == 0);
  free(saved), free(end_of_one), free(end_of_two);
  hx_plant_destroy(one), hx_plant_destroy(two);
}

/* ---- refusals ---- */

static void bad_input_changes_nothing(void) {
  hxPlant *plant = hx_plant_create();
  const size_t size = hx_plant_state_size();
  unsigned char *before = malloc(size), *after = malloc(size);
  char message[HX_MESSAGE_SIZE];
  double body[HX_BODIES][HX_BODY_STATE];
  hxDefinition robot;
  hxInput input;
  CHECK(before && after);
  hx_definition_default(&robot);
  hx_input_default(&input);
  CHECK(hx_plant_step(plant, &input, 0.01) == HX_OK);
  hx_plant_get_state(plant, before);

  CHECK(hx_plant_step(plant, &input, 0.005) == HX_INVALID_ARGUMENT);
  CHECK(strstr(hx_plant_message(plant), "0.005"));
  CHECK(hx_plant_step(plant, &input, HUGE_VAL) == HX_INVALID_ARGUMENT);
  input.angle_ref[RR][TIBIA] = nan("");
  CHECK(hx_plant_step(plant, &input, 0.02) == HX_INVALID_ARGUMENT);
  CHECK(strstr(hx_plant_message(plant), "RR.tibia.angle_ref"));
  robot.leg[RR].link[TIBIA].mass = -1.0;
  CHECK(hx_definition_check(&robot, message) == HX_INVALID_MODEL);
  CHECK(strstr(message, "RR.tibia.mass"));
  CHECK(hx_definition_check(&robot, NULL) == HX_INVALID_MODEL);
  CHECK(hx_plant_reset(plant, &robot, 0.0) == HX_INVALID_MODEL);
  hx_definition_default(&robot);
  CHECK(hx_plant_reset(plant, &robot, nan("")) == HX_INVALID_ARGUMENT);
  hx_plant_get_bodies(plant, body);
  body[HX_BODIES - 1][HX_BODY_STATE - 1] = nan("");
  CHECK(hx_plant_set_bodies(plant, (const double (*)[HX_BODY_STATE])body) != HX_OK);

  hx_plant_get_state(plant, after);
  CHECK(memcmp(before, after, size) == 0);
  free(before), free(after);
  hx_plant_destroy(plant);
}

/* Magic, version and size are in the first 16 bytes. */
static void a_state_of_another_version_is_refused(void) {
  hxPlant *plant = hx_plant_create();
  const size_t size = hx_plant_state_size();
  unsigned char *before = malloc(size), *after = malloc(size);
  CHECK(before && after);
  walk_in_place(plant, 0.02);
  hx_plant_get_state(plant, before);
  for (size_t place = 0; place < 16; ++place) {
    before[place] ^= 1;
    CHECK(hx_plant_set_state(plant, before, size) == HX_BAD_STATE);
    CHECK(strstr(hx_plant_message(plant), "saved state: got"));
    before[place] ^= 1;
  }
  hx_plant_get_state(plant, after);
  CHECK(memcmp(before, after, size) == 0);
  free(before), free(after);
  hx_plant_destroy(plant);
}

static void ranges_cover_what_they_name(void) {
  const hxRange *range;
  const size_t definition = hx_definition_ranges(&range);
  CHECK(definition > 400 && strcmp(range[0].name, "torso.mass") == 0);
  for (size_t k = 0; k < definition; ++k)
    CHECK(range[k].offset < sizeof(hxDefinition) && range[k].min <= range[k].max);
  const size_t input = hx_input_ranges(&range);
  CHECK(input == 114);
  for (size_t k = 0; k < input; ++k)
    CHECK(range[k].offset == k * sizeof(double) && !range[k].is_int);
  for (hxStatus status = HX_OK; status <= HX_BAD_STATE; ++status)
    CHECK(strlen(hx_status_name(status)) > 0);
}

int main(void) {
  standing_feet_carry_the_weight();
  everything_falls_at_the_same_rate();
  rates_are_the_derivatives_of_coordinates();
  a_saved_state_goes_on_as_it_would_have();
  bad_input_changes_nothing();
  a_state_of_another_version_is_refused();
  ranges_cover_what_they_name();
  return failures;
}
