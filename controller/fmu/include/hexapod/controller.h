/* controller.h - the controller: joint commands from a body velocity and from foot forces, once a
 * period.
 *
 * The C form of controller/ (Python), to round-off: the same files, names and laws, one step at a
 * time. SI units, frames and orders as in hexapod.h (docs/architecture.md). A controller has no
 * pointers, no globals and no hidden state: its bytes are its state. After create nothing
 * allocates, prints or exits.
 */
#ifndef HEXAPOD_CONTROLLER_H
#define HEXAPOD_CONTROLLER_H

#include "hexapod/generated/controller_settings.h"
#include "hexapod/legs.h"
#include "hexapod/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The controller's model of a link; joint axes are z, -y, y (docs/architecture.md). */
typedef struct hxKnownLink {
  double mass;                 /* kg */
  double length;               /* m     next joint (tibia: foot centre) along the link's x */
  double offset_y, offset_z;   /* m     the same point along y and z */
  double com[3];               /* m     centre of mass, link axes */
  double inertia_yy;           /* kg m2 about the centre of mass */
  double inertia_zz;           /* kg m2 */
  double angle_min, angle_max; /* rad   limits of the joint */
  double stance;               /* rad   the joint in the standing pose */
} hxKnownLink;

typedef struct hxKnownLeg {
  double hip_position[3]; /* m    coxa joint, torso axes */
  double hip_yaw;         /* rad  about z */
  hxKnownLink link[HX_JOINTS];
} hxKnownLeg;

/* The controller's model of the robot, the gait and the laws. hx_controller_definition_default sets
 * the ATHENA-like robot. */
typedef struct hxControllerDefinition {
  double period; /* s    between two steps of the controller */
  int control;   /* hxControl */
  struct {
    double mass;       /* kg */
    double com[3];     /* m      from the torso's origin, torso axes */
    double inertia_zz; /* kg m2  about the centre of mass */
  } torso;
  hxKnownLeg leg[HX_LEGS];
  double foot_radius;       /* m */
  double contact_stiffness; /* N/m^1.5  of a foot on the ground */
  double friction;          /* 1        coefficient of friction that is believed */
  struct {
    double kp;                /* N m/rad */
    double speed_max;         /* rad/s */
    double rotor_inertia;     /* kg m2  seen at the joint */
    double coulomb_friction;  /* N m    in the gear */
    double torque_continuous; /* N m    that it can give for ever */
  } servo;
  double gravity[3]; /* m/s2 */
  hxGait gait;
  hxGains gains; /* without the data that they were designed for */
  hxParts parts; /* switches of compliant and paper control */
} hxControllerDefinition;

/* Command and measurements of the controller. */
typedef struct hxControllerInput {
  struct {
    double vx, vy;      /* m/s    forward, to the left */
    double yaw_rate;    /* rad/s  to the left */
    double height;      /* m      above the stance */
    double roll, pitch; /* rad    z-y-x */
  } command;
  double angle[HX_LEGS][HX_JOINTS]; /* rad */
  double foot_force[HX_LEGS][3];    /* N   ground on foot, world axes */
  double quaternion[4];             /* 1   torso to world, w x y z */
} hxControllerInput;

typedef struct hxControllerOutput {
  double angle_ref[HX_LEGS][HX_JOINTS];  /* rad */
  double speed_ref[HX_LEGS][HX_JOINTS];  /* rad/s */
  double torque_ref[HX_LEGS][HX_JOINTS]; /* N m */
  int swinging[HX_LEGS];                 /* planned to be in the air */
  int unreachable[HX_LEGS];              /* the joints cannot follow */
  int fallback[HX_LEGS];                 /* walks without feedback */
  double shift[HX_LEGS][2];              /* m  horizontal correction of the foot, walking frame */
  double lift[HX_LEGS];                  /* m  vertical correction of the foot */
  double planned[HX_LEGS][3]; /* m  the foot's centre as the command plans it, torso frame, without
                                 any correction */
  double acceleration_ref[HX_LEGS][HX_JOINTS]; /* rad/s2  planned, for kinematic drives */
} hxControllerOutput;

typedef struct hxController hxController;

HX_API void hx_controller_definition_default(hxControllerDefinition *definition);
HX_API void hx_controller_input_default(
    hxControllerInput *input); /* no command, no forces, joints in the stance */

/* Sets *range to the ranges of all numbers of the structure; returns how many there are. */
HX_API size_t hx_controller_definition_ranges(const hxRange **range);
HX_API size_t hx_controller_input_ranges(const hxRange **range);

/* Checks a definition. On failure message (HX_MESSAGE_SIZE bytes, may be NULL) says which value was
 * got and what was expected. */
HX_API hxStatus hx_controller_definition_check(const hxControllerDefinition *definition,
                                               char *message);

/* Allocates a controller of the default robot at time 0; NULL when out of memory. */
HX_API hxController *hx_controller_create(void);
HX_API void hx_controller_destroy(hxController *controller);

/* Resets to standing in the stance, with the first tick at time t. On failure only the message
 * changes. */
HX_API hxStatus hx_controller_reset(hxController *controller,
                                    const hxControllerDefinition *definition, double t);

/* Changes the gait while the robot walks: legs in the air finish their steps, no other leg lifts
 * off, and the next gait begins with the feet where they are (C55). On failure only the message
 * changes. */
HX_API hxStatus hx_controller_change_gait(hxController *controller, const hxGait *gait);
HX_API const hxGait *hx_controller_gait(const hxController *controller); /* asked for last */

/* Changes the control (hxControl) while the robot walks: the next one goes on in the present phase
 * of the walk, its laws begin anew, and the joint commands fade over in 0.4 s. Before the first
 * tick it begins as after a reset. On failure only the message changes. */
HX_API hxStatus hx_controller_change_control(hxController *controller, int control);
HX_API int hx_controller_control(const hxController *controller);

/* Computes the joint commands at the present time: those of this input when a tick is due,
 * otherwise those of the last tick. The state does not change; the result is kept for the step that
 * follows under the same input. */
HX_API void hx_controller_output(hxController *controller, const hxControllerInput *input,
                                 hxControllerOutput *output);

/* Steps to t_end >= time under this input, which changes at a rate (1/s; NULL: is constant), and
 * executes all ticks before t_end. On failure only the message changes. */
HX_API hxStatus hx_controller_step(hxController *controller, const hxControllerInput *input,
                                   const hxControllerInput *rate, double t_end);

HX_API double hx_controller_time(const hxController *controller);
HX_API const char *
hx_controller_message(const hxController *controller); /* of the last failure, "" before any */

/* Save and restore the controller as bytes. hx_controller_set_state checks them; HX_BAD_STATE: the
 * controller is unchanged. */
HX_API size_t hx_controller_state_size(void);
HX_API void hx_controller_get_state(const hxController *controller, void *bytes);
HX_API hxStatus hx_controller_set_state(hxController *controller, const void *bytes, size_t size);

#ifdef __cplusplus
}
#endif
#endif
