/* surface.c - reads a grid's file, and finds the nearest point of its blocks, and of a smooth
 * surface by the kernels' smooth.h; models/ground is the readable form */
#include "surface.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hexapod/message.h"
#include "soil.h"

#define HX_LANES 1
#include "smooth.h"

const double hx_far = 1e3;

/* Limits of grid files: nodes each way, m, m. */
static const int64_t most_nodes = 1 << 20;
static const double highest = 1e4, farthest = 1e6, cell_range[2] = {1e-4, 1e3};

/* ---- the file ---- */

/* Writes what is wrong with a number of the head and returns 0. */
static int refuse(char *message, const char *what, double got, const char *expected) {
  hx_print(message, HX_MESSAGE_SIZE, "terrain grid: %s: got %.9g, expected %s", what, got,
           expected);
  return 0;
}

static int is_within(double x, double low, double high) { return x >= low && x <= high; }

/* Returns whether the head describes a grid. */
static int check_head(const hxGridHead *head, char *message) {
  const int64_t least = head->kind == HX_SURFACE_SMOOTH ? 2 : 1;
  if (memcmp(head->magic, "hxGrid01", sizeof head->magic) != 0) {
    hx_print(message, HX_MESSAGE_SIZE,
             "terrain grid: got bytes that do not begin with hxGrid01, expected a grid file of "
             "version 1");
    return 0;
  }
  if (head->kind != HX_SURFACE_SMOOTH && head->kind != HX_SURFACE_BLOCKS)
    return refuse(message, "kind", (double)head->kind, "1 (smooth) or 2 (blocks)");
  if (head->rows < least || head->rows > most_nodes)
    return refuse(message, "rows", (double)head->rows,
                  least == 2 ? "2 to 1048576 for a smooth surface" : "1 to 1048576");
  if (head->cols < least || head->cols > most_nodes)
    return refuse(message, "cols", (double)head->cols,
                  least == 2 ? "2 to 1048576 for a smooth surface" : "1 to 1048576");
  if (head->materials < 0 || head->materials > 255)
    return refuse(message, "materials", (double)head->materials, "0 to 255");
  if (!is_within(head->x0, -farthest, farthest))
    return refuse(message, "x0", head->x0, "-1e6 to 1e6 m");
  if (!is_within(head->y0, -farthest, farthest))
    return refuse(message, "y0", head->y0, "-1e6 to 1e6 m");
  if (!is_within(head->cell, cell_range[0], cell_range[1]))
    return refuse(message, "cell", head->cell, "1e-4 to 1000 m");
  return 1;
}

/* Returns the size of the material map with its padding. */
static uint64_t map_size(const hxGridHead *head) {
  const uint64_t nodes = (uint64_t)head->rows * (uint64_t)head->cols;
  return head->materials > 0 ? (nodes + 7) / 8 * 8 : 0;
}

/* Returns the size of the file that the head describes. */
static uint64_t file_size(const hxGridHead *head) {
  const uint64_t nodes = (uint64_t)head->rows * (uint64_t)head->cols;
  return sizeof *head + 8 * nodes + map_size(head) +
         8 * HX_MATERIAL_COLUMNS * (uint64_t)head->materials;
}

/* Returns whether all heights are in their range; one sum per row finds numbers that are not. */
static int check_heights(const hxTerrain *terrain, char *message) {
  const int64_t rows = terrain->head.rows, cols = terrain->head.cols;
  for (int64_t row = 0; row < rows; ++row) {
    const double *height = terrain->height + row * cols;
    int bad = 0;
    for (int64_t col = 0; col < cols; ++col) bad |= !(fabs(height[col]) <= highest);
    for (int64_t col = 0; bad && col < cols; ++col)
      if (!(fabs(height[col]) <= highest)) {
        hx_print(message, HX_MESSAGE_SIZE,
                 "terrain grid: height[%lld][%lld]: got %.9g, expected -1e4 to 1e4 m; fill gaps of "
                 "the map",
                 (long long)row, (long long)col, height[col]);
        return 0;
      }
  }
  return 1;
}

