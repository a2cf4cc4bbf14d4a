/* repeater.c - loads an FMU's binary, drives it with recorded inputs and prints its outputs bit by
 * bit.
 *
 * usage: repeater LIBRARY GUID RESOURCES INPUTS
 * INPUTS contains, separated by spaces: number of inputs and their references, number of outputs
 * and theirs, number of steps, step size, then the inputs of each step; Reals as 64-bit patterns in
 * hexadecimal. Prints a line of such patterns for each step. Exits with 0 when every call
 * succeeded.
 */
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

typedef void Function(void);

#ifdef _WIN32
#include <windows.h>
static void *load(const char *path) {
  static wchar_t wide[4096];
  return MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, 4096) ? (void *)LoadLibraryW(wide) : NULL;
}
static Function *find(void *library, const char *name) {
  return (Function *)GetProcAddress((HMODULE)library, name);
}
#else
#include <dlfcn.h>
static void *load(const char *path) {
  void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  if (!library) fprintf(stderr, "%s\n", dlerror());
  return library;
}
static Function *find(void *library, const char *name) {
  void *address = dlsym(library, name);
  Function *function;
  memcpy(&function, &address, sizeof function); /* POSIX allows it; ISO C has no such cast */
  return function;
}
#endif

static void log_line(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                     fmi2String category, fmi2String text, ...) {
  (void)environment, (void)category;
  fprintf(stderr, "%s: status %d: %s\n", name, (int)status, text);
}

static int fail(const char *what) {
  fprintf(stderr, "repeater: %s\n", what);
  return 1;
}

static double bits_to_real(uint64_t bits) {
  double value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

static int read_real(FILE *file, double *value) {
  uint64_t bits;
  if (fscanf(file, "%" SCNx64, &bits) != 1) return 0;
  *value = bits_to_real(bits);
  return 1;
}

static void print_reals(const double *value, size_t n) {
  for (size_t i = 0; i < n; i++) {
    uint64_t bits;
    memcpy(&bits, &value[i], sizeof bits);
    printf("%016" PRIx64 "%c", bits, i + 1 < n ? ' ' : '\n');
  }
}

enum { MOST = 2000 };

/* Returns the number of references, 0 if they are damaged. */
static unsigned read_references(FILE *file, fmi2ValueReference reference[MOST]) {
  unsigned n;
  if (fscanf(file, "%u", &n) != 1 || n > MOST) return 0;
  for (unsigned i = 0; i < n; i++)
    if (fscanf(file, "%u", &reference[i]) != 1) return 0;
  return n;
}

/* Replays the recorded steps; returns 0 on success. */
static int walk(void *library, fmi2Component plant, FILE *inputs) {
  static fmi2ValueReference in[MOST], out[MOST];
  static double given[MOST], seen[MOST];
  fmi2SetRealTYPE *set = (fmi2SetRealTYPE *)find(library, "fmi2SetReal");
  fmi2GetRealTYPE *get = (fmi2GetRealTYPE *)find(library, "fmi2GetReal");
  fmi2DoStepTYPE *step = (fmi2DoStepTYPE *)find(library, "fmi2DoStep");
  const unsigned n_in = read_references(inputs, in), n_out = read_references(inputs, out);
  unsigned steps;
  double h;
  if (!n_in || !n_out || fscanf(inputs, "%u", &steps) != 1 || !read_real(inputs, &h))
    return fail("inputs");
  for (unsigned k = 0; k < steps; k++) {
    for (unsigned i = 0; i < n_in; i++)
      if (!read_real(inputs, &given[i])) return fail("inputs end early");
    if (set(plant, in, n_in, given) != fmi2OK || step(plant, k * h, h, fmi2True) != fmi2OK)
      return fail("step");
    if (get(plant, out, n_out, seen) != fmi2OK) return fail("outputs");
    print_reals(seen, n_out);
  }
  return 0;
}

static int run(void *library, const char *guid, const char *resources, FILE *inputs) {
  static const fmi2CallbackFunctions callbacks = {log_line, calloc, free, NULL, NULL};
  fmi2InstantiateTYPE *instantiate = (fmi2InstantiateTYPE *)find(library, "fmi2Instantiate");
  fmi2SetupExperimentTYPE *setup = (fmi2SetupExperimentTYPE *)find(library, "fmi2SetupExperiment");
  fmi2EnterInitializationModeTYPE *enter =
      (fmi2EnterInitializationModeTYPE *)find(library, "fmi2EnterInitializationMode");
  fmi2ExitInitializationModeTYPE *leave =
      (fmi2ExitInitializationModeTYPE *)find(library, "fmi2ExitInitializationMode");
  fmi2TerminateTYPE *terminate = (fmi2TerminateTYPE *)find(library, "fmi2Terminate");
  fmi2FreeInstanceTYPE *release = (fmi2FreeInstanceTYPE *)find(library, "fmi2FreeInstance");
  if (!instantiate || !setup || !enter || !leave || !terminate || !release)
    return fail("a function is missing");
  fmi2Component plant =
      instantiate("plant", fmi2CoSimulation, guid, resources, &callbacks, fmi2False, fmi2False);
  if (!plant) return fail("not instantiated");
  if (setup(plant, fmi2False, 0.0, 0.0, fmi2False, 0.0) != fmi2OK || enter(plant) != fmi2OK ||
      leave(plant) != fmi2OK)
    return fail("not initialised");
  const int failed = walk(library, plant, inputs);
  terminate(plant);
  release(plant);
  return failed;
}

int main(int argc, char **argv) {
  if (argc != 5) return fail("usage: repeater LIBRARY GUID RESOURCES INPUTS");
  void *library = load(argv[1]);
  FILE *inputs = fopen(argv[4], "r");
  if (!library || !inputs) return fail(library ? "no inputs" : "library not loaded");
  return run(library, argv[2], argv[3], inputs);
}
