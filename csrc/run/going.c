/* SPDX-License-Identifier: MIT
 *
 * A belt set going along itself, and the pulleys with it.
 */
#include <math.h>

#include "run/run.h"

/* A link that lies as a tangent turns its pulley by less than l0 / R. */
void bd_set_going(const bd_plan *plan, double *y, double speed) {
  const bd_model *model = plan->model;
  const double tension = bd_running_tension(model, speed), half = 0.5 * model->info.link_length;
  model->belt_model->set_going(plan, y, speed);
  for (int j = 0; j < model->lay.np; ++j) {
    const double a = model->belt_model->facts.tangents ? atan(half / model->radius[j]) : 0.0;
    y[model->lay.omega + j] = model->wraps[j].sense * speed * bd_slower_inside(a) /
                              bd_running_radius(model, j, tension, speed);
  }
  for (int body = model->lay.np + model->lay.nm; body < bd_count_bodies(&model->lay); ++body) {
    const bd_freedom f = bd_freedom_of(plan, body); /* turns with its pulley */
    y[f.speed] = y[model->lay.omega + f.pulley];
  }
}
