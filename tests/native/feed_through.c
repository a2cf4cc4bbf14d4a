// feed_through.c - an FMU of FMI 2.0 with direct feed-through, for tests of packages.
//
// reference = start + gain (angle - start) + swing sin(2 pi t) + 1e-6 times the number of steps,
// where the swing is added only while the foot touches the ground. doStep changes the number of
// steps; the output depends directly on inputs and time.
#include "fmi2Functions.h"
#include <math.h>
#include <stdlib.h>

enum { ANGLE, START, GAIN, SWING, REFERENCE, REALS };

typedef struct {
  fmi2Real real[REALS], time;
  fmi2Boolean contact;
  int steps;
} Instance;

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                              fmi2Boolean logging) {
  (void)name, (void)type, (void)guid, (void)resources, (void)callbacks, (void)visible,
      (void)logging;
  Instance *self = calloc(1, sizeof(Instance));
  if (self) self->real[START] = 0.4, self->real[GAIN] = 0.5, self->real[SWING] = 0.05;
  return self;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean given, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean ends, fmi2Real stop) {
  (void)given, (void)tolerance, (void)ends, (void)stop;
  ((Instance *)c)->time = start;
  return fmi2OK;
}

static fmi2Real reference(const Instance *self) {
  const fmi2Real *r = self->real;
  return r[START] + r[GAIN] * (r[ANGLE] - r[START]) +
         (self->contact ? r[SWING] * sin(6.283185307179586 * self->time) : 0.0) +
         1e-6 * self->steps;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference *references, size_t count,
                       fmi2Real *values) {
  Instance *self = c;
  self->real[REFERENCE] = reference(self);
  for (size_t k = 0; k < count; k++) {
    if (references[k] >= REALS) return fmi2Error;
    values[k] = self->real[references[k]];
  }
  return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference *references, size_t count,
                       const fmi2Real *values) {
  for (size_t k = 0; k < count; k++) {
    if (references[k] >= REFERENCE) return fmi2Error;
    ((Instance *)c)->real[references[k]] = values[k];
  }
  return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference *references, size_t count,
                          fmi2Boolean *values) {
  (void)references;
  for (size_t k = 0; k < count; k++) values[k] = ((Instance *)c)->contact;
  return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference *references, size_t count,
                          const fmi2Boolean *values) {
  (void)references;
  for (size_t k = 0; k < count; k++) ((Instance *)c)->contact = values[k];
  return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean keep) {
  Instance *self = c;
  (void)keep;
  self->time = t + h;
  self->steps++;
  return fmi2OK;
}

#define NOTHING_TO_DO(name, ...)                                                                   \
  fmi2Status name(__VA_ARGS__) { return fmi2OK; }
#define NOT_THERE(name, ...)                                                                       \
  fmi2Status name(__VA_ARGS__) { return fmi2Error; }

NOTHING_TO_DO(fmi2EnterInitializationMode, fmi2Component c)
NOTHING_TO_DO(fmi2ExitInitializationMode, fmi2Component c)
NOTHING_TO_DO(fmi2Terminate, fmi2Component c)
NOTHING_TO_DO(fmi2SetDebugLogging, fmi2Component c, fmi2Boolean on, size_t n, const fmi2String s[])
NOT_THERE(fmi2Reset, fmi2Component c)
NOT_THERE(fmi2GetInteger, fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer v[])
NOT_THERE(fmi2GetString, fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String v[])
NOT_THERE(fmi2SetInteger, fmi2Component c, const fmi2ValueReference r[], size_t n,
          const fmi2Integer v[])
NOT_THERE(fmi2SetString, fmi2Component c, const fmi2ValueReference r[], size_t n,
          const fmi2String v[])
NOT_THERE(fmi2GetFMUstate, fmi2Component c, fmi2FMUstate *s)
NOT_THERE(fmi2SetFMUstate, fmi2Component c, fmi2FMUstate s)
NOT_THERE(fmi2FreeFMUstate, fmi2Component c, fmi2FMUstate *s)
NOT_THERE(fmi2SerializedFMUstateSize, fmi2Component c, fmi2FMUstate s, size_t *n)
NOT_THERE(fmi2SerializeFMUstate, fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n)
NOT_THERE(fmi2DeSerializeFMUstate, fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s)
NOT_THERE(fmi2GetDirectionalDerivative, fmi2Component c, const fmi2ValueReference u[], size_t n,
          const fmi2ValueReference k[], size_t m, const fmi2Real d[], fmi2Real v[])
NOT_THERE(fmi2SetRealInputDerivatives, fmi2Component c, const fmi2ValueReference r[], size_t n,
          const fmi2Integer o[], const fmi2Real v[])
NOT_THERE(fmi2GetRealOutputDerivatives, fmi2Component c, const fmi2ValueReference r[], size_t n,
          const fmi2Integer o[], fmi2Real v[])
NOT_THERE(fmi2CancelStep, fmi2Component c)
NOT_THERE(fmi2GetStatus, fmi2Component c, const fmi2StatusKind k, fmi2Status *v)
NOT_THERE(fmi2GetRealStatus, fmi2Component c, const fmi2StatusKind k, fmi2Real *v)
NOT_THERE(fmi2GetIntegerStatus, fmi2Component c, const fmi2StatusKind k, fmi2Integer *v)
NOT_THERE(fmi2GetBooleanStatus, fmi2Component c, const fmi2StatusKind k, fmi2Boolean *v)
NOT_THERE(fmi2GetStringStatus, fmi2Component c, const fmi2StatusKind k, fmi2String *v)
