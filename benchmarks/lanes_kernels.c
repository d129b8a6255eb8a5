/* SPDX-License-Identifier: MIT
 *
 * The core's kernels with a drive in each lane of a vector, for lanes.c; compiled once per
 * instruction level, LANES_LEVEL its name. They are the headers of csrc/kernels once more, their
 * doubles being vectors of one number per drive and their vectors one link wide; lines that do not
 * survive this, such as an `if` on a double, are replaced in the copies of the headers that
 * lanes.py makes. What stands below is the part of csrc/physics and csrc/solvers that calls them.
 * Contact is along the links (mesh "joint"), friction Dahl's without a Stribeck curve, pulleys turn
 * about fixed axes under no torque.
 */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "benchmarks/lanes.h"

#include "kernels/vector.h"

typedef double real;

/* From here on a double is one number of each drive, and a vector of the kernels one link wide. */
#define double vec
#define WIDTH 1
#define load(p) (*(p))
#define load_unaligned(p) (*(p))
#define store(p, a) (*(p) = (a))
#define gather(from, at) (*(from))
#define scatter(to, at, a) (*(to) = (a))
#define splat(a) ((a) - (vec){0.0})
#define from_left(before, a) (before)
#define from_right(a, after) (after)
#define turned(a, n) (a)
#define first_of(a) (a)
#define sum(a) (a)
#define lane_numbers() ((vec){0.0})

#include "kernels/kernels.h"

#include "kernels/laws.h"
#include "kernels/normal_force.h"

#include "kernels/rhs.h"
#include "kernels/ring.h"

#include "kernels/jacobian.h"

enum { DRIVES = sizeof(vec) / sizeof(real), STAGES = 8 };

/* A group of drives, one a lane. */
typedef struct group {
  bd_links links;
  int np, n_runs[MAX_PULLEYS];
  bd_run runs[MAX_PULLEYS][MAX_RUNS];
  bd_contact_pulley pulleys[MAX_PULLEYS];
  vec inertia[MAX_PULLEYS], g;
  vec *y, *y_new, *weights, *stage[STAGES], *c;
  vec error;
  bd_pressure pressure;
  bd_end_forces forces;
  bd_points points, points_at;
  bd_tangent tangent;
  bd_link_tangent along[MAX_PULLEYS];
  bd_blocks blocks;
  bd_stage constants;
  bd_link_scratch scratch;
  bd_ring ring;
  vec *x, *yy, *p, *joint_x, *joint_y, *rows, *border;
  vec own[MAX_PULLEYS], rhs[MAX_PULLEYS], matrix[MAX_PULLEYS * MAX_PULLEYS];
} group;

static void *memory(size_t size) {
  void *block = aligned_alloc(64, (size + 63) / 64 * 64);
  if (!block) {
    abort();
  }
  return memset(block, 0, size);
}

/* Blocks of links, as many as a struct has pointers to such. */
static void blocks_new(const bd_layout *lay, void *pointers, size_t size) {
  vec **at = pointers;
  for (size_t k = 0; k < size / sizeof *at; ++k) {
    at[k] = (vec *)memory((size_t)lay->stride * sizeof(vec)) + BD_HALO;
  }
}
#define BLOCKS(lay, of) blocks_new(lay, &(of), sizeof(of))

static void clear(const bd_layout *lay, vec *const *blocks, size_t n) {
  for (size_t k = 0; k < n; ++k) {
    memset(blocks[k] - BD_HALO, 0, (size_t)lay->stride * sizeof(vec));
  }
}

static vec *state_new(const bd_layout *lay) {
  return memory(lay->size * sizeof(vec));
}

/* --- in and out ------------------------------------------------------------------------------ */

static vec collect(const lanes_drive *drives, size_t offset) {
  real lanes[DRIVES];
  vec out;
  for (size_t k = 0; k < DRIVES; ++k) {
    memcpy(&lanes[k], (const char *)&drives[k] + offset, sizeof lanes[k]);
  }
  memcpy(&out, lanes, sizeof out);
  return out;
}
#define COLLECT(field) collect(drives, offsetof(lanes_drive, field))

static void put(vec *to, size_t lane, real value) {
  memcpy((char *)to + lane * sizeof value, &value, sizeof value);
}

