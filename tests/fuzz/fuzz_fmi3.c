/* fuzz_fmi3.c - bytes are a sequence of calls of FMI 3.0 on two instances of one component. */
#include "fuzz.h"

#include "fmi3Functions.h"

enum { MOST_ARRAYS = 6, MOST_ROWS = 400 };

static void ignore(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                   fmi3String text) {
  (void)environment, (void)status, (void)category;
  REQUIRE(text && strlen(text) < HX_LOG_SIZE);
}

/* ---- modes ---- */

static int enter(Session *s) {
  const bool defined = pick(&s->in, 2);
  const double tolerance = take_real(&s->in), start = take_real(&s->in), stop = take_real(&s->in);
  return fmi3EnterInitializationMode(present(s), defined, tolerance, start, defined, stop);
}

static int leave(Session *s) { return fmi3ExitInitializationMode(present(s)); }
static int terminate(Session *s) { return fmi3Terminate(present(s)); }
static int reset(Session *s) { return fmi3Reset(present(s)); }
static int enter_event(Session *s) { return fmi3EnterEventMode(present(s)); }
static int enter_continuous(Session *s) { return fmi3EnterContinuousTimeMode(present(s)); }
static int enter_step(Session *s) { return fmi3EnterStepMode(present(s)); }

static int change_instance(Session *s) {
  s->at = (s->at + 1) % INSTANCES;
  return STATUS_OK;
}

static int initialize(Session *s) {
  fmi3Reset(present(s));
  fmi3EnterInitializationMode(present(s), false, 0.0, 0.0, false, 0.0);
  const fmi3Status status = fmi3ExitInitializationMode(present(s));
  REQUIRE(status == fmi3OK);
  fmi3EnterStepMode(present(s)); /* refused without event mode */
  return status;
}

/* ---- values ---- */

/* Returns the number of elements of n arrays; unknown references count as one. */
static size_t elements(const unsigned reference[], size_t n) {
  size_t sum = 0;
  for (size_t i = 0; i < n; i++) {
    hxCausality causality;
    const hxVariable *variable = hx_variable_find(reference[i], &causality);
    sum += variable && variable->array_rows ? variable->array_rows : 1;
  }
  return sum;
}

/* Returns the length to state for n arrays: mostly the right one. */
static size_t take_length(Input *in, const unsigned reference[], size_t n) {
  return take(in) > 245 ? pick(in, MOST_ROWS) : elements(reference, n);
}

/* Returns n values, to be freed by the caller. The first ones belong to references. */
static double *take_row(Input *in, const unsigned reference[], size_t n_reference, size_t n) {
  double *value = room(n, sizeof *value);
  for (size_t i = 0; i < n; i++)
    value[i] = i < n_reference ? take_value(in, reference[i]) : take_real(in);
  return value;
}

static int get_reals(Session *s) {
  const size_t n = pick(&s->in, MOST_ARRAYS);
  unsigned *reference = take_references(&s->in, n);
  const size_t length = take_length(&s->in, reference, n);
  double *value = room(length, sizeof *value);
  const fmi3Status status = fmi3GetFloat64(present(s), reference, n, value, length);
  for (size_t i = 0; i < length && status == fmi3OK; i++) REQUIRE(isfinite(value[i]));
  free(value);
  free(reference);
  return status;
}

static int set_reals(Session *s) {
  const size_t n = pick(&s->in, MOST_ARRAYS);
  unsigned *reference = take_references(&s->in, n);
  const size_t length = take_length(&s->in, reference, n);
  double *value = take_row(&s->in, reference, n, length);
  const fmi3Status status = fmi3SetFloat64(present(s), reference, n, value, length);
  free(value);
  free(reference);
  return status;
}

static int integers(Session *s) {
  const unsigned set = pick(&s->in, 2);
  const size_t n = pick(&s->in, MOST_ARRAYS);
  unsigned *reference = take_references(&s->in, n);
  const size_t length = take_length(&s->in, reference, n);
  fmi3Int64 *value = room(length, sizeof *value);
  for (size_t i = 0; i < length; i++)
    value[i] = take(&s->in) > 240 ? INT64_MIN + (fmi3Int64)take(&s->in) : (fmi3Int64)take(&s->in);
  const fmi3Status status = set ? fmi3SetInt64(present(s), reference, n, value, length)
                                : fmi3GetInt64(present(s), reference, n, value, length);
  free(value);
  free(reference);
  return status;
}

static int booleans(Session *s) {
  const unsigned set = pick(&s->in, 2);
  const size_t n = pick(&s->in, MOST_ARRAYS);
  unsigned *reference = take_references(&s->in, n);
  const size_t length = take_length(&s->in, reference, n);
  fmi3Boolean *value = room(length, sizeof *value);
  for (size_t i = 0; i < length; i++) value[i] = take(&s->in) % 2 == 1;
  const fmi3Status status = set ? fmi3SetBoolean(present(s), reference, n, value, length)
                                : fmi3GetBoolean(present(s), reference, n, value, length);
  free(value);
  free(reference);
  return status;
}

