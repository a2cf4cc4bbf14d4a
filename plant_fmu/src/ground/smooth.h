/* smooth.h - nearest points of a smooth surface (eq. 31, 32) to a pack of points: the kernels
 * include it, and surface.c with one lane, with the same bits for each point */
#ifndef HX_SMOOTH_H
#define HX_SMOOTH_H

#include "../packs/lanes.h"
#include "surface.h"

/* Height over a point, its first and second derivatives. */
typedef struct {
  hxReal s, sx, sy, sxx, sxy, syy;
} hxPatch;

/* A coordinate on the grid: index of the node before it, place between this and the next node, and
 * how far it is beyond the grid, in cells, < 0 before its first node. */
typedef struct {
  hxReal node, place, beyond;
  hxMask outside;
} hxGridPlace;

/* Copies of the 4 x 4 nodes around the patches of a pack of points; of blocks the tops of cells.
 * The patches that were evaluated last are kept at their places. */
struct hxPatchNodes {
  double col[HX_LANES], row[HX_LANES]; /* of the patches; less than -1: none */
  double node[4][4][HX_LANES];
  double is_kept[HX_LANES]; /* 1: the next lines are set */
  double x[HX_LANES], y[HX_LANES];
  double patch[6][HX_LANES];
};

/* Places of points, and the nodes around each. */
typedef struct {
  hxGridPlace x, y;
  hxPatchNodes *of;
} hxStencil;

/* Marks patches as not kept. */
static inline void hx_forget_patches(hxPatchNodes *nodes) {
  hx_store(nodes->is_kept, hx_splat(0.0));
}

/* Marks copies of nodes as empty, and patches as not kept. */
static inline void hx_forget_nodes(hxPatchNodes *nodes) {
  hx_store(nodes->col, hx_splat(-2.0)), hx_store(nodes->row, hx_splat(-2.0));
  hx_forget_patches(nodes);
}

/* Returns the largest whole number that is not larger than x, for x from 0 to 2^51. */
static inline hxReal whole_part(hxReal x) {
  const double shift = 6755399441055744.0; /* 1.5 * 2^52: adding it rounds to an integer */
  const hxReal nearest = (x + shift) - shift;
  return nearest - hx_select(hx_less(x, nearest), hx_splat(1.0), hx_splat(0.0));
}

/* Returns the place of x, of the first node if x is not a number. */
static inline hxGridPlace grid_place(hxReal x, double origin, double per_cell, int64_t nodes) {
  const hxReal u = (x - origin) * per_cell, zero = hx_splat(0.0),
               last = hx_splat((double)(nodes - 1));
  const hxReal clamped = hx_select(hx_less(zero, u), hx_min(u, last), zero);
  const hxReal node = hx_min(whole_part(clamped), hx_splat((double)(nodes - 2)));
  const hxMask outside = hx_less(u, zero) | hx_less(last, u);
  return (hxGridPlace){node, clamped - node, u - clamped, outside};
}

/* Computes the weights w of four nodes (eq. 32), and their first and second derivatives. */
static inline void cubic_weights(hxReal t, hxReal w[3][4]) {
  const hxReal t2 = t * t, t3 = t2 * t;
  w[0][0] = -0.5 * t + t2 - 0.5 * t3, w[0][1] = 1.0 - 2.5 * t2 + 1.5 * t3;
  w[0][2] = 0.5 * t + 2.0 * t2 - 1.5 * t3, w[0][3] = 0.5 * t3 - 0.5 * t2;
  w[1][0] = -0.5 + 2.0 * t - 1.5 * t2, w[1][1] = 4.5 * t2 - 5.0 * t;
  w[1][2] = 0.5 + 4.0 * t - 4.5 * t2, w[1][3] = 1.5 * t2 - t;
  w[2][0] = 2.0 - 3.0 * t, w[2][1] = 9.0 * t - 5.0;
  w[2][2] = 4.0 - 9.0 * t, w[2][3] = 3.0 * t - 1.0;
}

/* Replaces weights of places beyond the grid, where the slope across its border runs out: with b
 * and s at the border the height is b + s (1 - (1 - u)^3)/3 run-out lengths, u in [0, 1]. */
