/* test_choices.c - every choice that a definition offers, on a robot that drops, walks and is
 * pushed: a walk from a saved state has the same bits, a walk that looks for events too, what a
 * push adds to the accelerations is the derivative by it, and the energy balance closes.
 * Definitions that contradict themselves are refused by name.
 *
 * usage: test_choices FOLDER; of grid files: smooth, blocks, material. Soil lies on the blocks and
 * on the same blocks with all heights 0.
 */
#include <stdlib.h>
#include <string.h>

#include <hexapod/hexapod.h>
#include <hexapod/terrain.h>

#include "check.h"

enum { GRIDS = 3, STEPS = 30, STATE = 1 << 19, FILE_SIZE = 1 << 20 };

typedef struct {
  const char *name;
  void (*make)(hxDefinition *d);
  int grid;         /* 1 + index of the ground's file; 0: none */
  double imbalance; /* J  allowed in the energy balance */
} hxChoice;

/* of accelerations, which are differences of terms that are a thousand times as large */
static const double rounding = 1e-8;

static hxTerrain *terrain[GRIDS];

/* ---- choices ---- */

static void nothing(hxDefinition *d) { (void)d; }
static void no_friction(hxDefinition *d) { d->friction.law = HX_FRICTION_NONE; }
static void lugre(hxDefinition *d) {
  d->friction.law = HX_FRICTION_LUGRE, d->friction.mu_static = 0.9, d->friction.viscous = 0.02;
}
static void bristles(hxDefinition *d) {
  d->friction.law = HX_FRICTION_BRISTLE, d->friction.mu_static = 0.9;
  d->friction.spin_radius = 0.005, d->friction.rolling_radius = 0.001;
}
static void turning(hxDefinition *d) {
  d->friction.spin_radius = 0.005, d->friction.rolling_radius = 0.001;
  d->friction.mu_static = 0.9;
}
static void slope(hxDefinition *d) {
  d->initial.position[2] += 0.02;
  d->terrain.kind = HX_TERRAIN_SLOPE, d->terrain.incline = 0.1, d->terrain.heading = 0.4;
}
static void torque_mode(hxDefinition *d) { d->servo.mode = HX_SERVO_TORQUE; }
static void kinematic_mode(hxDefinition *d) { d->servo.mode = HX_SERVO_KINEMATIC; }
static void motor(hxDefinition *d) {
  d->servo.drive = HX_DRIVE_MOTOR;
  d->servo.voltage = 12.0, d->servo.torque_constant = 1.8, d->servo.resistance = 2.0;
  d->servo.supply_resistance = 0.1, d->servo.viscous_friction = 0.05;
}
static void warm_motor(hxDefinition *d) {
  motor(d);
  d->servo.winding_capacity = 2.0, d->servo.housing_capacity = 40.0;
  d->servo.winding_to_housing = 5.0, d->servo.housing_to_air = 8.0;
  d->servo.start_temperature = 345.0, d->servo.air_temperature = 295.0;
  d->servo.derate_temperature = 340.0, d->servo.temperature_max = 350.0;
}
static void rubbing_gear(hxDefinition *d) {
  motor(d);
  d->servo.stribeck_friction = 0.05, d->servo.stribeck_speed = 0.2,
  d->servo.stribeck_exponent = 2.0;
  d->servo.motor_load_friction = 0.05, d->servo.external_load_friction = 0.05;
  d->servo.stribeck_motor_load_friction = 0.02, d->servo.stribeck_external_load_friction = 0.02;
  d->servo.quadratic_motor_friction = 0.01, d->servo.quadratic_external_friction = 0.01;
}
static void bus(hxDefinition *d) { d->servo.bus_period = 0.004, d->servo.command_step = 0.005; }
static void stops(hxDefinition *d) {
  d->servo.stop_stiffness = 200.0, d->servo.stop_damping = 1.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) d->leg[leg].link[0].angle_max = 0.05;
}
static void rotors(hxDefinition *d) { d->servo.rotor_inertia = 0.01, d->servo.gear_ratio = 250.0; }
static void drifting(hxDefinition *d) { d->solver.projection = HX_PROJECTION_NONE; }
static void body(hxDefinition *d) {
  d->body.contact = HX_BODY_ON, d->body.self_contact = HX_SELF_FORCE;
  d->body.torso_box[0] = 0.1, d->body.torso_box[1] = 0.08, d->body.torso_box[2] = 0.03;
  d->body.knee_radius = 0.03, d->body.shank_radius = 0.02, d->body.shank_position = 0.5;
  d->body.corner_radius = 0.005;
}
/* The robot lies on its back, so that torso and legs touch the ground. */
static void on_its_back(hxDefinition *d) {
  body(d);
  d->initial.position[2] = 0.2;
  d->initial.quaternion[0] = 0.0, d->initial.quaternion[1] = 1.0;
}
/* The soil carries a foot of 2 kg at a depth of some millimetres. */
static void soft(hxDefinition *d, int law) {
  d->soil.law = law;
  d->soil.frictional_modulus = 2e6, d->soil.cohesive_modulus = 1e4, d->soil.exponent = 1.1;
  d->soil.resistance = 5e6, d->soil.yield_pressure = 2e4, d->soil.hardening = 5e6;
  d->soil.cohesion = 500.0, d->soil.friction_angle = 0.5;
}
static void bekker(hxDefinition *d) { soft(d, HX_SOIL_BEKKER); }
static void granular(hxDefinition *d) { soft(d, HX_SOIL_GRANULAR), d->foot_pad_radius = 0.03; }
static void mud(hxDefinition *d) { soft(d, HX_SOIL_MUD); }
static void on_grid(hxDefinition *d) {
  d->terrain.kind = HX_TERRAIN_GRID, d->initial.position[2] += 0.06;
}
static void raised_grid(hxDefinition *d) { on_grid(d), d->terrain.height = 0.01; }
static void bristles_on_grid(hxDefinition *d) { on_grid(d), bristles(d); }
static void body_on_grid(hxDefinition *d) { on_grid(d), on_its_back(d); }
static void soil_on_grid(hxDefinition *d) { on_grid(d), granular(d); }
static void bekker_on_grid(hxDefinition *d) { on_grid(d), bekker(d), body(d); }

