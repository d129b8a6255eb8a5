/* SPDX-License-Identifier: MIT
 *
 * The ring of blocks of an ALE belt: which unknown stands where, and its memory.
 */
#include <math.h>
#include <string.h>

#include "belts/ale.h"

/* --- layout ----------------------------------------------------------------------------------- */

static void carve_slab(bd_carver *carver, int stride, int **block) {
  int *begin = bd_carve(carver, (size_t)stride, sizeof *begin);
  *block = begin ? begin + BD_HALO : NULL;
}

static void carve_rows(bd_carver *carver, int stride, int count, double **rows) {
  double *begin = bd_carve(carver, (size_t)(count * stride), sizeof *begin);
  *rows = begin ? begin + BD_HALO : NULL;
}

static int states_of(const bd_ale_drive *drive, int j) {
  const bd_friction *friction = drive->pulleys[j].friction;
  return friction ? bd_friction_states(friction) : 0;
}

/* Unknowns of block b of arc j, n - 1 of them, and of the span behind it, the n-th. */
static int unknowns_of(const bd_ale_drive *drive, int j, int b) {
  const int n = drive->pulleys[j].cells;
  return b == n - 1       ? bd_ale_unknowns(drive->along)
         : b == n / 2 - 1 ? 3 + 4 * states_of(drive, j)
                          : 2 + 2 * states_of(drive, j);
}

static int fours(int n) {
  return (n + 3) / 4 * 4;
}

/* The ring begins with the second block of arc 0, and ends with the first. */
static void carve_blocks(bd_carver *carver, bd_ale_ring *ring, const bd_ale_drive *drive) {
  const int np = drive->np, last = unknowns_of(drive, 0, 0);
  int n = 0, at = 0, largest = 0;
  for (int j = 0; j < np; ++j) {
    for (int k = 0; k < drive->pulleys[j].cells; ++k) {
      const int of = unknowns_of(drive, j, k);
      largest = fours(of) > largest ? fours(of) : largest;
      at += of;
      ++n;
    }
  }
  ring->n = n;
  ring->unknowns = at;
  BD_CARVE(carver, ring->blocks, n);
  BD_CARVE(carver, ring->from, fours(last) * at);
  BD_CARVE(carver, ring->scratch, largest * last);
  BD_CARVE(carver, ring->lanes, at * BD_LANES);
  for (int j = 0, b = n - 1; j < np; ++j) {
    const int cells = drive->pulleys[j].cells, before_j = (j + np - 1) % np;
    for (int k = 0; k < cells; ++k, b = (b + 1) % n) {
      const int of = unknowns_of(drive, j, k);
      const int before = k > 0 ? unknowns_of(drive, j, k - 1)
                               : unknowns_of(drive, before_j, drive->pulleys[before_j].cells - 1);
      const int after =
          k + 1 < cells ? unknowns_of(drive, j, k + 1) : unknowns_of(drive, (j + 1) % np, 0);
      double *all;
      BD_CARVE(carver, all, fours(of) * (2 * before + 2 * of + 2 * after + last));
      if (carver->base) {
        bd_ale_block *block = &ring->blocks[b];
        block->n = of;
        block->lead = fours(of);
        block->usual[0] = b > 0 && of == 4 && before == 4;
        block->usual[1] = b + 2 < n && of == 4 && after == 4;
        double **const parts[] = {&block->back,    &block->own,     &block->ahead, &block->inverse,
                                  &block->over[0], &block->over[1], &block->far};
        const int sizes[] = {before, of, after, of, before, after, last};
        for (int p = 0; p < 7; all += block->lead * sizes[p++]) {
          *parts[p] = all;
        }
      }
    }
  }
  at = 0;
  for (int b = 0; b < n && carver->base; at += ring->blocks[b++].n) {
    ring->blocks[b].at = at;
    ring->blocks[b].from = ring->from + at * fours(last);
  }
}

