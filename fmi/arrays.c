/* arrays.c - FMI 3's arrays: each is a range of rows of the table that begins at its reference. */
#include "fmi/instance.h"

#include <limits.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { CHUNK = 64 }; /* rows that are read or written at once */

/* gets, checks or sets rows; values are as in hx_instance_get */
typedef hxStatus rowsFunction(hxInstance *instance, hxType type, const unsigned reference[],
                              size_t n, void *value);

static hxStatus check_rows(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                           void *value) {
  return hx_instance_check_set(instance, type, reference, n, value);
}

static hxStatus set_rows(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                         void *value) {
  return hx_instance_set(instance, type, reference, n, value);
}

/* the number of rows of an array; logs and returns 0 when none begins at the reference */
static size_t rows_of(hxInstance *instance, hxType type, unsigned reference) {
  hxCausality causality;
  const hxVariable *variable = hx_variable_find(reference, &causality);
  if (variable && variable->array_rows) return variable->array_rows;
  if (reference == hx_time_reference && type == HX_REAL) return 1;
  hx_log(instance, HX_LOG_ERROR,
         "value reference: got %u, expected one of modelDescription.xml; nothing was done",
         reference);
  return 0;
}

/* checks that n_values is the number of elements of all the arrays */
static hxStatus check_count(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                            size_t n_values) {
  size_t expected = 0;
  for (size_t i = 0; i < n; i++) {
    const size_t rows = rows_of(instance, type, reference[i]);
    if (rows == 0) return HX_INVALID_ARGUMENT;
    expected += rows;
  }
  if (n_values == expected) return HX_OK;
  hx_log(
      instance, HX_LOG_ERROR,
      "values: got room for %zu, expected %zu, all elements of the %zu variables; nothing was done",
      n_values, expected, n);
  return HX_INVALID_ARGUMENT;
}

/* numbers outside int's range are outside every variable's range, so they may saturate */
static int to_int(int64_t value) {
  return value > INT_MAX ? INT_MAX : value < INT_MIN ? INT_MIN : (int)value;
}

static void read_ints(hxType type, const void *value, size_t first, size_t n, int number[]) {
  for (size_t i = 0; i < n; i++)
    number[i] = type == HX_INTEGER ? to_int(((const int64_t *)value)[first + i])
                                   : ((const bool *)value)[first + i];
}

static void write_ints(hxType type, const int number[], void *value, size_t first, size_t n) {
  for (size_t i = 0; i < n; i++) {
    if (type == HX_INTEGER)
      ((int64_t *)value)[first + i] = number[i];
    else
      ((bool *)value)[first + i] = number[i] != 0;
  }
}

/* applies a function to all rows of an array; its values begin at index `first` */
static hxStatus each_row(hxInstance *instance, rowsFunction *function, hxType type,
                         unsigned reference, size_t rows, void *value, size_t first) {
  unsigned row[CHUNK];
  int number[CHUNK];
  for (size_t done = 0; done < rows; done += CHUNK) {
    const size_t n = rows - done < CHUNK ? rows - done : CHUNK, at = first + done;
    for (size_t i = 0; i < n; i++) row[i] = reference + (unsigned)(done + i);
    if (type != HX_REAL && function != hx_instance_get) read_ints(type, value, at, n, number);
    const hxStatus status =
        function(instance, type, row, n, type == HX_REAL ? (void *)((double *)value + at) : number);
    if (status != HX_OK) return status;
    if (type != HX_REAL && function == hx_instance_get) write_ints(type, number, value, at, n);
  }
  return HX_OK;
}

static hxStatus each_array(hxInstance *instance, rowsFunction *function, hxType type,
                           const unsigned reference[], size_t n, void *value) {
  size_t first = 0;
  for (size_t i = 0; i < n; i++) {
    const size_t rows = rows_of(instance, type, reference[i]);
    if (reference[i] == hx_time_reference)
      ((double *)value)[first] = hx_instance_time(instance);
    else {
      const hxStatus status = each_row(instance, function, type, reference[i], rows, value, first);
      if (status != HX_OK) return status;
    }
    first += rows;
  }
  return HX_OK;
}

