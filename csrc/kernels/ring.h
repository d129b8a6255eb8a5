/* SPDX-License-Identifier: MIT
 *
 * The linear solver for a ring of nodes with D = 2, 3 or 4 unknowns each, compiled once per
 * instruction level: cyclic block tridiagonal, O(n), no pivoting among nodes. D is a constant where
 * the functions are put in place (RING below).
 *
 * The ring is cut into WIDTH arcs that are eliminated in lockstep, one vector lane an arc, one
 * row of nodes (the j-th of every arc) at a time. The last node of an arc, its separator, stays:
 * elimination couples it to the separator of the arc before (F, E below). The separators, a ring of
 * one lane each, are halved in number by every step of a cyclic reduction that all lanes take
 * together, until each stands alone. Arcs differ by one node at most; a shorter one begins with a
 * row of the identity that is coupled to nothing.
 *
 * The blocks stand in tiles (bd_assembled). Those of links that meet at joints alone have zeros,
 * which are left out, and entries that are the same all round, with e' = (-sin, cos) of a link and
 * q = -k e' + spin w e:
 *   link i to i - 1     [-k 1 | q_{i-1} ; k e'_i | -e'_i.q_{i-1} - bending]
 *   link i to i + 1     [-k 1 | -q_{i+1} ; -k e'_i | -e'_i.q_{i+1} - bending]
 * Diagonal blocks are those of an inertia plus stiffness and damping, positive definite but for
 * friction and links in compression, which is why no pivot is sought among nodes; a solve that went
 * wrong shows in numbers that are not finite or in the step's error. Within a block it is: of a
 * link in full slip, which is pressed back along n + mu t whichever way it moves against n, the
 * entry xx is 0 where n is at the angle of friction to y. Guarded by tests/c/test_kernels.c and
 * tests/test_jacobian.py.
 */
/* Steps of the cyclic reduction, log2 of the arcs. */
enum { REDUCTIONS = WIDTH == 8 ? 3 : WIDTH == 4 ? 2 : WIDTH == 2 ? 1 : 0 };

/* Entries of the largest block, and of its factors. */
enum { BLOCK = 16, FACTORS = 22 };

/* Where blocks of a node stand: of the node behind, its own, of the one ahead. */
enum { BACK, DIAGONAL, AHEAD };

/* Whether entry e of a block is anything but 0, and whether it is the same all round the ring:
 * where joints alone couple links, on whose own places contact may act. */
INLINE int is_set(const int place, const int e, const int joints) {
  return !joints || (place == DIAGONAL ? e % 3 < 2 && e < 6 : e != 1 && e != 3) || e == 8;
}

INLINE int is_shared(const int place, const int e, const int joints) {
  return joints && place != DIAGONAL && e % 4 == 0 && e < 8;
}

/* Whether it stands in the tiles: what is the same does once, and where joints alone couple links
 * k e' of a link stands with the link behind. */
INLINE int is_stored(const int place, const int e, const int joints) {
  return is_set(place, e, joints) && !(is_shared(place, e, joints) && (place == AHEAD || e > 0)) &&
         !(joints && place == AHEAD && (e == 6 || e == 7));
}

/* What a row keeps for the solves, a block each: D^-1, D the diagonal block; the coupling to the
 * node behind; E, that of the separator before the arc to this row; D^-1 U, what the node forward
 * is worth here; D^-1 F, the same of the separator before the arc. */
enum { INVERSE, BEHIND, TO_SEPARATOR, NEXT, LEFT, ROW_BLOCKS };

/* What the separators keep: times what stands 1, 2, 4 arcs before and after, and D^-1. */
enum { BEFORE = 0, AFTER = REDUCTIONS + 1, LAST = 2 * AFTER, END_BLOCKS };

/* --- lanes ----------------------------------------------------------------------------------- */

/* For every arc, what the arc `distance` before it has, or the one after it. */
INLINE vec from_before(vec v, const int distance) {
  return turned(v, -distance);
}

INLINE vec from_after(vec v, const int distance) {
  return turned(v, distance);
}

INLINE void all_before(const vec *block, const int n, const int distance, vec *out) {
  for (int i = 0; i < n; ++i) {
    out[i] = from_before(block[i], distance);
  }
}

INLINE void all_after(const vec *block, const int n, const int distance, vec *out) {
  for (int i = 0; i < n; ++i) {
    out[i] = from_after(block[i], distance);
  }
}

