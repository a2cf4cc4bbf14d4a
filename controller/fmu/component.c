/* component.c - the controller as an FMU's component */
#include "fmi/component.h"

#include <stdlib.h>
#include <string.h>

#include "src/state.h"

struct hxComponent {
  hxController controller;
  hxController next; /* memory of a call that changes the walk; threads may have small stacks */
};

hxComponent *hx_component_create(void) {
  hxControllerDefinition definition;
  hxComponent *component = calloc(1, sizeof *component);
  if (!component) return NULL;
  hx_controller_definition_default(&definition);
  hx_controller_reset(&component->controller, &definition, 0.0);
  return component;
}

void hx_component_destroy(hxComponent *component) { free(component); }

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
  return hx_controller_reset(&component->controller, &variables->definition, t);
}

static int is_same_gait(const hxGait *a, const hxGait *b) {
  int same = a->pattern == b->pattern && a->period == b->period && a->duty == b->duty &&
             a->step_height == b->step_height && a->touchdown_speed == b->touchdown_speed &&
             a->narrowing == b->narrowing;
  for (int leg = 0; leg < HX_LEGS; ++leg) same &= a->offset[leg] == b->offset[leg];
  return same;
}

/* Returns whether the controller has the control and the gait of the parameters, which are tunable.
 */
static int is_same_walk(const hxController *controller, const struct hxVariables *variables) {
  return variables->definition.control == hx_controller_control(controller) &&
         is_same_gait(&variables->definition.gait, hx_controller_gait(controller));
}

/* Changes control and gait to those of the parameters. */
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

/* Changes the walk and steps, on a copy, so that a refusal of either change or of the step leaves
 * the controller as it was. */
static hxStatus step_in_another_walk(hxComponent *component, const struct hxVariables *variables,
                                     const hxInput *rate, double t_end) {
  hxController *controller = &component->controller, *next = &component->next;
  *next = *controller;
  hxStatus status = follow(next, variables);
  if (status == HX_OK) status = hx_controller_step(next, &variables->input, rate, t_end);
  if (status == HX_OK)
    *controller = *next;
  else
    memcpy(controller->message, next->message, sizeof next->message);
  return status;
}

hxStatus hx_component_step(hxComponent *component, const struct hxVariables *variables,
                           const hxInput *rate, double t_end) {
  hxController *controller = &component->controller;
  if (is_same_walk(controller, variables))
    return hx_controller_step(controller, &variables->input, rate, t_end);
  return step_in_another_walk(component, variables, rate, t_end);
}

/* Calculates the output after a change of the walk, which only a step makes: on a copy, so that no
 * reading changes the controller. A refused change is not shown; the step reports it. */
static void output_in_another_walk(hxComponent *component, struct hxVariables *variables) {
  hxController *next = &component->next;
  *next = component->controller;
  if (follow(next, variables) != HX_OK) *next = component->controller;
  hx_controller_output(next, &variables->input, &variables->output);
}

void hx_component_output(hxComponent *component, struct hxVariables *variables, unsigned groups) {
  hxController *controller = &component->controller;
  (void)groups; /* there is one */
  if (is_same_walk(controller, variables))
    hx_controller_output(controller, &variables->input, &variables->output);
  else
    output_in_another_walk(component, variables);
}

double hx_component_time(const hxComponent *component) {
  return hx_controller_time(&component->controller);
}

const char *hx_component_message(const hxComponent *component) {
  return hx_controller_message(&component->controller);
}

size_t hx_component_state_size(void) { return hx_controller_state_size(); }

void hx_component_get_state(const hxComponent *component, void *bytes) {
  hx_controller_get_state(&component->controller, bytes);
}

hxStatus hx_component_set_state(hxComponent *component, const void *bytes) {
  return hx_controller_set_state(&component->controller, bytes);
}

const hxContinuous *const hx_continuous = NULL;
