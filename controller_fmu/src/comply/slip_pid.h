/* slip_pid.h - the slip PID of the paper's control, one per foot and direction (C25).
 * Python: controller/comply/slip_pid.py. */
#ifndef HX_SLIP_PID_H
#define HX_SLIP_PID_H

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

/* Returns the PID's answer to a force in this period [N] (C25). */
double hx_slip_pid_step(const hxSlipPidModel *pid, double force, hxSlipPid *state);

HX_HIDDEN_END

#endif
