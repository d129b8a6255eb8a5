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
#include <float.h>
#include <math.h>
#include <string.h>

#include "run/run.h"

struct bd_settling {
  bd_sim *sim;
  bd_settle_options options;
  double *start, *offset; /* state and displacement at the start */
  double start_turns;
  double flow; /* stress-free length of belt that runs past a point [m/s] */
  int tries, at_rest, status;
  bd_circulation circulation;
  double patience;        /* how long to wait for less than the least residual so far, */
  double best, best_time; /* that residual, and when it was seen */
  bd_error failure;
};

/* Largest unbalanced force over the mean tension, unless another is asked for. */
static const double TOLERANCE = 1e-9;

void bd_settle_options_default(bd_settle_options *options) {
  *options = (bd_settle_options){.tolerance = TOLERANCE};
}

/* Critical for the lowest transverse mode of the longest span [1/s]; and that mode's frequency, in
 * the pattern of a belt that runs with this flow. */
static double critical_mass_damping(const bd_model *model, double flow, double *lowest) {
  double span = fmax(model->longest_span, 0.25 * model->belt.length);
  double still = model->info.strain_tension / model->belt.linear_density;
  flow = model->n_moving > 0 ? 0.0 : flow;
  *lowest = BD_PI * sqrt(fmax(still - flow * flow, 0.01 * still)) / span;
  return 2.0 * *lowest;
}

/* What makes explicit steps longest. */
static double easiest_damping(const bd_model *model) {
  return 0.5 * sqrt(model->info.joint_stiffness * model->info.link_mass /
                    (0.25 * model->belt_model->facts.shear));
}

/* Times a radius, the most by which a link is pressed: PRESSED times the force on the belt line, as
 * much as was seen while links come to rest. */
static double pressed_by(const bd_model *model) {
  const bd_info *info = &model->info;
  const double PRESSED = 4.0;
  return PRESSED * model->belt.axial_stiffness * (info->strain + info->mesh_strain) *
         info->link_length;
}

/* Largest |lambda| of a link on its joints and a pulley, for a fixed explicit step. The contact
 * stiffens with penetration. */
static double fastest_mode(const bd_model *model, int friction, double flow) {
  const bd_info *info = &model->info;
  const double pressed = pressed_by(model), normal = pressed / bd_tightest_radius(model);
  double lowest;
  bd_friction_stiffness steepest = {0.0, 0.0, 0.0};
  for (int j = 0; friction && j < model->lay.np; ++j) {
    bd_friction_stiffness one = bd_friction_stiffness_of(model, j, pressed / model->radius[j]);
    steepest.stiffness = fmax(steepest.stiffness, one.stiffness);
    steepest.damping = fmax(steepest.damping, one.damping);
    steepest.adapts = fmax(steepest.adapts, one.adapts);
  }
  double contact = bd_contact_stiffness(info->contact_quadratic, info->contact_linear, normal);
  double m = info->link_mass;
  double k = model->belt_model->facts.shear * info->joint_stiffness / m +
             4.0 * info->bending_stiffness / info->link_inertia +
             (contact + steepest.stiffness) / m;
  double d = info->contact_damping / m + steepest.damping / m +
             critical_mass_damping(model, flow, &lowest) +
             model->belt_model->facts.shear * easiest_damping(model) / m +
             4.0 * info->bending_damping / info->link_inertia;
  return fmax(steepest.adapts, bd_oscillator_rate(k, d));
}

/* Implicit steps, times the mass-proportional damping; how many explicit steps one of them must
 * replace: it takes as long as three or four; with friction, where rounding would decide what long
 * steps leave it holding, and where contact sets in with a jump, whose coarse belts are to stay as
 * they were, many more. The share of the stability limit that an explicit step takes; if that was
 * too much, it is halved (retry). Centres move in, and settling is given up without progress, after
 * so many radians of the lowest transverse mode: the polygon of links holds a fine belt less. While
 * there is progress it goes on for MOST_PATIENCE times as many steps. */
static const double IMPLICIT_STEP = 0.25, WORTH_EXACT = 15.0, WORTH = 4.0, STABILITY_SHARE = 0.8;
static const double MOVE = 100.0, PATIENCE = 1000.0, PATIENCE_FINE = 5000.0, MOST_PATIENCE = 4.0;

