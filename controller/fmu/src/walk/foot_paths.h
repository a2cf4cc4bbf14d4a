/* foot_paths.h - the paths of the feet from the motion of the body. Python:
 * controller/walk/foot_paths.py. */
#ifndef HX_FOOT_PATHS_H
#define HX_FOOT_PATHS_H

#include "absence.h"
#include "gait_clock.h"
#include "kinematics.h"
#include "swing.h"

typedef struct hxFootPathsModel {
  hxGaitClockModel clock;
  double period, step_height, touchdown_speed;
  double swing_time;           /* s */
  double landing_lead;         /* s  from lift-off to the middle of the next stance */
  hxPlane home[HX_LEGS];       /* m   feet of the stance */
  hxPlane inward[HX_LEGS];     /* m   from the stance to the narrow one */
  double turned[HX_LEGS];      /* m   that the feet roll outwards on this way */
  double home_height[HX_LEGS]; /* m */
} hxFootPathsModel;

/* The feet at one step, as the command plans them, in the walking frame. goal, pull, way and turn
 * are in the ground frame. */
typedef struct hxPlannedFeet {
  hxPlane plane[HX_LEGS];    /* m    centres, x + i y */
  double height[HX_LEGS];    /* m    z */
  hxPlane velocity[HX_LEGS]; /* m/s  of x + i y */
  double rise[HX_LEGS];      /* m/s  of z */
  double phase[HX_LEGS];     /* 1    in [0, 1) */
  double blend[HX_LEGS];     /* 1    s of swinging feet, else 0 */
  /* m  where a swinging foot will touch down, or where a standing foot stands */
  hxPlane goal[HX_LEGS];
  hxPlane pull[HX_LEGS];  /* m  (goal - foot)/(1 - s) of swinging feet, 0 of standing feet */
  double rolled[HX_LEGS]; /* m  outwards from the stance to the position that the foot aims at */
  hxPlane way;            /* m  displacement of the walking frame over the ground */
  double turn;            /* rad  of the walking frame over the ground */
  hxTwist twist;          /* of the body */
} hxPlannedFeet;

/* The paths of the feet within a section of the walk. */
typedef struct hxFootPaths {
  hxGaitClock clock;
  int met[HX_LEGS]; /* the foot has met the ground on its way down, and stays where it is */
  double narrowing; /* 1  part of the way to the narrow stance that the steps aim at */
} hxFootPaths;

/* 1  part of the swing after which the landing point stays fixed on the ground */
static const double freeze = 0.75;
static const double same_distance = 1e-6; /* m  distances that differ by less are equal */
/* m  a foot this close to its stance position makes no step */
static const double home_tolerance = 1e-9;
static const double nearly_done = 1e-12; /* 1   floor of 1 - s */
/* 1/s, m/s  downwards, of feet that end their swings at once */
static const double drop_rate = 10.0, landing_speed = 0.08;

static inline void hx_foot_paths_compile(const hxControllerDefinition *definition,
                                         const hxLegSolver leg[HX_LEGS], hxFootPathsModel *model) {
  const hxGait *gait = &definition->gait;
  double foot[3];
  hx_gait_clock_compile(definition, &model->clock);
  model->period = definition->period;
  model->step_height = gait->step_height;
  model->touchdown_speed = gait->touchdown_speed;
  model->swing_time = gait->period * (1.0 - gait->duty);
  model->landing_lead = 0.5 * gait->period * gait->duty + model->swing_time;
  for (int k = 0; k < HX_LEGS; ++k) {
    hx_leg_solver_forward(&leg[k], leg[k].stance, foot);
    model->home[k] = hx_plane(foot[0], foot[1]);
    model->home_height[k] = foot[2];
    hxPose narrow;
    model->inward[k] = hx_scaled(hx_cis(leg[k].hip_yaw + leg[k].stance[0]), -gait->narrowing);
    hx_leg_solver_pose(&leg[k], hx_plane_add(model->home[k], model->inward[k]), foot[2], &narrow);
    model->turned[k] = hx_leg_solver_rolling(&leg[k], narrow.angle);
  }
}

/* Stops with the feet at `plane` and resets the gait clock. */
HX_RARE void rest(const hxFootPathsModel *model, const hxPlane plane[HX_LEGS], hxFootPaths *paths,
                  hxPlannedFeet *feet) {
  hxPlane place[HX_LEGS];
  memcpy(place, plane, sizeof place); /* plane may point into feet */
  hx_gait_clock_stop(&model->clock, &paths->clock);
  memset(paths->met, 0, sizeof paths->met);
  memset(feet, 0, sizeof *feet);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    feet->plane[leg] = feet->goal[leg] = place[leg];
    feet->height[leg] = model->home_height[leg];
    feet->phase[leg] = hx_gait_clock_phase(&model->clock, leg, 0);
    feet->rolled[leg] = paths->narrowing * model->turned[leg];
  }
}

