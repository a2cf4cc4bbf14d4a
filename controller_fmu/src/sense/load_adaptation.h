/* adaptation.h - squeeze and width of the stance by the load of the servos. Python:
 * controller/sense/load_adaptation.py. */
#ifndef HX_LOAD_ADAPTATION_H
#define HX_LOAD_ADAPTATION_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxLoadAdaptationModel {
  double rating; /* N2 m2, square of the continuous torque of a servo */
  double squeeze; /* 1, weight on ground on which feet creep, while all servos are cool */
  int narrows; /* the gait has a narrow stance */
  double follow_work, follow; /* 1, factors of the smoothings over a period */
} hxLoadAdaptationModel;

typedef struct hxLoadAdaptation {
  double work[HX_LEGS][HX_JOINTS]; /* N2 m2, squares of the torques, smoothed over a gait cycle */
  double heat[HX_LEGS][HX_JOINTS]; /* N2 m2, the same, smoothed over a minute */
  double heft; /* 1, measured over modelled weight, smoothed over a gait cycle */
  double narrowing; /* 1, part of the way to the narrow stance */
  double squeeze; /* 1, weight of the torques in the planned squeeze */
} hxLoadAdaptation;

void hx_load_adaptation_compile(const hxControllerDefinition *definition, hxLoadAdaptationModel *model);
void hx_load_adaptation_reset(const hxLoadAdaptationModel *model, hxLoadAdaptation *adaptation);

/* Advances weight and narrowing by one period (C53). heft: measured over modelled weight [1]. */
void hx_load_adaptation_weigh(const hxLoadAdaptationModel *model, double heft, hxLoadAdaptation *adaptation);

/* Returns measured over modelled weight, 1 in the wide stance [1] (C53). */
double hx_load_adaptation_laden(const hxLoadAdaptation *adaptation);

/* Advances by one period, after hx_load_adaptation_weigh (C45). torque: feed-forward torques [N m]; needed:
 * largest torque that the measured weight needs, over the largest that is allowed [1]; held: share
 * of the planned squeeze that the ground holds [1]. */
void hx_load_adaptation_step(const hxLoadAdaptationModel *model, const double torque[HX_LEGS][HX_JOINTS],
                    double needed, double held, hxLoadAdaptation *adaptation);

HX_HIDDEN_END

#endif