static const bd_method *method_for(const bd_model *model, int friction, double flow, double *step) {
  const bd_method *explicit = bd_method_find("rk4");
  double lowest, most = IMPLICIT_STEP / critical_mass_damping(model, flow, &lowest);
  *step = STABILITY_SHARE * explicit->stability / fastest_mode(model, friction, flow);
  const int exact = friction || !model->belt_model->facts.smooth;
  if ((exact ? WORTH_EXACT : WORTH) * *step >= most) {
    return explicit;
  }
  *step = most;
  return bd_method_find("lie");
}

/* Of a belt whose spans run at a speed. */
static double flow_of(const bd_model *model, double speed) {
  return speed / (1.0 + bd_running_tension(model, speed) / model->belt.axial_stiffness);
}

/* Without pressure on its pulleys the belt is held by its mass alone: T = rho A v^2 / lambda. With
 * mounts that give way the pressure stays, and the tension rises by rho A v^2 until no belt would
 * bear it. */
static int check_speed(const bd_model *model, const bd_settle_options *options, bd_error *err) {
  if (!isfinite(options->speed)) {
    return bd_fail(err, BD_ERR_OPTION, "speed", "speed must be finite, got %g m/s", options->speed);
  }
  if (options->speed == 0.0) {
    return BD_OK;
  }
  const double tension = bd_rest_tension(model, (double)INFINITY);
  const double stretched = 1.0 + tension / model->belt.axial_stiffness;
  const double most = sqrt(tension * stretched / model->belt.linear_density);
  const double EA = model->belt.axial_stiffness, density = model->belt.linear_density;
  const double room = BD_MAX_STRAIN * EA - bd_rest_tension(model, 0.0);
  const double fastest = sqrt(fmax(0.0, room) / density);
  if (model->n_moving > 0 && !(fabs(options->speed) < fastest)) {
    return bd_fail(
        err, BD_ERR_OPTION, "speed",
        "speed must be below %.6g m/s, at which rho A v^2 stretches the belt by more than "
        "%g; got %.6g m/s: is it a speed in 1/min where rad/s are meant?",
        fastest, BD_MAX_STRAIN, options->speed);
  }
  if (model->n_moving == 0 && !(fabs(options->speed) < most)) {
    return bd_fail(err, BD_ERR_OPTION, "speed",
                   "speed must be below %.6g m/s, at which the belt leaves its pulleys: rho A v^2 "
                   "is then all of its tension, %.4g N without their pressure; got %.6g m/s",
                   most, tension, options->speed);
  }
  if (options->friction) {
    return bd_fail(err, BD_ERR_OPTION, "speed",
                   "speed must be 0 where friction acts while settling: it holds the belt, and "
                   "of a belt that runs nothing is left of how it was laid");
  }
  return BD_OK;
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
  if (check_speed(model, options, err) != BD_OK) {
    return BD_ERR_OPTION;
  }
  for (int m = 0; options->offset && m < model->lay.nm; ++m) {
    const int j = model->lay.mounted[m];
    if (options->offset[2 * j] != 0.0 || options->offset[2 * j + 1] != 0.0) {
      return bd_fail_at(err, BD_ERR_OPTION, "offset", (double)NAN, -1, j, options->offset[2 * j],
                        "offset[%d] must be 0: the pulley stands on a mount, which moves it", j);
    }
  }
  for (int k = 0; options->offset && k < 2 * model->lay.np; ++k) {
    if (!isfinite(options->offset[k])) {
      return bd_fail(err, BD_ERR_OPTION, "offset", "offset[%d, %d] must be finite, got %g", k / 2,
                     k % 2, options->offset[k]);
    }
  }
  return BD_OK;
}

/* Least share of the tension down to which forces can balance: what the rounding of positions makes
 * of them, by joints or contact. Coordinates are a quarter of the path at most, from the origin to
 * both sides of a gap. */
static double rounding(const bd_model *model) {
  const bd_info *info = &model->info;
  const double normal = info->strain_tension * info->link_length / bd_tightest_radius(model);
  const double stiff = 2.0 * info->joint_stiffness +
                       bd_contact_stiffness(info->contact_quadratic, info->contact_linear, normal);
  return 0.25 * DBL_EPSILON * info->path_length * stiff / info->strain_tension;
}

