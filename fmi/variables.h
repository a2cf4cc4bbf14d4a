/* variables.h - the table of variables, whose rows are in generated/variables.c; the structure that
 * holds their values is in generated/variables.h. */
#ifndef HEXAPOD_FMI_VARIABLES_H
#define HEXAPOD_FMI_VARIABLES_H

#include <stdint.h>

#include "generated/variables.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Stored as double, int, int. Enumerations are HX_INTEGER. */
typedef enum hxType { HX_REAL, HX_INTEGER, HX_BOOLEAN } hxType;

/* Local variables are the rates of states. */
typedef enum hxCausality {
  HX_INPUT,
  HX_OUTPUT,
  HX_PARAMETER,
  HX_LOCAL,
  HX_CAUSALITIES
} hxCausality;

typedef struct hxVariable {
  const char *name;
  const char *unit;          /* "" when it has none */
  double min, max;           /* the allowed range, finite and inclusive */
  unsigned short offset;     /* in struct hxVariables */
  unsigned char type;        /* hxType */
  unsigned char tunable;     /* 1: a parameter that may be set between steps */
  unsigned short array_rows; /* FMI 3: of the array that begins here; 1: scalar, 0: within one */
} hxVariable;

/* The variables of one causality; their value references are first, first + 1, ... */
typedef struct hxSection {
  unsigned first;
  unsigned count;
  const hxVariable *variable;
} hxSection;

extern const hxSection hx_sections[HX_CAUSALITIES];

/* Groups of outputs that a component calculates together, as bits: of each output, in the order of
 * their references. Outputs with all bits need all groups. */
enum { HX_ALL_GROUPS = 0xff };
extern const unsigned char hx_output_groups[];

/* A continuous state of model exchange: its variable and its nominal value. */
typedef struct hxStateRow {
  unsigned reference;
  double nominal;
} hxStateRow;

/* In the order of the state in struct hxVariables; empty without model exchange. */
extern const hxStateRow *const hx_states;
extern const size_t hx_state_count;

/* FMI 3: the reference of the independent variable, time. */
extern const unsigned hx_time_reference;

/* Names of the log categories, in the order of hxLogCategory. */
extern const char *const hx_log_category_names[];

/* Identifies the table of variables: its rows and their references. */
extern const uint64_t hx_table_digest;

/* GUID of the model description with the compiled-in robot. */
extern const char hx_default_guid[];

HX_HIDDEN_END

#endif
