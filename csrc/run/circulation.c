/* SPDX-License-Identifier: MIT
 *
 * Circulation of a belt that settles: its motion along itself. Without friction the belt slides
 * round its pulleys almost freely, and with friction a drive whose pulleys are free circulates so,
 * against a stiffness that comes from the polygon of links alone and is thousands of times below
 * all others.
 */
#include <math.h>

#include "run/run.h"

/* Fine belts, whose circulation meets the least force, are not waited for. Nor are others for ever;
 * nearly all have come to rest by then. With friction Newton's method would decide what is held,
 * and of belts that run it does not know the centrifugal force, without which it would not let them
 * circulate: there fine ones are moved along themselves. */
void bd_circulation_begin(bd_circulation *circulation, bd_sim *sim) {
  const double FINE = 0.1; /* angle of a link on its pulley */
  const double SOON = 30.0, LATE = 1000.0;
  bd_plan *plan = &sim->stepper.plan;
  const bd_model *model = sim->stepper.model;
  const int fine = sim->stepper.method->implicit && !plan->friction_on &&
                   model->info.link_length < FINE * bd_tightest_radius(model);
  const int can =
      plan->flow == 0.0 && !plan->grip_on && bd_newton_check(plan, "lie", NULL) == BD_OK;
  *circulation = (bd_circulation){.fine = fine && !can,
                                  .try_after = !can   ? (double)INFINITY
                                               : fine ? SOON
                                                      : LATE};
  plan->circulation_damping = 0.0;
  plan->circulation_inertia_scale = 1.0;
}

/* Damping, times the time since centres have come to their places: motions at the pace of the
 * slowest that is damped critically have fallen by exp(given / 2). */
static double given(const bd_sim *sim) {
  return (sim->stepper.t - sim->stepper.plan.move_time) * sim->stepper.plan.mass_damping;
}

/* Of one move, as a share of a link. */
static const double LONGEST = 0.125;

/* By this share of a link, links following the line through them and their neighbours. */
static void move(bd_sim *sim, double share) {
  const bd_layout *lay = &sim->stepper.model->lay;
  for (int f = F_X; f <= F_PHI; ++f) {
    if (!bd_has_field(lay, f)) {
      continue;
    }
    double *v = bd_field(lay, sim->stepper.y, f);
    const double turn = f == F_PHI ? sim->stepper.plan.links.wind : 0.0, first = v[0];
    double behind = v[lay->n - 1] - turn;
    for (int i = 0; i < lay->n; ++i) {
      const double here = v[i], ahead = i + 1 < lay->n ? v[i + 1] : first + turn;
      v[i] += 0.5 * share * (ahead - behind + share * (ahead - 2.0 * here + behind));
      behind = here;
    }
  }
  sim->stepper.plan.search.travelled = (double)INFINITY;
}

/* Down the force, in steps that double, until it changes its sign, which it does within a link's
 * length; then between the last places of either sign by the rule of false position, that of a
 * place kept twice halved ("Illinois"). Where links come on or off a pulley at once there is no
 * zero between: the search begins again from there. A look counts when the force has stopped
 * changing. */
static void seek(bd_circulation *c, bd_sim *sim, double force) {
  enum { MOST = 8 };
  const double SHORTEST = 1e-6, STEADY = 0.05, SOON = 2.0, LATE = 60.0;
  const double since = (sim->stepper.t - c->time) * sim->stepper.plan.mass_damping;
  const int steady = fabs(force - c->force) <= STEADY * fabs(force);
  c->force = force;
  if (force == 0.0 || since < SOON || !steady) {
    c->fine &= since <= LATE;
    return;
  }
  const int side = force < 0.0;
  bd_circulation_place *here = &c->ends[side], *there = &c->ends[!side];
  *here = (bd_circulation_place){c->at, force, 1};
  if (c->last == side) {
    there->force *= 0.5;
  }
  c->last = side;
  if (there->known && ++c->tries > MOST) {
    c->step = fmax(SHORTEST, fabs(there->at - here->at));
    c->tries = there->known = 0;
  }
  double step = side ? -c->step : c->step;
  if (there->known) {
    step = (there->at - here->at) * here->force / (here->force - there->force);
  } else {
    c->step = fmin(LONGEST, 2.0 * c->step);
  }
  move(sim, step);
  c->at += step;
  c->time = sim->stepper.t;
  ++c->moves;
}

/* The stiffness is measured, from how the force along the belt changes with the distance travelled
 * since the last look, and circulation is given the inertia and damping that bring it to rest as
 * fast as the slowest of the other motions allows. A change of these changes the force at once,
 * which passes for stiffness and brings the next change: where that goes on, they are held until it
 * has died down. */
static void tune(bd_circulation *c, bd_sim *sim, double force) {
  enum { HELD = 16 };
  bd_plan *plan = &sim->stepper.plan;
  const double speed = bd_plan_circulation(plan, sim->stepper.y);
  const double travel = 0.5 * (speed + c->speed) * (sim->stepper.t - c->time);
  const double held_after = sim->stepper.method->implicit ? 2500.0 : 500.0;
  const double damped = given(sim);
  const int held = damped > held_after && ++c->looks < HELD;
  /* not before the rest of the motion has died down, or its noise would pass for a stiffness */
  if (!held && damped > 30.0 && fabs(travel) > 1e-9 * sim->stepper.model->info.link_length) {
    c->looks = 0;
    /* the estimate falls only slowly: gains that follow the position would feed energy in */
    const double seen = fabs(force - c->force) / fabs(travel), pace = plan->mass_damping / 16.0;
    c->stiffness = fmax(seen, 0.9 * c->stiffness);
    plan->circulation_inertia_scale = fmin(1e4, fmax(1.0, pace * pace / c->stiffness));
    plan->circulation_damping = fmin(plan->mass_damping, 2.0 * fmax(pace, sqrt(c->stiffness)));
  }
  c->force = force;
  c->speed = speed;
  c->time = sim->stepper.t;
}

/* Fine belts that Newton's method is not for, and that have not come to rest soon, are held and
 * moved. Coarse ones jump as links come on and off. */
void bd_circulation_look(bd_circulation *circulation, bd_sim *sim, const double *dy) {
  enum { MOST_MOVES = 60 };
  const double SOON = 60.0;
  bd_plan *plan = &sim->stepper.plan;
  const double force = bd_plan_circulation(plan, dy);
  if (plan->circulation_inertia_scale == 0.0 &&
      (circulation->moves > MOST_MOVES || !circulation->fine)) {
    bd_circulation_begin(circulation, sim); /* moved in vain */
    circulation->fine = 0;
  }
  if (!circulation->fine || given(sim) < SOON) {
    tune(circulation, sim, force);
    return;
  }
  if (circulation->moves == 0) {
    const double links =
        fabs(force) / (circulation->stiffness * sim->stepper.model->info.link_length);
    circulation->step = links < LONGEST ? links : LONGEST;
  }
  plan->circulation_damping = plan->mass_damping;
  plan->circulation_inertia_scale = 0.0;
  seek(circulation, sim, force);
}

/* What fails is tried again when half as much damping again has been given. */
int bd_circulation_ends(bd_circulation *c, bd_sim *sim, double tolerance) {
  const double damped = given(sim);
  if (damped < c->try_after) {
    return 0;
  }
  c->try_after = 1.5 * damped;
  return bd_find_equilibrium(sim, tolerance);
}
