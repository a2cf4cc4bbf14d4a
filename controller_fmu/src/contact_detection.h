/* contact_detection.h - what the foot force sensors say, and whether they can be believed. Python:
 * controller/contact_detection.py. */
#ifndef HX_CONTACT_DETECTION_H
#define HX_CONTACT_DETECTION_H

#include "hexapod/controller.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Touch-down and lift-off with hysteresis, all feet. weight [N] of the robot. */
void hx_contact_detect(double weight, const double normal[HX_LEGS], int touching[HX_LEGS]);

/* Which foot sensors contradict the plan for too long. */
typedef struct hxWatchModel {
  double period;   /* s */
  double missing;  /* N  less than this from all feet, and some force is not being reported */
  double memory;   /* s  without contradiction until a sensor is believed again */
} hxWatchModel;

typedef struct hxWatch {
  double contradicted[HX_LEGS];  /* s  for how long */
  double left[HX_LEGS];          /* s  until it is believed again */
} hxWatch;

/* The plan that the sensors are held against, of each leg. */
typedef struct hxExpected {
  int standing[HX_LEGS]; /* carries its whole share */
  int high[HX_LEGS];     /* well above the ground */
} hxExpected;

void hx_watch_compile(double weight, double cycle, double period, hxWatchModel *model);

/* Whether there is something to look after. */
int hx_watch_busy(const hxWatch *watch);

/* After another period: touching and the sum of all forces [N] are what is reported. */
void hx_watch_look(const hxWatchModel *model, const int touching[HX_LEGS], double total,
                   const hxExpected *expected, hxWatch *watch);

HX_HIDDEN_END

#endif
