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

/* --- blocks, rows first ---------------------------------------------------------------------- */

INLINE void clear_block(const int d, vec *block) {
  for (int i = 0; i < d * d; ++i) {
    block[i] = splat(0.0);
  }
}

/* a x */
INLINE void apply(const int d, const vec *a, const vec *x, vec *out) {
  for (int i = 0; i < d; ++i) {
    vec sum = a[d * i] * x[0];
    for (int j = 1; j < d; ++j) {
      sum = fma_(a[d * i + j], x[j], sum);
    }
    out[i] = sum;
  }
}

/* out -= a x for one column, its entries `step` apart */
INLINE void take_column(const int d, const vec *a, const vec *x, vec *out, const int step,
                        const int joints) {
  for (int i = 0; i < d; ++i) {
    for (int j = 0; j < d; ++j) {
      if (is_set(BACK, d * i + j, joints)) {
        out[step * i] = fnma_(a[d * i + j], x[step * j], out[step * i]);
      }
    }
  }
}

/* out -= a b */
INLINE void take_product(const int d, const vec *a, const vec *b, vec *out, const int joints) {
  for (int c = 0; c < d; ++c) {
    take_column(d, a, b + c, out + c, d, joints);
  }
}

/* --- of nodes in their arcs --- */

/* Where a is true, x and y change places. */
INLINE void exchange_where(mask a, vec *x, vec *y) {
  const vec kept = *x;
  *x = choose(a, *y, kept);
  *y = choose(a, kept, *y);
}

/* L and U of 2 x 2: reciprocal pivots for the diagonal, by the determinant, so that one division
 * does; rows exchanged (last entry: 1) where that makes the first pivot larger. Products with D^-1
 * itself would lose the digits by which the belt is stiffer along itself than across. */
INLINE void decompose_2(vec *f, const vec *given) {
  const mask exchanged = less(magnitude(given[0]), magnitude(given[2]));
  const vec xx = choose(exchanged, given[2], given[0]), xy = choose(exchanged, given[3], given[1]);
  const vec yx = choose(exchanged, given[0], given[2]), yy = choose(exchanged, given[1], given[3]);
  const vec determinant = fnma_(yx, xy, xx * yy), share = 1.0 / (xx * determinant);
  f[0] = determinant * share;
  f[1] = xy;
  f[2] = yx * f[0];
  f[3] = xx * xx * share;
  f[4] = where(exchanged, splat(1.0));
}

/* The same of 4 x 4, which no symmetry helps: each pivot the largest of its column, rows exchanged
 * two at a time, as the entries behind the block say. */
INLINE void decompose_4(vec *f, const vec *given) {
  for (int i = 0; i < 16; ++i) {
    f[i] = given[i];
  }
  vec *exchanged = f + 16;
  for (int k = 0; k < 4; ++k) {
    for (int i = k + 1; i < 4; ++i) {
      const mask larger_below = less(magnitude(f[4 * k + k]), magnitude(f[4 * i + k]));
      *exchanged++ = where(larger_below, splat(1.0));
      for (int c = 0; c < 4; ++c) {
        exchange_where(larger_below, &f[4 * k + c], &f[4 * i + c]);
      }
    }
    f[4 * k + k] = 1.0 / f[4 * k + k];
    for (int i = k + 1; i < 4; ++i) {
      const vec factor = f[4 * i + k] *= f[4 * k + k];
      for (int c = k + 1; c < 4; ++c) {
        f[4 * i + c] = fnma_(factor, f[4 * k + c], f[4 * i + c]);
      }
    }
  }
}

/* D = [A b; c d], A of x and y: A^-1, A^-1 b, c A^-1 and 1 / (d - c A^-1 b), by determinants, so
 * that one division does. No single entry of A is a pivot. Its determinant keeps its digits: along
 * an arc the joint ahead holds a link as much in one direction as in another, and only contact is
 * stiffer. */
INLINE void decompose_3(vec *f, const vec *d) {
  const vec of_a = fnma_(d[3], d[1], d[0] * d[4]);
  const vec b0 = fnma_(d[1], d[5], d[4] * d[2]), b1 = fnma_(d[3], d[2], d[0] * d[5]);
  const vec of_all = fnma_(d[7], b1, fnma_(d[6], b0, d[8] * of_a));
  const vec share = 1.0 / (of_a * of_all), per_a = of_all * share;
  f[0] = d[4] * per_a;
  f[1] = -d[1] * per_a;
  f[2] = -d[3] * per_a;
  f[3] = d[0] * per_a;
  f[4] = b0 * per_a;
  f[5] = b1 * per_a;
  f[6] = fma_(d[6], f[0], d[7] * f[2]);
  f[7] = fma_(d[6], f[1], d[7] * f[3]);
  f[8] = of_a * of_a * share;
}

INLINE void decompose(const int d, vec *f, const vec *block) {
  if (d == 3) {
    decompose_3(f, block);
  } else if (d == 2) {
    decompose_2(f, block);
  } else {
    decompose_4(f, block);
  }
}

