/* fuzz.h - what the fuzz targets share: bytes are decoded to numbers, value references and calls.
 *
 * A target is linked with a whole component, so that it may read the table of variables. Every
 * array that is passed to the component has exactly its stated length and lies on the heap, so that
 * the address sanitizer finds each access beyond it. A violated rule aborts.
 */
#ifndef HEXAPOD_TESTS_FUZZ_H
#define HEXAPOD_TESTS_FUZZ_H

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi/instance.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define REQUIRE(condition)                                                                         \
  do {                                                                                             \
    if (!(condition)) {                                                                            \
      fprintf(stderr, "%s:%d: violated: %s\n", __FILE__, __LINE__, #condition);                    \
      abort();                                                                                     \
    }                                                                                              \
  } while (0)

typedef struct Input {
  const uint8_t *data;
  size_t size, at;
} Input;

/* Returns the next byte; 0 after the last one. */
static inline unsigned take(Input *in) { return in->at < in->size ? in->data[in->at++] : 0; }

/* Returns a number below n. */
static inline unsigned pick(Input *in, unsigned n) {
  const unsigned low = take(in);
  return (n > 256 ? low + 256 * take(in) : low) % n;
}

/* Returns a number: a special one, a small one, or any 8 bytes. */
static inline double take_real(Input *in) {
  static const double special[] = {0.0,    -0.0,   1.0,      -1.0,      1e-9, 1e-3, 1e9, 1e300,
                                   -1e300, 5e-324, INFINITY, -INFINITY, NAN,  1e-4, 0.5, 3.0};
  const unsigned kind = take(in);
  if (kind < 48) return special[kind % (sizeof special / sizeof *special)];
  if (kind < 208) return ((int)take(in) - 128) * ldexp(1.0, (int)(kind % 16) - 10);
  double value = 0.0;
  unsigned char bytes[sizeof value];
  for (size_t i = 0; i < sizeof value; i++) bytes[i] = (unsigned char)take(in);
  memcpy(&value, bytes, sizeof value);
  return value;
}

/* Returns room for n elements of a size, to be freed by the caller. */
static inline void *room(size_t n, size_t size) {
  void *place = malloc(n * size > 0 ? n * size : 1);
  REQUIRE(place);
  memset(place, 0, n * size);
  return place;
}

/* Returns a value reference: mostly one of a causality, else any. */
static inline unsigned take_reference(Input *in) {
  const unsigned kind = take(in);
  const hxSection *section = &hx_sections[kind % HX_CAUSALITIES];
  if (kind >= 240) return kind * 16777259u + take(in);
  if (kind >= 236 || section->count == 0) return hx_time_reference;
  return section->first + pick(in, section->count);
}

/* Returns n references, to be freed by the caller. */
static inline unsigned *take_references(Input *in, size_t n) {
  unsigned *reference = room(n, sizeof *reference);
  for (size_t i = 0; i < n; i++) reference[i] = take_reference(in);
  return reference;
}

/* Returns a value for a variable: mostly near its default, else any. */
static inline double take_value(Input *in, unsigned reference) {
  struct hxVariables defaults;
  hxCausality causality;
  const hxVariable *variable = hx_variable_find(reference, &causality);
  if (take(in) % 4 == 0 || !variable || variable->type != HX_REAL) return take_real(in);
  memset(&defaults, 0, sizeof defaults);
  hx_component_defaults(&defaults);
  const double value = *hx_variable_place(&defaults, variable);
  return value * (1.0 + ((int)take(in) - 128) / 512.0);
}

/* Returns n values for n references, to be freed by the caller. */
static inline double *take_values(Input *in, const unsigned reference[], size_t n) {
  double *value = room(n, sizeof *value);
  for (size_t i = 0; i < n; i++) value[i] = take_value(in, reference[i]);
  return value;
}

/* Returns a step size [s]; legal ones are at most 0.02 s, so that an input takes little time. */
static inline double take_step_size(Input *in) {
  static const double size[] = {1e-9, 1e-4, 0.001, 0.005, 0.02, 1.0 / 60.0};
  const unsigned kind = take(in);
  const double h = kind < 200 ? size[kind % 6] : take_real(in);
  return h > 0.02 && h <= 100.0 ? 0.02 : h;
}

/* ---- sessions: two instances, saved states, a sequence of calls ---- */

enum { INSTANCES = 2, STATES = 3, MOST_CALLS = 40 };

typedef struct Session {
  Input in;
  void *instance[INSTANCES];
  void *state[STATES];
  void *before; /* the present instance's state before a call */
  void *after;
  unsigned at; /* the present instance */
} Session;

static inline void *present(const Session *s) { return s->instance[s->at]; }

static inline double present_time(const Session *s) { return hx_instance_time(present(s)); }

/* Makes one call and returns its status, as the standard numbers it. */
typedef int callFunction(Session *s);

enum { STATUS_OK, STATUS_WARNING, STATUS_DISCARD, STATUS_ERROR };

/* Ends the process when a refused call has changed the state; says which call and which byte. */
static inline void require_same_state(const Session *s, unsigned call, int status) {
  const unsigned char *before = s->before, *after = s->after;
  const size_t n = hx_instance_state_size();
  size_t i = 0;
  while (i < n && before[i] == after[i]) i++;
  if (i == n) return;
  fprintf(stderr,
          "violated: call %u was refused with status %d and changed byte %zu of the state\n", call,
          status, i);
  abort();
}

/* Makes the calls that the input names. A call that is refused must not change the state. */
static inline void run_calls(Session *s, callFunction *const call[], unsigned n) {
  for (int k = 0; k < MOST_CALLS && s->in.at < s->in.size; k++) {
    const unsigned chosen = pick(&s->in, n);
    const unsigned at = s->at;
    REQUIRE(hx_instance_save(s->instance[at], &s->before) == HX_OK);
    const int status = call[chosen](s);
    REQUIRE(status >= STATUS_OK && status <= STATUS_ERROR);
    REQUIRE(hx_instance_save(s->instance[at], &s->after) == HX_OK);
    if (status == STATUS_DISCARD || status == STATUS_ERROR) require_same_state(s, chosen, status);
  }
}

/* Frees what a session holds besides its instances. */
static inline void end_session(Session *s) {
  for (int k = 0; k < STATES; k++) free(s->state[k]);
  free(s->before);
  free(s->after);
}

#endif
