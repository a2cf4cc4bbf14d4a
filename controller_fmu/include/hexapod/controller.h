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

#include "hexapod/legs.h"
#include "hexapod/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum hxControl {
  HX_CONTROL_KINEMATIC = 1, /* follows the paths, no measurement */
  HX_CONTROL_COMPLIANT      /* answers to the measured forces as well */
} hxControl;

/* Which leg is in the air when: offsets by name, or the ones given. */
typedef enum hxPattern {
  HX_PATTERN_TRIPOD = 1,
  HX_PATTERN_RIPPLE,
  HX_PATTERN_WAVE,
  HX_PATTERN_AMBLE,
  HX_PATTERN_CUSTOM
} hxPattern;

/* What the controller knows of a link; joint axes are z, -y, y (docs/architecture.md). */
typedef struct hxKnownLink {
  double mass;                  /* kg */
  double length;                /* m     next joint (tibia: foot centre) along the link's x */
  double offset_y, offset_z;    /* m     the same point along y and z */
  double com[3];                /* m     centre of mass, link axes */
  double inertia_yy;            /* kg m2 about the centre of mass */
  double inertia_zz;            /* kg m2 */
  double angle_min, angle_max;  /* rad   limits of the joint */
  double stance;                /* rad   the joint in the standing pose */
} hxKnownLink;

typedef struct hxKnownLeg {
  double hip_position[3];  /* m    coxa joint, torso axes */
  double hip_yaw;          /* rad  about z */
  hxKnownLink link[HX_JOINTS];
} hxKnownLeg;

typedef struct hxGait {
  int pattern;             /* hxPattern */
  double period;           /* s    one cycle of a leg */
  double duty;             /* 1    share of the cycle on the ground */
  double offset[HX_LEGS];  /* 1    phase of each leg at clock 0, of HX_PATTERN_CUSTOM */
  double step_height;      /* m    the foot's lift above the ground */
  double touchdown_speed;  /* m/s  vertical, at the end of a swing */
} hxGait;

/* What gains.toml holds, without what it was designed for. */
typedef struct hxGains {
  struct {
    double kp;               /* 1 */
    double ki;               /* 1/s */
    double kd;               /* s */
    double derivative_time;  /* s    filter of the derivative */
    double filter_time;      /* s    force filter */
    double load_time;        /* s    smoothing of the measured load */
    double tracking_time;    /* s    anti-windup */
    double limit;            /* 1    largest answer, in thirds of the weight */
  } slip;
  struct {
    double mass;       /* kg */
    double damping;    /* N s/m */
    double stiffness;  /* N/m */
    double limit;      /* m    largest deflection */
  } suspension;
  struct {
    double handover_time;  /* s   in which one set of legs hands the weight to the next */
    double weight_time;    /* s   smoothing of the measured weight */
  } support;
  struct {
    double attitude_rate;  /* 1/s    integral of roll and pitch */
    double height_rate;    /* 1/s    and of the height */
    double ground_time;    /* s      smoothing of the ground's inclination */
    double angle_limit;    /* rad    largest correction of roll and pitch */
    double height_limit;   /* m      and of the height */
    double path_rate;      /* 1/s    from way and heading lost to velocity */
    double speed_limit;    /* m/s    largest such change */
    double turn_limit;     /* rad/s  and of the yaw rate */
  } hold;
  struct {
    double speed;   /* rad/s  fastest change of an angle's correction */
    double torque;  /* N m    largest feed-forward torque */
  } limits;
} hxGains;

/* Switches, 1 or 0: parts of the compliant control that are at work. */
typedef struct hxParts {
  int support, slip_pid, suspension, touchdown, posture, path, limits, fallback;
} hxParts;

/* The robot as its controller knows it, the gait and the laws. hx_controller_definition_default
 * fills in the ATHENA-like robot. */
