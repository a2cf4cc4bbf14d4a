/* footprints.h - where feet have stood in soil: a ring of footprints, outside the state that calls
 * copy. A new footprint takes the place of the oldest one when the ring is full.
 *
 * A call that fails takes back the footprints that it made. The entries that it overwrote are kept
 * for that.
 */
#ifndef HX_FOOTPRINTS_H
#define HX_FOOTPRINTS_H

#include "hexapod/hexapod.h"
#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* The last footprints; entry k of those made is footprint[k % HX_FOOTPRINTS]. */
typedef struct hxFootprints {
  double count; /* 1  made since the start */
  hxFootprint footprint[HX_FOOTPRINTS];
} hxFootprints;

/* A ring of footprints, and what the present call has overwritten in it. */
typedef struct hxFootprintLog {
  hxFootprints kept;
  double call_start; /* 1  footprints made before the present call */
  hxFootprint *lost; /* [HX_FOOTPRINTS]  in the work space */
} hxFootprintLog;

/* Removes all footprints. */
void hx_footprints_clear(hxFootprintLog *log);

/* Begins a call. */
void hx_footprints_begin(hxFootprintLog *log);

/* Removes the footprints of the present call and restores those that it overwrote. */
void hx_footprints_take_back(hxFootprintLog *log);

/* Adds a footprint; the oldest one is forgotten when the ring is full. */
void hx_footprints_add(hxFootprintLog *log, const hxFootprint *footprint);

/* Returns the depth of the deepest footprint around a point, 0 outside of all. */
double hx_footprints_depth(const hxFootprints *footprints, double x, double y);

/* Returns how many footprints the ring holds. */
int hx_footprints_number(const hxFootprints *footprints);

/* Copies a ring to and from bytes of any alignment; entries past the last footprint are 0 there.
 * The check returns the number of footprints in the bytes, -1 if these entries are not 0. */
void hx_footprints_write(unsigned char *bytes, const hxFootprints *from);
void hx_footprints_read(hxFootprintLog *log, const unsigned char *bytes);
int hx_footprints_check(const unsigned char *bytes);

HX_HIDDEN_END

#endif
