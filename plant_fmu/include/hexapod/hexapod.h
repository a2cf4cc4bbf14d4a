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
  HX_MULTIPLIERS = 5,                  /* per joint */
  HX_CONE_BINS = 31                    /* bins of the share of the friction cone that feet use */
};

typedef enum hxContactLaw {
  HX_CONTACT_EXACT_RESTITUTION = 1,
  HX_CONTACT_FLORES,
  HX_CONTACT_LANKARANI_NIKRAVESH,
  HX_CONTACT_HUNT_CROSSLEY,
  HX_CONTACT_CONSTANT_DAMPING,
  HX_CONTACT_HERTZ
} hxContactLaw;

typedef enum hxFrictionLaw {
  HX_FRICTION_TANH = 1,
  HX_FRICTION_NONE,
  HX_FRICTION_BRISTLE,
  HX_FRICTION_LUGRE
} hxFrictionLaw;

typedef enum hxTerrainKind {
  HX_TERRAIN_FLAT = 1,
  HX_TERRAIN_SLOPE,
  HX_TERRAIN_GRID /* an hxTerrain, see hx_plant_set_terrain */
} hxTerrainKind;

typedef enum hxSoilLaw {
  HX_SOIL_NONE = 1,
  HX_SOIL_BEKKER,
  HX_SOIL_GRANULAR,
  HX_SOIL_MUD
} hxSoilLaw;

/* Whether torso, knees and shanks touch the ground. */
typedef enum hxBodyContact { HX_BODY_OFF = 1, HX_BODY_ON } hxBodyContact;

/* Whether a run warns of legs that overlap. The plant ignores it: there is no force between legs.
 */
typedef enum hxSelfContact { HX_SELF_OFF = 1, HX_SELF_WARN, HX_SELF_FORCE } hxSelfContact;

typedef enum hxServoMode { HX_SERVO_POSITION = 1, HX_SERVO_TORQUE, HX_SERVO_KINEMATIC } hxServoMode;

/* What limits the servos' torque: the torque-speed line, or a motor's voltage and back-EMF. */
typedef enum hxServoDrive { HX_DRIVE_LINE = 1, HX_DRIVE_MOTOR } hxServoDrive;

typedef enum hxProjection {
  HX_PROJECTION_NONE = 1, /* joints drift; the Baumgarte terms limit the drift */
  HX_PROJECTION_STEP /* positions and velocities are projected onto the joints after every step */
} hxProjection;

typedef enum hxMethod {
  HX_METHOD_ROSW3 = 1, /* linearly implicit W-method, order 3(2) */
  HX_METHOD_ROS2,      /* linearly implicit W-method, order 2(1) */
  HX_METHOD_DP54,      /* explicit Dormand-Prince, order 5(4) */
  HX_METHOD_BS32,      /* explicit Bogacki-Shampine, order 3(2) */
  HX_METHOD_RK4        /* explicit classic, order 4, fixed step only */
} hxMethod;

/* One link. Its frame lies at its own joint and has the parent link's axes when the joint angle is
 * 0. */
typedef struct hxLink {
  double mass;       /* kg     > 0 */
  double length;     /* m      next joint (tibia: foot centre) along the link's x */
  double offset_y;   /* m      the same point along y, 0 in most robots */
  double offset_z;   /* m      the same point along z */
  double com[3];     /* m      centre of mass, link axes */
  double inertia[6]; /* kg m2  about the centre of mass, link axes: xx yy zz xy xz yz */
  double axis[3];    /* 1      parent link's axes (coxa: hip axes), normalised on use */
  double angle_min;  /* rad    the joint's stops are at angle_min and angle_max */
  double angle_max;  /* rad    > angle_min */
} hxLink;

typedef struct hxLeg {
  double hip_position[3]; /* m    coxa joint, torso axes, from the torso's origin */
  double hip_yaw;         /* rad  hip frame: torso axes rotated about z by this angle */
  hxLink link[HX_JOINTS];
} hxLeg;

/* Soft ground under the feet (eq. 40-47): its law and the numbers of all laws. */
typedef struct hxSoilDefinition {
  int law;                   /* hxSoilLaw; HX_SOIL_NONE: rigid ground */
  double frictional_modulus; /* N/m^(n+2)  Kphi of HX_SOIL_BEKKER */
  double cohesive_modulus;   /* N/m^(n+1)  Kc */
  double exponent;           /* 1          n */
  double resistance;         /* N/m3       unit of the three resistances of HX_SOIL_GRANULAR: */
  double alpha_down;         /* 1          of a horizontal plate that moves down */
  double alpha_side;         /* 1          of a plate on edge that moves down */
  double alpha_ahead;        /* 1          of a plate on edge that moves ahead */
  double yield_pressure;     /* Pa         of HX_SOIL_MUD, at the surface */
  double hardening;          /* Pa/m       its growth with depth */
  double cohesion;           /* Pa         c */
  double friction_angle;     /* rad        phi */
  double shear_displacement; /* m          K */
  double stiffness;          /* Pa/m       Ke of unloading */
  double damping;            /* Pa s/m     R */
} hxSoilDefinition;

