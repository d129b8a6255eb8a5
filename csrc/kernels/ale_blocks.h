/* SPDX-License-Identifier: MIT
 *
 * A belt that flows: factors of 1 - g J, cyclic and tridiagonal by blocks, and solutions. The last
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

/* --- solutions ----------------------------------------------------------------------------------
 */

/* On the way to the middle D^-1 of what stands in a block and what is known of the neighbours on
 * these sides, on the way back from it the last block and those, which are added. */
INLINE const double *first_matrix(const bd_ale_block *block, const int back) {
  return back ? block->far : block->inverse;
}

/* Of a block of four unknowns beside one of four. Two sums, for one would wait for itself. */
INLINE void solve_four(const bd_ale_block *block, const double *over, const double *near,
                       const double *first, const int back, double *here) {
  const double *const a = first_matrix(block, back);
  quad own = back ? quad_at(here) : quad_none(), other = quad_none();
  add_columns(1, QUAD, QUAD, a, first, &own);
  add_columns(1, QUAD, QUAD, over, near, &other);
  quad_to(here, quad_plus(own, other));
}

INLINE void solve_rows(const bd_ale_ring *ring, int b, const int sides[2], const int back,
                       const int quads, const int lead, int from, double *x, double *out) {
  const bd_ale_block *const block = &ring->blocks[b], *const last = &ring->blocks[ring->n - 1];
  const bd_ale_block *const first = back ? last : block;
  quad sum[MOST_QUADS] = {quad_none(), quad_none(), quad_none()};
  add_columns(quads, lead, first->n, first_matrix(block, back) + from, x + first->at, sum);
  for (int side = 0; side < 2; ++side) {
    const bd_ale_block *const near = beside(ring, b, side);
    if (sides[side] && near != last) {
      add_columns(quads, lead, near->n, block->over[side] + from, x + near->at, sum);
    }
  }
  for (int q = 0; q < quads; ++q) {
    quad_to(out + from + q * QUAD, sum[q]);
  }
}

/* Of a block that is not usual, or stands beside one. */
static void solve_any(const bd_ale_ring *ring, int b, int behind, int ahead, int back, double *x) {
  const bd_ale_block *const block = &ring->blocks[b];
  const int n = block->n, lead = block->lead, sides[2] = {behind, ahead};
  double *const here = x + block->at, out[LARGEST];
  if (lead == QUAD) {
    solve_rows(ring, b, sides, back, 1, QUAD, 0, x, out);
  } else if (lead == 2 * QUAD) {
    solve_rows(ring, b, sides, back, 2, 2 * QUAD, 0, x, out);
  } else if (lead == 3 * QUAD) {
    solve_rows(ring, b, sides, back, 3, 3 * QUAD, 0, x, out);
  } else {
    for (int i = 0; i < lead; i += QUAD) {
      solve_rows(ring, b, sides, back, 1, lead, i, x, out);
    }
  }
  for (int i = 0; i < n; ++i) {
    here[i] = back ? here[i] + out[i] : out[i];
  }
}

INLINE void solve_block(const bd_ale_ring *ring, int b, const int behind, const int ahead,
                        const int back, double *x) {
  const bd_ale_block *const block = &ring->blocks[b], *const last = &ring->blocks[ring->n - 1];
  const bd_ale_block *const near = ahead ? block + 1 : block - 1;
  if (behind + ahead == 1 && block->usual[ahead] && (!back || last->n == QUAD)) {
    double *const here = x + block->at;
    solve_four(block, block->over[ahead], x + near->at, back ? x + last->at : here, back, here);
  } else {
    solve_any(ring, b, behind, ahead, back, x);
  }
}

/* Four rows of a sum over many columns, of which four do not wait for each other. */
INLINE quad add_many(const int lead, int n, const double *a, const double *x) {
  quad sum[QUAD] = {quad_none(), quad_none(), quad_none(), quad_none()};
  int u = 0;
  for (; u + QUAD <= n; u += QUAD, a += QUAD * lead) {
    for (int l = 0; l < QUAD; ++l) {
      sum[l] = quad_add(sum[l], quad_at(a + l * lead), x[u + l]);
    }
  }
  for (; u < n; ++u, a += lead) {
    sum[0] = quad_add(sum[0], quad_at(a), x[u]);
  }
  return quad_plus(quad_plus(sum[0], sum[1]), quad_plus(sum[2], sum[3]));
}

