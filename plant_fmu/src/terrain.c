#include "terrain.h"

static hxGround flat(const hxModel *model, hxVec3 point) {
  return (hxGround){point.z - model->ground_point[2], {hx_splat(0.0), hx_splat(0.0), hx_splat(1.0)}};
}

static hxGround slope(const hxModel *model, hxVec3 point) {
  const hxVec3 n = hx_splat_vec3(model->ground_normal);
  return (hxGround){hx_dot(n, hx_sub(point, hx_splat_vec3(model->ground_point))), n};
}

static const hxTerrainRow terrain_rows[] = {
    [HX_TERRAIN_FLAT] = {flat},
    [HX_TERRAIN_SLOPE] = {slope},
};

HX_LOCAL const hxTerrainRow *hx_terrain(int kind) {
  return kind >= 1 && kind < (int)(sizeof terrain_rows / sizeof terrain_rows[0]) ? &terrain_rows[kind] : NULL;
}
