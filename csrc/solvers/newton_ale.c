/* SPDX-License-Identifier: MIT
 *
 * The ALE belt in the linear systems of the implicit methods (newton_system.c): its unknowns are
 * all of first order, a ring of blocks (kernels/ale_blocks.h) with a column for each body,
 *
 *   (1 - g J) k = g c - (columns of bodies) k,  J = ring + (columns of shears) (rows of shears),
 *
 * by the derivatives of belts/ale_jacobian.c. A mount's travel is eliminated, k_q = g (c_q + k_v).
 */
#include <math.h>
#include <string.h>

#include "solvers/solvers.h"

struct bd_ale_system {
  bd_ale_newton newton;
  const bd_ale_kernels *kernels;
  int *span_block; /* of spans */
  int *entry;      /* of the ring's unknowns in the state vector */
  double *bends;   /* by mount, force of the belt by what the lever turns */
  double *inertia; /* of the belt on mounts (mounts, mounts) */
  int shears;      /* of both ends of spans */
  double *over;    /* the ring's solutions of their columns; factors of 1 - rows over, shears */
  double *by_over, *factors;
  int *pivots, solved; /* if these columns and those of bodies are */
};

/* --- layout ----------------------------------------------------------------------------------- */

static void place_unknowns(struct bd_ale_system *own, const bd_model *model) {
  const bd_layout *lay = &model->lay;
  const bd_ale_drive *drive = model->drive;
  const bd_ale_newton *newton = &own->newton;
  const bd_ale_block *blocks = newton->ring.blocks;
  for (int i = 0, c = 0; i < lay->np; ++i) {
    const int j = (i + 1) % lay->np, first = c, last = c + drive->pulleys[j].cells;
    const int span = bd_ale_first_slot(drive, i) + drive->pulleys[i].cells;
    const int states = bd_friction_states(drive->pulleys[j].friction);
    for (; c <= last; ++c) {
      const int slot = c == first ? span : bd_ale_first_slot(drive, j) + c - first - 1;
      int *cell = own->entry + blocks[newton->cell_block[slot]].at + newton->cell_at[slot];
      int *node = own->entry + blocks[newton->node_block[slot]].at + newton->node_at[slot];
      *cell = lay->m + c;
      *node = lay->v + c;
      for (int e = 0; e < 2 * states && c > first; ++e) {
        const int of = e / states * lay->states + e % states;
        cell[1 + e] = (int)bd_field_offset(lay, F_MU, of) + c;
      }
    }
    own->span_block[i] = newton->cell_block[span];
    int *modes = own->entry + blocks[newton->cell_block[span]].at + 3;
    for (int n = 0; n < lay->modes; ++n) {
      modes[n] = lay->a + i * lay->modes + n;
      modes[lay->modes + n] = lay->p + i * lay->modes + n;
    }
    if (lay->n_along > 0) {
      modes[2 * lay->modes] = lay->along + i;
      modes[2 * lay->modes + 1] = lay->along_speed + i;
    }
  }
}

static void carve(bd_carver *carver, bd_newton_system *system, const bd_model *model) {
  const bd_layout *lay = &model->lay;
  struct bd_ale_system *own, sizes;
  BD_CARVE(carver, own, 1);
  struct bd_ale_system *to = carver->base ? own : &sizes;
  bd_ale_newton_carve(carver, &to->newton, model->drive, lay->states);
  const int unknowns = to->newton.ring.unknowns;
  BD_CARVE(carver, to->span_block, lay->np);
  BD_CARVE(carver, to->entry, unknowns);
  BD_CARVE(carver, to->bends, lay->nm);
  BD_CARVE(carver, to->inertia, lay->nm * lay->nm);
  system->width = BD_HALO + (unknowns + BD_LANES - 1) / BD_LANES * BD_LANES;
  const int shears = 2 * lay->np;
  BD_CARVE(carver, to->by_over, shears * shears);
  BD_CARVE(carver, to->factors, shears);
  BD_CARVE(carver, to->pivots, shears);
  BD_CARVE(carver, system->x, system->width);
  BD_CARVE(carver, system->border, (bd_count_bodies(lay) + shears) * system->width);
  if (carver->base) {
    system->x += BD_HALO;
    system->ale = own;
    own->kernels = model->kernels->ale;
    own->over = bd_newton_border(system, bd_count_bodies(lay));
    own->shears = shears;
    place_unknowns(own, model);
  }
}

