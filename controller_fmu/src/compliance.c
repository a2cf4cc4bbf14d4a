#include "compliance.h"

#include <string.h>

static const double load_floor = 1e-6; /* N  below it no foot carries anything */
static const double sliding_drag = 0.55; /* 1  common tangential over normal force beyond the plan:
                                            only a robot that slides has it */
static const double calm_cycles = 0.5; /* 1  gait cycles without it until feet are trusted again */
static const double sliding_time = 0.04; /* s  longer than a foot skids when it touches down */
static const double settled_share =
    0.5; /* 1  of the weight: feet that carry less together have only just met the ground */
static const double
    joints_follow = 0.35,
    joints_do_not = 0.45; /* 1  share of the time in which paths ask more speed than a servo has */
static const double gripped = 0.99; /* 1  of its share: a leg with more carries it */
static const double largest_load =
    2.0; /* 1  in thirds of the weight: the design's margins hold up to it */
static const double least_scale = 0.5,
                    largest_scale =
                        3.0; /* 1  measured over modelled weight that the support believes */
static const double high_share =
    0.25; /* 1  of the step height: a foot planned higher is certainly in the air */

enum {
  HX_TRIPOD_LEGS = 3
}; /* legs that share the weight in the hardest gait: loads are counted in weight / 3 */

static double total_weight(const hxControllerDefinition *d) {
  double mass = d->torso.mass;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint) mass += d->leg[leg].link[joint].mass;
  return mass * sqrt(d->gravity[0] * d->gravity[0] + d->gravity[1] * d->gravity[1] +
                     d->gravity[2] * d->gravity[2]);
}

void hx_compliance_compile(const hxControllerDefinition *definition, hxComplianceModel *model) {
  const hxGains *gains = &definition->gains;
  const double period = definition->period, cycle = definition->gait.period;
  model->parts = definition->parts;
  hx_foot_law_compile(definition, &model->law);
  model->period = period;
  model->weight = total_weight(definition);
  model->share = model->weight / HX_TRIPOD_LEGS;
  model->settled = settled_share * model->weight;
  hx_watch_compile(model->weight, cycle, period, &model->watch);
  hx_burden_compile(definition, &model->burden);
  model->softness = 1.0 / definition->servo.kp;
  model->high = high_share * definition->gait.step_height;
  model->tracking = fmin(period / gains->slip.tracking_time, 1.0);
  model->memory = exp(-period / gains->slip.load_time);
  model->follow_load = 1.0 - model->memory;
  model->follow_cycle = 1.0 - exp(-period / cycle);
  model->follow_weight = 1.0 - exp(-period / gains->support.weight_time);
  const double calm = nearbyint(calm_cycles * cycle / period);
  model->calm = (int64_t)calm;
  model->largest = gains->slip.limit * model->share;
  model->deepest = gains->suspension.limit;
  model->most = gains->limits.torque;
  model->fastest = gains->limits.speed * period;
}

void hx_compliance_reset(hxCompliance *laws) {
  memset(laws, 0, sizeof *laws);
  laws->trust = 1.0;
  hx_landings_reset(&laws->landings);
  hx_burden_reset(&laws->burden);
  for (int leg = 0; leg < HX_LEGS; ++leg) laws->grip[leg] = 1.0;
}

void hx_compliance_plan(const hxComplianceModel *model, const hxDemand *demand,
                        const double height[HX_LEGS], const double rise[HX_LEGS], hxPlan *plan) {
  const double supports = model->parts.support ? 1.0 : 0.0;
  plan->weight = plan->needed = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double f[3] = {plan->shares.push[leg].x, plan->shares.push[leg].y,
                         plan->shares.normal[leg]};
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double *lever = demand->lever[leg][joint];
      for (int i = 0; i < 3; ++i) plan->lever[leg][joint][i] = lever[i];
      plan->own[leg][joint] = supports * demand->torque[leg][joint];
      plan->carry[leg][joint] = -supports * (lever[0] * f[0] + lever[1] * f[1] + lever[2] * f[2]);
      plan->needed = fmax(plan->needed, fabs(plan->carry[leg][joint]));
    }
    plan->weight += plan->shares.normal[leg];
    plan->standing[leg] = plan->shares.activation[leg] >= 1.0;
    plan->well_up[leg] = height[leg] > hx_early;
    plan->height[leg] = height[leg];
    plan->falling[leg] = plan->well_up[leg] ? fmax(-model->period * rise[leg], 0.0) : 0.0;
  }
}

