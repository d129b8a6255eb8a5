/* SPDX-License-Identifier: MIT
 *
 * method = "auto": an explicit and an implicit method, of which the cheaper goes on.
 *
 * What an explicit step can span is known beforehand, from the joints' spectral bound: shorter as
 * the belt is finer or its damping heavier. How far an implicit step reaches depends on what
 * happens, how often links meet their pulleys and slip turns round, and is known only by trying. So
 * the first choice comes from the bound, the tolerance, the number of links and what an implicit
 * method needs at best; where that leaves doubt, both methods are tried, and again from time to
 * time, ever more rarely while the answer stays the same. Steps are counted, not timed: the same
 * run chooses the same on every machine. Guarded by tests/test_auto.py.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "run/run.h"

/* Steps that an implicit method takes while a wave runs once round the belt, at a local error of
 * 1e-3 of the stretch, where it has least to do (a drive that hardly slips); up to twenty times as
 * many were seen where links ring and slip turns round all the time. */
static const double LEAST = 4.0;
/* Steps to judge by, after those in which a step finds its length; and between two looks. */
enum { JUDGE = 128, WARM_UP = 16, FIRST_LOOK = 2000, LAST_LOOK = 32000 };
/* The other method must be this much cheaper. */
static const double MARGIN = 1.25;
/* Explicit steps so many times dearer than joints ask for are held by something stiffer, as
 * friction, and leave it vibrating: implicit ones need hundreds of steps to be as long as they can
 * be. */
static const double HELD = 10.0;
enum { LONG_WARM_UP = 512 };
/* From this tolerance on the second order is the cheapest; and where friction saturates within so
 * small a part of a joint's stretch that every reversal is a jump, which no order gets past. Modes
 * of a belt that flows ask for a higher one at any tolerance. */
static const double COARSE = 0.02, JUMPS = 100.0;
/* A Python torque costs this much a call [us]. */
static const double CALL = 1.0;

static double cost_of(const bd_sim *sim, const bd_method *m) {
  const bd_torque_set *set = &sim->stepper.plan.torques;
  double cost = m->cost[0] + m->cost[1] * sim->stepper.model->lay.n;
  for (size_t k = 0; k < set->n_terms; ++k) {
    if (set->terms[k].kind == BD_TORQUE_CALL) {
      double calls = m->vectors - 1 + (m->implicit ? 2 * set->np + 2 : 0);
      cost += CALL * calls;
    }
  }
  if (set->motion.called) {
    cost += CALL * m->vectors; /* several of a number, once a stage */
  }
  return cost;
}

void bd_auto_pair(const bd_model *model, double rtol, bd_auto *pair) {
  double stretch = model->info.strain * model->info.link_length;
  const int coarse = rtol >= COARSE || stretch > JUMPS * bd_least_slip(model);
  const int flows = model->belt_model->facts.flows;
  pair->method[AUTO_EXPLICIT] = bd_method_find("tsit5");
  pair->method[AUTO_IMPLICIT] = bd_method_find(coarse && !flows ? "lbdf2" : "rodas4");
}

/* Cost of a simulated second [us]: of the explicit method at its longest step; of the implicit one
 * at best. Waves in the cells of a belt that flows are not worth following, and explicit steps let
 * them grow where nothing damps them. */
static double explicit_cost(const bd_sim *sim) {
  if (sim->stepper.model->belt_model->facts.flows) {
    return (double)INFINITY;
  }
  const bd_method *m = sim->choice.method[AUTO_EXPLICIT];
  double h = bd_method_longest(m, sim->stepper.model);
  return cost_of(sim, m) / (sim->stepper.max_step > 0.0 ? fmin(h, sim->stepper.max_step) : h);
}

static double implicit_cost(const bd_sim *sim, double steps_a_round) {
  const bd_method *m = sim->choice.method[AUTO_IMPLICIT];
  const bd_belt *belt = &sim->stepper.model->belt;
  double rounds = sqrt(belt->axial_stiffness / belt->linear_density) / belt->length;
  double finer = pow(1e-3 / bd_method_tolerance(m, sim->stepper.model, sim->stepper.rtol),
                     1.0 / m->error_order);
  return cost_of(sim, m) * rounds * steps_a_round * finer;
}

static long tries(const bd_sim *sim) {
  return sim->stats.steps + sim->stats.rejected;
}

/* A new stretch: a few steps to find the step's length, then those to judge by. */
static void begin_stretch(bd_sim *sim) {
  sim->choice.tries_begin = sim->choice.tries_judge = tries(sim);
  sim->choice.t_judge = sim->stepper.t;
}

