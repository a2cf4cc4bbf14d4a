/* instance.h - one instance of the FMU, whatever the standard's version: values, modes, stepping,
 * saved states, log.
 *
 * Every function either does all it was asked or changes nothing; a refusal is logged with what was
 * got and expected.
 */
#ifndef HEXAPOD_FMI_INSTANCE_H
#define HEXAPOD_FMI_INSTANCE_H

#include "fmi/component.h"

HX_HIDDEN_BEGIN

/* Modes are bits so that a set of them is a mask. */
typedef enum hxMode {
  HX_MODE_INSTANTIATED = 1,
  HX_MODE_INITIALIZATION = 2,
  HX_MODE_STEP = 4, /* co-simulation */
  HX_MODE_TERMINATED = 8,
  HX_MODE_EVENT = 16,
  HX_MODE_CONTINUOUS = 32 /* model exchange */
} hxMode;

typedef enum hxInterface { HX_CO_SIMULATION = 1, HX_MODEL_EXCHANGE = 2 } hxInterface;

typedef enum hxLogCategory {
  HX_LOG_ERROR,
  HX_LOG_DISCARD,
  HX_LOG_WARNING,
  HX_LOG_EVENT,
  HX_LOG_ALL,
  HX_LOG_CATEGORIES
} hxLogCategory;

/* s  a start further from 0 is refused: the clock's last bit is to stay well below the solver's
 * steps */
static const double hx_latest_start = 1e9;

enum { HX_GUID_SIZE = 40, HX_NAME_SIZE = 128, HX_LOG_SIZE = 2 * HX_MESSAGE_SIZE };

typedef struct hxInstance hxInstance;

/* Passes a finished message on to the importer. */
typedef void hxLogSink(hxInstance *instance, hxLogCategory category, const char *text);

/* What a saved state holds besides the component's bytes. */
typedef struct hxInstanceState {
  int mode;         /* hxMode */
  int model_stale;  /* parameters were set since the component was reset */
  int output_stale; /* variables.output is not that of the present time and input */
  int rate_stale;   /* nor are the rates of the states */
  int interface;    /* hxInterface */
  int ramped;       /* input_rate is of the next step; else of the last one */
  double start_time;
  double stop_time; /* no step goes past it; infinite when the importer names none */
  hxInput input_rate; /* 1/s */
  struct hxVariables variables;
} hxInstanceState;

struct hxInstance {
  hxInstanceState state;
  hxComponent *component;
  struct hxVariables
      start; /* what a reset returns to: definition and input, compiled in or from the resources */
  char guid[HX_GUID_SIZE];
  char name[HX_NAME_SIZE];
  int uses_event_mode; /* of co-simulation: the importer handles events */
  unsigned logged; /* bit k: category k is passed on */
  hxLogSink *sink;
};

/* Opens an instance that is zero but for its name, log, sink and interface; resources is a URI, a
 * path or NULL. On failure it is to be closed all the same. */
hxStatus hx_instance_open(hxInstance *instance, const char *guid, const char *resources);
void hx_instance_close(hxInstance *instance);

/* Values by reference, n at once. Integers and Booleans come as int, by the type asked for. */
hxStatus hx_instance_get(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                         void *value);
hxStatus hx_instance_set(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                         const void *value);
hxStatus hx_instance_check_set(hxInstance *instance, hxType type, const unsigned reference[],
                               size_t n, const void *value);

/* FMI 3: of whole arrays, n_values numbers in all; integers are int64_t, Booleans bool. */
hxStatus hx_arrays_get(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                       void *value, size_t n_values);
hxStatus hx_arrays_set(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                       const void *value, size_t n_values);
hxStatus hx_arrays_directional(hxInstance *instance, const unsigned unknown[], size_t n_unknown,
                               const unsigned known[], size_t n_known, const double change[],
                               size_t n_change, double result[], size_t n_result);
hxStatus hx_arrays_get_output_rates(hxInstance *instance, const unsigned reference[], size_t n,
                                    double rate[], size_t n_rate);

/* When it all begins and, if stop_defined, ends. The tolerance is not used, only looked at: the
 * sound ones return 1. */
hxStatus hx_instance_set_experiment(hxInstance *instance, const char *call, double start,
                                    int stop_defined, double stop);
int hx_instance_note_tolerance(hxInstance *instance, const char *call, int defined,
                               double tolerance);

hxStatus hx_instance_initialize(hxInstance *instance); /* the component takes the parameters */
hxStatus hx_instance_step(hxInstance *instance, double t, double h);
hxStatus hx_instance_step_to_event(hxInstance *instance, double t, double h, int stop,
                                   int *event); /* see component.h */
