/* parts.h - what the files of the plant's calls share */
#ifndef HX_PARTS_H
#define HX_PARTS_H

#include <stddef.h>

#include "../state.h"

HX_HIDDEN_BEGIN

/* Sets the plant's message and returns the status. */
hxStatus hx_plant_fail(hxPlant *plant, hxStatus status, const char *text);

/* Sets the model with the rows of feet alone, after every change of the model. */
void hx_plant_derive_feet(hxPlant *plant);

/* Sets the stops in force to those of the robot and of the state's locks. */
void hx_plant_derive_stops(hxPlant *plant);

/* Computes the command of an input at the present time. */
void hx_plant_command(const hxPlant *plant, const hxInput *input, hxCommand *command);

/* Returns the largest magnitude of so_far and n numbers; NaN or infinity persists. */
double hx_largest(double so_far, const void *first, size_t n);

/* Returns whether a quaternion is long enough to be normalised. */
int hx_is_attitude(const double q[4]);

/* Returns whether a definition's ground is there and suits its contacts; else writes why not. */
hxStatus hx_plant_check_terrain(hxPlant *plant, const hxDefinition *d, char *message);

/* Fails if feet, torso, knees, shanks, or lines of two legs, start so deep in the ground or in each
 * other that the contact law does not hold. The kernel has started the state. */
hxStatus hx_plant_check_start(const hxPlant *plant, char message[HX_MESSAGE_SIZE]);

HX_HIDDEN_END

#endif
