// An FMI 2.0 importer: the robot of an unpacked FMU stands for a second, or walks by recorded joint commands.
//   unzip -q athena.fmu -d athena
//   cc -std=gnu11 importer.c -I FMI -ldl -o importer    FMI: a folder with the standard's headers, such as fmpy/c-code of Python's fmpy
//   ./importer athena [commands.csv] > outputs.csv      commands: "time","LF.coxa.angle_ref",...; a row every 5 ms, held until the next
#include "fmi2FunctionTypes.h"
#include <dlfcn.h> // Windows: LoadLibrary, GetProcAddress and binaries/win64/*.dll instead
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#define BINARY "%s/binaries/linux64/%s.so" // macOS: darwin64, .dylib
#define FMI2(name) ((fmi2##name##TYPE *)dlsym(library, "fmi2" #name))
#define CALL(name, ...) check(FMI2(name)(__VA_ARGS__) <= fmi2Warning, #name)
static char xml[1 << 22], line[1 << 16], path[3 * FILENAME_MAX];

static void check(int good, const char *what) {
  if (!good) exit((fprintf(stderr, "importer: %s\n", what), 1));
}

static void say(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...) {
  va_list values;
  va_start(values, message);
  if (status > fmi2OK) vfprintf(stderr, message, values);
  va_end(values);
}

static const char *attribute(const char *from, const char *name) { // the value of the next one of this name
  static char value[FILENAME_MAX];
  check((from = from ? strstr(from, name) : NULL) && sscanf(from += strlen(name), "=\"%4000[^\"]", value) == 1, name);
  return value;
}

int main(int count, char **arguments) {
  unsigned in[100], out[2000], ins = 0, outs = 0;
  double values[2000], h = 0.005;
  char *folder = realpath(count > 1 ? arguments[1] : ".", NULL), wanted[99], *number;
  check(folder && sprintf(path, "%s/modelDescription.xml", folder), "no such folder");
  FILE *description = fopen(path, "r"), *commands = fopen(count > 2 ? arguments[2] : "/dev/null", "r");
  check(description && fread(xml, 1, sizeof xml - 1, description) && commands,
        "no modelDescription.xml in the folder, or no such commands");
  void *library = (sprintf(path, BINARY, folder, attribute(xml, "modelIdentifier")), dlopen(path, RTLD_NOW));
  check(library != NULL, path);
  sprintf(path, "file://%s/resources", folder);
  fmi2CallbackFunctions callbacks = {say, calloc, free, NULL, NULL};
  fmi2Component fmu = FMI2(Instantiate)("robot", fmi2CoSimulation, attribute(xml, "guid"), path, &callbacks, fmi2False, fmi2False);
  check(fmu != NULL, "Instantiate");

  printf("\"time\"");
  for (const char *one = xml; (one = strstr(one + 1, "<ScalarVariable ")) != NULL;)
    if (!strcmp(attribute(one, "causality"), "output") && !strncmp(strchr(one + 1, '<'), "<Real", 5)) {
      printf(",\"%s\"", attribute(one, "name"));
      out[outs++] = (unsigned)atoi(attribute(one, "valueReference"));
    }
  if (fgets(line, sizeof line, commands))
    for (char *name = strtok(line, "\",\r\n"); (name = strtok(NULL, "\",\r\n")) != NULL;) {
      sprintf(wanted, "name=\"%.80s\"", name);
      in[ins++] = (unsigned)atoi(attribute(strstr(xml, wanted), "valueReference"));
    }
  CALL(SetupExperiment, fmu, fmi2False, 0.0, 0.0, fmi2False, 0.0);
  CALL(EnterInitializationMode, fmu);
  CALL(ExitInitializationMode, fmu);
  for (int step = 0; ins ? fgets(number = line, sizeof line, commands) != NULL : step <= 200; step++) {
    CALL(GetReal, fmu, out, outs, values);
    printf("\n%.17g", step * h);
    for (unsigned k = 0; k < outs; k++) printf(",%.17g", values[k]);
    for (unsigned k = 0; k < ins; k++) {
      check((number = strchr(number, ',')) != NULL, "a row of too few commands");
      values[k] = strtod(number + 1, &number);
    }
    CALL(SetReal, fmu, in, ins, values);
    CALL(DoStep, fmu, step * h, h, fmi2True);
  }
  CALL(Terminate, fmu);
  FMI2(FreeInstance)(fmu);
  return puts("") == EOF;
}
