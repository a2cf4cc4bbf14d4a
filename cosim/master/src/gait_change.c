/* gait_change.c - times of a change of gait while the robot walks. */
#include "hexapod/gait_change.h"

#include <math.h>

static int steps(double time, double h) { return (int)nearbyint(time / h); }

void hx_gait_change_begin(hxGaitChange *change, double period, double duty, double next_period,
                          double constant, double h) {
  const double swing = period * (1.0 - duty);
  /* the ramp to the last command takes a gait period (C1) */
  const int ramp = steps(period - constant, h), step = steps(swing, h);
  change->change = ramp > 0 ? ramp : 0;
  change->hold = change->change + (step > 1 ? step : 1);
  change->end = change->hold + steps(swing + next_period, h);
}

int hx_gait_change_advance(hxGaitChange *change) {
  const int due = (change->change == 0 ? HX_GAIT_CHANGE : 0) |
                  (change->hold == 0 ? HX_GAIT_HOLDS : 0) | (change->end == 0 ? HX_GAIT_ENDS : 0);
  --change->change;
  --change->hold;
  --change->end;
  return due;
}
