/* validation.h - checks of inputs; hx_definition_check is public */
#ifndef HX_VALIDATION_H
#define HX_VALIDATION_H

#include "hexapod/hexapod.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Checks the ranges of an input. message: HX_MESSAGE_SIZE bytes, written on failure only; may be
 * NULL. */
hxStatus hx_input_check(const hxInput *input, char *message);

HX_HIDDEN_END

#endif
