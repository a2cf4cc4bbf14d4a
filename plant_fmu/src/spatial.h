/* spatial.h - motions, forces and inertias of a rigid body, angular part first, world axes, at a named point */
#ifndef HX_SPATIAL_H
#define HX_SPATIAL_H

#include "vec3.h"

typedef struct { hxVec3 ang, lin; } hxMotion6; /* angular and linear acceleration (or velocity, or increment) */
typedef struct { hxVec3 ang, lin; } hxForce6;  /* torque and force */

/* [ C  H ; H^T  A ]: torque = C ang + H lin, force = H^T ang + A lin */
typedef struct { hxSym3 C; hxMat3 H; hxSym3 A; } hxInertia6;

static inline hxInertia6 hx_rigid_inertia(hxReal mass, hxSym3 J) {
  const hxReal o = hx_splat(0.0);
  return (hxInertia6){J, {{o, o, o}, {o, o, o}, {o, o, o}}, {mass, mass, mass, o, o, o}};
}

static inline hxForce6 hx_inertia_mul(const hxInertia6 *I, hxMotion6 a) {
  return (hxForce6){hx_add(hx_sym_mul(I->C, a.ang), hx_mul(I->H, a.lin)), hx_add(hx_tmul(I->H, a.ang), hx_sym_mul(I->A, a.lin))};
}

static inline hxReal hx_power(hxForce6 f, hxMotion6 v) { return hx_dot(f.ang, v.ang) + hx_dot(f.lin, v.lin); }

static inline hxForce6 hx_force_add(hxForce6 a, hxForce6 b) { return (hxForce6){hx_add(a.ang, b.ang), hx_add(a.lin, b.lin)}; }

static inline hxForce6 hx_force_add_scaled(hxForce6 a, hxReal s, hxForce6 b) {
  return (hxForce6){hx_add_scaled(a.ang, s, b.ang), hx_add_scaled(a.lin, s, b.lin)};
}

static inline hxMotion6 hx_motion_add_scaled(hxMotion6 a, hxReal s, hxMotion6 b) {
  return (hxMotion6){hx_add_scaled(a.ang, s, b.ang), hx_add_scaled(a.lin, s, b.lin)};
}

/* I - s U U^T */
static inline void hx_inertia_downdate(hxInertia6 *I, hxReal s, hxForce6 U) {
  const hxVec3 a = hx_scale(s, U.ang), l = hx_scale(s, U.lin);
  I->C.xx -= a.x * U.ang.x, I->C.yy -= a.y * U.ang.y, I->C.zz -= a.z * U.ang.z;
  I->C.xy -= a.x * U.ang.y, I->C.xz -= a.x * U.ang.z, I->C.yz -= a.y * U.ang.z;
  I->H.x = hx_add_scaled(I->H.x, -a.x, U.lin);
  I->H.y = hx_add_scaled(I->H.y, -a.y, U.lin);
  I->H.z = hx_add_scaled(I->H.z, -a.z, U.lin);
  I->A.xx -= l.x * U.lin.x, I->A.yy -= l.y * U.lin.y, I->A.zz -= l.z * U.lin.z;
  I->A.xy -= l.x * U.lin.y, I->A.xz -= l.x * U.lin.z, I->A.yz -= l.y * U.lin.z;
}

/* X a of eq. 10: the motion of a parent carried to a child, lin + e x ang... with e = s_j^P - s_i^P */
static inline hxMotion6 hx_carry_motion(hxVec3 e, hxMotion6 a) {
  return (hxMotion6){a.ang, hx_add(a.lin, hx_cross(e, a.ang))};
}

/* X^T f: a force on a child carried to its parent */
static inline hxForce6 hx_carry_force(hxVec3 e, hxForce6 f) {
  return (hxForce6){hx_sub(f.ang, hx_cross(e, f.lin)), f.lin};
}

/* E b with E = skew(e), applied to each row of M from the right: M E */
static inline hxMat3 hx_mul_skew(hxMat3 M, hxVec3 e) {
  return (hxMat3){hx_cross(M.x, e), hx_cross(M.y, e), hx_cross(M.z, e)};
}

static inline hxMat3 hx_sym_full(hxSym3 S) {
  return (hxMat3){{S.xx, S.xy, S.xz}, {S.xy, S.yy, S.yz}, {S.xz, S.yz, S.zz}};
}

static inline hxMat3 hx_transpose(hxMat3 M) {
  return (hxMat3){{M.x.x, M.y.x, M.z.x}, {M.x.y, M.y.y, M.z.y}, {M.x.z, M.y.z, M.z.z}};
}

/* X^T I X with X = [1 0; E 1]: A' = A, H' = H + E^T A, C' = C + H E + (H E)^T + E^T A E */
static inline hxInertia6 hx_carry_inertia(hxVec3 e, const hxInertia6 *I) {
  const hxMat3 AE = hx_mul_skew(hx_sym_full(I->A), e); /* (E^T A)^T = A E */
  const hxMat3 EtA = hx_transpose(AE);
  const hxMat3 HE = hx_mul_skew(I->H, e);
  const hxMat3 EtAE = hx_mul_skew(EtA, e);
  hxInertia6 out = *I;
  out.H = (hxMat3){hx_add(I->H.x, EtA.x), hx_add(I->H.y, EtA.y), hx_add(I->H.z, EtA.z)};
  out.C.xx += 2.0 * HE.x.x + EtAE.x.x;
  out.C.yy += 2.0 * HE.y.y + EtAE.y.y;
  out.C.zz += 2.0 * HE.z.z + EtAE.z.z;
  out.C.xy += (HE.x.y + HE.y.x) + EtAE.x.y;
  out.C.xz += (HE.x.z + HE.z.x) + EtAE.x.z;
  out.C.yz += (HE.y.z + HE.z.y) + EtAE.y.z;
  return out;
}

#endif
