/* instance.h - one instance of the FMU, whatever the standard's version: values, modes, stepping, saved states, log.
 *
 * Every function either does all it was asked or changes nothing; a refusal is logged with what was got and expected.
 */
#ifndef HEXAPOD_FMI_INSTANCE_H
#define HEXAPOD_FMI_INSTANCE_H

#include "fmi/component.h"

/* Modes are bits so that a set of them is a mask. */
typedef enum hxMode { HX_MODE_INSTANTIATED = 1, HX_MODE_INITIALIZATION = 2, HX_MODE_STEP = 4, HX_MODE_TERMINATED = 8 } hxMode;

typedef enum hxLogCategory { HX_LOG_ERROR, HX_LOG_DISCARD, HX_LOG_WARNING, HX_LOG_EVENT, HX_LOG_ALL, HX_LOG_CATEGORIES } hxLogCategory;

/* s  a start further from 0 is refused: the clock's last bit is to stay well below the solver's steps */
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
  double start_time;
  double stop_time; /* no step goes past it; infinite when the importer names none */
  struct hxVariables variables;
} hxInstanceState;

struct hxInstance {
  hxInstanceState state;
  hxComponent *component;
  struct hxVariables start; /* what a reset returns to: definition and input, compiled in or from the resources */
  char guid[HX_GUID_SIZE];
  char name[HX_NAME_SIZE];
  unsigned logged; /* bit k: category k is passed on */
  hxLogSink *sink;
};

/* Opens an instance that is zero but for its name, log and sink; resources is a URI, a path or NULL. On failure it is to be closed all the same. */
hxStatus hx_instance_open(hxInstance *instance, const char *guid, const char *resources);
void hx_instance_close(hxInstance *instance);

/* Values by reference, n at once. Integers and Booleans come as int, by the type asked for. */
hxStatus hx_instance_get(hxInstance *instance, hxType type, const unsigned reference[], size_t n, void *value);
hxStatus hx_instance_set(hxInstance *instance, hxType type, const unsigned reference[], size_t n, const void *value);

hxStatus hx_instance_initialize(hxInstance *instance); /* the component takes the parameters */
hxStatus hx_instance_step(hxInstance *instance, double t, double h);
void hx_instance_reset(hxInstance *instance);
double hx_instance_time(const hxInstance *instance);

/* Saved states: one block without pointers. check finds out whether n bytes are an intact one of this FMU. */
size_t hx_instance_state_size(void);
void hx_instance_save(const hxInstance *instance, void *block);
hxStatus hx_instance_restore(hxInstance *instance, const void *block);
hxStatus hx_instance_seal(hxInstance *instance, void *block); /* writes the checksum that check verifies */
hxStatus hx_instance_check(hxInstance *instance, const void *block, size_t n);

void hx_log(hxInstance *instance, hxLogCategory category, const char *format, ...);

/* Reads start_values.txt of the resources into start; *found says whether there is one. */
hxStatus hx_resources_read(hxInstance *instance, const char *resources, int *found);

/* The row of a reference, or NULL; and a value's fitness for it (NaN and infinities fit nowhere). */
const hxVariable *hx_variable_find(unsigned reference, hxCausality *causality);
int hx_variable_takes(const hxVariable *variable, double value);

#endif