/* ----------------------------------------------------------------------------------------------
 * sensors */

/* Feet whose sensors are not believed feel what is planned; all do once a tripod's are not. */
static void replace_forces(const hxPlan *plan, double force[HX_LEGS][3], hxCompliance *laws) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    if (!laws->doubted[leg]) continue;
    force[leg][0] = laws->scale * plan->shares.push[leg].x;
    force[leg][1] = laws->scale * plan->shares.push[leg].y;
    force[leg][2] = laws->scale * plan->shares.normal[leg];
    laws->touching[leg] = plan->shares.activation[leg] > 0.5;
  }
}

/* met: height at which feet meet the ground without any bump [m] */
static void doubt(const hxComplianceModel *model, const hxPlan *plan, const double met[HX_LEGS],
                  double force[HX_LEGS][3], hxCompliance *laws) {
  hxExpected expected;
  double total = 0.0;
  int doubted = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    expected.standing[leg] = plan->standing[leg];
    expected.high[leg] = plan->height[leg] > model->high + met[leg];
    total += laws->touching[leg] ? force[leg][2] : 0.0;
  }
  hx_watch_look(&model->watch, laws->touching, total, &expected, &laws->watch);
  for (int leg = 0; leg < HX_LEGS; ++leg) doubted += laws->watch.left[leg] > 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    laws->doubted[leg] = doubted >= HX_TRIPOD_LEGS || laws->watch.left[leg] > 0.0;
    laws->fallback[leg] = laws->doubted[leg] || laws->trust < 1.0;
  }
  if (doubted) replace_forces(plan, force, laws);
}

static void meet_ground(const hxComplianceModel *model, const hxPlan *plan,
                        const double met[HX_LEGS], hxCompliance *laws) {
  hxMeeting meeting[HX_LEGS];
  int early[HX_LEGS];
  laws->slack = 1;
  hx_landings_early(&laws->landings, met, plan->height, early);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double falling = early[leg] ? plan->falling[leg] : 0.0;
    meeting[leg] =
        (hxMeeting){laws->touching[leg], falling, plan->swinging[leg], plan->standing[leg]};
  }
  hx_touchdown_step(model->period, meeting, &laws->touchdown);
}

/* Feet that touch and should not, or the other way round: ground met early or late, or a sensor
 * that is wrong. */
static void wonder(const hxComplianceModel *model, const hxPlan *plan, double force[HX_LEGS][3],
                   hxCompliance *laws) {
  double met[HX_LEGS];
  hx_landings_expected(&laws->landings, laws->touching, plan->height, plan->swinging, met);
  if (model->parts.fallback) doubt(model, plan, met, force, laws);
  if (laws->trust < 1.0)
    memset(&laws->touchdown, 0, sizeof laws->touchdown);
  else if (model->parts.touchdown)
    meet_ground(model, plan, met, laws);
}

static int surprised(const hxPlan *plan, const hxCompliance *laws) {
  int found = hx_watch_busy(&laws->watch) || hx_touchdown_busy(&laws->touchdown);
  for (int leg = 0; leg < HX_LEGS; ++leg)
    found |=
        laws->touching[leg] != plan->standing[leg] && (plan->standing[leg] || plan->well_up[leg]);
  return found;
}

/* ----------------------------------------------------------------------------------------------
 * laws */

/* A robot whose feet slide, or whose joints cannot follow, has no use for the plan of who carries
 * what: kinematic control for it. drag: of the feet's common tangential force beyond the plan, the
 * share of the normal one. */
static void judge(const hxComplianceModel *model, const hxPlan *plan, double drag,
                  hxCompliance *laws) {
  laws->asked += model->follow_cycle * ((double)plan->hurried - laws->asked);
  laws->outrun = laws->asked > (laws->outrun ? joints_follow : joints_do_not);
  laws->dragged = drag > sliding_drag ? laws->dragged + 1 : 0;
  if ((double)laws->dragged * model->period > sliding_time)
    laws->sliding = model->calm;
  else if (laws->sliding)
    --laws->sliding;
  const double goal = laws->sliding || laws->outrun || laws->burden.overburdened ? 0.0 : 1.0;
  if (laws->trust == goal) return;
  laws->trust += model->follow_load * (goal - laws->trust);
  if (fabs(goal - laws->trust) < 1.0 - gripped) laws->trust = goal;
  for (int leg = 0; leg < HX_LEGS; ++leg) laws->fallback[leg] = laws->doubted[leg] || goal == 0.0;
}

