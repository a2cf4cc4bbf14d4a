/* message.h - formatted messages that do not depend on the locale, shared by the plant, the
 * controller and the FMI layer. Users of their headers do not need it. */
#ifndef HEXAPOD_MESSAGE_H
#define HEXAPOD_MESSAGE_H

#include <stdarg.h>
#include <stddef.h>

#include "hexapod/inside.h"

HX_HIDDEN_BEGIN

/* Write a text of at most size - 1 characters, as snprintf does in the locale "C": a process may
 * have set a locale in which 1.5 is "1,5". */
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
void hx_print(char *text, size_t size, const char *format, ...);
#if defined(__GNUC__)
__attribute__((format(printf, 3, 0)))
#endif
void hx_print_list(char *text, size_t size, const char *format, va_list arguments);

/* Returns the blank between a number and its unit, "" where the unit is "". */
const char *hx_unit_gap(const char *unit);

HX_HIDDEN_END

#endif
