/* derivative.c - directional derivatives of rates and outputs, by tangent.c */
#include <math.h>
#include <string.h>

#include "../command/command.h"
#include "../contact_law.h"
#include "../kernel.h"
#include "../robot/robot.h"
#include "../tangent.h"
#include "parts.h"

/* The constants of a model and of its contacts at parameters, and their change, at the end of the
 * work space of hx_tangent. */
typedef struct {
  double change[HX_CONSTANTS];
  hxDefinition definition;
  hxDepths depths;
  hxModel model;
  hxContactState contact;
  hxCommand command; /* that at the point, its supply at the parameters */
  double voltage;    /* V  change of the model's */
} hxConstants;

size_t hx_derivative_scratch(void) { return hx_tangent_scratch() + sizeof(hxConstants); }

#if HX_HAS_TANGENT
/* of central differences of order six, at 1, 2 and 3 steps */
static const double weight[] = {45.0 / 60.0, -9.0 / 60.0, 1.0 / 60.0};

/* Adds a share of the numbers of model and contacts to the change. */
static void add_numbers(hxConstants *constants, double share) {
  double *to = constants->change;
  const double *head = (const double *)(const void *)&constants->model,
               *contact = (const double *)(const void *)&constants->contact;
  for (int i = 0; i < HX_MODEL_HEAD; ++i) *to++ += share * head[i];
  for (int i = 0; i < HX_MODEL_TAIL; ++i) *to++ += share * (&constants->model.stiffness)[i];
  for (int i = 0; i < HX_CONTACT_SIZE; ++i) *to++ += share * contact[i];
}

/* Adds a share of what the motors get from their supply to the change of the command. */
static void add_supply(const hxPlant *plant, double share, hxConstants *constants,
                       hxCommand *d_command) {
  hxCommand *command = &constants->command;
  hx_supply_power(command, &constants->model, &plant->state);
  d_command->supply += share * command->supply;
  for (int i = 0; i < HX_JOINTS * HX_SLOTS; ++i)
    d_command->duty[i / HX_SLOTS][i % HX_SLOTS] +=
        share * command->duty[i / HX_SLOTS][i % HX_SLOTS];
  constants->voltage += share * constants->model.voltage;
}

/* Adds a share of the constants at the parameters plus t times their change. */
static void add_point(const hxPlant *plant, const hxParameterChange *parameters, double t,
                      double share, hxConstants *constants, hxCommand *d_command) {
  const hxRange *range;
  const size_t n = hx_definition_ranges(&range);
  constants->definition = *parameters->definition;
  for (size_t i = 0; i < n; ++i) {
    double change, value;
    char *place = (char *)&constants->definition + range[i].offset;
    if (range[i].is_int) continue;
    memcpy(&change, (const char *)parameters->change + range[i].offset, sizeof change);
    memcpy(&value, place, sizeof value);
    value += t * change;
    memcpy(place, &value, sizeof value);
  }
  memset(&constants->model, 0, sizeof constants->model);
  hx_model_compile(&constants->model, &constants->definition, plant->model.terrain);
  for (int joint = 0; joint < HX_JOINTS; ++joint) /* locks do not depend on parameters */
    if (plant->model.stops & 2) constants->model.joint[joint].stop = plant->model.joint[joint].stop;
  constants->contact = plant->state.contact;
  hx_contact_tune(&constants->model, &constants->depths, &constants->contact);
  add_numbers(constants, share);
  add_supply(plant, share, constants, d_command);
}

/* Returns the step of the differences below: 1e-3 of the parameters that change, or of 1 for those
 * that are 0; 0: none changes. */
static double difference_step(const hxParameterChange *parameters) {
  const hxRange *range;
  const size_t n = hx_definition_ranges(&range);
  double largest = 0.0;
  for (size_t i = 0; i < n; ++i) {
    double change, value;
    if (range[i].is_int) continue;
    memcpy(&change, (const char *)parameters->change + range[i].offset, sizeof change);
    memcpy(&value, (const char *)parameters->definition + range[i].offset, sizeof value);
    largest = fmax(largest, fabs(change) / (value != 0.0 ? fabs(value) : 1.0));
  }
  return largest > 0.0 ? 1e-3 / largest : 0.0;
}

