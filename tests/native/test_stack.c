/* test_stack.c - every call of the plant in a thread with a small stack: a step, outputs, saving
 * and restoring, rates, derivatives. The numbers are in docs/architecture.md. */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include <hexapod/hexapod.h>

#include "check.h"

enum { STACK = 256 * 1024 }; /* bytes, with what the system needs of it */

/* Saves the plant, moves it and restores it. */
static void restore(hxPlant *plant, const hxInput *input) {
  const size_t size = hx_plant_state_size();
  void *bytes = malloc(size);
  CHECK(bytes != NULL);
  const double t = hx_plant_time(plant);
  hx_plant_get_state(plant, bytes);
  CHECK(hx_plant_step(plant, input, t + 0.01) == HX_OK);
  CHECK(hx_plant_set_state(plant, bytes, size) == HX_OK);
  CHECK(hx_plant_time(plant) == t);
  free(bytes);
}

/* Lets the robot fall onto its back, so that all rows of contacts are computed. */
static void *call_all(void *unused) {
  hxPlant *plant = hx_plant_create();
  hxDefinition robot;
  hxInput input, d_input;
  hxCoordinates x, rate, d_rate;
  hxOutput output, d_output;
  (void)unused;
  hx_input_default(&input);
  hx_definition_default(&robot);
  robot.initial.quaternion[0] = 0.0, robot.initial.quaternion[1] = 1.0;
  CHECK(hx_plant_reset(plant, &robot, 0.0) == HX_OK);
  CHECK(hx_plant_step(plant, &input, 1.0) == HX_OK);
  hx_plant_output(plant, &input, &output);
  double on_knees = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) on_knees += output.body.knee_force[leg][2];
  CHECK(on_knees + output.torso.contact_force[2] > 10.0);
  restore(plant, &input);
  hx_plant_get_coordinates(plant, &x);
  CHECK(hx_plant_set_coordinates(plant, 1.0, &x) == HX_OK);
  hx_plant_rates(plant, &input, &rate);
  memset(&d_input, 0, sizeof d_input);
  d_input.push_force[2] = 1.0;
  const hxStatus status = hx_plant_tangent(plant, &input, &d_input, NULL, &d_rate, &d_output);
  CHECK(status == HX_OK || status == HX_INVALID_ARGUMENT); /* the latter without complex numbers */
  hx_plant_update_contacts(plant);
  hx_plant_completed_step(plant, &input);
  hx_plant_destroy(plant);
  return NULL;
}

int main(void) {
  pthread_attr_t attributes;
  pthread_t thread;
  CHECK(pthread_attr_init(&attributes) == 0);
  CHECK(pthread_attr_setstacksize(&attributes, STACK) == 0);
  CHECK(pthread_create(&thread, &attributes, call_all, NULL) == 0);
  CHECK(pthread_join(thread, NULL) == 0);
  CHECK(pthread_attr_destroy(&attributes) == 0);
  return failures;
}
