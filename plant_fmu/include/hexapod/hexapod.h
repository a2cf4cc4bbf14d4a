/* hexapod.h - the plant: a six-legged robot of 19 rigid bodies and 18 revolute joints on compliant
 * ground.
 *
 * SI units. World frame W: z up when gravity is (0, 0, -g). Every vector is in world axes unless
 * said otherwise. Quaternions are [w x y z], body to world. Legs in the order LF LM LR RF RM RR,
 * joints (and the link each one moves) coxa, femur, tibia. Bodies: 0 = torso, 1 + 3 leg + joint =
 * link. Equation numbers: docs/equations.md.
 *
 * A plant has no pointers, no globals and no hidden state: its bytes are its state. After create
 * nothing allocates, prints or exits.
 */
#ifndef HEXAPOD_H
#define HEXAPOD_H

#include "hexapod/legs.h"
#include "hexapod/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
  HX_BODIES = 1 + HX_LEGS * HX_JOINTS,   /* 19 */
  HX_BODY_STATE = 13,                    /* r[3] p[4] v[3] w[3] */
  HX_MULTIPLIERS = 5,                    /* per joint */
  HX_CONE_BINS = 31                      /* of the shares of the friction cone that feet use */
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
  HX_FRICTION_BRISTLE
} hxFrictionLaw;

typedef enum hxTerrainKind { HX_TERRAIN_FLAT = 1, HX_TERRAIN_SLOPE } hxTerrainKind;

typedef enum hxServoMode { HX_SERVO_POSITION = 1, HX_SERVO_TORQUE, HX_SERVO_KINEMATIC } hxServoMode;

typedef enum hxProjection {
  HX_PROJECTION_NONE = 1,  /* the joints drift, held by the Baumgarte terms */
  HX_PROJECTION_STEP /* positions and velocities are put back on the joints after every step */
} hxProjection;

typedef enum hxMethod {
  HX_METHOD_ROSW3 = 1, /* linearly implicit W-method, order 3(2) */
  HX_METHOD_ROS2, /* linearly implicit W-method, order 2(1) */
  HX_METHOD_DP54, /* explicit Dormand-Prince, order 5(4) */
  HX_METHOD_BS32, /* explicit Bogacki-Shampine, order 3(2) */
  HX_METHOD_RK4 /* explicit classic, order 4, fixed step only */
} hxMethod;

/* One link: its frame sits at its own joint, and has the parent link's axes when the joint angle is
 * 0. */
typedef struct hxLink {
  double mass; /* kg         > 0 */
  double length; /* m          next joint (tibia: foot centre) along the link's x */
  double offset_y; /* m          the same point along y, 0 in most robots */
  double offset_z; /* m          the same point along z */
  double com[3]; /* m          centre of mass, link axes */
  double inertia[6]; /* kg m2      about the centre of mass, link axes: xx yy zz xy xz yz */
  double axis[3]; /* 1          joint axis, in the parent link's axes (coxa: hip axes); normalised
                     on use */
} hxLink;

typedef struct hxLeg {
  double hip_position[3]; /* m    coxa joint, torso axes, from the torso's origin */
  double hip_yaw; /* rad  hip frame: torso axes turned about z by this */
  hxLink link[HX_JOINTS];
} hxLeg;

