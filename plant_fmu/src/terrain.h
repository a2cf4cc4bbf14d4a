/* terrain.h - distance of a sphere's centre from an uneven ground (eq. HXSURF). Scalar and compiled
 * once, so that all kernels get the same bits. Heights are above the terrain's own zero. */
#ifndef HX_SRC_TERRAIN_H
#define HX_SRC_TERRAIN_H

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

/* Faces of blocks that a sphere can touch at once: the top of its own cell, and the nearest face,
 * edge or corner of the columns around that are higher. */
typedef enum hxFaceKind { HX_FACE_TOP, HX_FACE_WALL, HX_FACE_NEARER } hxFaceKind;

extern const double hx_far; /* m  distance of a wall that is not there */

/* Computes a face of blocks, around this cell; with cell[0] < 0 around that below the point. The
 * columns are those of the cell also where the point is not over it, so that the face changes
 * smoothly. A smooth surface has one face. */
void hx_terrain_face(const hxTerrain *terrain, hxFaceKind kind, const double cell[2],
                     const double point[3], hxFace *face);

/* Returns the row of the table of the material at a point, NULL for the definition's ground. */
const double *hx_terrain_material(const hxTerrain *terrain, const double point[3]);

HX_HIDDEN_END

#endif
