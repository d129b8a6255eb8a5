/* SPDX-License-Identifier: MIT
 *
 * Rigid links that meet the pulleys along their length, with friction at their joints and their
 * mass at their ends (MODEL section 3, mesh "joint").
 */
#include <math.h>

#include "belts/belts.h"

static double nearer_end(const bd_model *model, const bd_state *state, int i,
                         const double point[2]) {
  const double half = 0.5 * model->info.link_length;
  const double dx = state->x[i] - point[0], dy = state->y[i] - point[1];
  const double ex = half * cos(state->phi[i]), ey = half * sin(state->phi[i]);
  return fmin(hypot(dx - ex, dy - ey), hypot(dx + ex, dy + ey));
}

/* Any end of the two links that meet at the joint. */
static double distance(const bd_model *model, const bd_state *state, int i, const double point[2]) {
  return fmin(nearer_end(model, state, i, point),
              nearer_end(model, state, i > 0 ? i - 1 : model->lay.n - 1, point));
}

/* Links with their ends on the circles of contact. */
static void lay(const bd_model *model, const bd_route *line, double shift, double *x, double *y,
                double *phi) {
  for (int i = 0; i < model->lay.n; ++i) {
    const bd_chord at = bd_line_chord(model, line, shift, i, &phi[i]);
    x[i] = 0.5 * (at.x0 + at.x1);
    y[i] = 0.5 * (at.y0 + at.y1);
  }
}

/* From directions as last evaluated; the halo of y is set. */
static void contact_begin(bd_plan *plan, double *y) {
  const bd_layout *layout = &plan->model->lay;
  const bd_links *links = &plan->links;
  bd_along_clear(plan);
  if (plan->friction_on) {
    bd_close_links(layout, y);
    links->cos[-1] = links->cos[layout->n - 1];
    links->sin[-1] = links->sin[layout->n - 1];
    plan->kernels->gather_points(links, links->cos, links->sin, y, &plan->points);
  }
}

static void contact(bd_plan *plan, int j, double *y, double *dy, bd_sums *sums) {
  const bd_kernels *kernels = plan->kernels;
  const bd_contact_pulley *pulley = &plan->contact_pulleys[j];
  const int n_runs = plan->search.n_runs[j], power = !plan->skip_power;
  const int on_mount = plan->model->mount_of && plan->model->mount_of[j] >= 0;
  const bd_run *runs = bd_runs_of(plan, j);
  double before[2], after[2];
  if (on_mount) {
    kernels->sum_forces(n_runs, runs, &plan->forces, before);
  }
  kernels->add_normal_forces[power](&plan->links, pulley, n_runs, runs, &plan->pressure,
                                    &plan->forces, y, sums);
  if (pulley->law != BD_LAW_NONE) {
    kernels->add_friction[pulley->law][power](&plan->links, pulley, n_runs, runs, &plan->points,
                                              &plan->pressure, &plan->forces, y, dy, sums);
  }
  if (on_mount) {
    kernels->sum_forces(n_runs, runs, &plan->forces, after);
    sums->force[0] = after[0] - before[0];
    sums->force[1] = after[1] - before[1];
  }
}

static void contact_end(bd_plan *plan, double *dy) {
  const bd_links *links = &plan->links;
  plan->kernels->scatter_forces(links, links->cos, links->sin, &plan->forces, dy);
}

/* Friction acts at the mean of the two ends that meet at a joint. */
static void contact_at(const bd_plan *plan, const double *y, int j, bd_touch *out, double force[2],
                       double *energy) {
  const bd_layout *layout = &plan->model->lay;
  const double *x = bd_cfield(layout, y, F_X), *z = bd_cfield(layout, y, F_Y);
  const double *vx = bd_cfield(layout, y, F_VX), *vz = bd_cfield(layout, y, F_VY);
  const double *w = bd_cfield(layout, y, F_VPHI), q = 0.5 * plan->links.half;
  bd_along_contact_at(plan, y, j, out, force, energy);
  for (int r = 0, i = -1; (i = bd_next_near(plan, j, &r, i)) >= 0;) {
    const int l = i > 0 ? i - 1 : layout->n - 1;
    const double c = plan->seen.cos[i], s = plan->seen.sin[i];
    const double cl = plan->seen.cos[l], sl = plan->seen.sin[l];
    out[i].x = 0.5 * (x[l] + x[i]) + q * (cl - c);
    out[i].y = 0.5 * (z[l] + z[i]) + q * (sl - s);
    out[i].vx = 0.5 * (vx[l] + vx[i]) + q * (w[i] * s - w[l] * sl);
    out[i].vy = 0.5 * (vz[l] + vz[i]) + q * (w[l] * cl - w[i] * c);
  }
}

const bd_belt_model bd_belt_joint = {
    .facts = {BD_FACTS_OF_LINKS, BD_FACTS_ALONG, .name = "joint",
              .text = "rigid links that meet the pulleys along their length", .at_joints = 1},
    BD_LINKS,
    BD_ALONG,
    .distance = distance,
    .lay = lay,
    .contact_begin = contact_begin,
    .contact = contact,
    .contact_end = contact_end,
    .contact_at = contact_at,
};
