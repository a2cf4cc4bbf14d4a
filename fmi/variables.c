/* variables.c - rows of the table of variables, by value reference; messages to the importer. */
#include "fmi/instance.h"

#include <stdarg.h>
#include <string.h>

#include "hexapod/message.h"

void hx_log(hxInstance *instance, hxLogCategory category, const char *format, ...) {
  char text[HX_LOG_SIZE];
  va_list arguments;
  if (!(instance->logged & 1u << category)) return;
  va_start(arguments, format);
  hx_print_list(text, sizeof text, format, arguments);
  va_end(arguments);
  instance->sink(instance, category, text);
}

static int find_category(const char *name) {
  for (int k = 0; k < HX_LOG_CATEGORIES; k++)
    if (name && strcmp(name, hx_log_category_names[k]) == 0) return k;
  return -1;
}

hxStatus hx_log_select(hxInstance *instance, const char *call, int on, size_t n,
                       const char *const category[]) {
  unsigned chosen = n == 0 ? ~0u : 0;
  for (size_t i = 0; i < n; i++) {
    const int k = find_category(category[i]);
    if (k < 0) {
      hx_log(instance, HX_LOG_ERROR,
             "%s: got category '%s', expected one of modelDescription.xml; nothing was changed",
             call, category[i] ? category[i] : "(NULL)");
      return HX_INVALID_ARGUMENT;
    }
    chosen |= k == HX_LOG_ALL ? ~0u : 1u << k;
  }
  instance->logged = (on ? chosen : instance->logged & ~chosen) | HX_LOG_ALWAYS;
  return HX_OK;
}

const hxVariable *hx_variable_find(unsigned reference, hxCausality *causality) {
  for (int k = 0; k < HX_CAUSALITIES; k++) {
    const hxSection *section = &hx_sections[k];
    if (reference - section->first < section->count) {
      *causality = (hxCausality)k;
      return &section->variable[reference - section->first];
    }
  }
  return NULL;
}

int hx_variable_in_range(const hxVariable *variable, double value) {
  return value >= variable->min && value <= variable->max;
}

static const char *const type_names[] = {
    [HX_REAL] = "Real", [HX_INTEGER] = "Integer or Enumeration", [HX_BOOLEAN] = "Boolean"};

/* logs why a reference does not belong to a variable of the type */
static void refuse_reference(hxInstance *instance, hxType type, unsigned reference,
                             const hxVariable *variable) {
  if (!variable)
    hx_log(instance, HX_LOG_ERROR,
           "value reference: got %u, expected one of modelDescription.xml; nothing was done",
           reference);
  else
    hx_log(instance, HX_LOG_ERROR, "%s: got a call for %s, expected one for %s; nothing was done",
           variable->name, type_names[type], type_names[variable->type]);
}

const hxVariable *hx_variable_of_type(hxInstance *instance, hxType type, unsigned reference,
                                      hxCausality *causality) {
  const hxVariable *variable = hx_variable_find(reference, causality);
  if (variable && variable->type == type) return variable;
  refuse_reference(instance, type, reference, variable);
  return NULL;
}
