/* trajectory.h - from the body command to the paths of the feet. Python:
 * controller/walk/trajectory.py. */
#ifndef HX_TRAJECTORY_H
#define HX_TRAJECTORY_H

#include "hexapod/inside.h"
#include "kinematics.h"

HX_HIDDEN_BEGIN

enum { HX_COMMANDS = 6 }; /* vx vy yaw_rate height roll pitch */

/* Smooths steps of the command (C1): a cubic from the present value and rate to the new value with
 * rate 0. */
typedef struct hxCommandRampModel {
  double duration, period; /* s */
  int64_t end; /* steps that a change takes */
} hxCommandRampModel;

typedef struct hxCommandRamp {
  double target[HX_COMMANDS];
  double cubic[4][HX_COMMANDS];
  int64_t steps; /* periods since the target was set */
} hxCommandRamp;

void hx_command_ramp_compile(double duration, double period, hxCommandRampModel *model);
void hx_command_ramp_reset(const hxCommandRampModel *model, hxCommandRamp *ramp);
int hx_command_ramp_settled(const hxCommandRampModel *model, const hxCommandRamp *ramp);

/* Sets the command to go to. Returns whether it is a new one. */
int hx_command_ramp_aim(const hxCommandRampModel *model, const double target[HX_COMMANDS],
                        hxCommandRamp *ramp);

/* Continues the change of another ramp, from its present value and rate, in the model's own time.
 */
void hx_command_ramp_carry(const hxCommandRampModel *model, const hxCommandRampModel *before,
                           hxCommandRamp *ramp);

/* Computes the command a number of periods ahead, and its rate per second. */
void hx_command_ramp_ahead(const hxCommandRampModel *model, const hxCommandRamp *ramp,
                           int64_t steps, double value[HX_COMMANDS], double rate[HX_COMMANDS]);

/* Returns whether the body is commanded to move, not only to change its posture. */
int hx_command_ramp_moves(const hxCommandRamp *ramp);

typedef struct hxFootPathsModel {
  double period, gait_period, duty, step_height, touchdown_speed;
  double gait_offset[HX_LEGS]; /* cycles; phases at clock 0 */
  double offset[HX_LEGS]; /* cycles; phases at the start of the walk */
  /* the walk begins during the leg's swing, or while it takes up its load */
  int late[HX_LEGS];
  double handover; /* cycles in which a leg takes up or gives up its load (C18) */
  double swing_time; /* s */
  double landing_lead; /* s, from lift-off to the middle of the next stance */
  hxPlane home[HX_LEGS]; /* m   feet of the stance */
  hxPlane inward[HX_LEGS]; /* m   from the stance to the narrow one */
  double turned[HX_LEGS]; /* m   that the feet roll outwards on this way */
  double home_height[HX_LEGS]; /* m */
} hxFootPathsModel;

/* Motion of the body at one step: the command, plus what leads the body back to its path. */
typedef struct hxTwist {
  hxPlane velocity; /* m/s */
  double yaw_rate; /* rad/s */
} hxTwist;

/* The feet at one step, as the command plans them, in the walking frame. goal, pull, way and turn
 * are in the ground frame. */
typedef struct hxPlannedFeet {
  hxPlane plane[HX_LEGS]; /* m    centres, x + i y */
  double height[HX_LEGS]; /* m    z */
  hxPlane velocity[HX_LEGS]; /* m/s  of x + i y */
  double rise[HX_LEGS]; /* m/s  of z */
  double phase[HX_LEGS]; /* 1    in [0, 1) */
  double blend[HX_LEGS]; /* 1    s of swinging feet, else 0 */
  /* m, where a swinging foot will touch down, or where a standing foot stands */
  hxPlane goal[HX_LEGS];
  hxPlane pull[HX_LEGS]; /* m, (goal - foot)/(1 - s) of swinging feet, 0 of standing feet */
  double rolled[HX_LEGS]; /* m, outwards from the stance to the position that the foot aims at */
  hxPlane way; /* m, displacement of the walking frame over the ground */
  double turn; /* rad  of the walking frame over the ground */
  hxTwist twist; /* of the body */
} hxPlannedFeet;