HX_RARE void run_out(const hxGridPlace *at, hxReal per_cell, hxReal w[3][4]) {
  const double length = 0.06; /* m */
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0), cells = length * per_cell;
  const hxReal way = hx_select(hx_less(at->beyond, zero), -cells, cells);
  const hxReal left = hx_max(one - at->beyond / way, zero);
  const hxReal rise = way * (one - left * left * left) * (1.0 / 3.0);
  for (int i = 0; i < 4; ++i) {
    const hxReal slope = w[1][i];
    w[0][i] = hx_select(at->outside, w[0][i] + rise * slope, w[0][i]);
    w[1][i] = hx_select(at->outside, left * left * slope, slope);
    w[2][i] = hx_select(at->outside, (-2.0 * left / way) * slope, w[2][i]);
  }
}

/* Returns whether a patch has nodes beyond the grid. */
static inline int is_at_border(const hxTerrain *terrain, int64_t col, int64_t row) {
  return col < 1 || row < 1 || col + 2 >= terrain->head.cols || row + 2 >= terrain->head.rows;
}

/* Copies the 4 x 4 nodes of a lane's patch. */
static inline void copy_nodes(const hxTerrain *terrain, int lane, hxPatchNodes *at) {
  const int64_t cols = terrain->head.cols, c = (int64_t)at->col[lane], r = (int64_t)at->row[lane];
  const double *first = terrain->height + (r - 1) * cols + (c - 1);
  double border[4][4];
  int64_t stride = cols;
  if (is_at_border(terrain, c, r)) {
    hx_terrain_border_nodes(terrain, r, c, border);
    first = border[0], stride = 4;
  }
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 4; ++k) at->node[i][k][lane] = first[i * stride + k];
}

/* Copies the nodes of all lanes, pack by pack: a pack that is stored as a whole is read without
 * waiting for eight stores. */
static inline void copy_all_nodes(const hxTerrain *terrain, hxPatchNodes *at) {
  const int64_t cols = terrain->head.cols;
  const double *first[HX_LANES];
  int borders = 0;
  for (int lane = 0; lane < HX_LANES; ++lane) {
    const int64_t c = (int64_t)at->col[lane], r = (int64_t)at->row[lane];
    borders |= is_at_border(terrain, c, r);
    first[lane] = terrain->height + (r * cols + c);
  }
  for (int i = 0; i < 4 && !borders; ++i)
    for (int k = 0; k < 4; ++k)
      hx_store(at->node[i][k], hx_gather(first, (i - 1) * cols + (k - 1)));
  for (int lane = 0; borders && lane < HX_LANES; ++lane) copy_nodes(terrain, lane, at);
}

/* Moves the places of a stencil to (x, y). */
static inline void move_places(const hxTerrain *terrain, hxReal x, hxReal y, hxStencil *at) {
  const hxGridHead *head = &terrain->head;
  at->x = grid_place(x, head->x0, terrain->per_cell, head->cols);
  at->y = grid_place(y, head->y0, terrain->per_cell, head->rows);
}

/* Returns where two numbers are different. */
static inline hxMask differ(hxReal a, hxReal b) { return hx_less(a, b) | hx_less(b, a); }

/* Copies the nodes of the lanes `moved`. */
HX_RARE void change_nodes(const hxTerrain *terrain, hxMask active, hxMask moved, hxStencil *at) {
  double has_moved[HX_LANES];
  hxPatchNodes *of = at->of;
  if (!hx_any(active & ~moved)) moved = hx_less(hx_splat(0.0), hx_splat(1.0));
  hx_store(of->col, hx_select(moved, at->x.node, hx_load(of->col)));
  hx_store(of->row, hx_select(moved, at->y.node, hx_load(of->row)));
  if (!hx_any(~moved)) {
    copy_all_nodes(terrain, of);
    return;
  }
  hx_store(has_moved, hx_select(moved, hx_splat(1.0), hx_splat(0.0)));
  for (int lane = 0; lane < HX_LANES; ++lane)
    if (has_moved[lane] > 0.0) copy_nodes(terrain, lane, of);
}

