/* laws.h - compiles the laws and settings of a definition */
#ifndef HX_LAWS_H
#define HX_LAWS_H

#include "../state.h"

HX_HIDDEN_BEGIN

/* Computes the part of a model that no geometry enters: friction, soil, servos, gears, solver.
 * The model's terrain is known. */
void hx_laws_compile(hxModel *model, const hxDefinition *d);

/* Returns the weight of all bodies, N. */
double hx_weight(const hxDefinition *d);

HX_HIDDEN_END

#endif
