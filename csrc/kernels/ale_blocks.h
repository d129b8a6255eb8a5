/* SPDX-License-Identifier: MIT
 *
 * A belt that flows: factors of 1 - g J, cyclic and tridiagonal by blocks. The last
 * block, which is the neighbour of the first and of the last but one, stands apart; the others are
 * eliminated from both ends to the middle, two chains that do not wait for each other. No pivot is
 * sought: each block has the identity and what couples a cell's metres to the speed of its node, of
 * opposite signs.
 *
 * Matrices stand by columns of `lead` rows, fours of them; those behind the block's are 0.
 */

enum { QUAD = 4, MOST_QUADS = 3, LARGEST = (BD_ALE_BLOCK + QUAD - 1) / QUAD * QUAD };

/* Four rows of a column. */
#if defined(__AVX2__) && !defined(BD_SCALAR)
typedef __m256d quad;

INLINE quad quad_at(const double *p) {
  return _mm256_loadu_pd(p);
}

INLINE void quad_to(double *p, quad a) {
  _mm256_storeu_pd(p, a);
}

/* sum + a x */
INLINE quad quad_add(quad sum, quad a, double x) {
  return _mm256_fmadd_pd(a, _mm256_set1_pd(x), sum);
}

INLINE quad quad_plus(quad a, quad b) {
  return a + b;
}

/* Row by row. */
INLINE quad quad_times(quad a, quad b) {
  return a * b;
}

INLINE double quad_lane(quad a, int i) {
  return a[i];
}
#else
typedef struct quad {
  vec part[QUAD / WIDTH];
} quad;

INLINE quad quad_at(const double *p) {
  quad a;
  memcpy(&a, p, sizeof a);
  return a;
}

INLINE void quad_to(double *p, quad a) {
  memcpy(p, &a, sizeof a);
}

INLINE quad quad_add(quad sum, quad a, double x) {
  for (int i = 0; i < QUAD / WIDTH; ++i) {
    sum.part[i] = sum.part[i] + a.part[i] * splat(x);
  }
  return sum;
}

INLINE quad quad_plus(quad a, quad b) {
  for (int i = 0; i < QUAD / WIDTH; ++i) {
    a.part[i] = a.part[i] + b.part[i];
  }
  return a;
}

INLINE quad quad_times(quad a, quad b) {
  for (int i = 0; i < QUAD / WIDTH; ++i) {
    a.part[i] = a.part[i] * b.part[i];
  }
  return a;
}

INLINE double quad_lane(quad a, int i) {
  double lanes[QUAD];
  quad_to(lanes, a);
  return lanes[i];
}
#endif

INLINE quad quad_none(void) {
  quad none;
  memset(&none, 0, sizeof none);
  return none;
}

/* Of the unit vector i four rows. */
INLINE quad unit_at(int i, int q) {
  static const double units[2 * LARGEST] = {[LARGEST] = 1.0};
  return quad_at(units + LARGEST - i + q * QUAD);
}

/* --- products --------------------------------------------------------------------------------- */

/* sum + a x, of so many fours of rows. */
INLINE void add_columns(const int quads, const int lead, const int k, const double *a,
                        const double *x, quad *sum) {
  for (int l = 0; l < k; ++l) {
    for (int q = 0; q < quads; ++q) {
      sum[q] = quad_add(sum[q], quad_at(a + l * lead + q * QUAD), x[l]);
    }
  }
}

INLINE void add_product(const int quads, const int lead, int k, const double *a, const double *x,
                        quad *sum) {
  if (k == QUAD) {
    add_columns(quads, lead, QUAD, a, x, sum);
  } else {
    add_columns(quads, lead, k, a, x, sum);
  }
}

/* Rows of out = factor a b, or that is added; b has k rows and m columns. */
INLINE void multiply_rows(const int quads, const int lead, int k, int m, double factor,
                          const double *a, const double *b, int lead_b, double *restrict out,
                          const int add) {
  for (int j = 0; j < m; ++j) {
    quad sum[MOST_QUADS] = {quad_none(), quad_none(), quad_none()};
    add_product(quads, lead, k, a, b + j * lead_b, sum);
    for (int q = 0; q < quads; ++q) {
      double *to = out + j * lead + q * QUAD;
      quad_to(to, quad_add(add ? quad_at(to) : quad_none(), sum[q], factor));
    }
  }
}

/* Of blocks that are not usual. */
static void multiply_any(int lead, int k, int m, double factor, const double *a, const double *b,
                         int lead_b, double *out, const int add) {
  if (lead == QUAD) {
    multiply_rows(1, QUAD, k, m, factor, a, b, lead_b, out, add);
  } else if (lead == 2 * QUAD) {
    multiply_rows(2, 2 * QUAD, k, m, factor, a, b, lead_b, out, add);
  } else if (lead == 3 * QUAD) {
    multiply_rows(3, 3 * QUAD, k, m, factor, a, b, lead_b, out, add);
  } else {
    for (int i = 0; i < lead; i += QUAD) {
      multiply_rows(1, lead, k, m, factor, a + i, b, lead_b, out + i, add);
    }
  }
}

