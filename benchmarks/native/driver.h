/* driver.h - shared code of all drivers: walk file, clock, command line and output as a JSON line
 *
 *     driver WALK METHOD STEP REPEATS PATH_OUT
 *
 * The time is that of the loop over the macro-steps alone: pass the commands, integrate, read the
 * torso's position.
 */
#ifndef BENCH_DRIVER_H
#define BENCH_DRIVER_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "hexapod/hexapod.h"

/* Content of a walk file: a robot, and the recorded inputs that drive it. */
typedef struct {
  hxDefinition definition;
  int64_t n;
  double h;       /* s  input k is held over [k h, (k + 1) h) */
  hxInput *input; /* n of them */
} Recording;

/* One engine. Functions return 0 on success; self points to the data of the driver. */
typedef struct {
  int (*prepare)(void *self, const Recording *walk, const char *method, double step);
  int (*start)(void *self); /* the initial state at t = 0 */
  int (*advance)(void *self, const hxInput *input, double t_end);
  void (*torso)(void *self, double position[3]); /* m  centre of mass */
  double (*evaluations)(void *self);             /* of the right-hand side since start */
  /* evaluates the right-hand side count times; NULL if the engine cannot */
  void (*evaluate)(void *self, const hxInput *input, int count);
} Driver;

enum { STATES = 100, EVALUATIONS_A_STATE = 10 };

static inline double seconds_now(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static inline int walk_read(const char *path, Recording *walk) {
  FILE *file = fopen(path, "rb");
  int good = file && fread(&walk->definition, sizeof walk->definition, 1, file) == 1 &&
             fread(&walk->n, sizeof walk->n, 1, file) == 1 &&
             fread(&walk->h, sizeof walk->h, 1, file) == 1 && walk->n > 0 && walk->n < 10000000;
  if (good) {
    walk->input = (hxInput *)malloc((size_t)walk->n * sizeof *walk->input);
    good = walk->input &&
           fread(walk->input, sizeof *walk->input, (size_t)walk->n, file) == (size_t)walk->n;
  }
  if (file) fclose(file);
  if (!good) fprintf(stderr, "%s: no walk file of this hexapod.h; write it anew\n", path);
  return good ? 0 : 1;
}

/* Runs the walk once; path: (n + 1) x 3. Returns 0, or 1 if the engine failed. */
static inline int walk_once(const Driver *driver, void *self, const Recording *walk, double *path,
                            double *seconds) {
  if (driver->start(self)) return 1;
  const double begin = seconds_now();
  driver->torso(self, path);
  for (int64_t k = 0; k < walk->n; ++k) {
    if (driver->advance(self, &walk->input[k], (double)(k + 1) * walk->h)) return 1;
    driver->torso(self, path + 3 * (k + 1));
  }
  *seconds = seconds_now() - begin;
  return 0;
}

/* Returns the mean time of an evaluation over a walk's first states [us], negative if unknown. */
static inline double evaluation_time(const Driver *driver, void *self, const Recording *walk) {
  double seconds = 0.0;
  if (!driver->evaluate || driver->start(self)) return -1.0;
  const int64_t n = walk->n < STATES ? walk->n : STATES;
  for (int64_t k = 0; k < n; ++k) {
    const double begin = seconds_now();
    driver->evaluate(self, &walk->input[k], EVALUATIONS_A_STATE);
    seconds += seconds_now() - begin;
    if (driver->advance(self, &walk->input[k], (double)(k + 1) * walk->h)) return -1.0;
  }
  return 1e6 * seconds / ((double)n * EVALUATIONS_A_STATE);
}

static inline int path_write(const char *name, const double *path, int64_t n) {
  FILE *file = fopen(name, "wb");
  const int good = file && fwrite(path, 3 * sizeof *path, (size_t)(n + 1), file) == (size_t)(n + 1);
  if (file) fclose(file);
  if (!good) fprintf(stderr, "%s: cannot be written\n", name);
  return good ? 0 : 1;
}

static inline int driver_run(const Driver *driver, void *self, const Recording *walk, int repeats,
                             double *path) {
  double evaluations = 0.0;
  printf("{\"seconds\": [");
  for (int r = 0; r < repeats; ++r) {
    double seconds = 0.0;
    if (walk_once(driver, self, walk, path, &seconds)) return 1;
    printf("%s%.9f", r ? ", " : "", seconds);
    evaluations = driver->evaluations(self);
  }
  const double each = evaluation_time(driver, self, walk);
  printf("], \"evaluations\": %.0f, \"microseconds_per_evaluation\": ", evaluations);
  if (each < 0.0)
    printf("null}\n");
  else
    printf("%.6f}\n", each);
  return 0;
}

static inline int driver_main(int argc, char **argv, const Driver *driver, void *self) {
  Recording walk;
  if (argc != 6) {
    fprintf(stderr, "usage: %s WALK METHOD STEP REPEATS PATH_OUT\n", argv[0]);
    return 2;
  }
  if (walk_read(argv[1], &walk)) return 2;
  if (driver->prepare(self, &walk, argv[2], atof(argv[3]))) return 2;
  double *path = (double *)calloc(3 * (size_t)(walk.n + 1), sizeof *path);
  if (!path || driver_run(driver, self, &walk, atoi(argv[4]), path)) return 1;
  return path_write(argv[5], path, walk.n);
}

#endif
