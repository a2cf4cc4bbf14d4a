/* robot.h - compiles a definition into a model and its initial state */
#ifndef HX_ROBOT_H
#define HX_ROBOT_H

#include "../state.h"

HX_HIDDEN_BEGIN

/* Computes the model of a checked definition; terrain: its ground if that is a grid. */
void hx_model_compile(hxModel *model, const hxDefinition *definition, const hxTerrain *terrain);

/* Computes the initial states of all bodies from the definition's torso and joint states; the
 * constraints are satisfied exactly. */
void hx_initial_bodies(const hxDefinition *definition, double body[HX_BODIES][HX_BODY_STATE]);

/* Convert between body states of hexapod.h, in link axes, and a motion, in joint axes. */
void hx_motion_from_bodies(const hxModel *model, const double body[HX_BODIES][HX_BODY_STATE],
                           hxPlantMotion *motion);
void hx_bodies_from_motion(const hxModel *model, const hxPlantMotion *motion,
                           double body[HX_BODIES][HX_BODY_STATE]);

/* laws.c */

/* Computes the part of a model that no geometry enters: friction, soil, servos, gears, solver.
 * The model's terrain is known. */
void hx_laws_compile(hxModel *model, const hxDefinition *d);

/* Returns the weight of all bodies, N. */
double hx_weight(const hxDefinition *d);

/* validation.c; hx_definition_check is public */

/* Checks the ranges of an input. message: HX_MESSAGE_SIZE bytes, written on failure only; may be
 * NULL. */
hxStatus hx_input_check(const hxInput *input, char *message);

/* frames.c: vectors and quaternions, and the frames of a definition's joints */

/* Computes out = a x b. */
void hx_vector_cross(const double a[3], const double b[3], double out[3]);

/* Computes out = a/|a| of n numbers and returns |a|. */
double hx_vector_normalise(const double *a, int n, double *out);

/* Computes the product out = a b of quaternions. */
void hx_quaternion_product(const double a[4], const double b[4], double out[4]);

/* Computes the conjugate of a quaternion. */
void hx_quaternion_conjugate(const double p[4], double out[4]);

/* Computes out = R(p) a, p of unit length: a + 2 w (u x a) + 2 u x (u x a). */
void hx_vector_rotate(const double p[4], const double a[3], double out[3]);

/* Computes two unit normals of a unit axis: a = axis x e with the coordinate direction e of the
 * axis's smallest component (the first of equal ones), b = axis x a. */
void hx_axis_normals(const double axis[3], double a[3], double b[3]);

/* Copies the position of the next joint or the foot in link axes. */
void hx_link_tip(const hxLink *link, double tip[3]);

/* Computes the joint's point from the parent's centre of mass, in the parent link's axes. */
void hx_joint_on_parent(const hxDefinition *d, int leg, int joint, double point[3]);

/* Computes the rotation q_PL of a link in its parent's axes at angle 0: the hip's yaw for the coxa,
 * identity for the others. */
void hx_zero_turn(const hxDefinition *d, int leg, int joint, double q_PL[4]);

/* Computes the rotation q_Lj of the joint's axes (x = a, y = b, z = axis) in the link's; identity
 * for the torso. */
void hx_joint_frame(const hxDefinition *d, int leg, int joint, double q_Lj[4]);

HX_HIDDEN_END

#endif