INLINE void multiply(int lead, int k, int m, double factor, const double *a, const double *b,
                     int lead_b, double *out, const int add) {
  if (lead == QUAD && k == QUAD && m == QUAD && lead_b == QUAD) {
    multiply_rows(1, QUAD, QUAD, QUAD, factor, a, b, QUAD, out, add);
  } else {
    multiply_any(lead, k, m, factor, a, b, lead_b, out, add);
  }
}

/* a = a^-1 by Gauss and Jordan: c has of row i what the others take, whose pivots are divided by at
 * the end. In place, of so many fours of rows. */
INLINE void invert_rows(const int n, const int quads, double *a) {
  const int lead = quads * QUAD;
  double per[LARGEST];
  quad c[LARGEST / QUAD];
  for (int i = 0; i < n; ++i) {
    double *const pivots = a + i * lead;
    per[i] = 1.0 / pivots[i];
    for (int q = 0; q < quads; ++q) {
      const quad unit = unit_at(i, q);
      c[q] = quad_add(unit, quad_at(pivots + q * QUAD), -per[i]);
      quad_to(pivots + q * QUAD, quad_add(c[q], unit, 1.0));
    }
    for (int j = 0; j < n; ++j) {
      double *const to = a + j * lead, factor = to[i];
      for (int q = 0; q < quads && j != i; ++q) {
        quad_to(to + q * QUAD, quad_add(quad_at(to + q * QUAD), c[q], factor));
      }
    }
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      a[j * lead + i] *= per[i];
    }
  }
}

/* The same of four unknowns, of which all stays in registers. */
INLINE void invert_columns(quad column[QUAD]) {
  double per[QUAD];
  quad pivots = quad_none();
  for (int i = 0; i < QUAD; ++i) {
    const quad unit = unit_at(i, 0);
    per[i] = 1.0 / quad_lane(column[i], i);
    const quad c = quad_add(unit, column[i], -per[i]);
    for (int j = 0; j < QUAD; ++j) {
      column[j] = quad_add(j == i ? unit : column[j], c, j == i ? 1.0 : quad_lane(column[j], i));
    }
    pivots = quad_add(pivots, unit, per[i]);
  }
  for (int i = 0; i < QUAD; ++i) {
    column[i] = quad_times(column[i], pivots);
  }
}

INLINE void columns_at(const double *a, quad column[QUAD]) {
  for (int i = 0; i < QUAD; ++i) {
    column[i] = quad_at(a + i * QUAD);
  }
}

INLINE void columns_to(double *a, const quad column[QUAD]) {
  for (int i = 0; i < QUAD; ++i) {
    quad_to(a + i * QUAD, column[i]);
  }
}

INLINE void invert_four(double *a) {
  quad column[QUAD];
  columns_at(a, column);
  invert_columns(column);
  columns_to(a, column);
}

static void invert_any(int n, int lead, double *a) {
  if (lead == 2 * QUAD) {
    invert_rows(n, 2, a);
  } else if (lead == 3 * QUAD) {
    invert_rows(n, 3, a);
  } else {
    invert_rows(n, lead / QUAD, a);
  }
}

INLINE void invert(int n, int lead, double *a) {
  if (n == QUAD) {
    invert_four(a);
  } else {
    invert_any(n, lead, a);
  }
}

/* --- factors ---------------------------------------------------------------------------------- */

INLINE void scale(int n, double factor, const double *a, double *out) {
  for (int i = 0; i < n; ++i) {
    out[i] = factor * a[i];
  }
}

/* 1 - g J of a block on itself. */
INLINE void begin_block(const bd_ale_block *block, double g) {
  const double *own = block->own;
  double *to = block->inverse;
  for (int i = 0; i < block->n; ++i) {
    for (int q = 0; q < block->lead / QUAD; ++q, to += QUAD, own += QUAD) {
      quad_to(to, quad_add(unit_at(i, q), quad_at(own), -g));
    }
  }
}

/* The neighbour on one side. */
INLINE const bd_ale_block *beside(const bd_ale_ring *ring, int b, int side) {
  return &ring->blocks[side == 1 ? b + 1 : b > 0 ? b - 1 : ring->n - 1];
}

/* A block whose neighbours on these sides have been: with x_near = .. + over x + far x_last of
 * theirs, x = D^-1 (b + g J_near x_near ..), and the last one's row has `from` of it. */
