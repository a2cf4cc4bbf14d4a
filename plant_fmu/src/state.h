/* state.h - data of a plant: the model (constants compiled from the definition) and the state.
 *
 * Legs are stored innermost, [quantity][component][slot]. But for the terrain, whose checksum a
 * saved state holds, model and state hold no pointers, so a copy of their bytes is a copy of what
 * they stand for. hxPlant also has addresses of its work space.
 */
#ifndef HX_STATE_H
#define HX_STATE_H

#include <stddef.h>
#include <string.h>

#include "ground/footprints.h"
#include "hexapod/hexapod.h"
#include "hexapod/inside.h"

enum {
  HX_SLOTS = 8, /* legs in memory, padded: slots past the last leg mirror leg 0 */
  HX_TORSO_SIZE = 16,
  HX_BODIES_SIZE = HX_TORSO_SIZE + HX_JOINTS * HX_BODY_STATE * HX_SLOTS,
  HX_BRISTLE_SIZE = 3 * HX_SLOTS, /* of one row of contacts */
  HX_MOTION_SIZE = HX_BODIES_SIZE + HX_BRISTLE_SIZE
};

/* Rows of contacts: of each, a slot has one. Those before the torso's are spheres on the tibia that
 * touch the ground, one for each leg; the torso's row has eight points of the torso. In those of
 * pairs a leg's femur or tibia touches the next leg's. A model lists the rows that it computes. */
enum {
  HX_FOOT,   /* the ground below the foot: the only row of feet but on blocks */
  HX_WALL,   /* a higher block beside the foot along x */
  HX_SIDE,   /* one along y */
  HX_CORNER, /* one across the cell's corner */
  HX_KNEE,
  HX_SHANK,
  HX_TORSO,
  HX_PAIR, /* the first of four: femur with femur, with tibia, tibia with femur, with tibia */
  HX_GROUND_ROWS = HX_PAIR,
  HX_PAIR_ROWS = 4,
  HX_ROWS = HX_PAIR + HX_PAIR_ROWS,
  HX_FOOT_ROWS = HX_KNEE,
  HX_TIBIA_ROWS = HX_TORSO
};

/* What a friction law has. Its function is in lanes/friction.h. */
typedef struct {
  int has_friction, has_bristles; /* forces along the ground; feet stand on bristles */
} hxFrictionKind;

static inline hxFrictionKind hx_friction_kind(int law) {
  static const hxFrictionKind laws[] = {
      [HX_FRICTION_TANH] = {1, 0},
      [HX_FRICTION_NONE] = {0, 0},
      [HX_FRICTION_BRISTLE] = {1, 1},
      [HX_FRICTION_LUGRE] = {1, 1},
  };
  return laws[law];
}

/* Numbers of hxSoil (ground/soil.h). */
enum { HX_SOIL_SIZE = 16 };

/* Offsets of position, quaternion, velocity and angular velocity in a body state. */
enum { HX_R = 0, HX_P = 3, HX_V = 7, HX_W = 10 };

/* The vector y of y' = f(t, y). The union gives the integrator a vector and the physics names. */
typedef union hxPlantMotion {
  double y[HX_MOTION_SIZE];
  struct {
    double torso[HX_BODY_STATE];                 /* m, 1, m/s, rad/s  r, p, v, w in world axes */
    double actuator_work, push_work, dissipated; /* J */
    double link[HX_JOINTS][HX_BODY_STATE][HX_SLOTS]; /* as the torso's */
    double bristle[3][HX_SLOTS]; /* m  b of eq. 16, world axes; other laws skip it */
  };
} hxPlantMotion;

/* Stops of a joint (eq. 39). Those of a locked joint are at the angle where it was locked. */
typedef struct hxStops {
  double middle[HX_SLOTS], half_range[HX_SLOTS]; /* rad */
  double stiffness[HX_SLOTS], damping[HX_SLOTS]; /* N m/rad, N m s/rad */
} hxStops;