/* The last block, from what all others stand at. */
INLINE void solve_last(const bd_ale_ring *ring, double *x) {
  const bd_ale_block *const last = &ring->blocks[ring->n - 1];
  const int lead = last->lead;
  double *const here = x + last->at, rhs[LARGEST];
  for (int i = 0; i < lead; i += QUAD) {
    const quad sum = lead == QUAD ? add_many(QUAD, last->at, ring->from, x)
                                  : add_many(lead, last->at, ring->from + i, x);
    quad_to(rhs + i, sum);
  }
  for (int i = 0; i < last->n; ++i) {
    rhs[i] += here[i];
    here[i] = 0.0;
  }
  for (int l = 0; l < last->n; ++l) {
    for (int i = 0; i < last->n; ++i) {
      here[i] += last->inverse[l * lead + i] * rhs[l];
    }
  }
}

/* --- several right-hand sides, a lane each ---------------------------------------------------- */

/* Four rows of sum + a x. */
INLINE void add_rows(const int lead, const int k, const double *a, const double *x, vec sum[QUAD]) {
  for (int l = 0; l < k; ++l) {
    const vec factor = load(x + l * WIDTH);
    for (int i = 0; i < QUAD; ++i) {
      sum[i] = fma_(splat(a[l * lead + i]), factor, sum[i]);
    }
  }
}

INLINE void clear_rows(vec sum[QUAD]) {
  for (int i = 0; i < QUAD; ++i) {
    sum[i] = splat(0.0);
  }
}

/* As solve_four. */
INLINE void solve_four_lanes(const bd_ale_block *block, const double *over, const double *near,
                             const double *first, const int back, double *here) {
  vec sum[QUAD];
  for (int i = 0; i < QUAD; ++i) {
    sum[i] = back ? load(here + i * WIDTH) : splat(0.0);
  }
  add_rows(QUAD, QUAD, first_matrix(block, back), first, sum);
  add_rows(QUAD, QUAD, over, near, sum);
  for (int i = 0; i < QUAD; ++i) {
    store(here + i * WIDTH, sum[i]);
  }
}

/* As solve_any. */
static void solve_any_lanes(const bd_ale_ring *ring, int b, int behind, int ahead, int back,
                            double *x) {
  const bd_ale_block *const block = &ring->blocks[b], *const last = &ring->blocks[ring->n - 1];
  const bd_ale_block *const first = back ? last : block;
  const int lead = block->lead, sides[2] = {behind, ahead};
  double *const here = x + block->at * WIDTH;
  vec out[LARGEST];
  for (int i = 0; i < lead; i += QUAD) {
    vec sum[QUAD];
    clear_rows(sum);
    add_rows(lead, first->n, first_matrix(block, back) + i, x + first->at * WIDTH, sum);
    for (int side = 0; side < 2; ++side) {
      const bd_ale_block *const near = beside(ring, b, side);
      if (sides[side] && near != last) {
        add_rows(lead, near->n, block->over[side] + i, x + near->at * WIDTH, sum);
      }
    }
    memcpy(out + i, sum, sizeof sum);
  }
  for (int r = 0; r < block->n; ++r) {
    store(here + r * WIDTH, back ? load(here + r * WIDTH) + out[r] : out[r]);
  }
}

INLINE void solve_lanes(const bd_ale_ring *ring, int b, const int behind, const int ahead,
                        const int back, double *x) {
  const bd_ale_block *const block = &ring->blocks[b], *const last = &ring->blocks[ring->n - 1];
  const bd_ale_block *const near = ahead ? block + 1 : block - 1;
  if (behind + ahead == 1 && block->usual[ahead] && (!back || last->n == QUAD)) {
    double *const here = x + block->at * WIDTH;
    solve_four_lanes(block, block->over[ahead], x + near->at * WIDTH,
                     back ? x + last->at * WIDTH : here, back, here);
  } else {
    solve_any_lanes(ring, b, behind, ahead, back, x);
  }
}

