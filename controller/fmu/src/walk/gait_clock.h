/* gait_clock.h - which legs stand and swing, period by period (C2, C50, C55). Python:
 * controller/walk/gait_clock.py. */
#ifndef HX_GAIT_CLOCK_H
#define HX_GAIT_CLOCK_H

#include "../plane.h"
#include "gait.h"
#include <string.h>

typedef struct hxGaitClockModel {
  double period, gait_period, duty;
  double gait_offset[HX_LEGS]; /* cycles; phases at clock 0 */
  double offset[HX_LEGS];      /* cycles; phases at the begin of the walk */
  /* the walk begins during the leg's swing, or while it takes up its load */
  int late[HX_LEGS];
  double handover; /* cycles in which a leg takes up or gives up its load (C18) */
} hxGaitClockModel;

/* The legs in a section of the walk, from a lift-off or touch-down to the next one. The same legs
 * are in the air throughout. */
typedef struct hxGaitClock {
  int walking;           /* the clock runs */
  int64_t before;        /* periods from the begin of the walk to the first step of the section */
  int swinging[HX_LEGS]; /* in the air */
  /* stands by the clock; a foot that makes no step neither stands by the clock nor swings */
  int standing[HX_LEGS];
  int lifted[HX_LEGS]; /* the foot lifts off at the begin of the section */
  int stayed[HX_LEGS]; /* the foot needed no step at its last lift-off and stood during its swing */
  /* the foot will need no step at its next lift-off: it is at its stance position under a body at
   * rest */
  int stays[HX_LEGS];
  int waiting; /* the clock stands still until feet at the ends of their swings carry load */
  int awaited[HX_LEGS]; /* the clock waits for this foot */
  int ending;           /* another gait follows: legs finish their steps and begin no other */
  int absent[HX_LEGS];  /* out of service: neither stands nor swings */
  int dropped[HX_LEGS]; /* ends its swing at once, straight down (C58) */
} hxGaitClock;

/* cycles by which the clock starts before the first lift-off */
static const double clock_epsilon = 1e-9;

/* Sets the phases of the legs at the begin of the walk [cycles]. */
HX_RARE void hx_gait_clock_start_at(hxGaitClockModel *model, const double begin[HX_LEGS]) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double first = begin[leg] + clock_epsilon, phase = hx_fraction(first);
    model->offset[leg] = begin[leg] - clock_epsilon;
    model->late[leg] = phase >= model->duty || phase < 0.5 * model->handover;
  }
}

static inline void hx_gait_clock_compile(const hxControllerDefinition *definition,
                                         hxGaitClockModel *model) {
  const hxGait *gait = &definition->gait;
  double begin[HX_LEGS], *offset = model->gait_offset;
  hx_gait_offsets(gait, offset);
  model->period = definition->period;
  model->gait_period = gait->period;
  model->duty = gait->duty;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    begin[leg] = offset[leg] + hx_gait_start_clock(gait, offset);
  hx_gait_clock_start_at(model, begin);
}

/* Stops the clock at its begin, with all legs standing. */
static inline void hx_gait_clock_stop(const hxGaitClockModel *model, hxGaitClock *clock) {
  int absent[HX_LEGS];
  memcpy(absent, clock->absent, sizeof absent);
  memset(clock, 0, sizeof *clock);
  memcpy(clock->absent, absent, sizeof absent);
  for (int leg = 0; leg < HX_LEGS; ++leg) clock->stayed[leg] = model->late[leg];
}

/* ------------------------------------------------------------------------------------- phases */

/* Returns the phase of a leg a number of periods after the begin of the walk (C2). */
static inline double hx_gait_clock_phase(const hxGaitClockModel *model, int leg, int64_t number) {
  const double clock = model->offset[leg] + (double)number * model->period / model->gait_period;
  return hx_fraction(clock);
}

/* Returns whether a leg stands by the clock a number of periods after the begin of the walk. */
static inline int hx_gait_clock_stands(const hxGaitClockModel *model, int leg, int64_t number) {
  return hx_gait_clock_phase(model, leg, number) < model->duty;
}

/* Returns whether a leg in service stands by the clock after a number of periods. */
static inline int hx_gait_clock_serves(const hxGaitClockModel *model, const hxGaitClock *clock,
                                       int leg, int64_t number) {
  return !clock->absent[leg] && hx_gait_clock_stands(model, leg, number);
}

/* Returns the periods on the clock `number` periods after the section began (C50). */
static inline int64_t hx_gait_clock_reached(const hxGaitClock *clock, int64_t number) {
  return clock->waiting ? clock->before : clock->before + number;
}

/* Returns the part tau of its swing that a leg at this phase has completed. */
static inline double hx_gait_clock_progress(const hxGaitClockModel *model, double phase) {
  return (phase - model->duty) / (1.0 - model->duty);
}

/* Returns the phase at which a standing leg begins to give up its load [cycles]. */
static inline double hx_gait_clock_unloads(const hxGaitClockModel *model) {
  return model->duty - 0.5 * model->handover;
}

