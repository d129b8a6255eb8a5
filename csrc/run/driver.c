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

/* Samples of a run at which velocities across the links are looked at, 100 in its last fifth: all
 * change their mean square by 1 to 3 %, and searching what touches takes as long as a sample of
 * little else. */
#define LOOKS 500

static int sample(bd_sim *sim, double t, double *y) {
  bd_plan *plan = &sim->stepper.plan;
  BD_TRY(bd_motion_put(plan, t, y, &sim->stepper.report.failure));
  /* functions are looked at for pulses here, whether or not their torque is kept */
  if (sim->output.torque || !plan->torques.smooth) {
    BD_TRY(bd_stepper_torque(&sim->stepper, t, y, plan->torque));
  }
  bd_output output = sim->output;
  if (sim->next_sample % (1 + sim->n_samples / LOOKS) != 0) {
    output.across = NULL;
  }
  bd_observe(plan, y, sim->stepper.turns, plan->torque, sim->e0, &output, sim->next_sample++);
  return BD_OK;
}

/* Samples up to the end of the step just made, t + h. */
static int sample_step(bd_sim *sim, double h, double t_new) {
  while (sim->next_sample < sim->n_samples && sim->t_sample[sim->next_sample] <= t_new) {
    double t = sim->t_sample[sim->next_sample], *y = sim->stepper.y_new;
    if (t < t_new) {
      y = sim->stepper.y_mid;
      sim->stepper.now->inside(&sim->stepper, h, (t - sim->stepper.t) / h, y);
    }
    BD_TRY(sample(sim, t, y));
    if (t < t_new && !sim->stepper.plan.torques.smooth) {
      bd_torque_functions_check_sample(&sim->stepper, t, h);
    }
  }
  return BD_OK;
}

/* Adopts y_new at t_new. */
static int accept(bd_sim *sim, double h, double t_new) {
  int changed = 0;
  const long contacts = sim->stepper.plan.contacts_changed;
  BD_TRY(bd_implicit_middle(&sim->stepper, h));
  BD_TRY(bd_plan_after_step(&sim->stepper.plan, t_new, sim->stepper.y_new, 1e-3 * sim->stepper.rtol,
                            &changed, &sim->stepper.report.failure));
  BD_TRY(sim->stepper.now->finish(&sim->stepper, h, t_new));
  BD_TRY(bd_torque_functions_push_torque(&sim->stepper, h));
  BD_TRY(sample_step(sim, h, t_new));
  sim->guard.bounces += bd_bounces(&sim->stepper.plan, sim->stepper.y, sim->stepper.y_new);
  /* an implicit method takes the rate at y_new after the change */
  bd_stepper_advance(&sim->stepper, h, t_new, sim->stepper.now->implicit || !changed);
  if (sim->stepper.plan.contacts_changed != contacts) {
    bd_stepper_weigh_friction(&sim->stepper);
  }
  bd_sim_warn_of_torques(sim);
  ++sim->stats.steps;
  sim->stats.largest_step = fmax(sim->stats.largest_step, h);
  sim->stats.smallest_step = sim->stats.steps == 1 ? h : fmin(sim->stats.smallest_step, h);
  return BD_OK;
}

static double next_stop(bd_sim *sim) {
  bd_torque_set *set = &sim->stepper.plan.torques;
  while (sim->next_break < set->n_breaks && set->breaks[sim->next_break] <= sim->stepper.t) {
    ++sim->next_break;
  }
  if (sim->next_break > 0) {
    set->after = set->breaks[sim->next_break - 1];
  }
  set->before = sim->next_break < set->n_breaks ? set->breaks[sim->next_break] : (double)INFINITY;
  return fmin(set->before, sim->t_end);
}

