/* instances.c - measures many plants in one process, stepped in turn
 *
 *     instances WALK TOLERANCE COUNT
 *
 * It prints a JSON line: "microseconds_per_step" of one plant that has its own work space, and
 * "shared_microseconds_per_step" of plants that share one; "bytes_per_instance" of its structure,
 * "resident_per_instance", the growth of the process (null if the system does not report it), and
 * "allocations" in all steps. All plants run the same walk; only the used memory grows with COUNT.
 */
#include <unistd.h>

#include "driver.h"
#include "state.h"

/* The linker replaces the allocator by these functions, for the code of this program. */
static long allocations;
void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *block, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *block, size_t size);

void *__wrap_malloc(size_t size) { return ++allocations, __real_malloc(size); }
void *__wrap_calloc(size_t count, size_t size) { return ++allocations, __real_calloc(count, size); }
void *__wrap_realloc(void *block, size_t size) {
  return ++allocations, __real_realloc(block, size);
}

/* Returns the resident memory of the process [bytes], 0 without /proc. */
static double resident(void) {
  double pages = 0.0, ignored;
  FILE *file = fopen("/proc/self/statm", "r");
  if (!file) return 0.0;
  if (fscanf(file, "%lf %lf", &ignored, &pages) != 2) pages = 0.0;
  fclose(file);
  return pages * (double)sysconf(_SC_PAGESIZE);
}

static int create(hxPlant **plant, int count, const hxDefinition *definition) {
  for (int i = 0; i < count; ++i) {
    plant[i] = hx_plant_create();
    if (!plant[i] || hx_plant_reset(plant[i], definition, 0.0) != HX_OK) return 1;
  }
  return 0;
}

static int step_all(hxPlant **plant, int count, const Recording *walk, int64_t k) {
  for (int i = 0; i < count; ++i)
    if (hx_plant_step(plant[i], &walk->input[k], (double)(k + 1) * walk->h) != HX_OK) return 1;
  return 0;
}

/* Steps all plants through the walk; returns the time of a step [s], < 0 on failure. */
static double step_time(hxPlant **plant, int count, const Recording *walk) {
  const double begin = seconds_now();
  for (int64_t k = 0; k < walk->n; ++k)
    if (step_all(plant, count, walk, k)) return -1.0;
  return (seconds_now() - begin) / ((double)walk->n * count);
}

/* Resets all plants and makes them use one work space. */
static int share_work(hxPlant **plant, int count, const hxDefinition *definition, void *work) {
  for (int i = 0; i < count; ++i)
    if (!work || hx_plant_use_work(plant[i], work, hx_work_size()) != HX_OK ||
        hx_plant_reset(plant[i], definition, 0.0) != HX_OK)
      return 1;
  return 0;
}

int main(int argc, char **argv) {
  Recording walk;
  if (argc != 4) {
    fprintf(stderr, "usage: %s WALK TOLERANCE COUNT\n", argv[0]);
    return 2;
  }
  const int count = atoi(argv[3]);
  if (walk_read(argv[1], &walk) || count < 1) return 2;
  walk.definition.solver.step = 0.0;
  walk.definition.solver.tolerance = atof(argv[2]);
  hxPlant **plant = calloc((size_t)count, sizeof(hxPlant *));
  const double before = resident();
  if (!plant || create(plant, count, &walk.definition)) return 1;
  const long before_steps = allocations;
  const double seconds = step_time(plant, count, &walk);
  const double grown = resident() - before;
  const long allocated = allocations - before_steps;
  const size_t size = hx_work_size() + HX_WORK_ALIGNMENT - hx_work_size() % HX_WORK_ALIGNMENT;
  if (share_work(plant, count, &walk.definition, aligned_alloc(HX_WORK_ALIGNMENT, size))) return 1;
  const double shared = step_time(plant, count, &walk);
  if (seconds < 0.0 || shared < 0.0) return 1;
  printf("{\"microseconds_per_step\": %.6f, \"shared_microseconds_per_step\": %.6f, "
         "\"bytes_per_instance\": %zu, \"allocations\": %ld, \"resident_per_instance\": ",
         1e6 * seconds, 1e6 * shared, sizeof(hxPlant), allocated);
  if (before > 0.0)
    printf("%.0f}\n", grown / count);
  else
    printf("null}\n");
  return 0;
}