static void *group_make(const lanes_drive *drives, const lanes_runs *runs) {
  group *G = memory(sizeof *G);
  const lanes_drive *d = drives;
  bd_layout *lay = &G->links.lay;
  *lay = (bd_layout){.n = d->n, .n8 = d->n, .np = d->np, .slots = 1, .states = 1};
  lay->stride = d->n + 2 * BD_HALO;
  lay->theta = d->blocks * lay->stride;
  lay->omega = lay->theta + d->np;
  lay->size = (size_t)(lay->omega + d->np);
  G->np = d->np;
  G->links.half = COLLECT(half);
  G->links.stiffness = COLLECT(stiffness);
  G->links.damping = COLLECT(damping);
  G->links.bending = COLLECT(bending);
  G->links.bending_damping = COLLECT(bending_damping);
  G->links.inv_mass = COLLECT(inv_mass);
  G->links.inv_inertia = COLLECT(inv_inertia);
  G->links.wind = COLLECT(wind);
  G->g = COLLECT(g);
  G->constants.mass = COLLECT(mass);
  G->constants.slender = 0.25 * COLLECT(shear);
  vec *ones = (vec *)memory((size_t)lay->stride * sizeof(vec)) + BD_HALO;
  for (int i = 0; i < lay->n; ++i) {
    ones[i] = splat(1.0);
  }
  G->links.link_mask = ones;
  blocks_new(lay, &G->links.cos, 6 * sizeof(vec *)); /* cos to fy */
  for (int j = 0; j < d->np; ++j) {
    bd_contact_pulley *p = &G->pulleys[j];
    p->x = COLLECT(pulleys[j].x);
    p->y = COLLECT(pulleys[j].y);
    p->radius = COLLECT(pulleys[j].radius);
    p->quadratic = COLLECT(pulleys[j].quadratic);
    p->linear = COLLECT(pulleys[j].linear);
    p->damping = COLLECT(pulleys[j].damping);
    p->l0 = COLLECT(pulleys[j].l0);
    p->bound = COLLECT(pulleys[j].bound);
    p->law = p->friction.law = BD_LAW_dahl;
    p->states = 1;
    p->stride = lay->stride;
    p->friction.dahl.mu_k = COLLECT(pulleys[j].mu_k);
    p->friction.dahl.sigma = COLLECT(pulleys[j].sigma);
    G->inertia[j] = COLLECT(pulleys[j].inertia);
    G->n_runs[j] = runs->n[j];
    for (int r = 0; r < runs->n[j]; ++r) {
      G->runs[j][r] = (bd_run){runs->begin[j][r], runs->end[j][r]};
    }
    BLOCKS(lay, G->along[j]);
  }
  G->y = state_new(lay);
  G->y_new = state_new(lay);
  G->weights = state_new(lay);
  G->c = state_new(lay);
  for (int s = 0; s < STAGES; ++s) {
    G->stage[s] = state_new(lay);
  }
  for (size_t lane = 0; lane < DRIVES; ++lane) {
    const lanes_drive *from = &drives[lane];
    for (int block = 0; block < d->blocks; ++block) {
      for (int i = 0; i < d->n; ++i) {
        put(G->y + block * lay->stride + BD_HALO + i, lane, from->state[block * from->stride + i]);
      }
    }
    for (int j = 0; j < d->np; ++j) {
      put(G->y + lay->theta + j, lane, from->theta[j]);
      put(G->y + lay->omega + j, lane, from->omega[j]);
    }
  }
  for (size_t k = 0; k < lay->size; ++k) {
    G->weights[k] = splat(1.0);
  }
  BLOCKS(lay, G->pressure);
  BLOCKS(lay, G->forces);
  BLOCKS(lay, G->points);
  BLOCKS(lay, G->points_at);
  BLOCKS(lay, G->tangent);
  BLOCKS(lay, G->scratch);
  bd_blocks *b = &G->blocks;
  vec **const own[] = {&b->xx, &b->xy, &b->yx, &b->yy, &b->pp, &b->xp,      &b->yp,
                       &b->px, &b->py, &G->x,  &G->yy, &G->p,  &G->joint_x, &G->joint_y};
  for (size_t k = 0; k < sizeof own / sizeof own[0]; ++k) {
    blocks_new(lay, own[k], sizeof(vec *));
  }
  BLOCKS(lay, b->back);
  BLOCKS(lay, b->forward);
  b->cos = G->tangent.cos;
  b->sin = G->tangent.sin;
  b->spin = G->tangent.spin;
  G->rows = memory((size_t)(3 * d->np * lay->stride) * sizeof(vec));
  G->border = memory((size_t)(3 * d->np * lay->stride) * sizeof(vec));
  const size_t n = (size_t)d->n;
  G->ring = (bd_ring){.n_rows = d->n,
                      .base = memory(sizeof(int)),
                      .shorter = memory(sizeof(vec)),
                      .rows = memory(n * sizeof(ring_row)),
                      .scratch = memory(3 * n * sizeof(vec)),
                      .ends = memory(sizeof(ring_ends))};
  return G;
}