static void solve_last_lanes(const bd_ale_ring *ring, double *x) {
  const bd_ale_block *const last = &ring->blocks[ring->n - 1];
  const int lead = last->lead;
  double *const here = x + last->at * WIDTH;
  vec rhs[LARGEST], sum[LARGEST];
  for (int i = 0; i < lead; i += QUAD) {
    vec one[QUAD], other[QUAD];
    const double *from = ring->from + i;
    int u = 0;
    clear_rows(one);
    clear_rows(other);
    for (; u + 2 <= last->at; u += 2, from += 2 * lead) {
      add_rows(lead, 1, from, x + u * WIDTH, one);
      add_rows(lead, 1, from + lead, x + (u + 1) * WIDTH, other);
    }
    if (u < last->at) {
      add_rows(lead, 1, from, x + u * WIDTH, one);
    }
    for (int r = 0; r < QUAD; ++r) {
      const vec own = i + r < last->n ? load(here + (i + r) * WIDTH) : splat(0.0);
      rhs[i + r] = own + (one[r] + other[r]);
      sum[i + r] = splat(0.0);
    }
  }
  for (int l = 0; l < last->n; ++l) {
    for (int r = 0; r < last->n; ++r) {
      sum[r] = fma_(splat(last->inverse[l * lead + r]), rhs[l], sum[r]);
    }
  }
  for (int r = 0; r < last->n; ++r) {
    store(here + r * WIDTH, sum[r]);
  }
}

/* --- all blocks ------------------------------------------------------------------------------- */

INLINE void solve_at(const bd_ale_ring *ring, int b, const int behind, const int ahead,
                     const int back, double *x, const int lanes) {
  if (lanes) {
    solve_lanes(ring, b, behind, ahead, back, x);
  } else {
    solve_block(ring, b, behind, ahead, back, x);
  }
}

/* From both ends to the middle, and back. */
INLINE void solve_ring(const bd_ale_ring *ring, double *x, const int lanes) {
  const int middle = (ring->n - 1) / 2, end = ring->n - 2;
  for (int b = 0; b < middle; ++b) {
    solve_at(ring, b, 1, 0, 0, x, lanes);
    if (end - b > middle) {
      solve_at(ring, end - b, 0, 1, 0, x, lanes);
    }
  }
  solve_at(ring, middle, 1, 1, 0, x, lanes);
  if (lanes) {
    solve_last_lanes(ring, x);
  } else {
    solve_last(ring, x);
  }
  solve_at(ring, middle, 0, 0, 1, x, lanes);
  for (int b = middle - 1; b >= 0; --b) {
    solve_at(ring, b, 0, 1, 1, x, lanes);
    if (end - b > middle) {
      solve_at(ring, end - b, 1, 0, 1, x, lanes);
    }
  }
}

/* By blocks, right-hand side in, solution out. */
static void solve(const bd_ale_ring *ring, double *x) {
  solve_ring(ring, x, 0);
}

/* A lane without a right-hand side has that of the last one. */
static void solve_all(const bd_ale_ring *ring, int n, int width, double *x) {
  for (int first = 0; first < n; first += WIDTH) {
    double *columns[WIDTH];
    for (int lane = 0; lane < WIDTH; ++lane) {
      columns[lane] = x + (first + lane < n ? first + lane : n - 1) * width;
    }
    for (int u = 0; u < ring->unknowns; ++u) {
      for (int lane = 0; lane < WIDTH; ++lane) {
        ring->lanes[u * WIDTH + lane] = columns[lane][u];
      }
    }
    solve_ring(ring, ring->lanes, 1);
    for (int u = 0; u < ring->unknowns; ++u) {
      for (int lane = 0; lane < WIDTH; ++lane) {
        columns[lane][u] = ring->lanes[u * WIDTH + lane];
      }
    }
  }
}

/* So many vectors of them. */
INLINE void deduct_at(const int vectors, int n, int width, const double *columns,
                      const double *factors, double *x) {
  vec left[QUAD];
  for (int i = 0; i < vectors; ++i) {
    left[i] = load(x + i * WIDTH);
  }
  for (int k = 0; k < n; ++k) {
    const vec factor = splat(factors[k]);
    for (int i = 0; i < vectors; ++i) {
      left[i] = fnma_(factor, load(columns + k * width + i * WIDTH), left[i]);
    }
  }
  for (int i = 0; i < vectors; ++i) {
    store(x + i * WIDTH, left[i]);
  }
}

static void deduct(int unknowns, int n, int width, const double *columns, const double *factors,
                   double *x) {
  int u = 0;
  for (; u + QUAD * WIDTH <= unknowns; u += QUAD * WIDTH) {
    deduct_at(QUAD, n, width, columns + u, factors, x + u);
  }
  for (; u < unknowns; u += WIDTH) {
    deduct_at(1, n, width, columns + u, factors, x + u);
  }
}