static const hxChoice choices[] = {{"nothing", nothing, 0, 0.01},
                                   {"no friction", no_friction, 0, 0.01},
                                   {"lugre", lugre, 0, 0.01},
                                   {"bristles", bristles, 0, 0.01},
                                   {"turning", turning, 0, 0.01},
                                   {"slope", slope, 0, 0.01},
                                   {"torque mode", torque_mode, 0, 0.01},
                                   {"kinematic mode", kinematic_mode, 0, 0.01},
                                   {"motor", motor, 0, 0.01},
                                   {"warm motor", warm_motor, 0, 0.01},
                                   {"rubbing gear", rubbing_gear, 0, 0.01},
                                   {"bus", bus, 0, 0.01},
                                   {"stops", stops, 0, 0.01},
                                   {"rotors", rotors, 0, 0.01},
                                   {"drifting", drifting, 0, 0.01},
                                   {"body", body, 0, 0.01},
                                   {"on its back", on_its_back, 0, 0.01},
                                   {"bekker", bekker, 0, 0.01},
                                   {"granular", granular, 0, 0.01},
                                   {"mud", mud, 0, 0.01},
                                   {"smooth grid", on_grid, 1, 0.01},
                                   {"raised grid", raised_grid, 1, 0.01},
                                   {"blocks", on_grid, 2, 0.01},
                                   {"bristles on blocks", bristles_on_grid, 2, 0.01},
                                   {"materials", on_grid, 3, 0.01},
                                   {"body on a grid", body_on_grid, 1, 0.01},
                                   {"body on blocks", body_on_grid, 2, 0.01},
                                   {"soil on a grid", soil_on_grid, 1, 0.01},
                                   {"bekker on a grid", bekker_on_grid, 1, 0.01}};

/* ---- walks ---- */

/* The command of a macro-step: every second leg is lifted and swung, then the others. */
static void command(hxInput *input, int k) {
  hx_input_default(input);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const int up = (k / 10 + leg) % 2;
    input->angle_ref[leg][0] += up ? 0.1 : -0.1;
    input->angle_ref[leg][1] += up ? -0.2 : 0.0;
    input->torque_ref[leg][2] = 0.1;
  }
  input->push_force[0] = k == 7 ? 5.0 : 0.0;
}

/* Walks for some steps; through events where `look`, which must not change a bit. */
static void walk(hxPlant *plant, int first, int last, int look, const char *name) {
  hxInput input;
  int event;
  for (int k = first; k < last; ++k) {
    const double end = 0.01 * (k + 1);
    command(&input, k);
    const hxStatus status = look ? hx_plant_step_to_event(plant, &input, end, 0, &event)
                                 : hx_plant_step(plant, &input, end);
    if (status != HX_OK) fprintf(stderr, "%s: %s\n", name, hx_plant_message(plant));
    CHECK(status == HX_OK);
    if (status != HX_OK) return;
  }
}

