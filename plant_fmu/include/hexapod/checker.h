/* checker.h - how definitions and inputs of plant and controller are judged. Not for users of their
 * headers. */
#ifndef HEXAPOD_CHECKER_H
#define HEXAPOD_CHECKER_H

#include "hexapod/inside.h"
#include "hexapod/legs.h"
#include "hexapod/status.h"

HX_HIDDEN_BEGIN

/* Collects the first failure; every check after it is silent. */
typedef struct hxChecker {
  hxStatus status;
  char *message; /* HX_MESSAGE_SIZE bytes, or NULL */
} hxChecker;

void hx_check_fail(hxChecker *checker, const char *name, double got, const char *expected);

/* Every number within its range; NaN lies in none. */
void hx_check_ranges(hxChecker *checker, const void *structure, const hxRange *range, size_t n);

/* Writes "LF.coxa.QUANTITY" or the like. */
void hx_joint_label(int leg, int joint, const char *quantity, char name[32]);

HX_HIDDEN_END

#endif
