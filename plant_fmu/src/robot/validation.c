/* validation.c - checks of a definition and of an input, beyond the ranges of their numbers */
#include "robot.h"

#include <math.h>

#include "hexapod/message.h"
#include "hexapod/range_check.h"

/* Returns whether a body can have the inertia I: I and (tr I / 2) 1 - I, its second moments of
 * mass, are positive (semi-)definite, which is the triangle inequality of the principal moments in
 * any axes. */
static int is_inertia(const double I[6]) {
  const double half = 0.5 * (I[0] + I[1] + I[2]), slack = 1e-9 * half;
  const double p[6] = {
      half - I[0] + slack, half - I[1] + slack, half - I[2] + slack, -I[3], -I[4], -I[5]};
  const double minor = p[0] * p[1] - p[3] * p[3];
  const double det = p[0] * (p[1] * p[2] - p[5] * p[5]) - p[3] * (p[3] * p[2] - p[5] * p[4]) +
                     p[4] * (p[3] * p[5] - p[1] * p[4]);
  return half > 0.0 && I[0] > 0.0 && I[1] > 0.0 && I[2] > 0.0 && p[0] >= 0.0 && p[1] >= 0.0 &&
         p[2] >= 0.0 && minor >= 0.0 && det >= 0.0;
}

/* Fails for an impossible inertia I of a body; names its largest moment. */
static void check_inertia(hxChecker *c, const char *body, const double I[6]) {
  static const char *const moment[] = {"inertia_xx", "inertia_yy", "inertia_zz"};
  const int yz = I[2] > I[1] ? 2 : 1, largest = I[yz] > I[0] ? yz : 0;
  char name[32];
  if (is_inertia(I)) return;
  hx_print(name, sizeof name, "%s%s", body, moment[largest]);
  hx_check_fail(c, name, I[largest],
                "an inertia that a body can have: positive, each principal moment at most the "
                "sum of the others");
}

/* Fails for a vector of n numbers without length. */
static void check_not_zero(hxChecker *c, const char *name, const double *x, int n,
                           const char *expected) {
  double square = 0.0;
  for (int i = 0; i < n; ++i) square += x[i] * x[i];
  if (!(square > 1e-12)) hx_check_fail(c, name, sqrt(square), expected);
}

/* Checks inertias, axes and lengths of all links. */
static void check_legs(hxChecker *c, const hxDefinition *d) {
  char name[32];
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxLink *link = &d->leg[leg].link[joint];
      const double tip[3] = {link->length, link->offset_y, link->offset_z};
      hx_joint_label(leg, joint, "", name);
      check_inertia(c, name, link->inertia);
      hx_joint_label(leg, joint, "axis", name);
      check_not_zero(c, name, link->axis, 3, "a direction: not all zero");
      hx_joint_label(leg, joint, "angle_min", name);
      if (!(link->angle_min < link->angle_max))
        hx_check_fail(c, name, link->angle_min, "an angle below the joint's angle_max");
      hx_joint_label(leg, joint, "length", name);
      if (tip[0] == 0.0 && tip[1] == 0.0 && tip[2] == 0.0)
        hx_check_fail(c, name, 0.0, "a tip away from the joint: length and offsets not all zero");
    }
  }
}

/* Checks the constants of motors. */
static void check_servo(hxChecker *c, const hxDefinition *d) {
  const char *positive = "more than 0 with servo.drive motor";
  const int motor = d->servo.drive == HX_DRIVE_MOTOR;
  if (motor && !(d->servo.voltage > 0.0))
    hx_check_fail(c, "servo.voltage", d->servo.voltage, positive);
  if (motor && !(d->servo.torque_constant > 0.0))
    hx_check_fail(c, "servo.torque_constant", d->servo.torque_constant, positive);
  if (d->servo.winding_capacity > 0.0 && !(d->servo.housing_capacity > 0.0))
    hx_check_fail(c, "servo.housing_capacity", d->servo.housing_capacity,
                  "more than 0 where servo.winding_capacity is");
  if (!(d->servo.temperature_max > d->servo.derate_temperature &&
        d->servo.temperature_max > d->servo.air_temperature))
    hx_check_fail(c, "servo.temperature_max", d->servo.temperature_max,
                  "more than servo.derate_temperature and servo.air_temperature");
  if (motor && !(d->servo.resistance > 0.0))
    hx_check_fail(c, "servo.resistance", d->servo.resistance, positive);
}

/* Returns s^T I^-1 s of an inertia I and the unit vector along an axis, 1/(kg m2). */
static double compliance_about(const double I[6], const double axis[3]) {
  const double xx = I[0], yy = I[1], zz = I[2], xy = I[3], xz = I[4], yz = I[5];
  const double c[6] = {yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy,
                       xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz};
  const double det = xx * c[0] + xy * c[3] + xz * c[4];
  const double x = axis[0], y = axis[1], z = axis[2];
  const double form = c[0] * x * x + c[1] * y * y + c[2] * z * z +
                      2.0 * (c[3] * x * y + c[4] * x * z + c[5] * y * z);
  return form / (det * (x * x + y * y + z * z));
}

