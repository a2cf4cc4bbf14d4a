/* vec3.h - vectors, rotations and symmetric matrices of 3-space, one per lane */
#ifndef HX_VEC3_H
#define HX_VEC3_H

#include "lanes.h"

typedef struct {
  hxReal x, y, z;
} hxVec3;
typedef struct {
  hxReal w, x, y, z;
} hxQuat;
typedef struct {
  hxVec3 x, y, z;
} hxMat3; /* rows */
typedef struct {
  hxReal xx, yy, zz, xy, xz, yz;
} hxSym3;

/* [component][slot] in memory */
static inline hxVec3 hx_load_vec3(const double (*m)[HX_SLOTS], int slot) {
  return (hxVec3){hx_load(&m[0][slot]), hx_load(&m[1][slot]), hx_load(&m[2][slot])};
}

static inline void hx_store_vec3(double (*m)[HX_SLOTS], int slot, hxVec3 a) {
  hx_store(&m[0][slot], a.x);
  hx_store(&m[1][slot], a.y);
  hx_store(&m[2][slot], a.z);
}

static inline hxVec3 hx_splat_vec3(const double a[3]) { return (hxVec3){hx_splat(a[0]), hx_splat(a[1]), hx_splat(a[2])}; }

static inline hxSym3 hx_load_sym3(const double (*m)[HX_SLOTS], int slot) {
  return (hxSym3){hx_load(&m[0][slot]), hx_load(&m[1][slot]), hx_load(&m[2][slot]),
                  hx_load(&m[3][slot]), hx_load(&m[4][slot]), hx_load(&m[5][slot])};
}

static inline hxVec3 hx_zero3(void) { return (hxVec3){hx_splat(0.0), hx_splat(0.0), hx_splat(0.0)}; }
static inline hxVec3 hx_add(hxVec3 a, hxVec3 b) { return (hxVec3){a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline hxVec3 hx_sub(hxVec3 a, hxVec3 b) { return (hxVec3){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline hxVec3 hx_neg(hxVec3 a) { return (hxVec3){-a.x, -a.y, -a.z}; }
static inline hxVec3 hx_scale(hxReal s, hxVec3 a) { return (hxVec3){s * a.x, s * a.y, s * a.z}; }
static inline hxReal hx_dot(hxVec3 a, hxVec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/* a + s b */
static inline hxVec3 hx_add_scaled(hxVec3 a, hxReal s, hxVec3 b) { return (hxVec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z}; }

static inline hxVec3 hx_cross(hxVec3 a, hxVec3 b) { return (hxVec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

static inline hxVec3 hx_mul(hxMat3 A, hxVec3 b) { return (hxVec3){hx_dot(A.x, b), hx_dot(A.y, b), hx_dot(A.z, b)}; }

/* A^T b */
static inline hxVec3 hx_tmul(hxMat3 A, hxVec3 b) {
  return (hxVec3){A.x.x * b.x + A.y.x * b.y + A.z.x * b.z, A.x.y * b.x + A.y.y * b.y + A.z.y * b.z,
                  A.x.z * b.x + A.y.z * b.y + A.z.z * b.z};
}

static inline hxVec3 hx_sym_mul(hxSym3 S, hxVec3 b) {
  return (hxVec3){S.xx * b.x + S.xy * b.y + S.xz * b.z, S.xy * b.x + S.yy * b.y + S.yz * b.z, S.xz * b.x + S.yz * b.y + S.zz * b.z};
}

/* R of eq. 7; p need not have unit length */
static inline hxMat3 hx_rotation_matrix(hxQuat p) {
  const hxReal two = 2.0 / (p.w * p.w + p.x * p.x + p.y * p.y + p.z * p.z);
  const hxReal x = two * p.x, y = two * p.y, z = two * p.z;
  const hxReal wx = p.w * x, wy = p.w * y, wz = p.w * z;
  const hxReal xx = p.x * x, xy = p.x * y, xz = p.x * z, yy = p.y * y, yz = p.y * z, zz = p.z * z;
  return (hxMat3){{1.0 - (yy + zz), xy - wz, xz + wy}, {xy + wz, 1.0 - (xx + zz), yz - wx}, {xz - wy, yz + wx, 1.0 - (xx + yy)}};
}

/* dp/dt = (0, w) p / 2, w in world axes (eq. 8) */
static inline hxQuat hx_quaternion_rate(hxQuat p, hxVec3 w) {
  const hxReal x = 0.5 * w.x, y = 0.5 * w.y, z = 0.5 * w.z;
  return (hxQuat){-x * p.x - y * p.y - z * p.z, x * p.w + y * p.z - z * p.y, y * p.w + z * p.x - x * p.z, z * p.w + x * p.y - y * p.x};
}

/* the rotation 2 Im(dp conj(p)) of a small quaternion change: the inverse of hx_quaternion_rate */
static inline hxVec3 hx_rotation_of_change(hxQuat p, hxQuat dp) {
  return (hxVec3){2.0 * (-dp.w * p.x + dp.x * p.w - dp.y * p.z + dp.z * p.y), 2.0 * (-dp.w * p.y + dp.y * p.w - dp.z * p.x + dp.x * p.z),
                  2.0 * (-dp.w * p.z + dp.z * p.w - dp.x * p.y + dp.y * p.x)};
}

/* R S R^T */
static inline hxSym3 hx_rotate_sym3(hxMat3 R, hxSym3 S) {
  const hxVec3 tx = hx_sym_mul(S, R.x), ty = hx_sym_mul(S, R.y), tz = hx_sym_mul(S, R.z);
  return (hxSym3){hx_dot(R.x, tx), hx_dot(R.y, ty), hx_dot(R.z, tz), hx_dot(R.x, ty), hx_dot(R.x, tz), hx_dot(R.y, tz)};
}

#endif
