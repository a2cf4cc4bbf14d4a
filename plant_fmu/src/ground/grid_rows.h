/* grid_rows.h - distance and normal of the ground under a row of contacts (eq. 31-34) */
#ifndef HX_GRID_ROWS_H
#define HX_GRID_ROWS_H

#include "../packs/vec3.h"
#include "surface.h"

#ifndef HX_TANGENT
#include "smooth.h"
#endif

/* Distance of a point from the ground, and the ground's normal. */
typedef struct {
  hxReal distance; /* m  signed, > 0 above the ground */
  hxVec3 normal;   /* 1  out of the ground, world axes */
} hxGround;

/* Copies distance and normal of a grid at one lane's point. The derivative of both by the point
 * belongs to numbers that carry one. */
static inline void put_face(const hxFace *face, const hxNumber point[3], hxNumber distance[1],
                            hxNumber normal[3]) {
  const double *n = face->normal, *m = face->bend;
  const double d[3] = {hx_slope(point[0]), hx_slope(point[1]), hx_slope(point[2])};
  if (!HX_HAS_SLOPES) {
    *distance = face->distance;
    for (int i = 0; i < 3; ++i) normal[i] = n[i];
    return;
  }
  distance[0] = hx_with_slope(face->distance, n[0] * d[0] + n[1] * d[1] + n[2] * d[2]);
  normal[0] = hx_with_slope(n[0], m[0] * d[0] + m[3] * d[1] + m[4] * d[2]);
  normal[1] = hx_with_slope(n[1], m[3] * d[0] + m[1] * d[1] + m[5] * d[2]);
  normal[2] = hx_with_slope(n[2], m[4] * d[0] + m[5] * d[1] + m[2] * d[2]);
}

/* Computes a face of a grid at a point; feet keep the cell that is held for them. */
static inline void query_grid(const hxModel *model, const hxContactState *state, hxFaceKind kind,
                              int slot, const hxNumber point[3], hxFace *face) {
  const double real[3] = {hx_re(point[0]), hx_re(point[1]), hx_re(point[2])},
               none[2] = {-1.0, -1.0},
               cell[2] = {hx_re(state->cell[0][slot]), hx_re(state->cell[1][slot])};
  hx_terrain_face(model->terrain, kind, kind == HX_FACE_NEAREST ? none : cell, real, HX_HAS_SLOPES,
                  face);
}

/* Contacts whose place on a grid is computed. Others are left above the ground. */
enum {
  HX_CLOSED, /* those that are closed */
  HX_ALL,
  HX_NEAR /* those that are closed, and open ones that may touch; on blocks all feet */
};

#ifndef HX_TANGENT
/* Returns the heights of the highest blocks within 20 mm of points along x and y. */
static inline hxReal tops_around(const hxTerrain *terrain, const hxVec3 *point) {
  const double reach = HX_LEAST_REACH * terrain->per_cell;
  const hxReal x = (point->x - terrain->head.x0) * terrain->per_cell,
               y = (point->y - terrain->head.y0) * terrain->per_cell;
  double low[2][HX_LANES], high[2][HX_LANES], top[HX_LANES];
  hx_store(low[0], x - reach), hx_store(high[0], x + reach);
  hx_store(low[1], y - reach), hx_store(high[1], y + reach);
  for (int lane = 0; lane < HX_LANES; ++lane) {
    const double ends[4] = {low[0][lane], high[0][lane], low[1][lane], high[1][lane]};
    top[lane] = hx_terrain_top_between(terrain, ends);
  }
  return hx_load(top);
}

/* Returns the indices of hx_cell_index along a line of n cells. */
static inline hxReal cell_index(hxReal u, int64_t n) {
  const hxReal zero = hx_splat(0.0), last = hx_splat((double)(n - 1));
  return whole_part(hx_select(hx_less(zero, u), hx_min(u, last), zero));
}

