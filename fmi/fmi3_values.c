/* fmi3_values.c - FMI 3.0: values, dependencies, saved states, derivatives, clocks. */
#include "fmi/fmi3_calls.h"

/* ----------------------------------------------------------------------------------------------
 * values */

static fmi3Status get_values(fmi3Instance c, fmi3Call call, hxType type,
                             const fmi3ValueReference vr[], size_t nvr, void *value, size_t n) {
  if (!hx_call_is_legal_with(c, &hx_fmi3_calls[call], nvr, vr, value)) return fmi3Error;
  return hx_fmi3_status(hx_arrays_get(c, type, vr, nvr, value, n));
}

static fmi3Status set_values(fmi3Instance c, fmi3Call call, hxType type,
                             const fmi3ValueReference vr[], size_t nvr, const void *value,
                             size_t n) {
  if (!hx_call_is_legal_with(c, &hx_fmi3_calls[call], nvr, vr, value)) return fmi3Error;
  return hx_fmi3_status(hx_arrays_set(c, type, vr, nvr, value, n));
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                          fmi3Float64 value[], size_t n) {
  return get_values(c, GET_FLOAT64, HX_REAL, vr, nvr, value, n);
}

/* enumerations are Int64 */
fmi3Status fmi3GetInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                        fmi3Int64 value[], size_t n) {
  return get_values(c, GET_INT64, HX_INTEGER, vr, nvr, value, n);
}

fmi3Status fmi3GetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                          fmi3Boolean value[], size_t n) {
  return get_values(c, GET_BOOLEAN, HX_BOOLEAN, vr, nvr, value, n);
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                          const fmi3Float64 value[], size_t n) {
  return set_values(c, SET_FLOAT64, HX_REAL, vr, nvr, value, n);
}

fmi3Status fmi3SetInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                        const fmi3Int64 value[], size_t n) {
  return set_values(c, SET_INT64, HX_INTEGER, vr, nvr, value, n);
}

fmi3Status fmi3SetBoolean(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                          const fmi3Boolean value[], size_t n) {
  return set_values(c, SET_BOOLEAN, HX_BOOLEAN, vr, nvr, value, n);
}

/* types that no variable has */
#define NO_VARIABLES_OF(Type)                                                                      \
  fmi3Status fmi3Get##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,              \
                           fmi3##Type value[], size_t n) {                                         \
    (void)vr, (void)value, (void)n;                                                                \
    return hx_fmi3_no_variables(c, GET_OTHER, nvr);                                                \
  }                                                                                                \
  fmi3Status fmi3Set##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,              \
                           const fmi3##Type value[], size_t n) {                                   \
    (void)vr, (void)value, (void)n;                                                                \
    return hx_fmi3_no_variables(c, SET_OTHER, nvr);                                                \
  }

NO_VARIABLES_OF(Float32)
NO_VARIABLES_OF(Int8)
NO_VARIABLES_OF(UInt8)
NO_VARIABLES_OF(Int16)
NO_VARIABLES_OF(UInt16)
NO_VARIABLES_OF(Int32)
NO_VARIABLES_OF(UInt32)
NO_VARIABLES_OF(UInt64)
NO_VARIABLES_OF(String)

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, size_t size[],
                         fmi3Binary value[], size_t n) {
  (void)vr, (void)size, (void)value, (void)n;
  return hx_fmi3_no_variables(c, GET_OTHER, nvr);
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                         const size_t size[], const fmi3Binary value[], size_t n) {
  (void)vr, (void)size, (void)value, (void)n;
  return hx_fmi3_no_variables(c, SET_OTHER, nvr);
}

/* ----------------------------------------------------------------------------------------------
 * dependencies */

/* Dependencies of single elements are not offered: see providesPerElementDependencies. */
fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t *n) {
  (void)vr, (void)n;
  return hx_fmi3_not_supported(c, "fmi3GetNumberOfVariableDependencies");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent,
                                       size_t elementIndicesOfDependent[],
                                       fmi3ValueReference independents[],
                                       size_t elementIndicesOfIndependents[],
                                       fmi3DependencyKind dependencyKinds[], size_t nDependencies) {
  (void)dependent, (void)elementIndicesOfDependent, (void)independents,
      (void)elementIndicesOfIndependents, (void)dependencyKinds;
  (void)nDependencies;
  return hx_fmi3_not_supported(c, "fmi3GetVariableDependencies");
}

