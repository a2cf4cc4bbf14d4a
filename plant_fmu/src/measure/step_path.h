/* step_path.h - a step between two moments, along which integrals are taken */
#ifndef HX_STEP_PATH_H
#define HX_STEP_PATH_H

#include "moment.h"

static const double shortest_bend = 1e-7; /* s  shorter steps: differences are rounding errors */

/* Nodes of a step at which forces are evaluated, and Simpson's weights: feet use all nodes, motors
 * every second one. */
enum { INTERVALS = 4, MOTOR_STRIDE = 2 };
static const double foot_weight[INTERVALS + 1] = {1.0 / 12, 4.0 / 12, 2.0 / 12, 4.0 / 12, 1.0 / 12};
static const double motor_weight[INTERVALS + 1] = {1.0 / 6, 0.0, 4.0 / 6, 0.0, 1.0 / 6};

/* A step between two moments. */
typedef struct {
  const hxModel *model;
  const hxContactState *contact;           /* contacts during the step */
  const hxCommand *command[INTERVALS + 1]; /* commands at its nodes */
  double t, h;                             /* s  start and length */
  const hxMoment *from, *to;
  double plastic[HX_SLOTS]; /* m  plastic depths of feet at its end; set with soil */
  const hxSoilEnds *ends;   /* set with soil */
} hxPath;

/* A cubic's value, first and second derivative at x. */
typedef struct {
  hxReal value, rate, second;
} hxCubic;

/* Returns those of the cubic through values and rates (per step) at both ends, x in [0, 1]
 * (eq. 28). */
static inline hxCubic cubic(hxReal from, hxReal slope_from, hxReal rise, hxReal slope_to,
                            hxReal x) {
  const hxReal bend = slope_from + slope_to - 2.0 * rise, curve = rise - slope_from - bend;
  return (hxCubic){from + x * (slope_from + x * (curve + x * bend)),
                   slope_from + x * (2.0 * curve + (3.0 * x) * bend),
                   2.0 * curve + (6.0 * x) * bend};
}

#endif
