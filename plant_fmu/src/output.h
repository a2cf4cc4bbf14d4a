/* output.h - what the robot shows, from an evaluation with multipliers */
#ifndef HX_OUTPUT_H
#define HX_OUTPUT_H

#include "dynamics.h"

/* kinetic energy of bodies and rotors */
double hx_kinetic_energy(const hxModel *model, const hxWork *work);

/* gravity and the elastic part of the contacts, 2/5 K delta^(5/2) each */
double hx_potential_energy(const hxModel *model, const hxWork *work);

void hx_output_fill(const hxModel *model, const hxState *state, const hxWork *work, hxOutput *output);

#endif
