/* reward.c - the terms of the reward. */
#include "environment.h"

#include <math.h>

/* Returns exp(-x), x >= 0, to 1e-13 without libm, whose last bits differ between systems: a series
 * for x / 1024, squared ten times. */
static double decay(double x) {
  const double small = -fmin(x, 700.0) / 1024.0;
  double sum = 1.0;
  for (int k = 8; k > 0; --k) sum = 1.0 + sum * small / k;
  for (int k = 0; k < 10; ++k) sum *= sum;
  return sum;
}

/* Returns the velocity along the commanded one, at most its size; -|v| without a command. */
static double progress(const double command[3], const double v[3]) {
  const double size = sqrt(command[0] * command[0] + command[1] * command[1]);
  if (size == 0.0) return -sqrt(v[0] * v[0] + v[1] * v[1]);
  return fmin((command[0] * v[0] + command[1] * v[1]) / size, size);
}

static double sum_of_squares(const double *value, int n) {
  double sum = 0.0;
  for (int i = 0; i < n; ++i) sum += value[i] * value[i];
  return sum;
}

/* Returns the sum of the powers of the servos that drive. */
static double driving_power(const double *torque, const double *speed) {
  double sum = 0.0;
  for (int i = 0; i < HX_ENV_JOINTS; ++i) sum += fmax(torque[i] * speed[i], 0.0);
  return sum;
}

double hx_reward(const hxEnvSettings *settings, const hxEnvMotion *motion,
                 double term[HX_ENV_TERMS]) {
  const double *c = motion->command, time = motion->time;
  const double *v = motion->view.velocity, *w = motion->view.rotation, *g = motion->view.gravity;
  const double error[3] = {(c[0] - v[0]) / settings->width[0], (c[1] - v[1]) / settings->width[0],
                           (c[2] - w[2]) / settings->width[1]};
  double sum = 0.0;
  term[HX_TERM_TRACKING_LIN_VEL] = decay(error[0] * error[0] + error[1] * error[1]);
  term[HX_TERM_TRACKING_ANG_VEL] = decay(error[2] * error[2]);
  term[HX_TERM_PROGRESS] = progress(c, v);
  term[HX_TERM_LIN_VEL_Z] = v[2] * v[2];
  term[HX_TERM_ANG_VEL_XY] = w[0] * w[0] + w[1] * w[1];
  term[HX_TERM_ORIENTATION] = g[0] * g[0] + g[1] * g[1];
  term[HX_TERM_TORQUES] = sum_of_squares(motion->torque, HX_ENV_JOINTS);
  term[HX_TERM_DOF_VEL] = sum_of_squares(motion->speed, HX_ENV_JOINTS);
  term[HX_TERM_POWER] = driving_power(motion->torque, motion->speed);
  term[HX_TERM_ACTION_RATE] = motion->change;
  term[HX_TERM_FEET_SLIP] = motion->slip / time;
  term[HX_TERM_ALIVE] = 1.0;
  term[HX_TERM_TERMINATION] = (motion->fell ? 1.0 : 0.0) / time; /* counts once */
  for (int i = 0; i < HX_ENV_TERMS; ++i) {
    term[i] *= settings->weight[i] * time;
    sum += term[i];
  }
  return sum;
}