/* --- a linearisation, its factors ------------------------------------------------------------- */

static void linearise(bd_newton_system *system, const bd_plan *plan, const double *y) {
  struct bd_ale_system *own = system->ale;
  bd_ale_belt *belt = plan->ale;
  bd_ale_evaluate(plan, y);
  bd_ale_linearise(&own->newton, &belt->ale, own->kernels, &belt->y, &belt->dy);
  for (int m = 0; m < plan->model->lay.nm; ++m) {
    const bd_ale_arc *arc = &belt->ale.arcs[plan->model->lay.mounted[m]];
    own->bends[m] = arc->force[0] * arc->axis.bend[0] + arc->force[1] * arc->axis.bend[1];
  }
  if (belt->ale.moving) {
    bd_ale_carried(plan, own->inertia);
    bd_ale_linearise_axes(&own->newton, &belt->ale, own->kernels, &belt->y, &belt->dy, &belt->spare,
                          plan->model->lay.nm, plan->model->lay.mounted);
    belt->known = 0;
  }
}

/* The arc whose belt touches a body; -1: none. */
static int arc_of(const bd_layout *lay, int body) {
  if (body >= lay->np && body < lay->np + lay->nm) {
    return lay->mounted[body - lay->np];
  }
  for (int j = 0; j < lay->np; ++j) {
    if (body == bd_belt_body(lay, j)) {
      return j;
    }
  }
  return -1;
}

static void fill(bd_newton_system *system, const bd_plan *plan, double *y, double g, double h,
                 double *c, double mass) {
  const bd_layout *lay = &plan->model->lay;
  struct bd_ale_system *own = system->ale;
  const bd_ale_newton *newton = &own->newton;
  const int unknowns = newton->ring.unknowns;
  (void)y, (void)h, (void)c, (void)mass;
  system->g = own->newton.ring.g = g;
  for (int body = 0; body < bd_count_bodies(lay); ++body) {
    if (arc_of(lay, body) < 0) {
      memset(bd_newton_border(system, body), 0, (size_t)unknowns * sizeof(double));
    }
  }
  for (int j = 0; j < lay->np; ++j) {
    double *column = bd_newton_border(system, bd_belt_body(lay, j));
    system->own[j] = -g * newton->own[j];
    for (int u = 0; u < unknowns; ++u) {
      column[u] = -g * newton->column[j * unknowns + u];
    }
  }
  for (int m = 0; m < lay->nm; ++m) {
    double *column = bd_newton_border(system, lay->np + m);
    const int at = lay->mounted[m] * unknowns;
    for (int u = 0; u < unknowns; ++u) {
      column[u] = -g * (newton->moved[0][at + u] + g * newton->moved[1][at + u]);
    }
  }
}

/* A shear by a vector of the ring's unknowns. */
static double shear_of(const struct bd_ale_system *own, int s, const double *x) {
  const bd_ale_block *blocks = own->newton.ring.blocks;
  const double *row = own->newton.shear_row[s];
  double sum = 0.0;
  const bd_ale_block *span = &blocks[own->span_block[s / 2]];
  x += span->at;
  for (int c = 0; c < span->n; ++c) {
    sum += row[c] * x[c];
  }
  return sum;
}

static void factor(bd_newton_system *system) {
  struct bd_ale_system *own = system->ale;
  const bd_ale_newton *newton = &own->newton;
  const int unknowns = newton->ring.unknowns;
  own->kernels->factor(&newton->ring);
  for (int s = 0; s < own->shears; ++s) {
    for (int u = 0; u < unknowns; ++u) {
      own->over[s * system->width + u] = system->g * newton->shear_column[s * unknowns + u];
    }
  }
  own->solved = 0;
}

