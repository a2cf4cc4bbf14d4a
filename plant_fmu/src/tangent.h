/* tangent.h - directional derivatives of rates and outputs, by the complex step
 * (packs/complex_step.h) */
#ifndef HX_TANGENT_H
#define HX_TANGENT_H

#include "state.h"

HX_HIDDEN_BEGIN

/* HX_NO_COMPLEX: build as a compiler without arithmetic on complex numbers does, such as MSVC */
#if defined(__GNUC__) && !defined(HX_NO_COMPLEX)
#define HX_HAS_TANGENT 1
#else
#define HX_HAS_TANGENT 0
#endif

/* A point and a direction. */
typedef struct hxTangentPoint {
  hxCommand command, d_command;
  hxCoordinates x, dx;
  double scale; /* > 0  magnitude of d_command and dx */
  hxModel model;
  /* contacts, time and measurements; the motion is that of x. Last, because the work space ends
   * before its moment, which the physics does not read */
  hxState state;
} hxTangentPoint;

/* Numbers of a model before and behind its choices. */
enum {
  HX_MODEL_HEAD = offsetof(hxModel, contact_law) / sizeof(double),
  HX_MODEL_TAIL = (sizeof(hxModel) - offsetof(hxModel, stiffness)) / sizeof(double),
  HX_CONTACT_SIZE = sizeof(hxContactState) / sizeof(double)
};

/* Changes of the constants that depend on parameters: of a model, then of contacts. */
enum { HX_CONSTANTS = HX_MODEL_HEAD + HX_MODEL_TAIL + HX_CONTACT_SIZE };

/* Returns the size of the work space of hx_tangent, bytes. */
size_t hx_tangent_scratch(void);

/* The same with what parameters add to it (plant/derivative.c). */
size_t hx_derivative_scratch(void);

/* Computes the derivatives of rates and outputs along the direction. The work space begins with an
 * hxTangentPoint, which is overwritten. constants: HX_CONSTANTS doubles outside of it, their change
 * in the direction; NULL: none. Either result may be NULL; contact flags in d_output are 0. */
void hx_tangent(void *scratch, const void *constants, hxCoordinates *d_rate, hxOutput *d_output);

HX_HIDDEN_END

#endif
