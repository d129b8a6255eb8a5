/* SPDX-License-Identifier: MIT
 *
 * Couplings between shafts and rims (MODEL section 5), and their part in the linear systems
 * (newton_system.c): a rim with a coupling is one more body of one degree of freedom, after shafts
 * and mounts, and its windup is eliminated,
 *
 *   k_z = g c_z + g s (k_rim - k_shaft) engaged,    k_z = g c_z / (1 + g k / d) released.
 */
#include <math.h>

#include "physics/physics.h"

static int enabled(const bd_model *model, const bd_plan_options *options) {
  return model->lay.nc > 0 && !options->hold_pulleys;
}

static const char *label(const bd_plan *plan) {
  const bd_coupled *couplings = plan->model->couplings;
  for (int c = 1; c < plan->model->lay.nc; ++c) {
    if (couplings[c].row != couplings[0].row) {
      return "couplings of shafts and rims: of several kinds";
    }
  }
  return couplings[0].row->label;
}

/* While a belt settles no torque acts on a hub, so that none is transmitted in the end, and until
 * then swings of hubs would only delay it. */
static bd_coupling_state coupling_at(const bd_plan *plan, const double *y, int c) {
  return plan->mass_damping > 0.0 ? (bd_coupling_state){0} : bd_coupling_at(plan->model, y, c);
}

/* After the pass of the pulleys. */
static int rate(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  double loss = 0.0;
  for (int c = 0; c < lay->nc; ++c) {
    const bd_coupled *k = &model->couplings[c];
    const bd_coupling_state at = coupling_at(plan, y, c);
    const int j = k->pulley;
    const double belt = bd_runs_on_shaft(lay, j) ? 0.0 : plan->friction[j];
    dy[lay->rim_angle + c] = y[lay->rim_speed + c];
    dy[lay->rim_speed + c] = (belt - k->sense * at.torque) / k->inertia;
    dy[lay->omega + j] += k->sense * at.torque / model->inertia[j];
    dy[lay->windup + c] = at.winds;
    loss += k->damping * at.winds * at.winds;
  }
  dy[lay->work + W_coupling_loss] = loss;
  return BD_OK;
}

static void carve_tangent(bd_carver *carver, bd_derivatives *out, const bd_model *model) {
  BD_CARVE(carver, out->couplings, model->lay.nc);
}

static void tangent(const bd_plan *plan, const double *y, bd_derivatives *out) {
  for (int c = 0; c < plan->model->lay.nc; ++c) {
    const bd_coupled *k = &plan->model->couplings[c];
    if (plan->mass_damping > 0.0) {
      out->couplings[c] = (bd_coupling_tangent){0};
      continue;
    }
    out->couplings[c] = bd_coupling_at(plan->model, y, c).engaged
                            ? (bd_coupling_tangent){.stiffness = k->stiffness,
                                                    .damping = k->damping,
                                                    .winds = k->sense}
                            : (bd_coupling_tangent){.decay = k->stiffness / k->damping};
  }
}

/* Of a clutch that has come free, to what its rollers are: a windup is never negative. */
static int after_step(bd_plan *plan, double t, double *y, double tolerance, int *changed,
                      bd_error *err) {
  (void)t, (void)err;
  const bd_model *model = plan->model;
  for (int c = 0; c < model->lay.nc; ++c) {
    double *z = &y[model->lay.windup + c];
    if (model->couplings[c].row->one_way && *z < 0.0) {
      *changed |= -*z > tolerance * bd_state_scale(model, F_WINDUP, c);
      *z = 0.0;
    }
  }
  return BD_OK;
}

static void energy(const bd_plan *plan, const double *y, double terms[BD_N_ENERGY]) {
  const bd_layout *lay = &plan->model->lay;
  for (int c = 0; c < lay->nc; ++c) {
    const bd_coupled *k = &plan->model->couplings[c];
    const double z = y[lay->windup + c], speed = y[lay->rim_speed + c];
    terms[BD_ENERGY_kinetic] += 0.5 * k->inertia * speed * speed;
    terms[BD_ENERGY_coupling] += 0.5 * k->stiffness * z * z;
  }
}

static void outputs(bd_plan *plan, const double *y, const bd_output *out, size_t k) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  for (int c = 0; c < lay->nc; ++c) {
    const double z = y[lay->windup + c]; /* between steps it is interpolated */
    const size_t at = k * (size_t)lay->nc + (size_t)c;
    bd_put(out->windup, at, model->couplings[c].row->one_way ? fmax(0.0, z) : z);
    bd_put(out->transmitted, at, model->couplings[c].sense * bd_coupling_at(model, y, c).torque);
  }
}

/* What a linear system with g leaves out of the speeds at clutch c, which has engaged or come free
 * between y and y_new [rad/s]. */
