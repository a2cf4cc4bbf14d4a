/* kernel.h - table of functions of the physics for one instruction set, and the list of such
 * kernels
 *
 * Each kernel_*.c compiles entry_points.h and what it includes at its own width. All kernels
 * give the same bits (packs/lanes.h), so a state saved by one can be continued by another.
 */
#ifndef HX_KERNEL_H
#define HX_KERNEL_H

#include "state.h"

HX_HIDDEN_BEGIN

/* What a call and its steps share: where it ends, events, what they change outside the state. */
typedef struct hxEvents {
  int stop;                   /* 1: a call ends at a touch-down or lift-off; 2: after any step */
  int found, ended;           /* whether there was such an event; with stop = 2 a step */
  const hxModel *feet;        /* the model with the rows of feet alone */
  int continues;              /* 1: a later part of a call, whose peaks stay */
  double t_end;               /* s  of the call */
  hxState *before;            /* for a copy of what steps change; NULL: it is made */
  hxFootprintLog *footprints; /* that feet leave in soil */
} hxEvents;

/* Keeps what steps change, once in a call, before a step that another one follows, which may fail.
 * A call of one step fails before it changes that. */
static inline void hx_keep_state(const hxModel *model, const hxState *state, hxEvents *events) {
  if (events->before) hx_copy_state(model, events->before, state);
  events->before = NULL;
}

/* Returns whether a call ends here. */
static inline int hx_ends_here(const hxEvents *events) {
  return events->stop && (events->found || events->ended);
}

typedef struct hxKernel {
  const char *name;
  int (*is_supported)(void); /* whether this processor has the instructions */
  size_t scratch;            /* bytes of work space, see hx_scratch_size */

  /* Sets contacts, energy, counters and time at the start of a motion. */
  void (*start)(const hxModel *model, double t, hxState *state, void *scratch);

  /* Advances the state to t_end exactly, or to an event; the command changes by ramp per second,
   * or is constant (NULL). A command older than the state belongs to a call that an event
   * interrupted. After a failure the state lies between the two times and the message gives the
   * reason. */
  hxStatus (*integrate)(const hxModel *model, const hxCommand *command, const hxCommand *ramp,
                        double t_end, hxEvents *events, hxState *state, void *scratch,
                        char *message);

  /* Computes dy/dt, and the multipliers on request. */
  void (*derivative)(const hxModel *model, const hxState *state, const hxCommand *command,
                     int multipliers, void *scratch, hxPlantMotion *rate);

  /* Computes the motion at coordinates. */
  void (*place)(const hxModel *model, const hxCoordinates *x, hxPlantMotion *motion);
  /* Computes coordinates of a motion and their rates; either result may be NULL. */
  void (*coordinates)(const hxModel *model, const hxState *state, const hxCommand *command,
                      void *scratch, hxCoordinates *x, hxCoordinates *rate);

  /* Computes penetration and approach speed of all contacts, of feet on soil from the depths at
   * which they touch it. */
  void (*depths)(const hxModel *model, const hxContactState *contact, const hxPlantMotion *motion,
                 hxDepths *depths);

  /* Switches the contacts that are due at the state's time by these penetrations. */
  void (*switch_contacts)(const hxModel *model, hxDepths *depths, hxFootprintLog *footprints,
                          hxState *state);

  /* Measures the path since the last moment, when an importer's solver has completed its step. */
  void (*measure)(const hxModel *model, const hxCommand *command, hxState *state, void *scratch);

  /* Computes groups of outputs, hxOutputGroup. */
  void (*output)(const hxModel *model, const hxState *state, const hxCommand *command,
                 unsigned groups, void *scratch, hxOutput *output);

  /* Computes the rates of those outputs that are integrals since the start. */
  void (*integral_rates)(const hxModel *model, const hxState *state, const hxCommand *command,
                         void *scratch, hxOutput *rate);

  /* Solves eq. 1 for accelerations, multipliers and motor torques. */
  void (*accelerations)(const hxModel *model, const hxState *state, const hxCommand *command,
                        void *scratch, double acceleration[HX_BODIES][6],
                        double multiplier[HX_BODIES - 1][HX_MULTIPLIERS],
                        double drive_torque[HX_BODIES - 1]);
} hxKernel;

extern const hxKernel hx_kernel_baseline;

/* Kernels of wider instruction sets, where the compiler can build them. GCC for Windows cannot: it
 * aligns the stack to 16 bytes but stores wider vectors as if aligned (GCC bug 54412). */
#if defined(__GNUC__) && defined(__x86_64__) && !defined(HX_BASELINE_ONLY) &&                      \
    (defined(__clang__) || !defined(_WIN32))
#define HX_HAS_X86_KERNELS 1
extern const hxKernel hx_kernel_avx2, hx_kernel_avx512;
#else
#define HX_HAS_X86_KERNELS 0
#endif

/* All kernels of this build, fastest first, ended by NULL. */
extern const hxKernel *const hx_kernels[];

/* Returns the fastest kernel that this processor supports. */
const hxKernel *hx_kernel(void);

/* Returns the size of the scratch that every kernel and hx_tangent can do with, bytes. It is
 * aligned to HX_WORK_ALIGNMENT. Every call may use all of it, and none reads what another one has
 * left there. */
size_t hx_scratch_size(void);

HX_HIDDEN_END

#endif
