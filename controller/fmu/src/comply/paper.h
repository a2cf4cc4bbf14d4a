/* paper.h - the paper's control: foot trajectories corrected by the deviations that the ground
 * causes. Python: controller/comply/paper.py. */
#ifndef HX_PAPER_H
#define HX_PAPER_H

#include "../plane.h"
#include "../walk/kinematics.h"
#include "load_plan.h"

typedef struct hxPaperModel {
  double period;              /* s */
  double servo_stiffness;     /* N m/rad  kp of the servos */
  double ground_stiffness;    /* N/m^1.5 */
  int pid, suspension, lifts; /* enabled parts; feet in the air are lifted */
  double share, height_share; /* 1  of this gait */
  double yield_share;         /* 1 */
  double return_rate;         /* 1/s */
  double damping;             /* N s/m */
  double sag_limit, limit;    /* m */
  double weighing, smoothing; /* 1  part of a new sum of loads and of a new force, per period */
  double landed, in_air, on_ground; /* 1  factors of a decay over a period */
} hxPaperModel;

typedef struct hxPaper {
  double force[HX_LEGS][3]; /* N  smoothed, torso axes */
  double weight;            /* N  smoothed sum of the normal forces */
  hxPlane back;             /* m  common return of all feet */
  double sag;               /* m  height by which the torso sags at its centre */
  hxPlane slope;            /* 1  of the sag */
  double lifted[HX_LEGS];   /* m  lift by the torso's sag */
  double yielded[HX_LEGS];  /* m  deflection of the suspensions; positive: the leg is shorter */
  double late[HX_LEGS];     /* s  time without force since the planned touch-down */
  hxPlane shift[HX_LEGS];   /* m  correction of a foot along the ground, torso axes */
  double lift[HX_LEGS];     /* m  correction upwards */
} hxPaper;

/* Plan and measurements of a period, torso frame. */
typedef struct hxPaperStep {
  const hxPose *pose;               /* (6) planned */
  const double (*planned)[3];       /* m (6, 3) planned centres of the feet */
  double height[HX_LEGS];           /* m  of the planned feet above the ground */
  double rise[HX_LEGS];             /* m/s  of the planned feet */
  const int *swinging;              /* (6) planned in the air */
  const double (*angle)[HX_JOINTS]; /* rad (6, 3) measured */
  double force[HX_LEGS][3];         /* N  measured, ground on foot */
} hxPaperStep;

/* 1  of the weight: what a foot carries beyond is not taken back */
static const double largest_part = 0.5;
static const double weight_time = 0.5;   /* s  smoothing of the sum of all loads */
static const double contact_part = 0.02; /* 1  of the weight: a foot with more stands */
/* 1  of the weight: with less in all, the force of some foot is not reported */
static const double whole_part = 0.9;
/* 1  added to the spread of the standing feet, for the tilt of the torso */
static const double evening = 0.15;
/* s  in which a landed foot gives back the lift that it had in the air */
static const double landed_time = 0.05;
/* m  a foot that is planned higher above the ground meets it early */
static const double early_height = 0.003;
static const double late_time = 0.04;    /* s  after the planned touch-down: a foot may be late */
static const double search_speed = 0.08; /* m/s  at most, of a foot that extends */
static const double air_time = 0.06; /* s  in which the suspension of a foot in the air returns */

static inline void hx_paper_compile(const hxControllerDefinition *definition, hxPaperModel *model) {
  const double h = definition->period, duty = definition->gait.duty;
  /* the torque that a share costs grows with the square of the load, W/(6 duty) on average */
  const double factor = definition->parts.paper_share ? (2.0 * duty) * (2.0 * duty) : 0.0;
  model->period = h;
  model->servo_stiffness = definition->servo.kp;
  model->ground_stiffness = definition->contact_stiffness;
  model->pid = definition->parts.paper_pid;
  model->suspension = definition->parts.paper_suspension;
  model->lifts = definition->parts.paper_share;
  model->share = fmin(factor * definition->gains.paper.share, definition->gains.paper.share_limit);
  model->height_share =
      fmin(factor * definition->gains.paper.height_share, definition->gains.paper.share_limit);
  model->yield_share = definition->gains.paper.yield_share;
  model->return_rate = definition->gains.paper.return_rate;
  model->damping = definition->gains.paper.damping;
  model->sag_limit = definition->gains.paper.sag_limit;
  model->limit = definition->gains.paper.limit;
  model->weighing = -hx_growth(-h / weight_time);
  model->smoothing = -hx_growth(-h / definition->gains.paper.filter_time);
  model->landed = hx_decay(-h / landed_time);
  model->in_air = hx_decay(-h / air_time);
  model->on_ground = hx_decay(-h / definition->gains.paper.return_time);
}

