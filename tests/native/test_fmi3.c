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

/* Makes calls without their arguments; all must be refused. */
static void call_without_arguments(fmi3Instance fmu) {
  const fmi3ValueReference reference = reference_of("LF.coxa.angle_ref");
  const fmi3Float64 number[1] = {1.0};
  const fmi3Int32 order = 1;
  CHECK(fmi3SetDebugLogging(fmu, fmi3True, 1, NULL) == fmi3Error);
  CHECK(fmi3GetFloat64(fmu, NULL, 1, NULL, 1) == fmi3Error);
  CHECK(fmi3GetInt32(fmu, NULL, 1, NULL, 1) == fmi3Error);
  CHECK(fmi3GetBoolean(fmu, NULL, 1, NULL, 1) == fmi3Error);
  CHECK(fmi3SetFloat64(fmu, &reference, 1, NULL, 18) == fmi3Error);
  CHECK(fmi3SetInt32(fmu, NULL, 1, &order, 1) == fmi3Error);
  CHECK(fmi3SetBoolean(fmu, NULL, 1, NULL, 1) == fmi3Error);
  CHECK(fmi3GetOutputDerivatives(fmu, &reference, 1, &order, NULL, 1) == fmi3Error);
  CHECK(fmi3GetDirectionalDerivative(fmu, NULL, 1, &reference, 1, number, 1, NULL, 1) == fmi3Error);
  CHECK(fmi3GetFMUState(fmu, NULL) == fmi3Error);
  CHECK(fmi3SetFMUState(fmu, NULL) == fmi3Error);
  CHECK(fmi3SerializedFMUStateSize(fmu, NULL, NULL) == fmi3Error);
  CHECK(fmi3SerializeFMUState(fmu, NULL, NULL, 1) == fmi3Error);
  CHECK(fmi3DeserializeFMUState(fmu, NULL, 1, NULL) == fmi3Error);
  CHECK(fmi3GetNumberOfContinuousStates(fmu, NULL) == fmi3Error);
  CHECK(fmi3GetNumberOfEventIndicators(fmu, NULL) == fmi3Error);
}

static void calls_without_arguments_are_refused_and_change_nothing(void) {
  fmi3Instance fmu = instantiated(fmi3False);
  fmi3FMUState before = NULL, after = NULL;
  fmi3Boolean event, terminate, early;
  fmi3Float64 last;
  size_t size = 0;
  initialise(fmu);
  CHECK(fmi3DoStep(fmu, 0.0, 0.01, fmi3True, &event, &terminate, &early, &last) == fmi3OK);
  CHECK(fmi3GetFMUState(fmu, &before) == fmi3OK);
  CHECK(fmi3SerializedFMUStateSize(fmu, before, &size) == fmi3OK);
  fmi3Byte *first = malloc(size), *second = malloc(size);
  complaints = 0;
  call_without_arguments(NULL);
  CHECK(complaints == 0); /* without an instance there is no logger */
  call_without_arguments(fmu);
  CHECK(complaints > 0);
  CHECK(fmi3GetFMUState(fmu, &after) == fmi3OK);
  CHECK(fmi3SerializeFMUState(fmu, before, first, size) == fmi3OK &&
        fmi3SerializeFMUState(fmu, after, second, size) == fmi3OK);
  CHECK(memcmp(first, second, size) == 0);
  CHECK(fmi3DoStep(fmu, 0.01, 0.01, fmi3True, &event, &terminate, &early, &last) == fmi3OK);
  free(first), free(second);
  CHECK(fmi3FreeFMUState(fmu, &before) == fmi3OK && fmi3FreeFMUState(fmu, &after) == fmi3OK);
  fmi3FreeInstance(fmu);
}

/* Makes calls of model exchange; all must be refused. */
static void call_model_exchange(fmi3Instance fmu) {
  fmi3Float64 number[1] = {0.0};
  fmi3Boolean enter, terminate;
  CHECK(fmi3EnterContinuousTimeMode(fmu) == fmi3Error);
  CHECK(fmi3CompletedIntegratorStep(fmu, fmi3True, &enter, &terminate) == fmi3Error);
  CHECK(fmi3SetTime(fmu, 0.0) == fmi3Error);
  CHECK(fmi3SetContinuousStates(fmu, number, 1) == fmi3Error);
  CHECK(fmi3GetContinuousStates(fmu, number, 1) == fmi3Error);
  CHECK(fmi3GetContinuousStateDerivatives(fmu, number, 1) == fmi3Error);
  CHECK(fmi3GetNominalsOfContinuousStates(fmu, number, 1) == fmi3Error);
  CHECK(fmi3GetEventIndicators(fmu, number, 1) == fmi3Error);
}

static void calls_of_the_other_interface_are_refused(void) {
  fmi3Instance fmu = instantiated(fmi3False);
  fmi3Boolean event, terminate, early;
  fmi3Float64 last;
  initialise(fmu);
  call_model_exchange(NULL);
  call_model_exchange(fmu);
  CHECK(fmi3DoStep(fmu, 0.0, 0.01, fmi3True, &event, &terminate, &early, &last) == fmi3OK);
  fmi3FreeInstance(fmu);
}

static void what_is_not_offered_is_refused_with_and_without_an_instance(void) {
  fmi3Instance fmu = instantiated(fmi3False);
  const fmi3ValueReference unknown = reference_of("LF.foot.normal_force"), none = 77777777;
  const fmi3Int32 order = 1;
  fmi3Float64 number[18] = {0.0};
  initialise(fmu);
  for (int k = 0; k < 2; ++k) {
    fmi3Instance to = k ? NULL : fmu;
    CHECK(fmi3GetAdjointDerivative(to, &unknown, 1, &unknown, 1, number, 1, number, 1) ==
          fmi3Error);
    CHECK(fmi3GetDirectionalDerivative(to, &unknown, 1, NULL, 1, number, 1, number, 18) ==
          fmi3Error);
    CHECK(fmi3GetOutputDerivatives(to, &none, 1, &order, number, 1) == fmi3Error);
  }
  CHECK(fmi3GetOutputDerivatives(fmu, &unknown, 1, &order, number, 5) == fmi3Error);
  CHECK(fmi3FreeFMUState(fmu, NULL) == fmi3OK && fmi3FreeFMUState(NULL, NULL) == fmi3Error);
  fmi3FreeInstance(fmu);
}

int main(int count, char **arguments) {
  if (count != 2) return EXIT_FAILURE;
  open_description(arguments[1]);
  arrays_hold_all_legs();
  stops_at_touch_downs_leave_no_trace();
  a_saved_state_goes_on();
  calls_without_arguments_are_refused_and_change_nothing();
  calls_of_the_other_interface_are_refused();
  what_is_not_offered_is_refused_with_and_without_an_instance();
  return failures;
}
