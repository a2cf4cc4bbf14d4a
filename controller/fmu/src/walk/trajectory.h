/* trajectory.h - from the body command to the paths of the feet. Python:
 * controller/walk/trajectory.py. */
#ifndef HX_TRAJECTORY_H
#define HX_TRAJECTORY_H

#include "gait.h"
#include "kinematics.h"
#include <string.h>

enum { HX_COMMANDS = 6 }; /* vx vy yaw_rate height roll pitch */

/* Smooths steps of the command (C1): a cubic from the present value and rate to the new value with
 * rate 0. */
typedef struct hxCommandRampModel {
  double duration, period; /* s */
  int64_t end;             /* steps that a change takes */
} hxCommandRampModel;

typedef struct hxCommandRamp {
  double target[HX_COMMANDS];
  double cubic[4][HX_COMMANDS];
  int64_t steps; /* periods since the target was set */
} hxCommandRamp;

typedef struct hxFootPathsModel {
  double period, gait_period, duty, step_height, touchdown_speed;
  double gait_offset[HX_LEGS]; /* cycles; phases at clock 0 */
  double offset[HX_LEGS];      /* cycles; phases at the start of the walk */
  /* the walk begins during the leg's swing, or while it takes up its load */
  int late[HX_LEGS];
  double handover;             /* cycles in which a leg takes up or gives up its load (C18) */
  double swing_time;           /* s */
  double landing_lead;         /* s, from lift-off to the middle of the next stance */
  hxPlane home[HX_LEGS];       /* m   feet of the stance */
  hxPlane inward[HX_LEGS];     /* m   from the stance to the narrow one */
  double turned[HX_LEGS];      /* m   that the feet roll outwards on this way */
  double home_height[HX_LEGS]; /* m */
} hxFootPathsModel;

/* Motion of the body at one step: the command, plus what leads the body back to its path. */
typedef struct hxTwist {
  hxPlane velocity; /* m/s */
  double yaw_rate;  /* rad/s */
} hxTwist;

/* The feet at one step, as the command plans them, in the walking frame. goal, pull, way and turn
 * are in the ground frame. */
typedef struct hxPlannedFeet {
  hxPlane plane[HX_LEGS];    /* m    centres, x + i y */
  double height[HX_LEGS];    /* m    z */
  hxPlane velocity[HX_LEGS]; /* m/s  of x + i y */
  double rise[HX_LEGS];      /* m/s  of z */
  double phase[HX_LEGS];     /* 1    in [0, 1) */
  double blend[HX_LEGS];     /* 1    s of swinging feet, else 0 */
  /* m, where a swinging foot will touch down, or where a standing foot stands */
  hxPlane goal[HX_LEGS];
  hxPlane pull[HX_LEGS];  /* m, (goal - foot)/(1 - s) of swinging feet, 0 of standing feet */
  double rolled[HX_LEGS]; /* m, outwards from the stance to the position that the foot aims at */
  hxPlane way;            /* m, displacement of the walking frame over the ground */
  double turn;            /* rad  of the walking frame over the ground */
  hxTwist twist;          /* of the body */
} hxPlannedFeet;

/* The paths of the feet between a lift-off or touch-down and the next one. The same legs are in the
 * air throughout such a section of the walk. */
typedef struct hxFootPaths {
  int walking;           /* the gait clock runs */
  int64_t before;        /* periods from the start of the walk to the first step of the section */
  int swinging[HX_LEGS]; /* in the air */
  /* stands by the gait clock; a foot that makes no step neither stands by the clock nor swings */
  int standing[HX_LEGS];
  int lifted[HX_LEGS]; /* the foot lifts off at the start of the section */
  int stayed[HX_LEGS]; /* the foot needed no step at its last lift-off and stood during its swing */
  /* the foot will need no step at its next lift-off: it is at its stance position under a body at
   * rest */
  int stays[HX_LEGS];
  int met[HX_LEGS]; /* the foot has met the ground on its way down, and stays where it is */
  int held; /* the gait clock stands still until feet at the ends of their swings carry load */
  int awaited[HX_LEGS]; /* the gait clock waits for this foot */
  int ending;           /* another gait follows: legs finish their steps and begin no other */
  double narrowing;     /* 1, part of the way to the narrow stance that the steps aim at */
} hxFootPaths;

