/* controller.h - the controller: joint commands from a body velocity and from foot forces, once a
 * period.
 *
 * The C form of controller/ (Python), to round-off: the same files, names and laws, one step at a
 * time. SI units, frames and orders as in hexapod.h (docs/architecture.md). A controller has no
 * pointers, no globals and no hidden state: its bytes are its state. After create nothing
 * allocates, prints or exits.
 */
#ifndef HEXAPOD_CONTROLLER_H
#define HEXAPOD_CONTROLLER_H

#include "hexapod/generated/controller_settings.h"
#include "hexapod/legs.h"
#include "hexapod/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* hxControllerDefinition (generated/controller_settings.h) is the controller's model of the robot,
 * the gait and the laws: joint axes are z, -y, y (docs/architecture.md). hxControllerInput holds
 * command and measurements,
 * hxControllerOutput the joint commands and what recorders see. */

typedef struct hxController hxController;

HX_API void hx_controller_definition_default(hxControllerDefinition *definition);
HX_API void hx_controller_input_default(
    hxControllerInput *input); /* no command, no forces, joints in the stance */

/* Sets *range to the ranges of all numbers of the structure; returns how many there are. */
HX_API size_t hx_controller_definition_ranges(const hxRange **range);
HX_API size_t hx_controller_input_ranges(const hxRange **range);

/* Checks a definition. On failure message (HX_MESSAGE_SIZE bytes, may be NULL) says which value was
 * got and what was expected. */
HX_API hxStatus hx_controller_definition_check(const hxControllerDefinition *definition,
                                               char *message);

/* Allocates a controller of the default robot at time 0; NULL when out of memory. */
HX_API hxController *hx_controller_create(void);
HX_API void hx_controller_destroy(hxController *controller);

/* Resets to standing in the stance, with the first tick at time t. On failure only the message
 * changes. */
HX_API hxStatus hx_controller_reset(hxController *controller,
                                    const hxControllerDefinition *definition, double t);

/* Changes the gait while the robot walks: legs in the air finish their steps, no other leg lifts
 * off, and the next gait begins with the feet where they are (C55). On failure only the message
 * changes. */
HX_API hxStatus hx_controller_change_gait(hxController *controller, const hxGait *gait);
HX_API const hxGait *hx_controller_gait(const hxController *controller); /* asked for last */

/* Changes the control (hxControl) while the robot walks: the next one goes on in the present phase
 * of the walk, its laws begin anew, and the joint commands fade over in 0.4 s. Before the first
 * tick it begins as after a reset. On failure only the message changes. */
HX_API hxStatus hx_controller_change_control(hxController *controller, int control);
HX_API int hx_controller_control(const hxController *controller);

/* Computes the joint commands at the present time: those of this input when a tick is due,
 * otherwise those of the last tick. The state does not change; the result is kept for the step that
 * follows under the same input. */
HX_API void hx_controller_output(hxController *controller, const hxControllerInput *input,
                                 hxControllerOutput *output);

/* Steps to t_end >= time under this input, which changes at a rate (1/s; NULL: is constant), and
 * executes all ticks before t_end. On failure only the message changes. */
HX_API hxStatus hx_controller_step(hxController *controller, const hxControllerInput *input,
                                   const hxControllerInput *rate, double t_end);

HX_API double hx_controller_time(const hxController *controller);
HX_API const char *
hx_controller_message(const hxController *controller); /* of the last failure, "" before any */

/* Save and restore the controller as bytes. HX_BAD_STATE: they are damaged, and the controller
 * is unchanged. */
HX_API size_t hx_controller_state_size(void);
HX_API void hx_controller_get_state(const hxController *controller, void *bytes);
HX_API hxStatus hx_controller_set_state(hxController *controller, const void *bytes);

#ifdef __cplusplus
}
#endif
#endif
