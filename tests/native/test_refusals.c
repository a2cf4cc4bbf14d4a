/* test_refusals.c - calls of a component that are refused although their arguments are no NULL
 * pointers: each says why, and what has been saved before stays as it was, byte for byte. Plant and
 * controller, through FMI 2.0 and 3.0.
 *
 * usage: test_refusals modelDescription.xml RESOURCES
 * RESOURCES: path of a folder with start_values.txt; the plant's also with terrain/1.terrain, which
 * is a grid, terrain/2.terrain, which is none, and terrain/3.terrain, which is empty
 */
#include <stdarg.h>

#include "fmi/instance.h"
#include "fmi2Functions.h"
#include "fmi3Functions.h"

#include "check.h"
#include "description.h"

static char logged[8192]; /* last message */
static const char *resources;
static int is_plant;

static void keep_two(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                     fmi2String category, fmi2String text, ...) {
  (void)environment, (void)name, (void)status, (void)category;
  snprintf(logged, sizeof logged, "%s", text);
}

static void keep_three(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                       fmi3String text) {
  (void)environment, (void)status, (void)category;
  snprintf(logged, sizeof logged, "%s", text);
}

static const fmi2CallbackFunctions callbacks = {keep_two, calloc, free, NULL, NULL};

static fmi2Component opened(fmi2Type type) {
  fmi2Component fmu = fmi2Instantiate("robot", type, guid, resources, &callbacks, 0, 0);
  CHECK(fmu);
  return fmu;
}

static fmi2Component running(fmi2Type type) {
  fmi2Component fmu = opened(type);
  CHECK(fmi2SetupExperiment(fmu, 0, 0.0, 0.0, 1, 10.0) == fmi2OK);
  CHECK(fmi2EnterInitializationMode(fmu) == fmi2OK && fmi2ExitInitializationMode(fmu) == fmi2OK);
  return fmu;
}

static void set(fmi2Component fmu, const char *name, double value) {
  const fmi2ValueReference reference = reference_of(name);
  CHECK(fmi2SetReal(fmu, &reference, 1, &value) == fmi2OK);
}

static void choose(fmi2Component fmu, const char *name, int value) {
  const fmi2ValueReference reference = reference_of(name);
  CHECK(fmi2SetInteger(fmu, &reference, 1, &value) == fmi2OK);
}

/* Checks that the last message contains these words, and forgets it. */
static void said(const char *words) {
  if (!strstr(logged, words)) fprintf(stderr, "expected '%s' in '%s'\n", words, logged);
  CHECK(strstr(logged, words) != NULL);
  logged[0] = '\0';
}

/* Returns the bytes of the instance's state, to be freed by the caller. */
static fmi2Byte *bytes_of(fmi2Component fmu, size_t *size) {
  fmi2FMUstate state = NULL;
  CHECK(fmi2GetFMUstate(fmu, &state) == fmi2OK);
  CHECK(fmi2SerializedFMUstateSize(fmu, state, size) == fmi2OK);
  fmi2Byte *bytes = malloc(*size);
  CHECK(bytes && fmi2SerializeFMUstate(fmu, state, bytes, *size) == fmi2OK);
  CHECK(fmi2FreeFMUstate(fmu, &state) == fmi2OK);
  return bytes;
}

/* ---- both components ---- */

static void steps_that_do_not_fit_are_refused(void) {
  fmi2Component fmu = running(fmi2CoSimulation);
  size_t size;
  CHECK(fmi2DoStep(fmu, 0.0, 0.02, fmi2True) == fmi2OK);
  fmi2Byte *before = bytes_of(fmu, &size);
  static const struct {
    double at, size;
    const char *words;
  } step[] = {{0.02, 0.0, "communication step size: got 0 s"},
              {0.02, -0.02, "communication step size: got -0.02"},
              {0.02, 101.0, "and at most 100; the state is unchanged, make it several steps"},
              {0.02, (double)NAN, "communication step size: got nan"},
              {0.04, 0.02, "communication point: got 0.04"},
              {(double)NAN, 0.02, "communication point: got nan"},
              {0.02, 9.99, "a step that ends by the experiment's stop time, 10 s"}};
  for (size_t k = 0; k < sizeof step / sizeof *step; ++k) {
    CHECK(fmi2DoStep(fmu, step[k].at, step[k].size, fmi2True) == fmi2Error);
    said(step[k].words);
  }
  fmi2Byte *after = bytes_of(fmu, &size);
  CHECK(memcmp(before, after, size) == 0);
  CHECK(fmi2DoStep(fmu, 0.02 - 8e-16, 4e-16, fmi2True) == fmi2OK); /* of rounding size: it stays */
  CHECK(fmi2DoStep(fmu, 0.02, 9.98, fmi2True) != fmi2Fatal);
  free(before), free(after);
  fmi2FreeInstance(fmu);
}

