/* validation.h - checks of definitions and inputs. */
#ifndef HX_CONTROLLER_VALIDATION_H
#define HX_CONTROLLER_VALIDATION_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Checks the range of every number of an input. On failure message says which value was got and
 * what was expected. */
hxStatus hx_controller_input_check(const hxControllerInput *input, char *message);

HX_HIDDEN_END

#endif
