/* friction.h - friction of a contact over its normal load: sliding by the tanh law (eq. 15, 35),
 * bristles (eq. 16-18), LuGre (eq. 36, 37), and the moments of spin and rolling (eq. 38) */
#ifndef HX_FRICTION_H
#define HX_FRICTION_H

#include "../packs/vec3.h"

/* Tangential force of a foot with bristles (eq. 16-18, 36, 37). */
typedef struct {
  hxVec3 traction;   /* 1    -f_t over f_n */
  hxVec3 rate;       /* m/s  db/dt */
  hxReal stiffness;  /* 1/m  traction over b (secant) */
  hxReal damping;    /* s/m  derivative of traction by db/dt */
  hxReal relaxation; /* 1/s  beta of eq. 21: derivative of db/dt by -b */
} hxGrip;

/* Moment of spin and rolling friction over the normal force (eq. 38). */
typedef struct {
  hxVec3 moment;     /* m      moment on the body over f_n */
  hxReal spin, roll; /* m s    moment over angular speed, about the normal and across it */
} hxTurningFriction;

/* Friction coefficients of a contact. */
typedef struct {
  hxReal mu, static_rise; /* 1  kinetic coefficient; static one less the kinetic one */
} hxFrictionAt;

static const double spring_limit = 0.7;  /* 1  of the presliding: bristles below are springs */
static const double no_friction = 1e-30; /* 1  keeps ratios of coefficients finite at mu = 0 */

/* Returns mu(p) = mu + (mu_s - mu)/(1 + (p/v_s)^2) at a sliding speed p (eq. 18). */
HX_INLINE hxReal hx_stribeck_curve(const hxModel *model, hxFrictionAt at, hxReal speed) {
  const hxReal x = hx_splat(model->per_stribeck) * speed;
  return at.mu + at.static_rise / (1.0 + x * x);
}

/* Returns tanh(k_t v) / v, whose limit at rest is k_t. The series k_t (1 - (k_t v)^2 / 3) is exact
 * below k_t v = 1e-5. */
HX_INLINE hxReal hx_regularised_direction(const hxModel *model, hxReal speed) {
  const hxReal x = model->slope * speed;
  const hxMask slow = hx_less(x, hx_splat(1e-5));
  return model->slope * hx_select(slow, 1.0 - x * x * (1.0 / 3.0),
                                  hx_tanh_ratio(hx_select(slow, hx_splat(1.0), x)));
}

/* Returns g of f_t = -mu f_n g(|v_t|) v_t (eq. 15). A further law without bristles needs here its
 * function above and a case. */
HX_INLINE hxReal hx_friction_direction(const hxModel *model, hxReal speed) {
  switch (model->friction_law) {
  case HX_FRICTION_NONE:
    return hx_splat(0.0);
  default:
    return hx_regularised_direction(model, speed);
  }
}

/* Returns the tanh law's tangential force over load and slip speed, s/m (eq. 15, 35):
 * mu(v) tanh(k_t v)/v + viscous. The plain law, mu_static = viscous = 0, needs no division more. */
HX_INLINE hxReal hx_friction_drag(const hxModel *model, hxFrictionAt at, hxReal speed) {
  if (!model->velocity_terms) return at.mu * hx_friction_direction(model, speed);
  return hx_stribeck_curve(model, at, speed) * hx_friction_direction(model, speed) + model->viscous;
}

/* Elasto-plastic bristles (eq. 16, 17) with u = b/b_max in the unit disc: db/dt = v - Y (v.u)+
 * u/|u|.
 *
 * The friction force is the share w = u (3 - u.u)/2 + d room/|(room, d)| of mu f_n, with the
 * damping d = 3/2 tau db/dt / b_max. The spring leaves room = 1 - |u| (3 - u.u)/2 to the damping,
 * so that w stays within the disc too, and w is C1 at |u| = 1, where a foot slides.
 *
 * The friction coefficient falls with the sliding speed p of the bristles: mu(p) = mu + (mu_s -
 * mu)/(1 + (p/v_s)^2) (eq. 18). The viscous part of eq. 35 is added.
 */
