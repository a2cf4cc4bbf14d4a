/* component.c - connects the plant to the FMI layer, and reads grids of the ground from the FMU's
 * resources */
#include "fmi/component.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hexapod/message.h"

struct hxComponent {
  hxPlant *plant;
  hxTerrain *terrain; /* of the grid below; NULL: none was read */
  double grid;        /* its number */
  char *resources;    /* folder of the FMU's resources, NULL: none */
  char message[HX_MESSAGE_SIZE];
};

hxComponent *hx_component_create(void) {
  hxComponent *component = calloc(1, sizeof *component);
  if (!component) return NULL;
  component->plant = hx_plant_create();
  if (component->plant) return component;
  free(component);
  return NULL;
}

void hx_component_destroy(hxComponent *component) {
  hx_plant_destroy(component->plant);
  hx_terrain_destroy(component->terrain);
  free(component->resources);
  free(component);
}

hxStatus hx_component_set_resources(hxComponent *component, const char *folder) {
  if (!folder) return HX_OK;
  component->resources = malloc(strlen(folder) + 1);
  if (!component->resources) return HX_OUT_OF_MEMORY;
  strcpy(component->resources, folder);
  return HX_OK;
}

/* ---- grids ---- */

/* Returns the bytes of a file, to be freed by the caller; NULL when it cannot be read, or when out
 * of memory, which *short_of_memory tells. */
static void *read_bytes(const char *path, size_t *size, int *short_of_memory) {
  FILE *file = hx_open_resource(path);
  char *bytes = NULL;
  *short_of_memory = 0;
  if (!file) return NULL;
  const long length = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
  if (length > 0 && fseek(file, 0, SEEK_SET) == 0) {
    bytes = malloc((size_t)length);
    *short_of_memory = !bytes;
  }
  *size = length > 0 ? (size_t)length : 0;
  if (bytes && fread(bytes, 1, *size, file) != *size) {
    free(bytes);
    bytes = NULL;
  }
  fclose(file);
  return bytes;
}

/* Writes what is wrong with a grid to the component's message; returns NULL. file: that of the
 * grid in the resources, their folder where the number names none. */
static hxTerrain *refuse_grid(hxComponent *component, double grid, const char *file,
                              const char *what) {
  const char *folder = component->resources ? component->resources : "(no resources)/";
  hx_print(component->message, HX_MESSAGE_SIZE,
           "terrain.grid: got %.9g, expected the number of a grid in the FMU's resources "
           "(%.160s%s); %.200s",
           grid, folder, file, what);
  return NULL;
}

/* Reads a grid of the resources. */
static hxTerrain *read_grid(hxComponent *component, double grid) {
  char name[48], message[HX_MESSAGE_SIZE];
  size_t size = 0;
  int short_of_memory;
  if (grid != floor(grid)) return refuse_grid(component, grid, "terrain/", "give a whole number");
  hx_print(name, sizeof name, "terrain/%.0f.terrain", grid);
  if (!component->resources)
    return refuse_grid(component, grid, name, "instantiate the FMU with the path of its resources");
  char *path = malloc(strlen(component->resources) + strlen(name) + 1);
  if (!path) return refuse_grid(component, grid, name, "out of memory; free some and try again");
  strcpy(path, component->resources);
  strcat(path, name);
  void *bytes = read_bytes(path, &size, &short_of_memory);
  free(path);
  if (!bytes)
    return refuse_grid(
        component, grid, name,
        short_of_memory
            ? "out of memory; free some and try again"
            : "the file is missing or cannot be read; export the FMU with that terrain");
  hxTerrain *terrain = hx_terrain_create(bytes, size, message);
  free(bytes);
  return terrain ? terrain : refuse_grid(component, grid, name, message);
}

/* Sets *terrain to a grid: the one that is there, or one read from the resources. */
static hxStatus find_grid(hxComponent *component, double grid, hxTerrain **terrain) {
  component->message[0] = '\0';
  *terrain = component->terrain && component->grid == grid ? component->terrain
                                                           : read_grid(component, grid);
  return *terrain ? HX_OK : HX_INVALID_ARGUMENT;
}

/* Keeps a grid that the plant has taken, or frees one that it has not. */
static void keep_grid(hxComponent *component, double grid, hxTerrain *terrain, hxStatus status) {
  if (terrain == component->terrain) return;
  hx_terrain_destroy(status == HX_OK ? component->terrain : terrain);
  if (status == HX_OK) component->terrain = terrain, component->grid = grid;
  hx_plant_set_terrain(component->plant, component->terrain);
}

void hx_component_defaults(struct hxVariables *variables) {
  hx_definition_default(&variables->definition);
  hx_input_default(&variables->input);
}

hxStatus hx_component_check(const struct hxVariables *variables, char *message) {
  return hx_definition_check(&variables->definition, message);
}

hxStatus hx_component_reset(hxComponent *component, const struct hxVariables *variables, double t) {
  const hxDefinition *definition = &variables->definition;
  hxTerrain *terrain = NULL;
  const double grid = definition->terrain.grid;
  hxStatus status = HX_OK;
  component->message[0] = '\0';
  if (definition->terrain.kind == HX_TERRAIN_GRID) status = find_grid(component, grid, &terrain);
  if (status != HX_OK) return status;
  hx_plant_set_terrain(component->plant, terrain);
  status = hx_plant_reset(component->plant, definition, t);
  keep_grid(component, grid, terrain, status);
  return status;
}

