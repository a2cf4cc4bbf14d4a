#include "surface.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hexapod/message.h"
#include "soil.h"

/* The head of a grid file. */
typedef struct {
  char magic[8];
  int64_t rows, cols, kind, materials;
  double x0, y0, cell;
  char name[64];
} hxGridHead;

struct hxTerrain {
  hxGridHead head;
  uint64_t checksum;
  double per_cell;               /* 1/m */
  const double *height;          /* [rows][cols] */
  const unsigned char *material; /* [rows][cols], NULL: none */
  const double *table;           /* [materials][HX_MATERIAL_COLUMNS] */
  double bytes[];                /* the file after its head */
};

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
    if (column == 0)
      return refuse(message, "table: soil law", row[HX_MATERIAL_SOIL], "0, 1, 2 or 3");
    if (column > 0)
      return refuse(message, "table: number of a soil", row[HX_MATERIAL_SOIL + column],
                    "a finite number >= 0; shear displacement, stiffness and exponent > 0");
  }
  return 1;
}

/* Returns whether a column is soil and not level with all its neighbours. */
static int is_uneven_soil(const hxTerrain *terrain, int64_t row, int64_t col) {
  const int64_t rows = terrain->head.rows, cols = terrain->head.cols;
  const unsigned char m = terrain->material[row * cols + col];
  if (m == 0 || terrain->table[HX_MATERIAL_COLUMNS * (m - 1) + HX_MATERIAL_SOIL] == 0.0) return 0;
  const double height = terrain->height[row * cols + col];
  int found = 0;
  for (int64_t r = row - 1; r <= row + 1; ++r)
    for (int64_t c = col - 1; c <= col + 1; ++c)
      found |= r >= 0 && r < rows && c >= 0 && c < cols && terrain->height[r * cols + c] != height;
  return found;
}

/* Returns whether soil of blocks is level: a foot that has sunk cannot pass an edge of soil without
 * a jump of the force, because the laws of soil are those of level ground. */
static int check_soil_of_blocks(const hxTerrain *terrain, char *message) {
  if (terrain->head.kind != HX_SURFACE_BLOCKS || !terrain->material) return 1;
  for (int64_t row = 0; row < terrain->head.rows; ++row)
    for (int64_t col = 0; col < terrain->head.cols; ++col)
      if (is_uneven_soil(terrain, row, col)) {
        hx_print(
            message, HX_MESSAGE_SIZE,
            "terrain grid: material[%lld][%lld]: got soil on a block that is higher or lower than "
            "its neighbour, expected soil on level blocks; move it, or make the surface smooth",
            (long long)row, (long long)col);
        return 0;
      }
  return 1;
}

/* Copies the file after its head and sets the pointers to its parts. */
static hxTerrain *copy_file(const hxGridHead *head, const void *bytes, size_t size) {
  hxTerrain *terrain = malloc(sizeof *terrain + (size - sizeof *head));
  if (!terrain) return NULL;
  memcpy(terrain->bytes, (const char *)bytes + sizeof *head, size - sizeof *head);
  const char *map = (const char *)(terrain->bytes + head->rows * head->cols);
  terrain->head = *head;
  terrain->per_cell = 1.0 / head->cell;
  terrain->checksum = hx_checksum(0, bytes, size);
  terrain->height = terrain->bytes;
  terrain->material = head->materials > 0 ? (const unsigned char *)map : NULL;
  terrain->table = terrain->bytes + head->rows * head->cols + (int64_t)(map_size(head) / 8);
  return terrain;
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
  if (!terrain) {
    hx_print(message, HX_MESSAGE_SIZE, "terrain grid: out of memory; free some and try again");
    return NULL;
  }
  if (check_heights(terrain, message) && check_materials(terrain, message) &&
      check_soil_of_blocks(terrain, message))
    return terrain;
  hx_terrain_destroy(terrain);
  return NULL;
}