/* Moves a stencil to (x, y), in the lanes `active` with its nodes. */
static inline void move_stencil(const hxTerrain *terrain, hxMask active, hxReal x, hxReal y,
                                hxStencil *at) {
  move_places(terrain, x, y, at);
  const hxMask moved = active & (differ(at->x.node, hx_load(at->of->col)) |
                                 differ(at->y.node, hx_load(at->of->row)));
  if (hx_any(moved)) change_nodes(terrain, active, moved, at);
}

/* Computes the height of the surface over the points of a stencil, and its derivatives (eq. 32). */
static inline hxPatch height_and_slopes(const hxTerrain *terrain, const hxStencil *at) {
  const hxPatchNodes *of = at->of;
  hxReal wx[3][4], wy[3][4], line[3][4], sum[3][3]; /* sum: [derivatives by y][by x] */
  cubic_weights(at->x.place, wx);
  cubic_weights(at->y.place, wy);
  const hxReal per_cell = hx_splat(terrain->per_cell);
  if (hx_any(at->x.outside | at->y.outside)) {
    run_out(&at->x, per_cell, wx);
    run_out(&at->y, per_cell, wy);
  }
  for (int i = 0; i < 4; ++i) {
    const hxReal a = hx_load(of->node[i][0]), b = hx_load(of->node[i][1]),
                 c = hx_load(of->node[i][2]), d = hx_load(of->node[i][3]);
    for (int k = 0; k < 3; ++k)
      line[k][i] = (wx[k][0] * a + wx[k][1] * b) + (wx[k][2] * c + wx[k][3] * d);
  }
  for (int j = 0; j < 3; ++j)
    for (int k = 0; j + k < 3; ++k)
      sum[j][k] = (wy[j][0] * line[k][0] + wy[j][1] * line[k][1]) +
                  (wy[j][2] * line[k][2] + wy[j][3] * line[k][3]);
  const hxReal square = per_cell * per_cell;
  return (hxPatch){.s = sum[0][0],
                   .sx = sum[0][1] * per_cell,
                   .sy = sum[1][0] * per_cell,
                   .sxx = sum[0][2] * square,
                   .sxy = sum[1][1] * square,
                   .syy = sum[2][0] * square};
}

/* Hessian of half the squared distance from a point rz below the surface, or its part without the
 * surface's bend where the whole has no minimum. */
typedef struct {
  hxReal xx, xy, yy, per_det;
} hxHessian;

static inline hxHessian hessian_of(const hxPatch *p, hxReal rz) {
  const hxReal gxx = 1.0 + p->sx * p->sx, gyy = 1.0 + p->sy * p->sy, gxy = p->sx * p->sy;
  const hxReal xx = gxx + rz * p->sxx, xy = gxy + rz * p->sxy, yy = gyy + rz * p->syy;
  const hxReal det = xx * yy - xy * xy, least = hx_splat(0.1);
  const hxMask whole = hx_less(least, xx) & hx_less(least, det);
  return (hxHessian){hx_select(whole, xx, gxx), hx_select(whole, xy, gxy),
                     hx_select(whole, yy, gyy), 1.0 / hx_select(whole, det, gxx * gyy - gxy * gxy)};
}

/* Moves the patch along the surface by its own second-order expansion. */
static inline hxPatch moved_patch(const hxPatch *p, hxReal dx, hxReal dy) {
  hxPatch moved = *p;
  moved.s += dx * (p->sx + 0.5 * (p->sxx * dx + p->sxy * dy)) +
             dy * (p->sy + 0.5 * (p->sxy * dx + p->syy * dy));
  moved.sx += p->sxx * dx + p->sxy * dy;
  moved.sy += p->sxy * dx + p->syy * dy;
  return moved;
}

/* Returns which lanes are on the same patch still after a move. */
static inline hxMask stays_in_patch(const hxTerrain *terrain, const hxStencil *at, hxReal dx,
                                    hxReal dy) {
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0), u = at->x.place + terrain->per_cell * dx,
               v = at->y.place + terrain->per_cell * dy;
  return hx_less(u, one) & hx_less(v, one) &
         ~(hx_less(u, zero) | hx_less(v, zero) | at->x.outside | at->y.outside);
}

