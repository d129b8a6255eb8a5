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
#include <stdio.h>
#include <string.h>

#include "internal.h"

void bd_options_default(bd_options *options) {
  *options = (bd_options){.method = "auto", .rtol = 1e-4, .ledger = 1};
}

/* --- making it ------------------------------------------------------------------------------- */

static void carve(bd_carver *carver, bd_sim *sim, const bd_model *model, const bd_torque *torque,
                  int settling) {
  const bd_layout *lay = &model->lay;
  BD_CARVE(carver, sim->y, lay->size);
  BD_CARVE(carver, sim->y_new, lay->size);
  BD_CARVE(carver, sim->y_mid, lay->size);
  BD_CARVE(carver, sim->weights, lay->size);
  for (int k = 0; k < BD_MAX_STAGES; ++k) {
    BD_CARVE(carver, sim->stage[k], lay->size);
  }
  if (settling) {
    BD_CARVE(carver, sim->settle_start, lay->size);
    BD_CARVE(carver, sim->settle_offset, 2 * lay->np);
    BD_CARVE(carver, sim->settle_centers, 2 * lay->np);
    BD_CARVE(carver, sim->settle_wraps, lay->np);
  }
  bd_plan_carve(carver, &sim->plan, lay);
  bd_load_carve(carver, &sim->plan.load, lay->np, torque);
}

bd_sim *bd_sim_new(const bd_model *model, const bd_torque *torque, int settling) {
  bd_carver carver = {0};
  bd_sim sizes, *sim;
  bd_carve(&carver, 1, sizeof *sim);
  carve(&carver, &sizes, model, torque, settling);
  char *block = bd_block_new(carver.used);
  if (!block) {
    return NULL;
  }
  carver = (bd_carver){.base = block};
  sim = bd_carve(&carver, 1, sizeof *sim);
  carve(&carver, sim, model, torque, settling);
  sim->model = model;
  sim->stats.spectral_bound = model->info.spectral_bound;
  atomic_flag_clear(&sim->running);
  return sim;
}

/* The sample times are the one thing of unknown number, in a block of their own. */
void bd_sim_free(bd_sim *sim) {
  if (sim) {
    bd_block_free(sim->t_sample);
    bd_block_free(sim);
  }
}

/* 1 / scale for every unknown. Stretch for positions; over half a link or a radius for angles; and
 * for velocities what a joint's stretch is worth over the time a wave needs round a belt of 60
 * links, which measured runs found as strict as the stretch itself. */
void bd_sim_weights(bd_sim *sim) {
  const bd_model *model = sim->model;
  const bd_layout *lay = &model->lay;
  const bd_info *info = &model->info;
  double strain = model->geometry.code == BD_OK ? info->strain : 0.01;
  double stretch = strain * info->link_length;
  double speed = strain * sqrt(model->belt.axial_stiffness / model->belt.linear_density) / 60.0;
  double half = 0.5 * info->link_length;
  double scale[] = {stretch, stretch, stretch / half, speed, speed, speed / half};
  memset(sim->weights, 0, lay->size * sizeof *sim->weights);
  for (int f = F_X; f < F_MU + lay->slots; ++f) {
    double *w = bd_field(lay, sim->weights, f);
    for (int i = 0; i < lay->n; ++i) {
      w[i] = f < F_MU ? 1.0 / scale[f] : 1.0;
    }
  }
  for (int j = 0; j < lay->np; ++j) {
    sim->weights[lay->theta + j] = model->radius[j] / stretch;
    sim->weights[lay->omega + j] = model->radius[j] / speed;
  }
}

