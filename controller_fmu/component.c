/* component.c - the controller as an FMU's component */
#include "fmi/component.h"

static hxController *controller_of(hxComponent *component) { return (hxController *)component; }
static const hxController *const_controller(const hxComponent *component) {
  return (const hxController *)component;
}

hxComponent *hx_component_create(void) { return (hxComponent *)hx_controller_create(); }

void hx_component_destroy(hxComponent *component) {
  hx_controller_destroy(controller_of(component));
}

hxStatus hx_component_set_resources(hxComponent *component, const char *folder) {
  (void)component, (void)folder; /* the controller reads no files */
  return HX_OK;
}

void hx_component_defaults(struct hxVariables *variables) {
  hx_controller_definition_default(&variables->definition);
  hx_controller_input_default(&variables->input);
}

hxStatus hx_component_check(const struct hxVariables *variables, char *message) {
  return hx_controller_definition_check(&variables->definition, message);
}

hxStatus hx_component_reset(hxComponent *component, const struct hxVariables *variables, double t) {
  return hx_controller_reset(controller_of(component), &variables->definition, t);
}

static int is_same_gait(const hxGait *a, const hxGait *b) {
  int same = a->pattern == b->pattern && a->period == b->period && a->duty == b->duty &&
             a->step_height == b->step_height && a->touchdown_speed == b->touchdown_speed &&
             a->narrowing == b->narrowing;
  for (int leg = 0; leg < HX_LEGS; ++leg) same &= a->offset[leg] == b->offset[leg];
  return same;
}

/* Changes control and gait to those of the parameters, which are tunable. */
static hxStatus follow(hxController *controller, const struct hxVariables *variables) {
  const hxGait *wanted = &variables->definition.gait;
  const int control = variables->definition.control;
  if (control != hx_controller_control(controller)) {
    const hxStatus status = hx_controller_change_control(controller, control);
    if (status != HX_OK) return status;
  }
  if (is_same_gait(wanted, hx_controller_gait(controller))) return HX_OK;
  return hx_controller_change_gait(controller, wanted);
}

hxStatus hx_component_step(hxComponent *component, const struct hxVariables *variables,
                           const hxInput *rate, double t_end) {
  const hxStatus status = follow(controller_of(component), variables);
  if (status != HX_OK) return status;
  return hx_controller_step(controller_of(component), &variables->input, rate, t_end);
}

void hx_component_output(hxComponent *component, struct hxVariables *variables, unsigned groups) {
  (void)groups; /* there is one */
  (void)follow(controller_of(component), variables); /* a step reports a refusal */
  hx_controller_output(controller_of(component), &variables->input, &variables->output);
}

double hx_component_time(const hxComponent *component) {
  return hx_controller_time(const_controller(component));
}

const char *hx_component_message(const hxComponent *component) {
  return hx_controller_message(const_controller(component));
}

size_t hx_component_state_size(void) { return hx_controller_state_size(); }

void hx_component_get_state(const hxComponent *component, void *bytes) {
  hx_controller_get_state(const_controller(component), bytes);
}

hxStatus hx_component_set_state(hxComponent *component, const void *bytes) {
  return hx_controller_set_state(controller_of(component), bytes, hx_controller_state_size());
}

const hxContinuous *const hx_continuous = NULL;
