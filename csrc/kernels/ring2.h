/* SPDX-License-Identifier: MIT
 *
 * The linear solver of ring.h for a string: a ring of point masses, 2 unknowns a mass, 2 x 2 blocks
 * that arrays hold entirely (bd_blocks). Arcs, elimination and cyclic reduction are those of
 * ring.h; blocks as small as these are passed by value and stay in registers, which is why the code
 * is not shared. Guarded by tests/c/test_kernels.c.
 */
typedef struct pair {
  vec x, y;
} pair;

/* Rows first. */
typedef struct square {
  vec xx, xy, yx, yy;
} square;

/* What a row keeps for the solves. */
typedef struct string_row {
  square inverse;      /* D^-1, D the diagonal block */
  square back;         /* coupling to the mass behind */
  square to_separator; /* E: coupling of the separator before the arc to this row */
  square next;         /* D^-1 U: what the mass forward is worth here */
  square left;         /* D^-1 F: the same of the separator before the arc */
} string_row;

/* What the separators keep: times what stands 1, 2, 4 arcs before and after, and D^-1. */
typedef struct string_ends {
  square before[REDUCTIONS + 1], after[REDUCTIONS + 1], inverse;
} string_ends;

/* --- blocks ---------------------------------------------------------------------------------- */

INLINE square square_of(vec diagonal, vec other) {
  return (square){diagonal, other, other, diagonal};
}

/* c - a b */
INLINE square less_product(square c, square a, square b) {
  return (square){
      fnma_(a.xy, b.yx, fnma_(a.xx, b.xx, c.xx)), fnma_(a.xy, b.yy, fnma_(a.xx, b.xy, c.xy)),
      fnma_(a.yy, b.yx, fnma_(a.yx, b.xx, c.yx)), fnma_(a.yy, b.yy, fnma_(a.yx, b.xy, c.yy))};
}

INLINE pair applied(square a, pair b) {
  return (pair){fma_(a.xy, b.y, a.xx * b.x), fma_(a.yy, b.y, a.yx * b.x)};
}

INLINE pair less_applied(pair c, square a, pair b) {
  return (pair){fnma_(a.xy, b.y, fnma_(a.xx, b.x, c.x)), fnma_(a.yy, b.y, fnma_(a.yx, b.x, c.y))};
}

INLINE square sum_of(square a, square b) {
  return (square){a.xx + b.xx, a.xy + b.xy, a.yx + b.yx, a.yy + b.yy};
}

/* a + f b */
INLINE square with_part(square a, vec f, square b) {
  return (square){fma_(f, b.xx, a.xx), fma_(f, b.xy, a.xy), fma_(f, b.yx, a.yx),
                  fma_(f, b.yy, a.yy)};
}

/* L and U: l10 in the place yx, u01 in xy, the reciprocal pivots in xx and yy; by the determinant,
 * so that one division does. Products with D^-1 itself would lose the digits by which the belt is
 * stiffer along itself than across. Rows are exchanged where that makes the first pivot larger
 * (ring.h says when it may be 0). */
typedef struct square_factors {
  square lu;
  vec exchanged; /* 1, or 0 */
} square_factors;

INLINE square_factors decomposed(square d) {
  const mask exchanged = less(magnitude(d.xx), magnitude(d.yx));
  const vec xx = choose(exchanged, d.yx, d.xx), xy = choose(exchanged, d.yy, d.xy);
  const vec yx = choose(exchanged, d.xx, d.yx), yy = choose(exchanged, d.xy, d.yy);
  const vec determinant = fnma_(yx, xy, xx * yy), share = 1.0 / (xx * determinant);
  const vec per_xx = determinant * share;
  return (square_factors){{per_xx, xy, yx * per_xx, xx * xx * share}, where(exchanged, splat(1.0))};
}

/* D^-1 b, and b D^-1 */
INLINE square divided(square_factors f, square given) {
  const mask exchanged = less(splat(0.0), f.exchanged);
  const square lu = f.lu,
               b = {choose(exchanged, given.yx, given.xx), choose(exchanged, given.yy, given.xy),
                    choose(exchanged, given.xx, given.yx), choose(exchanged, given.xy, given.yy)};
  const vec yx = fnma_(lu.yx, b.xx, b.yx) * lu.yy, yy = fnma_(lu.yx, b.xy, b.yy) * lu.yy;
  return (square){fnma_(lu.xy, yx, b.xx) * lu.xx, fnma_(lu.xy, yy, b.xy) * lu.xx, yx, yy};
}

