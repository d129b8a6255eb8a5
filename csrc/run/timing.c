/* SPDX-License-Identifier: MIT
 *
 * What the passes of a step cost, measured by calling each of them over and over at the state that
 * a run has reached. Nothing of it is in the steps themselves. Passes called like this find their
 * data in the nearest cache, and what stands between them is no part of any, so a step as a whole
 * takes a little longer than its parts.
 */
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "run/run.h"

enum { MAX_ROUNDS = 101 };

typedef struct pass {
  const char *name;
  double calls; /* a step */
  int (*call)(bd_stepper *stepper, int effect);
  int effect; /* index in the plan, of passes that are one */
} pass;

/* --- passes ---------------------------------------------------------------------------------- */

static int call_search(bd_stepper *stepper, int effect) {
  (void)effect;
  bd_search_ready(&stepper->plan, stepper->y, stepper->h);
  return BD_OK;
}

static int call_effect(bd_stepper *stepper, int effect) {
  return stepper->plan.effects[effect]->rate(&stepper->plan, stepper->t, stepper->y, stepper->y_mid,
                                             &stepper->report.failure);
}

/* contact as if no pulley had a friction law */
static int call_without_friction(bd_stepper *stepper, int effect) {
  bd_plan *plan = &stepper->plan;
  for (int j = 0; j < plan->model->lay.np; ++j) {
    plan->contact_pulleys[j].law = BD_LAW_NONE;
  }
  int code = call_effect(stepper, effect);
  for (int j = 0; j < plan->model->lay.np; ++j) {
    plan->contact_pulleys[j].law = plan->model->friction[j].law;
  }
  return code;
}

static int call_jacobian(bd_stepper *stepper, int effect) {
  (void)effect;
  bd_newton_linearise(&stepper->newton, &stepper->plan, stepper->y);
  return BD_OK;
}

static int call_factor(bd_stepper *stepper, int effect) {
  (void)effect;
  double *c = stepper->method->history > 0 ? stepper->y_mid : NULL;
  bd_newton_factor(&stepper->newton, &stepper->plan, stepper->y, stepper->h, stepper->h, c);
  return BD_OK;
}

/* of rates, which have to be fetched anew, for they become the solution */
static int call_solve(bd_stepper *stepper, int effect) {
  (void)effect;
  memcpy(stepper->y_mid, stepper->stage[0], stepper->model->lay.size * sizeof *stepper->y_mid);
  bd_newton_solve(&stepper->newton, &stepper->plan, stepper->y_mid);
  return BD_OK;
}

static void combine(bd_stepper *stepper, int n) {
  static const double a[MAX_VECTORS] = {0.0};
  stepper->plan.kernels->combine(stepper->model->lay.size, stepper->y_mid, stepper->y, stepper->h,
                                 n, a, stepper->stage);
}

/* All of a step: stage s from those before it; of Rosenbrock methods its right-hand side as well.
 */
static int call_combine(bd_stepper *stepper, int effect) {
  (void)effect;
  const bd_method *method = stepper->method;
  const int stages = method->implicit ? method->vectors - 2 : method->vectors;
  for (int s = 1; s < stages; ++s) {
    combine(stepper, s);
    if (method->implicit) {
      combine(stepper, s);
    }
  }
  if (method->implicit) {
    combine(stepper, 1);
  }
  if (method->history > 0) {
    combine(stepper, 2);
  }
  return BD_OK;
}

static int call_error(bd_stepper *stepper, int effect) {
  (void)effect;
  static const double weights[MAX_VECTORS] = {0.0};
  const bd_method *method = stepper->method;
  const int n = !method->implicit ? method->vectors : method->history > 0 ? 3 : 1;
  const double error = stepper->plan.kernels->error_norm(&stepper->model->lay, stepper->h, n,
                                                         weights, stepper->stage, stepper->weights);
  return error >= 0.0 ? BD_OK : BD_ERR_NOT_FINITE;
}

