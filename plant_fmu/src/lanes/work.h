/* work.h - what an evaluation works on and leaves behind: joints, feet and torso of all packs,
 * rates, a stage's slopes */
#ifndef HX_WORK_H
#define HX_WORK_H

#include "actuator.h"
#include "foot.h"
#include "kinematics.h"

/* What the O(n) sweeps of eq. 10-11 keep of joint k. */
typedef struct {
  hxMotion6 S;      /* (s, P x s) */
  hxForce6 U;       /* I S, I the articulated inertia of the child with all it carries */
  hxReal inverse_d; /* 1/d; 0 where the joint is driven kinematically */
  hxReal u;         /* torque - S.p */
} hxSweep;

/* A joint and its child. */
typedef struct {
  hxBody body;            /* the child */
  hxVec3 c; /* the child's centre of mass along the chain: r + sum of s_i^P - s_j^P */
  hxSym3 J; /* child's inertia, world axes, about its centre of mass */
  hxVec3 gyroscopic; /* -w x (J w) */
  hxReal angle, speed; /* rad, rad/s */
  hxReal torque; /* N m  on the joint's axis: servo and gear (kinematic mode: gear, then the drive's
                    too) */
  hxReal driven; /* rad/s2  the drive's qdd in kinematic mode, else 0 */
  hxServo servo;
  hxMotion6 bias; /* the child's acceleration from a_k of eq. 8, summed from the hip to here, with S
                     qdd in kinematic mode */
  hxForce6 p; /* what that bias takes less what is applied */
  hxSweep sweep;
  hxReal qdd;
  hxReal turned,
      sped; /* rad, rad/s  shifts of angle and speed before this stage's own share (eq. 20) */
  hxMotion6 acceleration; /* a - g of the child at its centre of mass */
  struct { /* for the multipliers, when they are asked for */
    hxJointKinematics kin;
    hxVec3 lambda_lin; /* rows 1-3 */
    hxReal lambda[2]; /* rows 4, 5 */
  } reaction;
} hxJointWork;

typedef struct {
  hxJointWork joint[HX_JOINTS];
  hxFootWork foot;
  hxVec3 response; /* N  what a stage adds to the foot's force, but for the share of its own
                      acceleration */
  hxVec3 foot_moved,
      foot_sped; /* m, m/s  shifts of the contact point before this stage's own share (eq. 20) */
  hxVec3 bristle_force; /* N  what bristles add to friction in a stage, but for the contact point's
                           own share (eq. 21) */
} hxLegWork;

typedef struct {
  hxBody torso;
  hxSym3 torso_J;
  hxMotion6 torso_acceleration; /* a - g */
  hxLegWork pack[HX_PACKS];
} hxWork;

enum { HX_TURN_SIZE = 8 + HX_JOINTS * 3 * HX_SLOTS };

/* dy/dt, and the angular velocities that its quaternion rates stand for. The same doubles as a
 * vector for the integrator. */
typedef union {
  hxNumber y[HX_TURN_SIZE + HX_MOTION_SIZE];
  struct {
    hxNumber torso_turn[8]; /* the last five are padding */
    hxNumber link_turn[HX_JOINTS][3][HX_SLOTS];
    hxPlantMotion motion;
  };
} hxRate;

static inline int has_bristles(const hxModel *model) {
  return model->friction_law == HX_FRICTION_BRISTLE;
}

/* A stage of a linearly implicit method (eq. 19). The slopes of contact and servo are the first
 * stage's, kept for the others. */
typedef struct {
  double z; /* h gamma */
  double ahead; /* s  how far ahead the first stage looks for the contact's slopes */
  const hxRate
      *change; /* sum of h g_ij k_j over the stages before this one; NULL: the first stage */
  struct {
    hxReal motor_stiffness[HX_JOINTS], motor_damping[HX_JOINTS], gear_drag[HX_JOINTS];
    hxReal stiffness, viscosity, drag;
    hxReal bristle, yield; /* N/m, 1/s  bristles: stiffness over 1 + z yield (in drag too, z times),
                              how fast they let go */
  } slope[HX_PACKS];
} hxImplicit;

#endif
