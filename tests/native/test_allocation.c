/* test_allocation.c - a component through FMI 2.0 and 3.0 while each allocation in turn fails: no
 * crash, no leak, a status that says so, and an instance that goes on. Linked with
 * -Wl,--wrap=malloc and so on.
 *
 * usage: test_allocation modelDescription.xml RESOURCES
 * RESOURCES: path of a folder with start_values.txt, and for the plant terrain/1.terrain
 */
#include <stdarg.h>

#include "fmi2Functions.h"
#include "fmi3Functions.h"

#include "check.h"
#include "description.h"

#if defined(__clang__)
#pragma clang diagnostic ignored "-Wreserved-identifier" /* the linker's names */
#endif

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void __real_free(void *memory);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void __wrap_free(void *memory);

static long allocations, failing, alive; /* since arm(); the one that fails, 0: none; not freed */
static size_t largest;                   /* bytes of the largest allocation */
static char logged[4096];                /* last message */

/* Starts counting; the n-th allocation from now on fails, or none (0). */
static void arm(long n) { allocations = 0, failing = n, alive = 0; }

static int fails(size_t size) {
  if (size > largest) largest = size;
  return ++allocations == failing;
}

void *__wrap_malloc(size_t size) {
  if (fails(size)) return NULL;
  ++alive;
  return __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size) {
  if (fails(count * size)) return NULL;
  ++alive;
  return __real_calloc(count, size);
}

void __wrap_free(void *memory) {
  if (memory) --alive;
  __real_free(memory);
}

static void keep(const char *text) { snprintf(logged, sizeof logged, "%s", text); }

static void log_two(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                    fmi2String category, fmi2String text, ...) {
  (void)environment, (void)name, (void)status, (void)category;
  keep(text);
}

static void log_three(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                      fmi3String text) {
  (void)environment, (void)status, (void)category;
  keep(text);
}

/* Returns whether a call succeeded; a failure needs an allocation that failed, and says so, except
 * where there was nobody to tell yet. */
static int went_well(int succeeded) {
  if (succeeded) return 1;
  CHECK(failing > 0 && allocations >= failing);
  CHECK(strstr(logged, "out of memory") != NULL);
  return 0;
}

static int is_plant;
static const char *resources;

/* ---- FMI 2.0 ---- */

/* Sets the ground to the grid of the resources. */
static void choose_grid(fmi2Component fmu) {
  const fmi2ValueReference kind = reference_of("terrain.kind"), grid = reference_of("terrain.grid"),
                           position = reference_of("initial.position[3]");
  const fmi2Integer is_grid = 3;
  const fmi2Real number = 1.0, height = 0.5;
  CHECK(fmi2SetInteger(fmu, &kind, 1, &is_grid) == fmi2OK);
  CHECK(fmi2SetReal(fmu, &grid, 1, &number) == fmi2OK);
  CHECK(fmi2SetReal(fmu, &position, 1, &height) == fmi2OK);
}