/* checks that arrays are of a type; time is Real */
static hxStatus check_types(hxInstance *instance, hxType type, const unsigned reference[],
                            size_t n) {
  hxCausality causality;
  for (size_t i = 0; i < n; i++)
    if (reference[i] != hx_time_reference &&
        !hx_variable_of_type(instance, type, reference[i], &causality))
      return HX_INVALID_ARGUMENT;
  return HX_OK;
}

/* All references are checked before the first value is calculated. */
hxStatus hx_arrays_get(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                       void *value, size_t n_values) {
  hxStatus status = check_count(instance, type, reference, n, n_values);
  if (status == HX_OK) status = check_types(instance, type, reference, n);
  return status == HX_OK ? each_array(instance, hx_instance_get, type, reference, n, value)
                         : status;
}

/* all values are checked before the first is set */
hxStatus hx_arrays_set(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                       const void *value, size_t n_values) {
  hxStatus status = check_count(instance, type, reference, n, n_values);
  for (size_t i = 0; i < n && status == HX_OK; i++)
    if (reference[i] == hx_time_reference) {
      hx_log(instance, HX_LOG_ERROR,
             "time: got a value, expected none, as steps move it; nothing was set");
      status = HX_INVALID_ARGUMENT;
    }
  if (status == HX_OK) status = each_array(instance, check_rows, type, reference, n, (void *)value);
  return status == HX_OK ? each_array(instance, set_rows, type, reference, n, (void *)value)
                         : status;
}

/* ----------------------------------------------------------------------------------------------
 * derivatives */

/* The references of all rows of arrays, to be freed by the caller. Logs and returns NULL when their
 * number is not n_values or memory is short. */
static unsigned *row_references(hxInstance *instance, const unsigned reference[], size_t n,
                                size_t n_values) {
  if (check_count(instance, HX_REAL, reference, n, n_values) != HX_OK) return NULL;
  unsigned *row = malloc((n_values + 1) * sizeof *row), *next = row;
  if (!row) hx_log(instance, HX_LOG_ERROR, "derivatives: out of memory; free some and try again");
  for (size_t i = 0; i < n && row; i++) {
    const size_t rows = rows_of(instance, HX_REAL, reference[i]);
    for (size_t k = 0; k < rows; k++) *next++ = reference[i] + (unsigned)k;
  }
  return row;
}

hxStatus hx_arrays_directional(hxInstance *instance, const unsigned unknown[], size_t n_unknown,
                               const unsigned known[], size_t n_known, const double change[],
                               size_t n_change, double result[], size_t n_result) {
  unsigned *unknowns = row_references(instance, unknown, n_unknown, n_result);
  unsigned *knowns = unknowns ? row_references(instance, known, n_known, n_change) : NULL;
  const hxStatus status = knowns ? hx_instance_directional(instance, unknowns, n_result, knowns,
                                                           n_change, change, result)
                                 : HX_INVALID_ARGUMENT;
  free(knowns);
  free(unknowns);
  return status;
}

hxStatus hx_arrays_adjoint(hxInstance *instance, const unsigned unknown[], size_t n_unknown,
                           const unsigned known[], size_t n_known, const double seed[],
                           size_t n_seed, double result[], size_t n_result) {
  unsigned *unknowns = row_references(instance, unknown, n_unknown, n_seed);
  unsigned *knowns = unknowns ? row_references(instance, known, n_known, n_result) : NULL;
  double *values = knowns ? malloc((n_seed + n_result + 1) * sizeof *values) : NULL;
  hxStatus status = HX_INVALID_ARGUMENT;
  if (values) {
    status = hx_instance_adjoint(instance, unknowns, n_seed, knowns, n_result, seed, values,
                                 values + n_seed);
    if (status == HX_OK) memcpy(result, values + n_seed, n_result * sizeof *result);
  }
  free(values);
  free(knowns);
  free(unknowns);
  return status;
}

hxStatus hx_arrays_get_output_rates(hxInstance *instance, const unsigned reference[], size_t n,
                                    double rate[], size_t n_rate) {
  unsigned *rows = row_references(instance, reference, n, n_rate);
  const hxStatus status =
      rows ? hx_instance_get_output_rates(instance, rows, n_rate, rate) : HX_INVALID_ARGUMENT;
  free(rows);
  return status;
}