static double largest_of(const double *x, size_t n) {
  double largest = 0.0;
  for (size_t i = 0; i < n; ++i) largest = fmax(largest, fabs(x[i]));
  return largest;
}

/* Accelerations are affine in a push on the torso, so the derivative by it is a difference. It is
 * not where friction depends on load. */
static void check_derivative(hxPlant *plant, const hxDefinition *d, const char *name) {
  static const hxInput none;
  hxInput input, push = none;
  hxCoordinates before, after, rate;
  hxOutput output;
  command(&input, 5);
  push.push_force[0] = 1.0, push.push_torque[2] = 0.2;
  const hxStatus status = hx_plant_tangent(plant, &input, &push, NULL, &rate, &output);
  CHECK(status == HX_OK);
  if (status != HX_OK || d->servo.motor_load_friction > 0.0) return;
  hx_plant_rates(plant, &input, &before);
  input.push_force[0] += 1.0, input.push_torque[2] += 0.2;
  hx_plant_rates(plant, &input, &after);
  double difference[HX_COORDINATES];
  const double *a = (const double *)&after, *b = (const double *)&before,
               *c = (const double *)&rate;
  for (size_t i = 0; i < HX_COORDINATES; ++i) difference[i] = a[i] - b[i] - c[i];
  const double error = largest_of(difference, HX_COORDINATES), size = largest_of(a, HX_COORDINATES);
  if (!(error <= rounding * (1.0 + size))) fprintf(stderr, "%s: %g of %g\n", name, error, size);
  CHECK(error <= rounding * (1.0 + size));
}

static void holds(const hxChoice *choice, const hxDefinition *d) {
  static unsigned char saved[STATE], first[STATE], second[STATE], third[STATE];
  const size_t size = hx_plant_state_size();
  hxPlant *one = hx_plant_create(), *two = hx_plant_create();
  hxInput input;
  hxOutput output;
  CHECK(one && two && size <= STATE);
  if (!one || !two || size > STATE) return;
  hx_plant_set_terrain(one, choice->grid ? terrain[choice->grid - 1] : NULL);
  hx_plant_set_terrain(two, choice->grid ? terrain[choice->grid - 1] : NULL);
  const hxStatus status = hx_plant_reset(one, d, 0.0);
  if (status != HX_OK) fprintf(stderr, "%s: %s\n", choice->name, hx_plant_message(one));
  CHECK(status == HX_OK && hx_plant_reset(two, d, 0.0) == HX_OK);
  if (status != HX_OK) return;
  walk(one, 0, STEPS / 2, 0, choice->name);
  hx_plant_get_state(one, saved);
  walk(one, STEPS / 2, STEPS, 0, choice->name);
  hx_plant_get_state(one, first);
  CHECK(hx_plant_set_state(two, saved, size) == HX_OK);
  walk(two, STEPS / 2, STEPS, 0, choice->name);
  hx_plant_get_state(two, second);
  CHECK(memcmp(first, second, size) == 0);
  CHECK(hx_plant_set_state(two, saved, size) == HX_OK);
  walk(two, STEPS / 2, STEPS, 1, choice->name);
  hx_plant_get_state(two, third);
  CHECK(memcmp(first, third, size) == 0);
  command(&input, STEPS - 1);
  hx_plant_output(one, &input, &output);
  if (!(fabs(output.energy.residual) <= choice->imbalance))
    fprintf(stderr, "%s: %g J\n", choice->name, output.energy.residual);
  CHECK(fabs(output.energy.residual) <= choice->imbalance);
  check_derivative(one, d, choice->name);
  hx_plant_destroy(one), hx_plant_destroy(two);
}

static void every_choice_keeps_the_laws(void) {
  for (size_t k = 0; k < sizeof choices / sizeof *choices; ++k) {
    hxDefinition d;
    hx_definition_default(&d);
    d.initial.position[2] += 0.01;
    choices[k].make(&d);
    holds(&choices[k], &d);
  }
}