/* Constants of a joint and the link it moves (docs/equations.md: s, s^P, a, b); i = parent, j =
 * child. In the model and in the motion the child's axes are the joint's: x = a, y = b, z = s, so
 * that its rotation matrix contains the vectors that the constraint needs. */
typedef struct hxJointModel {
  double mass[HX_SLOTS];       /* kg */
  double inertia[6][HX_SLOTS]; /* kg m2  child's axes */
  double s_i[3][HX_SLOTS];     /* 1  joint axis, parent's axes */
  double point_i[3][HX_SLOTS]; /* m  parent's centre of mass to the joint's point, parent's axes */
  double point_j[3][HX_SLOTS]; /* m  child's centre of mass to the joint's point, child's axes */
  double q_i0[4][HX_SLOTS];    /* 1  from 0, the child's axes at angle 0, to the parent's */
  double q_Lj[4][HX_SLOTS];    /* 1  from the child's axes to the link axes of hexapod.h */
  hxStops stop, own_stop;      /* those in force, and those of the robot, without locks */
} hxJointModel;

/* Constants of the heat of winding and housing (eq. 52). */
typedef struct hxHeat {
  double winding, housing;        /* J/K  heat capacities; winding 0: no heating */
  double to_housing, to_air;      /* W/K  conductances */
  double air, start, derate, max; /* K */
} hxHeat;

typedef struct hxModel {
  /* robot.c, bodies.c: masses and points, in the axes of the body's state */
  double torso_mass;       /* kg */
  double torso_inertia[6]; /* kg m2 */
  hxJointModel joint[HX_JOINTS];
  double point_B[HX_ROWS][3][HX_SLOTS]; /* m  centres of contacts' spheres from the centre of mass
                                         * of tibia or torso */
  double radius[HX_ROWS];               /* m  those of knee and shank are also of femur and tibia;
                                         *    those of pairs are sums */
  double ground_point[3];               /* m  of the plane */
  double ground_normal[3];              /* 1 */
  /* laws.c: gravity and constraints */
  double gravity[3];  /* m/s2 */
  double alpha, beta; /* 1/s  Baumgarte's (eq. 7) */
  /* laws.c: what is computed, by which law. All choices lie between the numbers (tangent.h). */
  int contact_law, friction_law, terrain_kind, servo_mode, servo_drive; /* of their enumerations */
  int method, projection;
  int velocity_terms;               /* 1: the tanh law has static friction or a viscous part */
  int spin_friction, roll_friction; /* 1: the feet resist spin, rolling */
  int stops;                        /* bits: 1: the joints have stops, 2: some are locked */
  int measured_friction;            /* 1: the gears have more than Coulomb friction */
  int stribeck;                     /* 1: it has Stribeck terms */
  int spin;                         /* 1: the rotors have angular momentum (eq. 54) */
  int has_soil; /* 1: the ground may be soil, of the definition or of a material of the terrain */
  /* robot.c: the rows of contacts that are computed, and the terrain */
  int rows;         /* on tibias, those on feet included */
  int foot_rows;    /* on feet */
  int torso_rows;   /* on the torso: 0 or 1 */
  int pair_rows;    /* between legs: 0 or HX_PAIR_ROWS */
  int listed;       /* all: rows + torso_rows + pair_rows */
  int row[HX_ROWS]; /* their numbers: first of feet, then tibias, torso, pairs */
  union {
    const hxTerrain *terrain; /* NULL: plane; not saved */
    int64_t terrain_bits;     /* the same size on every machine */
  };
  /* laws.c: contact */
  double stiffness;                   /* N/m^1.5  K of eq. 14 */
  double damping_scale;               /* s/m or 1  d of eq. 14, or d times the impact speed */
  double impact_speed_floor;          /* m/s  the least by which the scale is divided */
  double mu, slope;                   /* 1, s/m  eq. 15 */
  double presliding, bristle_damping; /* m, s  eq. 16, 17 */
  double static_rise, per_stribeck;   /* 1, s/m  eq. 18: mu_s - mu, 1/v_s */
  double viscous;                     /* s/m  eq. 35 */
  double spin_radius, rolling_radius; /* m  eq. 38 */
  double soil[HX_SOIL_SIZE];          /* hxSoil under the feet, of the definition */
  double bristle_length;              /* m  presliding, or shear displacement of the soil */
  double pad_radius;                  /* m  of the feet's pads; 0: spheres */
  double load_threshold;              /* N  a foot with a larger load counts its slip */
  /* laws.c: the servos */
  double kp, kd;                            /* N m/rad, N m s/rad  0 in torque mode */
  double torque_max, speed_max;             /* N m, rad/s */
  double rotor_inertia, coulomb_friction;   /* kg m2, N m */
  double lock_stiffness, lock_damping;      /* N m/rad, N m s/rad  of locked joints */
  double stall_torque, back_emf;            /* N m, N m s/rad  eq. 48 */
  double emf_damping, limit_damping;        /* N m s/rad  of the motor without kd, on its limits */
  double torque_constant, resistance;       /* N m/A, ohm */
  double gear_speed, per_gear_speed;        /* rad/s, s/rad  dry friction saturates there */
  double gear_viscous, gear_stribeck;       /* N m s/rad, N m  K_v, K_cs of eq. 50 */
  double motor_load, external_load;         /* 1  K_m, K_e */
  double stribeck_motor, stribeck_external; /* 1  K_ms, K_es */
  double quadratic_motor, quadratic_external;   /* 1/(N m)  K_mq, K_eq */
  double per_stribeck_speed, stribeck_exponent; /* s/rad, 1  1/w_s, a */
  double spin_inertia;                          /* kg m2  of the rotor, times its gear ratio */
  double voltage, duty_max, supply_resistance;  /* V, 1, ohm */
  hxHeat heat;
  double bus_period, command_step; /* s, rad  0 in kinematic mode */
  double current_torque;           /* N m  k_t times the largest current; huge: no limit */
  double goal_speed;               /* rad/s  of the firmware's setpoints; 0: no limit */
  double overload_time, overload_torque, overload_left; /* s, N m, 1  eq. 58 */
  /* laws.c: the integration */
  double step, step_max; /* s */
  double tolerance;      /* 1 */
} hxModel;