/* Sets all feet to the stance and stops the gait clock. */
static inline void hx_foot_paths_reset(const hxFootPathsModel *model, hxFootPaths *paths,
                                       hxPlannedFeet *feet) {
  paths->narrowing = 0.0;
  rest(model, model->home, paths, feet);
}

/* Returns the stance position that the steps of a leg aim at, walking frame (C53). */
static inline hxPlane aims(const hxFootPathsModel *model, const hxFootPaths *paths, int leg) {
  return hx_plane_add(model->home[leg], hx_scaled(model->inward[leg], paths->narrowing));
}

/* Lets feet that are in their stance positions skip their steps. Returns whether all feet stand
 * there. swung: legs that were in the air until now; place: positions of the feet; those that have
 * just landed are at their goals. */
static inline int come_home(const hxFootPathsModel *model, const int swung[HX_LEGS],
                            const hxPlannedFeet *now, hxFootPaths *paths, hxPlane place[HX_LEGS]) {
  int home[HX_LEGS];
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    place[leg] = now->plane[leg];
    if (swung[leg] && paths->clock.standing[leg])
      place[leg] = hx_times(hx_cis(-now->turn), hx_plane_sub(now->goal[leg], now->way));
    const hxPlane away = hx_plane_sub(place[leg], aims(model, paths, leg));
    home[leg] = sqrt(hx_square(away)) < home_tolerance;
  }
  return hx_gait_clock_skip((const int *)home, &paths->clock);
}

/* Returns the position of a foot on the ground (C5). */
static inline hxPlane ground_of(const hxPlannedFeet *feet, int leg) {
  return hx_plane_sub(feet->goal[leg], hx_scaled(feet->pull[leg], 1.0 - feet->blend[leg]));
}

/* Computes position and velocity of a foot with known phase, goal, pull and frame (C5 to C8).
 * carried: its position on the ground at the previous step; R_KW: e^(-i turn). */
static inline void place_foot(const hxFootPathsModel *model, const hxFootPaths *paths, int leg,
                              hxPlane R_KW, hxPlane carried, hxPlannedFeet *feet) {
  const double tau = hx_gait_clock_progress(&model->clock, feet->phase[leg]),
               w = feet->twist.yaw_rate;
  const double high = feet->height[leg] - model->home_height[leg];
  double s, slope, lift, climb;
  if (paths->clock.absent[leg]) { /* the foot is above its stance position */
    const hxPlane place = hx_times(hx_conj(R_KW), aims(model, paths, leg));
    feet->goal[leg] = hx_plane_add(feet->way, place);
    feet->pull[leg] = hx_plane(0.0, 0.0);
  }
  blend(tau, &s, &slope);
  feet->blend[leg] = paths->clock.swinging[leg] ? s : 0.0;
  const hxPlane was = hx_times(R_KW, hx_plane_sub(carried, feet->way)), v = feet->twist.velocity;
  feet->plane[leg] = hx_times(R_KW, hx_plane_sub(ground_of(feet, leg), feet->way));
  /* a foot on the ground: dp/dt = -(v + i w p) */
  /* 1/s  at which the foot passes through its path */
  const double pace = paths->clock.waiting ? 0.0 : 1.0 / model->swing_time;
  const hxPlane pulled = hx_scaled(hx_times(R_KW, feet->pull[leg]), slope * pace);
  feet->velocity[leg] = hx_plane(pulled.x - (v.x - w * was.y), pulled.y - (v.y + w * was.x));
  hop(tau, model->step_height, model->touchdown_speed * model->swing_time, &lift, &climb);
  feet->height[leg] = model->home_height[leg] + (paths->clock.swinging[leg] ? lift : 0.0);
  feet->rise[leg] = paths->clock.swinging[leg] ? climb * pace : 0.0;
  if (paths->clock.absent[leg]) {
    feet->height[leg] = model->home_height[leg] + model->step_height;
    feet->velocity[leg] = hx_plane(0.0, 0.0);
  } else if (paths->clock.dropped[leg] && paths->clock.swinging[leg]) {
    const double fall = hx_larger(drop_rate * high, landing_speed);
    feet->height[leg] = model->home_height[leg] + hx_larger(high - fall * model->period, 0.0);
    feet->rise[leg] = -fall;
  }
}

