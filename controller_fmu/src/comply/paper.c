#include "paper.h"

#include "../plane.h"

void hx_paper_compile(const hxControllerDefinition *definition, hxPaperModel *model) {
  const hxGains *gains = &definition->gains;
  model->parts = definition->parts;
  model->pid = (hxSlipPidModel){.h = definition->period,
                                .kp = gains->paper_slip.kp,
                                .ki = gains->paper_slip.ki,
                                .kd = gains->paper_slip.kd,
                                .filter = gains->paper_slip.filter_time,
                                .derivative = gains->paper_slip.derivative_time};
  hx_suspension_discretise(gains->paper_suspension.mass, gains->paper_suspension.damping,
                           gains->paper_suspension.stiffness, definition->period,
                           &model->suspension);
  model->memory = hx_decay(-definition->period / gains->paper_slip.load_time);
  model->tracking = fmin(definition->period / gains->paper_slip.tracking_time, 1.0);
  model->farthest = gains->paper_slip.limit;
  model->deepest = gains->paper_suspension.limit;
}

/* Updates the shift of a foot for a tangential force [N] (C47). The length of the shift is limited,
 * and its integral follows the limited value; that of a swinging foot decays. */
static void yield_sideways(const hxPaperModel *model, hxPlane force, int swinging, int k,
                           hxPaper *paper) {
  const hxPlane wanted = {hx_slip_pid_step(&model->pid, force.x, &paper->x[k]),
                          hx_slip_pid_step(&model->pid, force.y, &paper->y[k])};
  const double kept = swinging ? model->memory : 1.0;
  const hxPlane shift =
      hx_scaled(wanted, model->farthest / fmax(hx_length(wanted), model->farthest));
  paper->shift[k] = shift;
  paper->x[k].integral = kept * (paper->x[k].integral + model->tracking * (shift.x - wanted.x));
  paper->y[k].integral = kept * (paper->y[k].integral + model->tracking * (shift.y - wanted.y));
}

/* Updates the deflection of a suspension for a normal force [N] (C48). */
static void yield_upwards(const hxPaperModel *model, double force, int k, hxPaper *paper) {
  const hxSuspension *s = &model->suspension;
  const double z = paper->lift[k], rate = paper->rate[k],
               lift = s->a[0][0] * z + s->a[0][1] * rate + s->b[0] * force;
  paper->rate[k] = s->a[1][0] * z + s->a[1][1] * rate + s->b[1] * force;
  if (fabs(lift) > model->deepest) paper->rate[k] = 0.0;
  paper->lift[k] = hx_clamp(lift, -model->deepest, model->deepest);
}

int hx_paper_actuate(const hxPaper *paper, const hxLegSolver *leg, int k, const hxPosture *posture,
                     hxPlane plane, double height, hxPlane velocity, double rise,
                     double angle[HX_JOINTS], double speed[HX_JOINTS]) {
  hxPlane corrected = hx_plane_add(plane, paper->shift[k]);
  double raised = height + paper->lift[k];
  hxPose pose;
  hx_posture_see_place(posture, &corrected, &raised);
  hx_leg_solver_pose(leg, corrected, raised, &pose);
  hx_posture_see(posture, &plane, &height, &velocity, &rise);
  return hx_leg_solver_solve(leg, &pose, velocity, rise, angle, speed);
}

void hx_paper_step(const hxPaperModel *model, const double force[HX_LEGS][3],
                   const int swinging[HX_LEGS], hxPaper *paper) {
  for (int k = 0; k < HX_LEGS; ++k) {
    if (model->parts.slip_pid)
      yield_sideways(model, hx_plane(force[k][0], force[k][1]), swinging[k], k, paper);
    if (model->parts.paper_suspension) yield_upwards(model, force[k][2], k, paper);
  }
}