/* 1, share of the swing at each end in which the foot moves vertically only */
static const double dwell = 0.1;
/* 1, part of the swing after which the landing point stays fixed on the ground */
static const double freeze = 0.75;
static const double same_distance = 1e-6; /* m, distances that differ by less are equal */
/* m, a foot this close to its stance position makes no step */
static const double home_tolerance = 1e-9;
/* cycles by which the clock starts before the first lift-off */
static const double clock_epsilon = 1e-9;
static const double nearly_done = 1e-12; /* 1   floor of 1 - s */
static const double small_angle = 1e-12; /* rad, below it sin(a)/a is 1 */

/* ------------------------------------------------------------------------------------ command */

static inline void hx_command_ramp_compile(double duration, double period,
                                           hxCommandRampModel *model) {
  model->duration = duration;
  model->period = period;
  model->end = (int64_t)(duration / period);
  while ((double)model->end * period < duration) ++model->end;
}

static inline void hx_command_ramp_reset(const hxCommandRampModel *model, hxCommandRamp *ramp) {
  memset(ramp, 0, sizeof *ramp);
  ramp->steps = model->end;
}

static inline int hx_command_ramp_settled(const hxCommandRampModel *model,
                                          const hxCommandRamp *ramp) {
  return ramp->steps >= model->end;
}

/* Returns whether the body is commanded to move, not only to change its posture. */
static inline int hx_command_ramp_moves(const hxCommandRamp *ramp) {
  return ramp->target[0] != 0.0 || ramp->target[1] != 0.0 || ramp->target[2] != 0.0;
}

/* Sets the cubic from a value and rate to the target at rest (C1). */
static inline void bend(double duration, const double value[HX_COMMANDS],
                        const double rate[HX_COMMANDS], hxCommandRamp *ramp) {
  for (int i = 0; i < HX_COMMANDS; ++i) {
    const double gap = ramp->target[i] - value[i], slope = rate[i] * duration;
    ramp->cubic[0][i] = value[i];
    ramp->cubic[1][i] = slope;
    ramp->cubic[2][i] = 3.0 * gap - 2.0 * slope;
    ramp->cubic[3][i] = slope - 2.0 * gap;
  }
}

/* Computes the command a number of periods ahead, and its rate per second. */
static inline void hx_command_ramp_ahead(const hxCommandRampModel *model, const hxCommandRamp *ramp,
                                         int64_t steps, double value[HX_COMMANDS],
                                         double rate[HX_COMMANDS]) {
  const int64_t number = ramp->steps + steps;
  const double x = (double)number * model->period / model->duration;
  const int under_way = number < model->end;
  for (int i = 0; i < HX_COMMANDS; ++i) {
    const double c0 = ramp->cubic[0][i], c1 = ramp->cubic[1][i], c2 = ramp->cubic[2][i],
                 c3 = ramp->cubic[3][i];
    value[i] = under_way ? c0 + x * (c1 + x * (c2 + x * c3)) : ramp->target[i];
    rate[i] = under_way ? (c1 + x * (2.0 * c2 + 3.0 * x * c3)) / model->duration : 0.0;
  }
}

/* Sets the command to go to. Returns whether it is a new one. */
static inline int hx_command_ramp_aim(const hxCommandRampModel *model,
                                      const double target[HX_COMMANDS], hxCommandRamp *ramp) {
  double value[HX_COMMANDS], rate[HX_COMMANDS];
  int same = 1;
  for (int i = 0; i < HX_COMMANDS; ++i) same &= target[i] == ramp->target[i];
  if (same) return 0;
  hx_command_ramp_ahead(model, ramp, 0, value, rate);
  memcpy(ramp->target, target, sizeof ramp->target);
  bend(model->duration, value, rate, ramp);
  ramp->steps = 0;
  return 1;
}

