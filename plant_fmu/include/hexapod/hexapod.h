/* hexapod.h - the plant: a six-legged robot of 19 rigid bodies and 18 revolute joints on compliant
 * ground
 *
 * SI units. World frame W: z up when gravity is (0, 0, -g). Vectors are in world axes unless
 * stated otherwise. Quaternions are [w x y z], body to world. Legs are in the order LF LM LR RF RM
 * RR, joints (and the link each one moves) in the order coxa, femur, tibia. Bodies: 0 = torso, 1 +
 * 3 leg + joint = link. Equation numbers refer to docs/equations.md.
 *
 * A plant has no hidden state, and the library has no globals: what hx_plant_get_state copies is
 * the whole state. After hx_plant_create no function allocates, prints or exits. Work space belongs
 * to the plant, so that a call needs less than 48 kB of stack, and one plant is for one thread at a
 * time.
 */
#ifndef HEXAPOD_H
#define HEXAPOD_H

#include "hexapod/generated/plant_settings.h"
#include "hexapod/legs.h"
#include "hexapod/status.h"
#include "hexapod/terrain.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
  HX_BODIES = 1 + HX_LEGS * HX_JOINTS, /* 19 */
  HX_CORNERS = 8,                      /* of the torso's box */
  HX_NEIGHBOUR_PAIRS = 4,              /* of lines of a leg and its next leg */
  HX_BODY_STATE = 13,                  /* r[3] p[4] v[3] w[3] */
  HX_MULTIPLIERS = 5                   /* per joint */
};

/* hxDefinition (generated/plant_settings.h) is the robot, its laws and its settings. A link's frame
 * lies at its own joint and has the parent link's axes when the joint angle is 0; the hip's frame
 * has the torso's axes, rotated about z by the hip's yaw. Inertia matrices are xx yy zz xy xz yz.
 * hxInput holds the inputs of the robot, constant over a step unless a rate is given. */

/* A number for each contact that events close and open. It consists of doubles only, in this order
 * the event indicators of model exchange. */
typedef struct hxIndicators {
  double foot[HX_LEGS], knee[HX_LEGS], shank[HX_LEGS];
  double torso[HX_CORNERS];
  double neighbour[HX_LEGS][HX_NEIGHBOUR_PAIRS]; /* with the next leg: femur with femur, with tibia,
                                                  * tibia with femur, with tibia */
} hxIndicators;

enum { HX_INDICATORS = sizeof(hxIndicators) / sizeof(double) };

