/* output.h - what the robot shows, from an evaluation with multipliers */
#ifndef HX_OUTPUT_H
#define HX_OUTPUT_H

#include "dynamics.h"

/* kinetic energy of bodies and rotors */
HX_LOCAL double hx_kinetic_energy(const hxModel *model, const hxWork *work);

/* gravity and the elastic part of the contacts, 2/5 K delta^(5/2) each */
HX_LOCAL double hx_potential_energy(const hxModel *model, const hxWork *work);

HX_LOCAL void hx_output_fill(const hxModel *model, const hxState *state, const hxWork *work, hxOutput *output);

/* accelerations (linear, then angular), multipliers and motor torques in the order of hexapod.h's bodies */
HX_LOCAL void hx_accelerations_fill(const hxWork *work, const hxMotion *rate, double acceleration[HX_BODIES][6],
                                    double multiplier[HX_BODIES - 1][HX_MULTIPLIERS], double drive_torque[HX_BODIES - 1]);

#endif
