/* SPDX-License-Identifier: MIT
 *
 * Whether small differences grow exponentially. In a lightly damped drive whose links chatter on
 * the pulleys every impact multiplies a small difference, and after some tens of milliseconds no
 * tolerance can say where a link is, while averages stay what they are. Neither local errors nor
 * the balance of energy show it.
 *
 * So for short periods a second simulation, the twin, runs beside the run, displaced by a
 * hundredth of the local error allowed, in the very same steps (shorter ones only where its own
 * error asks for them), so that nothing but the displacement makes a difference. In a calm drive
 * the difference decays or stays, to within a few times, since links reach and leave the pulleys at
 * slightly different times; in one that chatters it has grown a thousandfold within ten rounds of a
 * stretch wave. Most of the displacement decays before what grows has overtaken it, so growth
 * counts from the least difference seen. Every run has a few such periods, ever further apart, and
 * one at its end; in a short run one is all of it. Where links come and go many times as often as
 * the belt's travel brings them, or friction is so stiff that each reversal is a jump, or the
 * belt's vibrations last for long, periods are longer, and one begins as soon as twins have made
 * less than a fifth of the steps. Friction that falls with slip velocity makes a belt stick for
 * long and let go within a millisecond, in which a difference grows 10^5 times, to be small again
 * soon: there the twin runs all the time, and is compared after every step. While the belt sticks
 * a displacement decays, to next to nothing in what will let go; the run's errors do not, for it
 * makes new ones, and so the twin is displaced anew in every round in which nothing has grown.
 *
 * Steps of implicit methods that are longer than a radian of the belt's vibrations damp these, the
 * twin's as well: what grows so fast that only they would show it is missed by both (a crossed belt
 * without axial damping: off by 0.6 % at any rtol down to 1e-5, where short steps see growth by e
 * in 0.7 ms). Where joints are hardly damped, two more simulations go on from the run for a few
 * periods, one of them displaced, in explicit steps that follow these vibrations.
 *
 * Prescribed motions are functions of time alone, and are called again. A torque function is not to
 * be called twice: where there is one, two twins run, one of them not
 * displaced, under the torques that the run had at the ends of its steps. Guarded by
 * tests/test_growth.py.
 */
#include <math.h>
#include <string.h>

#include "run/run.h"

/* Displacement over the local error allowed (for fixed steps, over their usual error). Two runs of
 * one drive differ by a few local errors, because only one of them may step across a kink; a
 * difference beyond two local errors, or 5 % of the tension, has grown. */
static const double DISPLACEMENT = 0.01, FIXED_ERROR = 0.03, ERRORS = 2.0, LARGE = 0.05;
/* Times in rounds of a stretch wave along the belt. */
static const double LOOK = 2.0;   /* between two comparisons */
static const double FRESH = 1.0;  /* between two displacements where friction falls */
static const double LEAST = 4.0;  /* shortest comparison period, if growth is below QUIET */
static const double USUAL = 10.0; /* usual one, if growth is below CALM */
static const double MOST = 60.0;  /* longest one: growth first has to overtake what decays */
static const double QUIET = 2.0, CALM = 5.0;
static const double DECAYED = 0.1; /* least difference that growth is counted from */
static const double SHORT = 20.0;  /* a run that is looked at as a whole, */
static const double LOOKS = 8.0;   /* so many times at least: in one of a round most of the
                                      displacement decays first */
static const double FIRST = 25.0;  /* when the first begins */
static const double LATER = 4.0;   /* each other begins at so many times the time of the last */
static const double LAST = 6.5;    /* and the last one so long before the end */
/* Where growth is suspected: share of all steps, made by twins, below which the next period begins
 * at once, and above which one ends. */
static const double SUSPECTED = 0.2, ENOUGH = 0.5;
/* Growth is suspected: contacts gained or lost over those that the belt's travel makes; stretch of
 * a joint over the slip in which friction saturates; rounds in which the lowest wave decays by e.
 */
static const double CHATTER = 4.0, STIFF = 3.0, LIGHT = 30.0;
/* Counts, of four rounds each, that must find links chattering before the warning. */
enum { OFTEN = 3 };

