/* master.c - the co-simulation loop of a plant FMU and a controller FMU. */
#include "hexapod/master.h"

#include <string.h>

/* stores a failed call and its status; returns 1 if the call succeeded */
static int accept(hxMaster *master, hxMasterCall call, fmi2Status status) {
  if (status <= fmi2Warning) return 1;
  master->call = (int)call;
  master->status = (int)status;
  return 0;
}

/* ----------------------------------------------------------------------------------------------
 * values */

static int get_reals(hxMaster *master, const hxMasterFmu *fmu, const hxMasterBlock *block,
                     hxMasterCall call) {
  double *value = master->value + block->place;
  return !block->count ||
         accept(master, call, fmu->get_real(fmu->instance, block->reference, block->count, value));
}

static int get_flags(hxMaster *master, const hxMasterFmu *fmu, const hxMasterBlock *block,
                     hxMasterCall call) {
  double *value = master->value + block->place;
  if (!block->count) return 1;
  if (!accept(master, call,
              fmu->get_boolean(fmu->instance, block->reference, block->count, master->flag)))
    return 0;
  for (size_t i = 0; i < block->count; ++i) value[i] = master->flag[i] ? 1.0 : 0.0;
  return 1;
}

/* ----------------------------------------------------------------------------------------------
 * sensors */

/* writes the reading of one foot: delayed, zero (dead sensor) or the last one (stuck sensor) */
static void show_foot(const hxMasterSensor *sensor, int fault, size_t moment, const double *delayed,
                      double *reading) {
  const size_t size = sensor->forces / sensor->feet * sizeof *reading;
  if (fault == HX_FAULT_DEAD)
    memset(reading, 0, size);
  else if (fault != HX_FAULT_STUCK || moment == 0)
    memcpy(reading, delayed, size);
}

/* calculates the readings after `moment` macro-steps from the true forces */
static void read_sensor(const hxMasterSensor *sensor, size_t moment, double *value) {
  const size_t n = sensor->forces, each = n / sensor->feet, slots = sensor->delay + 1;
  double *newest = sensor->memory + moment % slots * n;
  const double *oldest = sensor->memory + (moment + 1) % slots * n;
  for (size_t i = 0; i < n; ++i) newest[i] = value[sensor->place + i];
  if (sensor->factor)
    for (size_t i = 0; i < n; ++i) newest[i] *= sensor->factor[moment * n + i];
  /* until there are readings as old as the delay, the first one is used */
  for (size_t slot = 1; slot < slots && moment == 0; ++slot)
    memcpy(sensor->memory + slot * n, newest, n * sizeof *newest);
  for (size_t foot = 0; foot < sensor->feet; ++foot) {
    const int fault = sensor->fault ? sensor->fault[moment * sensor->feet + foot] : HX_FAULT_NONE;
    show_foot(sensor, fault, moment, oldest + foot * each, value + sensor->reading + foot * each);
  }
}

/* ----------------------------------------------------------------------------------------------
 * macro-step */

static int read_plant(hxMaster *master, size_t moment) {
  const hxMasterFmu *plant = &master->plant;
  if (!get_reals(master, plant, &master->plant_output, HX_CALL_PLANT_GET)) return 0;
  if (!get_flags(master, plant, &master->plant_flag, HX_CALL_PLANT_GET)) return 0;
  if (master->sensor.memory) read_sensor(&master->sensor, moment, master->value);
  return 1;
}

/* collects the controller's inputs: the command and the measurements */
static void sense(const hxMaster *master, double *input) {
  memcpy(input, master->command + master->step * master->command_count,
         master->command_count * sizeof *input);
  input += master->command_count;
  for (size_t i = 0; i < master->sensed_count; ++i) input[i] = master->value[master->sensed[i]];
}

/* reads the joint commands for the macro-step and steps the controller */
static int control(hxMaster *master) {
  const hxMasterFmu *controller = &master->controller;
  const size_t inputs = master->command_count + master->sensed_count;
  sense(master, master->controller_value);
  return accept(master, HX_CALL_CONTROLLER_SET,
                controller->set_real(controller->instance, master->controller_input, inputs,
                                     master->controller_value)) &&
         get_reals(master, controller, &master->controller_output, HX_CALL_CONTROLLER_GET) &&
         get_flags(master, controller, &master->controller_flag, HX_CALL_CONTROLLER_GET) &&
         accept(master, HX_CALL_CONTROLLER_STEP,
                controller->do_step(controller->instance, master->time[master->step], master->h,
                                    fmi2True));
}

