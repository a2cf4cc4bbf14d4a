/* valleys.h - the smallest concave radius of curvature of a smooth surface;
 * models/ground/valleys.py is the readable form and gives the reason for the limit */
#ifndef HX_VALLEYS_H
#define HX_VALLEYS_H

#include "surface.h"

HX_HIDDEN_BEGIN

/* The place of the smallest concave radius. */
typedef struct {
  double radius, x, y; /* m  radius 0: none below the limit */
} hxValley;

/* Returns the valley of the smallest radius if it is below a limit, m. Blocks have none. */
hxValley hx_terrain_valley(const hxTerrain *terrain, double limit);

HX_HIDDEN_END

#endif
