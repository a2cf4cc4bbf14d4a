/* variables.h - the table of variables that generated/variables.c fills in; their structure is in
 * generated/variables.h. */
#ifndef HEXAPOD_FMI_VARIABLES_H
#define HEXAPOD_FMI_VARIABLES_H

#include "generated/variables.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef enum hxType {
  HX_REAL,
  HX_INTEGER,
  HX_BOOLEAN
} hxType; /* double, int, int; an enumeration is an HX_INTEGER */

typedef enum hxCausality {
  HX_INPUT,
  HX_OUTPUT,
  HX_PARAMETER,
  HX_LOCAL,
  HX_CAUSALITIES
} hxCausality; /* local: rates of states */

typedef struct hxVariable {
  const char *name;
  const char *unit;  /* "" when it has none */
  double min, max;   /* inclusive, finite: what lies outside, infinite or NaN is refused */
  unsigned short offset; /* into struct hxVariables */
  unsigned char type;    /* hxType */
  unsigned short
      run;    /* FMI 3: rows of the array that begins here, 1 for a scalar; 0 within an array */
} hxVariable;

/* The variables of one causality; their value references are first, first + 1, ... */
typedef struct hxSection {
  unsigned first;
  unsigned count;
  const hxVariable *variable;
} hxSection;

extern const hxSection hx_sections[HX_CAUSALITIES];

/* A continuous state of model exchange: the variable that shows it, and its usual size. */
typedef struct hxStateRow {
  unsigned reference;
  double nominal;
} hxStateRow;

/* In the order of the state in struct hxVariables; none without model exchange. */
extern const hxStateRow *const hx_states;
extern const size_t hx_state_count;

/* FMI 3: the reference of the independent variable, time. */
extern const unsigned hx_time_reference;

/* Names of the log categories, in the order of hxLogCategory. */
extern const char *const hx_log_category_names[];

/* GUID of the model description with the compiled-in robot. */
extern const char hx_default_guid[];

HX_HIDDEN_END

#endif