static int write_plant(hxMaster *master) {
  const hxMasterBlock *input = &master->plant_input;
  return accept(master, HX_CALL_PLANT_SET,
                master->plant.set_real(master->plant.instance, input->reference, input->count,
                                       master->value + input->place));
}

static int step_plant(hxMaster *master) {
  return accept(master, HX_CALL_PLANT_STEP,
                master->plant.do_step(master->plant.instance, master->time[master->step], master->h,
                                      fmi2True));
}

/* writes the waiting rows; one by one, each of their numbers would be in a page of its own */
static void write_waiting(hxMasterTable *table) {
  for (size_t j = 0; table->first && j < table->columns; ++j) {
    double *to = table->first + j * table->stride + table->rows;
    for (size_t i = 0; i < table->waiting; ++i) to[i] = table->block[i * table->columns + j];
  }
  table->rows += table->waiting;
  table->waiting = 0;
}

static void write_row(hxMasterTable *table, const double *value) {
  if (!table->first) return;
  double *row = table->block + table->waiting * table->columns;
  for (size_t j = 0; j < table->columns; ++j) row[j] = value[table->column[j]];
  if (++table->waiting == HX_MASTER_BLOCK) write_waiting(table);
}

/* updates the largest value of each peak since the last recorded row */
static void fold_peaks(hxMasterPeaks *peaks, const double *value) {
  const size_t first = peaks->places - peaks->counts;
  for (size_t i = 0; i < peaks->places; ++i) {
    const double now = value[peaks->place[i]];
    int fresh = 0;
    if (i >= first) {
      const size_t k = i - first;
      const double count = value[peaks->count[k]];
      fresh = count != peaks->seen[k] && peaks->seen[k] == peaks->kept[k];
      peaks->seen[k] = count;
    }
    if (fresh || now > peaks->largest[i]) peaks->largest[i] = now;
  }
}

/* writes the largest values to the row of values and resets them */
static void show_peaks(hxMasterPeaks *peaks, double *value) {
  for (size_t i = 0; i < peaks->places; ++i) value[peaks->place[i]] = peaks->largest[i];
  memset(peaks->largest, 0, peaks->places * sizeof *peaks->largest);
  memcpy(peaks->kept, peaks->seen, peaks->counts * sizeof *peaks->kept);
}

/* records the present values in `judged`, and in `kept` when a row is due */
static void record(hxMaster *master, int due) {
  write_row(&master->judged, master->value);
  if (master->every > 1) fold_peaks(&master->peaks, master->value);
  if (!due) return;
  if (master->every > 1) show_peaks(&master->peaks, master->value);
  write_row(&master->kept, master->value);
}

static void write_tables(hxMaster *master) {
  write_waiting(&master->judged);
  write_waiting(&master->kept);
}

void hx_master_record(hxMaster *master) {
  record(master, 1);
  write_tables(master);
}

static int macro_step(hxMaster *master) {
  if (master->push)
    memcpy(master->value + master->push_place, master->push + master->step * master->push_count,
           master->push_count * sizeof(double));
  if (!control(master) || !write_plant(master)) return 0;
  record(master, master->step % master->every == 0);
  if (!step_plant(master)) return 0;
  ++master->step;
  return read_plant(master, master->step);
}

/* ----------------------------------------------------------------------------------------------
 * runs */

int hx_master_layout(void) { return HX_MASTER_LAYOUT; }

size_t hx_master_size(void) { return sizeof(hxMaster); }

int hx_master_begin(hxMaster *master) {
  master->step = master->kept.rows = master->judged.rows = 0;
  master->kept.waiting = master->judged.waiting = 0;
  memset(master->peaks.largest, 0, master->peaks.places * sizeof *master->peaks.largest);
  memset(master->peaks.seen, 0, master->peaks.counts * sizeof *master->peaks.seen);
  memset(master->peaks.kept, 0, master->peaks.counts * sizeof *master->peaks.kept);
  master->call = HX_CALL_NONE;
  master->status = fmi2OK;
  return read_plant(master, 0);
}

int hx_master_run(hxMaster *master, size_t end) {
  int going = 1;
  while (going && master->step < end) going = macro_step(master);
  write_tables(master);
  return going;
}