/* Of the ring alone: columns of shears with those of bodies, which stand before them. */
static void solve_columns(const bd_newton_system *system, int n, double *v) {
  struct bd_ale_system *own = system->ale;
  const bd_ale_ring *ring = &own->newton.ring;
  const int shears = own->shears, beside = v + n * system->width == own->over;
  own->kernels->solve_all(ring, beside ? n + shears : n, system->width, v);
  if (!beside) {
    own->kernels->solve_all(ring, shears, system->width, own->over);
  }
  for (int r = 0; r < shears; ++r) {
    for (int s = 0; s < shears; ++s) {
      own->by_over[r * shears + s] =
          (r == s ? 1.0 : 0.0) - shear_of(own, r, own->over + s * system->width);
    }
  }
  bd_dense_factor(shears, own->by_over, own->pivots);
  own->solved = 1;
}

/* Solutions of the ring alone, with the shears that follow. */
static void add_shears(const bd_newton_system *system, double *x) {
  const struct bd_ale_system *own = system->ale;
  const int n = own->shears;
  for (int k = 0; k < n; ++k) {
    own->factors[k] = -shear_of(own, k, x);
  }
  bd_dense_solve(n, own->by_over, own->pivots, own->factors);
  own->kernels->deduct(own->newton.ring.unknowns, n, system->width, own->over, own->factors, x);
}

static void solve(const bd_newton_system *system, const bd_layout *lay, int n, double *v) {
  const struct bd_ale_system *own = system->ale;
  (void)lay;
  if (own->solved) {
    own->kernels->solve(&own->newton.ring, v);
  } else {
    solve_columns(system, n, v);
  }
  for (int k = 0; k < n; ++k) {
    add_shears(system, v + k * system->width);
  }
}

/* --- bodies ----------------------------------------------------------------------------------- */

/* Of mount m by that of mount k; its lever's turning stands with the mount itself (mounts.c). */
static double push_by_travel(const bd_newton_system *system, const bd_layout *lay, int m, int k) {
  const struct bd_ale_system *own = system->ale;
  return own->newton.push_by[1][lay->mounted[m] * lay->np + lay->mounted[k]] -
         (m == k ? own->bends[m] : 0.0);
}

static void entries_of_bodies(const bd_newton_system *system, const bd_layout *lay, double damped,
                              int n, double *w) {
  const struct bd_ale_system *own = system->ale;
  const bd_ale_newton *newton = &own->newton;
  const int np = lay->np;
  const double g = system->g;
  for (int m = 0; m < lay->nm; ++m) {
    const int axis = lay->mounted[m];
    double *row = w + (np + m) * n;
    for (int k = 0; k < lay->nm; ++k) {
      const double by_speed = newton->push_by[0][axis * np + lay->mounted[k]];
      row[np + k] += own->inertia[m * lay->nm + k] * damped -
                     g * (by_speed + g * push_by_travel(system, lay, m, k));
    }
    for (int j = 0; j < np; ++j) {
      const int body = bd_belt_body(lay, j), at = j * np + axis;
      row[body] -= g * newton->push_by_rim[axis * np + j];
      w[body * n + np + m] -= g * (newton->torque_by[0][at] + g * newton->torque_by[1][at]);
    }
  }
}

/* The row of a body, of forces by the ring's unknowns; NULL: the belt does not touch it. */
static const double *forces_on(const bd_newton_system *system, const bd_layout *lay, int body) {
  const bd_ale_newton *newton = &system->ale->newton;
  const int arc = arc_of(lay, body), is_mount = body >= lay->np && body < lay->np + lay->nm;
  return arc < 0 ? NULL : (is_mount ? newton->push : newton->row) + arc * newton->ring.unknowns;
}

static double product_of(const double *a, const double *b, int first, int last) {
  double sum[4] = {0.0}, more = 0.0;
  for (; first + 4 <= last; first += 4) {
    for (int k = 0; k < 4; ++k) {
      sum[k] += a[first + k] * b[first + k];
    }
  }
  for (; first < last; ++first) {
    more += a[first] * b[first];
  }
  return (sum[0] + sum[1]) + (sum[2] + sum[3]) + more;
}

/* Of an arc, both spans beside it and the blocks behind these, which may go round the ring's end.
 */