/* Updates the torso's sag and the return of the feet by the standing feet (C26, C47). load:
 * smoothed normal forces [N]. */
static inline void update_torso(const hxPaperModel *model, const hxLegSolver leg[HX_LEGS],
                                const hxPaperStep *step, const double load[HX_LEGS],
                                hxPaper *paper) {
  double part[HX_LEGS], sunk[HX_LEGS], total = 0.0, mean = 0.0, spread = 0.0;
  hxPlane feet[HX_LEGS], centre = {0.0, 0.0}, astray = {0.0, 0.0};
  hxPlane skew = {0.0, 0.0}, moment = {0.0, 0.0}, slope = {0.0, 0.0};
  for (int k = 0; k < HX_LEGS; ++k) total += step->swinging[k] ? 0.0 : load[k];
  if (total <= least_load) return;
  for (int k = 0; k < HX_LEGS; ++k) {
    const double *planned = step->planned[k];
    double foot[3];
    hx_leg_solver_forward(&leg[k], step->angle[k], foot);
    part[k] = (step->swinging[k] ? 0.0 : load[k]) / total;
    sunk[k] =
        foot[2] - planned[2] - paper->yielded[k] + hx_indentation(load[k], model->ground_stiffness);
    feet[k] = hx_plane(planned[0], planned[1]);
    centre = hx_plane_add(centre, hx_scaled(feet[k], part[k]));
    mean += part[k] * sunk[k];
    astray = hx_plane_add(astray,
                          hx_scaled(hx_plane(foot[0] - planned[0], foot[1] - planned[1]), part[k]));
  }
  /* least squares: slope g of sum part (Re(arm^* g) - (sunk - mean))^2 */
  for (int k = 0; k < HX_LEGS; ++k) {
    const hxPlane arm = hx_plane_sub(feet[k], centre);
    spread += part[k] * hx_square(arm);
    skew = hx_plane_add(skew, hx_scaled(hx_times(arm, arm), 0.5 * part[k]));
    moment = hx_plane_add(moment, hx_scaled(arm, part[k] * (sunk[k] - mean)));
  }
  if (spread > 0.0) {
    const double even = (0.5 + evening) * spread;
    slope = hx_scaled(hx_plane_sub(hx_scaled(moment, even), hx_times(skew, hx_conj(moment))),
                      1.0 / (even * even - hx_square(skew)));
  }
  paper->sag += model->smoothing * (mean - hx_along(centre, slope) - paper->sag);
  paper->slope =
      hx_plane_add(paper->slope, hx_scaled(hx_plane_sub(slope, paper->slope), model->smoothing));
  if (!model->pid) return;
  const hxPlane back =
      hx_plane_sub(paper->back, hx_scaled(astray, model->period * model->return_rate));
  paper->back = hx_scaled(back, model->limit / fmax(hx_length(back), model->limit));
}

/* Returns the correction of a foot along the ground [m] (C47). borne: normal force whose deviation
 * is taken back [N]. */
static inline hxPlane along_ground(const hxPaperModel *model, const hxPaper *paper,
                                   const hxPose *pose, const hxSoftness *soft, int swinging, int k,
                                   double borne) {
  hxPlane shift = hx_scaled(pose->heading, -model->share * soft->splay * borne);
  if (model->pid) {
    const hxPlane pull =
        hx_times(hx_plane(paper->force[k][0], paper->force[k][1]), hx_conj(pose->heading));
    /* a standing foot keeps the outward force, which carries a part of the weight */
    const hxPlane yield = {swinging ? soft->outward * pull.x : 0.0, soft->sideward * pull.y};
    shift = hx_plane_add(shift, hx_scaled(hx_times(yield, pose->heading), model->yield_share));
  }
  return hx_plane_add(shift, paper->back);
}

