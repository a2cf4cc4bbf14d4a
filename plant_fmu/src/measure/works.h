/* works.h - works and losses of a step (eq. 27)
 *
 * They are the impulses of the step's forces times the mean of the speeds at its ends, so that they
 * equal the change of kinetic energy. */
#ifndef HX_WORKS_H
#define HX_WORKS_H

#include "step_path.h"

/* Works and losses of a step, J, legs in lanes. */
typedef struct {
  hxReal motor[HX_JOINTS][HX_PACKS];
  hxReal mean_torque[HX_JOINTS][HX_PACKS];                      /* N m  of the motors */
  hxReal contact[HX_PACKS], friction[HX_PACKS], gear[HX_PACKS]; /* of all rows on the tibias */
  hxNumber torso_contact, torso_friction;
} hxStepWorks;

static inline hxVec3 mean_vec3(const double (*from)[HX_SLOTS], const double (*to)[HX_SLOTS],
                               int slot) {
  return hx_scale(hx_splat(0.5), hx_add3(hx_load_vec3(from, slot), hx_load_vec3(to, slot)));
}

/* Returns whether the feet of a step's path share forces among their rows. */
static inline int has_shares(const hxPath *path, int row) {
  return path->model->foot_rows > 1 && hx_is_of_foot(row);
}

/* Returns the elastic energy 2/5 K delta^(5/2) of closed contacts, J. */
static inline hxReal stored_in_contact(hxContactLawAt law, const double *delta) {
  const hxReal depth = hx_max(hx_load(delta), hx_splat(0.0));
  return law.closed * (0.4 * law.stiffness) * (depth * depth) * hx_sqrt(depth);
}

/* Returns the approach velocity ddelta n. */
static inline hxVec3 approach_of(const hxContactMoment *moment, int slot) {
  return hx_scale(hx_load(&moment->ddelta[slot]),
                  hx_load_vec3((const double (*)[HX_SLOTS])moment->normal, slot));
}

/* Returns the growth of the energy stored under feet, in soil where they touched down on it, J. */
HX_RARE hxReal growth_with_soil(const hxPath *path, int slot, hxReal rigid) {
  const hxContactState *state = path->contact;
  const hxMask in = hx_in_soil(state, slot);
  if (!hx_any(in)) return rigid;
  const hxSoils soil = hx_soils_under(state, slot);
  const int pack = slot / HX_LANES;
  const hxReal before = hx_stored_energy(&soil, hx_load(&state->plastic[slot]),
                                         hx_load(&path->from->contact[HX_FOOT].delta[slot]),
                                         path->ends->from[pack]),
               after = hx_stored_energy(&soil, hx_load(&path->plastic[slot]),
                                        hx_load(&path->to->contact[HX_FOOT].delta[slot]),
                                        path->ends->to[pack]);
  return hx_select(in, after - before, rigid);
}

/* Computes what a row of contacts and its friction lose in a step with these impulses (eq. 27). */
HX_INLINE void contact_works(const hxPath *path, int row, int slot, hxVec3 impulse, hxReal *contact,
                             hxReal *friction) {
  const hxContactMoment *from = &path->from->contact[row], *to = &path->to->contact[row];
  const hxContactLawAt law = hx_law_at(path->contact, row, slot);
  const hxVec3 slip = mean_vec3(from->slip, to->slip, slot);
  const hxVec3 approach =
      hx_scale(hx_splat(0.5), hx_add3(approach_of(from, slot), approach_of(to, slot)));
  const hxReal taken = hx_dot(impulse, approach);
  hxReal before = stored_in_contact(law, &from->delta[slot]),
         after = stored_in_contact(law, &to->delta[slot]);
  if (has_shares(path, row)) {
    before *= hx_load(&path->from->share[row][slot]);
    after *= hx_load(&path->to->share[row][slot]);
  }
  hxReal stored = after - before;
  if (has_soil(path->model, row)) stored = growth_with_soil(path, slot, stored);
  *contact = taken - stored;
  *friction = -hx_dot(impulse, slip);
}

