/* fuzz_start_values.c - bytes are changes of the lines of a valid start_values.txt, which an
 * instance then reads from its resources. */
#include "fuzz.h"

#include <inttypes.h>

#include "fmi/variables.h"
#include "fmi2Functions.h"

enum { MOST_LINES = 4000, MOST_LENGTH = 300, MOST_EDITS = 12 };

static char *line[MOST_LINES + MOST_EDITS]; /* of the valid file, without line ends */
static size_t lines;
static char folder[] = "/tmp/hexapod_fuzz_XXXXXX", path[sizeof folder + 32];

static void ignore(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                   fmi2String category, fmi2String text, ...) {
  (void)environment, (void)name, (void)status, (void)category, (void)text;
}

static const fmi2CallbackFunctions callbacks = {ignore, calloc, free, NULL, NULL};

static void remove_folder(void) {
  remove(path);
  remove(folder);
}

/* Reads the lines of the component's exported file except the checksum's. */
static void read_valid_file(void) {
  char text[MOST_LENGTH];
  FILE *file = fopen(START_VALUES, "rb");
  REQUIRE(file && mkdtemp(folder));
  snprintf(path, sizeof path, "%s/start_values.txt", folder);
  atexit(remove_folder);
  while (lines < MOST_LINES && fgets(text, sizeof text, file)) {
    text[strcspn(text, "\n")] = '\0';
    if (strncmp(text, "checksum ", 9) == 0) break;
    line[lines] = room(strlen(text) + 1, 1);
    strcpy(line[lines++], text);
  }
  fclose(file);
}

/* Writes a changed line: other bytes in it, or a number in the place of its value. */
static void change_line(Input *in, const char *from, char *to) {
  const unsigned kind = pick(in, 3);
  if (kind == 0) {
    const size_t length = strlen(from);
    memcpy(to, from, length + 1);
    for (unsigned k = pick(in, 8); k > 0; k--) to[pick(in, (unsigned)length + 1)] = (char)take(in);
  } else if (kind == 1) {
    snprintf(to, MOST_LENGTH, "%.*s %a %s", (int)strcspn(from, " "), from, take_real(in),
             strrchr(from, ' ') ? strrchr(from, ' ') + 1 : "");
  } else {
    const size_t length = pick(in, MOST_LENGTH - 1);
    for (size_t k = 0; k < length; k++) to[k] = (char)take(in);
    to[length] = '\0';
  }
}

static uint64_t write_line(FILE *file, const char *text, uint64_t checksum) {
  const size_t length = strlen(text);
  fwrite(text, 1, length, file);
  fputc('\n', file);
  return hx_checksum(checksum, text, length);
}

/* Writes the valid file with some lines changed, left out or repeated; may cut it short. */
static void write_file(Input *in) {
  char changed[MOST_EDITS][MOST_LENGTH];
  size_t place[MOST_EDITS];
  const unsigned edits = pick(in, MOST_EDITS), end = take(in);
  uint64_t checksum = hx_table_digest;
  FILE *file = fopen(path, "wb");
  REQUIRE(file);
  for (unsigned k = 0; k < edits; k++) {
    place[k] = pick(in, (unsigned)lines);
    change_line(in, line[place[k]], changed[k]);
  }
  const size_t last = end > 230 ? pick(in, (unsigned)lines) : lines;
  for (size_t i = 0; i < last; i++) {
    const char *text = line[i];
    for (unsigned k = 0; k < edits; k++)
      if (place[k] == i) text = changed[k];
    checksum = write_line(file, text, checksum);
    if (end < 10 && i % 64 == end) checksum = write_line(file, text, checksum);
  }
  if (end % 8 != 7) fprintf(file, "checksum %016" PRIx64 "%s", checksum, end % 8 == 6 ? "" : "\n");
  fclose(file);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  Input in = {data, size, 0};
  if (lines == 0) read_valid_file();
  write_file(&in);
  fmi2Component fmu =
      fmi2Instantiate("fuzz", fmi2CoSimulation, hx_default_guid, folder, &callbacks, 0, 0);
  if (!fmu) return 0;
  fmi2EnterInitializationMode(fmu);
  if (fmi2ExitInitializationMode(fmu) == fmi2OK) {
    const fmi2Status status = fmi2DoStep(fmu, 0.0, 0.001, fmi2True);
    REQUIRE(status == fmi2OK || status == fmi2Discard || status == fmi2Error);
  }
  fmi2FreeInstance(fmu);
  return 0;
}
