/* gait.h - which legs are in the air at which time (C2). Python: controller/walk/gait.py. */
#ifndef HX_GAIT_H
#define HX_GAIT_H

#include "hexapod/controller.h"

/* Timing of a gait in whole numbers, as in OpenSHC: a cycle has stance + swing parts; the phase
 * offset of a leg is its multiplier times `offset`. Multipliers are ordered around the robot, from
 * the front right to the front left leg. */
typedef struct {
  int stance, swing, offset, multiplier[HX_LEGS];
} hxTiming;

static const hxTiming timings[] = {
    [HX_PATTERN_TRIPOD] = {2, 2, 2, {0, 1, 0, 1, 0, 1}},
    [HX_PATTERN_RIPPLE] = {4, 2, 1, {2, 0, 4, 1, 3, 5}},
    [HX_PATTERN_WAVE] = {10, 2, 2, {2, 3, 4, 1, 0, 5}},
    [HX_PATTERN_AMBLE] = {2, 1, 1, {1, 2, 0, 1, 2, 0}},
};

static const int around_to_legs[HX_LEGS] = {
    5, 4, 3, 0, 1, 2}; /* LF LM LR RF RM RR in the order around the robot */

/* Returns the number of marked legs. */
static inline int hx_marked(const int marked[HX_LEGS]) {
  int count = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) count += marked[leg];
  return count;
}

/* Computes the phase offsets of a gait's legs, in [0, 1) for named gaits. */
static inline void hx_gait_offsets(const hxGait *gait, double offset[HX_LEGS]) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    offset[leg] = gait->offset[leg];
    if (gait->pattern == HX_PATTERN_CUSTOM) continue;
    const hxTiming *timing = &timings[gait->pattern];
    const int parts = timing->stance + timing->swing;
    offset[leg] =
        (double)(timing->multiplier[around_to_legs[leg]] * timing->offset % parts) / parts;
  }
}

/* Returns a clock at which the legs of the largest offset are about to lift off. */
static inline double hx_gait_start_clock(const hxGait *gait, const double offset[HX_LEGS]) {
  double largest = offset[0];
  for (int leg = 1; leg < HX_LEGS; ++leg) largest = offset[leg] > largest ? offset[leg] : largest;
  return gait->duty - largest;
}

#endif
