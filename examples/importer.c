// An FMI 2.0 importer. The robot of an unpacked FMU stands for a second, or walks by recorded joint
// commands (one row for each 5 ms, constant between rows). FMI: folder of the standard's headers,
// for instance fmpy/c-code. commands.csv: "time","LF.coxa.angle_ref",...
//   unzip -q athena.fmu -d athena; cc -std=gnu11 importer.c -I FMI -ldl -o importer
//   ./importer athena [commands.csv] > outputs.csv
#include "fmi2FunctionTypes.h"
#include <dlfcn.h> // Windows: LoadLibrary, GetProcAddress and binaries/win64/*.dll instead
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#define FMI2(name) ((fmi2##name##TYPE *)need(dlsym(library, "fmi2" #name), #name))
#define CALL(name, ...) need(FMI2(name)(__VA_ARGS__) <= fmi2Warning ? fmu : NULL, #name)
static char xml[1 << 22], path[3 * FILENAME_MAX], value[FILENAME_MAX], column[100];

static void *need(void *it, const char *what) {
  return it ? it : (fprintf(stderr, "importer: trouble with %s\n", what), exit(1), NULL);
}
static void say(void *environment, fmi2String name, fmi2Status status, fmi2String category,
                fmi2String message, ...) {
  va_list values;
  va_start(values, message);
  vfprintf(stderr, message, values);
  va_end(values);
}
static char *attribute(char *element, const char *name) { // the next one of this name
  sscanf((char *)need(strstr(element, name), name) + strlen(name), "=\"%4000[^\"]", value);
  return value;
}
int main(int count, char **arguments) {
  unsigned in[2000], out[2000], ins = 0, outs = 0;
  double values[2000], time, h = 0.005;
  char *folder = need(realpath(count > 1 ? arguments[1] : ".", NULL), "the folder");
  sprintf(path, "%s/modelDescription.xml", folder);
  FILE *description = need(fopen(path, "r"), path),
       *commands = need(fopen(count > 2 ? arguments[2] : "/dev/null", "r"), "the commands");
  xml[fread(xml, 1, sizeof xml - 1, description)] = '\0';
  sprintf(path, "%s/binaries/linux64/%s.so", folder,
          attribute(xml, "modelIdentifier")); // macOS: darwin64, .dylib
  void *library = need(dlopen(path, RTLD_NOW), path);
  sprintf(path, "file://%s/resources", folder);
  fmi2CallbackFunctions callbacks = {say, calloc, free, NULL, NULL};
  void *fmu = need(
      FMI2(Instantiate)("robot", fmi2CoSimulation, attribute(xml, "guid"), path, &callbacks, 0, 0),
      "Instantiate");
  for (char *one = xml; (one = strstr(one + 1, "<ScalarVariable ")) != NULL;)
    if (!strcmp(attribute(one, "causality"), "output") &&
        !strncmp(strchr(one + 1, '<'), "<Real", 5)) {
      printf(outs ? ",\"%s\"" : "\"time\",\"%s\"", attribute(one, "name"));
      out[outs++] = (unsigned)atoi(attribute(one, "valueReference"));
    }
  for (int got = fscanf(commands, "%*[^,]");
       got >= 0 && fscanf(commands, "%*[,\"]%99[^,\"\r\n]", column) == 1;) {
    sprintf(path, "<ScalarVariable name=\"%s\"", column);
    in[ins++] = (unsigned)atoi(attribute(need(strstr(xml, path), column), "valueReference"));
  }
  CALL(SetupExperiment, fmu, fmi2False, 0.0, 0.0, fmi2False, 0.0);
  CALL(EnterInitializationMode, fmu);
  CALL(ExitInitializationMode, fmu);
  for (int step = 0; count > 2 ? fscanf(commands, "%lf", &time) == 1 : step <= 200; step++) {
    CALL(GetReal, fmu, out, outs, values);
    printf("\n%.17g", step * h);
    for (unsigned k = 0; k < outs; k++) printf(",%.17g", values[k]);
    for (unsigned k = 0; k < ins; k++)
      need(fscanf(commands, ",%lf", values + k) == 1 ? fmu : NULL, "a row of too few commands");
    CALL(SetReal, fmu, in, ins, values);
    CALL(DoStep, fmu, step * h, h, fmi2True);
  }
  CALL(Terminate, fmu);
  FMI2(FreeInstance)(fmu);
  return puts("") == EOF;
}