/* Returns whether materials are rows of the table, and the table's numbers in their ranges. */
static int check_materials(const hxTerrain *terrain, char *message) {
  const int64_t nodes = terrain->head.rows * terrain->head.cols, n = terrain->head.materials;
  for (int64_t i = 0; terrain->material && i < nodes; ++i)
    if (terrain->material[i] > n)
      return refuse(message, "material", terrain->material[i], "0 or a row of the table");
  for (int64_t i = 0; i < n; ++i) {
    const double *row = terrain->table + HX_MATERIAL_COLUMNS * i;
    if (!isnan(row[HX_MATERIAL_MU]) && !is_within(row[HX_MATERIAL_MU], 0.0, 100.0))
      return refuse(message, "table: mu", row[HX_MATERIAL_MU], "0 to 100, or NaN");
    if (!isnan(row[HX_MATERIAL_MU_STATIC]) && !is_within(row[HX_MATERIAL_MU_STATIC], 0.0, 100.0))
      return refuse(message, "table: mu_static", row[HX_MATERIAL_MU_STATIC], "0 to 100, or NaN");
    if (!isnan(row[HX_MATERIAL_STIFFNESS]) && !is_within(row[HX_MATERIAL_STIFFNESS], 1e-3, 1e14))
      return refuse(message, "table: stiffness", row[HX_MATERIAL_STIFFNESS],
                    "1e-3 to 1e14 N/m^1.5, or NaN");
    const int column = hx_soil_row_error(row + HX_MATERIAL_SOIL);
    if (terrain->head.kind == HX_SURFACE_BLOCKS && row[HX_MATERIAL_SOIL] != 0.0)
      return refuse(message, "table: soil law of blocks", row[HX_MATERIAL_SOIL],
                    "0: blocks are rigid; use a smooth surface");
    if (column == 0)
      return refuse(message, "table: soil law", row[HX_MATERIAL_SOIL], "0, 1, 2 or 3");
    if (column > 0)
      return refuse(message, "table: number of a soil", row[HX_MATERIAL_SOIL + column],
                    "a finite number >= 0; shear displacement, stiffness and exponent > 0");
  }
  return 1;
}

/* Reach of a tile: m, and cells at least. Tiles have at least two cells along an edge. */
static const double least_reach = HX_LEAST_REACH;

static int64_t cells_of_reach(const hxGridHead *head) {
  const double cells = ceil(least_reach / head->cell);
  return (int64_t)cells;
}

static int64_t cells_of_tile(const hxGridHead *head) {
  const int64_t cells = cells_of_reach(head);
  return cells > 2 ? cells : 2;
}

/* Returns how many tiles cover n nodes. */
static int64_t tiles_over(const hxGridHead *head, int64_t n) {
  const int64_t cells = cells_of_tile(head);
  return (n + cells - 1) / cells;
}

/* Copies the file after its head and sets the pointers to its parts. */
static hxTerrain *copy_file(const hxGridHead *head, const void *bytes, size_t size) {
  const int64_t tile_rows = tiles_over(head, head->rows), tile_cols = tiles_over(head, head->cols);
  const size_t tops = (size_t)(tile_rows * tile_cols) * sizeof(double);
  hxTerrain *terrain = malloc(sizeof *terrain + (size - sizeof *head) + tops);
  if (!terrain) return NULL;
  memcpy(terrain->bytes, (const char *)bytes + sizeof *head, size - sizeof *head);
  const char *map = (const char *)(terrain->bytes + head->rows * head->cols);
  terrain->head = *head;
  terrain->per_cell = 1.0 / head->cell;
  terrain->checksum = hx_checksum(0, bytes, size);
  terrain->height = terrain->bytes;
  terrain->material = head->materials > 0 ? (const unsigned char *)map : NULL;
  terrain->table = terrain->bytes + head->rows * head->cols + (int64_t)(map_size(head) / 8);
  terrain->top = terrain->bytes + (size - sizeof *head) / sizeof(double);
  terrain->tile_rows = tile_rows, terrain->tile_cols = tile_cols;
  const int64_t tile = cells_of_tile(head), reach = cells_of_reach(head);
  terrain->per_tile = 1.0 / ((double)tile * head->cell);
  terrain->reach = (double)reach * head->cell;
  return terrain;
}

/* Lowest and highest of some heights, m. */
typedef struct {
  double low, high;
} hxHeights;

/* Nodes from first to last along a line of n, those that tile i reaches: its patches depend on a
 * node before and two behind them. */
typedef struct {
  int64_t first, last;
  int at_border;
} hxNodes;

