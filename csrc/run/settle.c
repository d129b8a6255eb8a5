/* SPDX-License-Identifier: MIT
 *
 * The belt at rest under preload: what the paper calls stabilisation.
 *
 * The model itself, with damping proportional to every mass (dynamic relaxation), is integrated
 * until the unbalanced force is gone. That damping is critical for the lowest transverse mode of
 * the longest span. Coarse belts take the classical Runge-Kutta method; their joints' damping,
 * which has no say in an equilibrium, is set to what lets the explicit step be longest. Fine belts,
 * whose explicit steps would be too many, take the linearly implicit Euler method, with steps that
 * this damping sets. Centres may move in from a slack position meanwhile, as a belt is really
 * tensioned, with friction acting: the tension then depends on the way, which is why it can be
 * chosen.
 */
#include <math.h>
#include <string.h>

#include "run/run.h"

void bd_settle_options_default(bd_settle_options *options) {
  *options = (bd_settle_options){.tolerance = 1e-9};
}

/* Critical for the lowest transverse mode of the longest span [1/s]; and that mode's frequency. */
static double critical_mass_damping(const bd_model *model, double *lowest) {
  double span = fmax(model->longest_span, 0.25 * model->belt.length);
  *lowest = BD_PI * sqrt(model->info.mean_tension / model->belt.linear_density) / span;
  return 2.0 * *lowest;
}

/* What makes explicit steps longest. */
static double easiest_damping(const bd_model *model) {
  return 0.5 * sqrt(model->info.joint_stiffness * model->info.link_mass / 3.0);
}

/* Largest |lambda| of a link on its joints and a pulley, for a fixed explicit step. The contact
 * stiffens with penetration: take that of four times the belt line's normal force. */
static double fastest_mode(const bd_model *model, int friction) {
  const bd_info *info = &model->info;
  double tightest = model->radius[0], lowest;
  for (int j = 1; j < model->lay.np; ++j) {
    tightest = fmin(tightest, model->radius[j]);
  }
  double tension = model->belt.axial_stiffness * (info->strain + info->mesh_strain);
  double normal = 4.0 * tension * info->link_length / tightest;
  double c1 = info->contact_quadratic, c2 = info->contact_linear;
  double contact = sqrt(c2 * c2 + 4.0 * c1 * normal);
  double grip = friction && model->has_friction ? model->dahl.sigma * normal : 0.0;
  double m = info->link_mass;
  double k = 12.0 * info->joint_stiffness / m + 4.0 * info->bending_stiffness / info->link_inertia +
             (contact + grip) / m;
  double d = info->contact_damping / m + critical_mass_damping(model, &lowest) +
             12.0 * easiest_damping(model) / m + 4.0 * info->bending_damping / info->link_inertia;
  return d * d > 4.0 * k ? 0.5 * (d + sqrt(d * d - 4.0 * k)) : sqrt(k);
}

/* An implicit step takes as long as three explicit ones; the margin keeps what coarse belts gave.
 */
static const double IMPLICIT_STEP = 0.25, WORTH = 15.0;

static const bd_method *method_for(const bd_model *model, int friction, double *step) {
  const bd_method *explicit = bd_method_find("rk4");
  double lowest, most = IMPLICIT_STEP / critical_mass_damping(model, &lowest);
  *step = 0.8 * explicit->stability / fastest_mode(model, friction);
  if (WORTH * *step >= most) {
    return explicit;
  }
  *step = most;
  return bd_method_find("lie");
}

/* A hair inside the rims: exactly on them, rounding would decide which links touch at first, and
 * friction would keep a trace of it. */