/* Returns whether a foot is a dropped one that has reached the ground. */
static inline int hx_foot_paths_down(const hxFootPathsModel *model, const hxFootPaths *paths,
                                     const hxPlannedFeet *feet, int leg) {
  return paths->clock.dropped[leg] && paths->clock.swinging[leg] &&
         feet->height[leg] <= model->home_height[leg];
}

/* Computes the present step again, with those legs in the air that swing in the section. */
static inline void set_out(const hxFootPathsModel *model, const hxFootPaths *paths,
                           const hxPlannedFeet *now, hxTwist twist, hxPlannedFeet *first) {
  const hxPlannedFeet present = *now;
  memset(first, 0, sizeof *first);
  first->way = present.way;
  first->turn = present.turn;
  first->twist = twist;
  const hxPlane R_KW = hx_cis(-first->turn);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    double s, slope;
    first->phase[leg] = hx_gait_clock_phase(&model->clock, leg, paths->clock.before);
    blend(hx_gait_clock_progress(&model->clock, first->phase[leg]), &s, &slope);
    first->blend[leg] = paths->clock.swinging[leg] ? s : 0.0;
    first->goal[leg] = present.goal[leg];
    first->rolled[leg] = present.rolled[leg];
    first->pull[leg] = paths->clock.swinging[leg] ? present.pull[leg] : hx_plane(0.0, 0.0);
    first->height[leg] = present.height[leg];
    place_foot(model, paths, leg, R_KW, ground_of(first, leg), first);
    if (paths->clock.dropped[leg]) first->height[leg] = present.height[leg];
  }
}

/* Begins a new section after the present step. first: the feet at that step; number: periods since
 * the last section began; twist: of the body now; going: the body moves or is commanded to;
 * otherwise the feet step to their stance positions and the gait clock stops. */
static inline void hx_foot_paths_plan(const hxFootPathsModel *model, const hxPlannedFeet *now,
                                      int64_t number, int going, hxTwist twist, hxFootPaths *paths,
                                      hxPlannedFeet *first) {
  hxGaitClock *clock = &paths->clock;
  const hxGaitClock old = *clock;
  hxPlane place[HX_LEGS];
  if (!old.walking && !going) {
    rest(model, now->plane, paths, first);
    return;
  }
  for (int leg = 0; leg < HX_LEGS; ++leg)
    if (hx_foot_paths_down(model, paths, now, leg)) {
      clock->swinging[leg] = 0;
      clock->stayed[leg] = 1;
    }
  hx_gait_clock_begin_section(&model->clock, number, clock);
  if (old.ending)
    hx_gait_clock_keep_down(&model->clock, old.stays, clock);
  else if (!going && come_home(model, old.swinging, now, paths, place)) {
    rest(model, place, paths, first);
    return;
  }
  hx_gait_clock_set_out(clock);
  set_out(model, paths, now, twist, first);
}

/* Begins a section in which the gait clock stands still while the body moves on (C50). Arguments
 * are those of hx_foot_paths_plan. */
static inline void hx_foot_paths_hold(const hxFootPathsModel *model, const hxPlannedFeet *now,
                                      int64_t number, hxTwist twist, hxFootPaths *paths,
                                      hxPlannedFeet *first) {
  hx_gait_clock_hold(&model->clock, number, &paths->clock);
  set_out(model, paths, now, twist, first);
}

/* Returns the time to the next lift-off of a leg [s]. begin: its present phase [cycles]. */
static inline double lift_off(const hxFootPathsModel *model, double begin) {
  return hx_fraction(model->clock.duty - begin + clock_epsilon) * model->clock.gait_period;
}

/* Returns the velocity of the body over the ground at a foot [m/s]. */
static inline hxPlane ground_motion(const hxPlannedFeet *feet, int leg) {
  const hxPlane v = feet->twist.velocity, p = feet->plane[leg];
  const double w = feet->twist.yaw_rate;
  return hx_plane(v.x - w * p.y, v.y + w * p.x);
}

/* Returns how far the farthest foot will be from its stance position at its lift-off [m] (C55).
 * begin: phases at the begin of the walk [cycles]. */
HX_RARE double farthest(const hxFootPathsModel *model, const hxFootPaths *paths,
                        const hxPlannedFeet *feet, const double begin[HX_LEGS]) {
  double largest = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    if (paths->clock.absent[leg]) continue;
    const double time = lift_off(model, begin[leg]);
    const hxPlane way = hx_scaled(ground_motion(feet, leg), time),
                  there = hx_plane_sub(feet->plane[leg], way),
                  away = hx_plane_sub(there, aims(model, paths, leg));
    largest = hx_larger(largest, sqrt(hx_square(away)));
  }
  return largest;
}

