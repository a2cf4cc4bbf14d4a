/* step.c - uses the plant as a C library: the robot stands, lifts a leg, is restored and pushed.
 *
 * cc -std=c11 step.c $(pkg-config --cflags --libs hexapod-plant) -o step
 */
#include <stdio.h>
#include <stdlib.h>

#include <hexapod/hexapod.h>

enum { LF, LM, LR, RF, RM, RR };
enum { COXA, FEMUR, TIBIA };

static const double h = 0.005; /* s  between two commands */

static void advance(hxPlant *plant, const hxInput *input, double duration) {
  const double end = hx_plant_time(plant) + duration;
  while (hx_plant_time(plant) < end - 0.5 * h)
    if (hx_plant_step(plant, input, hx_plant_time(plant) + h) != HX_OK) {
      fprintf(stderr, "step: %s\n", hx_plant_message(plant));
      exit(EXIT_FAILURE);
    }
}

static void print_state(hxPlant *plant, const hxInput *input, const char *what) {
  hxOutput seen;
  double sum = 0.0;
  int feet = 0;
  hx_plant_output(plant, input, &seen);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    sum += seen.foot.normal_force[leg], feet += seen.foot.contact[leg];
  printf("%.2f s  %-8s %d feet on the ground carry %.3f N, torso %.1f mm ahead, %.1f mm high\n",
         seen.time, what, feet, sum, 1e3 * seen.torso.position[0], 1e3 * seen.torso.position[2]);
}

int main(void) {
  hxDefinition robot;
  hxInput input;
  hxPlant *plant = hx_plant_create();
  void *saved = malloc(hx_plant_state_size());
  if (!plant || !saved) return EXIT_FAILURE;

  hx_definition_default(&robot);
  robot.torso.mass += 0.5; /* kg  a payload */
  if (hx_plant_reset(plant, &robot, 0.0) != HX_OK) {
    fprintf(stderr, "step: %s\n", hx_plant_message(plant));
    return EXIT_FAILURE;
  }
  hx_input_default(&input); /* the standing pose */
  advance(plant, &input, 1.0);
  print_state(plant, &input, "stands");
  hx_plant_get_state(plant, saved);

  input.angle_ref[RM][FEMUR] += 0.4; /* rad */
  advance(plant, &input, 1.0);
  print_state(plant, &input, "lifts");

  if (hx_plant_set_state(plant, saved, hx_plant_state_size()) != HX_OK) return EXIT_FAILURE;
  hx_input_default(&input);
  input.push_force[0] = 10.0; /* N */
  advance(plant, &input, 0.2);
  print_state(plant, &input, "pushed");

  hx_plant_destroy(plant);
  free(saved);
  return EXIT_SUCCESS;
}