/* Begins the walk anew with legs that all stand (C55), but for one that swings (C58); -1: none. */
HX_RARE void hx_gait_clock_start_standing(const hxGaitClockModel *model, int returning_leg,
                                          hxGaitClock *clock) {
  hx_gait_clock_stop(model, clock);
  clock->walking = 1;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    clock->standing[leg] = hx_gait_clock_serves(model, clock, leg, 0);
  if (returning_leg < 0) return;
  clock->swinging[returning_leg] = 1;
  clock->stayed[returning_leg] = 0;
}

/* ----------------------------------------------------------------------------------- sections */

/* Begins a section a number of periods after the last one, and finds the legs that lift off. */
static inline void hx_gait_clock_begin_section(const hxGaitClockModel *model, int64_t number,
                                               hxGaitClock *clock) {
  clock->before = clock->walking ? hx_gait_clock_reached(clock, number) : 0;
  clock->waiting = 0;
  memset(clock->awaited, 0, sizeof clock->awaited);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const int stood = hx_gait_clock_stands(model, leg, clock->before);
    clock->standing[leg] = hx_gait_clock_serves(model, clock, leg, clock->before + 1);
    clock->lifted[leg] = stood && !clock->standing[leg] && !clock->absent[leg];
    clock->stayed[leg] |= clock->lifted[leg];
    clock->swinging[leg] &= (!clock->standing[leg] || clock->dropped[leg]) && !clock->absent[leg];
    clock->stays[leg] = 0;
  }
}

/* Returns whether some leg ends its swing at once. */
static inline int hx_gait_clock_drops(const hxGaitClock *clock) {
  int any = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) any |= clock->dropped[leg];
  return any;
}

/* Lets the legs skip their next steps that have not begun to give up their loads (C55). kept: legs
 * that were to skip them already. */
HX_RARE void hx_gait_clock_keep_down(const hxGaitClockModel *model, const int kept[HX_LEGS],
                                     hxGaitClock *clock) {
  const int dropped = hx_gait_clock_drops(clock);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double phase = hx_gait_clock_phase(model, leg, clock->before);
    const int leaving =
        phase >= hx_gait_clock_unloads(model) && phase < model->duty && !kept[leg] && !dropped;
    clock->stays[leg] = (!clock->swinging[leg] && !leaving) || clock->absent[leg];
    clock->lifted[leg] &= !clock->stays[leg];
  }
}

/* Ends the swings at once; the walk ends with them (C58). */
static inline void hx_gait_clock_drop(hxGaitClock *clock) {
  clock->ending = 1;
  clock->waiting = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    clock->dropped[leg] = clock->swinging[leg] &= !clock->absent[leg];
  memset(clock->awaited, 0, sizeof clock->awaited);
}

/* Lets the legs skip their steps whose feet are in their stance positions. Returns whether all legs
 * stand there. */
static inline int hx_gait_clock_skip(const int home[HX_LEGS], hxGaitClock *clock) {
  int all_home = 1;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const int stays = home[leg] || clock->absent[leg];
    clock->lifted[leg] &= !stays;
    clock->stays[leg] = stays && !clock->swinging[leg];
    all_home &= stays && !clock->swinging[leg] && !clock->lifted[leg];
  }
  return all_home;
}

/* Lifts the legs off that are in `lifted`. */
static inline void hx_gait_clock_set_out(hxGaitClock *clock) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    clock->swinging[leg] |= clock->lifted[leg];
    clock->stayed[leg] &= !clock->lifted[leg];
  }
  clock->walking = 1;
}

/* Finds the legs whose swing ends at the present step, or ended at the step at which the clock was
 * stopped. number: periods since the section began. */
static inline void hx_gait_clock_landing(const hxGaitClockModel *model, const hxGaitClock *clock,
                                         int64_t number, int landing[HX_LEGS]) {
  const int64_t next = hx_gait_clock_reached(clock, number) + 1;
  const int dropped = hx_gait_clock_drops(clock);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    landing[leg] = clock->walking && !dropped && clock->swinging[leg] &&
                   hx_gait_clock_stands(model, leg, next);
}

/* Begins a section in which the clock stands still (C50). number: as for landing. */
static inline void hx_gait_clock_hold(const hxGaitClockModel *model, int64_t number,
                                      hxGaitClock *clock) {
  hx_gait_clock_landing(model, clock, number, clock->awaited);
  clock->before = hx_gait_clock_reached(clock, number);
  clock->waiting = 1;
  memset(clock->lifted, 0, sizeof clock->lifted);
}

/* Returns whether a step, in periods after the first, still belongs to the section: no leg lifts
 * off or touches down before it. */
static inline int hx_gait_clock_reach(const hxGaitClockModel *model, const hxGaitClock *clock,
                                      int64_t number) {
  if (!clock->walking || clock->waiting || number == 1) return 1;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    if (hx_gait_clock_serves(model, clock, leg, clock->before + number) != clock->standing[leg])
      return 0;
  return 1;
}

/* Returns whether all legs stand and begin no other step, because another gait follows. */
static inline int hx_gait_clock_ended(const hxGaitClock *clock) {
  int ended = clock->ending && !clock->waiting;
  for (int leg = 0; leg < HX_LEGS; ++leg) ended &= clock->stays[leg];
  return ended;
}

#endif