/* Continues the change of another ramp, from its present value and rate, in the model's own time.
 */
static inline void hx_command_ramp_carry(const hxCommandRampModel *model,
                                         const hxCommandRampModel *before, hxCommandRamp *ramp) {
  double value[HX_COMMANDS], rate[HX_COMMANDS];
  hx_command_ramp_ahead(before, ramp, 0, value, rate);
  ramp->steps = hx_command_ramp_settled(before, ramp) ? model->end : 0;
  bend(model->duration, value, rate, ramp);
}

/* ------------------------------------------------------------------------------------- shapes */

/* Computes the horizontal progress s in [0, 1] at the part tau of a swing, and ds/dtau (C6). */
static inline void blend(double tau, double *s, double *slope) {
  const double y = hx_clamp((2.0 * tau - 1.0) / (1.0 - 2.0 * dwell), -1.0, 1.0);
  const double y4 = y * y * y * y, flat = 1.0 - y4;
  *s = 0.5 + y * (45.0 + y4 * (5.0 * y4 - 18.0)) / 64.0;
  *slope = 45.0 / 32.0 * flat * flat / (1.0 - 2.0 * dwell);
}

/* Computes the lift z of the foot at the part tau of a swing, and dz/dtau [m] (C7). top: the step
 * height; down: the touch-down speed times the duration of the swing [m]. */
static inline void hop(double tau, double top, double down, double *lift, double *climb) {
  const double arch = tau * (1.0 - tau), bow = 64.0 * top * arch * arch, fall = down * tau * tau;
  *lift = (bow + fall) * arch;
  *climb = 3.0 * bow * (1.0 - 2.0 * tau) + fall * (3.0 - 4.0 * tau);
}

/* Returns the displacement [m] under a constant twist for a time [s]: v (e^(i w t) - 1)/(i w) (C3).
 */
static inline hxPlane travel(hxTwist twist, double time) {
  const double half = 0.5 * twist.yaw_rate * time;
  const hxPlane turned = hx_cis(half);
  const double chord = fabs(half) > small_angle ? turned.y / half : 1.0;
  return hx_times(hx_scaled(twist.velocity, time * chord), turned);
}

/* -------------------------------------------------------------------------------------- paths */

/* Sets the phases of the legs at the begin of the walk [cycles]. */
HX_SELDOM static void start_at(hxFootPathsModel *model, const double begin[HX_LEGS]) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double first = begin[leg] + clock_epsilon, phase = hx_fraction(first);
    model->offset[leg] = begin[leg] - clock_epsilon;
    model->late[leg] = phase >= model->duty || phase < 0.5 * model->handover;
  }
}

static inline void hx_foot_paths_compile(const hxControllerDefinition *definition,
                                         const hxLegSolver leg[HX_LEGS], hxFootPathsModel *model) {
  const hxGait *gait = &definition->gait;
  double begin[HX_LEGS], foot[3];
  double *offset = model->gait_offset;
  hx_gait_offsets(gait, offset);
  model->period = definition->period;
  model->gait_period = gait->period;
  model->duty = gait->duty;
  model->step_height = gait->step_height;
  model->touchdown_speed = gait->touchdown_speed;
  model->swing_time = gait->period * (1.0 - gait->duty);
  model->landing_lead = 0.5 * gait->period * gait->duty + model->swing_time;
  for (int k = 0; k < HX_LEGS; ++k) {
    begin[k] = offset[k] + hx_gait_start_clock(gait, offset);
    hx_leg_solver_forward(&leg[k], leg[k].stance, foot);
    model->home[k] = hx_plane(foot[0], foot[1]);
    model->home_height[k] = foot[2];
    hxPose narrow;
    model->inward[k] = hx_scaled(hx_cis(leg[k].hip_yaw + leg[k].stance[0]), -gait->narrowing);
    hx_leg_solver_pose(&leg[k], hx_plane_add(model->home[k], model->inward[k]), foot[2], &narrow);
    model->turned[k] = hx_leg_solver_rolling(&leg[k], narrow.angle);
  }
  start_at(model, begin);
}

