/* component.h - what is inside an FMU: the layer of fmi/ drives it through these functions, which each component defines for itself.
 *
 * Its variables are struct hxVariables of its own generated/variables.h: at least a definition (parameters), an input and an output.
 * A component has no pointers and no hidden state: what get_state copies out is all there is.
 */
#ifndef HEXAPOD_FMI_COMPONENT_H
#define HEXAPOD_FMI_COMPONENT_H

#include "fmi/variables.h"

typedef struct hxComponent hxComponent;

hxComponent *hx_component_create(void); /* holding its defaults; NULL when out of memory */
void hx_component_destroy(hxComponent *component);

/* The definition and the input that are compiled in. */
void hx_component_defaults(struct hxVariables *variables);

/* Checks a definition. On failure message (HX_MESSAGE_SIZE bytes) says what, got, expected. */
hxStatus hx_component_check(const struct hxVariables *variables, char *message);

/* To the start at time t, by the definition; on failure unchanged but for the message. */
hxStatus hx_component_reset(hxComponent *component, const struct hxVariables *variables, double t);

/* To t_end exactly, under the input; on failure as before but for the message. */
hxStatus hx_component_step(hxComponent *component, const struct hxVariables *variables, double t_end);

/* The output at the present time under the input: nothing else changes. */
void hx_component_output(hxComponent *component, struct hxVariables *variables);

double hx_component_time(const hxComponent *component);
const char *hx_component_message(const hxComponent *component); /* of the last failure */

size_t hx_component_state_size(void);
void hx_component_get_state(const hxComponent *component, void *bytes);
hxStatus hx_component_set_state(hxComponent *component, const void *bytes); /* HX_BAD_STATE leaves it as it was */

#endif
