/* SPDX-License-Identifier: MIT
 *
 * The driver: steps, error control, exact stops at the torque's kinks, samples by dense output,
 * failure with the state left at the last good step.
 *
 * Contact and friction kinks are stepped through, not located: they outnumber the steps by far in a
 * fine belt, and a step that straddles one shows an error and shrinks. Local errors are held below
 * rtol on the scale of the joints' stretch in the max norm: one link in trouble is a sixtieth of a
 * root mean square, and a position's own size says nothing about a stretch of 1e-4 m.
 */
#include <float.h>
#include <math.h>
#include <string.h>

#include "run/run.h"

/* --- one step -------------------------------------------------------------------------------- */

int bd_sim_rate(bd_sim *sim, double t, double *y, double *dy) {
  ++sim->stats.nfev;
  return bd_plan_rate(&sim->plan, t, y, dy, &sim->failure);
}

int bd_sim_ensure_rate(bd_sim *sim) {
  if (sim->rate_known) {
    return BD_OK;
  }
  int code = bd_sim_rate(sim, sim->t, sim->y, sim->stage[0]);
  sim->rate_known = code == BD_OK;
  bd_opaque_began(sim);
  return code;
}

static int sample(bd_sim *sim, double t, double *y) {
  const bd_layout *lay = &sim->model->lay;
  int code = bd_torque_set_eval(&sim->plan.torques, t, sim->plan.t_piece, y + lay->theta,
                                y + lay->omega, sim->plan.torque, &sim->failure);
  if (code == BD_OK) {
    bd_observe(&sim->plan, y, sim->turns, sim->plan.torque, sim->e0, &sim->output,
               sim->next_sample++);
  }
  return code;
}

/* Samples up to the end of the step just made, t + h. */
static int sample_step(bd_sim *sim, double h, double t_new) {
  while (sim->next_sample < sim->n_samples && sim->t_sample[sim->next_sample] <= t_new) {
    double t = sim->t_sample[sim->next_sample], *y = sim->y_new;
    if (t < t_new) {
      y = sim->y_mid;
      sim->now->inside(sim, h, (t - sim->t) / h, y);
    }
    int code = sample(sim, t, y);
    if (code != BD_OK) {
      return code;
    }
    if (t < t_new && !sim->plan.torques.smooth) {
      bd_opaque_sampled(sim, t, h);
    }
  }
  return BD_OK;
}

/* Adopts y_new at t_new. */
static int accept(bd_sim *sim, double h, double t_new) {
  int changed = 0;
  int code = bd_plan_after_step(&sim->plan, t_new, sim->y_new, 1e-3 * sim->options.rtol, &changed,
                                &sim->failure);
  if (code == BD_OK) {
    code = sim->now->finish(sim, h, t_new);
  }
  if (code == BD_OK) {
    bd_opaque_keep(sim, h);
    code = sample_step(sim, h, t_new);
  }
  if (code != BD_OK) {
    return code;
  }
  double *first = sim->stage[0];
  int last = sim->now->vectors - 1;
  bd_history_push(sim, h);
  sim->stage[0] = sim->stage[last];
  sim->stage[last] = first;
  sim->t = t_new;
  sim->rate_known = sim->now->implicit || !changed; /* theirs was taken after the change */
  sim->jacobian_known = 0;
  bd_history_rebase(sim);
  ++sim->stats.steps;
  sim->stats.largest_step = fmax(sim->stats.largest_step, h);
  sim->stats.smallest_step = sim->stats.steps == 1 ? h : fmin(sim->stats.smallest_step, h);
  return BD_OK;
}

static double next_stop(bd_sim *sim) {
  bd_torque_set *set = &sim->plan.torques;
  while (sim->next_break < set->n_breaks && set->breaks[sim->next_break] <= sim->t) {
    ++sim->next_break;
  }
  if (sim->next_break > 0) {
    set->after = set->breaks[sim->next_break - 1];
  }
  set->before = sim->next_break < set->n_breaks ? set->breaks[sim->next_break] : (double)INFINITY;
  return fmin(set->before, sim->t_end);
}

