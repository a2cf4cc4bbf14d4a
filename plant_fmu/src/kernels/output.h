/* output.h - outputs of the plant, from an evaluation with multipliers */
#ifndef HX_OUTPUT_H
#define HX_OUTPUT_H

#include "../lanes/clearance.h"
#include "../lanes/dynamics.h"
#ifndef HX_TANGENT
#include "../measure/measure.h"
#endif

/* Copies one lane of a vector. */
static void get3(hxVec3 a, int lane, hxNumber out[3]) {
  out[0] = hx_lane(a.x, lane);
  out[1] = hx_lane(a.y, lane);
  out[2] = hx_lane(a.z, lane);
}

/* Returns the pack that holds a leg, and its lane. */
static const hxLegWork *leg_work(const hxWork *work, int leg, int *lane) {
  *lane = leg % HX_LANES;
  return &work->pack[leg / HX_LANES];
}

/* Returns the kinetic energy of a body, J. */
static hxReal body_kinetic(hxReal mass, hxSym3 J, hxVec3 v, hxVec3 w) {
  return 0.5 * (mass * hx_dot(v, v) + hx_dot(w, hx_sym_mul(J, w)));
}

/* Returns the part of the kinetic energy by which the rotors of a leg turn with the bodies that
 * carry them, h s.w_i (eq. 54), J. */
static hxReal spin_energy(const hxModel *model, const hxBody *torso, const hxLegWork *leg) {
  hxReal energy = hx_splat(0.0);
  for (int joint = 0; joint < HX_JOINTS; ++joint) {
    const hxVec3 w = joint > 0 ? leg->joint[joint - 1].body.w : torso->w;
    energy +=
        model->spin_inertia * leg->joint[joint].speed * hx_dot(leg->joint[joint].sweep.S.ang, w);
  }
  return energy;
}

/* Returns the kinetic energy of bodies and rotors, J. */
static hxNumber hx_kinetic_energy(const hxModel *model, const hxPlantMotion *motion,
                                  const hxWork *work) {
  const hxReal torso = body_kinetic(hx_splat(model->torso_mass), work->torso_J,
                                    hx_torso_vec3(motion, HX_V), work->torso.w);
  hxReal legs[HX_PACKS];
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    legs[pack] = hx_splat(0.0);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxJointWork *k = &work->pack[pack].joint[joint];
      const int slot = pack * HX_LANES;
      const hxReal mass = hx_load(&model->joint[joint].mass[slot]);
      const hxReal rotor = (0.5 * model->rotor_inertia) * k->speed * k->speed;
      legs[pack] +=
          body_kinetic(mass, k->J, hx_link_vec3(motion, joint, HX_V, slot), k->body.w) + rotor;
    }
    if (model->spin) legs[pack] += spin_energy(model, &work->torso, &work->pack[pack]);
  }
  return hx_lane(torso + hx_sum_legs(legs), 0);
}

/* Returns the energy that a row of contacts with the ground gives back, J. */
static hxReal ground_energy(const hxModel *model, int row, const hxContactWork *contact) {
  return has_soil(model, row) ? contact->stored : elastic_energy(contact);
}

static hxNumber torso_elastic_energy(const hxModel *model, const hxWork *work) {
  hxReal energy[HX_TORSO_PACKS];
  for (int pack = 0; pack < HX_TORSO_PACKS; ++pack)
    energy[pack] = ground_energy(model, HX_TORSO, &work->torso_contact[pack]);
  return hx_sum_slots(energy);
}

/* Returns the elastic energy of contacts between legs, J. */
static hxNumber pair_elastic_energy(const hxWork *work) {
  hxReal energy[HX_PACKS];
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    energy[pack] = elastic_energy(&work->pair[0][pack]);
    for (int pair = 1; pair < HX_PAIR_ROWS; ++pair)
      energy[pack] += elastic_energy(&work->pair[pair][pack]);
  }
  return hx_lane(hx_sum_legs(energy), 0);
}

/* Returns the energy k x^2/2 that the stops of a leg store, J. */
static hxReal stop_energy(const hxModel *model, const hxLegWork *leg, int slot) {
  hxReal energy = hx_splat(0.0);
  for (int joint = 0; joint < HX_JOINTS; ++joint)
    energy += hx_stop_energy(model, joint, slot, leg->joint[joint].angle);
  return energy;
}

