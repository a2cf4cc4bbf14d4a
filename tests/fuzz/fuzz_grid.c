/* fuzz_grid.c - bytes are a grid file (hexapod/terrain.h); the plant stands on each valid one. */
#include "fuzz.h"

#include "hexapod/hexapod.h"

static void stand(const hxTerrain *terrain) {
  static hxPlant *plant;
  hxDefinition definition;
  hxInput input;
  hxOutput output;
  if (!plant) plant = hx_plant_create();
  REQUIRE(plant);
  hx_definition_default(&definition);
  hx_input_default(&input);
  definition.terrain.kind = HX_TERRAIN_GRID;
  hx_plant_set_terrain(plant, terrain);
  if (hx_plant_reset(plant, &definition, 0.0) == HX_OK) {
    hx_plant_step(plant, &input, 0.004);
    hx_plant_output(plant, &input, &output);
  }
  hx_plant_set_terrain(plant, NULL);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  char message[HX_MESSAGE_SIZE] = "";
  void *bytes = room(size, 1);
  memcpy(bytes, data, size);
  hxTerrain *terrain = hx_terrain_create(bytes, size, message);
  free(bytes);
  REQUIRE(terrain || (message[0] && strlen(message) < sizeof message));
  if (!terrain) return 0;
  stand(terrain);
  hx_terrain_destroy(terrain);
  return 0;
}
