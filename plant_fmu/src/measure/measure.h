/* measure.h - measurements of a step: works and losses of joints and contacts; slip, impulses and
 * peaks of feet
 *
 * Works and losses are the impulses of the step's forces times the mean of the speeds at its ends
 * (eq. 27), so that they equal the change of kinetic energy. Other integrals follow the step's
 * path between its ends (hxMoment, eq. 28): angles and depths are cubics through values and rates,
 * sliding velocities are parabolas through values and mean. The loading rate of a landing is taken
 * over a millisecond (eq. 29), because the force's derivative jumps with every command. The
 * results do not depend on how often outputs are read.
 */
#ifndef HX_MEASURE_H
#define HX_MEASURE_H

#include "foot_measure.h"
#include "joint_measure.h"

/* Returns whether a row of feet has a closed contact. */
static inline int is_row_used(const hxContactState *contact, int row) {
  int used = 0;
  for (int pack = 0; pack < HX_PACKS; ++pack) used |= is_used(contact, row, pack * HX_LANES);
  return used;
}

/* Adds the measurements of a step. */
static inline void hx_measure_path(const hxPath *path, const hxImpulses *impulse,
                                   const hxStepWorks *works, hxMeasured *measured) {
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    hxReal squared[HX_JOINTS];
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      squared[joint] = measure_joint(path, joint, pack * HX_LANES, works->motor[joint][pack],
                                     works->mean_torque[joint][pack], measured);
    if (path->model->heat.winding > 0.0) warm_servos(path, pack, impulse, squared, measured);
    measure_feet(path, pack * HX_LANES, measured);
  }
  for (int leg = 0; leg < HX_LEGS; ++leg) measure_landing(path, leg, measured);
  for (int k = 0; k < path->model->foot_rows; ++k)
    if (k == 0 || is_row_used(path->contact, path->model->row[k]))
      measure_cone(path, path->model->row[k], impulse, measured);
  measured->contact_loss += hx_lane(hx_sum_legs(works->contact), 0) + works->torso_contact;
  measured->friction_loss += hx_lane(hx_sum_legs(works->friction), 0) + works->torso_friction;
  measured->gear_loss += hx_lane(hx_sum_legs(works->gear), 0);
}

#endif