/* The paths of the feet between a lift-off or touch-down and the next one. The same legs are in the
 * air throughout such a section of the walk. */
typedef struct hxFootPaths {
  int walking; /* the gait clock runs */
  int64_t before; /* periods from the start of the walk to the first step of the section */
  int swinging[HX_LEGS]; /* in the air */
  /* stands by the gait clock; a foot that makes no step neither stands by the clock nor swings */
  int standing[HX_LEGS];
  int lifted[HX_LEGS]; /* the foot lifts off at the start of the section */
  int stayed[HX_LEGS]; /* the foot needed no step at its last lift-off and stood during its swing */
  /* the foot will need no step at its next lift-off: it is at its stance position under a body at
   * rest */
  int stays[HX_LEGS];
  int met[HX_LEGS]; /* the foot has met the ground on its way down, and stays where it is */
  int held; /* the gait clock stands still until feet at the ends of their swings carry load */
  int awaited[HX_LEGS]; /* the gait clock waits for this foot */
  int ending; /* another gait follows: legs finish their steps and begin no other */
  double narrowing; /* 1, part of the way to the narrow stance that the steps aim at */
} hxFootPaths;

void hx_foot_paths_compile(const hxControllerDefinition *definition, const hxLegSolver leg[HX_LEGS],
                           hxFootPathsModel *model);

/* Sets all feet to the stance and stops the gait clock. */
void hx_foot_paths_reset(const hxFootPathsModel *model, hxFootPaths *paths, hxPlannedFeet *feet);

/* Begins a new section after the present step. first: the feet at that step; number: periods since
 * the last section began; twist: of the body now; going: the body moves or is commanded to;
 * otherwise the feet step to their stance positions and the gait clock stops. */
void hx_foot_paths_plan(const hxFootPathsModel *model, const hxPlannedFeet *now, int64_t number,
                        int going, hxTwist twist, hxFootPaths *paths, hxPlannedFeet *first);

/* Returns whether all legs stand and begin no other step, because another gait follows. */
int hx_foot_paths_ended(const hxFootPaths *paths);

/* Begins the walk anew with feet that stand under a moving body (C55): sets the phases of the legs
 * in the model so that one leg begins to give up its load, the first of those with which the
 * farthest foot goes least far. */
void hx_foot_paths_join(hxFootPathsModel *model, hxFootPaths *paths, hxPlannedFeet *feet);

/* Goes on in the phases of the paths of another control, in the same gait. before: the model of
 * these paths. */
void hx_foot_paths_carry(hxFootPathsModel *model, const hxFootPathsModel *before,
                         hxFootPaths *paths);

/* Finds the legs whose swing ends at the present step, or ended at the step at which the gait clock
 * was stopped. number: periods since the section began. */
void hx_foot_paths_landing(const hxFootPathsModel *model, const hxFootPaths *paths, int64_t number,
                           int landing[HX_LEGS]);

/* Begins a section in which the gait clock stands still while the body moves on (C50). Arguments
 * are those of hx_foot_paths_plan. */
void hx_foot_paths_hold(const hxFootPathsModel *model, const hxPlannedFeet *now, int64_t number,
                        hxTwist twist, hxFootPaths *paths, hxPlannedFeet *first);

/* Returns whether a step, in periods after the first, still belongs to the section: no leg lifts
 * off or touches down before it. */
int hx_foot_paths_reach(const hxFootPathsModel *model, const hxFootPaths *paths, int64_t number);

/* Computes the feet a number of periods after the first step of the section, from the step before.
 */
void hx_foot_paths_walk(const hxFootPathsModel *model, const hxFootPaths *paths, int64_t number,
                        hxTwist twist, const hxPlannedFeet *before, hxPlannedFeet *feet);

HX_HIDDEN_END

#endif