/* Returns the entries of a map of rows x cols at coordinates in its cells. */
static inline hxReal entries_at(const double *map, int64_t rows, int64_t cols, hxReal u, hxReal v) {
  const double *from[HX_LANES];
  double place[HX_LANES];
  hx_store(place, cell_index(v, rows) * (double)cols + cell_index(u, cols));
  for (int lane = 0; lane < HX_LANES; ++lane) from[lane] = map + (int64_t)place[lane];
  return hx_gather(from, 0);
}

/* Returns the heights of the tiles over which points are. */
static inline hxReal tops_of_tiles(const hxTerrain *terrain, const hxVec3 *point) {
  return entries_at(terrain->top, terrain->tile_rows, terrain->tile_cols,
                    (point->x - terrain->head.x0) * terrain->per_tile,
                    (point->y - terrain->head.y0) * terrain->per_tile);
}

/* Returns the largest depths that a row of contacts at these points may have, m; not positive: they
 * do not touch the grid. Each lane is bounded by itself, so that the bits do not depend on the
 * others of its pack: by the grid's highest place where it is above that, else by those around it,
 * which are looked up only if a lane needs them. */
HX_RARE hxReal hx_grid_depth_bound(const hxModel *model, int row, const hxVec3 *point) {
  const hxTerrain *terrain = model->terrain;
  const double radius = model->radius[row];
  const hxReal z = point->z - model->ground_point[2], above_all = z - terrain->highest;
  const int around = hx_has_large_blocks(terrain) && radius < 0.9 * HX_LEAST_REACH;
  const int is_bounded = radius < terrain->reach;
  const hxMask is_high = hx_less(hx_splat(is_bounded ? radius : HUGE_VAL), above_all);
  const hxReal highest = radius - hx_min(above_all, hx_splat(terrain->reach));
  if (!hx_any(~is_high)) return highest;
  if (!around && !is_bounded) return hx_splat(radius); /* unknown */
  const hxReal above = z - (around ? tops_around(terrain, point) : tops_of_tiles(terrain, point));
  const hxReal reach = hx_splat(around ? HX_LEAST_REACH : terrain->reach);
  return hx_select(is_high, highest, radius - hx_select(hx_less(above, reach), above, reach));
}
#endif

#ifndef HX_TANGENT
/* Returns distance and normal of a smooth grid at a row's points. */
HX_RARE hxGround hx_smooth_grid(const hxModel *model, const hxContactState *state, int row,
                                int slot, int all, const hxVec3 *point, hxPatchNodes *nodes) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0);
  const hxReal at[3] = {point->x, point->y, point->z - model->ground_point[2]};
  hxReal normal[3], distance = hx_splat(hx_far);
  hxMask wanted = hx_less(zero, hx_load(&state->closed[row][slot]));
  if (all == HX_ALL) wanted = hx_less(zero, one);
  if (all == HX_NEAR) {
    const hxReal bound = hx_grid_depth_bound(model, row, point);
    wanted |= hx_less(zero, bound);
    distance = model->radius[row] - bound;
  }
  if (!hx_any(wanted)) return (hxGround){distance, {zero, zero, one}};
  const int is_foot = row == HX_FOOT;
  const hxReal from[2] = {is_foot ? hx_load(&state->nearest[0][slot]) : zero,
                          is_foot ? hx_load(&state->nearest[1][slot]) : zero};
  hxPatchNodes own;
  if (!nodes) {
    hx_forget_nodes(&own);
    nodes = &own;
  }
  const hxNearest nearest = hx_nearest_point(model->terrain, wanted, at, from, 0, nodes);
  const hxReal exact = hx_smooth_distance(&nearest, at, normal);
  return (hxGround){hx_select(wanted, exact, distance),
                    {hx_select(wanted, normal[0], zero), hx_select(wanted, normal[1], zero),
                     hx_select(wanted, normal[2], one)}};
}
#endif

/* Returns distance and normal of a grid at a row's points, lane by lane; where the ground around an
 * open contact is lower, the least distance that it may have. */
