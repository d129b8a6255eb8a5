/* SPDX-License-Identifier: MIT
 *
 * Outputs of the ALE belt at any state, its energy, and how errors of steps are measured: functions
 * of its row (ale_row.c).
 */
#include <math.h>

#include "belts/belts.h"

/* All cells; of a span's those that its mesh has not. */
void bd_ale_joints_at(const bd_plan *plan, const double *y, const double *co, const double *si,
                      bd_joint *out) {
  const bd_model *model = plan->model;
  const bd_ale *ale = bd_ale_look(plan, y);
  (void)co, (void)si;
  for (int c = 0; c < model->lay.n; ++c) {
    const int k = plan->ale->slot[c];
    const double strain = ale->stretch[k] - 1.0, alike = strain * model->info.link_length;
    out[c] = (bd_joint){
        .along = strain * plan->ale->y.m[k], .squared = alike * alike, .force = ale->tension[k]};
  }
}

double bd_ale_push(const bd_plan *plan, const double *y, int j, double force[2]) {
  const bd_ale_arc *arc = &bd_ale_look(plan, y)->arcs[j];
  force[0] = -arc->force[0];
  force[1] = -arc->force[1];
  return arc->torque;
}

/* An output from a place on, which is no other array. */
static double *from(double *output, size_t at) {
  return output ? output + at : NULL;
}

/* What presses on the cells of an arc, both ends of each together. */
static void normal_force_outputs(const bd_ale *ale, int j, double *restrict to) {
  const bd_ale_arc *arc = &ale->arcs[j];
  const double half = 0.5 * arc->cell_angle;
  for (int k = 0; k < arc->n; ++k) {
    const int slot = arc->begin + k;
    const double own =
        bd_at_least(ale->pressing[slot], 0.0) * (ale->cut_b[slot] - ale->cut_a[slot]);
    const double both = bd_at_least(own + ale->shear[slot] * ale->end_a[slot], 0.0) +
                        bd_at_least(own + ale->shear[slot] * ale->end_b[slot], 0.0);
    to[k] = half * ale->lies[slot] * both;
  }
}

/* Of the cells of an arc, counter-clockwise. */
static void friction_outputs(const bd_ale *ale, int j, const bd_output *out, size_t at) {
  const bd_ale_arc *arc = &ale->arcs[j];
  const double rim = arc->axis.omega, sense = arc->sense, r0 = arc->radius + arc->raised;
  const double *const before = ale->force_a + arc->begin, *const after = ale->force_b + arc->begin;
  const double *const slid = ale->slid + arc->begin, *const sink = ale->sink + arc->begin;
  double *restrict const normal = from(out->normal, at), *restrict const mu = from(out->mu, at);
  double *restrict const friction = from(out->friction, at);
  double *restrict const velocity = from(out->velocity, at);
  if (normal) {
    normal_force_outputs(ale, j, normal);
  }
  for (int k = 0; friction && k < arc->n; ++k) {
    friction[k] = sense * (before[k] + after[k]);
  }
  if (mu) {
    normal_force_outputs(ale, j, mu);
  }
  for (int k = 0; mu && k < arc->n; ++k) {
    mu[k] = mu[k] > 0.0 ? sense * (before[k] + after[k]) / mu[k] : 0.0;
  }
  for (int k = 0; velocity && k < arc->n; ++k) {
    velocity[k] = sense * 0.5 * (slid[k] + slid[k + 1]) - rim * (r0 - sink[k]);
  }
  for (int k = 0; out->pulley && k < arc->n; ++k) {
    out->pulley[at + (size_t)k] = j;
  }
}