/* The inputs of one step, legs innermost. */
typedef struct hxCommand {
  double angle[HX_JOINTS][HX_SLOTS];        /* rad */
  double speed[HX_JOINTS][HX_SLOTS];        /* rad/s */
  double torque[HX_JOINTS][HX_SLOTS];       /* N m */
  double push_force[3], push_torque[3];     /* N, N m  on the torso, world axes */
  double acceleration[HX_JOINTS][HX_SLOTS]; /* rad/s2  in kinematic mode */
  double time;   /* s  time of the command, from which kinematic drives extrapolate (eq. 13) */
  double supply; /* 1  voltage of the supply over servo.voltage (eq. 53) */
  double duty[HX_JOINTS][HX_SLOTS];     /* 1  share of the duty limit that heat leaves (eq. 52) */
  double weakness[HX_JOINTS][HX_SLOTS]; /* 1  share of its limits that a motor has lost */
} hxCommand;

/* Commands that servos hold until the bus transmits the next ones; the first are hxCommand's. */
typedef struct hxBus {
  double angle[HX_JOINTS][HX_SLOTS];  /* rad */
  double speed[HX_JOINTS][HX_SLOTS];  /* rad/s */
  double torque[HX_JOINTS][HX_SLOTS]; /* N m */
  double start;                       /* s  of the first transmission */
  double sent;                        /* 1  transmissions since */
} hxBus;

enum { HX_JOINT_COMMANDS = offsetof(hxBus, start) }; /* bytes of angle, speed and torque */