static double row(const bd_newton_system *system, const bd_plan *plan, int body, const double *v) {
  const bd_ale_newton *newton = &system->ale->newton;
  const bd_ale_ring *ring = &newton->ring;
  const double *by = forces_on(system, &plan->model->lay, body);
  if (!by) {
    return 0.0;
  }
  const bd_ale_arc *arc = &plan->ale->ale.arcs[arc_of(&plan->model->lay, body)];
  const int before = newton->node_block[arc->begin],
            after = newton->cell_block[arc->begin + arc->n];
  const bd_ale_block *last = &ring->blocks[(after + 1) % ring->n];
  const int from = ring->blocks[(before + ring->n - 1) % ring->n].at, to = last->at + last->n;
  const double sum = from < to ? product_of(by, v, from, to)
                               : product_of(by, v, from, ring->unknowns) + product_of(by, v, 0, to);
  return -system->g * sum;
}

/* --- solutions -------------------------------------------------------------------------------- */

static void product(bd_newton_system *system, const bd_plan *plan, double *c) {
  const bd_layout *lay = &plan->model->lay;
  const struct bd_ale_system *own = system->ale;
  const bd_ale_newton *newton = &own->newton;
  const int unknowns = newton->ring.unknowns, np = lay->np;
  const double g = system->g;
  for (int u = 0; u < unknowns; ++u) {
    system->x[u] = g * c[own->entry[u]];
  }
  for (int m = 0; m < lay->nm; ++m) { /* given travels, and what the belt weighs on mounts */
    const double moves = g * g * c[lay->travel + m];
    const int axis = lay->mounted[m];
    for (int u = 0; u < unknowns; ++u) {
      system->x[u] += moves * newton->moved[1][axis * unknowns + u];
    }
    for (int j = 0; j < np; ++j) {
      system->rhs[bd_belt_body(lay, j)] += moves * newton->torque_by[1][j * np + axis];
    }
    for (int k = 0; k < lay->nm; ++k) {
      system->rhs[np + k] += moves * push_by_travel(system, lay, k, m) +
                             g * own->inertia[k * lay->nm + m] * c[lay->travel_speed + m];
    }
  }
}

static void finish(const bd_newton_system *system, const bd_plan *plan, int n,
                   const double *columns, const double *factors, double *c) {
  const struct bd_ale_system *own = system->ale;
  const int unknowns = own->newton.ring.unknowns;
  (void)plan;
  own->kernels->deduct(unknowns, n, system->width, columns, factors, system->x);
  for (int u = 0; u < unknowns; ++u) {
    c[own->entry[u]] = system->x[u];
  }
}

static void restore(const bd_newton_system *system, const bd_plan *plan, double *c) {
  (void)system, (void)plan, (void)c;
}

/* --- entries of the Jacobian ------------------------------------------------------------------ */

static const double SHORT = 0x1p-200; /* s: a power of two, which costs no digit */

/* What bodies are moved by, forces in system->off, by one column; those in rhs are over g^2. */
static void put_forces(const bd_reading *r, int column) {
  const bd_layout *lay = &r->plan->model->lay;
  double *force = r->system->off;
  for (int m = 0; m < lay->nm; ++m) {
    force[lay->np + m] = bd_freedom_of(r->plan, lay->np + m).prescribed ? 0.0 : force[lay->np + m];
  }
  if (lay->nm > 0) {
    bd_ale_carry(r->plan, r->system->ale->inertia, force + lay->np);
  }
  for (int body = 0; body < bd_count_bodies(lay); ++body) {
    const bd_freedom of = bd_freedom_of(r->plan, body);
    const int is_mount = body >= lay->np && body < lay->np + lay->nm;
    bd_newton_put(r->to, of.prescribed ? -1 : of.speed, column,
                  force[body] / (is_mount ? 1.0 : of.inertia));
  }
}

static void put_column(const void *reading, int state) {
  const bd_reading *r = reading;
  const bd_layout *lay = &r->plan->model->lay;
  const struct bd_ale_system *own = r->system->ale;
  memset(r->c, 0, lay->size * sizeof *r->c);
  r->c[state] = 1.0;
  bd_newton_product(r->system, r->plan, r->c);
  for (int u = 0; u < own->newton.ring.unknowns; ++u) {
    bd_newton_put(r->to, own->entry[u], state, r->system->x[u] / (SHORT * SHORT));
  }
  for (int body = 0; body < bd_count_bodies(lay); ++body) {
    r->system->off[body] = r->system->rhs[body] / (SHORT * SHORT);
  }
  put_forces(r, state);
}