hxStatus hx_component_step(hxComponent *component, const struct hxVariables *variables,
                           const hxInput *rate, double t_end) {
  return hx_plant_step_ramp(component->plant, &variables->input, rate, t_end);
}

static hxStatus tune(hxComponent *component, struct hxVariables *variables) {
  const hxStatus status = hx_plant_tune(component->plant, &variables->definition);
  component->message[0] = '\0';
  if (status == HX_OK) hx_plant_get_coordinates(component->plant, &variables->state);
  return status;
}

void hx_component_output(hxComponent *component, struct hxVariables *variables, unsigned groups) {
  hx_plant_output_groups(component->plant, &variables->input, groups & HX_OUTPUT_ALL,
                         &variables->output);
}

double hx_component_time(const hxComponent *component) { return hx_plant_time(component->plant); }

const char *hx_component_message(const hxComponent *component) {
  return component->message[0] ? component->message : hx_plant_message(component->plant);
}

/* A saved state: the number of the grid that was read last, 0: none; then the plant's state. */
size_t hx_component_state_size(void) { return sizeof(double) + hx_plant_state_size(); }

void hx_component_get_state(const hxComponent *component, void *bytes) {
  const double grid = component->terrain ? component->grid : 0.0;
  memcpy(bytes, &grid, sizeof grid);
  hx_plant_get_state(component->plant, (char *)bytes + sizeof grid);
}

hxStatus hx_component_set_state(hxComponent *component, const void *bytes) {
  hxTerrain *terrain = NULL;
  double grid;
  memcpy(&grid, bytes, sizeof grid);
  if (grid != 0.0 && find_grid(component, grid, &terrain) != HX_OK) return HX_BAD_STATE;
  hx_plant_set_terrain(component->plant, terrain);
  const hxStatus status = hx_plant_set_state(component->plant, (const char *)bytes + sizeof grid,
                                             hx_plant_state_size());
  keep_grid(component, grid, terrain, status);
  return status;
}

/* ---- model exchange ---- */

static hxStatus check_states(hxComponent *component, const struct hxVariables *variables) {
  return hx_definition_check_coordinates(&variables->definition, component->message);
}

static void get_state(const hxComponent *component, struct hxVariables *variables) {
  hx_plant_get_coordinates(component->plant, &variables->state);
}

static hxStatus set_state(hxComponent *component, const struct hxVariables *variables, double t) {
  return hx_plant_set_coordinates(component->plant, t, &variables->state);
}

static void rates(hxComponent *component, struct hxVariables *variables) {
  hx_plant_rates(component->plant, &variables->input, &variables->rate);
  hx_plant_indicators(component->plant, &variables->indicator);
}

static void completed(hxComponent *component, const struct hxVariables *variables) {
  hx_plant_completed_step(component->plant, &variables->input);
}

static hxStatus step(hxComponent *component, const struct hxVariables *variables, double t_end,
                     int stop, int *event) {
  return hx_plant_step_to_event(component->plant, &variables->input, t_end, stop, event);
}

static void indicate(const hxComponent *component, double indicator[]) {
  hxIndicators all;
  hx_plant_indicators(component->plant, &all);
  memcpy(indicator, &all, sizeof all);
}

/* Updates contacts and locks; events set bristles, and the loss of a lock that is released. */
static int update(hxComponent *component, struct hxVariables *variables) {
  hxCoordinates now;
  const int moved = hx_plant_update_contacts(component->plant);
  if (!hx_plant_update_locks(component->plant, &variables->input) && !moved) return 0;
  hx_plant_get_coordinates(component->plant, &now);
  variables->state.dissipated = now.dissipated;
  memcpy(variables->state.bristle, now.bristle, sizeof now.bristle);
  return 1;
}

static hxStatus tangent(hxComponent *component, const struct hxVariables *variables,
                        const struct hxVariables *change, struct hxVariables *result) {
  const hxParameterChange parameters = {&variables->definition, &change->definition};
  const hxStatus status =
      hx_plant_tangent_by(component->plant, &variables->input, &parameters, &change->input,
                          &change->state, &result->rate, &result->output);
  result->indicator = result->output.depth;
  return status;
}

static void integrals(hxComponent *component, const struct hxVariables *variables,
                      struct hxVariables *result) {
  hx_plant_integral_rates(component->plant, &variables->input, &result->output);
}

static hxStatus use_work(hxComponent *component, void *memory, size_t size) {
  const hxStatus status = hx_plant_use_work(component->plant, memory, size);
  component->message[0] = '\0';
  return status;
}

static const hxContinuous continuous = {
    .state = offsetof(struct hxVariables, state),
    .rate = offsetof(struct hxVariables, rate),
    .indicators = HX_INDICATORS,
    .check = check_states,
    .get = get_state,
    .set = set_state,
    .rates = rates,
    .completed = completed,
    .step = step,
    .tune = tune,
    .indicate = indicate,
    .update = update,
    .tangent = tangent,
    .integrals = integrals,
    .work_size = hx_work_size,
    .use_work = use_work,
};

const hxContinuous *const hx_continuous = &continuous;