/* Outputs of the robot. Booleans are ints. Integrals run from the start. */
typedef struct hxOutput {
  double time;                               /* s */
  double angle[HX_LEGS][HX_JOINTS];          /* rad */
  double speed[HX_LEGS][HX_JOINTS];          /* rad/s */
  double torque[HX_LEGS][HX_JOINTS];         /* N m     of the motor, or of the kinematic drive */
  double positive_work[HX_LEGS][HX_JOINTS];  /* J       of the motor where it drives */
  double negative_work[HX_LEGS][HX_JOINTS];  /* J       of the motor where it brakes, >= 0 */
  double torque_squared[HX_LEGS][HX_JOINTS]; /* N2 m2 s  integral of the squared torque */
  double reaction_force[HX_LEGS][HX_JOINTS][3];  /* N       joint on child */
  double reaction_torque[HX_LEGS][HX_JOINTS][3]; /* N m     the same, about the joint's point */
  struct {
    double force[HX_LEGS][3];         /* N    ground on foot */
    double normal_force[HX_LEGS];     /* N */
    double tangential_force[HX_LEGS]; /* N    size */
    double position[HX_LEGS][3];      /* m    contact point: the foot's lowest point */
    double velocity[HX_LEGS][3];      /* m/s  of the foot's material at the contact point */
    double slip_speed[HX_LEGS];       /* m/s  tangential part of the velocity */
    double bristle[HX_LEGS][3];       /* m    b of eq. 16, 36; 0 with other laws */
    double penetration[HX_LEGS];      /* m    < 0: clearance */
    double impact_speed[HX_LEGS];     /* m/s  at the last touch-down */
    double slip_distance[HX_LEGS];    /* m    slip under more than 1 % of the weight */
    double impulse[HX_LEGS];          /* N s  integral of the normal force */
    double peak_force[HX_LEGS];       /* N    largest normal force of the last hx_plant_step */
    double peak_force_rate[HX_LEGS];  /* N/s  steepest rise of the normal force in that step */
    double landing_rate[HX_LEGS];     /* N/s  largest rise over 1 ms of the last landing (20 ms) */
    double landings[HX_LEGS];         /* 1    touch-downs */
    double sinkage[HX_LEGS];          /* m    depth of the footprint under the foot, on soil */
    int contact[HX_LEGS];
  } foot;
  struct {
    double position[3], quaternion[4]; /* m, 1     centre of mass, attitude */
    double roll, pitch, yaw;           /* rad      z-y-x */
    double velocity[3];                /* m/s */
    double angular_velocity[3];        /* rad/s */
    double contact_force[3];           /* N        ground on the torso's corners */
  } torso;
  struct {
    double knee_force[HX_LEGS][3];  /* N  ground on the knee */
    double shank_force[HX_LEGS][3]; /* N  ground on the shank */
    double clearance[HX_LEGS]; /* m  from femur and tibia to those of the two neighbouring legs */
    double neighbour_force[HX_LEGS][3]; /* N  of these legs on femur and tibia */
  } body;
  struct {
    double specific_force[3];   /* m/s2   torso axes, at the centre of mass */
    double angular_velocity[3]; /* rad/s  torso axes */
  } imu;
  struct {
    double kinetic;        /* J  bodies and rotors */
    double potential;      /* J  gravity and the elastic parts of contacts and stops */
    double actuator_work;  /* J  by the motors on the joints */
    double push_work;      /* J  by push_force and push_torque */
    double dissipated;     /* J  in contact, friction (with bristles' energy) and gears */
    double contact_loss;   /* J  in the normal contact */
    double friction_loss;  /* J  in friction */
    double gear_loss;      /* J  in the gears and at the joints' stops */
    double residual;       /* J  stored - stored at start - works + dissipated: audit error */
    double parameter_work; /* J  by changes of tunable parameters */
  } energy;
  struct {
    double position_error; /* m or 1          norm of Phi */
    double velocity_error; /* m/s or 1/s      norm of dPhi/dt */
  } constraint;
  struct {
    double evaluations, steps, rejected, touchdowns; /* 1 */
  } solver;
  double footprints;              /* 1  made in soil since the start */
  double cone_time[HX_CONE_BINS]; /* s  feet under load, by |f_t|/(mu f_n): from 0.9 (i/30)^2 on */
  double current[HX_LEGS][HX_JOINTS];             /* A  of the motors; 0 with HX_DRIVE_LINE */
  double electrical_power[HX_LEGS][HX_JOINTS];    /* W  that they take from the supply; likewise */
  double winding_temperature[HX_LEGS][HX_JOINTS]; /* K */
  double housing_temperature[HX_LEGS][HX_JOINTS]; /* K */
  double remaining_rating[HX_LEGS][HX_JOINTS]; /* 1  of the winding's rise over the air, 0 to 1 */
  double supply_voltage; /* V  of all servos, under the currents at the start of the last call */
  hxIndicators depth;    /* m  of all contacts, < 0: clearance; -1 where the robot has none */
} hxOutput;

enum { HX_FOOTPRINTS = 512 }; /* footprints that a plant keeps; older ones are forgotten */

/* A footprint in soil, where a foot left its bottom for the last time. */
typedef struct hxFootprint {
  double x, y;   /* m  world axes */
  double depth;  /* m  plastic depth under the undisturbed surface */
  double radius; /* m  of the foot */
} hxFootprint;

/* Minimal coordinates: the torso's state, joint angles and speeds. It consists of doubles only, in
 * this order the continuous states of model exchange. The same structure holds rates and changes
 * of coordinates. */
typedef struct hxCoordinates {
  double position[3], quaternion[4]; /* m, 1   torso's centre of mass, attitude (any length > 0) */
  double velocity[3];                /* m/s */
  double angular_velocity[3];        /* rad/s  world axes */
  double angle[HX_LEGS][HX_JOINTS];  /* rad */
  double speed[HX_LEGS][HX_JOINTS];  /* rad/s */
  double actuator_work;              /* J */
  double push_work;                  /* J */
  double dissipated;                 /* J */
  double bristle[HX_LEGS][3];        /* m      world axes; 0 with other laws */
} hxCoordinates;

enum { HX_COORDINATES = sizeof(hxCoordinates) / sizeof(double) };

typedef struct hxPlant hxPlant;

HX_API void hx_definition_default(hxDefinition *definition);
HX_API void hx_input_default(hxInput *input); /* the ATHENA-like robot's standing pose */

/* Sets *range to the ranges of all numbers of the structure; returns how many there are. */
HX_API size_t hx_definition_ranges(const hxRange **range);
HX_API size_t hx_input_ranges(const hxRange **range);

/* Checks a definition. On failure message (HX_MESSAGE_SIZE bytes, may be NULL) says which value
 * was got and what was expected. */
HX_API hxStatus hx_definition_check(const hxDefinition *definition, char *message);