static void group_read(void *of, int what, int lane, int n, real *out) {
  const group *G = of;
  const bd_layout *lay = &G->links.lay;
  const vec *from = what == A_RATE ? G->stage[0] : G->c;
  const size_t at = (size_t)lane * sizeof *out;
  for (int k = 0; k < lay->theta / lay->stride; ++k) {
    for (int i = 0; i < n; ++i) {
      memcpy(out++, (const char *)&from[k * lay->stride + BD_HALO + i] + at, sizeof *out);
    }
  }
  for (int j = 0; j < TAIL * lay->np; ++j) {
    memcpy(out++, (const char *)&from[lay->theta + j] + at, sizeof *out);
  }
}

/* --- rate: as physics/effects.c and physics/link_contact.c ------------------------------------ */

static void group_rate(void *of) {
  group *G = of;
  const bd_layout *lay = &G->links.lay;
  const bd_links *links = &G->links;
  vec *y = G->y, *dy = G->stage[0];
  joints(links, y, dy, 1, 0);
  clear(lay, (vec *const *)&G->forces, sizeof G->forces / sizeof(vec *));
  bd_close_links(lay, y);
  links->cos[-1] = links->cos[lay->n - 1];
  links->sin[-1] = links->sin[lay->n - 1];
  gather_points(links, links->cos, links->sin, y, &G->points);
  for (int j = 0; j < lay->np; ++j) {
    bd_contact_pulley *pulley = &G->pulleys[j];
    bd_sums sums;
    pulley->omega = y[lay->omega + j];
    press(links, pulley, G->n_runs[j], G->runs[j], &G->pressure, &G->forces, y, &sums, 0, 0, 0);
    rub(links, pulley, G->n_runs[j], G->runs[j], &G->points, &G->pressure, &G->forces, y, dy, &sums,
        BD_LAW_dahl, 0, 1, 0);
    dy[lay->theta + j] = pulley->omega;
    dy[lay->omega + j] = sums.torque / G->inertia[j];
  }
  scatter_forces(links, links->cos, links->sin, &G->forces, dy);
}

/* --- linear systems: as solvers/newton_system.c ----------------------------------------------- */

static void group_linearise(void *of) {
  group *G = of;
  const bd_layout *lay = &G->links.lay;
  linearise_joints(&G->links, G->y, &G->tangent);
  bd_close_links(lay, G->y);
  gather_points(&G->links, G->tangent.cos, G->tangent.sin, G->y, &G->points_at);
  for (int j = 0; j < lay->np; ++j) {
    G->pulleys[j].omega = G->y[lay->omega + j];
    linearise_links(&G->links, &G->tangent, &G->pulleys[j], G->n_runs[j], G->runs[j], &G->points_at,
                    &G->scratch, G->y, &G->along[j], splat(0.0), BD_LAW_dahl, 0, 1, 0);
  }
}

static vec *border_of(const group *G, int j) {
  return G->border + 3 * j * G->links.lay.stride + BD_HALO;
}

static vec row_times(const group *G, int j, const vec *x, const vec *y, const vec *p) {
  const bd_layout *lay = &G->links.lay;
  const vec *row = G->rows + 3 * j * lay->stride + BD_HALO;
  const vec *const parts[3] = {row, row + lay->stride, row + 2 * lay->stride};
  return ring_product(lay, parts, x, y, p);
}

static void group_ring_factor(void *of) {
  group *G = of;
  ring_factor_1(&G->ring, &G->blocks);
}