int bd_sim_replay_step(bd_sim *sim, double t_new, double t_piece, double tolerance,
                       double longest) {
  /* of which a quarter still moves the time */
  const double least = fmax(1e-3 * (t_new - sim->stepper.t), 8.0 * DBL_EPSILON * fabs(t_new));
  const double whole =
      (t_new - sim->stepper.t) / fmax(1.0, ceil((t_new - sim->stepper.t) / longest));
  /* Twice the step errs 32 times as much: still by less than a twin is displaced (growth.c). */
  const double calm = 0.01 / 32.0;
  double h = whole, error;
  next_stop(sim);
  sim->stepper.plan.t_piece = t_piece;
  while (sim->stepper.t < t_new) {
    int last = sim->stepper.t + 1.001 * h >= t_new;
    h = last ? t_new - sim->stepper.t : h;
    bd_plan_list(&sim->stepper.plan, sim->stepper.y, h);
    BD_TRY(sim->stepper.now->attempt(&sim->stepper, h, &error));
    BD_TRY(isfinite(error) ? BD_OK : BD_ERR_NOT_FINITE);
    if (error > tolerance && h > least) {
      h *= 0.25;
      continue;
    }
    BD_TRY(accept(sim, h, last ? t_new : sim->stepper.t + h));
    h = error < calm * tolerance ? fmin(2.0 * h, whole) : h;
  }
  return BD_OK;
}

/* --- running --------------------------------------------------------------------------------- */

/* Steps come from a geometric ladder, 2^(1/32) apart: rounding in the error estimate then does not
 * reach the step, so scenes that differ by rounding alone (turned, shifted) take the same steps. */
static double rung(double h) {
  return exp2(floor(32.0 * log2(h)) / 32.0);
}

/* The shortest step that moves the time, at t = 0 the phase of the fastest mode. A belt that
 * settles by a millionth of its step sinks into a pulley as far as it can: such steps go on for
 * ever. */
static double shortest(const bd_sim *sim) {
  const double moves = 16.0 * DBL_EPSILON *
                       fmax(fabs(sim->stepper.t), 1.0 / sim->stepper.model->info.spectral_bound);
  return sim->settling ? fmax(moves, 1e-6 * sim->options.step) : moves;
}

/* The first step, a tenth of the time constant of the stiffest mode of the joints: its error is
 * below 1e-5 of that mode by any method of order 4, and the controller lengthens it by five times a
 * step. Of a method that looks back nothing checks its first step, which is of order 1 and errs by
 * (h lambda)^2 / 2 of all that is stiff: by no more than errors may be, as far as the time has
 * digits for it. Implicit stages need not follow waves through the cells of a belt that flows,
 * whose time constants contact and friction make much shorter: its first step is as long as such a
 * wave takes for a cell, and fifteen steps that only grow are saved. */
static double first_step(const bd_sim *sim) {
  const double SHARE_OF_TIME_CONSTANT = 0.1;
  const bd_stepper *stepper = &sim->stepper;
  const bd_model *model = stepper->model;
  const double h = SHARE_OF_TIME_CONSTANT / model->info.spectral_bound;
  if (stepper->method->history == 0) {
    const double wave = sqrt(model->belt.axial_stiffness / model->belt.linear_density);
    return stepper->method->implicit && model->belt_model->facts.flows
               ? model->info.link_length / wave
               : h;
  }
  const double error = bd_method_tolerance(stepper->method, stepper->model, stepper->rtol);
  const double fastest = bd_stiffness_of(stepper->model, &stepper->plan.torques).bound;
  return fmin(h, fmax(100.0 * shortest(sim), sqrt(2.0 * error) / fastest));
}

int bd_sim_begin_motion(bd_sim *sim, bd_error *err) {
  sim->stepper.plan.t_piece = 0.5 * (sim->stepper.t + next_stop(sim));
  return bd_motion_begin(&sim->stepper.plan, sim->stepper.t, sim->t_end, sim->stepper.y, err);
}

