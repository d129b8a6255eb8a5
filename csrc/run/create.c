/* SPDX-License-Identifier: MIT
 *
 * Making a simulation: one block with everything in it, nothing allocated later; options and times
 * against their rules; where samples go.
 */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "run/run.h"

void bd_options_default(bd_options *options) {
  *options = (bd_options){
      .method = "auto", .rtol = 1e-4, .ledger = 1, .guards = 1, .torque_interval = 5e-4};
}

static void carve(bd_carver *carver, bd_sim *sim, const bd_model *model, const bd_method *method,
                  const bd_method *other, const bd_torque *torque) {
  BD_KEEP_INDEXES(carver, &sim->choice.now, 1, 0, N_AUTO - 1);
  bd_stepper_carve(carver, &sim->stepper, model, method, other, torque);
  BD_KEEP_SPAN(carver, sim, choice.per_second, choice.look_after);
  BD_KEEP_SPAN(carver, sim, t0, stats);
  bd_guard_carve(carver, &sim->guard, model->lay.np);
  bd_twin_carve(carver, &sim->twin, model->lay.np);
}

bd_sim *bd_sim_new(const bd_model *model, const bd_method *method, const bd_method *other,
                   const bd_torque *torque) {
  bd_carver carver = {0};
  bd_sim sizes, *sim;
  bd_carve(&carver, 1, sizeof *sim);
  carve(&carver, &sizes, model, method, other, torque);
  const size_t used = carver.used, bytes = used + carver.n_kept * sizeof(bd_kept);
  char *block = bd_block_new(bytes);
  if (!block) {
    return NULL;
  }
  carver = (bd_carver){.base = block, .kept = (bd_kept *)(block + used), .given = BD_NOTHING};
  sim = bd_carve(&carver, 1, sizeof *sim);
  carve(&carver, sim, model, method, other, torque);
  sim->kept = carver.kept;
  sim->n_kept = carver.n_kept;
  sim->given = carver.given;
  sim->bytes = bytes;
  sim->stats.spectral_bound = model->info.spectral_bound;
  atomic_flag_clear(&sim->running);
  return sim;
}

/* The sample times are the one thing of unknown number, in a block of their own. */
void bd_sim_free(bd_sim *sim) {
  if (sim) {
    bd_twin_free(&sim->twin);
    bd_block_free(sim->t_sample);
    bd_block_free(sim);
  }
}

void bd_sim_sizes(const bd_sim *sim, bd_sizes *out) {
  const bd_layout *lay = &sim->stepper.model->lay;
  const bd_sim *const beside[] = {sim->twin.sim, sim->twin.still, sim->twin.missed.pair[0],
                                  sim->twin.missed.pair[1]};
  *out = (bd_sizes){.state = lay->size, .works = (size_t)lay->n_work, .bytes = sim->bytes};
  for (size_t k = 0; k < sizeof beside / sizeof beside[0]; ++k) {
    out->bytes += beside[k] ? beside[k]->bytes : 0;
  }
}

static int automatic(const bd_options *options) {
  return !options->method || strcmp(options->method, "auto") == 0;
}

const char *bd_method_name(size_t k) {
  const bd_method *method = k > 0 ? bd_method_at(k - 1) : NULL;
  return k == 0 ? "auto" : method ? method->name : NULL;
}

