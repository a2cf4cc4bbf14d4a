/* spatial.h - spatial vectors and inertias of rigid bodies: angular part first, world axes, about
 * the point that the caller names */
#ifndef HX_SPATIAL_H
#define HX_SPATIAL_H

#include "../packs/vec3.h"

typedef struct {
  hxVec3 ang, lin;
} hxMotion6; /* angular and linear acceleration, velocity or displacement */
typedef struct {
  hxVec3 ang, lin;
} hxForce6; /* torque and force */

/* Spatial inertia [ C  H ; H^T  A ]: torque = C ang + H lin, force = H^T ang + A lin. */
typedef struct {
  hxSym3 C;
  hxMat3 H;
  hxSym3 A;
} hxInertia6;

/* Spatial inertia of a rigid body about a point; c leads from there to the centre of mass: C = J -
 * m c~ c~, H = m c~ = h~, A = m. */
typedef struct {
  hxReal mass;
  hxVec3 h;
  hxSym3 C;
} hxRigid6;

/* Returns the inertia of a body of mass m and inertia J about its centre of mass at c. */
static inline hxRigid6 hx_rigid_inertia(hxReal mass, hxSym3 J, hxVec3 c) {
  const hxVec3 h = hx_scale(mass, c);
  const hxReal xx = h.x * c.x, yy = h.y * c.y, zz = h.z * c.z;
  return (hxRigid6){mass,
                    h,
                    {J.xx + (yy + zz), J.yy + (xx + zz), J.zz + (xx + yy), J.xy - h.x * c.y,
                     J.xz - h.x * c.z, J.yz - h.y * c.z}};
}

/* Returns I a of a rigid body. */
static inline hxForce6 hx_rigid_mul(const hxRigid6 *I, hxMotion6 a) {
  return (hxForce6){hx_add3(hx_sym_mul(I->C, a.ang), hx_cross(I->h, a.lin)),
                    hx_add_scaled(hx_cross(a.ang, I->h), I->mass, a.lin)};
}

/* Returns I a. */
static inline hxForce6 hx_inertia_mul(const hxInertia6 *I, hxMotion6 a) {
  return (hxForce6){hx_add3(hx_sym_mul(I->C, a.ang), hx_mul(I->H, a.lin)),
                    hx_add3(hx_tmul(I->H, a.ang), hx_sym_mul(I->A, a.lin))};
}

/* Returns f . v, the power of a force on a velocity. */
static inline hxReal hx_power(hxForce6 f, hxMotion6 v) {
  return hx_dot(f.ang, v.ang) + hx_dot(f.lin, v.lin);
}

static inline hxForce6 hx_force_add(hxForce6 a, hxForce6 b) {
  return (hxForce6){hx_add3(a.ang, b.ang), hx_add3(a.lin, b.lin)};
}

static inline hxForce6 hx_force_add_scaled(hxForce6 a, hxReal s, hxForce6 b) {
  return (hxForce6){hx_add_scaled(a.ang, s, b.ang), hx_add_scaled(a.lin, s, b.lin)};
}

static inline hxMotion6 hx_motion_add_scaled(hxMotion6 a, hxReal s, hxMotion6 b) {
  return (hxMotion6){hx_add_scaled(a.ang, s, b.ang), hx_add_scaled(a.lin, s, b.lin)};
}

static inline hxMotion6 hx_motion_add(hxMotion6 a, hxMotion6 b) {
  return (hxMotion6){hx_add3(a.ang, b.ang), hx_add3(a.lin, b.lin)};
}

static inline hxSym3 hx_sym_add(hxSym3 A, hxSym3 B) {
  return (hxSym3){A.xx + B.xx, A.yy + B.yy, A.zz + B.zz, A.xy + B.xy, A.xz + B.xz, A.yz + B.yz};
}

/* Returns the sum of two inertias about the same point. */
static inline hxInertia6 hx_inertia_add(const hxInertia6 *I, const hxInertia6 *J) {
  return (hxInertia6){hx_sym_add(I->C, J->C),
                      {hx_add3(I->H.x, J->H.x), hx_add3(I->H.y, J->H.y), hx_add3(I->H.z, J->H.z)},
                      hx_sym_add(I->A, J->A)};
}

/* Adds the inertia of a rigid body about the same point. */
static inline void hx_inertia_add_rigid(hxInertia6 *I, const hxRigid6 *r) {
  I->C = hx_sym_add(I->C, r->C);
  I->H.y.x -= r->h.z, I->H.z.x += r->h.y;
  I->H.x.y += r->h.z, I->H.z.y -= r->h.x;
  I->H.x.z -= r->h.y, I->H.y.z += r->h.x;
  I->A.xx += r->mass, I->A.yy += r->mass, I->A.zz += r->mass;
}

