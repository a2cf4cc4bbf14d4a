/* friction.h - f_t = -mu f_n g(|v_t|) v_t, g = the law's saturation over speed (eq. 5: tanh(k_t v) / v) */
#ifndef HX_FRICTION_H
#define HX_FRICTION_H

#include "state.h"
#include "vec3.h"

/* One row per hxFrictionLaw; the only place a law is chosen. */
typedef struct {
  hxReal (*per_speed)(const hxModel *model, hxReal speed); /* g, s/m, with its limit at rest */
} hxFrictionRow;

HX_LOCAL const hxFrictionRow *hx_friction(int law); /* NULL when there is no such law */

#endif
