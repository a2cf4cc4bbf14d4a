/* force_laws.h - the force laws of compliant control: from planned load and measured foot forces to
 * the servos' torques. Python: controller/comply/force_laws.py. */
#ifndef HX_FORCE_LAWS_H
#define HX_FORCE_LAWS_H

#include "../sense/contact_detection.h"
#include "../sense/load_limit.h"
#include "../sense/touchdown.h"
#include "../sense/trust.h"
#include "load_plan.h"
#include <string.h>

typedef struct hxForceLawsModel {
  hxParts parts;
  hxSensorWatchModel watch;
  hxLoadLimitModel limit;
  hxTrustModel trust;
  double period; /* s */
  /* N  of the robot; a third of it; load of all feet from which on they have settled */
  double weight, share, settled;
  double most_lean; /* m  limit of the distance of the centre of mass, each axis */
  double high;      /* m  a foot that is planned higher is in the air for certain */
  /* 1  factors of the smoothings over a period */
  double follow_load, follow_cycle, follow_weight;
  double most; /* N m  limit of the torque */
} hxForceLawsModel;

typedef struct hxForceLaws {
  hxSensorWatch watch;
  hxTouchdown touchdown;
  hxLandings landings;
  hxLoadLimit limit;
  hxTrust trust;
  int felt[HX_LEGS];                 /* the foot's sensor reports a contact */
  int contact[HX_LEGS];              /* the foot is on the ground */
  int carrying[HX_LEGS];             /* the gait clock need not wait for the foot any longer */
  double load[HX_LEGS];              /* 1    smoothed, in thirds of the weight */
  double torque[HX_LEGS][HX_JOINTS]; /* N m  for the servos */
  int doubted[HX_LEGS];              /* the foot's sensor is replaced */
  int open_loop[HX_LEGS]; /* the foot follows its path: its sensor is newly doubted, or all are */
  int fallback;           /* kinematic control: the robot slides or is far too heavy */
  double grip[HX_LEGS];   /* 1  factor on the planned load of a leg that is regaining contact */
  int regaining;          /* some grip may be below 1 */
  double scale;           /* 1    measured over planned weight */
  hxPlane lean;         /* m  of the measured centre of mass from the modelled one, walking frame */
  double squeeze_share; /* 1  of the planned squeeze, that the ground holds, smoothed */
  /* scale, weight ratio and lean before a sensor contradicted the plan */
  double trusted_scale, trusted_weight_ratio;
  hxPlane trusted_lean;
} hxForceLaws;

/* 1  of the weight: feet that carry less in all have only just met the ground */
static const double settled_share = 0.5;
static const double gripped = 0.99;    /* 1  of its share: a leg that is given more carries it */
static const double load_floor = 1e-6; /* N  a smaller sum of loads cannot be divided by */
/* 1  measured over modelled weight, range that the support accepts */
static const double least_scale = 0.5, largest_scale = 3.0;
/* 1  of the depth of the ground: distance of the centre of mass, each axis */
static const double largest_lean = 0.4;
/* 1  of the step height: a foot that is planned higher is in the air for certain */
static const double high_share = 0.25;
/* 1  of its planned load, or a third of the weight: a doubted foot bears no more */
static const double likely = 1.2;
/* 1  of the weight ratio, which changes faster: a larger scale has settled */
static const double weighed = 0.9;
/* 1  in thirds of the weight: an awaited foot with more stands */
static const double carrying_share = 0.2;

/* legs that share the weight in the hardest gait: loads are counted in weight / 3 */
enum { HX_TRIPOD_LEGS = 3 };

/* weight: of the robot [N]; depth: of the ground below the torso's origin in the stance [m]. */
static inline void hx_force_laws_compile(const hxControllerDefinition *definition, double weight,
                                         double depth, hxForceLawsModel *model) {
  const hxGains *gains = &definition->gains;
  const double period = definition->period, cycle = definition->gait.period;
  model->parts = definition->parts;
  model->period = period;
  model->weight = weight;
  model->share = model->weight / HX_TRIPOD_LEGS;
  model->settled = settled_share * model->weight;
  model->most_lean = largest_lean * depth;
  hx_sensor_watch_compile(model->weight, cycle, period, &model->watch);
  hx_load_limit_compile(definition, &model->limit);
  hx_trust_compile(definition, &model->trust);
  model->high = high_share * definition->gait.step_height;
  model->follow_load = 1.0 - hx_decay(-period / gains->support.load_time);
  model->follow_cycle = 1.0 - hx_decay(-period / cycle);
  model->follow_weight = 1.0 - hx_decay(-period / gains->support.weight_time);
  model->most = gains->limits.torque;
}

