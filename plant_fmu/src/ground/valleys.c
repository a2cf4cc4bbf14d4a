#include "valleys.h"

#include <math.h>

enum { SAMPLES = 5, ROUNDS = 8 };    /* places along an edge of a cell, searches at half the size */
static const double promising = 0.7; /* 1  of the largest curvature; cells below it are left */

/* Largest magnitudes of the second differences of a row of nodes, along it and across it, and of
 * the mixed differences between it and the next row, m. */
typedef struct {
  double along, across, mixed;
} hxRowBends;

static double larger(double a, double b) { return a > b ? a : b; }

/* Returns the weights of four nodes at t by Catmull and Rom's cubic (0), and their derivatives. */
static void weights_at(double t, double w[3][4]) {
  const double t2 = t * t, t3 = t2 * t;
  const double value[4] = {0.5 * (2.0 * t2 - t - t3), 1.0 - 2.5 * t2 + 1.5 * t3,
                           0.5 * (t + 4.0 * t2 - 3.0 * t3), 0.5 * (t3 - t2)},
               first[4] = {0.5 * (4.0 * t - 1.0 - 3.0 * t2), 4.5 * t2 - 5.0 * t,
                           0.5 * (1.0 + 8.0 * t - 9.0 * t2), 0.5 * (3.0 * t2 - 2.0 * t)},
               second[4] = {2.0 - 3.0 * t, 9.0 * t - 5.0, 4.0 - 9.0 * t, 3.0 * t - 1.0};
  for (int i = 0; i < 4; ++i) w[0][i] = value[i], w[1][i] = first[i], w[2][i] = second[i];
}

/* Returns the sum of nodes with weights along rows and columns. */
static double blend(const double node[4][4], const double row[4], const double col[4]) {
  double sum = 0.0;
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 4; ++k) sum += row[i] * col[k] * node[i][k];
  return sum;
}

/* Returns the larger principal curvature, 1/m, at a place (row, column) from 0 to 1 in a cell. */
static double curvature_at(const double node[4][4], double per_cell, double u, double t) {
  double a[3][4], b[3][4];
  weights_at(u, a);
  weights_at(t, b);
  const double square = per_cell * per_cell;
  const double p = per_cell * blend(node, a[0], b[1]), q = per_cell * blend(node, a[1], b[0]);
  const double xx = square * blend(node, a[0], b[2]), xy = square * blend(node, a[1], b[1]),
               yy = square * blend(node, a[2], b[0]);
  const double g = 1.0 + p * p + q * q;
  const double mean = ((1.0 + q * q) * xx - 2.0 * p * q * xy + (1.0 + p * p) * yy) /
                      (2.0 * g * sqrt(g)),
               gauss = (xx * yy - xy * xy) / (g * g);
  return mean + sqrt(larger(mean * mean - gauss, 0.0));
}

/* Widens a range to the second derivatives of a cubic at its ends, by second differences there. */
static void widen_bends(double before, double behind, double range[2]) {
  const double begin = 2.0 * before - behind, end = 2.0 * behind - before;
  range[0] = fmin(range[0], fmin(begin, end));
  range[1] = fmax(range[1], fmax(begin, end));
}

/* Returns an upper bound of the curvature of a cell, 1/m: second derivatives by one coordinate are
 * cubic in the other, with negative weights that sum to -1/8 at most; the weights of a slope sum to
 * 3/2. Slopes only lower the curvature. */
static double bound_of(const double node[4][4], double per_cell) {
  double x[2] = {HUGE_VAL, -HUGE_VAL}, y[2] = {HUGE_VAL, -HUGE_VAL}, mixed = 0.0;
  for (int i = 0; i < 4; ++i) {
    const double *n = node[i];
    widen_bends(n[0] - 2.0 * n[1] + n[2], n[1] - 2.0 * n[2] + n[3], x);
    widen_bends(node[0][i] - 2.0 * node[1][i] + node[2][i],
                node[1][i] - 2.0 * node[2][i] + node[3][i], y);
  }
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k)
      mixed =
          larger(mixed, fabs(node[i + 1][k + 1] - node[i + 1][k] - node[i][k + 1] + node[i][k]));
  const double bend_x = 1.125 * x[1] - 0.125 * x[0], bend_y = 1.125 * y[1] - 0.125 * y[0],
               half = 0.5 * (bend_x - bend_y), twist = 2.25 * mixed;
  return (0.5 * (bend_x + bend_y) + sqrt(half * half + twist * twist)) * per_cell * per_cell;
}

/* Copies the 4 x 4 nodes around a cell. */
static void nodes_around(const hxTerrain *terrain, int64_t row, int64_t col, double node[4][4]) {
  const int64_t rows = terrain->head.rows, cols = terrain->head.cols;
  if (row < 1 || col < 1 || row + 2 >= rows || col + 2 >= cols) {
    hx_terrain_border_nodes(terrain, row, col, node);
    return;
  }
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 4; ++k) node[i][k] = terrain->height[(row + i - 1) * cols + col + k - 1];
}

