/* environments.h - many robots stepped together, for reinforcement learning: one array of actions
 * in, arrays of observations, rewards and flags out.
 *
 * Each environment is an instance of a plant FMU, driven through functions of FMI 2.0 only.
 * Environments share nothing: what one does depends on its seed, its episode and its actions alone,
 * so that results are the same bits for any number of threads, any batch and any order.
 *
 * An FMU whose binary has the functions of shared_work.h uses a work space of the call of reset or
 * step, from just before to just after its own step.
 *
 * The library creates no threads. Several threads of a caller may each reset or step a share of the
 * environments, from `first` to before `end`.
 *
 * SI units, frames and orders as in hexapod.h.
 */
#ifndef HEXAPOD_ENVIRONMENTS_H
#define HEXAPOD_ENVIRONMENTS_H

#include <stddef.h>
#include <stdint.h>

#include "fmi2FunctionTypes.h"

#include "hexapod/macro_step.h"
#include "hexapod/shared_work.h"
#include "hexapod/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { HX_ENV_JOINTS = 18, HX_ENV_FEET = 6 };

/* Outputs of the plant in the order in which they are read: names with their numbers. */
typedef enum hxEnvPlace {
  HX_ENV_ANGLE = 0,                            /* 18 joint angles */
  HX_ENV_SPEED = HX_ENV_ANGLE + HX_ENV_JOINTS, /* 18 joint speeds */
  HX_ENV_FORCE = HX_ENV_SPEED + HX_ENV_JOINTS, /* 6 x 3 forces on the feet, world axes */
  HX_ENV_QUATERNION = HX_ENV_FORCE + 3 * HX_ENV_FEET,
  HX_ENV_ROTATION = HX_ENV_QUATERNION + 4,         /* 3 angular velocity, world axes */
  HX_ENV_TORQUE = HX_ENV_ROTATION + 3,             /* 18 torques of the servos */
  HX_ENV_POSITION = HX_ENV_TORQUE + HX_ENV_JOINTS, /* 3 */
  HX_ENV_VELOCITY = HX_ENV_POSITION + 3,           /* 3 world axes */
  HX_ENV_BELLY = HX_ENV_VELOCITY + 3,              /* 3 force of the ground on the torso */
  HX_ENV_SLIP = HX_ENV_BELLY + 3,                  /* 6 slip distances of the feet */
  HX_ENV_VALUES = HX_ENV_SLIP + HX_ENV_FEET
} hxEnvPlace;

/* Inputs of the plant in the order in which they are written. */
enum { HX_ENV_COMMANDS = 3 * HX_ENV_JOINTS, HX_ENV_INPUTS = HX_ENV_COMMANDS + 3 };

/* Largest size of a value in an observation: larger ones are limited to it. */
#define HX_ENV_LARGEST 100.0

/* Blocks of an observation, in this order. A block whose scale is 0 is left out. */
typedef enum hxEnvBlock {
  HX_SEE_VELOCITY, /* 3   m/s    of the torso, torso axes */
  HX_SEE_ROTATION, /* 3   rad/s  of the torso, torso axes */
  HX_SEE_GRAVITY,  /* 3   1      direction of gravity, torso axes; (0, 0, -1) when level */
  HX_SEE_COMMAND,  /* 3   m/s, m/s, rad/s  forward, to the left, yaw rate */
  HX_SEE_ANGLE,    /* 18  rad    joint angles less those of the stance */
  HX_SEE_SPEED,    /* 18  rad/s  joint speeds */
  HX_SEE_ACTION,   /* 18  1      the last action, as it was applied */
  HX_SEE_CLOCK,    /* 2   1      sine and cosine of the clock's phase */
  HX_ENV_BLOCKS
} hxEnvBlock;

/* Terms of the reward. Each is multiplied by its weight and, but for the last, by the time of a
 * step in s; the reward is their sum. c is the command, v and w are in torso axes. */
typedef enum hxEnvTerm {
  HX_TERM_TRACKING_LIN_VEL, /* 1         exp(-|c_xy - v_xy|^2 / width^2) */
  HX_TERM_TRACKING_ANG_VEL, /* 1         exp(-(c_yaw - w_z)^2 / width^2) */
  HX_TERM_PROGRESS,         /* m/s       velocity along the commanded one, at most its size */
  HX_TERM_LIN_VEL_Z,        /* m2/s2     v_z^2 */
  HX_TERM_ANG_VEL_XY,       /* rad2/s2   w_x^2 + w_y^2 */
  HX_TERM_ORIENTATION,      /* 1         square of the horizontal part of gravity's direction */
  HX_TERM_TORQUES,          /* N2 m2     sum of squares */
  HX_TERM_DOF_VEL,          /* rad2/s2   sum of squares */
  HX_TERM_POWER,            /* W         sum of the positive powers of the servos */
  HX_TERM_ACTION_RATE,      /* 1         sum of squared changes of the action */
  HX_TERM_FEET_SLIP,        /* m/s       mean speed over the step, summed over the feet */
  HX_TERM_ALIVE,            /* 1         1 */
  HX_TERM_TERMINATION,      /* 1         1 in a step that ends with a fall */
  HX_ENV_TERMS
} hxEnvTerm;

/* Why an episode ended. */
typedef enum hxEnvReason {
  HX_END_NONE,   /* it goes on */
  HX_END_TIME,   /* its time is over: truncated */
  HX_END_TILTED, /* the torso leans more than the limit: terminated */
  HX_END_BELLY,  /* the torso rests on the ground: terminated */
  HX_END_FAILED  /* an FMU refused a step or its start, see the message: terminated */
} hxEnvReason;