/* what happens to the state between two steps, of a copy */
static int call_after(bd_stepper *stepper, int effect) {
  (void)effect;
  int changed = 0;
  return bd_plan_after_step(&stepper->plan, stepper->t, stepper->y_new, 1e-3 * stepper->rtol,
                            &changed, &stepper->report.failure);
}

static int call_step(bd_stepper *stepper, int effect) {
  double error;
  stepper->jacobian_known = 0;
  int code = call_search(stepper, effect);
  if (code == BD_OK) {
    code = stepper->method->attempt(stepper, stepper->h, &error);
  }
  if (code == BD_OK) {
    code = call_after(stepper, effect);
  }
  return code == BD_OK ? stepper->method->finish(stepper, stepper->h, stepper->t + stepper->h)
                       : code;
}

static int call_step_without_ledger(bd_stepper *stepper, int effect) {
  stepper->plan.ledger = 0;
  int code = call_step(stepper, effect);
  stepper->plan.ledger = 1;
  return code;
}

/* --- the list -------------------------------------------------------------------------------- */

/* In the order of a step; at the end the step as a whole, and, where there is a ledger, the same
 * without it. rates: evaluations a step without ledger. */
static int list(const bd_sim *sim, int rates, pass *passes) {
  const bd_plan *plan = &sim->stepper.plan;
  const bd_method *method = sim->stepper.method;
  int n = 0;
  passes[n++] = (pass){"search for links near pulleys", 1.0, call_search, -1};
  if (method->implicit) {
    passes[n++] = (pass){"Jacobian", 1.0, call_jacobian, -1};
    passes[n++] = (pass){"factorisation", 1.0, call_factor, -1};
  }
  for (int k = 0; k < plan->n_effects; ++k) {
    if (plan->friction_on && strcmp(plan->effects[k]->name, "contact") == 0) {
      passes[n++] = (pass){"contact: normal force", rates, call_without_friction, k};
    }
    passes[n++] = (pass){bd_sim_pass(sim, k), rates, call_effect, k};
  }
  if (method->implicit) { /* a vector for each solution, and for the rates at both ends */
    passes[n++] = (pass){"solution of the linear system", method->vectors - 2, call_solve, -1};
  }
  passes[n++] = (pass){"stages combined", 1.0, call_combine, -1};
  if (method->adaptive) {
    passes[n++] = (pass){"norm of the error", 1.0, call_error, -1};
  }
  passes[n++] = (pass){"events of contact and friction", 1.0, call_after, -1};
  passes[n++] = (pass){"whole step", 1.0, call_step, -1};
  if (plan->ledger) {
    passes[n++] = (pass){"energy ledger", 1.0, call_step_without_ledger, -1};
  }
  return n;
}

_Static_assert((int)BD_MAX_EFFECTS + 10 <= (int)BD_MAX_PASSES, "room for every pass");

/* --- timing ---------------------------------------------------------------------------------- */

static double now(void) {
  struct timespec at;
  timespec_get(&at, TIME_UTC);
  return (double)at.tv_sec + 1e-9 * (double)at.tv_nsec;
}

/* Time of a call [s], of so many in a row. Effects and derivatives are those of a rate at y. */
static int time_calls(bd_stepper *stepper, const pass *p, long calls, double *seconds) {
  stepper->plan.skip_power = 1;
  int code = bd_plan_rate(&stepper->plan, stepper->t, stepper->y, stepper->y_mid,
                          &stepper->report.failure);
  const double begin = now();
  for (long k = 0; code == BD_OK && k < calls; ++k) {
    code = p->call(stepper, p->effect);
  }
  *seconds = (now() - begin) / (double)calls;
  stepper->plan.skip_power = stepper->plan.no_power;
  return code;
}

static int compare(const void *a, const void *b) {
  const double left = *(const double *)a, right = *(const double *)b;
  return (left > right) - (left < right);
}

static double median(int n, double *values) {
  qsort(values, (size_t)n, sizeof *values, compare);
  return values[n / 2];
}

