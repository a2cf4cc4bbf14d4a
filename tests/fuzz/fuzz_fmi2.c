/* fuzz_fmi2.c - bytes are a sequence of calls of FMI 2.0 on two instances of one component. */
#include "fuzz.h"

#include "fmi2Functions.h"

enum { MOST_VALUES = 12, MOST_ROWS = 400 };

static void ignore(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                   fmi2String category, fmi2String text, ...) {
  (void)environment, (void)name, (void)status, (void)category;
  REQUIRE(text && strlen(text) < 2 * HX_LOG_SIZE);
}

static const fmi2CallbackFunctions callbacks = {ignore, calloc, free, NULL, NULL};

/* ---- modes ---- */

static int set_up(Session *s) {
  const int defined = (int)pick(&s->in, 2);
  const double tolerance = take_real(&s->in), start = take_real(&s->in), stop = take_real(&s->in);
  return fmi2SetupExperiment(present(s), defined, tolerance, start, defined, stop);
}

static int enter(Session *s) { return fmi2EnterInitializationMode(present(s)); }
static int leave(Session *s) { return fmi2ExitInitializationMode(present(s)); }
static int terminate(Session *s) { return fmi2Terminate(present(s)); }
static int reset(Session *s) { return fmi2Reset(present(s)); }
static int enter_event(Session *s) { return fmi2EnterEventMode(present(s)); }
static int enter_continuous(Session *s) { return fmi2EnterContinuousTimeMode(present(s)); }
static int cancel(Session *s) { return fmi2CancelStep(present(s)); }

static int change_instance(Session *s) {
  s->at = (s->at + 1) % INSTANCES;
  return STATUS_OK;
}

static int initialize(Session *s) {
  fmi2Reset(present(s));
  fmi2EnterInitializationMode(present(s));
  const fmi2Status status = fmi2ExitInitializationMode(present(s));
  REQUIRE(status == fmi2OK);
  return status;
}

/* ---- values ---- */

static int get_reals(Session *s) {
  const size_t n = pick(&s->in, MOST_VALUES);
  unsigned *reference = take_references(&s->in, n);
  double *value = room(n, sizeof *value);
  const fmi2Status status = fmi2GetReal(present(s), reference, n, value);
  for (size_t i = 0; i < n && status == fmi2OK; i++) REQUIRE(isfinite(value[i]));
  free(value);
  free(reference);
  return status;
}

static int set_reals(Session *s) {
  const size_t n = pick(&s->in, MOST_VALUES);
  unsigned *reference = take_references(&s->in, n);
  double *value = take_values(&s->in, reference, n);
  const fmi2Status status = fmi2SetReal(present(s), reference, n, value);
  free(value);
  free(reference);
  return status;
}

static int integers(Session *s) {
  const unsigned kind = pick(&s->in, 4);
  const size_t n = pick(&s->in, MOST_VALUES);
  unsigned *reference = take_references(&s->in, n);
  int *value = room(n, sizeof *value);
  for (size_t i = 0; i < n; i++) value[i] = (int)take(&s->in) - (take(&s->in) > 200 ? 300 : 0);
  const fmi2Status status = kind == 0   ? fmi2GetInteger(present(s), reference, n, value)
                            : kind == 1 ? fmi2SetInteger(present(s), reference, n, value)
                            : kind == 2 ? fmi2GetBoolean(present(s), reference, n, value)
                                        : fmi2SetBoolean(present(s), reference, n, value);
  free(value);
  free(reference);
  return status;
}

static int strings(Session *s) {
  const fmi2String text[1] = {"text"};
  fmi2String got[1] = {NULL};
  const unsigned reference = take_reference(&s->in);
  const size_t n = pick(&s->in, 2);
  return take(&s->in) % 2 ? fmi2SetString(present(s), &reference, n, text)
                          : fmi2GetString(present(s), &reference, n, got);
}

/* ---- states ---- */

