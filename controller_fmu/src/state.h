/* state.h - what a controller is made of: constants compiled from the definition, and the state
 * that moves, without pointers; and its tick, from body command and measurement to joint commands.
 * Python: controller/controller.py.
 *
 *   command -> ramp -> foot paths -> rolling -> posture -> inverse kinematics ---------> angle_ref
 *                         ^                                      |                           ^
 *                       hold                      inverse dynamics -> support -> compliance -+
 *                         ^--- measured angles, attitude        measured forces --^          v
 *                                                                                       torque_ref
 */
#ifndef HX_CONTROLLER_STATE_H
#define HX_CONTROLLER_STATE_H

#include "comply/compliant.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxControllerModel {
  double period; /* s */
  int compliant; /* compliant control, otherwise kinematic control */
  hxLegSolver leg[HX_LEGS];
  hxCommandRampModel ramp;
  hxFootPathsModel paths;
  hxCompliantModel laws;
} hxControllerModel;

/* One planned step: what depends on the command alone. Feet in the walking frame. */
typedef struct hxPlannedStep {
  double value[HX_COMMANDS],
      rate[HX_COMMANDS]; /* vx vy yaw_rate height roll pitch, and per second */
  hxPosture posture;
  hxPlannedFeet feet;
  double activation[HX_LEGS]; /* 1 */
  double lowering[HX_LEGS]; /* m  by what the ground will give way */
  double height[HX_LEGS]; /* m  of the feet, lowered */
  hxPlane shift[HX_LEGS]; /* m  of the feet by the ground rolling off them */
  hxPose pose[HX_LEGS];
  hxMasses masses;
} hxPlannedStep;

typedef struct hxControllerState {
  double start; /* s  of the first tick */
  double time; /* s */
  int64_t tick; /* number of the next one */
  hxCommandRamp ramp;
  hxFootPaths paths;
  int64_t at; /* the present step, counted from the begin of its section */
  int64_t last; /* the step at which the command comes to rest and is planned afresh */
  int cut; /* the present step is the last of its section: a leg lifts off or touches down */
  int has_before, has_after; /* the neighbours of the present step are planned */
  int present; /* place of the present step among `step`, whose places go round */
  hxPlannedStep step[3];
  hxCompliant compliant;
  hxControllerOutput output; /* of the last tick */
} hxControllerState;

/* The next tick, computed for its outputs alone: the tick itself takes it over when time goes on
 * under the same input. Not part of the state. */
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

void hx_controller_compile(const hxControllerDefinition *definition, hxControllerModel *model);

/* Standing in the stance, all memory cleared. */
void hx_controller_begin(const hxControllerModel *model, double t, hxControllerState *state);

/* One tick: the commands of this input are state->output. */
void hx_controller_tick(const hxControllerModel *model, const hxControllerInput *input,
                        hxControllerState *state);

HX_HIDDEN_END

#endif