static void rates_of_inputs_are_checked(void) {
  const char *name = is_plant ? "LF.coxa.angle_ref" : "command.vx";
  fmi2Component fmu = running(fmi2CoSimulation);
  const fmi2ValueReference input = reference_of(name), other = reference_of("torso.mass"),
                           nowhere = 77777777;
  const fmi2Integer first = 1, second = 2;
  const fmi2Real slow = 0.01, fast = 1e6, none = NAN;
  CHECK(fmi2SetRealInputDerivatives(fmu, &input, 1, &second, &slow) == fmi2Error);
  said("got order 2, expected 1");
  CHECK(fmi2SetRealInputDerivatives(fmu, &nowhere, 1, &first, &slow) == fmi2Error);
  said("77777777");
  CHECK(fmi2SetRealInputDerivatives(fmu, &other, 1, &first, &slow) == fmi2Error);
  said("expected a finite number for an input; nothing was set");
  CHECK(fmi2SetRealInputDerivatives(fmu, &input, 1, &first, &none) == fmi2Error);
  said("expected a finite number for an input; nothing was set");
  CHECK(fmi2SetRealInputDerivatives(fmu, &input, 1, &first, &slow) == fmi2OK);
  CHECK(fmi2SetRealInputDerivatives(fmu, &input, 1, &first, &fast) == fmi2OK);
  CHECK(fmi2DoStep(fmu, 0.0, 0.02, fmi2True) == fmi2Error);
  said(is_plant ? "got a derivative that takes it to 20000, expected one that leaves it in "
                  "[-6.28319, 6.28319] rad; the state is unchanged"
                : "got a derivative that takes it to 20000, expected one that leaves it in "
                  "[-10, 10] m/s; the state is unchanged");
  CHECK(fmi2SetRealInputDerivatives(fmu, &input, 1, &first, &slow) == fmi2OK);
  CHECK(fmi2DoStep(fmu, 0.0, 0.02, fmi2True) == fmi2OK);
  fmi2Real reached = NAN;
  CHECK(fmi2GetReal(fmu, &input, 1, &reached) == fmi2OK);
  NEAR(reached, 0.0002, 1e-15);
  fmi2FreeInstance(fmu);
}

static void categories_and_experiments_are_checked(void) {
  fmi2Component fmu = opened(fmi2CoSimulation);
  const fmi2String known = "logEvents", all = "logAll", unknown = "noise", none = NULL,
                   warnings = "logStatusWarning";
  CHECK(fmi2SetDebugLogging(fmu, fmi2True, 1, &unknown) == fmi2Error);
  said("got category 'noise', expected one of modelDescription.xml");
  CHECK(fmi2SetDebugLogging(fmu, fmi2True, 1, &none) == fmi2Error);
  said("got category '(NULL)'");
  CHECK(fmi2SetDebugLogging(fmu, fmi2True, 1, &known) == fmi2OK);
  CHECK(fmi2SetDebugLogging(fmu, fmi2False, 1, &known) == fmi2OK);
  CHECK(fmi2SetDebugLogging(fmu, fmi2True, 1, &all) == fmi2OK);
  CHECK(fmi2SetDebugLogging(fmu, fmi2False, 0, NULL) == fmi2OK);
  CHECK(fmi2SetupExperiment(fmu, 0, 0.0, NAN, 0, 0.0) == fmi2Error);
  said("expected a finite start and a stop not before it");
  CHECK(fmi2SetupExperiment(fmu, 0, 0.0, 1.0, 1, 0.5) == fmi2Error);
  said("got 1 s to 0.5 s");
  CHECK(fmi2SetupExperiment(fmu, 0, 0.0, -2e9, 0, 0.0) == fmi2Error);
  said("expected one within 1e+09 s of 0");
  CHECK(fmi2SetDebugLogging(fmu, fmi2True, 1, &warnings) == fmi2OK);
  CHECK(fmi2SetupExperiment(fmu, 1, 2.0, 0.0, 0, 0.0) == fmi2Warning);
  said("got tolerance 2");
  CHECK(fmi2SetupExperiment(fmu, 1, 0.0, 0.0, 0, 0.0) == fmi2Warning);
  CHECK(fmi2SetupExperiment(fmu, 1, 1e-6, 0.0, 0, 0.0) == fmi2OK);
  fmi2FreeInstance(fmu);
}

