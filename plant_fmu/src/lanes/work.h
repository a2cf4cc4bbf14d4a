/* work.h - intermediate results of an evaluation: joints, contacts and torso, rates, and
 * a stage's derivatives */
#ifndef HX_WORK_H
#define HX_WORK_H

#include "actuator.h"
#include "foot.h"
#include "kinematics.h"

/* Quantities of joint k in the O(n) sweeps of eq. 10. */
typedef struct {
  hxMotion6 S;      /* (s, P x s) */
  hxForce6 U;       /* I S, with I the articulated inertia of the child and all it carries */
  hxReal inverse_d; /* 1/d; 0 for a kinematic drive */
  hxReal u;         /* torque - S.p */
  hxVec3 passed; /* N m  torque that the rotor's motion needs of the parent (eq. 55): with spin */
} hxSweep;

/* A joint and its child. */
typedef struct {
  hxBody body;         /* the child */
  hxVec3 c;            /* m  child's centre of mass: sum of s_i^P - s_j^P */
  hxSym3 J;            /* child's inertia, world axes, about its centre of mass */
  hxVec3 gyroscopic;   /* -w x (J w) */
  hxReal angle, speed; /* rad, rad/s */
  hxReal torque;       /* N m  servo, gear and stop (kinematic mode: gear and drive) */
  hxReal driven;       /* rad/s2  acceleration of the drive in kinematic mode, else 0 */
  hxServo servo;
  hxStop stop;    /* set if the model has stops */
  hxMotion6 bias; /* a_k of eq. 8 summed from the hip (kinematic: with S qdd) */
  hxForce6 p;     /* force that the bias needs, less applied forces */
  hxSweep sweep;
  hxReal qdd;
  hxReal angle_shift, speed_shift; /* rad, rad/s  of eq. 20, without qdd's part */
  hxMotion6 acceleration;          /* a - g of the child at its centre of mass */
  struct {                         /* set if the rotors spin */
    hxReal carrier, acceleration;  /* rad/s2  the parent's about the axis, and the rotor's */
  } rotor;
  struct { /* computed for the multipliers on request */
    hxJointKinematics kin;
    hxVec3 lambda_lin; /* rows 1-3 */
    hxReal lambda[2];  /* rows 4, 5 */
  } reaction;
} hxJointWork;

enum { HX_LINES = 2 }; /* bodies of a leg that other legs may touch: femur and tibia */

typedef struct {
  hxJointWork joint[HX_JOINTS];
  int rows, row[HX_TIBIA_ROWS]; /* rows of contacts that this evaluation computes */
  hxContactWork contact[HX_TIBIA_ROWS];
  hxForce6 by_legs[HX_LINES]; /* of other legs, about the centres of mass; set if legs may touch */
} hxLegWork;

enum { HX_TORSO_PACKS = HX_SLOTS / HX_LANES }; /* packs that hold all contacts of the torso */

typedef struct {
  hxBody torso;
  hxSym3 torso_J;
  hxMotion6 torso_acceleration; /* a - g */
  int torso_rows;               /* 1: this evaluation computes the torso's contacts */
  hxContactWork torso_contact[HX_TORSO_PACKS];
  hxForce6 torso_p[HX_TORSO_PACKS]; /* less forces of the ground on the torso, as hxJointWork.p */
  hxLegWork pack[HX_PACKS];
  int pair_rows; /* 1: this evaluation computes contacts between legs */
  hxContactWork pair[HX_PAIR_ROWS][HX_PACKS]; /* of each leg with the next one */
} hxWork;

enum { HX_TURN_SIZE = 8 + HX_JOINTS * 3 * HX_SLOTS };

/* dy/dt, and the angular velocities that the quaternion rates stand for. The union gives the
 * integrator a vector. */
typedef union {
  hxNumber y[HX_TURN_SIZE + HX_MOTION_SIZE];
  struct {
    hxNumber torso_turn[8]; /* rad/s  padded to eight entries */
    hxNumber link_turn[HX_JOINTS][3][HX_SLOTS];
    hxPlantMotion motion;
  };
} hxRate;

/* Slopes of a row of contacts for all stages of a step. */
typedef struct {
  hxReal stiffness, viscosity, drag;
  hxReal bristle, relaxation; /* N/m, 1/s  stiffness/(1 + z beta); beta */
  hxReal spin, roll;          /* N m s  of the moment; set with spin or rolling friction */
} hxContactSlope;

/* Data of a stage of a linearly implicit method (eq. 19). The derivatives of contact and servo
 * forces are the first stage's; the other stages reuse them. */
typedef struct {
  double z;             /* h gamma */
  double ahead;         /* s  the contact's derivatives are taken this far ahead */
  const hxRate *change; /* sum of h g_ij k_j over earlier stages; NULL: the first stage */
  struct {
    hxReal motor_stiffness[HX_JOINTS], motor_damping[HX_JOINTS], gear_drag[HX_JOINTS];
    hxContactSlope contact[HX_TIBIA_ROWS];
    hxReal stop_stiffness[HX_JOINTS], stop_damping[HX_JOINTS]; /* set if the model has stops */
  } slope[HX_PACKS];
  hxContactSlope torso_slope[HX_TORSO_PACKS];
} hxImplicit;

#endif