static int start(bd_sim *sim) {
  const double STABILITY_SHARE = 0.75; /* the bound on all stiffnesses is an estimate */
  double h = sim->options.step > 0.0 ? sim->options.step
             : sim->stepper.fixed
                 ? STABILITY_SHARE * sim->stepper.method->stability /
                       bd_stiffness_of(sim->stepper.model, &sim->stepper.plan.torques).bound
                 : first_step(sim);
  sim->stepper.h = bd_stepper_longest(&sim->stepper, fmax(h, shortest(sim)));
  sim->error_before = 1.0;
  sim->started = 1;
  bd_stepper_reset(&sim->stepper);
  bd_plan_begin(&sim->stepper.plan, sim->stepper.y);
  bd_stepper_weigh_friction(&sim->stepper);
  bd_plan_list(&sim->stepper.plan, sim->stepper.y, sim->stepper.h);
  BD_TRY(bd_sim_begin_motion(sim, &sim->stepper.report.failure));
  BD_TRY(bd_motion_put(&sim->stepper.plan, sim->stepper.t, sim->stepper.y,
                       &sim->stepper.report.failure));
  double terms[BD_N_ENERGY];
  sim->e0 = bd_energy(&sim->stepper.plan, sim->stepper.t, sim->stepper.y,
                      bd_joints(&sim->stepper.plan, sim->stepper.y, 0), NULL, terms);
  bd_guard_begin(sim);
  while (sim->next_sample < sim->n_samples && sim->t_sample[sim->next_sample] <= sim->stepper.t) {
    BD_TRY(sample(sim, sim->stepper.t, sim->stepper.y));
  }
  return BD_OK;
}

/* A failure of one step that a shorter or a more damping one may mend. */
static int may_be_mended(int code) {
  return code == BD_ERR_NOT_FINITE || code == BD_ERR_PASSED_THROUGH;
}

/* The step for the next one, from the error of this one over its limit: PI control with the
 * exponents 0.7 / order and 0.4 / order and the safety factor 0.9 of Hairer, Norsett, Wanner,
 * Solving ODEs II, IV.2 (after K. Gustafsson); errors that are mostly rounding count as RELIABLE. A
 * step cut short by a stop must not shorten the next. */
static void choose_next(bd_sim *sim, double h, double error) {
  const double order = sim->stepper.method->error_order;
  const double RELIABLE = 1e-3, SAFETY = 0.9, INTEGRAL = 0.7, PROPORTIONAL = 0.4, LEAST = 0.2;
  error = fmax(error, RELIABLE);
  double grow =
      SAFETY * pow(error, -INTEGRAL / order) * pow(sim->error_before, PROPORTIONAL / order);
  double next = rung(h * fmin(sim->stepper.method->growth, fmax(LEAST, grow)));
  sim->stepper.h =
      h < 0.9 * bd_stepper_longest(&sim->stepper, sim->stepper.h) && next < sim->stepper.h
          ? sim->stepper.h
          : next;
  sim->error_before = error;
}

/* Whether the set torque jumps at the stop just reached; the one before it was the last asked for.
 */
static int torque_jumps(bd_sim *sim, int *jumps) {
  const bd_layout *lay = &sim->stepper.model->lay;
  double *y = sim->stepper.y, *torque = sim->stepper.plan.torque;
  double piece = 0.5 * (sim->stepper.t + fmin(next_stop(sim), sim->t_end + 1.0));
  BD_TRY(bd_torque_set_eval(&sim->stepper.plan.torques, sim->stepper.t, piece, y + lay->theta,
                            y + lay->omega, torque, &sim->stepper.report.failure));
  for (int j = 0; j < lay->np; ++j) {
    double before = sim->stepper.functions.now[j];
    *jumps |= fabs(torque[j] - before) > 1e-9 * (fabs(torque[j]) + fabs(before));
  }
  return BD_OK;
}

/* After a stop the torque, or its slope, is another: the rate is not known. Where the torque jumps
 * there is no past either, and a multistep method begins anew as the run began, for its first two
 * steps are not looked at. */