/* Returns the potential energy of gravity, contacts and stops, J. */
static hxNumber hx_potential_energy(const hxModel *model, const hxPlantMotion *motion,
                                    const hxWork *work) {
  const hxVec3 g = hx_splat_vec3(model->gravity);
  hxReal legs[HX_PACKS];
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    const hxContactWork *contact = work->pack[pack].contact;
    const int slot = pack * HX_LANES;
    legs[pack] = ground_energy(model, HX_FOOT, &contact[HX_FOOT]);
    for (int k = 1; k < model->rows; ++k)
      legs[pack] += ground_energy(model, model->row[k], &contact[model->row[k]]);
    if (model->stops) legs[pack] += stop_energy(model, &work->pack[pack], slot);
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      legs[pack] -= hx_load(&model->joint[joint].mass[slot]) *
                    hx_dot(g, hx_link_vec3(motion, joint, HX_R, slot));
  }
  hxNumber sum =
      hx_lane(hx_sum_legs(legs) - model->torso_mass * hx_dot(g, hx_torso_vec3(motion, HX_R)), 0);
  if (model->torso_rows) sum += torso_elastic_energy(model, work);
  return model->pair_rows ? sum + pair_elastic_energy(work) : sum;
}

/* Returns the share of a winding's rise over the air that is left up to temperature_max. */
static hxNumber remaining_rating(const hxHeat *heat, hxNumber winding) {
  const hxNumber left = (heat->max - winding) / (heat->max - heat->air);
  return hx_lane(hx_clip(hx_splat(left), hx_splat(0.0), hx_splat(1.0)), 0);
}

/* Fills the temperatures of a joint's servo. */
static void fill_heat(const hxModel *model, const hxState *state, int leg, int joint, hxOutput *o) {
  const hxNumber winding = state->measured.winding[joint][leg];
  o->winding_temperature[leg][joint] = winding;
  o->housing_temperature[leg][joint] = state->measured.housing[joint][leg];
  o->remaining_rating[leg][joint] = remaining_rating(&model->heat, winding);
}

/* Fills what a joint's force depends on, and the motor's torque. */
static void fill_joint(const hxJointWork *k, int lane, int leg, int joint, hxOutput *o) {
  o->angle[leg][joint] = hx_lane(k->angle, lane);
  o->speed[leg][joint] = hx_lane(k->speed, lane);
  o->torque[leg][joint] = hx_lane(k->servo.torque, lane);
}

/* Fills the other outputs of a joint's servo. */
static void fill_servo(const hxModel *model, const hxState *state, const hxJointWork *k, int lane,
                       int leg, int joint, hxOutput *o) {
  o->current[leg][joint] = hx_lane(hx_motor_current(model, k->servo.torque), lane);
  o->electrical_power[leg][joint] =
      hx_lane(hx_electrical_power(model, k->servo.torque, k->speed), lane);
  o->positive_work[leg][joint] = state->measured.positive_work[joint][leg];
  o->negative_work[leg][joint] = state->measured.negative_work[joint][leg];
  o->torque_squared[leg][joint] = state->measured.torque_squared[joint][leg];
  fill_heat(model, state, leg, joint, o);
}

/* Fills the reaction on a joint's child: the force -lambda and, about the joint's point, the torque
 * -(u1 lambda_4 + u2 lambda_5); the motor's torque is not included. */
static void fill_reaction(const hxJointWork *k, int lane, int leg, int joint, hxOutput *o) {
  const hxVec3 s = k->reaction.kin.s, u1 = hx_cross(k->body.R_WB.x, s),
               u2 = hx_cross(k->body.R_WB.y, s);
  const hxVec3 couple =
      hx_add_scaled(hx_scale(k->reaction.lambda[0], u1), k->reaction.lambda[1], u2);
  get3(hx_neg(k->reaction.lambda_lin), lane, o->reaction_force[leg][joint]);
  get3(hx_neg(couple), lane, o->reaction_torque[leg][joint]);
}

