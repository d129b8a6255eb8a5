/* SPDX-License-Identifier: MIT
 *
 * The columns of axes in the Jacobian of an ALE belt: what one more of a mount's travel, and
 * of its speed, does to all rates, torques and forces, by differences of whole rates. They are two
 * a mount, where the rows of mounts, which are of all unknowns, are derived (ale_jacobian.c).
 */
#include <math.h>
#include <string.h>

#include "belts/ale.h"

void bd_ale_rate(bd_ale *ale, const bd_ale_kernels *kernels, const bd_ale_state *y,
                 const bd_ale_state *dy) {
  if (ale->moving) {
    kernels->place(ale);
  }
  kernels->stretch(ale, y);
  for (int j = 0; j < ale->np; ++j) {
    kernels->add_friction[ale->arcs[j].friction.law](ale, j, y, dy);
  }
  kernels->move(ale, y, dy);
}

static double push_of(const bd_ale_arc *arc) {
  return arc->force[0] * arc->axis.lever[0] + arc->force[1] * arc->axis.lever[1];
}

/* (a - b) / h, into a: all of a state lies together. */
static void subtract(const bd_ale_newton *newton, const bd_ale_state *a, const bd_ale_state *b,
                     double h) {
  const size_t n = newton->state_size;
  for (size_t k = 0; k < n; ++k) {
    a->m[k] = (a->m[k] - b->m[k]) / h;
  }
}

/* Forward differences: a travel that moves the axis by 1e-6 of the radius and turns its speed by no
 * more than 1e-6 of a wave's, as much of that speed; lost are 1e-6 of the column, and rounding,
 * 1e-16 / 5e-3 of a tension over 1e-6. */
static void difference(bd_ale_newton *newton, bd_ale *ale, const bd_ale_kernels *kernels,
                       const bd_ale_state *y, const bd_ale_state *dy, const bd_ale_state *scratch,
                       int j, int of) {
  const int unknowns = newton->ring.unknowns, np = ale->np;
  bd_ale_arc *arc = &ale->arcs[j];
  const bd_ale_axis kept = arc->axis;
  const double lever = hypot(kept.lever[0], kept.lever[1]);
  const double bends = fabs(kept.speed) * hypot(kept.bend[0], kept.bend[1]);
  const double wave = sqrt(ale->rest / ale->density);
  const double h = 1e-6 / (of == 0 ? lever / wave : fmax(lever / arc->radius, bends / wave));
  double *column = newton->moved[of] + j * unknowns, *torque = newton->torque_by[of] + j;
  double *push = newton->push_by[of] + j;
  for (int x = 0; x < 2; ++x) {
    if (of == 0) {
      arc->axis.v[x] += h * kept.lever[x];
      arc->axis.known[x] += h * (2.0 * kept.speed + h) * kept.bend[x];
    } else {
      arc->axis.c[x] += h * kept.lever[x];
      arc->axis.v[x] += h * kept.speed * kept.bend[x];
      arc->axis.lever[x] += h * kept.bend[x];
    }
  }
  bd_ale_rate(ale, kernels, y, scratch);
  for (int k = 0; k < np; ++k) {
    torque[k * np] = (ale->arcs[k].torque - torque[k * np]) / h;
    push[k * np] = (push_of(&ale->arcs[k]) - push[k * np]) / h;
  }
  arc->axis = kept;
  subtract(newton, scratch, dy, h);
  bd_ale_gather(newton, ale, scratch, column);
}

/* What differences are taken from; nothing moves where there is no lever. */
static void begin(bd_ale_newton *newton, const bd_ale *ale, int j, int of, int differs) {
  const int unknowns = newton->ring.unknowns, np = ale->np;
  memset(newton->moved[of] + j * unknowns, 0, (size_t)unknowns * sizeof(double));
  for (int k = 0; k < np; ++k) {
    newton->torque_by[of][k * np + j] = differs ? ale->arcs[k].torque : 0.0;
    newton->push_by[of][k * np + j] = differs ? push_of(&ale->arcs[k]) : 0.0;
  }
}

static int differs(const bd_ale_axis *axis, int of) {
  const int moves = axis->lever[0] != 0.0 || axis->lever[1] != 0.0;
  const int turns = axis->speed != 0.0 && (axis->bend[0] != 0.0 || axis->bend[1] != 0.0);
  return moves || (of == 1 && turns);
}

void bd_ale_linearise_axes(bd_ale_newton *newton, bd_ale *ale, const bd_ale_kernels *kernels,
                           const bd_ale_state *y, const bd_ale_state *dy,
                           const bd_ale_state *scratch, int n, const int *axes) {
  for (int k = 0; k < 2 * n; ++k) {
    begin(newton, ale, axes[k / 2], k % 2, differs(&ale->arcs[axes[k / 2]].axis, k % 2));
  }
  for (int k = 0; k < 2 * n; ++k) {
    if (differs(&ale->arcs[axes[k / 2]].axis, k % 2)) {
      difference(newton, ale, kernels, y, dy, scratch, axes[k / 2], k % 2);
    }
  }
}
