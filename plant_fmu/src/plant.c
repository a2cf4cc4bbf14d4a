#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "contact_law.h"
#include "ground/surface.h"
#include "ground/valleys.h"
#include "hexapod/message.h"
#include "hexapod/range_check.h"
#include "kernel.h"
#include "robot.h"
#include "tangent.h"
#include "validation.h"

/* A saved state: a head that identifies it, then the plant's model and state. */
typedef struct {
  uint64_t magic, version, size, checksum;
  uint64_t terrain; /* checksum of the grid; 0: none. The head ends here */
  hxModel model;
  hxState state;
  hxFootprints footprints; /* the last ones; unused entries are 0 */
} hxSavedPlant;

static const uint64_t magic = 0x74616c5064507868u; /* "hxPdPlat" */
static const uint64_t saved_version = 17;

/* Returns the checksum of a saved plant's bytes behind it, of the ring those of its footprints. */
static uint64_t checksum(const unsigned char *bytes, int footprints) {
  const size_t used = (size_t)footprints * sizeof(hxFootprint),
               end = offsetof(hxSavedPlant, footprints.print) + used;
  return hx_checksum(0, bytes + offsetof(hxSavedPlant, terrain),
                     end - offsetof(hxSavedPlant, terrain));
}

/* Sets the plant's message and returns the status. */
static hxStatus fail(hxPlant *plant, hxStatus status, const char *text) {
  hx_print(plant->message, HX_MESSAGE_SIZE, "%s", text);
  return status;
}

const char *hx_plant_message(const hxPlant *plant) { return plant->message; }
double hx_plant_time(const hxPlant *plant) { return plant->state.time; }

hxPlant *hx_plant_create(void) {
  hxPlant *plant = calloc(1, hx_plant_size());
  hxDefinition definition;
  if (!plant) return NULL;
  hx_plant_use_work(plant, NULL, 0);
  hx_definition_default(&definition);
  hx_plant_reset(plant, &definition, 0.0);
  return plant;
}

void hx_plant_destroy(hxPlant *plant) { free(plant); }

void hx_plant_set_terrain(hxPlant *plant, const hxTerrain *terrain) {
  plant->terrain = terrain;
  plant->valley_limit = 0.0;
}

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

