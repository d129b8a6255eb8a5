/* SPDX-License-Identifier: MIT
 *
 * What fills the Jacobian of an ALE belt: its blocks (ale_jacobian.c), its border (ale_border.c).
 */
#ifndef BELTDYN_BELTS_ALE_FILLING_H
#define BELTDYN_BELTS_ALE_FILLING_H

#include "belts/ale.h"

typedef struct filling {
  bd_ale_newton *newton;
  const bd_ale *ale;
  const bd_ale_state *y, *dy;
} filling;

/* More of all that a span's rates depend on. */
typedef struct span_move {
  double m, past, pull, stretch, pressing, fills, total[2], losing[2], lifted[2];
  double a[BD_ALE_MODES], p[BD_ALE_MODES];
} span_move;

/* An unknown's number in one of the vectors beside the ring, of pulley j. */
static inline double *beside(const filling *f, double *vectors, int j, int unknown) {
  return vectors + j * f->newton->ring.unknowns + unknown;
}

/* The end of a span that loads a cell of arc j. */
static inline int end_at(const bd_ale *ale, int j, int k) {
  return 2 * k < ale->arcs[j].n ? 2 * ale->arcs[j].before + 1 : 2 * j;
}

static inline int has_lever(const bd_ale *ale, int j) {
  const double *a = ale->arcs[j].axis.lever;
  return ale->arcs[j].mounted && (a[0] != 0.0 || a[1] != 0.0);
}

/* What moves a node besides: weight and turning less the rate itself, per mass. */
static inline double by_mass(const filling *f, int slot) {
  const bd_ale *ale = f->ale;
  return ale->gravity[0] * ale->tx[slot] + ale->gravity[1] * ale->ty[slot] -
         ale->direction * ale->turn[slot] * ale->across[slot] - f->dy->v[slot];
}

/* The torque on a pulley by its arc; the force on its axis, where that has a lever. */
void bd_ale_fill_torque(const filling *f, int j);
void bd_ale_push_by_arc(const filling *f, int j);
/* Of span i the forces on both axes by a column, but for what its modes' rates add; `bends`: what
 * bending at both ends does. */
void bd_ale_push_by_span(const filling *f, int i, int column, const span_move *by, double pressing,
                         const double bends[2]);
/* Once its rows and columns are filled: what these rates add, and what shears of its ends do. */
void bd_ale_push_by_modes(const filling *f, int i);
void bd_ale_add_shears(const filling *f, int i);

#endif
