/* component.c - the policy as an FMU's component */
#include "fmi/component.h"

static hxPolicy *policy_of(hxComponent *component) { return (hxPolicy *)component; }
static const hxPolicy *const_policy(const hxComponent *component) {
  return (const hxPolicy *)component;
}

hxComponent *hx_component_create(void) { return (hxComponent *)hx_policy_create(); }

void hx_component_destroy(hxComponent *component) { hx_policy_destroy(policy_of(component)); }

hxStatus hx_component_set_resources(hxComponent *component, const char *folder) {
  (void)component, (void)folder; /* the policy reads no files */
  return HX_OK;
}

void hx_component_defaults(struct hxVariables *variables) {
  hx_policy_definition_default(&variables->definition);
  hx_policy_input_default(&variables->input);
}

hxStatus hx_component_check(const struct hxVariables *variables, char *message) {
  return hx_policy_definition_check(&variables->definition, message);
}

hxStatus hx_component_reset(hxComponent *component, const struct hxVariables *variables, double t) {
  return hx_policy_reset(policy_of(component), &variables->definition, t);
}

hxStatus hx_component_step(hxComponent *component, const struct hxVariables *variables,
                           const hxInput *rate, double t_end) {
  return hx_policy_step(policy_of(component), &variables->input, rate, t_end);
}

void hx_component_output(hxComponent *component, struct hxVariables *variables, unsigned groups) {
  (void)groups; /* there is one */
  hx_policy_output(policy_of(component), &variables->input, &variables->output);
}

double hx_component_time(const hxComponent *component) {
  return hx_policy_time(const_policy(component));
}

const char *hx_component_message(const hxComponent *component) {
  return hx_policy_message(const_policy(component));
}

size_t hx_component_state_size(void) { return hx_policy_state_size(); }

void hx_component_get_state(const hxComponent *component, void *bytes) {
  hx_policy_get_state(const_policy(component), bytes);
}

hxStatus hx_component_set_state(hxComponent *component, const void *bytes) {
  return hx_policy_set_state(policy_of(component), bytes);
}

const hxContinuous *const hx_continuous = NULL;