/* Returns the phase of a leg a number of periods after the start of the walk (C2). */
static inline double phase_after(const hxFootPathsModel *model, int leg, int64_t number) {
  const double clock = model->offset[leg] + (double)number * model->period / model->gait_period;
  return hx_fraction(clock);
}

/* Returns the periods on the gait clock `number` periods after the section began (C50). */
static inline int64_t reached(const hxFootPaths *paths, int64_t number) {
  return paths->held ? paths->before : paths->before + number;
}

/* Stops with the feet at `plane` and resets the gait clock. */
HX_SELDOM static void rest(const hxFootPathsModel *model, const hxPlane plane[HX_LEGS],
                           hxFootPaths *paths, hxPlannedFeet *feet) {
  const double narrowing = paths->narrowing;
  hxPlane place[HX_LEGS];
  memcpy(place, plane, sizeof place); /* plane may point into feet */
  memset(paths, 0, sizeof *paths);
  paths->narrowing = narrowing;
  memset(feet, 0, sizeof *feet);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    feet->plane[leg] = feet->goal[leg] = place[leg];
    feet->height[leg] = model->home_height[leg];
    feet->phase[leg] = phase_after(model, leg, 0);
    feet->rolled[leg] = narrowing * model->turned[leg];
    paths->stayed[leg] = model->late[leg];
  }
}

/* Sets all feet to the stance and stops the gait clock. */
static inline void hx_foot_paths_reset(const hxFootPathsModel *model, hxFootPaths *paths,
                                       hxPlannedFeet *feet) {
  paths->narrowing = 0.0;
  rest(model, model->home, paths, feet);
}

/* Determines which legs are in the air in the coming section, by the gait clock. Returns whether
 * any leg is. */
static inline int lift_off(const hxFootPathsModel *model, const hxFootPaths *old,
                           hxFootPaths *paths) {
  int any = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const int stood = phase_after(model, leg, paths->before) < model->duty;
    paths->standing[leg] = phase_after(model, leg, paths->before + 1) < model->duty;
    paths->lifted[leg] = stood && !paths->standing[leg];
    paths->stayed[leg] |= paths->lifted[leg];
    paths->swinging[leg] = old->swinging[leg] && !paths->standing[leg];
    paths->stays[leg] = 0;
    any |= paths->swinging[leg];
  }
  return any;
}

/* Returns the stance position that the steps of a leg aim at, walking frame (C53). */
static inline hxPlane aims(const hxFootPathsModel *model, const hxFootPaths *paths, int leg) {
  return hx_plane_add(model->home[leg], hx_scaled(model->inward[leg], paths->narrowing));
}

/* Keeps feet in place that are at their stance positions. Returns whether all are there and on the
 * ground. place: positions of the feet; those that have just landed are at their goals. */
static inline int come_home(const hxFootPathsModel *model, const hxFootPaths *old,
                            const hxPlannedFeet *now, int any_swinging, hxFootPaths *paths,
                            hxPlane place[HX_LEGS]) {
  int all_home = 1, any_lifted = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    place[leg] = now->plane[leg];
    if (old->swinging[leg] && paths->standing[leg])
      place[leg] = hx_times(hx_cis(-now->turn), hx_plane_sub(now->goal[leg], now->way));
    const hxPlane away = hx_plane_sub(place[leg], aims(model, paths, leg));
    const int home = sqrt(hx_square(away)) < home_tolerance;
    paths->lifted[leg] &= !home;
    paths->stays[leg] = home && !paths->swinging[leg];
    all_home &= home;
    any_lifted |= paths->lifted[leg];
  }
  return all_home && !any_swinging && !any_lifted;
}

/* Lets the legs skip their next steps that have not begun to give up their loads (C55). kept: legs
 * that were to skip them already. */