/* Initialises, once more where memory was short. Returns whether it is initialised. */
static void initialise_two(fmi2Component fmu) {
  CHECK(fmi2SetupExperiment(fmu, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK);
  CHECK(fmi2EnterInitializationMode(fmu) == fmi2OK);
  if (went_well(fmi2ExitInitializationMode(fmu) == fmi2OK)) return;
  CHECK(fmi2Reset(fmu) == fmi2OK);
  if (is_plant) choose_grid(fmu);
  CHECK(fmi2SetupExperiment(fmu, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK);
  CHECK(fmi2EnterInitializationMode(fmu) == fmi2OK && fmi2ExitInitializationMode(fmu) == fmi2OK);
}

/* Saves, serialises and restores. */
static void restore_two(fmi2Component fmu) {
  static fmi2Byte bytes[1 << 20];
  fmi2FMUstate saved = NULL, copy = NULL;
  size_t size = 0;
  if (!went_well(fmi2GetFMUstate(fmu, &saved) == fmi2OK)) CHECK(!saved);
  if (saved) {
    CHECK(fmi2SerializedFMUstateSize(fmu, saved, &size) == fmi2OK && size <= sizeof bytes);
    CHECK(fmi2SerializeFMUstate(fmu, saved, bytes, size) == fmi2OK);
    if (went_well(fmi2DeSerializeFMUstate(fmu, bytes, size, &copy) == fmi2OK))
      CHECK(fmi2SetFMUstate(fmu, copy) == fmi2OK);
    CHECK(fmi2FreeFMUstate(fmu, &saved) == fmi2OK);
  }
  CHECK(fmi2FreeFMUstate(fmu, &copy) == fmi2OK);
}

static void walk_two(long n) {
  static const fmi2CallbackFunctions callbacks = {log_two, calloc, free, NULL, NULL};
  logged[0] = '\0';
  arm(n);
  fmi2Component fmu =
      fmi2Instantiate("robot", fmi2CoSimulation, guid, resources, &callbacks, fmi2False, fmi2False);
  if (!fmu) CHECK(n > 0 && allocations >= n);
  if (fmu) {
    if (is_plant) choose_grid(fmu);
    initialise_two(fmu);
    CHECK(fmi2DoStep(fmu, 0.0, 0.02, fmi2True) == fmi2OK);
    restore_two(fmu);
    CHECK(fmi2DoStep(fmu, 0.02, 0.02, fmi2True) == fmi2OK);
    fmi2FreeInstance(fmu);
  }
  CHECK(alive == 0);
}

/* ---- FMI 3.0 ---- */

static void derive_three(fmi3Instance fmu) {
  const fmi3ValueReference unknown = reference_of("LF.foot.normal_force"),
                           known = reference_of("torso.push_force[1]");
  const fmi3Float64 change[3] = {1.0, 0.0, 0.0};
  fmi3Float64 derivative[6];
  went_well(fmi3GetDirectionalDerivative(fmu, &unknown, 1, &known, 1, change, 3, derivative, 6) ==
            fmi3OK);
}

static void update(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set_requested,
                   fmi3Boolean get_allowed, fmi3Boolean finished, fmi3Boolean can_return,
                   fmi3Boolean *requested, fmi3Float64 *early) {
  (void)environment, (void)set_requested, (void)get_allowed, (void)finished, (void)can_return;
  *requested = fmi3False;
  *early = time;
}

static void walk_three(long n) {
  fmi3Boolean event, terminate, early;
  fmi3Float64 last;
  fmi3FMUState saved = NULL;
  logged[0] = '\0';
  arm(n);
  fmi3Instance fmu =
      fmi3InstantiateCoSimulation("robot", guid, resources, fmi3False, fmi3False, fmi3False,
                                  fmi3False, NULL, 0, NULL, log_three, update);
  if (!fmu) CHECK(n > 0 && allocations >= n);
  if (fmu) {
    CHECK(fmi3EnterInitializationMode(fmu, fmi3False, 0.0, 0.0, fmi3False, 0.0) == fmi3OK);
    CHECK(fmi3ExitInitializationMode(fmu) == fmi3OK);
    if (is_plant) derive_three(fmu);
    if (!went_well(fmi3GetFMUState(fmu, &saved) == fmi3OK)) CHECK(!saved);
    CHECK(fmi3FreeFMUState(fmu, &saved) == fmi3OK);
    CHECK(fmi3DoStep(fmu, 0.0, 0.02, fmi3True, &event, &terminate, &early, &last) == fmi3OK);
    fmi3FreeInstance(fmu);
  }
  CHECK(alive == 0);
}

/* Lets each allocation of a walk fail; returns how many there are. */
static long fail_each(void (*walk)(long)) {
  walk(0);
  const long count = allocations;
  for (long n = 1; n <= count; ++n) walk(n);
  return count;
}

int main(int count, char **arguments) {
  if (count != 3) return EXIT_FAILURE;
  open_description(arguments[1]);
  resources = arguments[2];
  is_plant = strstr(description, "name=\"terrain.kind\"") != NULL;
  const long two = fail_each(walk_two), three = fail_each(walk_three);
  printf("allocations: FMI 2.0 %ld, FMI 3.0 %ld; largest %zu B\n", two, three, largest);
  CHECK(two >= 7 && three >= 6);
  CHECK(largest < 350000); /* the plant with its work space, docs/architecture.md */
  return failures;
}
