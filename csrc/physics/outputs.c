/* SPDX-License-Identifier: MIT
 *
 * What is reported of a state: joint deformation and force (MODEL section 2), contact (sections 3
 * and 4), and the energy ledger (section 7).
 */
#include <string.h>

#include "physics/physics.h"

const bd_joint *bd_joints(const bd_plan *plan, const double *y, int with_rate) {
  const double *co = with_rate ? plan->links.cos : NULL, *si = with_rate ? plan->links.sin : NULL;
  plan->model->belt_model->joints_at(plan, y, co, si, plan->joints);
  return plan->joints;
}

double bd_mean_force(const bd_plan *plan, const double *y) {
  const int n = plan->model->lay.n;
  const bd_joint *joints = bd_joints(plan, y, 0);
  double total = 0.0;
  for (int i = 0; i < n; ++i) {
    total += joints[i].force;
  }
  return total / n;
}

enum { IS_STORED, IS_SUPPLIED, IS_LOST, IS_CHECK };

/* Of every work integral, its column of the ledger. */
static const int column_of[MAX_WORK] = {
#define X(name, kind, text) BD_WORK_##kind([W_##name] = BD_ENERGY_##name, )
    BD_ENERGY_TERMS(X)
#undef X
};

static const int is_stored[BD_N_ENERGY] = {
#define X(name, kind, text) [BD_ENERGY_##name] = IS_##kind == IS_STORED,
    BD_ENERGY_TERMS(X)
#undef X
};

int bd_model_energy_terms(const bd_model *model, int *terms) {
  const bd_effect *effects[BD_MAX_EFFECTS];
  const int n_effects = bd_effects_of(model, &(bd_plan_options){.friction = 1}, effects);
  int n = 0;
  for (int c = 0; c < BD_N_ENERGY; ++c) {
    int has = c <= BD_ENERGY_residual;
    for (int e = 0; e < n_effects; ++e) {
      has |= effects[e]->store > 0 && effects[e]->store == c;
      for (int k = 0; k < effects[e]->n_works; ++k) {
        has |= column_of[effects[e]->works[k].row] == c;
      }
    }
    if (has && terms) {
      terms[n] = c;
    }
    n += has;
  }
  return n;
}

double bd_energy(const bd_plan *plan, const double *y, double terms[BD_N_ENERGY]) {
  double stored = 0.0;
  memset(terms, 0, BD_N_ENERGY * sizeof *terms);
  bd_mounts_put(plan, y);
  plan->model->belt_model->energy(plan, y, terms);
  for (int j = 0; j < plan->model->lay.np; ++j) {
    const double omega = y[plan->model->lay.omega + j];
    terms[BD_ENERGY_kinetic] += 0.5 * plan->model->inertia[j] * omega * omega;
  }
  for (int e = 0; e < plan->n_effects; ++e) {
    const bd_effect *effect = plan->effects[e];
    if (effect->energy) {
      effect->energy(plan, y, terms);
    }
    for (int k = 0; k < effect->n_works; ++k) {
      const int work = effect->works[k].row;
      terms[column_of[work]] = y[plan->model->lay.work + work];
    }
  }
  for (int c = 0; c < BD_N_ENERGY; ++c) {
    stored += is_stored[c] ? terms[c] : 0.0;
  }
  return stored;
}

double bd_losses(const bd_layout *lay, const double *y) {
  double sum = 0.0;
  for (int k = W_drive + 1; k < lay->n_work; ++k) {
    sum += y[lay->work + k];
  }
  return sum;
}

/* Row k of an output. */
static double *row_of(double *output, size_t k, int width) {
  return output ? output + k * (size_t)width : NULL;
}

void bd_outputs_of_joints(bd_plan *plan, const double *y, const bd_output *out, size_t k) {
  const size_t n = (size_t)plan->model->lay.n;
  const bd_joint *joints = out->deformation || out->force ? bd_joints(plan, y, 0) : NULL;
  for (size_t i = 0; joints && i < n; ++i) {
    if (out->deformation) {
      out->deformation[k * n + i] = joints[i].along;
    }
    if (out->force) {
      out->force[k * n + i] = joints[i].force;
    }
  }
}

double bd_friction_torque(const bd_plan *plan, const double *y, int j, double force[2]) {
  double unused[2];
  return plan->model->belt_model->push(plan, y, j, force ? force : unused);
}

void bd_observe(bd_plan *plan, double *y, double turns, const double *torque, double e0,
                const bd_output *out, size_t k) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  bd_mounts_put(plan, y);
  bd_state_export(model, y, turns,
                  &(bd_state){.x = row_of(out->x, k, lay->n),
                              .y = row_of(out->y, k, lay->n),
                              .phi = row_of(out->phi, k, lay->n),
                              .vx = row_of(out->vx, k, lay->n),
                              .vy = row_of(out->vy, k, lay->n),
                              .vphi = row_of(out->vphi, k, lay->n),
                              .theta = row_of(out->theta, k, lay->np),
                              .omega = row_of(out->omega, k, lay->np),
                              .travel = row_of(out->travel, k, lay->nm),
                              .travel_speed = row_of(out->travel_speed, k, lay->nm),
                              .rim_angle = row_of(out->rim_angle, k, lay->nc),
                              .rim_speed = row_of(out->rim_speed, k, lay->nc)});
  for (int j = 0; out->torque && j < lay->np; ++j) {
    row_of(out->torque, k, lay->np)[j] = torque[j];
  }
  for (int e = 0; e < plan->n_effects; ++e) {
    if (plan->effects[e]->outputs) {
      plan->effects[e]->outputs(plan, y, out, k);
    }
  }
  if (out->energy) {
    double terms[BD_N_ENERGY], *row = out->energy + k * (size_t)plan->n_columns;
    double total = bd_energy(plan, y, terms), supplied = y[lay->work + W_drive];
    for (int w = W_drive + 1; w < lay->n_work; ++w) {
      supplied -= y[lay->work + w];
    }
    terms[BD_ENERGY_residual] = total - e0 - supplied;
    for (int c = 0; c < plan->n_columns; ++c) {
      row[c] = terms[plan->columns[c]];
    }
  }
}
