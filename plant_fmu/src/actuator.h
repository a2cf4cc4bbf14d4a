/* actuator.h - the servo of a joint: PD with feed-forward, torque-speed line, gear friction */
#ifndef HX_ACTUATOR_H
#define HX_ACTUATOR_H

#include "state.h"
#include "vec3.h"

typedef struct {
  hxReal torque;    /* N m        motor on child */
  hxReal friction;  /* N m        gear on child */
  hxReal stiffness; /* N m/rad    -d torque/d angle, 0 where the torque is clipped */
  hxReal damping;   /* N m s/rad  -d (torque + friction)/d speed */
} hxServo;

/* motor: clip(kp (q_ref - q) + kd (qd_ref - qd) + tau_ff) to the torque-speed line; gear: -tau_c tanh(qd / 0.05) (eq. 13) */
HX_LOCAL hxServo hx_servo_torque(const hxModel *model, hxReal angle, hxReal speed, hxReal angle_ref, hxReal speed_ref, hxReal torque_ref);

#endif
