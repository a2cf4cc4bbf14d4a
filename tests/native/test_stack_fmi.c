/* test_stack_fmi.c - every group of calls of a component's binary through FMI 2.0 and 3.0 in a
 * thread with a small stack (stack.h), for co-simulation and, where the component has it, model
 * exchange.
 *
 * usage: test_stack_fmi modelDescription.xml, in a folder with start_values.txt
 */
#define _POSIX_C_SOURCE 200809L /* pthread_attr_setstack */

#include <stdarg.h>

#include "fmi2Functions.h"
#include "fmi3Functions.h"

#include "description.h"
#include "stack.h"

enum { MOST = 2000, STATES = 200, FEET = 6, INDICATORS = 50 };

/* What the calls of both versions share. */
static char folder[4096];
static fmi2ValueReference input[MOST], output[MOST];
static double value[MOST], state[STATES], rate[STATES], indicator[INDICATORS];
static size_t n_inputs, n_outputs, n_states;
static int complaints;

/* Collects the references of Real variables of a causality. */
static size_t references_of(const char *causality, fmi2ValueReference *reference) {
  char wanted[64];
  size_t n = 0;
  snprintf(wanted, sizeof wanted, "causality=\"%s\"", causality);
  for (const char *at = description; (at = strstr(at, "<ScalarVariable ")) != NULL && n < MOST;) {
    const char *end = strstr(at, "</ScalarVariable>"), *number = strstr(at, "valueReference=\"");
    const char *found = strstr(at, wanted), *real = strstr(at, "<Real");
    if (!end || !number) break;
    if (found && found < end && real && real < end)
      if (sscanf(number, "valueReference=\"%u", &reference[n]) == 1) ++n;
    at = end;
  }
  return n;
}

/* Counts the states of the description. */
static size_t count_states(void) {
  size_t n = 0;
  for (const char *at = description; (at = strstr(at + 1, "derivative=\"")) != NULL;) ++n;
  return n;
}

/* ---- FMI 2.0 ---- */

typedef struct {
  fmi2Component fmu;
  fmi2Type type;
  double t;
} Two;

static void complain_two(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                         fmi2String category, fmi2String text, ...) {
  (void)environment, (void)name, (void)status, (void)category, (void)text;
  ++complaints;
}

