/* SPDX-License-Identifier: MIT
 *
 * ALE belt: solutions by the factors of its ring (ale_blocks.h).
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
