/* test_start_values.c - the start values in an FMU's resources, as tools and users damage or move
 * them: every number and line that is read, every one that is refused and why, and the forms of the
 * folder's address.
 *
 * usage: test_start_values modelDescription.xml start_values.txt FOLDER
 * FOLDER: path of a folder whose name contains a blank and "%41"
 */
#include <inttypes.h>
#include <stdarg.h>
#include <stdint.h>

#include "fmi2Functions.h"
#include "hexapod/status.h"

#include "check.h"
#include "description.h"

enum { MOST_LINES = 6000, LENGTH = 256, LONG = 400 };

static char line[MOST_LINES][LENGTH]; /* of the valid file, without the checksum's */
static int lines;
static char logged[8192], folder[1024]; /* last message */

static void keep(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                 fmi2String category, fmi2String text, ...) {
  (void)environment, (void)name, (void)status, (void)category;
  snprintf(logged, sizeof logged, "%s", text);
}

static const fmi2CallbackFunctions callbacks = {keep, calloc, free, NULL, NULL};

static void read_valid_file(const char *path) {
  FILE *file = fopen(path, "r");
  while (file && lines < MOST_LINES && fgets(line[lines], LENGTH, file)) {
    if (strncmp(line[lines], "checksum ", 9) == 0) break;
    line[lines][strcspn(line[lines], "\n")] = '\0';
    ++lines;
  }
  CHECK(file && lines > 1 && lines < MOST_LINES);
  if (file) fclose(file);
}

/* ---- a changed file ---- */

typedef struct {
  const char *instead[3]; /* of the lines of these variables */
  const char *variable[3];
  int last;            /* lines that are written; 0: all */
  const char *end;     /* after each line; NULL: "\n" */
  const char *closing; /* instead of the checksum's line and its end */
} hxEdit;

/* Returns the changed text of a line, the line itself where nothing changes. */
static const char *edited(const hxEdit *edit, const char *text) {
  const char *name = strrchr(text, ' ');
  for (int k = 0; k < 3 && edit->variable[k]; ++k)
    if (strcmp(name ? name + 1 : text, edit->variable[k]) == 0) return edit->instead[k];
  return text;
}

/* Writes the valid file with a change and the checksum that belongs to it. */
static void write_file(const hxEdit *edit) {
  char path[sizeof folder + 32];
  uint64_t checksum = 0;
  snprintf(path, sizeof path, "%s/start_values.txt", folder);
  FILE *file = fopen(path, "wb");
  CHECK(file);
  if (!file) return;
  for (int i = 0; i < (edit->last ? edit->last : lines); ++i) {
    const char *text = edited(edit, line[i]);
    fprintf(file, "%s%s", text, edit->end ? edit->end : "\n");
    checksum = hx_checksum(checksum, text, strlen(text));
  }
  if (edit->closing)
    fputs(edit->closing, file);
  else
    fprintf(file, "checksum %016" PRIx64 "%s", checksum, edit->end ? edit->end : "\n");
  fclose(file);
}

static fmi2Component opened(const char *address) {
  logged[0] = '\0';
  return fmi2Instantiate("robot", fmi2CoSimulation, guid, address, &callbacks, 0, 0);
}

static double real(fmi2Component fmu, const char *name) {
  const fmi2ValueReference reference = reference_of(name);
  fmi2Real value = NAN;
  CHECK(fmi2GetReal(fmu, &reference, 1, &value) == fmi2OK);
  return value;
}

/* A file with this change is refused, with a message that contains these words. */
static void refused(const hxEdit *edit, const char *words) {
  write_file(edit);
  fmi2Component fmu = opened(folder);
  CHECK(!fmu);
  if (fmu) fmi2FreeInstance(fmu);
  if (!strstr(logged, words)) fprintf(stderr, "expected '%s' in '%s'\n", words, logged);
  CHECK(strstr(logged, words) != NULL);
}

/* A line with this text instead of the value of friction.mu; the result is overwritten. */
static const char *mu_line(const char *value) {
  static char text[LONG];
  snprintf(text, sizeof text, "%u %s friction.mu", reference_of("friction.mu"), value);
  return text;
}

/* ---- what is read ---- */

