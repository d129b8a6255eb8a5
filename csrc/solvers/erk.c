/* SPDX-License-Identifier: MIT
 *
 * Explicit Runge-Kutta methods as tableaux, one row each. All end with a stage at (t + h, y_new),
 * so the last rate of a step is the first of the next, and both ends' rates serve dense output.
 *
 * tsit5: Ch. Tsitouras, "Runge-Kutta pairs of order 5(4) satisfying only the first column
 *   simplifying assumption", Comput. Math. Appl. 62 (2011) 770-775; its free interpolant of
 * order 4. Real stability limit 3.507; 3.0 to 3.5 for modes up to 80 degrees from it, 0.51 if
 * undamped. rk4: the classical method, cubic Hermite between its points.
 *
 * Guarded by tests/test_integrators.py: order conditions, observed order, dense output.
 */
#include <math.h>

#include "solvers/solvers.h"

static const double tsit5_c[] = {0.0, 0.161, 0.327, 0.9, 0.9800255409045097, 1.0, 1.0};
static const double tsit5_a[] = {
    0.161,
    -0.008480655492356989,
    0.335480655492357,
    2.8971530571054935,
    -6.359448489975075,
    4.3622954328695815,
    5.325864828439257,
    -11.748883564062828,
    7.4955393428898365,
    -0.09249506636175525,
    5.86145544294642,
    -12.92096931784711,
    8.159367898576159,
    -0.071584973281401,
    -0.028269050394068383,
    0.09646076681806523,
    0.01,
    0.4798896504144996,
    1.379008574103742,
    -3.290069515436081,
    2.324710524099774,
};
static const double tsit5_error[] = {
    -0.00178001105222577714, -0.0008164344596567469, 0.007880878010261995, -0.1447110071732629,
    0.5823571654525552,      -0.45808210592918697,   1.0 / 66.0,
};

static void tsit5_dense(double s, double *b) {
  static const double r[7][3] = {
      {-2.763706197274826, 2.9132554618219126, -1.0530884977290216},
      {0.1317, -0.2234, 0.1017},
      {3.9302962368947516, -5.941033872131505, 2.490627285651253},
      {-12.411077166933676, 30.33818863028232, -16.548102889244902},
      {37.50931341651104, -88.1789048947664, 47.37952196281928},
      {-27.896526289197286, 65.09189467479366, -34.87065786149661},
      {1.5, -4.0, 2.5},
  };
  for (int k = 0; k < 7; ++k) {
    b[k] = s * s * (r[k][0] + s * (r[k][1] + s * r[k][2]));
  }
  b[0] += s;
}

static const double rk4_c[] = {0.0, 0.5, 0.5, 1.0, 1.0};
static const double rk4_a[] = {
    0.5, 0.0, 0.5, 0.0, 0.0, 1.0, 1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0,
};

static void rk4_dense(double s, double *b) {
  double gain = s * s * (3.0 - 2.0 * s);
  for (int k = 0; k < 4; ++k) {
    b[k] = gain * rk4_a[6 + k];
  }
  b[0] += s * (1.0 - s) * (1.0 - s);
  b[4] = s * s * (s - 1.0);
}

const bd_tableau bd_tsit5 = {7, tsit5_c, tsit5_a, tsit5_error, tsit5_dense};
/* The rate at the end in place of the last stage's makes a formula of order 3 of the same stages.
 */
static const double rk4_error[] = {0.0, 0.0, 0.0, 1.0 / 6.0, -1.0 / 6.0};

const bd_tableau bd_rk4 = {5, rk4_c, rk4_a, rk4_error, rk4_dense};

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
    *error = kernels->error_norm(lay, h, m->stages, m->error, stepper->stage, stepper->weights);
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
