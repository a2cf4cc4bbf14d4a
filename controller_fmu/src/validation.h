/* validation.h - what a controller may be told. */
#ifndef HX_CONTROLLER_VALIDATION_H
#define HX_CONTROLLER_VALIDATION_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Every number of an input within its range; on failure message says what, got, expected. */
hxStatus hx_controller_input_check(const hxControllerInput *input, char *message);

HX_HIDDEN_END

#endif