HX_INLINE hxGrip hx_bristle_friction(const hxModel *model, hxFrictionAt at, hxReal closed, hxVec3 b,
                                     hxVec3 slip) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  const hxNumber per_length = 1.0 / model->presliding;
  const hxVec3 u = hx_scale(hx_splat(per_length), b);
  const hxReal size = hx_sqrt(hx_dot(u, u)), within = hx_min(size, one);
  const hxReal s = hx_clip((size - spring_limit) * (1.0 / (1.0 - spring_limit)), zero, one);
  const hxReal release_rate = s * s * (3.0 - 2.0 * s) * hx_max(hx_dot(slip, u), zero) /
                              hx_max(size, hx_splat(spring_limit));
  const hxVec3 rate = hx_scale(closed, hx_add_scaled(slip, -release_rate, u));
  const hxVec3 d = hx_scale(hx_splat(1.5 * model->bristle_damping * per_length), rate);
  const hxReal spring = (1.5 - 0.5 * within * within) / hx_max(size, one);
  const hxReal room = 1.0 - spring * size;
  /* 1e-30: without room and motion the share is 0, not 0/0 */
  const hxReal share = room / hx_sqrt(room * room + hx_dot(d, d) + 1e-30);
  const hxVec3 w = hx_add_scaled(hx_scale(spring, u), share, d);
  const hxReal mu = hx_stribeck_curve(model, at, release_rate * size);
  return (hxGrip){
      .traction = hx_add_scaled(hx_scale(mu, w), hx_splat(model->viscous), slip),
      .rate = rate,
      .stiffness = (mu * per_length) * spring,
      .damping = (1.5 * mu * model->bristle_damping * per_length) * share + model->viscous,
      .relaxation = per_length * release_rate,
  };
}

/* The LuGre law (eq. 36, 37): db/dt = v - |v| mu_0/mu(|v|) b/b_max, and the friction over load is
 * mu_0 b/b_max + sigma db/dt + viscous v. sigma falls with the speed, so that the law dissipates
 * and bristles in steady motion keep the force within mu(|v|) f_n. */
HX_INLINE hxGrip hx_lugre_friction(const hxModel *model, hxFrictionAt at, hxReal closed, hxVec3 b,
                                   hxVec3 slip) {
  const hxReal rest = at.mu + at.static_rise, stiffness = rest / model->presliding;
  const hxReal still_damping = stiffness * model->bristle_damping;
  const hxReal speed = hx_sqrt(hx_dot(slip, slip));
  const hxReal per_mu = 1.0 / (hx_stribeck_curve(model, at, speed) + no_friction);
  const hxReal release = speed * ((rest + no_friction) / model->presliding) * per_mu;
  const hxReal damping = still_damping / (1.0 + still_damping * speed * per_mu);
  const hxVec3 rate = hx_scale(closed, hx_add_scaled(slip, -release, b));
  const hxVec3 grip = hx_add_scaled(hx_scale(stiffness, b), damping, rate);
  return (hxGrip){
      .traction = hx_add_scaled(grip, hx_splat(model->viscous), slip),
      .rate = rate,
      .stiffness = stiffness,
      .damping = damping + model->viscous,
      .relaxation = release,
  };
}

/* Chooses the law of bristles: what a further law needs here is its function above and a case. */
HX_INLINE hxGrip hx_friction_grip(const hxModel *model, hxFrictionAt at, hxReal closed, hxVec3 b,
                                  hxVec3 slip) {
  return model->friction_law == HX_FRICTION_LUGRE ? hx_lugre_friction(model, at, closed, b, slip)
                                                  : hx_bristle_friction(model, at, closed, b, slip);
}

/* Returns the moment over the load of spin about the normal and of rolling across it (eq. 38), at
 * the angular velocity w of a body whose sphere touches the ground. */
HX_INLINE hxTurningFriction hx_turning_moment(const hxModel *model, hxFrictionAt at, hxReal radius,
                                              hxVec3 normal, hxVec3 w) {
  const hxReal spin = hx_dot(normal, w);
  const hxVec3 roll = hx_add_scaled(w, -spin, normal);
  hxTurningFriction f = {hx_zero3(), hx_splat(0.0), hx_splat(0.0)};
  if (model->spin_friction) {
    const hxReal speed = radius * hx_abs(spin);
    f.spin = model->spin_radius * radius * hx_stribeck_curve(model, at, speed) *
             hx_friction_direction(model, speed);
  }
  if (model->roll_friction) {
    const hxReal speed = radius * hx_sqrt(hx_dot(roll, roll));
    f.roll = model->rolling_radius * radius * hx_friction_direction(model, speed);
  }
  f.moment = hx_add_scaled(hx_scale(-f.roll, roll), -f.spin * spin, normal);
  return f;
}

#endif
