/* reward.h - the terms of the reward of a step. */
#ifndef HX_REWARD_H
#define HX_REWARD_H

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

/* Writes the weighted terms of a step and returns their sum. */
double hx_reward(const hxEnvSettings *settings, const hxEnvMotion *motion,
                 double term[HX_ENV_TERMS]);

#endif
