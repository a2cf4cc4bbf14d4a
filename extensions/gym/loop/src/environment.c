/* environment.c - one environment: episodes, steps and observations. */
#include "environment.h"

#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "hexapod/message.h"

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

static fmi2Component instantiate(hxEnvironment *environment, const hxEnvFmu *fmu, int which) {
  const fmi2CallbackFunctions callbacks = {keep_message, calloc, free, NULL, environment};
  memcpy(&environment->callbacks[which], &callbacks, sizeof callbacks);
  return fmu->instantiate(which == 0 ? "plant" : "controller", fmi2CoSimulation, fmu->guid,
                          fmu->resources, &environment->callbacks[which], fmi2False, fmi2False);
}

/* Prepares the macro-steps of an environment, whose instances are not made yet. */
static void prepare(hxEnvironment *environment, const hxEnvSettings *settings) {
  const hxStepBlock output = {settings->plant_output, HX_ENV_VALUES, 0};
  const hxStepBlock input = {settings->plant_input, HX_ENV_INPUTS, HX_ENV_VALUES};
  const hxStepBlock commands = {settings->controller_output, HX_ENV_COMMANDS, HX_ENV_VALUES};
  for (size_t i = 0; i < HX_ENV_SENSED; ++i) /* angles, then forces and quaternion, which adjoin */
    environment->sensed[i] =
        i < HX_ENV_JOINTS ? HX_ENV_ANGLE + i : HX_ENV_FORCE + i - HX_ENV_JOINTS;
  environment->stepper = (hxStepper){
      .plant = settings->plant.step,
      .controller = settings->controller.step,
      .plant_output = output,
      .plant_input = input,
      .controller_output = commands,
      .controller_input = settings->controller_input,
      .sensed = environment->sensed,
      .command_count = HX_ENV_BODY,
      .sensed_count = HX_ENV_SENSED,
      .given = environment->given,
      .value = environment->value,
      .h = settings->h,
  };
}

int hx_environment_open(hxEnvironment *environment, const hxEnvSettings *settings, double *drawn) {
  environment->settings = settings;
  environment->drawn = drawn;
  environment->ended = 1;
  prepare(environment, settings);
  hxStepper *stepper = &environment->stepper;
  stepper->plant.instance = instantiate(environment, &settings->plant, 0);
  if (!stepper->plant.instance) return 0;
  if (!settings->controller.instantiate) return 1;
  stepper->controller.instance = instantiate(environment, &settings->controller, 1);
  if (stepper->controller.instance) return 1;
  hx_environment_close(environment);
  return 0;
}