static int time_all(bd_stepper *stepper, int n, const pass *passes, int rounds, double *seconds) {
  const double BATCH = 1e-4; /* [s] */
  const int FIRST = 3;       /* calls, of which the clock and a cold cache are no large part */
  double times[BD_MAX_PASSES][MAX_ROUNDS];
  long calls[BD_MAX_PASSES];
  int code = BD_OK;
  for (int k = 0; code == BD_OK && k < n; ++k) {
    double once;
    code = time_calls(stepper, &passes[k], FIRST, &once);
    calls[k] = 1 + (long)(BATCH / (once > 1e-9 ? once : 1e-9));
  }
  for (int round = 0; code == BD_OK && round < rounds; ++round) {
    for (int k = 0; code == BD_OK && k < n; ++k) {
      code = time_calls(stepper, &passes[k], calls[k], &times[k][round]);
    }
  }
  for (int k = 0; code == BD_OK && k < n; ++k) {
    seconds[k] = median(rounds, times[k]);
  }
  return code;
}

/* A step from y, so that all that a pass looks at is there; and how many rates it evaluates. */
static int try_step(bd_sim *sim, int *rates) {
  bd_stepper *stepper = &sim->stepper;
  const int ledger = stepper->plan.ledger;
  stepper->now = stepper->method;
  stepper->plan.t_piece = stepper->t + 0.5 * stepper->h;
  bd_search_ready(&stepper->plan, stepper->y, stepper->h);
  int code = bd_stepper_ensure_rate(stepper);
  stepper->plan.ledger = 0;
  const long before = stepper->nfev;
  code = code == BD_OK ? call_step(stepper, -1) : code;
  stepper->plan.ledger = ledger;
  *rates = (int)(stepper->nfev - before);
  return code;
}

/* Friction and the ledger are what contact, or a step, takes more with them than without them. */
static int report(int n, const pass *passes, const double *seconds, bd_pass_time *out) {
  for (int k = 0; k < n; ++k) {
    out[k] = (bd_pass_time){passes[k].name, passes[k].calls, seconds[k]};
    if (k > 0 && passes[k - 1].call == call_without_friction) {
      out[k].seconds -= seconds[k - 1];
      out[k].name = "contact: friction";
    }
  }
  if (passes[n - 1].call == call_step_without_ledger) {
    const bd_pass_time whole = out[n - 2];
    out[n - 2] = out[n - 1];
    out[n - 2].seconds = whole.seconds - seconds[n - 1];
    out[n - 1] = whole;
  }
  return n;
}

static int measure(bd_sim *sim, int rounds, bd_pass_time *out, int *n) {
  pass passes[BD_MAX_PASSES];
  double seconds[BD_MAX_PASSES];
  int rates = 0;
  int code = try_step(sim, &rates);
  if (code == BD_OK) {
    *n = list(sim, rates, passes);
    code = time_all(&sim->stepper, *n, passes, rounds, seconds);
  }
  if (code == BD_OK) {
    *n = report(*n, passes, seconds, out);
  }
  return code;
}

int bd_sim_time_passes(bd_sim *sim, int rounds, bd_pass_time out[BD_MAX_PASSES], int *n,
                       bd_error *err) {
  *n = 0;
  if (rounds < 1 || rounds > MAX_ROUNDS) {
    return bd_fail(err, BD_ERR_OPTION, "rounds", "rounds must be from 1 to %d, got %d",
                   (int)MAX_ROUNDS, rounds);
  }
  if (atomic_flag_test_and_set(&sim->running)) {
    return bd_fail(err, BD_ERR_BUSY, "simulation", "the simulation is running in another call");
  }
  int code;
  if (sim->settling || sim->stats.steps == 0 || sim->status < 0) {
    code = bd_fail(err, BD_ERR_BUSY, "simulation",
                   "passes are timed of a run that has made a step and has not failed");
  } else {
    code = sim->status = measure(sim, rounds, out, n);
    if (code < 0 && err) {
      *err = sim->stepper.report.failure;
    }
    sim->t_end = sim->stepper.t;
  }
  atomic_flag_clear(&sim->running);
  return code;
}