/* Returns the size of the tangential force, N. */
static hxNumber tangential_force(const hxModel *model, int row, const hxContactWork *foot,
                                 int lane) {
  if (model->has_soil) {
    const hxVec3 across = hx_sub3(foot->force, hx_scale(foot->normal.force, foot->kin.normal));
    return hx_lane(hx_sqrt(hx_dot(across, across)), lane);
  }
  const hxVec3 grip = foot->grip.traction;
  return hx_lane(has_bristles(model, row) ? foot->normal.force * hx_sqrt(hx_dot(grip, grip))
                                          : foot->drag * foot->slip_speed,
                 lane);
}

/* Returns the deeper row of a foot. */
static int deeper_row(const hxModel *model, const hxLegWork *leg, int lane) {
  int deepest = HX_FOOT;
  for (int k = 1; k < model->foot_rows; ++k) {
    const hxReal *delta = &leg->contact[model->row[k]].kin.delta;
    if (hx_re(hx_lane(*delta, lane)) > hx_re(hx_lane(leg->contact[deepest].kin.delta, lane)))
      deepest = model->row[k];
  }
  return deepest;
}

/* Adds the forces of a foot's further rows. */
static void add_foot_row(const hxModel *model, const hxState *state, const hxContactWork *foot,
                         int row, int lane, int leg, hxOutput *o) {
  hxNumber force[3];
  get3(foot->force, lane, force);
  for (int i = 0; i < 3; ++i) o->foot.force[leg][i] += force[i];
  o->foot.normal_force[leg] += hx_lane(foot->normal.force, lane);
  o->foot.tangential_force[leg] += tangential_force(model, row, foot, lane);
  o->foot.contact[leg] |= state->contact.closed[row][leg] != 0.0;
}

/* Fills a foot's outputs: forces are sums over its rows, the point is that of its deeper row. */
static void fill_foot(const hxModel *model, const hxState *state, const hxLegWork *work,
                      hxVec3 tibia, int lane, int leg, hxOutput *o) {
  const hxContactWork *foot = &work->contact[HX_FOOT];
  const int row = deeper_row(model, work, lane);
  const hxContactWork *deeper = &work->contact[row];
  get3(foot->force, lane, o->foot.force[leg]);
  get3(hx_add3(tibia, deeper->kin.arm), lane, o->foot.position[leg]);
  get3(deeper->kin.velocity, lane, o->foot.velocity[leg]);
  o->foot.normal_force[leg] = hx_lane(foot->normal.force, lane);
  o->foot.tangential_force[leg] = tangential_force(model, HX_FOOT, foot, lane);
  o->foot.slip_speed[leg] = hx_lane(deeper->slip_speed, lane);
  o->foot.penetration[leg] = hx_lane(deeper->kin.delta, lane);
  o->foot.impact_speed[leg] = state->contact.impact_speed[row][leg];
  for (int i = 0; i < 3; ++i) o->foot.bristle[leg][i] = state->motion.bristle[i][leg];
  o->foot.slip_distance[leg] = state->measured.slip_distance[leg];
  o->foot.impulse[leg] = state->measured.impulse[leg];
  o->foot.peak_force[leg] = state->measured.peak_force[leg];
  o->foot.peak_force_rate[leg] = state->measured.peak_rate[leg];
  o->foot.landing_rate[leg] = state->measured.landing_rate[leg];
  o->foot.landings[leg] = state->measured.landings[leg];
  o->foot.sinkage[leg] = state->contact.plastic[leg];
  o->foot.contact[leg] = state->contact.closed[HX_FOOT][leg] != 0.0;
  for (int k = 1; k < model->foot_rows; ++k)
    add_foot_row(model, state, &work->contact[model->row[k]], model->row[k], lane, leg, o);
}

/* Fills the force of the ground on a sphere of the tibia; 0 where the model has no such row. */
static void fill_body_row(const hxModel *model, const hxLegWork *work, int row, int lane,
                          hxNumber force[3]) {
  for (int i = 0; i < 3; ++i) force[i] = 0.0;
  for (int k = model->foot_rows; k < model->rows; ++k)
    if (model->row[k] == row) get3(work->contact[row].force, lane, force);
}

