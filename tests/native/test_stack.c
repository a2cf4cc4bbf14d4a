/* test_stack.c - every call of the plant in a thread with a small stack, on each ground, with all
 * rows of contacts; and the size of an instance. The numbers are in docs/architecture.md. */
#define _POSIX_C_SOURCE 200809L /* pthread_attr_setstack */

#include <stdlib.h>
#include <string.h>

#include <hexapod/hexapod.h>

#include "stack.h"

/* A plant, what its calls read and what they return. */
typedef struct {
  hxPlant *plant;
  hxDefinition robot;
  hxInput input, d_input;
  hxCoordinates x, rate, d_rate;
  hxOutput output, d_output;
  void *bytes;
  double t;
  hxStatus status;
} Trial;

static void create(void *trial) { ((Trial *)trial)->plant = hx_plant_create(); }

static void reset(void *given) {
  Trial *trial = given;
  trial->status = hx_plant_reset(trial->plant, &trial->robot, 0.0);
  trial->t = 0.0;
}

static void step(void *given) {
  Trial *trial = given;
  trial->t += 1.0;
  trial->status = hx_plant_step(trial->plant, &trial->input, trial->t);
}

static void refused_step(void *given) {
  Trial *trial = given;
  trial->status = hx_plant_step(trial->plant, &trial->input, -1.0);
}

static void output(void *given) {
  Trial *trial = given;
  hx_plant_output(trial->plant, &trial->input, &trial->output);
  hx_plant_integral_rates(trial->plant, &trial->input, &trial->d_output);
}

static void restore(void *given) {
  Trial *trial = given;
  hx_plant_get_state(trial->plant, trial->bytes);
  trial->status = hx_plant_set_state(trial->plant, trial->bytes, hx_plant_state_size());
}

static void coordinates(void *given) {
  Trial *trial = given;
  hx_plant_get_coordinates(trial->plant, &trial->x);
  trial->status = hx_plant_set_coordinates(trial->plant, trial->t, &trial->x);
  hx_plant_rates(trial->plant, &trial->input, &trial->rate);
}

static void tangent(void *given) {
  Trial *trial = given;
  trial->d_input.push_force[2] = 1.0;
  trial->status = hx_plant_tangent(trial->plant, &trial->input, &trial->d_input, NULL,
                                   &trial->d_rate, &trial->d_output);
  if (trial->status == HX_INVALID_ARGUMENT) trial->status = HX_OK; /* without complex numbers */
}

static void completed(void *given) {
  Trial *trial = given;
  hx_plant_update_contacts(trial->plant);
  hx_plant_completed_step(trial->plant, &trial->input);
}

/* Makes all calls on one ground; the robot falls onto its back, so that bodies touch it too. */
static void call_all(const char *ground, Trial *trial) {
  static const struct {
    const char *name;
    void (*run)(void *);
  } calls[] = {{"reset", reset},
               {"step", step},
               {"outputs", output},
               {"saving and restoring", restore},
               {"coordinates and rates", coordinates},
               {"derivatives", tangent},
               {"completed step", completed}};
  for (size_t k = 0; k < sizeof calls / sizeof *calls; ++k) {
    char name[64];
    snprintf(name, sizeof name, "%s: %s", ground, calls[k].name);
    in_small_stack(name, calls[k].run, trial);
    CHECK(trial->status == HX_OK);
  }
  double pressed = trial->output.torso.contact_force[2];
  for (int leg = 0; leg < HX_LEGS; ++leg)
    pressed += trial->output.body.knee_force[leg][2] + trial->output.foot.force[leg][2];
  CHECK(pressed > 10.0);
}

static void on_rigid_ground(Trial *trial) {
  hx_definition_default(&trial->robot);
  trial->robot.initial.quaternion[0] = 0.0, trial->robot.initial.quaternion[1] = 1.0;
  trial->robot.friction.spin_radius = trial->robot.friction.rolling_radius = 0.001;
  call_all("back", trial);
  in_small_stack("refused step", refused_step, trial);
  CHECK(trial->status == HX_INVALID_ARGUMENT);
}

static void on_soil(Trial *trial) {
  hx_definition_default(&trial->robot);
  trial->robot.soil = (hxSoilDefinition){.law = HX_SOIL_BEKKER,
                                         .frictional_modulus = 1.5e6,
                                         .cohesive_modulus = 1e3,
                                         .exponent = 1.1,
                                         .cohesion = 1e3,
                                         .friction_angle = 0.5,
                                         .shear_displacement = 0.01,
                                         .stiffness = 1e8,
                                         .damping = 1e4};
  call_all("soil", trial);
}

/* Lets it stand on a grid of 16 x 16 heights. */
static void on_grid(const char *name, int64_t kind, Trial *trial) {
  enum { EDGE = 16 };
  struct {
    char magic[8];
    int64_t rows, cols, kind, materials;
    double x0, y0, cell;
    char name[64];
    double height[EDGE][EDGE];
  } grid = {.magic = {'h', 'x', 'G', 'r', 'i', 'd', '0', '1'},
            .rows = EDGE,
            .cols = EDGE,
            .kind = kind,
            .x0 = -0.8,
            .y0 = -0.8,
            .cell = 0.1};
  char message[HX_MESSAGE_SIZE];
  for (int i = 0; i < EDGE * EDGE; ++i) grid.height[i / EDGE][i % EDGE] = 0.002 * (i % 5);
  hxTerrain *terrain = hx_terrain_create(&grid, sizeof grid, message);
  CHECK(terrain != NULL);
  hx_definition_default(&trial->robot);
  trial->robot.initial.position[2] += 0.01;
  trial->robot.friction.law = HX_FRICTION_LUGRE;
  trial->robot.terrain.kind = HX_TERRAIN_GRID;
  hx_plant_set_terrain(trial->plant, terrain);
  call_all(name, trial);
  hx_plant_set_terrain(trial->plant, NULL);
  hx_terrain_destroy(terrain);
}

int main(void) {
  static Trial trial;
  hx_input_default(&trial.input);
  trial.bytes = malloc(hx_plant_state_size());
  in_small_stack("create", create, &trial);
  CHECK(trial.plant && trial.bytes);
  on_rigid_ground(&trial);
  on_soil(&trial);
  on_grid("smooth grid", HX_SURFACE_SMOOTH, &trial);
  on_grid("blocks", HX_SURFACE_BLOCKS, &trial);
  hx_plant_destroy(trial.plant);
  free(trial.bytes);
  return failures;
}