/* Vibrations that are missed: share of critical damping of the joints' fastest one, above which
 * none grows (friction made them grow by up to 0.008 a radian); radians of it in a step of the run
 * that damps them; of it, and of the stiffest motion of all, in a step that follows them (tsit5 is
 * stable to 3.3); the shortest of those in which growth would still be seen. */
static const double ALIVE = 0.01, DAMPED = 2.0, FOLLOWED = 1.0, STABLE = 2.0, TOO_SHORT = 0.3;
/* Such a period has so many steps, more while differences grow beyond RISES. Growth is judged so
 * many steps after the other and counts for no more than LEAP between two, for a link that reaches
 * a pulley makes a jump, and nothing else then grows by MISSED. A period begins at once, again in
 * the middle of the run, and where such steps are less than a share of all, for they cost a fifth
 * of an implicit one. */
enum { FEW_STEPS = 1000, MANY_STEPS = 3000, LOOK_STEPS = 75 };
static const double RISES = 3.0, LEAP = 2.5, MISSED = 30.0, MIDDLE = 0.5, SHARE = 0.1;

static bd_sim *make(bd_sim *sim, const bd_torque *torque, const bd_method *method,
                    const bd_method *other) {
  bd_sim *twin = bd_sim_new(sim->stepper.model, method, other, torque);
  if (twin) {
    bd_torque_set_fill(&twin->stepper.plan.torques, torque, NULL);
    twin->options = sim->options;
    twin->stepper.rtol = sim->stepper.rtol;
    twin->stepper.max_step = sim->stepper.max_step;
    twin->stepper.fixed = sim->stepper.fixed;
    twin->t_end = sim->t_end;
    bd_stepper_weigh(&twin->stepper);
    bd_plan_make(&twin->stepper.plan, sim->stepper.model,
                 &(bd_plan_options){.friction = 1,
                                    .no_power = 1,
                                    .motion = twin->stepper.plan.torques.motion.n > 0});
  }
  return twin;
}

static double fastest_of_joints(const bd_model *model) {
  return 2.0 / model->info.link_length *
         sqrt(model->belt.axial_stiffness / model->belt.linear_density);
}

/* Of critical, of the joints' fastest vibration. */
static double damping_of_joints(const bd_model *model) {
  return 0.5 * model->belt.axial_damping / model->belt.axial_stiffness * fastest_of_joints(model);
}

/* Whether the run may take steps that vibrations of the joints would outlive. */
static int may_miss(const bd_sim *sim) {
  const int implicit = sim->choice.method[0] || sim->stepper.method->implicit;
  return implicit && !sim->stepper.fixed && damping_of_joints(sim->stepper.model) < ALIVE;
}

/* The step in which explicit ones follow the vibrations of the joints; 0: they need not be. */
static double following(const bd_sim *sim) {
  const bd_model *model = sim->stepper.model;
  const double fastest = fastest_of_joints(model);
  const double step =
      fmin(FOLLOWED / fastest, STABLE / bd_stiffness_of(model, &sim->stepper.plan.torques).bound);
  return may_miss(sim) && step * fastest > TOO_SHORT ? step : 0.0;
}

/* The twins under a torque that may be called again; only: the run itself is the other one. */
static int make_all(bd_sim *sim, const bd_torque *torque, int only) {
  bd_twin *t = &sim->twin;
  const bd_method *const *c = sim->choice.method;
  const bd_method *method = c[0] ? c[0] : sim->stepper.method, *explicit = bd_method_find("tsit5");
  t->sim = make(sim, torque, method, c[1]);
  t->still = only ? NULL : make(sim, torque, method, c[1]);
  int made = t->sim && (only || t->still);
  for (int k = 0; k < 2 && may_miss(sim); ++k) {
    t->missed.pair[k] = make(sim, torque, explicit, NULL);
    made &= t->missed.pair[k] != NULL;
  }
  return made ? BD_OK : BD_ERR_MEMORY;
}

