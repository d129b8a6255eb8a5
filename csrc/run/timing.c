/* SPDX-License-Identifier: MIT
 *
 * What the passes of a step cost, measured by calling each of them over and over at the state that
 * a run has reached. Nothing of it is in the steps themselves: looks at the clock round each pass,
 * 36 ns each, would be 7 to 16 % of a step of the paper's mesh and as much as its smallest passes.
 * Passes called like this find their data in the nearest cache, and what stands between them is no
 * part of any, so a step as a whole takes a little longer than its parts.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "run/run.h"

enum { MAX_ROUNDS = 101 };

enum { SEARCH, JACOBIAN, FACTOR, EFFECT, WITHOUT_FRICTION, SOLVE, COMBINE, ERROR, EVENTS };
enum { STEP = EVENTS + 1, STEP_WITHOUT_LEDGER };

typedef struct pass {
  const char *name;
  double calls; /* a step */
  int does;
  int effect; /* index in the plan, of passes that are one */
} pass;

/* --- passes ---------------------------------------------------------------------------------- */

/* Contact as if no pulley had a friction law. */
static int rate_without_friction(bd_stepper *stepper, int effect) {
  bd_plan *plan = &stepper->plan;
  const int np = plan->model->lay.np;
  for (int j = 0; j < np; ++j) {
    plan->contact_pulleys[j].law = BD_LAW_NONE;
  }
  const int code = plan->effects[effect]->rate(plan, stepper->t, stepper->y, stepper->y_mid,
                                               &stepper->report.failure);
  for (int j = 0; j < np; ++j) {
    plan->contact_pulleys[j].law = plan->model->friction[j].law;
  }
  return code;
}

static void combine(bd_stepper *stepper, int n) {
  static const double a[MAX_VECTORS] = {0.0};
  stepper->plan.kernels->combine(stepper->model->lay.size, stepper->y_mid, stepper->y, stepper->h,
                                 n, a, stepper->stage);
}

/* All of a step: stage s from those before it; of Rosenbrock methods its right-hand side as well.
 */
static void combine_all(bd_stepper *stepper) {
  const bd_method *method = stepper->method;
  const int stages = method->implicit ? method->vectors - 2 : method->vectors;
  for (int s = 1; s < stages; ++s) {
    for (int k = 0; k < 1 + method->implicit; ++k) {
      combine(stepper, s);
    }
  }
  for (int k = 0; k < method->implicit + (method->history > 0); ++k) {
    combine(stepper, 1 + k);
  }
}

static int step(bd_stepper *stepper) {
  double error;
  int changed = 0;
  stepper->jacobian_known = 0;
  bd_plan_list(&stepper->plan, stepper->y, stepper->h);
  int code = stepper->method->attempt(stepper, stepper->h, &error);
  if (code == BD_OK) {
    code = bd_plan_after_step(&stepper->plan, stepper->t, stepper->y_new, 1e-3 * stepper->rtol,
                              &changed, &stepper->report.failure);
  }
  return code == BD_OK ? stepper->method->finish(stepper, stepper->h, stepper->t + stepper->h)
                       : code;
}

static int call(bd_stepper *stepper, const pass *p) {
  static const double weights[MAX_VECTORS] = {0.0};
  bd_plan *plan = &stepper->plan;
  bd_error *err = &stepper->report.failure;
  const bd_method *method = stepper->method;
  const bd_layout *lay = &stepper->model->lay;
  int code = BD_OK, changed = 0, terms;
  switch (p->does) {
  case SEARCH:
    bd_plan_list(plan, stepper->y, stepper->h);
    break;
  case JACOBIAN:
    bd_newton_linearise(&stepper->newton, plan, stepper->y);
    break;
  case FACTOR:
    bd_newton_factor(&stepper->newton, plan, stepper->y, stepper->h, stepper->h,
                     method->history > 0 ? stepper->y_mid : NULL);
    break;
  case EFFECT:
    code = plan->effects[p->effect]->rate(plan, stepper->t, stepper->y, stepper->y_mid, err);
    break;
  case WITHOUT_FRICTION:
    code = rate_without_friction(stepper, p->effect);
    break;
  case SOLVE: /* of rates, which have to be fetched anew, for they become the solution */
    memcpy(stepper->y_mid, stepper->stage[0], lay->size * sizeof *stepper->y_mid);
    bd_newton_solve(&stepper->newton, plan, stepper->y_mid);
    break;
  case COMBINE:
    combine_all(stepper);
    break;
  case ERROR:
    terms = !method->implicit ? method->vectors : method->history > 0 ? 3 : 1;
    code = bd_plan_error(plan, &(bd_step_sum){stepper->h, terms, weights, stepper->stage,
                                              stepper->weights}) >= 0.0
               ? BD_OK
               : BD_ERR_NOT_FINITE;
    break;
  case EVENTS: /* of a copy */
    code =
        bd_plan_after_step(plan, stepper->t, stepper->y_new, 1e-3 * stepper->rtol, &changed, err);
    break;
  case STEP:
    code = step(stepper);
    break;
  case STEP_WITHOUT_LEDGER:
    plan->ledger = 0;
    code = step(stepper);
    plan->ledger = 1;
  }
  return code;
}

