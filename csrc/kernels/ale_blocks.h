/* SPDX-License-Identifier: MIT
 *
 * ALE belt: factors of 1 - g J, cyclic and tridiagonal by blocks, and solutions. Blocks
 * are eliminated one after the other, the last of them apart; no pivot is sought: each has the
 * identity and what couples a cell's metres to the speed of its node, of opposite signs.
 *
 * One chain round the ring, with one block of a cell as the only separator, carries 4 columns
 * through every block; spans as separators and arcs from both ends would carry the 7 of a span.
 */

/* Of most blocks, those of a cell and a node under a law of one state. */
enum { USUAL = 4, LARGEST = BD_ALE_BLOCK };

/* Blocks stand by columns. out = factor a b, or that is added; a of n x k, b of k x m. */
INLINE void multiply_fixed(const int n, const int k, const int m, double factor, const double *a,
                           const double *b, double *out, const int add) {
  for (int j = 0; j < m; ++j) {
    double sum[LARGEST];
    for (int i = 0; i < n; ++i) {
      sum[i] = 0.0;
    }
    for (int l = 0; l < k; ++l) {
      for (int i = 0; i < n; ++i) {
        sum[i] += a[l * n + i] * b[j * k + l];
      }
    }
    for (int i = 0; i < n; ++i) {
      out[j * n + i] = add ? out[j * n + i] + factor * sum[i] : factor * sum[i];
    }
  }
}

#if defined(__GNUC__) && !defined(BD_SCALAR)
typedef double four __attribute__((vector_size(32)));

/* The same of four rows, a column at once. */
INLINE void multiply_four(int k, int m, double factor, const double *a, const double *b,
                          double *out, const int add) {
  for (int j = 0; j < m; ++j) {
    four sum = {0.0, 0.0, 0.0, 0.0}, column;
    for (int l = 0; l < k; ++l) {
      memcpy(&column, a + USUAL * l, sizeof column);
      sum += column * b[j * k + l];
    }
    memcpy(&column, out + USUAL * j, sizeof column);
    sum = add ? column + factor * sum : factor * sum;
    memcpy(out + USUAL * j, &sum, sizeof sum);
  }
}
#else
INLINE void multiply_four(int k, int m, double factor, const double *a, const double *b,
                          double *out, const int add) {
  multiply_fixed(USUAL, k, m, factor, a, b, out, add);
}
#endif

INLINE void multiply(int n, int k, int m, double factor, const double *a, const double *b,
                     double *out, const int add) {
  if (n == USUAL && k == USUAL && m == 1) {
    multiply_four(USUAL, 1, factor, a, b, out, add);
  } else if (n == USUAL && k == USUAL && m == USUAL) {
    multiply_four(USUAL, USUAL, factor, a, b, out, add);
  } else if (n == USUAL) {
    multiply_four(k, m, factor, a, b, out, add);
  } else {
    multiply_fixed(n, k, m, factor, a, b, out, add);
  }
}

/* a = a^-1, by Gauss and Jordan; by rows or by columns alike. */
INLINE void invert_fixed(const int n, double *given) {
  double usual[USUAL * USUAL], *const a = n == USUAL ? usual : given;
  if (n == USUAL) {
    memcpy(a, given, sizeof usual);
  }
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
  if (n == USUAL) {
    memcpy(given, a, sizeof usual);
  }
}

INLINE void invert_block(int n, double *a) {
  if (n == USUAL) {
    invert_fixed(USUAL, a);
  } else {
    invert_fixed(n, a);
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
  const int s = last->n;
  double *far = ring->scratch, *from = far + ring->largest * ring->largest;
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
    if (b > 0) {
      multiply(n, n, block[-1].n, g, block->inverse, block->back, block->behind, 0);
    }
    multiply(n, n, s, 1.0, block->inverse, far, block->far, 0);
    if (b < ring->n - 2) {
      multiply(n, n, block[1].n, -g, block->inverse, block->ahead, block->next, 0);
    }
    memcpy(block->from, from, (size_t)(s * n) * sizeof from[0]);
    multiply(s, n, s, -1.0, from, block->far, last->inverse, 1);
  }
  invert_block(s, last->inverse);
}

/* out = (out +) factor a x */
INLINE void apply_block(int n, int m, double factor, const double *a, const double *x, double *out,
                        const int add) {
  multiply(n, m, 1, factor, a, x, out, add);
}

/* By blocks, right-hand side in, solution out. What depends on the block before, or behind, is one
 * product each: the others can be done meanwhile. */
static void solve(const bd_ale_ring *ring, double *x) {
  const bd_ale_block *const last = &ring->blocks[ring->n - 1];
  const int s = last->n;
  double *at_last = x + last->at, rhs[LARGEST];
  for (int b = 0; b < ring->n - 1; ++b) {
    const bd_ale_block *block = &ring->blocks[b];
    double *here = x + block->at;
    memcpy(rhs, here, (size_t)block->n * sizeof *rhs);
    apply_block(block->n, block->n, 1.0, block->inverse, rhs, here, 0);
    if (b > 0) {
      apply_block(block->n, block[-1].n, 1.0, block->behind, x + block[-1].at, here, 1);
    }
    apply_block(s, block->n, -1.0, block->from, here, at_last, 1);
  }
  memcpy(rhs, at_last, (size_t)s * sizeof *rhs);
  apply_block(s, s, 1.0, last->inverse, rhs, at_last, 0);
  for (int b = ring->n - 2; b >= 0; --b) {
    const bd_ale_block *block = &ring->blocks[b];
    double *here = x + block->at;
    apply_block(block->n, s, -1.0, block->far, at_last, here, 1);
    if (b < ring->n - 2) {
      apply_block(block->n, block[1].n, -1.0, block->next, x + block[1].at, here, 1);
    }
  }
}