static void instances_that_are_not_offered_are_refused(void) {
  CHECK(!fmi2Instantiate("robot", (fmi2Type)7, guid, resources, &callbacks, 0, 0));
  said("got interface type 7");
  CHECK(!fmi2Instantiate(NULL, fmi2CoSimulation, guid, resources, &callbacks, 0, 0));
  said("got no instance name");
  CHECK(!fmi2Instantiate("robot", fmi2CoSimulation, NULL, resources, &callbacks, 0, 0));
  said("got no GUID");
  CHECK(!fmi2Instantiate("", fmi2CoSimulation, guid, resources, NULL, 0, 0));
  CHECK(!fmi3InstantiateScheduledExecution("robot", guid, resources, 0, 0, NULL, keep_three, NULL,
                                           NULL, NULL));
  said("got scheduled execution");
  CHECK(!fmi3InstantiateCoSimulation("robot", "{another}", NULL, 0, 0, 0, 0, NULL, 0, NULL, NULL,
                                     NULL));
}

/* ---- saved states ---- */

enum { HEADER = 24 + HX_GUID_SIZE, FORMAT_AT = 8, CHECKSUM_AT = 16, GUID_AT = 24 };

/* Restores changed bytes with the checksum that belongs to them; returns whether it was refused. */
static int is_refused(fmi2Component fmu, const fmi2Byte *bytes, size_t size) {
  fmi2FMUstate state = NULL;
  fmi2Byte *copy = malloc(size);
  if (!copy) return 0;
  memcpy(copy, bytes, size);
  const uint64_t checksum = hx_checksum(0, copy + HEADER, size - HEADER);
  memcpy(copy + CHECKSUM_AT, &checksum, sizeof checksum);
  const int refused = fmi2DeSerializeFMUstate(fmu, copy, size, &state) != fmi2OK ||
                      fmi2SetFMUstate(fmu, state) != fmi2OK;
  CHECK(fmi2FreeFMUstate(fmu, &state) == fmi2OK);
  free(copy);
  return refused;
}

/* Checks that a state is refused after `number`, of `n` bytes, is written to a place of it. */
static void refuses(fmi2Component fmu, const fmi2Byte *bytes, size_t size, size_t place,
                    const void *number, size_t n, const char *words) {
  fmi2Byte *changed = malloc(size);
  if (!changed) return;
  memcpy(changed, bytes, size);
  memcpy(changed + place, number, n);
  CHECK(is_refused(fmu, changed, size));
  said(words);
  free(changed);
}

#define FIELD(member) (HEADER + offsetof(hxInstanceState, member))

static void forged_states_are_refused(void) {
  fmi2Component fmu = running(fmi2CoSimulation);
  size_t size;
  fmi2Byte *bytes = bytes_of(fmu, &size);
  const int two = 2, exchange = HX_MODEL_EXCHANGE;
  const double late = 2e9, none = NAN;
  CHECK(!is_refused(fmu, bytes, size));
  refuses(fmu, bytes, size, 0, "x", 1, "bytes that are no saved state");
  refuses(fmu, bytes, size, FORMAT_AT, &two, sizeof two, "another version or platform");
  refuses(fmu, bytes, size, FORMAT_AT + 4, &two, sizeof two, "another version or platform");
  refuses(fmu, bytes, size, GUID_AT, "x", 1, "one of another FMU");
  refuses(fmu, bytes, size, FIELD(interface), &exchange, sizeof exchange, "the other interface");
  const size_t flag[] = {FIELD(model_stale), FIELD(output_stale), FIELD(rate_stale), FIELD(ramped)};
  for (size_t k = 0; k < sizeof flag / sizeof *flag; ++k)
    refuses(fmu, bytes, size, flag[k], &two, sizeof two, "a damaged instance");
  refuses(fmu, bytes, size, FIELD(start_time), &late, sizeof late, "a damaged instance");
  refuses(fmu, bytes, size, FIELD(stop_time), &none, sizeof none, "a damaged instance");
  refuses(fmu, bytes, size, FIELD(variables.input), &none, sizeof none, "a damaged instance");
  refuses(fmu, bytes, size, FIELD(variables.definition), &none, sizeof none, "a damaged instance");
  fmi2FMUstate state = NULL;
  CHECK(fmi2DeSerializeFMUstate(fmu, bytes, size - 1, &state) == fmi2Error);
  said("too few bytes");
  CHECK(fmi2DeSerializeFMUstate(fmu, bytes, size + 1, &state) == fmi2Error);
  said("too many bytes");
  bytes[size - 1] ^= 1;
  CHECK(fmi2DeSerializeFMUstate(fmu, bytes, size, &state) == fmi2Error);
  said("damaged bytes");
  bytes[size - 1] ^= 1;
  CHECK(fmi2GetFMUstate(fmu, &state) == fmi2OK);
  CHECK(fmi2SerializeFMUstate(fmu, state, bytes, size - 1) == fmi2Error);
  said("nothing was written");
  ((char *)state)[0] = 'x';
  CHECK(fmi2SerializeFMUstate(fmu, state, bytes, size) == fmi2Error);
  said("bytes that are no saved state");
  CHECK(fmi2SetFMUstate(fmu, state) == fmi2Error);
  said("bytes that are no saved state");
  CHECK(fmi2FreeFMUstate(fmu, &state) == fmi2OK);
  free(bytes);
  fmi2FreeInstance(fmu);
}

