/* sharing.h - shares of the faces, edges and corners of blocks that carry the same part of a foot
 * (eq. 59); models/contact/geometry.py is the readable form. For numbers with and without
 * a derivative. */
#ifndef HX_SHARING_H
#define HX_SHARING_H

#include "../packs/lanes.h"
#include "surface.h"

enum { HX_SHARERS = HX_FACE_NEAREST }; /* faces of blocks in contact with a foot at once, at most */

/* Contacts of one sphere that share its force. */
typedef struct {
  int count;
  hxNumber depth[HX_SHARERS];     /* m  > 0 */
  hxNumber normal[HX_SHARERS][3]; /* 1  out of the ground */
} hxSharers;

static inline hxNumber number_root(hxNumber x) { return hx_lane(hx_sqrt(hx_splat(x)), 0); }

/* Returns G_ij = (n_i . n_j) phi(|n_i - n_j|/rho) (eq. 59); reach: 1/rho^2. */
static inline hxNumber overlap(const hxNumber a[3], const hxNumber b[3], hxNumber reach) {
  hxNumber square = 0.0;
  for (int i = 0; i < 3; ++i) square += (a[i] - b[i]) * (a[i] - b[i]);
  if (hx_re(square * reach) >= 1.0) return 0.0;
  const hxNumber rest = 1.0 - number_root(square * reach), two = rest * rest;
  if (hx_re(rest) <= 0.0) return 0.0;
  return (1.0 - 0.5 * square) * (two * two) * (5.0 - 4.0 * rest);
}

/* A choice of contacts that carry, the others have the share 0: the solution of G lambda = delta of
 * the chosen ones by G = L D L^T. */
typedef struct {
  int size, chosen[HX_SHARERS];
  hxNumber lambda[HX_SHARERS]; /* m */
} hxCarriers;

/* Solves for a choice; returns 0 if two of its contacts are one, or one of them would pull. */
static inline int solve_carriers(const hxNumber G[HX_SHARERS][HX_SHARERS], const hxNumber *depth,
                                 hxCarriers *at) {
  const double singular = 1e-9; /* 1  least pivot of contacts that count as different */
  hxNumber L[HX_SHARERS][HX_SHARERS], D[HX_SHARERS], y[HX_SHARERS];
  for (int i = 0; i < at->size; ++i) {
    D[i] = G[at->chosen[i]][at->chosen[i]];
    y[i] = depth[at->chosen[i]];
    for (int j = 0; j < i; ++j) {
      L[i][j] = G[at->chosen[i]][at->chosen[j]];
      for (int k = 0; k < j; ++k) L[i][j] -= L[i][k] * D[k] * L[j][k];
      L[i][j] /= D[j];
      D[i] -= L[i][j] * L[i][j] * D[j];
      y[i] -= L[i][j] * y[j];
    }
    if (!(hx_re(D[i]) > singular)) return 0;
  }
  for (int i = at->size - 1; i >= 0; --i) {
    at->lambda[i] = y[i] / D[i];
    for (int j = i + 1; j < at->size; ++j) at->lambda[i] -= L[j][i] * at->lambda[j];
    if (hx_re(at->lambda[i]) < 0.0) return 0;
  }
  return 1;
}

/* Sets G, and returns whether any two contacts overlap. */
static inline int contacts_overlap(const hxSharers *of, double radius,
                                   hxNumber G[HX_SHARERS][HX_SHARERS]) {
  const double factor = 25.0; /* 1  of rho^2 */
  hxNumber deepest = of->depth[0];
  int found = 0;
  for (int i = 1; i < of->count; ++i)
    if (hx_re(of->depth[i]) > hx_re(deepest)) deepest = of->depth[i];
  hxNumber reach = (radius - 2.0 * deepest) / (factor * deepest);
  if (hx_re(reach) < 0.0) reach = 0.0;
  for (int i = 0; i < of->count; ++i) {
    G[i][i] = 1.0;
    for (int j = 0; j < i; ++j) {
      G[i][j] = G[j][i] = overlap(of->normal[i], of->normal[j], reach);
      found |= hx_re(G[i][j]) != 0.0;
    }
  }
  return found;
}

/* Computes the shares of two contacts: both carry, or the deeper one where the other would pull. */
static inline void share_between_two(const hxNumber depth[2], hxNumber G, hxNumber share[2]) {
  const double singular = 1e-9; /* as in solve_carriers */
  const hxNumber pivot = 1.0 - G * G, second = (depth[1] - G * depth[0]) / pivot,
                 first = depth[0] - G * second;
  const double alone[2] = {hx_re(depth[0]) * hx_re(depth[0]), hx_re(depth[1]) * hx_re(depth[1])},
               both = hx_re(first) * hx_re(depth[0]) + hx_re(second) * hx_re(depth[1]);
  const int deeper = alone[1] > alone[0];
  const int carry = hx_re(pivot) > singular && hx_re(first) >= 0.0 && hx_re(second) >= 0.0 &&
                    both > alone[deeper];
  share[0] = carry ? first / depth[0] : (hxNumber)(deeper ? 0.0 : 1.0);
  share[1] = carry ? second / depth[1] : (hxNumber)(deeper ? 1.0 : 0.0);
}

/* Computes the shares w of contacts (eq. 59): of all choices that only push, that with the largest
 * lambda . delta is the solution. */
static inline void hx_contact_shares(const hxSharers *of, double radius,
                                     hxNumber share[HX_SHARERS]) {
  hxNumber G[HX_SHARERS][HX_SHARERS];
  double best = -1.0;
  for (int i = 0; i < of->count; ++i) share[i] = 1.0;
  if (of->count < 2 || !contacts_overlap(of, radius, G)) return;
  if (of->count == 2) {
    share_between_two(of->depth, G[1][0], share);
    return;
  }
  for (int mask = 1; mask < 1 << of->count; ++mask) {
    hxCarriers at = {.size = 0};
    double value = 0.0;
    for (int i = 0; i < of->count; ++i)
      if (mask >> i & 1) at.chosen[at.size++] = i;
    if (!solve_carriers((const hxNumber(*)[HX_SHARERS])G, of->depth, &at)) continue;
    for (int i = 0; i < at.size; ++i) value += hx_re(at.lambda[i]) * hx_re(of->depth[at.chosen[i]]);
    if (!(value > best)) continue;
    best = value;
    for (int i = 0; i < of->count; ++i) share[i] = 0.0;
    for (int i = 0; i < at.size; ++i) share[at.chosen[i]] = at.lambda[i] / of->depth[at.chosen[i]];
  }
}

#endif