void hx_terrain_destroy(hxTerrain *terrain) { free(terrain); }
uint64_t hx_terrain_checksum(const hxTerrain *terrain) { return terrain->checksum; }
hxTerrainSurface hx_terrain_surface(const hxTerrain *terrain) {
  return (hxTerrainSurface)terrain->head.kind;
}
double hx_terrain_cell_size(const hxTerrain *terrain) { return terrain->head.cell; }

/* ---- the smooth surface ---- */

/* Height over a point, its first and second derivatives. */
typedef struct {
  double s, sx, sy, sxx, sxy, syy;
  int64_t row, col; /* of the patch */
} hxPatch;

/* A coordinate on the grid: index of the node before it, place between this and the next node. */
typedef struct {
  int64_t node;
  double place;
  int outside; /* beyond the grid, where the border's height goes on */
} hxGridPlace;

static hxGridPlace grid_place(double x, double origin, double per_cell, int64_t nodes) {
  const double u = (x - origin) * per_cell, last = (double)(nodes - 1);
  const double clamped = u < 0.0 ? 0.0 : u > last ? last : u;
  const int64_t before = (int64_t)clamped, node = before < nodes - 2 ? before : nodes - 2;
  return (hxGridPlace){node, clamped - (double)node, u < 0.0 || u > last};
}

/* Computes weights of four nodes by Catmull and Rom's cubic, and their derivatives by the place. */
static void cubic_weights(double t, double w[3][4]) {
  const double t2 = t * t, t3 = t2 * t;
  w[0][0] = -0.5 * t + t2 - 0.5 * t3, w[0][1] = 1.0 - 2.5 * t2 + 1.5 * t3;
  w[0][2] = 0.5 * t + 2.0 * t2 - 1.5 * t3, w[0][3] = 0.5 * t3 - 0.5 * t2;
  w[1][0] = -0.5 + 2.0 * t - 1.5 * t2, w[1][1] = 4.5 * t2 - 5.0 * t;
  w[1][2] = 0.5 + 4.0 * t - 4.5 * t2, w[1][3] = 1.5 * t2 - t;
  w[2][0] = 2.0 - 3.0 * t, w[2][1] = 9.0 * t - 5.0;
  w[2][2] = 4.0 - 9.0 * t, w[2][3] = 3.0 * t - 1.0;
}

/* Copies four nodes of a grid line around a place; nodes beyond the line continue it linearly. */
static void line_nodes(const double *line, int64_t node, int64_t nodes, double out[4]) {
  out[1] = line[node], out[2] = line[node + 1];
  out[0] = node > 0 ? line[node - 1] : 2.0 * out[1] - out[2];
  out[3] = node + 2 < nodes ? line[node + 2] : 2.0 * out[2] - out[1];
}

/* Copies the 4 x 4 nodes around a place. */
static void patch_nodes(const hxTerrain *terrain, int64_t row, int64_t col, double out[4][4]) {
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

/* Computes the surface over (x, y). */
static hxPatch patch_at(const hxTerrain *terrain, double x, double y) {
  const hxGridHead *head = &terrain->head;
  const double per_cell = terrain->per_cell;
  const hxGridPlace px = grid_place(x, head->x0, per_cell, head->cols),
                    py = grid_place(y, head->y0, per_cell, head->rows);
  double node[4][4], wx[3][4], wy[3][4], line[3][4] = {{0.0}};
  patch_nodes(terrain, py.node, px.node, node);
  cubic_weights(px.place, wx);
  cubic_weights(py.place, wy);
  for (int d = 0; d < 3; ++d)
    for (int i = 0; i < 4; ++i)
      line[d][i] = (wx[d][0] * node[i][0] + wx[d][1] * node[i][1]) +
                   (wx[d][2] * node[i][2] + wx[d][3] * node[i][3]);
  hxPatch p = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, py.node, px.node};
  for (int i = 0; i < 4; ++i) {
    p.s += wy[0][i] * line[0][i], p.sx += wy[0][i] * line[1][i], p.sxx += wy[0][i] * line[2][i];
    p.sy += wy[1][i] * line[0][i], p.sxy += wy[1][i] * line[1][i];
    p.syy += wy[2][i] * line[0][i];
  }
  const double by_x = px.outside ? 0.0 : per_cell, by_y = py.outside ? 0.0 : per_cell;
  p.sx *= by_x, p.sxx *= by_x * by_x, p.sxy *= by_x * by_y;
  p.sy *= by_y, p.syy *= by_y * by_y;
  return p;
}

