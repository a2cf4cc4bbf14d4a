/* state.h - what a plant is made of: constants compiled from the definition, and the state that
 * moves.
 *
 * Legs are stored innermost, [quantity][component][slot]. No pointers anywhere: the bytes are the
 * plant.
 */
#ifndef HX_STATE_H
#define HX_STATE_H

#include <stddef.h>

#include "hexapod/hexapod.h"
#include "hexapod/inside.h"

enum {
  HX_SLOTS = 8, /* legs in memory, padded: slots past the last leg mirror leg 0 */
  HX_TORSO_SIZE = 16,
  HX_BODIES_SIZE = HX_TORSO_SIZE + HX_JOINTS * HX_BODY_STATE * HX_SLOTS,
  HX_BRISTLE_SIZE = 3 * HX_SLOTS,
  HX_MOTION_SIZE = HX_BODIES_SIZE + HX_BRISTLE_SIZE
};

/* Where a body state's parts begin. */
enum { HX_R = 0, HX_P = 3, HX_V = 7, HX_W = 10 };

/* y of y' = f(t, y). The same doubles as a vector for the integrator and by name for the physics.
 */
typedef union hxPlantMotion {
  double y[HX_MOTION_SIZE];
  struct {
    double torso[HX_BODY_STATE];
    double actuator_work, push_work, dissipated; /* J */
    double link[HX_JOINTS][HX_BODY_STATE][HX_SLOTS];
    double bristle[3][HX_SLOTS]; /* m  b of eq. 16, world axes; 0 and at rest with other laws. The
                                    last: they leave it out */
  };
} hxPlantMotion;

/* A joint and the link it moves; i = parent, j = child (equations.md: s, s^P, a, b). The child's
 * axes here and in its motion are the joint's: x = a, y = b, z = s, so that its rotation matrix
 * holds what the constraint needs. */
typedef struct hxJointModel {
  double mass[HX_SLOTS];
  double inertia[6][HX_SLOTS];  /* child's axes */
  double s_i[3][HX_SLOTS];      /* joint axis, parent's axes */
  double point_i[3][HX_SLOTS];  /* parent's centre of mass to the joint's point, parent's axes */
  double point_j[3][HX_SLOTS];  /* child's centre of mass to the joint's point, child's axes */
  double zero[4][HX_SLOTS];     /* the turn from the parent's to the child's axes at angle 0 */
  double frame[4][HX_SLOTS]; /* the turn from the link's axes, those of hexapod.h, to the child's
                                axes here */
} hxJointModel;

typedef struct hxModel {
  double torso_mass;
  double torso_inertia[6];
  hxJointModel joint[HX_JOINTS];
  double point_foot[3][HX_SLOTS]; /* tibia's centre of mass to the foot's centre, tibia's axes */
  double foot_radius;
  double gravity[3];
  double alpha, beta; /* Baumgarte */
  int contact_law, friction_law, terrain_kind, servo_mode, method, projection;
  double stiffness, damping_scale,
      impact_speed_floor; /* eq. 14; what damping_scale means is the law's business */
  double mu, slope; /* eq. 15 */
  double presliding, bristle_damping; /* eq. 16, 17 */
  double static_rise, per_stribeck; /* eq. 18: mu_s - mu, 1/v_s */
  double kp, kd, torque_max, speed_max, rotor_inertia, coulomb_friction;
  double ground_point[3], ground_normal[3];
  double step, tolerance, step_max;
  double load_threshold; /* N  a foot that bears more slips under load */
} hxModel;

/* The inputs of one step, legs innermost. */
typedef struct hxCommand {
  double angle[HX_JOINTS][HX_SLOTS];
  double speed[HX_JOINTS][HX_SLOTS];
  double torque[HX_JOINTS][HX_SLOTS];
  double push_force[3], push_torque[3];
  double acceleration[HX_JOINTS][HX_SLOTS];
  double time; /* s  when it was given: the kinematic drive goes on from there (eq. 13) */
} hxCommand;

/* Changes at touch-down and lift-off only, never within a step. */
typedef struct hxContactState {
  double closed[HX_SLOTS]; /* 1 from touch-down to lift-off, else 0 */
  double damping[HX_SLOTS]; /* s/m  d of f_n = K delta^1.5 (1 + d ddelta), fixed at touch-down */
  double impact_speed[HX_SLOTS]; /* m/s  at the last touch-down */
} hxContactState;

