/* resources.c - reads the start values in the FMU's resources.
 *
 * start_values.txt: the GUID; then, for every input and parameter in the order of their references,
 * a line "reference value name"; then "checksum" and 16 hexadecimal digits: hx_checksum over the
 * lines above without their line ends, where each line's checksum is the next one's seed and
 * hx_table_digest is the first one's. Reals are hexadecimal (0x1.8p+1), so that they are exact and
 * independent of the locale.
 */
#include "fmi/instance.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hexapod/message.h"

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#endif

enum { LINE_SIZE = 256 };

static const char file_name[] = "start_values.txt";

/* ----------------------------------------------------------------------------------------------
 * URI to path */

static int is_digit(char c) { return c >= '0' && c <= '9'; }

static int hex_digit(char c) {
  if (is_digit(c)) return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* replaces escapes such as %41 by their characters, in place; keeps invalid escapes */
static void percent_decode(char *text) {
  char *out = text;
  while (*text) {
    const int high = text[0] == '%' ? hex_digit(text[1]) : -1;
    const int low = high >= 0 ? hex_digit(text[2]) : -1;
    if (low >= 0 && high + low > 0) {
      *out++ = (char)(16 * high + low);
      text += 3;
    } else
      *out++ = *text++;
  }
  *out = '\0';
}

/* file:///x, file://host/x and file:/x -> /x; NULL for other URIs and paths */
static const char *skip_scheme(const char *uri) {
  static const char scheme[] = "file:";
  for (size_t i = 0; i < sizeof scheme - 1; i++)
    if (uri[i] != scheme[i] && uri[i] != scheme[i] - 'a' + 'A') return NULL;
  uri += sizeof scheme - 1;
#ifndef _WIN32
  if (uri[0] == '/' && uri[1] == '/') {
    const char *path = strchr(uri + 2, '/');
    return path ? path : uri + 2;
  }
#endif
  return uri;
}

#ifdef _WIN32
/* /C:/x, //C:/x, ///C:/x, //localhost/C:/x -> C:/x; ////server/share -> //server/share; in place */
static void to_windows_path(char *path) {
  static const char this_machine[] = "//localhost/";
  const size_t host =
      strncmp(path, this_machine, sizeof this_machine - 1) == 0 ? sizeof this_machine - 2 : 0;
  const size_t slashes = strspn(path + host, "/");
  const char *name = path + host + slashes;
  const int drive = name[0] && (name[1] == ':' || name[1] == '|');
  const char *from = drive ? name : slashes >= 4 ? name - 2 : path + host;
  memmove(path, from, strlen(from) + 1);
  if (drive) path[1] = ':';
}
#endif

/* The path of start_values.txt in the resources folder, with or without percent decoding, to be
 * freed by the caller; NULL when out of memory. */
static char *start_values_path(const char *resources, int decode) {
  const char *after_scheme = skip_scheme(resources);
  char *path = malloc(strlen(resources) + sizeof file_name + 1);
  if (!path) return NULL;
  strcpy(path, after_scheme ? after_scheme : resources);
  if (after_scheme && decode) percent_decode(path);
#ifdef _WIN32
  to_windows_path(path);
#endif
  size_t length = strlen(path);
  if (length > 0 && path[length - 1] != '/') path[length++] = '/';
  strcpy(path + length, file_name);
  return path;
}

FILE *hx_open_resource(const char *path) {
#ifdef _WIN32
  const int size = MultiByteToWideChar(CP_UTF8, 0, path, -1, NULL, 0); /* 0 for wrong UTF-8 */
  wchar_t *wide = size > 0 ? malloc((size_t)size * sizeof *wide) : NULL;
  const int converted = wide && MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, size) == size;
  FILE *file = converted ? _wfopen(wide, L"rb") : NULL;
  free(wide);
  return file;
#else
  return fopen(path, "rb");
#endif
}

/* ----------------------------------------------------------------------------------------------
 * lines */

/* Parses a hexadecimal floating point number of at most 15 digits, so that the mantissa is exact.
 * Returns 1 if the whole text is such a number. */
