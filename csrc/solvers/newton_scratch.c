/* SPDX-License-Identifier: MIT
 *
 * Memory of the linear systems (newton_system.c): of the ring and its border, of assembled blocks,
 * of the tangent of contact at the links' centres.
 */
#include "solvers/solvers.h"

/* A ring too short for the level's arcs is solved with two: the cyclic reduction of separators that
 * few links hold apart would cost digits where links weigh little against their joints. */
static const bd_newton_kernels *ring_kernels(const bd_model *model) {
  const bd_newton_kernels *best = model->kernels->newton;
  return model->lay.n >= 4 * best->width ? best
         : model->lay.string             ? &bd_newton_string_baseline
                                         : &bd_newton_baseline;
}

/* A law that is not general shares two arrays, and has no part of others; of states there are as
 * many rows as the law has. */
static void carve_contact(bd_carver *carver, const bd_layout *lay, bd_contact_tangent *contact,
                          const bd_friction *friction) {
  const int general = bd_law_is_general(friction->law), states = bd_friction_states(friction);
  double **const fields[] = {&contact->nx,
                             &contact->ny,
                             &contact->rho,
                             &contact->normal,
                             &contact->mu,
                             &contact->stiff,
                             &contact->damp,
                             &contact->normal_over_rho,
                             &contact->cross,
                             &contact->apart,
                             &contact->xx,
                             &contact->xy,
                             &contact->yx,
                             &contact->yy,
                             &contact->torque_x,
                             &contact->torque_y,
                             &contact->row_x,
                             &contact->row_y,
                             &contact->slide_x,
                             &contact->slide_y,
                             &contact->normal_correction};
  double **const of_states[] = {&contact->gain, &contact->decay, &contact->by_given_state,
                                &contact->state_by_slip, &contact->decay_factor};
  double **const more[] = {&contact->by_state, &contact->gain_normal, &contact->state_by_normal};
  for (size_t k = 0; k < sizeof fields / sizeof fields[0]; ++k) {
    bd_carve_links(carver, lay, fields[k]);
  }
  for (size_t k = 0; k < sizeof of_states / sizeof of_states[0]; ++k) {
    bd_carve_rows(carver, lay, states, of_states[k]);
  }
  if (general) {
    bd_carve_links(carver, lay, &contact->by_normal);
    bd_carve_links(carver, lay, &contact->by_slip);
  } else {
    contact->by_normal = contact->mu;
    contact->by_state = contact->normal;
  }
  for (size_t k = 0; general && k < sizeof more / sizeof more[0]; ++k) {
    bd_carve_rows(carver, lay, states, more[k]);
  }
}

static void carve_all(bd_carver *carver, const bd_layout *lay, double **const *arrays, size_t n) {
  for (size_t k = 0; k < n; ++k) {
    bd_carve_links(carver, lay, arrays[k]);
  }
}

/* Assembled blocks, and what contact along the links needs, of all pulleys and of each. */
static void carve_blocks(bd_carver *carver, const bd_model *model, bd_newton_system *system) {
  const bd_layout *lay = &model->lay;
  bd_contact_scratch *s = &system->scratch;
  bd_end_forces unused;
  const int d = lay->string ? 2 : 3, bodies = lay->np + lay->nm + lay->nc;
  BD_CARVE(carver, system->blocks.w, 3 * d * d * lay->n8);
  BD_CARVE(carver, system->blocks.q, 3 * d * d * lay->n8);
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
  BD_CARVE(carver, system->slots, lay->np);
  for (int j = 0; j < lay->np; ++j) {
    bd_slot none, *slot = carver->base ? &system->slots[j] : &none;
    const int states = bd_friction_states(&model->friction[j]);
    double **const of_states[] = {&slot->decay, &slot->spin, &slot->given_x, &slot->given_y,
                                  &slot->given_torque};
    for (int m = 0; m < 6; ++m) {
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
  BD_CARVE(carver, system->bodies, bodies);
  for (int body = 0; body < bodies; ++body) {
    bd_body none, *b = carver->base ? &system->bodies[body] : &none;
    bd_carve_rows(carver, lay, 3, &b->w);
    bd_carve_rows(carver, lay, 3, &b->q);
    bd_carve_rows(carver, lay, bd_is_mount_body(lay, body) ? 3 : 0, &b->given);
  }
  BD_CARVE(carver, system->mounts, lay->nm);
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
  const int np = lay->np, bodies = np + lay->nm + lay->nc;
  bd_blocks *b = &system->ring_blocks;
  bd_effects_carve_tangents(carver, &system->at, model);
  double **by_link[] = {&system->x, &system->y, &system->p, &b->xx, &b->xy, &b->yx, &b->yy, &b->pp};
  carve_all(carver, lay, by_link, model->along_links ? 3 : sizeof by_link / sizeof by_link[0]);
  if (model->along_links) {
    carve_blocks(carver, model, system);
  } else {
    BD_CARVE(carver, system->contact, np);
  }
  for (int j = 0; !model->along_links && j < np; ++j) {
    carve_contact(carver, lay, carver->base ? &system->contact[j] : &(bd_contact_tangent){0},
                  &model->friction[j]);
  }
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
  system->ring_kernels = ring;
  b->cos = system->at.joints.cos;
  b->sin = system->at.joints.sin;
  b->spin = system->at.joints.spin;
  b->tiles = system->blocks.w;
  b->n = lay->n;
  for (int body = 0; model->along_links && body < bodies; ++body) {
    system->bodies[body].column = bd_newton_border(system, lay, body);
  }
}