/* Where the arcs' rows begin. */
INLINE void places_of(const bd_ring *ring, ptrdiff_t *at) {
  for (int a = 0; a < WIDTH; ++a) {
    at[a] = ring->base[a];
  }
}

#include "kernels/ring_blocks.h"

/* --- separators ------------------------------------------------------------------------------ */

/* One step: every separator is freed of those `distance` before and after it, and is left coupled
 * to those twice as far. */
INLINE void reduce(const int size, const int distance, vec *d, vec *left, vec *right, vec *before,
                   vec *after) {
  const int entries = size * size, factors = end_factors(size);
  vec lu[FACTORS], near[BLOCK], far[FACTORS], new_left[BLOCK], new_right[BLOCK];
  decompose_end(size, lu, d);
  clear_block(size, new_left);
  clear_block(size, new_right);
  all_before(lu, factors, distance, far);
  divide_rows(size, far, left, before);
  all_after(lu, factors, distance, far);
  divide_rows(size, far, right, after);
  all_before(right, entries, distance, near);
  all_before(left, entries, distance, far);
  take_product(size, before, near, d, 0);
  take_product(size, before, far, new_left, 0);
  all_after(left, entries, distance, near);
  all_after(right, entries, distance, far);
  take_product(size, after, near, d, 0);
  take_product(size, after, far, new_right, 0);
  for (int i = 0; i < entries; ++i) {
    left[i] = new_left[i];
    right[i] = new_right[i];
  }
}

/* The last step: the separator before is the one after. */
INLINE void reduce_last(const int size, vec *d, vec *left, const vec *right, vec *before) {
  enum { HALF = WIDTH / 2 };
  vec lu[FACTORS], far[FACTORS];
  for (int i = 0; i < size * size; ++i) {
    left[i] += right[i];
  }
  if (HALF == 0) { /* it is itself */
    for (int i = 0; i < size * size; ++i) {
      d[i] += left[i];
    }
    return;
  }
  decompose_end(size, lu, d);
  all_before(lu, end_factors(size), HALF, far);
  divide_rows(size, far, left, before);
  all_before(left, size * size, HALF, far);
  take_product(size, before, far, d, 0);
}

INLINE void separators_factor(const int size, vec *ends, vec *d, vec *left, vec *right) {
  const int entries = size * size;
  vec lu[FACTORS], one[BLOCK];
  if (REDUCTIONS > 1) {
    reduce(size, 1, d, left, right, ends + BEFORE * entries, ends + AFTER * entries);
  }
  if (REDUCTIONS > 2) {
    reduce(size, 2, d, left, right, ends + (BEFORE + 1) * entries, ends + (AFTER + 1) * entries);
  }
  reduce_last(size, d, left, right, ends + (REDUCTIONS > 0 ? REDUCTIONS - 1 : 0) * entries);
  decompose_end(size, lu, d);
  if (size != 3) {
    invert(size, lu, ends + LAST * entries);
    return;
  }
  for (int i = 0; i < entries; ++i) {
    one[i] = splat(i % (size + 1) == 0 ? 1.0 : 0.0);
  }
  divide_rows(size, lu, one, ends + LAST * entries);
}

INLINE void take_neighbours(const int d, const vec *ends, const int step, vec *r) {
  vec before[4], after[4];
  all_before(r, d, 1 << step, before);
  all_after(r, d, 1 << step, after);
  take_column(d, ends + (BEFORE + step) * d * d, before, r, 1, 0);
  if (step < REDUCTIONS - 1) {
    take_column(d, ends + (AFTER + step) * d * d, after, r, 1, 0);
  }
}

INLINE void separators_solve(const int d, const vec *ends, vec *r, vec *u) {
  if (REDUCTIONS > 0) {
    take_neighbours(d, ends, 0, r);
  }
  if (REDUCTIONS > 1) {
    take_neighbours(d, ends, 1, r);
  }
  if (REDUCTIONS > 2) {
    take_neighbours(d, ends, 2, r);
  }
  apply(d, ends + LAST * d * d, r, u);
}

/* --- factorisation --------------------------------------------------------------------------- */

/* How far the elimination is: the row's diagonal block D and, of the row before, its factors; what
 * couples the row to the separator before its arc, F, and that separator to the row, E; what the
 * rows so far take from that separator's diagonal block. */
typedef struct elimination {
  vec d[BLOCK], lu[FACTORS], left[BLOCK], to_separator[BLOCK], own[BLOCK];
} elimination;

