/* SPDX-License-Identifier: MIT
 *
 * What the implicit methods share: the Jacobian where it is due, the set torques' change with time,
 * and the ledger, whose power is a quadrature that no stage needs: it is taken at the ends of a
 * step, and in its middle where the method is of an order that would notice.
 */
#include <string.h>

#include "run/run.h"

static void keep_torque(bd_sim *sim) {
  memcpy(sim->newton.torque, sim->plan.torque, (size_t)sim->model->lay.np * sizeof(double));
}

int bd_sim_linearise(bd_sim *sim) {
  if (sim->jacobian_known) {
    return BD_OK;
  }
  if (!sim->rate_known) {
    int code = bd_sim_ensure_rate(sim);
    if (code != BD_OK) {
      return code;
    }
    keep_torque(sim);
  }
  bd_newton_linearise(&sim->newton, &sim->plan, sim->y);
  const int watched = sim->plan.torques.watched;
  sim->plan.torques.watched = 0; /* what is asked for derivatives is not the step's */
  int code = sim->plan.pulleys_locked ? BD_OK : bd_opaque_derive(sim);
  sim->plan.torques.watched = watched;
  sim->jacobian_known = code == BD_OK;
  ++sim->stats.njev;
  return code;
}

int bd_sim_torque_by_time(bd_sim *sim, double h, int at_start) {
  bd_newton_system *system = &sim->newton;
  const bd_layout *lay = &sim->model->lay;
  if (sim->plan.pulleys_locked) {
    return BD_OK;
  }
  double dt = at_start ? 1e-4 * h : h;
  int code =
      bd_torque_set_by_time(&sim->plan.torques, sim->t, dt, sim->plan.t_piece, sim->y + lay->theta,
                            sim->y + lay->omega, system->torque, system->by_time, &sim->failure);
  return code == BD_OK && at_start && !sim->plan.torques.smooth ? bd_opaque_by_time(sim, h) : code;
}

void bd_sim_add_torque_by_time(const bd_sim *sim, double *c, double factor) {
  for (int j = 0; !sim->plan.pulleys_locked && j < sim->model->lay.np; ++j) {
    c[sim->model->lay.omega + j] += factor * sim->newton.by_time[j] / sim->model->inertia[j];
  }
}

int bd_sim_finish_step(bd_sim *sim, double h, double t_new, int middle) {
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
    double linear = -3.0 * p0 + 4.0 * p1 - p2, quadratic = 2.0 * p0 - 4.0 * p1 + 2.0 * p2;
    y[lay->work + k] =
        sim->y[lay->work + k] + h * s * (p0 + s * (0.5 * linear + s * quadratic / 3.0));
  }
}
