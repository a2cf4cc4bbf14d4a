/* paper.h - the paper's control: foot trajectories corrected by the deviations that the ground
 * causes. Python: controller/comply/paper.py. */
#ifndef HX_PAPER_H
#define HX_PAPER_H

#include "../walk/kinematics.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxPaperModel {
  double period; /* s */
  double servo_stiffness; /* N m/rad  kp of the servos */
  double ground_stiffness; /* N/m^1.5 */
  int pid, suspension, lifts; /* enabled parts; feet in the air are lifted */
  double share, height_share; /* 1, of this gait */
  double yield_share; /* 1 */
  double return_rate; /* 1/s */
  double damping; /* N s/m */
  double sag_limit, limit; /* m */
  double weighing, smoothing; /* 1, part of a new sum of loads and of a new force, per period */
  double landed, in_air, on_ground; /* 1, factors of a decay over a period */
} hxPaperModel;

typedef struct hxPaper {
  double force[HX_LEGS][3]; /* N, smoothed, torso axes */
  double total, weight; /* N, sum of the normal forces, and the same smoothed */
  hxPlane back; /* m, common return of all feet */
  double sag; /* m, height by which the torso sags at its centre */
  hxPlane slope; /* 1, of the sag */
  double lifted[HX_LEGS]; /* m, lift by the torso's sag */
  double yielded[HX_LEGS]; /* m, deflection of the suspensions; positive: the leg is shorter */
  double late[HX_LEGS]; /* s, time without force since the planned touch-down */
  hxPlane shift[HX_LEGS]; /* m, correction of a foot along the ground, torso axes */
  double lift[HX_LEGS]; /* m, correction upwards */
} hxPaper;

/* Plan and measurements of a period, torso frame. */
typedef struct hxPaperStep {
  const hxPose *pose; /* (6) planned */
  const double (*planned)[3]; /* m (6, 3) planned centres of the feet */
  double height[HX_LEGS]; /* m, of the planned feet above the ground */
  double rise[HX_LEGS]; /* m/s, of the planned feet */
  const int *swinging; /* (6) planned in the air */
  const double (*angle)[HX_JOINTS]; /* rad (6, 3) measured */
  double force[HX_LEGS][3]; /* N, measured, ground on foot */
} hxPaperStep;

void hx_paper_compile(const hxControllerDefinition *definition, hxPaperModel *model);

/* Advances the corrections by one period (C25, C26, C47 to C49). */
void hx_paper_step(const hxPaperModel *model, const hxLegSolver leg[HX_LEGS],
                   const hxPaperStep *step, hxPaper *paper);

/* Computes the joint angles [rad] and speeds [rad/s] that put a foot on its corrected trajectory
 * (C49), and returns whether the foot misses it. The planned foot is in the torso frame. */
int hx_paper_actuate(const hxPaper *paper, const hxLegSolver *leg, int k, hxPlane plane,
                     double height, hxPlane velocity, double rise, double angle[HX_JOINTS],
                     double speed[HX_JOINTS]);

HX_HIDDEN_END

#endif
