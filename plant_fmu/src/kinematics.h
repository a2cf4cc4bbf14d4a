/* kinematics.h - positions, velocities and constraint equations of the joints and feet of one pack of legs */
#ifndef HX_KINEMATICS_H
#define HX_KINEMATICS_H

#include "spatial.h"
#include "state.h"
#include "terrain.h"

/* A body here and now; the torso's is the same in every lane. */
typedef struct {
  hxVec3 r, v, w; /* centre of mass, its velocity, angular velocity */
  hxQuat p;
  hxMat3 R;       /* R_WB */
} hxBodyWork;

/* Joint k between parent i and child j, eq. 2-3. World axes. */
typedef struct {
  hxBodyWork body;        /* the child */
  hxVec3 sP_i, sP_j;      /* centres of mass to the joint's point */
  hxVec3 s;               /* axis, fixed in i */
  hxVec3 u1, u2;          /* a x s, b x s: rows 4 and 5 of D act on w_j - w_i through them */
  hxVec3 u2_s, s_u1;      /* u2 x s, s x u1: with 1/det the dual basis of (u1, u2, s) */
  hxReal inverse_det;     /* 1 / (u1 . u2 x s) */
  hxReal angle, speed;    /* rad, rad/s */
  hxVec3 phi_lin, dphi_lin, gamma_lin; /* constraint, its rate, gamma: rows 1-3 */
  hxReal phi[2], dphi[2], gamma[2];    /* rows 4, 5 */
} hxJointKinematics;

typedef struct {
  hxVec3 arm;          /* tibia's centre of mass to the contact point */
  hxVec3 point, velocity, normal;
  hxReal delta, ddelta; /* penetration, approach speed */
} hxFootKinematics;

HX_LOCAL hxBodyWork hx_torso_work(const hxMotion *motion);
HX_LOCAL void hx_joint_kinematics(const hxJointModel *model, const hxMotion *motion, int joint, int slot, const hxBodyWork *parent,
                                  hxJointKinematics *k);
HX_LOCAL void hx_foot_kinematics(const hxModel *model, int slot, const hxBodyWork *tibia, hxFootKinematics *foot);

/* Penetration and approach speed of every foot. */
HX_LOCAL void hx_feet(const hxModel *model, const hxMotion *motion, double delta[HX_SLOTS], double ddelta[HX_SLOTS]);

/* Rates of the positions, dr/dt = v and dp/dt = (0, w) p / 2, with p from one motion and v, w from another (or the same). */
HX_LOCAL void hx_position_rates(const hxMotion *at, const hxMotion *velocities, hxMotion *rate);

#endif
