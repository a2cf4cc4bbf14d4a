/* compliant.h - compliant control around its laws, from the sensors to the corrected feet. Python:
 * controller/comply/compliant.py. */
#ifndef HX_COMPLIANT_H
#define HX_COMPLIANT_H

#include "../sense/load_adaptation.h"
#include "../walk/hold.h"
#include "../walk/trajectory.h"
#include "compliance.h"
#include "hexapod/inside.h"
#include "planned_squeeze.h"
#include "sway.h"

HX_HIDDEN_BEGIN

typedef struct hxCompliantModel {
  double per_second; /* 1/s   one over the period */
  double leading; /* steps of the transition of the added velocity */
  hxInverseDynamics dynamics;
  hxSway sway;
  hxSupport support;
  hxPlannedSqueeze squeeze;
  hxComplianceModel laws;
  hxHoldModel hold;
  hxLoadAdaptationModel adaptation;
} hxCompliantModel;

/* Velocity that steers back to the path, added to the commanded one, with a transition from one
 * value to the next. */
typedef struct hxSteering {
  hxTwist begin, goal;
  int64_t past; /* steps from the start of the transition to the first planned step */
} hxSteering;

typedef struct hxCompliant {
  hxCompliance laws;
  hxHold hold;
  hxLoadAdaptation adaptation;
  hxSteering steering;
  int64_t count; /* number of steps */
  double offset[HX_LEGS]; /* m, offsets for early and late touch-downs at the last step */
  int moving; /* the offsets have just changed */
} hxCompliant;

/* What a step requires, and its commands. */
typedef struct hxStance {
  hxPlan plan;
  double climb[HX_LEGS][HX_JOINTS]; /* rad/m  of the joints as a foot rises */
  const double *value; /* (6) commanded vx vy yaw_rate height roll pitch */
  const hxPosture *posture;
  const hxPlane *plane; /* m  (6) planned feet, walking frame */
  hxPlane sway; /* m, of the torso in the walking frame */
  const double *height; /* m, (6) heights of the lowered feet */
  const double *rolled; /* m, (6) outwards from the stance to the positions that the feet aim at */
} hxStance;

/* Computes the foot forces in the walking frame (C22) [N]: f_K = R_KT R_TW f_W. */
void hx_sense(const hxControllerInput *input, const hxPosture *posture, double force[HX_LEGS][3]);

void hx_compliant_compile(const hxControllerDefinition *definition, const hxLegSolver leg[HX_LEGS],
                          hxCompliantModel *model);
void hx_compliant_reset(const hxCompliantModel *model, hxCompliant *compliant);

/* Called before new steps are planned: takes over the corrections of the slow loops, when a leg
 * lifts off or touches down (afresh), and at a stop (not moves) (C40). steps: periods since the
 * last planning. */
void hx_compliant_steer(const hxCompliantModel *model, int64_t steps, int moves, int afresh,
                        hxCompliant *compliant);

/* Returns what is added to the commanded velocity a number of periods after the first planned step
 * (C40). */
hxTwist hx_compliant_addition(const hxCompliantModel *model, const hxCompliant *compliant,
                              int64_t steps);

/* Advances by one period: corrects the joint commands of this step in place (C41). */
void hx_compliant_step(const hxCompliantModel *model, const hxLegSolver leg[HX_LEGS],
                       const hxStance *stance, const hxControllerInput *input,
                       hxCompliant *compliant, hxControllerOutput *output);

HX_HIDDEN_END

#endif