/* Fills the force of neighbouring legs on femur and tibia. */
static void fill_neighbour_force(const hxModel *model, const hxLegWork *work, int lane,
                                 hxNumber force[3]) {
  for (int i = 0; i < 3; ++i) force[i] = 0.0;
  if (model->pair_rows) get3(hx_add3(work->by_legs[0].lin, work->by_legs[1].lin), lane, force);
}

/* Fills the sum of the ground's forces on the torso's corners. */
static void fill_torso_contact(const hxModel *model, const hxWork *work, hxNumber force[3]) {
  hxReal x[HX_TORSO_PACKS], y[HX_TORSO_PACKS], z[HX_TORSO_PACKS];
  for (int i = 0; i < 3; ++i) force[i] = 0.0;
  if (!model->torso_rows) return;
  for (int pack = 0; pack < HX_TORSO_PACKS; ++pack) {
    const hxVec3 f = work->torso_contact[pack].force;
    x[pack] = f.x, y[pack] = f.y, z[pack] = f.z;
  }
  force[0] = hx_sum_slots(x), force[1] = hx_sum_slots(y), force[2] = hx_sum_slots(z);
}

/* Returns the penetration of a row of the tibia; -1 where the model has no such row. */
static hxNumber depth_of_row(const hxModel *model, const hxLegWork *work, int row, int lane) {
  for (int k = model->foot_rows; k < model->rows; ++k)
    if (model->row[k] == row) return hx_lane(work->contact[row].kin.delta, lane);
  return -1.0;
}

/* Fills the penetrations of all contacts. */
static void fill_depths(const hxModel *model, const hxWork *work, hxIndicators *depth) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    int lane;
    const hxLegWork *w = leg_work(work, leg, &lane);
    depth->foot[leg] = hx_lane(w->contact[HX_FOOT].kin.delta, lane);
    depth->knee[leg] = depth_of_row(model, w, HX_KNEE, lane);
    depth->shank[leg] = depth_of_row(model, w, HX_SHANK, lane);
    for (int pair = 0; pair < HX_PAIR_ROWS; ++pair) {
      depth->neighbour[leg][pair] = -1.0;
      if (model->pair_rows)
        depth->neighbour[leg][pair] = hx_lane(work->pair[pair][leg / HX_LANES].kin.delta, lane);
    }
  }
  for (int slot = 0; slot < HX_CORNERS; ++slot) {
    depth->torso[slot] = -1.0;
    if (model->torso_rows)
      depth->torso[slot] = hx_lane(work->torso_contact[slot / HX_LANES].kin.delta, slot % HX_LANES);
  }
}

/* Fills the motion of the torso. */
static void fill_torso(const hxPlantMotion *motion, const hxWork *work, hxOutput *o) {
  const hxNumber *m = motion->torso;
  const hxMat3 R_WT = work->torso.R_WB;
  hxNumber x[3], y[3], z[3]; /* its columns */
  get3(R_WT.x, 0, x), get3(R_WT.y, 0, y), get3(R_WT.z, 0, z);
  for (int i = 0; i < 3; ++i) {
    o->torso.position[i] = m[HX_R + i];
    o->torso.velocity[i] = m[HX_V + i];
    o->torso.angular_velocity[i] = m[HX_W + i];
  }
  for (int i = 0; i < 4; ++i) o->torso.quaternion[i] = m[HX_P + i];
  o->torso.roll = hx_atan2(y[2], z[2]);
  o->torso.pitch = hx_asin(-x[2]);
  o->torso.yaw = hx_atan2(x[1], x[0]);
  get3(hx_tmul(R_WT, work->torso.w), 0, o->imu.angular_velocity);
}

/* Fills the norms of Phi and dPhi/dt over all joints. */
static void fill_constraint(const hxModel *model, const hxPlantMotion *motion, hxOutput *o) {
  hxReal position[HX_PACKS], velocity[HX_PACKS];
  for (int pack = 0; pack < HX_PACKS; ++pack) {
    position[pack] = velocity[pack] = hx_splat(0.0);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxConstraint c = hx_joint_constraint(model, motion, joint, pack * HX_LANES);
      position[pack] += hx_dot(c.phi_lin, c.phi_lin) + c.phi[0] * c.phi[0] + c.phi[1] * c.phi[1];
      velocity[pack] +=
          hx_dot(c.dphi_lin, c.dphi_lin) + c.dphi[0] * c.dphi[0] + c.dphi[1] * c.dphi[1];
    }
  }
  o->constraint.position_error = hx_lane(hx_sqrt(hx_sum_legs(position)), 0);
  o->constraint.velocity_error = hx_lane(hx_sqrt(hx_sum_legs(velocity)), 0);
}