static inline void hx_force_laws_reset(hxForceLaws *laws) {
  memset(laws, 0, sizeof *laws);
  laws->trust.level = laws->squeeze_share = laws->trusted_scale = laws->trusted_weight_ratio = 1.0;
  hx_landings_reset(&laws->landings);
  hx_load_limit_reset(&laws->limit);
  for (int leg = 0; leg < HX_LEGS; ++leg) laws->grip[leg] = 1.0;
}

/* Returns the torque needed for the measured weight over the torque allowed [1]. */
static inline double hx_force_laws_needed(const hxForceLawsModel *model, const hxForceLaws *laws) {
  return laws->limit.weight_ratio * laws->limit.peak / model->most;
}

/* ----------------------------------------------------------------------------------- contacts */

/* Replaces the forces of sensors that are not trusted (C34). */
static inline void replace_forces(const hxForceLawsModel *model, const hxLoadPlan *plan,
                                  double force[HX_LEGS][3], hxForceLaws *laws) {
  const hxShares *shares = &plan->shares;
  const int count = hx_marked(laws->doubted);
  int before[HX_LEGS];
  memcpy(before, laws->contact, sizeof before);
  memcpy(laws->contact, laws->felt, sizeof laws->contact);
  if (!count) return;
  hx_replaced(shares->normal, laws->scale, laws->felt, laws->doubted, force);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    if (!laws->doubted[leg]) continue;
    force[leg][0] = laws->scale * shares->push[leg].x;
    force[leg][1] = laws->scale * shares->push[leg].y;
    laws->contact[leg] = count == HX_LEGS
                             ? shares->activation[leg] > 0.5
                             : hx_sensor_watch_found(&model->watch, force[leg][2], before[leg]);
  }
}

/* Decides which sensors are trusted (C34). When the sensors of three feet are not, none is. met:
 * heights at which the feet meet the ground without a bump [m]; force: that the laws use; reported:
 * normal forces that the sensors report [N]. */
static inline void judge_sensors(const hxForceLawsModel *model, const hxLoadPlan *plan,
                                 const double met[HX_LEGS], const double force[HX_LEGS][3],
                                 const double reported[HX_LEGS], hxForceLaws *laws) {
  int high[HX_LEGS], due[HX_LEGS], count = 0, fresh = 0;
  double total[HX_LEGS], whole = 0.0, known = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    whole += reported[leg];
    high[leg] = plan->height[leg] > model->high + met[leg];
    due[leg] = plan->standing[leg] || plan->awaited[leg];
    const double most = hx_larger(model->share, likely * laws->scale * plan->shares.normal[leg]);
    known += laws->doubted[leg] && !high[leg] ? hx_smaller(force[leg][2], most) : 0.0;
  }
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    total[leg] = laws->doubted[leg] ? whole : whole + known;
    if (high[leg]) total[leg] = whole + known - reported[leg];
  }
  hx_sensor_watch_update(&model->watch, laws->felt, total, due, high, &laws->watch);
  for (int leg = 0; leg < HX_LEGS; ++leg) count += laws->watch.left[leg] > 0.0;
  const int all_doubted = count >= HX_TRIPOD_LEGS;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const int doubted = all_doubted || laws->watch.left[leg] > 0.0,
              now = doubted && !laws->doubted[leg];
    laws->open_loop[leg] =
        all_doubted || ((laws->open_loop[leg] || now) && doubted && plan->height[leg] <= hx_early);
    laws->doubted[leg] = doubted;
    fresh |= now;
  }
  if (!fresh) return;
  laws->scale = laws->trusted_scale;
  laws->lean = laws->trusted_lean;
  laws->limit.weight_ratio = laws->trusted_weight_ratio;
}

/* Adapts the paths to ground that is met early or late (C36). */
static inline void meet_ground(const hxForceLawsModel *model, const hxLoadPlan *plan,
                               const double met[HX_LEGS], hxForceLaws *laws) {
  double falling[HX_LEGS];
  int early[HX_LEGS], searching[HX_LEGS];
  laws->regaining = 1;
  hx_landings_early(&laws->landings, met, plan->height, early);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    falling[leg] = early[leg] ? plan->descent[leg] : 0.0;
    searching[leg] = plan->awaited[leg] && !laws->open_loop[leg] && !laws->carrying[leg];
  }
  hx_touchdown_step(model->period, laws->contact, falling, plan->swinging, plan->standing,
                    searching, laws->open_loop, &laws->touchdown);
}

