/* SPDX-License-Identifier: MIT
 *
 * Where forces balance: what is left of them, and Newton's method for where nothing is.
 *
 * Dynamic relaxation leaves slow motions last: a belt without friction slides round its pulleys
 * against next to no force, links creep where a soft contact, or a damper, holds them. Of the first
 * kind are belts whose wraps are whole numbers of links apart, as on equal pulleys in a triangle,
 * near the place where the polygon of links resists least; no damping is right for them, since what
 * moves is neither the belt alone nor known beforehand. Newton's method does not care how slow a
 * motion is.
 *
 * Its steps are those of the linearly implicit Euler method, from rest,
 *
 *   (M (1 + beta h) + h^2 K) d = h^2 F,
 *
 * which go along the force while h is short and are Newton's where it is long. h grows with every
 * step that is taken: all that go with the force, so that none ends on the ridge between two places
 * of rest, and move no link farther than linearising allows. Residuals may rise meanwhile: a step
 * along a pulley is straight, and the next one presses the link back on to its circle.
 */
#include <math.h>
#include <string.h>

#include "run/run.h"

double bd_stop(const bd_sim *sim, double *y) {
  const bd_layout *lay = &sim->stepper.model->lay;
  double fastest = 0.0;
  for (int f = F_VX; f <= F_VPHI; ++f) {
    if (!bd_has_field(lay, f)) {
      continue;
    }
    double *v = bd_field(lay, y, f), arm = f == F_VPHI ? sim->stepper.plan.links.half : 1.0;
    for (int i = 0; i < lay->n; ++i) {
      fastest = fmax(fastest, arm * fabs(v[i]));
      v[i] = 0.0;
    }
  }
  for (int body = 0; body < bd_count_bodies(lay); ++body) {
    const bd_freedom f = bd_freedom_of(&sim->stepper.plan, body);
    fastest = fmax(fastest, f.arm * fabs(y[f.speed]));
    y[f.speed] = 0.0;
  }
  return fastest;
}

double bd_unbalanced(const bd_sim *sim, const double *dy) {
  const bd_model *model = sim->stepper.model;
  const bd_layout *lay = &model->lay;
  const bd_info *info = &model->info;
  const double *spin = bd_find_field(lay, dy, F_VPHI);
  double worst = 0.0;
  for (int i = 0; i < lay->n; ++i) {
    double fx = bd_cfield(lay, dy, F_VX)[i], fy = bd_cfield(lay, dy, F_VY)[i];
    double turning = spin ? spin[i] : 0.0;
    worst = fmax(worst, info->link_mass * hypot(fx, fy));
    worst = fmax(worst, info->link_inertia * fabs(turning) / (0.5 * info->link_length));
  }
  for (int body = 0; body < bd_count_bodies(lay); ++body) {
    const bd_freedom f = bd_freedom_of(&sim->stepper.plan, body);
    worst = fmax(worst, f.inertia * fabs(dy[f.speed]) / f.arm);
  }
  return worst / info->strain_tension;
}

/* Work of the forces that make these rates, along d; *far: the farthest that d moves a link. */
static double work_along(const bd_sim *sim, const double *dy, const double *d, double *far) {
  const bd_model *model = sim->stepper.model;
  const bd_layout *lay = &model->lay;
  const double *dx = bd_cfield(lay, d, F_X), *dz = bd_cfield(lay, d, F_Y);
  const double *ax = bd_cfield(lay, dy, F_VX), *az = bd_cfield(lay, dy, F_VY);
  double work = 0.0, square = 0.0;
  for (int i = 0; i < lay->n; ++i) {
    work += model->info.link_mass * (ax[i] * dx[i] + az[i] * dz[i]);
    square = fmax(square, dx[i] * dx[i] + dz[i] * dz[i]);
  }
  for (int i = 0; bd_has_field(lay, F_PHI) && i < lay->n; ++i) {
    work += model->info.link_inertia * bd_cfield(lay, dy, F_VPHI)[i] * bd_cfield(lay, d, F_PHI)[i];
  }
  for (int body = 0; body < bd_count_bodies(lay); ++body) {
    const bd_freedom f = bd_freedom_of(&sim->stepper.plan, body);
    work += f.inertia * dy[f.speed] * d[f.place];
  }
  *far = sqrt(square);
  return work;
}