int bd_sim_follow(bd_sim *sim, double t_new, double t_piece, double tolerance) {
  const double least = 1e-3 * (t_new - sim->t);
  double h = t_new - sim->t, error;
  next_stop(sim);
  sim->plan.t_piece = t_piece;
  while (sim->t < t_new) {
    int last = sim->t + 1.001 * h >= t_new;
    h = last ? t_new - sim->t : h;
    bd_search_ready(&sim->plan, sim->y, h);
    int code = sim->now->attempt(sim, h, &error);
    if (code == BD_OK && !isfinite(error)) {
      code = BD_ERR_NOT_FINITE;
    }
    if (code == BD_OK && error > tolerance && h > least) {
      h *= 0.25;
      continue;
    }
    if (code == BD_OK) {
      code = accept(sim, h, last ? t_new : sim->t + h);
    }
    if (code != BD_OK) {
      return code;
    }
  }
  return BD_OK;
}

/* --- running --------------------------------------------------------------------------------- */

/* Steps come from a geometric ladder, 2^(1/32) apart: rounding in the error estimate then does not
 * reach the step, so scenes that differ by rounding alone (turned, shifted) take the same steps. */
static double rung(double h) {
  return exp2(floor(32.0 * log2(h)) / 32.0);
}

/* An adaptive explicit step never nears the stability limit of the joints, which is known: there
 * the stiffest mode would live on rounding and rejected steps. */
double bd_sim_longest(const bd_sim *sim, double h) {
  const double MOST_LOOKS = 1000.0; /* in a step, between two answers to Ctrl-C */
  if (!sim->fixed && sim->method->stability > 0.0) {
    h = fmin(h, 0.93 * sim->method->stability / sim->model->info.spectral_bound);
  }
  if (!sim->plan.torques.smooth && !sim->fixed) {
    h = fmin(h, MOST_LOOKS * sim->opaque.interval);
  }
  return sim->options.max_step > 0.0 ? fmin(h, sim->options.max_step) : h;
}

/* One that nothing in the joints can make too long. */
static double first_step(const bd_sim *sim) {
  return 0.1 / sim->model->info.spectral_bound;
}

/* The shortest step that moves the time, at t = 0 the phase of the fastest mode. */
static double shortest(const bd_sim *sim) {
  return 16.0 * DBL_EPSILON * fmax(fabs(sim->t), 1.0 / sim->model->info.spectral_bound);
}

static int start(bd_sim *sim) {
  double h = sim->options.step > 0.0 ? sim->options.step
             : sim->fixed            ? 0.75 * sim->method->stability /
                                bd_stiffness_of(sim->model, &sim->plan.torques).bound
                          : first_step(sim);
  sim->h = bd_sim_longest(sim, fmax(h, shortest(sim)));
  sim->error_before = 1.0;
  sim->started = 1;
  bd_plan_place(&sim->plan, sim->t);
  bd_plan_assign_contacts(&sim->plan, sim->y);
  sim->plan.search.margin = 0.0;
  sim->plan.search.travelled = INFINITY;
  bd_search_ready(&sim->plan, sim->y, sim->h);
  sim->plan.t_piece = 0.5 * (sim->t + next_stop(sim));
  double terms[BD_N_ENERGY];
  sim->e0 = bd_energy(&sim->plan, sim->y, terms);
  bd_guard_begin(sim);
  while (sim->next_sample < sim->n_samples && sim->t_sample[sim->next_sample] <= sim->t) {
    int code = sample(sim, sim->t, sim->y);
    if (code != BD_OK) {
      return code;
    }
  }
  return BD_OK;
}

/* A failure of one step that a shorter or a more damping one may mend. */
static int may_be_mended(int code) {
  return code == BD_ERR_NOT_FINITE || code == BD_ERR_PASSED_THROUGH;
}

/* The step for the next one, from the error of this one over its limit: PI control (Gustafsson),
 * errors that are mostly rounding set aside; a step cut short by a stop must not shorten the next.
 */
