/* terrain.h - the ground: how far a point is above it, and which way is up there */
#ifndef HX_TERRAIN_H
#define HX_TERRAIN_H

#include "state.h"
#include "vec3.h"

typedef struct {
  hxReal distance; /* m  signed, > 0 above the ground */
  hxVec3 normal;   /* 1  out of the ground, world axes */
} hxGround;

/* One row per hxTerrainKind; the only place a terrain is chosen. */
typedef struct {
  hxGround (*ground)(const hxModel *model, hxVec3 point);
} hxTerrainRow;

HX_LOCAL const hxTerrainRow *hx_terrain(int kind); /* NULL when there is no such kind */

#endif