static double off_line(const bd_plan *plan, const double *y, const double *y_new, int c, double g) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const bd_coupled *k = &model->couplings[c];
  if (!k->row->one_way) {
    return 0.0;
  }
  const bd_coupling_state before = bd_coupling_at(model, y, c),
                          after = bd_coupling_at(model, y_new, c);
  const double line = k->stiffness * (y_new[lay->windup + c] - y[lay->windup + c]) +
                      k->damping * (after.ahead - before.ahead);
  const double off = after.torque - before.torque - (before.engaged ? line : 0.0);
  const double stiff = g * (g * k->stiffness + k->damping);
  const double lighter = fmin(model->inertia[k->pulley], k->inertia);
  return g * off / (lighter + (after.engaged ? stiff : 0.0));
}

static double unseen(const bd_plan *plan, const bd_step *step) {
  double most = 0.0;
  for (int c = 0; c < plan->model->lay.nc; ++c) {
    const double faster = off_line(plan, step->y, step->y_new, c, step->g);
    most = fmax(most, step->weights[plan->model->lay.rim_speed + c] * fabs(faster));
  }
  return most;
}

static void stiffness(bd_stiffening *at) {
  const bd_model *model = at->model;
  for (int c = 0; c < model->lay.nc; ++c) {
    const bd_coupled *k = &model->couplings[c];
    const double light = 1.0 / k->inertia + 1.0 / at->inertia;
    if (k->pulley == at->pulley) {
      bd_stiffen(at, BD_STIFF_OWN, "a very stiff coupling", k->stiffness * light,
                 k->damping * light, k->row->one_way ? k->stiffness / k->damping : 0.0);
    }
  }
}

static double on_shaft(const bd_plan *plan, const double *y, int j) {
  const bd_model *model = plan->model;
  double sum = 0.0;
  for (int c = 0; c < model->lay.nc; ++c) {
    if (model->couplings[c].pulley == j) {
      sum += model->couplings[c].sense * bd_coupling_at(model, y, c).torque;
    }
  }
  return sum;
}

/* At rest no torque goes through a coupling. */
static void rest(const bd_plan *plan, double *y) {
  for (int c = 0; c < plan->model->lay.nc; ++c) {
    y[plan->model->lay.windup + c] = 0.0;
  }
}

/* --- in the linear systems -------------------------------------------------------------------- */

static void entries(const bd_plan *plan, const bd_derivatives *at, double g, int n, double *w) {
  const bd_layout *lay = &plan->model->lay;
  for (int c = 0; c < lay->nc; ++c) {
    const int shaft = lay->coupled[c], rim = bd_rim_body(lay, c);
    const double between = g * (g * at->couplings[c].stiffness + at->couplings[c].damping);
    w[shaft * n + shaft] += between;
    w[rim * n + rim] += between;
    w[shaft * n + rim] -= between;
    w[rim * n + shaft] -= between;
  }
}

static void product(const bd_plan *plan, const bd_derivatives *at, double g, const double *y,
                    double *rhs, double *off) {
  (void)off;
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  for (int c = 0; c < lay->nc; ++c) {
    const bd_coupled *k = &model->couplings[c];
    const double torque = g * g * at->couplings[c].stiffness * k->sense * y[lay->windup + c];
    rhs[k->pulley] += torque;
    rhs[bd_rim_body(lay, c)] += g * k->inertia * y[lay->rim_speed + c] - torque;
  }
}

static void finish(const bd_plan *plan, const bd_derivatives *at, double g, const double *rhs,
                   double *y) {
  const bd_layout *lay = &plan->model->lay;
  for (int c = 0; c < lay->nc; ++c) {
    const bd_coupling_tangent *k = &at->couplings[c];
    const double rim = rhs[bd_rim_body(lay, c)], shaft = rhs[lay->coupled[c]];
    y[lay->rim_angle + c] = g * (y[lay->rim_angle + c] + rim);
    y[lay->rim_speed + c] = rim;
    y[lay->windup + c] = g * (y[lay->windup + c] + k->winds * (rim - shaft)) / (1.0 + g * k->decay);
  }
}

static void states(const bd_derivatives *at, const bd_layout *lay, const bd_state_entries *to) {
  for (int c = 0; c < lay->nc; ++c) {
    const bd_coupling_tangent *k = &at->couplings[c];
    const int windup = lay->windup + c, rim = lay->rim_speed + c;
    to->column(to->reading, windup);
    to->put(to->reading, lay->rim_angle + c, rim, 1.0);
    to->put(to->reading, windup, rim, k->winds);
    to->put(to->reading, windup, lay->omega + lay->coupled[c], -k->winds);
    to->put(to->reading, windup, windup, -k->decay);
  }
}

const bd_effect bd_effect_couplings = {
    .name = "couplings of shafts and rims",
    .asked_by = BD_COUPLINGS(BD_KIND_NAME),
    .label = label,
    .enabled = enabled,
    .rate = rate,
    .tangent = tangent,
    .carve_tangent = carve_tangent,
    .entries = entries,
    .product = product,
    .finish = finish,
    .states = states,
    .after_step = after_step,
    .unseen = unseen,
    .stiffness = stiffness,
    .rest = rest,
    .on_shaft = on_shaft,
    .outputs = outputs,
    .energy = energy,
    .n_works = 1,
    .works = {BD_LOST_IN(coupling_loss, "dampers of couplings have given", 1)},
    .store = BD_ENERGY_coupling,
};
