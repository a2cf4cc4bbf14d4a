/* controller.h - from body command and measurement to joint commands, one tick. Python:
 * controller/controller.py.
 *
 *   command -> ramp -> foot paths -> rolling -> posture -> inverse kinematics ---------> angle_ref,
 * speed_ref ^                                      |                           ^ hold inverse
 * dynamics -> support -> compliance -+-> torque_ref
 *                         ^------ measured angles, attitude          measured forces --^
 */
#ifndef HX_CONTROLLER_TICK_H
#define HX_CONTROLLER_TICK_H

#include "hexapod/inside.h"
#include "state.h"

HX_HIDDEN_BEGIN

void hx_controller_compile(const hxControllerDefinition *definition, hxControllerModel *model);

/* Standing in the stance, all memory cleared. */
void hx_controller_begin(const hxControllerModel *model, double t, hxControllerState *state);

/* One tick: the commands of this input are state->output. */
void hx_controller_tick(const hxControllerModel *model, const hxControllerInput *input,
                        hxControllerState *state);

HX_HIDDEN_END

#endif