INLINE square divided_rows(square b, square_factors f) {
  const mask exchanged = less(splat(0.0), f.exchanged);
  const square lu = f.lu;
  const vec left_x = b.xx * lu.xx, left_y = b.yx * lu.xx;
  const vec xy = fnma_(left_x, lu.xy, b.xy) * lu.yy, yy = fnma_(left_y, lu.xy, b.yy) * lu.yy;
  const vec xx = fnma_(xy, lu.yx, left_x), yx = fnma_(yy, lu.yx, left_y);
  return (square){choose(exchanged, xy, xx), choose(exchanged, xx, xy), choose(exchanged, yy, yx),
                  choose(exchanged, yx, yy)};
}

INLINE square inverse_of(square_factors f) {
  return divided_rows(square_of(splat(1.0), splat(0.0)), f);
}

INLINE square square_before(square a, const int distance) {
  return (square){from_before(a.xx, distance), from_before(a.xy, distance),
                  from_before(a.yx, distance), from_before(a.yy, distance)};
}

INLINE square square_after(square a, const int distance) {
  return (square){from_after(a.xx, distance), from_after(a.xy, distance),
                  from_after(a.yx, distance), from_after(a.yy, distance)};
}

INLINE square_factors factors_before(square_factors f, const int distance) {
  return (square_factors){square_before(f.lu, distance), from_before(f.exchanged, distance)};
}

INLINE square_factors factors_after(square_factors f, const int distance) {
  return (square_factors){square_after(f.lu, distance), from_after(f.exchanged, distance)};
}

INLINE pair pair_before(pair a, const int distance) {
  return (pair){from_before(a.x, distance), from_before(a.y, distance)};
}

INLINE pair pair_after(pair a, const int distance) {
  return (pair){from_after(a.x, distance), from_after(a.y, distance)};
}

/* --- separators ------------------------------------------------------------------------------ */

/* The separators as they are coupled to each other. */
typedef struct coupled_ends {
  square d, left, right;
} coupled_ends;

/* One step: every separator is freed of those `distance` before and after it, and is left coupled
 * to those twice as far. */
INLINE coupled_ends string_reduce(coupled_ends s, const int distance, square *before,
                                  square *after) {
  const square none = square_of(splat(0.0), splat(0.0));
  const square_factors own = decomposed(s.d);
  const square by_before = divided_rows(s.left, factors_before(own, distance));
  const square by_after = divided_rows(s.right, factors_after(own, distance));
  *before = by_before;
  *after = by_after;
  s.d = less_product(s.d, by_before, square_before(s.right, distance));
  s.d = less_product(s.d, by_after, square_after(s.left, distance));
  s.left = less_product(none, by_before, square_before(s.left, distance));
  s.right = less_product(none, by_after, square_after(s.right, distance));
  return s;
}

INLINE void string_factor_ends(string_ends *ends, coupled_ends s) {
  enum { HALF = WIDTH / 2 };
  if (REDUCTIONS > 1) {
    s = string_reduce(s, 1, &ends->before[0], &ends->after[0]);
  }
  if (REDUCTIONS > 2) {
    s = string_reduce(s, 2, &ends->before[1], &ends->after[1]);
  }
  /* the last step: the separator before is the one after, or itself */
  const square both = sum_of(s.left, s.right);
  if (HALF == 0) {
    s.d = sum_of(s.d, both);
  } else {
    const square by_before = divided_rows(both, factors_before(decomposed(s.d), HALF));
    ends->before[REDUCTIONS > 0 ? REDUCTIONS - 1 : 0] = by_before;
    s.d = less_product(s.d, by_before, square_before(both, HALF));
  }
  ends->inverse = inverse_of(decomposed(s.d));
}

INLINE pair less_neighbours(const string_ends *ends, const int step, pair r) {
  const pair before = pair_before(r, 1 << step), after = pair_after(r, 1 << step);
  r = less_applied(r, ends->before[step], before);
  return step < REDUCTIONS - 1 ? less_applied(r, ends->after[step], after) : r;
}

