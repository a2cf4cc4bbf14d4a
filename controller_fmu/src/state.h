/* state.h - what a controller is made of: constants compiled from the definition, and the state
 * that moves. No pointers anywhere. */
#ifndef HX_CONTROLLER_STATE_H
#define HX_CONTROLLER_STATE_H

#include "compliant.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxControllerModel {
  double period;  /* s */
  int compliant;  /* answers to forces; otherwise follows the paths */
  hxLegModel leg[HX_LEGS];
  hxRampModel ramp;
  hxPathModel paths;
  hxCompliantModel laws;
} hxControllerModel;

/* One planned step: what depends on the command alone. */
typedef struct hxRow {
  double value[HX_COMMANDS],
      rate[HX_COMMANDS];  /* vx vy yaw_rate height roll pitch, and per second */
  hxPosture posture;
  hxSteps steps;
  double activation[HX_LEGS];  /* 1 */
  double lowering[HX_LEGS];    /* m  by what the ground will give way */
  double height[HX_LEGS];      /* m  of the feet, lowered */
  hxPlane shift[HX_LEGS];      /* m  of the feet by the ground rolling off them */
  hxPose pose[HX_LEGS];
  hxMasses masses;
} hxRow;

typedef struct hxControllerState {
  double start;    /* s  of the first tick */
  double time;     /* s */
  int64_t tick;    /* number of the next one */
  hxRamp ramp;
  hxPaths paths;
  int64_t at;      /* the present step, counted from where its planning began */
  int64_t last;    /* the step at which the command comes to rest and is to be planned for anew */
  int cut;         /* the present step is the last before a leg lifts off or touches down */
  int has_before, has_after; /* its neighbours are planned */
  int present;     /* place of the present step in row, whose places go round */
  hxRow row[3];
  hxCompliant compliant;
  hxControllerOutput output; /* of the last tick */
} hxControllerState;

/* The next tick, done for show: it is the same when time goes on under the same input. Not part of
 * the state. */
typedef struct hxAhead {
  int known;
  hxControllerInput input;
  hxControllerState state;
} hxAhead;

struct hxController {
  hxControllerModel model;
  hxControllerState state;
  hxAhead ahead;
  char message[HX_MESSAGE_SIZE];
};

HX_HIDDEN_END

#endif