/* The robot, the laws and the settings. hx_definition_default fills in the ATHENA-like robot. */
typedef struct hxDefinition {
  struct {
    double mass; /* kg */
    double com[3]; /* m      from the torso's origin, torso axes */
    double inertia[6]; /* kg m2  about the centre of mass, torso axes: xx yy zz xy xz yz */
  } torso;
  hxLeg leg[HX_LEGS];
  double foot_radius; /* m */
  struct {
    int law; /* hxContactLaw */
    double stiffness; /* N/m^1.5  K of eq. 14 */
    double restitution; /* 1        [0, 1]; the dissipative laws need > 0 */
    double damping_factor; /* s/m      c of the constant law F = K d^1.5 (1 + 1.5 c dd) */
    double impact_speed_floor; /* m/s      a slower touch-down counts as this fast */
  } contact;
  struct {
    int law; /* hxFrictionLaw */
    double mu; /* 1 */
    double slope; /* s/m  k_t of eq. 15, of the tanh law */
    double presliding; /* m    b_max of eq. 16, of the bristle law: a foot pushed this far slides */
    double bristle_damping; /* s    tau of eq. 17, of the bristle law: damping over stiffness */
    double mu_static; /* 1    of a foot that sticks, of the bristle law; 0: mu */
    double
        stribeck_speed; /* m/s  v_s of eq. 18, of the bristle law: half-way from mu_static to mu */
  } friction;
  struct {
    int mode; /* hxServoMode, all joints */
    double kp; /* N m/rad */
    double kd; /* N m s/rad */
    double torque_max; /* N m      at stall */
    double speed_max; /* rad/s    no-load speed: the torque-speed line ends here */
    double rotor_inertia; /* kg m2    seen at the joint */
    double coulomb_friction; /* N m      in the gear, regularised by tanh(speed / 0.05 rad/s) */
  } servo;
  struct {
    double alpha, beta; /* 1/s */
  } baumgarte;
  double gravity[3]; /* m/s2 */
  struct {
    int method; /* hxMethod */
    double step; /* s   > 0: fixed step; 0: error control */
    double tolerance; /* 1   of the error control */
    double step_max; /* s   of the error control */
    int projection; /* hxProjection */
  } solver;
  struct {
    int kind; /* hxTerrainKind */
    double height; /* m    of the ground at the world's origin */
    double incline; /* rad  of HX_TERRAIN_SLOPE: the ground rises along the heading */
    double heading; /* rad  about z, from x */
  } terrain;
  struct {
    double position[3]; /* m      torso's centre of mass */
    double quaternion[4]; /* 1      normalised on use */
    double velocity[3]; /* m/s */
    double angular_velocity[3]; /* rad/s */
    double angle[HX_LEGS][HX_JOINTS];
    double speed[HX_LEGS][HX_JOINTS];
  } initial;
} hxDefinition;

/* What the outside does to the robot; held constant over a step. */
typedef struct hxInput {
  double angle_ref[HX_LEGS][HX_JOINTS]; /* rad */
  double speed_ref[HX_LEGS][HX_JOINTS]; /* rad/s */
  double torque_ref[HX_LEGS][HX_JOINTS]; /* N m   feed-forward */
  double push_force[3]; /* N     at the torso's centre of mass */
  double push_torque[3]; /* N m */
  double acceleration_ref[HX_LEGS][HX_JOINTS]; /* rad/s2  of kinematic drives alone */
} hxInput;

