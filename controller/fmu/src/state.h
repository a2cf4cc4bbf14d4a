/* state.h - data of a controller: constants compiled from the definition, and the state, without
 * pointers; and its tick, from body command and measurement to joint commands. Python:
 * controller/controller.py. */
#ifndef HX_CONTROLLER_STATE_H
#define HX_CONTROLLER_STATE_H

#include "comply/paper.h"
#include "hexapod/inside.h"
#include "plan.h"
#include "sense/health.h"
#include "walk/fade.h"

HX_HIDDEN_BEGIN

/* Constants, by controller.c: hx_controller_compile(), with the compile functions of the parts. */
typedef struct hxControllerModel {
  int paper;          /* 1: the paper's control; 0: compliant or kinematic control */
  int watches_servos; /* 1: servos that do not work are searched for: all but kinematic control */
  hxGait gait;
  hxWalkPlanModel plan;
  hxPaperModel corrections; /* of the paper's control */
  hxFadeModel fade;
  hxHealthModel health;
} hxControllerModel;

typedef struct hxControllerState {
  /* controller.c: hx_controller_begin() */
  double start; /* s  time of the first tick */
  /* schedule.c: hx_controller_step() */
  double time; /* s */
  /* controller.c: hx_controller_tick() */
  int64_t tick;              /* 1  number of the next tick */
  hxWalkPlan plan;           /* by plan.h */
  hxHealth health;           /* by sense/health.h */
  hxCompliant compliant;     /* by comply/compliant.h */
  hxPaper paper;             /* by comply/paper.h */
  hxFade fade;               /* by walk/fade.h  from the control before */
  int gait_is_outdated;      /* 1: the legs in service have changed, their gait is to follow */
  hxControllerOutput output; /* of the last tick */
  /* controller.c: hx_controller_change() and hx_controller_adopt() */
  int model;            /* 1  index of the present model; the other one is that of the next gait */
  int is_changing_gait; /* 1: to that of the other model */
  int returning_leg;    /* 1  leg that is in service again in the next gait, from 1; 0: none */
} hxControllerState;

struct hxController {
  hxControllerDefinition definition; /* with the gait that was asked for last */
  hxControllerModel model[2];        /* of the present gait and of the next one */
  /* the present state, and the other one: the next tick's, computed early for its outputs, or that
   * before a step, which one that fails restores. It is not part of the controller's state */
  hxControllerState state[2];
  int present;             /* 1  index of the present state */
  int is_ahead;            /* 1: the other state is that after the next tick under `input` */
  hxControllerInput input; /* of that tick */
  char message[HX_MESSAGE_SIZE];
};

void hx_controller_compile(const hxControllerDefinition *definition, hxControllerModel *model);

/* Resets to standing in the stance, with all states of the laws cleared. */
void hx_controller_begin(const hxControllerModel *model, double t, hxControllerState *state);

/* Continues in the gait of the other model once all legs stand and carry their whole loads, when
 * the gait is being changed (C55). The models differ in their gaits only. */
void hx_controller_adopt(hxControllerModel model[2], hxControllerState *state);

/* Begins a change to the gait of the other model (C55). returning_leg: as in the state. */
void hx_controller_change(hxControllerModel model[2], int returning_leg, hxControllerState *state);

/* Goes on under another control, which the present model has been compiled for, in the present
 * phase of the walk: the plan keeps its state, the laws begin anew, and the joint commands fade
 * over from the last ones. before: the paths' model of the present gait under the control before.
 */
void hx_controller_exchange(hxControllerModel *model, const hxFootPathsModel *before,
                            hxControllerState *state);

/* Checks the range of every number of an input. On failure message says which value was got and
 * what was expected. */
hxStatus hx_controller_input_check(const hxControllerInput *input, char *message);

/* Computes one tick; state->output then holds the commands for this input. */
void hx_controller_tick(const hxControllerModel *model, const hxControllerInput *input,
                        hxControllerState *state);

HX_HIDDEN_END

#endif