/* Returns the share of a move of these squares that is made: at most a cell. */
static inline hxReal share_of_move(const hxTerrain *terrain, hxReal square) {
  const hxReal one = hx_splat(1.0), cell = hx_splat(terrain->head.cell);
  const hxMask far = hx_less(cell * cell, square);
  return hx_any(far) ? hx_select(far, cell / hx_sqrt(hx_select(far, square, one)), one) : one;
}

/* A nearest point: (x, y), the surface there and the Hessian. */
typedef struct {
  hxReal x, y;
  hxPatch p;
  hxHessian H;
} hxNearest;

static inline hxReal *entries_of(hxNearest *nearest) { return &nearest->x; }

/* Replaces a nearest point in some lanes. */
static inline void replace_nearest(hxMask mask, hxNearest new, hxNearest *nearest) {
  enum { SIZE = sizeof(hxNearest) / sizeof(hxReal) };
  for (int i = 0; i < SIZE; ++i)
    entries_of(nearest)[i] = hx_select(mask, entries_of(&new)[i], entries_of(nearest)[i]);
}

/* Squares of Newton's last step over the cell's. Its end is found by the patch's expansion: third
 * derivatives, and at a border the jump of the second ones, are left out. */
static const double close = 1e-7, closest = 1e-14;

/* Newton's method that still moves by this share of a cell, squared, has not found a point. */
static const double not_found = 1e-4;

/* A step of Newton's method from a place with this patch, and its square. */
typedef struct {
  hxReal dx, dy, square;
  hxHessian H;
} hxMove;

static inline hxMove move_from(const hxPatch *p, hxReal x, hxReal y, const hxReal point[3]) {
  const hxReal rz = p->s - point[2];
  const hxReal gx = (x - point[0]) + p->sx * rz, gy = (y - point[1]) + p->sy * rz;
  const hxHessian H = hessian_of(p, rz);
  const hxReal dx = H.per_det * (H.xy * gy - H.yy * gx), dy = H.per_det * (H.xy * gx - H.xx * gy);
  return (hxMove){dx, dy, dx * dx + dy * dy, H};
}

/* Keeps the patches of some lanes, except beyond the grid. */
static inline void keep_patches(hxMask mask, const hxStencil *at, hxReal x, hxReal y,
                                const hxPatch *p) {
  const hxReal entry[6] = {p->s, p->sx, p->sy, p->sxx, p->sxy, p->syy};
  hxPatchNodes *of = at->of;
  mask &= ~(at->x.outside | at->y.outside);
  hx_store(of->is_kept, hx_select(mask, hx_splat(1.0), hx_load(of->is_kept)));
  hx_store(of->x, hx_select(mask, x, hx_load(of->x)));
  hx_store(of->y, hx_select(mask, y, hx_load(of->y)));
  for (int i = 0; i < 6; ++i)
    hx_store(of->patch[i], hx_select(mask, entry[i], hx_load(of->patch[i])));
}

/* Finds nearest points by the expansions of patches that are kept, and returns in which of the
 * lanes `wanted` they are so close that this is as exact as Newton's last step. */
static inline hxMask find_by_kept_patches(const hxTerrain *terrain, hxMask wanted,
                                          const hxReal point[3], const hxPatchNodes *of,
                                          hxNearest *found) {
  const hxGridHead *head = &terrain->head;
  const hxReal zero = hx_splat(0.0), one = hx_splat(1.0), x = hx_load(of->x), y = hx_load(of->y);
  const hxMask kept = wanted & hx_less(zero, hx_load(of->is_kept));
  if (!hx_any(kept)) return kept;
  const hxPatch p = {hx_load(of->patch[0]), hx_load(of->patch[1]), hx_load(of->patch[2]),
                     hx_load(of->patch[3]), hx_load(of->patch[4]), hx_load(of->patch[5])};
  const hxMove move = move_from(&p, x, y, point);
  *found = (hxNearest){x + move.dx, y + move.dy, moved_patch(&p, move.dx, move.dy), move.H};
  const hxReal u = (found->x - head->x0) * terrain->per_cell - hx_load(of->col),
               v = (found->y - head->y0) * terrain->per_cell - hx_load(of->row);
  return kept & ~hx_less(hx_splat(close * (head->cell * head->cell)), move.square) &
         hx_less(u, one) & hx_less(v, one) & ~(hx_less(u, zero) | hx_less(v, zero));
}

