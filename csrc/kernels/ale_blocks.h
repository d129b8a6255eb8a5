/* SPDX-License-Identifier: MIT
 *
 * A belt that flows: factors of 1 - g J, cyclic and tridiagonal by blocks, and solutions. Blocks
 * are eliminated one after the other, the last of them apart; no pivot is sought: each has the
 * identity and what couples a cell's metres to the speed of its node, of opposite signs.
 */

/* Of most blocks, those of a cell and a node under a law of one state. */
enum { USUAL = 4 };

/* out = (minus) a b, or adds it; a of n x k, b of k x m. */
INLINE void multiply_fixed(const int n, const int k, const int m, double factor, const double *a,
                           const double *b, double *out, const int add) {
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < m; ++j) {
      double sum = 0.0;
      for (int l = 0; l < k; ++l) {
        sum += a[i * k + l] * b[l * m + j];
      }
      out[i * m + j] = add ? out[i * m + j] + factor * sum : factor * sum;
    }
  }
}

static void multiply_any(int n, int k, int m, double factor, const double *a, const double *b,
                         double *out, int add) {
  multiply_fixed(n, k, m, factor, a, b, out, add);
}

INLINE void multiply(int n, int k, int m, double factor, const double *a, const double *b,
                     double *out, const int add) {
  if (n == USUAL && k == USUAL && m == USUAL) {
    multiply_fixed(USUAL, USUAL, USUAL, factor, a, b, out, add);
  } else {
    multiply_any(n, k, m, factor, a, b, out, add);
  }
}

/* a = a^-1, by Gauss and Jordan. */
INLINE void invert_fixed(const int n, double *a) {
  for (int k = 0; k < n; ++k) {
    const double per = 1.0 / a[k * n + k];
    a[k * n + k] = 1.0;
    for (int j = 0; j < n; ++j) {
      a[k * n + j] *= per;
    }
    for (int i = 0; i < n; ++i) {
      if (i != k) {
        const double factor = a[i * n + k];
        a[i * n + k] = 0.0;
        for (int j = 0; j < n; ++j) {
          a[i * n + j] -= factor * a[k * n + j];
        }
      }
    }
  }
}

static void invert_any(int n, double *a) {
  invert_fixed(n, a);
}

INLINE void invert_block(int n, double *a) {
  if (n == USUAL) {
    invert_fixed(USUAL, a);
  } else {
    invert_any(n, a);
  }
}

/* 1 - g J of a block on itself. */
INLINE void begin_block(const bd_ale_block *block, double g, double *out) {
  const int n = block->n;
  for (int i = 0; i < n * n; ++i) {
    out[i] = -g * block->own[i];
  }
  for (int i = 0; i < n; ++i) {
    out[i * n + i] += 1.0;
  }
}

static void factor(const bd_ale_ring *ring) {
  const double g = ring->g;
  const bd_ale_block *const last = &ring->blocks[ring->n - 1];
  const int s = last->n, room = ring->largest * ring->largest;
  double *far = ring->scratch, *from = far + room;
  begin_block(last, g, last->inverse);
  for (int b = 0; b < ring->n - 1; ++b) {
    const bd_ale_block *block = &ring->blocks[b];
    const int n = block->n;
    begin_block(block, g, block->inverse);
    if (b == 0) {
      for (int i = 0; i < n * s; ++i) {
        far[i] = -g * block->back[i];
        from[i] = -g * last->ahead[i];
      }
    } else {
      const bd_ale_block *before = block - 1;
      multiply(n, before->n, n, g, block->back, before->next, block->inverse, 1);
      multiply(n, before->n, s, g, block->back, before->far, far, 0);
      multiply(s, before->n, n, -1.0, before->from, before->next, from, 0);
    }
    if (b == ring->n - 2) {
      for (int i = 0; i < n * s; ++i) {
        far[i] -= g * block->ahead[i];
        from[i] -= g * last->back[i];
      }
    }
    invert_block(n, block->inverse);
    multiply(n, n, s, 1.0, block->inverse, far, block->far, 0);
    if (b < ring->n - 2) {
      multiply(n, n, block[1].n, -g, block->inverse, block->ahead, block->next, 0);
    }
    memcpy(block->from, from, (size_t)(s * n) * sizeof *from);
    multiply(s, n, s, -1.0, from, block->far, last->inverse, 1);
  }
  invert_block(s, last->inverse);
}

/* out += factor a x */
INLINE void apply_block(int n, int m, double factor, const double *a, const double *x,
                        double *out) {
  if (n == USUAL && m == USUAL) {
    for (int i = 0; i < USUAL; ++i) {
      double sum = 0.0;
      for (int j = 0; j < USUAL; ++j) {
        sum += a[USUAL * i + j] * x[j];
      }
      out[i] += factor * sum;
    }
    return;
  }
  for (int i = 0; i < n; ++i) {
    double sum = 0.0;
    for (int j = 0; j < m; ++j) {
      sum += a[i * m + j] * x[j];
    }
    out[i] += factor * sum;
  }
}

/* By blocks, right-hand side in, solution out. */
static void solve(const bd_ale_ring *ring, double *x) {
  const bd_ale_block *const last = &ring->blocks[ring->n - 1];
  const int s = last->n;
  double *at_last = x + last->at, *rhs = ring->scratch;
  for (int b = 0; b < ring->n - 1; ++b) {
    const bd_ale_block *block = &ring->blocks[b];
    double *here = x + block->at;
    if (b > 0) {
      apply_block(block->n, block[-1].n, ring->g, block->back, x + block[-1].at, here);
    }
    memcpy(rhs, here, (size_t)block->n * sizeof *rhs);
    memset(here, 0, (size_t)block->n * sizeof *here);
    apply_block(block->n, block->n, 1.0, block->inverse, rhs, here);
    apply_block(s, block->n, -1.0, block->from, here, at_last);
  }
  memcpy(rhs, at_last, (size_t)s * sizeof *rhs);
  memset(at_last, 0, (size_t)s * sizeof *rhs);
  apply_block(s, s, 1.0, last->inverse, rhs, at_last);
  for (int b = ring->n - 2; b >= 0; --b) {
    const bd_ale_block *block = &ring->blocks[b];
    double *here = x + block->at;
    if (b < ring->n - 2) {
      apply_block(block->n, block[1].n, -1.0, block->next, x + block[1].at, here);
    }
    apply_block(block->n, s, -1.0, block->far, at_last, here);
  }
}