static int pass_stop(bd_sim *sim) {
  int jumps = 0;
  sim->stepper.rate_known = sim->stepper.jacobian_known = 0;
  if (sim->stepper.method->history > 0 && !sim->stepper.plan.pulleys_locked &&
      sim->stepper.t < sim->t_end) {
    BD_TRY(torque_jumps(sim, &jumps));
  }
  if (jumps) {
    sim->stepper.n_history = 0;
    if (!sim->stepper.fixed) {
      sim->stepper.h = fmin(sim->stepper.h, first_step(sim));
    }
  }
  return BD_OK;
}

/* Whether an implicit fixed step goes on with shorter ones after a failure. */
static int shortened(const bd_sim *sim) {
  const bd_stepper *stepper = &sim->stepper;
  return stepper->fixed && stepper->method->implicit && stepper->h < 0.99 * sim->options.step;
}

/* What the error of a trial may be. A fixed step is not believed when it errs by many times the
 * stretch of a joint: an implicit one is then made again, and its error controlled, loosely, until
 * steps are as long as asked; an explicit one ends the run. What is left to the first order is
 * taken as it comes. */
static double limit(const bd_sim *sim) {
  /* in units of a joint's stretch at rest: a link is then thrown out of its place by more than the
   * belt is stretched, and no result of such a step has been seen to be of use */
  enum { MAX_FIXED_STEP_ERROR = 20, LOOSE = 2 };
  const bd_stepper *stepper = &sim->stepper;
  if (stepper->now != stepper->method || sim->settling) {
    return DBL_MAX;
  }
  return !stepper->fixed  ? bd_method_tolerance(stepper->method, stepper->model, stepper->rtol)
         : shortened(sim) ? (double)LOOSE
                          : (double)MAX_FIXED_STEP_ERROR;
}

/* A step being tried. */
typedef struct trial {
  double h, t_new;
  int hits_stop; /* t_new is a kink of the torque, or the end */
  double error, tolerance;
  double least;        /* for a torque that jumps all the time: steps need not be shorter */
  int rough;           /* errs by more than the tolerance because of such a torque */
  double shortened_by; /* < 1: by which factor a torque function asks for a shorter step */
} trial;

static trial next_trial(bd_sim *sim) {
  const bd_stepper *stepper = &sim->stepper;
  const double stop = next_stop(sim), left = stop - stepper->t;
  const double h = bd_stepper_longest(stepper, stepper->h);
  /* equal parts rather than a sliver before the stop */
  const double parts = ceil(left / h * (1.0 - 1e-12));
  trial t = {.hits_stop = parts <= 1.0, .error = INFINITY, .shortened_by = 1.0};
  t.h = t.hits_stop ? left : !stepper->fixed && parts > 2.0 ? h : left / parts;
  t.t_new = t.hits_stop ? stop : stepper->t + t.h;
  t.tolerance = limit(sim);
  return t;
}

/* Of friction without a state, as links break loose. Where it falls, whether they do decides what
 * follows, so that errors of 1e-4 a step came out as 5e-3 to 4e-2 (tests/test_friction_runs.py): a
 * step with stages has mended most of it, one with a single evaluation has all of it. Elsewhere
 * what is left out comes once. */
static double unseen_error(bd_sim *sim, double h) {
  bd_stepper *stepper = &sim->stepper;
  const double of_stages = 1.0, of_single = 50.0, not_falling = 0.1;
  const double off =
      stepper->model->belt_model->off_line(&stepper->plan, stepper->y, stepper->y_new, h);
  const double counts = !sim->twin.friction_falls ? not_falling
                        : stepper->now->order > 2 ? of_stages
                                                  : of_single;
  return counts * off / stepper->rtol *
         bd_method_tolerance(stepper->now, stepper->model, stepper->rtol);
}

