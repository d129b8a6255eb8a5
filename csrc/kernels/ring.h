/* SPDX-License-Identifier: MIT
 *
 * The linear solver for the ring of links, compiled once per instruction level: cyclic block
 * tridiagonal, 3 unknowns a link, O(n_b), no pivoting.
 *
 * The ring is cut into WIDTH arcs that are eliminated in lockstep, one vector lane an arc, one
 * row of links (the j-th of every arc) at a time. The last link of an arc, its separator, stays:
 * elimination couples it to the separator of the arc before (F, E below). The separators, a ring of
 * one lane each, are halved in number by every step of a cyclic reduction that all lanes take
 * together, until each stands alone. Arcs differ by one link at most; a shorter one begins with a
 * row of the identity that is coupled to nothing.
 *
 * Blocks (solvers/newton_system.c derives them), e' = (-sin, cos) of a link, q = -k e' + spin w e:
 *   diagonal            diag(2 k + mass + contact, ..., k22)
 *   link i to i - 1     [-k 1 | q_{i-1} ; k e'_i | -e'_i.q_{i-1} - bending]
 *   link i - 1 to i     [-k 1 | -q_i ; -k e'_{i-1} | -e'_{i-1}.q_i - bending]
 * The diagonal blocks are those of an inertia plus stiffness and damping, positive definite but for
 * friction and links in compression, which is why no pivot is sought among links; a solve that went
 * wrong shows in numbers that are not finite or in the step's error. Within a block it is: of a
 * link in full slip, which is pressed back along n + mu t whichever way it moves against n, the
 * entry xx is 0 where n is at the angle of friction to y. Guarded by tests/test_jacobian.py.
 */
/* Steps of the cyclic reduction, log2 of the arcs. */
enum { REDUCTIONS = WIDTH == 8 ? 3 : WIDTH == 4 ? 2 : WIDTH == 2 ? 1 : 0 };

/* What a row keeps for the solves. */
typedef struct ring_row {
  vec inverse[9];      /* D^-1, D the diagonal block */
  vec back[9];         /* coupling to the link behind */
  vec to_separator[9]; /* E: coupling of the separator before the arc to this row */
  vec next[9];         /* D^-1 U: what the link forward is worth here */
  vec left[9];         /* D^-1 F: the same of the separator before the arc */
} ring_row;

/* What the separators keep: times what stands 1, 2, 4 arcs before and after, and D^-1. */
typedef struct ring_ends {
  vec before[REDUCTIONS + 1][9], after[REDUCTIONS + 1][9], inverse[9];
} ring_ends;

/* --- lanes ----------------------------------------------------------------------------------- */

/* For every arc, what the arc `distance` before it has, or the one after it. */
INLINE vec from_before(vec v, const int distance) {
  return turned(v, -distance);
}

INLINE vec from_after(vec v, const int distance) {
  return turned(v, distance);
}

/* Where the arcs' rows begin. */
INLINE void places_of(const bd_ring *ring, ptrdiff_t *at) {
  for (int a = 0; a < WIDTH; ++a) {
    at[a] = ring->base[a];
  }
}

/* --- 3 x 3 blocks, rows first ---------------------------------------------------------------- */

/* D = [A b; c d], A of x and y: A^-1, A^-1 b, c A^-1 and 1 / (d - c A^-1 b), by determinants, so
 * that one division does. No single entry of A is a pivot. Its determinant keeps its digits: along
 * an arc the joint ahead holds a link as much in one direction as in another, and only contact is
 * stiffer.
 */
INLINE void decompose(vec *f, const vec *d) {
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

/* x = D^-1 b, three entries `step` apart */
INLINE void substitute(const vec *f, const vec *b, vec *x, const int step) {
  const vec last = fnma_(f[7], b[step], fnma_(f[6], b[0], b[2 * step])) * f[8];
  x[0] = fnma_(f[4], last, fma_(f[1], b[step], f[0] * b[0]));
  x[step] = fnma_(f[5], last, fma_(f[3], b[step], f[2] * b[0]));
  x[2 * step] = last;
}

INLINE void invert(const vec *f, vec *x) {
  x[2] = -f[4] * f[8];
  x[5] = -f[5] * f[8];
  x[6] = -f[6] * f[8];
  x[7] = -f[7] * f[8];
  x[8] = f[8];
  x[0] = fnma_(f[4], x[6], f[0]);
  x[1] = fnma_(f[4], x[7], f[1]);
  x[3] = fnma_(f[5], x[6], f[2]);
  x[4] = fnma_(f[5], x[7], f[3]);
}

/* out -= a x for one column, its entries `step` apart */
INLINE void take_column(const vec *a, const vec *x, vec *out, const int step) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      out[step * i] = fnma_(a[3 * i + j], x[step * j], out[step * i]);
    }
  }
}