static int other_types(Session *s) {
  const unsigned reference = take_reference(&s->in);
  const size_t n = pick(&s->in, 2);
  fmi3Int32 integer = 1;
  fmi3String text = "text";
  fmi3Clock clock = false;
  const unsigned kind = pick(&s->in, 4);
  return kind == 0   ? fmi3SetInt32(present(s), &reference, n, &integer, n)
         : kind == 1 ? fmi3SetString(present(s), &reference, n, &text, n)
         : kind == 2 ? fmi3GetString(present(s), &reference, n, &text, n)
                     : fmi3GetClock(present(s), &reference, n, &clock);
}

/* ---- states ---- */

static int save(Session *s) { return fmi3GetFMUState(present(s), &s->state[pick(&s->in, STATES)]); }

static int restore(Session *s) {
  return fmi3SetFMUState(present(s), s->state[pick(&s->in, STATES)]);
}

static int free_state(Session *s) {
  return fmi3FreeFMUState(present(s), &s->state[pick(&s->in, STATES)]);
}

/* Serializes a state, may damage the bytes, and reads them again. */
static int serialize(Session *s) {
  void **state = &s->state[pick(&s->in, STATES)];
  size_t size = 0;
  if (!*state || fmi3SerializedFMUStateSize(present(s), *state, &size) != fmi3OK) return STATUS_OK;
  fmi3Byte *bytes = room(size, 1);
  fmi3Status status = fmi3SerializeFMUState(present(s), *state, bytes, size);
  const unsigned damage = take(&s->in);
  if (damage > 128)
    bytes[(damage * 7919u + 256 * take(&s->in)) % size] ^= (fmi3Byte)(1 + damage % 64);
  const size_t given = damage % 16 == 15 ? size / 2 : size;
  if (status == fmi3OK) status = fmi3DeserializeFMUState(present(s), bytes, given, state);
  REQUIRE((status == fmi3OK) == (damage <= 128 && given == size));
  free(bytes);
  return status;
}

/* ---- co-simulation ---- */

static fmi3Instance updated; /* that steps */

static int step(Session *s) {
  const double wrong = take(&s->in) > 240 ? take_real(&s->in) : 0.0, t = present_time(s) + wrong;
  fmi3Boolean event, end, early;
  double reached = NAN;
  updated = present(s);
  const fmi3Status status =
      fmi3DoStep(present(s), t, take_step_size(&s->in), true, &event, &end, &early, &reached);
  REQUIRE(status != fmi3OK || reached == present_time(s));
  return status;
}

static int output_rates(Session *s) {
  const size_t n = pick(&s->in, MOST_ARRAYS);
  unsigned *reference = take_references(&s->in, n);
  const size_t length = take_length(&s->in, reference, n);
  double *value = room(length, sizeof *value);
  fmi3Int32 *order = room(n, sizeof *order);
  for (size_t i = 0; i < n; i++) order[i] = take(&s->in) > 240 ? 2 : 1;
  const fmi3Status status =
      fmi3GetOutputDerivatives(present(s), reference, n, order, value, length);
  free(order);
  free(value);
  free(reference);
  return status;
}

/* ---- derivatives and model exchange ---- */

static int directional(Session *s) {
  const size_t n = pick(&s->in, MOST_ARRAYS), m = pick(&s->in, MOST_ARRAYS);
  unsigned *unknown = take_references(&s->in, n), *known = take_references(&s->in, m);
  const size_t rows = take_length(&s->in, unknown, n), columns = take_length(&s->in, known, m);
  double *change = take_row(&s->in, known, m, columns), *result = room(rows, sizeof *result);
  const fmi3Status status = take(&s->in) % 2
                                ? fmi3GetAdjointDerivative(present(s), known, m, unknown, n, change,
                                                           columns, result, rows)
                                : fmi3GetDirectionalDerivative(present(s), unknown, n, known, m,
                                                               change, columns, result, rows);
  free(result);
  free(change);
  free(known);
  free(unknown);
  return status;
}

static int update(Session *s) {
  fmi3Boolean flag[5];
  double next;
  return take(&s->in) > 240
             ? fmi3UpdateDiscreteStates(present(s), NULL, NULL, NULL, NULL, NULL, NULL)
             : fmi3UpdateDiscreteStates(present(s), &flag[0], &flag[1], &flag[2], &flag[3],
                                        &flag[4], &next);
}

static int completed(Session *s) {
  fmi3Boolean event, end;
  return fmi3CompletedIntegratorStep(present(s), true, &event, &end);
}

static int set_time(Session *s) {
  const double wrong = take(&s->in) > 200 ? take_real(&s->in) : 0.001;
  return fmi3SetTime(present(s), present_time(s) + wrong);
}

static int set_states(Session *s) {
  const size_t n = take(&s->in) > 240 ? pick(&s->in, MOST_ROWS) : hx_state_count;
  double *x = room(n, sizeof *x);
  if (n == hx_state_count) fmi3GetContinuousStates(present(s), x, n);
  REQUIRE(hx_instance_save(present(s), &s->before) == HX_OK); /* reading may initialize */
  for (unsigned k = pick(&s->in, 4); k > 0 && n > 0; k--)
    x[pick(&s->in, (unsigned)n)] += take_real(&s->in);
  const fmi3Status status = fmi3SetContinuousStates(present(s), x, n);
  free(x);
  return status;
}