/* Makes the step and adopts it if it is good: BD_OK. BD_MORE: it errs too much. */
static int try_step(bd_sim *sim, trial *t) {
  bd_stepper *stepper = &sim->stepper;
  stepper->plan.t_piece = stepper->t + 0.5 * t->h;
  bd_plan_list(&stepper->plan, stepper->y, t->h);
  bd_torque_functions_before_try(stepper);
  int code = stepper->now->attempt(stepper, t->h, &t->error);
  if (code == BD_OK && !stepper->fixed && !sim->settling && stepper->now->implicit) {
    t->error = fmax(t->error, unseen_error(sim, t->h));
  }
  const int looked = bd_torque_functions_after_try(stepper, t->h, t->error);
  code = code == BD_OK ? looked : code;
  int within = isfinite(t->error) && t->error <= t->tolerance;
  t->least = stepper->fixed ? 0.0 : bd_torque_functions_shortest_step(stepper);
  t->rough = !within && !stepper->fixed && isfinite(t->error) &&
             t->error <= t->tolerance + bd_torque_functions_extra_error(stepper, t->h);
  if (code == BD_OK && within) {
    code = bd_torque_functions_check_step(stepper, t->h, t->t_new, t->tolerance, &t->shortened_by);
    within = t->shortened_by >= 1.0;
  }
  if (code != BD_OK) {
    return code;
  }
  if (!within && !t->rough) {
    return isfinite(t->error) ? BD_MORE : BD_ERR_NOT_FINITE;
  }
  if (stepper->fixed && bd_state_bad(&stepper->model->lay, stepper->y_new, &(int){0}, &(int){0})) {
    return BD_ERR_NOT_FINITE;
  }
  return accept(sim, t->h, t->t_new);
}

/* After an accepted step: errors, the length of the next. */
static int go_on(bd_sim *sim, const trial *t) {
  enum { MAX_FALLBACKS = 200 }; /* then it is no single jump, and the run would take for ever */
  bd_stepper *stepper = &sim->stepper;
  const int fallback = stepper->now != stepper->method;
  if (!t->rough) {
    sim->stats.local_error =
        fmax(sim->stats.local_error, bd_method_error(stepper->now, stepper->model, t->error));
  }
  if (fallback) {
    ++sim->stats.fallbacks;
  } else if (!stepper->fixed) {
    choose_next(sim, t->h, t->error / t->tolerance);
    stepper->h = fmax(stepper->h, t->least);
  } else if (shortened(sim)) {
    choose_next(sim, t->h, t->error / t->tolerance);
    stepper->h = fmin(stepper->h, sim->options.step);
  }
  sim->fallbacks_in_a_row = fallback ? sim->fallbacks_in_a_row + 1 : 0;
  if (sim->fallbacks_in_a_row > MAX_FALLBACKS) {
    return bd_sim_fail_floor(sim, t->h);
  }
  return t->hits_stop ? pass_stop(sim) : BD_OK;
}

/* After a rejected step: BD_OK, and stepper.h is what to try next, or the error that ends the run.
 * code: BD_MORE where the step erred too much. */