static void place_on_line(bd_sim *sim, const double *cx, const double *cy, const bd_wrap *wraps,
                          int direction, double length, bd_state *state) {
  const bd_model *model = sim->model;
  int n = model->lay.n;
  double inward = 1e-3 * model->info.strain * model->info.link_length * direction;
  for (int i = 0; i < n; ++i) {
    double s = length * (i + 0.5) / n + sim->settle.shift, round = floor(s / length);
    bd_belt_line_point(model->lay.np, cx, cy, model->radius, wraps, direction, s - round * length,
                       &state->x[i], &state->y[i], &state->phi[i]);
    state->phi[i] += round * direction * 2.0 * BD_PI;
    state->x[i] += model->origin[0] - inward * sin(state->phi[i]);
    state->y[i] += model->origin[1] + inward * cos(state->phi[i]);
  }
}

/* Lays the belt along the line round the centres where they start. A vector of the simulation lends
 * the room for it, before it is needed. */
static int lay_belt(bd_sim *sim, bd_error *err) {
  const bd_model *model = sim->model;
  int n = model->lay.n, np = model->lay.np, direction;
  double length, *room = sim->y_new;
  double *cx = sim->settle_centers, *cy = cx + np;
  bd_wrap *wraps = sim->settle_wraps;
  for (int j = 0; j < np; ++j) {
    cx[j] = model->cx[j] + (sim->plan.offset ? sim->plan.offset[2 * j] : 0.0);
    cy[j] = model->cy[j] + (sim->plan.offset ? sim->plan.offset[2 * j + 1] : 0.0);
  }
  int code = bd_belt_line_lay(np, cx, cy, model->radius, wraps, &direction, &length, err);
  if (code != BD_OK) {
    if (err && sim->plan.offset) {
      memmove(err->field, "offset", sizeof "offset");
    }
    return code;
  }
  double *zero = sim->weights; /* still all zero */
  bd_state state = {.x = room,
                    .y = room + n,
                    .phi = room + 2 * n,
                    .vx = zero,
                    .vy = zero,
                    .vphi = zero,
                    .mu = zero,
                    .slip = zero,
                    .theta = zero,
                    .omega = zero};
  place_on_line(sim, cx, cy, wraps, direction, length, &state);
  return bd_state_import(model, &state, sim->y, &sim->turns, err);
}

static int check_options(const bd_model *model, const bd_settle_options *options, bd_error *err) {
  if (!(options->tolerance > 0.0 && options->tolerance < 1.0)) {
    return bd_fail(err, BD_ERR_OPTION, "tolerance", "tolerance must be > 0 and < 1, got %g",
                   options->tolerance);
  }
  if (!(options->move_time >= 0.0) || !isfinite(options->move_time) ||
      !(options->max_time >= 0.0) || !isfinite(options->max_time)) {
    return bd_fail(err, BD_ERR_OPTION, "move_time",
                   "move_time and max_time must be finite and >= 0 (0: chosen), got %g and %g",
                   options->move_time, options->max_time);
  }
  if (bd_sim_check_time(model, "move_time", options->move_time, err) != BD_OK ||
      bd_sim_check_time(model, "max_time", options->max_time, err) != BD_OK) {
    return BD_ERR_OPTION;
  }
  if (!(fabs(options->shift) <= model->belt.length)) {
    return bd_fail(err, BD_ERR_OPTION, "shift",
                   "shift must be at most the belt's length, %g m, got %g", model->belt.length,
                   options->shift);
  }
  for (int k = 0; options->offset && k < 2 * model->lay.np; ++k) {
    if (!isfinite(options->offset[k])) {
      return bd_fail(err, BD_ERR_OPTION, "offset", "offset[%d, %d] must be finite, got %g", k / 2,
                     k % 2, options->offset[k]);
    }
  }
  return BD_OK;
}