int bd_twin_create(bd_sim *sim, const bd_torque *torque) {
  bd_twin *t = &sim->twin;
  const bd_model *model = sim->stepper.model;
  t->stiff = fabs(model->info.strain) * model->info.link_length > STIFF * bd_least_slip(model);
  t->lightly_damped = bd_wave_life(model) > LIGHT * bd_round_time(model);
  t->friction_falls = bd_friction_falls(model);
  double rounds = (sim->t_end - sim->t0) / bd_round_time(model);
  t->whole = rounds <= SHORT;
  t->next_begin = t->whole ? 0.0 : fmin(FIRST, rounds / 3.0);
  t->missed.step = following(sim);
  if (sim->stepper.plan.torques.smooth) {
    return make_all(sim, torque, 1);
  }
  double times[2] = {0.0, 1.0};
  double *zero = bd_block_new(2 * (size_t)model->lay.np * sizeof *zero);
  bd_torque_term seen = {.kind = BD_TORQUE_PIECEWISE, .n_t = 2, .t = times, .values = zero};
  bd_torque as_seen = *torque; /* but for the motions, which are functions of time alone */
  as_seen.n_terms = 1;
  as_seen.terms = &seen;
  const int code = zero ? make_all(sim, &as_seen, 0) : BD_ERR_MEMORY;
  bd_block_free(zero);
  return code;
}

/* Root mean square of the difference of the joints' stretches, over the stretch at rest. */
static double relative_distance(const bd_sim *one, const bd_sim *other) {
  const bd_model *model = one->stepper.model;
  const double sum = model->belt_model->stretch_difference(&one->stepper.plan, one->stepper.y,
                                                           &other->stepper.plan, other->stepper.y);
  return sqrt(sum / model->lay.n) / (model->info.strain * model->info.link_length);
}

/* --- when to look ---------------------------------------------------------------------------- */

/* Over some rounds of a wave: contacts gained and lost, and those that the travel of the fastest
 * rim makes, two a link and pulley, and two more a pulley for what sways at its ends. A twin begins
 * as soon as they are too many: within these rounds links that land may be all that makes
 * differences grow. */
static void watch_contacts(bd_sim *sim) {
  bd_twin *twin = &sim->twin;
  const bd_layout *lay = &sim->stepper.model->lay;
  const int over = sim->stepper.t - twin->t_events >= 4.0 * bd_round_time(sim->stepper.model);
  const double changed = (double)(sim->stepper.plan.contacts_changed - twin->events);
  const double at_rest = 4.0 * lay->np;
  if (!over && (twin->chatters || changed <= CHATTER * at_rest)) {
    return;
  }
  double travel = 0.0;
  for (int j = 0; j < lay->np; ++j) {
    double arc =
        sim->stepper.model->radius[j] * fabs(sim->stepper.y[lay->theta + j] - twin->theta[j]);
    travel = fmax(travel, arc);
  }
  double expected = 2.0 * lay->np * travel / sim->stepper.model->info.link_length + at_rest;
  int chatters = changed > CHATTER * expected;
  if (chatters && !twin->chatters) {
    twin->t_chatter = twin->t_events;
  }
  twin->chatters = chatters;
  if (!over) {
    return;
  }
  memcpy(twin->theta, sim->stepper.y + lay->theta, (size_t)lay->np * sizeof *twin->theta);
  twin->times_chattered += chatters;
  if (twin->times_chattered >= OFTEN) {
    BD_WARN(
        sim, BD_WARN_chatter, twin->t_chatter, -1, -1,
        "links lose and regain contact with the pulleys %.0f times more often than the belt's "
        "travel explains, from t = %.6g s on: small differences may grow, so the error in time is "
        "not known; more damping of contact or joints calms them",
        changed / expected, twin->t_chatter);
  }
  twin->events = sim->stepper.plan.contacts_changed;
  twin->t_events = sim->stepper.t;
}

/* Another simulation where this one is. */
static void copy(const bd_sim *sim, bd_sim *twin) {
  bd_stepper_copy(&twin->stepper, &sim->stepper);
  twin->choice.now = sim->choice.now;
  twin->started = 1;
  twin->next_break = 0;
}