HX_SELDOM static void keep_down(const hxFootPathsModel *model, const int kept[HX_LEGS],
                                hxFootPaths *paths) {
  const double unloads = model->duty - 0.5 * model->handover;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double phase = phase_after(model, leg, paths->before);
    const int leaving = phase >= unloads && phase < model->duty && !kept[leg];
    paths->stays[leg] = !paths->swinging[leg] && !leaving;
    paths->lifted[leg] &= !paths->stays[leg];
  }
}

/* Returns the part tau of its swing that a leg at this phase has completed. */
static inline double progress(const hxFootPathsModel *model, double phase) {
  return (phase - model->duty) / (1.0 - model->duty);
}

/* Returns the position of a foot on the ground (C5). */
static inline hxPlane ground_of(const hxPlannedFeet *feet, int leg) {
  return hx_plane_sub(feet->goal[leg], hx_scaled(feet->pull[leg], 1.0 - feet->blend[leg]));
}

/* Computes position and velocity of a foot with known phase, goal, pull and frame (C5 to C8).
 * carried: its position on the ground at the previous step; back: e^(-i turn). */
static inline void place_foot(const hxFootPathsModel *model, const hxFootPaths *paths, int leg,
                              hxPlane back, hxPlane carried, hxPlannedFeet *feet) {
  const double tau = progress(model, feet->phase[leg]), w = feet->twist.yaw_rate;
  double s, slope, lift, climb;
  blend(tau, &s, &slope);
  feet->blend[leg] = paths->swinging[leg] ? s : 0.0;
  const hxPlane was = hx_times(back, hx_plane_sub(carried, feet->way)), v = feet->twist.velocity;
  feet->plane[leg] = hx_times(back, hx_plane_sub(ground_of(feet, leg), feet->way));
  /* a foot on the ground: dp/dt = -(v + i w p) */
  /* 1/s, at which the foot passes through its path */
  const double pace = paths->held ? 0.0 : 1.0 / model->swing_time;
  const hxPlane pulled = hx_scaled(hx_times(back, feet->pull[leg]), slope * pace);
  feet->velocity[leg] = hx_plane(pulled.x - (v.x - w * was.y), pulled.y - (v.y + w * was.x));
  hop(tau, model->step_height, model->touchdown_speed * model->swing_time, &lift, &climb);
  feet->height[leg] = model->home_height[leg] + (paths->swinging[leg] ? lift : 0.0);
  feet->rise[leg] = paths->swinging[leg] ? climb * pace : 0.0;
}

/* Computes the present step again, with those legs in the air that swing in the section. */
static inline void set_out(const hxFootPathsModel *model, const hxFootPaths *paths,
                           const hxPlannedFeet *now, hxTwist twist, hxPlannedFeet *first) {
  const hxPlannedFeet present = *now;
  memset(first, 0, sizeof *first);
  first->way = present.way;
  first->turn = present.turn;
  first->twist = twist;
  const hxPlane back = hx_cis(-first->turn);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    double s, slope;
    first->phase[leg] = phase_after(model, leg, paths->before);
    blend(progress(model, first->phase[leg]), &s, &slope);
    first->blend[leg] = paths->swinging[leg] ? s : 0.0;
    first->goal[leg] = present.goal[leg];
    first->rolled[leg] = present.rolled[leg];
    first->pull[leg] = paths->swinging[leg] ? present.pull[leg] : hx_plane(0.0, 0.0);
    place_foot(model, paths, leg, back, ground_of(first, leg), first);
  }
}

/* Begins a new section after the present step. first: the feet at that step; number: periods since
 * the last section began; twist: of the body now; going: the body moves or is commanded to;
 * otherwise the feet step to their stance positions and the gait clock stops. */