static int save(Session *s) { return fmi2GetFMUstate(present(s), &s->state[pick(&s->in, STATES)]); }

static int restore(Session *s) {
  return fmi2SetFMUstate(present(s), s->state[pick(&s->in, STATES)]);
}

static int free_state(Session *s) {
  return fmi2FreeFMUstate(present(s), &s->state[pick(&s->in, STATES)]);
}

/* Serializes a state, may damage the bytes, and reads them again. */
static int serialize(Session *s) {
  void **state = &s->state[pick(&s->in, STATES)];
  size_t size = 0;
  if (!*state || fmi2SerializedFMUstateSize(present(s), *state, &size) != fmi2OK) return STATUS_OK;
  char *bytes = room(size, 1);
  fmi2Status status = fmi2SerializeFMUstate(present(s), *state, bytes, size);
  const unsigned damage = take(&s->in);
  if (damage > 128) bytes[(damage * 7919u + 256 * take(&s->in)) % size] ^= (char)(1 + damage % 64);
  const size_t given = damage % 16 == 15 ? size / 2 : size;
  if (status == fmi2OK) status = fmi2DeSerializeFMUstate(present(s), bytes, given, state);
  REQUIRE((status == fmi2OK) == (damage <= 128 && given == size));
  free(bytes);
  return status;
}

/* ---- co-simulation ---- */

static int step(Session *s) {
  const double wrong = take(&s->in) > 240 ? take_real(&s->in) : 0.0;
  return fmi2DoStep(present(s), present_time(s) + wrong, take_step_size(&s->in), fmi2True);
}

static int rates(Session *s) {
  const int inputs = (int)pick(&s->in, 2);
  const size_t n = pick(&s->in, MOST_VALUES);
  unsigned *reference = take_references(&s->in, n);
  double *value = take_values(&s->in, reference, n);
  int *order = room(n, sizeof *order);
  for (size_t i = 0; i < n; i++) order[i] = take(&s->in) > 240 ? 2 : 1;
  const fmi2Status status =
      inputs ? fmi2SetRealInputDerivatives(present(s), reference, n, order, value)
             : fmi2GetRealOutputDerivatives(present(s), reference, n, order, value);
  free(order);
  free(value);
  free(reference);
  return status;
}

static int ask_status(Session *s) {
  const fmi2StatusKind kind = (fmi2StatusKind)pick(&s->in, 4);
  fmi2Status status;
  fmi2Real real;
  fmi2Integer integer;
  fmi2Boolean boolean;
  fmi2String text;
  const int first = fmi2GetStatus(present(s), kind, &status);
  const int second = fmi2GetRealStatus(present(s), kind, &real);
  fmi2GetIntegerStatus(present(s), kind, &integer);
  fmi2GetBooleanStatus(present(s), kind, &boolean);
  fmi2GetStringStatus(present(s), kind, &text);
  return first > second ? first : second;
}

/* ---- derivatives and model exchange ---- */

static int directional(Session *s) {
  const size_t n = pick(&s->in, MOST_VALUES), m = pick(&s->in, MOST_VALUES);
  unsigned *unknown = take_references(&s->in, n), *known = take_references(&s->in, m);
  double *change = take_values(&s->in, known, m), *result = room(n, sizeof *result);
  const fmi2Status status =
      fmi2GetDirectionalDerivative(present(s), unknown, n, known, m, change, result);
  free(result);
  free(change);
  free(known);
  free(unknown);
  return status;
}

static int update(Session *s) {
  fmi2EventInfo info;
  return fmi2NewDiscreteStates(present(s), &info);
}

static int completed(Session *s) {
  fmi2Boolean event, end;
  return fmi2CompletedIntegratorStep(present(s), fmi2True, &event, &end);
}

static int set_time(Session *s) {
  const double wrong = take(&s->in) > 200 ? take_real(&s->in) : 0.001;
  return fmi2SetTime(present(s), present_time(s) + wrong);
}