/* The local error of a step. */
static double allowed(const bd_sim *sim) {
  return sim->stepper.fixed
             ? FIXED_ERROR
             : bd_method_tolerance(sim->stepper.method, sim->stepper.model, sim->stepper.rtol);
}

/* The past is displaced as well: it is the place that differs, not the speed; of cells the metres
 * in them, by what they are in lengths of the shortest. By how much the twin is apart then. */
static double displace(bd_sim *sim, bd_sim *twin) {
  bd_twin *t = &sim->twin;
  const bd_layout *lay = &sim->stepper.model->lay;
  const double length = sim->stepper.model->info.link_length;
  const double stretch = sim->stepper.model->info.strain * length;
  const double size = fmax(1e-8, DISPLACEMENT * allowed(sim)) * stretch;
  const int cells = bd_has_field(lay, F_M);
  for (int f = cells ? F_M : F_X; f <= (cells ? F_M : F_Y); ++f) {
    for (int i = 0; i < lay->n; ++i) {
      t->random = t->random * 6364136223846793005u + 1442695040888963407u; /* Knuth's MMIX */
      double shift = size * ((double)(t->random >> 11) * 0x1p-52 - 1.0);
      shift *= cells ? bd_field(lay, twin->stepper.y, f)[i] / length : 1.0;
      bd_field(lay, twin->stepper.y, f)[i] += shift;
      for (int k = 0; k < twin->stepper.n_history; ++k) {
        bd_field(lay, twin->stepper.history[k], f)[i] += shift;
      }
    }
  }
  /* of a number evenly spread over +-size, of differences of two, in x and in y or along it alone
   */
  const int along = sim->stepper.model->belt_model->facts.stretches;
  return sqrt(cells ? 1.0 / 3.0 : along ? 2.0 / 3.0 : 4.0 / 3.0) * size / stretch;
}

static double next_look(const bd_sim *sim) {
  const double run = sim->t_end - sim->t0, round = bd_round_time(sim->stepper.model);
  const double look = sim->twin.friction_falls ? FRESH : LOOK;
  return (sim->stepper.t - sim->twin.t_begin) / round +
         (sim->twin.whole ? fmin(look, run / (LOOKS * round)) : look);
}

static void begin(bd_sim *sim) {
  bd_twin *t = &sim->twin;
  copy(sim, t->sim);
  if (t->still) {
    copy(sim, t->still);
  }
  t->first_distance = displace(sim, t->sim);
  t->warn_at = fmax(100.0, fmin(ERRORS * allowed(sim), LARGE) / t->first_distance);
  t->active = 1;
  t->least = t->before = 1.0;
  t->t_begin = sim->stepper.t;
  t->next_look = next_look(sim);
}

/* --- a stretch ------------------------------------------------------------------------------- */

static void note_growth(bd_sim *sim, double folding) {
  sim->twin.grows = 1;
  sim->stats.growth = 1.0 / folding;
}

static void conclude(bd_sim *sim, double growth) {
  bd_twin *t = &sim->twin;
  double from = t->chatters ? t->t_chatter : t->t_begin;
  double folding = (sim->stepper.t - t->t_begin) / log(growth);
  note_growth(sim, folding);
  BD_WARN(sim, BD_WARN_growth, from, -1, -1,
          "small differences grow exponentially from t = %.6g s on, by a factor of e in "
          "%.2g s: single forces and positions cannot be trusted from then on, whatever the "
          "tolerance, only averages are meaningful; more damping of contact or joints calms such "
          "drives",
          from, folding);
}

/* The torques of functions, as the run had them at the ends of its step. */
static void see_torque(bd_sim *sim, bd_sim *twin) {
  bd_twin *t = &sim->twin;
  const int np = sim->stepper.model->lay.np;
  if (!sim->stepper.plan.torques.smooth) {
    bd_torque_term *seen = &twin->stepper.plan.torques.terms[0];
    memcpy(t->seen, sim->stepper.functions.last, (size_t)np * sizeof *t->seen);
    memcpy(t->seen + np, sim->stepper.functions.now, (size_t)np * sizeof *t->seen);
    t->seen_t[0] = twin->stepper.t;
    t->seen_t[1] = sim->stepper.t;
    seen->t = t->seen_t;
    seen->values = t->seen;
  }
}