/* Inputs of the laws from the forces felt, tangential ones beyond the plan's: the squeeze of these,
 * f_n, load. Returns sum f_n [N]. */
static double mix(const hxComplianceModel *model, const hxPlan *plan,
                  const double force[HX_LEGS][3], hxFootInput input[HX_LEGS], hxCompliance *laws) {
  hxPlane felt[HX_LEGS], common = {0.0, 0.0};
  double normal[HX_LEGS], total = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double touching = laws->touching[leg] ? 1.0 : 0.0;
    felt[leg].x = (force[leg][0] - laws->scale * plan->shares.push[leg].x) * touching;
    felt[leg].y = (force[leg][1] - laws->scale * plan->shares.push[leg].y) * touching;
    normal[leg] = force[leg][2] * touching;
    common = hx_add(common, felt[leg]);
    total += normal[leg];
  }
  const double share = total > load_floor ? 1.0 / total : 0.0;
  if (model->parts.fallback)
    judge(model, plan, total > model->settled ? hypot(common.x, common.y) * share : 0.0, laws);
  hx_slip_squeeze(normal, plan->feet, felt);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    input[leg].push = model->parts.slip_pid ? felt[leg] : hx_plane(0.0, 0.0);
    input[leg].excess = normal[leg];
    input[leg].load = normal[leg] * (1.0 / model->share);
  }
  return total;
}

/* measured over planned weight, and what the suspensions are to give way to */
static void weigh(const hxComplianceModel *model, const hxPlan *plan, double total,
                  hxFootInput input[HX_LEGS], hxCompliance *laws) {
  const double ratio = total / fmax(plan->weight, load_floor),
               scale = hx_clamp(ratio, least_scale, largest_scale);
  int doubted = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) doubted |= laws->doubted[leg];
  if (!doubted) {
    laws->scale += model->follow_weight * (scale - laws->scale);
    hx_burden_weigh(&model->burden, ratio, &laws->burden);
  }
  hx_burden_step(&model->burden, plan->needed, laws->scale, &laws->burden);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const int live = model->parts.suspension && plan->shares.activation[leg] > 0.0;
    input[leg].excess = live ? input[leg].excess - laws->scale * plan->shares.normal[leg] : 0.0;
  }
}

/* The PID's answers no larger than allowed, their direction kept; integrals give way. */
static void limit_answers(const hxComplianceModel *model, hxCompliance *laws) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    hxFootLaw *law = &laws->law[leg];
    const hxPlane wanted = law->answer;
    law->answer =
        hx_scaled(wanted, model->largest / fmax(hypot(wanted.x, wanted.y), model->largest));
    law->x.integral += model->tracking * (law->answer.x - wanted.x);
    law->y.integral += model->tracking * (law->answer.y - wanted.y);
  }
}

/* At its stop a suspension stands still. */
static void limit_deflections(const hxComplianceModel *model, hxCompliance *laws) {
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    hxFootLaw *law = &laws->law[leg];
    if (fabs(law->deflection) > model->deepest) law->rate = 0.0;
    law->deflection = hx_clamp(law->deflection, -model->deepest, model->deepest);
  }
}

