/* SPDX-License-Identifier: MIT
 *
 * The paper's belt (MODEL sections 2, 3): rigid links, whose centres meet the pulleys.
 */
#include <math.h>

#include "belts/belts.h"

static double distance(const bd_model *model, const bd_state *state, int i, const double point[2]) {
  (void)model;
  return hypot(state->x[i] - point[0], state->y[i] - point[1]);
}

static void lay(const bd_model *model, const bd_route *line, double shift, double *x, double *y,
                double *phi) {
  for (int i = 0; i < model->lay.n; ++i) {
    bd_line_point(model, line, model->radius, i + 0.5, shift, &x[i], &y[i], &phi[i]);
  }
}

static void distances(const bd_plan *plan, const double *y, int j, int begin, int end,
                      double *out) {
  const bd_layout *layout = &plan->model->lay;
  const double *x = bd_cfield(layout, y, F_X), *z = bd_cfield(layout, y, F_Y);
  for (int i = begin; i < end; ++i) {
    const double dx = x[i] - plan->contact_pulleys[j].x, dy = z[i] - plan->contact_pulleys[j].y;
    out[i - begin] = dx * dx + dy * dy;
  }
}

static double stored_by(const bd_contact_pulley *d, double p) {
  return p * p * (d->quadratic * p / 3.0 + d->linear / 2.0);
}

static void contact_at(const bd_plan *plan, const double *y, int j, bd_touch *out, double force[2],
                       double *energy) {
  const bd_layout *layout = &plan->model->lay;
  const bd_contact_pulley *d = &plan->contact_pulleys[j];
  const double *x = bd_cfield(layout, y, F_X), *z = bd_cfield(layout, y, F_Y);
  const double *vx = bd_cfield(layout, y, F_VX), *vz = bd_cfield(layout, y, F_VY);
  force[0] = force[1] = 0.0;
  for (int r = 0, i = -1; (i = bd_next_near(plan, j, &r, i)) >= 0;) {
    const double dx = x[i] - d->x, dy = z[i] - d->y, rho = hypot(dx, dy), p = d->radius - rho;
    const double apart = (vx[i] - d->vx) * (dx / rho) + (vz[i] - d->vy) * (dy / rho);
    const double elastic = (d->quadratic * p + d->linear) * p;
    const double raw = elastic - (d->damping + d->hunt_crossley * elastic) * apart;
    const double normal = raw > 0.0 && p > 0.0 ? raw : 0.0;
    out[i] = (bd_touch){x[i], z[i], vx[i], vz[i], p > 0.0 ? 1.0 : 0.0, normal, normal, normal};
    if (p > 0.0) {
      *energy += stored_by(d, p);
    }
  }
}

/* Without a root where nothing touches. */
static int contact_energy(const bd_plan *plan, const double *y, int j, double *energy) {
  const bd_layout *layout = &plan->model->lay;
  const bd_contact_pulley *d = &plan->contact_pulleys[j];
  const double *x = bd_cfield(layout, y, F_X), *z = bd_cfield(layout, y, F_Y);
  int touched = 0;
  for (int r = 0, i = -1; (i = bd_next_near(plan, j, &r, i)) >= 0;) {
    const double dx = x[i] - d->x, dy = z[i] - d->y, rho2 = dx * dx + dy * dy;
    if (rho2 < d->radius * d->radius) {
      *energy += stored_by(d, d->radius - sqrt(rho2));
      touched = 1;
    }
  }
  return touched;
}

const bd_belt_model bd_belt_paper = {
    .facts = {BD_FACTS_OF_LINKS, .name = "paper",
              .text = "rigid links that meet the pulleys at their centres",
              .note = "The mesh is the paper's, kept to reproduce it; mesh=\"joint\" has no such "
                      "error",
              .mesh = BD_MESH_PAPER, .tangents = 1, .shear = 12.0, .error_by_local = 1.0,
              .error_by_balance = 5.0, .implicit_cost = 7.0},
    BD_LINKS,
    .distance = distance,
    .lay = lay,
    .contact = bd_contact_in_one_pass,
    .distances = distances,
    .contact_at = contact_at,
    .contact_energy = contact_energy,
};
