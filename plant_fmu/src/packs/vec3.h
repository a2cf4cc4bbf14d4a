/* vec3.h - vectors, rotation matrices, quaternions and symmetric matrices, one per lane */
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
} hxMat3; /* columns */
typedef struct {
  hxReal xx, yy, zz, xy, xz, yz;
} hxSym3;

/* Loads and stores read and write [component][slot] arrays, from a slot on. */
static inline hxVec3 hx_load_vec3(const hxNumber (*m)[HX_SLOTS], int slot) {
  return (hxVec3){hx_load(&m[0][slot]), hx_load(&m[1][slot]), hx_load(&m[2][slot])};
}

static inline void hx_store_vec3(hxNumber (*m)[HX_SLOTS], int slot, hxVec3 a) {
  hx_store(&m[0][slot], a.x);
  hx_store(&m[1][slot], a.y);
  hx_store(&m[2][slot], a.z);
}

static inline hxQuat hx_load_quat(const hxNumber (*m)[HX_SLOTS], int slot) {
  return (hxQuat){hx_load(&m[0][slot]), hx_load(&m[1][slot]), hx_load(&m[2][slot]),
                  hx_load(&m[3][slot])};
}

static inline void hx_store_quat(hxNumber (*m)[HX_SLOTS], int slot, hxQuat p) {
  hx_store(&m[0][slot], p.w);
  hx_store(&m[1][slot], p.x);
  hx_store(&m[2][slot], p.y);
  hx_store(&m[3][slot], p.z);
}

static inline hxSym3 hx_load_sym3(const hxNumber (*m)[HX_SLOTS], int slot) {
  return (hxSym3){hx_load(&m[0][slot]), hx_load(&m[1][slot]), hx_load(&m[2][slot]),
                  hx_load(&m[3][slot]), hx_load(&m[4][slot]), hx_load(&m[5][slot])};
}

/* The splat functions copy one vector or quaternion into all lanes. */
static inline hxVec3 hx_splat_vec3(const hxNumber a[3]) {
  return (hxVec3){hx_splat(a[0]), hx_splat(a[1]), hx_splat(a[2])};
}
static inline hxQuat hx_splat_quat(const hxNumber p[4]) {
  return (hxQuat){hx_splat(p[0]), hx_splat(p[1]), hx_splat(p[2]), hx_splat(p[3])};
}

static inline hxVec3 hx_zero3(void) {
  return (hxVec3){hx_splat(0.0), hx_splat(0.0), hx_splat(0.0)};
}
static inline hxVec3 hx_add3(hxVec3 a, hxVec3 b) {
  return (hxVec3){a.x + b.x, a.y + b.y, a.z + b.z};
}
static inline hxVec3 hx_sub3(hxVec3 a, hxVec3 b) {
  return (hxVec3){a.x - b.x, a.y - b.y, a.z - b.z};
}
static inline hxVec3 hx_neg(hxVec3 a) { return (hxVec3){-a.x, -a.y, -a.z}; }
static inline hxVec3 hx_scale(hxReal s, hxVec3 a) { return (hxVec3){s * a.x, s * a.y, s * a.z}; }
static inline hxReal hx_dot(hxVec3 a, hxVec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/* Returns a + s b. */
static inline hxVec3 hx_add_scaled(hxVec3 a, hxReal s, hxVec3 b) {
  return (hxVec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}

static inline hxVec3 hx_cross(hxVec3 a, hxVec3 b) {
  return (hxVec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* Returns A b. */
static inline hxVec3 hx_mul(hxMat3 A, hxVec3 b) {
  return (hxVec3){A.x.x * b.x + A.y.x * b.y + A.z.x * b.z, A.x.y * b.x + A.y.y * b.y + A.z.y * b.z,
                  A.x.z * b.x + A.y.z * b.y + A.z.z * b.z};
}

/* Returns A^T b. */
static inline hxVec3 hx_tmul(hxMat3 A, hxVec3 b) {
  return (hxVec3){hx_dot(A.x, b), hx_dot(A.y, b), hx_dot(A.z, b)};
}

/* Returns S b. */
static inline hxVec3 hx_sym_mul(hxSym3 S, hxVec3 b) {
  return (hxVec3){S.xx * b.x + S.xy * b.y + S.xz * b.z, S.xy * b.x + S.yy * b.y + S.yz * b.z,
                  S.xz * b.x + S.yz * b.y + S.zz * b.z};
}

/* Returns R of eq. 5; p need not have unit length. */
static inline hxMat3 hx_rotation_matrix(hxQuat p) {
  const hxReal two = 2.0 / (p.w * p.w + p.x * p.x + p.y * p.y + p.z * p.z);
  const hxReal x = two * p.x, y = two * p.y, z = two * p.z;
  const hxReal wx = p.w * x, wy = p.w * y, wz = p.w * z;
  const hxReal xx = p.x * x, xy = p.x * y, xz = p.x * z, yy = p.y * y, yz = p.y * z, zz = p.z * z;
  return (hxMat3){{1.0 - (yy + zz), xy + wz, xz - wy},
                  {xy - wz, 1.0 - (xx + zz), yz + wx},
                  {xz + wy, yz - wx, 1.0 - (xx + yy)}};
}

/* Returns the quaternion product a b. */
static inline hxQuat hx_quat_mul(hxQuat a, hxQuat b) {
  return (hxQuat){
      a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
      a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}

/* Returns dp/dt = (0, w) p / 2 with w in world axes (eq. 6). */
static inline hxQuat hx_quaternion_rate(hxQuat p, hxVec3 w) {
  const hxReal x = 0.5 * w.x, y = 0.5 * w.y, z = 0.5 * w.z;
  return (hxQuat){-x * p.x - y * p.y - z * p.z, x * p.w + y * p.z - z * p.y,
                  y * p.w + z * p.x - x * p.z, z * p.w + x * p.y - y * p.x};
}

/* Returns R S R^T. */
static inline hxSym3 hx_rotate_sym3(hxMat3 R, hxSym3 S) {
  const hxVec3 tx = hx_mul(R, (hxVec3){S.xx, S.xy, S.xz}),
               ty = hx_mul(R, (hxVec3){S.xy, S.yy, S.yz}),
               tz = hx_mul(R, (hxVec3){S.xz, S.yz, S.zz}); /* columns of R S */
  return (hxSym3){
      tx.x * R.x.x + ty.x * R.y.x + tz.x * R.z.x, tx.y * R.x.y + ty.y * R.y.y + tz.y * R.z.y,
      tx.z * R.x.z + ty.z * R.y.z + tz.z * R.z.z, tx.x * R.x.y + ty.x * R.y.y + tz.x * R.z.y,
      tx.x * R.x.z + ty.x * R.y.z + tz.x * R.z.z, tx.y * R.x.z + ty.y * R.y.z + tz.y * R.z.z};
}

#endif