static hxNodes nodes_of_tile(const hxGridHead *head, int64_t tile, int64_t n) {
  const int64_t cells = cells_of_tile(head), reach = cells_of_reach(head);
  const int64_t first = tile * cells - reach - 1, last = (tile + 1) * cells - 1 + reach + 2;
  return (hxNodes){first < 0 ? 0 : first, last < n - 1 ? last : n - 1, first < 0 || last > n - 1};
}

static void widen(hxHeights *heights, double low, double high) {
  heights->low = low < heights->low ? low : heights->low;
  heights->high = high > heights->high ? high : heights->high;
}

/* Returns an upper bound of the ground between nodes of these heights: the weights of a patch have
 * magnitudes that add up to at most 5/4 along each axis; beyond the map, where nodes continue
 * linearly, the bound is coarser. */
static double top_over(const hxTerrain *terrain, const hxHeights *heights, int at_border) {
  const double middle = 0.5 * (heights->low + heights->high),
               half = 0.5 * (heights->high - heights->low), rounding = 1e-9;
  if (terrain->head.kind == HX_SURFACE_BLOCKS) return heights->high + rounding;
  /* the run-out: nodes of the border with 1 + 2 g, g of the last slope in cells */
  const double beyond = 1.0 + 2.0 * (0.06 / 3.0) / terrain->head.cell,
               most = beyond * beyond > 15.0 ? beyond * beyond : 15.0;
  return middle + (at_border ? most : 25.0 / 16.0) * half + rounding;
}

/* Computes the tops of a row of tiles, from lowest and highest heights of each column. */
static void fill_tops(hxTerrain *terrain, int64_t tile_row, hxHeights *column) {
  const hxGridHead *head = &terrain->head;
  const hxNodes rows = nodes_of_tile(head, tile_row, head->rows);
  for (int64_t row = rows.first; row <= rows.last; ++row) {
    const double *height = terrain->height + row * head->cols;
    for (int64_t col = 0; col < head->cols; ++col) {
      if (row == rows.first) column[col] = (hxHeights){height[col], height[col]};
      widen(&column[col], height[col], height[col]);
    }
  }
  for (int64_t tile = 0; tile < terrain->tile_cols; ++tile) {
    const hxNodes cols = nodes_of_tile(head, tile, head->cols);
    hxHeights all = column[cols.first];
    for (int64_t col = cols.first; col <= cols.last; ++col)
      widen(&all, column[col].low, column[col].high);
    const double top = top_over(terrain, &all, rows.at_border || cols.at_border);
    terrain->top[tile_row * terrain->tile_cols + tile] = top;
    terrain->highest = top > terrain->highest ? top : terrain->highest;
  }
}

/* Computes the tops of all tiles; returns 0 when out of memory. */
static int make_tops(hxTerrain *terrain) {
  hxHeights *column = malloc((size_t)terrain->head.cols * sizeof *column);
  if (!column) return 0;
  terrain->highest = -HUGE_VAL;
  for (int64_t row = 0; row < terrain->tile_rows; ++row) fill_tops(terrain, row, column);
  free(column);
  return 1;
}

/* Refuses a grid for lack of memory. */
static hxTerrain *refuse_memory(hxTerrain *terrain, char *message) {
  hx_print(message, HX_MESSAGE_SIZE, "terrain grid: out of memory; free some and try again");
  hx_terrain_destroy(terrain);
  return NULL;
}

hxTerrain *hx_terrain_create(const void *bytes, size_t size, char *message) {
  hxGridHead head;
  if (size < sizeof head) {
    refuse(message, "size", (double)size, "at least the 128 bytes of a grid file's head");
    return NULL;
  }
  memcpy(&head, bytes, sizeof head);
  if (!check_head(&head, message)) return NULL;
  if (file_size(&head) != size) {
    hx_print(message, HX_MESSAGE_SIZE,
             "terrain grid: size: got %llu bytes, expected %llu for its rows, cols and materials; "
             "the file is cut off or damaged",
             (unsigned long long)size, (unsigned long long)file_size(&head));
    return NULL;
  }
  hxTerrain *terrain = copy_file(&head, bytes, size);
  if (!terrain) return refuse_memory(NULL, message);
  if (!(check_heights(terrain, message) && check_materials(terrain, message))) {
    hx_terrain_destroy(terrain);
    return NULL;
  }
  return make_tops(terrain) ? terrain : refuse_memory(terrain, message);
}

