/* SPDX-License-Identifier: MIT
 *
 * The ring of blocks of an ALE belt: which unknown stands where, and its memory.
 */
#include <math.h>
#include <string.h>

#include "belts/ale.h"

/* --- layout ----------------------------------------------------------------------------------- */

static int slab(const bd_ale *ale) {
  return BD_HALO + ale->slots + BD_LANES;
}

static void carve_slab(bd_carver *carver, const bd_ale *ale, int **block) {
  int *begin = bd_carve(carver, (size_t)slab(ale), sizeof *begin);
  *block = begin ? begin + BD_HALO : NULL;
}

static void carve_rows(bd_carver *carver, const bd_ale *ale, int count, double **rows) {
  double *begin = bd_carve(carver, (size_t)(count * slab(ale)), sizeof *begin);
  *rows = begin ? begin + BD_HALO : NULL;
}

/* Unknowns of block b of an arc, n - 1 of them, and of the span behind it, the n-th. */
static int unknowns_of(const bd_ale *ale, const bd_ale_arc *arc, int b) {
  return b == arc->n - 1       ? 3 + 2 * ale->modes
         : b == arc->n / 2 - 1 ? 3 + 4 * arc->states
                               : 2 + 2 * arc->states;
}

/* The ring begins with the second block of arc 0, and ends with the first. */
static void carve_blocks(bd_carver *carver, bd_ale_ring *ring, const bd_ale *ale) {
  int n = 0, at = 0, last = 0;
  for (int j = 0; j < ale->np; ++j) {
    n += ale->arcs[j].n;
  }
  ring->n = n;
  ring->largest = 0;
  BD_CARVE(carver, ring->blocks, n);
  for (int j = 0, b = n - 1; j < ale->np; ++j) {
    for (int k = 0; k < ale->arcs[j].n; ++k, b = (b + 1) % n) {
      const int of = unknowns_of(ale, &ale->arcs[j], k);
      if (carver->base) {
        ring->blocks[b].n = ring->blocks[b].lead = of;
      }
      last = b == n - 1 ? of : last;
      ring->largest = of > ring->largest ? of : ring->largest;
      at += of;
    }
  }
  ring->unknowns = at;
  at = 0;
  BD_CARVE(carver, ring->scratch, 2 * ring->largest * ring->largest);
  for (int j = 0, b = n - 1; j < ale->np; ++j) {
    for (int k = 0; k < ale->arcs[j].n; ++k, b = (b + 1) % n) {
      const int of = unknowns_of(ale, &ale->arcs[j], k);
      const bd_ale_arc *behind = k > 0 ? &ale->arcs[j] : &ale->arcs[ale->arcs[j].before];
      const int before = unknowns_of(ale, behind, (k + behind->n - 1) % behind->n);
      const bd_ale_arc *ahead =
          k + 1 < ale->arcs[j].n ? &ale->arcs[j] : &ale->arcs[ale->arcs[j].next];
      const int after = unknowns_of(ale, ahead, k + 1 < ale->arcs[j].n ? k + 1 : 0);
      /* back, own and ahead together, to be cleared at once */
      double *all;
      BD_CARVE(carver, all, of * (2 * before + 2 * of + 2 * after + 2 * last));
      if (carver->base) {
        bd_ale_block *block = &ring->blocks[b];
        double **const parts[] = {&block->back,   &block->own,  &block->ahead, &block->inverse,
                                  &block->behind, &block->next, &block->far,   &block->from};
        const int sizes[] = {before, of, after, of, before, after, last, last};
        for (int p = 0; p < 8; all += of * sizes[p++]) {
          *parts[p] = all;
        }
      }
    }
  }
  for (int b = 0; b < n && carver->base; at += ring->blocks[b++].n) {
    ring->blocks[b].at = at;
  }
}