/* Where joints and feet are at one time: an end of a step, between which its works and peaks are
 * found. World axes. */
typedef struct hxMoment {
  double angle[HX_JOINTS][HX_SLOTS]; /* rad */
  double speed[HX_JOINTS][HX_SLOTS]; /* rad/s */
  double centre[3][HX_SLOTS]; /* m    of the foot's sphere */
  double normal[3][HX_SLOTS]; /* 1    of the ground there */
  double slip[3][HX_SLOTS]; /* m/s  velocity of the contact point's material along the ground */
  double roll[3][HX_SLOTS]; /* m/s  the part of it by the foot's rotation */
  double delta[HX_SLOTS], ddelta[HX_SLOTS]; /* m, m/s  penetration, approach speed */
  double time; /* s */
  double stale; /* 1    0: it is the state's; 1: coordinates were set since */
} hxMoment;

/* Forces and powers at the last completed step of a solver of others. */
typedef struct hxCompleted {
  double motor[HX_JOINTS][HX_SLOTS]; /* N m  motor torques */
  double gear[HX_JOINTS][HX_SLOTS]; /* N m  gear friction */
  double foot[3][HX_SLOTS]; /* N    ground on feet, world axes */
  double known; /* 1    0: there was none yet */
} hxCompleted;

enum { HX_MOMENT_ROWS = offsetof(hxMoment, time) / (HX_SLOTS * sizeof(double)) };

enum { HX_RISE_SAMPLES = 10 }; /* across the window of 1 ms over which a landing's force rises */

/* What was measured since the start, along the path that the steps went. */
typedef struct hxMeasured {
  double positive_work[HX_JOINTS][HX_SLOTS]; /* J       of the motors, where they drive */
  double negative_work[HX_JOINTS][HX_SLOTS]; /* J       where they brake, >= 0 */
  double torque_squared[HX_JOINTS][HX_SLOTS]; /* N2 m2 s integral of the motor torque's square */
  double slip_distance[HX_SLOTS]; /* m       along the ground under load */
  double impulse[HX_SLOTS]; /* N s     integral of the normal force */
  double peak_force[HX_SLOTS]; /* N       largest normal force of the last call */
  double peak_rate[HX_SLOTS]; /* N/s     steepest rise of the normal force in the last call */
  double landing_rate[HX_SLOTS]; /* N/s     largest rise over a window within 20 ms of the last
                                    touch-down */
  double landing_force[HX_RISE_SAMPLES][HX_SLOTS]; /* N  the last samples of a landing's normal
                                                      force, the oldest is next */
  double landing_left[HX_SLOTS]; /* 1       samples of the landing that are still to come */
  double landed_at[HX_SLOTS]; /* s       time of the last touch-down */
  double landings[HX_SLOTS]; /* 1       touch-downs */
  double contact_loss, friction_loss,
      gear_loss; /* J    their sum is what the motion has dissipated */
  double cone_time[HX_CONE_BINS]; /* s  of all feet under load, by the share of the friction cone
                                     that they use */
} hxMeasured;

enum { HX_MEASURED_ROWS = offsetof(hxMeasured, contact_loss) / (HX_SLOTS * sizeof(double)) };

typedef struct hxState {
  double time;
  double next_step; /* s  what the error control would take next */
  double first_step; /* s  the same for the first step of a call, which new inputs shorten */
  double stored_at_start; /* J  energy the audit starts from */
  double call_start; /* s  when the call began that an event broke off */
  double call_input; /* 1  checksum of its input, a whole number; 0: no call was broken off */
  hxPlantMotion motion;
  hxContactState contact;
  double evaluations, steps, rejected, touchdowns;
  hxMoment moment; /* the last step's end */
  hxCompleted completed; /* model exchange: the last step's end */
  hxMeasured measured;
} hxState;

struct hxPlant {
  hxModel model;
  hxState state;
  char message[HX_MESSAGE_SIZE];
};

/* Copies leg 0 into the slots past the last leg, so that every lane always holds a physical leg. */
static inline void hx_fill_slots(double *slots) {
  for (int slot = HX_LEGS; slot < HX_SLOTS; ++slot) slots[slot] = slots[0];
}

#endif