static void choose_next(bd_sim *sim, double h, double error) {
  const double order = sim->method->error_order;
  error = fmax(error, 1e-3);
  double grow = 0.9 * pow(error, -0.7 / order) * pow(sim->error_before, 0.4 / order);
  double next = rung(h * fmin(sim->method->growth, fmax(0.2, grow)));
  sim->h = h < 0.9 * bd_sim_longest(sim, sim->h) && next < sim->h ? sim->h : next;
  sim->error_before = error;
}

/* Whether the set torque jumps at the stop just reached; the one before it was the last asked for.
 */
static int torque_jumps(bd_sim *sim, int *jumps) {
  const bd_layout *lay = &sim->model->lay;
  double *y = sim->y, *torque = sim->plan.torque;
  double piece = 0.5 * (sim->t + fmin(next_stop(sim), sim->t_end + 1.0));
  int code = bd_torque_set_eval(&sim->plan.torques, sim->t, piece, y + lay->theta, y + lay->omega,
                                torque, &sim->failure);
  for (int j = 0; code == BD_OK && j < lay->np; ++j) {
    double before = sim->newton.torque[j];
    *jumps |= fabs(torque[j] - before) > 1e-9 * (fabs(torque[j]) + fabs(before));
  }
  return code;
}

/* After a stop the torque, or its slope, is another: the rate is not known. Where the torque jumps
 * there is no past either, and a multistep method begins anew as the run began, for its first two
 * steps are not looked at. */
static int pass_stop(bd_sim *sim) {
  int jumps = 0, code = BD_OK;
  sim->rate_known = sim->jacobian_known = 0;
  if (sim->method->history > 0 && !sim->plan.pulleys_locked && sim->t < sim->t_end) {
    code = torque_jumps(sim, &jumps);
  }
  if (jumps) {
    sim->n_history = 0;
    if (!sim->fixed) {
      sim->h = fmin(sim->h, first_step(sim));
    }
  }
  return code;
}

/* Whether an implicit fixed step goes on with shorter ones after a failure. */
static int shortened(const bd_sim *sim) {
  return sim->fixed && sim->method->implicit && sim->h < 0.99 * sim->options.step;
}

/* What the error of a trial may be. A fixed step is not believed when it errs by many times the
 * stretch of a joint: an implicit one is then made again, and its error controlled, loosely, until
 * steps are as long as asked; an explicit one ends the run. What is left to the first order is
 * taken as it comes. */
static double limit(const bd_sim *sim) {
  enum { MAX_FIXED_STEP_ERROR = 20, LOOSE = 2 };
  if (sim->now != sim->method || sim->watch) {
    return DBL_MAX;
  }
  return !sim->fixed      ? bd_method_tolerance(sim->method, sim->options.rtol)
         : shortened(sim) ? (double)LOOSE
                          : (double)MAX_FIXED_STEP_ERROR;
}

