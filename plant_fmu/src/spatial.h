/* spatial.h - motions, forces and inertias of a rigid body, angular part first, world axes, at a named point */
#ifndef HX_SPATIAL_H
#define HX_SPATIAL_H

#include "vec3.h"

typedef struct {
  hxVec3 ang, lin;
} hxMotion6; /* angular and linear acceleration (or velocity, or increment) */
typedef struct {
  hxVec3 ang, lin;
} hxForce6;  /* torque and force */

/* [ C  H ; H^T  A ]: torque = C ang + H lin, force = H^T ang + A lin */
typedef struct {
  hxSym3 C;
  hxMat3 H;
  hxSym3 A;
} hxInertia6;

/* a rigid body about a point from which its centre of mass is at c: C = J - m c~ c~, H = m c~, A = m */
static inline hxInertia6 hx_rigid_inertia(hxReal mass, hxSym3 J, hxVec3 c) {
  const hxReal o = hx_splat(0.0);
  const hxVec3 h = hx_scale(mass, c);
  const hxReal xx = h.x * c.x, yy = h.y * c.y, zz = h.z * c.z;
  const hxSym3 C = {J.xx + (yy + zz), J.yy + (xx + zz), J.zz + (xx + yy), J.xy - h.x * c.y, J.xz - h.x * c.z, J.yz - h.y * c.z};
  return (hxInertia6){C, {{o, -h.z, h.y}, {h.z, o, -h.x}, {-h.y, h.x, o}}, {mass, mass, mass, o, o, o}};
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

static inline hxMotion6 hx_motion_add(hxMotion6 a, hxMotion6 b) { return (hxMotion6){hx_add(a.ang, b.ang), hx_add(a.lin, b.lin)}; }

static inline void hx_inertia_add(hxInertia6 *a, const hxInertia6 *b) {
  a->C.xx += b->C.xx, a->C.yy += b->C.yy, a->C.zz += b->C.zz, a->C.xy += b->C.xy, a->C.xz += b->C.xz, a->C.yz += b->C.yz;
  a->A.xx += b->A.xx, a->A.yy += b->A.yy, a->A.zz += b->A.zz, a->A.xy += b->A.xy, a->A.xz += b->A.xz, a->A.yz += b->A.yz;
  a->H = (hxMat3){hx_add(a->H.x, b->H.x), hx_add(a->H.y, b->H.y), hx_add(a->H.z, b->H.z)};
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

/* a symmetric block A that acts at c: [ -c~ A c~  c~ A ; .  A ], as seen about the point that c is from */
static inline hxInertia6 hx_inertia_at(hxSym3 A, hxVec3 c) {
  const hxVec3 x = {A.xx, A.xy, A.xz}, y = {A.xy, A.yy, A.yz}, z = {A.xz, A.yz, A.zz};
  const hxVec3 cx = hx_cross(c, x), cy = hx_cross(c, y), cz = hx_cross(c, z); /* columns of c~ A */
  const hxMat3 H = {{cx.x, cy.x, cz.x}, {cx.y, cy.y, cz.y}, {cx.z, cy.z, cz.z}};
  const hxVec3 Cx = hx_cross(c, H.x), Cy = hx_cross(c, H.y), Cz = hx_cross(c, H.z); /* rows of -c~ A c~ = c~ (c~ A)^T */
  return (hxInertia6){{Cx.x, Cy.y, Cz.z, Cx.y, Cx.z, Cy.z}, H, A};
}

#endif