void hx_instance_reset(hxInstance *instance);
double hx_instance_time(const hxInstance *instance);

/* Model exchange (exchange.c): continuous states and their rates, in the order of hx_states; event
 * indicators; what an event brings about. */
hxStatus hx_instance_set_time(hxInstance *instance, double t);
hxStatus hx_instance_get_states(hxInstance *instance, double x[], size_t n);
hxStatus hx_instance_set_states(hxInstance *instance, const double x[], size_t n);
hxStatus hx_instance_get_rates(hxInstance *instance, double rate[], size_t n);
hxStatus hx_instance_completed_step(hxInstance *instance); /* of the importer's solver */
hxStatus hx_instance_get_nominals(hxInstance *instance, double nominal[], size_t n);
hxStatus hx_instance_get_indicators(hxInstance *instance, double indicator[], size_t n);
hxStatus hx_instance_update(hxInstance *instance, int *states_changed);

/* Derivatives by reference (exchange.c): of unknowns (outputs, rates) along a change of knowns
 * (inputs, continuous states), exact; rates of inputs for the next steps; rates of outputs now. All
 * or nothing. */
hxStatus hx_instance_directional(hxInstance *instance, const unsigned unknown[], size_t n_unknown,
                                 const unsigned known[], size_t n_known, const double change[],
                                 double result[]);
hxStatus hx_instance_set_input_rates(hxInstance *instance, const unsigned reference[], size_t n,
                                     const double rate[]);
hxStatus hx_instance_get_output_rates(hxInstance *instance, const unsigned reference[], size_t n,
                                      double rate[]);

/* Saved states: one block without pointers, taken with calloc where *block is NULL, to be freed by
 * the caller. serialize copies one into room for n bytes, with the checksum that deserialize
 * verifies; deserialize makes one of n intact bytes of this FMU. */
size_t hx_instance_state_size(void);
hxStatus hx_instance_keep(hxInstance *instance, void **block);
hxStatus hx_instance_restore(hxInstance *instance, const void *block);
hxStatus hx_instance_serialize(hxInstance *instance, const char *call, void *block, void *bytes,
                               size_t n);
hxStatus hx_instance_deserialize(hxInstance *instance, const void *bytes, size_t n, void **block);

#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
void hx_log(hxInstance *instance, hxLogCategory category, const char *format, ...);

/* A function of the standard: when it may be called, as masks. */
typedef struct hxCall {
  const char *name;
  int modes, interfaces;
} hxCall;

/* Whether a call is legal now; whether n elements may be at two places; whether derivatives are of
 * order 1. They complain if not. */
int hx_call_admit(hxInstance *instance, const hxCall *call);
int hx_call_given(hxInstance *instance, const hxCall *call, size_t n, const void *array,
                  const void *other);
int hx_call_first_order(hxInstance *instance, const hxCall *call, size_t n, const int order[]);

/* What is passed on: refusals and discarded steps always, the rest when the importer wants it.
 * choose: these categories, all when n = 0. */
enum { HX_LOG_ALWAYS = 1u << HX_LOG_ERROR | 1u << HX_LOG_DISCARD };
hxStatus hx_log_choose(hxInstance *instance, const char *call, int on, size_t n,
                       const char *const category[]);

/* Reads start_values.txt of the resources into start; *found says whether there is one. */
hxStatus hx_resources_read(hxInstance *instance, const char *resources, int *found);

/* The input at the end of the next step, if it is ramped and that is in range; complains if not. */
hxStatus hx_instance_ramp_end(hxInstance *instance, double h, hxInput *end);

/* Output and rates are to be found anew. */
static inline void hx_stale(hxInstance *instance) {
  instance->state.output_stale = instance->state.rate_stale = 1;
}

/* Brings output or rates to the present time and input, and the component to the parameters before
 * that; the row of a reference if it is of the type asked for. */
hxStatus hx_instance_refresh(hxInstance *instance, int output, int rate);
const hxVariable *hx_instance_find(hxInstance *instance, hxType type, unsigned reference,
                                   hxCausality *causality);

/* Whether numbers are finite; a solver is told to try a smaller step otherwise. */
hxStatus hx_instance_check_finite(hxInstance *instance, const double number[], size_t n,
                                  const char *what);

/* The row of a reference, or NULL; and a value's fitness for it (NaN and infinities fit nowhere).
 */
const hxVariable *hx_variable_find(unsigned reference, hxCausality *causality);
int hx_variable_takes(const hxVariable *variable, double value);

HX_HIDDEN_END

#endif