/* Fills the energies and the audit's error (eq. 26). */
static void fill_energy(const hxModel *model, const hxState *state, const hxWork *work,
                        hxOutput *o) {
  const hxPlantMotion *m = &state->motion;
  o->energy.kinetic = hx_kinetic_energy(model, m, work);
  o->energy.potential = hx_potential_energy(model, m, work);
  o->energy.actuator_work = m->actuator_work;
  o->energy.push_work = m->push_work;
  o->energy.dissipated = m->dissipated;
  o->energy.contact_loss = state->measured.contact_loss;
  o->energy.friction_loss = state->measured.friction_loss;
  o->energy.gear_loss = state->measured.gear_loss;
  o->energy.parameter_work = state->parameter_work;
  o->energy.residual = o->energy.kinetic + o->energy.potential - state->stored_at_start -
                       m->actuator_work - m->push_work + m->dissipated - state->parameter_work;
}

/* Fills the outputs of all joints that belong to the groups. */
static void fill_joints(const hxModel *model, const hxState *state, const hxWork *work,
                        unsigned groups, hxOutput *o) {
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      int lane;
      const hxJointWork *k = &leg_work(work, leg, &lane)->joint[joint];
      if (groups & HX_OUTPUT_FORCES) fill_joint(k, lane, leg, joint, o);
      if (groups & HX_OUTPUT_SERVOS) fill_servo(model, state, k, lane, leg, joint, o);
      if (groups & HX_OUTPUT_REACTIONS) fill_reaction(k, lane, leg, joint, o);
    }
}

/* Fills the forces on feet, legs and torso. */
static void fill_forces(const hxModel *model, const hxState *state, const hxWork *work,
                        hxOutput *o) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    int lane;
    const hxLegWork *w = leg_work(work, leg, &lane);
    const hxVec3 tibia = hx_link_vec3(&state->motion, HX_JOINTS - 1, HX_R, leg - lane);
    fill_foot(model, state, w, tibia, lane, leg, o);
    fill_body_row(model, w, HX_KNEE, lane, o->body.knee_force[leg]);
    fill_body_row(model, w, HX_SHANK, lane, o->body.shank_force[leg]);
    fill_neighbour_force(model, w, lane, o->body.neighbour_force[leg]);
  }
  fill_torso_contact(model, work, o->torso.contact_force);
}

/* Fills what needs no forces. */
static void fill_motion(const hxState *state, const hxWork *work, hxOutput *o) {
  o->time = state->time;
  fill_torso(&state->motion, work, o);
  /* hx_plant_output_groups() sets both afterwards: they are not in the state */
  o->supply_voltage = o->footprints = 0.0;
  for (int i = 0; i < HX_CONE_BINS; ++i) o->cone_time[i] = state->measured.cone_time[i];
  o->solver.evaluations = state->evaluations;
  o->solver.steps = state->steps;
  o->solver.rejected = state->rejected;
  o->solver.touchdowns = state->touchdowns;
}

/* Fills groups of outputs, hxOutputGroup. */
static void hx_output_fill(const hxModel *model, const hxState *state, const hxWork *work,
                           unsigned groups, hxOutput *o) {
  if (groups & HX_OUTPUT_MOTION) fill_motion(state, work, o);
  fill_joints(model, state, work, groups, o);
  if (groups & HX_OUTPUT_FORCES) fill_forces(model, state, work, o);
  if (groups & HX_OUTPUT_REACTIONS)
    get3(hx_tmul(work->torso.R_WB, work->torso_acceleration.lin), 0, o->imu.specific_force);
  if (groups & HX_OUTPUT_DISTANCES) {
    hx_clearances(model, &state->motion, work, o->body.clearance);
    fill_depths(model, work, &o->depth);
  }
  if (groups & HX_OUTPUT_AUDIT) {
    fill_energy(model, state, work, o);
    fill_constraint(model, &state->motion, o);
  }
}