static int check_options(const bd_options *options, bd_error *err) {
  if (!automatic(options) && !bd_method_find(options->method)) {
    char names[256] = "";
    for (size_t k = 0; bd_method_name(k); ++k) {
      size_t used = strlen(names);
      snprintf(names + used, sizeof names - used, "%s%s", k > 0 ? ", " : "", bd_method_name(k));
    }
    return bd_fail(err, BD_ERR_OPTION, "method", "method must be one of %s, got \"%s\"", names,
                   options->method);
  }
  if (!(options->rtol > 0.0 && options->rtol <= 1.0)) {
    return bd_fail(err, BD_ERR_OPTION, "rtol", "rtol must be > 0 and <= 1, got %g", options->rtol);
  }
  if (!(options->torque_interval > 0.0) || !isfinite(options->torque_interval)) {
    return bd_fail(err, BD_ERR_OPTION, "torque_interval",
                   "torque_interval must be finite and > 0 s, got %g", options->torque_interval);
  }
  const char *names[] = {"step", "max_step"};
  double values[] = {options->step, options->max_step};
  for (int k = 0; k < 2; ++k) {
    if (!(values[k] >= 0.0) || !isfinite(values[k])) {
      return bd_fail(err, BD_ERR_OPTION, names[k], "%s must be finite and >= 0 (0: chosen), got %g",
                     names[k], values[k]);
    }
  }
  if (options->max_steps < 0) {
    return bd_fail(err, BD_ERR_OPTION, "max_steps", "max_steps must be >= 0 (0: none), got %ld",
                   options->max_steps);
  }
  return BD_OK;
}

int bd_sim_check_time(const bd_model *model, const char *name, double t, bd_error *err) {
  double wave =
      model->info.link_length * sqrt(model->belt.linear_density / model->belt.axial_stiffness);
  double most = 1e-3 * wave / DBL_EPSILON;
  if (fabs(t) <= most) {
    return BD_OK;
  }
  return bd_fail(
      err, BD_ERR_OPTION, name,
      "%s must be within +-%.3g s, beyond which double precision cannot tell times apart "
      "in which a wave runs along a link, at sqrt(EA/rho) = %.3g m/s, got %g s",
      name, most, model->info.link_length / wave, t);
}

static int check_times(const bd_model *model, double t, double t_end, const bd_options *options,
                       bd_error *err) {
  const double largest = fmax(fabs(t_end), fabs(t));
  if (!(t_end - t > 1e3 * DBL_EPSILON * largest) || !isfinite(t_end)) {
    return bd_fail(err, BD_ERR_OPTION, "t_end",
                   "t_end must be finite and later than the start t = %.17g s by more than "
                   "rounding, got %.17g",
                   t, t_end);
  }
  BD_TRY(bd_sim_check_time(model, "t_end", t_end, err));
  BD_TRY(bd_sim_check_time(model, "initial.t", t, err));
  const double finest = fmin(1e-7, 1e-4 * bd_round_time(model));
  if (options->torque_interval < finest) {
    return bd_fail(err, BD_ERR_OPTION, "torque_interval",
                   "torque_interval must be at least %.3g s, or each step would call the torque "
                   "function too often, "
                   "got %g s",
                   finest, options->torque_interval);
  }
  const bd_method *method = automatic(options) ? NULL : bd_method_find(options->method);
  const double step = method && method->may_be_fixed ? options->step : 0.0;
  const double least = 16.0 * DBL_EPSILON * largest;
  if ((step > 0.0 && step < least) || (options->max_step > 0.0 && options->max_step < least)) {
    const char *name = step > 0.0 && step < least ? "step" : "max_step";
    return bd_fail(err, BD_ERR_OPTION, name,
                   "%s must be at least %.3g s, below which a step does not move the time from "
                   "t = %g s to %g s, got %g s",
                   name, least, t, t_end, step > 0.0 && step < least ? step : options->max_step);
  }
  return BD_OK;
}

int bd_sim_create(bd_sim **out, const bd_model *model, const bd_state *initial,
                  const bd_torque *torque, double t_end, const bd_options *options, bd_error *err) {
  int code = bd_sim_create_unchecked(out, model, initial, torque, t_end, options, err);
  if (code == BD_OK) {
    code = bd_guard_initial(&(*out)->stepper.plan, (*out)->stepper.y, err, initial->t);
  }
  if (code == BD_OK) {
    code = bd_sim_begin_motion(*out, err);
  }
  if (code == BD_OK) {
    code = bd_mounts_begin(&(*out)->stepper.plan, initial->t, (*out)->stepper.y, err);
  }
  if (code != BD_OK) {
    bd_sim_free(*out);
    *out = NULL;
  }
  return code;
}