/* Sets the nearest points of some lanes to those below. Far above a rough surface, beyond the
 * centres of its curvature, Newton's method may find none; the distance is then that of the plane
 * at the point below, which is far, too. */
static inline void use_points_below(const hxTerrain *terrain, hxMask mask, const hxReal point[3],
                                    hxStencil *at, hxNearest *found) {
  move_stencil(terrain, mask, point[0], point[1], at);
  replace_nearest(mask, (hxNearest){point[0], point[1], height_and_slopes(terrain, at), found->H},
                  found);
}

/* Replaces the nearest points of the lanes `active` by those of Newton's method from (x, y). */
static inline void search_nearest(const hxTerrain *terrain, hxMask active, const hxReal point[3],
                                  hxReal x, hxReal y, int exactly, hxPatchNodes *nodes,
                                  hxNearest *found) {
  enum { MOST = 40 };
  const double area = terrain->head.cell * terrain->head.cell;
  hxStencil at;
  at.of = nodes;
  move_stencil(terrain, active, x, y, &at);
  for (int i = 0;; ++i) {
    const hxPatch p = height_and_slopes(terrain, &at);
    const hxMove move = move_from(&p, x, y, point);
    hxMask done = ~hx_less(hx_splat(closest * area), move.square);
    if (!exactly) {
      keep_patches(active, &at, x, y, &p);
      done |= ~hx_less(hx_splat(close * area), move.square) &
              stays_in_patch(terrain, &at, move.dx, move.dy);
    }
    if (i == MOST) done = active;
    const hxNearest end = {x + move.dx, y + move.dy, moved_patch(&p, move.dx, move.dy), move.H};
    replace_nearest(done & active, end, found);
    const hxMask none =
        i == MOST ? active & hx_less(hx_splat(not_found * area), move.square) : active ^ active;
    if (hx_any(none)) use_points_below(terrain, none, point, &at, found);
    active &= ~done;
    if (!hx_any(active)) return;
    const hxReal share = share_of_move(terrain, move.square);
    x += share * move.dx, y += share * move.dy;
    move_stencil(terrain, active, x, y, &at);
  }
}

/* Computes the nearest points of a smooth surface to the lanes `wanted` by Newton's method on
 * their two parameters (eq. 33), from the points below moved by `start`. With `exactly`, also the
 * second derivatives belong to the nearest point. `nodes` are those of an earlier search on the
 * same terrain, or empty. */
static inline hxNearest hx_nearest_point(const hxTerrain *terrain, hxMask wanted,
                                         const hxReal point[3], const hxReal start[2], int exactly,
                                         hxPatchNodes *nodes) {
  const hxReal zero = hx_splat(0.0);
  hxNearest found = {zero, zero, {zero, zero, zero, zero, zero, zero}, {zero, zero, zero, zero}};
  const hxMask known = find_by_kept_patches(terrain, wanted, point, nodes, &found),
               unknown = wanted & ~known;
  if (hx_any(unknown))
    search_nearest(terrain, unknown, point, point[0] + start[0], point[1] + start[1], exactly,
                   nodes, &found);
  return found;
}

/* Returns the signed distance of points from the surface at their nearest points (eq. 31), and sets
 * the normals there. */
static inline hxReal hx_smooth_distance(const hxNearest *at, const hxReal point[3],
                                        hxReal normal[3]) {
  const hxPatch *p = &at->p;
  const hxReal per_n = 1.0 / hx_sqrt(1.0 + p->sx * p->sx + p->sy * p->sy);
  normal[0] = -p->sx * per_n, normal[1] = -p->sy * per_n, normal[2] = per_n;
  return (point[0] - at->x) * normal[0] + (point[1] - at->y) * normal[1] +
         (point[2] - p->s) * normal[2];
}

#endif