/* Decides between a wrong sensor and ground that is met early or late; as for judge_sensors. */
static inline void examine_contacts(const hxForceLawsModel *model, const hxLoadPlan *plan,
                                    const double force[HX_LEGS][3], const double reported[HX_LEGS],
                                    hxForceLaws *laws) {
  double met[HX_LEGS];
  hx_landings_expected(&laws->landings, laws->contact, plan->height, plan->swinging, met);
  if (model->parts.fallback) judge_sensors(model, plan, met, force, reported, laws);
  if (laws->trust.level < 1.0)
    memset(&laws->touchdown, 0, sizeof laws->touchdown);
  else if (model->parts.touchdown)
    meet_ground(model, plan, met, laws);
}

/* Returns whether contacts contradict the plan, or have done so and the reaction is in progress. */
static inline int contacts_differ(const hxLoadPlan *plan, const hxForceLaws *laws) {
  int found = hx_sensor_watch_busy(&laws->watch) || hx_touchdown_busy(&laws->touchdown);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    found |= plan->awaited[leg] || (laws->contact[leg] != plan->standing[leg] &&
                                    (plan->standing[leg] || plan->height[leg] > hx_early));
  return found;
}

/* -------------------------------------------------------------------------- inputs and weight */

/* Returns the share of the planned squeeze that creep has taken away, in [0, 1] (C46); 0 without
 * planned squeeze. deviation: of the tangential forces from the planned ones [N]. */
static inline double squeeze_lost(const hxLoadPlan *plan, const hxPlane deviation[HX_LEGS],
                                  const hxForceLaws *laws) {
  double whole = 0.0, present = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    if (!laws->contact[leg]) continue;
    const hxPlane planned = hx_scaled(plan->shares.squeeze[leg], laws->scale);
    whole += hx_square(planned);
    present += hx_along(planned, deviation[leg]);
  }
  return whole <= load_floor ? 0.0 : hx_clamp(-present / whole, 0.0, 1.0);
}

/* Computes the normal forces and returns their sum [N]. Updates trust (C33), the smoothed loads
 * (C27) and the share of the planned squeeze that is held (C52) by the deviations of the tangential
 * forces (C24). */
static inline double measure_loads(const hxForceLawsModel *model, const hxLoadPlan *plan,
                                   const double force[HX_LEGS][3], double normal[HX_LEGS],
                                   hxForceLaws *laws) {
  hxPlane common = {0.0, 0.0}, deviation[HX_LEGS];
  double total = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double contact = laws->contact[leg] ? 1.0 : 0.0;
    const hxPlane planned = hx_scaled(plan->shares.push[leg], laws->scale);
    deviation[leg] =
        hx_scaled(hx_plane_sub(hx_plane(force[leg][0], force[leg][1]), planned), contact);
    normal[leg] = force[leg][2] * contact;
    common = hx_plane_add(common, deviation[leg]);
    total += normal[leg];
  }
  const double share = total > load_floor ? 1.0 / total : 0.0;
  if (model->parts.fallback)
    laws->fallback =
        hx_trust_step(&model->trust, total > model->settled ? hx_length(common) * share : 0.0,
                      laws->limit.overloaded, &laws->trust) == 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    laws->load[leg] += model->follow_load * (normal[leg] / model->share - laws->load[leg]);
  const double missing = squeeze_lost(plan, (const hxPlane *)deviation, laws);
  laws->squeeze_share += model->follow_cycle * (1.0 - missing - laws->squeeze_share);
  return total;
}

/* Updates the distance of the centre of mass from the modelled one (C44). The planned loads contain
 * the present distance. normal: measured [N]; total: their sum. */
static inline void update_lean(const hxForceLawsModel *model, const hxLoadPlan *plan,
                               const double normal[HX_LEGS], double total, hxForceLaws *laws) {
  hxPlane measured = {0.0, 0.0}, planned = {0.0, 0.0};
  if (!(total > model->settled) || !(plan->weight > model->settled)) return;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    measured = hx_plane_add(measured, hx_scaled(plan->feet[leg], normal[leg]));
    planned = hx_plane_add(planned, hx_scaled(plan->feet[leg], plan->shares.normal[leg]));
  }
  const hxPlane ahead =
      hx_plane_sub(hx_scaled(measured, 1.0 / total), hx_scaled(planned, 1.0 / plan->weight));
  const hxPlane lean = hx_plane_add(laws->lean, hx_scaled(ahead, model->follow_cycle));
  laws->lean.x = hx_clamp(lean.x, -model->most_lean, model->most_lean);
  laws->lean.y = hx_clamp(lean.y, -model->most_lean, model->most_lean);
}

/* Updates the ratio of measured to planned weight (C30), the centre of mass (C44), and the part of
 * the weight that the servos carry. normal: measured normal forces [N]; total: their sum [N]. */
