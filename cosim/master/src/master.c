/* master.c - the co-simulation loop of a plant FMU and a controller FMU. */
#include "hexapod/master.h"

#include <string.h>

/* keeps the plant's joint commands where new ones are lost */
static void adjust(void *owner) {
  hxMaster *master = owner;
  double *drive = master->stepper.value + master->drive_place;
  const size_t bytes = master->drive_count * sizeof *drive;
  if (master->lost && master->lost[master->step]) memcpy(drive, master->drive, bytes);
  memcpy(master->drive, drive, bytes);
}

static void record(void *owner) {
  hxMaster *master = owner;
  for (size_t j = 0; j < master->columns; ++j)
    master->record[j] = master->stepper.value[master->column[j]];
  master->record += master->columns;
  ++master->recorded;
}

static void read_sensors(const hxMaster *master) {
  double *value = master->stepper.value;
  hx_sensors_read(&master->feet, master->step, value);
  hx_sensors_read(&master->joints, master->step, value);
  hx_sensors_read(&master->torso, master->step, value);
}

/* sets the parameters that change before this macro-step */
static int tune(hxMaster *master) {
  const hxStepFmu *plant = &master->stepper.plant;
  for (; master->tuned < master->tunings; ++master->tuned) {
    const hxTuning *next = master->tuning + master->tuned;
    if (next->step > master->step) break;
    master->stepper.status = plant->set_reals(plant->instance, &next->reference, 1, &next->value);
    if (master->stepper.status <= 1) continue;
    master->stepper.call = HX_CALL_PLANT_SET;
    return 0;
  }
  return 1;
}

static int macro_step(hxMaster *master) {
  hxStepper *stepper = &master->stepper;
  const size_t k = master->step;
  if (master->push)
    memcpy(stepper->value + master->push_place, master->push + k * master->push_count,
           master->push_count * sizeof *master->push);
  if (master->tuning && !tune(master)) return 0;
  read_sensors(master);
  if (!hx_macro_step(stepper, master->time[k], master->command + k * stepper->command_count, adjust,
                     record, master))
    return 0;
  ++master->step;
  return 1;
}

int hx_master_layout(void) { return HX_MASTER_LAYOUT; }

size_t hx_master_size(void) { return sizeof(hxMaster); }

int hx_master_begin(hxMaster *master) {
  master->step = master->recorded = master->tuned = 0;
  master->stepper.call = HX_CALL_NONE;
  master->stepper.status = 0;
  return hx_read_plant(&master->stepper);
}

int hx_master_run(hxMaster *master, size_t end) {
  int going = 1;
  while (going && master->step < end) going = macro_step(master);
  return going;
}

void hx_master_record(hxMaster *master) { record(master); }