/* Hessian of half the squared distance from a point rz below the surface, or its part without the
 * surface's bend where the whole has no minimum. */
typedef struct {
  double xx, xy, yy, det;
} hxHessian;

static hxHessian hessian_of(const hxPatch *p, double rz) {
  const double gxx = 1.0 + p->sx * p->sx, gyy = 1.0 + p->sy * p->sy, gxy = p->sx * p->sy;
  hxHessian H = {gxx + rz * p->sxx, gxy + rz * p->sxy, gyy + rz * p->syy, 0.0};
  H.det = H.xx * H.yy - H.xy * H.xy;
  if (H.xx > 0.1 && H.det > 0.1) return H;
  return (hxHessian){gxx, gxy, gyy, gxx * gyy - gxy * gxy};
}

/* Moves the patch along the surface by its own second-order expansion. */
static void move_patch(hxPatch *p, double dx, double dy) {
  p->s += dx * (p->sx + 0.5 * (p->sxx * dx + p->sxy * dy)) +
          dy * (p->sy + 0.5 * (p->sxy * dx + p->syy * dy));
  p->sx += p->sxx * dx + p->sxy * dy;
  p->sy += p->sxy * dx + p->syy * dy;
}

/* Sets the face from the nearest point's patch: d normal/d point = -P S H^-1 J^T / |N|, where N =
 * (-s_x, -s_y, 1), P projects across the normal, S is the surface's second derivative and J the
 * derivative of its points. */
static void set_bend(const hxPatch *p, const hxHessian *H, double per_n, hxFace *face) {
  const double J[2][3] = {{1.0, 0.0, p->sx}, {0.0, 1.0, p->sy}}, *n = face->normal;
  static const int row[6] = {0, 1, 2, 0, 0, 1}, col[6] = {0, 1, 2, 1, 2, 2};
  double turn[3][3];
  for (int k = 0; k < 3; ++k) {
    const double ux = (H->yy * J[0][k] - H->xy * J[1][k]) / H->det,
                 uy = (H->xx * J[1][k] - H->xy * J[0][k]) / H->det;
    const double dN[3] = {-(p->sxx * ux + p->sxy * uy), -(p->sxy * ux + p->syy * uy), 0.0};
    const double along = n[0] * dN[0] + n[1] * dN[1];
    for (int i = 0; i < 3; ++i) turn[i][k] = per_n * (dN[i] - along * n[i]);
  }
  for (int i = 0; i < 6; ++i) face->bend[i] = turn[row[i]][col[i]];
}

/* Returns whether (x, y) is on the patch that was computed. */
static int is_in_patch(const hxTerrain *terrain, const hxPatch *p, double x, double y) {
  const hxGridHead *head = &terrain->head;
  return grid_place(x, head->x0, terrain->per_cell, head->cols).node == p->col &&
         grid_place(y, head->y0, terrain->per_cell, head->rows).node == p->row;
}

/* Squares of Newton's last step over the cell's. Its end is found by the patch's expansion: third
 * derivatives, and at a border the jump of the second ones, are left out. */
static const double close = 1e-7, closest = 1e-14;

/* Newton's method that still moves by this share of a cell, squared, has not found a point. */
static const double lost = 1e-4;

/* Computes the face of a smooth surface by Newton's method on the two parameters of its nearest
 * point, from the point below. Far above a rough surface, beyond the centres of its curvature, the
 * method may find none; the distance is then that of the plane at the point below, which is far,
 * too. */
