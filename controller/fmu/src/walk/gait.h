/* gait.h - which legs are in the air at which time (C2). Python: controller/walk/gait.py. */
#ifndef HX_GAIT_H
#define HX_GAIT_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Computes the phase offsets of a gait's legs, in [0, 1) for named gaits. */
void hx_gait_offsets(const hxGait *gait, double offset[HX_LEGS]);

/* Returns a clock at which the legs of the largest offset are about to lift off. */
double hx_gait_start_clock(const hxGait *gait, const double offset[HX_LEGS]);

HX_HIDDEN_END

#endif
