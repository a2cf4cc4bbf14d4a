/* macro_step.h - one macro-step of a plant and a controller.
 *
 * At t the controller gets the body command and what sensors read of the plant's outputs; its joint
 * commands are the plant's inputs from t to t + h. cosim/master/loop.py is the same in Python. The
 * loop over a run (master.h), the environments for learning (environments.h) and the page without a
 * server call this one function.
 *
 * All signals at a time are in one row of numbers, `value`, in which each block has its place:
 *
 *   plant outputs | plant flags | push | joint commands | insides | controller flags | readings
 *                                \____ plant inputs ___/
 *                                       \__ controller outputs __/
 *
 * Flags are Booleans as 0 and 1; insides are internal signals of the controller; readings are those
 * of sensors with errors (sensors.h).
 *
 * The functions of both have the types of FMI 2.0 in plain C, so that no header of the standard is
 * needed: fmi2GetReal, fmi2GetBoolean, fmi2SetReal and fmi2DoStep. Statuses up to 1 (a warning) are
 * accepted. Nothing is allocated.
 */
#ifndef HEXAPOD_MACRO_STEP_H
#define HEXAPOD_MACRO_STEP_H

#include <stddef.h>

#include "hexapod/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef int hxGetReals(void *instance, const unsigned *reference, size_t count, double *value);
typedef int hxGetFlags(void *instance, const unsigned *reference, size_t count, int *value);
typedef int hxSetReals(void *instance, const unsigned *reference, size_t count,
                       const double *value);
typedef int hxDoStep(void *instance, double t, double h, int no_prior_state);

/* An initialized instance and its functions. */
typedef struct hxStepFmu {
  void *instance; /* of the controller NULL: there is none */
  hxGetReals *get_reals;
  hxGetFlags *get_flags; /* not called where there are no flags */
  hxSetReals *set_reals;
  hxDoStep *do_step;
} hxStepFmu;

/* Variables that one call reads or writes. */
typedef struct hxStepBlock {
  const unsigned *reference; /* 1     [count] */
  size_t count;
  size_t place; /* 1     index of the first in `value` */
} hxStepBlock;

/* The call that failed. */
typedef enum hxStepCall {
  HX_CALL_NONE,
  HX_CALL_PLANT_GET,
  HX_CALL_PLANT_SET,
  HX_CALL_PLANT_STEP,
  HX_CALL_CONTROLLER_GET,
  HX_CALL_CONTROLLER_SET,
  HX_CALL_CONTROLLER_STEP
} hxStepCall;

typedef struct hxStepper {
  hxStepFmu plant, controller;
  hxStepBlock plant_output, plant_flag, plant_input;
  hxStepBlock controller_output, controller_flag;
  const unsigned *controller_input; /* 1     the body command, then the measurements */
  const size_t *sensed;             /* 1     [sensed_count] indices of these in `value` */
  size_t command_count, sensed_count;
  double *given; /*       memory for the controller's inputs */
  int *flag;     /*       memory for the flags of one FMU */
  double *value; /*       the row of values */
  double h;      /* s     the macro-step */
  int call;      /* hxStepCall  that failed */
  int status;    /* fmi2Status  of the failed call */
} hxStepper;

/* What an owner of a stepper does within a macro-step. */
typedef void hxStepHook(void *owner);

/* Reads the plant's outputs and flags. Returns 1; 0 when the call failed, which call and status
 * show. */
HX_API int hx_read_plant(hxStepper *stepper);

/* Makes the macro-step at t, s, under a body command. Returns as hx_read_plant.
 *
 * adjust: changes the joint commands in `value` before the plant gets them. record: is called
 * before the plant steps, so that a recording shows the values that led to a failed step. NULL:
 * nothing. */
HX_API int hx_macro_step(hxStepper *stepper, double t, const double *command, hxStepHook *adjust,
                         hxStepHook *record, void *owner);

#ifdef __cplusplus
}
#endif

#endif