/* Rates, of links at rest, with all that may touch a pulley listed anew; returns what is
 * unbalanced, NaN or infinite where a number is. */
static double forces(bd_sim *sim, double *y, double *dy, int *code) {
  bd_stepper *stepper = &sim->stepper;
  bd_stop(sim, y);
  stepper->plan.search.travelled = (double)INFINITY;
  bd_search_ready(&stepper->plan, y, 0.0);
  *code = bd_stepper_rate(stepper, stepper->t, y, dy);
  return bd_unbalanced(sim, dy);
}

static void swap(double **a, double **b) {
  double *before = *a;
  *a = *b;
  *b = before;
}

/* One step, adopted or not; 1: adopted. */
static int step(bd_sim *sim, double h, double *residual, int *code) {
  const double FARTHEST = 0.125; /* of a link */
  bd_stepper *stepper = &sim->stepper;
  double error, far, left = NAN;
  *code = stepper->now->attempt(stepper, h, &error);
  const double work = work_along(sim, stepper->stage[0], stepper->stage[1], &far);
  const double links = far / stepper->model->info.link_length;
  if (*code == BD_OK && isfinite(error) && work > 0.0 && links < FARTHEST) {
    left = forces(sim, stepper->y_new, stepper->stage[2], code);
  }
  if (*code != BD_OK || !isfinite(left)) {
    ++sim->stats.rejected;
    return 0;
  }
  ++sim->stats.steps;
  swap(&stepper->y, &stepper->y_new);
  swap(&stepper->stage[0], &stepper->stage[2]);
  stepper->jacobian_known = 0;
  *residual = left;
  return 1;
}

/* h begins with what damping takes, where steps go along the force, and need not be shorter than a
 * thousandth of it: there relaxation does as well. */
int bd_find_equilibrium(bd_sim *sim, double tolerance) {
  enum { MOST_STEPS = 100 };
  const double GROWTH = 4.0, MOST_GROWTH = 1e3, SHRINK = 0.1, SHORTEST = 1e-3, LONGEST = 1e10;
  bd_stepper *stepper = &sim->stepper;
  bd_plan *plan = &stepper->plan;
  const size_t bytes = stepper->model->lay.size * sizeof *stepper->y;
  const double inertia = plan->circulation_inertia_scale, damping = plan->circulation_damping;
  const double time = 1.0 / plan->mass_damping;
  double *before = stepper->history[0], h = time;
  int code;
  memcpy(before, stepper->y, bytes);
  plan->circulation_inertia_scale = 1.0; /* the true forces */
  plan->circulation_damping = plan->mass_damping;
  stepper->now = bd_method_find("lie");
  stepper->n_history = 0;
  double residual = forces(sim, stepper->y, stepper->stage[0], &code);
  stepper->rate_known = 1;
  stepper->jacobian_known = 0;
  for (int k = 0; code == BD_OK && residual > tolerance && k < MOST_STEPS; ++k) {
    const double was = residual;
    if (step(sim, h, &residual, &code)) {
      h = fmin(LONGEST * time, h * fmin(MOST_GROWTH, fmax(GROWTH, was / residual)));
    } else if ((h *= SHRINK) < SHORTEST * time) {
      break;
    }
  }
  const int found = code == BD_OK && residual <= tolerance;
  if (!found) {
    memcpy(stepper->y, before, bytes);
  }
  plan->circulation_inertia_scale = inertia;
  plan->circulation_damping = damping;
  plan->search.travelled = (double)INFINITY;
  stepper->now = stepper->method;
  stepper->rate_known = stepper->jacobian_known = 0;
  return found;
}