void bd_ale_newton_carve(bd_carver *carver, bd_ale_newton *newton, const bd_ale *ale, int states) {
  newton->states = states;
  newton->stride = slab(ale);
  newton->state_size = bd_ale_state_size(ale, states) - BD_HALO;
  carve_blocks(carver, &newton->ring, ale);
  int **const maps[] = {&newton->cell_block, &newton->cell_at, &newton->node_block,
                        &newton->node_at};
  for (int k = 0; k < 4; ++k) {
    carve_slab(carver, ale, maps[k]);
  }
  bd_ale_slopes *slopes = &newton->slopes;
  carve_rows(carver, ale, 1, &slopes->stretch);
  for (int u = 0; u < BD_ALE_BYS; ++u) {
    carve_rows(carver, ale, 1, &slopes->torque[u]);
    for (int end = 0; end < 2; ++end) {
      carve_rows(carver, ale, 1, &slopes->total[end][u]);
      carve_rows(carver, ale, states, &slopes->rate[end][u]);
    }
  }
  for (int end = 0; end < 2; ++end) {
    carve_rows(carver, ale, states, &slopes->rate_z[end]);
    carve_rows(carver, ale, states, &slopes->total_z[end]);
  }
  BD_CARVE(carver, newton->column, ale->np * newton->ring.unknowns);
  BD_CARVE(carver, newton->row, ale->np * newton->ring.unknowns);
  BD_CARVE(carver, newton->own, ale->np);
  BD_CARVE(carver, newton->push, ale->np * newton->ring.unknowns);
  BD_CARVE(carver, newton->push_by_rim, ale->np * ale->np);
  for (int of = 0; of < 2; ++of) {
    BD_CARVE(carver, newton->moved[of], ale->np * newton->ring.unknowns);
    BD_CARVE(carver, newton->torque_by[of], ale->np * ale->np);
    BD_CARVE(carver, newton->push_by[of], ale->np * ale->np);
  }
  BD_CARVE(carver, newton->answers, ale->np);
}

void bd_ale_newton_make(bd_ale_newton *newton, const bd_ale *ale) {
  const int n = newton->ring.n;
  for (int j = 0, b = n - 1; j < ale->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    const int span = (b + arc->n - 1) % n, half = arc->n / 2;
    for (int k = 0; k < arc->n; ++k) {
      const int slot = arc->begin + k, right = k >= half;
      newton->cell_block[slot] = (b + k - right) % n;
      newton->cell_at[slot] = k == half ? 2 + 2 * arc->states : 0;
      newton->node_block[slot] = (b + k - 1) % n;
      newton->node_at[slot] = 1 + 2 * arc->states;
      if (k > half) { /* it stands with the cell behind it */
        newton->node_block[slot] = newton->cell_block[slot];
      }
    }
    newton->cell_block[arc->begin + arc->n] = newton->node_block[arc->begin + arc->n] = span;
    newton->cell_at[arc->begin + arc->n] = 0;
    newton->node_at[arc->begin + arc->n] = 1;
    newton->node_block[ale->arcs[arc->next].begin] = span;
    b = (span + 1) % n;
  }
  for (int j = 0; j < ale->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    const int before = ale->arcs[arc->before].begin + ale->arcs[arc->before].n;
    newton->node_block[arc->begin] = newton->cell_block[before];
    newton->node_at[arc->begin] = 2;
  }
}

/* Goes through the unknowns: each with its place in a state. */
static void copy(const bd_ale_newton *newton, const bd_ale *ale, const bd_ale_state *y, double *x,
                 int gathers) {
  const bd_ale_block *blocks = newton->ring.blocks;
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
      const int at = blocks[newton->cell_block[k]].at + newton->cell_at[k];
      COPY(at, y->m[k]);
      COPY(blocks[newton->node_block[k]].at + newton->node_at[k], y->v[k]);
      for (int e = 0; e < 2 * arc->states && k < arc->begin + arc->n; ++e) {
        COPY(at + 1 + e, y->z[e / arc->states][e % arc->states * y->stride + k]);
      }
    }
    const int span = blocks[newton->cell_block[arc->begin + arc->n]].at + 3;
    for (int n = 0; n < ale->modes; ++n) {
      COPY(span + n, y->a[j * ale->modes + n]);
      COPY(span + ale->modes + n, y->p[j * ale->modes + n]);
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
