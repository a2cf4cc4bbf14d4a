/* absence.h - walks without legs that are out of service, and takes them back (C58). Python:
 * controller/walk/absence.py. */
#ifndef HX_ABSENCE_H
#define HX_ABSENCE_H

#include "gait.h"
#include "kinematics.h"

typedef struct hxAbsenceModel {
  double period, handover; /* s  handover: of a load */
  hxPlane home[HX_LEGS];   /* m  feet of the stance */
} hxAbsenceModel;

typedef struct hxAbsence {
  int legs[HX_LEGS];                  /* out of service */
  int gone[HX_LEGS];                  /* that were out of service before */
  double command[HX_LEGS][HX_JOINTS]; /* rad  of these legs */
  double place[HX_LEGS][HX_JOINTS];   /* rad  around which their faulty joints are tried */
  /* periods since the legs out of service changed, and since the begin of the trial */
  int64_t since, trial;
  hxPlane begin, goal; /* m  ways of the torso from its nominal place, walking frame */
} hxAbsence;

enum { HX_MOST_ABSENT = 2 }; /* legs: four must walk */
/* 1  swing time and step height without a leg over those of the gait */
static const double swift = 0.6, low_step = 0.6;
static const double shift_time = 0.4; /* s  in which the torso moves over the other feet */
/* s  in which the walk then takes the torso back to its path */
static const double back_time = 3.0;
static const double far_shift = 0.045;  /* m  at most for each lost leg */
static const double fold_speed = 4.0;   /* rad/s */
static const double lead = 0.15;        /* rad  of a command before its joint, at most */
static const double fold_margin = 0.1;  /* rad  of a folded joint from its limit */
static const double trial_swing = 0.08; /* rad  size of the swing of a faulty joint */
static const double trial_time = 1.0;   /* s  its period */
static const double arrived = 1e-3;     /* rad  a command this near to the plan is the plan */
/* leg that steps first without a leg, forwards and backwards: without the foremost of a side the
 * rearmost one there, so that the feet beside the torso step before it stands on them alone */
static const int steps_first[2][HX_LEGS] = {{2, 4, 3, 5, 1, 0}, {5, 4, 0, 2, 1, 3}};

/* Changes a gait to the wave of the legs that are not absent, if any is absent. */
HX_RARE void hx_gait_without(hxGait *gait, const int absent[HX_LEGS], int backwards) {
  const hxGait wave = {.pattern = HX_PATTERN_WAVE};
  const int count = HX_LEGS - hx_marked(absent);
  double phase[HX_LEGS], way[HX_LEGS]; /* way: in the wave, from the leg that steps first */
  int lost = 0;
  hx_gait_offsets(&wave, phase);
  if (count == HX_LEGS) return;
  while (!absent[lost]) ++lost;
  const double turn = backwards ? 1.0 : -1.0, begin = phase[steps_first[backwards][lost]];
  for (int leg = 0; leg < HX_LEGS; ++leg) way[leg] = hx_fraction(turn * (phase[leg] - begin));
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    int place = 0; /* of the leg in the order in which the feet lift off */
    for (int k = 0; k < HX_LEGS; ++k) place += !absent[k] && way[k] < way[leg];
    gait->offset[leg] = place == 0 ? 0.0 : 1.0 - (double)place / count;
    /* an absent leg gives up its load while it stands by the clock */
    if (absent[leg]) gait->offset[leg] = 0.5;
  }
  const double swing = swift * gait->period * (1.0 - gait->duty);
  gait->pattern = HX_PATTERN_CUSTOM;
  gait->period = count * swing;
  gait->duty = (double)(count - 1) / count;
  gait->step_height *= low_step;
  gait->narrowing = 0.0;
}

static inline void hx_absence_compile(const hxPlane home[HX_LEGS], double handover, double period,
                                      hxAbsenceModel *model) {
  model->period = period;
  model->handover = hx_larger(handover, period);
  memcpy(model->home, home, sizeof model->home);
}