/* Begins the walk anew with feet that stand under a moving body (C55): sets the phases of the legs
 * in the model so that one leg begins to give up its load, the first of those with which the
 * farthest foot goes least far. A leg that is back in service (-1: none) begins in the middle of
 * its swing instead (C58). */
HX_RARE void hx_foot_paths_join(hxFootPathsModel *model, hxFootPaths *paths, hxPlannedFeet *feet,
                                int returning_leg) {
  hxGaitClockModel *clock = &model->clock;
  const double unloads = hx_gait_clock_unloads(clock);
  const double *offset = clock->gait_offset;
  double begin[HX_LEGS], least = INFINITY;
  if (!paths->clock.walking) {
    rest(model, feet->plane, paths, feet);
    return;
  }
  const int has_first = hx_marked(paths->clock.absent) == 1;
  if (returning_leg >= 0) {
    for (int leg = 0; leg < HX_LEGS; ++leg)
      begin[leg] = 0.5 + 0.5 * clock->duty + offset[leg] - offset[returning_leg];
    hx_gait_clock_start_at(clock, begin);
  }
  for (int first = 0; returning_leg < 0 && first < HX_LEGS; ++first) {
    if (paths->clock.absent[first] || (has_first && offset[first] > 0.0)) continue;
    for (int leg = 0; leg < HX_LEGS; ++leg) begin[leg] = unloads + (offset[leg] - offset[first]);
    const double far = farthest(model, paths, feet, begin);
    if (far >= least - same_distance) continue;
    least = far;
    hx_gait_clock_start_at(clock, begin);
  }
  hx_gait_clock_start_standing(clock, returning_leg, &paths->clock);
  memset(paths->met, 0, sizeof paths->met);
}

/* Returns the landing point (C4, C53) in the walking frame. */
static inline hxPlane landing(const hxFootPathsModel *model, const hxFootPaths *paths, int leg,
                              double tau, hxTwist twist) {
  const double ahead = model->landing_lead - tau * model->swing_time;
  return hx_plane_add(hx_times(hx_cis(twist.yaw_rate * ahead), aims(model, paths, leg)),
                      travel(twist, ahead));
}

/* Computes the feet a number of periods after the first step of the section, from the step before.
 */
static inline void hx_foot_paths_walk(const hxFootPathsModel *model, const hxFootPaths *paths,
                                      int64_t number, hxTwist twist, const hxPlannedFeet *before,
                                      hxPlannedFeet *feet) {
  if (!paths->clock.walking) {
    *feet = *before;
    return;
  }
  hxPlane way;
  double yaw;
  odometry(before->twist, twist, model->period, &way, &yaw);
  feet->turn = before->turn + yaw;
  feet->way = hx_plane_add(before->way, hx_times(hx_cis(before->turn), way));
  feet->twist = twist;
  const hxPlane R_WK = hx_cis(feet->turn), R_KW = hx_conj(R_WK);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    feet->phase[leg] =
        hx_gait_clock_phase(&model->clock, leg, hx_gait_clock_reached(&paths->clock, number));
    const double tau = hx_gait_clock_progress(&model->clock, feet->phase[leg]);
    /* each foot gets its goal once */
    const int free =
        paths->clock.swinging[leg] && (tau < freeze || (number == 1 && paths->clock.lifted[leg]));
    feet->goal[leg] =
        free ? hx_plane_add(feet->way, hx_times(R_WK, landing(model, paths, leg, tau, twist)))
             : before->goal[leg];
    /* the distance to the landing point is proportional to 1 - s (C5) */
    const double left = hx_larger(1.0 - before->blend[leg], nearly_done);
    const hxPlane moved = hx_scaled(hx_plane_sub(feet->goal[leg], before->goal[leg]), 1.0 / left);
    feet->pull[leg] = hx_plane_add(before->pull[leg], moved);
    feet->rolled[leg] = before->rolled[leg];
    if (paths->clock.swinging[leg] && !paths->met[leg]) {
      const double aim = paths->narrowing * model->turned[leg];
      double s, slope;
      blend(tau, &s, &slope);
      feet->rolled[leg] = aim - (aim - before->rolled[leg]) * (1.0 - s) / left;
    }
    if (paths->met[leg] || paths->clock.dropped[leg]) { /* the foot stays where it is (C51) */
      feet->goal[leg] = ground_of(before, leg);
      feet->pull[leg] = hx_plane(0.0, 0.0);
    }
    feet->height[leg] = before->height[leg];
    place_foot(model, paths, leg, R_KW, ground_of(before, leg), feet);
  }
}

#endif
