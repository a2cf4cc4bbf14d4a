// idle_fmu.cpp - the binary of an FMU that computes nothing; a run of it measures the master alone
#include <cstddef>

extern "C" {
#include "fmi2Functions.h"

#define OK(name, ...)                                                                              \
  fmi2Status name(__VA_ARGS__) { return fmi2OK; }
#define VARIABLES(type)                                                                            \
  OK(fmi2Get##type, fmi2Component, const fmi2ValueReference[], size_t, fmi2##type[])               \
  OK(fmi2Set##type, fmi2Component, const fmi2ValueReference[], size_t, const fmi2##type[])

static char instance;

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Component fmi2Instantiate(fmi2String, fmi2Type, fmi2String, fmi2String,
                              const fmi2CallbackFunctions *, fmi2Boolean, fmi2Boolean) {
  return &instance;
}
void fmi2FreeInstance(fmi2Component) {}
OK(fmi2SetDebugLogging, fmi2Component, fmi2Boolean, size_t, const fmi2String[])
OK(fmi2SetupExperiment, fmi2Component, fmi2Boolean, fmi2Real, fmi2Real, fmi2Boolean, fmi2Real)
OK(fmi2EnterInitializationMode, fmi2Component)
OK(fmi2ExitInitializationMode, fmi2Component)
OK(fmi2Terminate, fmi2Component)
OK(fmi2Reset, fmi2Component)
VARIABLES(Real)
VARIABLES(Integer)
VARIABLES(Boolean)
VARIABLES(String)
OK(fmi2GetFMUstate, fmi2Component, fmi2FMUstate *)
OK(fmi2SetFMUstate, fmi2Component, fmi2FMUstate)
OK(fmi2FreeFMUstate, fmi2Component, fmi2FMUstate *)
OK(fmi2SerializedFMUstateSize, fmi2Component, fmi2FMUstate, size_t *)
OK(fmi2SerializeFMUstate, fmi2Component, fmi2FMUstate, fmi2Byte[], size_t)
OK(fmi2DeSerializeFMUstate, fmi2Component, const fmi2Byte[], size_t, fmi2FMUstate *)
OK(fmi2GetDirectionalDerivative, fmi2Component, const fmi2ValueReference[], size_t,
   const fmi2ValueReference[], size_t, const fmi2Real[], fmi2Real[])
OK(fmi2SetRealInputDerivatives, fmi2Component, const fmi2ValueReference[], size_t,
   const fmi2Integer[], const fmi2Real[])
OK(fmi2GetRealOutputDerivatives, fmi2Component, const fmi2ValueReference[], size_t,
   const fmi2Integer[], fmi2Real[])
OK(fmi2DoStep, fmi2Component, fmi2Real, fmi2Real, fmi2Boolean)
OK(fmi2CancelStep, fmi2Component)
OK(fmi2GetStatus, fmi2Component, const fmi2StatusKind, fmi2Status *)
OK(fmi2GetRealStatus, fmi2Component, const fmi2StatusKind, fmi2Real *)
OK(fmi2GetIntegerStatus, fmi2Component, const fmi2StatusKind, fmi2Integer *)
OK(fmi2GetBooleanStatus, fmi2Component, const fmi2StatusKind, fmi2Boolean *)
OK(fmi2GetStringStatus, fmi2Component, const fmi2StatusKind, fmi2String *)
}