static int parse_real(const char *text, double *value) {
  const int negative = text[0] == '-';
  unsigned long long mantissa = 0;
  int digits = 0, exponent = 0, seen_point = 0;
  text += negative || text[0] == '+';
  if (text[0] != '0' || (text[1] != 'x' && text[1] != 'X')) return 0;
  for (text += 2; hex_digit(*text) >= 0 || (*text == '.' && !seen_point); text++) {
    if (*text == '.')
      seen_point = 1;
    else {
      mantissa = 16 * mantissa + (unsigned)hex_digit(*text);
      exponent -= 4 * seen_point;
      digits++;
    }
  }
  if (digits < 1 || digits > 15 || (*text != 'p' && *text != 'P')) return 0;
  const int minus = text[1] == '-', sign = minus || text[1] == '+';
  int power = 0;
  for (text += 1 + sign; is_digit(*text) && power < 10000; text++)
    power = 10 * power + (*text - '0');
  if (*text || !is_digit(text[-1])) return 0;
  *value = ldexp((double)mantissa, exponent + (minus ? -power : power)) * (negative ? -1.0 : 1.0);
  return 1;
}

/* Parses a number of at most 9 decimal digits. Returns 1 if the whole text is one. */
static int parse_count(const char *text, unsigned *value) {
  size_t length = 0;
  for (*value = 0; is_digit(text[length]) && length < 10; length++)
    *value = 10 * *value + (unsigned)(text[length] - '0');
  return length > 0 && length < 10 && !text[length];
}

static int parse_value(const hxVariable *variable, const char *text, double *value) {
  unsigned count;
  if (variable->type == HX_REAL) return parse_real(text, value);
  if (!parse_count(text, &count)) return 0;
  *value = (double)count;
  return 1;
}

typedef struct hxReader {
  FILE *file;
  int number;        /* of the last line read, from 1 */
  uint64_t checksum; /* of the lines before the last one read */
  uint64_t next_checksum;
  char line[LINE_SIZE];
} hxReader;

/* Reads the next line without its line end; NULL at the end of the file. A line that is too long is
 * returned in pieces, none of which can be parsed. */
static char *next_line(hxReader *reader) {
  size_t length = 0;
  int c = fgetc(reader->file);
  reader->number++;
  if (c == EOF) return NULL;
  for (; c != EOF && c != '\n'; c = fgetc(reader->file)) {
    reader->line[length++] = (char)c;
    if (length == LINE_SIZE - 1) break;
  }
  if (length > 0 && reader->line[length - 1] == '\r') length--;
  reader->line[length] = '\0';
  reader->checksum = reader->next_checksum;
  reader->next_checksum = hx_checksum(reader->checksum, reader->line, length);
  return reader->line;
}

/* Splits "reference value name" in place. Returns 1 if the line has this form. */
static int split(char *line, char *part[3]) {
  part[0] = line;
  for (int k = 1; k < 3; k++) {
    char *blank = strchr(part[k - 1], ' ');
    if (!blank) return 0;
    *blank = '\0';
    part[k] = blank + 1;
  }
  return 1;
}

static void store(struct hxVariables *variables, const hxVariable *variable, double value) {
  char *place = (char *)variables + variable->offset;
  if (variable->type == HX_REAL)
    memcpy(place, &value, sizeof value);
  else {
    const int number = (int)value;
    memcpy(place, &number, sizeof number);
  }
}

/* Reads one line, which must belong to the given variable. Returns 1 if it does. */
static int read_variable(struct hxVariables *variables, const hxVariable *variable,
                         unsigned reference, char *line) {
  char *part[3];
  unsigned given;
  double value;
  if (!line || !split(line, part) || !parse_count(part[0], &given) || given != reference ||
      strcmp(part[2], variable->name) != 0)
    return 0;
  if (!parse_value(variable, part[1], &value) || !hx_variable_in_range(variable, value)) return 0;
  store(variables, variable, value);
  return 1;
}

/* ----------------------------------------------------------------------------------------------
 * file */

static hxStatus refuse(hxInstance *instance, const hxReader *reader, const char *got,
                       const char *expected) {
  hx_log(instance, HX_LOG_ERROR, "%s: line %d: got '%s', expected %s; export the FMU again",
         file_name, reader->number, got ? got : "the end of the file", expected);
  return HX_INVALID_ARGUMENT;
}

