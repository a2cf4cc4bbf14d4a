/* surface.h - distance of a sphere's centre from an uneven ground (eq. 31-34). Scalar and compiled
 * once, so that all kernels get the same bits. Heights are above the terrain's own zero. */
#ifndef HX_SURFACE_H
#define HX_SURFACE_H

#include "hexapod/inside.h"
#include "hexapod/terrain.h"

HX_HIDDEN_BEGIN

/* The face of the ground nearest to a point. */
typedef struct hxFace {
  double distance;  /* m    signed, > 0 outside */
  double normal[3]; /* 1    out of the ground; gradient of the distance */
  double bend[6];   /* 1/m  derivative of the normal by the point: xx yy zz xy xz yz */
} hxFace;

hxTerrainSurface hx_terrain_surface(const hxTerrain *terrain);
double hx_terrain_cell_size(const hxTerrain *terrain);

/* Returns the cell (column, row) of blocks over which a point is, and how far outside of a cell a
 * point is, m, < 0 inside; the border's cells have no outer edge. */
void hx_terrain_cell_at(const hxTerrain *terrain, const double point[3], double cell[2]);
double hx_terrain_outside(const hxTerrain *terrain, const double point[3], const double cell[2]);

/* Faces of blocks that a sphere can touch at once, if cells are not smaller than it. */
typedef enum hxFaceKind {
  HX_FACE_TOP,    /* of its own cell */
  HX_FACE_WALL,   /* a higher column beside it along x: its wall, or the edge of its top */
  HX_FACE_SIDE,   /* the same along y */
  HX_FACE_CORNER, /* edges and corner of a higher column across the cell's corner */
  HX_FACE_NEAREST /* the nearest of these */
} hxFaceKind;

extern const double hx_far; /* m  distance of a wall that is not there */

/* Computes a face of blocks, around this cell; with cell[0] < 0 around that below the point. The
 * columns are those of the cell also where the point is not over it, so that the face changes
 * smoothly. A smooth surface has one face; its normal's derivative is computed with bends only. */
void hx_terrain_face(const hxTerrain *terrain, hxFaceKind kind, const double cell[2],
                     const double point[3], int bends, hxFace *face);

/* Returns the row of the table of the material at a point, NULL for the definition's ground. */
const double *hx_terrain_material(const hxTerrain *terrain, const double point[3]);

HX_HIDDEN_END

#endif
