/* SPDX-License-Identifier: MIT
 *
 * Contact along the links (kernels/link_contact.h) of all pulleys: its scratch, its part of the
 * rate, and what outputs and guards ask of it at any state.
 */
#include <string.h>

#include "physics/physics.h"

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

void bd_clear_end_forces(const bd_layout *lay, const bd_end_forces *forces) {
  double *const by_link[] = {forces->left_x,  forces->left_y,  forces->right_x,
                             forces->right_y, forces->joint_x, forces->joint_y};
  for (size_t k = 0; k < sizeof by_link / sizeof by_link[0]; ++k) {
    memset(by_link[k] - BD_HALO, 0, (size_t)lay->stride * sizeof(double));
  }
}

void bd_link_contact_carve(bd_carver *carver, bd_plan *plan, const bd_layout *lay) {
  double **const by_link[] = {&plan->points.x, &plan->points.y, &plan->points.vx, &plan->points.vy,
                              &plan->nearest,  &plan->seen.cos, &plan->seen.sin};
  bd_carve_pressure(carver, lay, &plan->pressure, &plan->forces);
  for (size_t k = 0; k < sizeof by_link / sizeof by_link[0]; ++k) {
    bd_carve_links(carver, lay, by_link[k]);
  }
}

void bd_link_contact_rate(bd_plan *plan, double *y, double *dy) {
  const bd_layout *lay = &plan->model->lay;
  const bd_kernels *kernels = plan->kernels;
  const bd_links *links = &plan->links;
  const int power = !plan->skip_power;
  double contact_loss = 0.0, friction_loss = 0.0;
  bd_clear_end_forces(lay, &plan->forces);
  if (plan->friction_on) {
    bd_close_links(lay, y);
    links->cos[-1] = links->cos[lay->n - 1];
    links->sin[-1] = links->sin[lay->n - 1];
    kernels->gather_points(links, links->cos, links->sin, y, &plan->points);
  }
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &plan->contact_pulleys[j];
    const int n_runs = plan->search.n_runs[j];
    const bd_run *runs = plan->search.runs + j * plan->search.max_runs;
    bd_sums sums;
    const int m = plan->model->mount_of ? plan->model->mount_of[j] : -1;
    double before[2], after[2];
    if (m >= 0) {
      kernels->sum_forces(n_runs, runs, &plan->forces, before);
    }
    kernels->press[power](links, pulley, n_runs, runs, &plan->pressure, &plan->forces, y, &sums);
    if (pulley->law != BD_LAW_NONE) {
      kernels->rub[pulley->law][power](links, pulley, n_runs, runs, &plan->points, &plan->pressure,
                                       &plan->forces, y, dy, &sums);
    }
    if (m >= 0) {
      kernels->sum_forces(n_runs, runs, &plan->forces, after);
      plan->hub[2 * m] = before[0] - after[0];
      plan->hub[2 * m + 1] = before[1] - after[1];
    }
    plan->friction[j] = sums.torque;
    contact_loss += sums.contact_loss;
    friction_loss += sums.friction_loss;
  }
  kernels->scatter_forces(links, links->cos, links->sin, &plan->forces, dy);
  dy[lay->work + W_contact_loss] = contact_loss;
  dy[lay->work + W_friction_loss] = friction_loss;
}

void bd_link_contact_see(const bd_plan *plan, const double *y) {
  plan->kernels->directions(&plan->seen, y);
}

double bd_link_contact_press(const bd_plan *plan, const double *y, int j) {
  bd_sums sums;
  plan->kernels->press[1](&plan->seen, &plan->contact_pulleys[j], plan->search.n_runs[j],
                          plan->search.runs + j * plan->search.max_runs, &plan->pressure,
                          &plan->forces, y, &sums);
  return sums.contact_energy;
}

void bd_link_contact_distances(const bd_plan *plan, const double *y, int j) {
  const bd_run all = {0, plan->model->lay.n8};
  plan->kernels->nearest_ends(&plan->seen, &plan->contact_pulleys[j], 1, &all, y, plan->nearest);
}
