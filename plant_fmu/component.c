/* component.c - connects the plant to the FMI layer */
#include "fmi/component.h"

#include <string.h>

static hxPlant *plant_of(hxComponent *component) { return (hxPlant *)component; }
static const hxPlant *const_plant(const hxComponent *component) {
  return (const hxPlant *)component;
}

hxComponent *hx_component_create(void) { return (hxComponent *)hx_plant_create(); }

void hx_component_destroy(hxComponent *component) { hx_plant_destroy(plant_of(component)); }

void hx_component_defaults(struct hxVariables *variables) {
  hx_definition_default(&variables->definition);
  hx_input_default(&variables->input);
}

hxStatus hx_component_check(const struct hxVariables *variables, char *message) {
  return hx_definition_check(&variables->definition, message);
}

hxStatus hx_component_reset(hxComponent *component, const struct hxVariables *variables, double t) {
  return hx_plant_reset(plant_of(component), &variables->definition, t);
}

hxStatus hx_component_step(hxComponent *component, const struct hxVariables *variables,
                           const hxInput *rate, double t_end) {
  return hx_plant_step_ramp(plant_of(component), &variables->input, rate, t_end);
}

void hx_component_output(hxComponent *component, struct hxVariables *variables) {
  hx_plant_output(plant_of(component), &variables->input, &variables->output);
}

double hx_component_time(const hxComponent *component) {
  return hx_plant_time(const_plant(component));
}

const char *hx_component_message(const hxComponent *component) {
  return hx_plant_message(const_plant(component));
}

size_t hx_component_state_size(void) { return hx_plant_state_size(); }

void hx_component_get_state(const hxComponent *component, void *bytes) {
  hx_plant_get_state(const_plant(component), bytes);
}

hxStatus hx_component_set_state(hxComponent *component, const void *bytes) {
  return hx_plant_set_state(plant_of(component), bytes, hx_plant_state_size());
}

/* ---- model exchange ---- */

static void get_state(const hxComponent *component, struct hxVariables *variables) {
  hx_plant_get_coordinates(const_plant(component), &variables->state);
}

static hxStatus set_state(hxComponent *component, const struct hxVariables *variables, double t) {
  return hx_plant_set_coordinates(plant_of(component), t, &variables->state);
}

static void rates(hxComponent *component, struct hxVariables *variables) {
  hx_plant_rates(plant_of(component), &variables->input, &variables->rate);
  hx_plant_indicators(const_plant(component), variables->indicator);
}

static void completed(hxComponent *component, const struct hxVariables *variables) {
  hx_plant_completed_step(plant_of(component), &variables->input);
}

static hxStatus step(hxComponent *component, const struct hxVariables *variables, double t_end,
                     int stop, int *event) {
  return hx_plant_step_to_event(plant_of(component), &variables->input, t_end, stop, event);
}

static void indicate(const hxComponent *component, double indicator[]) {
  hx_plant_indicators(const_plant(component), indicator);
}

/* Updates the contacts; bristles are the only states that an event sets. */
static int update(hxComponent *component, struct hxVariables *variables) {
  hxCoordinates now;
  if (!hx_plant_update_contacts(plant_of(component))) return 0;
  hx_plant_get_coordinates(const_plant(component), &now);
  memcpy(variables->state.bristle, now.bristle, sizeof now.bristle);
  return 1;
}

static hxStatus tangent(hxComponent *component, const struct hxVariables *variables,
                        const struct hxVariables *change, struct hxVariables *result) {
  const hxStatus status = hx_plant_tangent(plant_of(component), &variables->input, &change->input,
                                           &change->state, &result->rate, &result->output);
  memcpy(result->indicator, result->output.foot.penetration, sizeof result->indicator);
  return status;
}

static void integrals(hxComponent *component, const struct hxVariables *variables,
                      struct hxVariables *result) {
  hx_plant_integral_rates(plant_of(component), &variables->input, &result->output);
}

static const hxContinuous continuous = {
    .state = offsetof(struct hxVariables, state),
    .rate = offsetof(struct hxVariables, rate),
    .indicators = HX_LEGS,
    .get = get_state,
    .set = set_state,
    .rates = rates,
    .completed = completed,
    .step = step,
    .indicate = indicate,
    .update = update,
    .tangent = tangent,
    .integrals = integrals,
};

const hxContinuous *const hx_continuous = &continuous;