static void smooth_face(const hxTerrain *terrain, const double point[3], int bends, hxFace *face) {
  enum { MOST = 64 }; /* steps of at most a cell each */
  const double cell = terrain->head.cell, area = cell * cell;
  double x = point[0], y = point[1];
  hxPatch p;
  hxHessian H;
  for (int i = 0;; ++i) {
    p = patch_at(terrain, x, y);
    const double rx = x - point[0], ry = y - point[1], rz = p.s - point[2];
    const double gx = rx + p.sx * rz, gy = ry + p.sy * rz;
    H = hessian_of(&p, rz);
    double dx = (H.xy * gy - H.yy * gx) / H.det, dy = (H.xy * gx - H.xx * gy) / H.det;
    const double square = dx * dx + dy * dy;
    if (i == MOST && square > lost * area) {
      x = point[0], y = point[1], p = patch_at(terrain, x, y);
      break;
    }
    if (square <= closest * area || i == MOST ||
        (!bends && square <= close * area && is_in_patch(terrain, &p, x + dx, y + dy))) {
      x += dx, y += dy;
      move_patch(&p, dx, dy);
      break;
    }
    const double limit = square > area ? cell / sqrt(square) : 1.0;
    x += limit * dx, y += limit * dy;
  }
  const double per_n = 1.0 / sqrt(1.0 + p.sx * p.sx + p.sy * p.sy);
  face->normal[0] = -p.sx * per_n, face->normal[1] = -p.sy * per_n, face->normal[2] = per_n;
  face->distance = (point[0] - x) * face->normal[0] + (point[1] - y) * face->normal[1] +
                   (point[2] - p.s) * face->normal[2];
  if (bends) set_bend(&p, &H, per_n, face);
}

/* ---- blocks ---- */

static int64_t clamped_index(double u, int64_t n) {
  return u <= 0.0 ? 0 : u >= (double)(n - 1) ? n - 1 : (int64_t)u;
}

