/* message.c - prints messages with a decimal point in every locale */
#include "hexapod/message.h"

#include <stdio.h>
#include <string.h>

static int is_digit(char c) { return c >= '0' && c <= '9'; }

/* Replaces the locale's sign for the decimal point, which may be several bytes, by a point wherever
 * it is between two digits. */
static void replace_sign(char *text, const char *sign, size_t size) {
  char *at = text;
  while ((at = strstr(at, sign)) != NULL) {
    if (at > text && is_digit(at[-1]) && is_digit(at[size])) {
      *at = '.';
      memmove(at + 1, at + size, strlen(at + size) + 1);
    }
    ++at;
  }
}

void hx_print_list(char *text, size_t size, const char *format, va_list arguments) {
  char half[16];
  vsnprintf(text, size, format, arguments);
  snprintf(half, sizeof half, "%.1f", 0.5);
  const size_t sign_size = strlen(half) - 2;
  half[1 + sign_size] = '\0';
  if (strcmp(half + 1, ".") != 0) replace_sign(text, half + 1, sign_size);
}

void hx_print(char *text, size_t size, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  hx_print_list(text, size, format, arguments);
  va_end(arguments);
}

const char *hx_unit_gap(const char *unit) { return *unit ? " " : ""; }