/* The laws one period on, limited, and the forces that come of them. */
static void answer_forces(const hxComplianceModel *model, const hxPlan *plan,
                          const hxFootInput input[HX_LEGS], double answer[HX_LEGS][3],
                          hxCompliance *laws) {
  const double freedom = model->parts.support ? laws->burden.freedom : 1.0,
               kept = 1.0 - (1.0 - freedom) * model->follow_load;
  double answers = 0.0, deflections = 0.0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    hx_foot_law_step(&model->law, &input[leg], &laws->law[leg]);
    answers += hx_square(laws->law[leg].answer);
    deflections += laws->law[leg].deflection * laws->law[leg].deflection;
  }
  /* no single one is beyond its limit when all together are not */
  if (answers > model->largest * model->largest) limit_answers(model, laws);
  if (deflections > model->deepest * model->deepest) limit_deflections(model, laws);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    hxFootLaw *law = &laws->law[leg];
    const double (*lever)[3] = plan->lever[leg];
    const double vertical =
        lever[0][2] * lever[0][2] + lever[1][2] * lever[1][2] + lever[2][2] * lever[2][2];
    const hxPlane given = hx_scaled(law->answer, freedom * fmin(law->load, largest_load));
    answer[leg][0] = given.x;
    answer[leg][1] = given.y;
    answer[leg][2] = law->deflection / (model->softness * vertical); /* z/C_zz, C = J kp^-1 J^T */
    /* a foot in the air forgets, within the time in which a leg gives up its load; and all do what
     * they may not take away */
    const double left = plan->swinging[leg] && !laws->touching[leg] ? kept * model->memory : kept;
    law->x.integral *= left;
    law->y.integral *= left;
  }
}

/* A leg that stands in the plan and not on the ground is given its share back as it loads. */
static void take_up(const hxComplianceModel *model, const hxPlan *plan, hxCompliance *laws) {
  laws->slack = 0;
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    laws->grip[leg] += model->follow_load * (1.0 - laws->grip[leg]);
    if (plan->standing[leg] && !laws->touching[leg]) laws->grip[leg] = 0.0;
    for (int joint = 0; joint < HX_JOINTS; ++joint) laws->torque[leg][joint] *= laws->grip[leg];
    laws->slack |= laws->grip[leg] < gripped;
  }
}

/* one joint's bend towards the wanted one, and torque, within what commands never exceed */
static void limit_joint(const hxComplianceModel *model, double wanted, double *bend,
                        double *torque) {
  if (!model->parts.limits) {
    *bend = wanted;
    return;
  }
  *bend += hx_clamp(wanted - *bend, -model->fastest, model->fastest);
  *torque = hx_clamp(*torque, -model->most, model->most);
}

/* bend = J^T f/kp, limited in rate; torque = own + strength x scale x carry, limited */
static void actuate(const hxComplianceModel *model, const hxPlan *plan,
                    const double answer[HX_LEGS][3], hxCompliance *laws) {
  const double strength = model->parts.limits ? laws->burden.strength : 1.0;
  for (int leg = 0; leg < HX_LEGS; ++leg)
    for (int joint = 0; joint < HX_JOINTS; ++joint)
      laws->torque[leg][joint] = plan->carry[leg][joint] * (strength * laws->scale);
  if (laws->slack) take_up(model, plan, laws);
  for (int leg = 0; leg < HX_LEGS; ++leg) {
    const double *f = answer[leg];
    double *shift = laws->shift[leg];
    shift[0] = shift[1] = shift[2] = 0.0;
    for (int joint = 0; joint < HX_JOINTS; ++joint) {
      const double *lever = plan->lever[leg][joint];
      const double bend = model->softness * (lever[0] * f[0] + lever[1] * f[1] + lever[2] * f[2]);
      for (int i = 0; i < 3; ++i) shift[i] += lever[i] * bend;
      laws->torque[leg][joint] = (laws->torque[leg][joint] + plan->own[leg][joint]) * laws->trust;
      limit_joint(model, bend * laws->trust, &laws->bend[leg][joint], &laws->torque[leg][joint]);
    }
  }
}

void hx_compliance_step(const hxComplianceModel *model, const hxPlan *plan,
                        double force[HX_LEGS][3], hxCompliance *laws) {
  hxFootInput input[HX_LEGS];
  double normal[HX_LEGS], answer[HX_LEGS][3];
  for (int leg = 0; leg < HX_LEGS; ++leg) normal[leg] = force[leg][2];
  hx_contact_detect(model->weight, normal, laws->touching);
  hx_landings_look(laws->touching, plan->height, plan->swinging, &laws->landings);
  if (surprised(plan, laws)) wonder(model, plan, force, laws);
  const double total = mix(model, plan, (const double (*)[3])force, input, laws);
  weigh(model, plan, total, input, laws);
  answer_forces(model, plan, input, answer, laws);
  actuate(model, plan, (const double (*)[3])answer, laws);
}
