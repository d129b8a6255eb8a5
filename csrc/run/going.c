/* SPDX-License-Identifier: MIT
 *
 * A belt set going along itself, and the pulleys with it.
 */
#include <math.h>

#include "run/run.h"

/* Of a polygon whose links turn by 2 a each: the speed of their centres, as it turns about the axis
 * of its pulley, over that of a straight span. */
static double slower_inside(double a) {
  return fabs(a) > 1e-6 ? a / tan(a) : 1.0;
}

/* Links run along themselves and turn, within the time of one link, from the direction of the one
 * before to that of the one after. */
static void set_links_going(const bd_plan *plan, double *y, double speed) {
  const bd_layout *lay = &plan->model->lay;
  const double wind = plan->links.wind, pitch = 2.0 * plan->model->info.link_length;
  const double *phi = bd_field(lay, y, F_PHI);
  double *vx = bd_field(lay, y, F_VX), *vy = bd_field(lay, y, F_VY);
  double *vphi = bd_field(lay, y, F_VPHI);
  for (int i = 0; i < lay->n; ++i) {
    const double before = i > 0 ? phi[i - 1] : phi[lay->n - 1] - wind;
    const double after = i + 1 < lay->n ? phi[i + 1] : phi[0] + wind;
    const double along = speed * slower_inside(0.25 * (after - before));
    vx[i] = along * cos(phi[i]);
    vy[i] = along * sin(phi[i]);
    vphi[i] = speed * (after - before) / pitch;
  }
}

/* Masses of a string run towards where the next one stands, each in the time of one bar. On a
 * circle, where bars turn by 2 a, they are faster than a straight span by a / sin a. */
static void set_masses_going(const bd_plan *plan, double *y, double speed) {
  const bd_layout *lay = &plan->model->lay;
  const double *x = bd_field(lay, y, F_X), *yy = bd_field(lay, y, F_Y);
  double *vx = bd_field(lay, y, F_VX), *vy = bd_field(lay, y, F_VY);
  for (int i = 0; i < lay->n; ++i) {
    const int before = i > 0 ? i - 1 : lay->n - 1, after = i + 1 < lay->n ? i + 1 : 0;
    const double ax = x[i] - x[before], ay = yy[i] - yy[before];
    const double bx = x[after] - x[i], by = yy[after] - yy[i];
    const double a = 0.5 * atan2(ax * by - ay * bx, ax * bx + ay * by);
    const double faster = fabs(a) > 1e-6 ? a / sin(a) : 1.0;
    const double chord = hypot(ax + bx, ay + by);
    vx[i] = speed * faster * (ax + bx) / chord;
    vy[i] = speed * faster * (ay + by) / chord;
  }
}

/* A link of the paper's mesh is the tangent of a circle and turns it by less than l0 / R. */
void bd_set_going(const bd_plan *plan, double *y, double speed) {
  const bd_model *model = plan->model;
  const double tension = bd_running_tension(model, speed), half = 0.5 * model->info.link_length;
  if (model->lay.string) {
    set_masses_going(plan, y, speed);
  } else {
    set_links_going(plan, y, speed);
  }
  for (int j = 0; j < model->lay.np; ++j) {
    const double a = model->along_links ? 0.0 : atan(half / model->radius[j]);
    y[model->lay.omega + j] = model->wraps[j].sense * speed * slower_inside(a) /
                              bd_running_radius(model, j, tension, speed);
  }
  for (int c = 0; c < model->lay.nc; ++c) {
    y[model->lay.rim_speed + c] = y[model->lay.omega + model->lay.coupled[c]];
  }
}
