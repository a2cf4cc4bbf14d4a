/* macro_step.c - one macro-step of a plant and a controller. */
#include "hexapod/macro_step.h"

#include <string.h>

enum { WARNING = 1, NO_PRIOR_STATE = 1 };

/* stores a failed call and its status; returns 1 if the call succeeded */
static int accept(hxStepper *stepper, hxStepCall call, int status) {
  if (status <= WARNING) return 1;
  stepper->call = (int)call;
  stepper->status = status;
  return 0;
}

static int get_reals(hxStepper *stepper, const hxStepFmu *fmu, const hxStepBlock *block,
                     hxStepCall call) {
  double *value = stepper->value + block->place;
  return !block->count ||
         accept(stepper, call,
                fmu->get_reals(fmu->instance, block->reference, block->count, value));
}

static int get_flags(hxStepper *stepper, const hxStepFmu *fmu, const hxStepBlock *block,
                     hxStepCall call) {
  double *value = stepper->value + block->place;
  if (!block->count) return 1;
  const int status = fmu->get_flags(fmu->instance, block->reference, block->count, stepper->flag);
  for (size_t i = 0; i < block->count; ++i) value[i] = stepper->flag[i] ? 1.0 : 0.0;
  return accept(stepper, call, status);
}

static int step(hxStepper *stepper, const hxStepFmu *fmu, double t, hxStepCall call) {
  return accept(stepper, call, fmu->do_step(fmu->instance, t, stepper->h, NO_PRIOR_STATE));
}

/* gives the controller the body command and the measurements */
static int sense(hxStepper *stepper, const double *command) {
  const hxStepFmu *controller = &stepper->controller;
  const size_t commands = stepper->command_count, sensed = stepper->sensed_count;
  memcpy(stepper->given, command, commands * sizeof *command);
  for (size_t i = 0; i < sensed; ++i)
    stepper->given[commands + i] = stepper->value[stepper->sensed[i]];
  return accept(stepper, HX_CALL_CONTROLLER_SET,
                controller->set_reals(controller->instance, stepper->controller_input,
                                      commands + sensed, stepper->given));
}

/* reads the joint commands for the macro-step and steps the controller */
static int control(hxStepper *stepper, double t, const double *command) {
  const hxStepFmu *fmu = &stepper->controller;
  return !fmu->instance ||
         (sense(stepper, command) &&
          get_reals(stepper, fmu, &stepper->controller_output, HX_CALL_CONTROLLER_GET) &&
          get_flags(stepper, fmu, &stepper->controller_flag, HX_CALL_CONTROLLER_GET) &&
          step(stepper, fmu, t, HX_CALL_CONTROLLER_STEP));
}

static int write_plant(hxStepper *stepper) {
  const hxStepBlock *input = &stepper->plant_input;
  const hxStepFmu *plant = &stepper->plant;
  return accept(stepper, HX_CALL_PLANT_SET,
                plant->set_reals(plant->instance, input->reference, input->count,
                                 stepper->value + input->place));
}

int hx_read_plant(hxStepper *stepper) {
  const hxStepFmu *plant = &stepper->plant;
  return get_reals(stepper, plant, &stepper->plant_output, HX_CALL_PLANT_GET) &&
         get_flags(stepper, plant, &stepper->plant_flag, HX_CALL_PLANT_GET);
}

int hx_macro_step(hxStepper *stepper, double t, const double *command, hxStepHook *adjust,
                  hxStepHook *record, void *owner) {
  if (!control(stepper, t, command)) return 0;
  if (adjust) adjust(owner);
  if (!write_plant(stepper)) return 0;
  if (record) record(owner);
  return step(stepper, &stepper->plant, t, HX_CALL_PLANT_STEP) && hx_read_plant(stepper);
}
