/* fuzz_states.c - bytes are changes of a serialized state, which another instance then restores.
 *
 * Without a new checksum each change must be refused. With one, as nobody but a forger writes it,
 * the component may refuse the state or continue from it.
 */
#include "fuzz.h"

#include "fmi2Functions.h"

enum { CHECKSUM_AT = 16, HEADER_SIZE = 24 + HX_GUID_SIZE, MOST_EDITS = 16 };

static void ignore(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                   fmi2String category, fmi2String text, ...) {
  (void)environment, (void)name, (void)status, (void)category, (void)text;
}

static const fmi2CallbackFunctions callbacks = {ignore, calloc, free, NULL, NULL};

static fmi2Component opened(void) {
  fmi2Component fmu =
      fmi2Instantiate("fuzz", fmi2CoSimulation, hx_default_guid, NULL, &callbacks, 0, 0);
  REQUIRE(fmu);
  return fmu;
}

/* Returns the bytes of the state of an instance that has made steps. */
static char *valid_bytes(size_t *size) {
  fmi2FMUstate state = NULL;
  fmi2Component fmu = opened();
  fmi2EnterInitializationMode(fmu);
  fmi2ExitInitializationMode(fmu);
  for (int k = 0; k < 4; k++) REQUIRE(fmi2DoStep(fmu, 0.02 * k, 0.02, fmi2True) == fmi2OK);
  REQUIRE(fmi2GetFMUstate(fmu, &state) == fmi2OK);
  REQUIRE(fmi2SerializedFMUstateSize(fmu, state, size) == fmi2OK);
  char *bytes = room(*size, 1);
  REQUIRE(fmi2SerializeFMUstate(fmu, state, bytes, *size) == fmi2OK);
  fmi2FreeFMUstate(fmu, &state);
  fmi2FreeInstance(fmu);
  return bytes;
}

/* Changes bytes or whole numbers. Returns whether anything changed. */
static int change(Input *in, char *bytes, size_t size) {
  char *before = room(size, 1);
  memcpy(before, bytes, size);
  for (unsigned k = pick(in, MOST_EDITS); k > 0; k--) {
    const size_t at = pick(in, 65536) + (take(in) % 4) * 65536u;
    if (take(in) % 2)
      bytes[at % size] = (char)take(in);
    else {
      const double value = take_real(in);
      memcpy(bytes + 8 * (at % (size / 8)), &value, sizeof value);
    }
  }
  const int changed = memcmp(before, bytes, size) != 0;
  free(before);
  return changed;
}

static void continue_from(fmi2Component fmu, fmi2FMUstate state) {
  static const unsigned first[] = {0, 1};
  double value[2];
  if (fmi2SetFMUstate(fmu, state) != fmi2OK) return;
  const double t = hx_instance_time(fmu);
  fmi2DoStep(fmu, t, 0.001, fmi2True);
  fmi2GetReal(fmu, first, 2, value);
  const unsigned output = hx_sections[HX_OUTPUT].first;
  fmi2GetReal(fmu, &output, 1, value);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  static char *valid;
  static size_t n;
  Input in = {data, size, 0};
  if (!valid) valid = valid_bytes(&n);
  char *bytes = room(n, 1);
  memcpy(bytes, valid, n);
  const unsigned kind = take(&in);
  const int changed = change(&in, bytes, n), forged = kind % 2;
  const size_t given = kind > 250 ? pick(&in, 65536) % n : n;
  if (forged) {
    const uint64_t checksum = hx_checksum(0, bytes + HEADER_SIZE, n - HEADER_SIZE);
    memcpy(bytes + CHECKSUM_AT, &checksum, sizeof checksum);
  }
  fmi2Component fmu = opened();
  fmi2FMUstate state = NULL;
  char *exact = room(given, 1);
  memcpy(exact, bytes, given);
  const fmi2Status status = fmi2DeSerializeFMUstate(fmu, exact, given, &state);
  REQUIRE(forged || (status == fmi2OK) == (!changed && given == n));
  if (status == fmi2OK) continue_from(fmu, state);
  fmi2FreeFMUstate(fmu, &state);
  fmi2FreeInstance(fmu);
  free(exact);
  free(bytes);
  return 0;
}
