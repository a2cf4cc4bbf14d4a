/* instance.h - one instance of the FMU, independent of the standard's version: values, modes,
 * steps, saved states, log.
 *
 * The files of fmi/ in layers; each calls the layers below it only:
 *
 *   fmi2.c  fmi3.c               the functions of the standard's versions
 *   call.c  arrays.c             legal order and calls of both versions; FMI 3's arrays
 *   step.c  exchange.c  state.c  co-simulation; model exchange, an extension; saved states
 *   instance.c                   opening, values, initialization, reset
 *   resources.c                  start values from the FMU's resources
 *   variables.c                  the table of variables; messages to the importer
 *
 * Every function either does all that it was asked for or changes nothing; a refusal is logged with
 * what was got and what was expected.
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
  HX_MODE_CONTINUOUS = 32,  /* model exchange */
  HX_MODE_INTERMEDIATE = 64 /* within a step of FMI 3 */
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

/* s  the latest start: the resolution of a later clock is too coarse for the solver's steps */
static const double hx_latest_start = 1e9;

enum { HX_GUID_SIZE = 40, HX_NAME_SIZE = 128, HX_LOG_SIZE = 2 * HX_MESSAGE_SIZE };

typedef struct hxInstance hxInstance;

/* Passes a formatted message on to the importer. */
typedef void hxLogSink(hxInstance *instance, hxLogCategory category, const char *text);

/* What a saved state holds besides the component's bytes. */
typedef struct hxInstanceState {
  int mode;           /* hxMode */
  int model_stale;    /* parameters were set since the component was reset */
  int output_stale;   /* nothing of variables.output is of the present time and input */
  int rate_stale;     /* the rates of the states are not those of the present time and input */
  int interface;      /* hxInterface */
  int tuned;          /* tunable parameters were set that are not in force yet */
  int ramped;         /* 1: input_rate belongs to the next step; 0: to the last one */
  double start_time;  /* s */
  double stop_time;   /* s  no step passes it; infinite when the importer gives none */
  hxInput input_rate; /* 1/s */
  struct hxVariables variables;
} hxInstanceState;

/* The references of the last call that read Reals, and of the last one that set Real inputs, which
 * were valid, with what the table of variables says of them: importers repeat such calls at every
 * communication point, and the table is larger than the fastest memory. Calls for more are not
 * kept. */
enum { HX_KNOWN_OUTPUTS = 512, HX_KNOWN_INPUTS = 128 };
typedef struct hxKnownOutputs {
  size_t n;
  unsigned groups; /* of outputs */
  int needs_rate;
  unsigned reference[HX_KNOWN_OUTPUTS];
  unsigned short offset[HX_KNOWN_OUTPUTS];
} hxKnownOutputs;
typedef struct hxKnownInputs {
  size_t n;
  unsigned reference[HX_KNOWN_INPUTS];
  unsigned short offset[HX_KNOWN_INPUTS];
  double min[HX_KNOWN_INPUTS], max[HX_KNOWN_INPUTS];
} hxKnownInputs;

struct hxInstance {
  hxInstanceState state;
  hxComponent *component;
  struct hxVariables start; /* values after a reset: compiled in or from the resources */
  char guid[HX_GUID_SIZE];
  char name[HX_NAME_SIZE];
  unsigned fresh;       /* groups of outputs that are up to date, unless state.output_stale */
  int version;          /* of the standard: 2 or 3 */
  int uses_event_mode;  /* co-simulation: the importer handles events */
  int may_return_early; /* co-simulation: a step may end where discrete variables change */
  unsigned logged;      /* bit k: category k is passed on */
  hxLogSink *sink;
  hxKnownOutputs outputs;
  hxKnownInputs inputs;
};

/* ----------------------------------------------------------------------------------------------
 * variables.c */

#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
void hx_log(hxInstance *instance, hxLogCategory category, const char *format, ...);