/* out -= a b */
INLINE void take_product(const vec *a, const vec *b, vec *out) {
  for (int c = 0; c < 3; ++c) {
    take_column(a, b + c, out + c, 3);
  }
}

/* --- separators ------------------------------------------------------------------------------ */

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

/* A separator's block: L and U, l10 l20 l21, u01 u02 u12 and reciprocal pivots, by minors, its
 * first two rows exchanged (last entry: 1) where that makes the first pivot larger. By A^-1 the
 * digits would be lost by which the belt between separators is stiffer along itself than across. */
enum { ENDS_LU = 10 };

INLINE void decompose_end(vec *lu, const vec *given) {
  const mask exchanged = less(magnitude(given[0]), magnitude(given[3]));
  vec d[9];
  for (int i = 0; i < 3; ++i) {
    d[i] = choose(exchanged, given[3 + i], given[i]);
    d[3 + i] = choose(exchanged, given[i], given[3 + i]);
    d[6 + i] = given[6 + i];
  }
  const vec m11 = fnma_(d[3], d[1], d[0] * d[4]), m12 = fnma_(d[3], d[2], d[0] * d[5]);
  const vec m21 = fnma_(d[6], d[1], d[0] * d[7]), m22 = fnma_(d[6], d[2], d[0] * d[8]);
  const vec last = fnma_(m12, m21, m11 * m22), first = d[0] * m11;
  const vec share = 1.0 / (first * last);
  const vec per_d00 = m11 * last * share, per_m11 = d[0] * last * share;
  lu[0] = d[3] * per_d00;
  lu[1] = d[6] * per_d00;
  lu[2] = m21 * per_m11;
  lu[3] = d[1];
  lu[4] = d[2];
  lu[5] = m12 * per_d00;
  lu[6] = per_d00;
  lu[7] = d[0] * per_m11;
  lu[8] = first * first * share;
  lu[9] = where(exchanged, splat(1.0));
}

/* x = b D^-1, row by row */
INLINE void divide_rows(const vec *lu, const vec *b, vec *x) {
  const mask exchanged = less(splat(0.0), lu[9]);
  for (int r = 0; r < 9; r += 3) {
    const vec y0 = b[r] * lu[6];
    const vec y1 = fnma_(y0, lu[3], b[r + 1]) * lu[7];
    const vec x2 = fnma_(y1, lu[5], fnma_(y0, lu[4], b[r + 2])) * lu[8];
    const vec x1 = fnma_(x2, lu[2], y1);
    const vec x0 = fnma_(x2, lu[1], fnma_(x1, lu[0], y0));
    x[r] = choose(exchanged, x1, x0);
    x[r + 1] = choose(exchanged, x0, x1);
    x[r + 2] = x2;
  }
}

/* One step: every separator is freed of those `distance` before and after it, and is left coupled
 * to those twice as far. */
INLINE void reduce(const int distance, vec *d, vec *left, vec *right, vec *before, vec *after) {
  vec lu[ENDS_LU], near[9], far[ENDS_LU], new_left[9], new_right[9];
  decompose_end(lu, d);
  for (int i = 0; i < 9; ++i) {
    new_left[i] = new_right[i] = splat(0.0);
  }
  all_before(lu, ENDS_LU, distance, far);
  divide_rows(far, left, before);
  all_after(lu, ENDS_LU, distance, far);
  divide_rows(far, right, after);
  all_before(right, 9, distance, near);
  all_before(left, 9, distance, far);
  take_product(before, near, d);
  take_product(before, far, new_left);
  all_after(left, 9, distance, near);
  all_after(right, 9, distance, far);
  take_product(after, near, d);
  take_product(after, far, new_right);
  for (int i = 0; i < 9; ++i) {
    left[i] = new_left[i];
    right[i] = new_right[i];
  }
}