static void every_form_of_a_number_is_read(void) {
  static const struct {
    const char *text;
    double value;
  } number[] = {{"0x1p-1", 0.5},       {"0x1.8p-1", 0.75}, {"0X.8P+0", 0.5},
                {"+0xC.0p-4", 0.75},   {"0xcp-4", 0.75},   {"0x0.0000000000001p+52", 1.0},
                {"-0x0.0p+0", 0.0},    {"0x0a.p-1", 5.0},  {"0x3p0", 3.0},
                {"0x1.9p+0006", 100.0}};
  for (size_t k = 0; k < sizeof number / sizeof *number; ++k) {
    const hxEdit edit = {{mu_line(number[k].text)}, {"friction.mu"}, 0, NULL, NULL};
    write_file(&edit);
    fmi2Component fmu = opened(folder);
    CHECK(fmu);
    if (!fmu) fprintf(stderr, "%s: %s\n", number[k].text, logged);
    if (!fmu) continue;
    CHECK(real(fmu, "friction.mu") == number[k].value);
    fmi2FreeInstance(fmu);
  }
}

static void integers_and_other_line_ends_are_read(void) {
  static const char *const end[] = {"\n", "\r\n"};
  char text[LONG];
  const fmi2ValueReference reference = reference_of("terrain.kind");
  snprintf(text, sizeof text, "%u 002 terrain.kind", reference);
  for (int k = 0; k < 2; ++k) {
    const hxEdit edit = {{text}, {"terrain.kind"}, 0, end[k], NULL};
    fmi2Integer value = 0;
    write_file(&edit);
    fmi2Component fmu = opened(folder);
    CHECK(fmu);
    if (!fmu) continue;
    CHECK(fmi2GetInteger(fmu, &reference, 1, &value) == fmi2OK && value == 2);
    fmi2FreeInstance(fmu);
  }
}

/* ---- what is refused ---- */

static void other_numbers_are_refused(void) {
  static const char *const text[] = {"",          "0.7",
                                     "0",         "1x1p0",
                                     "0y1p0",     "0x",
                                     "0xp0",      "0x.p0",
                                     "0x1",       "0x1q0",
                                     "0x1p",      "0x1p+",
                                     "0x1p-",     "0x1p1x",
                                     "0x1.0.0p0", "0x1p99999",
                                     "0x1p9999",  "-0x1p0",
                                     "0x64.1p0",  "nan",
                                     "inf",       "0x0123456789abcdefp0",
                                     "0x1p0 ",    "--0x1p0",
                                     "0x1g",      "0xGp0",
                                     "0x1:p0",    "0x1@p0",
                                     "0x1`p0"};
  for (size_t k = 0; k < sizeof text / sizeof *text; ++k) {
    const hxEdit edit = {{mu_line(text[k])}, {"friction.mu"}, 0, NULL, NULL};
    refused(&edit, "VALUE friction.mu' with a value in [0, 100] 1");
  }
}

static void other_lines_are_refused(void) {
  char first[LONG], other[LONG], far[LONG], huge[LONG];
  const unsigned reference = reference_of("friction.mu");
  snprintf(first, sizeof first, "%u", reference);
  snprintf(other, sizeof other, "%u 0x1p0 friction.nu", reference);
  snprintf(far, sizeof far, "%u 0x1p0 friction.mu", reference + 1);
  snprintf(huge, sizeof huge, "%u 0x1%0*dp0 friction.mu", reference, 300, 0);
  const char *const text[] = {"",
                              first,
                              "1 0x1p0",
                              other,
                              far,
                              huge,
                              "x 0x1p0 friction.mu",
                              "0000004329 0x1p0 friction.mu",
                              " 0x1p0 friction.mu"};
  for (size_t k = 0; k < sizeof text / sizeof *text; ++k) {
    const hxEdit edit = {{text[k]}, {"friction.mu"}, 0, NULL, NULL};
    refused(&edit, "VALUE friction.mu'");
  }
  static const char *const integer[] = {"4", "0", "1x", "", "-1", "1234567890"};
  for (size_t k = 0; k < sizeof integer / sizeof *integer; ++k) {
    snprintf(first, sizeof first, "%u %s terrain.kind", reference_of("terrain.kind"), integer[k]);
    const hxEdit edit = {{first}, {"terrain.kind"}, 0, NULL, NULL};
    refused(&edit, "VALUE terrain.kind' with a value in [1, 3];");
  }
}