/* ---- the plant ---- */

static void derivatives_of_other_variables_are_refused(void) {
  fmi2Component fmu = running(fmi2CoSimulation);
  const fmi2ValueReference mass = reference_of("torso.mass"),
                           push = reference_of("torso.push_force[1]"),
                           force = reference_of("LF.foot.normal_force"), nowhere = 77777777;
  const fmi2Real one = 1.0, endless = INFINITY;
  const fmi2Integer order = 1;
  fmi2Real value = -1.0;
  static const char directional[] = "directional derivative: got the ";
  CHECK(fmi2GetDirectionalDerivative(fmu, &mass, 1, &push, 1, &one, &value) == fmi2Error);
  said("got the unknown torso.mass, expected an output or a derivative");
  CHECK(fmi2GetDirectionalDerivative(fmu, &push, 1, &push, 1, &one, &value) == fmi2Error);
  said(directional);
  CHECK(fmi2GetDirectionalDerivative(fmu, &nowhere, 1, &push, 1, &one, &value) == fmi2Error);
  CHECK(fmi2GetDirectionalDerivative(fmu, &force, 1, &nowhere, 1, &one, &value) == fmi2Error);
  said("77777777");
  CHECK(fmi2GetDirectionalDerivative(fmu, &force, 1, &mass, 1, &one, &value) == fmi2Error);
  said("got the known torso.mass, expected an input or a continuous state");
  CHECK(fmi2GetDirectionalDerivative(fmu, &force, 1, &push, 1, &endless, &value) == fmi2Error);
  said("got a direction that is not finite");
  CHECK(fmi2GetRealOutputDerivatives(fmu, &mass, 1, &order, &value) == fmi2Error);
  said("got the unknown torso.mass");
  CHECK(value == -1.0);
  CHECK(fmi2GetDirectionalDerivative(fmu, &force, 1, &push, 0, &one, &value) == fmi2OK);
  CHECK(value == 0.0); /* nothing changes along no direction */
  fmi2FreeInstance(fmu);
}

static size_t count_states(void) {
  size_t n = 0;
  for (const char *at = description; (at = strstr(at + 1, "derivative=\"")) != NULL;) ++n;
  return n;
}

