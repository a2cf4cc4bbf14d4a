/* validation.c - checks of definitions and inputs. */
#include <math.h>

#include "hexapod/message.h"
#include "hexapod/range_check.h"
#include "state.h"

static void legs(hxChecker *c, const hxControllerDefinition *d) {
  char name[32];
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxKnownLink *link = &d->leg[leg].link[joint];
      hx_joint_label(leg, joint, "stance", name);
      if (!(link->stance >= link->angle_min && link->stance <= link->angle_max))
        hx_check_fail(c, name, link->stance,
                      "an angle between the joint's angle_min and angle_max");
      /* femur and tibia are the arms of a planar linkage */
      hx_joint_label(leg, joint, "length", name);
      if (joint > 0 && !(hx_length(hx_plane(link->length, link->offset_z)) > 1e-6))
        hx_check_fail(c, name, link->length,
                      "a tip away from the joint: length and offset_z not both zero");
    }
  }
}

/* Checks conditions between several numbers that are within their ranges. */
static void relations(hxChecker *c, const hxControllerDefinition *d) {
  char expected[96];
  const double stance = d->gait.duty * d->gait.period,
               swing = (1.0 - d->gait.duty) * d->gait.period, shorter = fmin(stance, swing);
  hx_print(expected, sizeof expected, "less than %.9g s, the gait's shorter phase", shorter);
  if (!(d->period < shorter)) hx_check_fail(c, "period", d->period, expected);
  if (d->control != HX_CONTROL_KINEMATIC && !(d->servo.kp > 0.0))
    hx_check_fail(c, "servo.kp", d->servo.kp,
                  "more than 0 except under kinematic control: the others shift the servos' "
                  "targets");
  legs(c, d);
}

hxStatus hx_controller_definition_check(const hxControllerDefinition *definition, char *message) {
  hxChecker c = {HX_OK, message};
  const hxRange *range;
  const size_t n = hx_controller_definition_ranges(&range);
  hx_check_ranges(&c, definition, range, n);
  if (c.status == HX_OK) relations(&c, definition);
  return c.status;
}

hxStatus hx_controller_input_check(const hxControllerInput *input, char *message) {
  hxChecker c = {HX_OK, message};
  const hxRange *range;
  const size_t n = hx_controller_input_ranges(&range);
  hx_check_ranges(&c, input, range, n);
  return c.status == HX_OK ? HX_OK : HX_INVALID_ARGUMENT;
}
