/* dynamics.h - eq. 1 solved exactly in O(n): Newton-Euler with multipliers and Baumgarte on the tree of 19 bodies */
#ifndef HX_DYNAMICS_H
#define HX_DYNAMICS_H

#include "actuator.h"
#include "contact.h"
#include "kinematics.h"

/* What the O(n) sweeps of eq. 11-12 keep of joint k, about the torso's centre of mass. */
typedef struct {
  hxMotion6 S;      /* (s, P x s) */
  hxForce6 U;       /* I S, I the articulated inertia of the child with all it carries */
  hxReal inverse_d; /* 1/d; 0 where the joint is driven kinematically */
} hxSweep;

typedef struct {
  hxJointKinematics kin;
  hxVec3 P, c;         /* the joint's point and the child's centre of mass from the torso's, along the chain: r + sum of s_i^P - s_j^P */
  hxSweep sweep;
  hxServo servo;
  hxReal mass;
  hxSym3 J;            /* child's inertia, world axes, about its centre of mass */
  hxInertia6 inertia;  /* the same about the torso's centre of mass */
  hxForce6 applied;    /* on the child at its centre of mass: gravity, gyroscopic, contact; not the servo */
  hxReal torque;       /* N m  on the joint's axis: servo and gear (kinematic mode: gear, then the drive's too) */
  hxReal driven;       /* rad/s2  the drive's qdd in kinematic mode, else 0 */
  hxMotion6 bias;      /* a_k of eq. 10 summed from the hip to here, with S qdd in kinematic mode */
  hxReal u;            /* torque - S.p */
  hxReal qdd;
  hxMotion6 acceleration; /* of the child at its centre of mass */
  hxVec3 lambda_lin;   /* multipliers, rows 1-3 */
  hxReal lambda[2];    /* rows 4, 5 */
} hxJointWork;

typedef struct {
  hxFootKinematics kin;
  hxNormalForce normal;
  hxReal slip_speed;
  hxReal drag;         /* N s/m  size of the tangential force over the slip speed */
  hxVec3 slip, force;  /* m/s, N  tangential velocity, ground on foot */
} hxFootWork;

typedef struct {
  hxJointWork joint[HX_JOINTS];
  hxFootWork foot;
} hxLegWork;

typedef struct {
  hxBodyWork torso;
  hxSym3 torso_J;
  double torso_applied[6]; /* torque, force at the centre of mass */
  double torso_acceleration[6];
  hxLegWork pack[HX_PACKS];
} hxWork;

/* L D L^T of the torso's articulated 6 x 6. */
typedef struct {
  double L[6][6], inverse_d[6];
} hxTorsoFactor;

typedef struct {
  struct {
    hxQuat p;
    hxVec3 c;
    hxSweep sweep;
    hxReal stiffness, damping; /* servo */
  } joint[HX_JOINTS];
  hxVec3 arm, normal;
  hxReal stiffness, viscosity, drag; /* contact */
} hxImplicitLeg;

/* (M - h gamma G_v - (h gamma)^2 G_x) on the constraints, factorised: contact and servo stay inside the tree. */
typedef struct {
  hxQuat torso_p;
  hxTorsoFactor torso;
  hxImplicitLeg pack[HX_PACKS];
} hxImplicit;

/* Everything at (t, y): work, and dy/dt into rate. The multipliers are found when asked for, and in kinematic mode. */
HX_LOCAL void hx_dynamics_evaluate(const hxModel *model, const hxContactState *contact, const hxCommand *command, double t,
                                   const hxMotion *motion, int multipliers, hxWork *work, hxMotion *rate);

/* Puts the feet's stiffness, viscosity and drag where they will be after h: a foot that has just touched down has none yet, and a W without
 * them lets go of the very contact that it is there for. For hx_implicit_factorise only; forces and rates are not touched. */
HX_LOCAL void hx_foot_ahead(const hxModel *model, const hxContactState *contact, double h, hxWork *work);

/* Factorises W at the evaluated point; h_gamma = h gamma. */
HX_LOCAL void hx_implicit_factorise(const hxModel *model, const hxWork *work, double h_gamma, hxImplicit *implicit);

/* u of W u + D^T mu = G_v dv + G_x dx, D u = 0, in the velocity entries of u. dx and dv: positions of dx, velocities of dv. */
HX_LOCAL void hx_implicit_solve(const hxImplicit *implicit, const hxMotion *dx, const hxMotion *dv, hxMotion *u);

#endif
