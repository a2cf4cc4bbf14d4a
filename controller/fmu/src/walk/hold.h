/* hold.h - slow loops that correct the torso's posture and path from the positions of the standing
 * feet. Python: controller/walk/hold.py. */
#ifndef HX_HOLD_H
#define HX_HOLD_H

#include "../plane.h"
#include "hexapod/controller.h"

typedef struct hxHoldModel {
  int64_t every; /* steps between two updates */
  double time;   /* s  between two updates */
  int posture, path;
  double attitude_step, height_step; /* 1  factors of the integrals for one update */
  double smooth;                     /* 1  factor of the ground's inclination for one update */
  double angle_limit, height_limit, path_rate, speed_limit, turn_limit;
} hxHoldModel;

/* Measurements for one update. Feet are in the walking frame. */
typedef struct hxHoldInput {
  hxPlane plane[HX_LEGS];         /* m  contact points from the measured joint angles */
  double height[HX_LEGS];         /* m  of the feet's centres */
  hxPlane planned[HX_LEGS];       /* m  planned positions */
  double planned_height[HX_LEGS]; /* m */
  double load[HX_LEGS];           /* 1    thirds of the weight */
  double tilt[2];                 /* rad  roll and pitch minus the commanded ones */
  double yaw;                     /* rad */
  hxPlane velocity;               /* m/s  commanded, walking frame */
  double yaw_rate;                /* rad/s */
} hxHoldInput;

typedef struct hxHold {
  double lift[HX_LEGS]; /* m      of the feet */
  hxPlane velocity;     /* m/s    added to the commanded one */
  double yaw_rate;      /* rad/s  added to the commanded one */
  hxPlane way;          /* m  lost displacement */
  double heading;       /* rad  lost heading */
  int ground_known, looked;
  double ground[2];          /* rad    inclination */
  double angle[2], height;   /* rad, m  of the corrections */
  hxPlane foot[HX_LEGS];     /* m  at the last update, turned by the yaw */
  double load[HX_LEGS], yaw; /* 1, rad  at the last update */
} hxHold;

static const double update_time = 0.04; /* s  interval of the loops, at least a period */
/* 1  in thirds of the weight: a foot with a larger load does not slip */
static const double loaded_from = 0.4;
static const double determinant_floor = 1e-6;       /* m4  feet on one line define no plane */
static const double whole_turn = 6.283185307179586; /* rad */

/* Fits the plane height = c + s_x x + s_y y of least weighted squares (C37): fit = c, s_x, s_y.
 * Returns whether the feet define a plane. */
static inline int fit_plane(const hxHoldInput *seen, double fit[3]) {
  double total = 0.0, x0 = 0.0, y0 = 0.0, z0 = 0.0, xx = 0.0, yy = 0.0, xy = 0.0, xz = 0.0,
         yz = 0.0;
  int feet = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double w = seen->load[leg];
    if (!(w > loaded_from)) continue;
    ++feet;
    total += w;
    x0 += w * seen->planned[leg].x;
    y0 += w * seen->planned[leg].y;
    z0 += w * (seen->height[leg] - seen->planned_height[leg]);
  }
  if (feet < 3) return 0;
  x0 /= total;
  y0 /= total;
  z0 /= total;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    if (!(seen->load[leg] > loaded_from)) continue;
    const double w = seen->load[leg] / total, x = seen->planned[leg].x - x0,
                 y = seen->planned[leg].y - y0;
    const double z = seen->height[leg] - seen->planned_height[leg] - z0;
    xx += w * x * x;
    yy += w * y * y;
    xy += w * x * y;
    xz += w * x * z;
    yz += w * y * z;
  }
  const double determinant = xx * yy - xy * xy;
  if (determinant < determinant_floor) return 0;
  fit[1] = (xz * yy - yz * xy) / determinant;
  fit[2] = (yz * xx - xz * xy) / determinant;
  fit[0] = z0 - fit[1] * x0 - fit[2] * y0;
  return 1;
}

