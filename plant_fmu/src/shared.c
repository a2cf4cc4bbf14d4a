/* shared.c - what every component needs: names of statuses, checksums, range checks */
#include <float.h>
#include <string.h>

#include "hexapod/message.h"
#include "hexapod/range_check.h"
#include "hexapod/status.h"

const char *hx_status_name(hxStatus status) {
  static const char *const names[] = {
      [HX_OK] = "ok",
      [HX_INVALID_ARGUMENT] = "invalid argument",
      [HX_INVALID_MODEL] = "invalid model",
      [HX_STEP_TOO_SMALL] = "step too small",
      [HX_NOT_FINITE] = "not finite",
      [HX_OUT_OF_MEMORY] = "out of memory",
      [HX_BAD_STATE] = "bad state",
  };
  const unsigned index = (unsigned)status;
  return index < sizeof names / sizeof names[0] ? names[index] : "unknown status";
}

/* FNV-1a over little-endian words, the last one padded with zeros. A shift after each product
 * mixes high bits into low ones, without which changes of sign bits would cancel. Every step is
 * invertible in the hash and in the word. */
uint64_t hx_checksum(uint64_t seed, const void *bytes, size_t n) {
  const unsigned char *byte = bytes;
  uint64_t hash = seed ^ 0xcbf29ce484222325u;
  for (size_t i = 0; i < n; i += 8) {
    uint64_t word = 0;
    for (size_t k = 0; k < 8 && i + k < n; ++k) word |= (uint64_t)byte[i + k] << (8 * k);
    hash = (hash ^ word) * 0x100000001b3u;
    hash ^= hash >> 32;
  }
  return (hash ^ n) * 0x100000001b3u;
}

void hx_check_fail(hxChecker *checker, const char *name, double got, const char *expected) {
  if (checker->status != HX_OK) return;
  checker->status = HX_INVALID_MODEL;
  if (checker->message)
    hx_print(checker->message, HX_MESSAGE_SIZE, "%s: got %.9g, expected %s", name, got, expected);
}

static double number_at(const void *structure, const hxRange *range) {
  const char *place = (const char *)structure + range->offset;
  double real;
  int whole;
  if (range->is_int) {
    memcpy(&whole, place, sizeof whole);
    return (double)whole;
  }
  memcpy(&real, place, sizeof real);
  return real;
}

/* Returns the index of the first number outside its range, n: none. */
static size_t first_outside(const void *structure, const hxRange *range, size_t n) {
  for (size_t i = 0; i < n; ++i) {
    const double x = number_at(structure, &range[i]);
    if (!(x >= range[i].min && x <= range[i].max)) return i;
  }
  return n;
}

void hx_check_ranges(hxChecker *checker, const void *structure, const hxRange *range, size_t n) {
  char expected[96];
  const size_t i = first_outside(structure, range, n);
  if (i == n) return;
  hx_print(expected, sizeof expected, "%.9g to %.9g%s%s", range[i].min, range[i].max,
           hx_unit_gap(range[i].unit), range[i].unit);
  hx_check_fail(checker, range[i].name, number_at(structure, &range[i]), expected);
}

hxStatus hx_check_end(double time, double t_end, char *message) {
  if (t_end >= time && t_end <= DBL_MAX) return HX_OK;
  hx_print(message, HX_MESSAGE_SIZE,
           "end of step: got %.17g s, expected a finite time of at least %.17g s; step forwards",
           t_end, time);
  return HX_INVALID_ARGUMENT;
}

void hx_ramp(const void *input, const void *rate, double time, size_t n, void *now) {
  const double *from = input, *slope = rate;
  double *to = now;
  for (size_t i = 0; i < n; ++i) to[i] = from[i] + slope[i] * time;
}

const char *hx_leg_name(int leg) {
  static const char *const legs[HX_LEGS] = {"LF", "LM", "LR", "RF", "RM", "RR"};
  return legs[leg];
}

void hx_joint_label(int leg, int joint, const char *quantity, char name[32]) {
  static const char *const joints[HX_JOINTS] = {"coxa", "femur", "tibia"};
  hx_print(name, 32, "%s.%s.%s", hx_leg_name(leg), joints[joint], quantity);
}