/* The robot, its laws and its settings. hx_definition_default() fills in the ATHENA-like robot. */
typedef struct hxDefinition {
  struct {
    double mass;       /* kg */
    double com[3];     /* m      from the torso's origin, torso axes */
    double inertia[6]; /* kg m2  about the centre of mass, torso axes: xx yy zz xy xz yz */
  } torso;
  hxLeg leg[HX_LEGS];
  double foot_radius;       /* m */
  struct {                  /* spheres that touch the ground besides the feet; see hxTerrain */
    int contact;            /* hxBodyContact */
    int self_contact;       /* hxSelfContact */
    double torso_box[3];    /* m  half edges along the torso's axes of a box whose eight corners
                             *    touch the ground; 0 0 0: they do not */
    double torso_centre[3]; /* m  centre of the box from the torso's origin */
    double corner_radius;   /* m  of spheres at the box's corners; 0: points */
    double knee_radius;     /* m  of a sphere at the tibia's joint; 0: none; of the femur */
    double shank_radius;    /* m  of a sphere on the tibia's line; 0: none; of the tibia */
    double shank_position;  /* 1  its place, 0 at the joint, 1 at the foot's centre */
  } body;
  double foot_pad_radius; /* m  flat round pad of feet on soil; 0: the sphere */
  struct {
    int law;                   /* hxContactLaw */
    double stiffness;          /* N/m^1.5  K of eq. 14 */
    double restitution;        /* 1        [0, 1]; the dissipative laws need > 0 */
    double damping_factor;     /* s/m      c of the constant law F = K d^1.5 (1 + 1.5 c dd) */
    double impact_speed_floor; /* m/s      slower touch-downs use this speed */
  } contact;
  struct {
    int law;                /* hxFrictionLaw */
    double mu;              /* 1 */
    double slope;           /* s/m  k_t of eq. 15, tanh law, and of eq. 38 */
    double presliding;      /* m    b_max of eq. 16, 36: a foot pushed this far slides */
    double bristle_damping; /* s    tau of eq. 17, 37: damping of bristles over their stiffness */
    double mu_static;       /* 1    static friction; 0: mu */
    double stribeck_speed;  /* m/s  v_s of eq. 18: half-way from mu_static to mu */
    double viscous;         /* s/m  of eq. 35: coefficient added for each m/s of slip; 0: none */
    double spin_radius;     /* m    r_s of eq. 38: moment against spin over mu f_n; 0: none */
    double rolling_radius;  /* m    r_r of eq. 38: moment against rolling over f_n; 0: none */
  } friction;
  struct {
    int mode;                /* hxServoMode, all joints */
    int drive;               /* hxServoDrive */
    double kp;               /* N m/rad */
    double kd;               /* N m s/rad */
    double torque_max;       /* N m      at stall, of HX_DRIVE_LINE */
    double speed_max;        /* rad/s    no-load speed, where the torque-speed line ends */
    double rotor_inertia;    /* kg m2    seen at the joint */
    double coulomb_friction; /* N m      in the gear, regularised by tanh(speed/friction_speed) */
    double stop_stiffness;   /* N m/rad    k of the joints' stops (eq. 39); 0: no stops */
    double stop_damping;     /* N m s/rad  c of eq. 39 */
    /* of HX_DRIVE_MOTOR (eq. 48), seen at the joint */
    double voltage;         /* V      of the supply */
    double duty_max;        /* 1      largest duty: the motor gets at most duty_max voltage */
    double torque_constant; /* N m/A  k_t */
    double resistance;      /* ohm    R */
    /* friction of motor and gear besides coulomb_friction (eq. 49, 50) */
    double viscous_friction;                /* N m s/rad  K_v */
    double stribeck_friction;               /* N m        K_cs */
    double motor_load_friction;             /* 1          K_m */
    double external_load_friction;          /* 1          K_e */
    double stribeck_motor_load_friction;    /* 1          K_ms */
    double stribeck_external_load_friction; /* 1          K_es */
    double quadratic_motor_friction;        /* 1/(N m)    K_mq */
    double quadratic_external_friction;     /* 1/(N m)    K_eq */
    double stribeck_speed;                  /* rad/s      w_s */
    double stribeck_exponent;               /* 1          a */
    double friction_speed;                  /* rad/s      w_f: dry friction saturates there */
    /* heat of HX_DRIVE_MOTOR (eq. 52), and its supply (eq. 53) */
    double winding_capacity;   /* J/K  heat capacity of a winding; 0: no heating */
    double housing_capacity;   /* J/K  of a housing, > 0 */
    double winding_to_housing; /* K/W  thermal resistance */
    double housing_to_air;     /* K/W */
    double air_temperature;    /* K */
    double start_temperature;  /* K    of windings and housings at the start */
    double derate_temperature; /* K    of a winding: hotter ones lower the duty limit */
    double temperature_max;    /* K    there it is 0; > derate_temperature */
    double supply_resistance;  /* ohm  of the battery and its cables */
    /* how commands reach the servos, but in kinematic mode */
    double bus_period;   /* s    from one transmission to the next; 0: at every call */
    double command_step; /* rad  angles are rounded to multiples of it; 0: they are not */
    /* gear between rotor and link, but in kinematic mode (eq. 54-56) */
    double gear_stiffness; /* N m/rad    0: rigid; else rotor_inertia is > 0 */
    double gear_damping;   /* N m s/rad */
    double backlash;       /* rad        play of the elastic gear, from side to side */
    double gear_ratio;     /* 1  turns of the rotor for one of the joint, < 0: against it; 0: the
                            *    rotor's angular momentum is left out (eq. 57, 58) */
  } servo;
  struct {
    double alpha, beta; /* 1/s */
  } baumgarte;
  double gravity[3]; /* m/s2 */
  struct {
    int method;       /* hxMethod */
    double step;      /* s   > 0: fixed step; 0: error control */
    double tolerance; /* 1   of the error control */
    double step_max;  /* s   of the error control */
    int projection;   /* hxProjection */
  } solver;
  struct {
    int kind;       /* hxTerrainKind */
    double height;  /* m    of the ground at the world's origin, of a grid's zero */
    double incline; /* rad  of HX_TERRAIN_SLOPE: the ground rises along the heading */
    double heading; /* rad  about z, from x */
    double grid;    /* 1    which grid of an FMU's resources; the plant itself ignores it */
  } terrain;
  hxSoilDefinition soil;
  struct {
    double position[3];         /* m      torso's centre of mass */
    double quaternion[4];       /* 1      normalised on use */
    double velocity[3];         /* m/s */
    double angular_velocity[3]; /* rad/s */
    double angle[HX_LEGS][HX_JOINTS];
    double speed[HX_LEGS][HX_JOINTS];
  } initial;
} hxDefinition;

