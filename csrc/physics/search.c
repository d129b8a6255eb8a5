/* SPDX-License-Identifier: MIT
 *
 * The list of links that can touch a pulley. Links are listed by blocks of BD_LANES when any of a
 * block is within `margin` of the rim; the list stands as long as no link can have travelled that
 * far, by a bound on the speed, so a link off the list need not be tested. Guarded by
 * tests/test_oracle.py (the oracle tests all pairs) and test_integrators.py (rebuilds counted).
 */
#include <math.h>

#include "physics/physics.h"

void bd_search_carve(bd_carver *carver, bd_search *search, const bd_layout *lay) {
  search->max_runs = lay->n8 / BD_LANES / 2 + 1;
  BD_CARVE(carver, search->n_runs, lay->np);
  BD_CARVE(carver, search->runs, lay->np * search->max_runs);
}

static void list_links(bd_plan *plan, const double *y) {
  bd_search *search = &plan->search;
  const bd_layout *lay = &plan->model->lay;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  bd_mounts_put(plan, y);
  ++search->rebuilds;
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &plan->contact_pulleys[j];
    bd_run *runs = search->runs + j * search->max_runs;
    /* the joints of a link that touches belong to its neighbours as well, and may gape */
    const double apart = 2.0 * plan->model->belt_model->facts.reach * plan->model->info.link_length;
    double reach = pulley->radius + search->margin + apart;
    int n_runs = 0;
    for (int begin = 0; begin < lay->n; begin += BD_LANES) {
      int near = 0;
      for (int i = begin; i < begin + BD_LANES && i < lay->n; ++i) {
        double dx = x[i] - pulley->x, dy = yy[i] - pulley->y;
        near |= !(dx * dx + dy * dy > reach * reach);
      }
      if (near && n_runs > 0 && runs[n_runs - 1].end == begin) {
        runs[n_runs - 1].end = begin + BD_LANES;
      } else if (near) {
        runs[n_runs++] = (bd_run){begin, begin + BD_LANES};
      }
    }
    search->n_runs[j] = n_runs;
  }
}

void bd_search_ready(bd_plan *plan, const double *y, double h) {
  bd_search *search = &plan->search;
  const bd_layout *lay = &plan->model->lay;
  double fastest = plan->kernels->fastest(lay, y);
  for (int j = 0; plan->offset && j < lay->np; ++j) {
    double reach = hypot(plan->offset[2 * j], plan->offset[2 * j + 1]);
    double speed = plan->move_time > 0.0 ? 1.875 * reach / plan->move_time : 0.0;
    fastest = fmax(fastest, speed * speed);
  }
  for (int m = 0; m < lay->nm; ++m) {
    const bd_mounted *mount = &plan->model->mounts[m];
    const bd_place at = bd_mount_place(mount, y[lay->travel + m]);
    double speed = fabs(y[lay->travel_speed + m]) * hypot(at.a[0], at.a[1]);
    /* a path may be at rest now and go on at once */
    speed = fmax(speed, mount->fastest);
    fastest = fmax(fastest, speed * speed);
  }
  /* Twice for what a link can gain on the speed at the step's start, twice for what link and
   * pulley close on each other. */
  const double SAFETY = 2.0 * 2.0;
  double step = SAFETY * h * sqrt(fastest);
  search->travelled += step;
  if (!(search->travelled <= search->margin)) {
    search->margin = fmax(plan->model->info.link_length, 4.0 * step);
    search->travelled = step;
    list_links(plan, y);
  }
}
