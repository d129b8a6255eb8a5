/* SPDX-License-Identifier: MIT
 *
 * What the implicit methods share: the Jacobian where it is due, the set torques' change with time,
 * and the ledger, whose power is a quadrature that no stage needs: it is taken at the ends of a
 * step, and in its middle where the method is of an order that would notice.
 */
#include <string.h>

#include "run/run.h"

static void keep_torque(bd_sim *sim) {
  memcpy(sim->linear.torque, sim->plan.torque, (size_t)sim->model->lay.np * sizeof(double));
}

int bd_sim_linearise(bd_sim *sim) {
  if (sim->linear_known) {
    return BD_OK;
  }
  if (!sim->rate_known) {
    int code = bd_sim_know_rate(sim);
    if (code != BD_OK) {
      return code;
    }
    keep_torque(sim);
  }
  bd_linearise(&sim->linear, &sim->plan, sim->y);
  const int watched = sim->plan.load.watched;
  sim->plan.load.watched = 0; /* what is asked for derivatives is not the step's */
  int code = sim->plan.held ? BD_OK : bd_opaque_derive(sim);
  sim->plan.load.watched = watched;
  sim->linear_known = code == BD_OK;
  ++sim->stats.njev;
  return code;
}

int bd_sim_take_slope(bd_sim *sim, double h, int at_start) {
  bd_linear *lin = &sim->linear;
  const bd_layout *lay = &sim->model->lay;
  if (sim->plan.held) {
    return BD_OK;
  }
  double dt = at_start ? 1e-4 * h : h;
  int code = bd_load_slope(&sim->plan.load, sim->t, dt, sim->plan.t_piece, sim->y + lay->theta,
                           sim->y + lay->omega, lin->torque, lin->slope, &sim->failure);
  return code == BD_OK && at_start && !sim->plan.load.smooth ? bd_opaque_slope(sim, h) : code;
}

void bd_sim_add_slope(const bd_sim *sim, double *c, double factor) {
  for (int j = 0; !sim->plan.held && j < sim->model->lay.np; ++j) {
    c[sim->model->lay.omega + j] += factor * sim->linear.slope[j] / sim->model->inertia[j];
  }
}

int bd_sim_arrive(bd_sim *sim, double h, double t_new, int middle) {
  const bd_layout *lay = &sim->model->lay;
  double *rate = sim->stage[sim->now->vectors - 1];
  const double *before = sim->stage[0] + lay->work, *after = rate + lay->work;
  middle &= sim->plan.ledger;
  if (middle) {
    sim->now->inside(sim, h, 0.5, sim->y_mid);
    int code = bd_sim_rate(sim, sim->t + 0.5 * h, sim->y_mid, rate);
    if (code != BD_OK) {
      return code;
    }
    memcpy(sim->work_middle, after, sizeof sim->work_middle);
  }
  int code = bd_sim_rate(sim, t_new, sim->y_new, rate);
  if (code != BD_OK) {
    return code;
  }
  keep_torque(sim);
  for (int k = 0; k < N_WORK; ++k) {
    double mean = middle ? sim->work_middle[k] : 0.5 * (before[k] + after[k]);
    sim->work_middle[k] = mean;
    sim->y_new[lay->work + k] =
        sim->y[lay->work + k] + h * (before[k] + 4.0 * mean + after[k]) / 6.0;
  }
  return BD_OK;
}

/* The integral of the parabola through the step's three powers. */
void bd_sim_work_inside(const bd_sim *sim, double h, double s, double *y) {
  const bd_layout *lay = &sim->model->lay;
  const double *before = sim->stage[0] + lay->work;
  const double *after = sim->stage[sim->now->vectors - 1] + lay->work;
  for (int k = 0; k < N_WORK; ++k) {
    double p0 = before[k], p1 = sim->work_middle[k], p2 = after[k];
    double rise = -3.0 * p0 + 4.0 * p1 - p2, bend = 2.0 * p0 - 4.0 * p1 + 2.0 * p2;
    y[lay->work + k] = sim->y[lay->work + k] + h * s * (p0 + s * (0.5 * rise + s * bend / 3.0));
  }
}
