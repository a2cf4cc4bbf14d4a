#include "hexapod/message.h"

#include <stdio.h>
#include <string.h>

enum { NUMBER_SIZE = 352 }; /* bytes, for every finite double as %.17f */

/* A conversion of a format: its length modifier ('\0', 'z' or 'l' for ll) and its letter. */
typedef struct {
  int precision; /* -1: none is given */
  char size, letter;
} hxConversion;

/* A text that is being written, of which one byte is kept for the final zero. */
typedef struct {
  char *at, *end;
} hxText;

static void append(hxText *text, const char *bytes, size_t n) {
  const size_t room = (size_t)(text->end - text->at), used = n < room ? n : room;
  memcpy(text->at, bytes, used);
  text->at += used;
}

static int is_part_of_a_number(char c) {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || c == '-' || c == '+';
}

/* Appends a number of the C library, with a point for the locale's sign, which may be several
 * bytes. */
static void append_real(hxText *text, const char *number) {
  while (*number) {
    size_t n = 0, other = 0;
    while (is_part_of_a_number(number[n])) n++;
    append(text, number, n);
    while (number[n + other] && !is_part_of_a_number(number[n + other])) other++;
    if (other > 0) append(text, ".", 1);
    number += n + other;
  }
}

/* Reads the conversion after a '%'; returns what follows it. */
static const char *read_conversion(const char *format, hxConversion *conversion) {
  *conversion = (hxConversion){-1, '\0', '\0'};
  if (*format == '.') {
    conversion->precision = 0;
    for (format++; *format >= '0' && *format <= '9'; format++)
      conversion->precision = 10 * conversion->precision + (*format - '0');
  }
  for (; *format == 'l' || *format == 'z'; format++) conversion->size = *format;
  conversion->letter = *format;
  return *format ? format + 1 : format;
}

static void append_string(hxText *text, const char *string, int precision) {
  size_t n = 0;
  while ((precision < 0 || n < (size_t)precision) && string[n]) n++;
  append(text, string, n);
}

void hx_print_list(char *text, size_t size, const char *format, va_list arguments) {
  char number[NUMBER_SIZE] = "";
  hxConversion conversion;
  hxText out = {text, text + size - 1};
  while (*format) {
    const size_t plain = strcspn(format, "%");
    append(&out, format, plain);
    format += plain;
    if (!*format) break;
    format = read_conversion(format + 1, &conversion);
    const char letter = conversion.letter, length = conversion.size;
    if (letter == 's') {
      append_string(&out, va_arg(arguments, const char *), conversion.precision);
      continue;
    }
    if (letter == 'g')
      snprintf(number, sizeof number, "%.*g", conversion.precision, va_arg(arguments, double));
    else if (letter == 'f')
      snprintf(number, sizeof number, "%.*f", conversion.precision, va_arg(arguments, double));
    else if (letter == 'd' && length == 'l')
      snprintf(number, sizeof number, "%lld", va_arg(arguments, long long));
    else if (letter == 'd')
      snprintf(number, sizeof number, "%d", va_arg(arguments, int));
    else if (letter == 'u' && length == 'l')
      snprintf(number, sizeof number, "%llu", va_arg(arguments, unsigned long long));
    else if (letter == 'u' && length == 'z')
      snprintf(number, sizeof number, "%zu", va_arg(arguments, size_t));
    else if (letter == 'u')
      snprintf(number, sizeof number, "%u", va_arg(arguments, unsigned));
    else if (letter == '%') {
      append(&out, "%", 1);
      continue;
    } else
      break;
    append_real(&out, number);
  }
  *out.at = '\0';
}

void hx_print(char *text, size_t size, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  hx_print_list(text, size, format, arguments);
  va_end(arguments);
}

const char *hx_unit_gap(const char *unit) { return *unit ? " " : ""; }