/* Of what follows the shears of span i an unknown's rate by another of the span. */
static double by_shears(const struct bd_ale_system *own, int i, int u, int c) {
  const bd_ale_newton *newton = &own->newton;
  double sum = 0.0;
  for (int s = 2 * i; s < 2 * i + 2; ++s) {
    sum += newton->shear_column[s * newton->ring.unknowns + u] * newton->shear_row[s][c];
  }
  return sum;
}

/* Those that are no neighbours of the span's block; each entry is put once. */
static void put_shears(const bd_reading *r, int i) {
  const struct bd_ale_system *own = r->system->ale;
  const bd_ale_ring *ring = &own->newton.ring;
  const int block = own->span_block[i];
  const bd_ale_block *span = &ring->blocks[block];
  for (int b = 0; b < ring->n; ++b) {
    const int away = (b - block + ring->n) % ring->n;
    for (int k = 0; k < ring->blocks[b].n * span->n && away > 1 && away < ring->n - 1; ++k) {
      const int u = ring->blocks[b].at + k / span->n, c = k % span->n;
      bd_newton_put(r->to, own->entry[u], own->entry[span->at + c], by_shears(own, i, u, c));
    }
  }
}

static void put_blocks(const bd_reading *r) {
  const struct bd_ale_system *own = r->system->ale;
  const bd_ale_ring *ring = &own->newton.ring;
  for (int b = 0; b < ring->n; ++b) {
    const bd_ale_block *block = &ring->blocks[b];
    const bd_ale_block *beside[3] = {&ring->blocks[(b + ring->n - 1) % ring->n], block,
                                     &ring->blocks[(b + 1) % ring->n]};
    const int near[3] = {(b + ring->n - 1) % ring->n, b, (b + 1) % ring->n};
    const double *const parts[3] = {block->back, block->own, block->ahead};
    for (int p = 0; p < 3; ++p) {
      int span = r->plan->model->lay.np;
      while (--span >= 0 && own->span_block[span] != near[p]) {
      }
      for (int k = 0; k < block->n * beside[p]->n; ++k) {
        const int at = k % block->n, column = k / block->n;
        bd_newton_put(r->to, own->entry[block->at + at], own->entry[beside[p]->at + column],
                      parts[p][column * block->lead + at] +
                          (span < 0 ? 0.0 : by_shears(own, span, block->at + at, column)));
      }
    }
  }
}

static void entries(bd_newton_system *system, bd_plan *plan, double *y, double *c,
                    struct bd_entries *to) {
  const bd_layout *lay = &plan->model->lay;
  const struct bd_ale_system *own = system->ale;
  const bd_reading r = {system, plan, to, c};
  const int unknowns = own->newton.ring.unknowns, bodies = bd_count_bodies(lay);
  fill(system, plan, y, SHORT, 0.0, NULL, 0.0);
  put_blocks(&r);
  for (int i = 0; i < lay->np; ++i) {
    put_shears(&r, i);
  }
  for (int j = 0; j < lay->np; ++j) {
    bd_newton_put(to, lay->theta + j, lay->omega + j, 1.0);
  }
  for (int u = 0; u < unknowns; ++u) {
    for (int body = 0; body < bodies; ++body) {
      const double *by = forces_on(system, lay, body);
      system->off[body] = by ? by[u] : 0.0;
    }
    put_forces(&r, own->entry[u]);
  }
  bd_newton_bodies(system, plan, SHORT, 0.0);
  for (int body = 0; body < bodies; ++body) {
    const int column = bd_freedom_of(plan, body).speed;
    for (int u = 0; u < unknowns; ++u) {
      bd_newton_put(to, own->entry[u], column, -bd_newton_border(system, body)[u] / SHORT);
    }
    for (int k = 0; k < bodies; ++k) {
      system->off[k] = -system->of_bodies[k * bodies + body] / SHORT;
    }
    put_forces(&r, column);
  }
  bd_newton_put_states(&r, put_column);
}

const bd_newton_belt bd_newton_ale = {.carve = carve,
                                      .linearise = linearise,
                                      .fill = fill,
                                      .factor = factor,
                                      .solve = solve,
                                      .row = row,
                                      .bodies = entries_of_bodies,
                                      .product = product,
                                      .finish = finish,
                                      .restore = restore,
                                      .entries = entries};
