/* slip_pid.h - the law against slip: one discrete PID per foot and direction.
 * Python: controller/comply/slip_pid.py. */
#ifndef HX_SLIP_PID_H
#define HX_SLIP_PID_H

#include "../plane.h"
#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

typedef struct hxSlipPidModel {
  double h; /* s */
  double kp, ki, kd;
  double filter, derivative; /* s  T_f, T_d */
} hxSlipPidModel;

/* State of one PID, from the last period. */
typedef struct hxSlipPid {
  double force; /* N   e */
  double smooth; /* N   e', filtered */
  double integral; /* N */
  double slope; /* N   filtered derivative */
} hxSlipPid;

extern const double hx_load_floor; /* N, a foot with a smaller normal force carries no load */

/* Subtracts from the tangential forces on the feet [N] the part that pushes and turns the body as a
 * whole, shared by load (C24), in place; normal: forces on the feet [N]; feet: their positions [m].
 */
void hx_squeeze(const double normal[HX_LEGS], const hxPlane feet[HX_LEGS], hxPlane push[HX_LEGS]);

/* Returns the share of the planned squeeze that creep has taken away, in [0, 1] (C46); 0 without
 * planned squeeze. found: squeeze above the planned one [N]; planned [N]. */
double hx_missing_share(const hxPlane found[HX_LEGS], const hxPlane planned[HX_LEGS]);

/* Returns the PID's answer to a force in this period [N] (C25). */
double hx_slip_pid_step(const hxSlipPidModel *pid, double force, hxSlipPid *state);

HX_HIDDEN_END

#endif