/* The same step; whether it can be compared. */
static int repeat(bd_sim *sim, bd_sim *twin) {
  bd_twin *t = &sim->twin;
  see_torque(sim, twin);
  if (twin->choice.now !=
      sim->choice.now) { /* "auto" has gone over to the other, which begins anew */
    twin->choice.now = sim->choice.now;
    twin->stepper.method = sim->stepper.method;
    twin->stepper.n_history = 0;
    twin->stepper.rate_known = twin->stepper.jacobian_known = 0;
  }
  twin->stepper.now = sim->stepper.now;
  const long before = twin->stats.steps;
  double tolerance =
      sim->stepper.fixed || sim->stepper.now != sim->stepper.method
          ? INFINITY
          : bd_method_tolerance(sim->stepper.method, sim->stepper.model, sim->stepper.rtol);
  int code = bd_sim_replay_step(twin, sim->stepper.t, sim->stepper.plan.t_piece, tolerance,
                                (double)INFINITY);
  t->steps += twin->stats.steps - before;
  return code == BD_OK;
}

static void follow(bd_sim *sim) {
  bd_twin *t = &sim->twin;
  const bd_sim *still = t->still ? t->still : sim;
  if (bd_torque_functions_shortest_step(&sim->stepper) > 0.0 || !repeat(sim, t->sim) ||
      (t->still && !repeat(sim, t->still))) {
    t->active = 0;
    return;
  }
  double rounds = (sim->stepper.t - t->t_begin) / bd_round_time(sim->stepper.model);
  const int looks = rounds >= t->next_look;
  if (!looks && !t->friction_falls && sim->stepper.t < sim->t_end) {
    return;
  }
  t->next_look = looks ? next_look(sim) : t->next_look;
  const double difference = relative_distance(still, t->sim) / t->first_distance;
  t->least = fmin(t->least, fmax(DECAYED, difference));
  const double growth = difference / t->least;
  const int rises = growth > CALM && difference > t->before;
  t->before = difference;
  t->most = fmax(t->most, t->whole || t->friction_falls ? growth : difference);
  if (difference > t->warn_at) {
    conclude(sim, difference);
  }
  int calm =
      !t->suspected && ((rounds > USUAL && growth < CALM) || (rounds > LEAST && growth < QUIET));
  t->excused |= t->times_chattered > 0 && rounds > USUAL && difference <= t->warn_at;
  int too_costly = rounds > USUAL && !rises && !t->whole && !t->friction_falls &&
                   (double)t->steps > ENOUGH * (double)sim->stats.steps;
  if (t->grows || rounds > MOST || calm || too_costly) {
    t->active = 0;
  } else if (t->friction_falls && looks && difference < 1.0) {
    displace(sim, t->sim);
    bd_stepper_reset(&t->sim->stepper);
    t->least = t->before = 1.0;
  }
}

/* --- vibrations that are missed --------------------------------------------------------------- */

static void begin_missed(bd_sim *sim) {
  bd_missed *m = &sim->twin.missed;
  const double gone = (sim->stepper.t - sim->t0) / (sim->t_end - sim->t0);
  if (sim->stepper.h < DAMPED * m->step || !sim->stepper.method->implicit ||
      !(gone >= m->next_begin || (double)m->steps < SHARE * (double)sim->stats.steps)) {
    return;
  }
  m->next_begin = gone < MIDDLE ? MIDDLE : (double)INFINITY;
  for (int k = 0; k < 2; ++k) {
    copy(sim, m->pair[k]);
    m->pair[k]->stepper.method = m->pair[k]->stepper.now = bd_method_find("tsit5");
    m->pair[k]->stats.steps = 0;
  }
  m->first_distance = displace(sim, m->pair[1]);
  m->growth = m->before = 1.0;
  m->next_look = LOOK_STEPS;
  m->t_begin = sim->stepper.t;
  m->active = 1;
}

