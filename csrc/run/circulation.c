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
 * nearly all have come to rest by then. With friction Newton's method would decide what is held. */
void bd_circulation_begin(bd_circulation *circulation, bd_sim *sim) {
  const double FINE = 0.1; /* angle of a link on its pulley */
  const double SOON = 30.0, LATE = 1000.0;
  bd_plan *plan = &sim->stepper.plan;
  const bd_model *model = sim->stepper.model;
  const int fine =
      sim->stepper.method->implicit && model->info.link_length < FINE * bd_tightest_radius(model);
  const int can = !plan->grip_on && bd_newton_check(plan, "lie", NULL) == BD_OK;
  *circulation = (bd_circulation){.try_after = !can ? (double)INFINITY : fine ? SOON : LATE};
  plan->circulation_damping = 0.0;
  plan->circulation_inertia_scale = 1.0;
}

/* Damping, times the time since centres have come to their places: motions at the pace of the
 * slowest that is damped critically have fallen by exp(given / 2). */
static double given(const bd_plan *plan, double t) {
  return (t - plan->move_time) * plan->mass_damping;
}

/* The stiffness is measured, from how the force along the belt changes with the distance travelled
 * since the last look, and circulation is given the inertia and damping that bring it to rest as
 * fast as the slowest of the other motions allows. A change of these changes the force at once,
 * which passes for stiffness and brings the next change: where that goes on, they are held until it
 * has died down. */
void bd_circulation_look(bd_circulation *c, bd_sim *sim, const double *dy) {
  enum { HELD = 16 };
  bd_plan *plan = &sim->stepper.plan;
  const double force = bd_plan_circulation(plan, dy);
  const double speed = bd_plan_circulation(plan, sim->stepper.y);
  const double travel = 0.5 * (speed + c->speed) * (sim->stepper.t - c->time);
  const double held_after = sim->stepper.method->implicit ? 2500.0 : 500.0;
  const double damped = given(plan, sim->stepper.t);
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

/* What fails is tried again when half as much damping again has been given. */
int bd_circulation_ends(bd_circulation *c, bd_sim *sim, double tolerance) {
  const double damped = given(&sim->stepper.plan, sim->stepper.t);
  if (damped < c->try_after) {
    return 0;
  }
  c->try_after = 1.5 * damped;
  return bd_find_equilibrium(sim, tolerance);
}