void hx_terrain_destroy(hxTerrain *terrain) { free(terrain); }
uint64_t hx_terrain_checksum(const hxTerrain *terrain) { return terrain->checksum; }
hxTerrainSurface hx_terrain_surface(const hxTerrain *terrain) {
  return (hxTerrainSurface)terrain->head.kind;
}
double hx_terrain_cell_size(const hxTerrain *terrain) { return terrain->head.cell; }

/* ---- the smooth surface ---- */

/* Copies four nodes of a grid line around a place; nodes beyond the line continue it linearly. */
static void line_nodes(const double *line, int64_t node, int64_t nodes, double out[4]) {
  out[1] = line[node], out[2] = line[node + 1];
  out[0] = node > 0 ? line[node - 1] : 2.0 * out[1] - out[2];
  out[3] = node + 2 < nodes ? line[node + 2] : 2.0 * out[2] - out[1];
}

void hx_terrain_border_nodes(const hxTerrain *terrain, int64_t row, int64_t col, double out[4][4]) {
  const int64_t rows = terrain->head.rows, cols = terrain->head.cols;
  for (int i = 1; i < 3; ++i) line_nodes(terrain->height + (row + i - 1) * cols, col, cols, out[i]);
  for (int i = 0; i < 4; i += 3) {
    const int64_t beyond = row + i - 1;
    const int inner = i == 0 ? 1 : 2, next = i == 0 ? 2 : 1;
    if (beyond >= 0 && beyond < rows)
      line_nodes(terrain->height + beyond * cols, col, cols, out[i]);
    else
      for (int k = 0; k < 4; ++k) out[i][k] = 2.0 * out[inner][k] - out[next][k];
  }
}

/* Sets the face from the nearest point's patch: d normal/d point = -P S H^-1 J^T / |N|, where N =
 * (-s_x, -s_y, 1), P projects across the normal, S is the surface's second derivative and J the
 * derivative of its points. */
static void set_bend(const hxPatch *p, const hxHessian *H, hxFace *face) {
  const double J[2][3] = {{1.0, 0.0, p->sx}, {0.0, 1.0, p->sy}}, *n = face->normal;
  static const int row[6] = {0, 1, 2, 0, 0, 1}, col[6] = {0, 1, 2, 1, 2, 2};
  double turn[3][3];
  for (int k = 0; k < 3; ++k) {
    const double ux = H->per_det * (H->yy * J[0][k] - H->xy * J[1][k]),
                 uy = H->per_det * (H->xx * J[1][k] - H->xy * J[0][k]);
    const double dN[3] = {-(p->sxx * ux + p->sxy * uy), -(p->sxy * ux + p->syy * uy), 0.0};
    const double along = n[0] * dN[0] + n[1] * dN[1];
    for (int i = 0; i < 3; ++i) turn[i][k] = n[2] * (dN[i] - along * n[i]);
  }
  for (int i = 0; i < 6; ++i) face->bend[i] = turn[row[i]][col[i]];
}

static void smooth_face(const hxTerrain *terrain, const double point[3], int bends, hxFace *face) {
  const double below[2] = {0.0, 0.0};
  hxPatchNodes nodes;
  hx_forget_nodes(&nodes);
  const hxNearest nearest = hx_nearest_point(terrain, -1, point, below, bends, &nodes);
  face->distance = hx_smooth_distance(&nearest, point, face->normal);
  if (bends) set_bend(&nearest.p, &nearest.H, face);
}

/* ---- blocks ---- */

void hx_terrain_cell_at(const hxTerrain *terrain, const double point[3], double cell[2]) {
  const hxGridHead *head = &terrain->head;
  const int64_t col = hx_cell_index((point[0] - head->x0) / head->cell, head->cols);
  const int64_t row = hx_cell_index((point[1] - head->y0) / head->cell, head->rows);
  cell[0] = (double)col;
  cell[1] = (double)row;
}

/* Returns how far x is outside of a cell along one axis. */
static double outside_along(double x, double origin, double size, double cell, int64_t n) {
  const double low = origin + size * cell;
  const double below = cell > 0.0 ? low - x : -hx_far;
  const double above = cell < (double)(n - 1) ? x - (low + size) : -hx_far;
  return fmax(below, above);
}

