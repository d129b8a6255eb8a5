/* SPDX-License-Identifier: MIT
 *
 * Linearly implicit backward differentiation of order 2 ("lbdf2") and 1 ("lie", the linearly
 * implicit Euler method): one evaluation, one factorisation, one solve a step, no iteration that
 * could fail. With w = h / (step before), gamma = (1 + w) / (1 + 2 w), beta = w^2 / (1 + 2 w),
 *
 *   (1 - gamma h J) d = beta (y_n - y_{n-1}) + gamma h f(t_{n+1}, y_n),   y_{n+1} = y_n + d,
 *
 * J and f at y_n, the set torque at t_{n+1}, contact as bd_newton_factor sees it: a link
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

#include "solvers/solvers.h"

static int order_now(const bd_stepper *stepper) {
  return stepper->now->order < stepper->n_history + 1 ? stepper->now->order
                                                      : stepper->n_history + 1;
}

/* Weights of y_new, y and the past in the divided difference of that order, times h^order. */
static void differences(const bd_stepper *stepper, double h, int order, double *weights) {
  double t[MAX_HISTORY + 2] = {1.0, 0.0};
  for (int k = 0; k < order - 1; ++k) {
    t[k + 2] = t[k + 1] - stepper->history_h[k] / h;
  }
  for (int i = 0; i <= order; ++i) {
    weights[i] = 1.0;
    for (int j = 0; j <= order; ++j) {
      weights[i] /= i == j ? 1.0 : t[i] - t[j];
    }
  }
}

static int attempt(bd_stepper *stepper, double h, double *error) {
  const bd_layout *lay = &stepper->model->lay;
  const bd_kernels *kernels = stepper->plan.kernels;
  const int order = order_now(stepper);
  int code = bd_implicit_linearise(stepper, stepper->plan.search.step);
  if (code == BD_OK) {
    code = bd_implicit_torque_by_time(stepper, h, 0);
  }
  if (code != BD_OK) {
    return code;
  }
  const double w = order > 1 ? h / stepper->history_h[0] : 0.0;
  const double gamma = (1.0 + w) / (1.0 + 2.0 * w), beta = w * w / (1.0 + 2.0 * w);
  const double g = gamma * h;
  double *d = stepper->stage[1];
  if (order > 1) {
    const double a[] = {beta / g, -beta / g};
    kernels->combine(lay->size, d, stepper->stage[0], 1.0, 2, a,
                     (double *[]){stepper->y, stepper->history[0]});
  } else {
    memcpy(d, stepper->stage[0], lay->size * sizeof *d);
  }
  bd_implicit_add_torque_by_time(stepper, d, h);
  bd_newton_factor(&stepper->newton, &stepper->plan, stepper->y, g, h, d);
  ++stepper->nlu;
  code = bd_implicit_prescribe(stepper, h, g, d);
  if (code != BD_OK) {
    return code;
  }
  bd_newton_solve(&stepper->newton, &stepper->plan, d);
  const double one = 1.0;
  kernels->combine(lay->size, stepper->y_new, stepper->y, 1.0, 1, &one, &d);
  if (stepper->n_history < order) {
    *error = bd_plan_error(&stepper->plan, /* finite or not */
                           &(bd_step_sum){0.0, 1, &one, &d, stepper->weights});
    *error = fmax(*error, bd_implicit_hidden_error(stepper, h, g, stepper->y_new));
    return BD_OK;
  }
  const double local = order > 1 ? (1.0 + w) * (1.0 + w) / (w * (1.0 + 2.0 * w)) : 1.0;
  double weights[MAX_HISTORY + 2];
  differences(stepper, h, order + 1, weights);
  double *const states[] = {stepper->y_new, stepper->y, stepper->history[0], stepper->history[1]};
  *error = bd_plan_error(&stepper->plan,
                         &(bd_step_sum){local, order + 2, weights, states, stepper->weights});
  *error = fmax(*error, bd_implicit_hidden_error(stepper, h, g, stepper->y_new));
  return BD_OK;
}

static void inside(bd_stepper *stepper, double h, double s, double *y) {
  const double r = order_now(stepper) > 1 ? stepper->history_h[0] / h : 0.0;
  const double a[] = {r > 0.0 ? s * (s + r) / (1.0 + r) : s, r > 0.0 ? -s * (s + r - 1.0) / r : -s,
                      r > 0.0 ? s * (s - 1.0) / (r * (r + 1.0)) : 0.0};
  stepper->plan.kernels->combine(stepper->model->lay.size, y, stepper->y, 1.0, r > 0.0 ? 3 : 2, a,
                                 (double *[]){stepper->y_new, stepper->y, stepper->history[0]});
  bd_implicit_work_inside(stepper, h, s, y);
}

/* What the two have in common. */
#define LINEARLY_IMPLICIT                                                                          \
  .implicit = 1, .vectors = 3, .adaptive = 1, .may_be_fixed = 1, .growth = 2.0,                    \
  .error_target = {100.0, 2.0}, .cost = {1.60, 0.052}, .attempt = attempt,                         \
  .finish = bd_implicit_finish, .inside = inside

const bd_method bd_method_lbdf2 = {.name = "lbdf2",
                                   .order = 2,
                                   .error_order = 3,
                                   .history = 2,
                                   .error_target_smooth = {39.0, 1.4},
                                   LINEARLY_IMPLICIT};

const bd_method bd_method_lie = {
    .name = "lie", .order = 1, .error_order = 2, .history = 1, LINEARLY_IMPLICIT};
