/* SPDX-License-Identifier: MIT
 *
 * "rk4": the classical Runge-Kutta method, cubic Hermite between its points.
 */
#include "solvers/solvers.h"

static const double c[] = {0.0, 0.5, 0.5, 1.0, 1.0};
static const double a[] = {
    0.5, 0.0, 0.5, 0.0, 0.0, 1.0, 1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0,
};

static void dense(double s, double *b) {
  double gain = s * s * (3.0 - 2.0 * s);
  for (int k = 0; k < 4; ++k) {
    b[k] = gain * a[6 + k];
  }
  b[0] += s * (1.0 - s) * (1.0 - s);
  b[4] = s * s * (s - 1.0);
}

/* The rate at the end in place of the last stage's makes a formula of order 3 of the same stages,
 * whose error says whether a fixed step is out of all proportion. */
static const double error[] = {0.0, 0.0, 0.0, 1.0 / 6.0, -1.0 / 6.0};

static const bd_tableau tableau = {.stages = 5, .c = c, .a = a, .error = error, .dense = dense};

const bd_method bd_method_rk4 = {
    .name = "rk4",
    .order = 4,
    .error_order = 4,
    .vectors = 5,
    .may_be_fixed = 1,
    .stability = 2.78,
    .growth = 1.0,
    .error_target = {1.0, 1.0},
    .cost = {0.40, 0.025},
    BD_EXPLICIT(&tableau),
};