static int check_options(const bd_options *options, bd_error *err) {
  if (!bd_tableau_find(options->method)) {
    return bd_fail(err, BD_ERR_OPTION, "method",
                   "method must be \"auto\", \"tsit5\" or \"rk4\", got \"%s\"", options->method);
  }
  if (!(options->rtol > 0.0 && options->rtol <= 1.0)) {
    return bd_fail(err, BD_ERR_OPTION, "rtol", "rtol must be > 0 and <= 1, got %g", options->rtol);
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

int bd_sim_create(bd_sim **out, const bd_model *model, const bd_state *initial,
                  const bd_torque *torque, double t_end, const bd_options *options, bd_error *err) {
  *out = NULL;
  bd_options defaults;
  bd_options_default(&defaults);
  options = options ? options : &defaults;
  if (check_options(options, err) != BD_OK) {
    return BD_ERR_OPTION;
  }
  if (!(t_end - initial->t > 1e3 * DBL_EPSILON * fmax(fabs(t_end), fabs(initial->t))) ||
      !isfinite(t_end)) {
    return bd_fail(err, BD_ERR_OPTION, "t_end",
                   "t_end must be finite and later than the start t = %.17g s by more than "
                   "rounding, got %.17g",
                   initial->t, t_end);
  }
  bd_sim *sim = bd_sim_new(model, torque, 0);
  if (!sim) {
    return bd_fail(err, BD_ERR_MEMORY, "simulation", "out of memory for a simulation");
  }
  int code = bd_load_fill(&sim->plan.load, torque, err);
  if (code == BD_OK) {
    code = bd_state_import(model, initial, sim->y, &sim->turns, err);
  }
  if (code != BD_OK) {
    bd_sim_free(sim);
    return code;
  }
  sim->options = *options;
  sim->method = bd_tableau_find(options->method);
  sim->options.method = sim->method->name;
  sim->t = sim->t0 = initial->t;
  sim->t_end = t_end;
  bd_plan_make(&sim->plan, model, &(bd_plan_options){.ledger = options->ledger, .friction = 1});
  bd_sim_weights(sim);
  *out = sim;
  return BD_OK;
}

int bd_sim_set_output(bd_sim *sim, size_t n, const double *t, const bd_output *output,
                      bd_error *err) {
  if (sim->watch) {
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

/* --- one step -------------------------------------------------------------------------------- */

static int rate(bd_sim *sim, double t, double *y, double *dy) {
  ++sim->stats.nfev;
  return bd_plan_rate(&sim->plan, t, y, dy, &sim->failure);
}

/* Stages of a step of length h into y_new and stage[]; the last stage is the rate at y_new. */
static int try_step(bd_sim *sim, double h) {
  const bd_tableau *m = sim->method;
  const size_t size = sim->model->lay.size;
  const double *row = m->a;
  for (int s = 1; s < m->stages; ++s) {
    double *y = s == m->stages - 1 ? sim->y_new : sim->y_mid;
    sim->plan.kernels->combine(size, y, sim->y, h, s, row, sim->stage);
    int code = rate(sim, sim->t + m->c[s] * h, y, sim->stage[s]);
    if (code != BD_OK) {
      return code;
    }
    row += s;
  }
  return BD_OK;
}

static int sample(bd_sim *sim, double t, double *y) {
  const bd_layout *lay = &sim->model->lay;
  int code = bd_load_eval(&sim->plan.load, t, sim->plan.t_piece, y + lay->theta, y + lay->omega,
                          sim->plan.torque, &sim->failure);
  if (code == BD_OK) {
    bd_observe(&sim->plan, y, sim->turns, sim->plan.torque, sim->e0, &sim->output,
               sim->next_sample++);
  }
  return code;
}

/* Samples up to the end of the step just made, t + h. */
static int sample_step(bd_sim *sim, double h, double t_new) {
  double b[BD_MAX_STAGES];
  while (sim->next_sample < sim->n_samples && sim->t_sample[sim->next_sample] <= t_new) {
    double t = sim->t_sample[sim->next_sample], *y = sim->y_new;
    if (t < t_new) {
      sim->method->dense((t - sim->t) / h, b);
      y = sim->y_mid;
      sim->plan.kernels->combine(sim->model->lay.size, y, sim->y, h, sim->method->stages, b,
                                 sim->stage);
    }
    int code = sample(sim, t, y);
    if (code != BD_OK) {
      return code;
    }
  }
  return BD_OK;
}

/* A fixed step beyond the stability limit shows as links thrown about or as numbers gone. */
static int fail_unstable(bd_sim *sim, int code, double h) {
  const bd_tableau *m = sim->method;
  int body = sim->failure.body, pulley = sim->failure.pulley;
  const char *name = "contact";
  if (code == BD_ERR_NOT_FINITE) {
    name = bd_state_bad(&sim->model->lay, sim->y_new, &body, &pulley);
    name = name ? name : "rate";
  }
  char where[32] = "";
  if (body >= 0 || pulley >= 0) {
    snprintf(where, sizeof where, " of %s %d", body >= 0 ? "link" : "pulley",
             body >= 0 ? body : pulley);
  }
  if (m->error) {
    return bd_fail_at(&sim->failure, code, name, sim->t, body, pulley, h,
                      "no step after t = %.9g s gives finite numbers, first in %s%s: look for "
                      "parameters far out of scale",
                      sim->t, name, where);
  }
  return bd_fail_at(&sim->failure, code, name, sim->t, body, pulley, h,
                    "the step after t = %.9g s blew up, first in %s%s (method %s, step %.3g s): "
                    "take a shorter step than %.3g s or an adaptive method",
                    sim->t, name, where, m->name, h,
                    m->stability / sim->model->info.spectral_bound);
}

static int fail_step_floor(bd_sim *sim, double h, double floor) {
  const bd_layout *lay = &sim->model->lay;
  static const char *const names[] = {"x", "y", "phi", "vx", "vy", "vphi"};
  int worst_link = -1, worst_pulley = -1;
  const char *name = "the state";
  double worst = 0.0;
  for (size_t k = 0; k < lay->size; ++k) {
    double e = 0.0;
    for (int s = 0; s < sim->method->stages; ++s) {
      e += h * sim->method->error[s] * sim->stage[s][k];
    }
    e = sim->weights[k] * fabs(e);
    if (!(e <= worst) && sim->weights[k] > 0.0) {
      int f = (int)k / lay->stride;
      worst = e;
      worst_link = (int)k < lay->theta ? (int)k % lay->stride - BD_HALO : -1;
      worst_pulley = worst_link < 0 ? ((int)k - lay->theta) % lay->np : -1;
      name = worst_link < 0 ? ((int)k < lay->omega ? "theta" : "omega")
             : f < F_MU     ? names[f]
                            : "mu";
    }
  }
  return bd_fail_at(&sim->failure, BD_ERR_STEP_FLOOR, name, sim->t, worst_link, worst_pulley, h,
                    "the step fell to its floor of %.3g s at t = %.9g s without meeting rtol = %g; "
                    "the largest error is in %s of %s %d: loosen rtol, or look for a jump in the "
                    "torque and name its time in breakpoints",
                    floor, sim->t, sim->options.rtol, name, worst_pulley >= 0 ? "pulley" : "link",
                    worst_pulley >= 0 ? worst_pulley : worst_link);
}

/* Adopts y_new at t_new. */
static int accept(bd_sim *sim, double h, double t_new) {
  int changed = 0;
  int code = bd_plan_after_step(&sim->plan, t_new, sim->y_new, 1e-3 * sim->options.rtol, &changed,
                                &sim->failure);
  if (code == BD_OK) {
    code = sample_step(sim, h, t_new);
  }
  if (code != BD_OK) {
    return code;
  }
  double *y = sim->y, *first = sim->stage[0];
  int last = sim->method->stages - 1;
  sim->y = sim->y_new;
  sim->y_new = y;
  sim->stage[0] = sim->stage[last];
  sim->stage[last] = first;
  sim->t = t_new;
  sim->rate_known = !changed;
  bd_state_wind(&sim->model->lay, sim->y, &sim->turns);
  ++sim->stats.steps;
  sim->stats.largest_step = fmax(sim->stats.largest_step, h);
  sim->stats.smallest_step = sim->stats.steps == 1 ? h : fmin(sim->stats.smallest_step, h);
  return BD_OK;
}

/* --- running --------------------------------------------------------------------------------- */

static double next_stop(bd_sim *sim) {
  bd_load *load = &sim->plan.load;
  while (sim->next_break < load->n_breaks && load->breaks[sim->next_break] <= sim->t) {
    ++sim->next_break;
  }
  if (sim->next_break > 0) {
    load->after = load->breaks[sim->next_break - 1];
  }
  load->before =
      sim->next_break < load->n_breaks ? load->breaks[sim->next_break] : (double)INFINITY;
  return fmin(load->before, sim->t_end);
}

/* Steps come from a geometric ladder, 2^(1/32) apart: rounding in the error estimate then does not
 * reach the step, so scenes that differ by rounding alone (turned, shifted) take the same steps. */
static double rung(double h) {
  return exp2(floor(32.0 * log2(h)) / 32.0);
}

/* An adaptive explicit step never nears the stability limit of the joints, which is known: there
 * the stiffest mode would live on rounding and rejected steps. */
static double longest(const bd_sim *sim, double h) {
  double most =
      sim->method->error ? 0.93 * sim->method->stability / sim->model->info.spectral_bound : h;
  h = fmin(h, most);
  return sim->options.max_step > 0.0 ? fmin(h, sim->options.max_step) : h;
}

static int start(bd_sim *sim) {
  double bound = sim->model->info.spectral_bound;
  double h = sim->options.step > 0.0 ? sim->options.step
             : sim->method->error    ? 0.1 / bound
                                     : 0.75 * sim->method->stability / bound;
  sim->h = longest(sim, h);
  sim->error_before = 1.0;
  sim->started = 1;
  bd_plan_place(&sim->plan, sim->t);
  bd_plan_own(&sim->plan, sim->y);
  sim->plan.search.margin = 0.0;
  sim->plan.search.travelled = INFINITY;
  bd_search_ready(&sim->plan, sim->y, sim->h);
  sim->plan.t_piece = 0.5 * (sim->t + next_stop(sim));
  double terms[BD_N_ENERGY];
  sim->e0 = bd_energy(&sim->plan, sim->y, terms);
  while (sim->next_sample < sim->n_samples && sim->t_sample[sim->next_sample] <= sim->t) {
    int code = sample(sim, sim->t, sim->y);
    if (code != BD_OK) {
      return code;
    }
  }
  return BD_OK;
}

/* One accepted step, or an error. */
static int step(bd_sim *sim) {
  const bd_tableau *m = sim->method;
  const double step_floor = 16.0 * DBL_EPSILON * fmax(fabs(sim->t), fabs(sim->t_end));
  for (;;) {
    double stop = next_stop(sim), left = stop - sim->t;
    double h = longest(sim, sim->h);
    /* equal parts rather than a sliver before the stop */
    double parts = ceil(left / h * (1.0 - 1e-12));
    int hit = parts <= 1.0;
    h = hit ? left : m->error && parts > 2.0 ? h : left / parts;
    double t_new = hit ? stop : sim->t + h;
    sim->plan.t_piece = sim->t + 0.5 * h;
    bd_search_ready(&sim->plan, sim->y, h);
    int code = BD_OK;
    if (!sim->rate_known) {
      code = rate(sim, sim->t, sim->y, sim->stage[0]);
      sim->rate_known = code == BD_OK;
    }
    if (code == BD_OK) {
      code = try_step(sim, h);
    }
    if (code != BD_OK) {
      return code;
    }
    double error = sim->plan.kernels->error_norm(
        &sim->model->lay, h, m->stages, m->error ? m->error : m->c, sim->stage, sim->weights);
    if (!m->error) {
      if (!isfinite(error) || bd_state_bad(&sim->model->lay, sim->y_new, &(int){0}, &(int){0})) {
        return fail_unstable(sim, BD_ERR_NOT_FINITE, h);
      }
      code = accept(sim, h, t_new);
      if (code == BD_ERR_PASSED_THROUGH && h * sim->model->info.spectral_bound > m->stability) {
        code = fail_unstable(sim, code, h);
      }
    } else {
      error /= sim->options.rtol;
      if (!(error <= 1.0)) {
        ++sim->stats.rejected;
        if (h <= step_floor) {
          return isfinite(error) ? fail_step_floor(sim, h, step_floor)
                                 : fail_unstable(sim, BD_ERR_NOT_FINITE, h);
        }
        double shrink = isfinite(error) ? 0.9 * pow(error, -1.0 / m->order) : 0.1;
        sim->h = fmax(step_floor, rung(h * fmin(0.9, fmax(0.1, shrink))));
        continue;
      }
      /* PI control (Gustafsson), errors that are mostly rounding set aside; a step cut short by a
       * stop must not shorten the next ones */
      error = fmax(error, 1e-3);
      double grow = 0.9 * pow(error, -0.7 / m->order) * pow(sim->error_before, 0.4 / m->order);
      double next = rung(h * fmin(5.0, fmax(0.2, grow)));
      sim->h = h < 0.9 * longest(sim, sim->h) && next < sim->h ? sim->h : next;
      sim->error_before = error;
      code = accept(sim, h, t_new);
    }
    if (code == BD_OK && hit) {
      sim->rate_known = 0; /* the torque may jump here */
    }
    return code;
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
                        "max_steps or loosen rtol",
                        sim->options.max_steps, sim->t, sim->t_end);
    }
    code = sim->started ? BD_OK : start(sim);
    if (code == BD_OK) {
      code = step(sim);
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
void bd_sim_stats(const bd_sim *sim, bd_stats *out) {
  *out = sim->stats;
}
const char *bd_sim_method(const bd_sim *sim) {
  return sim->method->name;
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

int bd_model_rate(const bd_model *model, const bd_state *state, const double *torque, bd_state *out,
                  bd_error *err) {
  double moment = 0.0;
  const bd_torque given = {
      .n_terms = 1,
      .terms =
          &(bd_torque_term){.kind = BD_TORQUE_PIECEWISE, .n_t = 1, .t = &moment, .values = torque}};
  bd_sim *sim = NULL;
  int code =
      bd_sim_create(&sim, model, state, &given, state->t + fmax(1.0, fabs(state->t)), NULL, err);
  if (code != BD_OK) {
    return code;
  }
  bd_plan_place(&sim->plan, sim->t);
  sim->plan.search.travelled = INFINITY;
  bd_search_ready(&sim->plan, sim->y, 0.0);
  code = bd_plan_rate(&sim->plan, sim->t, sim->y, sim->stage[0], err);
  if (code == BD_OK) {
    bd_model moved = *model; /* rates know neither origin nor turns */
    moved.origin[0] = moved.origin[1] = 0.0;
    out->t = 1.0;
    bd_state_export(&moved, sim->stage[0], 0.0, out);
  }
  bd_sim_free(sim);
  return code;
}
