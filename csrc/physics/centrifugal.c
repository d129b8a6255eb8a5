/* SPDX-License-Identifier: MIT
 *
 * The belt running along itself, seen from its own pattern, which stands still: each link goes to
 * the place of the next within the time l0 / q, q the stress-free length that passes a point per
 * time. Its acceleration there is q^2 times the second difference of positions and angles over
 * l0^2, whose forces, with the opposite sign, are those of statics: tension less rho A q^2, the
 * same for all joints, so that nothing drives the belt round. Settling only.
 */
#include "physics/physics.h"

int bd_centrifugal_enabled(const bd_model *model, const bd_plan_options *options) {
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

int bd_centrifugal_rate(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_layout *lay = &plan->model->lay;
  const double links = plan->flow / plan->model->info.link_length, scale = links * links;
  add_differences(lay, bd_field(lay, y, F_X), 0.0, scale, bd_field(lay, dy, F_VX));
  add_differences(lay, bd_field(lay, y, F_Y), 0.0, scale, bd_field(lay, dy, F_VY));
  if (!lay->string) {
    add_differences(lay, bd_field(lay, y, F_PHI), plan->links.wind, scale,
                    bd_field(lay, dy, F_VPHI));
  }
  return BD_OK;
}