#ifndef HX_TANGENT /* measurements are not functions of state and input, so they have no           \
                      derivative */
static int cone_bin(double share) {
  const double place = hx_lane(hx_cone_place(hx_splat(share)), 0);
  return (int)place;
}

/* Returns the largest friction or shear force of a row under its normal force, N. */
static double cone_limit(const hxModel *model, const hxContactState *state,
                         const hxContactWork *foot, int row, int leg, int lane) {
  const double force = hx_lane(foot->normal.force, lane);
  if (!has_soil(model, row) || !is_in_soil(state, leg)) return state->mu[row][leg] * force;
  const hxSoil soil = hx_soil_under(state, leg);
  return soil.friction * force + hx_lane(foot->hold, lane) / soil.per_displacement;
}

/* Fills the rates of a foot's integrals. */
static void fill_foot_rates(const hxModel *model, const hxContactState *state,
                            const hxLegWork *work, int lane, int leg, hxOutput *rate) {
  double sum = 0.0;
  for (int k = 0; k < model->foot_rows; ++k) {
    const hxContactWork *foot = &work->contact[model->row[k]];
    const double force = hx_lane(foot->normal.force, lane),
                 across = tangential_force(model, model->row[k], foot, lane);
    sum += force;
    if (force > model->load_threshold && hx_has_cone(model))
      rate->cone_time[cone_bin(
          across / fmax(cone_limit(model, state, foot, model->row[k], leg, lane), 1e-300))] += 1.0;
  }
  const hxContactWork *deeper = &work->contact[deeper_row(model, work, lane)];
  rate->foot.impulse[leg] = sum;
  rate->foot.slip_distance[leg] =
      sum > model->load_threshold ? hx_lane(deeper->slip_speed, lane) : 0.0;
}

/* Fills the rates of the integrals since the start; rates of peaks are 0. */
static void hx_integral_rates_fill(const hxModel *model, const hxContactState *state,
                                   const hxWork *work, hxOutput *rate) {
  const hxLossPowers losses = hx_loss_powers(model, work);
  rate->energy.contact_loss = losses.contact;
  rate->energy.friction_loss = losses.friction;
  rate->energy.gear_loss = losses.gear;
  memset(rate->cone_time, 0, sizeof rate->cone_time);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    int lane;
    const hxLegWork *w = leg_work(work, leg, &lane);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double torque = hx_lane(w->joint[joint].servo.torque, lane),
                   power = torque * hx_lane(w->joint[joint].speed, lane);
      rate->positive_work[leg][joint] = fmax(power, 0.0);
      rate->negative_work[leg][joint] = fmax(-power, 0.0);
      rate->torque_squared[leg][joint] = torque * torque;
    }
    fill_foot_rates(model, state, w, lane, leg, rate);
    rate->foot.peak_force[leg] = rate->foot.peak_force_rate[leg] = rate->foot.landing_rate[leg] =
        rate->foot.landings[leg] = 0.0;
  }
}
#endif

/* Fills accelerations (linear, then angular), multipliers and motor torques, in the order of
 * hexapod.h's bodies. */
static inline void hx_accelerations_fill(const hxWork *work, const hxPlantMotion *rate,
                                         hxNumber acceleration[HX_BODIES][6],
                                         hxNumber multiplier[HX_BODIES - 1][HX_MULTIPLIERS],
                                         hxNumber drive_torque[HX_BODIES - 1]) {
  for (int i = 0; i < 6; ++i) acceleration[0][i] = rate->torso[HX_V + i];
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    int lane;
    const hxLegWork *w = leg_work(work, leg, &lane);
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const hxJointWork *k = &w->joint[joint];
      const int row = HX_JOINTS * leg + joint;
      for (int i = 0; i < 6; ++i) acceleration[1 + row][i] = rate->link[joint][HX_V + i][leg];
      get3(k->reaction.lambda_lin, lane, multiplier[row]);
      for (int i = 0; i < 2; ++i) multiplier[row][3 + i] = hx_lane(k->reaction.lambda[i], lane);
      drive_torque[row] = hx_lane(k->servo.torque, lane);
    }
  }
}

#endif