/* Searches the sharpest place of a cell on grids of half the size each time, and keeps it if it is
 * sharper than those before. */
static void search_cell(const hxTerrain *terrain, int64_t row, int64_t col, const double node[4][4],
                        hxValley *found, double *sharpest) {
  double u = 0.5, t = 0.5, largest = 0.0, half = 0.5;
  for (int round = 0; round < ROUNDS; ++round, half *= 0.5) {
    double best_u = u, best_t = t;
    largest = -HUGE_VAL;
    for (int i = 0; i < SAMPLES; ++i)
      for (int k = 0; k < SAMPLES; ++k) {
        const double at_u = fmin(fmax(u + half * (0.5 * i - 1.0), 0.0), 1.0),
                     at_t = fmin(fmax(t + half * (0.5 * k - 1.0), 0.0), 1.0),
                     c = curvature_at(node, terrain->per_cell, at_u, at_t);
        if (c > largest) largest = c, best_u = at_u, best_t = at_t;
      }
    u = best_u, t = best_t;
    if (largest < promising * *sharpest) return;
  }
  if (!(largest > *sharpest)) return;
  *sharpest = largest;
  found->radius = 1.0 / largest;
  found->x = terrain->head.x0 + terrain->head.cell * ((double)col + t);
  found->y = terrain->head.y0 + terrain->head.cell * ((double)row + u);
}

static void visit_cell(const hxTerrain *terrain, int64_t row, int64_t col, hxValley *found,
                       double *sharpest) {
  double node[4][4];
  nodes_around(terrain, row, col, node);
  const double (*nodes)[4] = (const double (*)[4])node;
  if (bound_of(nodes, terrain->per_cell) > *sharpest)
    search_cell(terrain, row, col, nodes, found, sharpest);
}

/* Returns the largest differences of an inner row of nodes. */
static hxRowBends bends_of_row(const hxTerrain *terrain, int64_t row) {
  const int64_t cols = terrain->head.cols;
  const double *h = terrain->height + row * cols, *below = h - cols, *above = h + cols;
  hxRowBends found = {0.0, 0.0, 0.0};
  for (int64_t k = 1; k + 1 < cols; ++k) {
    found.along = larger(found.along, fabs(h[k - 1] - 2.0 * h[k] + h[k + 1]));
    found.across = larger(found.across, fabs(below[k] - 2.0 * h[k] + above[k]));
    found.mixed = larger(found.mixed, fabs(above[k] - above[k - 1] - h[k] + h[k - 1]));
  }
  found.across = larger(found.across, fabs(below[0] - 2.0 * h[0] + above[0]));
  found.across = larger(found.across, fabs(below[cols - 1] - 2.0 * h[cols - 1] + above[cols - 1]));
  found.mixed =
      larger(found.mixed, fabs(above[cols - 1] - above[cols - 2] - h[cols - 1] + h[cols - 2]));
  return found;
}

/* Returns an upper bound of the curvatures of an inner row of cells between nodes with these bends,
 * 1/m: those of the rows around it. */
static double bound_of_row(const hxRowBends around[4], double per_cell) {
  double bend = 0.0, mixed = 0.0;
  for (int i = 0; i < 4; ++i) {
    bend = larger(bend, larger(around[i].along, around[i].across));
    mixed = larger(mixed, around[i].mixed);
  }
  return (3.75 * bend + 2.25 * mixed) * per_cell * per_cell;
}

hxValley hx_terrain_valley(const hxTerrain *terrain, double limit) {
  const int64_t rows = terrain->head.rows, cols = terrain->head.cols;
  hxValley found = {0.0, 0.0, 0.0};
  hxRowBends around[4] = {{0.0, 0.0, 0.0}};
  double sharpest = 1.0 / limit;
  if (terrain->head.kind != HX_SURFACE_SMOOTH) return found;
  for (int64_t row = 0; row + 1 < rows; ++row) {
    /* rows whose nodes are all inner ones have a common bound; the others are visited */
    const int inner = row >= 2 && row + 3 < rows;
    for (int i = 0; inner && i < 4; ++i) {
      if (row > 2 && i < 3)
        around[i] = around[i + 1];
      else
        around[i] = bends_of_row(terrain, row + i - 1);
    }
    const int visited = !inner || bound_of_row(around, terrain->per_cell) > sharpest;
    for (int64_t col = 0; col + 1 < cols; ++col)
      if (visited || col == 0 || col + 2 == cols) visit_cell(terrain, row, col, &found, &sharpest);
  }
  return found;
}
