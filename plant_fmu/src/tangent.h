/* tangent.h - directional derivatives of rates and outputs, by the complex step
 * (lanes/complex_step.h) */
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

/* Returns the size of the work space of hx_tangent, bytes. */
size_t hx_tangent_scratch(void);

/* Computes the derivatives of rates and outputs along the direction. The work space begins with an
 * hxTangentPoint, which is overwritten. Either result may be NULL; contact flags in d_output are
 * 0. */
void hx_tangent(void *scratch, hxCoordinates *d_rate, hxOutput *d_output);

HX_HIDDEN_END

#endif