/* Updates the lift of a foot in the air by the torso's sag (C48). */
static inline void lift_swinging(const hxPaperModel *model, const double planned[3], int swinging,
                                 int k, hxPaper *paper) {
  const double sunk = paper->sag + hx_along(hx_plane(planned[0], planned[1]), paper->slope);
  const double wanted = hx_clamp(sunk, -model->sag_limit, model->sag_limit);
  if (swinging)
    paper->lifted[k] += model->smoothing * (wanted - paper->lifted[k]);
  else
    paper->lifted[k] *= model->landed;
}

/* Updates the deflection of a suspension (C48). total: of the normal forces [N]. */
static inline void suspend(const hxPaperModel *model, const hxPaperStep *step, double total, int k,
                           hxPaper *paper) {
  const double h = model->period, force = step->force[k][2];
  const int contact = force > fmax(contact_part * paper->weight, least_load);
  const int swinging = step->swinging[k];
  /* the damper yields to the force beyond the share of a foot */
  const double rate = (force - paper->weight / HX_LEGS) / model->damping;
  const int missing = !contact && !swinging && total >= whole_part * paper->weight;
  paper->late[k] = missing ? paper->late[k] + h : 0.0;
  if (paper->late[k] > late_time)
    paper->yielded[k] += h * hx_clamp(rate, -search_speed, 0.0);
  else if (swinging && contact)
    paper->yielded[k] +=
        h * hx_clamp(rate, 0.0, step->height[k] > early_height ? fmax(-step->rise[k], 0.0) : 0.0);
  else
    paper->yielded[k] *= swinging ? model->in_air : model->on_ground;
  paper->yielded[k] = hx_clamp(paper->yielded[k], -model->limit, model->limit);
}

/* Advances the corrections by one period (C25, C26, C47 to C49). */
static inline void hx_paper_step(const hxPaperModel *model, const hxLegSolver leg[HX_LEGS],
                                 const hxPaperStep *step, hxPaper *paper) {
  double load[HX_LEGS], total = 0.0;
  for (int k = 0; k < HX_LEGS; ++k) {
    for (int i = 0; i < 3; ++i)
      paper->force[k][i] += model->smoothing * (step->force[k][i] - paper->force[k][i]);
    load[k] = fmax(paper->force[k][2], 0.0);
    total += fmax(step->force[k][2], 0.0);
  }
  paper->weight += (paper->weight > 0.0 ? model->weighing : 1.0) * (total - paper->weight);
  update_torso(model, leg, step, load, paper);
  for (int k = 0; k < HX_LEGS; ++k) {
    const int swinging = step->swinging[k];
    const hxSoftness soft = hx_leg_solver_softness(&leg[k], &step->pose[k], model->servo_stiffness);
    const double borne = fmin(load[k], largest_part * paper->weight);
    if (model->lifts) lift_swinging(model, step->planned[k], swinging, k, paper);
    if (model->suspension) suspend(model, step, total, k, paper);
    paper->shift[k] = along_ground(model, paper, &step->pose[k], &soft, swinging, k, borne);
    paper->lift[k] = paper->lifted[k] + paper->yielded[k] - model->height_share * soft.up * borne;
  }
}

/* Computes the joint angles [rad] and speeds [rad/s] that put a foot on its corrected trajectory
 * (C49), and returns whether the foot misses it. The planned foot is in the torso frame. */
static inline int hx_paper_actuate(const hxPaper *paper, const hxLegSolver *leg, int k,
                                   hxPlane plane, double height, hxPlane velocity, double rise,
                                   double angle[HX_JOINTS], double speed[HX_JOINTS]) {
  hxPose pose;
  hx_leg_solver_pose(leg, hx_plane_add(plane, paper->shift[k]), height + paper->lift[k], &pose);
  return hx_leg_solver_solve(leg, &pose, velocity, rise, angle, speed);
}

#endif