static void set_up(bd_settling *settling, double step) {
  bd_sim *sim = settling->sim;
  const bd_model *model = sim->stepper.model;
  const bd_settle_options *given = &settling->options;
  double lowest, mass_damping = critical_mass_damping(model, settling->flow, &lowest);
  double move_time = !given->offset           ? 0.0
                     : given->move_time > 0.0 ? given->move_time
                                              : MOVE / lowest;
  sim->stepper.t = sim->t0 = 0.0;
  settling->patience = (sim->stepper.method->implicit ? PATIENCE_FINE : PATIENCE) / lowest;
  sim->t_end = move_time + (given->max_time > 0.0 ? given->max_time : settling->patience);
  bd_plan_make(&sim->stepper.plan, model,
               &(bd_plan_options){.friction = given->friction,
                                  .hold_pulleys = !given->free_pulleys,
                                  .no_power = 1,
                                  .settling = 1,
                                  .mass_damping = mass_damping,
                                  .offset = given->offset,
                                  .move_time = move_time,
                                  .flow = settling->flow});
  if (!sim->stepper.method->implicit) {
    sim->stepper.plan.links.damping = easiest_damping(model);
  }
  bd_circulation_begin(&settling->circulation, sim);
  /* Damping by the force has no say in an equilibrium; where a link comes in fast it makes the
   * contact stiffer than steps are chosen for, and links are thrown off for ever. */
  for (int j = 0; j < model->lay.np; ++j) {
    sim->stepper.plan.contact_pulleys[j].hunt_crossley = 0.0;
  }
  /* critical for mounts as well: no inertia has a say in an equilibrium */
  for (int m = 0; m < model->lay.nm; ++m) {
    sim->stepper.plan.mount_inertia[m] =
        4.0 * model->mounts[m].held / (mass_damping * mass_damping);
  }
  if (given->tolerance >= TOLERANCE) { /* what is asked beyond that is held to, if it can be had */
    settling->options.tolerance = fmax(given->tolerance, rounding(model));
  }
  bd_options_default(&sim->options);
  sim->options.method = sim->stepper.method->name;
  sim->options.step = step;
  sim->options.ledger = 0;
  sim->stepper.fixed = 1;
}

/* A belt that does not touch every pulley has settled in a wrong position. */
static int check_laid(bd_sim *sim, bd_error *err) {
  const bd_model *model = sim->stepper.model;
  const bd_layout *lay = &model->lay;
  int code = bd_guard_winding(&sim->stepper.plan, sim->stepper.y, err, sim->stepper.t);
  double turn;
  const int over = bd_state_wrapped(model, bd_cfield(lay, sim->stepper.y, F_PHI), &turn);
  if (code == BD_OK && over >= 0) {
    return bd_fail_at(err, BD_ERR_NOT_SETTLED, "settle", sim->stepper.t, over, -1, turn,
                      "link %d has turned over: links of %.3g m are too long for the pulleys, "
                      "raise belt.n_bodies",
                      over, model->info.link_length);
  }
  bd_plan_see(&sim->stepper.plan, sim->stepper.y);
  for (int j = 0; code == BD_OK && j < lay->np; ++j) {
    double stored = 0.0;
    if (!model->belt_model->contact_energy(&sim->stepper.plan, sim->stepper.y, j, &stored)) {
      return bd_fail_at(
          err, BD_ERR_OFF_PULLEY, "settle", sim->stepper.t, -1, j, model->info.link_length,
          "no link touches %s: the belt bends round it between two links of "
          "%.3g m; %s would make sure that one does",
          bd_pulley_label(model, j).text, model->info.link_length,
          bd_links_label(model->belt.length / (model->wraps[j].wrap * model->contact_radius[j]))
              .text);
    }
  }
  return code;
}

/* The largest unbalanced force with everything stopped, over the mean tension, into
 * stats.residual; velocities must be gone to the same degree. At rest: stops the belt. */
