/* SPDX-License-Identifier: MIT
 *
 * Memory of the linear systems (newton_system.c): of the ring and its border, of assembled blocks.
 */
#include "solvers/solvers.h"

/* A ring too short for the level's arcs is solved with two: the cyclic reduction of separators that
 * few links hold apart would cost digits where links weigh little against their joints. */
static const bd_newton_kernels *ring_kernels(const bd_model *model) {
  const bd_newton_kernels *best = model->kernels->newton;
  return model->lay.n >= 4 * best->width ? best : bd_kernels_baseline[bd_model_belt(model)].newton;
}

static void carve_all(bd_carver *carver, const bd_layout *lay, double **const *arrays, size_t n) {
  for (size_t k = 0; k < n; ++k) {
    bd_carve_links(carver, lay, arrays[k]);
  }
}

/* What contact along the links needs once for all pulleys. */
static void carve_scratch(bd_carver *carver, const bd_layout *lay, bd_contact_scratch *s) {
  bd_end_forces unused;
  double **const single[] = {&s->points.x,  &s->points.y,      &s->points.vx,
                             &s->points.vy, &s->correction[0], &s->correction[1]};
  carve_all(carver, lay, single, sizeof single / sizeof single[0]);
  bd_carve_pressure(carver, lay, &s->pressure, &unused);
  for (int m = 0; m < 2 * BD_END_ROWS; ++m) {
    bd_carve_links(carver, lay, &s->end[m % 2][m / 2]);
  }
  for (int m = 0; m < BD_POINT_ROWS; ++m) {
    bd_carve_links(carver, lay, &s->point[m]);
  }
}

/* What solves need of one pulley's friction. */
static void carve_slot(bd_carver *carver, const bd_model *model, int j, bd_slot *slot) {
  const bd_layout *lay = &model->lay;
  const int states = bd_friction_states(&model->friction[j]),
            columns = model->belt_model->facts.reach > 0.0 ? 6 : 2;
  double **const of_states[] = {&slot->decay, &slot->spin, &slot->given_x, &slot->given_y,
                                &slot->given_torque};
  for (int m = 0; m < columns; ++m) {
    bd_carve_rows(carver, lay, states, &slot->zq[m]);
    bd_carve_rows(carver, lay, states, &slot->zv[m]);
    bd_carve_links(carver, lay, &slot->sq[m]);
    bd_carve_links(carver, lay, &slot->sv[m]);
  }
  for (size_t m = 0; m < sizeof of_states / sizeof of_states[0]; ++m) {
    bd_carve_rows(carver, lay, states, of_states[m]);
  }
  bd_carve_links(carver, lay, &slot->rho);
}

void bd_ring_carve(bd_carver *carver, bd_ring *ring, const bd_newton_kernels *kernels, int n) {
  const int width = kernels->width, rows = (n + width - 1) / width;
  BD_CARVE(carver, ring->base, width);
  BD_CARVE(carver, ring->shorter, width);
  ring->rows = bd_carve(carver, (size_t)rows, kernels->ring_row);
  ring->ends = bd_carve(carver, 1, kernels->ring_ends);
  double *scratch;
  BD_CARVE(carver, scratch, kernels->unknowns * width * rows);
  ring->scratch = scratch;
  if (!carver->base) {
    return;
  }
  ring->n = n;
  ring->n_rows = rows;
  const int whole = n - width * (rows - 1); /* arcs of `rows` links; the rest have one less */
  for (int a = 0, first = 0; a < width; ++a) {
    int shorter = a >= whole;
    ring->base[a] = first - shorter;
    ring->shorter[a] = shorter;
    first += rows - shorter;
  }
}

void bd_newton_carve(bd_carver *carver, bd_newton_system *system, const bd_model *model) {
  const bd_layout *lay = &model->lay;
  const bd_newton_kernels *ring = ring_kernels(model);
  const int np = lay->np, bodies = bd_count_bodies(lay);
  const int entries = 3 * ring->unknowns * ring->unknowns;
  bd_effects_carve_tangents(carver, &system->at, model);
  double **const by_link[] = {&system->x, &system->y, &system->p};
  carve_all(carver, lay, by_link, 3);
  BD_CARVE(carver, system->blocks.w, entries * lay->n8);
  BD_CARVE(carver, system->blocks.q, entries * lay->n8);
  if (model->belt_model->facts.reach > 0.0) {
    carve_scratch(carver, lay, &system->scratch);
  }
  BD_CARVE(carver, system->slots, np);
  for (int j = 0; j < np; ++j) {
    carve_slot(carver, model, j, carver->base ? &system->slots[j] : &(bd_slot){0});
  }
  BD_CARVE(carver, system->bodies, bodies);
  for (int body = 0; body < bodies; ++body) {
    bd_body none, *b = carver->base ? &system->bodies[body] : &none;
    bd_carve_rows(carver, lay, 3, &b->w);
    bd_carve_rows(carver, lay, 3, &b->q);
    bd_carve_rows(carver, lay, bd_is_mount_body(lay, body) ? 3 : 0, &b->given);
  }
  BD_CARVE(carver, system->mounts, lay->nm);
  bd_ring_carve(carver, &system->ring, ring, lay->n);
  BD_CARVE(carver, system->border, 3 * bodies * lay->stride);
  BD_CARVE(carver, system->own, np);
  BD_CARVE(carver, system->rhs, bodies);
  BD_CARVE(carver, system->matrix, bodies * bodies);
  BD_CARVE(carver, system->pivots, bodies);
  BD_CARVE(carver, system->by_theta, np * np);
  BD_CARVE(carver, system->by_omega, np * np);
  BD_CARVE(carver, system->by_time, np);
  if (!carver->base) {
    return;
  }
  system->kernels = model->kernels->newton;
  system->ring_kernels = ring;
  for (int body = 0; body < bodies; ++body) {
    system->bodies[body].column = bd_newton_border(system, lay, body);
  }
}