void hx_environment_close(hxEnvironment *environment) {
  const hxEnvSettings *settings = environment->settings;
  hxStepFmu *plant = &environment->stepper.plant, *controller = &environment->stepper.controller;
  if (plant->instance) settings->plant.free_instance(plant->instance);
  if (controller->instance) settings->controller.free_instance(controller->instance);
  plant->instance = controller->instance = NULL;
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

/* Draws the command of the present step if one begins with it. */
static void draw_command(hxEnvironment *environment) {
  const hxEnvSettings *settings = environment->settings;
  const size_t interval = settings->command_interval;
  const size_t number = interval ? environment->step / interval : 0;
  if (environment->step != number * interval) return;
  for (size_t i = 0; i < 3; ++i) {
    const double low = settings->command_low[i], range = settings->command_high[i] - low;
    environment->body[i] = low + uniform(environment, HX_STREAM_COMMAND, 3 * number + i) * range;
  }
}

/* Resets and initialises the FMUs; returns 0 when one refuses. */
static int restart(hxEnvironment *environment) {
  const hxEnvSettings *settings = environment->settings;
  const hxEnvDraws *draws = &settings->draws;
  const hxStepFmu *plant = &environment->stepper.plant;
  void *controller = environment->stepper.controller.instance;
  if (!accept(settings->plant.reset(plant->instance))) return 0;
  if (draws->count && !accept(plant->set_reals(plant->instance, draws->reference, draws->count,
                                               environment->drawn)))
    return 0;
  if (!start(&settings->plant, plant->instance)) return 0;
  if (controller &&
      !(accept(settings->controller.reset(controller)) && start(&settings->controller, controller)))
    return 0;
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

/* Computes R^T u, with the rotation R of the quaternion [w x y z], torso to world. */
static void to_torso(const double p[4], const double u[3], double v[3]) {
  const double w = p[0], *q = p + 1;
  const double c[3] = {u[1] * q[2] - u[2] * q[1], u[2] * q[0] - u[0] * q[2],
                       u[0] * q[1] - u[1] * q[0]}; /* u x q */
  const double d[3] = {c[1] * q[2] - c[2] * q[1], c[2] * q[0] - c[0] * q[2],
                       c[0] * q[1] - c[1] * q[0]}; /* (u x q) x q */
  for (int i = 0; i < 3; ++i) v[i] = u[i] + 2.0 * (w * c[i] + d[i]);
}

static hxEnvView view_of(const hxEnvironment *environment) {
  static const double down[3] = {0.0, 0.0, -1.0};
  const double *value = environment->value, *p = value + HX_ENV_QUATERNION;
  hxEnvView view;
  to_torso(p, value + HX_ENV_VELOCITY, view.velocity);
  to_torso(p, value + HX_ENV_ROTATION, view.rotation);
  to_torso(p, down, view.gravity);
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

/* Adds the action to the joint commands of the controller, or to the stance. */
static void act(void *owner) {
  hxEnvironment *environment = owner;
  const hxEnvSettings *settings = environment->settings;
  double *angle = environment->value + HX_ENV_VALUES;
  if (!environment->stepper.controller.instance)
    memcpy(angle, settings->stance, sizeof settings->stance);
  for (int i = 0; i < HX_ENV_JOINTS; ++i)
    angle[i] += settings->action_scale[i] * environment->action[i];
}

static int substep(hxEnvironment *environment, size_t number) {
  const hxEnvSettings *settings = environment->settings;
  const double t = (double)(environment->step * settings->substeps + number) * settings->h;
  return hx_macro_step(&environment->stepper, t, environment->body, act, NULL, environment);
}

static int advance(hxEnvironment *environment) {
  push(environment);
  for (size_t number = 0; number < environment->settings->substeps; ++number)
    if (!substep(environment, number)) return 0;
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
      .command = environment->body,
      .torque = environment->value + HX_ENV_TORQUE,
      .speed = environment->value + HX_ENV_SPEED,
      .change = change,
      .slip = slip_distance(environment) - before,
      .time = (double)settings->substeps * settings->h,
      .fell = environment->ended && environment->reason != HX_END_TIME,
  };
  const double reward = hx_reward(settings, &motion, term);
  draw_command(environment);
  return reward;
}

/* ----------------------------------------------------------------------------------------------
 * observations */

static const size_t block_size[HX_ENV_BLOCKS] = {
    3, 3, 3, 3, HX_ENV_JOINTS, HX_ENV_JOINTS, HX_ENV_JOINTS, 2, 0};

static size_t size_of(const hxEnvSettings *settings, int block) {
  return block == HX_SEE_HEIGHTS ? settings->ground.points : block_size[block];
}

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
    if (sees(settings, block)) size += size_of(settings, block);
  return size;
}

/* Returns a value within -limit and limit. */
static double limited(double value, double limit) { return fmin(fmax(value, -limit), limit); }

/* Writes a block and returns the place behind it. */
static float *show(const hxEnvSettings *settings, int block, const double *value, float *to) {
  const double *scale = settings->observed[block];
  const size_t size = size_of(settings, block);
  if (!sees(settings, block)) return to;
  for (size_t i = 0; i < size; ++i)
    to[i] = (float)limited(value[i] * scale[is_vector(block) ? i : 0], HX_ENV_LARGEST);
  return to + size;
}

/* Returns the node below a coordinate in units of the spacing, and the share of the way to the next
 * node. Beyond the first and the last node it stays there. */
static size_t node_below(double coordinate, size_t nodes, double *share) {
  const double last = (double)(nodes - 1), inside = fmin(fmax(coordinate, 0.0), last);
  const double node = fmin(floor(inside), last - 1.0);
  *share = inside - node;
  return (size_t)node;
}

/* Returns the height of a ground [m] at a place in the world. */
static double height_at(const hxEnvGround *ground, const float *height, double x, double y) {
  double u, v;
  const size_t column = node_below((x - ground->x0) / ground->spacing, ground->columns, &u);
  const size_t row = node_below((y - ground->y0) / ground->spacing, ground->rows, &v);
  const float *low = height + row * ground->columns + column, *high = low + ground->columns;
  return (1.0 - v) * ((1.0 - u) * (double)low[0] + u * (double)low[1]) +
         v * ((1.0 - u) * (double)high[0] + u * (double)high[1]);
}

static const float *present_ground(const hxEnvironment *environment) {
  const hxEnvSettings *settings = environment->settings;
  const hxEnvGround *ground = &settings->ground;
  const size_t number =
      ground->draw < settings->draws.count ? (size_t)environment->drawn[ground->draw] - 1 : 0;
  return ground->height + number * ground->rows * ground->columns;
}

/* Writes the heights of the scanned places. */
static void scan(const hxEnvironment *environment, float *to) {
  const hxEnvSettings *settings = environment->settings;
  const hxEnvGround *ground = &settings->ground;
  const float *height = present_ground(environment);
  const double *r = environment->value + HX_ENV_POSITION;
  const double *p = environment->value + HX_ENV_QUATERNION;
  /* the torso's x axis, projected onto the horizontal plane */
  const double x = 1.0 - 2.0 * (p[2] * p[2] + p[3] * p[3]), y = 2.0 * (p[1] * p[2] + p[0] * p[3]);
  const double length = sqrt(x * x + y * y);
  const double c = length > 0.0 ? x / length : 1.0, s = length > 0.0 ? y / length : 0.0;
  for (size_t i = 0; i < ground->points; ++i) {
    const double a = ground->place[2 * i], b = ground->place[2 * i + 1];
    const double below = height_at(ground, height, r[0] + c * a - s * b, r[1] + s * a + c * b);
    const double over = limited(r[2] - below - ground->clearance, 1.0);
    to[i] = (float)limited(over * settings->observed[HX_SEE_HEIGHTS][0], HX_ENV_LARGEST);
  }
}

void hx_environment_observe(const hxEnvironment *environment, float *observation) {
  const hxEnvSettings *settings = environment->settings;
  const hxEnvView view = view_of(environment);
  const double time = (double)(environment->step * settings->substeps) * settings->h;
  const double turns = settings->clock * time, phase = two_pi * (turns - floor(turns));
  const double clock[2] = {sin(phase), cos(phase)};
  double angle[HX_ENV_JOINTS];
  for (int i = 0; i < HX_ENV_JOINTS; ++i)
    angle[i] = environment->value[HX_ENV_ANGLE + i] - settings->stance[i];
  observation = show(settings, HX_SEE_VELOCITY, view.velocity, observation);
  observation = show(settings, HX_SEE_ROTATION, view.rotation, observation);
  observation = show(settings, HX_SEE_GRAVITY, view.gravity, observation);
  observation = show(settings, HX_SEE_COMMAND, environment->body, observation);
  observation = show(settings, HX_SEE_ANGLE, angle, observation);
  observation = show(settings, HX_SEE_SPEED, environment->value + HX_ENV_SPEED, observation);
  observation = show(settings, HX_SEE_ACTION, environment->action, observation);
  observation = show(settings, HX_SEE_CLOCK, clock, observation);
  if (sees(settings, HX_SEE_HEIGHTS)) scan(environment, observation);
}
