/* trust.h - whether the planned load and the force sensors can be trusted (C33, C34). Python:
 * controller/sense/trust.py. */
#ifndef HX_TRUST_H
#define HX_TRUST_H

#include "../plane.h"

typedef struct hxTrustModel {
  double period;      /* s */
  double follow_load; /* 1  factor of the smoothing over a period */
  int64_t calm;       /* steps without sliding until feet are trusted again */
} hxTrustModel;

typedef struct hxTrust {
  double level;             /* 1  factor on all torques */
  int64_t slide_periods;    /* steps for which the robot has been sliding */
  int64_t recovery_periods; /* steps that remain until feedback resumes after sliding */
} hxTrust;

/* Finds the foot sensors that contradict the plan for too long (C34). */
typedef struct hxSensorWatchModel {
  double period;  /* s */
  double weight;  /* N */
  double missing; /* N  when all feet measure less, some sensor reports too little */
  double memory;  /* s  time without contradiction until a sensor is trusted again */
} hxSensorWatchModel;

typedef struct hxSensorWatch {
  double contradicted[HX_LEGS]; /* s  duration of the contradiction */
  double left[HX_LEGS];         /* s  time until the sensor is trusted again */
} hxSensorWatch;

/* 1  common tangential over normal force beyond the plan, which only a sliding robot reaches */
static const double sliding_drag = 0.55;
/* 1  gait cycles without sliding until feet are trusted again */
static const double calm_cycles = 0.5;
static const double sliding_time = 0.04; /* s  longer than a foot skids at touch-down */
static const double trusted = 0.99;      /* 1  so near to its goal the trust is at it */
/* s  longest plausible contradiction, which exceeds the delay of the sensors */
static const double contradiction_time = 0.10;
static const double missing_share = 0.92; /* 1  of the weight */
static const double memory_cycles = 1.5;  /* 1  gait cycles */
/* 1  of the weight: as contact_share and lift_share, for a doubted foot; more, because torso and
 * feet accelerate */
static const double found_part = 0.10, gone_part = 0.03;
/* N  of a doubted foot, so that the shares of feet in the air are not 0 / 0 */
static const double least_share = 1e-6;

static inline void hx_trust_compile(const hxControllerDefinition *definition, hxTrustModel *model) {
  const double period = definition->period, cycle = definition->gait.period;
  model->period = period;
  model->follow_load = 1.0 - hx_decay(-period / definition->gains.support.load_time);
  const double calm = nearbyint(calm_cycles * cycle / period);
  model->calm = (int64_t)calm;
}

/* Advances the trust by one period (C33) and returns the level that it goes to, 0 or 1. drag: the
 * common tangential force of the feet beyond the plan, over the normal force; overloaded: the
 * robot is far too heavy for its servos. */
static inline double hx_trust_step(const hxTrustModel *model, double drag, int overloaded,
                                   hxTrust *trust) {
  trust->slide_periods = drag > sliding_drag ? trust->slide_periods + 1 : 0;
  if ((double)trust->slide_periods * model->period > sliding_time)
    trust->recovery_periods = model->calm;
  else if (trust->recovery_periods)
    --trust->recovery_periods;
  const double goal = trust->recovery_periods || overloaded ? 0.0 : 1.0;
  if (trust->level == goal) return goal;
  trust->level += model->follow_load * (goal - trust->level);
  if (fabs(goal - trust->level) < 1.0 - trusted) trust->level = goal;
  return goal;
}

static inline void hx_sensor_watch_compile(double weight, double cycle, double period,
                                           hxSensorWatchModel *model) {
  model->period = period;
  model->weight = weight;
  model->missing = missing_share * weight;
  model->memory = memory_cycles * cycle;
}

/* Returns whether some sensor contradicts the plan. */
static inline int hx_sensor_watch_contradicted(const hxSensorWatch *watch) {
  int found = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) found |= watch->contradicted[leg] != 0.0;
  return found;
}

/* Returns whether some sensor contradicts the plan or is not trusted. */
static inline int hx_sensor_watch_busy(const hxSensorWatch *watch) {
  int busy = hx_sensor_watch_contradicted(watch);
  for (int leg = 0; leg < HX_LEGS; ++leg) busy |= watch->left[leg] != 0.0;
  return busy;
}

/* Advances by one period. contact: feet that report a force; total: for each foot the sum of all
 * normal forces, without its own if it is high [N]; standing: planned to carry their whole share;
 * high: planned well above the ground. */
static inline void hx_sensor_watch_update(const hxSensorWatchModel *model,
                                          const int contact[HX_LEGS], const double total[HX_LEGS],
                                          const int standing[HX_LEGS], const int high[HX_LEGS],
                                          hxSensorWatch *watch) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const int up = high[leg], lacking = total[leg] < model->missing;
    const int wrong = up ? contact[leg] && !lacking : standing[leg] && !contact[leg] && lacking;
    watch->contradicted[leg] = wrong ? watch->contradicted[leg] + model->period : 0.0;
    watch->left[leg] = watch->contradicted[leg] > contradiction_time
                           ? model->memory
                           : fmax(watch->left[leg] - model->period, 0.0);
  }
}

/* Returns whether a doubted foot has contact (C34). load: that replaces the measured one [N];
 * contact: a period ago. */
static inline int hx_sensor_watch_found(const hxSensorWatchModel *model, double load, int contact) {
  return load > (contact ? gone_part : found_part) * model->weight;
}

/* Replaces the normal forces of the doubted feet, of which there is one at least (C34): they carry
 * what the others leave of the weight, in the shares of the plan. planned, scale: normal forces [N]
 * and the ratio of measured to planned weight; contact: feet that report a force. */
static inline void hx_replaced(const double planned[HX_LEGS], double scale,
                               const int contact[HX_LEGS], const int doubted[HX_LEGS],
                               double force[HX_LEGS][3]) {
  double left = 0.0, whole = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double load = scale * planned[leg];
    left += load - (contact[leg] && !doubted[leg] ? force[leg][2] : 0.0);
    whole += doubted[leg] ? load + least_share : 0.0;
  }
  for (int leg = 0; leg < HX_LEGS; ++leg)
    if (doubted[leg])
      force[leg][2] = hx_larger(left, 0.0) * (scale * planned[leg] + least_share) / whole;
}

#endif