/* Takes all legs back at once. */
static inline void hx_absence_reset(const hxAbsenceModel *model, hxAbsence *absence) {
  const double steps = nearbyint((shift_time + back_time) / model->period);
  memset(absence, 0, sizeof *absence);
  absence->since = (int64_t)steps + 1;
}

/* Returns 3 x^2 - 2 x^3. */
static inline double ease(double x) { return x * x * (3.0 - 2.0 * x); }

/* Returns the way of the torso a number of periods after the present step [m]. */
static inline hxPlane hx_absence_torso(const hxAbsenceModel *model, const hxAbsence *absence,
                                       int64_t ahead) {
  const double x = hx_smaller((double)(absence->since + ahead) * model->period / shift_time, 1.0);
  return hx_plane_add(absence->begin,
                      hx_scaled(hx_plane_sub(absence->goal, absence->begin), ease(x)));
}

/* Returns the velocity that leads the torso back to its path a number of periods later [m/s]: its
 * nominal place moves as far as the torso has moved from there, in the other direction. */
static inline hxPlane hx_absence_drift(const hxAbsenceModel *model, const hxAbsence *absence,
                                       int64_t ahead) {
  const double x = ((double)(absence->since + ahead) * model->period - shift_time) / back_time;
  if (!(0.0 < x && x < 1.0)) return hx_plane(0.0, 0.0);
  return hx_scaled(hx_plane_sub(absence->begin, absence->goal), 6.0 * x * (1.0 - x) / back_time);
}

/* Returns the factor on the activation of a leg a number of periods later. */
static inline double hx_absence_presence(const hxAbsenceModel *model, const hxAbsence *absence,
                                         int leg, int64_t ahead) {
  const double x = (double)(absence->since + ahead) * model->period / model->handover;
  if (!absence->legs[leg]) return 1.0;
  return absence->gone[leg] || x >= 1.0 ? 0.0 : 1.0 - ease(x);
}

static inline hxPlane mean_of(const hxPlane place[HX_LEGS], const int out[HX_LEGS]) {
  hxPlane sum = {0.0, 0.0};
  int count = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    if (out && out[leg]) continue;
    sum = hx_plane_add(sum, place[leg]);
    ++count;
  }
  return hx_scaled(sum, 1.0 / count);
}

/* Sets the legs out of service, and the way of the torso over the others. */
HX_RARE void set_absent(const hxAbsenceModel *model, const int legs[HX_LEGS], hxAbsence *absence) {
  const hxPlane begin = hx_absence_torso(model, absence, 0),
                goal = hx_plane_sub(mean_of(model->home, legs), mean_of(model->home, NULL));
  const double most = far_shift * hx_larger(hx_marked(legs), 1);
  absence->begin = begin;
  absence->goal = hx_scaled(goal, most / hx_larger(hx_length(goal), most));
  memcpy(absence->gone, absence->legs, sizeof absence->gone);
  memcpy(absence->legs, legs, sizeof absence->legs);
  absence->since = 0;
}

/* Returns whether another leg may be taken out of service. */
static inline int hx_absence_has_room(const hxAbsence *absence) {
  int count = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) count += absence->legs[leg];
  return count < HX_MOST_ABSENT;
}

/* Takes lost legs out of service, HX_MOST_ABSENT at most. Returns whether any is new. */
static inline int hx_absence_change(const hxAbsenceModel *model, const int lost[HX_LEGS],
                                    const hxControllerOutput *last, hxAbsence *absence) {
  int legs[HX_LEGS], room = HX_MOST_ABSENT, any = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) room -= absence->legs[leg];
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const int new = !absence->legs[leg] && room > 0 && lost[leg];
    legs[leg] = absence->legs[leg] || new;
    if (!new) continue;
    memcpy(absence->command[leg], last->angle_ref[leg], sizeof absence->command[leg]);
    memcpy(absence->place[leg], last->angle_ref[leg], sizeof absence->place[leg]);
    any = 1;
    --room;
  }
  if (any) set_absent(model, (const int *)legs, absence);
  return any;
}