static void states_that_are_none_are_refused(void) {
  enum { MOST = 200 };
  static double state[MOST], other[MOST], row[MOST];
  fmi2Component fmu = running(fmi2ModelExchange);
  fmi2EventInfo event;
  fmi2Boolean enter, end;
  const size_t n = count_states();
  CHECK(n > 0 && n <= MOST);
  CHECK(fmi2NewDiscreteStates(fmu, &event) == fmi2OK && fmi2EnterContinuousTimeMode(fmu) == fmi2OK);
  CHECK(fmi2GetContinuousStates(fmu, state, n) == fmi2OK);
  memcpy(other, state, sizeof other);
  other[n / 2] = NAN;
  CHECK(fmi2SetContinuousStates(fmu, other, n) == fmi2Discard);
  said("continuous states: coordinates: got numbers that are not finite");
  CHECK(fmi2SetContinuousStates(fmu, state, n - 1) == fmi2Error);
  said("continuous states: got ");
  CHECK(fmi2SetTime(fmu, INFINITY) == fmi2Error);
  said("time: got a number that is not finite");
  CHECK(fmi2GetContinuousStates(fmu, other, n) == fmi2OK);
  CHECK(memcmp(state, other, sizeof state) == 0);
  CHECK(fmi2GetEventIndicators(fmu, row, 1) == fmi2Error);
  said("event indicators: got 1 places");
  CHECK(fmi2GetContinuousStates(fmu, row, n + 1) == fmi2Error);
  CHECK(fmi2GetDerivatives(fmu, row, 0) == fmi2Error);
  CHECK(fmi2GetNominalsOfContinuousStates(fmu, row, 1) == fmi2Error);
  CHECK(fmi2GetNominalsOfContinuousStates(fmu, row, n) == fmi2OK && row[0] > 0.0);
  CHECK(fmi2CompletedIntegratorStep(fmu, 1, &enter, &end) == fmi2OK && !enter && !end);
  CHECK(fmi2CompletedIntegratorStep(fmu, 1, NULL, &end) == fmi2Error);
  CHECK(fmi2NewDiscreteStates(fmu, &event) == fmi2Error);
  CHECK(fmi2EnterEventMode(fmu) == fmi2OK && fmi2NewDiscreteStates(fmu, NULL) == fmi2Error);
  CHECK(fmi2NewDiscreteStates(fmu, &event) == fmi2OK);
  fmi2FreeInstance(fmu);
}

/* Values are read in initialization mode with parameters that do not belong together. */
static void robots_that_cannot_be_are_refused(void) {
  static double row[200];
  static const fmi2Type type[] = {fmi2CoSimulation, fmi2ModelExchange};
  for (int k = 0; k < 2; ++k) {
    fmi2Component fmu = opened(type[k]);
    const fmi2ValueReference force = reference_of("LF.foot.normal_force");
    set(fmu, "friction.mu_static", 0.25);
    CHECK(fmi2EnterInitializationMode(fmu) == fmi2OK);
    CHECK(fmi2GetReal(fmu, &force, 1, row) == fmi2Error);
    said("at least friction.mu, or 0, which means the same; nothing was initialised");
    CHECK(fmi2GetDirectionalDerivative(fmu, &force, 1, &force, 0, row, row) == fmi2Error);
    said("friction.mu_static");
    if (type[k] == fmi2ModelExchange) {
      CHECK(fmi2GetContinuousStates(fmu, row, count_states()) == fmi2Error);
      said("friction.mu_static");
      CHECK(fmi2GetDerivatives(fmu, row, count_states()) == fmi2Error);
      said("friction.mu_static");
      CHECK(fmi2GetEventIndicators(fmu, row, 50) == fmi2Error);
      said("friction.mu_static");
    }
    CHECK(fmi2ExitInitializationMode(fmu) == fmi2Error);
    set(fmu, "friction.mu_static", 0.0);
    CHECK(fmi2ExitInitializationMode(fmu) == fmi2OK);
    fmi2FreeInstance(fmu);
  }
  fmi2Component fmu = opened(fmi2ModelExchange);
  set(fmu, "servo.gear_stiffness", 100.0), set(fmu, "servo.rotor_inertia", 1e-4);
  CHECK(fmi2EnterInitializationMode(fmu) == fmi2OK && fmi2ExitInitializationMode(fmu) == fmi2Error);
  said("got an elastic gear, whose rotors are no continuous states");
  fmi2FreeInstance(fmu);
}

/* Initialises a plant on a grid; returns the instance, or NULL after a refusal. */
static fmi2Component on_grid(double grid, double mu_static) {
  fmi2Component fmu = opened(fmi2CoSimulation);
  choose(fmu, "terrain.kind", 3);
  set(fmu, "terrain.grid", grid), set(fmu, "initial.position[3]", 0.5);
  set(fmu, "friction.mu_static", mu_static);
  CHECK(fmi2EnterInitializationMode(fmu) == fmi2OK);
  if (fmi2ExitInitializationMode(fmu) == fmi2OK) return fmu;
  fmi2FreeInstance(fmu);
  return NULL;
}

