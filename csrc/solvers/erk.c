/* SPDX-License-Identifier: MIT
 *
 * Explicit Runge-Kutta methods, each a tableau in a file of its own. All end with a stage at (t +
 * h, y_new), so the last rate of a step is the first of the next, and both ends' rates serve dense
 * output. Guarded by tests/test_integrators.py: order conditions, observed order,
 * dense output.
 */
#include <math.h>

#include "solvers/solvers.h"

/* The last stage is the rate at y_new. Without the ledger power is wanted at the steps' ends alone.
 */
int bd_erk_attempt(bd_stepper *stepper, double h, double *error) {
  const bd_tableau *m = stepper->now->table;
  const bd_layout *lay = &stepper->model->lay;
  const bd_kernels *kernels = stepper->plan.kernels;
  const double *row = m->a;
  int code = bd_stepper_ensure_rate(stepper);
  for (int s = 1; code == BD_OK && s < m->stages; ++s) {
    double *y = s == m->stages - 1 ? stepper->y_new : stepper->y_mid;
    kernels->combine(lay->size, y, stepper->y, h, s, row, stepper->stage);
    stepper->plan.skip_power =
        stepper->plan.no_power || (!stepper->plan.ledger && s < m->stages - 1);
    code = bd_stepper_rate(stepper, stepper->t + m->c[s] * h, y, stepper->stage[s]);
    row += s;
  }
  if (code == BD_OK) {
    *error = bd_plan_error(
        &stepper->plan, &(bd_step_sum){h, m->stages, m->error, stepper->stage, stepper->weights});
  }
  /* tsit5's last stages stand together: of a force that begins within 0.3 and 0.7 h, and rises, the
   * step has up to 0.17 too much or too little, and the estimate 0.01 of it on average */
  if (code == BD_OK && !stepper->fixed) {
    const double unseen = 0.1;
    const bd_step step = {
        .h = h, .g = h, .y = stepper->y, .y_new = stepper->y_new, .weights = stepper->weights};
    *error = fmax(*error, unseen * bd_plan_unseen(&stepper->plan, &step));
  }
  return code;
}

int bd_erk_finish(bd_stepper *stepper, double h, double t_new) {
  (void)t_new;
  const bd_layout *lay = &stepper->model->lay;
  const double *before = stepper->stage[0] + lay->work;
  const double *after = stepper->stage[stepper->now->vectors - 1] + lay->work;
  for (int k = 0; !stepper->plan.ledger && k < lay->n_work; ++k) {
    stepper->y_new[lay->work + k] = stepper->y[lay->work + k] + 0.5 * h * (before[k] + after[k]);
  }
  return BD_OK;
}

void bd_erk_inside(bd_stepper *stepper, double h, double s, double *y) {
  const bd_tableau *m = stepper->now->table;
  double b[BD_MAX_STAGES];
  m->dense(s, b);
  stepper->plan.kernels->combine(stepper->model->lay.size, y, stepper->y, h, m->stages, b,
                                 stepper->stage);
}

const char *bd_erk_worst(const bd_stepper *stepper, double h, int *body, int *pulley) {
  const bd_tableau *m = stepper->now->table;
  const bd_layout *lay = &stepper->model->lay;
  const char *name = "the state";
  double worst = 0.0;
  *body = *pulley = -1;
  for (size_t k = 0; k < lay->size; ++k) {
    double e = 0.0;
    for (int s = 0; s < m->stages; ++s) {
      e += h * m->error[s] * stepper->stage[s][k];
    }
    e = stepper->weights[k] * fabs(e);
    if (!(e <= worst) && stepper->weights[k] > 0.0) {
      worst = e;
      name = bd_state_fields[bd_field_at(lay, k, body, pulley)].name;
    }
  }
  return name;
}
