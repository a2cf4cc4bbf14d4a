/* pace.h - slows the body where the joints cannot follow its command (C59). Python:
 * controller/walk/pace.py. */
#ifndef HX_PACE_H
#define HX_PACE_H

#include "command.h"
#include "foot_paths.h"
#include "posture.h"

enum { HX_STANCE_SAMPLES = 5, HX_SAMPLES = HX_STANCE_SAMPLES + 16 };

/* A moment of the cycle of a leg. */
typedef struct hxMoment {
  double time; /* s  since the middle of the stance */
  double part; /* 1  of the way to the next stance */
  double rate; /* 1/s */
  double lift; /* m */
  double rise; /* m/s */
} hxMoment;

typedef struct hxPaceModel {
  double cycle; /* s */
  hxMoment moment[HX_SAMPLES];
} hxPaceModel;

typedef struct hxPace {
  double asked[HX_COMMANDS]; /* the last command as it was given */
  int outrun[HX_LEGS];       /* joints that cannot follow it, so that the body walks slower */
} hxPace;

/* 1  joint speed that a command may need, over the largest one or over that of steps on the spot:
 * servos follow so short a peak (the PhantomX's own walk has 1.056), and feet land late from 1.2 on
 */
static const double fastest = 1.06;
/* of the interval in which the share lies: it is exact to 6e-5 */
static const int halvings = 14;

static inline void hx_pace_compile(const hxFootPathsModel *paths, hxPaceModel *model) {
  const double swing = paths->swing_time;
  const double stance = paths->clock.gait_period * paths->clock.duty;
  model->cycle = paths->clock.gait_period;
  for (int i = 0; i < HX_SAMPLES; ++i) {
    hxMoment *moment = &model->moment[i];
    const int air = i - HX_STANCE_SAMPLES;
    const double tau = (air + 0.5) / (HX_SAMPLES - HX_STANCE_SAMPLES);
    double slope, climb;
    memset(moment, 0, sizeof *moment);
    moment->time = stance * ((double)i / (HX_STANCE_SAMPLES - 1) - 0.5);
    if (air < 0) continue;
    blend(tau, &moment->part, &slope);
    hop(tau, paths->step_height, paths->touchdown_speed * swing, &moment->lift, &climb);
    moment->time = 0.5 * stance + tau * swing;
    moment->rate = slope / swing;
    moment->rise = climb / swing;
  }
}

/* What the speeds of a command depend on besides its velocity. */
typedef struct hxStride {
  const hxLegSolver *leg;
  const hxFootPathsModel *model;
  const hxFootPaths *paths;
  const hxAbsence *absence;
  hxPosture posture;
} hxStride;

/* Returns the largest joint speed of a leg over that of the servos [1] under the motion (C59). */
static inline double needed(const hxPaceModel *model, const hxStride *stride, int k,
                            hxTwist motion) {
  const hxLegSolver *leg = &stride->leg[k];
  const double w = motion.yaw_rate;
  const hxPlane home = aims(stride->model, stride->paths, k), turn = hx_cis(w * model->cycle);
  const hxPlane step =
      hx_plane_add(travel(motion, model->cycle), hx_times(hx_plane(turn.x - 1.0, turn.y), home));
  double most = 0.0;
  for (int i = 0; i < HX_SAMPLES; ++i) {
    const hxMoment *moment = &model->moment[i];
    const hxPlane back = hx_cis(-w * moment->time);
    const hxPlane ground = hx_plane_add(home, hx_scaled(step, moment->part));
    const hxPlane p = hx_times(back, hx_plane_sub(ground, travel(motion, moment->time)));
    const hxPlane body = hx_plane_add(motion.velocity, hx_plane(-w * p.y, w * p.x));
    hxPlane plane = hx_plane_sub(p, stride->absence->goal);
    hxPlane velocity = hx_plane_sub(hx_times(back, hx_scaled(step, moment->rate)), body);
    double height = stride->model->home_height[k] + moment->lift, rise = moment->rise;
    double speed[HX_JOINTS];
    hxPose pose;
    hxBends bends;
    hx_posture_feet_to_torso(&stride->posture, &plane, &height, &velocity, &rise);
    linkage(leg, plane, height, &pose, &bends);
    hx_leg_solver_speeds(leg, &pose, velocity, rise, speed);
    for (int joint = 0; joint < HX_JOINTS; ++joint) most = hx_larger(fabs(speed[joint]), most);
  }
  return most / leg->speed_max;
}

/* Returns the largest of these of the legs that walk, for a share of the command. Sets those of the
 * legs that are above `most`. */
static inline double needed_of(const hxPaceModel *model, const hxStride *stride,
                               const double asked[HX_COMMANDS], double share, double most,
                               int above[HX_LEGS]) {
  const hxTwist motion = {{share * asked[0], share * asked[1]}, share * asked[2]};
  double largest = 0.0;
  for (int k = 0; k < HX_LEGS; ++k) {
    const double speed = stride->absence->legs[k] ? 0.0 : needed(model, stride, k, motion);
    above[k] = speed > most;
    largest = hx_larger(speed, largest);
  }
  return largest;
}

/* Computes the command with the share of its velocity that the joints can follow (C59). */
HX_RARE void hx_pace_follow(const hxPaceModel *model, hxStride *stride,
                            const double asked[HX_COMMANDS], hxPace *pace,
                            double target[HX_COMMANDS]) {
  const double still[3] = {0.0, 0.0, 0.0};
  double most = fastest, low = 0.0, high = 1.0;
  int above[HX_LEGS];
  memcpy(pace->asked, asked, sizeof pace->asked);
  memcpy(target, pace->asked, sizeof pace->asked);
  hx_posture_of(&stride->posture, pace->asked + 3, still);
  if (needed_of(model, stride, target, 1.0, most, pace->outrun) <= most) return;
  most = fastest * hx_larger(needed_of(model, stride, target, 0.0, most, above), 1.0);
  if (needed_of(model, stride, target, 1.0, most, pace->outrun) <= most) return;
  for (int i = 0; i < halvings; ++i) {
    const double middle = 0.5 * (low + high);
    if (needed_of(model, stride, target, middle, most, above) <= most)
      low = middle;
    else
      high = middle;
  }
  for (int i = 0; i < 3; ++i) target[i] *= low;
}

#endif