/* Computes the derivatives of the constants by central differences of order six. Most constants are
 * linear in a parameter, for which these are exact; the others have errors of about 1e-13. Adds
 * that of the motors' supply to the point's. Returns NULL if no parameter changes. */
static const hxConstants *constants_of(hxPlant *plant, const hxParameterChange *parameters,
                                       hxTangentPoint *point) {
  hxConstants *constants = (void *)((char *)plant->scratch + hx_tangent_scratch());
  const double h = parameters ? difference_step(parameters) : 0.0;
  if (!(h > 0.0)) return NULL;
  memset(constants->change, 0, sizeof constants->change);
  constants->command = point->command;
  constants->voltage = 0.0;
  hx_kernel()->depths(&plant->model, &plant->state.contact, &plant->state.motion,
                      &constants->depths);
  for (int k = 0; k < 3; ++k) {
    add_point(plant, parameters, (k + 1) * h, weight[k] / h, constants, &point->d_command);
    add_point(plant, parameters, -(k + 1) * h, -weight[k] / h, constants, &point->d_command);
  }
  return constants;
}

/* Adds to the change of the point's command how it changes the supply's voltage, by the same
 * differences; size: the largest number of the change. */
static void add_sag(const hxPlant *plant, double size, hxTangentPoint *point) {
  enum { COUNT = sizeof(hxCommand) / sizeof(double) };
  const double h = 1e-3 / size, *from = (const double *)&point->command,
               *change = (const double *)&point->d_command;
  double sum = 0.0;
  hxCommand moved;
  double *to = (double *)&moved;
  if (!(plant->model.supply_resistance > 0.0 && size > 0.0)) return;
  for (int k = -3; k <= 3; ++k) {
    for (int i = 0; i < COUNT; ++i) to[i] = from[i] + k * h * change[i];
    hx_supply_power(&moved, &plant->model, &plant->state);
    if (k != 0) sum += (k > 0 ? weight[k - 1] : -weight[-k - 1]) * moved.supply;
  }
  point->d_command.supply = sum / h;
}
#endif

hxStatus hx_plant_tangent_by(hxPlant *plant, const hxInput *input,
                             const hxParameterChange *parameters, const hxInput *d_input,
                             const hxCoordinates *dx, hxCoordinates *d_rate, hxOutput *d_output) {
  static const hxInput no_input;
  static const hxCoordinates no_change;
  const double size = hx_largest(0.0, d_input, sizeof *d_input / sizeof(double)),
               scale = hx_largest(size, dx, HX_COORDINATES);
  if (!isfinite(scale))
    return hx_plant_fail(
        plant, HX_INVALID_ARGUMENT,
        "derivatives: got a direction that is not finite, expected finite numbers");
#if HX_HAS_TANGENT
  hxTangentPoint *point = plant->scratch;
  hxCoordinates x;
  hx_plant_get_coordinates(plant, &x); /* before the point, because it uses the same memory */
  hx_plant_command(plant, input, &point->command);
  hx_command_from_input(&point->d_command, d_input ? d_input : &no_input, 0.0);
  add_sag(plant, size, point);
  const hxConstants *constants = constants_of(plant, parameters, point);
  const double d_voltage = plant->model.voltage * point->d_command.supply +
                           point->command.supply * (constants ? constants->voltage : 0.0);
  point->x = x;
  point->dx = dx ? *dx : no_change;
  point->model = plant->model;
  memcpy(&point->state, &plant->state, offsetof(hxState, moment));
  point->scale = scale > 0.0 ? scale : 1.0;
  hx_tangent(point, constants ? constants->change : NULL, d_rate, d_output);
  if (d_output && plant->model.servo_drive == HX_DRIVE_MOTOR) d_output->supply_voltage = d_voltage;
  return HX_OK;
#else
  (void)parameters;
  return hx_plant_fail(
      plant, HX_INVALID_ARGUMENT,
      "derivatives: got a call in a binary without complex numbers, expected another "
      "compiler's binary; build the plant with gcc or clang");
#endif
}

hxStatus hx_plant_tangent(hxPlant *plant, const hxInput *input, const hxInput *d_input,
                          const hxCoordinates *dx, hxCoordinates *d_rate, hxOutput *d_output) {
  return hx_plant_tangent_by(plant, input, NULL, d_input, dx, d_rate, d_output);
}