/* What the servos' firmware remembers, legs innermost. */
typedef struct hxFirmware {
  double angle[HX_JOINTS][HX_SLOTS];  /* rad    setpoints at the last command (eq. 57), */
  double rate[HX_JOINTS][HX_SLOTS];   /* rad/s  their speed since, */
  double time;                        /* s      and its time */
  double loaded[HX_JOINTS][HX_SLOTS]; /* s      of a duty above the overload limit (eq. 58), with
                                       *        the sign of the duty */
} hxFirmware;

/* State of the contacts. It changes between steps alone. */
typedef struct hxContactState {
  /* contact_law.c: at touch-down; lift-off sets closed and damping to 0 */
  double closed[HX_ROWS][HX_SLOTS];       /* 1        1 from touch-down to lift-off, else 0 */
  double damping[HX_ROWS][HX_SLOTS];      /* s/m      d of eq. 14 */
  double impact_speed[HX_ROWS][HX_SLOTS]; /* m/s      approach speed at the last touch-down */
  double stiffness[HX_ROWS][HX_SLOTS];    /* N/m^1.5  K of the ground where it touched down */
  double mu[HX_ROWS][HX_SLOTS];           /* 1        friction of that ground */
  double static_rise[HX_ROWS][HX_SLOTS];  /* 1        mu_s - mu of eq. 18 */
  double on_soil[HX_SLOTS];               /* 1        1: the foot touched down on soil */
  double soil[HX_SOIL_SIZE][HX_SLOTS];    /* numbers of an hxSoil, where on_soil is 1 */
  /* lanes/soil_path.h: at the end of every step on soil */
  double plastic[HX_SLOTS];  /* m  depth at which feet touch soil: z_p, or that of the footprint
                              *    above which one is; 0 on rigid ground */
  double place[2][HX_SLOTS]; /* m  x and y where they left the bottom of that footprint */
  /* contact_law.c: at touch-down, and where a foot leaves its cell */
  double cell[2][HX_SLOTS]; /* 1  blocks: column and row over which a foot is; < 0: none */
  /* kernels/integrator.h: at the end of every step */
  double nearest[2][HX_SLOTS]; /* m  smooth grids: x and y from a foot's centre to the point nearest
                                *    to it, where the next search begins; 0 between calls */
} hxContactState;

/* Penetration and approach speed of all contacts; only the model's rows are set. */
typedef struct hxDepths {
  double delta[HX_ROWS][HX_SLOTS], ddelta[HX_ROWS][HX_SLOTS]; /* m, m/s */
  /* on a grid only */
  double centre[HX_GROUND_ROWS][3][HX_SLOTS]; /* m  of spheres, world axes; of feet in HX_FOOT */
  double outside[HX_SLOTS]; /* m  how far a foot is outside of the cell that is held for it */
} hxDepths;

/* Contacts of a row at one end of a step. World axes; to pairs of legs the next leg is ground. */
typedef struct hxContactMoment {
  double centre[3][HX_SLOTS];               /* m      centre of the sphere; of pairs the point */
  double normal[3][HX_SLOTS];               /* 1      normal of the ground */
  double slip[3][HX_SLOTS];                 /* m/s    of the body's material along the ground */
  double roll[3][HX_SLOTS];                 /* m/s    its part due to the body's rotation */
  double delta[HX_SLOTS], ddelta[HX_SLOTS]; /* m, m/s penetration, approach speed */
} hxContactMoment;

/* Joints and contacts at one end of a step, from which its works and peaks are computed. */
typedef struct hxMoment {
  double angle[HX_JOINTS][HX_SLOTS];    /* rad */
  double speed[HX_JOINTS][HX_SLOTS];    /* rad/s */
  double w[3][HX_SLOTS];                /* rad/s  of the tibias, world axes */
  double time;                          /* s */
  double stale;                         /* 1      1: coordinates were set since */
  hxContactMoment contact[HX_ROWS];     /* the model's rows are set */
  double share[HX_FOOT_ROWS][HX_SLOTS]; /* 1  of feet on blocks (ground/sharing.h) */
} hxMoment;