/* The last step: the separator before is the one after. */
INLINE void reduce_last(vec *d, vec *left, const vec *right, vec *before) {
  enum { HALF = WIDTH / 2 };
  vec lu[ENDS_LU], far[ENDS_LU];
  for (int i = 0; i < 9; ++i) {
    left[i] += right[i];
  }
  if (HALF == 0) { /* it is itself */
    for (int i = 0; i < 9; ++i) {
      d[i] += left[i];
    }
    return;
  }
  decompose_end(lu, d);
  all_before(lu, ENDS_LU, HALF, far);
  divide_rows(far, left, before);
  all_before(left, 9, HALF, far);
  take_product(before, far, d);
}

static void separators_factor(ring_ends *ends, vec *d, vec *left, vec *right) {
  vec lu[ENDS_LU];
  if (REDUCTIONS > 1) {
    reduce(1, d, left, right, ends->before[0], ends->after[0]);
  }
  if (REDUCTIONS > 2) {
    reduce(2, d, left, right, ends->before[1], ends->after[1]);
  }
  reduce_last(d, left, right, ends->before[REDUCTIONS > 0 ? REDUCTIONS - 1 : 0]);
  decompose_end(lu, d);
  for (int i = 0; i < 9; ++i) {
    d[i] = splat(i % 4 == 0 ? 1.0 : 0.0);
  }
  divide_rows(lu, d, ends->inverse);
}

INLINE void take_neighbours(const ring_ends *ends, const int step, vec *r) {
  vec before[3], after[3];
  for (int i = 0; i < 3; ++i) {
    before[i] = from_before(r[i], 1 << step);
    after[i] = from_after(r[i], 1 << step);
  }
  take_column(ends->before[step], before, r, 1);
  if (step < REDUCTIONS - 1) {
    take_column(ends->after[step], after, r, 1);
  }
}

INLINE void separators_solve(const ring_ends *ends, vec *r, vec *u) {
  if (REDUCTIONS > 0) {
    take_neighbours(ends, 0, r);
  }
  if (REDUCTIONS > 1) {
    take_neighbours(ends, 1, r);
  }
  if (REDUCTIONS > 2) {
    take_neighbours(ends, 2, r);
  }
  for (int i = 0; i < 3; ++i) {
    u[i] = splat(0.0);
    r[i] = -r[i];
  }
  take_column(ends->inverse, r, u, 1);
}

/* --- factorisation --------------------------------------------------------------------------- */

/* Where the arcs' rows j stand in tiles of d x d blocks, and the nodes behind them. */
INLINE void tiles_of(const bd_ring *ring, const ptrdiff_t *at, const int j, const int d,
                     ptrdiff_t *here, ptrdiff_t *behind) {
  const ptrdiff_t tile = 3 * d * d * BD_LANES;
  for (int a = 0; a < WIDTH; ++a) {
    const ptrdiff_t i = at[a] + j, l = i > 0 ? i - 1 : ring->n - 1;
    here[a] = i / BD_LANES * tile + i % BD_LANES;
    behind[a] = l / BD_LANES * tile + l % BD_LANES;
  }
}

/* How far the elimination is: the row's diagonal block D and, of the row before, its factors; what
 * couples the row to the separator before its arc, F, and that separator to the row, E; what the
 * rows so far take from that separator's diagonal block. */
typedef struct elimination {
  vec d[9], lu[9], left[9], to_separator[9], own[9];
} elimination;

/* A row's blocks, and what couples the one behind to it. */
INLINE void load_row(elimination *e, const bd_ring *ring, const double *w, const ptrdiff_t *at,
                     const int j, vec *back, vec *forward) {
  ptrdiff_t here[WIDTH], behind[WIDTH];
  tiles_of(ring, at, j, 3, here, behind);
  for (int i = 0; i < 9; ++i) {
    back[i] = gather(w + i * BD_LANES, here);
    e->d[i] = gather(w + (9 + i) * BD_LANES, here);
    forward[i] = gather(w + (18 + i) * BD_LANES, behind);
  }
}

/* Frees a row of the one behind it, which keeps what the solves need. */
INLINE void eliminate_behind(elimination *e, ring_row *behind, const vec *back,
                             const vec *forward) {
  vec next[9], over[9], left[9], to_separator[9];
  for (int c = 0; c < 3; ++c) {
    substitute(e->lu, forward + c, next + c, 3);
    substitute(e->lu, e->left + c, over + c, 3);
  }
  for (int i = 0; i < 9; ++i) {
    left[i] = to_separator[i] = splat(0.0);
    behind->next[i] = next[i];
    behind->left[i] = over[i];
    behind->to_separator[i] = e->to_separator[i];
  }
  take_product(back, next, e->d);
  take_product(back, over, left);
  take_product(e->to_separator, next, to_separator);
  take_product(e->to_separator, over, e->own);
  for (int i = 0; i < 9; ++i) {
    e->left[i] = left[i];
    e->to_separator[i] = to_separator[i];
  }
}

