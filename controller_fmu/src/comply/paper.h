/* paper.h - the paper's control: foot trajectories corrected by the forces on the feet. Python:
 * controller/comply/paper.py. */
#ifndef HX_PAPER_H
#define HX_PAPER_H

#include "../walk/kinematics.h"
#include "hexapod/inside.h"
#include "posture.h"
#include "slip_pid.h"
#include "suspension.h"

HX_HIDDEN_BEGIN

typedef struct hxPaperModel {
  hxParts parts;
  hxSlipPidModel pid; /* from N to m */
  hxSuspension suspension;
  double memory; /* 1, factor of the integral of a swinging foot over a period */
  double tracking; /* 1 */
  double farthest, deepest; /* m, largest shift and deflection */
} hxPaperModel;

typedef struct hxPaper {
  hxSlipPid x[HX_LEGS], y[HX_LEGS];
  hxPlane shift[HX_LEGS]; /* m, horizontal correction of a foot, walking frame */
  double lift[HX_LEGS], rate[HX_LEGS]; /* m, m/s, vertical correction */
} hxPaper;

void hx_paper_compile(const hxControllerDefinition *definition, hxPaperModel *model);

/* Computes the joint angles [rad] and speeds [rad/s] that put a foot on its corrected trajectory
 * (C49), and returns whether the foot misses it. The planned foot is in the walking frame. */
int hx_paper_actuate(const hxPaper *paper, const hxLegSolver *leg, int k, const hxPosture *posture,
                     hxPlane plane, double height, hxPlane velocity, double rise,
                     double angle[HX_JOINTS], double speed[HX_JOINTS]);

/* Advances the corrections by one period (C47, C48). force: of the ground on the feet, walking
 * frame [N]; swinging: legs planned in the air. */
void hx_paper_step(const hxPaperModel *model, const double force[HX_LEGS][3],
                   const int swinging[HX_LEGS], hxPaper *paper);

HX_HIDDEN_END

#endif
