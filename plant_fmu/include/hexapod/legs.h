/* legs.h - order of legs (LF LM LR RF RM RR) and joints (coxa, femur, tibia), and the ranges of
 * numbers, shared by the plant and the controller. */
#ifndef HEXAPOD_LEGS_H
#define HEXAPOD_LEGS_H

#include <stddef.h>

enum {
  HX_LEGS = 6,
  HX_JOINTS = 3 /* per leg */
};

/* The allowed range of one number of a definition or an input. */
typedef struct hxRange {
  const char *name; /* name of the FMU variable */
  const char *unit; /* "" for a dimensionless number */
  double min, max;  /* inclusive */
  size_t offset;    /* bytes from the start of the structure */
  int is_int;       /* 1: the number is an int, 0: a double */
} hxRange;

#endif