/* Returns whether a definition's ground is there and suits its contacts; else writes why not. */
static hxStatus check_terrain(hxPlant *plant, const hxDefinition *d, char *message) {
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

/* Sets the model with the rows of feet alone, after every change of the model. */
static void derive_feet(hxPlant *plant) {
  plant->feet = plant->model;
  plant->feet.rows = plant->feet.listed = plant->model.foot_rows;
  plant->feet.torso_rows = plant->feet.pair_rows = 0;
}

hxStatus hx_plant_reset(hxPlant *plant, const hxDefinition *definition, double t) {
  char message[HX_MESSAGE_SIZE];
  double body[HX_BODIES][HX_BODY_STATE];
  if (!isfinite(t))
    return fail(plant, HX_INVALID_ARGUMENT,
                "start time: got a number that is not finite, expected a finite time in s");
  hxStatus status = hx_definition_check(definition, message);
  if (status == HX_OK) status = check_terrain(plant, definition, message);
  if (status != HX_OK) return fail(plant, status, message);
  plant->feet = plant->model;
  *plant->state_before = plant->state;
  memset(&plant->model, 0, sizeof plant->model);
  memset(&plant->state, 0, sizeof plant->state);
  hx_model_compile(&plant->model, definition, plant->terrain);
  hx_initial_bodies(definition, body);
  hx_motion_from_bodies(&plant->model, (const double (*)[HX_BODY_STATE])body, &plant->state.motion);
  hx_kernel()->start(&plant->model, t, &plant->state, plant->scratch);
  status = check_start_depth(plant, message); /* the cells of feet on blocks are known now */
  if (status == HX_OK) status = check_start_overlap(plant, message);
  if (status != HX_OK) {
    plant->model = plant->feet;
    plant->state = *plant->state_before;
    derive_feet(plant);
    return fail(plant, status, message);
  }
  derive_feet(plant);
  hx_footprints_clear(&plant->footprints);
  plant->message[0] = '\0';
  return HX_OK;
}

/* Returns the largest magnitude of so_far and n numbers; NaN or infinity persists. */
static double largest(double so_far, const void *first, size_t n) {
  const double *entry = first;
  for (size_t i = 0; first && i < n; ++i)
    if (!isnan(so_far) && !(fabs(entry[i]) <= so_far)) so_far = fabs(entry[i]);
  return so_far;
}

/* Returns the command of a rate, NULL for a rate of zero; *finite: all its numbers are finite. */
static const hxCommand *ramp_from_rate(const hxInput *rate, hxCommand *command, int *finite) {
  const double size = largest(0.0, rate, sizeof *rate / sizeof(double));
  *finite = isfinite(size);
  if (!rate || size == 0.0) return NULL;
  hx_command_from_input(command, rate, 0.0);
  return command;
}

/* Returns a fingerprint of an input: 52 bits of a checksum, never 0. */
static double input_fingerprint(const hxInput *input) {
  return 1.0 + (double)(hx_checksum(1, input, sizeof *input) >> 12);
}

/* Computes the command of an input at the present time. */
static void present_command(const hxPlant *plant, const hxInput *input, hxCommand *command) {
  hx_command_from_input(command, input, plant->state.time);
  hx_bus_command(command, &plant->model, &plant->state);
  hx_command_supply(command, &plant->model, &plant->state);
}

/* Sets what the motors get in a call's command; a call that resumes another has what that had. */
static void supply_motors(hxPlant *plant, int resumes, hxCommand *command) {
  hxState *state = &plant->state;
  if (!resumes) {
    hx_command_supply(command, &plant->model, state);
    state->supply = command->supply;
    memcpy(state->duty, command->duty, sizeof state->duty);
  }
  command->supply = state->supply;
  memcpy(command->duty, state->duty, sizeof command->duty);
}

static const double most_parts = 1e6; /* 1  transmissions of the bus within a call */

/* Returns whether a call to t_end is possible, else writes why not. */
static hxStatus check_end(hxPlant *plant, double t_end) {
  const double time = plant->state.time, period = plant->model.bus_period;
  if (!(t_end >= time && t_end <= DBL_MAX)) {
    hx_print(plant->message, HX_MESSAGE_SIZE,
             "end of step: got %.17g s, expected a finite time of at least %.17g s", t_end, time);
    return HX_INVALID_ARGUMENT;
  }
  if (!(period > 0.0 && (t_end - time) / period > most_parts)) return HX_OK;
  hx_print(plant->message, HX_MESSAGE_SIZE,
           "servo.bus_period: got %.3g s, which makes %.3g transmissions in this call, expected at "
           "most %.3g; raise servo.bus_period or make shorter calls",
           period, (t_end - time) / period, most_parts);
  return HX_INVALID_ARGUMENT;
}

/* A call: its inputs, their fingerprint or 0, and its start, s. */
typedef struct {
  const hxInput *input;
  const hxCommand *ramp; /* NULL: constant */
  double fingerprint, start;
} hxStepCall;

/* Sets a part's command, and in *ramp its change per second; servos on a bus hold theirs. */
static void part_command(hxPlant *plant, const hxStepCall *call, int resumes, hxCommand *command,
                         hxCommand *ramp) {
  enum { SIZE = sizeof(hxCommand) / sizeof(double) };
  hxState *state = &plant->state;
  const double elapsed = state->time - call->start;
  hx_command_from_input(command, call->input, resumes ? state->call_start : state->time);
  if (hx_has_bus(&plant->model)) {
    double *to = (double *)command;
    const double time = command->time, *rate = (const double *)call->ramp;
    for (int i = 0; call->ramp && i < SIZE; ++i) to[i] += elapsed * rate[i];
    command->time = time;
    hx_bus_send(command, &plant->model, state);
    memset(ramp->angle, 0, sizeof ramp->angle);
    memset(ramp->speed, 0, sizeof ramp->speed);
    memset(ramp->torque, 0, sizeof ramp->torque);
  }
  supply_motors(plant, resumes, command);
}

/* Advances the plant by a part of a call: to its end, or to the next transmission of the bus. If an
 * event interrupted the last part and the input is the same, the step sequence of that part
 * continues, so that the motion does not depend on the interruption. */
static hxStatus advance_part(hxPlant *plant, const hxStepCall *call, double t_end,
                             hxEvents *events) {
  hxState *state = &plant->state;
  hxCommand command, ramp;
  const int resumes = state->call_input != 0.0 && state->call_input == call->fingerprint &&
                      state->call_start < state->time;
  if (call->ramp) ramp = *call->ramp;
  part_command(plant, call, resumes, &command, &ramp);
  const double end = hx_bus_end(&plant->model, state, t_end);
  const hxStatus status =
      hx_kernel()->integrate(&plant->model, &command, call->ramp ? &ramp : NULL, end, events, state,
                             plant->scratch, plant->message);
  const int interrupted = state->time < end;
  state->call_input = interrupted ? call->fingerprint : 0.0;
  state->call_start = interrupted ? command.time : 0.0;
  return status;
}

/* Advances the plant. */
static hxStatus advance(hxPlant *plant, const hxInput *input, const hxInput *rate, double t_end,
                        hxEvents *events) {
  hxState *before = plant->state_before;
  hxCommand change;
  int finite;
  const hxCommand *ramp = ramp_from_rate(rate, &change, &finite);
  if (!finite)
    return fail(
        plant, HX_INVALID_ARGUMENT,
        "rates of inputs: got a number that is not finite, expected finite rates per second");
  hxStatus status = check_end(plant, t_end);
  if (status == HX_OK) status = hx_input_check(input, plant->message);
  if (status != HX_OK) return status;
  hx_copy_state(&plant->model, before, &plant->state);
  const int told = !ramp && (events->stop || before->call_input != 0.0);
  const hxStepCall call = {input, ramp, told ? input_fingerprint(input) : 0.0, before->time};
  hx_footprints_begin(&plant->footprints);
  events->footprints = &plant->footprints;
  events->feet = &plant->feet;
  do {
    status = advance_part(plant, &call, t_end, events);
    events->continues = 1;
  } while (status == HX_OK && plant->state.time < t_end && !(events->stop && events->found));
  if (status == HX_OK) return HX_OK;
  hx_copy_state(&plant->model, &plant->state, before);
  hx_footprints_take_back(&plant->footprints);
  return status;
}

hxStatus hx_plant_step(hxPlant *plant, const hxInput *input, double t_end) {
  return hx_plant_step_ramp(plant, input, NULL, t_end);
}

hxStatus hx_plant_step_ramp(hxPlant *plant, const hxInput *input, const hxInput *rate,
                            double t_end) {
  return advance(plant, input, rate, t_end, &(hxEvents){.stop = 0});
}

hxStatus hx_plant_step_to_event(hxPlant *plant, const hxInput *input, double t_end, int stop,
                                int *event) {
  hxEvents events = {.stop = stop};
  const hxStatus status = advance(plant, input, NULL, t_end, &events);
  *event = events.found && status == HX_OK;
  return status;
}

void hx_plant_output_groups(hxPlant *plant, const hxInput *input, unsigned groups,
                            hxOutput *output) {
  hxCommand command;
  present_command(plant, input, &command);
  hx_kernel()->output(&plant->model, &plant->state, &command, groups, plant->scratch, output);
  if (!(groups & HX_OUTPUT_MOTION)) return;
  output->footprints = plant->footprints.kept.count;
  if (plant->model.servo_drive == HX_DRIVE_MOTOR)
    output->supply_voltage = command.supply * plant->model.voltage;
}

void hx_plant_output(hxPlant *plant, const hxInput *input, hxOutput *output) {
  hx_plant_output_groups(plant, input, HX_OUTPUT_ALL, output);
}

size_t hx_plant_footprints(const hxPlant *plant, hxFootprint *footprint, size_t capacity) {
  const hxFootprints *kept = &plant->footprints.kept;
  const size_t number = (size_t)hx_footprints_number(kept), first = (size_t)kept->count - number;
  for (size_t k = 0; k < number && k < capacity; ++k)
    footprint[k] = kept->print[(first + k) % HX_FOOTPRINTS];
  return number;
}

size_t hx_plant_state_size(void) { return sizeof(hxSavedPlant); }

/* The head of hxSavedPlant. */
typedef struct {
  uint64_t magic, version, size, checksum, terrain;
} hxSavedHead;

/* The saved plant is put together in the caller's bytes, which may have any alignment. */
void hx_plant_get_state(const hxPlant *plant, void *bytes) {
  unsigned char *to = bytes;
  const uint64_t grid = plant->model.terrain ? hx_terrain_checksum(plant->model.terrain) : 0;
  hxSavedHead head = {magic, saved_version, sizeof(hxSavedPlant), 0, grid};
  memcpy(to, &head, sizeof head);
  memcpy(to + offsetof(hxSavedPlant, model), &plant->model, sizeof plant->model);
  memset(to + offsetof(hxSavedPlant, model.terrain_bits), 0, sizeof plant->model.terrain_bits);
  memcpy(to + offsetof(hxSavedPlant, state), &plant->state, sizeof plant->state);
  hx_footprints_write(to + offsetof(hxSavedPlant, footprints), &plant->footprints.kept);
  head.checksum = checksum(to, hx_footprints_number(&plant->footprints.kept));
  memcpy(to, &head, sizeof head);
}

/* Returns whether this plant can continue a saved one, else sets its message. */
static hxStatus check_saved(hxPlant *plant, const unsigned char *bytes, size_t size,
                            hxSavedHead *head) {
  if (size != sizeof(hxSavedPlant)) {
    hx_print(plant->message, HX_MESSAGE_SIZE,
             "saved state: got %zu bytes, expected %zu; save it again with this version", size,
             sizeof(hxSavedPlant));
    return HX_BAD_STATE;
  }
  memcpy(head, bytes, sizeof *head);
  if (head->magic != magic || head->version != saved_version || head->size != size)
    return fail(
        plant, HX_BAD_STATE,
        "saved state: got one of another version, expected one of this version; save it again");
  const int footprints = hx_footprints_check(bytes + offsetof(hxSavedPlant, footprints));
  if (footprints < 0 || head->checksum != checksum(bytes, footprints))
    return fail(
        plant, HX_BAD_STATE,
        "saved state: got a damaged one, expected one whose checksum is right; save it again");
  if (head->terrain && (!plant->terrain || hx_terrain_checksum(plant->terrain) != head->terrain))
    return fail(plant, HX_BAD_STATE,
                "saved state: its ground is a grid that this plant does not have; set the one that "
                "it was saved with before");
  return HX_OK;
}

hxStatus hx_plant_set_state(hxPlant *plant, const void *bytes, size_t size) {
  const unsigned char *from = bytes;
  hxSavedHead head;
  const hxStatus status = check_saved(plant, from, size, &head);
  if (status != HX_OK) return status;
  memcpy(&plant->model, from + offsetof(hxSavedPlant, model), sizeof plant->model);
  memcpy(&plant->state, from + offsetof(hxSavedPlant, state), sizeof plant->state);
  plant->model.terrain = head.terrain ? plant->terrain : NULL;
  derive_feet(plant);
  hx_footprints_read(&plant->footprints, from + offsetof(hxSavedPlant, footprints));
  return HX_OK;
}

static const hxCommand no_command;

void hx_plant_get_coordinates(const hxPlant *plant, hxCoordinates *x) {
  hx_kernel()->coordinates(&plant->model, &plant->state, &no_command, plant->scratch, x, NULL);
}

/* Limits of coordinates (m, m/s, rad/s, J) and of angles (rad). Larger ones are errors of a
 * solver's trial step. */
static const double largest_coordinate = 1e9, largest_angle = 1e5;

/* Returns whether coordinates are a state of the robot. */
static int are_valid_coordinates(const hxCoordinates *x) {
  const double *p = x->quaternion;
  return largest(0.0, x, HX_COORDINATES) <= largest_coordinate &&
         largest(0.0, x->angle, HX_LEGS * HX_JOINTS) <= largest_angle &&
         p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3] > 1e-6;
}