/* x = D^-1 b, entries `step` apart */
INLINE void substitute(const int d, const vec *f, const vec *b, vec *x, const int step) {
  if (d == 3) {
    const vec last = fnma_(f[7], b[step], fnma_(f[6], b[0], b[2 * step])) * f[8];
    x[0] = fnma_(f[4], last, fma_(f[1], b[step], f[0] * b[0]));
    x[step] = fnma_(f[5], last, fma_(f[3], b[step], f[2] * b[0]));
    x[2 * step] = last;
    return;
  }
  vec y[4];
  for (int i = 0; i < d; ++i) {
    y[i] = b[step * i];
  }
  const vec *exchanged = f + d * d;
  for (int k = 0; k < d; ++k) {
    for (int i = k + 1; i < d; ++i) {
      exchange_where(less(splat(0.0), *exchanged++), &y[k], &y[i]);
    }
  }
  for (int i = 1; i < d; ++i) {
    for (int k = 0; k < i; ++k) {
      y[i] = fnma_(f[d * i + k], y[k], y[i]);
    }
  }
  for (int i = d - 1; i >= 0; --i) {
    for (int k = i + 1; k < d; ++k) {
      y[i] = fnma_(f[d * i + k], y[k], y[i]);
    }
    y[i] *= f[d * i + i];
  }
  for (int i = 0; i < d; ++i) {
    x[step * i] = y[i];
  }
}

INLINE void invert(const int d, const vec *f, vec *x) {
  if (d == 3) {
    x[2] = -f[4] * f[8];
    x[5] = -f[5] * f[8];
    x[6] = -f[6] * f[8];
    x[7] = -f[7] * f[8];
    x[8] = f[8];
    x[0] = fnma_(f[4], x[6], f[0]);
    x[1] = fnma_(f[4], x[7], f[1]);
    x[3] = fnma_(f[5], x[6], f[2]);
    x[4] = fnma_(f[5], x[7], f[3]);
    return;
  }
  vec one[BLOCK];
  for (int i = 0; i < d * d; ++i) {
    one[i] = splat(i % (d + 1) == 0 ? 1.0 : 0.0);
  }
  for (int c = 0; c < d; ++c) {
    substitute(d, f, one + c, x + c, d);
  }
}

/* --- of separators --- */

/* A separator's block: L and U. Of 3 x 3: l10 l20 l21, u01 u02 u12 and reciprocal pivots, by
 * minors, its first two rows exchanged (last entry: 1) where that makes the first pivot larger. By
 * A^-1 the digits would be lost by which the belt between separators is stiffer along itself than
 * across. */
INLINE void decompose_end(const int d, vec *lu, const vec *given) {
  if (d != 3) {
    decompose(d, lu, given);
    return;
  }
  const mask exchanged = less(magnitude(given[0]), magnitude(given[3]));
  vec e[9];
  for (int i = 0; i < 3; ++i) {
    e[i] = choose(exchanged, given[3 + i], given[i]);
    e[3 + i] = choose(exchanged, given[i], given[3 + i]);
    e[6 + i] = given[6 + i];
  }
  const vec m11 = fnma_(e[3], e[1], e[0] * e[4]), m12 = fnma_(e[3], e[2], e[0] * e[5]);
  const vec m21 = fnma_(e[6], e[1], e[0] * e[7]), m22 = fnma_(e[6], e[2], e[0] * e[8]);
  const vec last = fnma_(m12, m21, m11 * m22), first = e[0] * m11;
  const vec share = 1.0 / (first * last);
  const vec per_d00 = m11 * last * share, per_m11 = e[0] * last * share;
  lu[0] = per_d00;
  lu[1] = e[1];
  lu[2] = e[2];
  lu[3] = e[3] * per_d00;
  lu[4] = e[0] * per_m11;
  lu[5] = m12 * per_d00;
  lu[6] = e[6] * per_d00;
  lu[7] = m21 * per_m11;
  lu[8] = first * first * share;
  lu[9] = where(exchanged, splat(1.0));
}

/* Entries of the above, and exchanges that they know of. */
INLINE int end_factors(const int d) {
  return d == 4 ? FACTORS : d * d + 1;
}

/* x = b D^-1, row by row */
INLINE void divide_rows(const int d, const vec *lu, const vec *b, vec *x) {
  for (int r = 0; r < d * d; r += d) {
    vec y[4];
    for (int j = 0; j < d; ++j) {
      y[j] = b[r + j];
      for (int k = 0; k < j; ++k) {
        y[j] = fnma_(y[k], lu[d * k + j], y[j]);
      }
      y[j] *= lu[d * j + j];
    }
    for (int j = d - 1; j >= 0; --j) {
      for (int k = j + 1; k < d; ++k) {
        y[j] = fnma_(y[k], lu[d * k + j], y[j]);
      }
    }
    const vec *exchanged = lu + end_factors(d);
    for (int k = d == 4 ? 2 : 0; k >= 0; --k) {
      for (int i = d == 4 ? 3 : 1; i > k; --i) {
        exchange_where(less(splat(0.0), *--exchanged), &y[k], &y[i]);
      }
    }
    for (int j = 0; j < d; ++j) {
      x[r + j] = y[j];
    }
  }
}

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

/* A row's blocks, and what couples the one behind to it. */
INLINE void load_row(const int d, elimination *e, const double *w, const ptrdiff_t *here,
                     const ptrdiff_t *behind, vec *back, vec *forward, const int joints) {
  const vec none = splat(0.0);
  for (int i = 0; i < d * d; ++i) {
    const double *first = w + i * BD_LANES, *own = first + d * d * BD_LANES;
    const int shared = is_shared(BACK, i, joints), set = is_set(BACK, i, joints);
    back[i] = shared ? splat(w[0]) : set ? gather(first, here) : none;
    e->d[i] = is_set(DIAGONAL, i, joints) ? gather(own, here) : none;
    forward[i] = shared ? back[i] : set ? gather(own + d * d * BD_LANES, behind) : none;
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
  clear_block(d, e.left);
  clear_block(d, e.to_separator);
  clear_block(d, e.own);
  for (int j = 0; j < m; ++j, row += ROW_BLOCKS * entries) {
    vec back[BLOCK], forward[BLOCK], coupled[BLOCK];
    tiles_of(d, ring, j, here);
    load_row(d, &e, w, here, behind, back, forward, joints);
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