/* What the robot shows. Booleans are ints. */
typedef struct hxOutput {
  double time; /* s */
  double angle[HX_LEGS][HX_JOINTS]; /* rad */
  double speed[HX_LEGS][HX_JOINTS]; /* rad/s */
  double torque[HX_LEGS]
               [HX_JOINTS]; /* N m    motor on child (kinematic mode: the drive's multiplier) */
  double positive_work[HX_LEGS][HX_JOINTS]; /* J      of the motor on the joint where it drives,
                                               since the start */
  double negative_work[HX_LEGS][HX_JOINTS]; /* J      where it brakes, >= 0 */
  double torque_squared[HX_LEGS][HX_JOINTS]; /* N2 m2 s  integral of the motor torque's square since
                                                the start */
  double reaction_force[HX_LEGS][HX_JOINTS][3]; /* N      joint on child */
  double reaction_torque[HX_LEGS][HX_JOINTS]
                        [3]; /* N m    joint on child, about the joint's point */
  struct {
    double force[HX_LEGS][3]; /* N    ground on foot */
    double normal_force[HX_LEGS]; /* N */
    double tangential_force[HX_LEGS]; /* N    size */
    double position[HX_LEGS][3]; /* m    contact point: the foot's lowest towards the ground */
    double velocity[HX_LEGS][3]; /* m/s  of the foot's material point there */
    double slip_speed[HX_LEGS]; /* m/s  tangential part of it */
    double bristle[HX_LEGS][3]; /* m    b of eq. 16, the bristle law's; 0 with others */
    double penetration[HX_LEGS]; /* m    < 0: clearance */
    double impact_speed[HX_LEGS]; /* m/s  at the last touch-down */
    double slip_distance[HX_LEGS]; /* m    along the ground while the foot bears more than 1 % of
                                      the weight, since the start */
    double impulse[HX_LEGS]; /* N s  integral of the normal force since the start */
    double peak_force[HX_LEGS]; /* N    largest normal force of the last step, a call of
                                   hx_plant_step */
    double peak_force_rate[HX_LEGS]; /* N/s  steepest rise of the normal force in the last step */
    double landing_rate[HX_LEGS]; /* N/s  largest rise over 1 ms within 20 ms after the last
                                     touch-down */
    double landings[HX_LEGS]; /* 1    touch-downs since the start */
    int contact[HX_LEGS];
  } foot;
  struct {
    double position[3], quaternion[4]; /* m, 1     centre of mass, attitude */
    double roll, pitch, yaw; /* rad      z-y-x */
    double velocity[3]; /* m/s */
    double angular_velocity[3]; /* rad/s */
  } torso;
  struct {
    double specific_force[3]; /* m/s2   torso axes, at the centre of mass */
    double angular_velocity[3]; /* rad/s  torso axes */
  } imu;
  struct {
    double kinetic; /* J  bodies and rotors */
    double potential; /* J  gravity and the elastic part of the contacts */
    double actuator_work; /* J  by the motors on the joints, since start */
    double push_work; /* J  by push_force and push_torque */
    double dissipated; /* J  in contact, friction (with what bristles hold) and gears */
    double contact_loss; /* J  its part in the normal contact */
    double friction_loss; /* J  its part in friction */
    double gear_loss; /* J  its part in the gears */
    double residual; /* J  stored - stored at start - work + dissipated: what the books do not
                        explain */
  } energy;
  struct {
    double position_error; /* m or 1          norm of Phi */
    double velocity_error; /* m/s or 1/s      norm of dPhi/dt */
  } constraint;
  struct {
    double evaluations, steps, rejected, touchdowns; /* 1, since start */
  } solver;
  double cone_time[HX_CONE_BINS]; /* s  of all feet under load since the start, by |f_t|/(mu f_n):
                                     from 0.9 (i/30)^2 on, the last from 0.9 on */
} hxOutput;

/* The least numbers that tell where everything is: the torso as it is, joints by angle and speed.
 * Of doubles alone, in this order the continuous states of model exchange. The same structure holds
 * their rates, and changes of either. */
typedef struct hxCoordinates {
  double position[3], quaternion[4]; /* m, 1      torso's centre of mass and attitude; the
                                        quaternion need not have unit length */
  double velocity[3]; /* m/s */
  double angular_velocity[3]; /* rad/s     world axes */
  double angle[HX_LEGS][HX_JOINTS]; /* rad */
  double speed[HX_LEGS][HX_JOINTS]; /* rad/s */
  double actuator_work; /* J */
  double push_work; /* J */
  double dissipated; /* J */
  double bristle[HX_LEGS][3]; /* m         world axes; 0 and at rest but with the bristle law */
} hxCoordinates;

enum { HX_COORDINATES = sizeof(hxCoordinates) / sizeof(double) };

typedef struct hxPlant hxPlant;

HX_API void hx_definition_default(hxDefinition *definition);
HX_API void hx_input_default(hxInput *input); /* the ATHENA-like robot's standing pose */

/* The ranges of every number in either structure; returns how many there are. */
HX_API size_t hx_definition_ranges(const hxRange **range);
HX_API size_t hx_input_ranges(const hxRange **range);

/* Checks a definition. On failure message (HX_MESSAGE_SIZE bytes, may be NULL) says what, got,
 * expected. */
HX_API hxStatus hx_definition_check(const hxDefinition *definition, char *message);

/* Allocates a plant holding the default robot in its initial state; NULL when out of memory. */
HX_API hxPlant *hx_plant_create(void);
HX_API void hx_plant_destroy(hxPlant *plant);

/* Puts the robot of a definition into its initial state at time t. On failure the plant is
 * unchanged but for its message. */
HX_API hxStatus hx_plant_reset(hxPlant *plant, const hxDefinition *definition, double t);

/* Integrates to t_end >= time, exactly. On failure the plant is as it was before the call, but for
 * its message. */
HX_API hxStatus hx_plant_step(hxPlant *plant, const hxInput *input, double t_end);