/* Forces at the last completed step of an importer's solver (model exchange). */
typedef struct hxCompleted {
  double motor[HX_JOINTS][HX_SLOTS];        /* N m  motor torques */
  double gear[HX_JOINTS][HX_SLOTS];         /* N m  gear friction */
  double stop[HX_JOINTS][HX_SLOTS];         /* N m  stops */
  double moment[HX_FOOT_ROWS][3][HX_SLOTS]; /* N m  spin and rolling friction on tibias */
  double contact[HX_ROWS][3][HX_SLOTS];     /* N    ground on feet and bodies, world axes */
  double known;                             /* 1    0: no step was completed yet */
} hxCompleted;

enum {
  HX_MOMENT_LINES = offsetof(hxMoment, time) / (HX_SLOTS * sizeof(double)),
  HX_CONTACT_LINES = sizeof(hxContactMoment) / (HX_SLOTS * sizeof(double)),
  HX_COMPLETED_LINES = offsetof(hxCompleted, contact) / (HX_SLOTS * sizeof(double))
};

enum { HX_RISE_SAMPLES = 10 }; /* samples in the rise window of 1 ms */

/* Integrals and peaks along the path of the steps, since the start unless stated otherwise. */
typedef struct hxMeasured {
  /* measure/joint_measure.h */
  double positive_work[HX_JOINTS][HX_SLOTS];  /* J       where motors drive */
  double negative_work[HX_JOINTS][HX_SLOTS];  /* J       where motors brake, >= 0 */
  double torque_squared[HX_JOINTS][HX_SLOTS]; /* N2 m2 s integral of squared motor torque */
  /* measure/foot_measure.h; moment.h begins a landing and resets the peaks of a call */
  double slip_distance[HX_SLOTS]; /* m       slip of feet under load */
  double impulse[HX_SLOTS];       /* N s     integral of the normal force */
  double peak_force[HX_SLOTS];    /* N       largest force of the last call */
  double peak_rate[HX_SLOTS];     /* N/s     steepest rise in the last call */
  double landing_rate[HX_SLOTS];  /* N/s     largest rise of the last landing (eq. 29) */
  double landing_force[HX_RISE_SAMPLES][HX_SLOTS]; /* N       ring buffer of a landing's forces */
  double landing_left[HX_SLOTS]; /* 1       samples of the landing still to take */
  double landed_at[HX_SLOTS];    /* s       time of the last touch-down */
  double landings[HX_SLOTS];     /* 1       touch-downs */
  /* measure/joint_measure.h (eq. 52) */
  double winding[HX_JOINTS][HX_SLOTS]; /* K       temperatures of windings */
  double housing[HX_JOINTS][HX_SLOTS]; /* K       of housings */
  /* measure/measure.h */
  double contact_loss, friction_loss, gear_loss; /* J       their sum is the dissipated energy;
                                                  * stops count with the gears */
  /* measure/foot_measure.h (eq. 30) */
  double cone_time[HX_CONE_BINS]; /* s       feet under load, by share of the friction cone */
} hxMeasured;

enum { HX_MEASURED_LINES = offsetof(hxMeasured, contact_loss) / (HX_SLOTS * sizeof(double)) };

/* State of a plant. A call of hx_plant_step writes in this order
 *   locked, locked_angle                plant/locks.c
 *   in each part of the call, from one transmission of the bus to the next:
 *     bus, firmware                   command/command.c: hx_bus_send, hx_follow_goals
 *     supply, duty                    command/command.c: hx_supply_power
 *     in each step, by advance() of kernels/integrator.h:
 *       evaluations, rejected         kernels/step.h: trials until the error is small enough
 *       next_step, first_step         the error control
 *       measured, plastic, moment     measure/: from the old moment to that of the step's end
 *       motion, steps, time
 *       contact, touchdowns           measure/moment.h: switches the contacts that are due
 *     call_start, call_input          plant/advance.c
 *     firmware.loaded                 command/command.c: hx_count_overload */
