/* range_check.h - checks and ramps of definitions and inputs, shared by all components.
 * Users of their headers do not need it. */
#ifndef HEXAPOD_RANGE_CHECK_H
#define HEXAPOD_RANGE_CHECK_H

#include "hexapod/inside.h"
#include "hexapod/legs.h"
#include "hexapod/status.h"

HX_HIDDEN_BEGIN

/* Collects the first failure; later failures are ignored. */
typedef struct hxChecker {
  hxStatus status;
  char *message; /* HX_MESSAGE_SIZE bytes, or NULL */
} hxChecker;

/* Records a failure, with a message that says what was got and what was expected. */
void hx_check_fail(hxChecker *checker, const char *name, double got, const char *expected);

/* Fails for the first of n numbers that is outside its range. NaN is outside every range. */
void hx_check_ranges(hxChecker *checker, const void *structure, const hxRange *range, size_t n);

/* Returns HX_OK if a step from a time may end at t_end [s]; otherwise writes a message. */
hxStatus hx_check_end(double time, double t_end, char *message);

/* Computes n inputs some time after they were set, with their rates of change. */
void hx_ramp(const void *input, const void *rate, double time, size_t n, void *now);

/* Returns the name of a leg, for example "LF". */
const char *hx_leg_name(int leg);

/* Writes the variable's name, for example "LF.coxa.QUANTITY". */
void hx_joint_label(int leg, int joint, const char *quantity, char name[32]);

HX_HIDDEN_END

#endif