static void every_law_of_contact_and_every_method_keeps_them(void) {
  for (int law = 1; law <= HX_CONTACT_HERTZ; ++law) {
    hxDefinition d;
    hx_definition_default(&d);
    d.contact.law = law, d.initial.position[2] += 0.01;
    holds(&(hxChoice){"law of contact", nothing, 0, 0.01}, &d);
  }
  for (int method = HX_METHOD_ROSW3; method <= HX_METHOD_DP54; ++method)
    for (int fixed = 0; fixed < 2; ++fixed) {
      hxDefinition d;
      hx_definition_default(&d);
      d.solver.method = method, d.solver.step = fixed ? 2e-4 : 0.0;
      holds(&(hxChoice){"method", nothing, 0, 0.01}, &d);
    }
}

/* A grid that is raised carries a robot that is raised with it by the same forces. */
static void grids_may_be_raised(void) {
  static const double height[2] = {0.0, 0.25};
  hxOutput output[2];
  for (int grid = 0; grid < GRIDS; ++grid) {
    for (int k = 0; k < 2; ++k) {
      hxDefinition d;
      hxInput input;
      hxPlant *plant = hx_plant_create();
      hx_definition_default(&d);
      on_grid(&d), body(&d);
      d.terrain.height = height[k], d.initial.position[2] += height[k];
      hx_plant_set_terrain(plant, terrain[grid]);
      CHECK(hx_plant_reset(plant, &d, 0.0) == HX_OK);
      walk(plant, 0, 20, 0, "raised grid");
      command(&input, 20);
      hx_plant_output(plant, &input, &output[k]);
      hx_plant_destroy(plant);
    }
    CHECK(largest_of(output[0].foot.normal_force, HX_LEGS) > 1.0);
    for (int leg = 0; leg < HX_LEGS; ++leg)
      NEAR(output[1].foot.normal_force[leg], output[0].foot.normal_force[leg], 1e-4); /* N */
  }
}

static void stiff_stops(hxDefinition *d) {
  stops(d);
  d->servo.stop_stiffness = 2e3, d->servo.stop_damping = 5.0;
}
static void stiff_turning(hxDefinition *d) {
  turning(d);
  d->friction.slope = 1e5, d->friction.spin_radius = d->friction.rolling_radius = 0.01;
}
/* With steps of many time constants of its laws a robot that drops comes to rest. */
static void long_steps_are_stable(void) {
  static void (*const stiff[])(hxDefinition *) = {stiff_stops, stiff_turning, lugre};
  for (size_t k = 0; k < sizeof stiff / sizeof *stiff; ++k)
    for (int method = HX_METHOD_ROSW3; method <= HX_METHOD_ROS2; ++method) {
      hxDefinition d;
      hxInput input;
      hxOutput output;
      hxPlant *plant = hx_plant_create();
      hx_definition_default(&d), hx_input_default(&input);
      stiff[k](&d);
      d.solver.method = method, d.solver.step = 2e-3, d.initial.position[2] += 0.005;
      for (int leg = 0; leg < HX_LEGS; ++leg) input.angle_ref[leg][0] += 0.1;
      CHECK(hx_plant_reset(plant, &d, 0.0) == HX_OK);
      CHECK(hx_plant_step(plant, &input, 1.0) == HX_OK);
      hx_plant_output(plant, &input, &output);
      if (!(output.energy.kinetic < 1e-4))
        fprintf(stderr, "stiff %zu, method %d: %g J\n", k, method, output.energy.kinetic);
      CHECK(output.energy.kinetic < 1e-4); /* J */
      hx_plant_destroy(plant);
    }
}

/* ---- definitions that contradict themselves ---- */