static int check_rest(bd_settling *settling) {
  bd_sim *sim = settling->sim;
  bd_error *err = &settling->failure;
  const bd_model *model = sim->stepper.model;
  const bd_layout *lay = &model->lay;
  const bd_info *info = &model->info;
  double *y = sim->stepper.y_mid, *dy = sim->stepper.stage[sim->stepper.method->vectors - 1];
  memcpy(y, sim->stepper.y, lay->size * sizeof *y);
  const double fastest = bd_stop(sim, y);
  double wave = sqrt(model->belt.axial_stiffness / model->belt.linear_density);
  if (!(fastest < wave)) {
    return bd_fail_at(
        err, BD_ERR_NOT_FINITE, "settle", sim->stepper.t, -1, -1, fastest,
        "settling blew up: a link moves at %.3g m/s, faster than waves along the belt; "
        "the start is too far from rest or the contact too stiff for it",
        fastest);
  }
  double gain = sim->stepper.plan.circulation_inertia_scale;
  sim->stepper.plan.circulation_inertia_scale = 1.0; /* the true forces */
  int code = bd_plan_rate(&sim->stepper.plan, sim->stepper.t, y, dy, err);
  sim->stepper.plan.circulation_inertia_scale = gain;
  if (code != BD_OK) {
    return code;
  }
  ++sim->stepper.nfev;
  bd_circulation_look(&settling->circulation, sim, dy);
  sim->stats.residual = bd_unbalanced(sim, dy);
  if (!(sim->stats.residual > 0.9 * settling->best)) {
    settling->best = sim->stats.residual;
    settling->best_time = sim->stepper.t;
  }
  int still = sim->stats.residual <= settling->options.tolerance &&
              fastest <= settling->options.tolerance * info->strain * wave &&
              sim->stepper.t >= sim->stepper.plan.move_time;
  if (still && !(bd_mean_force(&sim->stepper.plan, y) > 1e-6 * info->strain_tension)) {
    return bd_fail_at(err, BD_ERR_NOT_SETTLED, "settle", sim->stepper.t, -1, -1,
                      sim->stats.residual,
                      "the belt came to rest without tension: it has slipped off its pulleys, or "
                      "the contact is too soft, or the links too long for the pulleys");
  }
  if (still) {
    code = check_laid(sim, err);
    if (code != BD_OK) {
      return code;
    }
    if (settling->flow != 0.0) {
      bd_set_going(&sim->stepper.plan, y, settling->options.speed);
    }
    memcpy(sim->stepper.y, y, lay->size * sizeof *y);
    sim->stepper.t = sim->t0;
    settling->at_rest = 1;
    return BD_OK;
  }
  /* no progress for twice the time expected: give up */
  int hopeless = sim->stepper.t > settling->best_time + settling->patience &&
                 sim->stepper.t > sim->stepper.plan.move_time + settling->patience;
  /* as many steps in all, however short they had to become */
  const double more = fmax(1.0, ldexp(MOST_PATIENCE, -settling->tries));
  const double longest = sim->stepper.plan.move_time + more * settling->patience;
  if (sim->stepper.t >= sim->t_end && !hopeless && !(settling->options.max_time > 0.0) &&
      sim->t_end < 0.999 * longest) { /* in progress: as long again, by steps of the same length */
    sim->t_end += settling->patience;
    sim->status = BD_MORE;
  } else if (sim->stepper.t >= sim->t_end || hopeless) {
    return bd_fail_at(
        err, BD_ERR_NOT_SETTLED, "settle", sim->stepper.t, -1, -1, sim->stats.residual,
        "the belt did not come to rest within %.3g s: unbalanced force %.3g of the "
        "mean tension, fastest motion %.3g m/s; the contact may be too soft, axial_damping too "
        "large, %sor the links too long for the pulleys; or call settle(params, %stolerance=...) "
        "and pass its state as initial",
        sim->stepper.t, sim->stats.residual, fastest,
        model->n_moving > 0 ? "the mounts' stops too stiff or their springs too soft, " : "",
        hopeless ? "" : "max_time=..., ");
  }
  return BD_OK;
}

/* Starts over with half the step, a few times: the bound on the contact is an estimate. Mounts
 * begin in balance and are damped critically: one that comes upon another pulley was thrown. */
static int retry(bd_settling *settling) {
  enum { MOST = 8 };
  bd_sim *sim = settling->sim;
  const int code = settling->failure.code;
  const int thrown = code == BD_ERR_OFF_PULLEY && strcmp(settling->failure.field, "mount") == 0;
  if (settling->tries >= MOST ||
      !(thrown || code == BD_ERR_NOT_FINITE || code == BD_ERR_PASSED_THROUGH)) {
    return 0;
  }
  ++settling->tries;
  sim->options.step *= 0.5;
  bd_sim_restart(sim, settling->start, settling->start_turns);
  settling->best = INFINITY;
  settling->best_time = sim->stepper.t;
  bd_circulation_begin(&settling->circulation, sim);
  return 1;
}