static void grids_that_are_not_there_are_refused(void) {
  CHECK(!on_grid(9.0, 0.0));
  said("terrain/9.terrain); the file is missing or cannot be read");
  CHECK(!on_grid(1.5, 0.0));
  said("terrain/); give a whole number");
  CHECK(!on_grid(2.0, 0.0));
  said("(");
  CHECK(!on_grid(3.0, 0.0));
  said("the file is missing or cannot be read");
  CHECK(!on_grid(1.0, 0.25));
  said("friction.mu_static");
  const char *there = resources;
  resources = NULL;
  CHECK(!on_grid(1.0, 0.0));
  said("instantiate the FMU with the path of its resources");
  resources = there;
}

/* A saved state names its grid, which is read again, or is there. */
static void a_state_on_a_grid_returns_to_it(void) {
  fmi2Component fmu = on_grid(1.0, 0.0), flat = running(fmi2CoSimulation);
  fmi2FMUstate state = NULL, level = NULL;
  size_t size, flat_size;
  if (!fmu) CHECK(0);
  if (!fmu) return;
  fmi2Byte *bytes = bytes_of(fmu, &size), *flat_bytes = bytes_of(flat, &flat_size);
  CHECK(fmi2DeSerializeFMUstate(flat, bytes, size, &state) == fmi2OK);
  CHECK(fmi2SetFMUstate(flat, state) == fmi2OK && fmi2SetFMUstate(flat, state) == fmi2OK);
  fmi2Byte *after = bytes_of(flat, &flat_size);
  CHECK(flat_size == size && memcmp(bytes, after, size) == 0);
  CHECK(fmi2DeSerializeFMUstate(flat, flat_bytes, size, &level) == fmi2OK);
  CHECK(fmi2SetFMUstate(flat, level) == fmi2OK);
  const double nowhere = 9.0, damaged = NAN;
  const size_t component = HEADER + sizeof(hxInstanceState);
  refuses(flat, bytes, size, component, &nowhere, sizeof nowhere, "a damaged component");
  refuses(flat, bytes, size, component + 8, &damaged, sizeof damaged, "a damaged component");
  CHECK(fmi2DoStep(flat, 0.0, 0.01, fmi2True) == fmi2OK);
  CHECK(fmi2FreeFMUstate(flat, &state) == fmi2OK && fmi2FreeFMUstate(flat, &level) == fmi2OK);
  free(bytes), free(flat_bytes), free(after);
  fmi2FreeInstance(fmu), fmi2FreeInstance(flat);
}

/* ---- the plant through FMI 3.0 ---- */

/* Flags and times that the importer does not ask for are not written. */
static void places_that_are_not_given_are_not_needed(void) {
  fmi3Instance fmu = fmi3InstantiateModelExchange("robot", guid, resources, 0, 0, NULL, keep_three);
  CHECK(fmu && fmi3EnterInitializationMode(fmu, 0, 0.0, 0.0, 0, 0.0) == fmi3OK);
  CHECK(fmi3ExitInitializationMode(fmu) == fmi3OK);
  CHECK(fmi3UpdateDiscreteStates(fmu, NULL, NULL, NULL, NULL, NULL, NULL) == fmi3OK);
  CHECK(fmi3EnterContinuousTimeMode(fmu) == fmi3OK);
  CHECK(fmi3CompletedIntegratorStep(fmu, 1, NULL, NULL) == fmi3OK);
  fmi3FreeInstance(fmu);
  fmu = fmi3InstantiateCoSimulation("robot", guid, resources, 0, 0, 1, 1, NULL, 0, NULL, keep_three,
                                    NULL);
  fmi3Boolean event = 1, early = 1;
  fmi3Float64 reached = -1.0;
  CHECK(fmu && fmi3EnterInitializationMode(fmu, 0, 0.0, 0.0, 0, 0.0) == fmi3OK);
  CHECK(fmi3ExitInitializationMode(fmu) == fmi3OK);
  CHECK(fmi3UpdateDiscreteStates(fmu, NULL, NULL, NULL, NULL, NULL, NULL) == fmi3OK);
  CHECK(fmi3EnterStepMode(fmu) == fmi3OK);
  CHECK(fmi3DoStep(fmu, 0.0, -1.0, 1, NULL, NULL, NULL, NULL) == fmi3Error);
  said("communication step size: got -1 s");
  CHECK(fmi3DoStep(fmu, -8e-16, 4e-16, 1, &event, NULL, &early, &reached) == fmi3OK);
  CHECK(!event && !early && reached == 0.0); /* of rounding size: it stays */
  fmi3FreeInstance(fmu);
}