HX_RARE void add_further_works(const hxPath *path, int pack, const hxImpulses *impulse,
                               hxStepWorks *works) {
  for (int k = 1; k < path->model->rows; ++k) {
    const int row = path->model->row[k];
    hxReal contact, friction;
    if (!is_used(path->contact, row, pack * HX_LANES)) continue;
    contact_works(path, row, pack * HX_LANES, impulse->contact[row][pack], &contact, &friction);
    works->contact[pack] += contact, works->friction[pack] += friction;
  }
}

/* Sums the losses of the torso's contacts. */
HX_RARE void torso_works(const hxPath *path, const hxImpulses *impulse, hxStepWorks *works) {
  hxReal contact[HX_TORSO_PACKS], friction[HX_TORSO_PACKS];
  for (int pack = 0; pack < HX_TORSO_PACKS; ++pack)
    contact_works(path, HX_TORSO, pack * HX_LANES, impulse->torso[pack], &contact[pack],
                  &friction[pack]);
  works->torso_contact = hx_sum_slots(contact);
  works->torso_friction = hx_sum_slots(friction);
}

/* Adds the losses of contacts between legs. */
HX_RARE void add_pair_works(const hxPath *path, const hxImpulses *impulse, hxStepWorks *works) {
  for (int row = HX_PAIR; row < HX_ROWS; ++row)
    for (int pack = 0; pack < HX_PACKS; ++pack) {
      hxReal contact, friction;
      contact_works(path, row, pack * HX_LANES, impulse->pair[row - HX_PAIR][pack], &contact,
                    &friction);
      works->contact[pack] += contact, works->friction[pack] += friction;
    }
}

/* Returns the mean of a joint's speeds at both ends, rad/s. */
static inline hxReal mean_speed(const hxPath *path, int joint, int slot) {
  return 0.5 * (hx_load(&path->from->speed[joint][slot]) + hx_load(&path->to->speed[joint][slot]));
}

/* Adds what the stops of a pack of legs lose in a step: their work on the joints less what they
 * store. */
HX_RARE void add_stop_works(const hxPath *path, const hxImpulses *impulse, int pack,
                            hxStepWorks *works) {
  const int slot = pack * HX_LANES;
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    const hxReal speed = mean_speed(path, joint, slot);
    const hxReal before = hx_load(&path->from->angle[joint][slot]),
                 after = hx_load(&path->to->angle[joint][slot]);
    const hxReal stored = hx_stop_energy(path->model, joint, slot, after) -
                          hx_stop_energy(path->model, joint, slot, before);
    works->gear[pack] -= impulse->stop[joint][pack] * speed + stored;
  }
}

/* Adds what spin and rolling friction of a pack of feet lose in a step. */
HX_RARE void add_turning_works(const hxPath *path, const hxImpulses *impulse, int pack,
                               hxStepWorks *works) {
  const hxVec3 w = mean_vec3(path->from->w, path->to->w, pack * HX_LANES);
  for (int k = 0; k < path->model->foot_rows; ++k)
    works->friction[pack] -= hx_dot(impulse->moment[path->model->row[k]][pack], w);
}

/* Computes works and losses of a step from its impulses (eq. 27). */
static inline void hx_step_works(const hxPath *path, const hxImpulses *impulse,
                                 hxStepWorks *works) {
  const hxReal per_step = hx_splat(1.0 / path->h);
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const int slot = pack * HX_LANES;
    works->gear[pack] = hx_splat(0.0);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxReal speed = mean_speed(path, joint, slot);
      works->motor[joint][pack] = impulse->motor[joint][pack] * speed;
      works->mean_torque[joint][pack] = impulse->motor[joint][pack] * per_step;
      works->gear[pack] -= impulse->gear[joint][pack] * speed;
    }
    contact_works(path, HX_FOOT, slot, impulse->contact[HX_FOOT][pack], &works->contact[pack],
                  &works->friction[pack]);
    if (path->model->rows > 1) add_further_works(path, pack, impulse, works);
    if (path->model->stops) add_stop_works(path, impulse, pack, works);
    if (has_turning_friction(path->model, HX_FOOT)) add_turning_works(path, impulse, pack, works);
  }
  works->torso_contact = works->torso_friction = 0.0;
  if (path->model->torso_rows) torso_works(path, impulse, works);
  if (path->model->pair_rows) add_pair_works(path, impulse, works);
}

#endif
