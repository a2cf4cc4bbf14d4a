#include "check.h"

#include <float.h>
#include <math.h>
#include <stdio.h>

#include "contact.h"
#include "friction.h"
#include "method.h"
#include "terrain.h"

static const char *const leg_names[HX_LEGS] = {"LF", "LM", "LR", "RF", "RM", "RR"};
static const char *const joint_names[HX_JOINTS] = {"coxa", "femur", "tibia"};

/* Collects the first failure; every check after it is silent. */
typedef struct {
  hxStatus status;
  char *message;
} hxChecker;

static void fail(hxChecker *c, const char *where, const char *name, double got, const char *expected) {
  if (c->status != HX_OK) return;
  c->status = HX_INVALID_MODEL;
  if (c->message) snprintf(c->message, HX_MESSAGE_SIZE, "%s%s: got %.9g, expected %s", where, name, got, expected);
}

static void within(hxChecker *c, const char *where, const char *name, double x, double low, double high, const char *expected) {
  if (!(x >= low && x <= high)) fail(c, where, name, x, expected);
}

static void positive(hxChecker *c, const char *where, const char *name, double x) {
  within(c, where, name, x, DBL_MIN, DBL_MAX, "a positive number");
}

static void not_negative(hxChecker *c, const char *where, const char *name, double x) {
  within(c, where, name, x, 0.0, DBL_MAX, "zero or a positive number");
}

static void finite_all(hxChecker *c, const char *where, const char *name, const double *x, int n) {
  for (int i = 0; i < n; ++i) within(c, where, name, x[i], -DBL_MAX, DBL_MAX, "finite numbers");
}

/* A body can have inertia I when I and (tr I / 2) 1 - I, its second moments of mass, are positive (semi-)definite:
 * that is the triangle inequality of the principal moments, whatever the axes. */
static int is_inertia(const double I[6]) {
  const double half = 0.5 * (I[0] + I[1] + I[2]), slack = 1e-9 * half;
  const double p[6] = {half - I[0] + slack, half - I[1] + slack, half - I[2] + slack, -I[3], -I[4], -I[5]};
  const double minor = p[0] * p[1] - p[3] * p[3];
  const double det = p[0] * (p[1] * p[2] - p[5] * p[5]) - p[3] * (p[3] * p[2] - p[5] * p[4]) + p[4] * (p[3] * p[5] - p[1] * p[4]);
  return half > 0.0 && I[0] > 0.0 && I[1] > 0.0 && I[2] > 0.0 && p[0] >= 0.0 && p[1] >= 0.0 && p[2] >= 0.0 && minor >= 0.0 && det >= 0.0;
}

static void body(hxChecker *c, const char *where, double mass, const double com[3], const double inertia[6]) {
  positive(c, where, ".mass", mass);
  finite_all(c, where, ".com", com, 3);
  finite_all(c, where, ".inertia", inertia, 6);
  if (!is_inertia(inertia))
    fail(c, where, ".inertia_xx", inertia[0],
         "an inertia that a body can have: positive, each principal moment at most the sum of the others");
}

static void length_not_zero(hxChecker *c, const char *where, const char *name, const double *x, int n, const char *expected) {
  double square = 0.0;
  for (int i = 0; i < n; ++i) square += x[i] * x[i];
  if (!(square > 1e-12 && square < DBL_MAX)) fail(c, where, name, sqrt(square), expected);
}

static void legs(hxChecker *c, const hxDefinition *d) {
  char where[32];
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    finite_all(c, leg_names[leg], ".hip_position", d->leg[leg].hip_position, 3);
    finite_all(c, leg_names[leg], ".hip_yaw", &d->leg[leg].hip_yaw, 1);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxLink *link = &d->leg[leg].link[joint];
      const double offset[2] = {link->offset_y, link->offset_z};
      snprintf(where, sizeof where, "%s.%s", leg_names[leg], joint_names[joint]);
      body(c, where, link->mass, link->com, link->inertia);
      positive(c, where, ".length", link->length);
      finite_all(c, where, ".offset", offset, 2);
      length_not_zero(c, where, ".axis", link->axis, 3, "a direction: not all zero");
    }
  }
}