static inline void update_weight(const hxForceLawsModel *model, const hxLoadPlan *plan,
                                 const double normal[HX_LEGS], double total, hxForceLaws *laws) {
  const double ratio = total / hx_larger(plan->weight, load_floor),
               scale = hx_clamp(ratio, least_scale, largest_scale);
  if (laws->scale > weighed * laws->limit.weight_ratio &&
      !hx_sensor_watch_contradicted(&laws->watch)) {
    laws->trusted_scale = laws->scale;
    laws->trusted_weight_ratio = laws->limit.weight_ratio;
    laws->trusted_lean = laws->lean;
  }
  if (!hx_marked(laws->doubted)) {
    laws->scale += model->follow_weight * (scale - laws->scale);
    hx_load_limit_weigh(&model->limit, ratio, &laws->limit);
    update_lean(model, plan, normal, total, laws);
  }
  hx_load_limit_step(&model->limit, plan->needed, laws->scale, &laws->limit);
}

/* ------------------------------------------------------------------------------------- joints */

/* Takes its share from a leg that does not touch the ground where it should stand, and gives it
 * back gradually once the leg touches (C28). */
static inline void restore_grip(const hxForceLawsModel *model, const hxLoadPlan *plan,
                                hxForceLaws *laws) {
  laws->regaining = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    laws->grip[leg] += model->follow_load * (1.0 - laws->grip[leg]);
    if ((plan->standing[leg] || plan->awaited[leg]) && !laws->contact[leg]) laws->grip[leg] = 0.0;
    for (int joint = 0; joint < HX_JOINTS; ++joint) laws->torque[leg][joint] *= laws->grip[leg];
    laws->regaining |= laws->grip[leg] < gripped;
  }
}

/* Sets the torques of the planned load: trust (own + grip strength scale carry) (C29). */
static inline void actuate(const hxForceLawsModel *model, const hxLoadPlan *plan,
                           hxForceLaws *laws) {
  const int limited = model->parts.limits;
  const double strength = limited ? laws->limit.strength : 1.0;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      laws->torque[leg][joint] = plan->carry[leg][joint] * (strength * laws->scale);
  if (laws->regaining) restore_grip(model, plan, laws);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double torque = (laws->torque[leg][joint] + plan->own[leg][joint]) * laws->trust.level;
      laws->torque[leg][joint] = limited ? hx_clamp(torque, -model->most, model->most) : torque;
    }
}

/* Returns the height offsets of the feet [m] (C36), and in *busy whether they are changing. */
static inline const double *hx_force_laws_raised(const hxForceLaws *laws, int *busy) {
  *busy = hx_touchdown_busy(&laws->touchdown);
  return laws->touchdown.offset;
}

/* Returns whether a foot on its way down has met the ground (C51). */
static inline int hx_force_laws_meets(const hxForceLawsModel *model, int leg,
                                      const hxForceLaws *laws) {
  return model->parts.touchdown && laws->trust.level == 1.0 && laws->contact[leg] &&
         !laws->open_loop[leg];
}

/* Returns whether the gait clock waits for the feet of legs that end their swing (C50). waiting: it
 * waits already. */
static inline int hx_force_laws_waits(const hxForceLawsModel *model, const int landing[HX_LEGS],
                                      int waiting, const hxForceLaws *laws) {
  int waits = 0;
  if (!model->parts.touchdown || laws->trust.level < 1.0) return 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const int found = waiting ? laws->carrying[leg] : laws->contact[leg];
    waits |= landing[leg] && !found && !laws->open_loop[leg] &&
             laws->touchdown.offset[leg] > -hx_reach_limit;
  }
  return waits;
}

/* Advances the laws by one period. force: of the ground on the feet, walking frame [N]; replaced
 * where a sensor is not trusted. */
static inline void hx_force_laws_step(const hxForceLawsModel *model, const hxLoadPlan *plan,
                                      double force[HX_LEGS][3], hxForceLaws *laws) {
  double normal[HX_LEGS], reported[HX_LEGS];
  for (int leg = 0; leg < HX_LEGS; ++leg) reported[leg] = force[leg][2];
  hx_contact_detector_step(model->weight, reported, laws->felt);
  for (int leg = 0; leg < HX_LEGS; ++leg) reported[leg] *= laws->felt[leg] ? 1.0 : 0.0;
  replace_forces(model, plan, force, laws);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    laws->carrying[leg] = laws->contact[leg] && force[leg][2] > carrying_share * model->share;
  hx_landings_update(laws->contact, plan->height, plan->swinging, &laws->landings);
  if (contacts_differ(plan, laws))
    examine_contacts(model, plan, (const double (*)[3])force, reported, laws);
  const double total = measure_loads(model, plan, (const double (*)[3])force, normal, laws);
  update_weight(model, plan, normal, total, laws);
  actuate(model, plan, laws);
}

#endif