/* Where so many cells on a pulley begin, and how the belt moves there. */
static void place_outputs(const bd_plan *plan, int j, int slot, int n, const bd_output *out,
                          size_t at) {
  const bd_ale *ale = &plan->ale->ale;
  const bd_ale_arc *arc = &ale->arcs[j];
  const double *tx = ale->tx + slot, *ty = ale->ty + slot, *across = ale->across + slot;
  const double *v = plan->ale->y.v + slot, *origin = plan->model->origin, D = ale->direction;
  const double lift = D * arc->side * arc->radius, *c = arc->axis.c;
  double *restrict const x = from(out->x, at), *restrict const y = from(out->y, at);
  double *restrict const vx = from(out->vx, at), *restrict const vy = from(out->vy, at);
  for (int k = 0; x && k < n; ++k) {
    x[k] = c[0] + lift * ty[k] + origin[0];
  }
  for (int k = 0; y && k < n; ++k) {
    y[k] = c[1] - lift * tx[k] + origin[1];
  }
  for (int k = 0; vx && k < n; ++k) {
    vx[k] = v[k] * tx[k] + across[k] * D * ty[k];
  }
  for (int k = 0; vy && k < n; ++k) {
    vy[k] = v[k] * ty[k] - across[k] * D * tx[k];
  }
}

/* Of span i, and of its cell. */
static void span_outputs(const bd_plan *plan, int i, const bd_output *out, size_t at,
                         size_t pulley) {
  const bd_ale *ale = &plan->ale->ale;
  bd_put(out->normal, at, 0.0);
  bd_put(out->friction, at, 0.0);
  bd_put(out->mu, at, 0.0);
  bd_put(out->velocity, at, 0.0);
  if (out->pulley) {
    out->pulley[at] = -1;
  }
  bd_put(out->load, 2 * pulley, ale->arcs[i].force[0]);
  bd_put(out->load, 2 * pulley + 1, ale->arcs[i].force[1]);
  bd_put(out->span_tension, pulley, ale->tension[ale->arcs[i].begin + ale->arcs[i].n]);
}

void bd_ale_contact_outputs(bd_plan *plan, const double *y, const bd_output *out, size_t k) {
  const bd_layout *lay = &plan->model->lay;
  const bd_ale *ale = bd_ale_look(plan, y);
  size_t at = k * (size_t)lay->n;
  double swings = 0.0;
  for (int i = 0; i < lay->np; ++i) {
    const int j = ale->arcs[i].next, n = ale->arcs[j].n;
    const int slot = ale->arcs[i].begin + ale->arcs[i].n; /* where the arc of i ends */
    span_outputs(plan, i, out, at, k * (size_t)lay->np + (size_t)i);
    place_outputs(plan, i, slot, 1, out, at++);
    friction_outputs(ale, j, out, at);
    place_outputs(plan, j, ale->arcs[j].begin, n, out, at);
    at += (size_t)n;
    for (int m = 0; m < lay->modes; ++m) {
      const double p = y[lay->p + i * lay->modes + m];
      swings += 0.5 * p * p * plan->ale->y.m[slot];
    }
  }
  bd_put(out->flow, k, ale->flow[plan->ale->slot[0]]);
  for (int m = 0; m < lay->n_modes; ++m) {
    bd_put(out->deflection, k * (size_t)lay->n_modes + (size_t)m, y[lay->a + m]);
  }
  bd_put(out->across, k, swings / plan->model->belt.length);
}

/* Where a cell has its middle against the model's origin, at the mean of its nodes' tangents. */
static void middle_of(const bd_ale *ale, int j, int slot, double at[2]) {
  const bd_ale_arc *arc = &ale->arcs[j];
  const bd_ale_span *span = &ale->spans[j];
  const double D = ale->direction, lift = arc->side * (arc->radius - ale->sink[slot] + arc->raised);
  if (slot < arc->begin + arc->n) {
    const double tx = ale->tx[slot] + ale->tx[slot + 1], ty = ale->ty[slot] + ale->ty[slot + 1];
    const double per = lift / sqrt(tx * tx + ty * ty);
    at[0] = arc->axis.c[0] + D * ty * per;
    at[1] = arc->axis.c[1] - D * tx * per;
    return;
  }
  const double raised = arc->side * arc->line_radius, half = 0.5 * span->length;
  at[0] = arc->axis.c[0] + raised * span->n[0] + half * span->e[0];
  at[1] = arc->axis.c[1] + raised * span->n[1] + half * span->e[1];
}