/* The same under an input that changes at a rate, per second; NULL: it is held. In kinematic mode a
 * rate of angle_ref takes the place of what speed_ref moves the drives by, and a rate of speed_ref
 * that of acceleration_ref. */
HX_API hxStatus hx_plant_step_ramp(hxPlant *plant, const hxInput *input, const hxInput *rate,
                                   double t_end);

/* hx_plant_step, but *event tells whether a foot touched down or lifted off, and with stop the call
 * ends there, hx_plant_time says when. Going on under the same input to the same end gives, bit for
 * bit, what the call would have given without the stop. */
HX_API hxStatus hx_plant_step_to_event(hxPlant *plant, const hxInput *input, double t_end, int stop,
                                       int *event);

/* Everything there is to see at the present time under this input. */
HX_API void hx_plant_output(hxPlant *plant, const hxInput *input, hxOutput *output);

HX_API double hx_plant_time(const hxPlant *plant);
HX_API const char *hx_plant_message(const hxPlant *plant); /* of the last failure, "" before any */

/* The plant's bytes: size, copy out, copy in (checked: HX_BAD_STATE leaves the plant as it was). */
HX_API size_t hx_plant_state_size(void);
HX_API void hx_plant_get_state(const hxPlant *plant, void *bytes);
HX_API hxStatus hx_plant_set_state(hxPlant *plant, const void *bytes, size_t size);

/* For solvers of others: y' = f(t, y, u) in coordinates, between touch-downs and lift-offs. The
 * importer looks for sign changes of the feet's indicators, > 0 for feet that touch the ground and
 * < 0 for others, and then has the contacts updated. */
HX_API void hx_plant_get_coordinates(const hxPlant *plant, hxCoordinates *x);
HX_API hxStatus hx_plant_set_coordinates(
    hxPlant *plant, double t, const hxCoordinates *x); /* contacts stay; HX_NOT_FINITE: no state */

/* Tells the plant that the solver's step to the present coordinates is completed. Peaks, integrals
 * and losses of hxOutput are those of the path between two such calls; without them they stand
 * still. The works in the coordinates are the solver's own. */
HX_API void hx_plant_completed_step(hxPlant *plant, const hxInput *input);

HX_API void hx_plant_rates(const hxPlant *plant, const hxInput *input, hxCoordinates *rate);
HX_API void hx_plant_indicators(const hxPlant *plant,
                                double indicator[HX_LEGS]); /* m  penetration, but for a tenth of a
                                                               nanometre (docs/equations.md) */
HX_API int hx_plant_update_contacts(hxPlant *plant); /* touch-downs and lift-offs that are due;
                                                        whether coordinates changed (bristles) */

/* What small changes of input and coordinates make of rates and outputs: derivatives along that
 * direction, exact to rounding (complex arithmetic, lanes/complex_step.h), contacts held; contact
 * and the solver's counts have none. Either change may be NULL, for none, and so may either result.
 * HX_INVALID_ARGUMENT where the compiler has no complex numbers (MSVC). */
HX_API hxStatus hx_plant_tangent(hxPlant *plant, const hxInput *input, const hxInput *d_input,
                                 const hxCoordinates *dx, hxCoordinates *d_rate,
                                 hxOutput *d_output);

/* Sets the rates per second, at the present time under this input, of those outputs that are
 * integrals since the start: works, squared torques, slip, impulses, losses. Peaks stay as they are
 * within a call, so their rates are set to 0. */
HX_API void hx_plant_integral_rates(hxPlant *plant, const hxInput *input, hxOutput *rate);

/* For multibody researchers: the bodies' states, drifted joints allowed, and eq. 1 solved for them.
 */
HX_API void hx_plant_get_bodies(const hxPlant *plant, double body[HX_BODIES][HX_BODY_STATE]);
HX_API hxStatus hx_plant_set_bodies(hxPlant *plant, const double body[HX_BODIES][HX_BODY_STATE]);
HX_API void hx_plant_accelerations(hxPlant *plant, const hxInput *input,
                                   double acceleration[HX_BODIES][6], /* m/s2 then rad/s2 */
                                   double multiplier[HX_BODIES - 1][HX_MULTIPLIERS],
                                   double drive_torque[HX_BODIES - 1]); /* N m */

#ifdef __cplusplus
}
#endif
#endif
