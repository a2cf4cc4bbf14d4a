/* law.h - the plant's laws of servo, contact and friction for the peers
 *
 * They are written from docs/equations.md and not from the plant's sources.
 *
 * Exact restitution, tanh friction, flat ground, servo in position mode; law_compile refuses
 * anything else.
 */
#ifndef BENCH_LAW_H
#define BENCH_LAW_H

#include <math.h>
#include <stdio.h>

#include "hexapod/hexapod.h"

typedef struct {
  double stiffness, chi, floor; /* eq. 14 */
  double mu, slope;             /* eq. 15 */
  double ground, radius;        /* m */
  double kp, kd, torque_max, speed_max, gear;
} Law;

typedef struct {
  int closed;
  double damping; /* s/m  fixed at touch-down */
} LawFoot;

/* chi (1 + e) = ln((1 + chi) / (1 - chi e)), its root other than 0 */
static inline double law_chi(double e) {
  double low = 0.0, high = 1.0 / e;
  if (e >= 1.0) return 0.0;
  while (high - low > 1e-15 * high) {
    const double middle = 0.5 * (low + high);
    const int below = log((1.0 + middle) / (1.0 - middle * e)) < middle * (1.0 + e);
    if (middle <= low || middle >= high) break;
    *(below ? &low : &high) = middle;
  }
  return low;
}

static inline int law_compile(Law *law, const hxDefinition *d) {
  if (d->contact.law != HX_CONTACT_EXACT_RESTITUTION || d->friction.law != HX_FRICTION_TANH ||
      d->terrain.kind != HX_TERRAIN_FLAT || d->servo.mode != HX_SERVO_POSITION) {
    fprintf(
        stderr,
        "the peers know exact restitution, tanh friction, flat ground and position servos only\n");
    return 1;
  }
  law->stiffness = d->contact.stiffness, law->chi = law_chi(d->contact.restitution),
  law->floor = d->contact.impact_speed_floor;
  law->mu = d->friction.mu, law->slope = d->friction.slope;
  law->ground = d->terrain.height, law->radius = d->foot_radius;
  law->kp = d->servo.kp, law->kd = d->servo.kd, law->torque_max = d->servo.torque_max,
  law->speed_max = d->servo.speed_max;
  law->gear = d->servo.coulomb_friction;
  return 0;
}

static inline double law_within(double x, double low, double high) {
  return x < low ? low : x > high ? high : x;
}

/* Returns the torque of motor (torque-speed line) and gear (dry friction) [N m]. */
static inline double law_servo(const Law *law, double angle, double speed, double angle_ref,
                               double speed_ref, double torque_ref) {
  const double wanted = law->kp * (angle_ref - angle) + law->kd * (speed_ref - speed) + torque_ref;
  const double load = speed / law->speed_max;
  const double high = law->torque_max * law_within(1.0 - load, 0.0, 1.0),
               low = -law->torque_max * law_within(1.0 + load, 0.0, 1.0);
  return law_within(wanted, low, high) - law->gear * tanh(speed / 0.05);
}

static inline double law_damping(const Law *law, double impact_speed) {
  return law->chi / fmax(impact_speed, law->floor);
}

/* Ground on foot [N], world axes: centre of the sphere and velocity of its lowest point. A foot
 * that enters the ground within a step gets the contact force at once, at its present speed,
 * because the peers do not stop at touch-downs. */
static inline double law_foot(const Law *law, const LawFoot *foot, const double centre[3],
                              const double velocity[3], double force[3]) {
  const double depth = law->radius - (centre[2] - law->ground), approach = -velocity[2];
  force[0] = force[1] = force[2] = 0.0;
  if (depth <= 0.0) return depth;
  const double damping = foot->closed ? foot->damping : law_damping(law, approach);
  const double normal = law->stiffness * depth * sqrt(depth) * fmax(1.0 + damping * approach, 0.0);
  const double slip = hypot(velocity[0], velocity[1]);
  const double drag =
      law->mu * normal * (law->slope * slip < 1e-8 ? law->slope : tanh(law->slope * slip) / slip);
  force[0] = -drag * velocity[0], force[1] = -drag * velocity[1], force[2] = normal;
  return depth;
}

/* Updates touch-down and lift-off after a step. */
static inline void law_switch(const Law *law, LawFoot *foot, double depth, double approach) {
  if (depth > 0.0 && !foot->closed) foot->damping = law_damping(law, approach);
  foot->closed = depth > 0.0;
}

#endif