static double weighs(const bd_plan *plan, const bd_ale *ale) {
  const bd_model *model = plan->model;
  const bd_ale_state *y = &plan->ale->y;
  double sum = 0.0, along = 0.0;
  for (int j = 0; j < ale->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    const double of_span = y->m[arc->begin + arc->n];
    for (int k = arc->begin; k <= arc->begin + arc->n; ++k) {
      double at[2];
      middle_of(ale, j, k, at);
      sum += y->m[k] * (model->gravity[0] * (at[0] + model->origin[0]) +
                        model->gravity[1] * (at[1] + model->origin[1]));
    }
    for (int n = 0; n < BD_ALE_MODES; ++n) {
      sum += of_span * 2.0 * ale->odd[n] * ale->spans[j].sag * y->a[j * BD_ALE_MODES + n];
    }
    along += ale->along ? bd_ale_hung_along(ale, &ale->spans[j]) * y->along[j] : 0.0;
  }
  return -ale->density * sum - along / BD_ALE_SHARE;
}

void bd_ale_stored(const bd_plan *plan, const double *y, const bd_joint *unused,
                   double terms[BD_N_ENERGY]) {
  const bd_ale *ale = bd_ale_look(plan, y);
  const bd_ale_energy has = bd_ale_energy_of(ale, &plan->ale->y);
  (void)unused;
  terms[BD_ENERGY_kinetic] += has.kinetic + has.lateral;
  terms[BD_ENERGY_axial] += has.axial;
  terms[BD_ENERGY_bending] += has.bending;
  terms[BD_ENERGY_contact] += has.contact;
  terms[BD_ENERGY_gravity] += plan->model->has_gravity ? weighs(plan, ale) : 0.0;
}

/* Of stretches, on cells of one length. */
double bd_ale_stretch_difference(const bd_plan *plan, const double *y, const bd_plan *other,
                                 const double *v) {
  const bd_ale *one = bd_ale_look(plan, y), *two = bd_ale_look(other, v);
  const double length = plan->model->info.link_length;
  double sum = 0.0;
  for (int c = 0; c < plan->model->lay.n; ++c) {
    const int k = plan->ale->slot[c];
    const double off = length * (one->stretch[k] - two->stretch[k]);
    sum += off * off;
  }
  return sum;
}

/* --- errors ----------------------------------------------------------------------------------- */

/* Of the speed of belt and rim [m/s]: what a wave of the strain at rest has; under a law without a
 * state, whose friction follows it at once, ten times the slip over which that builds up. */
static double speed_scale(const bd_model *model, int j) {
  const double waves = sqrt(model->belt.axial_stiffness / model->belt.linear_density);
  const double wave = model->info.strain * waves, normal = model->drive->rest / model->radius[j];
  if (model->friction[j].law == BD_LAW_NONE || bd_friction_states(&model->friction[j]) > 0) {
    return wave;
  }
  const bd_friction_stiffness law = bd_friction_stiffness_of(model, j, normal);
  return fmin(wave, 10.0 * bd_friction_kinetic(model, j) * normal / law.damping);
}

/* Metres by what their stretch at rest is worth, modes by 1/700 of the belt: tension goes by the
 * square of their slopes, so that errors of theirs are worth less. Histories of drive U and of
 * seven pulleys then err by 0.2 to 0.5 % at rtol 1e-2; by a three-hundredth of each span, which is
 * less, short spans would set the steps. */
void bd_ale_weigh(const bd_model *model, double *weights) {
  const bd_layout *lay = &model->lay;
  const double MODES = 700.0, strain = model->info.strain;
  double *m = bd_field(lay, weights, F_M), *v = bd_field(lay, weights, F_V);
  for (int i = 0, c = 0; i < lay->np; ++i) {
    const int j = (i + 1) % lay->np, cells = model->drive->pulleys[j].cells;
    const double span = model->wraps[i].span, arc = model->wraps[j].wrap * model->radius[j];
    const double across = sqrt(model->drive->rest / model->belt.linear_density);
    const double speed = speed_scale(model, j);
    m[c] = 1.0 / (span * strain);
    for (int k = 0; k < cells; ++k) {
      m[++c] = cells / (arc * strain);
      v[c] = 1.0 / speed;
    }
    v[++c % lay->n] = 1.0 / speed;
    for (int n = 0; n < lay->modes; ++n) {
      weights[lay->a + i * lay->modes + n] = MODES / model->belt.length;
      weights[lay->p + i * lay->modes + n] = MODES / model->belt.length * span / (BD_PI * across);
    }
    if (lay->n_along > 0) {
      weights[lay->along + i] = BD_PI / (span * strain);
      weights[lay->along_speed + i] = 1.0 / speed;
    }
    weights[lay->omega + j] = fmax(weights[lay->omega + j], model->radius[j] / speed);
  }
}

