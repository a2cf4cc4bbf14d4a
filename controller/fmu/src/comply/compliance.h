/* compliance.h - the force laws of compliant control: from planned load and measured foot forces to
 * the servos' torques. Python: controller/comply/compliance.py. */
#ifndef HX_COMPLIANCE_H
#define HX_COMPLIANCE_H

#include "../sense/burden.h"
#include "../sense/contact_detection.h"
#include "../sense/landing.h"
#include "../sense/touchdown.h"
#include "hexapod/inside.h"
#include "support.h"

HX_HIDDEN_BEGIN

typedef struct hxComplianceModel {
  hxParts parts;
  hxSensorWatchModel watch;
  hxBurdenModel burden;
  double period; /* s */
  /* N, of the robot; a third of it; load of all feet from which on they have settled */
  double weight, share, settled;
  double most_lean; /* m, limit of the distance of the centre of mass, each axis */
  double high; /* m, a foot that is planned higher is in the air for certain */
  /* 1, factors of the smoothings over a period */
  double follow_load, follow_cycle, follow_weight;
  int64_t calm; /* steps without sliding until feet are trusted again */
  double most; /* N m, limit of the torque */
} hxComplianceModel;

/* What a planned step requires of the laws. */
typedef struct hxPlan {
  double own[HX_LEGS][HX_JOINTS]; /* N m  torques for the legs' own weight and motion */
  double carry[HX_LEGS][HX_JOINTS]; /* N m, torques for the planned load */
  hxShares shares;
  hxPlane feet[HX_LEGS]; /* m    contact points */
  double weight; /* N, sum of all shares */
  int standing[HX_LEGS]; /* the leg carries its whole share */
  int well_up[HX_LEGS]; /* the foot is in the air even if it meets the ground early */
  double height[HX_LEGS]; /* m, of the paths above their ends */
  double needed; /* N m, largest element of carry */
  int swinging[HX_LEGS];
  int awaited[HX_LEGS]; /* the gait clock waits for the foot */
  double falling[HX_LEGS]; /* m, by which feet well above the ground move down in a period */
  int overspeed; /* the plan exceeds the speed limit of some joint */
} hxPlan;

typedef struct hxCompliance {
  hxSensorWatch watch;
  hxTouchdown touchdown;
  hxLandings landings;
  hxBurden burden;
  int touching[HX_LEGS];
  double load[HX_LEGS]; /* 1    smoothed, in thirds of the weight */
  double torque[HX_LEGS][HX_JOINTS]; /* N m, for the servos */
  int doubted[HX_LEGS]; /* the foot's sensor is not trusted */
  /* walks without feedback, because the sensor is not trusted, the robot slides, or its joints do
   * not follow */
  int fallback[HX_LEGS];
  double grip[HX_LEGS]; /* 1, factor on the planned load of a leg that is regaining contact */
  int regaining; /* some grip may be below 1 */
  double scale; /* 1    measured over planned weight */
  hxPlane lean; /* m, of the measured centre of mass from the modelled one, walking frame */
  double held; /* 1, share of the planned squeeze that the ground holds, smoothed */
  double trust; /* 1, below 1 while the robot slides or its joints cannot follow */
  int lagging; /* the joints cannot follow the plan */
  double overspeed_share; /* 1, share of the time in which the plan exceeds a speed limit */
  int64_t slide_periods; /* steps for which the robot has been sliding */
  int64_t recovery_periods; /* steps that remain until feedback resumes after sliding */
} hxCompliance;

/* depth: of the ground below the torso's origin in the stance [m]. */
void hx_compliance_compile(const hxControllerDefinition *definition, double depth,
                           hxComplianceModel *model);
void hx_compliance_reset(hxCompliance *laws);

/* Sets what a step requires of the laws; height, rise: of the feet's paths above the stance [m,
 * m/s]. */
void hx_compliance_plan(const hxComplianceModel *model, const hxDemand *demand,
                        const double height[HX_LEGS], const double rise[HX_LEGS], hxPlan *plan);

/* Returns whether a foot on its way down has met the ground, and not a sensor that lies (C51). */
int hx_compliance_meets(const hxComplianceModel *model, int leg, const hxCompliance *laws);

/* Returns whether the gait clock waits for the feet of legs that end their swing (C50). held: it
 * waits already. */
int hx_compliance_waits(const hxComplianceModel *model, const int landing[HX_LEGS], int held,
                        const hxCompliance *laws);

/* Advances the laws by one period. force: of the ground on the feet, walking frame [N]; replaced by
 * the planned one where a sensor is not trusted. */
void hx_compliance_step(const hxComplianceModel *model, const hxPlan *plan,
                        double force[HX_LEGS][3], hxCompliance *laws);

HX_HIDDEN_END

#endif