/* Takes a leg back into service. */
HX_RARE void hx_absence_take_back(const hxAbsenceModel *model, int leg, hxAbsence *absence) {
  int legs[HX_LEGS];
  memcpy(legs, absence->legs, sizeof legs);
  legs[leg] = 0;
  set_absent(model, (const int *)legs, absence);
}

/* Computes the joint angles at which a leg is out of the way [rad]. The femur is raised. The tibia
 * is folded under a limp femur, which hangs down, and raised on a locked one. */
HX_RARE void folded(const hxLegSolver *leg, const int faulty[HX_JOINTS],
                    const int locked[HX_JOINTS], double angle[HX_JOINTS]) {
  angle[0] = leg->stance[0];
  angle[1] = leg->angle_max[1] - fold_margin;
  angle[2] = !faulty[1]  ? leg->stance[2]
             : locked[1] ? leg->angle_min[2] + fold_margin
                         : leg->angle_max[2] - fold_margin;
}

/* Replaces the commands of a leg out of service; one without a faulty servo returns to the plan.
 * Returns whether it is there. angle: measured [rad]; swing: of the faulty joints on trial [rad].
 */
HX_RARE int fold_leg(const hxAbsenceModel *model, const hxLegSolver *leg, int k,
                     const double angle[HX_JOINTS], const int faulty[HX_JOINTS],
                     const int locked[HX_JOINTS], double swing, hxAbsence *absence,
                     hxControllerOutput *output) {
  const int lost = faulty[0] || faulty[1] || faulty[2];
  const double step = fold_speed * model->period;
  double target[HX_JOINTS];
  int there = !lost;
  folded(leg, faulty, locked, target);
  for (int j = 0; j < HX_JOINTS; ++j) {
    double *command = &absence->command[k][j], *planned = &output->angle_ref[k][j];
    if (faulty[j]) target[j] = (locked[j] ? absence->place[k][j] : target[j]) + swing;
    const double wanted = lost ? target[j] : *planned;
    const double way = hx_clamp(wanted, leg->angle_min[j], leg->angle_max[j]) - *command;
    const double moved =
        hx_clamp(*command + hx_clamp(way, -step, step), angle[j] - lead, angle[j] + lead);
    there &= fabs(moved - *planned) < arrived;
    output->speed_ref[k][j] = (moved - *command) / model->period;
    output->torque_ref[k][j] = 0.0;
    *command = *planned = moved;
  }
  output->unreachable[k] = 0;
  return there;
}

/* Replaces the commands of the legs out of service. Returns the first one that has returned to the
 * plan, -1 if none has. angle: measured [rad]; faulty, locked: of the servos. */
static inline int hx_absence_fold(const hxAbsenceModel *model, const hxLegSolver leg[HX_LEGS],
                                  const double angle[HX_LEGS][HX_JOINTS],
                                  const int faulty[HX_LEGS][HX_JOINTS],
                                  const int locked[HX_LEGS][HX_JOINTS], hxAbsence *absence,
                                  hxControllerOutput *output) {
  static const double turn = 6.283185307179586;
  int back = -1, any = 0;
  for (int k = 0; k < HX_LEGS; ++k) any |= absence->legs[k];
  if (!any) return -1;
  const double time = (double)absence->trial * model->period / trial_time,
               swing = trial_swing * hx_cis(turn * time).y;
  ++absence->trial;
  for (int k = 0; k < HX_LEGS; ++k)
    if (absence->legs[k] &&
        fold_leg(model, &leg[k], k, angle[k], faulty[k], locked[k], swing, absence, output) &&
        back < 0)
      back = k;
  return back;
}

#endif
