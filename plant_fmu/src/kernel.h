/* kernel.h - the physics of one instruction set behind a table of functions, and which of these
 * this build has
 *
 * lanes/entry_points.h and what it includes are compiled once for each kernel_*.c, at its width.
 * All kernels give the same bits (lanes/lanes.h), so a state saved under one goes on under another.
 */
#ifndef HX_KERNEL_H
#define HX_KERNEL_H

#include "state.h"

HX_HIDDEN_BEGIN

/* Touch-downs and lift-offs: whether a call ends at the first, and whether there was one. */
typedef struct hxEvents {
  int stop, found;
} hxEvents;

typedef struct hxKernel {
  const char *name;
  int (*runs_here)(void); /* whether this processor has its instructions */

  /* Sets contacts, energy, counters and time of a motion that starts here and now. */
  void (*start)(const hxModel *model, double t, hxState *state);

  /* Advances the state to t_end exactly, or to an event; the command changes by the ramp per
   * second, or is held (NULL). A command older than the state is that of a call which an event
   * broke off. On failure the state is somewhere on the way and the message says why. */
  hxStatus (*integrate)(const hxModel *model, const hxCommand *command, const hxCommand *ramp,
                        double t_end, hxEvents *events, hxState *state, char *message);

  /* dy/dt, with or without the multipliers on the way. */
  void (*derivative)(const hxModel *model, const hxState *state, const hxCommand *command,
                     int multipliers, hxPlantMotion *rate);

  /* A motion on its joints at coordinates; coordinates of a motion and their rates, either of which
   * may be NULL. */
  void (*place)(const hxModel *model, const hxCoordinates *x, hxPlantMotion *motion);
  void (*coordinates)(const hxModel *model, const hxState *state, const hxCommand *command,
                      hxCoordinates *x, hxCoordinates *rate);

  /* All feet: penetration, approach speed; m, m/s. */
  void (*feet)(const hxModel *model, const hxPlantMotion *motion, double delta[HX_SLOTS],
               double ddelta[HX_SLOTS]);

  /* Touch-downs and lift-offs that are due at the state's time by these penetrations. */
  void (*switch_contacts)(const hxModel *model, const double delta[HX_SLOTS],
                          const double ddelta[HX_SLOTS], hxState *state);

  /* Measures the path since the last moment, for solvers of others whose step to here is completed.
   */
  void (*measure)(const hxModel *model, const hxCommand *command, hxState *state);

  void (*output)(const hxModel *model, const hxState *state, const hxCommand *command,
                 hxOutput *output);

  /* Rates of the outputs that are integrals since the start. */
  void (*integral_rates)(const hxModel *model, const hxState *state, const hxCommand *command,
                         hxOutput *rate);

  void (*accelerations)(const hxModel *model, const hxState *state, const hxCommand *command,
                        double acceleration[HX_BODIES][6],
                        double multiplier[HX_BODIES - 1][HX_MULTIPLIERS],
                        double drive_torque[HX_BODIES - 1]);
} hxKernel;

extern const hxKernel hx_kernel_baseline;

/* Kernels of wider instruction sets, where the compiler can build them. Not by GCC for Windows,
 * which aligns the stack to 16 bytes and then stores wider vectors there as if aligned (its bug
 * 54412). */
#if defined(__GNUC__) && defined(__x86_64__) && !defined(HX_BASELINE_ONLY) &&                      \
    (defined(__clang__) || !defined(_WIN32))
#define HX_HAS_X86_KERNELS 1
extern const hxKernel hx_kernel_avx2, hx_kernel_avx512;
#else
#define HX_HAS_X86_KERNELS 0
#endif

/* All kernels of this build, fastest first, ended by NULL. */
extern const hxKernel *const hx_kernels[];

/* The fastest kernel that this processor runs. */
const hxKernel *hx_kernel(void);

HX_HIDDEN_END

#endif
