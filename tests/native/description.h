/* description.h - data from modelDescription.xml for tests of the FMU's binary. */
#ifndef HX_TESTS_DESCRIPTION_H
#define HX_TESTS_DESCRIPTION_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char description[1 << 20], guid[64];

static inline void open_description(const char *path) {
  FILE *file = fopen(path, "r");
  const size_t n = file ? fread(description, 1, sizeof description - 1, file) : 0;
  const char *found = n ? strstr(description, "guid=\"") : NULL;
  if (!found || sscanf(found, "guid=\"%63[^\"]", guid) != 1) {
    fprintf(stderr, "%s: no model description\n", path);
    exit(EXIT_FAILURE);
  }
  fclose(file);
}

static inline unsigned reference_of(const char *name) {
  static char text[256];
  unsigned reference;
  snprintf(text, sizeof text, "name=\"%s\" valueReference=\"", name);
  const char *found = strstr(description, text);
  if (!found || sscanf(found + strlen(text), "%u", &reference) != 1) {
    fprintf(stderr, "no variable %s\n", name);
    exit(EXIT_FAILURE);
  }
  return reference;
}

#endif