/* The time is a Float64 that is read, and nothing else. */
static void the_time_is_a_number_that_steps_move(void) {
  fmi3Instance fmu = fmi3InstantiateCoSimulation("robot", guid, resources, 0, 0, 0, 0, NULL, 0,
                                                 NULL, keep_three, NULL);
  const fmi3ValueReference time = 9999;
  fmi3Float64 t = -1.0;
  fmi3Int64 number = -1;
  const fmi3Int32 order = 1;
  CHECK(fmu && fmi3GetFloat64(fmu, &time, 1, &t, 1) == fmi3OK && t == 0.0);
  CHECK(fmi3GetInt64(fmu, &time, 1, &number, 1) == fmi3Error && number == -1);
  said("value reference: got 9999");
  CHECK(fmi3SetFloat64(fmu, &time, 1, &t, 1) == fmi3Error);
  said("time: got a value, expected none, as steps move it");
  CHECK(fmi3EnterInitializationMode(fmu, 0, 0.0, 0.0, 0, 0.0) == fmi3OK);
  CHECK(fmi3GetDirectionalDerivative(fmu, &time, 1, &time, 1, &t, 1, &t, 1) == fmi3Error);
  CHECK(fmi3GetDirectionalDerivative(fmu, &time, 1, &time, 1, &t, 1, &t, 2) == fmi3Error);
  said("values: got room for 2, expected 1");
  CHECK(fmi3ExitInitializationMode(fmu) == fmi3OK);
  CHECK(fmi3GetOutputDerivatives(fmu, &time, 1, &order, &t, 3) == fmi3Error);
  said("values: got room for 3, expected 1");
  fmi3FreeInstance(fmu);
}

/* ---- the controller ---- */

static void a_component_without_states_offers_no_derivatives(void) {
  fmi2Component fmu = running(fmi2CoSimulation);
  const fmi2ValueReference input = reference_of("command.vx"),
                           output = reference_of("LF.coxa.angle_ref");
  const fmi2Real one = 1.0;
  const fmi2Integer order = 1;
  fmi2Real value;
  CHECK(fmi2GetDirectionalDerivative(fmu, &output, 1, &input, 1, &one, &value) == fmi2Error);
  said("directional derivative: got a call, expected none");
  CHECK(fmi2GetRealOutputDerivatives(fmu, &output, 1, &order, &value) == fmi2Error);
  said("derivatives of outputs: got a call, expected none");
  fmi2FreeInstance(fmu);
  CHECK(!fmi2Instantiate("robot", fmi2ModelExchange, guid, resources, &callbacks, 0, 0));
  said("got interface type 0");
  CHECK(!fmi3InstantiateModelExchange("robot", guid, resources, 0, 0, NULL, keep_three));
  said("got model exchange");
}

/* An importer that would handle events gets none from a controller, which has step mode alone. */
static void a_component_without_states_has_no_events(void) {
  fmi3Instance fmu = fmi3InstantiateCoSimulation("robot", guid, resources, 0, 0, 1, 1, NULL, 0,
                                                 NULL, keep_three, NULL);
  fmi3Boolean event = 1, end = 1, early = 1;
  fmi3Float64 reached = -1.0;
  size_t n = 7;
  CHECK(fmu);
  CHECK(fmi3EnterInitializationMode(fmu, 0, 0.0, 0.0, 0, 0.0) == fmi3OK);
  CHECK(fmi3ExitInitializationMode(fmu) == fmi3OK);
  CHECK(fmi3DoStep(fmu, 0.0, 0.02, 1, &event, &end, &early, &reached) == fmi3OK);
  CHECK(!event && !end && !early && reached == 0.02);
  CHECK(fmi3DoStep(fmu, 0.02, 0.02, 1, NULL, NULL, NULL, NULL) == fmi3OK);
  CHECK(fmi3GetNumberOfEventIndicators(fmu, &n) == fmi3Error);
  CHECK(fmi3GetNumberOfContinuousStates(fmu, &n) == fmi3Error && n == 7);
  CHECK(fmi3EnterEventMode(fmu) == fmi3Error);
  fmi3FreeInstance(fmu);
}

/* Walks on from a saved state, with another value of a Real parameter unless name is NULL; writes
 * the commanded joint angles after half a second. */