/* Now and then, every millisecond or so, looks whether the belt has come to rest. */
static int advance(bd_settling *settling, long max_steps) {
  bd_sim *sim = settling->sim;
  const bd_stepper *stepper = &sim->stepper;
  const long every = stepper->method->implicit ? 8 : 64;
  for (long done = 0; !settling->at_rest && done < max_steps;) {
    const long before = sim->stats.steps, to_look = every - before % every;
    const long left = max_steps - done;
    int code = bd_sim_advance(sim, to_look < left ? to_look : left, &settling->failure);
    done += code < 0 ? to_look : sim->stats.steps - before;
    if (code >= 0 && (sim->stats.steps % every == 0 || stepper->t >= sim->t_end)) {
      code = check_rest(settling);
      if (code == BD_OK && !settling->at_rest &&
          bd_circulation_ends(&settling->circulation, sim, settling->options.tolerance)) {
        code = check_rest(settling);
      }
      if (stepper->method->implicit) {
        sim->stepper.rate_known = sim->stepper.jacobian_known = 0; /* the look used their scratch */
      }
    }
    if (code < 0 && !retry(settling)) {
      return code;
    }
  }
  return settling->at_rest ? BD_OK : BD_MORE;
}

int bd_settle_advance(bd_settling *settling, long max_steps, bd_error *err) {
  if (settling->status >= 0) {
    settling->status = advance(settling, max_steps);
  }
  if (settling->status < 0 && err) {
    *err = settling->failure;
  }
  return settling->status;
}

bd_sim *bd_settle_sim(bd_settling *settling) {
  return settling->sim;
}

void bd_settle_free(bd_settling *settling) {
  if (settling) {
    bd_sim_free(settling->sim);
    bd_block_free(settling);
  }
}

static void carve(bd_carver *carver, bd_settling *settling, const bd_layout *lay) {
  BD_CARVE(carver, settling->start, lay->size);
  BD_CARVE(carver, settling->offset, 2 * lay->np);
}

static bd_settling *new_settling(const bd_model *model, const bd_method *method, int friction) {
  const bd_method *last = friction ? NULL : bd_method_find("lie"); /* bd_find_equilibrium */
  bd_carver carver = {0};
  bd_settling sizes, *settling;
  bd_carve(&carver, 1, sizeof *settling);
  carve(&carver, &sizes, &model->lay);
  char *block = bd_block_new(carver.used);
  if (!block) {
    return NULL;
  }
  carver = (bd_carver){.base = block};
  settling = bd_carve(&carver, 1, sizeof *settling);
  carve(&carver, settling, &model->lay);
  settling->sim = bd_sim_new(model, method, last, NULL);
  if (!settling->sim) {
    bd_block_free(settling);
    return NULL;
  }
  settling->sim->settling = 1;
  bd_torque_set_fill(&settling->sim->stepper.plan.torques, NULL, NULL); /* there are none */
  return settling;
}

int bd_settle_create(bd_settling **out, const bd_model *model, const bd_state *initial,
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
  double step, flow = flow_of(model, options->speed);
  const bd_method *method = method_for(model, options->friction, flow, &step);
  if (!model->belt_model->rest && !(step < INFINITY)) { /* it would be tried, halved, for ever */
    return bd_fail(err, BD_ERR_NOT_SETTLED, "settle",
                   "the belt vibrates too slowly to be settled: its tension at rest is next to 0, "
                   "or its density beyond all measure; raise belt.preload");
  }
  bd_settling *settling = new_settling(model, method, options->friction);
  if (!settling) {
    return bd_fail(err, BD_ERR_MEMORY, "simulation", "out of memory for a simulation");
  }
  settling->options = *options;
  settling->flow = flow;
  settling->best = INFINITY;
  if (options->offset) {
    memcpy(settling->offset, options->offset, 2 * (size_t)model->lay.np * sizeof(double));
    settling->options.offset = settling->offset;
  }
  set_up(settling, step);
  bd_stepper *stepper = &settling->sim->stepper;
  int code = method->implicit ? bd_newton_check(&stepper->plan, method->name, err) : BD_OK;
  if (code == BD_OK) {
    settling->at_rest = model->belt_model->rest != NULL;
    code =
        settling->at_rest ? model->belt_model->rest(&stepper->plan, options->speed, stepper->y, err)
        : initial         ? bd_state_import(model, initial, stepper->y, &stepper->turns, err)
                  : bd_lay_belt(&stepper->plan, options->shift, stepper->y, &stepper->turns, err);
  }
  if (code != BD_OK) {
    bd_settle_free(settling);
    return code;
  }
  if (!settling->at_rest) {
    bd_stop(settling->sim, stepper->y);
  }
  bd_effects_rest(&stepper->plan, stepper->y);
  settling->start_turns = stepper->turns;
  memcpy(settling->start, stepper->y, model->lay.size * sizeof *stepper->y);
  bd_stepper_weigh(stepper);
  *out = settling;
  return BD_OK;
}
