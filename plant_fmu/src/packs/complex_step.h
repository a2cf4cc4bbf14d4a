/* complex_step.h - numbers with derivatives by the complex step (eq. 25), one leg at a time: hxReal
 * is the complex number x + i step x', instead of the pack of lanes.h
 *
 * (a + i h a')(b + i h b') = ab + i h (a b' + a' b) - h^2 a' b', and the last term vanishes at h =
 * 1e-170. Derivatives are therefore exact to rounding; no difference of values is taken.
 * Comparisons use the real part; at a kink the derivative is that of the side on which the value
 * is computed.
 */
#ifndef HX_COMPLEX_STEP_H
#define HX_COMPLEX_STEP_H

static const double hx_tangent_step = 1e-170;

typedef hxComplex hxReal, hxNumber;
typedef int64_t hxMask;

static inline double hx_re(hxComplex x) { return __real__ x; }
static inline double hx_im(hxComplex x) { return __imag__ x; }

static inline hxComplex hx_complex(double re, double im) {
  hxComplex x;
  __real__ x = re;
  __imag__ x = im;
  return x;
}

enum { HX_HAS_SLOPES = 1 };
static inline double hx_slope(hxComplex x) { return hx_im(x); }
static inline hxComplex hx_with_slope(double x, double slope) { return hx_complex(x, slope); }

static inline hxReal hx_load(const hxNumber *slots) { return slots[0]; }
static inline void hx_store(hxNumber *slots, hxReal x) { slots[0] = x; }
static inline hxReal hx_splat(hxNumber x) { return x; }
static inline hxNumber hx_lane(hxReal x, int lane) {
  (void)lane;
  return x;
}

static inline hxMask hx_less(hxReal a, hxReal b) { return hx_re(a) < hx_re(b) ? -1 : 0; }
static inline hxReal hx_select(hxMask mask, hxReal a, hxReal b) { return mask ? a : b; }
static inline hxReal hx_min(hxReal a, hxReal b) { return hx_select(hx_less(b, a), b, a); }
static inline hxReal hx_max(hxReal a, hxReal b) { return hx_select(hx_less(a, b), b, a); }
static inline hxReal hx_clip(hxReal x, hxReal low, hxReal high) {
  return hx_min(hx_max(x, low), high);
}
static inline hxReal hx_abs(hxReal x) { return hx_re(x) < 0.0 ? -x : x; }

/* Returns f(x) with its derivative, from the value and the slope at x. */
static inline hxReal hx_chain(hxReal x, double value, double slope) {
  return hx_complex(value, slope * hx_im(x));
}

static inline int hx_any(hxMask mask) { return mask != 0; }

/* The slope at 0 is set to 0, because all arguments of roots are squares. */
static inline hxReal hx_sqrt(hxReal x) {
  const double root = sqrt(fmax(hx_re(x), 0.0));
  return hx_chain(x, root, root > 0.0 ? 0.5 / root : 0.0);
}

static inline hxReal hx_tanh(hxReal x) {
  const double t = tanh(hx_re(x));
  return hx_chain(x, t, 1.0 - t * t);
}

static inline hxReal hx_tanh_ratio(hxReal x) { return hx_tanh(x) / x; }

static inline void hx_lanes_sin_cos(hxReal x, hxReal *sine, hxReal *cosine) {
  double s, c;
  hx_sin_cos(hx_re(x), &s, &c);
  *sine = hx_chain(x, s, c), *cosine = hx_chain(x, c, -s);
}

static inline hxNumber hx_atan2(hxNumber y, hxNumber x) {
  const double a = hx_re(x), b = hx_re(y), square = a * a + b * b;
  return hx_complex(atan2(b, a), (a * hx_im(y) - b * hx_im(x)) / square);
}

static inline hxNumber hx_asin(hxNumber x) {
  const double s = fmin(1.0, fmax(-1.0, hx_re(x))), cosine = sqrt(1.0 - s * s);
  return hx_chain(x, asin(s), cosine > 0.0 ? 1.0 / cosine : 0.0);
}

/* d x^y = y x^(y-1) dx + x^y ln x dy; 0 where x is 0. */
static inline hxReal hx_lanes_pow(hxReal x, hxReal y) {
  const double power = hx_pow(hx_re(x), hx_re(y));
  if (!(hx_re(x) > 0.0)) return power;
  return hx_complex(power, power * (hx_re(y) / hx_re(x) * hx_im(x) + hx_ln(hx_re(x)) * hx_im(y)));
}

static inline hxReal hx_expm1(hxReal x) {
  const double e = expm1(hx_re(x));
  return hx_chain(x, e, 1.0 + e);
}

static inline hxReal hx_angle_from_half(hxReal y, hxReal x) {
  const hxReal sign = hx_re(x) < 0.0 ? -1.0 : 1.0;
  return 2.0 * hx_atan2(sign * y, sign * x);
}

#endif
