/* policy.h - a policy: joint angles from a body command and from measurements by a small multilayer
 * perceptron, once a period.
 *
 * It computes what a policy of gym/ does in its environment. SI units, frames and orders as in
 * hexapod.h. A policy has no pointers, no globals and no hidden state: its bytes are its state.
 * After create nothing allocates, prints or exits.
 */
#ifndef HEXAPOD_POLICY_H
#define HEXAPOD_POLICY_H

#include "hexapod/legs.h"
#include "hexapod/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { HX_POLICY_SEEN = 29, HX_POLICY_UNITS = 16 };

/* The perceptron a = V tanh(W x + w) + v of the observation x: angular velocity / 4 and direction
 * of gravity in torso axes, command times 10, 10 and 1, joint angles less those of the stance, sine
 * and cosine of the clock. */
typedef struct hxPolicyDefinition {
  double period;                                             /* s    between two actions */
  double clock;                                              /* Hz */
  double action_scale;                                       /* rad  for the action 1 */
  double stance[HX_LEGS][HX_JOINTS];                         /* rad  for the action 0 */
  double hidden_weight[HX_POLICY_UNITS][HX_POLICY_SEEN];     /* 1    W */
  double hidden_bias[HX_POLICY_UNITS];                       /* 1    w */
  double action_weight[HX_LEGS][HX_JOINTS][HX_POLICY_UNITS]; /* 1    V */
  double action_bias[HX_LEGS][HX_JOINTS];                    /* 1    v */
} hxPolicyDefinition;

/* Command and measurements. */
typedef struct hxPolicyInput {
  struct {
    double vx, vy;   /* m/s    forward, to the left */
    double yaw_rate; /* rad/s  to the left */
  } command;
  double angle[HX_LEGS][HX_JOINTS]; /* rad */
  double quaternion[4];             /* 1      torso to world, w x y z */
  double rotation[3];               /* rad/s  of the torso, world axes */
} hxPolicyInput;

typedef struct hxPolicyOutput {
  double angle_ref[HX_LEGS][HX_JOINTS]; /* rad */
  double action[HX_LEGS][HX_JOINTS];    /* 1    limited to [-1, 1] */
} hxPolicyOutput;

typedef struct hxPolicy hxPolicy;

HX_API void hx_policy_definition_default(hxPolicyDefinition *definition);
HX_API void hx_policy_input_default(hxPolicyInput *input);

/* Sets *range to the ranges of all numbers of the structure; returns how many there are. */
HX_API size_t hx_policy_definition_ranges(const hxRange **range);
HX_API size_t hx_policy_input_ranges(const hxRange **range);

/* Checks a definition. On failure message (HX_MESSAGE_SIZE bytes, may be NULL) says which value was
 * got and what was expected. */
HX_API hxStatus hx_policy_definition_check(const hxPolicyDefinition *definition, char *message);

/* Allocates a policy at time 0 whose actions are 0; NULL when out of memory. */
HX_API hxPolicy *hx_policy_create(void);
HX_API void hx_policy_destroy(hxPolicy *policy);

/* Resets to the first tick at time t. On failure only the message changes. */
HX_API hxStatus hx_policy_reset(hxPolicy *policy, const hxPolicyDefinition *definition, double t);

/* Computes the joint commands at the present time: those of this input when a tick is due,
 * otherwise those of the last tick. The state does not change. */
HX_API void hx_policy_output(const hxPolicy *policy, const hxPolicyInput *input,
                             hxPolicyOutput *output);

/* Steps to t_end >= time under this input, which changes at a rate (1/s; NULL: is constant), and
 * executes all ticks before t_end. On failure only the message changes. */
HX_API hxStatus hx_policy_step(hxPolicy *policy, const hxPolicyInput *input,
                               const hxPolicyInput *rate, double t_end);

HX_API double hx_policy_time(const hxPolicy *policy);
HX_API const char *
hx_policy_message(const hxPolicy *policy); /* of the last failure, "" before any */

/* Save and restore the policy as bytes. HX_BAD_STATE: their definition is not valid; the policy
 * stays as it was. */
HX_API size_t hx_policy_state_size(void);
HX_API void hx_policy_get_state(const hxPolicy *policy, void *bytes);
HX_API hxStatus hx_policy_set_state(hxPolicy *policy, const void *bytes);

#ifdef __cplusplus
}
#endif
#endif