/* Fails for rotors that are heavier than the bodies which contain them: the inertia of each about
 * its own axis is J_r/n^2, and the torso has six. */
static void check_rotors(hxChecker *c, const hxDefinition *d) {
  const double ratio = d->servo.gear_ratio;
  double compliance = 0.0;
  if (ratio == 0.0) return;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double yaw = d->leg[leg].hip_yaw, *a = d->leg[leg].link[0].axis;
    const double axis[3] = {cos(yaw) * a[0] - sin(yaw) * a[1], sin(yaw) * a[0] + cos(yaw) * a[1],
                            a[2]};
    compliance = fmax(compliance, HX_LEGS * compliance_about(d->torso.inertia, axis));
    for (int joint = 1; joint < HX_JOINTS; ++joint)
      compliance = fmax(compliance, compliance_about(d->leg[leg].link[joint - 1].inertia,
                                                     d->leg[leg].link[joint].axis));
  }
  if (d->servo.rotor_inertia * compliance >= ratio * ratio)
    hx_check_fail(c, "servo.gear_ratio", ratio,
                  "0, or turns so many that rotor_inertia over their square is less than the "
                  "inertia of every body that contains a rotor");
}

/* Checks conditions between several numbers that are within their ranges. */
static void check_relations(hxChecker *c, const hxDefinition *d) {
  check_inertia(c, "torso.", d->torso.inertia);
  check_legs(c, d);
  check_servo(c, d);
  if (c->status == HX_OK) check_rotors(c, d);
  if ((d->contact.law == HX_CONTACT_EXACT_RESTITUTION || d->contact.law == HX_CONTACT_FLORES) &&
      d->contact.restitution < 1e-3)
    hx_check_fail(c, "contact.restitution", d->contact.restitution,
                  "0.001 to 1 with this contact.law, which divides by it");
  if (d->friction.mu_static != 0.0 && d->friction.mu_static < d->friction.mu)
    hx_check_fail(c, "friction.mu_static", d->friction.mu_static,
                  "at least friction.mu, or 0, which means the same");
  else if (d->friction.mu_static > d->friction.mu &&
           !hx_friction_kind(d->friction.law).has_friction)
    hx_check_fail(c, "friction.mu_static", d->friction.mu_static,
                  "0 or friction.mu with friction.law none, which has no friction");
  if (d->body.self_contact == HX_SELF_FORCE && d->body.knee_radius == 0.0 &&
      d->body.shank_radius == 0.0)
    hx_check_fail(c, "body.knee_radius", d->body.knee_radius,
                  "a radius > 0 of femurs, or of tibias (body.shank_radius), with "
                  "body.self_contact force");
  check_not_zero(c, "initial.quaternion", d->initial.quaternion, 4, "a quaternion: not all zero");
}

hxStatus hx_definition_check(const hxDefinition *d, char *message) {
  hxChecker c = {HX_OK, message};
  const hxRange *range;
  const size_t n = hx_definition_ranges(&range);
  hx_check_ranges(&c, d, range, n);
  if (c.status == HX_OK) check_relations(&c, d);
  return c.status;
}

hxStatus hx_definition_check_coordinates(const hxDefinition *d, char *message) {
  if (d->servo.goal_speed_max > 0.0 || d->servo.overload_time > 0.0) {
    if (message)
      hx_print(message, HX_MESSAGE_SIZE,
               "servo.goal_speed_max, servo.overload_time: got a firmware whose memory is no "
               "continuous state; expected 0 in model exchange and for derivatives; set them to 0, "
               "or use co-simulation and differences");
    return HX_INVALID_ARGUMENT;
  }
  return HX_OK;
}

/* Returns whether no number of an input is outside of the narrowest ranges: of angles, rad, of
 * shares (weakness and lock, the last numbers) and of all others. Inputs of walks are, and every
 * step asks this first. */
static int is_well_inside(const hxInput *input) {
  enum { ANGLES = HX_LEGS * HX_JOINTS, SIZE = sizeof(hxInput) / sizeof(double) };
  const double angle = 6.28, others = 1e4;
  const double *x = &input->angle_ref[0][0];
  int outside = 0;
  for (int i = 0; i < ANGLES; ++i) outside |= !(fabs(x[i]) <= angle);
  for (int i = ANGLES; i < SIZE - 2 * ANGLES; ++i) outside |= !(fabs(x[i]) <= others);
  for (int i = SIZE - 2 * ANGLES; i < SIZE; ++i) outside |= !(x[i] >= 0.0 && x[i] <= 1.0);
  return !outside;
}

hxStatus hx_input_check(const hxInput *input, char *message) {
  hxChecker c = {HX_OK, message};
  if (is_well_inside(input)) return HX_OK;
  const hxRange *range;
  const size_t n = hx_input_ranges(&range);
  hx_check_ranges(&c, input, range, n);
  return c.status == HX_OK ? HX_OK : HX_INVALID_ARGUMENT;
}
