/* health.h - finds servos that do not follow their commands, and when they do again (C57). Python:
 * controller/sense/health.py. */
#ifndef HX_HEALTH_H
#define HX_HEALTH_H

#include "../walk/kinematics.h"

typedef struct hxHealthModel {
  double stiffness; /* N m/rad  of the servos */
  double drag;      /* N m s/rad  that the speed takes from their torque */
  double rotor;     /* kg m2  inertia at the joint */
  double most;      /* N m  largest torque */
  double way;       /* rad  by which a firmware leads its servo in a period at most */
  double period;    /* s */
} hxHealthModel;

typedef struct hxHealth {
  double strange[HX_LEGS][HX_JOINTS]; /* s  of unexplained torque, with its sign */
  double still[HX_LEGS][HX_JOINTS];   /* s  for which the joint has not moved */
  double proof[HX_LEGS][HX_JOINTS];   /* s  for which the servo has seemed to work */
  double goal[HX_LEGS][HX_JOINTS];    /* rad  to which the firmware has led its servo */
  double angle[HX_LEGS][HX_JOINTS];   /* rad  measured at the last step */
  double speed[HX_LEGS][HX_JOINTS];   /* rad/s  in the period before it */
  int begun;                          /* there was one */
  int faulty[HX_LEGS][HX_JOINTS];     /* the servo does not work */
  int locked[HX_LEGS][HX_JOINTS];     /* its joint did not move when this was found */
} hxHealth;

static const double strange_share = 0.5;  /* 1  of the largest torque, that nothing explains */
static const double strange_time = 0.035; /* s  in one direction: the servo does not work */
/* s  largest damping over stiffness, besides the drag of the model */
static const double damping_time = 0.02;
static const double still_speed = 0.05; /* rad/s  of a joint that does not move */
static const double sound_share = 0.35; /* 1  of the largest torque: the servo seems to work */
/* s  for which a servo must seem to work: longer than a period of the trial */
static const double proof_time = 1.2;

static inline void hx_health_compile(const hxControllerDefinition *definition,
                                     hxHealthModel *model) {
  model->stiffness = definition->servo.kp;
  model->drag = definition->servo.drag;
  model->rotor = definition->servo.rotor_inertia;
  model->most = hx_smaller(definition->gains.limits.torque, definition->servo.torque_limit);
  const double way = definition->servo.goal_speed_max * definition->period;
  model->way = way > 0.0 ? way : INFINITY;
  model->period = definition->period;
}

/* Returns the torque of a servo's model that nothing explains, over the largest one. speed_before:
 * of the joint a period ago, speed: now [rad/s]; error: of the angle [rad]; load: torque that the
 * joint needs with the measured force on the foot, free: with the least force on it [N m]. */
static inline double unexplained(const hxHealthModel *model, double speed_max, double speed_before,
                                 double speed, double speed_ref, double error, double torque_ref,
                                 double load, double free) {
  const double pace = speed / speed_max, low = -model->most * hx_clamp(1.0 + pace, 0.0, 1.0),
               high = model->most * hx_clamp(1.0 - pace, 0.0, 1.0),
               torque = model->stiffness * error + torque_ref - model->drag * speed,
               damping = damping_time * model->stiffness, slowed = torque - damping * speed,
               followed = torque + damping * (speed_ref - speed),
               weakest = hx_smaller(torque, hx_smaller(slowed, followed)),
               strongest = hx_larger(torque, hx_larger(slowed, followed)),
               spin = model->rotor / model->period * (speed - speed_before),
               least = hx_clamp(weakest, low, high) - hx_larger(load, free) - hx_larger(spin, 0.0),
               most =
                   hx_clamp(strongest, low, high) - hx_smaller(load, free) - hx_smaller(spin, 0.0);
  return (hx_larger(least, 0.0) + hx_smaller(most, 0.0)) / model->most;
}

/* Judges a servo whose unexplained torque is `excess`, over the largest one. rests: its joint has
 * not moved in the period. */
static inline void judge(double period, double excess, int rests, int leg, int joint,
                         hxHealth *health) {
  double *strange = &health->strange[leg][joint], *still = &health->still[leg][joint],
         *proof = &health->proof[leg][joint];
  int *faulty = &health->faulty[leg][joint];
  const double size = fabs(excess), sign = size > strange_share ? (excess > 0.0 ? 1.0 : -1.0) : 0.0;
  *still = rests ? *still + period : 0.0;
  *strange = (sign * *strange > 0.0 ? *strange : 0.0) + sign * period;
  *proof = size < sound_share ? *proof + period : 0.0;
  if (!*faulty) health->locked[leg][joint] = *still > strange_time;
  *faulty = (*faulty && *proof < proof_time) || fabs(*strange) > strange_time;
}

/* Judges the servos by a period under a command. angle: measured at its end [rad]; force: of the
 * ground on the feet, torso axes [N], of which no more counts than the servo can carry; lifted:
 * feet that their legs lift, which bear none to all of the force: a stuck sensor, or a stone in the
 * way of the leg. */
static inline void hx_health_step(const hxHealthModel *model, const hxLegSolver leg[HX_LEGS],
                                  const double angle[HX_LEGS][HX_JOINTS],
                                  const double force[HX_LEGS][3], const hxControllerOutput *command,
                                  const int lifted[HX_LEGS], hxHealth *health) {
  for (int k = 0; k < HX_LEGS; ++k) {
    double load[HX_JOINTS];
    hx_leg_solver_load_torques(&leg[k], angle[k], force[k], load);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double now = angle[k][joint], before = health->begun ? health->angle[k][joint] : now,
                   speed = (now - before) / model->period, speed_max = leg[k].speed_max,
                   speed_ref = command->speed_ref[k][joint],
                   asked = command->angle_ref[k][joint] +
                           model->period * hx_clamp(speed_ref, -speed_max, speed_max),
                   led = health->begun ? health->goal[k][joint] : asked,
                   goal = hx_clamp(asked, led - model->way, led + model->way),
                   needed = hx_clamp(load[joint], -model->most, model->most),
                   excess = unexplained(model, speed_max, health->speed[k][joint], speed, speed_ref,
                                        goal - now, command->torque_ref[k][joint], needed,
                                        lifted[k] ? 0.0 : needed);
      judge(model->period, excess, fabs(now - before) < still_speed * model->period, k, joint,
            health);
      health->goal[k][joint] = goal;
      health->angle[k][joint] = now;
      health->speed[k][joint] = speed;
    }
  }
  health->begun = 1;
}

/* Returns whether some servo of a leg does not work. */
static inline int hx_health_lost(const hxHealth *health, int leg) {
  return health->faulty[leg][0] || health->faulty[leg][1] || health->faulty[leg][2];
}

/* Returns whether a leg can bear a load: neither femur nor tibia is limp. */
static inline int hx_health_bearing(const hxHealth *health, int leg) {
  const int *faulty = health->faulty[leg], *locked = health->locked[leg];
  return (!faulty[1] || locked[1]) && (!faulty[2] || locked[2]);
}

#endif