INLINE pair string_solve_ends(const string_ends *ends, pair r) {
  if (REDUCTIONS > 0) {
    r = less_neighbours(ends, 0, r);
  }
  if (REDUCTIONS > 1) {
    r = less_neighbours(ends, 1, r);
  }
  if (REDUCTIONS > 2) {
    r = less_neighbours(ends, 2, r);
  }
  return applied(ends->inverse, r);
}

/* --- factorisation --------------------------------------------------------------------------- */

INLINE square gather_square(const double *w, const ptrdiff_t *at, const int place) {
  const double *first = w + 4 * place * BD_LANES;
  return (square){gather(first, at), gather(first + BD_LANES, at), gather(first + 2 * BD_LANES, at),
                  gather(first + 3 * BD_LANES, at)};
}

static void string_factor(const bd_ring *ring, const double *w) {
  string_row *const row = ring->rows;
  const int m = ring->n_rows;
  ptrdiff_t at[WIDTH], here[WIDTH], behind[WIDTH];
  places_of(ring, at);
  tiles_of(ring, at, 0, 2, here, behind);
  const vec zero = splat(0.0), shorter = load(ring->shorter), whole = 1.0 - shorter;
  const square none = square_of(zero, zero);
  /* Row 0 of an arc meets the separator before the arc, or is the identity, coupled to nothing. */
  square back = gather_square(w, here, 0), forward = gather_square(w, behind, 2);
  /* Of the row: D; F, its coupling to that separator; E, the separator's to it. And what the rows
   * so far take from the separator's diagonal block. */
  square d = with_part(square_of(shorter, zero), whole, gather_square(w, here, 1));
  square left = with_part(none, whole, back), to_separator = with_part(none, whole, forward);
  square own = none;
  row[0].back = back;
  for (int j = 1; j < m; ++j) {
    const square_factors factors = decomposed(d);
    tiles_of(ring, at, j, 2, here, behind);
    back = gather_square(w, here, 0);
    forward = gather_square(w, behind, 2);
    const square coupled = j == 1 ? with_part(none, whole, forward) : forward;
    const square next = divided(factors, coupled), over = divided(factors, left);
    row[j - 1].inverse = inverse_of(factors);
    row[j - 1].to_separator = to_separator;
    row[j - 1].next = next;
    row[j - 1].left = over;
    row[j].back = back;
    d = less_product(gather_square(w, here, 1), back, next);
    own = less_product(own, to_separator, over);
    left = less_product(none, back, over);
    to_separator = less_product(none, to_separator, next);
    if (j == 1) { /* the first mass of a shorter arc */
      left = with_part(left, shorter, back);
      to_separator = with_part(to_separator, shorter, forward);
    }
  }
  /* the separator's row after the arc is that of the arc that follows */
  d = sum_of(d, square_after(own, 1));
  string_factor_ends(ring->ends, (coupled_ends){d, left, square_after(to_separator, 1)});
}

/* --- solve ----------------------------------------------------------------------------------- */

/* x, y: right-hand side in, solution out. */
static void string_solve(const bd_ring *ring, double *x, double *y, double *p) {
  (void)p;
  const string_row *const row = ring->rows;
  pair *const z = ring->scratch;
  const int m = ring->n_rows;
  ptrdiff_t at[WIDTH];
  places_of(ring, at);
  const vec zero = splat(0.0), whole = 1.0 - load(ring->shorter);
  pair own = {zero, zero}, r = {whole * gather(x, at), whole * gather(y, at)};
  for (int j = 0; j < m - 1; ++j) {
    const pair v = applied(row[j].inverse, r);
    z[j] = v;
    own = less_applied(own, row[j].to_separator, v);
    r = (pair){gather(x + j + 1, at), gather(y + j + 1, at)};
    r = less_applied(r, row[j + 1].back, v);
  }
  own = pair_after(own, 1);
  const pair separator = string_solve_ends(ring->ends, (pair){r.x + own.x, r.y + own.y});
  const pair before = pair_before(separator, 1);
  pair u = separator;
  for (int j = m - 2; j >= 0; --j) {
    u = less_applied(less_applied(z[j], row[j].left, before), row[j].next, u);
    scatter(x + j, at, u.x);
    scatter(y + j, at, u.y);
  }
  /* last, for the identity rows of short arcs stand on the separators before them */
  scatter(x + m - 1, at, separator.x);
  scatter(y + m - 1, at, separator.y);
}
