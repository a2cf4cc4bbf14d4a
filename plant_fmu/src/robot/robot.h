/* robot.h - compiles a definition into a model and its initial state */
#ifndef HX_ROBOT_H
#define HX_ROBOT_H

#include "../state.h"

HX_HIDDEN_BEGIN

/* Computes the model of a checked definition; terrain: its ground if that is a grid. */
void hx_model_compile(hxModel *model, const hxDefinition *definition, const hxTerrain *terrain);

/* Computes the initial states of all bodies from the definition's torso and joint states; the
 * constraints are satisfied exactly. */
void hx_initial_bodies(const hxDefinition *definition, double body[HX_BODIES][HX_BODY_STATE]);

/* Convert between body states of hexapod.h, in link axes, and a motion, in joint axes. */
void hx_motion_from_bodies(const hxModel *model, const double body[HX_BODIES][HX_BODY_STATE],
                           hxPlantMotion *motion);
void hx_bodies_from_motion(const hxModel *model, const hxPlantMotion *motion,
                           double body[HX_BODIES][HX_BODY_STATE]);

HX_HIDDEN_END

#endif