static void open_two(void *given) {
  static const fmi2CallbackFunctions callbacks = {complain_two, calloc, free, NULL, NULL};
  Two *two = given;
  two->fmu = fmi2Instantiate("robot", two->type, guid, folder, &callbacks, fmi2False, fmi2False);
  CHECK(two->fmu && fmi2SetupExperiment(two->fmu, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK);
  CHECK(fmi2EnterInitializationMode(two->fmu) == fmi2OK);
  CHECK(fmi2ExitInitializationMode(two->fmu) == fmi2OK);
}

static void step_two(void *given) {
  Two *two = given;
  CHECK(fmi2GetReal(two->fmu, input, n_inputs, value) == fmi2OK);
  CHECK(fmi2SetReal(two->fmu, input, n_inputs, value) == fmi2OK);
  CHECK(fmi2DoStep(two->fmu, two->t, 0.02, fmi2True) == fmi2OK);
  two->t += 0.02;
}

/* Another control and another gait, with the outputs read before the step. */
static void change_walk_two(void *given) {
  Two *two = given;
  const fmi2ValueReference control = reference_of("control"), period = reference_of("gait.period");
  const fmi2Integer compliant = 2;
  const fmi2Real seconds = 1.2;
  CHECK(fmi2SetInteger(two->fmu, &control, 1, &compliant) == fmi2OK);
  CHECK(fmi2SetReal(two->fmu, &period, 1, &seconds) == fmi2OK);
  CHECK(fmi2GetReal(two->fmu, output, n_outputs, value) == fmi2OK);
  CHECK(fmi2DoStep(two->fmu, two->t, 0.02, fmi2True) == fmi2OK);
  two->t += 0.02;
}

static void read_two(void *given) {
  Two *two = given;
  CHECK(fmi2GetReal(two->fmu, output, n_outputs, value) == fmi2OK);
}

static void restore_two(void *given) {
  fmi2Component fmu = ((Two *)given)->fmu;
  fmi2FMUstate saved = NULL, copy = NULL;
  size_t size = 0;
  CHECK(fmi2GetFMUstate(fmu, &saved) == fmi2OK);
  CHECK(fmi2SerializedFMUstateSize(fmu, saved, &size) == fmi2OK);
  fmi2Byte *bytes = malloc(size);
  CHECK(fmi2SerializeFMUstate(fmu, saved, bytes, size) == fmi2OK);
  CHECK(fmi2DeSerializeFMUstate(fmu, bytes, size, &copy) == fmi2OK);
  CHECK(fmi2SetFMUstate(fmu, copy) == fmi2OK);
  free(bytes);
  CHECK(fmi2FreeFMUstate(fmu, &saved) == fmi2OK && fmi2FreeFMUstate(fmu, &copy) == fmi2OK);
}

static void derive_two(void *given) {
  fmi2Component fmu = ((Two *)given)->fmu;
  const fmi2ValueReference unknown = reference_of("RM.tibia.torque");
  const fmi2Real change = 1.0;
  fmi2Real derivative;
  CHECK(fmi2GetDirectionalDerivative(fmu, &unknown, 1, input, 1, &change, &derivative) == fmi2OK);
}

static void exchange_two(void *given) {
  fmi2Component fmu = ((Two *)given)->fmu;
  fmi2EventInfo event;
  fmi2Boolean enter, terminate;
  CHECK(fmi2NewDiscreteStates(fmu, &event) == fmi2OK);
  CHECK(fmi2EnterContinuousTimeMode(fmu) == fmi2OK);
  CHECK(fmi2GetContinuousStates(fmu, state, n_states) == fmi2OK);
  CHECK(fmi2SetTime(fmu, 0.001) == fmi2OK);
  CHECK(fmi2SetContinuousStates(fmu, state, n_states) == fmi2OK);
  CHECK(fmi2GetDerivatives(fmu, rate, n_states) == fmi2OK);
  CHECK(fmi2GetEventIndicators(fmu, indicator, INDICATORS) == fmi2OK);
  CHECK(fmi2CompletedIntegratorStep(fmu, fmi2True, &enter, &terminate) == fmi2OK);
}

static void refuse_two(void *given) {
  fmi2Component fmu = ((Two *)given)->fmu;
  const double wrong = nan("");
  complaints = 0;
  CHECK(fmi2SetReal(fmu, input, 1, &wrong) > fmi2Warning);
  CHECK(complaints == 1);
}

static void close_two(void *given) {
  fmi2Component fmu = ((Two *)given)->fmu;
  CHECK(fmi2Reset(fmu) == fmi2OK);
  fmi2FreeInstance(fmu);
}

/* ---- FMI 3.0 ---- */

typedef struct {
  fmi3Instance fmu;
  double t;
} Three;

static void complain_three(fmi3InstanceEnvironment environment, fmi3Status status,
                           fmi3String category, fmi3String text) {
  (void)environment, (void)status, (void)category, (void)text;
  ++complaints;
}

static void initialise_three(fmi3Instance fmu) {
  CHECK(fmu && fmi3EnterInitializationMode(fmu, fmi3False, 0.0, 0.0, fmi3False, 0.0) == fmi3OK);
  CHECK(fmi3ExitInitializationMode(fmu) == fmi3OK);
}

static void open_three(void *given) {
  Three *three = given;
  three->fmu =
      fmi3InstantiateCoSimulation("robot", guid, folder + strlen("file://"), fmi3False, fmi3False,
                                  fmi3False, fmi3False, NULL, 0, NULL, complain_three, NULL);
  initialise_three(three->fmu);
}

static void step_three(void *given) {
  Three *three = given;
  fmi3Boolean event, terminate, early;
  fmi3Float64 last;
  CHECK(fmi3DoStep(three->fmu, three->t, 0.02, fmi3True, &event, &terminate, &early, &last) ==
        fmi3OK);
  three->t += 0.02;
}

static void restore_three(void *given) {
  fmi3Instance fmu = ((Three *)given)->fmu;
  fmi3FMUState saved = NULL, copy = NULL;
  size_t size = 0;
  CHECK(fmi3GetFMUState(fmu, &saved) == fmi3OK);
  CHECK(fmi3SerializedFMUStateSize(fmu, saved, &size) == fmi3OK);
  fmi3Byte *bytes = malloc(size);
  CHECK(fmi3SerializeFMUState(fmu, saved, bytes, size) == fmi3OK);
  CHECK(fmi3DeserializeFMUState(fmu, bytes, size, &copy) == fmi3OK);
  CHECK(fmi3SetFMUState(fmu, copy) == fmi3OK);
  free(bytes);
  CHECK(fmi3FreeFMUState(fmu, &saved) == fmi3OK && fmi3FreeFMUState(fmu, &copy) == fmi3OK);
}

static void derive_three(void *given) {
  fmi3Instance fmu = ((Three *)given)->fmu;
  const fmi3ValueReference unknown = reference_of("LF.foot.normal_force"),
                           known = reference_of("torso.push_force[1]");
  const fmi3Float64 change[3] = {1.0, 0.0, 0.0};
  fmi3Float64 derivative[FEET];
  CHECK(fmi3GetDirectionalDerivative(fmu, &unknown, 1, &known, 1, change, 3, derivative, FEET) ==
        fmi3OK);
}

static void exchange_three(void *given) {
  Three *three = given;
  fmi3Boolean update, terminate, nominals, states, timed, enter;
  fmi3Float64 next;
  three->fmu =
      fmi3InstantiateModelExchange("robot", guid, NULL, fmi3False, fmi3False, NULL, complain_three);
  fmi3Instance fmu = three->fmu;
  initialise_three(fmu);
  CHECK(fmi3UpdateDiscreteStates(fmu, &update, &terminate, &nominals, &states, &timed, &next) ==
        fmi3OK);
  CHECK(fmi3EnterContinuousTimeMode(fmu) == fmi3OK);
  CHECK(fmi3GetContinuousStates(fmu, state, n_states) == fmi3OK);
  CHECK(fmi3SetTime(fmu, 0.001) == fmi3OK);
  CHECK(fmi3SetContinuousStates(fmu, state, n_states) == fmi3OK);
  CHECK(fmi3GetContinuousStateDerivatives(fmu, rate, n_states) == fmi3OK);
  CHECK(fmi3GetEventIndicators(fmu, indicator, INDICATORS) == fmi3OK);
  CHECK(fmi3CompletedIntegratorStep(fmu, fmi3True, &enter, &terminate) == fmi3OK);
}

static void close_three(void *given) {
  fmi3Instance fmu = ((Three *)given)->fmu;
  CHECK(fmi3Reset(fmu) == fmi3OK);
  fmi3FreeInstance(fmu);
}

static void co_simulation(int has_derivatives) {
  Two two = {.type = fmi2CoSimulation};
  Three three = {.t = 0.0};
  in_small_stack("FMI 2.0: instantiate, initialise", open_two, &two);
  in_small_stack("FMI 2.0: inputs, step", step_two, &two);
  in_small_stack("FMI 2.0: outputs", read_two, &two);
  if (strstr(description, "name=\"gait.period\"")) /* a controller, whose walk is tunable */
    in_small_stack("FMI 2.0: another walk", change_walk_two, &two);
  in_small_stack("FMI 2.0: states", restore_two, &two);
  if (has_derivatives) in_small_stack("FMI 2.0: derivatives", derive_two, &two);
  in_small_stack("FMI 2.0: refused value", refuse_two, &two);
  in_small_stack("FMI 2.0: reset, free", close_two, &two);
  in_small_stack("FMI 3.0: instantiate, initialise", open_three, &three);
  in_small_stack("FMI 3.0: step", step_three, &three);
  in_small_stack("FMI 3.0: states", restore_three, &three);
  if (has_derivatives) in_small_stack("FMI 3.0: derivatives", derive_three, &three);
  in_small_stack("FMI 3.0: reset, free", close_three, &three);
}

static void model_exchange(void) {
  Two two = {.type = fmi2ModelExchange};
  Three three = {.t = 0.0};
  in_small_stack("FMI 2.0 exchange: instantiate", open_two, &two);
  in_small_stack("FMI 2.0 exchange: rates, step", exchange_two, &two);
  in_small_stack("FMI 2.0 exchange: derivatives", derive_two, &two);
  in_small_stack("FMI 2.0 exchange: states", restore_two, &two);
  in_small_stack("FMI 2.0 exchange: reset, free", close_two, &two);
  in_small_stack("FMI 3.0 exchange: rates, step", exchange_three, &three);
  in_small_stack("FMI 3.0 exchange: derivatives", derive_three, &three);
  in_small_stack("FMI 3.0 exchange: states", restore_three, &three);
  in_small_stack("FMI 3.0 exchange: reset, free", close_three, &three);
}

int main(int count, char **arguments) {
  if (count != 2) return EXIT_FAILURE;
  open_description(arguments[1]);
  const int length = (int)(strrchr(arguments[1], '/') - arguments[1]);
  snprintf(folder, sizeof folder, "file://%.*s/", length, arguments[1]);
  n_inputs = references_of("input", input), n_outputs = references_of("output", output);
  n_states = count_states();
  CHECK(n_inputs > 0 && n_outputs > 0 && n_states <= STATES);
  const int exchange = strstr(description, "<ModelExchange") != NULL;
  co_simulation(exchange);
  if (exchange) model_exchange();
  return failures;
}