/* Inputs of the robot, constant over a step unless a rate is given. */
typedef struct hxInput {
  double angle_ref[HX_LEGS][HX_JOINTS];        /* rad */
  double speed_ref[HX_LEGS][HX_JOINTS];        /* rad/s */
  double torque_ref[HX_LEGS][HX_JOINTS];       /* N m   feed-forward */
  double push_force[3];                        /* N     at the torso's centre of mass */
  double push_torque[3];                       /* N m */
  double acceleration_ref[HX_LEGS][HX_JOINTS]; /* rad/s2  kinematic drives only */
} hxInput;

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
    double kinetic;       /* J  bodies and rotors */
    double potential;     /* J  gravity and the elastic parts of contacts, stops and gears */
    double actuator_work; /* J  by the motors on the joints */
    double push_work;     /* J  by push_force and push_torque */
    double dissipated;    /* J  in contact, friction (with bristles' energy) and gears */
    double contact_loss;  /* J  in the normal contact */
    double friction_loss; /* J  in friction */
    double gear_loss;     /* J  in the gears and at the joints' stops */
    double residual;      /* J  stored - stored at start - works + dissipated: audit error */
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
  double gear_deflection[HX_LEGS][HX_JOINTS]; /* rad    rotor less link; 0 of a rigid gear */
  double motor_speed[HX_LEGS][HX_JOINTS];     /* rad/s  of the rotor, seen at the joint */
  hxIndicators depth; /* m  of all contacts, < 0: clearance; -1 where the robot has none */
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

/* Returns HX_OK if hxCoordinates are the whole state of the robot. With elastic gears they are not:
 * model exchange and derivatives are then refused with HX_INVALID_ARGUMENT and a message as above.
 */
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

/* Advances the plant to t_end >= time, exactly. On failure only the plant's message changes. */
HX_API hxStatus hx_plant_step(hxPlant *plant, const hxInput *input, double t_end);

/* Does the same with an input that changes at a rate, per second (NULL: constant). In kinematic
 * mode a rate of angle_ref replaces the motion by speed_ref, and a rate of speed_ref replaces
 * acceleration_ref. */
HX_API hxStatus hx_plant_step_ramp(hxPlant *plant, const hxInput *input, const hxInput *rate,
                                   double t_end);

/* Does the same as hx_plant_step and sets *event to whether a foot touched down or lifted off.
 * With stop the call ends at the first such event; hx_plant_time() returns its time. A second call
 * with the same input and end gives, bit for bit, the result of a call without stop. */
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

/* Computes derivatives of rates and outputs along a direction of input and coordinates, with
 * contacts held. They are exact to rounding (complex step, lanes/complex_step.h); contact flags
 * and the solver's counters have derivative 0. Changes and results may be NULL. Returns
 * HX_INVALID_ARGUMENT where the compiler has no complex numbers (MSVC), and with elastic gears. */
HX_API hxStatus hx_plant_tangent(hxPlant *plant, const hxInput *input, const hxInput *d_input,
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
