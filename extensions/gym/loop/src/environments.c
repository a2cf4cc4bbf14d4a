/* environments.c - many environments. */
#include "hexapod/environments.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "environment.h"

struct hxEnvironments {
  hxEnvSettings settings;
  hxEnvArrays arrays;
  size_t count, size; /* environments, values in an observation */
  hxEnvironment *environment;
  double *drawn;
};

/* ----------------------------------------------------------------------------------------------
 * creation */

int hx_environments_layout(void) { return HX_ENVIRONMENTS_LAYOUT; }

size_t hx_environments_settings_size(void) { return sizeof(hxEnvSettings); }

static void free_memory(hxEnvironments *all) {
  free(all->environment);
  free(all->drawn);
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

static void reset_one(const hxEnvironments *all, size_t i, const uint64_t *seed) {
  hxEnvironment *environment = &all->environment[i];
  if (seed) {
    environment->seed = seed[i];
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
 * work on a share of them, whose plants use one work space by turns */

void hx_environments_reset(hxEnvironments *all, size_t first, size_t end, const uint8_t *mask,
                           const uint64_t *seed) {
  const hxEnvWork work = hx_environment_work(&all->settings);
  for (size_t i = first; i < end; ++i) {
    if (mask && !mask[i]) continue;
    hx_environment_use(&all->environment[i], &work);
    reset_one(all, i, seed);
    hx_environment_use(&all->environment[i], NULL);
  }
  free(work.block);
}

void hx_environments_step(hxEnvironments *all, size_t first, size_t end) {
  const hxEnvWork work = hx_environment_work(&all->settings);
  for (size_t i = first; i < end; ++i) {
    hx_environment_use(&all->environment[i], &work);
    step_one(all, i);
    hx_environment_use(&all->environment[i], NULL);
  }
  free(work.block);
}

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