void hx_terrain_cell_at(const hxTerrain *terrain, const double point[3], double cell[2]) {
  const hxGridHead *head = &terrain->head;
  const int64_t col = clamped_index((point[0] - head->x0) / head->cell, head->cols);
  const int64_t row = clamped_index((point[1] - head->y0) / head->cell, head->rows);
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

/* Returns the height of a column, of the border's where there is none. */
static double column_height(const hxTerrain *terrain, double col, double row) {
  const hxGridHead *head = &terrain->head;
  const int64_t c = clamped_index(col, head->cols), r = clamped_index(row, head->rows);
  return terrain->height[r * head->cols + c];
}

static void top_face(const hxTerrain *terrain, const double point[3], const double cell[2],
                     hxFace *face) {
  *face = (hxFace){point[2] - column_height(terrain, cell[0], cell[1]), {0.0, 0.0, 1.0}, {0.0}};
}

/* Returns the gap between a point and the column at offset -1, 0 or 1 from the cell along an axis,
 * 0 for an offset of 0. */
static double gap_to(double x, double origin, double size, double cell, int offset) {
  const double low = origin + size * cell;
  return offset > 0 ? low + size - x : offset < 0 ? x - low : 0.0;
}

/* Keeps the face with this distance vector from the column's nearest point if it is nearer. */
static void keep_nearer(const double away[3], hxFace *face) {
  const double d = sqrt(away[0] * away[0] + away[1] * away[1] + away[2] * away[2]);
  if (!(d < face->distance)) return;
  face->distance = d;
  for (int i = 0; i < 3; ++i) face->normal[i] = away[i] / d;
  const double *n = face->normal;
  const int edges = (away[0] != 0.0) + (away[1] != 0.0) + (away[2] != 0.0);
  const double bend[6] = {(away[0] != 0.0) - n[0] * n[0],
                          (away[1] != 0.0) - n[1] * n[1],
                          (away[2] != 0.0) - n[2] * n[2],
                          -n[0] * n[1],
                          -n[0] * n[2],
                          -n[1] * n[2]};
  for (int i = 0; i < 6; ++i) face->bend[i] = edges > 1 ? bend[i] / d : 0.0;
}

/* Keeps a level or a vertical plane if it is nearer. */
static void keep_plane(double distance, int axis, double sign, hxFace *face) {
  if (!(distance < face->distance)) return;
  *face = (hxFace){.distance = distance};
  face->normal[axis] = sign;
}

/* Keeps the nearest face or edge of a column beside the cell, at offset sign along an axis. */
static void side_column(double gap, double above, int axis, int sign, hxFace *face) {
  if (above <= 0.0) {
    keep_plane(gap, axis, (double)-sign, face);
  } else if (gap <= 0.0) {
    keep_plane(above, 2, 1.0, face);
  } else {
    double away[3] = {0.0, 0.0, above};
    away[axis] = -sign * gap;
    keep_nearer(away, face);
  }
}

/* Keeps the nearest face of higher columns beside a cell, along x (0) or y (1). */
static void wall_faces(const hxTerrain *terrain, const double point[3], const double cell[2],
                       int axis, hxFace *face) {
  const hxGridHead *head = &terrain->head;
  const double own = column_height(terrain, cell[0], cell[1]);
  const double origin = axis == 0 ? head->x0 : head->y0;
  for (int k = -1; k <= 1; k += 2) {
    const double top =
        column_height(terrain, cell[0] + (axis == 0 ? k : 0), cell[1] + (axis == 1 ? k : 0));
    const double gap = gap_to(point[axis], origin, head->cell, cell[axis], k);
    if (top > own) side_column(gap, point[2] - top, axis, k, face);
  }
}

/* Keeps the nearest edge or corner of higher columns across the corners of a cell. One counts where
 * its nearest point is above both columns beside it. */
static void corner_faces(const hxTerrain *terrain, const double point[3], const double cell[2],
                         hxFace *face) {
  const hxGridHead *head = &terrain->head;
  const double own = column_height(terrain, cell[0], cell[1]);
  for (int i = -1; i <= 1; i += 2)
    for (int j = -1; j <= 1; j += 2) {
      const double top = column_height(terrain, cell[0] + i, cell[1] + j);
      const double nearest = point[2] < top ? point[2] : top;
      if (!(top > own && nearest > column_height(terrain, cell[0] + i, cell[1]) &&
            nearest > column_height(terrain, cell[0], cell[1] + j)))
        continue;
      const double x = gap_to(point[0], head->x0, head->cell, cell[0], i),
                   y = gap_to(point[1], head->y0, head->cell, cell[1], j);
      const double away[3] = {x > 0.0 ? -i * x : 0.0, y > 0.0 ? -j * y : 0.0, point[2] - nearest};
      if (away[0] != 0.0 || away[1] != 0.0 || away[2] != 0.0) keep_nearer(away, face);
    }
}

void hx_terrain_face(const hxTerrain *terrain, hxFaceKind kind, const double cell[2],
                     const double point[3], int bends, hxFace *face) {
  double around[2] = {cell[0], cell[1]};
  if (terrain->head.kind == HX_SURFACE_SMOOTH) {
    smooth_face(terrain, point, bends, face);
    return;
  }
  if (cell[0] < 0.0) hx_terrain_cell_at(terrain, point, around);
  *face = (hxFace){.distance = hx_far, .normal = {0.0, 0.0, 1.0}};
  if (kind == HX_FACE_TOP || kind == HX_FACE_NEAREST) top_face(terrain, point, around, face);
  if (kind == HX_FACE_WALL || kind == HX_FACE_NEAREST) wall_faces(terrain, point, around, 0, face);
  if (kind == HX_FACE_SIDE || kind == HX_FACE_NEAREST) wall_faces(terrain, point, around, 1, face);
  if (kind == HX_FACE_CORNER || kind == HX_FACE_NEAREST) corner_faces(terrain, point, around, face);
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
  const int64_t c = clamped_index((point[0] - head->x0) / head->cell + shift, head->cols);
  const int64_t r = clamped_index((point[1] - head->y0) / head->cell + shift, head->rows);
  const int m = terrain->material[r * head->cols + c];
  return m > 0 ? terrain->table + HX_MATERIAL_COLUMNS * (m - 1) : NULL;
}
