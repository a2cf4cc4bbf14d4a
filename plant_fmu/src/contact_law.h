/* contact_law.h - damping of contacts (eq. 14): touch-down fixes it by the law and the impact
 * speed, and it holds until lift-off */
#ifndef HX_CONTACT_LAW_H
#define HX_CONTACT_LAW_H

#include "ground/soil.h"
#include "state.h"

HX_HIDDEN_BEGIN

/* Functions of a contact law; one row per hxContactLaw. */
typedef struct {
  double (*scale)(const hxDefinition *definition); /* constant of the law, stored in the model */
  double (*damping)(const hxModel *model, double impact_speed); /* d at touch-down, s/m */
} hxContactRow;

const hxContactRow *hx_contact(int law); /* NULL for an unknown law */

/* Returns chi of the law with exact restitution e in (0, 1] (eq. 14): chi (1 + e) = ln[(1 + chi)/(1
 * - chi e)]. */
double hx_exact_restitution_chi(double e);

/* Opens all contacts and holds no cells. */
void hx_contact_release(hxContactState *contact);

/* Sets the contacts at the start of a motion: those in the ground close with impact speed 0. */
void hx_contact_start(const hxModel *model, const hxDepths *depths, hxContactState *contact);

/* Returns whether feet stand on cells of blocks. */
int hx_has_cells(const hxModel *model);

/* Moves the held cells of feet that have left them to those that they are over; returns a bit for
 * each leg that did. */
int hx_contact_cross(const hxModel *model, const hxDepths *depths, hxContactState *contact);

/* Gives the contacts of legs that have crossed a border to the rows that they continue in: those
 * with the same depth and normal before and after, of several that with the largest share. A
 * contact that does not continue opens. */
void hx_contact_hand_over(const hxMoment *before, const hxMoment *after, int crossed,
                          hxContactState *contact);

/* Sets the ground's constants of all contacts to those of a changed model; contacts that are closed
 * keep their impact speeds. */
void hx_contact_tune(const hxModel *model, const hxDepths *depths, hxContactState *contact);

/* Sets the bristles of open feet to 0. */
void hx_contact_slacken(const hxContactState *contact, hxPlantMotion *motion);

/* Returns whether a contact has to be closed or opened. */
int hx_contact_is_due(const hxModel *model, const hxDepths *depths, const hxContactState *contact);

/* Closes open contacts that are in the ground and opens closed ones that are out of it; returns
 * the number of touch-downs. */
int hx_contact_switch(const hxModel *model, const hxDepths *depths, hxContactState *contact);

/* Gives feet's contacts with blocks that have just closed the damping and the impact speed of one
 * that was closed before and carries the same part of the foot: low steps cause no impacts. */
void hx_contact_continue_impacts(const hxModel *model, const hxMoment *at,
                                 const hxContactState *before, hxContactState *contact);

HX_HIDDEN_END

#endif