/* Which unknown stands in which block, and where there. */
static void place_unknowns(const bd_ale_newton *newton, const bd_ale_drive *drive) {
  const int n = newton->ring.n, np = drive->np;
  for (int j = 0, b = n - 1; j < np; ++j) {
    const int cells = drive->pulleys[j].cells, begin = bd_ale_first_slot(drive, j);
    const int span = (b + cells - 1) % n, half = cells / 2, states = states_of(drive, j);
    const int next = bd_ale_first_slot(drive, (j + 1) % np);
    for (int k = 0; k < cells; ++k) {
      const int slot = begin + k, right = k >= half;
      newton->cell_block[slot] = (b + k - right) % n;
      newton->cell_at[slot] = k == half ? 2 + 2 * states : 0;
      if (k > 0) { /* the first stands with the span before it */
        newton->node_block[slot] = k > half ? newton->cell_block[slot] : (b + k - 1) % n;
        newton->node_at[slot] = 1 + 2 * states;
      }
    }
    newton->cell_block[begin + cells] = newton->node_block[begin + cells] = span;
    newton->cell_at[begin + cells] = 0;
    newton->node_at[begin + cells] = 1;
    newton->node_block[next] = span;
    newton->node_at[next] = 2;
    b = (span + 1) % n;
  }
}

static double *entry_at(const bd_ale_newton *newton, const int row[2], const int column[2]) {
  const bd_ale_ring *ring = &newton->ring;
  const bd_ale_block *block = &ring->blocks[row[0]];
  const int ahead = row[0] + 1 < ring->n ? row[0] + 1 : 0;
  double *of = column[0] == row[0] ? block->own : column[0] == ahead ? block->ahead : block->back;
  return of + column[1] * block->lead + row[1];
}

/* -1: there is none. */
static void place_row(const bd_ale_newton *newton, bd_ale_row *row, const int of[2],
                      const int cells[3], const int nodes[3]) {
  row->lead = newton->ring.blocks[of[0]].lead;
  row->at = newton->ring.blocks[of[0]].at + of[1];
  for (int k = 0; k < 3; ++k) {
    const int c = cells[k], n = nodes[k];
    if (c >= 0) {
      row->cells[k] = entry_at(newton, of, (int[2]){newton->cell_block[c], newton->cell_at[c]});
    }
    if (n >= 0) {
      row->nodes[k] = entry_at(newton, of, (int[2]){newton->node_block[n], newton->node_at[n]});
    }
  }
}

static void place_rows(const bd_ale_newton *newton, const bd_ale_drive *drive) {
  const int np = drive->np;
  for (int j = 0; j < np; ++j) {
    const int n = drive->pulleys[j].cells, begin = bd_ale_first_slot(drive, j);
    const int behind = (j + np - 1) % np, next = bd_ale_first_slot(drive, (j + 1) % np);
    const int before = bd_ale_first_slot(drive, behind) + drive->pulleys[behind].cells;
    for (int k = 0; k <= n; ++k) {
      const int slot = begin + k, is_span = k == n;
      const int cell[2] = {newton->cell_block[slot], newton->cell_at[slot]};
      const int node[2] = {newton->node_block[slot], newton->node_at[slot]};
      place_row(newton, &newton->cells[slot], cell,
                (int[3]){k > 0 ? slot - 1 : before, slot, is_span ? next : slot + 1},
                is_span ? (int[3]){slot - 1, -1, next + 1} : (int[3]){slot, slot + 1, -1});
      place_row(newton, &newton->nodes[slot], node, (int[3]){k > 0 ? slot - 1 : -1, slot, -1},
                k > 0 && !is_span ? (int[3]){slot - 1, slot, slot + 1} : (int[3]){-1, -1, -1});
    }
  }
}