/* Where the nodes of the arcs' rows j stand in the tiles; the one before the first is the last. */
INLINE void tiles_of(const int d, const bd_ring *ring, int j, ptrdiff_t *to) {
  for (int a = 0; a < WIDTH; ++a) {
    const int at = ring->base[a] + j, i = at < 0 ? at + ring->n : at;
    to[a] = i / BD_LANES * (3 * d * d * BD_LANES) + i % BD_LANES;
  }
}

/* A row's blocks, and what couples the one behind to it; those of the row before stand there yet
 * (again), and with joints alone have q and k e' of the link behind, of the other sign. */
INLINE void load_row(const int d, elimination *e, const double *w, const ptrdiff_t *here,
                     const ptrdiff_t *behind, vec *back, vec *forward, const int again,
                     const int joints) {
  const vec none = splat(0.0);
  vec q[2] = {none, none}, lever[2] = {none, none};
  if (joints && again) {
    for (int u = 0; u < 2; ++u) {
      q[u] = -forward[3 * u + 2];
      lever[u] = -back[6 + u];
    }
  } else if (joints) {
    for (int u = 0; u < 2; ++u) {
      q[u] = gather(w + (3 * u + 2) * BD_LANES, here);
      lever[u] = -gather(w + (6 + u) * BD_LANES, behind);
    }
  }
  for (int i = 0; i < d * d; ++i) {
    const double *first = w + i * BD_LANES, *own = first + d * d * BD_LANES;
    const int shared = is_shared(BACK, i, joints), set = is_set(BACK, i, joints);
    const int turns = joints && (i == 2 || i == 5), levers = joints && (i == 6 || i == 7);
    back[i] = shared ? splat(w[0]) : turns ? q[i / 3] : set ? gather(first, here) : none;
    e->d[i] = is_set(DIAGONAL, i, joints) ? gather(own, here) : none;
    forward[i] = shared   ? back[i]
                 : levers ? lever[i % 2]
                 : set    ? gather(own + d * d * BD_LANES, behind)
                          : none;
  }
}

/* Frees a row of the one behind it, which keeps what the solves need. */
INLINE void eliminate_behind(const int d, elimination *e, vec *behind, const vec *back,
                             const vec *forward, const int joints) {
  const int entries = d * d;
  vec next[BLOCK], over[BLOCK], left[BLOCK], to_separator[BLOCK];
  for (int c = 0; c < d; ++c) {
    substitute(d, e->lu, forward + c, next + c, d);
    substitute(d, e->lu, e->left + c, over + c, d);
  }
  clear_block(d, left);
  clear_block(d, to_separator);
  for (int i = 0; i < entries; ++i) {
    behind[NEXT * entries + i] = next[i];
    behind[LEFT * entries + i] = over[i];
    behind[TO_SEPARATOR * entries + i] = e->to_separator[i];
  }
  take_product(d, back, next, e->d, joints);
  take_product(d, back, over, left, joints);
  take_product(d, e->to_separator, next, to_separator, 0);
  take_product(d, e->to_separator, over, e->own, 0);
  for (int i = 0; i < entries; ++i) {
    e->left[i] = left[i];
    e->to_separator[i] = to_separator[i];
  }
}

INLINE void factor_ring(const int d, const bd_ring *ring, const double *w, const int joints) {
  const int m = ring->n_rows, entries = d * d;
  vec *row = ring->rows;
  ptrdiff_t here[WIDTH], behind[WIDTH];
  tiles_of(d, ring, -1, behind);
  const vec shorter = load(ring->shorter), whole = 1.0 - shorter;
  elimination e;
  vec back[BLOCK], forward[BLOCK];
  clear_block(d, back);
  clear_block(d, forward);
  clear_block(d, e.left);
  clear_block(d, e.to_separator);
  clear_block(d, e.own);
  for (int j = 0; j < m; ++j, row += ROW_BLOCKS * entries) {
    vec coupled[BLOCK];
    tiles_of(d, ring, j, here);
    load_row(d, &e, w, here, behind, back, forward, j > 0, joints);
    memcpy(behind, here, sizeof here);
    for (int i = 0; i < entries; ++i) {
      if (j == 0 || (is_set(BACK, i, joints) && !is_shared(BACK, i, joints))) {
        row[BEHIND * entries + i] = back[i];
      }
    }
    if (j > 0) {
      for (int i = 0; i < entries; ++i) {
        coupled[i] = j == 1 ? whole * forward[i] : forward[i];
      }
      eliminate_behind(d, &e, row - ROW_BLOCKS * entries, back, coupled, joints);
    }
    if (j < 2) { /* where an arc begins, its first node meets the separator before it */
      const vec begins = j == 0 ? whole : shorter;
      for (int i = 0; i < entries; ++i) {
        e.left[i] = fma_(begins, back[i], e.left[i]);
        e.to_separator[i] = fma_(begins, forward[i], e.to_separator[i]);
      }
    }
    if (j == 0) { /* rows of the identity */
      for (int i = 0; i < entries; ++i) {
        e.d[i] = fma_(whole, e.d[i], i % (d + 1) == 0 ? shorter : splat(0.0));
      }
    }
    if (j < m - 1) {
      decompose(d, e.lu, e.d);
      invert(d, e.lu, row + INVERSE * entries);
    }
  }
  /* the separator's row after the arc is that of the arc that follows */
  vec right[BLOCK];
  for (int i = 0; i < entries; ++i) {
    e.d[i] += from_after(e.own[i], 1);
    right[i] = from_after(e.to_separator[i], 1);
  }
  separators_factor(d, ring->ends, e.d, e.left, right);
}