HX_RARE hxGround hx_grid(const hxModel *model, const hxContactState *state, int row, int slot,
                         int all, const hxVec3 *point) {
  static const hxFaceKind kind[HX_ROWS] = {HX_FACE_TOP,    HX_FACE_WALL,    HX_FACE_SIDE,
                                           HX_FACE_CORNER, HX_FACE_NEAREST, HX_FACE_NEAREST,
                                           HX_FACE_NEAREST};
  hxNumber at[3][HX_LANES], distance[HX_LANES], normal[3][HX_LANES];
  double bound[HX_LANES] = {0.0};
#ifndef HX_TANGENT
  if (all == HX_NEAR) hx_store(bound, hx_grid_depth_bound(model, row, point));
#endif
  hx_store(at[0], point->x), hx_store(at[1], point->y), hx_store(at[2], point->z);
  for (int lane = 0; lane < HX_LANES; ++lane) {
    const int place = slot + lane, mirrors = row != HX_TORSO && place >= HX_LEGS && slot == 0;
    const hxNumber p[3] = {at[0][lane], at[1][lane], at[2][lane] - model->ground_point[2]};
    hxNumber n[3];
    if (mirrors) {
      distance[lane] = distance[0];
      for (int i = 0; i < 3; ++i) normal[i][lane] = normal[i][0];
      continue;
    }
    hxFace face = {.distance = hx_far, .normal = {0.0, 0.0, 1.0}};
    if (all == HX_ALL || hx_re(state->closed[row][place]) != 0.0 || bound[lane] > 0.0)
      query_grid(model, state, kind[row], place, p, &face);
    else if (all == HX_NEAR)
      face.distance = hx_re(model->radius[row]) - bound[lane];
    put_face(&face, p, &distance[lane], n);
    for (int i = 0; i < 3; ++i) normal[i][lane] = n[i];
  }
  return (hxGround){hx_load(distance),
                    {hx_load(normal[0]), hx_load(normal[1]), hx_load(normal[2])}};
}

#ifndef HX_TANGENT
/* Copies the tops of cells and of those beside them to node[1 + along y][1 + along x], those beyond
 * the border being its own. */
HX_RARE void copy_cells(const hxTerrain *terrain, hxReal col, hxReal row, hxPatchNodes *nodes) {
  const int64_t cols = terrain->head.cols, rows = terrain->head.rows;
  hx_store(nodes->col, col), hx_store(nodes->row, row);
  for (int lane = 0; lane < HX_LANES; ++lane) {
    const int64_t c = hx_cell_index(nodes->col[lane], cols),
                  r = hx_cell_index(nodes->row[lane], rows);
    const int64_t beside[3] = {c > 0 ? -1 : 0, 0, c < cols - 1 ? 1 : 0},
                  along[3] = {r > 0 ? -cols : 0, 0, r < rows - 1 ? cols : 0};
    const double *own = terrain->height + r * cols + c;
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) nodes->node[i][k][lane] = own[along[i] + beside[k]];
  }
}

/* Copies them in the lanes `wanted`, unless they are those of an earlier look-up. */
static inline void hold_cells_of(const hxTerrain *terrain, hxMask wanted, hxReal col, hxReal row,
                                 hxPatchNodes *nodes) {
  const hxReal from_col = hx_load(nodes->col), from_row = hx_load(nodes->row);
  const hxMask changed = wanted & (differ(col, from_col) | differ(row, from_row));
  if (hx_any(changed))
    copy_cells(terrain, hx_select(changed, col, from_col), hx_select(changed, row, from_row),
               nodes);
}

/* Replaces the cells of lanes that hold none by those below the points. */
static inline void cells_below(const hxTerrain *terrain, const hxVec3 *point, hxReal *col,
                               hxReal *row) {
  const hxGridHead *head = &terrain->head;
  const hxMask below = hx_less(*col, hx_splat(0.0));
  *col = hx_select(below, cell_index((point->x - head->x0) / head->cell, head->cols), *col);
  *row = hx_select(below, cell_index((point->y - head->y0) / head->cell, head->rows), *row);
}