void bd_auto_begin(bd_sim *sim) {
  bd_auto *c = &sim->choice;
  double certain = explicit_cost(sim);
  c->now = certain <= implicit_cost(sim, LEAST) ? AUTO_EXPLICIT : AUTO_IMPLICIT;
  c->doubtful = c->now == AUTO_IMPLICIT;
  c->look_after = FIRST_LOOK;
  c->t_before = sim->stepper.t;
  sim->stepper.method = sim->stepper.now = c->method[c->now];
  begin_stretch(sim);
}

static void change(bd_sim *sim) {
  bd_auto *c = &sim->choice;
  double kept = c->h_kept > 0.0 ? c->h_kept : sim->stepper.h;
  c->h_kept = sim->stepper.h;
  c->now = !c->now;
  ++sim->stats.changes;
  sim->stepper.method = c->method[c->now];
  /* a multistep method begins with its first order */
  sim->stepper.h =
      bd_stepper_longest(&sim->stepper, c->now == AUTO_EXPLICIT            ? (double)INFINITY
                                        : sim->stepper.method->history > 0 ? 0.0625 * kept
                                                                           : kept);
  sim->error_before = 1.0;
  sim->stepper.n_history = 0;
  sim->stepper.rate_known = sim->stepper.jacobian_known = 0;
  begin_stretch(sim);
}

int bd_auto_leave_explicit(bd_sim *sim) {
  bd_auto *c = &sim->choice;
  if (!c->method[AUTO_EXPLICIT] || c->now != AUTO_EXPLICIT) {
    return 0;
  }
  change(sim);
  c->per_second[AUTO_EXPLICIT] = (double)INFINITY; /* no cost makes the implicit one dearer */
  return 1;
}

void bd_auto_watch(bd_sim *sim) {
  bd_auto *c = &sim->choice;
  long since = tries(sim) - c->tries_begin;
  ++c->steps[c->now];
  c->time[c->now] += sim->stepper.t - c->t_before;
  c->t_before = sim->stepper.t;
  const int held = c->per_second[AUTO_EXPLICIT] > HELD * explicit_cost(sim);
  const long warm_up = held && c->now == AUTO_IMPLICIT ? LONG_WARM_UP : WARM_UP;
  if (since < warm_up) {
    c->tries_judge = tries(sim);
    c->t_judge = sim->stepper.t;
  }
  if (since < warm_up + JUDGE) {
    return;
  }
  double seen = cost_of(sim, sim->stepper.method) * (double)(tries(sim) - c->tries_judge) /
                (sim->stepper.t - c->t_judge);
  c->per_second[c->now] = seen;
  if (c->now == AUTO_IMPLICIT) {
    if (seen > MARGIN * fmax(explicit_cost(sim), c->per_second[AUTO_EXPLICIT])) {
      change(sim);
    } else {
      c->look_after = FIRST_LOOK; /* it was worth looking */
      begin_stretch(sim);
    }
    return;
  }
  /* shorter steps than the joints ask for: the contact's stiffness, or the tolerance */
  c->doubtful |= seen > 1.5 * explicit_cost(sim) && seen > implicit_cost(sim, LEAST);
  if (seen > HELD * explicit_cost(sim)) {
    c->look_after = FIRST_LOOK; /* by far: looking can only help */
  }
  double other = c->per_second[AUTO_IMPLICIT];
  if (c->doubtful && other > 0.0 && seen > MARGIN * other) {
    change(sim);
  } else if (c->doubtful && since >= c->look_after) {
    c->look_after = c->look_after < LAST_LOOK ? 2 * c->look_after : LAST_LOOK;
    change(sim);
  }
}

void bd_sim_explain(const bd_sim *sim, char *text, size_t size) {
  const bd_auto *c = &sim->choice;
  const bd_method *one = c->method[AUTO_EXPLICIT], *other = c->method[AUTO_IMPLICIT];
  if (!one) {
    snprintf(text, size, "%s, as asked", sim->stepper.method->name);
    return;
  }
  double bound = sim->stepper.model->info.spectral_bound,
         longest = bd_method_longest(one, sim->stepper.model);
  if (sim->stats.changes == 0) {
    snprintf(text, size, "%s: explicit steps are limited to %.3g s (spectral bound %.3g 1/s), %s",
             sim->stepper.method->name, longest, bound,
             c->now == AUTO_EXPLICIT ? "long enough for this tolerance"
                                     : "so implicit ones are cheaper");
    return;
  }
  snprintf(text, size,
           "%s for %.3g s in %ld steps, %s for %.3g s in %ld steps, switched %ld times to the "
           "cheaper method: explicit steps are limited to %.3g s (spectral bound %.3g 1/s)",
           one->name, c->time[AUTO_EXPLICIT], c->steps[AUTO_EXPLICIT], other->name,
           c->time[AUTO_IMPLICIT], c->steps[AUTO_IMPLICIT], sim->stats.changes, longest, bound);
}
