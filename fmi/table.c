/* table.c - rows of the table of variables, by value reference. */
#include "fmi/instance.h"

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