typedef struct hxControllerDefinition {
  double period;  /* s    between two steps of the controller */
  int control;    /* hxControl */
  struct {
    double mass;        /* kg */
    double com[3];      /* m      from the torso's origin, torso axes */
    double inertia_zz;  /* kg m2  about the centre of mass */
  } torso;
  hxKnownLeg leg[HX_LEGS];
  double foot_radius;        /* m */
  double contact_stiffness;  /* N/m^1.5  of a foot on the ground */
  struct {
    double kp;                /* N m/rad */
    double speed_max;         /* rad/s */
    double rotor_inertia;     /* kg m2  seen at the joint */
    double coulomb_friction;  /* N m    in the gear */
  } servo;
  double gravity[3];  /* m/s2 */
  hxGait gait;
  hxGains gains;
  hxParts parts;
} hxControllerDefinition;

/* What the controller is told and what it senses. */
typedef struct hxControllerInput {
  struct {
    double vx, vy;       /* m/s    forward, to the left */
    double yaw_rate;     /* rad/s  to the left */
    double height;       /* m      above the stance */
    double roll, pitch;  /* rad    z-y-x */
  } command;
  double angle[HX_LEGS][HX_JOINTS];  /* rad */
  double foot_force[HX_LEGS][3];     /* N   ground on foot, world axes */
  double quaternion[4];              /* 1   torso to world, w x y z */
} hxControllerInput;

typedef struct hxControllerOutput {
  double angle_ref[HX_LEGS][HX_JOINTS];   /* rad */
  double speed_ref[HX_LEGS][HX_JOINTS];   /* rad/s */
  double torque_ref[HX_LEGS][HX_JOINTS];  /* N m */
  int swinging[HX_LEGS];                  /* planned to be in the air */
  int unreachable[HX_LEGS];               /* the joints cannot follow */
  int fallback[HX_LEGS];                  /* walks without feedback */
  double shift[HX_LEGS][2]; /* m  horizontal correction of the foot, walking frame */
  double lift[HX_LEGS]; /* m  and the vertical one */
  double planned[HX_LEGS][3]; /* m  the foot's centre as the command plans it, torso frame, without
                                 any correction */
  double acceleration_ref[HX_LEGS][HX_JOINTS]; /* rad/s2  planned, for kinematic drives */
} hxControllerOutput;

typedef struct hxController hxController;

HX_API void hx_controller_definition_default(hxControllerDefinition *definition);
HX_API void hx_controller_input_default(
    hxControllerInput *input); /* nothing commanded, nothing felt, joints in the stance */

/* The ranges of every number in either structure; returns how many there are. */
HX_API size_t hx_controller_definition_ranges(const hxRange **range);
HX_API size_t hx_controller_input_ranges(const hxRange **range);

/* Checks a definition. On failure message (HX_MESSAGE_SIZE bytes, may be NULL) says what, got,
 * expected. */
HX_API hxStatus hx_controller_definition_check(const hxControllerDefinition *definition,
                                               char *message);

/* Allocates a controller of the default robot at time 0; NULL when out of memory. */
HX_API hxController *hx_controller_create(void);
HX_API void hx_controller_destroy(hxController *controller);

/* Standing in the stance, all memory cleared, the first tick at time t. On failure nothing changes
 * but the message. */
HX_API hxStatus hx_controller_reset(hxController *controller,
                                    const hxControllerDefinition *definition, double t);

/* The joint commands at the present time: of this input when a tick is due, else those of the last
 * tick. Changes nothing that counts: what was calculated is only kept for the step that follows
 * under the same input. */
HX_API void hx_controller_output(hxController *controller, const hxControllerInput *input,
                                 hxControllerOutput *output);

/* Goes on to t_end >= time under this input, which changes at a rate (1/s; NULL: is held): all
 * ticks before t_end are done. On failure nothing changes but the message. */
HX_API hxStatus hx_controller_step(hxController *controller, const hxControllerInput *input,
                                   const hxControllerInput *rate, double t_end);

HX_API double hx_controller_time(const hxController *controller);
HX_API const char *
hx_controller_message(const hxController *controller); /* of the last failure, "" before any */

/* The controller's bytes: size, copy out, copy in (checked: HX_BAD_STATE leaves the controller as
 * it was). */
HX_API size_t hx_controller_state_size(void);
HX_API void hx_controller_get_state(const hxController *controller, void *bytes);
HX_API hxStatus hx_controller_set_state(hxController *controller, const void *bytes, size_t size);

#ifdef __cplusplus
}
#endif
#endif
