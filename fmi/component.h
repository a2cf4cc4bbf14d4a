/* component.h - what is inside an FMU: the layer of fmi/ drives it through these functions, which
 * each component defines for itself.
 *
 * Its variables are struct hxVariables of its own generated/variables.h: at least a definition
 * (parameters), an hxInput input and an output. A component has no pointers and no hidden state:
 * what get_state copies out is all there is.
 */
#ifndef HEXAPOD_FMI_COMPONENT_H
#define HEXAPOD_FMI_COMPONENT_H

#include "fmi/variables.h"

HX_HIDDEN_BEGIN

typedef struct hxComponent hxComponent;

hxComponent *hx_component_create(void); /* holding its defaults; NULL when out of memory */
void hx_component_destroy(hxComponent *component);

/* The definition and the input that are compiled in. */
void hx_component_defaults(struct hxVariables *variables);

/* Checks a definition. On failure message (HX_MESSAGE_SIZE bytes) says what, got, expected. */
hxStatus hx_component_check(const struct hxVariables *variables, char *message);

/* To the start at time t, by the definition; on failure unchanged but for the message. */
hxStatus hx_component_reset(hxComponent *component, const struct hxVariables *variables, double t);

/* To t_end exactly, under the input, which changes at a rate (NULL: is held); on failure as before
 * but for the message. */
hxStatus hx_component_step(hxComponent *component, const struct hxVariables *variables,
                           const hxInput *rate, double t_end);

/* The output at the present time under the input: nothing else changes. */
void hx_component_output(hxComponent *component, struct hxVariables *variables);

double hx_component_time(const hxComponent *component);
const char *hx_component_message(const hxComponent *component); /* of the last failure */

size_t hx_component_state_size(void);
void hx_component_get_state(const hxComponent *component, void *bytes);
hxStatus hx_component_set_state(hxComponent *component,
                                const void *bytes); /* HX_BAD_STATE leaves it as it was */

/* What a component with continuous states has besides. */
typedef struct hxContinuous {
  size_t state, rate; /* offsets in struct hxVariables of hx_state_count doubles each */
  size_t indicators;  /* events are where one of these changes its sign */

  /* Reads the state into the variables; puts the component there at time t. */
  void (*get)(const hxComponent *component, struct hxVariables *variables);
  hxStatus (*set)(hxComponent *component, const struct hxVariables *variables, double t);

  void (*rates)(hxComponent *component,
                struct hxVariables *variables); /* at the present time under the input */

  void (*completed)(
      hxComponent *component,
      const struct hxVariables *variables); /* the importer's step to the present state is */

  /* hx_component_step, but *event tells whether discrete variables changed on the way, and with
   * stop the step ends where the first did. Going on from there to the same end under the same
   * input gives, bit for bit, what the step would have given without the stop. */
  hxStatus (*step)(hxComponent *component, const struct hxVariables *variables, double t_end,
                   int stop, int *event);

  void (*indicate)(const hxComponent *component, double indicator[]);
  int (*update)(
      hxComponent *component,
      struct hxVariables *variables); /* what an event brings about; whether the state changed */

  /* Derivatives of output and rate along a change of input and state: rows of the same structure.
   */
  hxStatus (*tangent)(hxComponent *component, const struct hxVariables *variables,
                      const struct hxVariables *change, struct hxVariables *result);

  /* Sets the rates over time of those outputs that are integrals of the past and hence no functions
   * of state and input. */
  void (*integrals)(hxComponent *component, const struct hxVariables *variables,
                    struct hxVariables *result);
} hxContinuous;

extern const hxContinuous *const hx_continuous; /* NULL for a component without */

HX_HIDDEN_END

#endif
