/* perceptron.h - what a policy observes, and its action. */
#ifndef HX_PERCEPTRON_H
#define HX_PERCEPTRON_H

#include "hexapod/inside.h"
#include "hexapod/policy.h"

HX_HIDDEN_BEGIN

/* Computes the action of a policy for an input at a time since the first tick [s]. */
void hx_policy_act(const hxPolicyDefinition *definition, const hxPolicyInput *input, double time,
                   hxPolicyOutput *output);

HX_HIDDEN_END

#endif
