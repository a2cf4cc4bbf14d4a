#include "slip_pid.h"

const double hx_load_floor = 1e-6;
/* m2, of the feet about their centre: feet that are closer take no moment about the vertical */
static const double least_spread = 1e-4;

void hx_squeeze(const double normal[HX_LEGS], const hxPlane feet[HX_LEGS], hxPlane push[HX_LEGS]) {
  double total = 0.0, spread = 0.0, moment = 0.0, share[HX_LEGS];
  hxPlane arm[HX_LEGS], common = {0.0, 0.0}, centre = {0.0, 0.0};
  for (int leg = 0; leg < HX_LEGS; ++leg) total += normal[leg];
  if (total <= hx_load_floor) return;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    share[leg] = normal[leg] / total;
    common = hx_plane_add(common, push[leg]);
    centre = hx_plane_add(centre, hx_scaled(feet[leg], share[leg]));
  }
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    arm[leg] = hx_plane_sub(feet[leg], centre);
    spread += share[leg] * hx_square(arm[leg]);
    moment += hx_across(arm[leg], push[leg]);
  }
  /* e = d - (n / sum n) (D + i w (p - c)) */
  const double w = spread < least_spread ? 0.0 : moment / spread;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    push[leg] = hx_plane_sub(
        push[leg],
        hx_scaled(hx_plane_add(common, hx_plane(-w * arm[leg].y, w * arm[leg].x)), share[leg]));
}

double hx_missing_share(const hxPlane found[HX_LEGS], const hxPlane planned[HX_LEGS]) {
  double whole = 0.0, present = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    whole += hx_square(planned[leg]);
    present += hx_along(planned[leg], found[leg]);
  }
  return whole <= hx_load_floor ? 0.0 : hx_clamp(-present / whole, 0.0, 1.0);
}

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