double hx_terrain_outside(const hxTerrain *terrain, const double point[3], const double cell[2]) {
  const hxGridHead *head = &terrain->head;
  return fmax(outside_along(point[0], head->x0, head->cell, cell[0], head->cols),
              outside_along(point[1], head->y0, head->cell, cell[1], head->rows));
}

/* A cell: its column and row, the height of its top, and the ways to those beside it, 0 at the
 * border. */
typedef struct {
  double col, row, own; /* 1, 1, m */
  const double *height; /* of its own top, in the grid */
  int64_t x[3], y[3];   /* from it to the heights at offsets -1, 0, 1 along x and y */
} hxCellAt;

static void set_cell(const hxTerrain *terrain, const double cell[2], hxCellAt *at) {
  const hxGridHead *head = &terrain->head;
  const int64_t c = hx_cell_index(cell[0], head->cols), r = hx_cell_index(cell[1], head->rows);
  at->col = cell[0], at->row = cell[1];
  at->height = terrain->height + r * head->cols + c;
  at->own = *at->height;
  at->x[0] = c > 0 ? -1 : 0, at->x[1] = 0, at->x[2] = c < head->cols - 1 ? 1 : 0;
  at->y[0] = r > 0 ? -head->cols : 0, at->y[1] = 0;
  at->y[2] = r < head->rows - 1 ? head->cols : 0;
}

/* Returns the height of the top of the cell at offsets -1, 0 or 1. */
static double top_beside(const hxCellAt *at, int i, int j) {
  return at->height[at->x[1 + i] + at->y[1 + j]];
}

/* Returns the gap (eq. 34) between a point and the column at offset -1, 0 or 1 from the cell along
 * an axis, 0 for an offset of 0. */
static double gap_to(double x, double origin, double size, double cell, int offset) {
  const double low = origin + size * cell;
  return offset > 0 ? low + size - x : offset < 0 ? x - low : 0.0;
}

/* The nearest of several faces: its distance, and the vector from its nearest point, or a plane's
 * normal. */
typedef struct {
  double distance, away[3];
  int is_plane;
} hxNearestFace;

/* Keeps the face with this distance vector from the column's nearest point if it is nearer. A
 * distance is not less than any component of its vector, also when it is rounded. */
static void keep_nearer(double x, double y, double z, hxNearestFace *face) {
  const double limit = face->distance;
  if (fabs(x) >= limit || fabs(y) >= limit || fabs(z) >= limit) return;
  const double d = sqrt(x * x + y * y + z * z);
  if (!(d < limit)) return;
  face->distance = d, face->is_plane = 0;
  face->away[0] = x, face->away[1] = y, face->away[2] = z;
}

/* Keeps a level or a vertical plane if it is nearer. */
static void keep_plane(double distance, int axis, double sign, hxNearestFace *face) {
  if (!(distance < face->distance)) return;
  face->distance = distance, face->is_plane = 1;
  for (int i = 0; i < 3; ++i) face->away[i] = i == axis ? sign : 0.0;
}

/* Keeps the nearest face or edge of a column beside the cell, at offset sign along an axis. */
static void side_column(double gap, double above, int axis, int sign, hxNearestFace *face) {
  if (above <= 0.0)
    keep_plane(gap, axis, (double)-sign, face);
  else if (gap <= 0.0)
    keep_plane(above, 2, 1.0, face);
  else
    keep_nearer(axis == 0 ? -sign * gap : 0.0, axis == 1 ? -sign * gap : 0.0, above, face);
}

/* Keeps the nearest face of higher columns beside a cell, along x (0) or y (1). */
static void wall_faces(const hxTerrain *terrain, const double point[3], const hxCellAt *at,
                       int axis, hxNearestFace *face) {
  const hxGridHead *head = &terrain->head;
  const double origin = axis == 0 ? head->x0 : head->y0, cell = axis == 0 ? at->col : at->row;
  for (int k = -1; k <= 1; k += 2) {
    const double top = top_beside(at, axis == 0 ? k : 0, axis == 1 ? k : 0);
    if (top > at->own)
      side_column(gap_to(point[axis], origin, head->cell, cell, k), point[2] - top, axis, k, face);
  }
}

