/* environments.c - many environments over threads. */
#include "hexapod/environments.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "environment.h"
#include "pool.h"

struct hxEnvironments {
  hxEnvSettings settings;
  hxEnvArrays arrays;
  size_t count, size; /* environments, values in an observation */
  hxEnvironment *environment;
  double *drawn;
  hxPool pool;
  hxEnvWork work;       /* of the thread that calls reset or step */
  const uint8_t *mask;  /* of the present reset */
  const uint64_t *seed; /* of the present reset */
};

/* ----------------------------------------------------------------------------------------------
 * creation */

int hx_environments_layout(void) { return HX_ENVIRONMENTS_LAYOUT; }

size_t hx_environments_settings_size(void) { return sizeof(hxEnvSettings); }

static void free_memory(hxEnvironments *all) {
  free(all->environment);
  free(all->drawn);
  free(all->work.block);
  free(all);
}

static hxEnvironments *allocate(const hxEnvSettings *settings, size_t n) {
  hxEnvironments *all = calloc(1, sizeof *all);
  if (!all) return NULL;
  all->environment = calloc(n ? n : 1, sizeof *all->environment);
  all->drawn = calloc(n * settings->draws.count + 1, sizeof *all->drawn);
  if (all->environment && all->drawn) return all;
  free_memory(all);
  return NULL;
}

hxEnvironments *hx_environments_create(const hxEnvSettings *settings, const hxEnvArrays *arrays,
                                       size_t n, char *message) {
  hxEnvironments *all = allocate(settings, n);
  snprintf(message, HX_MESSAGE_SIZE, "%s", all ? "" : "out of memory; use fewer environments");
  if (!all) return NULL;
  all->settings = *settings;
  all->arrays = *arrays;
  all->size = hx_environments_observed(settings);
  all->work = hx_environment_work(settings);
  hx_pool_open(&all->pool);
  for (; all->count < n; ++all->count) {
    hxEnvironment *environment = &all->environment[all->count];
    double *drawn = all->drawn + all->count * settings->draws.count;
    if (hx_environment_open(environment, &all->settings, drawn)) continue;
    snprintf(message, HX_MESSAGE_SIZE, "%s", environment->message);
    hx_environments_destroy(all);
    return NULL;
  }
  return all;
}

void hx_environments_destroy(hxEnvironments *all) {
  if (!all) return;
  for (size_t i = 0; i < all->count; ++i) hx_environment_close(&all->environment[i]);
  hx_pool_close(&all->pool);
  free_memory(all);
}

/* ----------------------------------------------------------------------------------------------
 * work on one environment */

static float *observation_of(const hxEnvironments *all, size_t i) {
  return all->arrays.observation + i * all->size;
}

static void clear_results(const hxEnvironments *all, size_t i) {
  const hxEnvArrays *to = &all->arrays;
  to->reward[i] = 0.0;
  memset(to->term + i * HX_ENV_TERMS, 0, HX_ENV_TERMS * sizeof *to->term);
  to->terminated[i] = to->truncated[i] = to->refused[i] = 0;
  to->reason[i] = HX_END_NONE;
}

static void begin_next_episode(const hxEnvironments *all, size_t i) {
  hxEnvironment *environment = &all->environment[i];
  ++environment->episode;
  hx_environment_reset(environment);
  hx_environment_observe(environment, observation_of(all, i));
}

static void reset_one(const hxEnvironments *all, size_t i) {
  hxEnvironment *environment = &all->environment[i];
  if (all->mask && !all->mask[i]) return;
  if (all->seed) {
    environment->seed = all->seed[i];
    environment->episode = 0;
    hx_environment_reset(environment);
    hx_environment_observe(environment, observation_of(all, i));
  } else
    begin_next_episode(all, i);
  clear_results(all, i);
  all->arrays.reason[i] = environment->reason;
}

static int is_finite_action(const float *action) {
  for (int k = 0; k < HX_ENV_JOINTS; ++k)
    if (!isfinite(action[k])) return 0;
  return 1;
}

static void show_end(const hxEnvironments *all, size_t i) {
  const hxEnvArrays *to = &all->arrays;
  const hxEnvironment *environment = &all->environment[i];
  to->reason[i] = environment->reason;
  to->truncated[i] = environment->reason == HX_END_TIME;
  to->terminated[i] = environment->ended && !to->truncated[i];
}

/* Starts the next episode in the same step and keeps the last observation of the one before. */
static void renew(const hxEnvironments *all, size_t i) {
  memcpy(all->arrays.last + i * all->size, observation_of(all, i),
         all->size * sizeof *all->arrays.last);
  begin_next_episode(all, i);
}

static void step_going(const hxEnvironments *all, size_t i, const float *action) {
  const hxEnvArrays *to = &all->arrays;
  hxEnvironment *environment = &all->environment[i];
  to->reward[i] = hx_environment_step(environment, action, to->term + i * HX_ENV_TERMS);
  hx_environment_observe(environment, observation_of(all, i));
}

static void step_one(const hxEnvironments *all, size_t i) {
  hxEnvironment *environment = &all->environment[i];
  const float *action = all->arrays.action + i * HX_ENV_JOINTS;
  clear_results(all, i);
  if (environment->ended && all->settings.autoreset == HX_AUTORESET_NEXT_STEP)
    begin_next_episode(all, i);
  else if (!environment->ended && is_finite_action(action))
    step_going(all, i, action);
  else if (!environment->ended)
    all->arrays.refused[i] = 1;
  if (!environment->ended) return;
  show_end(all, i); /* also of an episode whose start failed */
  if (all->settings.autoreset == HX_AUTORESET_SAME_STEP) renew(all, i);
}

/* ----------------------------------------------------------------------------------------------
 * work on all */

/* Does something with an environment whose plant uses the work space of this thread meanwhile. */
static void with_work(hxEnvironments *all, size_t i, const hxEnvWork *work,
                      void (*act)(const hxEnvironments *all, size_t i)) {
  hxEnvironment *environment = &all->environment[i];
  hx_environment_use(environment, work);
  act(all, i);
  hx_environment_use(environment, NULL);
}

static void reset_item(void *owner, size_t i, void *own) { with_work(owner, i, own, reset_one); }

static void step_item(void *owner, size_t i, void *own) { with_work(owner, i, own, step_one); }

void hx_environments_reset(hxEnvironments *all, const uint8_t *mask, const uint64_t *seed) {
  all->mask = mask;
  all->seed = seed;
  hx_pool_run(&all->pool, reset_item, all, all->count, &all->work);
}

void hx_environments_step(hxEnvironments *all) {
  hx_pool_run(&all->pool, step_item, all, all->count, &all->work);
}

void hx_environments_serve(hxEnvironments *all) {
  hxEnvWork work = hx_environment_work(&all->settings);
  hx_pool_serve(&all->pool, &work);
  free(work.block);
}

void hx_environments_stop(hxEnvironments *all) { hx_pool_stop(&all->pool); }

/* ----------------------------------------------------------------------------------------------
 * inspection */

const char *hx_environments_message(const hxEnvironments *all, size_t index) {
  return all->environment[index].message;
}

void hx_environments_drawn(const hxEnvironments *all, size_t index, double *value) {
  memcpy(value, all->environment[index].drawn, all->settings.draws.count * sizeof *value);
}

void hx_environments_values(const hxEnvironments *all, size_t index, double *value) {
  memcpy(value, all->environment[index].value, HX_ENV_VALUES * sizeof *value);
}