static void walk_on(fmi2Component fmu, fmi2FMUstate begin, const char *name, double value,
                    fmi2Real angle[HX_LEGS * HX_JOINTS]) {
  fmi2ValueReference reference[HX_LEGS * HX_JOINTS];
  for (unsigned i = 0; i < HX_LEGS * HX_JOINTS; ++i)
    reference[i] = reference_of("LF.coxa.angle_ref") + i;
  CHECK(fmi2SetFMUstate(fmu, begin) == fmi2OK);
  if (name && strcmp(name, "gait.pattern") == 0)
    choose(fmu, name, (int)value);
  else if (name)
    set(fmu, name, value);
  for (int k = 0; k < 50; ++k) CHECK(fmi2DoStep(fmu, 0.5 + 0.01 * k, 0.01, fmi2True) == fmi2OK);
  CHECK(fmi2GetReal(fmu, reference, HX_LEGS * HX_JOINTS, angle) == fmi2OK);
}

static void each_parameter_of_the_gait_changes_a_walk_that_is_under_way(void) {
  static const struct {
    const char *name;
    double same, other;
  } gait[] = {{"gait.period", 1.0, 1.1},
              {"gait.duty", 0.5, 0.6},
              {"gait.step_height", 0.04, 0.05},
              {"gait.touchdown_speed", 0.0, 0.1}};
  fmi2Component fmu = running(fmi2CoSimulation);
  fmi2FMUstate begin = NULL;
  fmi2Real before[HX_LEGS * HX_JOINTS], after[HX_LEGS * HX_JOINTS];
  set(fmu, "command.vx", 0.05);
  for (int k = 0; k < 50; ++k) CHECK(fmi2DoStep(fmu, 0.01 * k, 0.01, fmi2True) == fmi2OK);
  CHECK(fmi2GetFMUstate(fmu, &begin) == fmi2OK);
  walk_on(fmu, begin, NULL, 0.0, before);
  for (size_t k = 0; k < sizeof gait / sizeof *gait; ++k) {
    walk_on(fmu, begin, gait[k].name, gait[k].same, after);
    CHECK(memcmp(before, after, sizeof before) == 0);
    walk_on(fmu, begin, gait[k].name, gait[k].other, after);
    CHECK(memcmp(before, after, sizeof before) != 0);
  }
  /* custom with the phases of the tripod, and a narrowing for loads that are not there: changes to
   * the same steps, which are led over alike */
  walk_on(fmu, begin, "gait.pattern", 5.0, before);
  walk_on(fmu, begin, "gait.narrowing", 0.01, after);
  CHECK(memcmp(before, after, sizeof before) == 0);
  CHECK(fmi2FreeFMUstate(fmu, &begin) == fmi2OK);
  fmi2FreeInstance(fmu);
}

static void a_gait_faster_than_the_controller_is_refused_by_the_next_step(void) {
  fmi2Component fmu = running(fmi2CoSimulation);
  size_t size;
  CHECK(fmi2DoStep(fmu, 0.0, 0.02, fmi2True) == fmi2OK);
  set(fmu, "gait.period", 0.005);
  fmi2Byte *before = bytes_of(fmu, &size);
  CHECK(fmi2DoStep(fmu, 0.02, 0.02, fmi2True) == fmi2Error);
  said("expected less than 0.0025 s, the gait's shorter phase");
  fmi2Byte *after = bytes_of(fmu, &size);
  CHECK(memcmp(before, after, size) == 0);
  set(fmu, "gait.period", 1.0);
  CHECK(fmi2DoStep(fmu, 0.02, 0.02, fmi2True) == fmi2OK);
  free(before), free(after);
  fmi2FreeInstance(fmu);
}

int main(int arguments, char *argument[]) {
  if (arguments != 3) return 2;
  open_description(argument[1]);
  resources = argument[2];
  is_plant = strstr(description, "name=\"terrain.kind\"") != NULL;
  steps_that_do_not_fit_are_refused();
  rates_of_inputs_are_checked();
  categories_and_experiments_are_checked();
  instances_that_are_not_offered_are_refused();
  forged_states_are_refused();
  if (is_plant) {
    derivatives_of_other_variables_are_refused();
    states_that_are_none_are_refused();
    robots_that_cannot_be_are_refused();
    grids_that_are_not_there_are_refused();
    a_state_on_a_grid_returns_to_it();
    places_that_are_not_given_are_not_needed();
    the_time_is_a_number_that_steps_move();
  } else {
    a_component_without_states_offers_no_derivatives();
    a_component_without_states_has_no_events();
    each_parameter_of_the_gait_changes_a_walk_that_is_under_way();
    a_gait_faster_than_the_controller_is_refused_by_the_next_step();
  }
  return failures != 0;
}