static void set_up(bd_sim *sim, double step) {
  const bd_model *model = sim->model;
  const bd_settle_options *given = &sim->settle;
  double lowest, mass_damping = critical_mass_damping(model, &lowest);
  double move_time = !given->offset           ? 0.0
                     : given->move_time > 0.0 ? given->move_time
                                              : 100.0 / lowest;
  sim->t = sim->t0 = 0.0;
  /* a fine belt's polygon holds it less, and waiting costs less with implicit steps */
  sim->settle_patience = (sim->method->implicit ? 5000.0 : 1000.0) / lowest;
  sim->t_end = move_time + (given->max_time > 0.0 ? given->max_time : sim->settle_patience);
  bd_plan_make(&sim->plan, model,
               &(bd_plan_options){.friction = given->friction,
                                  .hold_pulleys = !given->free_pulleys,
                                  .skip_power = 1,
                                  .mass_damping = mass_damping,
                                  .offset = given->offset,
                                  .move_time = move_time});
  if (!sim->method->implicit) {
    sim->plan.links.damping = easiest_damping(model);
  }
  bd_options_default(&sim->options);
  sim->options.method = sim->method->name;
  sim->options.step = step;
  sim->options.ledger = 0;
  sim->fixed = 1;
}

/* Without friction the belt slides round its pulleys almost freely, and with friction a drive whose
 * pulleys are free circulates so, against a stiffness that comes from the polygon of links alone
 * and is thousands of times below all others. It is measured, from how the force along the belt
 * changes with the distance travelled since the last check, and circulation is given the inertia
 * and damping that bring it to rest as fast as the slowest of the other motions allows. */
static void tune_circulation(bd_sim *sim, const double *dy) {
  bd_plan *plan = &sim->plan;
  double force = bd_plan_circulation(plan, dy), speed = bd_plan_circulation(plan, sim->y);
  double travel = 0.5 * (speed + sim->settle_speed) * (sim->t - sim->settle_time);
  /* not before the rest of the motion has died down, or its noise would pass for a stiffness */
  if (sim->t > plan->move_time + 30.0 / plan->mass_damping &&
      fabs(travel) > 1e-9 * sim->model->info.link_length) {
    /* a stiffness once seen is let go slowly: a gain that followed it round the path would pump */
    double seen = fabs(force - sim->settle_push) / fabs(travel), pace = plan->mass_damping / 16.0;
    sim->settle_stiffness = fmax(seen, 0.9 * sim->settle_stiffness);
    plan->circulation_inertia_scale = fmin(1e4, fmax(1.0, pace * pace / sim->settle_stiffness));
    plan->circulation_damping =
        fmin(plan->mass_damping, 2.0 * fmax(pace, sqrt(sim->settle_stiffness)));
  }
  sim->settle_push = force;
  sim->settle_speed = speed;
  sim->settle_time = sim->t;
}

/* Takes all velocities out of y; returns the largest, of link ends and rims [m/s]. */
static double stop(const bd_sim *sim, double *y) {
  const bd_layout *lay = &sim->model->lay;
  double fastest = 0.0;
  for (int f = F_VX; f <= F_VPHI; ++f) {
    double *v = bd_field(lay, y, f), arm = f == F_VPHI ? sim->plan.links.half : 1.0;
    for (int i = 0; i < lay->n; ++i) {
      fastest = fmax(fastest, arm * fabs(v[i]));
      v[i] = 0.0;
    }
  }
  for (int j = 0; j < lay->np; ++j) {
    fastest = fmax(fastest, sim->model->radius[j] * fabs(y[lay->omega + j]));
    y[lay->omega + j] = 0.0;
  }
  return fastest;
}

/* A belt at rest that misses a pulley is at rest somewhere else. */
static int check_laid(bd_sim *sim, bd_error *err) {
  const bd_model *model = sim->model;
  const bd_layout *lay = &model->lay;
  const double *x = bd_cfield(lay, sim->y, F_X), *y = bd_cfield(lay, sim->y, F_Y);
  int code = bd_guard_winding(&sim->plan, sim->y, err, sim->t);
  for (int j = 0; code == BD_OK && j < lay->np; ++j) {
    const bd_contact_pulley *d = &sim->plan.contact_pulleys[j];
    int touches = 0;
    for (int i = 0; i < lay->n; ++i) {
      touches |= hypot(x[i] - d->x, y[i] - d->y) < d->radius;
    }
    if (!touches) {
      return bd_fail_at(err, BD_ERR_OFF_PULLEY, "settle", sim->t, -1, j, model->info.link_length,
                        "no link touches pulley %d: the belt bends round it between two links of "
                        "%.3g m; belt.n_bodies >= %.0f makes sure that one does",
                        j, model->info.link_length,
                        ceil(model->belt.length / (model->wraps[j].wrap * d->radius)));
    }
  }
  return code;
}

