/* gait_change.h - times of a change of gait while the robot walks.
 *
 * Feet stand longer during a change than in either gait and need more reach (docs/control/gait.md,
 * C55). So the robot walks slowly from the request until every leg has made a step in the next
 * gait: the command slows down first, then the controller gets the next gait, legs in the air
 * finish their steps, and each leg makes its first step in the next gait. */
#ifndef HEXAPOD_GAIT_CHANGE_H
#define HEXAPOD_GAIT_CHANGE_H

#include "hexapod/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Macro-steps that are left; negative: it has been. */
typedef struct hxGaitChange {
  int change; /* until the controller gets the next gait */
  int hold;   /* until the next gait holds: no leg steps in the gait before */
  int end;    /* until commands need no longer be slow */
} hxGaitChange;

/* What is due in a macro-step. */
enum { HX_GAIT_CHANGE = 1, HX_GAIT_HOLDS = 2, HX_GAIT_ENDS = 4 };

/* Plans a change of gait.
 *
 * period, duty: s, 1, of the gait before. next_period: s. constant: s for which the command has
 * not changed and needs no change; 0: it changes now. h: s, the macro-step. */
HX_API void hx_gait_change_begin(hxGaitChange *change, double period, double duty,
                                 double next_period, double constant, double h);

/* Returns what is due in this macro-step, and counts it. */
HX_API int hx_gait_change_advance(hxGaitChange *change);

#ifdef __cplusplus
}
#endif

#endif