static inline void hx_foot_paths_plan(const hxFootPathsModel *model, const hxPlannedFeet *now,
                                      int64_t number, int going, hxTwist twist, hxFootPaths *paths,
                                      hxPlannedFeet *first) {
  const hxFootPaths old = *paths;
  hxPlane place[HX_LEGS];
  if (!old.walking && !going) {
    rest(model, now->plane, paths, first);
    return;
  }
  paths->before = old.walking ? reached(paths, number) : 0;
  paths->held = 0;
  memset(paths->awaited, 0, sizeof paths->awaited);
  const int any = lift_off(model, &old, paths);
  if (old.ending)
    keep_down(model, old.stays, paths);
  else if (!going && come_home(model, &old, now, any, paths, place)) {
    rest(model, place, paths, first);
    return;
  }
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    paths->swinging[leg] |= paths->lifted[leg];
    paths->stayed[leg] &= !paths->lifted[leg];
  }
  paths->walking = 1;
  set_out(model, paths, now, twist, first);
}

/* Returns whether all legs stand and begin no other step, because another gait follows. */
static inline int hx_foot_paths_ended(const hxFootPaths *paths) {
  int ended = paths->ending && !paths->held;
  for (int leg = 0; leg < HX_LEGS; ++leg) ended &= paths->stays[leg];
  return ended;
}

/* Returns how far the farthest foot will be from its stance position at its lift-off [m] (C55).
 * begin: phases at the begin of the walk [cycles]. */
HX_SELDOM static double farthest(const hxFootPathsModel *model, const hxFootPaths *paths,
                                 const hxPlannedFeet *feet, const double begin[HX_LEGS]) {
  const hxPlane v = feet->twist.velocity;
  const double w = feet->twist.yaw_rate;
  double largest = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const hxPlane p = feet->plane[leg], motion = hx_plane(v.x - w * p.y, v.y + w * p.x);
    const double left = model->duty - begin[leg] + clock_epsilon,
                 time = hx_fraction(left) * model->gait_period;
    const hxPlane there = hx_plane_sub(p, hx_scaled(motion, time)),
                  away = hx_plane_sub(there, aims(model, paths, leg));
    largest = hx_larger(largest, sqrt(hx_square(away)));
  }
  return largest;
}

/* Begins the walk anew with feet that stand under a moving body (C55): sets the phases of the legs
 * in the model so that one leg begins to give up its load, the first of those with which the
 * farthest foot goes least far. */
static HX_SELDOM void hx_foot_paths_join(hxFootPathsModel *model, hxFootPaths *paths,
                                         hxPlannedFeet *feet) {
  const double unloads = model->duty - 0.5 * model->handover;
  const double *offset = model->gait_offset;
  double begin[HX_LEGS], least = INFINITY;
  if (!paths->walking) {
    rest(model, feet->plane, paths, feet);
    return;
  }
  for (int first = 0; first < HX_LEGS; ++first) {
    for (int leg = 0; leg < HX_LEGS; ++leg) begin[leg] = unloads + (offset[leg] - offset[first]);
    const double far = farthest(model, paths, feet, begin);
    if (far >= least - same_distance) continue;
    least = far;
    start_at(model, begin);
  }
  const double narrowing = paths->narrowing;
  memset(paths, 0, sizeof *paths);
  paths->walking = 1;
  paths->narrowing = narrowing;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    paths->standing[leg] = phase_after(model, leg, 0) < model->duty;
    paths->stayed[leg] = model->late[leg];
  }
}

/* Goes on in the phases of the paths of another control, in the same gait. before: the model of
 * these paths. */
static HX_SELDOM void hx_foot_paths_carry(hxFootPathsModel *model, const hxFootPathsModel *before,
                                          hxFootPaths *paths) {
  memcpy(model->offset, before->offset, sizeof model->offset);
  memcpy(model->late, before->late, sizeof model->late);
  memset(paths->met, 0, sizeof paths->met);
}

/* Finds the legs whose swing ends at the present step, or ended at the step at which the gait clock
 * was stopped. number: periods since the section began. */
static inline void hx_foot_paths_landing(const hxFootPathsModel *model, const hxFootPaths *paths,
                                         int64_t number, int landing[HX_LEGS]) {
  const int64_t next = reached(paths, number) + 1;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    landing[leg] =
        paths->walking && paths->swinging[leg] && phase_after(model, leg, next) < model->duty;
}

