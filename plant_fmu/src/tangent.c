/* tangent.c - the physics compiled for complex numbers; the imaginary part of each result is a
 * derivative */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(__GNUC__) && !defined(HX_NO_COMPLEX)

/* products of complex numbers without the standard's treatment of infinities */
#if defined(__clang__)
#pragma STDC CX_LIMITED_RANGE ON
#else
#pragma GCC optimize("cx-limited-range")
#endif

#include "ground/surface.h" /* before double is redefined: queries of the ground are real */

/* In this file every number of the structures is complex; to_complex() converts the bytes of real
 * structures. */
typedef double _Complex hxComplex;
#define double hxComplex
#include "tangent.h"
#undef double

#define HX_TANGENT
#define HX_LANES 1

#include "lanes/coordinates.h"
#include "lanes/dynamics.h"

#include "kernels/output.h"

/* A point consists of numbers, the model's integer choices, and numbers; an output consists of
 * numbers, contact flags, and numbers. */
#define NUMBERS(bytes) ((bytes) / sizeof(hxComplex))
enum {
  POINT_FIRST = NUMBERS(offsetof(hxTangentPoint, model.contact_law)),
  POINT_CHOICES = offsetof(hxTangentPoint, model.stiffness) -
      offsetof(hxTangentPoint, model.contact_law),
  POINT_END = offsetof(hxTangentPoint, state.moment),
  POINT_LAST = NUMBERS(POINT_END - offsetof(hxTangentPoint, model.stiffness)),
  OUTPUT_FIRST = NUMBERS(offsetof(hxOutput, foot.contact)),
  OUTPUT_CONTACT = offsetof(hxOutput, torso) - offsetof(hxOutput, foot.contact),
  OUTPUT_LAST = NUMBERS(sizeof(hxOutput) - offsetof(hxOutput, torso))
};
_Static_assert(OUTPUT_CONTACT == sizeof(((hxOutput *)0)->foot.contact),
               "the flags of the contacts lie between the numbers of feet and torso");
_Static_assert(POINT_CHOICES % sizeof(double) == 0 && OUTPUT_CONTACT % sizeof(double) == 0,
               "no padding, whatever numbers are");

static const double *to_complex(const double *from, size_t n, hxComplex *to) {
  for (size_t i = 0; i < n; ++i) to[i] = hx_complex(from[i], 0.0);
  return from + n;
}

static void point_to_complex(const void *real, hxTangentPoint *point) {
  const double *from = to_complex(real, POINT_FIRST, (hxComplex *)point);
  memcpy(&point->model.contact_law, from, POINT_CHOICES);
  to_complex(from + POINT_CHOICES / sizeof(double), POINT_LAST,
             (hxComplex *)&point->model.stiffness);
}

/* Adds a change of the numbers as their imaginary part. */
static void add_direction(hxComplex *numbers, const hxComplex *change, size_t n, double scale) {
  for (size_t i = 0; i < n; ++i)
    numbers[i] = hx_complex(hx_re(numbers[i]), hx_tangent_step * (hx_re(change[i]) / scale));
}

/* Adds a change of real numbers as their imaginary part; returns what follows it. */
static const double *add_constants(hxComplex *numbers, const double *change, size_t n,
                                   double scale) {
  for (size_t i = 0; i < n; ++i)
    numbers[i] = hx_complex(hx_re(numbers[i]), hx_tangent_step * (change[i] / scale));
  return change + n;
}

static double *to_derivatives(const hxComplex *from, size_t n, double scale, double *to) {
  for (size_t i = 0; i < n; ++i) to[i] = hx_im(from[i]) / hx_tangent_step * scale;
  return to + n;
}

static void output_to_derivatives(const hxOutput *output, double scale, void *real) {
  double *to = to_derivatives((const hxComplex *)output, OUTPUT_FIRST, scale, real);
  memset(to, 0, OUTPUT_CONTACT);
  to_derivatives((const hxComplex *)&output->torso, OUTPUT_LAST, scale,
                 to + OUTPUT_CONTACT / sizeof(double));
}

/* The work space; the real point is where the work is written later. */
typedef struct {
  hxWork work;
  hxRate all;
  hxOutput output;
  hxTangentPoint point; /* to before its state's moment */
} hxTangentScratch;
_Static_assert(sizeof(hxWork) >= POINT_END / 2, "the real point lies in the work");

size_t hx_tangent_scratch(void) {
  return (offsetof(hxTangentScratch, point.state.moment) + 63) / 64 * 64; /* aligned behind it */
}

void hx_tangent(void *memory, const void *constants, hxCoordinates *d_rate, hxOutput *d_output) {
  hxTangentScratch *scratch = memory;
  hxTangentPoint *point = &scratch->point;
  hxOutput *output = &scratch->output;
  hxWork *work = &scratch->work;
  hxRate *all = &scratch->all;
  hxCoordinates rate;
  point_to_complex(memory, point);
  const double scale = hx_re(point->scale);
  add_direction((hxComplex *)&point->x, (const hxComplex *)&point->dx, NUMBERS(sizeof point->x),
                scale);
  add_direction((hxComplex *)&point->command, (const hxComplex *)&point->d_command,
                NUMBERS(sizeof point->command), scale);
  if (constants) {
    const double *change =
        add_constants((hxComplex *)&point->model, constants, HX_MODEL_HEAD, scale);
    change = add_constants(&point->model.stiffness, change, HX_MODEL_TAIL, scale);
    add_constants((hxComplex *)&point->state.contact, change, HX_CONTACT_SIZE, scale);
  }
  hx_motion_from_coordinates(&point->model, &point->x, &point->state.motion);
  memset(all, 0, sizeof *all);
  hx_dynamics_evaluate(&point->model, &point->state.contact, &point->command,
                       hx_re(point->state.time), &point->state.motion, NULL, NULL,
                       HX_WITH_OPEN_CONTACTS, work, all);
  hx_coordinates_rate(&all->motion, work, &rate);
  hx_output_fill(&point->model, &point->state, work, HX_OUTPUT_ALL, output);
  if (d_rate)
    to_derivatives((const hxComplex *)&rate, NUMBERS(sizeof rate), scale, (double *)d_rate);
  if (d_output) output_to_derivatives(output, scale, d_output);
}

#else

#include "tangent.h"

size_t hx_tangent_scratch(void) { return 0; }

#endif
