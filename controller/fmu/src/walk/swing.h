/* swing.h - the shape of a swing (C6, C7) and the motion under a constant twist (C3). Python:
 * controller/walk/swing.py. */
#ifndef HX_SWING_H
#define HX_SWING_H

#include "../plane.h"

/* Motion of the body at one step: the command, plus what leads the body back to its path. */
typedef struct hxTwist {
  hxPlane velocity; /* m/s */
  double yaw_rate;  /* rad/s */
} hxTwist;

/* 1  share of the swing at each end in which the foot moves vertically only */
static const double dwell = 0.1;
static const double small_angle = 1e-12; /* rad  below it sin(a)/a is 1 */

/* Computes the horizontal progress s in [0, 1] at the part tau of a swing, and ds/dtau (C6). */
static inline void blend(double tau, double *s, double *slope) {
  const double y = hx_clamp((2.0 * tau - 1.0) / (1.0 - 2.0 * dwell), -1.0, 1.0);
  const double y4 = y * y * y * y, flat = 1.0 - y4;
  *s = 0.5 + y * (45.0 + y4 * (5.0 * y4 - 18.0)) / 64.0;
  *slope = 45.0 / 32.0 * flat * flat / (1.0 - 2.0 * dwell);
}

/* Computes the lift z of the foot at the part tau of a swing, and dz/dtau [m] (C7). top: the step
 * height; down: the touch-down speed times the duration of the swing [m]. */
static inline void hop(double tau, double top, double down, double *lift, double *climb) {
  const double arch = tau * (1.0 - tau), bow = 64.0 * top * arch * arch, fall = down * tau * tau;
  *lift = (bow + fall) * arch;
  *climb = 3.0 * bow * (1.0 - 2.0 * tau) + fall * (3.0 - 4.0 * tau);
}

/* Returns the displacement [m] under a constant twist for a time [s]: v (e^(i w t) - 1)/(i w) (C3).
 */
static inline hxPlane travel(hxTwist twist, double time) {
  const double half = 0.5 * twist.yaw_rate * time;
  const hxPlane turned = hx_cis(half);
  const double chord = fabs(half) > small_angle ? turned.y / half : 1.0;
  return hx_times(hx_scaled(twist.velocity, time * chord), turned);
}

/* Computes displacement [m] and turn [rad] of the walking frame over a period [s] (C3). last: the
 * motion of the body at its begin; twist: at its end. */
static inline void odometry(hxTwist last, hxTwist twist, double period, hxPlane *way,
                            double *turn) {
  const hxTwist mean = {hx_scaled(hx_plane_add(twist.velocity, last.velocity), 0.5),
                        0.5 * (twist.yaw_rate + last.yaw_rate)};
  *way = travel(mean, period);
  *turn = mean.yaw_rate * period;
}

#endif
