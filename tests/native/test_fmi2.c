/* test_fmi2.c - the FMU's binary through FMI 2.0: co-simulation, saved states, derivatives, model
 * exchange, refusals.
 *
 * usage: test_fmi2 modelDescription.xml
 */
#include <stdarg.h>

#include "fmi2Functions.h"

#include "check.h"
#include "description.h"

static int complaints;

static void complain(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                     fmi2String category, fmi2String text, ...) {
  (void)environment, (void)name, (void)status, (void)category, (void)text;
  ++complaints;
}

static const fmi2CallbackFunctions callbacks = {complain, calloc, free, NULL, NULL};

static fmi2Component initialised(fmi2Type type) {
  fmi2Component fmu = fmi2Instantiate("robot", type, guid, NULL, &callbacks, fmi2False, fmi2False);
  CHECK(fmu);
  CHECK(fmi2SetupExperiment(fmu, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK);
  CHECK(fmi2EnterInitializationMode(fmu) == fmi2OK && fmi2ExitInitializationMode(fmu) == fmi2OK);
  return fmu;
}

static double real(fmi2Component fmu, const char *name) {
  const fmi2ValueReference reference = reference_of(name);
  fmi2Real value = 0.0;
  CHECK(fmi2GetReal(fmu, &reference, 1, &value) == fmi2OK);
  return value;
}

static fmi2Status set(fmi2Component fmu, const char *name, double value) {
  const fmi2ValueReference reference = reference_of(name);
  return fmi2SetReal(fmu, &reference, 1, &value);
}

static double weight_on_feet(fmi2Component fmu) {
  static const char *const legs[] = {"LF", "LM", "LR", "RF", "RM", "RR"};
  double sum = 0.0;
  for (int leg = 0; leg < 6; ++leg) {
    char name[64];
    snprintf(name, sizeof name, "%s.foot.normal_force", legs[leg]);
    sum += real(fmu, name);
  }
  return sum;
}

static void it_stands_and_goes_back(void) {
  fmi2Component fmu = initialised(fmi2CoSimulation), other;
  fmi2FMUstate state = NULL, copy = NULL;
  size_t size = 0;
  CHECK(fmi2DoStep(fmu, 0.0, 0.5, fmi2True) == fmi2OK);
  NEAR(weight_on_feet(fmu), 5.6 * 9.81, 1e-3);
  CHECK(fmi2GetFMUstate(fmu, &state) == fmi2OK &&
        fmi2SerializedFMUstateSize(fmu, state, &size) == fmi2OK);
  fmi2Byte *bytes = malloc(size);
  CHECK(fmi2SerializeFMUstate(fmu, state, bytes, size) == fmi2OK);

  CHECK(set(fmu, "torso.push_force[1]", 10.0) == fmi2OK &&
        fmi2DoStep(fmu, 0.5, 0.1, fmi2True) == fmi2OK);
  const double pushed = real(fmu, "torso.position[1]");
  CHECK(pushed > 1e-4);
  CHECK(fmi2SetFMUstate(fmu, state) == fmi2OK);
  NEAR(real(fmu, "torso.position[1]"), 0.0, 1e-6);
  other = initialised(fmi2CoSimulation);
  CHECK(fmi2DeSerializeFMUstate(other, bytes, size, &copy) == fmi2OK &&
        fmi2SetFMUstate(other, copy) == fmi2OK);
  CHECK(set(other, "torso.push_force[1]", 10.0) == fmi2OK &&
        fmi2DoStep(other, 0.5, 0.1, fmi2True) == fmi2OK);
  CHECK(real(other, "torso.position[1]") == pushed);
  CHECK(complaints == 0);
  bytes[size / 2] ^= 1;
  CHECK(fmi2DeSerializeFMUstate(other, bytes, size, &copy) > fmi2Warning);

  free(bytes);
  CHECK(fmi2FreeFMUstate(fmu, &state) == fmi2OK && !state &&
        fmi2FreeFMUstate(other, &copy) == fmi2OK);
  CHECK(fmi2Reset(other) == fmi2OK);
  CHECK(fmi2Terminate(fmu) == fmi2OK);
  fmi2FreeInstance(fmu), fmi2FreeInstance(other);
}

static void derivatives_are_differences(void) {
  fmi2Component fmu = initialised(fmi2CoSimulation);
  const fmi2ValueReference known = reference_of("RM.tibia.torque_ref"),
                           unknown = reference_of("RM.tibia.torque");
  const fmi2Real change = 1.0;
  fmi2Real derivative = 0.0;
  CHECK(fmi2DoStep(fmu, 0.0, 0.1, fmi2True) == fmi2OK);
  const double before = real(fmu, "RM.tibia.torque");
  CHECK(fmi2GetDirectionalDerivative(fmu, &unknown, 1, &known, 1, &change, &derivative) == fmi2OK);
  CHECK(set(fmu, "RM.tibia.torque_ref", 0.01) == fmi2OK);
  NEAR(derivative, 1.0, 1e-12);
  NEAR(real(fmu, "RM.tibia.torque") - before, 0.01, 1e-12);
  fmi2FreeInstance(fmu);
}

static void solvers_of_others_see_it_fall(void) {
  enum { MOST = 200, FEET = 6, INDICATORS = 50 };
  fmi2Component fmu =
      fmi2Instantiate("robot", fmi2ModelExchange, guid, NULL, &callbacks, fmi2False, fmi2False);
  double state[MOST], rate[MOST], indicator[INDICATORS];
  fmi2EventInfo event;
  size_t n = 0;
  for (const char *at = description; (at = strstr(at + 1, "derivative=\"")) != NULL;
       ++n) { /* n becomes the number of states */
  }
  CHECK(n > 0 && n <= MOST);
  CHECK(set(fmu, "initial.position[3]", 1.0) == fmi2OK);
  CHECK(fmi2SetupExperiment(fmu, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK);
  CHECK(fmi2EnterInitializationMode(fmu) == fmi2OK && fmi2ExitInitializationMode(fmu) == fmi2OK);
  CHECK(fmi2NewDiscreteStates(fmu, &event) == fmi2OK && fmi2EnterContinuousTimeMode(fmu) == fmi2OK);
  CHECK(fmi2GetContinuousStates(fmu, state, n) == fmi2OK &&
        fmi2GetDerivatives(fmu, rate, n) == fmi2OK);
  CHECK(fmi2GetEventIndicators(fmu, indicator, INDICATORS) == fmi2OK);
  for (int k = 0; k < FEET; ++k)
    NEAR(indicator[k], -0.87, 0.02); /* m; the torso is 0.13 above the ground */
  CHECK(fmi2SetTime(fmu, 0.001) == fmi2OK && fmi2SetContinuousStates(fmu, state, n) == fmi2OK);
  CHECK(fmi2GetDerivatives(fmu, rate, n) == fmi2OK &&
        fmi2GetContinuousStates(fmu, state, n) == fmi2OK);
  for (size_t k = 0; k < n; ++k) CHECK(isfinite(rate[k]) && isfinite(state[k]));
  CHECK(fmi2GetDerivatives(fmu, rate, n - 1) > fmi2Warning);
  fmi2FreeInstance(fmu);
}

static void misuse_is_refused(void) {
  complaints = 0;
  CHECK(!fmi2Instantiate("robot", fmi2CoSimulation, "{another}", NULL, &callbacks, fmi2False,
                         fmi2False));
  fmi2Component fmu = initialised(fmi2CoSimulation);
  const fmi2ValueReference nowhere = 4000000000u;
  fmi2Real value;
  CHECK(fmi2GetReal(fmu, &nowhere, 1, &value) == fmi2Error);
  CHECK(set(fmu, "RR.tibia.angle_ref", nan("")) > fmi2Warning);
  CHECK(set(fmu, "torso.mass", 1.0) > fmi2Warning); /* parameters are fixed after initialisation */
  CHECK(fmi2DoStep(fmu, 0.0, -1.0, fmi2True) > fmi2Warning);
  CHECK(complaints == 5);
  CHECK(fmi2DoStep(fmu, 0.0, 0.01, fmi2True) == fmi2OK);
  fmi2FreeInstance(fmu);
  CHECK(fmi2DoStep(NULL, 0.0, 0.01, fmi2True) > fmi2Warning);
}

/* Makes every call of co-simulation that has arguments without them; all must be refused. */
static void call_without_arguments(fmi2Component fmu) {
  const fmi2ValueReference reference = reference_of("LF.coxa.angle_ref");
  const fmi2Real number = 1.0;
  const fmi2Integer order = 1;
  CHECK(fmi2SetDebugLogging(fmu, fmi2True, 1, NULL) == fmi2Error);
  CHECK(fmi2GetReal(fmu, &reference, 1, NULL) == fmi2Error);
  CHECK(fmi2GetInteger(fmu, NULL, 1, NULL) == fmi2Error);
  CHECK(fmi2GetBoolean(fmu, NULL, 1, NULL) == fmi2Error);
  CHECK(fmi2GetString(fmu, NULL, 1, NULL) == fmi2Error);
  CHECK(fmi2SetReal(fmu, NULL, 1, &number) == fmi2Error);
  CHECK(fmi2SetInteger(fmu, NULL, 1, &order) == fmi2Error);
  CHECK(fmi2SetBoolean(fmu, NULL, 1, NULL) == fmi2Error);
  CHECK(fmi2SetString(fmu, NULL, 1, NULL) == fmi2Error);
  CHECK(fmi2SetRealInputDerivatives(fmu, &reference, 1, NULL, &number) == fmi2Error);
  CHECK(fmi2SetRealInputDerivatives(fmu, NULL, 1, &order, &number) == fmi2Error);
  CHECK(fmi2GetRealOutputDerivatives(fmu, &reference, 1, &order, NULL) == fmi2Error);
  CHECK(fmi2GetDirectionalDerivative(fmu, NULL, 1, &reference, 1, &number, NULL) == fmi2Error);
  CHECK(fmi2GetFMUstate(fmu, NULL) == fmi2Error);
  CHECK(fmi2SetFMUstate(fmu, NULL) == fmi2Error);
  CHECK(fmi2SerializedFMUstateSize(fmu, NULL, NULL) == fmi2Error);
  CHECK(fmi2SerializeFMUstate(fmu, NULL, NULL, 1) == fmi2Error);
  CHECK(fmi2DeSerializeFMUstate(fmu, NULL, 1, NULL) == fmi2Error);
  CHECK(fmi2CancelStep(fmu) == fmi2Error);
}

static void calls_without_arguments_are_refused_and_change_nothing(void) {
  fmi2Component fmu = initialised(fmi2CoSimulation);
  fmi2FMUstate before = NULL, after = NULL;
  size_t size = 0;
  CHECK(fmi2DoStep(fmu, 0.0, 0.01, fmi2True) == fmi2OK);
  CHECK(fmi2GetFMUstate(fmu, &before) == fmi2OK);
  CHECK(fmi2SerializedFMUstateSize(fmu, before, &size) == fmi2OK);
  fmi2Byte *first = malloc(size), *second = malloc(size);
  complaints = 0;
  call_without_arguments(NULL);
  CHECK(complaints == 0); /* without an instance there is no logger */
  call_without_arguments(fmu);
  CHECK(complaints > 0);
  CHECK(fmi2GetFMUstate(fmu, &after) == fmi2OK);
  CHECK(fmi2SerializeFMUstate(fmu, before, first, size) == fmi2OK &&
        fmi2SerializeFMUstate(fmu, after, second, size) == fmi2OK);
  CHECK(memcmp(first, second, size) == 0);
  CHECK(fmi2DoStep(fmu, 0.01, 0.01, fmi2True) == fmi2OK);
  free(first), free(second);
  CHECK(fmi2FreeFMUstate(fmu, &before) == fmi2OK && fmi2FreeFMUstate(fmu, &after) == fmi2OK);
  fmi2FreeInstance(fmu);
}

/* Makes every call of model exchange; all must be refused. */
static void call_model_exchange(fmi2Component fmu) {
  fmi2Real state[1] = {0.0};
  fmi2EventInfo event;
  fmi2Boolean enter, terminate;
  CHECK(fmi2EnterEventMode(fmu) == fmi2Error);
  CHECK(fmi2NewDiscreteStates(fmu, &event) == fmi2Error);
  CHECK(fmi2EnterContinuousTimeMode(fmu) == fmi2Error);
  CHECK(fmi2CompletedIntegratorStep(fmu, fmi2True, &enter, &terminate) == fmi2Error);
  CHECK(fmi2SetTime(fmu, 0.0) == fmi2Error);
  CHECK(fmi2SetContinuousStates(fmu, state, 1) == fmi2Error);
  CHECK(fmi2GetContinuousStates(fmu, state, 1) == fmi2Error);
  CHECK(fmi2GetNominalsOfContinuousStates(fmu, state, 1) == fmi2Error);
  CHECK(fmi2GetDerivatives(fmu, state, 1) == fmi2Error);
  CHECK(fmi2GetEventIndicators(fmu, state, 1) == fmi2Error);
}

static void calls_of_the_other_interface_are_refused(void) {
  fmi2Component fmu = initialised(fmi2CoSimulation);
  call_model_exchange(NULL);
  call_model_exchange(fmu);
  CHECK(fmi2DoStep(fmu, 0.0, 0.01, fmi2True) == fmi2OK);
  fmi2FreeInstance(fmu);
  fmu = initialised(fmi2ModelExchange);
  CHECK(fmi2DoStep(fmu, 0.0, 0.01, fmi2True) == fmi2Error);
  fmi2FreeInstance(fmu);
}

static void a_status_is_what_a_step_left(void) {
  fmi2Component fmu = initialised(fmi2CoSimulation);
  fmi2Status status;
  fmi2Real last = -1.0;
  fmi2Integer integer;
  fmi2Boolean ended = fmi2True;
  fmi2String text;
  CHECK(fmi2DoStep(fmu, 0.0, 0.25, fmi2True) == fmi2OK);
  CHECK(fmi2GetRealStatus(fmu, fmi2LastSuccessfulTime, &last) == fmi2OK && last == 0.25);
  CHECK(fmi2GetBooleanStatus(fmu, fmi2Terminated, &ended) == fmi2OK && !ended);
  CHECK(fmi2GetStatus(fmu, fmi2DoStepStatus, &status) != fmi2Fatal);
  CHECK(fmi2GetRealStatus(fmu, fmi2LastSuccessfulTime, NULL) > fmi2Warning);
  CHECK(fmi2GetRealStatus(fmu, fmi2Terminated, &last) > fmi2Warning);
  CHECK(fmi2GetBooleanStatus(fmu, fmi2LastSuccessfulTime, &ended) > fmi2Warning);
  CHECK(fmi2GetBooleanStatus(fmu, fmi2Terminated, NULL) > fmi2Warning);
  CHECK(fmi2GetStatus(fmu, fmi2Terminated, &status) > fmi2Warning);
  CHECK(fmi2GetStatus(fmu, fmi2DoStepStatus, NULL) > fmi2Warning);
  CHECK(fmi2GetIntegerStatus(fmu, fmi2PendingStatus, &integer) > fmi2Warning);
  CHECK(fmi2GetStringStatus(fmu, fmi2PendingStatus, &text) > fmi2Warning);
  CHECK(fmi2GetStatus(NULL, fmi2DoStepStatus, &status) > fmi2Warning);
  CHECK(fmi2GetRealStatus(NULL, fmi2LastSuccessfulTime, &last) > fmi2Warning);
  CHECK(fmi2GetBooleanStatus(NULL, fmi2Terminated, &ended) > fmi2Warning);
  fmi2FreeInstance(fmu);
}

static void an_instance_without_a_name_or_guid_is_refused(void) {
  complaints = 0;
  CHECK(!fmi2Instantiate("", fmi2CoSimulation, guid, NULL, &callbacks, fmi2False, fmi2False));
  CHECK(!fmi2Instantiate("robot", fmi2CoSimulation, NULL, NULL, &callbacks, fmi2False, fmi2False));
  CHECK(complaints == 2);
}

/* More variables than the component remembers the places of from its check of them. */
static void long_lists_of_variables_are_set_in_their_order(void) {
  enum { MANY = 1500 };
  static fmi2ValueReference reference[MANY];
  static fmi2Real value[MANY];
  fmi2Component fmu = initialised(fmi2CoSimulation);
  for (int i = 0; i < MANY; ++i)
    reference[i] = reference_of(i % 2 ? "torso.push_force[2]" : "torso.push_force[1]");
  for (int i = 0; i < MANY; ++i) value[i] = 0.01 * i;
  CHECK(fmi2SetReal(fmu, reference, MANY, value) == fmi2OK);
  CHECK(fmi2GetReal(fmu, reference, MANY, value) == fmi2OK);
  for (int i = 0; i < MANY; ++i) NEAR(value[i], i % 2 ? 14.99 : 14.98, 0.0);
  reference[MANY - 1] = 77777777; /* the last one alone is unknown: none is set */
  for (int i = 0; i < MANY; ++i) value[i] = 1.0;
  CHECK(fmi2SetReal(fmu, reference, MANY, value) == fmi2Error);
  NEAR(real(fmu, "torso.push_force[1]"), 14.98, 0.0);
  fmi2FreeInstance(fmu);
}

static void missing_arrays_of_directions_and_states_are_refused_or_nothing(void) {
  fmi2Component fmu = initialised(fmi2CoSimulation);
  const fmi2ValueReference unknown = reference_of("LF.coxa.angle"),
                           known = reference_of("LF.coxa.angle_ref");
  const fmi2Real one = 1.0;
  fmi2Real found = 0.0;
  CHECK(fmi2GetDirectionalDerivative(fmu, &unknown, 1, NULL, 1, &one, &found) == fmi2Error);
  CHECK(fmi2GetDirectionalDerivative(fmu, &unknown, 1, &known, 1, NULL, &found) == fmi2Error);
  CHECK(fmi2GetDirectionalDerivative(fmu, &unknown, 1, &known, 1, &one, &found) == fmi2OK);
  CHECK(fmi2FreeFMUstate(fmu, NULL) == fmi2OK && fmi2FreeFMUstate(NULL, NULL) == fmi2Error);
  fmi2FreeInstance(fmu);
}

int main(int count, char **arguments) {
  if (count != 2) return EXIT_FAILURE;
  open_description(arguments[1]);
  it_stands_and_goes_back();
  derivatives_are_differences();
  solvers_of_others_see_it_fall();
  misuse_is_refused();
  calls_without_arguments_are_refused_and_change_nothing();
  calls_of_the_other_interface_are_refused();
  a_status_is_what_a_step_left();
  an_instance_without_a_name_or_guid_is_refused();
  long_lists_of_variables_are_set_in_their_order();
  missing_arrays_of_directions_and_states_are_refused_or_nothing();
  return failures;
}