/* Keeps the nearest wall, edge or corner of higher columns across the corners of a cell. */
static void corner_faces(const hxTerrain *terrain, const double point[3], const hxCellAt *at,
                         hxNearestFace *face) {
  const hxGridHead *head = &terrain->head;
  for (int i = -1; i <= 1; i += 2)
    for (int j = -1; j <= 1; j += 2) {
      const double top = top_beside(at, i, j);
      if (!(top > at->own)) continue;
      const double x = gap_to(point[0], head->x0, head->cell, at->col, i),
                   y = gap_to(point[1], head->y0, head->cell, at->row, j);
      const double ax = x > 0.0 ? -i * x : 0.0, ay = y > 0.0 ? -j * y : 0.0,
                   az = point[2] > top ? point[2] - top : 0.0;
      if (ax != 0.0 || ay != 0.0 || az != 0.0) keep_nearer(ax, ay, az, face);
    }
}

/* Sets a face from the nearest one: its normal, and at edges the normal's derivative. */
static void set_face(const hxNearestFace *nearest, int bends, hxFace *face) {
  const double *away = nearest->away, d = nearest->distance;
  face->distance = d;
  for (int i = 0; i < 3; ++i) face->normal[i] = nearest->is_plane ? away[i] : away[i] / d;
  if (!bends) return;
  for (int i = 0; i < 6; ++i) face->bend[i] = 0.0;
  const int edges = (away[0] != 0.0) + (away[1] != 0.0) + (away[2] != 0.0);
  if (nearest->is_plane || edges < 2) return;
  const double *n = face->normal;
  const double bend[6] = {(away[0] != 0.0) - n[0] * n[0],
                          (away[1] != 0.0) - n[1] * n[1],
                          (away[2] != 0.0) - n[2] * n[2],
                          -n[0] * n[1],
                          -n[0] * n[2],
                          -n[1] * n[2]};
  for (int i = 0; i < 6; ++i) face->bend[i] = bend[i] / d;
}

void hx_terrain_face(const hxTerrain *terrain, hxFaceKind kind, const double cell[2],
                     const double point[3], int bends, hxFace *face) {
  double around[2] = {cell[0], cell[1]};
  if (terrain->head.kind == HX_SURFACE_SMOOTH) {
    smooth_face(terrain, point, bends, face);
    return;
  }
  if (cell[0] < 0.0) hx_terrain_cell_at(terrain, point, around);
  hxCellAt at;
  set_cell(terrain, around, &at);
  const int all = kind == HX_FACE_NEAREST;
  hxNearestFace nearest = {hx_far, {0.0, 0.0, 1.0}, 1};
  if (kind == HX_FACE_TOP || all) nearest.distance = point[2] - at.own;
  if (kind == HX_FACE_WALL || all) wall_faces(terrain, point, &at, 0, &nearest);
  if (kind == HX_FACE_SIDE || all) wall_faces(terrain, point, &at, 1, &nearest);
  if (kind == HX_FACE_CORNER || all) corner_faces(terrain, point, &at, &nearest);
  set_face(&nearest, bends, face);
}

/* ---- materials ---- */

double hx_terrain_shear_displacement(const hxTerrain *terrain) {
  enum { DISPLACEMENT = HX_MATERIAL_SOIL + 6 };
  double least = 0.0;
  for (int64_t i = 0; i < terrain->head.materials; ++i) {
    const double *row = terrain->table + HX_MATERIAL_COLUMNS * i;
    if (row[HX_MATERIAL_SOIL] != 0.0 && (least == 0.0 || row[DISPLACEMENT] < least))
      least = row[DISPLACEMENT];
  }
  return least;
}

const double *hx_terrain_material(const hxTerrain *terrain, const double point[3]) {
  const hxGridHead *head = &terrain->head;
  const double shift = head->kind == HX_SURFACE_SMOOTH ? 0.5 : 0.0; /* the nearest node */
  if (!terrain->material) return NULL;
  const int64_t c = hx_cell_index((point[0] - head->x0) / head->cell + shift, head->cols);
  const int64_t r = hx_cell_index((point[1] - head->y0) / head->cell + shift, head->rows);
  const int m = terrain->material[r * head->cols + c];
  return m > 0 ? terrain->table + HX_MATERIAL_COLUMNS * (m - 1) : NULL;
}
