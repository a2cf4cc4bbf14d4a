/* state.c - saved states: header, instance and component in one block without pointers. */
#include "fmi/instance.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { STATE_FORMAT = 4 };

static const char state_magic[8] = "hexapod";

typedef struct hxStateHeader {
  char magic[8];
  uint32_t format;
  uint32_t size;     /* of the block [B]: differs between platforms and components */
  uint64_t checksum; /* of the bytes after the header; written by hx_instance_serialize */
  char guid[HX_GUID_SIZE];
} hxStateHeader;

typedef struct hxStateBlock {
  hxStateHeader header;
  hxInstanceState instance;
  double component[]; /* hx_component_state_size bytes */
} hxStateBlock;

size_t hx_instance_state_size(void) { return sizeof(hxStateBlock) + hx_component_state_size(); }

/* Marks what is calculated on demand as not calculated, so that a saved state does not depend on
 * what the importer has read. */
static void forget_results(hxInstanceState *state) {
  char *first = (char *)&state->variables.output;
  memset(first, 0, (size_t)((char *)(&state->variables + 1) - first));
  state->output_stale = state->rate_stale = 1;
}

static void save(const hxInstance *instance, void *bytes) {
  hxStateBlock *block = bytes;
  memset(&block->header, 0, sizeof block->header);
  memcpy(block->header.magic, state_magic, sizeof state_magic);
  memcpy(block->header.guid, instance->guid, sizeof instance->guid);
  block->header.format = STATE_FORMAT;
  block->header.size = (uint32_t)hx_instance_state_size();
  memcpy(&block->instance, &instance->state, sizeof instance->state);
  forget_results(&block->instance);
  hx_component_get_state(instance->component, block->component);
}

/* allocates a block for a saved state unless there is one */
static hxStatus need_block(hxInstance *instance, void **block) {
  if (!*block) *block = calloc(1, hx_instance_state_size());
  if (*block) return HX_OK;
  hx_log(instance, HX_LOG_ERROR, "saved state: out of memory; free some and try again");
  return HX_OUT_OF_MEMORY;
}

hxStatus hx_instance_save(hxInstance *instance, void **block) {
  const hxStatus status = need_block(instance, block);
  if (status == HX_OK) save(instance, *block);
  return status;
}

/* checksum of a block; its bytes may be unaligned */
static uint64_t checksum(const void *bytes) {
  return hx_checksum(0, (const char *)bytes + sizeof(hxStateHeader),
                     hx_instance_state_size() - sizeof(hxStateHeader));
}

static hxStatus refuse(hxInstance *instance, const char *what) {
  hx_log(instance, HX_LOG_ERROR,
         "saved state: got %s, expected one that this FMU (%s) saved; nothing was changed", what,
         instance->guid);
  return HX_BAD_STATE;
}

/* returns why a header does not belong to a state of this FMU; NULL when it does */
static const char *fault(const hxInstance *instance, const hxStateHeader *header) {
  if (memcmp(header->magic, state_magic, sizeof state_magic) != 0)
    return "bytes that are no saved state";
  if (header->format != STATE_FORMAT || header->size != hx_instance_state_size())
    return "one of another version or platform";
  return memcmp(header->guid, instance->guid, sizeof header->guid) == 0 ? NULL
                                                                        : "one of another FMU";
}

hxStatus hx_instance_serialize(hxInstance *instance, const char *call, void *saved, void *bytes,
                               size_t n) {
  hxStateBlock *block = saved;
  const char *what = fault(instance, &block->header);
  if (what) return refuse(instance, what);
  if (n < hx_instance_state_size()) {
    hx_log(instance, HX_LOG_ERROR, "%s: got room for %zu bytes, expected %zu; nothing was written",
           call, n, hx_instance_state_size());
    return HX_INVALID_ARGUMENT;
  }
  block->header.checksum = checksum(block);
  memcpy(bytes, block, hx_instance_state_size());
  return HX_OK;
}

/* checks size, header and checksum; the bytes may be unaligned, so the header is copied */
static hxStatus check(hxInstance *instance, const void *bytes, size_t n) {
  hxStateHeader header;
  if (n != hx_instance_state_size())
    return refuse(instance, n < hx_instance_state_size() ? "too few bytes" : "too many bytes");
  memcpy(&header, bytes, sizeof header);
  const char *what = fault(instance, &header);
  if (what) return refuse(instance, what);
  return header.checksum == checksum(bytes) ? HX_OK : refuse(instance, "damaged bytes");
}

hxStatus hx_instance_deserialize(hxInstance *instance, const void *bytes, size_t n, void **block) {
  hxStatus status = check(instance, bytes, n);
  if (status == HX_OK) status = need_block(instance, block);
  if (status == HX_OK) memcpy(*block, bytes, n);
  return status;
}

static int is_flag(int value) { return value == 0 || value == 1; }

/* whether all values of a causality are in their ranges */
static int are_in_range(const struct hxVariables *variables, hxCausality causality) {
  const hxSection *section = &hx_sections[causality];
  for (unsigned i = 0; i < section->count; i++) {
    const hxVariable *variable = &section->variable[i];
    const char *place = (const char *)variables + variable->offset;
    int number = 0;
    double real = 0.0;
    if (variable->type == HX_REAL)
      memcpy(&real, place, sizeof real);
    else
      memcpy(&number, place, sizeof number);
    if (!hx_variable_in_range(variable, variable->type == HX_REAL ? real : (double)number))
      return 0;
  }
  return 1;
}

/* Whether the bytes are the state of an instance. A forged state, whose checksum is right, must not
 * lead to a mode that does not exist or to values that could not be set. */
static int is_instance_state(const hxInstanceState *state) {
  static const int modes = HX_MODE_INSTANTIATED | HX_MODE_INITIALIZATION | HX_MODE_STEP |
                           HX_MODE_TERMINATED | HX_MODE_EVENT | HX_MODE_CONTINUOUS;
  const int mode = state->mode;
  return mode > 0 && (mode & ~modes) == 0 && (mode & (mode - 1)) == 0 &&
         is_flag(state->model_stale) && is_flag(state->output_stale) &&
         is_flag(state->rate_stale) && is_flag(state->ramped) && is_flag(state->tuned) &&
         fabs(state->start_time) <= hx_latest_start && !isnan(state->stop_time) &&
         are_in_range(&state->variables, HX_INPUT) && are_in_range(&state->variables, HX_PARAMETER);
}

hxStatus hx_instance_restore(hxInstance *instance, const void *bytes) {
  const hxStateBlock *block = bytes;
  const char *what = fault(instance, &block->header);
  if (what) return refuse(instance, what);
  if (block->instance.interface != instance->state.interface)
    return refuse(instance, "one of the other interface");
  if (!is_instance_state(&block->instance)) return refuse(instance, "a damaged instance");
  if (hx_component_set_state(instance->component, block->component) != HX_OK)
    return refuse(instance, "a damaged component");
  memcpy(&instance->state, &block->instance, sizeof instance->state);
  instance->state.output_stale = instance->state.rate_stale = 1;
  /* the state was saved by an instance with event mode, which this one does not use */
  if (instance->state.interface == HX_CO_SIMULATION && instance->state.mode == HX_MODE_EVENT &&
      !instance->uses_event_mode)
    instance->state.mode = HX_MODE_STEP;
  return HX_OK;
}
