/* component.h - the model inside an FMU: the files of fmi/ call it through these functions, which
 * each component (plant, controller) defines in its component.c.
 *
 * Its variables are struct hxVariables of its generated/variables.h: at least a definition
 * (parameters), an hxInput input and an output. A component has no pointers and no hidden state:
 * get_state copies its whole state.
 */
#ifndef HEXAPOD_FMI_COMPONENT_H
#define HEXAPOD_FMI_COMPONENT_H

#include <stdio.h>

#include "fmi/variables.h"

HX_HIDDEN_BEGIN

/* Opens a file of the resources for reading, whose path is UTF-8; NULL when it cannot be opened.
 * fmi/resources.c defines it for its own files and for the component's. */
FILE *hx_open_resource(const char *path);

typedef struct hxComponent hxComponent;

/* Creates a component with its defaults; NULL when out of memory. */
hxComponent *hx_component_create(void);
void hx_component_destroy(hxComponent *component);

/* Tells the component the folder of the FMU's resources, a path in UTF-8 that ends in a slash;
 * NULL: there is none. Returns HX_OUT_OF_MEMORY when out of memory. */
hxStatus hx_component_set_resources(hxComponent *component, const char *folder);

/* Sets definition and input to the compiled-in defaults. */
void hx_component_defaults(struct hxVariables *variables);

/* Checks a definition. On failure writes what was got and expected to message (HX_MESSAGE_SIZE
 * bytes). */
hxStatus hx_component_check(const struct hxVariables *variables, char *message);

/* Resets to the start of the definition at time t [s]; on failure changes the message only. */
hxStatus hx_component_reset(hxComponent *component, const struct hxVariables *variables, double t);

/* Steps to t_end [s] exactly, under the input, which changes at a rate [1/s] (NULL: is constant);
 * on failure changes the message only. */
hxStatus hx_component_step(hxComponent *component, const struct hxVariables *variables,
                           const hxInput *rate, double t_end);

/* Calculates groups of the output (hx_output_groups) at the present time under the input; may
 * calculate others too. */
void hx_component_output(hxComponent *component, struct hxVariables *variables, unsigned groups);

double hx_component_time(const hxComponent *component);
const char *hx_component_message(const hxComponent *component); /* of the last failure */

size_t hx_component_state_size(void);
void hx_component_get_state(const hxComponent *component, void *bytes);

/* Returns HX_BAD_STATE and changes nothing when the bytes are no state. */
hxStatus hx_component_set_state(hxComponent *component, const void *bytes);

/* Further functions of a component with continuous states. */
typedef struct hxContinuous {
  size_t state, rate; /* offsets in struct hxVariables of hx_state_count doubles each */
  size_t indicators;  /* number of event indicators; events are where one changes its sign */

  /* Returns whether, with the parameters in the variables, the states are the component's whole
   * state, as model exchange and derivatives need. */
  hxStatus (*check)(hxComponent *component, const struct hxVariables *variables);

  /* Copies the states to the variables; sets the component to the variables' states at time t. */
  void (*get)(const hxComponent *component, struct hxVariables *variables);
  hxStatus (*set)(hxComponent *component, const struct hxVariables *variables, double t);

  /* Calculates the rates of the states at the present time under the input. */
  void (*rates)(hxComponent *component, struct hxVariables *variables);

  /* The importer's solver has completed a step to the present state. */
  void (*completed)(hxComponent *component, const struct hxVariables *variables);

  /* As hx_component_step, but sets *event to whether discrete variables changed. With stop = 1 the
   * step ends where they first do, with 2 at the end of each step of the solver; further steps to
   * the same end under the same input then give, bit for bit, the result of the step without stop.
   */
  hxStatus (*step)(hxComponent *component, const struct hxVariables *variables, double t_end,
                   int stop, int *event);

  /* Changes the component's tunable parameters to those in the variables; sets the states in the
   * variables, which may change with it. On failure only the message changes. */
  hxStatus (*tune)(hxComponent *component, struct hxVariables *variables);

  /* Calculates the event indicators. */
  void (*indicate)(const hxComponent *component, double indicator[]);

  /* Handles an event; returns whether the states changed. */
  int (*update)(hxComponent *component, struct hxVariables *variables);

  /* Calculates derivatives of output and rate along a change of input, state and tunable
   * parameters.
   */
  hxStatus (*tangent)(hxComponent *component, const struct hxVariables *variables,
                      const struct hxVariables *change, struct hxVariables *result);

  /* Calculates the time derivatives of outputs that are integrals over time, which are no functions
   * of state and input. */
  void (*integrals)(hxComponent *component, const struct hxVariables *variables,
                    struct hxVariables *result);

  /* Size of a work space, and use of the caller's; see hexapod/shared_work.h. */
  size_t (*work_size)(void);
  hxStatus (*use_work)(hxComponent *component, void *memory, size_t size);
} hxContinuous;

/* NULL for a component without continuous states. */
extern const hxContinuous *const hx_continuous;

HX_HIDDEN_END

#endif