static void eliminate(const bd_ale_ring *ring, int b, int behind, int ahead) {
  const bd_ale_block *const block = &ring->blocks[b], *const last = &ring->blocks[ring->n - 1];
  const int n = block->n, lead = block->lead, s = last->n;
  const double g = ring->g;
  double *const rhs = ring->scratch;
  const double *const coupled[2] = {block->back, block->ahead};
  const int been[2] = {behind, ahead};
  begin_block(block, g);
  for (int side = 0; side < 2; ++side) {
    const bd_ale_block *const near = beside(ring, b, side);
    if (been[side] && near == last) {
      scale(lead * s, g, coupled[side], rhs);
      scale(last->lead * n, g, side == 0 ? last->ahead : last->back, block->from);
    } else if (been[side]) {
      const double *over = near->over[1 - side];
      const int add = side == 1 && behind;
      multiply(lead, near->n, n, -g, coupled[side], over, near->lead, block->inverse, 1);
      multiply(lead, near->n, s, g, coupled[side], near->far, near->lead, rhs, add);
      multiply(last->lead, near->n, n, 1.0, near->from, over, near->lead, block->from, add);
    }
  }
  invert(n, lead, block->inverse);
  for (int side = 0; side < 2; ++side) {
    const bd_ale_block *const near = beside(ring, b, side);
    if (near != last) {
      multiply(lead, n, near->n, g, block->inverse, coupled[side], lead, block->over[side], 0);
    }
  }
  multiply(lead, n, s, 1.0, block->inverse, rhs, lead, block->far, 0);
  multiply(last->lead, n, s, -1.0, block->from, block->far, lead, last->inverse, 1);
}

/* sum + a b, of four by four. */
INLINE void add_four(const quad a[QUAD], const double *b, quad sum[QUAD]) {
  for (int j = 0; j < QUAD; ++j) {
    for (int l = 0; l < QUAD; ++l) {
      sum[j] = quad_add(sum[j], a[l], b[j * QUAD + l]);
    }
  }
}

INLINE void scale_four(quad a[QUAD], double factor) {
  for (int i = 0; i < QUAD; ++i) {
    a[i] = quad_add(quad_none(), a[i], factor);
  }
}

INLINE void clear_four(quad a[QUAD]) {
  for (int i = 0; i < QUAD; ++i) {
    a[i] = quad_none();
  }
}

/* As eliminate, of a block of four unknowns between such ones, of which the one on this side has
 * been; the last block has four. */
INLINE void eliminate_four(const bd_ale_ring *ring, int b, const int side) {
  const bd_ale_block *const block = &ring->blocks[b], *const last = &ring->blocks[ring->n - 1];
  const bd_ale_block *const near = side == 0 ? block - 1 : block + 1;
  const double *const been = side == 0 ? block->back : block->ahead;
  const double *const coming = side == 0 ? block->ahead : block->back;
  const double *const over = near->over[1 - side];
  double *const rhs = ring->scratch;
  quad a[QUAD], inverse[QUAD], sum[QUAD];
  columns_at(block->own, inverse);
  columns_at(been, a);
  for (int i = 0; i < QUAD; ++i) {
    inverse[i] = quad_add(unit_at(i, 0), inverse[i], -ring->g);
    a[i] = quad_add(quad_none(), a[i], -ring->g);
  }
  add_four(a, over, inverse);
  clear_four(sum);
  add_four(a, near->far, sum);
  columns_to(rhs, sum); /* less than 0 */
  columns_at(near->from, a);
  clear_four(sum);
  add_four(a, over, sum);
  columns_to(block->from, sum);
  invert_columns(inverse);
  columns_to(block->inverse, inverse);
  scale_four(inverse, -1.0);
  clear_four(a);
  add_four(inverse, rhs, a);
  columns_to(block->far, a);
  scale_four(inverse, -ring->g);
  clear_four(a);
  add_four(inverse, coming, a);
  columns_to(block->over[1 - side], a);
  clear_four(a);
  add_four(inverse, been, a);
  columns_to(block->over[side], a);
  scale_four(sum, -1.0);
  columns_at(last->inverse, a);
  add_four(sum, block->far, a);
  columns_to(last->inverse, a);
}

/* Towards the middle. */
INLINE void eliminate_from(const bd_ale_ring *ring, int b, const int side) {
  const bd_ale_block *const block = &ring->blocks[b];
  if (block->usual[0] && block->usual[1] && ring->blocks[ring->n - 1].n == QUAD) {
    eliminate_four(ring, b, side);
  } else {
    eliminate(ring, b, side == 0, side == 1);
  }
}

static void factor(const bd_ale_ring *ring) {
  const bd_ale_block *const last = &ring->blocks[ring->n - 1];
  const int middle = (ring->n - 1) / 2;
  begin_block(last, ring->g);
  for (int b = 0; b < middle; ++b) {
    eliminate_from(ring, b, 0);
    if (ring->n - 2 - b > middle) {
      eliminate_from(ring, ring->n - 2 - b, 1);
    }
  }
  eliminate(ring, middle, 1, 1);
  invert(last->n, last->lead, last->inverse);
}