static void heavy_side(hxDefinition *d) { d->torso.inertia[0] = 1.0; }
static void skew_inertia(hxDefinition *d) { d->leg[2].link[1].inertia[3] = 1.0; }
static void no_axis(hxDefinition *d) { memset(d->leg[1].link[0].axis, 0, 3 * sizeof(double)); }
static void no_way(hxDefinition *d) { d->leg[0].link[2].angle_min = d->leg[0].link[2].angle_max; }
static void no_length(hxDefinition *d) {
  d->leg[3].link[1].length = d->leg[3].link[1].offset_y = d->leg[3].link[1].offset_z = 0.0;
}
static void no_voltage(hxDefinition *d) { motor(d), d->servo.voltage = 0.0; }
static void no_constant(hxDefinition *d) { motor(d), d->servo.torque_constant = 0.0; }
static void no_resistance(hxDefinition *d) { motor(d), d->servo.resistance = 0.0; }
static void no_housing(hxDefinition *d) { warm_motor(d), d->servo.housing_capacity = 0.0; }
static void cold_limit(hxDefinition *d) { d->servo.temperature_max = d->servo.derate_temperature; }
static void cold_air(hxDefinition *d) {
  d->servo.derate_temperature = 300.0, d->servo.temperature_max = d->servo.air_temperature = 310.0;
}
static void heavy_rotor(hxDefinition *d) { rotors(d), d->servo.gear_ratio = 1.0; }
static void no_rebound(hxDefinition *d) {
  d->contact.law = HX_CONTACT_FLORES, d->contact.restitution = 0.0;
}
static void weak_hold(hxDefinition *d) { d->friction.mu_static = 0.5 * d->friction.mu; }
static void hold_of_nothing(hxDefinition *d) {
  d->friction.law = HX_FRICTION_NONE, d->friction.mu_static = 2.0 * d->friction.mu;
}
static void no_radius(hxDefinition *d) {
  body(d), d->body.knee_radius = d->body.shank_radius = 0.0;
}
static void no_attitude(hxDefinition *d) { memset(d->initial.quaternion, 0, 4 * sizeof(double)); }
static void no_number(hxDefinition *d) { d->torso.mass = NAN; }

static void contradictions_are_refused_by_name(void) {
  static const struct {
    void (*make)(hxDefinition *d);
    const char *name;
  } wrong[] = {{heavy_side, "torso.inertia_xx"},
               {skew_inertia, "LR.femur.inertia_yy"},
               {no_axis, "LM.coxa.axis"},
               {no_way, "LF.tibia.angle_min"},
               {no_length, "RF.femur.length"},
               {no_voltage, "servo.voltage"},
               {no_constant, "servo.torque_constant"},
               {no_resistance, "servo.resistance"},
               {no_housing, "servo.housing_capacity"},
               {cold_limit, "servo.temperature_max"},
               {cold_air, "servo.temperature_max"},
               {heavy_rotor, "servo.gear_ratio"},
               {no_rebound, "contact.restitution"},
               {weak_hold, "friction.mu_static"},
               {hold_of_nothing, "friction.mu_static"},
               {no_radius, "body.knee_radius"},
               {no_attitude, "initial.quaternion"},
               {no_number, "torso.mass"}};
  hxPlant *plant = hx_plant_create();
  static unsigned char before[STATE], after[STATE];
  hx_plant_get_state(plant, before);
  for (size_t k = 0; k < sizeof wrong / sizeof *wrong; ++k) {
    hxDefinition d;
    char message[HX_MESSAGE_SIZE] = "";
    hx_definition_default(&d);
    wrong[k].make(&d);
    CHECK(hx_definition_check(&d, message) != HX_OK);
    if (!strstr(message, wrong[k].name)) fprintf(stderr, "%s: %s\n", wrong[k].name, message);
    CHECK(strstr(message, wrong[k].name) != NULL && strstr(message, "expected") != NULL);
    CHECK(hx_definition_check(&d, NULL) != HX_OK);
    CHECK(hx_plant_reset(plant, &d, 0.0) != HX_OK);
  }
  hx_plant_get_state(plant, after);
  CHECK(memcmp(before, after, hx_plant_state_size()) == 0);
  hx_plant_destroy(plant);
}

static void read_grids(const char *folder) {
  static const char *const name[GRIDS] = {"smooth", "blocks", "material"};
  static unsigned char bytes[FILE_SIZE];
  char path[4096], message[HX_MESSAGE_SIZE] = "";
  for (int k = 0; k < GRIDS; ++k) {
    snprintf(path, sizeof path, "%s/%s", folder, name[k]);
    FILE *file = fopen(path, "rb");
    const size_t n = file ? fread(bytes, 1, sizeof bytes, file) : 0;
    if (file) fclose(file);
    terrain[k] = hx_terrain_create(bytes, n, message);
    if (!terrain[k]) fprintf(stderr, "%s: %s\n", path, message);
    CHECK(terrain[k]);
  }
}

int main(int arguments, char *argument[]) {
  if (arguments != 2) return 2;
  read_grids(argument[1]);
  every_choice_keeps_the_laws();
  every_law_of_contact_and_every_method_keeps_them();
  grids_may_be_raised();
  long_steps_are_stable();
  contradictions_are_refused_by_name();
  for (int k = 0; k < GRIDS; ++k) hx_terrain_destroy(terrain[k]);
  return failures != 0;
}
