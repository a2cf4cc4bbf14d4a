/* patches.c - nearest points of a smooth grid by patches that are kept, for the tests */
#include "packs/vec3.h"

#include "ground/grid_rows.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored                                                                     \
    "-Wmissing-prototypes" /* called from Python only: there is no header */
#endif

/* Stores distance and normal at a point. */
static void put_nearest(const hxTerrain *terrain, const double point[3], hxPatchNodes *nodes,
                        double out[4]) {
  const hxReal at[3] = {hx_splat(point[0]), hx_splat(point[1]), hx_splat(point[2])};
  const hxReal start[2] = {hx_splat(0.0), hx_splat(0.0)};
  const hxMask wanted = hx_less(hx_splat(0.0), hx_splat(1.0));
  hxReal normal[3];
  const hxNearest nearest = hx_nearest_point(terrain, wanted, at, start, 0, nodes);
  out[0] = hx_lane(hx_smooth_distance(&nearest, at, normal), 0);
  for (int i = 0; i < 3; ++i) out[1 + i] = hx_lane(normal[i], 0);
}

/* Stores distance and normal at the second point: after a search at the first one, the same with
 * its patch forgotten, and without such a search; and whether the search kept a patch. */
HX_API void hx_probe_kept_patch(const hxTerrain *terrain, const double first[3],
                                const double second[3], double out[13]) {
  hxPatchNodes nodes, none;
  hx_forget_nodes(&nodes), hx_forget_nodes(&none);
  put_nearest(terrain, first, &nodes, out);
  out[12] = nodes.is_kept[0];
  hxPatchNodes same = nodes;
  put_nearest(terrain, second, &nodes, &out[0]);
  hx_forget_patches(&same);
  put_nearest(terrain, second, &same, &out[4]);
  put_nearest(terrain, second, &none, &out[8]);
}
