/* command.h - what the servos get: an input's commands, over a bus, with the motors' supply */
#ifndef HX_COMMAND_H
#define HX_COMMAND_H

#include "../state.h"

HX_HIDDEN_BEGIN

/* Computes the command of an input given at a time, s. Its motors have no supply. */
void hx_command_from_input(hxCommand *command, const hxInput *input, double time);

/* Returns whether servos hold commands that a bus transmits, or rounded ones. */
int hx_has_bus(const hxModel *model);

/* Replaces the commands of joints by those that the servos have at the present time: rounded ones
 * where the bus transmits now, else those that they hold. */
void hx_held_commands(hxCommand *command, const hxModel *model, const hxState *state);

/* Does the same, and keeps commands that the bus transmits now. */
void hx_bus_send(hxCommand *command, const hxModel *model, hxState *state);

/* Returns the time of the next transmission if it is before t_end, else t_end, s. */
double hx_bus_end(const hxModel *model, const hxState *state, double t_end);

/* Replaces commanded angles by the firmware's setpoints at the present time. */
void hx_setpoints(hxCommand *command, const hxModel *model, const hxState *state);

/* Moves the setpoints to the present time, and sets the speeds at which they follow the commanded
 * angles until t_end, s. */
void hx_follow_goals(const hxCommand *goal, const hxModel *model, hxState *state, double t_end);

/* Adds a call's length h, s, to the times of the duties that are above the overload limit under its
 * last command, at the last moment (eq. 58). */
void hx_count_overload(const hxCommand *command, const hxModel *model, hxState *state, double h);

/* Sets what the motors get from their supply in a command: the shares of their duty limits by the
 * temperatures of their windings (eq. 52) and the overload protection (eq. 58), and the supply's
 * voltage under the currents of this command at the last moment (eq. 53). */
void hx_supply_power(hxCommand *command, const hxModel *model, const hxState *state);

HX_HIDDEN_END

#endif