typedef struct hxState {
  double time;                      /* s */
  double next_step;                 /* s  step that the error control proposes next */
  double first_step;                /* s  the same for a call's first step, with new inputs */
  double stored_at_start;           /* J  stored energy at the start of the energy audit */
  double parameter_work;            /* J  given by changes of parameters since (plant/tune.c) */
  double call_start;                /* s  start of the call that an event interrupted */
  double call_input;                /* 1  checksum of its input, a whole number; 0: no such call */
  double call_evaluations;          /* 1  evaluations before the last call began */
  double supply;                    /* 1  hxCommand.supply of the last call, */
  double duty[HX_JOINTS][HX_SLOTS]; /* 1    and its duty */
  double locked[HX_JOINTS][HX_SLOTS];       /* 1    1: the joint is locked */
  double locked_angle[HX_JOINTS][HX_SLOTS]; /* rad  where it was locked */
  hxBus bus;
  hxFirmware firmware;
  double evaluations, steps, rejected, touchdowns; /* 1  counts since the start */
  hxPlantMotion motion; /* hx_copy_state() copies from here to the moment's first row */
  hxContactState contact;
  hxMeasured measured;
  hxMoment moment;       /* end of the last step */
  hxCompleted completed; /* by plant/continuous.c, model exchange: end of the last step */
} hxState;

enum { HX_CALL_SIZE = offsetof(hxState, motion) }; /* bytes of what a call changes outside steps */

struct hxPlant {
  hxModel model;
  union {           /* in one place, because a further model would enlarge every instance */
    hxModel feet;   /* with the rows of feet alone: open contacts exert no force, so steps without
                     * their rows have the same bits */
    hxModel before; /* while hx_plant_reset and hx_plant_tune run: the model before the call */
  };
  hxState state;
  const hxTerrain *terrain; /* of later resets */
  char message[HX_MESSAGE_SIZE];
  hxFootprintLog footprints; /* outside the state, which calls copy */
  hxState *state_before; /* that before a call, which one that fails restores: in the work space */
  void *scratch;         /* of the kernels, see kernel.h: the rest of the work space */
};

/* Copies the parts of a state that a step of this model changes. */
static inline void hx_copy_state(const hxModel *model, hxState *to, const hxState *from) {
  memcpy(&to->motion, &from->motion, offsetof(hxState, moment.contact[1]) - HX_CALL_SIZE);
  for (int k = 1; k < model->listed; ++k)
    to->moment.contact[model->row[k]] = from->moment.contact[model->row[k]];
  if (model->foot_rows > 1) memcpy(to->moment.share, from->moment.share, sizeof to->moment.share);
}

/* Returns whether a row's contacts are those of feet. */
static inline int hx_is_of_foot(int row) { return row < HX_KNEE; }

/* Returns whether a row's contacts are those of feet with blocks beside them. */
static inline int hx_is_wall(int row) { return row >= HX_WALL && row < HX_KNEE; }

/* Returns whether a row's contacts are those of pairs of legs. */
static inline int hx_is_of_pair(int row) { return row >= HX_PAIR; }

/* Returns how many slots of a row of contacts hold one. */
static inline int hx_slots_of(int row) { return row == HX_TORSO ? HX_SLOTS : HX_LEGS; }

/* Return the neighbours of a slot's leg around the torso: LF LM LR RR RM RF. Slots past the last
 * leg hold leg 0. */
static inline int hx_next_leg(int slot) {
  static const int next[HX_SLOTS] = {1, 2, 5, 0, 3, 4, 1, 1};
  return next[slot];
}
static inline int hx_previous_leg(int slot) {
  static const int previous[HX_SLOTS] = {3, 0, 1, 4, 5, 2, 3, 3};
  return previous[slot];
}

/* Copies leg 0 into the slots past the last leg, so that every lane holds a physical leg. */
static inline void hx_fill_slots(double *slots) {
  for (int slot = HX_LEGS; slot < HX_SLOTS; ++slot) slots[slot] = slots[0];
}

#endif
