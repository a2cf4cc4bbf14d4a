/* controller_probe.c - the controller's internal functions for the tests, under names that the library shows. */
#include "suspension.h"

HX_API void hx_probe_suspension(double mass, double damping, double stiffness, double period, hxSuspension *suspension);

void hx_probe_suspension(double mass, double damping, double stiffness, double period, hxSuspension *suspension) {
  hx_suspension_discretise(mass, damping, stiffness, period, suspension);
}