/* The largest unbalanced force with everything stopped, over the mean tension, into
 * stats.residual; velocities must be gone to the same degree. At rest: stops the belt. */
static int check_rest(bd_sim *sim, int *at_rest, bd_error *err) {
  const bd_model *model = sim->model;
  const bd_layout *lay = &model->lay;
  const bd_info *info = &model->info;
  *at_rest = 0;
  double *y = sim->y_mid, *dy = sim->stage[sim->method->vectors - 1];
  double fastest, worst = 0.0;
  memcpy(y, sim->y, lay->size * sizeof *y);
  fastest = stop(sim, y);
  double wave = sqrt(model->belt.axial_stiffness / model->belt.linear_density);
  if (!(fastest < wave)) {
    return bd_fail_at(
        err, BD_ERR_NOT_FINITE, "settle", sim->t, -1, -1, fastest,
        "settling blew up: a link moves at %.3g m/s, faster than waves along the belt; "
        "the start is too far from rest or the contact too stiff for it",
        fastest);
  }
  double gain = sim->plan.circulation_inertia_scale;
  sim->plan.circulation_inertia_scale = 1.0; /* the true forces */
  int code = bd_plan_rate(&sim->plan, sim->t, y, dy, err);
  sim->plan.circulation_inertia_scale = gain;
  if (code != BD_OK) {
    return code;
  }
  ++sim->stats.nfev;
  tune_circulation(sim, dy);
  for (int i = 0; i < lay->n; ++i) {
    double fx = bd_field(lay, dy, F_VX)[i], fy = bd_field(lay, dy, F_VY)[i];
    double turning = bd_field(lay, dy, F_VPHI)[i];
    worst = fmax(worst, info->link_mass * hypot(fx, fy));
    worst = fmax(worst, info->link_inertia * fabs(turning) / (0.5 * info->link_length));
  }
  for (int j = 0; j < lay->np; ++j) {
    worst = fmax(worst, model->inertia[j] * fabs(dy[lay->omega + j]) / model->radius[j]);
  }
  sim->stats.residual = worst / info->mean_tension;
  if (!(sim->stats.residual > 0.9 * sim->settle_best)) {
    sim->settle_best = sim->stats.residual;
    sim->settle_best_time = sim->t;
  }
  int still = sim->stats.residual <= sim->settle.tolerance &&
              fastest <= sim->settle.tolerance * info->strain * wave &&
              sim->t >= sim->plan.move_time;
  if (still && !(bd_mean_force(&sim->plan, y) > 1e-6 * info->mean_tension)) {
    return bd_fail_at(err, BD_ERR_NOT_SETTLED, "settle", sim->t, -1, -1, sim->stats.residual,
                      "the belt came to rest without tension: it has slipped off its pulleys, or "
                      "the contact is too soft, or the links too long for the pulleys");
  }
  if (still) {
    code = check_laid(sim, err);
    if (code != BD_OK) {
      return code;
    }
    memcpy(sim->y, y, lay->size * sizeof *y);
    sim->t = sim->t0;
    *at_rest = 1;
    return BD_OK;
  }
  /* as long again as should be enough, and no nearer to rest: it will not come */
  int hopeless = sim->t > sim->settle_best_time + sim->settle_patience &&
                 sim->t > sim->plan.move_time + sim->settle_patience;
  if (sim->t >= sim->t_end || hopeless) {
    return bd_fail_at(
        err, BD_ERR_NOT_SETTLED, "settle", sim->t, -1, -1, sim->stats.residual,
        "the belt did not come to rest within %.3g s: unbalanced force %.3g of the "
        "mean tension, fastest motion %.3g m/s; allow %sa looser "
        "tolerance; or the contact is too soft, or the links too long for the pulleys",
        sim->t, sim->stats.residual, fastest, hopeless ? "" : "more max_time, ");
  }
  return BD_OK;
}