/* Returns which contacts of a pack of feet the choice contains. */
static inline hxMask wanted_lanes(const hxContactState *state, int row, int slot, int all) {
  const hxMask closed = hx_less(hx_splat(0.0), hx_load(&state->closed[row][slot]));
  return all == HX_CLOSED ? closed : closed | ~closed;
}

/* Returns the distances of feet from the tops of the columns that are held for them, or below them;
 * with the bits of hx_terrain_face. `nodes`: of the held cells, from an earlier look-up, or NULL */
HX_RARE hxGround hx_block_tops(const hxModel *model, const hxContactState *state, int slot, int all,
                               const hxVec3 *point, hxPatchNodes *nodes) {
  const hxTerrain *terrain = model->terrain;
  const hxGridHead *head = &terrain->head;
  const hxReal zero = hx_splat(0.0), z = point->z - model->ground_point[2];
  const hxMask wanted = wanted_lanes(state, HX_FOOT, slot, all);
  hxReal col = hx_load(&state->cell[0][slot]), row = hx_load(&state->cell[1][slot]), top;
  if (hx_any(wanted & hx_less(col, zero))) cells_below(terrain, point, &col, &row);
  if (nodes) {
    hold_cells_of(terrain, wanted, col, row, nodes);
    top = hx_load(nodes->node[1][1]);
  } else {
    top = entries_at(terrain->height, head->rows, head->cols, col, row);
  }
  return (hxGround){hx_select(wanted, z - top, hx_splat(hx_far)), {zero, zero, hx_splat(1.0)}};
}

/* The nearest of the faces of columns beside a cell: its distance, and the vector from its nearest
 * point, which over `over` is the normal. */
typedef struct {
  hxReal distance, away[3], over;
} hxNearestFaces;

/* Keeps a face in the lanes in which it is nearer. */
static inline void keep_nearer_lanes(hxMask mask, const hxNearestFaces *other,
                                     hxNearestFaces *face) {
  mask &= hx_less(other->distance, face->distance);
  face->distance = hx_select(mask, other->distance, face->distance);
  for (int i = 0; i < 3; ++i) face->away[i] = hx_select(mask, other->away[i], face->away[i]);
  face->over = hx_select(mask, other->over, face->over);
}

/* Keeps the nearest faces or edges of columns beside cells, at offset `sign` along an axis. */
static inline void keep_side_columns(hxMask mask, hxReal gap, hxReal above, int axis, double sign,
                                     hxNearestFaces *face) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0), beside = -sign * gap;
  const hxMask is_wall = ~hx_less(zero, above), is_top = ~is_wall & ~hx_less(zero, gap);
  const hxReal edge = hx_sqrt(beside * beside + above * above);
  hxNearestFaces other = {hx_select(is_wall, gap, hx_select(is_top, above, edge)),
                          {zero, zero, hx_select(is_wall, zero, hx_select(is_top, one, above))},
                          hx_select(is_wall | is_top, one, edge)};
  other.away[axis] = hx_select(is_wall, hx_splat(-sign), hx_select(is_top, zero, beside));
  keep_nearer_lanes(mask, &other, face);
}

/* Keeps the nearest walls, edges or corners of columns across the corners of cells, at these gaps
 * from them along x and y. */
static inline void keep_corner_columns(hxMask mask, hxReal gap_x, hxReal gap_y, hxReal above,
                                       double sign_x, double sign_y, hxNearestFaces *face) {
  const hxReal zero = hx_splat(0.0), x = -sign_x * hx_max(gap_x, zero),
               y = -sign_y * hx_max(gap_y, zero), z = hx_max(above, zero),
               distance = hx_sqrt(x * x + y * y + z * z);
  keep_nearer_lanes(mask & hx_less(zero, distance),
                    &(hxNearestFaces){distance, {x, y, z}, distance}, face);
}

