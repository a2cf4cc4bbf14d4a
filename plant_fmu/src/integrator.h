/* integrator.h - from one time to another, stopping at every touch-down */
#ifndef HX_INTEGRATOR_H
#define HX_INTEGRATOR_H

#include "state.h"

/* Advances the state to t_end exactly. On failure the state is somewhere on the way and the message says why. */
HX_LOCAL hxStatus hx_integrate(const hxModel *model, const hxCommand *command, double t_end, hxState *state, char *message);

#endif
