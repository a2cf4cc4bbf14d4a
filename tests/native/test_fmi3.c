/* test_fmi3.c - the FMU's binary through FMI 3.0: arrays, stops at touch-downs, saved states,
 * refusals.
 *
 * usage: test_fmi3 modelDescription.xml of FMI 2.0, whose references are the first ones of
 * FMI 3.0's arrays
 */
#include "fmi3Functions.h"

#include "check.h"
#include "description.h"

enum { LEGS = 6, JOINTS = 3 };

static int complaints;

static void complain(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                     fmi3String text) {
  (void)environment, (void)status, (void)category, (void)text;
  ++complaints;
}

static fmi3Instance instantiated(fmi3Boolean events) {
  fmi3Instance fmu = fmi3InstantiateCoSimulation("robot", guid, NULL, fmi3False, fmi3False, events,
                                                 events, NULL, 0, NULL, complain, NULL);
  CHECK(fmu);
  return fmu;
}

static void initialise(fmi3Instance fmu) {
  CHECK(fmi3EnterInitializationMode(fmu, fmi3False, 0.0, 0.0, fmi3False, 0.0) == fmi3OK &&
        fmi3ExitInitializationMode(fmu) == fmi3OK);
}

static double height(fmi3Instance fmu) {
  const fmi3ValueReference position = reference_of("torso.position[1]");
  fmi3Float64 value[3] = {0.0};
  CHECK(fmi3GetFloat64(fmu, &position, 1, value, 3) == fmi3OK);
  return value[2];
}

static void arrays_hold_all_legs(void) {
  const fmi3ValueReference command = reference_of("LF.coxa.angle_ref"),
                           carried = reference_of("LF.foot.normal_force");
  fmi3Instance fmu = instantiated(fmi3False);
  fmi3Float64 angle[LEGS * JOINTS], force[LEGS], sum = 0.0, last = 0.0;
  fmi3Boolean event, terminate, early;
  initialise(fmu);
  CHECK(fmi3GetFloat64(fmu, &command, 1, angle, LEGS * JOINTS) == fmi3OK);
  CHECK(fmi3SetFloat64(fmu, &command, 1, angle, LEGS * JOINTS) == fmi3OK);
  CHECK(fmi3DoStep(fmu, 0.0, 0.5, fmi3True, &event, &terminate, &early, &last) == fmi3OK);
  CHECK(!terminate && !early && last == 0.5);
  CHECK(fmi3GetFloat64(fmu, &carried, 1, force, LEGS) == fmi3OK);
  for (int leg = 0; leg < LEGS; ++leg) sum += force[leg];
  NEAR(sum, 5.6 * 9.81, 1e-3);
  CHECK(complaints == 0);
  CHECK(fmi3GetFloat64(fmu, &carried, 1, force, LEGS - 1) == fmi3Error);
  CHECK(fmi3SetFloat64(fmu, &command, 1, angle, LEGS * JOINTS + 1) == fmi3Error);
  angle[LEGS * JOINTS - 1] = nan("");
  CHECK(fmi3SetFloat64(fmu, &command, 1, angle, LEGS * JOINTS) == fmi3Error);
  CHECK(complaints == 3);
  fmi3FreeInstance(fmu);
}

static double dropped(fmi3Boolean events) {
  const fmi3ValueReference position = reference_of("initial.position[1]");
  const fmi3Float64 start[3] = {0.0, 0.0, 0.15};
  fmi3Instance fmu = instantiated(events);
  fmi3Boolean event, terminate, early, update, nominals, states, timed;
  fmi3Float64 time = 0.0, next;
  int stops = 0;
  CHECK(fmi3SetFloat64(fmu, &position, 1, start, 3) == fmi3OK);
  initialise(fmu);
  for (int calls = 0; time < 0.2 && calls < 1000; ++calls) {
    if (events) {
      if (calls > 0) CHECK(fmi3EnterEventMode(fmu) == fmi3OK);
      CHECK(fmi3UpdateDiscreteStates(fmu, &update, &terminate, &nominals, &states, &timed, &next) ==
            fmi3OK);
      CHECK(fmi3EnterStepMode(fmu) == fmi3OK);
    }
    CHECK(fmi3DoStep(fmu, time, 0.2 - time, fmi3True, &event, &terminate, &early, &time) == fmi3OK);
    stops += early;
  }
  CHECK(events ? stops >= 1 : stops == 0);
  const double z = height(fmu);
  fmi3FreeInstance(fmu);
  return z;
}

/* the end of a step is a sum of pieces, so the last step may differ by rounding */
static void stops_at_touch_downs_leave_no_trace(void) {
  NEAR(dropped(fmi3True), dropped(fmi3False), 1e-12);
}

static void a_saved_state_goes_on(void) {
  fmi3Instance fmu = instantiated(fmi3False), other = instantiated(fmi3False);
  const fmi3ValueReference push = reference_of("torso.push_force[1]");
  const fmi3Float64 force[3] = {0.0, 0.0, -20.0};
  fmi3Boolean event, terminate, early;
  fmi3Float64 last;
  fmi3FMUState state = NULL, copy = NULL;
  size_t size = 0;
  initialise(fmu), initialise(other);
  CHECK(fmi3DoStep(fmu, 0.0, 0.1, fmi3True, &event, &terminate, &early, &last) == fmi3OK);
  CHECK(fmi3GetFMUState(fmu, &state) == fmi3OK &&
        fmi3SerializedFMUStateSize(fmu, state, &size) == fmi3OK);
  fmi3Byte *bytes = malloc(size);
  CHECK(fmi3SerializeFMUState(fmu, state, bytes, size) == fmi3OK);
  CHECK(fmi3DeserializeFMUState(other, bytes, size, &copy) == fmi3OK &&
        fmi3SetFMUState(other, copy) == fmi3OK);
  fmi3Instance both[] = {fmu, other};
  for (int k = 0; k < 2; ++k) {
    CHECK(fmi3SetFloat64(both[k], &push, 1, force, 3) == fmi3OK);
    CHECK(fmi3DoStep(both[k], 0.1, 0.1, fmi3True, &event, &terminate, &early, &last) == fmi3OK);
  }
  CHECK(height(fmu) == height(other) && height(fmu) < 0.1312);
  free(bytes);
  CHECK(fmi3FreeFMUState(fmu, &state) == fmi3OK && fmi3FreeFMUState(other, &copy) == fmi3OK);
  fmi3FreeInstance(fmu), fmi3FreeInstance(other);
}

int main(int count, char **arguments) {
  if (count != 2) return EXIT_FAILURE;
  open_description(arguments[1]);
  arrays_hold_all_legs();
  stops_at_touch_downs_leave_no_trace();
  a_saved_state_goes_on();
  return failures;
}
