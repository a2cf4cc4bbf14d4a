#include "check.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Collects the first failure; every check after it is silent. */
typedef struct {
  hxStatus status;
  char *message;
} hxChecker;

static void fail(hxChecker *c, const char *name, double got, const char *expected) {
  if (c->status != HX_OK) return;
  c->status = HX_INVALID_MODEL;
  if (c->message) snprintf(c->message, HX_MESSAGE_SIZE, "%s: got %.9g, expected %s", name, got, expected);
}

static double number_at(const void *structure, const hxRange *range) {
  const char *place = (const char *)structure + range->offset;
  double real;
  int whole;
  if (range->is_int) {
    memcpy(&whole, place, sizeof whole);
    return (double)whole;
  }
  memcpy(&real, place, sizeof real);
  return real;
}

/* Every number within its range; NaN lies in none. */
static void within(hxChecker *c, const void *structure, const hxRange *range, size_t n) {
  char expected[96];
  for (size_t i = 0; i < n; ++i) {
    const double x = number_at(structure, &range[i]);
    if (x >= range[i].min && x <= range[i].max) continue;
    snprintf(expected, sizeof expected, "%.9g to %.9g %s", range[i].min, range[i].max, range[i].unit);
    fail(c, range[i].name, x, expected);
    return;
  }
}

static void legs(hxChecker *c, const hxControllerDefinition *d) {
  static const char *const leg_names[HX_LEGS] = {"LF", "LM", "LR", "RF", "RM", "RR"};
  static const char *const joint_names[HX_JOINTS] = {"coxa", "femur", "tibia"};
  char name[32];
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxKnownLink *link = &d->leg[leg].link[joint];
      snprintf(name, sizeof name, "%s.%s.stance", leg_names[leg], joint_names[joint]);
      if (!(link->stance >= link->angle_min && link->stance <= link->angle_max))
        fail(c, name, link->stance, "an angle between the joint's angle_min and angle_max");
    }
  }
}

/* What numbers within their ranges must be together. */
static void relations(hxChecker *c, const hxControllerDefinition *d) {
  char expected[96];
  const double stance = d->gait.duty * d->gait.period, swing = (1.0 - d->gait.duty) * d->gait.period, shorter = fmin(stance, swing);
  snprintf(expected, sizeof expected, "less than %.9g s, the gait's shorter phase", shorter);
  if (!(d->period < shorter)) fail(c, "period", d->period, expected);
  if (d->control == HX_CONTROL_COMPLIANT && !(d->servo.kp > 0.0))
    fail(c, "servo.kp", d->servo.kp, "more than 0 under compliant control, which shifts the servos' targets");
  legs(c, d);
}

hxStatus hx_controller_definition_check(const hxControllerDefinition *definition, char *message) {
  hxChecker c = {HX_OK, message};
  const hxRange *range;
  const size_t n = hx_controller_definition_ranges(&range);
  within(&c, definition, range, n);
  if (c.status == HX_OK) relations(&c, definition);
  return c.status;
}

hxStatus hx_controller_input_check(const hxControllerInput *input, char *message) {
  hxChecker c = {HX_OK, message};
  const hxRange *range;
  const size_t n = hx_controller_input_ranges(&range);
  within(&c, input, range, n);
  return c.status == HX_OK ? HX_OK : HX_INVALID_ARGUMENT;
}
