/* environment.h - one environment: a robot, its episode and its rewards. */
#ifndef HX_ENVIRONMENT_H
#define HX_ENVIRONMENT_H

#include "hexapod/environments.h"

/* The torso's motion in its own axes. */
typedef struct hxEnvView {
  double velocity[3]; /* m/s */
  double rotation[3]; /* rad/s */
  double gravity[3];  /* 1      direction */
} hxEnvView;

/* What a step is rewarded for. */
typedef struct hxEnvMotion {
  hxEnvView view;        /*        at its end */
  const double *command; /* m/s, m/s, rad/s  forward, to the left, yaw rate */
  const double *torque;  /* N m    [HX_ENV_JOINTS] at its end */
  const double *speed;   /* rad/s  [HX_ENV_JOINTS] at its end */
  double change;         /* 1      sum of the squared changes of the action */
  double slip;           /* m      of all feet */
  double time;           /* s      of the step */
  int fell;              /* 1: the episode ended with a fall */
} hxEnvMotion;

typedef struct hxEnvironment {
  const hxEnvSettings *settings;
  hxStepper stepper; /* of the plant */
  uint64_t seed, episode;
  size_t step;                                 /* 1  steps of this episode */
  int ended;                                   /* 1: the episode is over, or none was started */
  int reason;                                  /* hxEnvReason */
  double value[HX_ENV_VALUES + HX_ENV_INPUTS]; /* outputs of the plant, then its inputs */
  double action[HX_ENV_JOINTS];                /* 1    last one, limited */
  double command[3];                           /* m/s, m/s, rad/s  forward, to the left, yaw rate */
  double *drawn;                               /*      [draws.count] values of the parameters */
  fmi2CallbackFunctions callbacks;             /* of the plant */
  char message[HX_MESSAGE_SIZE];
} hxEnvironment;

/* Instantiates the plant. Returns 0 when it refuses. */
int hx_environment_open(hxEnvironment *environment, const hxEnvSettings *settings, double *drawn);
void hx_environment_close(hxEnvironment *environment);

/* Memory that plants use as their work space (shared_work.h). */
typedef struct hxEnvWork {
  void *block, *memory; /* NULL: the plants use their own */
  size_t size;          /* B  of the memory */
} hxEnvWork;

/* Allocates memory if the plant can use it; without, or out of memory, there is none. */
hxEnvWork hx_environment_work(const hxEnvSettings *settings);

/* Makes the environment's plant use the memory; with NULL its own again. */
void hx_environment_use(hxEnvironment *environment, const hxEnvWork *work);

/* Starts the episode `episode` of the seed. */
void hx_environment_reset(hxEnvironment *environment);

/* Does one step; writes the weighted terms of the reward and returns their sum. */
double hx_environment_step(hxEnvironment *environment, const float action[HX_ENV_JOINTS],
                           double term[HX_ENV_TERMS]);

/* Writes the weighted terms of a step (reward.c) and returns their sum. */
double hx_reward(const hxEnvSettings *settings, const hxEnvMotion *motion,
                 double term[HX_ENV_TERMS]);

/* Writes the observation of the present state. */
void hx_environment_observe(const hxEnvironment *environment, float *observation);

#endif
