/* SPDX-License-Identifier: MIT
 *
 * From one step to the next: the states that a multistep method looks back on.
 */
#include "solvers/solvers.h"

/* Whole turns taken off phi, of the states looked back on as well. */
static void wind(bd_stepper *stepper) {
  double before = stepper->turns;
  bd_state_wind(&stepper->model->lay, stepper->y, &stepper->turns);
  double taken = (stepper->turns - before) * 2.0 * BD_PI; /* 0 of a string */
  for (int k = 0; taken != 0.0 && k < stepper->n_history; ++k) {
    double *phi = bd_field(&stepper->model->lay, stepper->history[k], F_PHI);
    for (int i = 0; i < stepper->model->lay.n; ++i) {
      phi[i] -= taken;
    }
  }
}

/* Friction that was reset when a link left its pulley is reset in past states, too; otherwise a
 * multistep method would take the difference for an error. */
static void reset_friction(bd_stepper *stepper) {
  const bd_layout *lay = &stepper->model->lay;
  for (int s = 0; s < bd_field_pieces(lay, F_SLIP); ++s) {
    const double *slip = bd_cfield(lay, stepper->y, bd_f_slip(lay, s));
    for (int k = 0; k < stepper->n_history; ++k) {
      double *before = stepper->history[k];
      for (int f = bd_f_state(lay, s); f < bd_f_state(lay, s + 1); ++f) {
        const double *mu = bd_cfield(lay, stepper->y, f);
        double *mu_before = bd_field(lay, before, f);
        for (int i = 0; i < lay->n; ++i) {
          mu_before[i] = mu[i] == 0.0 ? 0.0 : mu_before[i];
        }
      }
      double *slip_before = bd_field(lay, before, bd_f_slip(lay, s));
      for (int i = 0; i < lay->n; ++i) {
        slip_before[i] = slip[i] == 0.0 ? 0.0 : slip_before[i];
      }
    }
  }
}

/* y_new becomes y, y the first of the past, and the oldest makes room for the next y_new. */
void bd_history_push(bd_stepper *stepper, double h) {
  const int most = stepper->method->history;
  double *spare = most > 0 ? stepper->history[most - 1] : stepper->y;
  for (int k = most - 1; k > 0; --k) {
    stepper->history[k] = stepper->history[k - 1];
    stepper->history_h[k] = stepper->history_h[k - 1];
  }
  if (most > 0) {
    stepper->history[0] = stepper->y;
    stepper->history_h[0] = h;
    stepper->n_history = stepper->n_history < most ? stepper->n_history + 1 : most;
  }
  stepper->y = stepper->y_new;
  stepper->y_new = spare;
}

void bd_history_rebase(bd_stepper *stepper) {
  wind(stepper);
  reset_friction(stepper);
  for (int k = 0; stepper->model->belt_model->rebase && k < stepper->n_history; ++k) {
    stepper->model->belt_model->rebase(&stepper->plan, stepper->history[k]);
  }
}