/* Returns HX_OK if hxCoordinates are the whole state of the robot. With a firmware that has a
 * memory they are not: model exchange and derivatives are then refused with HX_INVALID_ARGUMENT and
 * a message as above. */
HX_API hxStatus hx_definition_check_coordinates(const hxDefinition *definition, char *message);

/* Allocates a plant with the default robot in its initial state; NULL when out of memory. */
HX_API hxPlant *hx_plant_create(void);
HX_API void hx_plant_destroy(hxPlant *plant);

enum { HX_WORK_ALIGNMENT = 64 }; /* B  of the address of a work space */

/* A plant's calls use a work space, which carries nothing from one call to the next. Each plant has
 * its own. Many plants that one thread calls in turn can share one instead, which then stays in the
 * processor's fastest memory; results have the same bits.
 * hx_plant_use_work makes all later calls for the plant use the caller's memory: at least
 * hx_work_size() bytes at a multiple of HX_WORK_ALIGNMENT, else HX_INVALID_ARGUMENT, and only the
 * message changes. NULL returns the plant to its own. The plant never frees the memory and does not
 * save its address in states. It must live until the plant uses another one or is destroyed, and
 * two calls must not use it at the same time. */
HX_API size_t hx_work_size(void);
HX_API hxStatus hx_plant_use_work(hxPlant *plant, void *memory, size_t size);

/* Sets the ground of later resets to definitions whose terrain.kind is HX_TERRAIN_GRID; NULL: none.
 * The plant keeps the pointer, so the terrain must not be destroyed before the plant is, or is
 * reset on another ground. Saved states are refused by plants with another ground. */
HX_API void hx_plant_set_terrain(hxPlant *plant, const hxTerrain *terrain);

/* Sets a definition and its initial state at time t, s. On failure only the plant's message
 * changes. */
HX_API hxStatus hx_plant_reset(hxPlant *plant, const hxDefinition *definition, double t);

/* Changes parameters while the plant runs: those of a definition that plant_settings.h calls
 * tunable. The others must be as in the last reset. The pose and motion of all bodies stay,
 * contacts keep their impact speeds, and the energy that the change gives is booked as
 * parameter_work. On failure only the plant's message changes. */
HX_API hxStatus hx_plant_tune(hxPlant *plant, const hxDefinition *definition);

/* Advances the plant to t_end >= time, exactly. On failure only the plant's message changes. */
HX_API hxStatus hx_plant_step(hxPlant *plant, const hxInput *input, double t_end);

/* Does the same with an input that changes at a rate, per second (NULL: constant). In kinematic
 * mode a rate of angle_ref replaces the motion by speed_ref, and a rate of speed_ref replaces
 * acceleration_ref. */
HX_API hxStatus hx_plant_step_ramp(hxPlant *plant, const hxInput *input, const hxInput *rate,
                                   double t_end);

/* Does the same as hx_plant_step and sets *event to whether a foot touched down or lifted off.
 * With stop = 1 the call ends at the first such event, with 2 at the end of each step of the
 * solver; hx_plant_time() returns its time. Further calls with the same input and end give, bit for
 * bit, the result of a call without stop. */
HX_API hxStatus hx_plant_step_to_event(hxPlant *plant, const hxInput *input, double t_end, int stop,
                                       int *event);

/* Computes all outputs at the present time under this input. */
HX_API void hx_plant_output(hxPlant *plant, const hxInput *input, hxOutput *output);

/* Groups of outputs that are computed together. Bits. */
typedef enum hxOutputGroup {
  HX_OUTPUT_MOTION = 1,     /* time, supply_voltage, footprints, cone_time, solver; torso without
                             * contact_force; imu.angular_velocity */
  HX_OUTPUT_FORCES = 2,     /* angle, speed, torque; foot; torso.contact_force; body without
                             * clearance */
  HX_OUTPUT_SERVOS = 4,     /* the other numbers of joints and servos but for reactions */
  HX_OUTPUT_REACTIONS = 8,  /* reaction_force, reaction_torque; imu.specific_force */
  HX_OUTPUT_DISTANCES = 16, /* body.clearance; depth */
  HX_OUTPUT_AUDIT = 32,     /* energy; constraint */
  HX_OUTPUT_ALL = 63
} hxOutputGroup;

/* Computes some groups of outputs, hxOutputGroup, with the same bits as hx_plant_output, and leaves
 * the others as they are. Motion and forces take half of the time of all, motion a twelfth. */
HX_API void hx_plant_output_groups(hxPlant *plant, const hxInput *input, unsigned groups,
                                   hxOutput *output);

HX_API double hx_plant_time(const hxPlant *plant);
HX_API const char *hx_plant_message(const hxPlant *plant); /* "" before the first failure */

