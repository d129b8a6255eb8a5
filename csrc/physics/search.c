/* SPDX-License-Identifier: MIT
 *
 * The list of links that can touch a pulley. Links are listed by blocks of BD_LANES when any of a
 * block is within `margin` of touching; the list stands as long as no link can have travelled that
 * far, by a bound on the speed, so a link off the list need not be tested. Derivatives are of one
 * state: they have a list of what touches there. Guarded by tests/test_oracle.py (the oracle tests
 * all pairs), test_jacobian.py and test_integrators.py (rebuilds counted).
 */
#include <math.h>

#include "physics/physics.h"

void bd_search_carve(bd_carver *carver, bd_search *search, const bd_layout *lay) {
  search->max_runs = lay->n8 / BD_LANES / 2 + 1;
  BD_CARVE(carver, search->n_runs, lay->np);
  BD_CARVE(carver, search->runs, lay->np * search->max_runs);
  BD_KEEP_SPAN(carver, search, margin, rebuilds);
  BD_KEEP_INDEXES(carver, search->n_runs, lay->np, 0, search->max_runs);
  BD_KEEP_INDEXES(carver, search->runs, 2 * lay->np * search->max_runs, 0, lay->n8);
}

int bd_search_near(const bd_plan *plan, const double *y, int j, double margin, int n_within,
                   const bd_run *within, bd_run *runs) {
  const bd_layout *lay = &plan->model->lay;
  const bd_contact_pulley *pulley = &plan->contact_pulleys[j];
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  /* of a belt that touches along its links, or bars: it does so at their ends */
  const int beside = plan->model->belt_model->facts.reach > 0.0;
  const double reach = pulley->radius + (beside ? plan->links.half : 0.0) + margin;
  int n_runs = 0;
  for (const bd_run *in = within; in < within + n_within; ++in) {
    for (int begin = in->begin; begin < in->end; begin += BD_LANES) {
      const int end = begin + BD_LANES < lay->n ? begin + BD_LANES : lay->n;
      int near = 0;
      for (int i = begin - beside; !near && i < end + beside; ++i) {
        const int k = i < 0 ? lay->n - 1 : i < lay->n ? i : 0;
        const double dx = x[k] - pulley->x, dy = yy[k] - pulley->y;
        near = !(dx * dx + dy * dy > reach * reach);
      }
      if (near && n_runs > 0 && runs[n_runs - 1].end == begin) {
        runs[n_runs - 1].end = begin + BD_LANES;
      } else if (near) {
        runs[n_runs++] = (bd_run){begin, begin + BD_LANES};
      }
    }
  }
  return n_runs;
}

/* How fast an axis moves, at most. */
static double fastest_axis(const bd_plan *plan, const double *y) {
  const bd_layout *lay = &plan->model->lay;
  double fastest = 0.0;
  for (int j = 0; plan->offset && plan->move_time > 0.0 && j < lay->np; ++j) {
    const double reach = hypot(plan->offset[2 * j], plan->offset[2 * j + 1]);
    fastest = fmax(fastest, 1.875 * reach / plan->move_time);
  }
  for (int m = 0; m < lay->nm; ++m) {
    const bd_mounted *mount = &plan->model->mounts[m];
    const bd_place at = bd_mount_place(mount, y[lay->travel + m]);
    const double speed = fabs(y[lay->travel_speed + m]) * hypot(at.a[0], at.a[1]);
    /* a path may be at rest now and go on at once */
    fastest = fmax(fastest, fmax(speed, mount->fastest));
  }
  return fastest;
}

void bd_search_ready(bd_plan *plan, const double *y, double h) {
  const double SAFETY = 4.0; /* for what they can gain on their speeds at the step's start */
  bd_search *search = &plan->search;
  const double links = sqrt(plan->kernels->fastest(&plan->model->lay, y));
  search->step = SAFETY * h * (links + fastest_axis(plan, y));
  search->travelled += search->step;
  if (!(search->travelled <= search->margin)) {
    search->margin = fmax(plan->model->info.link_length, search->step);
    search->travelled = search->step;
    ++search->rebuilds;
    bd_mounts_put(plan, y);
    for (int j = 0; j < plan->model->lay.np; ++j) {
      search->n_runs[j] =
          bd_search_near(plan, y, j, search->margin, 1, &(bd_run){0, plan->model->lay.n8},
                         search->runs + j * search->max_runs);
    }
  }
}