hxStatus hx_plant_set_coordinates(hxPlant *plant, double t, const hxCoordinates *x) {
  if (!isfinite(t) || !are_valid_coordinates(x))
    return fail(plant, HX_NOT_FINITE,
                "coordinates: got numbers that are not finite, angles beyond 1e5 rad, others "
                "beyond 1e9 SI units or a "
                "quaternion near 0, expected a state of the robot");
  hx_kernel()->place(&plant->model, x, &plant->state.motion);
  plant->state.time = t;
  plant->state.call_input = 0.0;
  plant->state.moment.stale = 1.0;
  return HX_OK;
}

/* m  Half-width of the band in which contacts switch. A foot touches the ground at this depth and
 * leaves it at this height; within the band it switches together with another foot, if it moves in
 * that direction. Otherwise solvers that locate one foot's sign change would miss another's within
 * their rounding (docs/equations.md). */
static const double switch_band = 1e-10;

/* Switches the contacts that are due and have no indicator: those of feet with walls. Others stay.
 */
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
  hx_command_supply(&command, &plant->model, &plant->state);
  hx_kernel()->measure(&plant->model, &command, &plant->state, plant->scratch);
  switch_walls(plant);
}

void hx_plant_rates(const hxPlant *plant, const hxInput *input, hxCoordinates *rate) {
  hxCommand command;
  present_command(plant, input, &command);
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
  const int touches = closed ? !(delta <= -switch_band || (delta < 0.0 && ddelta < 0.0))
                             : delta >= switch_band || (delta > 0.0 && ddelta > 0.0);
  return touches ? fmax(delta, switch_band) : fmin(delta, -switch_band);
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

hxStatus hx_plant_tangent(hxPlant *plant, const hxInput *input, const hxInput *d_input,
                          const hxCoordinates *dx, hxCoordinates *d_rate, hxOutput *d_output) {
  static const hxInput no_input;
  static const hxCoordinates no_change;
  const double scale =
      largest(largest(0.0, d_input, sizeof *d_input / sizeof(double)), dx, HX_COORDINATES);
  if (plant->model.elastic) return hx_refuse_elastic_gears(plant->message);
  if (!isfinite(scale))
    return fail(plant, HX_INVALID_ARGUMENT,
                "derivatives: got a direction that is not finite, expected finite numbers");
#if HX_HAS_TANGENT
  hxTangentPoint *point = plant->scratch;
  hxCoordinates x;
  hx_plant_get_coordinates(plant, &x); /* before the point, because it uses the same memory */
  present_command(plant, input, &point->command);
  hx_command_from_input(&point->d_command, d_input ? d_input : &no_input, 0.0);
  point->x = x;
  point->dx = dx ? *dx : no_change;
  point->model = plant->model;
  memcpy(&point->state, &plant->state, offsetof(hxState, moment));
  point->scale = scale > 0.0 ? scale : 1.0;
  hx_tangent(point, d_rate, d_output);
  return HX_OK;
#else
  return fail(plant, HX_INVALID_ARGUMENT,
              "derivatives: got a call in a binary without complex numbers, expected another "
              "compiler's binary; build the plant with gcc or clang");
#endif
}

void hx_plant_integral_rates(hxPlant *plant, const hxInput *input, hxOutput *rate) {
  hxCommand command;
  present_command(plant, input, &command);
  hx_kernel()->integral_rates(&plant->model, &plant->state, &command, plant->scratch, rate);
}

void hx_plant_get_bodies(const hxPlant *plant, double body[HX_BODIES][HX_BODY_STATE]) {
  hx_bodies_from_motion(&plant->model, &plant->state.motion, body);
}

void hx_plant_get_torso(const hxPlant *plant, double torso[HX_BODY_STATE]) {
  memcpy(torso, plant->state.motion.torso, sizeof plant->state.motion.torso);
}

hxStatus hx_plant_set_bodies(hxPlant *plant, const double body[HX_BODIES][HX_BODY_STATE]) {
  for (int b = 0; b < HX_BODIES; ++b)
    for (int i = 0; i < HX_BODY_STATE; ++i)
      if (!isfinite(body[b][i]))
        return fail(plant, HX_INVALID_ARGUMENT,
                    "body state: got a number that is not finite, expected finite numbers");
  hx_motion_from_bodies(&plant->model, body, &plant->state.motion);
  hx_kernel()->start(&plant->model, plant->state.time, &plant->state, plant->scratch);
  return HX_OK;
}

void hx_plant_accelerations(hxPlant *plant, const hxInput *input, double acceleration[HX_BODIES][6],
                            double multiplier[HX_BODIES - 1][HX_MULTIPLIERS],
                            double drive_torque[HX_BODIES - 1]) {
  hxCommand command;
  present_command(plant, input, &command);
  hx_kernel()->accelerations(&plant->model, &plant->state, &command, plant->scratch, acceleration,
                             multiplier, drive_torque);
}