/* ----------------------------------------------------------------------------------------------
 * saved states */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  return hx_fmi3_status(hx_call_save(c, &hx_fmi3_calls[GET_STATE], state));
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  return hx_fmi3_status(hx_call_restore(c, &hx_fmi3_calls[SET_STATE], state));
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
  return hx_fmi3_status(hx_call_free_state(c, &hx_fmi3_calls[FREE_STATE], state));
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
  return hx_fmi3_status(hx_call_state_size(c, &hx_fmi3_calls[SERIALIZED_SIZE], state, size));
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[],
                                 size_t size) {
  return hx_fmi3_status(hx_call_serialize(c, &hx_fmi3_calls[SERIALIZE], state, bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size,
                                   fmi3FMUState *state) {
  return hx_fmi3_status(hx_call_deserialize(c, &hx_fmi3_calls[DESERIALIZE], bytes, size, state));
}

/* ----------------------------------------------------------------------------------------------
 * derivatives */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[],
                                        size_t nUnknowns, const fmi3ValueReference knowns[],
                                        size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                        fmi3Float64 sensitivity[], size_t nSensitivity) {
  if (!hx_call_is_legal_with(c, &hx_fmi3_calls[DIRECTIONAL_DERIVATIVE], nUnknowns, unknowns,
                             sensitivity))
    return fmi3Error;
  if (!hx_call_has_arrays(c, &hx_fmi3_calls[DIRECTIONAL_DERIVATIVE], nKnowns, knowns, seed))
    return fmi3Error;
  return hx_fmi3_status(hx_arrays_directional(c, unknowns, nUnknowns, knowns, nKnowns, seed, nSeed,
                                              sensitivity, nSensitivity));
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[],
                                    size_t nUnknowns, const fmi3ValueReference knowns[],
                                    size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                    fmi3Float64 sensitivity[], size_t nSensitivity) {
  (void)unknowns, (void)nUnknowns, (void)knowns, (void)nKnowns, (void)seed, (void)nSeed,
      (void)sensitivity, (void)nSensitivity;
  return hx_fmi3_not_supported(c, "fmi3GetAdjointDerivative");
}

/* ----------------------------------------------------------------------------------------------
 * configuration, clocks */

/* There are no structural parameters. */
fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) {
  return hx_fmi3_not_supported(c, "fmi3EnterConfigurationMode");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) {
  return hx_fmi3_not_supported(c, "fmi3ExitConfigurationMode");
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                                  fmi3Float64 interval[], fmi3IntervalQualifier qualifier[]) {
  (void)vr, (void)interval, (void)qualifier;
  return hx_fmi3_no_variables(c, CLOCKS, nvr);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr,
                                   fmi3UInt64 counter[], fmi3UInt64 resolution[],
                                   fmi3IntervalQualifier qualifier[]) {
  (void)vr, (void)counter, (void)resolution, (void)qualifier;
  return hx_fmi3_no_variables(c, CLOCKS, nvr);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clockReference,
                                      fmi3Float64 activationTime) {
  (void)clockReference, (void)activationTime;
  return hx_fmi3_not_supported(c, "fmi3ActivateModelPartition");
}

#define NO_CLOCKS(Name, Type)                                                                      \
  fmi3Status fmi3##Name(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, Type value[]) { \
    (void)vr, (void)value;                                                                         \
    return hx_fmi3_no_variables(c, CLOCKS, nvr);                                                   \
  }
#define NO_CLOCK_FRACTIONS(Name, Type)                                                             \
  fmi3Status fmi3##Name(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, Type counter[], \
                        Type resolution[]) {                                                       \
    (void)vr, (void)counter, (void)resolution;                                                     \
    return hx_fmi3_no_variables(c, CLOCKS, nvr);                                                   \
  }

NO_CLOCKS(GetClock, fmi3Clock)
NO_CLOCKS(SetClock, const fmi3Clock)
NO_CLOCKS(GetShiftDecimal, fmi3Float64)
NO_CLOCKS(SetIntervalDecimal, const fmi3Float64)
NO_CLOCKS(SetShiftDecimal, const fmi3Float64)
NO_CLOCK_FRACTIONS(GetShiftFraction, fmi3UInt64)
NO_CLOCK_FRACTIONS(SetIntervalFraction, const fmi3UInt64)
NO_CLOCK_FRACTIONS(SetShiftFraction, const fmi3UInt64)