/* --- solve ----------------------------------------------------------------------------------- */

/* v: right-hand side in, solution out. */
INLINE void solve_ring(const int d, const bd_ring *ring, double *const *v, const int joints) {
  const int m = ring->n_rows, entries = d * d;
  const vec *row = ring->rows;
  vec *const z = ring->scratch;
  ptrdiff_t at[WIDTH];
  places_of(ring, at);
  const vec shorter = load(ring->shorter);
  vec back[BLOCK], r[4], own[4], u[4], before[4], separator[4];
  for (int i = 0; i < entries; ++i) {
    back[i] = row[BEHIND * entries + i];
  }
  for (int i = 0; i < d; ++i) {
    r[i] = own[i] = u[i] = splat(0.0);
  }
  for (int j = 0; j < m; ++j, row += ROW_BLOCKS * entries) {
    for (int i = 0; i < d; ++i) {
      r[i] = gather(v[i] + j, at);
      if (j == 0) {
        r[i] = fnma_(shorter, r[i], r[i]);
      }
    }
    for (int i = 0; i < entries; ++i) {
      back[i] = is_shared(BACK, i, joints) ? back[i] : row[BEHIND * entries + i];
    }
    take_column(d, back, u, r, 1, joints);
    if (j < m - 1) {
      apply(d, row + INVERSE * entries, r, u);
      for (int i = 0; i < d; ++i) {
        z[d * j + i] = u[i];
      }
      take_column(d, row + TO_SEPARATOR * entries, u, own, 1, 0);
    }
  }
  for (int i = 0; i < d; ++i) {
    r[i] += from_after(own[i], 1);
  }
  separators_solve(d, ring->ends, r, u);
  for (int i = 0; i < d; ++i) {
    before[i] = from_before(u[i], 1);
    separator[i] = u[i];
  }
  row -= ROW_BLOCKS * entries;
  for (int j = m - 2; j >= 0; --j) {
    row -= ROW_BLOCKS * entries;
    vec here[4];
    for (int i = 0; i < d; ++i) {
      here[i] = z[d * j + i];
    }
    take_column(d, row + LEFT * entries, before, here, 1, 0);
    take_column(d, row + NEXT * entries, u, here, 1, 0);
    for (int i = 0; i < d; ++i) {
      scatter(v[i] + j, at, here[i]);
      u[i] = here[i];
    }
  }
  /* last, for the identity rows of short arcs stand on the separators before them */
  for (int i = 0; i < d; ++i) {
    scatter(v[i] + m - 1, at, separator[i]);
  }
}

/* For blocks of d x d; of links that joints alone couple, or of any nodes. */
#define RING(name, d, joints)                                                                      \
  static void factor_##name(const bd_ring *ring, const double *w) {                                \
    factor_ring(d, ring, w, joints);                                                               \
  }                                                                                                \
  static void solve_##name(const bd_ring *ring, double *const *v) {                                \
    solve_ring(d, ring, v, joints);                                                                \
  }
#define RING_MEMORY(d)                                                                             \
  .width = WIDTH, .unknowns = d, .ring_row = ROW_BLOCKS * (d) * (d) * sizeof(vec),                 \
  .ring_ends = END_BLOCKS * (d) * (d) * sizeof(vec)