/* The categories that are passed on in any case. */
enum { HX_LOG_ALWAYS = 1u << HX_LOG_ERROR | 1u << HX_LOG_DISCARD };

/* Turns n categories on or off; all of them when n = 0. */
hxStatus hx_log_select(hxInstance *instance, const char *call, int on, size_t n,
                       const char *const category[]);

/* The row of a reference, or NULL; sets its causality. */
const hxVariable *hx_variable_find(unsigned reference, hxCausality *causality);

/* The same for a variable of the given type; for others logs and returns NULL. */
const hxVariable *hx_variable_of_type(hxInstance *instance, hxType type, unsigned reference,
                                      hxCausality *causality);

/* Whether a variable may have the value; false for NaN. */
int hx_variable_in_range(const hxVariable *variable, double value);

/* The address of a Real variable. */
static inline double *hx_variable_place(struct hxVariables *variables, const hxVariable *variable) {
  return (double *)(void *)((char *)variables + variable->offset);
}

/* ----------------------------------------------------------------------------------------------
 * resources.c */

/* Sets *folder to that of the resources, a URI or a path, as a path that ends in a slash, to be
 * freed by the caller; NULL without resources. Returns HX_OUT_OF_MEMORY when out of memory. */
hxStatus hx_resources_folder(const char *resources, char **folder);

/* Reads start_values.txt of the resources into start; sets *found to whether the file exists. */
hxStatus hx_resources_read(hxInstance *instance, const char *resources, int *found);

/* ----------------------------------------------------------------------------------------------
 * instance.c */

/* Allocates an instance of `size` bytes, which begin with an hxInstance and are otherwise zero, so
 * that it can log; NULL when out of memory. */
void *hx_instance_new(size_t size, int version, hxInterface interface, const char *name,
                      int logging, hxLogSink *sink);

/* Opens a new instance; resources is a URI, a path or NULL. */
hxStatus hx_instance_open(hxInstance *instance, const char *guid, const char *resources);

/* Frees an instance, opened or not, or NULL. */
void hx_instance_free(hxInstance *instance);

/* Values of n references. Integers and Booleans are int. */
hxStatus hx_instance_get(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                         void *value);
hxStatus hx_instance_set(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                         const void *value);
hxStatus hx_instance_check_set(hxInstance *instance, hxType type, const unsigned reference[],
                               size_t n, const void *value);

/* Puts tunable parameters in force that were set. */
hxStatus hx_instance_tune(hxInstance *instance);

/* Updates groups of outputs or the rates to the present time and input, after initializing a
 * component whose parameters were set, or, in co-simulation, putting them in force. */
hxStatus hx_instance_refresh(hxInstance *instance, unsigned groups, int rate);

/* Returns HX_NOT_FINITE, so that a solver tries a smaller step, unless all numbers are finite. */
hxStatus hx_instance_check_finite(hxInstance *instance, const double number[], size_t n,
                                  const char *what);

/* Marks output and rates as not up to date. */
static inline void hx_mark_stale(hxInstance *instance) {
  instance->state.output_stale = instance->state.rate_stale = 1;
}

double hx_instance_time(const hxInstance *instance);

/* Sets the start and, if stop_defined, the stop time [s]. */
hxStatus hx_instance_set_experiment(hxInstance *instance, const char *call, double start,
                                    int stop_defined, double stop);

/* Returns 1 if the importer's tolerance, which is not used, is valid; else logs a warning. */
int hx_instance_check_tolerance(hxInstance *instance, const char *call, int defined,
                                double tolerance);

/* Resets the component to the start time with the present parameters. */
hxStatus hx_instance_initialize(hxInstance *instance);

/* Returns the instance to its start values, before initialization. */
void hx_instance_reset(hxInstance *instance);

/* ----------------------------------------------------------------------------------------------
 * step.c */