/* One accepted step, or an error. */
static int step(bd_sim *sim) {
  const bd_method *m = sim->method;
  const double step_floor = shortest(sim);
  enum { MAX_RETRIES = 12, MAX_FALLBACKS = 200 };
  sim->now = m;
  for (int failed = 0;; ++failed) {
    double stop = next_stop(sim), left = stop - sim->t;
    double h = bd_sim_longest(sim, sim->h);
    /* equal parts rather than a sliver before the stop */
    double parts = ceil(left / h * (1.0 - 1e-12));
    int hit = parts <= 1.0;
    h = hit ? left : !sim->fixed && parts > 2.0 ? h : left / parts;
    double t_new = hit ? stop : sim->t + h, error = INFINITY, tolerance = limit(sim);
    sim->plan.t_piece = sim->t + 0.5 * h;
    bd_search_ready(&sim->plan, sim->y, h);
    bd_opaque_try(sim);
    int code = sim->now->attempt(sim, h, &error);
    bd_opaque_tried(sim, h);
    int within = isfinite(error) && error <= tolerance;
    const double least = sim->fixed ? 0.0 : bd_opaque_least(sim);
    const int rough = !within && !sim->fixed && isfinite(error) &&
                      error <= tolerance + bd_opaque_allowance(sim, h);
    double shortened_by = 1.0;
    if (rough) {
      within = 1;
    } else if (code == BD_OK && within) {
      code = bd_opaque_check(sim, h, t_new, tolerance, &shortened_by);
      within = shortened_by >= 1.0;
    }
    if (code == BD_OK && within) {
      if (sim->fixed && bd_state_bad(&sim->model->lay, sim->y_new, &(int){0}, &(int){0})) {
        code = BD_ERR_NOT_FINITE;
      } else {
        code = accept(sim, h, t_new);
      }
    } else if (code == BD_OK) {
      code = isfinite(error) ? BD_MORE : BD_ERR_NOT_FINITE;
    }
    if (code == BD_OK) {
      if (!rough) {
        sim->stats.local_error = fmax(sim->stats.local_error, bd_method_error(sim->now, error));
      }
      if (sim->now != m) {
        ++sim->stats.fallbacks;
      } else if (!sim->fixed) {
        choose_next(sim, h, error / tolerance);
        sim->h = fmax(sim->h, least);
      } else if (shortened(sim)) {
        choose_next(sim, h, error / tolerance);
        sim->h = fmin(sim->h, sim->options.step);
      }
      sim->fallbacks_in_a_row = sim->now != m ? sim->fallbacks_in_a_row + 1 : 0;
      if (sim->fallbacks_in_a_row > MAX_FALLBACKS) {
        return bd_sim_fail_floor(sim, h);
      }
      return hit ? pass_stop(sim) : BD_OK;
    }
    int mendable = code == BD_MORE || may_be_mended(code);
    if (code == BD_MORE && sim->fixed && !m->implicit) {
      return bd_sim_fail_fixed(sim, h, error);
    }
    if (!mendable || (sim->fixed && !m->implicit)) {
      return mendable ? bd_sim_fail_unstable(sim, code, h) : code;
    }
    ++sim->stats.rejected;
    if (sim->fixed) {
      /* the step asked for is not to be trusted */
      double guess = isfinite(error) ? bd_method_error(sim->now, error) : 1.0;
      sim->stats.local_error = fmax(sim->stats.local_error, fmax(1.0, guess));
    }
    if (code == BD_ERR_PASSED_THROUGH) {
      if (!m->implicit || h <= 1.01 * step_floor) {
        return sim->fixed ? bd_sim_fail_unstable(sim, code, h) : code;
      }
      bd_plan_assign_contacts(&sim->plan, sim->y);
    }
    if (h <= 1.01 * step_floor && (!m->implicit || sim->now->order == 1)) {
      return isfinite(error) ? bd_sim_fail_floor(sim, h)
                             : bd_sim_fail_unstable(sim, BD_ERR_NOT_FINITE, h);
    }
    double shrink = 0.1;
    if (shortened_by < 1.0) {
      shrink = shortened_by;
    } else if (code == BD_MORE) {
      shrink = fmin(0.9, fmax(0.1, 0.9 * pow(error / tolerance, -1.0 / m->error_order)));
    }
    sim->h = fmax(step_floor, rung(h * shrink));
    sim->h = h > 1.1 * least ? fmax(least, sim->h) : sim->h;
    /* what even short steps of a higher order cannot follow is left to the first order */
    if (m->implicit && (failed >= MAX_RETRIES || h <= 1.01 * step_floor)) {
      sim->now = bd_method_find("lie");
    }
  }
}

