/* perceptron.c - what a policy observes, and its action: a = V tanh(W x + w) + v. */
#include "perceptron.h"

#include <math.h>

static const double two_pi = 6.283185307179586;

/* Computes R^T u, with the rotation R of the quaternion [w x y z], torso to world. */
static void to_torso_axes(const double p[4], const double u[3], double v[3]) {
  const double w = p[0], *q = p + 1;
  const double c[3] = {u[1] * q[2] - u[2] * q[1], u[2] * q[0] - u[0] * q[2],
                       u[0] * q[1] - u[1] * q[0]}; /* u x q */
  const double d[3] = {c[1] * q[2] - c[2] * q[1], c[2] * q[0] - c[0] * q[2],
                       c[0] * q[1] - c[1] * q[0]}; /* (u x q) x q */
  for (int i = 0; i < 3; ++i) v[i] = u[i] + 2.0 * (w * c[i] + d[i]);
}

/* Computes the observation. */
static void observe(const hxPolicyDefinition *definition, const hxPolicyInput *input, double time,
                    double x[HX_POLICY_SEEN]) {
  static const double down[3] = {0.0, 0.0, -1.0};
  const double turns = definition->clock * time, phase = two_pi * (turns - floor(turns));
  double *to = x + 9;
  to_torso_axes(input->quaternion, input->rotation, x);
  to_torso_axes(input->quaternion, down, x + 3);
  for (int i = 0; i < 3; ++i) x[i] *= 0.25;
  x[6] = 10.0 * input->command.vx;
  x[7] = 10.0 * input->command.vy;
  x[8] = input->command.yaw_rate;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      *to++ = input->angle[leg][joint] - definition->stance[leg][joint];
  to[0] = sin(phase);
  to[1] = cos(phase);
}

static double product(const double *a, const double *b, int n) {
  double sum = 0.0;
  for (int i = 0; i < n; ++i) sum += a[i] * b[i];
  return sum;
}

void hx_policy_act(const hxPolicyDefinition *definition, const hxPolicyInput *input, double time,
                   hxPolicyOutput *output) {
  double x[HX_POLICY_SEEN], hidden[HX_POLICY_UNITS];
  observe(definition, input, time, x);
  for (int k = 0; k < HX_POLICY_UNITS; ++k)
    hidden[k] =
        tanh(product(definition->hidden_weight[k], x, HX_POLICY_SEEN) + definition->hidden_bias[k]);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double a = product(definition->action_weight[leg][joint], hidden, HX_POLICY_UNITS) +
                       definition->action_bias[leg][joint];
      output->action[leg][joint] = fmin(fmax(a, -1.0), 1.0);
      output->angle_ref[leg][joint] =
          definition->stance[leg][joint] + definition->action_scale * output->action[leg][joint];
    }
}
