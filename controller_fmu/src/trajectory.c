#include "trajectory.h"

#include "gait.h"

#include <string.h>

static const double dwell = 0.1; /* 1   share of the swing at each end with vertical motion only */
static const double freeze =
    0.75; /* 1   part of the swing after which the landing point stays fixed to the ground */
static const double home_tolerance =
    1e-9; /* m   a foot this close to its stance position need not step any more */
static const double clock_epsilon =
    1e-9; /* cycles  the clock starts this much before the first lift-off */
static const double nearly_done = 1e-12; /* 1   floor of 1 - s */
static const double small_angle = 1e-12; /* rad below it sin(a)/a is 1 */

/* ----------------------------------------------------------------------------------------------
 * command */

void hx_ramp_compile(double duration, double period, hxRampModel *model) {
  model->duration = duration;
  model->period = period;
  model->end = (int64_t)(duration / period);
  while ((double)model->end * period < duration) ++model->end;
}

void hx_ramp_reset(const hxRampModel *model, hxRamp *ramp) {
  memset(ramp, 0, sizeof *ramp);
  ramp->steps = model->end;
}

int hx_ramp_settled(const hxRampModel *model, const hxRamp *ramp) {
  return ramp->steps >= model->end;
}

int hx_ramp_moves(const hxRamp *ramp) {
  return ramp->target[0] != 0.0 || ramp->target[1] != 0.0 || ramp->target[2] != 0.0;
}

int hx_ramp_aim(const hxRampModel *model, const double target[HX_COMMANDS], hxRamp *ramp) {
  double value[HX_COMMANDS], rate[HX_COMMANDS];
  int same = 1;
  for (int i = 0; i < HX_COMMANDS; ++i) same &= target[i] == ramp->target[i];
  if (same) return 0;
  hx_ramp_ahead(model, ramp, 0, value, rate);
  for (int i = 0; i < HX_COMMANDS; ++i) {
    const double gap = target[i] - value[i], slope = rate[i] * model->duration;
    ramp->cubic[0][i] = value[i];
    ramp->cubic[1][i] = slope;
    ramp->cubic[2][i] = 3.0 * gap - 2.0 * slope;
    ramp->cubic[3][i] = slope - 2.0 * gap;
    ramp->target[i] = target[i];
  }
  ramp->steps = 0;
  return 1;
}

void hx_ramp_ahead(const hxRampModel *model, const hxRamp *ramp, int64_t steps,
                   double value[HX_COMMANDS], double rate[HX_COMMANDS]) {
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

/* ----------------------------------------------------------------------------------------------
 * shapes */

/* s in [0, 1] and ds/dtau: s = 1/2 + 45/64 y - 9/32 y^5 + 5/64 y^9 between the dwells */
static void blend(double tau, double *s, double *slope) {
  const double y = hx_clamp((2.0 * tau - 1.0) / (1.0 - 2.0 * dwell), -1.0, 1.0);
  const double y4 = y * y * y * y, flat = 1.0 - y4;
  *s = 0.5 + y * (45.0 + y4 * (5.0 * y4 - 18.0)) / 64.0;
  *slope = 45.0 / 32.0 * flat * flat / (1.0 - 2.0 * dwell);
}

/* z and dz/dtau [m]: 64 top (tau (1 - tau))^3 + down tau^3 (1 - tau), down the touch-down speed
 * times the swing's time */
static void hop(double tau, double top, double down, double *lift, double *climb) {
  const double arch = tau * (1.0 - tau), bow = 64.0 * top * arch * arch, fall = down * tau * tau;
  *lift = (bow + fall) * arch;
  *climb = 3.0 * bow * (1.0 - 2.0 * tau) + fall * (3.0 - 4.0 * tau);
}

/* the way under a constant twist: v (e^(i w t) - 1)/(i w) */
static hxPlane travel(hxTwist twist, double time) {
  const double half = 0.5 * twist.yaw_rate * time;
  const double chord = fabs(half) > small_angle ? sin(half) / half : 1.0;
  return hx_times(hx_scaled(twist.velocity, time * chord), hx_cis(half));
}

/* ----------------------------------------------------------------------------------------------
 * paths */

void hx_paths_compile(const hxControllerDefinition *definition, const hxLegModel leg[HX_LEGS],
                      hxPathModel *model) {
  const hxGait *gait = &definition->gait;
  double offset[HX_LEGS], foot[3];
  hx_gait_offsets(gait, offset);
  model->period = definition->period;
  model->gait_period = gait->period;
  model->duty = gait->duty;
  model->step_height = gait->step_height;
  model->touchdown_speed = gait->touchdown_speed;
  model->swing_time = gait->period * (1.0 - gait->duty);
  model->landing_lead = 0.5 * gait->period * gait->duty + model->swing_time;
  for (int k = 0; k < HX_LEGS; ++k) {
    const double begin = offset[k] + hx_gait_start_clock(gait, offset),
                 first = begin + clock_epsilon;
    model->offset[k] = begin - clock_epsilon;
    model->late[k] = first - floor(first) >= gait->duty;
    hx_leg_forward(&leg[k], leg[k].stance, foot);
    model->home[k] = hx_plane(foot[0], foot[1]);
    model->home_height[k] = foot[2];
  }
}

static double phase_after(const hxPathModel *model, int leg, int64_t number) {
  const double clock = model->offset[leg] + (double)number * model->period / model->gait_period;
  return clock - floor(clock);
}

/* standing still, with the clock rewound */
static void rest(const hxPathModel *model, const hxPlane plane[HX_LEGS], hxPaths *paths,
                 hxSteps *steps) {
  hxPlane place[HX_LEGS];
  memcpy(place, plane, sizeof place); /* plane may lie in steps */
  memset(paths, 0, sizeof *paths);
  memset(steps, 0, sizeof *steps);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    steps->plane[leg] = steps->goal[leg] = place[leg];
    steps->height[leg] = model->home_height[leg];
    steps->phase[leg] = phase_after(model, leg, 0);
    paths->stayed[leg] = model->late[leg];
  }
}

