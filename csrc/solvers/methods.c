/* SPDX-License-Identifier: MIT
 *
 * The table of integration methods: one row each. The driver (run/driver.c) knows a method by its
 * row alone; the rows' functions are in erk.c, rosenbrock.c and lbdf.c.
 *
 * aim: what a method must hold its local errors below for joint forces to come out about as near,
 * over the mean tension, as rtol asks, measured with benchmarks/work_precision.py: damping out the
 * belt's vibration, as methods of low order do, is an error that adds up over time, so they need
 * local errors that go with the square. rk4's error is that of the formula of order 3 in its
 * stages, which says whether a fixed step is out of all proportion. cost: benchmarks/kernels.py.
 */
#include <math.h>
#include <string.h>

#include "solvers/solvers.h"

#define EXPLICIT bd_erk_attempt, bd_erk_finish, bd_erk_inside
#define ROSENBROCK bd_rosenbrock_attempt, bd_rosenbrock_finish, bd_rosenbrock_inside
#define LBDF bd_lbdf_attempt, bd_lbdf_finish, bd_lbdf_inside

static const bd_method methods[] = {
    /* name, implicit, order, error_order, vectors, history, adaptive, may_be_fixed, stability,
     * growth, aim {factor, power}, cost {of a step, of a link in it} */
    {"tsit5", 0, 5, 5, 7, 0, 1, 0, 3.5, 5.0, {1.0, 1.0}, {0.40, 0.032}, EXPLICIT, &bd_tsit5},
    {"rk4", 0, 4, 4, 5, 0, 0, 1, 2.78, 1.0, {1.0, 1.0}, {0.40, 0.025}, EXPLICIT, &bd_rk4},
    {"lbdf2", 1, 2, 3, 3, 2, 1, 1, 0.0, 2.0, {100.0, 2.0}, {1.60, 0.052}, LBDF, NULL},
    {"rodas4", 1, 4, 4, 8, 0, 1, 0, 0.0, 5.0, {10.0, 1.0}, {3.00, 0.150}, ROSENBROCK, &bd_rodas4},
    {"lie", 1, 1, 2, 3, 1, 1, 1, 0.0, 2.0, {100.0, 2.0}, {1.60, 0.052}, LBDF, NULL},
};

const bd_method *bd_method_at(size_t k) {
  return k < sizeof methods / sizeof methods[0] ? &methods[k] : NULL;
}

const bd_method *bd_method_find(const char *name) {
  const bd_method *method;
  for (size_t k = 0; (method = bd_method_at(k)); ++k) {
    if (strcmp(name, method->name) == 0) {
      return method;
    }
  }
  return NULL;
}

/* Differences of states say nothing below what rounding leaves of a joint's stretch. */
double bd_method_tolerance(const bd_method *method, double rtol) {
  double least = method->history > 0 ? 1e-10 : 0.0;
  return fmax(least, fmin(1.0, method->aim[0] * pow(rtol, method->aim[1])));
}

double bd_method_error(const bd_method *method, double local) {
  return pow(local / method->aim[0], 1.0 / method->aim[1]);
}

/* A step at the stability limit of the joints, which is known, would let rounding errors and
 * rejected steps excite the stiffest mode: at 93 % of it scenes that differ by rounding alone take
 * the same steps (tests/test_invariance.py). */
double bd_method_longest(const bd_method *method, const bd_model *model) {
  return 0.93 * method->stability / model->info.spectral_bound;
}