static inline void hx_hold_compile(const hxControllerDefinition *definition, hxHoldModel *model) {
  const double every = nearbyint(update_time / definition->period);
  model->every = every < 1.0 ? 1 : (int64_t)every;
  model->time = (double)model->every * definition->period;
  model->posture = definition->parts.posture;
  model->path = definition->parts.path;
  model->attitude_step = definition->gains.hold.attitude_rate * model->time;
  model->height_step = definition->gains.hold.height_rate * model->time;
  model->smooth = fmin(model->time / definition->gains.hold.ground_time, 1.0);
  model->angle_limit = definition->gains.hold.angle_limit;
  model->height_limit = definition->gains.hold.height_limit;
  model->path_rate = definition->gains.hold.path_rate;
  model->speed_limit = definition->gains.hold.speed_limit;
  model->turn_limit = definition->gains.hold.turn_limit;
}

/* Integrates the errors of height and tilt relative to the ground (C38). */
static inline void hold_posture(const hxHoldModel *model, const hxHoldInput *seen, hxHold *hold) {
  double fit[3];
  if (!fit_plane(seen, fit)) return;
  /* relative to the planned feet the torso is pitched by s_x and rolled by -s_y */
  const double leaning[2] = {seen->tilt[0] + fit[2], seen->tilt[1] - fit[1]};
  for (int i = 0; i < 2; ++i) {
    const double ground = hold->ground_known ? hold->ground[i] : leaning[i];
    hold->ground[i] = ground + model->smooth * (leaning[i] - ground);
    const double correction =
        hold->angle[i] - model->attitude_step * (seen->tilt[i] - hold->ground[i]);
    hold->angle[i] = hx_clamp(correction, -model->angle_limit, model->angle_limit);
  }
  hold->ground_known = 1;
  hold->height = hx_clamp(hold->height + model->height_step * fit[0], -model->height_limit,
                          model->height_limit);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    hold->lift[leg] = seen->planned[leg].x * hold->angle[1] -
                      seen->planned[leg].y * hold->angle[0] - hold->height;
}

/* Adds the displacement and heading lost since the last update (C39). foot: turned by the yaw [m].
 */
static inline void add_lost_way(const hxHoldModel *model, const hxHoldInput *seen,
                                const hxPlane foot[HX_LEGS], hxHold *hold) {
  const hxPlane ahead = hx_cis(hold->yaw + hold->heading + 0.5 * seen->yaw_rate * model->time);
  const hxPlane commanded = hx_scaled(hx_times(ahead, seen->velocity), model->time);
  hxPlane walked = {0.0, 0.0};
  double total = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double least = fmin(hold->load[leg], seen->load[leg]),
                 both = least > loaded_from ? least : 0.0;
    total += both;
    walked = hx_plane_add(walked, hx_scaled(hx_plane_sub(foot[leg], hold->foot[leg]), both));
  }
  walked = total > 0.0 ? hx_scaled(walked, -1.0 / total) : commanded;
  hold->way = hx_plane_add(hold->way, hx_plane_sub(commanded, walked));
  hold->heading += seen->yaw_rate * model->time - remainder(seen->yaw - hold->yaw, whole_turn);
}

/* Computes the velocity that leads the robot back to its path (C39, C40). */
static inline void hold_path(const hxHoldModel *model, const hxHoldInput *seen, hxHold *hold) {
  const hxPlane R_WK = hx_cis(seen->yaw);
  hxPlane foot[HX_LEGS];
  for (int leg = 0; leg < HX_LEGS; ++leg) foot[leg] = hx_times(R_WK, seen->plane[leg]);
  if (hold->looked) add_lost_way(model, seen, foot, hold);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    hold->foot[leg] = foot[leg];
    hold->load[leg] = seen->load[leg];
  }
  hold->yaw = seen->yaw;
  hold->looked = 1;
  const hxPlane back = hx_times(hx_scaled(hold->way, model->path_rate), hx_conj(R_WK));
  hold->velocity = hx_scaled(back, model->speed_limit / fmax(hx_length(back), model->speed_limit));
  hold->yaw_rate =
      hx_clamp(model->path_rate * hold->heading, -model->turn_limit, model->turn_limit);
}

/* Updates the corrections. */
static inline void hx_hold_update(const hxHoldModel *model, const hxHoldInput *seen, hxHold *hold) {
  if (model->posture) hold_posture(model, seen, hold);
  if (model->path) hold_path(model, seen, hold);
}

#endif