void hx_paths_reset(const hxPathModel *model, hxPaths *paths, hxSteps *steps) {
  rest(model, model->home, paths, steps);
}

/* Which legs are in the air in the coming steps, by the clock; returns whether any is. */
static int lift_off(const hxPathModel *model, const hxPaths *old, hxPaths *paths) {
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

/* Feet that are home stay there. Returns whether all do; feet: where they are, the ones just landed
 * at their goals. */
static int come_home(const hxPathModel *model, const hxPaths *old, const hxSteps *now,
                     int any_swinging, hxPaths *paths, hxPlane feet[HX_LEGS]) {
  int all_home = 1, any_lifted = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    feet[leg] = now->plane[leg];
    if (old->swinging[leg] && paths->standing[leg])
      feet[leg] = hx_times(hx_cis(-now->turn), hx_sub(now->goal[leg], now->way));
    const int home = sqrt(hx_square(hx_sub(feet[leg], model->home[leg]))) < home_tolerance;
    paths->lifted[leg] &= !home;
    paths->stays[leg] = home && !paths->swinging[leg];
    all_home &= home;
    any_lifted |= paths->lifted[leg];
  }
  return all_home && !any_swinging && !any_lifted;
}

/* foot, velocity and height of one leg at a step whose goal, pull, way and turn are known; carried:
 * on the ground, where it was */
static void place_foot(const hxPathModel *model, const hxPaths *paths, int leg, hxPlane back,
                       hxPlane carried, double slope, double tau, hxSteps *steps) {
  const hxPlane ground =
      hx_sub(steps->goal[leg], hx_scaled(steps->pull[leg], 1.0 - steps->blend[leg]));
  const hxPlane was = hx_times(back, hx_sub(carried, steps->way)), v = steps->twist.velocity;
  double lift, climb;
  steps->plane[leg] = hx_times(back, hx_sub(ground, steps->way));
  /* a foot on the ground: dp/dt = -(v + i w p) */
  const hxPlane pulled = hx_scaled(hx_times(back, steps->pull[leg]), slope / model->swing_time);
  const double w = steps->twist.yaw_rate;
  steps->velocity[leg] = hx_plane(pulled.x - (v.x - w * was.y), pulled.y - (v.y + w * was.x));
  hop(tau, model->step_height, model->touchdown_speed * model->swing_time, &lift, &climb);
  steps->height[leg] = model->home_height[leg] + (paths->swinging[leg] ? lift : 0.0);
  steps->rise[leg] = paths->swinging[leg] ? climb / model->swing_time : 0.0;
}

static hxPlane ground_of(const hxSteps *steps, int leg) {
  return hx_sub(steps->goal[leg], hx_scaled(steps->pull[leg], 1.0 - steps->blend[leg]));
}