static void group_ring_solve(void *of) {
  group *G = of;
  const bd_layout *lay = &G->links.lay;
  vec *const to[] = {G->x, G->yy, G->p};
  for (int k = 0; k < 3; ++k) {
    memcpy(to[k], bd_field(lay, G->stage[0], F_VX + k), (size_t)lay->n * sizeof(vec));
  }
  ring_solve_1(&G->ring, G->blocks.k, G->x, G->yy, G->p);
}

/* Of the shafts, in place; inertia stands on the diagonal, so that no pivot is sought. */
static void small_factor(int n, vec *a) {
  for (int k = 0; k < n; ++k) {
    a[k * n + k] = 1.0 / a[k * n + k];
    for (int i = k + 1; i < n; ++i) {
      const vec factor = a[i * n + k] *= a[k * n + k];
      for (int c = k + 1; c < n; ++c) {
        a[i * n + c] -= factor * a[k * n + c];
      }
    }
  }
}

static void small_solve(int n, const vec *a, vec *x) {
  for (int i = 0; i < n; ++i) {
    for (int c = 0; c < i; ++c) {
      x[i] -= a[i * n + c] * x[c];
    }
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int c = i + 1; c < n; ++c) {
      x[i] -= a[i * n + c] * x[c];
    }
    x[i] *= a[i * n + i];
  }
}

static void group_factor(void *of) {
  group *G = of;
  const bd_layout *lay = &G->links.lay;
  const bd_links *links = &G->links;
  const bd_tangent *t = &G->tangent;
  const bd_link_scratch *s = &G->scratch;
  bd_blocks *b = &G->blocks;
  const vec g = G->g, inv_half = 1.0 / links->half;
  const int n = lay->np, stride = lay->stride;
  G->constants.g = g;
  b->k = g * (g * links->stiffness + links->damping);
  b->damping = g * g * links->damping;
  b->bending = g * (g * links->bending + links->bending_damping) * inv_half * inv_half;
  diagonal(links, t, &G->constants, b);
  memset(G->border, 0, (size_t)(3 * n * stride) * sizeof(vec));
  clear(lay, (vec *const[]){b->xp, b->yp, b->px, b->py}, 4);
  clear(lay, s->before, 6);
  clear(lay, s->behind, 6);
  clear(lay, (vec *const *)&s->forces, sizeof s->forces / sizeof(vec *));
  for (int j = 0; j < n; ++j) {
    vec *z = border_of(G, j);
    clear(lay, (vec *const[]){G->joint_x, G->joint_y}, 2);
    clear(lay, s->row_before, 3);
    clear(lay, s->row_behind, 3);
    G->own[j] = add_links(links, t, &G->pulleys[j], G->n_runs[j], G->runs[j], &G->along[j], g, b, s,
                          G->joint_x, G->joint_y, G->rows + 3 * j * stride + BD_HALO);
    joints_to_links(links, t, G->joint_x, G->joint_y, z, z + stride, z + 2 * stride);
  }
  assemble(links, t, g, s, b);
  ring_factor_1(&G->ring, b);
  for (int j = 0; j < n; ++j) {
    vec *z = border_of(G, j);
    ring_solve_1(&G->ring, b->k, z, z + stride, z + 2 * stride);
    for (int i = 0; i < n; ++i) {
      G->matrix[i * n + j] = (i == j ? G->inertia[i] + G->own[i] : splat(0.0)) -
                             row_times(G, i, z, z + stride, z + 2 * stride);
    }
  }
  small_factor(n, G->matrix);
}

/* Of the rate, as the timed solves of the core are. */
static void group_solve(void *of) {
  group *G = of;
  const bd_layout *lay = &G->links.lay;
  const bd_links *links = &G->links;
  const bd_tangent *t = &G->tangent;
  const int n = lay->np;
  const vec g = G->g;
  vec *c = G->c, *x = G->x, *y = G->yy, *p = G->p, *rhs = G->rhs;
  memcpy(c, G->stage[0], lay->size * sizeof *c);
  joints_product(links, t, &G->constants, c, x, y, p);
  clear(lay, (vec *const[]){G->joint_x, G->joint_y}, 2);
  bd_close_links(lay, c);
  for (int j = 0; j < n; ++j) {
    rhs[j] = link_product(links, t, &G->pulleys[j], G->n_runs[j], G->runs[j], &G->along[j], g, c,
                          G->joint_x, G->joint_y, x, y, p);
  }
  joints_to_links(links, t, G->joint_x, G->joint_y, x, y, p);
  add_turning(lay, G->scratch.turning, g, c, p);
  ring_solve_1(&G->ring, G->blocks.k, x, y, p);
  for (int j = 0; j < n; ++j) {
    rhs[j] += g * G->inertia[j] * c[lay->omega + j] - row_times(G, j, x, y, p);
  }
  small_solve(n, G->matrix, rhs);
  finish_links(links, &G->constants, n, border_of(G, 0), rhs, x, y, p, c);
  bd_close_links(lay, c);
  for (int j = 0; j < n; ++j) {
    c[lay->theta + j] = g * (c[lay->theta + j] + rhs[j]);
    c[lay->omega + j] = rhs[j];
    finish_joints(links, t, &G->pulleys[j], G->n_runs[j], G->runs[j], &G->along[j], g, rhs[j], c);
  }
}