static void laws(hxChecker *c, const hxDefinition *d) {
  if (!hx_contact(d->contact.law)) fail(c, "contact", ".law", d->contact.law, "1 to 6, an item of the enumeration");
  if (!hx_friction(d->friction.law)) fail(c, "friction", ".law", d->friction.law, "1 or 2, an item of the enumeration");
  if (!hx_terrain(d->terrain.kind)) fail(c, "terrain", ".kind", d->terrain.kind, "1 or 2, an item of the enumeration");
  if (!hx_method(d->solver.method)) fail(c, "solver", ".method", d->solver.method, "1 to 5, an item of the enumeration");
  within(c, "servo", ".mode", d->servo.mode, HX_SERVO_POSITION, HX_SERVO_KINEMATIC, "1 to 3, an item of the enumeration");
  positive(c, "contact", ".stiffness", d->contact.stiffness);
  within(c, "contact", ".restitution", d->contact.restitution, 0.0, 1.0, "0 to 1");
  if (d->contact.law == HX_CONTACT_EXACT_RESTITUTION || d->contact.law == HX_CONTACT_FLORES)
    within(c, "contact", ".restitution", d->contact.restitution, 1e-3, 1.0, "0.001 to 1 with this contact.law, which divides by it");
  not_negative(c, "contact", ".damping_factor", d->contact.damping_factor);
  positive(c, "contact", ".impact_speed_floor", d->contact.impact_speed_floor);
  not_negative(c, "friction", ".mu", d->friction.mu);
  not_negative(c, "friction", ".slope", d->friction.slope);
}

static void settings(hxChecker *c, const hxDefinition *d) {
  const double step = d->solver.step;
  positive(c, "foot", ".radius", d->foot_radius);
  not_negative(c, "servo", ".kp", d->servo.kp);
  not_negative(c, "servo", ".kd", d->servo.kd);
  not_negative(c, "servo", ".torque_max", d->servo.torque_max);
  positive(c, "servo", ".speed_max", d->servo.speed_max);
  not_negative(c, "servo", ".rotor_inertia", d->servo.rotor_inertia);
  not_negative(c, "servo", ".coulomb_friction", d->servo.coulomb_friction);
  not_negative(c, "baumgarte", ".alpha", d->baumgarte.alpha);
  not_negative(c, "baumgarte", ".beta", d->baumgarte.beta);
  finite_all(c, "gravity", "", d->gravity, 3);
  if (step != 0.0) within(c, "solver", ".step", step, 1e-9, 1.0, "0 (error control) or 1e-9 s to 1 s");
  within(c, "solver", ".tolerance", d->solver.tolerance, 1e-13, 1.0, "1e-13 to 1");
  within(c, "solver", ".step_max", d->solver.step_max, 1e-9, 1.0, "1e-9 s to 1 s");
  if (hx_method(d->solver.method) && hx_method(d->solver.method)->error_order == 0 && step == 0.0)
    fail(c, "solver", ".step", step, "a fixed step > 0 with this solver.method, which has no error estimate");
  finite_all(c, "terrain", ".height", &d->terrain.height, 1);
  within(c, "terrain", ".incline", d->terrain.incline, -1.5, 1.5, "-1.5 to 1.5 rad");
  finite_all(c, "terrain", ".heading", &d->terrain.heading, 1);
}

static void initial(hxChecker *c, const hxDefinition *d) {
  finite_all(c, "initial", ".position", d->initial.position, 3);
  length_not_zero(c, "initial", ".quaternion", d->initial.quaternion, 4, "a quaternion: not all zero");
  finite_all(c, "initial", ".velocity", d->initial.velocity, 3);
  finite_all(c, "initial", ".angular_velocity", d->initial.angular_velocity, 3);
  finite_all(c, "initial", ".angle", &d->initial.angle[0][0], HX_LEGS * HX_JOINTS);
  finite_all(c, "initial", ".speed", &d->initial.speed[0][0], HX_LEGS * HX_JOINTS);
}

hxStatus hx_definition_check(const hxDefinition *d, char *message) {
  hxChecker c = {HX_OK, message};
  body(&c, "torso", d->torso.mass, d->torso.com, d->torso.inertia);
  legs(&c, d);
  laws(&c, d);
  settings(&c, d);
  initial(&c, d);
  return c.status;
}

hxStatus hx_input_check(const hxInput *input, char *message) {
  hxChecker c = {HX_OK, message};
  const int n = HX_LEGS * HX_JOINTS;
  finite_all(&c, "input", ".angle_ref", &input->angle_ref[0][0], n);
  finite_all(&c, "input", ".speed_ref", &input->speed_ref[0][0], n);
  finite_all(&c, "input", ".torque_ref", &input->torque_ref[0][0], n);
  finite_all(&c, "torso", ".push_force", input->push_force, 3);
  finite_all(&c, "torso", ".push_torque", input->push_torque, 3);
  return c.status == HX_OK ? HX_OK : HX_INVALID_ARGUMENT;
}