/* In the order of a step; at the end the step as a whole, and, where there is a ledger, the same
 * without it. rates: evaluations a step without ledger. */
static int list(const bd_sim *sim, int rates, pass *passes) {
  const bd_plan *plan = &sim->stepper.plan;
  const bd_method *method = sim->stepper.method;
  int n = 0;
  passes[n++] = (pass){"search for links near pulleys", 1.0, SEARCH, -1};
  if (method->implicit) {
    passes[n++] = (pass){"Jacobian", 1.0, JACOBIAN, -1};
    passes[n++] = (pass){"factorisation", 1.0, FACTOR, -1};
  }
  for (int k = 0; k < plan->n_effects; ++k) {
    const int is_contact = plan->friction_on && plan->effects[k] == &bd_effect_contact;
    if (is_contact) {
      passes[n++] = (pass){"contact: normal force", rates, WITHOUT_FRICTION, k};
    }
    passes[n++] = (pass){is_contact ? "contact: friction" : bd_sim_pass(sim, k), rates, EFFECT, k};
  }
  if (method->implicit) { /* a vector for each solution, and for the rates at both ends */
    passes[n++] = (pass){"solution of the linear system", method->vectors - 2, SOLVE, -1};
  }
  passes[n++] = (pass){"stages combined", 1.0, COMBINE, -1};
  if (method->adaptive) {
    passes[n++] = (pass){"norm of the error", 1.0, ERROR, -1};
  }
  passes[n++] = (pass){"events of contact and friction", 1.0, EVENTS, -1};
  passes[n++] = (pass){"whole step", 1.0, STEP, -1};
  if (plan->ledger) {
    passes[n++] = (pass){"energy ledger", 1.0, STEP_WITHOUT_LEDGER, -1};
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
    code = call(stepper, p);
  }
  *seconds = (now() - begin) / (double)calls;
  stepper->plan.skip_power = stepper->plan.no_power;
  return code;
}

static int compare(const void *a, const void *b) {
  const double left = *(const double *)a, right = *(const double *)b;
  return (left > right) - (left < right);
}

/* Medians of rounds over all passes. */
static int time_all(bd_stepper *stepper, int n, const pass *passes, int rounds, double *seconds) {
  const double BATCH = 1e-4; /* [s] */
  const int FIRST = 3;       /* calls, of which the clock and a cold cache are no large part */
  double times[BD_MAX_PASSES][MAX_ROUNDS];
  long calls[BD_MAX_PASSES];
  for (int round = -1; round < rounds; ++round) {
    for (int k = 0; k < n; ++k) {
      double *time = round < 0 ? &seconds[k] : &times[k][round];
      const int code = time_calls(stepper, &passes[k], round < 0 ? FIRST : calls[k], time);
      if (code != BD_OK) {
        return code;
      }
      if (round < 0) {
        calls[k] = 1 + (long)(BATCH / fmax(1e-9, seconds[k]));
      }
    }
  }
  for (int k = 0; k < n; ++k) {
    qsort(times[k], (size_t)rounds, sizeof **times, compare);
    seconds[k] = times[k][rounds / 2];
  }
  return BD_OK;
}

/* A step from y, so that all that a pass looks at is there; and how many rates it evaluates. */
static int try_step(bd_stepper *stepper, int *rates) {
  const int ledger = stepper->plan.ledger;
  stepper->now = stepper->method;
  stepper->plan.t_piece = stepper->t + 0.5 * stepper->h;
  bd_plan_list(&stepper->plan, stepper->y, stepper->h);
  int code = bd_stepper_ensure_rate(stepper);
  stepper->plan.ledger = 0;
  const long before = stepper->nfev;
  code = code == BD_OK ? step(stepper) : code;
  stepper->plan.ledger = ledger;
  *rates = (int)(stepper->nfev - before);
  return code;
}

/* Friction and the ledger are what contact, or a step, takes more with them than without them. */
static int measure(bd_sim *sim, int rounds, bd_pass_time *out, int *n) {
  pass passes[BD_MAX_PASSES];
  double seconds[BD_MAX_PASSES];
  int rates = 0;
  int code = try_step(&sim->stepper, &rates);
  const int listed = list(sim, rates, passes);
  code = code == BD_OK ? time_all(&sim->stepper, listed, passes, rounds, seconds) : code;
  for (int k = 0; code == BD_OK && k < listed; ++k) {
    out[k] = (bd_pass_time){passes[k].name, passes[k].calls, seconds[k]};
    if (k > 0 && passes[k - 1].does == WITHOUT_FRICTION) {
      out[k].seconds -= seconds[k - 1];
    } else if (passes[k].does == STEP_WITHOUT_LEDGER) {
      out[k] = out[k - 1];
      out[k - 1] = (bd_pass_time){passes[k].name, 1.0, seconds[k - 1] - seconds[k]};
    }
  }
  *n = code == BD_OK ? listed : 0;
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