static void damaged_files_are_refused(void) {
  const hxEdit changed = {{0}, {0}, 0, NULL, "checksum 0123456789abcdef\n"},
               cut = {{0}, {0}, 100, NULL, ""}, none = {{0}, {0}, 0, NULL, ""},
               other = {{"{another}"}, {guid}, 0, NULL, NULL};
  char path[sizeof folder + 32];
  refused(&changed, "expected the checksum of the lines above: they were changed");
  refused(&none, "got 'the end of the file', expected the checksum of the lines above");
  refused(&cut, "line 101: got 'the end of the file', expected '");
  refused(&other, "expected '{another}', that of the resources; pass the one in");
  write_file(&(hxEdit){{0}, {0}, 0, NULL, NULL});
  snprintf(path, sizeof path, "%s/start_values.txt", folder);
  FILE *file = fopen(path, "ab");
  CHECK(file && fputs("one more\n", file) >= 0);
  if (file) fclose(file);
  CHECK(!opened(folder) && strstr(logged, "got 'one more', expected the end of the file"));
  file = fopen(path, "wb");
  if (file) fclose(file);
  CHECK(!opened(folder) && strstr(logged, "got 'the end of the file', expected the FMU's GUID"));
}

static void values_that_do_not_belong_together_are_refused(void) {
  char text[LONG];
  snprintf(text, sizeof text, "%u 0x1p-2 friction.mu_static", reference_of("friction.mu_static"));
  const hxEdit edit = {{text}, {"friction.mu_static"}, 0, NULL, NULL};
  refused(&edit, "at least friction.mu, or 0, which means the same; correct the robot");
}

/* ---- addresses ---- */

/* Writes an address with the folder's path, as it is or with %20 and so on in it. */
static const char *address(const char *before, int encoded, const char *after) {
  static const char plain[] = "/ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.~";
  static char text[4 * sizeof folder];
  size_t n = (size_t)snprintf(text, sizeof text, "%s", before);
  for (const char *from = folder; *from; ++from)
    n += (size_t)snprintf(text + n, sizeof text - n,
                          encoded && !strchr(plain, *from) ? (encoded > 1 ? "%%%02X" : "%%%02x")
                                                           : "%c",
                          (unsigned char)*from);
  snprintf(text + n, sizeof text - n, "%s", after);
  return text;
}

static void every_form_of_the_address_is_found(void) {
  static const struct {
    const char *before, *after;
    int encoded;
  } form[] = {
      {"", "", 0},        {"", "/", 0},        {"file://", "/", 1},         {"file://", "", 2},
      {"file:", "/", 1},  {"FILE://", "/", 1}, {"file://localhost", "", 1}, {"File:", "", 2},
      {"file://", "/", 0}};
  const hxEdit edit = {{mu_line("0x1.4p+0")}, {"friction.mu"}, 0, NULL, NULL};
  write_file(&edit);
  for (size_t k = 0; k < sizeof form / sizeof *form; ++k) {
    const char *text = address(form[k].before, form[k].encoded, form[k].after);
    fmi2Component fmu = opened(text);
    CHECK(fmu);
    if (!fmu) continue;
    if (real(fmu, "friction.mu") != 1.25) fprintf(stderr, "not found: %s\n", text);
    CHECK(real(fmu, "friction.mu") == 1.25);
    fmi2FreeInstance(fmu);
  }
}

/* Without start values in its resources the FMU is the robot that the binary contains. */
static void without_start_values_it_is_the_default_robot(void) {
  static const char *const nowhere[] = {
      NULL,          "",          "/no/such/folder", "file:///no/such", "file://nohost",
      "file:",       "file:/%zz", "file:///%4",      "file:///a%",      "file:///a%4g",
      "file:///%00", "http://a/b"};
  for (size_t k = 0; k < sizeof nowhere / sizeof *nowhere; ++k) {
    fmi2Component fmu = opened(nowhere[k]);
    CHECK(fmu);
    if (!fmu) continue;
    NEAR(real(fmu, "friction.mu"), 0.7, 0.0);
    fmi2FreeInstance(fmu);
  }
  CHECK(!fmi2Instantiate("robot", fmi2CoSimulation, "{another}", "/no/such/folder", &callbacks, 0,
                         0));
  CHECK(strstr(logged, "no start_values.txt was found in the resources '/no/such/folder'"));
  CHECK(!fmi2Instantiate("robot", fmi2CoSimulation, "{another}", NULL, &callbacks, 0, 0));
  CHECK(strstr(logged, "in the resources '(NULL)'"));
}

int main(int arguments, char *argument[]) {
  if (arguments != 4) return 2;
  open_description(argument[1]);
  read_valid_file(argument[2]);
  snprintf(folder, sizeof folder, "%s", argument[3]);
  every_form_of_a_number_is_read();
  integers_and_other_line_ends_are_read();
  other_numbers_are_refused();
  other_lines_are_refused();
  damaged_files_are_refused();
  values_that_do_not_belong_together_are_refused();
  every_form_of_the_address_is_found();
  without_start_values_it_is_the_default_robot();
  return failures != 0;
}
