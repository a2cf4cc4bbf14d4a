/* trajectory.h - where the feet should be: from a body command to foot paths in the walking frame.
 * Python: controller/trajectory.py. */
#ifndef HX_TRAJECTORY_H
#define HX_TRAJECTORY_H

#include "hexapod/inside.h"
#include "kinematics.h"

HX_HIDDEN_BEGIN

enum { HX_COMMANDS = 6 }; /* vx vy yaw_rate height roll pitch */

/* Turns steps of the command into smooth changes: a cubic from the present value and rate to the
 * new value and rate 0. */
typedef struct hxRampModel {
  double duration, period;  /* s */
  int64_t end;              /* steps that a change takes */
} hxRampModel;

typedef struct hxRamp {
  double target[HX_COMMANDS];
  double cubic[4][HX_COMMANDS];
  int64_t steps; /* periods since the target was told */
} hxRamp;

void hx_ramp_compile(double duration, double period, hxRampModel *model);
void hx_ramp_reset(const hxRampModel *model, hxRamp *ramp);
int hx_ramp_settled(const hxRampModel *model, const hxRamp *ramp);

/* Heads for a command. Returns whether it is a new one. */
int hx_ramp_aim(const hxRampModel *model, const double target[HX_COMMANDS], hxRamp *ramp);

/* The command so many steps ahead, and its rate per second. */
void hx_ramp_ahead(const hxRampModel *model, const hxRamp *ramp, int64_t steps,
                   double value[HX_COMMANDS], double rate[HX_COMMANDS]);

/* Whether a body is commanded to move, not only to change its posture. */
int hx_ramp_moves(const hxRamp *ramp);

typedef struct hxPathModel {
  double period, gait_period, duty, step_height, touchdown_speed;
  double offset[HX_LEGS];       /* cycles  phases at the walk's begin */
  int late[HX_LEGS];            /* the walk begins in the time of its swing */
  double swing_time;            /* s */
  double landing_lead;          /* s   from lift-off to the middle of the next stance */
  hxPlane home[HX_LEGS];        /* m   feet of the stance */
  double home_height[HX_LEGS];  /* m */
} hxPathModel;

/* The body's motion at one step: of the command and of what leads it back to the way. */
typedef struct hxTwist {
  hxPlane velocity; /* m/s */
  double yaw_rate;  /* rad/s */
} hxTwist;

/* Feet at one step, in the walking frame; what is on the ground in its frame, where the walk began.
 */
typedef struct hxSteps {
  hxPlane plane[HX_LEGS];     /* m    centres, x + i y */
  double height[HX_LEGS];     /* m    and z */
  hxPlane velocity[HX_LEGS];  /* m/s */
  double rise[HX_LEGS];       /* m/s */
  double phase[HX_LEGS];      /* 1    in [0, 1) */
  double blend[HX_LEGS];      /* 1    s of swinging feet, else 0 */
  hxPlane goal[HX_LEGS]; /* m    on the ground: where a swinging foot will touch down, a standing
                            one stands */
  hxPlane pull[HX_LEGS]; /* m    (goal - foot)/(1 - s) on the ground, 0 of standing feet */
  hxPlane way; /* m    of the walking frame over the ground */
  double turn; /* rad */
  hxTwist twist;
} hxSteps;

/* The steps up to the next lift-off or touch-down: the same legs are in the air throughout. */
typedef struct hxPaths {
  int walking; /* the gait clock runs */
  int64_t before; /* periods from the walk's begin to the first step, the one before those that are
                     planned */
  int swinging[HX_LEGS];
  int standing[HX_LEGS]; /* by the clock; a foot with nowhere to step neither stands by it nor
                            swings */
  int lifted[HX_LEGS]; /* just now */
  int stayed[HX_LEGS]; /* had nowhere to step when it was to lift off last, so it stood through the
                          time of its swing */
  int stays[HX_LEGS]; /* will have nowhere to when it is next: at home under a body at rest */
} hxPaths;

void hx_paths_compile(const hxControllerDefinition *definition, const hxLegModel leg[HX_LEGS],
                      hxPathModel *model);

/* All feet in the stance, clock stopped. */
void hx_paths_reset(const hxPathModel *model, hxPaths *paths, hxSteps *steps);

/* Begins the steps after `now`, `number` periods after the last such begin, and makes `first` of
 * it, the step that they set out from. going: the body moves or is commanded to; otherwise feet
 * step home and the clock then stops. */
void hx_paths_plan(const hxPathModel *model, const hxSteps *now, int64_t number, int going,
                   hxTwist twist, hxPaths *paths, hxSteps *first);

/* Whether there is a planned step so many periods after the first: no leg lifts off or touches down
 * before it. */
int hx_paths_reach(const hxPathModel *model, const hxPaths *paths, int64_t number);

/* The step `number` periods after the first, from the one before it. */
void hx_paths_walk(const hxPathModel *model, const hxPaths *paths, int64_t number, hxTwist twist,
                   const hxSteps *before, hxSteps *steps);

HX_HIDDEN_END

#endif