/* Returns r - s U U^T of a rigid body's inertia r. */
static inline hxInertia6 hx_rigid_downdate(const hxRigid6 *r, hxReal s, hxForce6 U) {
  const hxVec3 a = hx_scale(s, U.ang), l = hx_scale(s, U.lin), h = r->h;
  return (hxInertia6){{r->C.xx - a.x * U.ang.x, r->C.yy - a.y * U.ang.y, r->C.zz - a.z * U.ang.z,
                       r->C.xy - a.x * U.ang.y, r->C.xz - a.x * U.ang.z, r->C.yz - a.y * U.ang.z},
                      {{-(l.x * U.ang.x), h.z - l.x * U.ang.y, -h.y - l.x * U.ang.z},
                       {-h.z - l.y * U.ang.x, -(l.y * U.ang.y), h.x - l.y * U.ang.z},
                       {h.y - l.z * U.ang.x, -h.x - l.z * U.ang.y, -(l.z * U.ang.z)}},
                      {r->mass - l.x * U.lin.x, r->mass - l.y * U.lin.y, r->mass - l.z * U.lin.z,
                       -(l.x * U.lin.y), -(l.x * U.lin.z), -(l.y * U.lin.z)}};
}

/* Subtracts s U U^T from I. */
static inline void hx_inertia_downdate(hxInertia6 *I, hxReal s, hxForce6 U) {
  const hxVec3 a = hx_scale(s, U.ang), l = hx_scale(s, U.lin);
  I->C.xx -= a.x * U.ang.x, I->C.yy -= a.y * U.ang.y, I->C.zz -= a.z * U.ang.z;
  I->C.xy -= a.x * U.ang.y, I->C.xz -= a.x * U.ang.z, I->C.yz -= a.y * U.ang.z;
  I->H.x = hx_add_scaled(I->H.x, -l.x, U.ang);
  I->H.y = hx_add_scaled(I->H.y, -l.y, U.ang);
  I->H.z = hx_add_scaled(I->H.z, -l.z, U.ang);
  I->A.xx -= l.x * U.lin.x, I->A.yy -= l.y * U.lin.y, I->A.zz -= l.z * U.lin.z;
  I->A.xy -= l.x * U.lin.y, I->A.xz -= l.x * U.lin.z, I->A.yz -= l.y * U.lin.z;
}

/* Returns the spatial inertia of a symmetric block A that acts at c: [ -c~ A c~  c~ A ; .  A ]. */
static inline hxInertia6 hx_inertia_at(hxSym3 A, hxVec3 c) {
  const hxVec3 x = {A.xx, A.xy, A.xz}, y = {A.xy, A.yy, A.yz}, z = {A.xz, A.yz, A.zz};
  const hxMat3 H = {hx_cross(c, x), hx_cross(c, y), hx_cross(c, z)};
  const hxVec3 Cx = hx_cross(c, (hxVec3){H.x.x, H.y.x, H.z.x}),
               Cy = hx_cross(c, (hxVec3){H.x.y, H.y.y, H.z.y}),
               Cz = hx_cross(c, (hxVec3){H.x.z, H.y.z, H.z.z}); /* -c~ A c~ = c~ (c~ A)^T */
  return (hxInertia6){{Cx.x, Cy.y, Cz.z, Cx.y, Cx.z, Cy.z}, H, A};
}

/* Returns the inverse of a positive definite matrix, by cofactors. */
static inline hxSym3 hx_sym_inverse(hxSym3 S) {
  const hxSym3 c = {S.yy * S.zz - S.yz * S.yz, S.xx * S.zz - S.xz * S.xz,
                    S.xx * S.yy - S.xy * S.xy, S.xz * S.yz - S.xy * S.zz,
                    S.xy * S.yz - S.xz * S.yy, S.xy * S.xz - S.xx * S.yz};
  const hxReal r = 1.0 / (S.xx * c.xx + S.xy * c.xy + S.xz * c.xz);
  return (hxSym3){r * c.xx, r * c.yy, r * c.zz, r * c.xy, r * c.xz, r * c.yz};
}

/* Solves I a = f by blocks: (C - H A^-1 H^T) ang = torque - H A^-1 force. */
static inline hxMotion6 hx_inertia_solve(const hxInertia6 *I, hxForce6 f) {
  const hxSym3 A = hx_sym_inverse(I->A);
  const hxVec3 a = {A.xx, A.xy, A.xz}, b = {A.xy, A.yy, A.yz}, c = {A.xz, A.yz, A.zz};
  const hxMat3 G = {hx_mul(I->H, a), hx_mul(I->H, b), hx_mul(I->H, c)}; /* H A^-1 */
  const hxMat3 H = I->H;
  const hxSym3 S = {I->C.xx - (G.x.x * H.x.x + G.y.x * H.y.x + G.z.x * H.z.x),
                    I->C.yy - (G.x.y * H.x.y + G.y.y * H.y.y + G.z.y * H.z.y),
                    I->C.zz - (G.x.z * H.x.z + G.y.z * H.y.z + G.z.z * H.z.z),
                    I->C.xy - (G.x.x * H.x.y + G.y.x * H.y.y + G.z.x * H.z.y),
                    I->C.xz - (G.x.x * H.x.z + G.y.x * H.y.z + G.z.x * H.z.z),
                    I->C.yz - (G.x.y * H.x.z + G.y.y * H.y.z + G.z.y * H.z.z)};
  const hxVec3 ang = hx_sym_mul(hx_sym_inverse(S), hx_sub3(f.ang, hx_mul(G, f.lin)));
  return (hxMotion6){ang, hx_sub3(hx_sym_mul(A, f.lin), hx_tmul(G, ang))};
}

#endif