/* Starts over with half the step, a few times: the bound on the contact is an estimate. */
static int retry(bd_sim *sim) {
  if (sim->settle_tries >= 8 ||
      (sim->failure.code != BD_ERR_NOT_FINITE && sim->failure.code != BD_ERR_PASSED_THROUGH)) {
    return 0;
  }
  ++sim->settle_tries;
  memcpy(sim->y, sim->settle_start, sim->model->lay.size * sizeof *sim->y);
  sim->t = sim->t0;
  sim->turns = sim->settle_turns;
  sim->options.step *= 0.5;
  sim->started = sim->rate_known = sim->jacobian_known = 0;
  sim->settle_best = INFINITY;
  sim->settle_best_time = sim->t;
  sim->settle_push = sim->settle_speed = sim->settle_time = sim->settle_stiffness = 0.0;
  sim->plan.circulation_damping = 0.0;
  sim->plan.circulation_inertia_scale = 1.0;
  return 1;
}

/* Now and then, every millisecond or so, looks whether the belt has come to rest. */
static int watch(bd_sim *sim, int code, int *finished) {
  const int every = sim->method->implicit ? 8 : 64;
  if (code == BD_OK && (sim->stats.steps % every == 0 || sim->t >= sim->t_end)) {
    code = check_rest(sim, finished, &sim->failure);
    if (sim->method->implicit) {
      sim->rate_known = sim->jacobian_known = 0; /* the look has used the scratch of the rate */
    }
  }
  return code != BD_OK && retry(sim) ? BD_OK : code;
}

int bd_settle_create(bd_sim **out, const bd_model *model, const bd_state *initial,
                     const bd_settle_options *options, bd_error *err) {
  *out = NULL;
  bd_settle_options defaults;
  bd_settle_options_default(&defaults);
  options = options ? options : &defaults;
  if (bd_model_check_geometry(model, err) != BD_OK) {
    return BD_ERR_GEOMETRY;
  }
  if (check_options(model, options, err) != BD_OK) {
    return BD_ERR_OPTION;
  }
  double step;
  const bd_method *method = method_for(model, options->friction, &step);
  bd_sim *sim = bd_sim_new(model, method, NULL, NULL, 1);
  if (!sim) {
    return bd_fail(err, BD_ERR_MEMORY, "simulation", "out of memory for a simulation");
  }
  sim->settle = *options;
  sim->settle_best = INFINITY;
  sim->watch = watch;
  if (options->offset) {
    memcpy(sim->settle_offset, options->offset, 2 * (size_t)model->lay.np * sizeof(double));
    sim->settle.offset = sim->settle_offset;
  }
  set_up(sim, step);
  int code =
      initial ? bd_state_import(model, initial, sim->y, &sim->turns, err) : lay_belt(sim, err);
  if (code != BD_OK) {
    bd_sim_free(sim);
    return code;
  }
  stop(sim, sim->y);
  if (!sim->plan.friction_on) {
    for (int f = F_MU; f < F_MU + 2 * model->lay.slots; ++f) {
      memset(bd_field(&model->lay, sim->y, f), 0, (size_t)model->lay.n * sizeof *sim->y);
    }
  }
  sim->settle_turns = sim->turns;
  memcpy(sim->settle_start, sim->y, model->lay.size * sizeof *sim->y);
  bd_sim_weights(sim);
  *out = sim;
  return BD_OK;
}