/* Begins a section in which the gait clock stands still while the body moves on (C50). Arguments
 * are those of hx_foot_paths_plan. */
static inline void hx_foot_paths_hold(const hxFootPathsModel *model, const hxPlannedFeet *now,
                                      int64_t number, hxTwist twist, hxFootPaths *paths,
                                      hxPlannedFeet *first) {
  hx_foot_paths_landing(model, paths, number, paths->awaited);
  paths->before = reached(paths, number);
  paths->held = 1;
  memset(paths->lifted, 0, sizeof paths->lifted);
  set_out(model, paths, now, twist, first);
}

/* Returns whether a step, in periods after the first, still belongs to the section: no leg lifts
 * off or touches down before it. */
static inline int hx_foot_paths_reach(const hxFootPathsModel *model, const hxFootPaths *paths,
                                      int64_t number) {
  if (!paths->walking || paths->held || number == 1) return 1;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    if ((phase_after(model, leg, paths->before + number) < model->duty) != paths->standing[leg])
      return 0;
  return 1;
}

/* Returns the landing point (C4, C53) in the walking frame. */
static inline hxPlane landing(const hxFootPathsModel *model, const hxFootPaths *paths, int leg,
                              double tau, hxTwist twist) {
  const double ahead = model->landing_lead - tau * model->swing_time;
  return hx_plane_add(hx_times(hx_cis(twist.yaw_rate * ahead), aims(model, paths, leg)),
                      travel(twist, ahead));
}

/* Computes displacement and turn of the walking frame since the start of the walk (C3). */
static inline void odometry(double period, const hxPlannedFeet *before, hxTwist twist,
                            hxPlannedFeet *feet) {
  const hxTwist *last = &before->twist;
  const hxTwist mean = {hx_scaled(hx_plane_add(twist.velocity, last->velocity), 0.5),
                        0.5 * (twist.yaw_rate + last->yaw_rate)};
  feet->turn = before->turn + mean.yaw_rate * period;
  feet->way = hx_plane_add(before->way, hx_times(hx_cis(before->turn), travel(mean, period)));
  feet->twist = twist;
}

/* Computes the feet a number of periods after the first step of the section, from the step before.
 */
static inline void hx_foot_paths_walk(const hxFootPathsModel *model, const hxFootPaths *paths,
                                      int64_t number, hxTwist twist, const hxPlannedFeet *before,
                                      hxPlannedFeet *feet) {
  if (!paths->walking) {
    *feet = *before;
    return;
  }
  odometry(model->period, before, twist, feet);
  const hxPlane turn = hx_cis(feet->turn), back = hx_conj(turn);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    feet->phase[leg] = phase_after(model, leg, reached(paths, number));
    const double tau = progress(model, feet->phase[leg]);
    /* each foot gets its goal once */
    const int free = paths->swinging[leg] && (tau < freeze || (number == 1 && paths->lifted[leg]));
    feet->goal[leg] =
        free ? hx_plane_add(feet->way, hx_times(turn, landing(model, paths, leg, tau, twist)))
             : before->goal[leg];
    /* the distance to the landing point is proportional to 1 - s (C5) */
    const double left = hx_larger(1.0 - before->blend[leg], nearly_done);
    const hxPlane moved = hx_scaled(hx_plane_sub(feet->goal[leg], before->goal[leg]), 1.0 / left);
    feet->pull[leg] = hx_plane_add(before->pull[leg], moved);
    feet->rolled[leg] = before->rolled[leg];
    if (paths->swinging[leg] && !paths->met[leg]) {
      const double aim = paths->narrowing * model->turned[leg];
      double s, slope;
      blend(tau, &s, &slope);
      feet->rolled[leg] = aim - (aim - before->rolled[leg]) * (1.0 - s) / left;
    }
    if (paths->met[leg]) { /* the foot stays where it met the ground (C51) */
      feet->goal[leg] = ground_of(before, leg);
      feet->pull[leg] = hx_plane(0.0, 0.0);
    }
    place_foot(model, paths, leg, back, ground_of(before, leg), feet);
  }
}

#endif
