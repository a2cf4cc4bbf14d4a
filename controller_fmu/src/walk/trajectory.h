/* trajectory.h - where the feet should be: from the body command to the paths of the feet.
 * Python: controller/walk/trajectory.py. */
#ifndef HX_TRAJECTORY_H
#define HX_TRAJECTORY_H

#include "hexapod/inside.h"
#include "kinematics.h"

HX_HIDDEN_BEGIN

enum { HX_COMMANDS = 6 }; /* vx vy yaw_rate height roll pitch */

/* Turns steps of the command into smooth changes (C1): a cubic from the present value and rate
 * to the new value and rate 0. */
typedef struct hxCommandRampModel {
  double duration, period; /* s */
  int64_t end; /* steps that a change takes */
} hxCommandRampModel;

typedef struct hxCommandRamp {
  double target[HX_COMMANDS];
  double cubic[4][HX_COMMANDS];
  int64_t steps; /* periods since the target was told */
} hxCommandRamp;

void hx_command_ramp_compile(double duration, double period, hxCommandRampModel *model);
void hx_command_ramp_reset(const hxCommandRampModel *model, hxCommandRamp *ramp);
int hx_command_ramp_settled(const hxCommandRampModel *model, const hxCommandRamp *ramp);

/* Heads for a command. Returns whether it is a new one. */
int hx_command_ramp_aim(const hxCommandRampModel *model, const double target[HX_COMMANDS],
                        hxCommandRamp *ramp);

/* The command so many periods ahead, and its rate per second. */
void hx_command_ramp_ahead(const hxCommandRampModel *model, const hxCommandRamp *ramp,
                           int64_t steps, double value[HX_COMMANDS], double rate[HX_COMMANDS]);

/* Whether a body is commanded to move, not only to change its posture. */
int hx_command_ramp_moves(const hxCommandRamp *ramp);

typedef struct hxFootPathsModel {
  double period, gait_period, duty, step_height, touchdown_speed;
  double offset[HX_LEGS]; /* cycles  phases at the walk's begin */
  int late[HX_LEGS]; /* the walk begins in the time of its swing */
  double swing_time; /* s */
  double landing_lead; /* s   from lift-off to the middle of the next stance */
  hxPlane home[HX_LEGS]; /* m   feet of the stance */
  double home_height[HX_LEGS]; /* m */
} hxFootPathsModel;

/* The motion of the body at one step: of the command and of what leads it back to its way. */
typedef struct hxTwist {
  hxPlane velocity; /* m/s */
  double yaw_rate; /* rad/s */
} hxTwist;

/* The feet at one step as the command plans them. Walking frame, but goal, pull, way and turn:
 * ground frame. */
typedef struct hxPlannedFeet {
  hxPlane plane[HX_LEGS]; /* m    centres, x + i y */
  double height[HX_LEGS]; /* m    z */
  hxPlane velocity[HX_LEGS]; /* m/s  of x + i y */
  double rise[HX_LEGS]; /* m/s  of z */
  double phase[HX_LEGS]; /* 1    in [0, 1) */
  double blend[HX_LEGS]; /* 1    s of swinging feet, else 0 */
  /* m  where a swinging foot will touch down, where a standing one stands */
  hxPlane goal[HX_LEGS];
  hxPlane pull[HX_LEGS]; /* m    (goal - foot)/(1 - s) of swinging feet, 0 of standing ones */
  hxPlane way; /* m    of the walking frame over the ground */
  double turn; /* rad  of the walking frame over the ground */
  hxTwist twist; /* of the body */
} hxPlannedFeet;

/* The paths of the feet, between a lift-off or touch-down and the next. The same legs are in the
 * air throughout such a section of the walk. */
typedef struct hxFootPaths {
  int walking; /* the gait clock runs */
  int64_t before; /* periods from the begin of the walk to the first step of the section */
  int swinging[HX_LEGS]; /* in the air */
  /* by the clock; a foot with nowhere to step neither stands by it nor swings */
  int standing[HX_LEGS];
  int lifted[HX_LEGS]; /* lifts off at the begin of the section */
  int stayed[HX_LEGS]; /* had nowhere to step at its last lift-off and stood through its swing */
  int stays[HX_LEGS]; /* will have nowhere to at its next one: home under a body at rest */
} hxFootPaths;

void hx_foot_paths_compile(const hxControllerDefinition *definition, const hxLegSolver leg[HX_LEGS],
                           hxFootPathsModel *model);

/* All feet in the stance, the gait clock stopped. */
void hx_foot_paths_reset(const hxFootPathsModel *model, hxFootPaths *paths, hxPlannedFeet *feet);

/* Begins a new section after the present step; first: the feet at that step, from which it begins.
 * number: periods since the last section began; twist: of the body now; going: the body moves or is
 * commanded to, otherwise feet step home and the gait clock then stops. */
void hx_foot_paths_plan(const hxFootPathsModel *model, const hxPlannedFeet *now, int64_t number,
                        int going, hxTwist twist, hxFootPaths *paths, hxPlannedFeet *first);

/* Whether the step so many periods after the first still belongs to the section: no leg lifts off
 * or touches down before it. */
int hx_foot_paths_reach(const hxFootPathsModel *model, const hxFootPaths *paths, int64_t number);

/* The feet so many periods after the first step of the section, from the step before. */
void hx_foot_paths_walk(const hxFootPathsModel *model, const hxFootPaths *paths, int64_t number,
                        hxTwist twist, const hxPlannedFeet *before, hxPlannedFeet *feet);

HX_HIDDEN_END

#endif
