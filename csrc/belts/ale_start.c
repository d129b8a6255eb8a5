/* SPDX-License-Identifier: MIT
 *
 * Starts of the ALE belt: at rest, or running along itself, its mounts in balance with it.
 */
#include <math.h>
#include <string.h>

#include "belts/belts.h"

void bd_ale_set_going(const bd_plan *plan, double *y, double speed) {
  const bd_layout *lay = &plan->model->lay;
  const bd_ale *ale = bd_ale_look(plan, y);
  const double flow = speed / ale->spans[0].stretch;
  double *v = bd_field(lay, y, F_V);
  for (int c = 0; c < lay->n; ++c) {
    v[c] = flow / ale->per_stretch[plan->ale->slot[c]];
  }
  for (int i = 0; i < lay->n_along; ++i) {
    const bd_ale_arc *arc = &ale->arcs[i];
    const int first = arc->begin + arc->n, last = ale->arcs[arc->next].begin;
    y[lay->along_speed + i] =
        BD_ALE_SHARE * flow * (1.0 / ale->per_stretch[first] + 1.0 / ale->per_stretch[last]);
  }
  for (int k = 0; k < lay->n_modes; ++k) {
    y[lay->p + k] = ale->spans[k / lay->modes].moved[k % lay->modes];
  }
}

void bd_ale_solve_mounts(int n, double *a, double *x) {
  for (int m = 0; m < n; ++m) {
    for (int k = m + 1; k < n; ++k) {
      const double factor = a[k * n + m] / a[m * n + m];
      for (int l = m; factor != 0.0 && l < n; ++l) {
        a[k * n + l] -= factor * a[m * n + l];
      }
      x[k] -= factor * x[m];
    }
  }
  for (int m = n - 1; m >= 0; --m) {
    for (int k = m + 1; k < n; ++k) {
      x[m] -= a[m * n + k] * x[k];
    }
    x[m] /= a[m * n + m];
  }
}

/* The belt at this speed with its mounts where y has them, into its slabs, and what is left over of
 * the forces on those that move. Whether there is such a belt. */
static int lay(const bd_plan *plan, double speed, const double *y, double *left_over) {
  const bd_model *model = plan->model;
  bd_ale_belt *belt = plan->ale;
  bd_mounts_put(plan, y);
  bd_ale_put_axes(plan, y);
  belt->kernels->place(&belt->ale);
  belt->known = 0;
  if (!isfinite(bd_ale_start(&belt->ale, model->belt.length, speed, &belt->y))) {
    return 0;
  }
  bd_ale_rate(&belt->ale, belt->kernels, &belt->y, &belt->dy);
  for (int m = 0; m < model->lay.nm; ++m) {
    const bd_mounted *mount = &model->mounts[m];
    const double q = y[model->lay.travel + m];
    const bd_place at = bd_mount_place(mount, q);
    const double *force = belt->ale.arcs[mount->pulley].force;
    double lost = 0.0;
    left_over[m] = mount->row->moves
                       ? force[0] * at.a[0] + force[1] * at.a[1] + bd_mount_spring(mount, q) +
                             bd_mount_stop(mount, q, 0.0, &lost) +
                             bd_mount_weight(model, mount, &at)
                       : 0.0;
  }
  return 1;
}

/* By how much less is left over as each travel grows, by differences. */
static int stiffness_of_mounts(const bd_plan *plan, double speed, double *y, const double *force,
                               double *other, double *out) {
  const int nm = plan->model->lay.nm;
  double *travel = y + plan->model->lay.travel;
  for (int k = 0; k < nm; ++k) {
    const bd_mounted *mount = &plan->model->mounts[k];
    const double kept = travel[k], h = 1e-6 * plan->model->belt.length / mount->lever;
    if (mount->row->moves) {
      travel[k] += h;
      if (!lay(plan, speed, y, other)) {
        return 0;
      }
      travel[k] = kept;
    }
    for (int m = 0; m < nm; ++m) {
      out[m * nm + k] = mount->row->moves ? (force[m] - other[m]) / h : m == k;
    }
  }
  return 1;
}

/* Newton's method, from where the closed form of the tension at rest has the mounts. */
static int balance(const bd_plan *plan, double speed, double *y) {
  const double PRECISION = 1e-12; /* of the tension at rest */
  const bd_model *model = plan->model;
  const int nm = model->lay.nm;
  double *force = plan->ale->forces, *other = force + nm, *stiffness = plan->ale->carried;
  double before = (double)INFINITY;
  for (int turn = 0; turn < 30 && lay(plan, speed, y, force); ++turn) {
    double most = 0.0;
    for (int m = 0; m < nm; ++m) {
      const bd_mounted *mount = &model->mounts[m];
      most = mount->row->moves ? fmax(most, fabs(force[m]) / mount->lever) : most;
    }
    /* rounding of differences of whole belts ends it above that */
    if (!(most > PRECISION * plan->ale->ale.rest) ||
        (most < 1e-7 * plan->ale->ale.rest && !(most < 0.5 * before))) {
      return 1;
    }
    before = most;
    if (!stiffness_of_mounts(plan, speed, y, force, other, stiffness)) {
      return 0;
    }
    bd_ale_solve_mounts(nm, stiffness, force);
    for (int m = 0; m < nm; ++m) {
      const double longest = 0.02 * model->belt.length / model->mounts[m].lever;
      const double step = fmin(fmax(force[m], -longest), longest);
      y[model->lay.travel + m] += model->mounts[m].row->moves ? step : 0.0;
    }
  }
  return 0;
}

int bd_ale_rest(const bd_plan *plan, double speed, double *y, bd_error *err) {
  const bd_model *model = plan->model;
  const bd_layout *layout = &model->lay;
  bd_ale_belt *belt = plan->ale;
  memset(y, 0, layout->size * sizeof *y);
  bd_ale_read(plan, y, &belt->y);
  for (int m = 0; m < layout->nm; ++m) {
    y[layout->travel + m] = model->mounts[m].rest;
  }
  if (!balance(plan, speed, y)) {
    return bd_fail(err, BD_ERR_NOT_SETTLED, "settle",
                   "no tension was found in which the belt runs at %g m/s%s: take mesh=\"joint\"",
                   speed, model->n_moving > 0 ? ", its mounts in balance" : "");
  }
  bd_ale_write(plan, &belt->y, y);
  for (int j = 0; j < layout->np; ++j) {
    y[layout->omega + j] = y[layout->rim[j]] = belt->ale.arcs[j].axis.omega;
  }
  for (int c = 0; c < layout->nc; ++c) { /* rings turn with their pulleys */
    y[layout->rim_speed + c] = y[layout->omega + layout->coupled[c]];
  }
  return BD_OK;
}
