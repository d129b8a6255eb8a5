/* SPDX-License-Identifier: MIT
 *
 * The table of integration methods. The driver (run/driver.c) knows a method by its bd_method
 * alone, which stands at the end of its file; another method is another file and a row here. First
 * explicit methods, then implicit ones, in the order in which lists of them are shown.
 */
#include <math.h>
#include <string.h>

#include "solvers/solvers.h"

#define METHODS(X)                                                                                 \
  X(tsit5)                                                                                         \
  X(rk4)                                                                                           \
  X(lbdf2)                                                                                         \
  X(rodas4)                                                                                        \
  X(lie)

#define X(name) extern const bd_method bd_method_##name;
METHODS(X)
#undef X

static const bd_method *const methods[] = {
#define X(name) &bd_method_##name,
    METHODS(X)
#undef X
};

const bd_method *bd_method_at(size_t k) {
  return k < sizeof methods / sizeof methods[0] ? methods[k] : NULL;
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

typedef struct error_target {
  double factor, exponent;
} error_target;

/* Of a belt that says by which share of rtol, local errors add up as those of smooth motions do: to
 * what goes with the order of the method. */
static error_target error_target_of(const bd_method *method, const bd_model *model) {
  const bd_belt_facts *belt = &model->belt_model->facts;
  const double *as = belt->smooth && method->error_target_smooth[0] > 0.0
                         ? method->error_target_smooth
                         : method->error_target;
  return belt->by_rtol > 0.0
             ? (error_target){belt->by_rtol, (double)method->error_order / (double)method->order}
             : (error_target){as[0], as[1]};
}

/* Of methods that look back, differences of states say nothing below what rounding leaves of a
 * joint's stretch. Nor are errors of e stretches small where e^2 of the preload's energy, which
 * they may leave in the joints, is more than the twentieth that bd_guard_energy allows; in contact,
 * a hundred times as stiff, they leave more. A single evaluation that erred by 0.4 to 1 lifted all
 * links off a pulley, and the next pressed them in, with ten times the preload's energy; explicit
 * steps at the stability limit keep such errors, and what damps them (tests/test_guards.py). The
 * stages of an implicit step meet the contact within it. */
double bd_method_tolerance(const bd_method *method, const bd_model *model, double rtol) {
  const int back = method->history > 0;
  const double least = back ? 1e-10 : 0.0, most = method->implicit && !back ? 1.0 : 0.22;
  const error_target to = error_target_of(method, model);
  return fmax(least, fmin(most, to.factor * pow(rtol, to.exponent)));
}

double bd_method_error(const bd_method *method, const bd_model *model, double local) {
  const error_target from = error_target_of(method, model);
  return pow(local / from.factor, 1.0 / from.exponent);
}

/* A step at the stability limit of the joints, which is known, would let rounding errors and
 * rejected steps excite the stiffest mode: at 93 % of it scenes that differ by rounding alone take
 * the same steps (tests/test_invariance.py). The stiffest mode of a string is at the closed form,
 * that of links below it: with 93 % forces of the paper's drive with 60 masses err by 1e-3 of the
 * tension where 1e-4 is asked, for the friction of weakly damped waves chatters, with 86 % by 2e-4.
 */
double bd_method_longest(const bd_method *method, const bd_model *model) {
  return model->belt_model->facts.explicit_share * method->stability / model->info.spectral_bound;
}