int bd_sim_create_unchecked(bd_sim **out, const bd_model *model, const bd_state *initial,
                            const bd_torque *torque, double t_end, const bd_options *options,
                            bd_error *err) {
  *out = NULL;
  bd_options defaults;
  bd_options_default(&defaults);
  options = options ? options : &defaults;
  BD_TRY(check_options(options, err));
  BD_TRY(check_times(model, initial->t, t_end, options, err));
  bd_auto pair = {0};
  if (automatic(options)) {
    bd_auto_pair(model, options->rtol, &pair);
  }
  const bd_method *method = pair.method[0] ? pair.method[0] : bd_method_find(options->method);
  bd_sim *sim = bd_sim_new(model, method, pair.method[1], torque);
  if (!sim) {
    return bd_fail(err, BD_ERR_MEMORY, "simulation", "out of memory for a simulation");
  }
  int code = bd_torque_set_fill(&sim->stepper.plan.torques, torque, err);
  if (code == BD_OK) {
    code = bd_state_import(model, initial, sim->stepper.y, &sim->stepper.turns, err);
  }
  if (code != BD_OK) {
    bd_sim_free(sim);
    return code;
  }
  sim->options = *options;
  sim->stepper.rtol = options->rtol;
  sim->stepper.max_step = options->max_step;
  sim->stepper.functions.interval = options->torque_interval;
  sim->stepper.functions.rough_until = -INFINITY;
  sim->stepper.fixed =
      !sim->stepper.method->adaptive || (sim->stepper.method->may_be_fixed && options->step > 0.0);
  sim->options.method = NULL; /* the caller's string need not live on */
  sim->choice = pair;
  sim->stepper.t = sim->t0 = initial->t;
  sim->t_end = t_end;
  bd_plan_make(&sim->stepper.plan, model,
               &(bd_plan_options){.ledger = options->ledger,
                                  .friction = 1,
                                  .motion = sim->stepper.plan.torques.motion.n > 0});
  const int implicit = method->implicit || (pair.method[1] && pair.method[1]->implicit);
  if (implicit &&
      bd_newton_check(&sim->stepper.plan, pair.method[0] ? "auto" : method->name, err) != BD_OK) {
    bd_sim_free(sim);
    return BD_ERR_OPTION;
  }
  bd_stepper_weigh(&sim->stepper);
  if (options->guards && bd_twin_create(sim, torque) != BD_OK) {
    bd_sim_free(sim);
    return bd_fail(err, BD_ERR_MEMORY, "simulation", "out of memory for a simulation");
  }
  if (pair.method[0]) {
    bd_auto_begin(sim);
  }
  *out = sim;
  return BD_OK;
}

int bd_sim_set_output(bd_sim *sim, size_t n, const double *t, const bd_output *output,
                      bd_error *err) {
  if (sim->settling) {
    return bd_fail(err, BD_ERR_BUSY, "t_eval", "settling has no samples: only its end counts");
  }
  if (sim->started || sim->t_sample) {
    return bd_fail(err, BD_ERR_BUSY, "t_eval",
                   "the sample times must be set once, before the run starts");
  }
  for (size_t k = 0; k < n; ++k) {
    if (!(t[k] >= sim->t0 && t[k] <= sim->t_end) || (k > 0 && t[k] < t[k - 1])) {
      return bd_fail(err, BD_ERR_OPTION, "t_eval",
                     "t_eval must be non-decreasing and within [%g, %g] s, t_eval[%zu] is %g",
                     sim->t0, sim->t_end, k, t[k]);
    }
  }
  sim->t_sample = bd_block_new((n + 1) * sizeof *t);
  if (!sim->t_sample) {
    return bd_fail(err, BD_ERR_MEMORY, "t_eval", "out of memory for %zu sample times", n);
  }
  if (n > 0) {
    memcpy(sim->t_sample, t, n * sizeof *t);
  }
  sim->n_samples = n;
  sim->output = *output;
  return BD_OK;
}