/* Where an arc begins, its first link meets the separator before it; begins: 1 where this row is
 * that link. */
INLINE void meet_separator(elimination *e, vec begins, const vec *back, const vec *forward) {
  for (int i = 0; i < 9; ++i) {
    e->left[i] = fma_(begins, back[i], e->left[i]);
    e->to_separator[i] = fma_(begins, forward[i], e->to_separator[i]);
  }
}

static void ring_factor(const bd_ring *ring, const double *w) {
  ring_row *const row = ring->rows;
  const int m = ring->n_rows;
  ptrdiff_t at[WIDTH];
  places_of(ring, at);
  const vec shorter = load(ring->shorter), whole = 1.0 - shorter;
  elimination e;
  for (int i = 0; i < 9; ++i) {
    e.left[i] = e.to_separator[i] = e.own[i] = e.lu[i] = splat(0.0);
  }
  for (int j = 0; j < m; ++j) {
    vec *const back = row[j].back, forward[9], coupled[9];
    load_row(&e, ring, w, at, j, back, forward);
    if (j > 0) {
      for (int i = 0; i < 9; ++i) {
        coupled[i] = j == 1 ? whole * forward[i] : forward[i];
      }
      eliminate_behind(&e, &row[j - 1], back, coupled);
    }
    if (j < 2) {
      meet_separator(&e, j == 0 ? whole : shorter, back, forward);
    }
    if (j == 0) { /* rows of the identity */
      for (int i = 0; i < 9; ++i) {
        e.d[i] = fma_(whole, e.d[i], i % 4 == 0 ? shorter : splat(0.0));
      }
    }
    if (j < m - 1) {
      decompose(e.lu, e.d);
      invert(e.lu, row[j].inverse);
    }
  }
  /* the separator's row after the arc is that of the arc that follows */
  vec right[9];
  for (int i = 0; i < 9; ++i) {
    e.d[i] += from_after(e.own[i], 1);
    right[i] = from_after(e.to_separator[i], 1);
  }
  separators_factor(ring->ends, e.d, e.left, right);
}

/* --- solve ----------------------------------------------------------------------------------- */

/* x, y, p: right-hand side in, solution out. */
static void ring_solve(const bd_ring *ring, double *x, double *y, double *p) {
  const ring_row *const row = ring->rows;
  vec *const z = ring->scratch;
  const int m = ring->n_rows;
  ptrdiff_t at[WIDTH];
  places_of(ring, at);
  const vec zero = splat(0.0);
  const vec shorter = load(ring->shorter);
  double *const fields[] = {x, y, p};
  vec r[3], own[3] = {zero, zero, zero}, v[3] = {zero, zero, zero};
  for (int j = 0; j < m; ++j) {
    for (int i = 0; i < 3; ++i) {
      r[i] = gather(fields[i] + j, at);
      if (j == 0) {
        r[i] = fnma_(shorter, r[i], r[i]);
      }
    }
    take_column(row[j].back, v, r, 1);
    if (j < m - 1) {
      for (int i = 0; i < 3; ++i) {
        const vec *const inverse = row[j].inverse + 3 * i;
        v[i] = fma_(inverse[2], r[2], fma_(inverse[1], r[1], inverse[0] * r[0]));
        z[3 * j + i] = v[i];
      }
      take_column(row[j].to_separator, v, own, 1);
    }
  }
  vec u[3], before[3], separator[3];
  for (int i = 0; i < 3; ++i) {
    r[i] += from_after(own[i], 1);
  }
  separators_solve(ring->ends, r, u);
  for (int i = 0; i < 3; ++i) {
    before[i] = from_before(u[i], 1);
    separator[i] = u[i];
  }
  for (int j = m - 2; j >= 0; --j) {
    for (int i = 0; i < 3; ++i) {
      v[i] = z[3 * j + i];
    }
    take_column(row[j].left, before, v, 1);
    take_column(row[j].next, u, v, 1);
    for (int i = 0; i < 3; ++i) {
      scatter(fields[i] + j, at, v[i]);
      u[i] = v[i];
    }
  }
  /* last, for the identity rows of short arcs stand on the separators before them */
  for (int i = 0; i < 3; ++i) {
    scatter(fields[i] + m - 1, at, separator[i]);
  }
}
