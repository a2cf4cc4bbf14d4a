/* footprints.c - the ring of footprints: adds, searches, saves and takes them back */
#include "footprints.h"

#include <stddef.h>
#include <string.h>

/* Returns the ring's entry of footprint k. */
static int entry(double k) { return (int)((long long)k % HX_FOOTPRINTS); }

/* Returns how many of those made a ring holds, 0 for a NaN. */
static int number_of(double count) {
  if (count >= HX_FOOTPRINTS) return HX_FOOTPRINTS;
  return count > 0.0 ? (int)count : 0;
}

int hx_footprints_number(const hxFootprints *footprints) { return number_of(footprints->count); }

void hx_footprints_clear(hxFootprintLog *log) {
  const size_t used = (size_t)hx_footprints_number(&log->kept);
  memset(log->kept.footprint, 0, used * sizeof(hxFootprint));
  log->kept.count = log->call_start = 0.0;
}

void hx_footprints_begin(hxFootprintLog *log) { log->call_start = log->kept.count; }

void hx_footprints_take_back(hxFootprintLog *log) {
  hxFootprints *kept = &log->kept;
  const double made = kept->count - log->call_start;
  const double changed = made < HX_FOOTPRINTS ? made : HX_FOOTPRINTS;
  for (double k = 0.0; k < changed; k += 1.0)
    kept->footprint[entry(log->call_start + k)] = log->lost[entry(log->call_start + k)];
  kept->count = log->call_start;
}

void hx_footprints_add(hxFootprintLog *log, const hxFootprint *footprint) {
  hxFootprints *kept = &log->kept;
  const int k = entry(kept->count);
  if (kept->count - log->call_start < HX_FOOTPRINTS) log->lost[k] = kept->footprint[k];
  kept->footprint[k] = *footprint;
  kept->count += 1.0;
}

double hx_footprints_depth(const hxFootprints *footprints, double x, double y) {
  const int number = hx_footprints_number(footprints);
  double depth = 0.0;
  for (int k = 0; k < number; ++k) {
    const hxFootprint *footprint = &footprints->footprint[k];
    const double dx = x - footprint->x, dy = y - footprint->y;
    if (dx * dx + dy * dy <= footprint->radius * footprint->radius && footprint->depth > depth)
      depth = footprint->depth;
  }
  return depth;
}

int hx_footprints_check(const unsigned char *bytes) {
  double count;
  memcpy(&count, bytes + offsetof(hxFootprints, count), sizeof count);
  const int number = number_of(count);
  unsigned found = 0;
  for (size_t i = offsetof(hxFootprints, footprint) + (size_t)number * sizeof(hxFootprint);
       i < sizeof(hxFootprints); ++i)
    found |= bytes[i];
  return found == 0 ? number : -1;
}

void hx_footprints_write(unsigned char *bytes, const hxFootprints *from) {
  const size_t end =
      offsetof(hxFootprints, footprint) + (size_t)hx_footprints_number(from) * sizeof(hxFootprint);
  memcpy(bytes, from, end);
  memset(bytes + end, 0, sizeof *from - end);
}

void hx_footprints_read(hxFootprintLog *log, const unsigned char *bytes) {
  memcpy(&log->kept, bytes, sizeof log->kept);
  log->call_start = log->kept.count;
}