void bd_ale_newton_carve(bd_carver *carver, bd_ale_newton *newton, const bd_ale_drive *drive,
                         int states) {
  const int np = drive->np, stride = BD_HALO + bd_ale_first_slot(drive, drive->np) + BD_LANES;
  newton->states = states;
  newton->stride = stride;
  newton->state_size = bd_ale_state_size(drive, states) - BD_HALO;
  carve_blocks(carver, &newton->ring, drive);
  int **const maps[] = {&newton->cell_block, &newton->cell_at, &newton->node_block,
                        &newton->node_at};
  for (int k = 0; k < 4; ++k) {
    carve_slab(carver, stride, maps[k]);
  }
  bd_ale_slopes *slopes = &newton->slopes;
  carve_rows(carver, stride, 1, &slopes->stretch);
  for (int u = 0; u < BD_ALE_BYS; ++u) {
    carve_rows(carver, stride, 1, &slopes->torque[u]);
    for (int end = 0; end < 2; ++end) {
      carve_rows(carver, stride, 1, &slopes->total[end][u]);
      carve_rows(carver, stride, states, &slopes->rate[end][u]);
    }
  }
  for (int end = 0; end < 2; ++end) {
    carve_rows(carver, stride, states, &slopes->rate_z[end]);
    carve_rows(carver, stride, states, &slopes->total_z[end]);
  }
  BD_CARVE(carver, newton->column, np * newton->ring.unknowns);
  BD_CARVE(carver, newton->row, np * newton->ring.unknowns);
  BD_CARVE(carver, newton->own, np);
  BD_CARVE(carver, newton->push, np * newton->ring.unknowns);
  BD_CARVE(carver, newton->push_by_rim, np * np);
  for (int of = 0; of < 2; ++of) {
    BD_CARVE(carver, newton->moved[of], np * newton->ring.unknowns);
    BD_CARVE(carver, newton->torque_by[of], np * np);
    BD_CARVE(carver, newton->push_by[of], np * np);
  }
  BD_CARVE(carver, newton->shear_row, 2 * np);
  BD_CARVE(carver, newton->shear_column, 2 * np * newton->ring.unknowns);
  BD_CARVE(carver, newton->shear_torque, 2 * np);
  BD_CARVE(carver, newton->shear_push, 2 * np);
  BD_CARVE(carver, newton->moves, 1);
  BD_CARVE(carver, newton->answers, np);
  BD_CARVE(carver, newton->cells, bd_ale_first_slot(drive, np));
  BD_CARVE(carver, newton->nodes, bd_ale_first_slot(drive, np));
  if (carver->base) {
    place_unknowns(newton, drive);
    place_rows(newton, drive);
  }
}

/* Goes through the unknowns: each with its place in a state. */
static void copy(const bd_ale_newton *newton, const bd_ale *ale, const bd_ale_state *y, double *x,
                 int gathers) {
#define COPY(place, number)                                                                        \
  do {                                                                                             \
    if (gathers) {                                                                                 \
      x[place] = (number);                                                                         \
    } else {                                                                                       \
      (number) = x[place];                                                                         \
    }                                                                                              \
  } while (0)
  for (int j = 0; j < ale->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    for (int k = arc->begin; k <= arc->begin + arc->n; ++k) {
      const int at = newton->cells[k].at;
      COPY(at, y->m[k]);
      COPY(newton->nodes[k].at, y->v[k]);
      for (int e = 0; e < 2 * arc->states && k < arc->begin + arc->n; ++e) {
        COPY(at + 1 + e, y->z[e / arc->states][e % arc->states * y->stride + k]);
      }
    }
    const int span = newton->cells[arc->begin + arc->n].at + 3;
    for (int n = 0; n < BD_ALE_MODES; ++n) {
      COPY(span + n, y->a[j * BD_ALE_MODES + n]);
      COPY(span + BD_ALE_MODES + n, y->p[j * BD_ALE_MODES + n]);
    }
    if (ale->along) {
      COPY(span - 3 + BD_ALE_ALONG, y->along[j]);
      COPY(span - 3 + BD_ALE_ALONG + 1, y->along_speed[j]);
    }
  }
#undef COPY
}

void bd_ale_gather(const bd_ale_newton *newton, const bd_ale *ale, const bd_ale_state *y,
                   double *x) {
  copy(newton, ale, y, x, 1);
}

void bd_ale_scatter(const bd_ale_newton *newton, const bd_ale *ale, const double *x,
                    const bd_ale_state *y) {
  copy(newton, ale, y, (double *)x, 0);
}
