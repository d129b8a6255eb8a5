/* SPDX-License-Identifier: MIT
 *
 * Belts whose nodes are masses that move with it, links or points: what is summed over them.
 */
#include "belts/belts.h"

double bd_nodes_joints(bd_plan *plan, double *y, double *dy) {
  return plan->kernels->joints[plan->bending_on][!plan->skip_power](&plan->links, y, dy);
}

void bd_nodes_fall(const bd_plan *plan, double *dy) {
  const bd_layout *lay = &plan->model->lay;
  double *ax = bd_field(lay, dy, F_VX), *ay = bd_field(lay, dy, F_VY);
  const double gx = plan->model->gravity[0], gy = plan->model->gravity[1];
  for (int i = 0; i < lay->n; ++i) {
    ax[i] += gx;
    ay[i] += gy;
  }
}

void bd_nodes_energy(const bd_plan *plan, const double *y, const bd_joint *joints,
                     double terms[restrict BD_N_ENERGY]) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *w = bd_find_field(lay, y, F_VPHI);
  const double m = model->info.link_mass, inertia = model->info.link_inertia;
  for (int i = 0; i < lay->n; ++i) {
    const double spin = w ? w[i] : 0.0;
    terms[BD_ENERGY_kinetic] +=
        0.5 * m * (vx[i] * vx[i] + vy[i] * vy[i]) + 0.5 * inertia * spin * spin;
    terms[BD_ENERGY_axial] += 0.5 * plan->links.stiffness * joints[i].squared;
    terms[BD_ENERGY_bending] += 0.5 * plan->links.bending * joints[i].turn * joints[i].turn;
    terms[BD_ENERGY_gravity] -= m * (model->gravity[0] * (x[i] + model->origin[0]) +
                                     model->gravity[1] * (yy[i] + model->origin[1]));
  }
}

/* Of the polygon: crossings of the ray to the right of the axis (D. Sunday, "Inclusion of a point
 * in a polygon", 2001). */
int bd_nodes_turns(const bd_plan *plan, const double *y, int j) {
  const bd_layout *lay = &plan->model->lay;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double cx = plan->contact_pulleys[j].x, cy = plan->contact_pulleys[j].y;
  int turns = 0;
  for (int i = 0, l = lay->n - 1; i < lay->n; l = i++) {
    double left = (x[l] - cx) * (yy[i] - cy) - (x[i] - cx) * (yy[l] - cy);
    turns += yy[l] <= cy && yy[i] > cy && left > 0.0;
    turns -= yy[l] > cy && yy[i] <= cy && left < 0.0;
  }
  return turns;
}
