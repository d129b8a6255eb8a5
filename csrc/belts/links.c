/* SPDX-License-Identifier: MIT
 *
 * Belts of rigid links (MODEL section 2), wherever they meet their pulleys.
 */
#include <math.h>

#include "belts/belts.h"

/* Along the mean direction of the two links of a joint. */
void bd_links_joints_at(const bd_plan *plan, const double *y, const double *co, const double *si,
                        bd_joint *out) {
  const bd_layout *lay = &plan->model->lay;
  const double half = plan->links.half;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *phi = bd_cfield(lay, y, F_PHI), *w = bd_cfield(lay, y, F_VPHI);
  int l = lay->n - 1;
  double cl = co ? co[l] : cos(phi[l]), sl = si ? si[l] : sin(phi[l]);
  for (int i = 0; i < lay->n; l = i++) {
    const double ci = co ? co[i] : cos(phi[i]), s = si ? si[i] : sin(phi[i]);
    const double dx = x[i] - x[l] - half * (ci + cl), dy = yy[i] - yy[l] - half * (s + sl);
    const double du = vx[i] - vx[l] + half * (s * w[i] + sl * w[l]);
    const double dv = vy[i] - vy[l] - half * (ci * w[i] + cl * w[l]);
    double ex = ci + cl, ey = s + sl, norm = hypot(ex, ey);
    /* two links folded back on each other have no mean direction; take the right one's */
    ex = norm > 1e-12 ? ex / norm : ci;
    ey = norm > 1e-12 ? ey / norm : s;
    const double along = dx * ex + dy * ey, rate = du * ex + dv * ey;
    out[i] = (bd_joint){.along = along,
                        .squared = dx * dx + dy * dy,
                        .turn = phi[i] - phi[l] + (i > 0 ? 0.0 : plan->links.wind),
                        .force = plan->links.stiffness * along + plan->links.damping * rate};
    cl = ci;
    sl = s;
  }
}

void bd_links_direction(const bd_layout *lay, const double *y, int i, double e[2]) {
  e[0] = cos(bd_cfield(lay, y, F_PHI)[i]);
  e[1] = sin(bd_cfield(lay, y, F_PHI)[i]);
}

double bd_links_stretch_difference(const bd_plan *plan, const double *y, const bd_plan *other,
                                   const double *v) {
  const bd_layout *lay = &plan->model->lay;
  const double half = plan->links.half;
  const double *x = bd_cfield(lay, y, F_X), *z = bd_cfield(lay, y, F_Y);
  const double *xv = bd_cfield(lay, v, F_X), *zv = bd_cfield(lay, v, F_Y);
  const double *co = plan->links.cos, *si = plan->links.sin;
  const double *cv = other->links.cos, *sv = other->links.sin;
  double sum = 0.0;
  for (int i = 0, l = lay->n - 1; i < lay->n; l = i++) {
    double dx = (xv[i] - x[i]) - (xv[l] - x[l]) - half * (cv[i] - co[i] + cv[l] - co[l]);
    double dy = (zv[i] - z[i]) - (zv[l] - z[l]) - half * (sv[i] - si[i] + sv[l] - si[l]);
    sum += dx * dx + dy * dy;
  }
  return sum;
}

/* Links run along themselves and turn, within the time of one link, from the direction of the one
 * before to that of the one after. */
void bd_links_set_going(const bd_plan *plan, double *y, double speed) {
  const bd_layout *lay = &plan->model->lay;
  const double wind = plan->links.wind, pitch = 2.0 * plan->model->info.link_length;
  const double *phi = bd_field(lay, y, F_PHI);
  double *vx = bd_field(lay, y, F_VX), *vy = bd_field(lay, y, F_VY);
  double *vphi = bd_field(lay, y, F_VPHI);
  for (int i = 0; i < lay->n; ++i) {
    const double before = i > 0 ? phi[i - 1] : phi[lay->n - 1] - wind;
    const double after = i + 1 < lay->n ? phi[i + 1] : phi[0] + wind;
    const double along = speed * bd_slower_inside(0.25 * (after - before));
    vx[i] = along * cos(phi[i]);
    vy[i] = along * sin(phi[i]);
    vphi[i] = speed * (after - before) / pitch;
  }
}
