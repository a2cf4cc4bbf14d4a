/* environment.c - one environment: episodes, steps and observations. */
#include "environment.h"

#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "hexapod/message.h"
#include "hexapod/torso_axes.h"

static const double two_pi = 6.283185307179586;

/* ----------------------------------------------------------------------------------------------
 * FMUs */

/* Keeps a message of an FMU: the logger of its callbacks. */
#if defined(__GNUC__)
__attribute__((format(printf, 5, 6)))
#endif
static void keep_message(fmi2ComponentEnvironment owner, fmi2String name, fmi2Status status,
                         fmi2String category, fmi2String format, ...) {
  hxEnvironment *environment = owner;
  va_list arguments;
  (void)name, (void)category;
  if (status <= fmi2OK) return;
  va_start(arguments, format);
  hx_print_list(environment->message, HX_MESSAGE_SIZE, format, arguments);
  va_end(arguments);
}

int hx_environment_open(hxEnvironment *environment, const hxEnvSettings *settings, double *drawn) {
  const fmi2CallbackFunctions callbacks = {keep_message, calloc, free, NULL, environment};
  const hxEnvFmu *plant = &settings->plant;
  memcpy(&environment->callbacks, &callbacks, sizeof callbacks);
  environment->settings = settings;
  environment->drawn = drawn;
  environment->ended = 1;
  environment->stepper = (hxStepper){
      .plant = plant->step,
      .plant_output = {settings->plant_output, HX_ENV_VALUES, 0},
      .plant_input = {settings->plant_input, HX_ENV_INPUTS, HX_ENV_VALUES},
      .value = environment->value,
      .h = settings->h,
  };
  environment->stepper.plant.instance =
      plant->instantiate("plant", fmi2CoSimulation, plant->guid, plant->resources,
                         &environment->callbacks, fmi2False, fmi2False);
  return environment->stepper.plant.instance != NULL;
}

void hx_environment_close(hxEnvironment *environment) {
  environment->settings->plant.free_instance(environment->stepper.plant.instance);
}

hxEnvWork hx_environment_work(const hxEnvSettings *settings) {
  const hxEnvFmu *fmu = &settings->plant;
  hxEnvWork work = {NULL, NULL, 0};
  if (!fmu->work_size || !fmu->work_use) return work;
  work.size = fmu->work_size();
  if (work.size) work.block = malloc(work.size + HX_SHARED_WORK_ALIGNMENT);
  if (!work.block) return work;
  work.memory = (char *)work.block + hx_shared_work_padding((uintptr_t)work.block);
  return work;
}

void hx_environment_use(hxEnvironment *environment, const hxEnvWork *work) {
  const hxEnvFmu *fmu = &environment->settings->plant;
  if (!fmu->work_use) return;
  if (!work)
    fmu->work_use(environment->stepper.plant.instance, NULL, 0);
  else if (work->memory)
    fmu->work_use(environment->stepper.plant.instance, work->memory, work->size);
}

static int accept(int status) { return status <= fmi2Warning; }

/* Initialises an instance with its parameters. */
static int start(const hxEnvFmu *fmu, fmi2Component instance) {
  return accept(fmu->setup(instance, fmi2False, 0.0, 0.0, fmi2False, 0.0)) &&
         accept(fmu->enter(instance)) && accept(fmu->leave(instance));
}

/* ----------------------------------------------------------------------------------------------
 * random numbers: functions of seed, episode and place, which do not depend on earlier draws */

/* Streams of an episode's random numbers. */
enum { HX_STREAM_COMMAND, HX_STREAM_DRAWS, HX_STREAM_PUSH };