static int set_states(Session *s) {
  const size_t n = take(&s->in) > 240 ? pick(&s->in, MOST_ROWS) : hx_state_count;
  double *x = room(n, sizeof *x);
  if (n == hx_state_count) fmi2GetContinuousStates(present(s), x, n);
  REQUIRE(hx_instance_save(present(s), &s->before) == HX_OK); /* reading may initialize */
  for (unsigned k = pick(&s->in, 4); k > 0 && n > 0; k--)
    x[pick(&s->in, (unsigned)n)] += take_real(&s->in);
  const fmi2Status status = fmi2SetContinuousStates(present(s), x, n);
  free(x);
  return status;
}

static int get_row(Session *s) {
  const unsigned kind = pick(&s->in, 4);
  const size_t right = kind == 0 ? (hx_continuous ? hx_continuous->indicators : 0) : hx_state_count;
  const size_t n = take(&s->in) > 240 ? pick(&s->in, MOST_ROWS) : right;
  double *row = room(n, sizeof *row);
  const fmi2Status status = kind == 0   ? fmi2GetEventIndicators(present(s), row, n)
                            : kind == 1 ? fmi2GetDerivatives(present(s), row, n)
                            : kind == 2 ? fmi2GetContinuousStates(present(s), row, n)
                                        : fmi2GetNominalsOfContinuousStates(present(s), row, n);
  free(row);
  return status;
}

/* ---- wrong pointers, log ---- */

static int nothing(Session *s) {
  const size_t n = pick(&s->in, 3);
  fmi2SetRealInputDerivatives(present(s), NULL, n, NULL, NULL);
  fmi2GetDirectionalDerivative(present(s), NULL, n, NULL, n, NULL, NULL);
  fmi2SetContinuousStates(present(s), NULL, hx_state_count);
  fmi2GetFMUstate(present(s), NULL);
  fmi2DeSerializeFMUstate(present(s), NULL, n, NULL);
  REQUIRE(fmi2GetReal(NULL, NULL, n, NULL) == fmi2Error);
  REQUIRE(n == 0 || fmi2GetReal(present(s), NULL, n, NULL) == fmi2Error);
  return n == 0 ? STATUS_OK : fmi2SetReal(present(s), NULL, n, NULL);
}

static int log_all(Session *s) {
  const fmi2String category[2] = {hx_log_category_names[pick(&s->in, HX_LOG_CATEGORIES)], "wrong"};
  return fmi2SetDebugLogging(present(s), (int)pick(&s->in, 2), pick(&s->in, 3), category);
}

static callFunction *const call[] = {set_up,
                                     enter,
                                     leave,
                                     initialize,
                                     initialize,
                                     terminate,
                                     reset,
                                     enter_event,
                                     enter_continuous,
                                     change_instance,
                                     get_reals,
                                     get_reals,
                                     set_reals,
                                     set_reals,
                                     integers,
                                     strings,
                                     save,
                                     restore,
                                     free_state,
                                     serialize,
                                     step,
                                     step,
                                     step,
                                     step,
                                     rates,
                                     ask_status,
                                     directional,
                                     update,
                                     completed,
                                     set_time,
                                     set_states,
                                     get_row,
                                     nothing,
                                     log_all,
                                     cancel};

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  Session s = {.in = {data, size, 0}};
  const fmi2Type type = take(&s.in) % 2 && hx_continuous ? fmi2ModelExchange : fmi2CoSimulation;
  for (int k = 0; k < INSTANCES; k++) {
    s.instance[k] = fmi2Instantiate("fuzz", type, hx_default_guid, NULL, &callbacks, 0, 0);
    REQUIRE(s.instance[k]);
  }
  run_calls(&s, call, sizeof call / sizeof *call);
  for (int k = 0; k < INSTANCES; k++) fmi2FreeInstance(s.instance[k]);
  end_session(&s);
  return 0;
}
