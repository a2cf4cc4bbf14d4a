#include <math.h>

#include "../ground/surface.h"
#include "../ground/valleys.h"
#include "../kernel.h"
#include "hexapod/message.h"
#include "hexapod/range_check.h"
#include "parts.h"

/* Fails if a smooth surface has a valley in which the largest sphere touches two places: the plant
 * computes one of them (ground/valleys.h). */
static hxStatus check_valleys(hxPlant *plant, const hxDefinition *d, char *message) {
  const double margin = 1.05; /* 1  least radius of valleys over that of the sphere */
  const char *name[] = {"foot.radius", "body.corner_radius", "body.knee_radius",
                        "body.shank_radius"};
  const double radius[] = {d->foot_radius, d->body.corner_radius, d->body.knee_radius,
                           d->body.shank_radius};
  int largest = 0;
  for (int i = 1; i < 4 && d->body.contact == HX_BODY_ON; ++i)
    if (radius[i] > radius[largest]) largest = i;
  const double limit = margin * radius[largest];
  if (limit <= plant->valley_limit) return HX_OK;
  const hxValley valley = hx_terrain_valley(plant->terrain, limit);
  if (valley.radius == 0.0) {
    plant->valley_limit = limit;
    return HX_OK;
  }
  hx_print(message, HX_MESSAGE_SIZE,
           "terrain.grid: valleys narrower than a %s: got a radius of curvature of %.4g mm at x = "
           "%.4g m, y = %.4g m, expected at least %.4g mm, 1.05 times %s; enlarge "
           "terrain.horizontal_scale, reduce difficulty or heights, choose blocks (a heightfield "
           "with slope_threshold), or reduce %s",
           largest == 0 ? "foot" : "part", 1e3 * valley.radius, valley.x, valley.y, 1e3 * limit,
           name[largest], name[largest]);
  return HX_INVALID_MODEL;
}

hxStatus hx_plant_check_terrain(hxPlant *plant, const hxDefinition *d, char *message) {
  if (d->terrain.kind != HX_TERRAIN_GRID) return HX_OK;
  if (!plant->terrain) {
    hx_print(message, HX_MESSAGE_SIZE,
             "terrain.kind: got grid, expected a grid; load one and set it before the reset "
             "(hx_plant_set_terrain), or choose flat or slope");
    return HX_INVALID_MODEL;
  }
  const double radius = fmax(fmax(d->foot_radius, d->body.corner_radius),
                             fmax(d->body.knee_radius, d->body.shank_radius));
  const double cell = hx_terrain_cell_size(plant->terrain);
  if (hx_terrain_surface(plant->terrain) == HX_SURFACE_SMOOTH)
    return check_valleys(plant, d, message);
  if (cell >= 2.0 * radius) return HX_OK;
  hx_print(message, HX_MESSAGE_SIZE,
           "terrain.grid: got blocks with cells of %.9g m, expected at least %.9g m, twice the "
           "largest radius that touches them; resample the grid, or reduce foot.radius",
           cell, 2.0 * radius);
  return HX_INVALID_MODEL;
}

/* Fails if the centre of a foot lies in the ground: the contact law does not hold at such depths,
 * and its force would throw the robot up. On soil the depth is what unloading gives back, so that
 * feet that have sunk into it are accepted, also below their radius. */
static hxStatus check_start_depth(const hxPlant *plant, char message[HX_MESSAGE_SIZE]) {
  hxDepths depths;
  const double radius = plant->model.radius[HX_FOOT], *delta = depths.delta[HX_FOOT];
  hx_kernel()->depths(&plant->model, &plant->state.contact, &plant->state.motion, &depths);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    if (delta[leg] > radius) {
      hx_print(message, HX_MESSAGE_SIZE,
               "initial.position: got foot %s %.4g m deep in the ground, expected at most its "
               "radius, %.4g m; raise initial.position[3] by %.4g m or more, or lower "
               "terrain.height",
               hx_leg_name(leg), delta[leg], radius, delta[leg] - radius);
      return HX_INVALID_MODEL;
    }
  return HX_OK;
}

/* Fails if lines of two legs are so near to each other that the contact law does not hold. */
static hxStatus check_start_overlap(const hxPlant *plant, char message[HX_MESSAGE_SIZE]) {
  static const char *part[] = {"femur", "tibia"};
  hxDepths depths;
  const hxModel *model = &plant->model;
  if (!model->pair_rows) return HX_OK;
  hx_kernel()->depths(model, &plant->state.contact, &plant->state.motion, &depths);
  for (int pair = 0; pair < HX_PAIR_ROWS; ++pair) {
    const double allowed = 0.5 * model->radius[HX_PAIR + pair];
    for (int leg = 0; leg < HX_LEGS; ++leg)
      if (depths.delta[HX_PAIR + pair][leg] > allowed && allowed > 0.0) {
        hx_print(message, HX_MESSAGE_SIZE,
                 "initial.%s: got its %s %.4g m inside the %s of leg %s, expected at most %.4g m, "
                 "half the sum of their radii; move the legs apart, or reduce body.knee_radius or "
                 "body.shank_radius",
                 hx_leg_name(leg), part[pair / 2], depths.delta[HX_PAIR + pair][leg],
                 part[pair % 2], hx_leg_name(hx_next_leg(leg)), allowed);
        return HX_INVALID_MODEL;
      }
  }
  return HX_OK;
}

hxStatus hx_plant_check_start(const hxPlant *plant, char message[HX_MESSAGE_SIZE]) {
  const hxStatus status = check_start_depth(plant, message);
  return status == HX_OK ? check_start_overlap(plant, message) : status;
}
