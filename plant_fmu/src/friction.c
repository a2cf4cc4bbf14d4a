#include "friction.h"

/* tanh(k v) / v -> k at rest, where the series k (1 - (k v)^2 / 3) is exact below k v = 1e-5 */
static hxReal tanh_law(const hxModel *model, hxReal speed) {
  const hxReal x = model->slope * speed;
  const hxMask slow = hx_less(x, hx_splat(1e-5));
  const hxReal safe = hx_select(slow, hx_splat(1.0), x);
  return model->slope * hx_select(slow, 1.0 - x * x * (1.0 / 3.0), hx_tanh(safe) / safe);
}

static hxReal none(const hxModel *model, hxReal speed) {
  (void)model;
  (void)speed;
  return hx_splat(0.0);
}

static const hxFrictionRow friction_rows[] = {
    [HX_FRICTION_TANH] = {tanh_law},
    [HX_FRICTION_NONE] = {none},
};

HX_LOCAL const hxFrictionRow *hx_friction(int law) {
  return law >= 1 && law < (int)(sizeof friction_rows / sizeof friction_rows[0]) ? &friction_rows[law] : NULL;
}
