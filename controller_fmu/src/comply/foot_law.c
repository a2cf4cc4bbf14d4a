#include "foot_law.h"

void hx_foot_law_compile(const hxControllerDefinition *definition, hxFootLawModel *model) {
  const hxGains *gains = &definition->gains;
  model->pid = (hxSlipPidModel){.h = definition->period,
                                .kp = gains->slip.kp,
                                .ki = gains->slip.ki,
                                .kd = gains->slip.kd,
                                .filter = gains->slip.filter_time,
                                .derivative = gains->slip.derivative_time};
  hx_suspension_discretise(gains->suspension.mass, gains->suspension.damping,
                           gains->suspension.stiffness, definition->period, &model->suspension);
  model->keep = hx_decay(-definition->period / gains->slip.load_time);
}

void hx_foot_law_step(const hxFootLawModel *model, hxPlane push, double excess, double load,
                      hxFootLaw *law) {
  const hxSuspension *s = &model->suspension;
  const double z = law->deflection, rate = law->rate;
  law->answer.x = hx_slip_pid_step(&model->pid, push.x, &law->x);
  law->answer.y = hx_slip_pid_step(&model->pid, push.y, &law->y);
  law->deflection = s->a[0][0] * z + s->a[0][1] * rate + s->b[0] * excess;
  law->rate = s->a[1][0] * z + s->a[1][1] * rate + s->b[1] * excess;
  law->load = model->keep * law->load + (1.0 - model->keep) * load;
}
