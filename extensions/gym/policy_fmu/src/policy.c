/* policy.c - a policy: its action a = V tanh(W x + w) + v, ticks, saved states, refusals. */
#include "hexapod/policy.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hexapod/message.h"
#include "hexapod/range_check.h"
#include "hexapod/torso_axes.h"

/* Consists of doubles and one integer of 64 bits, without padding. */
typedef struct hxPolicyState {
  double start;          /* s  time of the first tick */
  double time;           /* s */
  int64_t tick;          /* 1  number of the next tick */
  hxPolicyOutput output; /*    of the last tick */
} hxPolicyState;

struct hxPolicy {
  hxPolicyDefinition definition;
  hxPolicyState state;
  char message[HX_MESSAGE_SIZE];
};

/* A saved state; the FMI layer puts a header with a checksum before it. */
typedef struct {
  hxPolicyDefinition definition;
  hxPolicyState state;
} hxSavedPolicy;

/* 1  of a period: a tick that is later than the present time by less than this is due */
static const double clock_tolerance = 0.01;
static const double two_pi = 6.283185307179586;

static hxStatus refuse_policy(hxPolicy *policy, hxStatus status, const char *text) {
  hx_print(policy->message, HX_MESSAGE_SIZE, "%s", text);
  return status;
}

const char *hx_policy_message(const hxPolicy *policy) { return policy->message; }
double hx_policy_time(const hxPolicy *policy) { return policy->state.time; }

hxPolicy *hx_policy_create(void) {
  hxPolicy *policy = calloc(1, sizeof *policy);
  hxPolicyDefinition definition;
  if (!policy) return NULL;
  hx_policy_definition_default(&definition);
  hx_policy_reset(policy, &definition, 0.0);
  return policy;
}

void hx_policy_destroy(hxPolicy *policy) { free(policy); }

/* ----------------------------------------------------------------------------------------------
 * checks */

hxStatus hx_policy_definition_check(const hxPolicyDefinition *definition, char *message) {
  hxChecker checker = {HX_OK, message};
  const hxRange *range;
  const size_t n = hx_policy_definition_ranges(&range);
  hx_check_ranges(&checker, definition, range, n);
  return checker.status;
}

static hxStatus check_input(const hxPolicyInput *input, char *message) {
  hxChecker checker = {HX_OK, message};
  const hxRange *range;
  const size_t n = hx_policy_input_ranges(&range);
  hx_check_ranges(&checker, input, range, n);
  return checker.status == HX_OK ? HX_OK : HX_INVALID_ARGUMENT;
}

/* ----------------------------------------------------------------------------------------------
 * action */

/* Computes the observation. */
static void observe(const hxPolicyDefinition *definition, const hxPolicyInput *input, double time,
                    double x[HX_POLICY_SEEN]) {
  static const double down[3] = {0.0, 0.0, -1.0};
  const double turns = definition->clock * time, phase = two_pi * (turns - floor(turns));
  double *to = x + 9;
  hx_torso_axes(input->quaternion, input->rotation, x);
  hx_torso_axes(input->quaternion, down, x + 3);
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

/* Computes the action for an input at a time since the first tick [s]. */
static void act(const hxPolicyDefinition *definition, const hxPolicyInput *input, double time,
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

/* ----------------------------------------------------------------------------------------------
 * ticks */

hxStatus hx_policy_reset(hxPolicy *policy, const hxPolicyDefinition *definition, double t) {
  char message[HX_MESSAGE_SIZE];
  if (!isfinite(t))
    return refuse_policy(policy, HX_INVALID_ARGUMENT,
                         "start time: got a number that is not finite, expected a finite time in "
                         "s");
  const hxStatus status = hx_policy_definition_check(definition, message);
  if (status != HX_OK) return refuse_policy(policy, status, message);
  memset(&policy->state, 0, sizeof policy->state);
  policy->definition = *definition;
  policy->state.start = policy->state.time = t;
  memcpy(policy->state.output.angle_ref, definition->stance, sizeof definition->stance);
  policy->message[0] = '\0';
  return HX_OK;
}

/* Returns the time of the next tick since the first one. */
static double next_tick(const hxPolicy *policy) {
  return (double)policy->state.tick * policy->definition.period;
}

void hx_policy_output(const hxPolicy *policy, const hxPolicyInput *input, hxPolicyOutput *output) {
  const hxPolicyState *state = &policy->state;
  const double tick = next_tick(policy), tolerance = clock_tolerance * policy->definition.period;
  if (state->start + tick - state->time > tolerance)
    *output = state->output;
  else
    act(&policy->definition, input, tick, output);
}

hxStatus hx_policy_step(hxPolicy *policy, const hxPolicyInput *input, const hxPolicyInput *rate,
                        double t_end) {
  enum { REALS = sizeof *input / sizeof(double) };
  hxPolicyState *state = &policy->state;
  const double begin = state->time, tolerance = clock_tolerance * policy->definition.period;
  hxPolicyInput now = *input;
  hxStatus status = hx_check_end(begin, t_end, policy->message);
  if (status == HX_OK) status = check_input(input, policy->message);
  if (status != HX_OK) return status;
  while (t_end - (state->start + next_tick(policy)) > tolerance) {
    const double tick = next_tick(policy);
    if (rate) hx_ramp(input, rate, fmax(state->start + tick - begin, 0.0), REALS, &now);
    act(&policy->definition, &now, tick, &state->output);
    ++state->tick;
  }
  state->time = t_end;
  return HX_OK;
}

/* ----------------------------------------------------------------------------------------------
 * saved states */

size_t hx_policy_state_size(void) { return sizeof(hxSavedPolicy); }

void hx_policy_get_state(const hxPolicy *policy, void *bytes) {
  const hxSavedPolicy saved = {policy->definition, policy->state};
  memcpy(bytes, &saved, sizeof saved);
}

hxStatus hx_policy_set_state(hxPolicy *policy, const void *bytes) {
  hxSavedPolicy saved;
  memcpy(&saved, bytes, sizeof saved);
  if (hx_policy_definition_check(&saved.definition, policy->message) != HX_OK) return HX_BAD_STATE;
  policy->definition = saved.definition;
  policy->state = saved.state;
  return HX_OK;
}
