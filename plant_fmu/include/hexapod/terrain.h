/* terrain.h - an uneven ground: an immutable surface made from the bytes of a grid file
 *
 * Grid file, version 1, little-endian:
 *
 *   char magic[8]               "hxGrid01"
 *   int64 rows, cols            of the grid: rows along +y, columns along +x
 *   int64 kind                  1 smooth, 2 blocks
 *   int64 materials             rows of the table below, 0 to 255
 *   double x0, y0, cell         m  origin of the grid and edge of its square cells
 *   char name[64]               UTF-8, padded with zeros
 *   double height[rows][cols]   m
 *   with materials > 0:
 *   uint8 material[rows][cols]  padded with zeros to a multiple of 8 bytes; 0: the ground of the
 *                               definition, m: row m - 1 of the table
 *   double table[materials][16] see hxMaterialColumn
 *
 * smooth: heights are those of nodes at (x0 + cell col, y0 + cell row), at least two each way,
 * joined by a bicubic surface without kinks. blocks: a column of ground with a level top and
 * vertical walls on each cell from (x0 + cell col, y0 + cell row) on. Beyond the grid its border's
 * height goes on. */
#ifndef HEXAPOD_TERRAIN_H
#define HEXAPOD_TERRAIN_H

#include "hexapod/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct hxTerrain hxTerrain;

typedef enum hxTerrainSurface { HX_SURFACE_SMOOTH = 1, HX_SURFACE_BLOCKS } hxTerrainSurface;

/* Columns of a material. NaN in the first three: as the definition has it; mu_static: as mu, where
 * mu is given. The others belong to the soil's law. */
typedef enum hxMaterialColumn {
  HX_MATERIAL_MU,        /* 1        friction.mu */
  HX_MATERIAL_MU_STATIC, /* 1        friction.mu_static */
  HX_MATERIAL_STIFFNESS, /* N/m^1.5  contact.stiffness */
  HX_MATERIAL_SOIL,      /* 1        0 none: rigid ground */
  HX_MATERIAL_COLUMNS = 16
} hxMaterialColumn;

/* Copies and checks the bytes of a grid file. Returns NULL for bytes that are none and when out of
 * memory; message (HX_MESSAGE_SIZE bytes) then says what was got and what was expected. */
HX_API hxTerrain *hx_terrain_create(const void *bytes, size_t size, char *message);
HX_API void hx_terrain_destroy(hxTerrain *terrain);

/* Returns the checksum of the file's bytes. */
HX_API uint64_t hx_terrain_checksum(const hxTerrain *terrain);

#ifdef __cplusplus
}
#endif
#endif
