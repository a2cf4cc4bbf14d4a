/* start.c - checks of a definition's terrain and of the start: no contact may begin deep in it */
#include <math.h>

#include "../contact_law.h"
#include "../ground/surface.h"
#include "../kernel.h"
#include "../robot/robot.h"
#include "hexapod/message.h"
#include "hexapod/range_check.h"
#include "parts.h"

hxStatus hx_plant_check_terrain(hxPlant *plant, const hxDefinition *d, char *message) {
  if (d->terrain.kind != HX_TERRAIN_GRID) return HX_OK;
  if (!plant->terrain) {
    hx_print(
        message, HX_MESSAGE_SIZE,
        "terrain.kind: got grid and no loaded terrain, expected one; load it and set it before the "
        "reset (hx_plant_set_terrain), or choose flat or slope");
    return HX_INVALID_MODEL;
  }
  const double radius = fmax(fmax(d->foot_radius, d->body.corner_radius),
                             fmax(d->body.knee_radius, d->body.shank_radius));
  const double cell = hx_terrain_cell_size(plant->terrain);
  if (hx_terrain_surface(plant->terrain) == HX_SURFACE_BLOCKS && d->soil.law != HX_SOIL_NONE) {
    hx_print(message, HX_MESSAGE_SIZE,
             "soil.law: got a soil on blocks, expected none, because blocks are rigid; choose a "
             "smooth grid, flat or slope");
    return HX_INVALID_MODEL;
  }
  if (hx_terrain_surface(plant->terrain) == HX_SURFACE_SMOOTH || cell >= 2.0 * radius) return HX_OK;
  hx_print(message, HX_MESSAGE_SIZE,
           "terrain.grid: got blocks with cells of %.9g m, expected at least %.9g m, twice the "
           "largest radius that touches them; resample the grid, or reduce foot.radius",
           cell, 2.0 * radius);
  return HX_INVALID_MODEL;
}

/* Returns how deep a sphere may be in the ground, m: its radius, where its centre reaches the
 * surface. Points have the bound of feet, because the force that the law has at a depth is the
 * same. */
static double deepest_start(const hxModel *model, int row) {
  return model->radius[row] > 0.0 ? model->radius[row] : model->radius[HX_FOOT];
}

/* Fails if a foot, a knee, a shank or a corner of the torso starts deeper in rigid ground than it
 * may: the contact law does not hold at such depths, and its force would throw the robot up. */
static hxStatus check_start_depth(const hxPlant *plant, const hxDepths *depths,
                                  char message[HX_MESSAGE_SIZE]) {
  static const char *const part[] = {
      [HX_FOOT] = "foot", [HX_KNEE] = "knee", [HX_SHANK] = "shank", [HX_TORSO] = "torso"};
  const hxModel *model = &plant->model;
  const hxContactState *contact = &plant->state.contact;
  int worst_row = HX_FOOT, worst_slot = 0;
  double excess = 0.0; /* m */
  for (int k = 0; k < model->listed; ++k)
    for (int row = model->row[k], slot = 0; slot < hx_slots_of(row); ++slot) {
      const double over = depths->delta[row][slot] - deepest_start(model, row);
      const int is_soft = row == HX_FOOT && contact->on_soil[slot] != 0.0;
      if (hx_is_wall(row) || hx_is_of_pair(row) || is_soft || !(over > excess)) continue;
      worst_row = row, worst_slot = slot, excess = over;
    }
  if (!(excess > 0.0)) return HX_OK;
  hx_print(message, HX_MESSAGE_SIZE,
           "initial.position: got %s %s %.4g m deep in the ground, expected at most %.4g m; raise "
           "initial.position[3] by %.4g m or more, or lower terrain.height",
           part[worst_row], worst_row == HX_TORSO ? "corner" : hx_leg_name(worst_slot),
           depths->delta[worst_row][worst_slot], deepest_start(model, worst_row), excess);
  return HX_INVALID_MODEL;
}

/* Fails if lines of two legs are so near to each other that the contact law does not hold. */
static hxStatus check_start_overlap(const hxModel *model, const hxDepths *depths,
                                    char message[HX_MESSAGE_SIZE]) {
  static const char *part[] = {"femur", "tibia"};
  for (int pair = 0; model->pair_rows && pair < HX_PAIR_ROWS; ++pair) {
    const double allowed = 0.5 * model->radius[HX_PAIR + pair];
    for (int leg = 0; leg < HX_LEGS; ++leg)
      if (depths->delta[HX_PAIR + pair][leg] > allowed && allowed > 0.0) {
        hx_print(message, HX_MESSAGE_SIZE,
                 "initial.%s: got its %s %.4g m inside the %s of leg %s, expected at most %.4g m, "
                 "half the sum of their radii; move the legs apart, or reduce body.knee_radius or "
                 "body.shank_radius",
                 hx_leg_name(leg), part[pair / 2], depths->delta[HX_PAIR + pair][leg],
                 part[pair % 2], hx_leg_name(hx_next_leg(leg)), allowed);
        return HX_INVALID_MODEL;
      }
  }
  return HX_OK;
}

hxStatus hx_plant_check_start(const hxPlant *plant, char message[HX_MESSAGE_SIZE]) {
  hxDepths depths;
  hx_kernel()->depths(&plant->model, &plant->state.contact, &plant->state.motion, &depths);
  const hxStatus status = check_start_depth(plant, &depths, message);
  return status == HX_OK ? check_start_overlap(&plant->model, &depths, message) : status;
}