/* A step from t to t + h [s]. hx_instance_step_to_event sets *event to whether discrete variables
 * changed; with stop it ends earlier (see component.h). */
hxStatus hx_instance_step(hxInstance *instance, double t, double h);
hxStatus hx_instance_step_to_event(hxInstance *instance, double t, double h, int stop, int *event);

/* Sets rates of Real inputs [1/s] for the next step. */
hxStatus hx_instance_set_input_rates(hxInstance *instance, const unsigned reference[], size_t n,
                                     const double rate[]);

/* ----------------------------------------------------------------------------------------------
 * exchange.c */

/* Model exchange: continuous states and their rates, in the order of hx_states; event indicators.
 */
hxStatus hx_instance_set_time(hxInstance *instance, double t);
hxStatus hx_instance_get_states(hxInstance *instance, double x[], size_t n);
hxStatus hx_instance_set_states(hxInstance *instance, const double x[], size_t n);
hxStatus hx_instance_get_rates(hxInstance *instance, double rate[], size_t n);
hxStatus hx_instance_get_nominals(hxInstance *instance, double nominal[], size_t n);
hxStatus hx_instance_get_indicators(hxInstance *instance, double indicator[], size_t n);

/* The importer's solver has completed a step. */
hxStatus hx_instance_completed_step(hxInstance *instance);

/* Handles an event. */
hxStatus hx_instance_update(hxInstance *instance, int *states_changed);

/* Exact derivatives of unknowns (outputs, rates) along a change of knowns (inputs, continuous
 * states, tunable parameters). */
hxStatus hx_instance_directional(hxInstance *instance, const unsigned unknown[], size_t n_unknown,
                                 const unsigned known[], size_t n_known, const double change[],
                                 double result[]);

/* Sums of the derivatives of unknowns times their seeds, by each known; value: memory for n_unknown
 * numbers. */
hxStatus hx_instance_adjoint(hxInstance *instance, const unsigned unknown[], size_t n_unknown,
                             const unsigned known[], size_t n_known, const double seed[],
                             double value[], double result[]);

/* Time derivatives of outputs [1/s]. */
hxStatus hx_instance_get_output_rates(hxInstance *instance, const unsigned reference[], size_t n,
                                      double rate[]);

/* ----------------------------------------------------------------------------------------------
 * state.c */

/* A saved state is one block without pointers, which the caller frees. save allocates it when
 * *block is NULL. serialize copies a block to n bytes and adds the checksum that deserialize
 * verifies. */
size_t hx_instance_state_size(void);
hxStatus hx_instance_save(hxInstance *instance, void **block);
hxStatus hx_instance_restore(hxInstance *instance, const void *block);
hxStatus hx_instance_serialize(hxInstance *instance, const char *call, void *block, void *bytes,
                               size_t n);
hxStatus hx_instance_deserialize(hxInstance *instance, const void *bytes, size_t n, void **block);

/* ----------------------------------------------------------------------------------------------
 * arrays.c */

/* FMI 3: whole arrays, with n_values numbers in all. Integers are int64_t, Booleans bool. */
hxStatus hx_arrays_get(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                       void *value, size_t n_values);
hxStatus hx_arrays_set(hxInstance *instance, hxType type, const unsigned reference[], size_t n,
                       const void *value, size_t n_values);
hxStatus hx_arrays_directional(hxInstance *instance, const unsigned unknown[], size_t n_unknown,
                               const unsigned known[], size_t n_known, const double change[],
                               size_t n_change, double result[], size_t n_result);
hxStatus hx_arrays_adjoint(hxInstance *instance, const unsigned unknown[], size_t n_unknown,
                           const unsigned known[], size_t n_known, const double seed[],
                           size_t n_seed, double result[], size_t n_result);
hxStatus hx_arrays_get_output_rates(hxInstance *instance, const unsigned reference[], size_t n,
                                    double rate[], size_t n_rate);

HX_HIDDEN_END

#endif
