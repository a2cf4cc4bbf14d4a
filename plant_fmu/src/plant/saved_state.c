/* saved_state.c - a plant's model and state as bytes with a checksum, for FMI's saved states */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "../ground/surface.h"
#include "hexapod/message.h"
#include "hexapod/status.h"
#include "parts.h"

/* The head of a saved state, which identifies it. */
typedef struct {
  uint64_t magic, version, size, checksum;
  uint64_t terrain; /* checksum of the grid; 0: none */
} hxSavedHead;

typedef struct {
  hxSavedHead head;
  hxModel model;
  hxState state;
  hxFootprints footprints; /* the last ones; unused entries are 0 */
} hxSavedPlant;

static const uint64_t magic = 0x74616c5064507868u; /* "hxPdPlat" */
static const uint64_t saved_version = 20;

/* Returns the checksum of a saved plant's bytes behind it, of the ring those of its footprints. */
static uint64_t checksum(const unsigned char *bytes, int footprints) {
  const size_t used = (size_t)footprints * sizeof(hxFootprint),
               end = offsetof(hxSavedPlant, footprints.footprint) + used;
  const size_t begin = offsetof(hxSavedPlant, head.terrain);
  return hx_checksum(0, bytes + begin, end - begin);
}

size_t hx_plant_state_size(void) { return sizeof(hxSavedPlant); }

/* The saved plant is put together in the caller's bytes, which may have any alignment. */
void hx_plant_get_state(const hxPlant *plant, void *bytes) {
  unsigned char *to = bytes;
  const uint64_t grid = plant->model.terrain ? hx_terrain_checksum(plant->model.terrain) : 0;
  hxSavedHead head = {magic, saved_version, sizeof(hxSavedPlant), 0, grid};
  memcpy(to, &head, sizeof head);
  memcpy(to + offsetof(hxSavedPlant, model), &plant->model, sizeof plant->model);
  memset(to + offsetof(hxSavedPlant, model.terrain_bits), 0, sizeof plant->model.terrain_bits);
  memcpy(to + offsetof(hxSavedPlant, state), &plant->state, sizeof plant->state);
  hx_footprints_write(to + offsetof(hxSavedPlant, footprints), &plant->footprints.kept);
  head.checksum = checksum(to, hx_footprints_number(&plant->footprints.kept));
  memcpy(to, &head, sizeof head);
}

/* Returns whether this plant can continue a saved one, else sets its message. */
static hxStatus check_saved(hxPlant *plant, const unsigned char *bytes, size_t size,
                            hxSavedHead *head) {
  if (size != sizeof(hxSavedPlant)) {
    hx_print(plant->message, HX_MESSAGE_SIZE,
             "saved state: got %zu bytes, expected %zu; save it again with this version", size,
             sizeof(hxSavedPlant));
    return HX_BAD_STATE;
  }
  memcpy(head, bytes, sizeof *head);
  if (head->magic != magic || head->version != saved_version || head->size != size)
    return hx_plant_fail(
        plant, HX_BAD_STATE,
        "saved state: got one of another version, expected one of this version; save it again");
  const int footprints = hx_footprints_check(bytes + offsetof(hxSavedPlant, footprints));
  if (footprints < 0 || head->checksum != checksum(bytes, footprints))
    return hx_plant_fail(
        plant, HX_BAD_STATE,
        "saved state: got a damaged one, expected one whose checksum is right; save it again");
  if (head->terrain && (!plant->terrain || hx_terrain_checksum(plant->terrain) != head->terrain))
    return hx_plant_fail(
        plant, HX_BAD_STATE,
        "saved state: its ground is a grid that this plant does not have; set the one that "
        "it was saved with before");
  return HX_OK;
}

hxStatus hx_plant_set_state(hxPlant *plant, const void *bytes, size_t size) {
  const unsigned char *from = bytes;
  hxSavedHead head;
  const hxStatus status = check_saved(plant, from, size, &head);
  if (status != HX_OK) return status;
  memcpy(&plant->model, from + offsetof(hxSavedPlant, model), sizeof plant->model);
  memcpy(&plant->state, from + offsetof(hxSavedPlant, state), sizeof plant->state);
  plant->model.terrain = head.terrain ? plant->terrain : NULL;
  hx_plant_derive_feet(plant);
  hx_footprints_read(&plant->footprints, from + offsetof(hxSavedPlant, footprints));
  return HX_OK;
}