static int get_row(Session *s) {
  const unsigned kind = pick(&s->in, 4);
  const size_t right = kind == 0 ? (hx_continuous ? hx_continuous->indicators : 0) : hx_state_count;
  const size_t n = take(&s->in) > 240 ? pick(&s->in, MOST_ROWS) : right;
  double *row = room(n, sizeof *row);
  const fmi3Status status = kind == 0   ? fmi3GetEventIndicators(present(s), row, n)
                            : kind == 1 ? fmi3GetContinuousStateDerivatives(present(s), row, n)
                            : kind == 2 ? fmi3GetContinuousStates(present(s), row, n)
                                        : fmi3GetNominalsOfContinuousStates(present(s), row, n);
  free(row);
  return status;
}

/* ---- functions that are not offered, wrong pointers, log ---- */

static int not_offered(Session *s) {
  size_t n;
  REQUIRE(fmi3EnterConfigurationMode(present(s)) == fmi3Error);
  REQUIRE(fmi3EvaluateDiscreteStates(present(s)) == fmi3Error);
  return fmi3GetNumberOfVariableDependencies(present(s), take_reference(&s->in), &n);
}

static int nothing(Session *s) {
  const size_t n = 1 + pick(&s->in, 2);
  fmi3GetDirectionalDerivative(present(s), NULL, n, NULL, n, NULL, n, NULL, n);
  fmi3GetAdjointDerivative(present(s), NULL, n, NULL, n, NULL, n, NULL, n);
  fmi3GetOutputDerivatives(present(s), NULL, n, NULL, NULL, n);
  fmi3SetContinuousStates(present(s), NULL, hx_state_count + 1);
  fmi3GetFMUState(present(s), NULL);
  fmi3DeserializeFMUState(present(s), NULL, n, NULL);
  REQUIRE(fmi3GetFloat64(NULL, NULL, n, NULL, n) == fmi3Error);
  return fmi3SetFloat64(present(s), NULL, n, NULL, n);
}

static int log_all(Session *s) {
  const fmi3String category[2] = {hx_log_category_names[pick(&s->in, HX_LOG_CATEGORIES)], "wrong"};
  return fmi3SetDebugLogging(present(s), pick(&s->in, 2), pick(&s->in, 3), category);
}

static callFunction *const call[] = {enter,
                                     leave,
                                     initialize,
                                     initialize,
                                     terminate,
                                     reset,
                                     enter_event,
                                     enter_step,
                                     enter_continuous,
                                     change_instance,
                                     get_reals,
                                     get_reals,
                                     set_reals,
                                     set_reals,
                                     integers,
                                     booleans,
                                     other_types,
                                     save,
                                     restore,
                                     free_state,
                                     serialize,
                                     step,
                                     step,
                                     step,
                                     step,
                                     output_rates,
                                     directional,
                                     update,
                                     completed,
                                     set_time,
                                     set_states,
                                     get_row,
                                     not_offered,
                                     nothing,
                                     log_all};

/* An importer that reads, sets an input and asks to return early, now and then. */
static void intermediate(fmi3InstanceEnvironment environment, double time, bool settable,
                         bool readable, bool finished, bool can_return, bool *requested,
                         double *early) {
  static unsigned calls;
  const unsigned first = 0; /* an input of every component */
  const size_t n = elements(&first, 1);
  double *value = room(n, sizeof *value);
  (void)environment, (void)settable, (void)readable, (void)finished;
  *requested = can_return && ++calls % 3 == 0;
  *early = time + 1e-4 * (calls % 5);
  REQUIRE(fmi3GetFloat64(updated, &first, 1, value, n) == fmi3OK);
  REQUIRE(fmi3SetFloat64(updated, &first, 1, value, n) == fmi3OK);
  REQUIRE(fmi3Terminate(updated) == fmi3Error);
  free(value);
}

static fmi3Instance opened(unsigned kind) {
  return kind % 2 && hx_continuous
             ? fmi3InstantiateModelExchange("fuzz", hx_default_guid, NULL, false, false, NULL,
                                            ignore)
             : fmi3InstantiateCoSimulation("fuzz", hx_default_guid, NULL, false, false, kind & 2,
                                           kind & 4, NULL, 0, NULL, ignore,
                                           kind & 8 ? intermediate : NULL);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  Session s = {.in = {data, size, 0}};
  const unsigned kind = take(&s.in);
  for (unsigned k = 0; k < INSTANCES; k++) {
    s.instance[k] = opened(k == 0 ? kind : kind ^ (kind >> 4 & 6));
    REQUIRE(s.instance[k]);
  }
  run_calls(&s, call, sizeof call / sizeof *call);
  for (int k = 0; k < INSTANCES; k++) fmi3FreeInstance(s.instance[k]);
  end_session(&s);
  return 0;
}