static int reject(bd_sim *sim, const trial *t, int code, int retries) {
  enum { MAX_RETRIES = 12 }; /* of one step; a jump of the torque takes about as many */
  bd_stepper *stepper = &sim->stepper;
  const bd_method *m = stepper->method;
  const double step_floor = shortest(sim), h = t->h;
  const int at_floor = h <= 1.01 * step_floor;
  if (code == BD_MORE && stepper->fixed && !m->implicit) {
    return bd_sim_fail_fixed(sim, h, t->error);
  }
  if (code != BD_MORE && !may_be_mended(code)) {
    return code;
  }
  if (stepper->fixed && !m->implicit) {
    return bd_sim_fail_unstable(sim, code, h);
  }
  ++sim->stats.rejected;
  if (stepper->fixed) {
    /* the step asked for is not to be trusted */
    double guess =
        isfinite(t->error) ? bd_method_error(stepper->now, stepper->model, t->error) : 1.0;
    sim->stats.local_error = fmax(sim->stats.local_error, fmax(1.0, guess));
  }
  if (code == BD_ERR_PASSED_THROUGH) {
    if (!m->implicit || at_floor) {
      return stepper->fixed ? bd_sim_fail_unstable(sim, code, h) : code;
    }
    bd_plan_begin(&stepper->plan, stepper->y);
    bd_stepper_weigh_friction(stepper);
  }
  if (at_floor && (!m->implicit || stepper->now->order == 1)) {
    return isfinite(t->error) ? bd_sim_fail_floor(sim, h)
                              : bd_sim_fail_unstable(sim, BD_ERR_NOT_FINITE, h);
  }
  double shrink = 0.1;
  if (t->shortened_by < 1.0) {
    shrink = t->shortened_by;
  } else if (code == BD_MORE) {
    shrink = fmin(0.9, fmax(0.1, 0.9 * pow(t->error / t->tolerance, -1.0 / m->error_order)));
  }
  stepper->h = fmax(step_floor, rung(h * shrink));
  stepper->h = h > 1.1 * t->least ? fmax(t->least, stepper->h) : stepper->h;
  /* what even short steps of a higher order cannot follow is left to the first order */
  if (m->implicit && (retries >= MAX_RETRIES || at_floor)) {
    stepper->now = bd_method_find("lie");
  }
  return BD_OK;
}

/* One accepted step, or an error. */
static int step(bd_sim *sim) {
  sim->stepper.now = sim->stepper.method;
  for (int retries = 0;; ++retries) {
    trial t = next_trial(sim);
    int code = try_step(sim, &t);
    if (code == BD_OK) {
      return go_on(sim, &t);
    }
    BD_TRY(reject(sim, &t, code, retries));
  }
}

static int advance(bd_sim *sim, long max_steps) {
  const int guarded = sim->options.guards && !sim->settling;
  for (long k = 0; sim->stepper.t < sim->t_end; ++k) {
    if (k >= max_steps) {
      return BD_MORE;
    }
    if (sim->options.max_steps > 0 && sim->stats.steps >= sim->options.max_steps) {
      return BD_FAIL(sim, BD_ERR_MAX_STEPS, "max_steps", -1, -1, (double)sim->stats.steps,
                     "the limit of %ld steps was reached at t = %.9g s of %.9g s: raise "
                     "max_steps or %s",
                     sim->options.max_steps, sim->stepper.t, sim->t_end,
                     sim->stepper.max_step > 0.0 ? "max_step"
                     : sim->stepper.fixed        ? "step"
                                                 : "loosen rtol");
    }
    BD_TRY(sim->started ? BD_OK : start(sim));
    BD_TRY(step(sim));
    if (guarded) {
      BD_TRY(bd_guard_look(sim, sim->stepper.t >= sim->t_end));
      BD_TRY(BD_EVERY_STEP ? bd_guard_check(sim) : BD_OK);
      BD_TRY(bd_guard_progress(sim));
      bd_twin_follow(sim);
    }
    if (sim->choice.method[0]) {
      bd_auto_watch(sim);
    }
  }
  return BD_OK;
}

int bd_sim_advance(bd_sim *sim, long max_steps, bd_error *err) {
  if (atomic_flag_test_and_set(&sim->running)) {
    return bd_fail(err, BD_ERR_BUSY, "simulation",
                   "the simulation is running in another call; one simulation serves one thread, "
                   "and its torque function must not advance it");
  }
  if (sim->status >= 0 && !(sim->started && sim->status == BD_OK)) {
    sim->status = advance(sim, max_steps);
    sim->stats.searches = sim->stepper.plan.search.rebuilds;
  }
  int code = sim->status;
  if (code < 0 && err) {
    *err = sim->stepper.report.failure;
  }
  atomic_flag_clear(&sim->running);
  return code;
}

void bd_sim_restart(bd_sim *sim, const double *y, double turns) {
  memcpy(sim->stepper.y, y, sim->stepper.model->lay.size * sizeof *y);
  sim->stepper.t = sim->t0;
  sim->stepper.turns = turns;
  sim->stepper.rate_known = sim->stepper.jacobian_known = 0;
  sim->started = 0;
  sim->status = BD_OK;
}