/* Returns distance and normal of walls, edges and corners beside the cells that are held for feet,
 * or below them: with the bits of hx_terrain_face. `nodes`: as in hx_block_tops. */
HX_RARE hxGround hx_block_sides(const hxModel *model, const hxContactState *state, int row,
                                int slot, int all, const hxVec3 *point, hxPatchNodes *nodes) {
  const hxTerrain *terrain = model->terrain;
  const hxGridHead *head = &terrain->head;
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0), z = point->z - model->ground_point[2];
  const hxMask wanted = wanted_lanes(state, row, slot, all);
  hxReal col = hx_load(&state->cell[0][slot]), line = hx_load(&state->cell[1][slot]);
  hxPatchNodes own_nodes;
  if (!nodes) {
    nodes = &own_nodes;
    hx_forget_nodes(nodes);
  }
  if (hx_any(wanted & hx_less(col, zero))) cells_below(terrain, point, &col, &line);
  hold_cells_of(terrain, wanted, col, line, nodes);
  const hxReal low_x = head->x0 + head->cell * col, low_y = head->y0 + head->cell * line,
               gap_x[2] = {point->x - low_x, low_x + head->cell - point->x},
               gap_y[2] = {point->y - low_y, low_y + head->cell - point->y},
               own = hx_load(nodes->node[1][1]);
  hxNearestFaces face = {hx_splat(hx_far), {zero, zero, one}, one};
  for (int k = 0; k < 2; ++k) {
    const double sign = k == 0 ? -1.0 : 1.0;
    const hxReal beside =
        row == HX_WALL ? hx_load(nodes->node[1][2 * k]) : hx_load(nodes->node[2 * k][1]);
    const hxMask higher = wanted & hx_less(own, beside);
    if (row != HX_CORNER && hx_any(higher))
      keep_side_columns(higher, row == HX_WALL ? gap_x[k] : gap_y[k], z - beside, row - HX_WALL,
                        sign, &face);
    for (int i = 0; row == HX_CORNER && i < 2; ++i) {
      const hxReal across = hx_load(nodes->node[2 * i][2 * k]);
      const hxMask above_own = wanted & hx_less(own, across);
      if (hx_any(above_own))
        keep_corner_columns(above_own, gap_x[k], gap_y[i], z - across, sign, i == 0 ? -1.0 : 1.0,
                            &face);
    }
  }
  return (hxGround){face.distance,
                    {face.away[0] / face.over, face.away[1] / face.over, face.away[2] / face.over}};
}
#endif

/* Returns distance and normal of the ground at the points of a row of contacts. All other code is
 * independent of the terrain. `nodes`: of feet, from an earlier search; NULL: none. */
HX_INLINE hxGround hx_ground(const hxModel *model, const hxContactState *state, int row, int slot,
                             int all, hxVec3 point, hxPatchNodes *nodes) {
  if (model->terrain_kind == HX_TERRAIN_FLAT)
    return (hxGround){point.z - model->ground_point[2],
                      {hx_splat(0.0), hx_splat(0.0), hx_splat(1.0)}};
#ifndef HX_TANGENT
  if (model->terrain_kind == HX_TERRAIN_GRID &&
      hx_terrain_surface(model->terrain) == HX_SURFACE_SMOOTH)
    return hx_smooth_grid(model, state, row, slot, all, &point, nodes);
  if (model->terrain_kind == HX_TERRAIN_GRID && row < HX_FOOT_ROWS)
    return row == HX_FOOT ? hx_block_tops(model, state, slot, all, &point, nodes)
                          : hx_block_sides(model, state, row, slot, all, &point, nodes);
#endif
  (void)nodes;
  if (model->terrain_kind == HX_TERRAIN_GRID) return hx_grid(model, state, row, slot, all, &point);
  const hxVec3 n = hx_splat_vec3(model->ground_normal);
  return (hxGround){hx_dot(n, hx_sub3(point, hx_splat_vec3(model->ground_point))), n};
}

#endif
