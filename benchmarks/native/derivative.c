/* derivative.c - measures one evaluation of the right-hand side, for each kernel
 *
 *     derivative WALK REPEATS [KERNEL MULTIPLIERS]
 *
 * It evaluates the states of a walk one after the other, so that neither the branch predictor nor
 * the cache can repeat results. It prints a JSON line with {"plain": us, "multipliers": us} for
 * each kernel that this processor supports: the least of the repeats' means, because noise only
 * adds. With KERNEL and MULTIPLIERS (0 or 1) it evaluates that one ROUNDS times at every state and
 * prints nothing; callgrind counts its instructions.
 */
#include <string.h>

#include "command/command.h"
#include "driver.h"
#include "kernel.h"

enum { VISITS = 400, ROUNDS = 25 };

typedef struct {
  hxPlant *plant; /* whose work space the kernels use */
  hxModel model;
  int count;
  hxState state[VISITS];
  hxCommand command[VISITS];
} Visited;

static int visit(const Recording *walk, Visited *visited) {
  hxPlant *plant = hx_plant_create();
  if (!plant || hx_plant_reset(plant, &walk->definition, 0.0) != HX_OK) return 1;
  visited->plant = plant;
  visited->model = plant->model;
  for (visited->count = 0; visited->count < VISITS && visited->count < walk->n; ++visited->count) {
    const int k = visited->count;
    visited->state[k] = plant->state;
    hx_command_from_input(&visited->command[k], &walk->input[k], plant->state.time);
    if (hx_plant_step(plant, &walk->input[k], (k + 1) * walk->h) != HX_OK) return 1;
  }
  return 0;
}

/* Returns the time of one evaluation [us]. It sums the results, so that none is optimised away. */
__attribute__((noinline)) static double measure(const hxKernel *kernel, const Visited *visited,
                                                int multipliers, double *sum) {
  hxPlantMotion rate;
  const double begin = seconds_now();
  for (int round = 0; round < ROUNDS; ++round) {
    for (int k = 0; k < visited->count; ++k) {
      kernel->derivative(&visited->model, &visited->state[k], &visited->command[k], multipliers,
                         visited->plant->scratch, &rate);
      *sum += rate.y[HX_V];
    }
  }
  return 1e6 * (seconds_now() - begin) / (ROUNDS * visited->count);
}

static void report(const hxKernel *kernel, const Visited *visited, int repeats, double *sum) {
  double best[2] = {1e30, 1e30};
  for (int r = 0; r < repeats; ++r) {
    for (int multipliers = 0; multipliers < 2; ++multipliers) {
      const double us = measure(kernel, visited, multipliers, sum);
      if (us < best[multipliers]) best[multipliers] = us;
    }
  }
  printf("\"%s\": {\"plain\": %.6f, \"multipliers\": %.6f}", kernel->name, best[0], best[1]);
}

static int only(const char *name, int multipliers, const Visited *visited, double *sum) {
  for (const hxKernel *const *kernel = hx_kernels; *kernel; ++kernel) {
    if (strcmp((*kernel)->name, name) != 0 || !(*kernel)->is_supported()) continue;
    measure(*kernel, visited, multipliers, sum);
    return 0;
  }
  return 1;
}

int main(int argc, char **argv) {
  static Visited visited;
  Recording walk;
  double sum = 0.0;
  const char *comma = "";
  if (argc != 3 && argc != 5) {
    fprintf(stderr, "usage: %s WALK REPEATS [KERNEL MULTIPLIERS]\n", argv[0]);
    return 2;
  }
  if (walk_read(argv[1], &walk) || visit(&walk, &visited)) return 2;
  if (argc == 5) {
    const int unknown = only(argv[3], atoi(argv[4]), &visited, &sum);
    hx_plant_destroy(visited.plant);
    return unknown;
  }
  printf("{");
  for (const hxKernel *const *kernel = hx_kernels; *kernel; ++kernel) {
    if (!(*kernel)->is_supported()) continue;
    printf("%s", comma);
    report(*kernel, &visited, atoi(argv[2]), &sum);
    comma = ", ";
  }
  printf("}\n");
  hx_plant_destroy(visited.plant);
  return sum != sum;
}