static hxStatus read_variables(hxInstance *instance, hxReader *reader,
                               struct hxVariables *variables) {
  static const hxCausality causalities[] = {HX_INPUT, HX_PARAMETER};
  char shown[LINE_SIZE], expected[LINE_SIZE];
  for (int k = 0; k < 2; k++) {
    const hxSection *section = &hx_sections[causalities[k]];
    for (unsigned i = 0; i < section->count; i++) {
      const hxVariable *variable = &section->variable[i];
      char *text = next_line(reader);
      if (text) strcpy(shown, text);
      if (!read_variable(variables, variable, section->first + i, text)) {
        hx_print(expected, sizeof expected, "'%u VALUE %s' with a value in [%g, %g]%s%s",
                 section->first + i, variable->name, variable->min, variable->max,
                 hx_unit_gap(variable->unit), variable->unit);
        return refuse(instance, reader, text ? shown : NULL, expected);
      }
    }
  }
  return HX_OK;
}

/* checks that the lines are as they were exported and that no others follow */
static hxStatus read_checksum(hxInstance *instance, hxReader *reader) {
  char expected[LINE_SIZE];
  const char *line = next_line(reader);
  snprintf(expected, sizeof expected, "checksum %08lx%08lx",
           (unsigned long)(reader->checksum >> 32),
           (unsigned long)(reader->checksum & 0xffffffffu));
  if (!line || strcmp(line, expected) != 0)
    return refuse(
        instance, reader, line,
        "the checksum of the lines above and of the binary's variables: one of them was changed");
  line = next_line(reader);
  return line ? refuse(instance, reader, line, "the end of the file") : HX_OK;
}

/* checks that the component accepts the definition */
static hxStatus check_start(hxInstance *instance, const struct hxVariables *variables) {
  char message[HX_MESSAGE_SIZE];
  const hxStatus status = hx_component_check(variables, message);
  if (status != HX_OK)
    hx_log(instance, HX_LOG_ERROR, "%s: %s; correct the robot and export the FMU again", file_name,
           message);
  return status;
}

static hxStatus read_file(hxInstance *instance, FILE *file) {
  hxReader reader = {.file = file, .next_checksum = hx_table_digest};
  struct hxVariables variables;
  const char *guid = next_line(&reader);
  if (!guid) return refuse(instance, &reader, NULL, "the FMU's GUID");
  if (strcmp(guid, instance->guid) != 0) {
    hx_log(instance, HX_LOG_ERROR,
           "GUID: got '%s', expected '%s', that of the resources; pass the one in "
           "modelDescription.xml",
           instance->guid, guid);
    return HX_INVALID_ARGUMENT;
  }
  variables = instance->start;
  hxStatus status = read_variables(instance, &reader, &variables);
  if (status == HX_OK) status = read_checksum(instance, &reader);
  if (status == HX_OK) status = check_start(instance, &variables);
  if (status != HX_OK) return status;
  instance->start = variables;
  return HX_OK;
}

/* Opens start_values.txt. Some importers pass paths that were never percent-encoded, so the path
 * without decoding is tried second. */
static hxStatus open_resources(hxInstance *instance, const char *resources, FILE **file) {
  *file = NULL;
  for (int decode = 1; decode >= 0 && !*file; decode--) {
    char *path = start_values_path(resources, decode);
    if (!path) {
      hx_log(instance, HX_LOG_ERROR, "resources: out of memory; free some and try again");
      return HX_OUT_OF_MEMORY;
    }
    *file = hx_open_resource(path);
    free(path);
  }
  return HX_OK;
}

hxStatus hx_resources_folder(const char *resources, char **folder) {
  *folder = NULL;
  if (!resources || !resources[0]) return HX_OK;
  char *plain = start_values_path(resources, 0), *path = start_values_path(resources, 1);
  if (!plain || !path) {
    free(plain);
    free(path);
    return HX_OUT_OF_MEMORY;
  }
  FILE *file = hx_open_resource(path);
  const int decoded = file != NULL;
  if (file) fclose(file);
  file = decoded ? NULL : hx_open_resource(plain);
  if (file) { /* the path was never percent-encoded */
    fclose(file);
    free(path);
    path = plain;
  } else {
    free(plain);
  }
  path[strlen(path) - (sizeof file_name - 1)] = '\0';
  *folder = path;
  return HX_OK;
}

hxStatus hx_resources_read(hxInstance *instance, const char *resources, int *found) {
  FILE *file;
  *found = 0;
  if (!resources || !resources[0]) return HX_OK;
  hxStatus status = open_resources(instance, resources, &file);
  if (status != HX_OK || !file) return status;
  *found = 1;
  status = read_file(instance, file);
  fclose(file);
  return status;
}
