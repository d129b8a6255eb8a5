/* SPDX-License-Identifier: MIT
 *
 * Linearly implicit backward differentiation of order 2 ("lbdf2") and 1 ("lie", the linearly
 * implicit Euler method): one evaluation, one factorisation, one solve a step, no iteration that
 * could fail. With w = h / (step before), gamma = (1 + w) / (1 + 2 w), beta = w^2 / (1 + 2 w),
 *
 *   (1 - gamma h J) d = beta (y_n - y_{n-1}) + gamma h f(t_{n+1}, y_n),   y_{n+1} = y_n + d,
 *
 * J and f at y_n, the set torque at t_{n+1}, contact as bd_newton_linearise_contact sees it: a link
 * that moves by h v round a pulley leaves the tangent by (h v)^2 / (2 rho), 1e-6 m, and a contact a
 * hundred times stiffer than the paper's is pressed by 1e-7 m. Zero-stable for w < 1 + sqrt 2
 * (Hairer, Norsett, Wanner, Solving ODEs I, III.5; steps grow by 2 at most), L-stable at constant
 * step. The first step, and the first after a stop, is one of order 1.
 *
 * Local errors come from divided differences of the solution itself, which stiff modes, once
 * damped, do not reach as they would reach the rates: (1 + w)^2 / (6 w (1 + 2 w)) h^3 y''' and
 * h^2 y'' / 2. Between steps: the polynomial that the formula differentiates.
 */
#include <math.h>
#include <string.h>

#include "run/run.h"

static int order_now(const bd_sim *sim) {
  return sim->now->order < sim->n_history + 1 ? sim->now->order : sim->n_history + 1;
}

/* Weights of y_new, y and the past in the divided difference of that order, times h^order. */
static void differences(const bd_sim *sim, double h, int order, double *weights) {
  double t[MAX_HISTORY + 2] = {1.0, 0.0};
  for (int k = 0; k < order - 1; ++k) {
    t[k + 2] = t[k + 1] - sim->history_h[k] / h;
  }
  for (int i = 0; i <= order; ++i) {
    weights[i] = 1.0;
    for (int j = 0; j <= order; ++j) {
      weights[i] /= i == j ? 1.0 : t[i] - t[j];
    }
  }
}

int bd_lbdf_attempt(bd_sim *sim, double h, double *error) {
  const bd_layout *lay = &sim->model->lay;
  const bd_kernels *kernels = sim->plan.kernels;
  const int order = order_now(sim);
  int code = bd_sim_linearise(sim);
  if (code == BD_OK) {
    code = bd_sim_torque_by_time(sim, h, 0);
  }
  if (code != BD_OK) {
    return code;
  }
  const double w = order > 1 ? h / sim->history_h[0] : 0.0;
  const double gamma = (1.0 + w) / (1.0 + 2.0 * w), beta = w * w / (1.0 + 2.0 * w);
  const double g = gamma * h;
  bd_newton_linearise_contact(&sim->newton, &sim->plan, sim->y, h);
  bd_newton_factor(&sim->newton, &sim->plan, g);
  ++sim->stats.nlu;
  double *d = sim->stage[1];
  if (order > 1) {
    const double a[] = {beta / g, -beta / g};
    kernels->combine(lay->size, d, sim->stage[0], 1.0, 2, a, (double *[]){sim->y, sim->history[0]});
  } else {
    memcpy(d, sim->stage[0], lay->size * sizeof *d);
  }
  bd_sim_add_torque_by_time(sim, d, h);
  bd_newton_add_normal_correction(&sim->newton, &sim->plan, d);
  bd_newton_solve(&sim->newton, &sim->plan, d);
  const double one = 1.0;
  kernels->combine(lay->size, sim->y_new, sim->y, 1.0, 1, &one, &d);
  if (sim->n_history < order) {
    *error = kernels->error_norm(lay, 0.0, 1, &one, &d, sim->weights); /* finite or not */
    return BD_OK;
  }
  const double local = order > 1 ? (1.0 + w) * (1.0 + w) / (w * (1.0 + 2.0 * w)) : 1.0;
  double weights[MAX_HISTORY + 2];
  differences(sim, h, order + 1, weights);
  *error = kernels->error_norm(lay, local, order + 2, weights,
                               (double *[]){sim->y_new, sim->y, sim->history[0], sim->history[1]},
                               sim->weights);
  return BD_OK;
}

void bd_lbdf_inside(bd_sim *sim, double h, double s, double *y) {
  const double r = order_now(sim) > 1 ? sim->history_h[0] / h : 0.0;
  const double a[] = {r > 0.0 ? s * (s + r) / (1.0 + r) : s, r > 0.0 ? -s * (s + r - 1.0) / r : -s,
                      r > 0.0 ? s * (s - 1.0) / (r * (r + 1.0)) : 0.0};
  sim->plan.kernels->combine(sim->model->lay.size, y, sim->y, 1.0, r > 0.0 ? 3 : 2, a,
                             (double *[]){sim->y_new, sim->y, sim->history[0]});
  bd_sim_work_inside(sim, h, s, y);
}

int bd_lbdf_finish(bd_sim *sim, double h, double t_new) {
  return bd_sim_finish_step(sim, h, t_new, 0);
}