static int advance(bd_sim *sim, long max_steps) {
  int code = BD_OK, finished = 0;
  for (long k = 0; code == BD_OK && !finished && sim->t < sim->t_end; ++k) {
    if (k >= max_steps) {
      return BD_MORE;
    }
    if (sim->options.max_steps > 0 && sim->stats.steps >= sim->options.max_steps) {
      return bd_fail_at(&sim->failure, BD_ERR_MAX_STEPS, "max_steps", sim->t, -1, -1,
                        (double)sim->stats.steps,
                        "the limit of %ld steps was reached at t = %.9g s of %.9g s: raise "
                        "max_steps or %s",
                        sim->options.max_steps, sim->t, sim->t_end,
                        sim->options.max_step > 0.0 ? "max_step"
                        : sim->fixed                ? "step"
                                                    : "loosen rtol");
    }
    code = sim->started ? BD_OK : start(sim);
    if (code == BD_OK) {
      code = step(sim);
    }
    const int guarded = sim->options.guards && !sim->watch;
    if (code == BD_OK && guarded) {
      code = bd_guard_look(sim, sim->t >= sim->t_end);
    }
    if (code == BD_OK && guarded) {
      code = bd_guard_progress(sim);
    }
    if (code == BD_OK && guarded) {
      bd_twin_follow(sim);
    }
    if (code == BD_OK && sim->choice.method[0]) {
      bd_auto_watch(sim);
    }
    if (sim->watch) {
      code = sim->watch(sim, code, &finished);
    }
  }
  return code;
}

int bd_sim_advance(bd_sim *sim, long max_steps, bd_error *err) {
  if (atomic_flag_test_and_set(&sim->running)) {
    return bd_fail(err, BD_ERR_BUSY, "simulation",
                   "the simulation is running in another call; one simulation serves one thread, "
                   "and its torque function must not advance it");
  }
  if (sim->status >= 0 && !(sim->started && sim->status == BD_OK)) {
    sim->status = advance(sim, max_steps);
    sim->stats.searches = sim->plan.search.rebuilds;
  }
  int code = sim->status;
  if (code < 0 && err) {
    *err = sim->failure;
  }
  atomic_flag_clear(&sim->running);
  return code;
}

double bd_sim_time(const bd_sim *sim) {
  return sim->t;
}
size_t bd_sim_samples(const bd_sim *sim) {
  return sim->next_sample;
}
/* Local errors that do not grow come out about as large, and what the balance of energy misses
 * shows in the forces five times as large; where friction is so stiff that reversals are jumps,
 * errors come out up to ten times the local ones: measured on 400 random drives with
 * benchmarks/claims.py. Of the first and second order, damping shifts the creep, which adds up:
 * to 2.1 times in six seconds of the paper's drive. No estimate where steps are fixed, histories
 * part or a torque is not followed. */
static double estimated_error(const bd_sim *sim) {
  const double by_balance = 5.0, by_jumps = 5.0, rounds = 780.0; /* a second of the paper's drive */
  const int unknown[] = {BD_WARN_growth, BD_WARN_chatter, BD_WARN_undamped, BD_WARN_torque,
                         BD_WARN_rough_torque};
  for (size_t k = 0; k < sizeof unknown / sizeof unknown[0]; ++k) {
    if (sim->warned[unknown[k]].message[0]) {
      return 0.0;
    }
  }
  if (sim->fixed || sim->stats.local_error == 0.0) {
    return 0.0;
  }
  double error = sim->stats.local_error * (sim->twin.stiff ? by_jumps : 1.0);
  if (sim->plan.ledger) { /* else it is summed too coarsely to say so much */
    error = fmax(error, by_balance * fabs(sim->stats.balance));
  }
  double long_run = (sim->t - sim->t0) / bd_round_time(sim->model) / rounds;
  error *= bd_twin_magnifies(&sim->twin);
  return sim->method->history > 0 ? error * sqrt(fmax(1.0, long_run)) : error;
}

void bd_sim_stats(const bd_sim *sim, bd_stats *out) {
  *out = sim->stats;
  out->twin_steps = sim->twin.steps;
  out->error = estimated_error(sim);
}
const char *bd_sim_method(const bd_sim *sim) {
  return sim->method->name;
}
void bd_sim_explain(const bd_sim *sim, char *text, size_t size) {
  bd_auto_explain(sim, text, size);
}

const char *bd_sim_pass(const bd_sim *sim, int k) {
  const bd_plan *plan = &sim->plan;
  if (k >= 0 && k < plan->n_passes) {
    return plan->names[k];
  }
  return k == plan->n_passes && plan->ledger ? "energy ledger" : NULL;
}

int bd_sim_state(const bd_sim *sim, bd_state *out) {
  out->t = sim->t;
  bd_state_export(sim->model, sim->y, sim->turns, out);
  return BD_OK;
}