/* Groups of unknowns, none of which may err by more than is asked, however many others there are.
 */
enum { OF_ARCS, OF_STATES, OF_SPANS, OF_MODES, OF_BODIES, GROUPS };

typedef struct errors {
  const bd_step_sum *of;
  double sum[GROUPS], count[GROUPS];
} errors;

static void add_error(errors *at, int group, size_t entry, double counts) {
  double off = 0.0;
  for (int j = 0; j < at->of->m; ++j) {
    off += at->of->a[j] * at->of->k[j][entry];
  }
  off *= at->of->h * at->of->weights[entry];
  at->sum[group] += counts * off * off;
  at->count[group] += counts;
}

/* States of friction count by what of the normal force acts there: where nothing does, they are 0
 * after each step. They set most steps; tension, which is a sum over all cells, errs by less. */
double bd_ale_error(const bd_plan *plan, const bd_step_sum *of) {
  const bd_layout *lay = &plan->model->lay;
  const bd_ale *ale = &plan->ale->ale;
  errors at = {.of = of};
  for (int i = 0, c = 0; i < lay->np; ++i) {
    const bd_ale_arc *arc = &ale->arcs[ale->arcs[i].next];
    add_error(&at, OF_SPANS, (size_t)(lay->m + c), 1.0);
    add_error(&at, OF_SPANS, (size_t)(lay->v + c), 1.0);
    for (int k = 0; k < arc->n; ++k) {
      ++c;
      add_error(&at, OF_ARCS, (size_t)(lay->m + c), 1.0);
      add_error(&at, k > 0 ? OF_ARCS : OF_SPANS, (size_t)(lay->v + c), 1.0);
      for (int e = 0; e < 2 * arc->states; ++e) {
        const int end = e / arc->states, row = end * lay->states + e % arc->states;
        const int slot = arc->begin + k;
        const double more = (end == 0 ? ale->end_a : ale->end_b)[slot];
        const double share = ale->cut_b[slot] - ale->cut_a[slot] + more;
        add_error(&at, OF_STATES, bd_field_offset(lay, F_MU, row) + (size_t)c,
                  ale->lies[slot] * bd_at_most(bd_at_least(share, 0.0), 1.0));
      }
    }
    ++c;
  }
  for (int k = 0; k < lay->n_modes; ++k) {
    add_error(&at, OF_MODES, (size_t)(lay->a + k), 1.0);
    add_error(&at, OF_MODES, (size_t)(lay->p + k), 1.0);
  }
  for (int i = 0; i < lay->n_along; ++i) {
    add_error(&at, OF_SPANS, (size_t)(lay->along + i), 1.0);
    add_error(&at, OF_SPANS, (size_t)(lay->along_speed + i), 1.0);
  }
  for (size_t k = (size_t)lay->theta; k < (size_t)lay->a; ++k) {
    add_error(&at, OF_BODIES, k, of->weights[k] > 0.0 ? 1.0 : 0.0);
  }
  const double STATES = 0.7;
  double most = 0.0, all = 0.0;
  at.sum[OF_STATES] *= STATES * STATES;
  for (int group = 0; group < GROUPS; ++group) {
    most = fmax(most, at.count[group] > 0.0 ? at.sum[group] / at.count[group] : 0.0);
    all += at.sum[group];
  }
  return isfinite(all) ? sqrt(most) : (double)INFINITY;
}
