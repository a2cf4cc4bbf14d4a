/* robot.h - from a definition to a checked, compiled model and its initial state */
#ifndef HX_ROBOT_H
#define HX_ROBOT_H

#include "state.h"

HX_HIDDEN_BEGIN

/* Two unit normals to a unit axis: a = axis x (the coordinate direction it is least along, the
 * first on ties), b = axis x a. */
void hx_axis_normals(const double axis[3], double a[3], double b[3]);

void hx_model_compile(hxModel *model, const hxDefinition *definition);

/* All bodies where the definition's initial torso and joint states put them: on the constraints
 * exactly. */
void hx_initial_bodies(const hxDefinition *definition, double body[HX_BODIES][HX_BODY_STATE]);

/* Between the bodies of hexapod.h, in link axes, and a motion, in joint axes. */
void hx_motion_from_bodies(const hxModel *model, const double body[HX_BODIES][HX_BODY_STATE],
                           hxPlantMotion *motion);
void hx_bodies_from_motion(const hxModel *model, const hxPlantMotion *motion,
                           double body[HX_BODIES][HX_BODY_STATE]);

void hx_command_from_input(hxCommand *command, const hxInput *input, double time);

HX_HIDDEN_END

#endif
