/* validation.h - checks of inputs; hx_definition_check is public */
#ifndef HX_VALIDATION_H
#define HX_VALIDATION_H

#include "hexapod/hexapod.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Checks the ranges of an input. message: HX_MESSAGE_SIZE bytes, written on failure only; may be
 * NULL. */
hxStatus hx_input_check(const hxInput *input, char *message);

int hx_has_elastic_gears(const hxDefinition *definition);

/* Writes why coordinates are not the state of a robot with elastic gears; message as above. */
hxStatus hx_refuse_elastic_gears(char *message);

HX_HIDDEN_END

#endif
