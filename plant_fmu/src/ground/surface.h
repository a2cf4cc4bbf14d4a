/* surface.h - distance of a sphere's centre from an uneven ground (eq. 31-34). Scalar and compiled
 * once, so that all kernels get the same bits. Heights are above the terrain's own zero. */
#ifndef HX_SURFACE_H
#define HX_SURFACE_H

#include "hexapod/inside.h"
#include "hexapod/terrain.h"

HX_HIDDEN_BEGIN

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
  int64_t tile_rows, tile_cols;  /* of the map of heights below */
  double per_tile, reach;        /* 1/m, m */
  double highest;                /* m  of the tops */
  double *top;    /* m  [tile_rows][tile_cols]: no ground within the reach of a tile is higher */
  double bytes[]; /* the file after its head, then the map of tops */
};

/* Copies of nodes of a smooth surface (smooth.h). */
typedef struct hxPatchNodes hxPatchNodes;

/* The face of the ground nearest to a point. */
typedef struct hxFace {
  double distance;  /* m    signed, > 0 outside */
  double normal[3]; /* 1    out of the ground; gradient of the distance */
  double bend[6];   /* 1/m  derivative of the normal by the point: xx yy zz xy xz yz */
} hxFace;

#define HX_LEAST_REACH 0.02 /* m  around a place, in which the highest ground is looked up */

hxTerrainSurface hx_terrain_surface(const hxTerrain *terrain);
double hx_terrain_cell_size(const hxTerrain *terrain);

/* Returns the cell (column, row) of blocks over which a point is, and how far outside of a cell a
 * point is, m, < 0 inside; the border's cells have no outer edge. */
void hx_terrain_cell_at(const hxTerrain *terrain, const double point[3], double cell[2]);
double hx_terrain_outside(const hxTerrain *terrain, const double point[3], const double cell[2]);

/* Returns the index along a line of n cells of a coordinate in cells, of the border's beyond it. */
static inline int64_t hx_cell_index(double u, int64_t n) {
  return !(u > 0.0) ? 0 : u >= (double)(n - 1) ? n - 1 : (int64_t)u; /* NaN: 0 */
}

static inline double hx_higher_of(double a, double b) { return a < b ? b : a; }

/* Returns the highest top of the blocks between coordinates in cells: least and greatest along x,
 * least and greatest along y. */
static inline double hx_terrain_top_between(const hxTerrain *terrain, const double ends[4]) {
  const hxGridHead *head = &terrain->head;
  const int64_t c0 = hx_cell_index(ends[0], head->cols), c1 = hx_cell_index(ends[1], head->cols),
                r0 = hx_cell_index(ends[2], head->rows), r1 = hx_cell_index(ends[3], head->rows);
  const double *low = terrain->height + r0 * head->cols, *high = terrain->height + r1 * head->cols;
  double top = hx_higher_of(hx_higher_of(low[c0], low[c1]), hx_higher_of(high[c0], high[c1]));
  if (c1 - c0 < 2 && r1 - r0 < 2) return top;
  for (int64_t row = r0; row <= r1; ++row)
    for (int64_t col = c0; col <= c1; ++col)
      top = hx_higher_of(top, terrain->height[row * head->cols + col]);
  return top;
}

/* Faces of blocks that a sphere can touch at once, if cells are not smaller than it. */
typedef enum hxFaceKind {
  HX_FACE_TOP,    /* of its own cell */
  HX_FACE_WALL,   /* a higher column beside it along x: its wall, or the edge of its top */
  HX_FACE_SIDE,   /* the same along y */
  HX_FACE_CORNER, /* the same of a column across the cell's corner */
  HX_FACE_NEAREST /* the nearest of these */
} hxFaceKind;

extern const double hx_far; /* m  distance of a wall that is not there */

/* Computes a face of blocks, around this cell; with cell[0] < 0 around that below the point. The
 * columns are those of the cell also where the point is not over it, so that the face changes
 * smoothly. A smooth surface has one face; its normal's derivative is computed with bends only. */
void hx_terrain_face(const hxTerrain *terrain, hxFaceKind kind, const double cell[2],
                     const double point[3], int bends, hxFace *face);

/* Copies the 4 x 4 nodes around a patch; nodes beyond the grid continue it linearly. */
void hx_terrain_border_nodes(const hxTerrain *terrain, int64_t row, int64_t col, double out[4][4]);

/* Returns whether the blocks are so large that few of them are within the least reach. */
static inline int hx_has_large_blocks(const hxTerrain *terrain) {
  return terrain->head.kind == HX_SURFACE_BLOCKS && terrain->head.cell >= HX_LEAST_REACH;
}

/* Returns the least shear displacement of the table's soils, m; 0 if no material is soil. */
double hx_terrain_shear_displacement(const hxTerrain *terrain);

/* Returns the row of the table of the material at a point, NULL for the definition's ground. */
const double *hx_terrain_material(const hxTerrain *terrain, const double point[3]);

HX_HIDDEN_END

#endif
