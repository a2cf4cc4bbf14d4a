/* walker.h - the default robot with its controller, for a page that steps them without a server
 *
 * extensions/live/module.py compiles it to WebAssembly together with the cores of plant and controller.
 * There is one robot in a module. SI units, frames and orders as in hexapod.h.
 */
#ifndef HEXAPOD_WALKER_H
#define HEXAPOD_WALKER_H

#include "hexapod/controller.h"
#include "hexapod/hexapod.h"

/* Control and gait. It consists of doubles only. */
typedef struct hxWalk {
  double control;         /* hxControl */
  double pattern;         /* hxPattern */
  double period;          /* s    one cycle of a leg */
  double duty;            /* 1    share of the cycle on the ground */
  double step_height;     /* m    the foot's lift above the ground */
  double touchdown_speed; /* m/s  vertical, at the end of a swing */
} hxWalk;

/* What a page shows, as of the last macro-step. It consists of doubles only. */
typedef struct hxFrame {
  double time;                        /* s    since the start */
  double position[3], quaternion[4];  /* m, 1 torso's centre of mass, attitude */
  double velocity[3], rate[3];        /* m/s, rad/s  world axes */
  double angle[HX_LEGS][HX_JOINTS];   /* rad */
  double contact[HX_LEGS];            /* 1: the foot touches the ground */
  double force[HX_LEGS][3];           /* N    ground on foot */
  double slip_speed[HX_LEGS];         /* m/s */
  double largest_torque;              /* N m  of all servos */
  /* 1: the gait is being changed; 2: the next gait has begun, and legs make their first
   * steps in it */
  double changing;
} hxFrame;

/* The control and gait of the next start or change: the page writes them here. */
HX_API hxWalk *hx_walker_wanted(void);

/* Allocates the robot once and places it at its start; HX_OK, or the status of the first failure,
 * explained by hx_walker_message. */
HX_API int hx_walker_start(double friction);

/* Sets the body velocity in the torso's axes [m/s, rad/s] and the height above the stance [m]. */
HX_API void hx_walker_command(double forward, double left, double turn, double height);

/* Sets the force on the torso's centre of mass, world axes [N]. */
HX_API void hx_walker_push(double x, double y, double z);

/* Changes to the wanted control and gait while the robot walks; HX_OK, or the status of a refusal.
 * Another control goes on in the present phase at once, and the joint commands fade over. Another
 * gait follows once the command has been followed for a gait period; the page should give a command
 * that both gaits can follow. */
HX_API int hx_walker_change(void);

/* Changes the friction coefficient: the plant begins again in its present pose and motion. */
HX_API int hx_walker_set_friction(double friction);

/* Advances by macro-steps of hx_walker_macro_step() [s]. */
HX_API int hx_walker_advance(int steps);
HX_API double hx_walker_macro_step(void);

HX_API const hxFrame *hx_walker_frame(void);
HX_API const char *hx_walker_message(void); /* of the last failure, "" before any */

/* Memory that a page may write to: the plant's input of a replay. */
HX_API hxInput *hx_walker_input(void);
/* Steps the plant alone to t_end under hx_walker_input() and returns its outputs. NULL: failed. */
HX_API const hxOutput *hx_walker_replay(double t_end);

#endif