double bd_sim_time(const bd_sim *sim) {
  return sim->stepper.t;
}
size_t bd_sim_samples(const bd_sim *sim) {
  return sim->next_sample;
}
/* Local errors that neither grow nor add up come out about as large, and what the balance of
 * energy misses shows in the forces five times as large; where friction is so stiff that reversals
 * are jumps, errors come out up to ten times the local ones: measured on 400 random drives with
 * benchmarks/claims.py. Contact along the links lets implicit steps be so long that the works in
 * them, not the forces, are what the balance misses: by 0.1 to 300 times the error of the forces.
 * Of the first and second order, damping shifts the creep, which adds up:
 * to 2.1 times in six seconds of the paper's drive. A mount that bounces on its stops carries
 * errors from one bounce to the next and makes them larger, up to 20 times in 50 bounces, seldom
 * though. No estimate where steps are fixed, histories part or a torque is not followed. */
static double estimated_error(const bd_sim *sim) {
  const double by_jumps = 5.0, by_bounce = 10.0;
  const double rounds = 780.0; /* a second of the paper's drive */
  const bd_belt_facts *belt = &sim->stepper.model->belt_model->facts;
  const int unknown[] = {BD_WARN_growth, BD_WARN_chatter, BD_WARN_torque, BD_WARN_rough_torque};
  for (size_t k = 0; k < sizeof unknown / sizeof unknown[0]; ++k) {
    const int excused = unknown[k] == BD_WARN_chatter && sim->twin.excused;
    if (sim->stepper.report.warned[unknown[k]].message[0] && !excused) {
      return 0.0;
    }
  }
  if (sim->stepper.fixed || sim->guard.rings || sim->stats.local_error == 0.0) {
    return 0.0;
  }
  double error = sim->stats.local_error * fmax(belt->error_by_local, bd_guard_adds_up(sim)) *
                 (sim->twin.stiff ? by_jumps : 1.0);
  if (sim->stepper.plan.ledger) { /* else it is summed too coarsely to say so much */
    error = fmax(error, belt->error_by_balance * fabs(sim->stats.balance));
  }
  double long_run = (sim->stepper.t - sim->t0) / bd_round_time(sim->stepper.model) / rounds;
  error *= bd_growth_factor(&sim->twin) * (1.0 + (double)sim->guard.bounces / by_bounce);
  return sim->stepper.method->history > 0 ? error * sqrt(fmax(1.0, long_run)) : error;
}

void bd_sim_stats(const bd_sim *sim, bd_stats *out) {
  *out = sim->stats;
  out->nfev = sim->stepper.nfev;
  out->njev = sim->stepper.njev;
  out->nlu = sim->stepper.nlu;
  out->twin_steps = sim->twin.steps + sim->twin.missed.steps;
  out->error = estimated_error(sim);
}
const char *bd_sim_method(const bd_sim *sim) {
  return sim->stepper.method->name;
}
const char *bd_sim_pass(const bd_sim *sim, int k) {
  const bd_plan *plan = &sim->stepper.plan;
  if (k >= 0 && k < plan->n_effects) {
    const bd_effect *effect = plan->effects[k];
    return effect->label ? effect->label(plan) : effect->name;
  }
  return k == plan->n_effects && plan->ledger ? "energy ledger" : NULL;
}

int bd_sim_effect(const bd_sim *sim, int k) {
  const bd_plan *plan = &sim->stepper.plan;
  return k >= 0 && k < plan->n_effects ? bd_effect_row(plan->effects[k]) : -1;
}

int bd_sim_state(const bd_sim *sim, bd_state *out) {
  out->t = sim->stepper.t;
  bd_state_export(sim->stepper.model, sim->stepper.y, sim->stepper.turns, out);
  return BD_OK;
}