/* What follows the end of an episode, as in Gymnasium. An episode whose start fails has ended, with
 * HX_END_FAILED, and is followed by the next one like others. */
typedef enum hxAutoreset {
  HX_AUTORESET_NEXT_STEP, /* the next step resets, whatever its action */
  HX_AUTORESET_SAME_STEP, /* the same step resets; the last observation is in `last` */
  HX_AUTORESET_DISABLED   /* the caller resets; until then steps change nothing */
} hxAutoreset;

/* An FMU and its functions. */
typedef struct hxEnvFmu {
  fmi2InstantiateTYPE *instantiate;
  fmi2FreeInstanceTYPE *free_instance;
  fmi2ResetTYPE *reset;
  fmi2SetupExperimentTYPE *setup;
  fmi2EnterInitializationModeTYPE *enter;
  fmi2ExitInitializationModeTYPE *leave;
  hxStepFmu step; /* its functions; the instances are those of the environments */
  const char *guid;
  const char *resources;       /* URI of the unpacked resources */
  hxSharedWorkSize *work_size; /* NULL, like the next: the binary does not have it */
  hxSharedWorkUse *work_use;
} hxEnvFmu;

/* Parameters of the plant that are drawn anew for each episode, uniformly. */
typedef struct hxEnvDraws {
  const fmi2ValueReference *reference; /*       [count] */
  const double *low, *high;            /*       [count] range, both ends possible */
  const int32_t *whole;                /* 1     [count] whole numbers only */
  size_t count;
} hxEnvDraws;

/* Equal for all environments of a batch. Arrays must live as long as the batch. */
typedef struct hxEnvSettings {
  hxEnvFmu plant;
  const fmi2ValueReference *plant_output; /* [HX_ENV_VALUES] */
  const fmi2ValueReference *plant_input;  /* [HX_ENV_INPUTS] angles, speeds, torques, push */
  hxEnvDraws draws;
  double h;                           /* s    of a step */
  size_t length;                      /* 1    steps of an episode */
  double stance[HX_ENV_JOINTS];       /* rad  commanded angles for the action 0 */
  double action_scale[HX_ENV_JOINTS]; /* rad  for the action 1, the largest */
  double observed[HX_ENV_BLOCKS][3];  /*      scales of the blocks; for each axis of blocks of 3,
                                       *      otherwise the first */
  double clock;                       /* Hz */
  double command_low[3], command_high[3]; /* m/s, m/s, rad/s  ranges of the drawn commands */
  size_t push_interval;        /* 1    steps from the start of a push to the next; 0: none */
  size_t push_length;          /* 1    steps that a push lasts */
  double push_force;           /* N    largest; horizontal, of uniform size and direction */
  double upright;              /* 1    least cosine of the torso's lean */
  double belly_force;          /* N    largest force of the ground on the torso */
  double weight[HX_ENV_TERMS]; /*      of the terms of the reward */
  double width[2];             /* m/s, rad/s  of the tracking terms: exp(-(e / width)^2) */
  int autoreset;               /* hxAutoreset */
} hxEnvSettings;

/* What goes in and out of all environments. The caller's arrays; there are no copies. */
typedef struct hxEnvArrays {
  const float *action; /* 1  [n][18] */
  float *observation;  /*    [n][size] */
  float *last;         /*    [n][size] last observation of an episode that ended in this step */
  double *reward;      /*    [n] */
  double *term;        /*    [n][HX_ENV_TERMS] weighted terms, whose sum is the reward */
  uint8_t *terminated, *truncated; /* 1  [n] */
  uint8_t *refused; /* 1  [n] the action was not finite: the environment did not step */
  int32_t *reason;  /* 1  [n] hxEnvReason */
} hxEnvArrays;

typedef struct hxEnvironments hxEnvironments;

/* Number of the layout of hxEnvSettings, hxEnvArrays, the structures in them and the lists of names
 * above. A change of their members, or of what a member means, increases it. */
#define HX_ENVIRONMENTS_LAYOUT 4

/* Layout and size of hxEnvSettings in this library, with which callers check their own. */
HX_API int hx_environments_layout(void);
HX_API size_t hx_environments_settings_size(void);

/* Returns the number of values in an observation. */
HX_API size_t hx_environments_observed(const hxEnvSettings *settings);

/* Creates n environments that are not reset yet. NULL when an FMU refuses an instance; message
 * (HX_MESSAGE_SIZE bytes) then says why. */
HX_API hxEnvironments *hx_environments_create(const hxEnvSettings *settings,
                                              const hxEnvArrays *arrays, size_t n, char *message);

HX_API void hx_environments_destroy(hxEnvironments *environments);

/* Starts an episode in the environments of a share that are in the mask ([n], NULL: all). seed: [n]
 * restarts the episodes of these environments from these seeds; NULL: their next episodes.
 * Environments whose FMU refuses to start have the reason HX_END_FAILED. */
HX_API void hx_environments_reset(hxEnvironments *environments, size_t first, size_t end,
                                  const uint8_t *mask, const uint64_t *seed);

/* Steps the environments of a share. */
HX_API void hx_environments_step(hxEnvironments *environments, size_t first, size_t end);

/* Returns the last message of an environment's FMUs, "" before any. */
HX_API const char *hx_environments_message(const hxEnvironments *environments, size_t index);

/* Copy the numbers of the present episode: drawn parameters [draws.count]; values [HX_ENV_VALUES]
 * of the plant. */
HX_API void hx_environments_drawn(const hxEnvironments *environments, size_t index, double *value);
HX_API void hx_environments_values(const hxEnvironments *environments, size_t index, double *value);

#ifdef __cplusplus
}
#endif

#endif
