#include "slip_pid.h"

double hx_slip_pid_step(const hxSlipPidModel *pid, double force, hxSlipPid *state) {
  const double h = pid->h, tf = pid->filter, td = pid->derivative, old = state->smooth;
  /* e' = (h (e + e-) + (2 T_f - h) e'-)/(2 T_f + h) */
  state->smooth = (h * (force + state->force) + (2.0 * tf - h) * old) / (2.0 * tf + h);
  /* i = i- + k_i h/2 (e' + e'-) */
  state->integral += 0.5 * h * pid->ki * (state->smooth + old);
  /* d = (2 k_d (e' - e'-) + (2 T_d - h) d-)/(2 T_d + h) */
  state->slope =
      (2.0 * pid->kd * (state->smooth - old) + (2.0 * td - h) * state->slope) / (2.0 * td + h);
  state->force = force;
  /* u = k_p e' + i + d */
  return pid->kp * state->smooth + state->integral + state->slope;
}
