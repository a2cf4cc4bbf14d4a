/* plant.c - runs a walk in this plant, with the drivers' command line (driver.h)
 *
 * METHOD: a method's name, error control with the tolerance STEP; with "-fixed" appended, steps of
 * STEP seconds.
 */
#include <string.h>

#include "driver.h"

typedef struct {
  hxPlant *plant;
  hxDefinition definition;
  hxInput last;
} Ours;

static const struct {
  const char *name;
  int method, fixed;
} methods[] = {
    {"rosw3", HX_METHOD_ROSW3, 0}, {"rosw3-fixed", HX_METHOD_ROSW3, 1},
    {"ros2", HX_METHOD_ROS2, 0},   {"ros2-fixed", HX_METHOD_ROS2, 1},
    {"dp54", HX_METHOD_DP54, 0},   {"dp54-fixed", HX_METHOD_DP54, 1},
};

static int prepare(void *self, const Recording *walk, const char *method, double step) {
  Ours *ours = self;
  ours->definition = walk->definition;
  for (size_t i = 0; i < sizeof methods / sizeof methods[0]; ++i) {
    if (strcmp(method, methods[i].name) != 0) continue;
    ours->definition.solver.method = methods[i].method;
    ours->definition.solver.step = methods[i].fixed ? step : 0.0;
    if (!methods[i].fixed) ours->definition.solver.tolerance = step;
    ours->plant = hx_plant_create();
    return ours->plant == NULL;
  }
  fprintf(stderr, "method %s: not one of this driver's\n", method);
  return 1;
}

static int succeed(const Ours *ours, hxStatus status) {
  if (status != HX_OK) fprintf(stderr, "%s\n", hx_plant_message(ours->plant));
  return status != HX_OK;
}

static int start(void *self) {
  Ours *ours = self;
  hx_input_default(&ours->last);
  return succeed(ours, hx_plant_reset(ours->plant, &ours->definition, 0.0));
}

static int advance(void *self, const hxInput *input, double t_end) {
  Ours *ours = self;
  ours->last = *input;
  return succeed(ours, hx_plant_step(ours->plant, input, t_end));
}

static void torso(void *self, double position[3]) {
  double state[HX_BODY_STATE];
  hx_plant_get_torso(((Ours *)self)->plant, state);
  memcpy(position, state, 3 * sizeof *position);
}

static double evaluations(void *self) {
  Ours *ours = self;
  hxOutput output;
  hx_plant_output(ours->plant, &ours->last, &output);
  return output.solver.evaluations;
}

int main(int argc, char **argv) {
  static const Driver driver = {prepare, start, advance, torso, evaluations, NULL};
  Ours ours;
  return driver_main(argc, argv, &driver, &ours);
}