/* Mixes the bits of a number: the finaliser of SplitMix64 (Steele, Lea and Flood, 2014). */
static uint64_t mix_bits(uint64_t x) {
  x += UINT64_C(0x9e3779b97f4a7c15);
  x = (x ^ (x >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
  x = (x ^ (x >> 27)) * UINT64_C(0x94d049bb133111eb);
  return x ^ (x >> 31);
}

/* Returns a number uniform in [0, 1), a multiple of 2^-53. */
static double uniform(const hxEnvironment *environment, int stream, size_t place) {
  const uint64_t own = mix_bits(mix_bits(environment->seed) ^ environment->episode);
  const uint64_t bits = mix_bits(mix_bits(own ^ (uint64_t)stream) ^ place);
  return (double)(bits >> 11) * 0x1p-53;
}

/* ----------------------------------------------------------------------------------------------
 * episodes */

static void draw_parameters(hxEnvironment *environment) {
  const hxEnvDraws *draws = &environment->settings->draws;
  for (size_t i = 0; i < draws->count; ++i) {
    const double low = draws->low[i], range = draws->high[i] - low;
    const double u = uniform(environment, HX_STREAM_DRAWS, i);
    environment->drawn[i] = low + (draws->whole[i] ? floor(u * (range + 1.0)) : u * range);
  }
}

static void draw_command(hxEnvironment *environment) {
  const hxEnvSettings *settings = environment->settings;
  for (size_t i = 0; i < 3; ++i) {
    const double low = settings->command_low[i], range = settings->command_high[i] - low;
    environment->command[i] = low + uniform(environment, HX_STREAM_COMMAND, i) * range;
  }
}

/* Resets and initialises the plant; returns 0 when it refuses. */
static int restart(hxEnvironment *environment) {
  const hxEnvSettings *settings = environment->settings;
  const hxEnvDraws *draws = &settings->draws;
  const hxStepFmu *plant = &environment->stepper.plant;
  if (!accept(settings->plant.reset(plant->instance))) return 0;
  if (draws->count && !accept(plant->set_reals(plant->instance, draws->reference, draws->count,
                                               environment->drawn)))
    return 0;
  if (!start(&settings->plant, plant->instance)) return 0;
  return hx_read_plant(&environment->stepper);
}

void hx_environment_reset(hxEnvironment *environment) {
  environment->step = 0;
  environment->reason = HX_END_NONE;
  memset(environment->action, 0, sizeof environment->action);
  memset(environment->value, 0, sizeof environment->value);
  environment->value[HX_ENV_QUATERNION] = 1.0;
  draw_parameters(environment);
  draw_command(environment);
  environment->ended = !restart(environment);
  if (environment->ended) environment->reason = HX_END_FAILED;
}

/* ----------------------------------------------------------------------------------------------
 * motion in axes of the torso */

static hxEnvView view_of(const hxEnvironment *environment) {
  static const double down[3] = {0.0, 0.0, -1.0};
  const double *value = environment->value, *p = value + HX_ENV_QUATERNION;
  hxEnvView view;
  hx_torso_axes(p, value + HX_ENV_VELOCITY, view.velocity);
  hx_torso_axes(p, value + HX_ENV_ROTATION, view.rotation);
  hx_torso_axes(p, down, view.gravity);
  return view;
}

/* ----------------------------------------------------------------------------------------------
 * steps */

/* Stores the action, limited to [-1, 1]; returns the sum of its squared changes. */
static double take_action(hxEnvironment *environment, const float action[HX_ENV_JOINTS]) {
  double change = 0.0;
  for (int i = 0; i < HX_ENV_JOINTS; ++i) {
    const double wanted = fmin(fmax((double)action[i], -1.0), 1.0);
    const double difference = wanted - environment->action[i];
    change += difference * difference;
    environment->action[i] = wanted;
  }
  return change;
}

/* Sets the push of this step. */
static void push(hxEnvironment *environment) {
  const hxEnvSettings *settings = environment->settings;
  double *force = environment->value + HX_ENV_VALUES + HX_ENV_COMMANDS;
  const size_t interval = settings->push_interval;
  force[0] = force[1] = 0.0;
  if (!interval || environment->step < interval) return;
  if (environment->step % interval >= settings->push_length) return;
  const size_t number = environment->step / interval;
  const double size = settings->push_force * uniform(environment, HX_STREAM_PUSH, 2 * number);
  const double angle = two_pi * uniform(environment, HX_STREAM_PUSH, 2 * number + 1);
  force[0] = size * cos(angle);
  force[1] = size * sin(angle);
}

/* Commands the angles of the stance and the action. */
static void act(void *owner) {
  hxEnvironment *environment = owner;
  const hxEnvSettings *settings = environment->settings;
  double *angle = environment->value + HX_ENV_VALUES;
  for (int i = 0; i < HX_ENV_JOINTS; ++i)
    angle[i] = settings->stance[i] + settings->action_scale[i] * environment->action[i];
}

static int advance(hxEnvironment *environment) {
  const double t = (double)environment->step * environment->settings->h;
  push(environment);
  if (!hx_macro_step(&environment->stepper, t, NULL, act, NULL, environment)) return 0;
  ++environment->step;
  return 1;
}

/* Returns why the episode ends with the present values. */
static int judge(const hxEnvironment *environment, const hxEnvView *view) {
  const hxEnvSettings *settings = environment->settings;
  const double *f = environment->value + HX_ENV_BELLY, limit = settings->belly_force;
  if (-view->gravity[2] < settings->upright) return HX_END_TILTED;
  if (f[0] * f[0] + f[1] * f[1] + f[2] * f[2] > limit * limit) return HX_END_BELLY;
  return environment->step >= settings->length ? HX_END_TIME : HX_END_NONE;
}

static double slip_distance(const hxEnvironment *environment) {
  double sum = 0.0;
  for (int i = 0; i < HX_ENV_FEET; ++i) sum += environment->value[HX_ENV_SLIP + i];
  return sum;
}

double hx_environment_step(hxEnvironment *environment, const float action[HX_ENV_JOINTS],
                           double term[HX_ENV_TERMS]) {
  const hxEnvSettings *settings = environment->settings;
  const double before = slip_distance(environment);
  const double change = take_action(environment, action);
  const int going = advance(environment);
  const hxEnvView view = view_of(environment);
  environment->reason = going ? judge(environment, &view) : HX_END_FAILED;
  environment->ended = environment->reason != HX_END_NONE;
  const hxEnvMotion motion = {
      .view = view,
      .command = environment->command,
      .torque = environment->value + HX_ENV_TORQUE,
      .speed = environment->value + HX_ENV_SPEED,
      .change = change,
      .slip = slip_distance(environment) - before,
      .time = settings->h,
      .fell = environment->ended && environment->reason != HX_END_TIME,
  };
  return hx_reward(settings, &motion, term);
}

/* ----------------------------------------------------------------------------------------------
 * observations */

static const size_t block_size[HX_ENV_BLOCKS] = {
    3, 3, 3, 3, HX_ENV_JOINTS, HX_ENV_JOINTS, HX_ENV_JOINTS, 2};

/* Returns whether the axes of a block have scales of their own. */
static int is_vector(int block) { return block_size[block] == 3; }

/* Returns whether a block is observed. */
static int sees(const hxEnvSettings *settings, int block) {
  const double *scale = settings->observed[block];
  return scale[0] != 0.0 || (is_vector(block) && (scale[1] != 0.0 || scale[2] != 0.0));
}

size_t hx_environments_observed(const hxEnvSettings *settings) {
  size_t size = 0;
  for (int block = 0; block < HX_ENV_BLOCKS; ++block)
    if (sees(settings, block)) size += block_size[block];
  return size;
}

/* Returns a value within -limit and limit. */
static double limited(double value, double limit) { return fmin(fmax(value, -limit), limit); }

/* Writes a block and returns the place behind it. */
static float *show(const hxEnvSettings *settings, int block, const double *value, float *to) {
  const double *scale = settings->observed[block];
  const size_t size = block_size[block];
  if (!sees(settings, block)) return to;
  for (size_t i = 0; i < size; ++i)
    to[i] = (float)limited(value[i] * scale[is_vector(block) ? i : 0], HX_ENV_LARGEST);
  return to + size;
}

void hx_environment_observe(const hxEnvironment *environment, float *observation) {
  const hxEnvSettings *settings = environment->settings;
  const hxEnvView view = view_of(environment);
  const double time = (double)environment->step * settings->h;
  const double turns = settings->clock * time, phase = two_pi * (turns - floor(turns));
  const double clock[2] = {sin(phase), cos(phase)};
  double angle[HX_ENV_JOINTS];
  for (int i = 0; i < HX_ENV_JOINTS; ++i)
    angle[i] = environment->value[HX_ENV_ANGLE + i] - settings->stance[i];
  observation = show(settings, HX_SEE_VELOCITY, view.velocity, observation);
  observation = show(settings, HX_SEE_ROTATION, view.rotation, observation);
  observation = show(settings, HX_SEE_GRAVITY, view.gravity, observation);
  observation = show(settings, HX_SEE_COMMAND, environment->command, observation);
  observation = show(settings, HX_SEE_ANGLE, angle, observation);
  observation = show(settings, HX_SEE_SPEED, environment->value + HX_ENV_SPEED, observation);
  observation = show(settings, HX_SEE_ACTION, environment->action, observation);
  show(settings, HX_SEE_CLOCK, clock, observation);
}
