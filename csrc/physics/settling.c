/* SPDX-License-Identifier: MIT
 *
 * Effects that a belt has while it settles alone (run/settle.c): centres that move in, the
 * centrifugal force of a belt that runs, damping in proportion to mass.
 */
#include "physics/physics.h"

/* --- moving centres --------------------------------------------------------------------------- */

static int moves_centres(const bd_model *model, const bd_plan_options *options) {
  (void)model;
  return options->offset != NULL;
}

static int pass_place(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)dy, (void)err;
  bd_plan_place(plan, t, y);
  return BD_OK;
}

const bd_effect bd_effect_moving_centres = {
    .name = "moving centres",
    .enabled = moves_centres,
    .rate = pass_place,
    .tangent = bd_tangent_none,
};

/* --- centrifugal force ------------------------------------------------------------------------ */

/* The belt running along itself, seen from its own pattern, which stands still: each link goes to
 * the place of the next within the time l0 / q, q the stress-free length that passes a point per
 * time. Its acceleration there is q^2 times the second difference of positions and angles over
 * l0^2, whose forces, with the opposite sign, are those of statics: tension less rho A q^2, the
 * same for all joints, so that nothing drives the belt round. */
static int belt_runs(const bd_model *model, const bd_plan_options *options) {
  (void)model;
  return options->flow != 0.0;
}

static void add_differences(const bd_layout *lay, const double *at, double closure, double scale,
                            double *to) {
  for (int i = 0; i < lay->n; ++i) {
    const double before = i > 0 ? at[i - 1] : at[lay->n - 1] - closure;
    const double after = i + 1 < lay->n ? at[i + 1] : at[0] + closure;
    to[i] -= scale * (after - 2.0 * at[i] + before);
  }
}

static int pass_centrifugal(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_layout *lay = &plan->model->lay;
  const double links = plan->flow / plan->model->info.link_length, scale = links * links;
  add_differences(lay, bd_field(lay, y, F_X), 0.0, scale, bd_field(lay, dy, F_VX));
  add_differences(lay, bd_field(lay, y, F_Y), 0.0, scale, bd_field(lay, dy, F_VY));
  if (bd_has_field(lay, F_PHI)) {
    add_differences(lay, bd_field(lay, y, F_PHI), plan->links.wind, scale,
                    bd_field(lay, dy, F_VPHI));
  }
  return BD_OK;
}

const bd_effect bd_effect_centrifugal = {
    .name = "centrifugal force",
    .enabled = belt_runs,
    .rate = pass_centrifugal,
    .tangent = bd_tangent_none, /* weaker than the tension, which is stiff enough for settling */
};

/* --- mass-proportional damping ---------------------------------------------------------------- */

static int has_mass_damping(const bd_model *model, const bd_plan_options *options) {
  (void)model;
  return options->mass_damping > 0.0;
}

/* Speed of circulation: of the belt along itself and of the pulleys that friction
 * turns with it; from the velocities in y, or from the accelerations if y is a rate. */
double bd_plan_circulation(const bd_plan *plan, const double *y) {
  const bd_layout *lay = &plan->model->lay;
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *co = plan->links.cos, *si = plan->links.sin;
  double sum = 0.0, mass = lay->n;
  for (int i = 0; i < lay->n; ++i) {
    sum += vx[i] * co[i] + vy[i] * si[i];
  }
  for (int j = 0; plan->friction_on && !plan->pulleys_locked && j < lay->np; ++j) {
    double r = plan->model->radius[j];
    double rim = plan->model->rim_inertia[j] / (r * r * plan->model->info.link_mass);
    sum += rim * y[lay->rim[j]] * r * plan->model->wraps[j].sense;
    mass += rim;
  }
  return sum / mass;
}

/* Dynamic relaxation: mass-proportional damping of every motion but circulation, in
 * which all links run along the belt at one speed v and turn at kappa v; circulation has a damping
 * and an inertia of its own. */
static int pass_mass_damping(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_layout *lay = &plan->model->lay;
  const int n = lay->n, bodies = lay->np + lay->nm + (plan->pulleys_locked ? 0 : lay->nc);
  const double *vx = bd_field(lay, y, F_VX), *vy = bd_field(lay, y, F_VY);
  const double *co = plan->links.cos, *si = plan->links.sin, wind = plan->links.wind;
  double *ax = bd_field(lay, dy, F_VX), *ay = bd_field(lay, dy, F_VY);
  const double mass_damping = plan->mass_damping, pitch = 4.0 * plan->links.half;
  const double circulation_correction =
      (mass_damping - plan->circulation_damping) * bd_plan_circulation(plan, y) +
      (plan->circulation_inertia_scale - 1.0) * bd_plan_circulation(plan, dy);
  for (int i = 0; i < n; ++i) {
    ax[i] -= mass_damping * vx[i] - circulation_correction * co[i];
    ay[i] -= mass_damping * vy[i] - circulation_correction * si[i];
  }
  if (bd_has_field(lay, F_PHI)) {
    const double *phi = bd_field(lay, y, F_PHI), *vphi = bd_field(lay, y, F_VPHI);
    double *aphi = bd_field(lay, dy, F_VPHI);
    for (int i = 0; i < n; ++i) {
      double turn = phi[i + 1 < n ? i + 1 : 0] - phi[i > 0 ? i - 1 : n - 1] +
                    (i == 0 || i + 1 == n ? wind : 0.0);
      aphi[i] -= mass_damping * vphi[i] - circulation_correction * turn / pitch;
    }
  }
  for (int body = plan->pulleys_locked ? lay->np : 0; body < bodies; ++body) {
    const bd_freedom f = bd_freedom_of(plan, body);
    const int circulates = plan->friction_on && f.speed == lay->rim[f.pulley];
    const double round =
        circulates ? plan->model->wraps[f.pulley].sense / plan->model->radius[f.pulley] : 0.0;
    dy[f.speed] -= mass_damping * y[f.speed] - circulation_correction * round;
  }
  return BD_OK;
}

/* Of the damping alone: circulation, which it exempts, ties every link to every other. */
static void tangent_mass_damping(const bd_plan *plan, const double *y, bd_derivatives *out) {
  (void)y;
  out->mass_damping = plan->mass_damping;
}

const bd_effect bd_effect_mass_damping = {
    .name = "mass-proportional damping",
    .enabled = has_mass_damping,
    .rate = pass_mass_damping,
    .tangent = tangent_mass_damping,
};
