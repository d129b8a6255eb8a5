/* SPDX-License-Identifier: MIT
 *
 * From one step to the next: the states that a multistep method looks back on.
 */
#include "run/run.h"

/* Whole turns taken off phi, of the states looked back on as well. */
static void wind(bd_sim *sim) {
  double before = sim->turns;
  bd_state_wind(&sim->model->lay, sim->y, &sim->turns);
  double taken = (sim->turns - before) * 2.0 * BD_PI;
  for (int k = 0; taken != 0.0 && k < sim->n_history; ++k) {
    double *phi = bd_field(&sim->model->lay, sim->history[k], F_PHI);
    for (int i = 0; i < sim->model->lay.n; ++i) {
      phi[i] -= taken;
    }
  }
}

/* What a link that has left its pulley forgot was never there: a multistep method would go on with
 * it, and take it for an error. */
static void reset_friction(bd_sim *sim) {
  const bd_layout *lay = &sim->model->lay;
  for (int s = 0; s < lay->slots; ++s) {
    const double *mu = bd_cfield(lay, sim->y, F_MU + s);
    for (int k = 0; k < sim->n_history; ++k) {
      double *mu_before = bd_field(lay, sim->history[k], F_MU + s);
      double *slip_before = bd_field(lay, sim->history[k], bd_f_slip(lay) + s);
      for (int i = 0; i < lay->n; ++i) {
        mu_before[i] = mu[i] == 0.0 ? 0.0 : mu_before[i];
        slip_before[i] = mu[i] == 0.0 ? 0.0 : slip_before[i];
      }
    }
  }
}

/* y_new becomes y, y the first of the past, and the oldest makes room for the next y_new. */
void bd_history_push(bd_sim *sim, double h) {
  const int most = sim->method->history;
  double *spare = most > 0 ? sim->history[most - 1] : sim->y;
  for (int k = most - 1; k > 0; --k) {
    sim->history[k] = sim->history[k - 1];
    sim->history_h[k] = sim->history_h[k - 1];
  }
  if (most > 0) {
    sim->history[0] = sim->y;
    sim->history_h[0] = h;
    sim->n_history = sim->n_history < most ? sim->n_history + 1 : most;
  }
  sim->y = sim->y_new;
  sim->y_new = spare;
}

void bd_history_rebase(bd_sim *sim) {
  wind(sim);
  reset_friction(sim);
}
