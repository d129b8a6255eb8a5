/* SPDX-License-Identifier: MIT
 *
 * Contact along the links, or bars (kernels/link_contact.h), of all pulleys: its scratch, and what
 * outputs and guards ask of it at any state.
 */
#include <math.h>
#include <string.h>

#include "belts/belts.h"

void bd_carve_pressure(bd_carver *carver, const bd_layout *lay, bd_pressure *pressure,
                       bd_end_forces *forces) {
  double **const by_link[] = {&pressure->left,        &pressure->right,     &pressure->share_left,
                              &pressure->share_right, &pressure->rate_left, &pressure->rate_right,
                              &forces->left_x,        &forces->left_y,      &forces->right_x,
                              &forces->right_y,       &forces->joint_x,     &forces->joint_y};
  for (size_t k = 0; k < sizeof by_link / sizeof by_link[0]; ++k) {
    bd_carve_links(carver, lay, by_link[k]);
  }
}

void bd_along_clear(const bd_plan *plan) {
  const bd_layout *lay = &plan->model->lay;
  const bd_end_forces *forces = &plan->forces;
  double *const by_link[] = {forces->left_x,  forces->left_y,  forces->right_x,
                             forces->right_y, forces->joint_x, forces->joint_y};
  for (size_t k = 0; k < sizeof by_link / sizeof by_link[0]; ++k) {
    memset(by_link[k] - BD_HALO, 0, (size_t)lay->stride * sizeof(double));
  }
}

void bd_along_carve(bd_carver *carver, bd_plan *plan, const bd_model *model) {
  const bd_layout *lay = &model->lay;
  double **const by_link[] = {&plan->points.x, &plan->points.y, &plan->points.vx, &plan->points.vy,
                              &plan->nearest,  &plan->seen.cos, &plan->seen.sin};
  bd_carve_pressure(carver, lay, &plan->pressure, &plan->forces);
  for (size_t k = 0; k < sizeof by_link / sizeof by_link[0]; ++k) {
    bd_carve_links(carver, lay, by_link[k]);
  }
}

/* Of the nearest end of the two that meet at a joint. */
void bd_along_distances(const bd_plan *plan, const double *y, int j, int begin, int end,
                        double *out) {
  (void)y, (void)j;
  for (int i = begin; i < end; ++i) {
    out[i - begin] = fmin(plan->nearest[i - 1], plan->nearest[i]);
  }
}

static double contact_energy(const bd_plan *plan, const double *y, int j) {
  bd_sums sums;
  plan->kernels->add_normal_forces[1](&plan->seen, &plan->contact_pulleys[j],
                                      plan->search.n_runs[j], bd_runs_of(plan, j), &plan->pressure,
                                      &plan->forces, y, &sums);
  return sums.contact_energy;
}

int bd_along_contact_energy(const bd_plan *plan, const double *y, int j, double *energy) {
  const double stored = contact_energy(plan, y, j);
  *energy += stored;
  return stored > 0.0;
}

/* Normal forces act at the ends. */
void bd_along_contact_at(const bd_plan *plan, const double *y, int j, bd_touch *out,
                         double force[2], double *energy) {
  const bd_pressure *p = &plan->pressure;
  bd_along_clear(plan);
  *energy += contact_energy(plan, y, j);
  force[0] = force[1] = 0.0;
  for (int r = 0, i = -1; (i = bd_next_near(plan, j, &r, i)) >= 0;) {
    force[0] += plan->forces.left_x[i] + plan->forces.right_x[i];
    force[1] += plan->forces.left_y[i] + plan->forces.right_y[i];
    out[i] = (bd_touch){.share = p->share_left[i] + p->share_right[i - 1],
                        .normal = p->left[i] + p->right[i - 1],
                        .least = fmin(p->left[i], p->right[i - 1])};
  }
}