static void conclude_missed(bd_sim *sim) {
  bd_twin *t = &sim->twin;
  const double folding = (sim->stepper.t - t->missed.t_begin) / log(t->missed.growth);
  note_growth(sim, folding);
  BD_WARN(sim, BD_WARN_growth, t->missed.t_begin, -1, -1,
          "vibrations of the belt grow from t = %.6g s on, by a factor of e in %.2g s, which "
          "steps of %s, up to %.2g s, are too long to follow: what they would become is missing, "
          "and the error is not known; compare with method=\"tsit5\", or give the belt more "
          "axial_damping, of which it has %.2g of critical",
          t->missed.t_begin, folding, sim->stepper.method->name, sim->stats.largest_step,
          damping_of_joints(sim->stepper.model));
}

static void follow_missed(bd_sim *sim) {
  bd_missed *m = &sim->twin.missed;
  if (sim->stepper.t - m->pair[0]->stepper.t > FEW_STEPS * m->step) { /* the drive rests */
    m->active = 0;
    return;
  }
  for (int k = 0; k < 2; ++k) {
    bd_sim *twin = m->pair[k];
    const long before = twin->stats.steps;
    see_torque(sim, twin);
    twin->stepper.rate_known = 0; /* the torque may have jumped */
    const int code = bd_sim_replay_step(twin, sim->stepper.t, sim->stepper.plan.t_piece,
                                        (double)INFINITY, m->step);
    m->steps += twin->stats.steps - before;
    if (code != BD_OK) {
      m->active = 0;
      return;
    }
  }
  const long steps = m->pair[1]->stats.steps;
  if (steps < m->next_look) {
    return;
  }
  m->next_look = steps + LOOK_STEPS;
  const double difference = relative_distance(m->pair[0], m->pair[1]) / m->first_distance;
  m->growth = fmax(1.0, m->growth * fmin(LEAP, difference / m->before));
  m->before = difference;
  m->t_begin = m->growth > 1.0 ? m->t_begin : sim->stepper.t;
  if (m->growth > MISSED) {
    conclude_missed(sim);
  }
  m->active =
      !(m->growth > MISSED || steps > MANY_STEPS || (steps > FEW_STEPS && m->growth < RISES));
}

static void watch_missed(bd_sim *sim) {
  const bd_missed *m = &sim->twin.missed;
  if (m->step > 0.0) {
    (m->active ? follow_missed : begin_missed)(sim);
  }
}

void bd_twin_follow(bd_sim *sim) {
  bd_twin *t = &sim->twin;
  if (t->grows) {
    return;
  }
  watch_missed(sim);
  watch_contacts(sim);
  if (t->active) {
    follow(sim);
    return;
  }
  double rounds = (sim->stepper.t - sim->t0) / bd_round_time(sim->stepper.model);
  const int few = (double)t->steps <= SUSPECTED * (double)sim->stats.steps;
  const int suspected = t->chatters || t->times_chattered > 0 || t->stiff || t->lightly_damped;
  const int due = (t->friction_falls || (suspected && few)) && rounds > LEAST;
  int last = !t->last && sim->t_end - sim->stepper.t < LAST * bd_round_time(sim->stepper.model) &&
             rounds > LAST;
  if (rounds > t->next_begin || due || last) {
    t->suspected = due || t->whole;
    t->last |= last;
    t->next_begin = rounds > t->next_begin ? LATER * rounds : t->next_begin;
    begin(sim);
  }
}

double bd_growth_factor(const bd_twin *twin) {
  return fmax(1.0, twin->most / CALM);
}

void bd_twin_free(bd_twin *twin) {
  bd_sim_free(twin->sim);
  bd_sim_free(twin->still);
  bd_sim_free(twin->missed.pair[0]);
  bd_sim_free(twin->missed.pair[1]);
}

void bd_twin_carve(bd_carver *carver, bd_twin *twin, int np) {
  BD_KEEP_SPAN(carver, twin, missed.steps, missed.next_look);
  BD_KEEP_SPAN(carver, twin, least, seen_t);
  BD_KEEP(carver, twin->theta, np);
  BD_KEEP(carver, twin->seen, 2 * np);
}
