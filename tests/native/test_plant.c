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

/* the rate of a linear function of an input is its difference quotient */
static void tangents_are_differences(void) {
  hxPlant *plant = hx_plant_create();
  hxInput input, change;
  hxCoordinates rate, changed, tangent;
  hxOutput d_output;
  const double step = 1e-3;
  hx_input_default(&input);
  CHECK(hx_plant_step(plant, &input, 0.2) == HX_OK);
  memset(&change, 0, sizeof change);
  change.push_force[2] = 1.0;
  change.torque_ref[RM][TIBIA] = 0.1;
  const hxStatus status = hx_plant_tangent(plant, &input, &change, NULL, &tangent, &d_output);
  CHECK(status == HX_OK || status == HX_INVALID_ARGUMENT); /* compilers without complex numbers */
  hx_plant_rates(plant, &input, &rate);
  input.push_force[2] += step * change.push_force[2];
  input.torque_ref[RM][TIBIA] += step * change.torque_ref[RM][TIBIA];
  hx_plant_rates(plant, &input, &changed);
  if (status == HX_OK) {
    for (int i = 0; i < 3; ++i)
      NEAR(tangent.velocity[i], (changed.velocity[i] - rate.velocity[i]) / step, 1e-8);
    NEAR(tangent.speed[RM][TIBIA], (changed.speed[RM][TIBIA] - rate.speed[RM][TIBIA]) / step, 1e-6);
    CHECK(fabs(tangent.speed[RM][TIBIA]) > 1.0);
  }
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

static void stops_at_touch_downs_leave_no_trace(void) {
  hxPlant *through = hx_plant_create(), *stopping = hx_plant_create();
  hxDefinition robot;
  hxInput input;
  int stops = 0, found = 0;
  hx_definition_default(&robot);
  hx_input_default(&input);
  robot.initial.position[2] += 0.02;
  robot.initial.angle[RR][FEMUR] += 0.1; /* the feet land at different times */
  CHECK(hx_plant_reset(through, &robot, 0.0) == HX_OK &&
        hx_plant_reset(stopping, &robot, 0.0) == HX_OK);
  CHECK(hx_plant_step_to_event(through, &input, 0.3, 0, &found) == HX_OK && found);
  for (int calls = 0; hx_plant_time(stopping) < 0.3 && calls < 1000; ++calls) {
    CHECK(hx_plant_step_to_event(stopping, &input, 0.3, 1, &found) == HX_OK);
    stops += found;
  }
  CHECK(stops >= 2);
  const hxOutput a = seen_by(through, &input), b = seen_by(stopping, &input);
  CHECK(memcmp(&a, &b, sizeof a) == 0);
  CHECK(a.solver.touchdowns >= 6.0);
  hx_plant_destroy(through), hx_plant_destroy(stopping);
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

static void coordinates_that_are_no_state_of_the_robot_are_refused(void) {
  hxPlant *plant = hx_plant_create();
  hxCoordinates good, x;
  hx_plant_get_coordinates(plant, &good);
  CHECK(hx_plant_set_coordinates(plant, nan(""), &good) == HX_NOT_FINITE);
  x = good, x.angle[RR][TIBIA] = 1.1e5;
  CHECK(hx_plant_set_coordinates(plant, 0.0, &x) == HX_NOT_FINITE);
  x = good, x.angle[LF][COXA] = nan("");
  CHECK(hx_plant_set_coordinates(plant, 0.0, &x) == HX_NOT_FINITE);
  x = good, x.position[0] = 1.1e9;
  CHECK(hx_plant_set_coordinates(plant, 0.0, &x) == HX_NOT_FINITE);
  x = good, memset(x.quaternion, 0, sizeof x.quaternion);
  CHECK(hx_plant_set_coordinates(plant, 0.0, &x) == HX_NOT_FINITE);
  CHECK(strstr(hx_plant_message(plant), "a quaternion near 0, expected a state of the robot"));
  CHECK(hx_plant_set_coordinates(plant, 0.0, &good) == HX_OK);
  hx_plant_destroy(plant);
}

static void directions_that_are_not_finite_are_refused_and_missing_ones_are_zero(void) {
  hxPlant *plant = hx_plant_create();
  hxInput input, d_input;
  hxCoordinates dx, rate, other;
  hxOutput output;
  hx_input_default(&input);
  memset(&d_input, 0, sizeof d_input), memset(&dx, 0, sizeof dx);
  dx.angle[LF][COXA] = INFINITY;
  CHECK(hx_plant_tangent(plant, &input, &d_input, &dx, &rate, &output) == HX_INVALID_ARGUMENT);
  CHECK(strstr(hx_plant_message(plant), "derivatives: got a direction that is not finite"));
  dx.angle[LF][COXA] = 1.0;
  CHECK(hx_plant_tangent(plant, &input, &d_input, &dx, &rate, &output) == HX_OK);
  CHECK(hx_plant_tangent(plant, &input, NULL, &dx, &other, NULL) == HX_OK);
  CHECK(memcmp(&rate, &other, sizeof rate) == 0);
  CHECK(hx_plant_tangent(plant, &input, NULL, NULL, &rate, &output) == HX_OK);
  double number[sizeof rate / sizeof(double)];
  memcpy(number, &rate, sizeof number);
  for (size_t i = 0; i < sizeof number / sizeof *number; ++i) NEAR(number[i], 0.0, 0.0);
  CHECK(hx_plant_tangent(plant, &input, &d_input, NULL, NULL, &output) == HX_OK);
  NEAR(output.torso.position[2], 0.0, 0.0);
  hx_plant_destroy(plant);
}

static void impossible_inertias_are_refused(void) {
  /* xx, yy, zz, xy, xz, yz: each breaks another condition of a body's inertia */
  static const double inertia[][6] = {
      {0, 1, 1, 0, 0, 0},   {1, 0, 1, 0, 0, 0},   {1, 1, 0, 0, 0, 0},
      {3, 1, 1, 0, 0, 0},   {1, 3, 1, 0, 0, 0},   {1, 1, 3, 0, 0, 0},
      {1, 1, 1, 0.6, 0, 0}, {1, 1, 1, 0, 0.6, 0}, {1, 1, 1, 0.4, 0.4, 0.4}};
  hxDefinition robot;
  char message[HX_MESSAGE_SIZE];
  for (size_t k = 0; k < sizeof inertia / sizeof *inertia; ++k) {
    hx_definition_default(&robot);
    for (int i = 0; i < 6; ++i) robot.leg[RF].link[FEMUR].inertia[i] = 1e-3 * inertia[k][i];
    CHECK(hx_definition_check(&robot, message) == HX_INVALID_MODEL);
    CHECK(strstr(message, "RF.femur.inertia_"));
  }
  for (int i = 0; i < 6; ++i) robot.leg[RF].link[FEMUR].inertia[i] = i < 3 ? 1e-3 : 0.0;
  CHECK(hx_definition_check(&robot, message) == HX_OK);
}

static void impossible_legs_are_refused(void) {
  hxDefinition robot;
  char message[HX_MESSAGE_SIZE];
  hx_definition_default(&robot);
  hxLink *link = &robot.leg[LM].link[TIBIA];
  const hxLink good = *link;
  link->angle_min = link->angle_max;
  CHECK(hx_definition_check(&robot, message) == HX_INVALID_MODEL);
  CHECK(strstr(message, "LM.tibia.angle_min: got") && strstr(message, "below the joint's"));
  *link = good, memset(link->axis, 0, sizeof link->axis);
  CHECK(hx_definition_check(&robot, message) == HX_INVALID_MODEL);
  CHECK(strstr(message, "LM.tibia.axis: got 0, expected a direction"));
  *link = good, link->length = link->offset_y = link->offset_z = 0.0;
  CHECK(hx_definition_check(&robot, message) == HX_INVALID_MODEL);
  CHECK(strstr(message, "LM.tibia.length: got 0, expected a tip away from the joint"));
  link->offset_z = -0.1;
  CHECK(hx_definition_check(&robot, message) == HX_OK);
  link->offset_z = 0.0, link->offset_y = 0.1;
  CHECK(hx_definition_check(&robot, message) == HX_OK);
  *link = good, memset(robot.initial.quaternion, 0, sizeof robot.initial.quaternion);
  CHECK(hx_definition_check(&robot, message) == HX_INVALID_MODEL);
  CHECK(strstr(message, "initial.quaternion: got 0, expected a quaternion"));
}

/* ---- every law, method and mode ---- */

static void moves(hxPlant *plant, const hxDefinition *robot) {
  double body[HX_BODIES][HX_BODY_STATE], torso[HX_BODY_STATE];
  CHECK(hx_plant_reset(plant, robot, 0.0) == HX_OK);
  walk_in_place(plant, 0.05);
  hxInput input;
  hx_input_default(&input);
  const hxOutput seen = seen_by(plant, &input);
  CHECK(isfinite(seen.torso.position[2]) && isfinite(seen.energy.residual) &&
        isfinite(weight_on_feet(&seen)));
  CHECK(seen.solver.steps >= 10.0);
  hx_plant_get_bodies(plant, body);
  hx_plant_get_torso(plant, torso);
  CHECK(memcmp(torso, body[0], sizeof torso) == 0);
  CHECK(hx_plant_set_bodies(plant, (const double (*)[HX_BODY_STATE])body) == HX_OK);
}

static void every_law_method_and_drive_moves(void) {
  hxPlant *plant = hx_plant_create();
  hxDefinition robot;
  hx_definition_default(&robot);
  robot.initial.position[2] += 0.001;
  robot.terrain.incline = 0.04;
  for (int law = HX_CONTACT_EXACT_RESTITUTION; law <= HX_CONTACT_HERTZ; ++law)
    for (int friction = HX_FRICTION_TANH; friction <= HX_FRICTION_LUGRE; ++friction) {
      robot.contact.law = law, robot.friction.law = friction;
      robot.terrain.kind = friction == HX_FRICTION_NONE ? HX_TERRAIN_FLAT : HX_TERRAIN_SLOPE;
      moves(plant, &robot);
    }
  hx_definition_default(&robot);
  for (int method = HX_METHOD_ROSW3; method <= HX_METHOD_RK4; ++method)
    for (int mode = HX_SERVO_POSITION; mode <= HX_SERVO_KINEMATIC; ++mode) {
      robot.solver.method = method, robot.servo.mode = mode;
      robot.solver.step = method == HX_METHOD_RK4 ? 5e-5 : 0.0;
      robot.solver.projection = mode == HX_SERVO_TORQUE ? HX_PROJECTION_NONE : HX_PROJECTION_STEP;
      moves(plant, &robot);
    }
  hx_plant_destroy(plant);
}

static void ranges_cover_what_they_name(void) {
  const hxRange *range;
  const size_t definition = hx_definition_ranges(&range);
  CHECK(definition > 400 && strcmp(range[0].name, "torso.mass") == 0);
  for (size_t k = 0; k < definition; ++k)
    CHECK(range[k].offset < sizeof(hxDefinition) && range[k].min <= range[k].max);
  const size_t input = hx_input_ranges(&range);
  CHECK(input == 78);
  for (size_t k = 0; k < input; ++k)
    CHECK(range[k].offset == k * sizeof(double) && !range[k].is_int);
  for (hxStatus status = HX_OK; status <= HX_BAD_STATE; ++status)
    CHECK(strlen(hx_status_name(status)) > 0);
}

/* The first input that a step refuses is the one next to the end of its range. */
static void inputs_are_accepted_up_to_the_ends_of_their_ranges(void) {
  hxPlant *plant = hx_plant_create();
  const hxRange *range;
  const size_t count = hx_input_ranges(&range);
  for (size_t k = 0; k < count; ++k)
    for (int end = 0; end < 2; ++end) {
      hxInput input;
      hx_input_default(&input);
      double *x = (double *)&input + k;
      *x = end ? range[k].max : range[k].min;
      CHECK(hx_plant_step(plant, &input, 0.0) == HX_OK);
      *x = nextafter(*x, end ? INFINITY : -INFINITY);
      CHECK(hx_plant_step(plant, &input, 0.0) == HX_INVALID_ARGUMENT);
      CHECK(strstr(hx_plant_message(plant), range[k].name) != NULL);
    }
  hx_plant_destroy(plant);
}

int main(void) {
  standing_feet_carry_the_weight();
  everything_falls_at_the_same_rate();
  rates_are_the_derivatives_of_coordinates();
  tangents_are_differences();
  a_saved_state_goes_on_as_it_would_have();
  stops_at_touch_downs_leave_no_trace();
  bad_input_changes_nothing();
  a_state_of_another_version_is_refused();
  coordinates_that_are_no_state_of_the_robot_are_refused();
  directions_that_are_not_finite_are_refused_and_missing_ones_are_zero();
  impossible_inertias_are_refused();
  impossible_legs_are_refused();
  every_law_method_and_drive_moves();
  ranges_cover_what_they_name();
  inputs_are_accepted_up_to_the_ends_of_their_ranges();
  return failures;
}
