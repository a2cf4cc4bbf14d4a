/* legs.h - what plant and controller agree on: legs in the order LF LM LR RF RM RR, joints coxa,
 * femur, tibia; and how ranges are told. */
#ifndef HEXAPOD_LEGS_H
#define HEXAPOD_LEGS_H

#include <stddef.h>

enum {
  HX_LEGS = 6,
  HX_JOINTS = 3 /* per leg */
};

/* What one number of a definition or an input may be. */
typedef struct hxRange {
  const char *name;  /* as in the FMU */
  const char *unit;  /* "" when it has none */
  double min, max;   /* inclusive */
  size_t offset;     /* into the structure */
  int is_int;        /* an int there, otherwise a double */
} hxRange;

#endif
