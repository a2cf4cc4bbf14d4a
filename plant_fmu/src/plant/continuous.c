/* continuous.c - coordinates, rates and indicators for a solver in model exchange */
#include <math.h>
#include <string.h>

#include "../command/command.h"
#include "../contact_law.h"
#include "../kernel.h"
#include "../robot/robot.h"
#include "parts.h"

static const hxCommand no_command;

void hx_plant_get_coordinates(const hxPlant *plant, hxCoordinates *x) {
  hx_kernel()->coordinates(&plant->model, &plant->state, &no_command, plant->scratch, x, NULL);
}

/* Limits of coordinates (m, m/s, rad/s, J) and of angles (rad). Larger ones are errors of a
 * solver's trial step. */
static const double largest_coordinate = 1e9, largest_angle = 1e5;

/* Returns whether coordinates are a state of the robot. */
static int are_valid_coordinates(const hxCoordinates *x) {
  return hx_largest(0.0, x, HX_COORDINATES) <= largest_coordinate &&
         hx_largest(0.0, x->angle, HX_LEGS * HX_JOINTS) <= largest_angle &&
         hx_is_attitude(x->quaternion);
}

hxStatus hx_plant_set_coordinates(hxPlant *plant, double t, const hxCoordinates *x) {
  if (!isfinite(t) || !are_valid_coordinates(x))
    return hx_plant_fail(
        plant, HX_NOT_FINITE,
        "coordinates: got numbers that are not finite, angles beyond 1e5 rad, others "
        "beyond 1e9 SI units or a "
        "quaternion near 0, expected a state of the robot");
  hx_kernel()->place(&plant->model, x, &plant->state.motion);
  plant->state.time = t;
  plant->state.call_input = 0.0;
  plant->state.moment.stale = 1.0;
  return HX_OK;
}

/* m  Half-width of the band in which contacts switch. A foot comes into contact at this depth and
 * leaves the ground at this height; within the band it switches together with another foot, if it
 * moves in that direction. Otherwise solvers that locate one foot's sign change would miss
 * another's within their rounding (docs/equations.md). */
static const double switch_band = 1e-10;

/* Switches contacts that are due and have no indicator: those of feet with walls. Others stay. */
static void switch_walls(hxPlant *plant) {
  hxDepths depths;
  const hxModel *model = &plant->model;
  if (model->listed == 1) return;
  hx_kernel()->depths(model, &plant->state.contact, &plant->state.motion, &depths);
  for (int k = 0; k < model->listed; ++k) {
    const int row = model->row[k];
    for (int slot = 0; slot < hx_slots_of(row) && !hx_is_wall(row); ++slot) {
      double *delta = &depths.delta[row][slot];
      *delta = plant->state.contact.closed[row][slot] != 0.0 ? fmax(*delta, switch_band)
                                                             : fmin(*delta, -switch_band);
    }
  }
  hx_footprints_begin(&plant->footprints);
  hx_kernel()->switch_contacts(model, &depths, &plant->footprints, &plant->state);
}

void hx_plant_completed_step(hxPlant *plant, const hxInput *input) {
  hxCommand command;
  hx_command_from_input(&command, input, plant->state.time);
  if (hx_has_bus(&plant->model)) hx_bus_send(&command, &plant->model, &plant->state);
  hx_supply_power(&command, &plant->model, &plant->state);
  hx_kernel()->measure(&plant->model, &command, &plant->state, plant->scratch);
  switch_walls(plant);
}

void hx_plant_rates(const hxPlant *plant, const hxInput *input, hxCoordinates *rate) {
  hxCommand command;
  hx_plant_command(plant, input, &command);
  hx_kernel()->coordinates(&plant->model, &plant->state, &command, plant->scratch, NULL, rate);
}

/* Returns the indicators of a row of contacts. */
static double *indicators_of(int row, hxIndicators *indicator) {
  return row == HX_FOOT    ? indicator->foot
         : row == HX_KNEE  ? indicator->knee
         : row == HX_SHANK ? indicator->shank
                           : indicator->torso;
}

void hx_plant_indicators(const hxPlant *plant, hxIndicators *indicator) {
  enum { COUNT = HX_INDICATORS };
  hxDepths depths;
  const hxModel *model = &plant->model;
  double all[COUNT];
  for (int i = 0; i < COUNT; ++i) all[i] = -1.0; /* contacts that the robot does not have */
  memcpy(indicator, all, sizeof all);
  hx_kernel()->depths(model, &plant->state.contact, &plant->state.motion, &depths);
  for (int k = 0; k < model->listed; ++k) {
    const int row = model->row[k];
    for (int slot = 0; slot < hx_slots_of(row) && !hx_is_wall(row); ++slot) {
      const int closed = plant->state.contact.closed[row][slot] != 0.0;
      double *to = hx_is_of_pair(row) ? &indicator->neighbour[slot][row - HX_PAIR]
                                      : &indicators_of(row, indicator)[slot];
      *to = depths.delta[row][slot] + (closed ? switch_band : -switch_band);
    }
  }
}

/* Returns the penetration that makes a contact switch, or keep its state; outside of the band. */
static double switching_depth(int closed, double delta, double ddelta) {
  const int in_contact = closed ? !(delta <= -switch_band || (delta < 0.0 && ddelta < 0.0))
                                : delta >= switch_band || (delta > 0.0 && ddelta > 0.0);
  return in_contact ? fmax(delta, switch_band) : fmin(delta, -switch_band);
}

int hx_plant_update_contacts(hxPlant *plant) {
  hxDepths depths;
  const hxModel *model = &plant->model;
  double before[3][HX_SLOTS];
  memcpy(before, plant->state.motion.bristle, sizeof before);
  hx_kernel()->depths(model, &plant->state.contact, &plant->state.motion, &depths);
  for (int k = 0; k < model->listed; ++k) {
    const int row = model->row[k];
    for (int slot = 0; slot < hx_slots_of(row); ++slot)
      depths.delta[row][slot] = switching_depth(plant->state.contact.closed[row][slot] != 0.0,
                                                depths.delta[row][slot], depths.ddelta[row][slot]);
  }
  hx_footprints_begin(&plant->footprints);
  hx_kernel()->switch_contacts(model, &depths, &plant->footprints, &plant->state);
  return memcmp(before, plant->state.motion.bristle, sizeof before) != 0;
}

void hx_plant_integral_rates(hxPlant *plant, const hxInput *input, hxOutput *rate) {
  hxCommand command;
  hx_plant_command(plant, input, &command);
  hx_kernel()->integral_rates(&plant->model, &plant->state, &command, plant->scratch, rate);
}