/* --- steps: as the end of kernels/rhs.h, each lane with a step of its own --------------------- */

INLINE vec weighted_sum(size_t i, const int m, const vec *a, vec *const *k) {
  vec total = a[0] * k[0][i];
  for (int j = 1; j < m; ++j) {
    total = fma_(a[j], k[j][i], total);
  }
  return total;
}

INLINE void combine(group *G, const int m) {
  vec ha[STAGES];
  for (int j = 0; j < m; ++j) {
    ha[j] = 1e-9 * G->g * (0.5 - 0.25 * j);
  }
  const size_t n = G->links.lay.size;
  vec *restrict out = G->y_new;
  for (size_t i = 0; i < n; ++i) {
    out[i] = G->y[i] + weighted_sum(i, m, ha, G->stage);
  }
}

INLINE void weigh(group *G, size_t i, const size_t pair, const int m, const vec *e, vec *worst,
                  vec *total) {
  const vec one = G->weights[i] * weighted_sum(i, m, e, G->stage);
  vec square = one * one;
  if (pair) {
    const vec two = G->weights[i] * weighted_sum(i + pair, m, e, G->stage);
    square = fma_(two, two, square);
  }
  *worst = larger(square, *worst);
  *total += square;
}

INLINE void error_of(group *G, const int m) {
  const bd_layout *lay = &G->links.lay;
  vec e[STAGES], worst = splat(0.0), total = splat(0.0);
  for (int j = 0; j < m; ++j) {
    e[j] = 1e-9 * G->g * (0.5 - 0.25 * j);
  }
  const size_t stride = (size_t)lay->stride;
  for (size_t i = BD_HALO; i < BD_HALO + (size_t)lay->n; ++i) {
    weigh(G, i, stride, m, e, &worst, &total);
    weigh(G, i + 3 * stride, stride, m, e, &worst, &total);
    weigh(G, i + F_PHI * stride, 0, m, e, &worst, &total);
    weigh(G, i + F_VPHI * stride, 0, m, e, &worst, &total);
    weigh(G, i + F_MU * stride, 0, m, e, &worst, &total);
  }
  for (size_t i = (size_t)lay->theta; i < lay->size; ++i) {
    weigh(G, i, 0, m, e, &worst, &total);
  }
  vec inverse;
  root_and_inverse(worst + 1e-300, &G->error, &inverse);
  G->error += total - total;
}

/* the loops of each length have one of their own, as in the core */
#define LENGTHS(X) X(1) X(2) X(3) X(4) X(5) X(6) X(7)
#define CASE(call, m)                                                                              \
  case m:                                                                                          \
    call(of, m);                                                                                   \
    break;

static void group_combine(void *of, int m) {
  switch (m) {
#define X(m) CASE(combine, m)
    LENGTHS(X)
#undef X
  }
}

static void group_error(void *of, int m) {
  switch (m) {
#define X(m) CASE(error_of, m)
    LENGTHS(X)
#undef X
  }
}

#define TEXT2(a) #a
#define TEXT(a) TEXT2(a)
extern const lanes_kernels LANES_NAME(LANES_LEVEL);
const lanes_kernels LANES_NAME(LANES_LEVEL) = {
    .level = TEXT(LANES_LEVEL),
    .width = DRIVES,
    .make = group_make,
    .rate = group_rate,
    .linearise = group_linearise,
    .factor = group_factor,
    .solve = group_solve,
    .ring_factor = group_ring_factor,
    .ring_solve = group_ring_solve,
    .combine = group_combine,
    .error = group_error,
    .read = group_read,
};