static double progress(const hxPathModel *model, double phase) {
  return (phase - model->duty) / (1.0 - model->duty);
}

/* the present step anew, with the legs in the air that will be so */
static void set_out(const hxPathModel *model, const hxPaths *paths, const hxSteps *now,
                    hxTwist twist, hxSteps *first) {
  const hxSteps present = *now;
  memset(first, 0, sizeof *first);
  first->way = present.way;
  first->turn = present.turn;
  first->twist = twist;
  const hxPlane back = hx_cis(-first->turn);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    double s, slope;
    first->phase[leg] = phase_after(model, leg, paths->before);
    const double tau = progress(model, first->phase[leg]);
    blend(tau, &s, &slope);
    first->blend[leg] = paths->swinging[leg] ? s : 0.0;
    first->goal[leg] = present.goal[leg];
    first->pull[leg] = paths->swinging[leg] ? present.pull[leg] : hx_plane(0.0, 0.0);
    place_foot(model, paths, leg, back, ground_of(first, leg), slope, tau, first);
  }
}

void hx_paths_plan(const hxPathModel *model, const hxSteps *now, int64_t number, int going,
                   hxTwist twist, hxPaths *paths, hxSteps *first) {
  const hxPaths old = *paths;
  hxPlane feet[HX_LEGS];
  if (!old.walking && !going) {
    rest(model, now->plane, paths, first);
    return;
  }
  paths->before = old.walking ? old.before + number : 0;
  const int any = lift_off(model, &old, paths);
  if (!going && come_home(model, &old, now, any, paths, feet)) {
    rest(model, feet, paths, first);
    return;
  }
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    paths->swinging[leg] |= paths->lifted[leg];
    paths->stayed[leg] &= !paths->lifted[leg];
  }
  paths->walking = 1;
  set_out(model, paths, now, twist, first);
}

int hx_paths_reach(const hxPathModel *model, const hxPaths *paths, int64_t number) {
  if (!paths->walking || number == 1) return 1;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    if ((phase_after(model, leg, paths->before + number) < model->duty) != paths->standing[leg])
      return 0;
  return 1;
}

/* where the ground under the stance position, half a stance after touch-down, is now */
static hxPlane landing(const hxPathModel *model, int leg, double tau, hxTwist twist) {
  const double ahead = model->landing_lead - tau * model->swing_time;
  return hx_add(hx_times(hx_cis(twist.yaw_rate * ahead), model->home[leg]), travel(twist, ahead));
}

/* way and turn of the walking frame since the walk's begin */
static void odometry(double period, const hxSteps *before, hxTwist twist, hxSteps *steps) {
  const hxTwist *last = &before->twist;
  const hxTwist mean = {hx_scaled(hx_add(twist.velocity, last->velocity), 0.5),
                        0.5 * (twist.yaw_rate + last->yaw_rate)};
  steps->turn = before->turn + mean.yaw_rate * period;
  steps->way = hx_add(before->way, hx_times(hx_cis(before->turn), travel(mean, period)));
  steps->twist = twist;
}

void hx_paths_walk(const hxPathModel *model, const hxPaths *paths, int64_t number, hxTwist twist,
                   const hxSteps *before, hxSteps *steps) {
  if (!paths->walking) {
    *steps = *before;
    return;
  }
  odometry(model->period, before, twist, steps);
  const hxPlane turn = hx_cis(steps->turn), back = hx_conj(turn);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    double s, slope;
    steps->phase[leg] = phase_after(model, leg, paths->before + number);
    const double tau = progress(model, steps->phase[leg]);
    blend(tau, &s, &slope);
    steps->blend[leg] = paths->swinging[leg] ? s : 0.0;
    const int free = paths->swinging[leg] && (tau < freeze || (number == 1 && paths->lifted[leg]));
    steps->goal[leg] = free ? hx_add(steps->way, hx_times(turn, landing(model, leg, tau, twist)))
                            : before->goal[leg];
    /* the way to the landing point shrinks as 1 - s: with pull = (goal - foot)/(1 - s), pull' =
     * pull + (goal' - goal)/(1 - s) */
    const double left = 1.0 - before->blend[leg];
    const hxPlane moved = hx_scaled(hx_sub(steps->goal[leg], before->goal[leg]),
                                    1.0 / (left < nearly_done ? nearly_done : left));
    steps->pull[leg] = hx_add(before->pull[leg], moved);
    place_foot(model, paths, leg, back, ground_of(before, leg), slope, tau, steps);
  }
}