/* Copies the last footprints in soil, oldest first, at most `capacity` of them (NULL and 0: none);
 * returns how many the plant keeps, at most HX_FOOTPRINTS. */
HX_API size_t hx_plant_footprints(const hxPlant *plant, hxFootprint *footprint, size_t capacity);

/* Save and restore the plant as bytes. hx_plant_set_state checks them; HX_BAD_STATE: the plant is
 * unchanged. */
HX_API size_t hx_plant_state_size(void);
HX_API void hx_plant_get_state(const hxPlant *plant, void *bytes);
HX_API hxStatus hx_plant_set_state(hxPlant *plant, const void *bytes, size_t size);

/* Model exchange: y' = f(t, y, u) in coordinates, between touch-downs and lift-offs. The importer
 * locates sign changes of the feet's indicators, > 0 for feet that touch the ground and < 0 for
 * others, and then calls hx_plant_update_contacts. hx_plant_set_coordinates returns HX_NOT_FINITE
 * for numbers that are no state of the robot. */
HX_API void hx_plant_get_coordinates(const hxPlant *plant, hxCoordinates *x);
HX_API hxStatus hx_plant_set_coordinates(hxPlant *plant, double t,
                                         const hxCoordinates *x); /* contacts stay */

/* Reports that the importer's solver has completed its step to the present coordinates. Peaks,
 * integrals and losses of hxOutput belong to the path between two such calls and do not change
 * without them. The works in the coordinates are the solver's own. Feet touch and leave the walls,
 * edges and corners of blocks beside them, which have no indicators, at these calls. */
HX_API void hx_plant_completed_step(hxPlant *plant, const hxInput *input);

/* Compute the rates of the coordinates and the contacts' indicators, and switch the contacts that
 * are due. */
HX_API void hx_plant_rates(const hxPlant *plant, const hxInput *input, hxCoordinates *rate);
HX_API void hx_plant_indicators(const hxPlant *plant,
                                hxIndicators *indicator); /* m  penetration +- 0.1 nm */
HX_API int hx_plant_update_contacts(hxPlant *plant);      /* 1: bristles changed */

/* Locks and releases joints as the input's `lock` says, which steps do at their start; returns
 * whether one changed. A lock takes the joint's angle at that moment and holds it by stiff stops; a
 * release loses the energy in them. */
HX_API int hx_plant_update_locks(hxPlant *plant, const hxInput *input);

/* Computes derivatives of rates and outputs along a direction of input and coordinates, with
 * contacts held. They are exact to rounding (complex step, packs/complex_step.h); contact flags
 * and the solver's counters have derivative 0. Changes and results may be NULL. Returns
 * HX_INVALID_ARGUMENT where the compiler has no complex numbers (MSVC). */
HX_API hxStatus hx_plant_tangent(hxPlant *plant, const hxInput *input, const hxInput *d_input,
                                 const hxCoordinates *dx, hxCoordinates *d_rate,
                                 hxOutput *d_output);

/* A direction of tunable parameters: those in force, and their change, whose whole numbers have no
 * effect. Coordinates and bristles stay; a law that a parameter of 0 switches off stays off. */
typedef struct hxParameterChange {
  const hxDefinition *definition, *change;
} hxParameterChange;

/* Does the same along a direction of parameters, too (NULL: none). */
HX_API hxStatus hx_plant_tangent_by(hxPlant *plant, const hxInput *input,
                                    const hxParameterChange *parameters, const hxInput *d_input,
                                    const hxCoordinates *dx, hxCoordinates *d_rate,
                                    hxOutput *d_output);

/* Computes the rates, per second, of outputs that are integrals since the start, at the present
 * time under this input: works, squared torques, slip, impulses, losses. Rates of peaks are 0. */
HX_API void hx_plant_integral_rates(hxPlant *plant, const hxInput *input, hxOutput *rate);

/* Full body states, in which joints may have drifted, and accelerations by eq. 1. */
HX_API void hx_plant_get_bodies(const hxPlant *plant, double body[HX_BODIES][HX_BODY_STATE]);
/* Copies the torso's state alone, which costs a few nanoseconds. */
HX_API void hx_plant_get_torso(const hxPlant *plant, double torso[HX_BODY_STATE]);
HX_API hxStatus hx_plant_set_bodies(hxPlant *plant, const double body[HX_BODIES][HX_BODY_STATE]);
HX_API void hx_plant_accelerations(hxPlant *plant, const hxInput *input,
                                   double acceleration[HX_BODIES][6], /* m/s2 then rad/s2 */
                                   double multiplier[HX_BODIES - 1][HX_MULTIPLIERS],
                                   double drive_torque[HX_BODIES - 1]); /* N m */

#ifdef __cplusplus
}
#endif
#endif
