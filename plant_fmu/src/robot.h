/* robot.h - compiles a definition into a model and its initial state */
#ifndef HX_ROBOT_H
#define HX_ROBOT_H

#include "state.h"

HX_HIDDEN_BEGIN

/* Computes two unit normals of a unit axis: a = axis x e with the coordinate direction e of the
 * axis's smallest component (the first of equal ones), b = axis x a. */
void hx_axis_normals(const double axis[3], double a[3], double b[3]);

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

/* Computes the command of an input given at a time, s. Its motors have no supply. */
void hx_command_from_input(hxCommand *command, const hxInput *input, double time);

/* Returns whether servos hold commands that a bus transmits, or rounded ones. */
int hx_has_bus(const hxModel *model);

/* Replaces the commands of joints by those that the servos have at the present time: rounded ones
 * where the bus transmits now, else those that they hold. */
void hx_bus_command(hxCommand *command, const hxModel *model, const hxState *state);

/* Does the same, and keeps commands that the bus transmits now. */
void hx_bus_send(hxCommand *command, const hxModel *model, hxState *state);

/* Returns the time of the next transmission if it is before t_end, else t_end, s. */
double hx_bus_end(const hxModel *model, const hxState *state, double t_end);

/* Sets what the motors get from their supply in a command: the shares of their duty limits by the
 * temperatures of their windings (eq. 52), and the supply's voltage under the currents of this
 * command at the last moment (eq. 53). */
void hx_command_supply(hxCommand *command, const hxModel *model, const hxState *state);

HX_HIDDEN_END

#endif
