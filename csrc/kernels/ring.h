/* SPDX-License-Identifier: MIT
 *
 * The linear solver for the ring of links, compiled once per instruction level (BD_WIDTH: doubles
 * in a vector): cyclic block tridiagonal, 3 unknowns a link, O(n_b), no pivoting.
 *
 * The ring is cut into BD_WIDTH arcs that are eliminated in lockstep, one vector lane an arc, one
 * row of links (the j-th of every arc) at a time. The last link of an arc, its separator, stays:
 * elimination couples it to the separator of the arc before (F, E below). The separators, a ring of
 * one lane each, are halved in number by every step of a cyclic reduction that all lanes take
 * together, until each stands alone. Arcs differ by one link at most; a shorter one begins with a
 * row of the identity that is coupled to nothing.
 *
 * Blocks (jacobian.c derives them), e' = (-sin, cos) of a link, q = -k e' + spin w e:
 *   diagonal            diag(2 k + mass + contact, ..., k22)
 *   link i to i - 1     [-k 1 | q_{i-1} ; k e'_i | -e'_i.q_{i-1} - bending]
 *   link i - 1 to i     [-k 1 | -q_i ; -k e'_{i-1} | -e'_{i-1}.q_i - bending]
 * The diagonal blocks are those of an inertia plus stiffness and damping, positive definite but for
 * friction and links in compression, which is why no pivot is sought; a solve that went wrong shows
 * in numbers that are not finite or in the step's error. Guarded by tests/test_jacobian.py.
 */
#if defined(__GNUC__) || defined(__clang__)
typedef double pack __attribute__((vector_size(8 * BD_WIDTH), may_alias));
#else
#undef BD_WIDTH
#define BD_WIDTH 1
typedef double pack;
#endif

/* Steps of the cyclic reduction, log2 of the arcs. */
enum { REDUCTIONS = BD_WIDTH == 8 ? 3 : BD_WIDTH == 4 ? 2 : BD_WIDTH == 2 ? 1 : 0 };

/* What a row keeps for the solves, in packs. */
typedef struct ring_row {
  pack inverse[9];      /* D^-1, D the diagonal block */
  pack back[5];         /* coupling to the link behind: q, k e', corner */
  pack to_separator[9]; /* E: coupling of the separator before the arc to this row */
  pack next[9];         /* D^-1 U: what the link forward is worth here */
  pack left[9];         /* D^-1 F: the same of the separator before the arc */
} ring_row;

/* What the separators keep: times what stands 1, 2, 4 arcs before and after, and D^-1. */
typedef struct ring_ends {
  pack before[REDUCTIONS + 1][9], after[REDUCTIONS + 1][9], inverse[9];
} ring_ends;

/* --- lanes ----------------------------------------------------------------------------------- */

/* Lane l takes what lane l + n has, round the ring. */
#if BD_WIDTH == 8
#define TURNED(v, n)                                                                               \
  __builtin_shufflevector(v, v, (n)&7, (1 + (n)) & 7, (2 + (n)) & 7, (3 + (n)) & 7, (4 + (n)) & 7, \
                          (5 + (n)) & 7, (6 + (n)) & 7, (7 + (n)) & 7)
#elif BD_WIDTH == 4
#define TURNED(v, n)                                                                               \
  __builtin_shufflevector(v, v, (n)&3, (1 + (n)) & 3, (2 + (n)) & 3, (3 + (n)) & 3)
#elif BD_WIDTH == 2
#define TURNED(v, n) __builtin_shufflevector(v, v, (n)&1, (1 + (n)) & 1)
#else
#define TURNED(v, n) (v)
#endif

/* For every arc, what the arc `distance` before it has, or the one after it. */
SPECIALISED pack from_before(pack v, const int distance) {
  return distance == 1 ? TURNED(v, -1) : distance == 2 ? TURNED(v, -2) : TURNED(v, -4);
}

SPECIALISED pack from_after(pack v, const int distance) {
  return distance == 1 ? TURNED(v, 1) : distance == 2 ? TURNED(v, 2) : TURNED(v, 4);
}

/* Where the arcs' rows begin. */
SPECIALISED void places_of(const bd_ring *ring, ptrdiff_t *at) {
  for (int a = 0; a < BD_WIDTH; ++a) {
    at[a] = ring->base[a];
  }
}

/* One link of every arc. */
SPECIALISED pack lanes_from(const double *from, const ptrdiff_t *at) {
#define AT(k) from[at[k]]
#if BD_WIDTH == 8
  return (pack){AT(0), AT(1), AT(2), AT(3), AT(4), AT(5), AT(6), AT(7)};
#elif BD_WIDTH == 4
  return (pack){AT(0), AT(1), AT(2), AT(3)};
#elif BD_WIDTH == 2
  return (pack){AT(0), AT(1)};
#else
  return AT(0);
#endif
#undef AT
}

SPECIALISED void lanes_to(double *to, const ptrdiff_t *at, pack value) {
  double lane[BD_WIDTH];
  memcpy(lane, &value, sizeof lane);
  for (int a = 0; a < BD_WIDTH; ++a) {
    to[at[a]] = lane[a];
  }
}

SPECIALISED pack splat(double value) {
  return (pack){0} + value;
}

/* --- 3 x 3 blocks, rows first ---------------------------------------------------------------- */

/* L and U: l10 l20 l21, u01 u02 u12, reciprocal pivots; by minors, so that one division does. */
SPECIALISED void decompose(pack *lu, const pack *d) {
  const pack m11 = d[0] * d[4] - d[3] * d[1], m12 = d[0] * d[5] - d[3] * d[2];
  const pack m21 = d[0] * d[7] - d[6] * d[1], m22 = d[0] * d[8] - d[6] * d[2];
  const pack last = m11 * m22 - m12 * m21, first = d[0] * m11;
  const pack share = 1.0 / (first * last);
  const pack per_d00 = m11 * last * share, per_m11 = d[0] * last * share;
  lu[0] = d[3] * per_d00;
  lu[1] = d[6] * per_d00;
  lu[2] = m21 * per_m11;
  lu[3] = d[1];
  lu[4] = d[2];
  lu[5] = m12 * per_d00;
  lu[6] = per_d00;
  lu[7] = d[0] * per_m11;
  lu[8] = first * first * share;
}

/* x = D^-1 b, three entries `step` apart */
SPECIALISED void substitute(const pack *lu, const pack *b, pack *x, const int step) {
  const pack y1 = b[step] - lu[0] * b[0];
  const pack y2 = b[2 * step] - lu[1] * b[0] - lu[2] * y1;
  x[2 * step] = y2 * lu[8];
  x[step] = (y1 - lu[5] * x[2 * step]) * lu[7];
  x[0] = (b[0] - lu[3] * x[step] - lu[4] * x[2 * step]) * lu[6];
}

/* x = b D^-1, one row */
SPECIALISED void substitute_row(const pack *lu, const pack *b, pack *x) {
  const pack y0 = b[0] * lu[6];
  const pack y1 = (b[1] - y0 * lu[3]) * lu[7];
  x[2] = (b[2] - y0 * lu[4] - y1 * lu[5]) * lu[8];
  x[1] = y1 - x[2] * lu[2];
  x[0] = y0 - x[1] * lu[0] - x[2] * lu[1];
}

SPECIALISED void invert(const pack *lu, pack *x) {
  x[6] = (lu[2] * lu[0] - lu[1]) * lu[8];
  x[7] = -lu[2] * lu[8];
  x[8] = lu[8];
  x[3] = -(lu[0] + lu[5] * x[6]) * lu[7];
  x[4] = (1.0 - lu[5] * x[7]) * lu[7];
  x[5] = -lu[5] * x[8] * lu[7];
  x[0] = (1.0 - lu[3] * x[3] - lu[4] * x[6]) * lu[6];
  x[1] = -(lu[3] * x[4] + lu[4] * x[7]) * lu[6];
  x[2] = -(lu[3] * x[5] + lu[4] * x[8]) * lu[6];
}

/* out -= L x for one column of x: L is the coupling to the link behind */
SPECIALISED void take_behind(const pack *back, pack k, const pack *x, pack *out, const int step) {
  out[0] += k * x[0];
  out[0] -= back[0] * x[2 * step];
  out[step] += k * x[step];
  out[step] -= back[1] * x[2 * step];
  out[2 * step] -= back[2] * x[0];
  out[2 * step] -= back[3] * x[step];
  out[2 * step] -= back[4] * x[2 * step];
}

/* out -= a b */
SPECIALISED void take_product(const pack *a, const pack *b, pack *out) {
  for (int i = 0; i < 3; ++i) {
    for (int c = 0; c < 3; ++c) {
      for (int j = 0; j < 3; ++j) {
        out[3 * i + c] -= a[3 * i + j] * b[3 * j + c];
      }
    }
  }
}

/* out -= a x for one column */
SPECIALISED void take_column(const pack *a, const pack *x, pack *out) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      out[i] -= a[3 * i + j] * x[j];
    }
  }
}

/* --- separators ------------------------------------------------------------------------------ */

SPECIALISED void all_before(const pack *block, const int distance, pack *out) {
  for (int i = 0; i < 9; ++i) {
    out[i] = from_before(block[i], distance);
  }
}

SPECIALISED void all_after(const pack *block, const int distance, pack *out) {
  for (int i = 0; i < 9; ++i) {
    out[i] = from_after(block[i], distance);
  }
}

/* One step: every separator is freed of those `distance` before and after it, and is left coupled
 * to those twice as far. */
SPECIALISED void reduce(const int distance, pack *d, pack *left, pack *right, pack *before,
                        pack *after) {
  pack lu[9], near[9], far[9], new_left[9], new_right[9];
  decompose(lu, d);
  for (int i = 0; i < 9; ++i) {
    new_left[i] = new_right[i] = splat(0.0);
  }
  all_before(lu, distance, far);
  for (int r = 0; r < 9; r += 3) {
    substitute_row(far, left + r, before + r);
  }
  all_after(lu, distance, far);
  for (int r = 0; r < 9; r += 3) {
    substitute_row(far, right + r, after + r);
  }
  all_before(right, distance, near);
  all_before(left, distance, far);
  take_product(before, near, d);
  take_product(before, far, new_left);
  all_after(left, distance, near);
  all_after(right, distance, far);
  take_product(after, near, d);
  take_product(after, far, new_right);
  for (int i = 0; i < 9; ++i) {
    left[i] = new_left[i];
    right[i] = new_right[i];
  }
}

/* The last step: the separator before is the one after. */
SPECIALISED void reduce_last(pack *d, pack *left, const pack *right, pack *before) {
  enum { HALF = BD_WIDTH / 2 };
  pack lu[9], far[9];
  for (int i = 0; i < 9; ++i) {
    left[i] += right[i];
  }
  if (HALF == 0) { /* it is itself */
    for (int i = 0; i < 9; ++i) {
      d[i] += left[i];
    }
    return;
  }
  decompose(lu, d);
  all_before(lu, HALF, far);
  for (int r = 0; r < 9; r += 3) {
    substitute_row(far, left + r, before + r);
  }
  all_before(left, HALF, far);
  take_product(before, far, d);
}

static void separators_factor(ring_ends *ends, pack *d, pack *left, pack *right) {
  pack lu[9];
  if (REDUCTIONS > 1) {
    reduce(1, d, left, right, ends->before[0], ends->after[0]);
  }
  if (REDUCTIONS > 2) {
    reduce(2, d, left, right, ends->before[1], ends->after[1]);
  }
  reduce_last(d, left, right, ends->before[REDUCTIONS > 0 ? REDUCTIONS - 1 : 0]);
  decompose(lu, d);
  invert(lu, ends->inverse);
}

SPECIALISED void take_neighbours(const ring_ends *ends, const int step, pack *r) {
  pack before[3], after[3];
  for (int i = 0; i < 3; ++i) {
    before[i] = from_before(r[i], 1 << step);
    after[i] = from_after(r[i], 1 << step);
  }
  take_column(ends->before[step], before, r);
  if (step < REDUCTIONS - 1) {
    take_column(ends->after[step], after, r);
  }
}

SPECIALISED void separators_solve(const ring_ends *ends, pack *r, pack *u) {
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
  take_column(ends->inverse, r, u);
}

/* --- factorisation --------------------------------------------------------------------------- */

/* What the couplings of a link need of it. */
typedef struct ring_link {
  pack ex, ey; /* e' */
  pack qx, qy;
} ring_link;

SPECIALISED ring_link link_of(const bd_blocks *b, const ptrdiff_t *at, const int j, pack k,
                              pack spin) {
  const pack c = lanes_from(b->cos + j, at), s = lanes_from(b->sin + j, at);
  const pack turn = spin * lanes_from(b->spin + j, at);
  ring_link out = {.ex = -s, .ey = c, .qx = k * s + turn * c, .qy = turn * s - k * c};
  return out;
}

static void ring_factor(const bd_ring *ring, const bd_blocks *b) {
  ring_row *const row = ring->rows;
  const int m = ring->n_rows;
  ptrdiff_t at[BD_WIDTH];
  places_of(ring, at);
  const pack k = splat(b->k), bending = splat(b->bending), spin = splat(b->damping),
             zero = splat(0.0);
  pack shorter;
  memcpy(&shorter, ring->shorter, sizeof shorter);
  const pack whole = 1.0 - shorter;
  ring_link behind = link_of(b, at, -1, k, spin);
  pack d[9], lu[9], left[9], to_separator[9], own[9];
  for (int i = 0; i < 9; ++i) {
    left[i] = to_separator[i] = own[i] = lu[i] = zero;
  }
  for (int j = 0; j < m; ++j) {
    pack *const back = row[j].back;
    const ring_link here = link_of(b, at, j, k, spin);
    d[0] = lanes_from(b->xx + j, at);
    d[1] = lanes_from(b->xy + j, at);
    d[2] = d[5] = d[6] = d[7] = zero;
    d[3] = lanes_from(b->yx + j, at);
    d[4] = lanes_from(b->yy + j, at);
    d[8] = lanes_from(b->pp + j, at);
    back[0] = behind.qx;
    back[1] = behind.qy;
    back[2] = k * here.ex;
    back[3] = k * here.ey;
    back[4] = -(here.ex * behind.qx + here.ey * behind.qy) - bending;
    const pack forward[9] = {-k,
                             zero,
                             -here.qx,
                             zero,
                             -k,
                             -here.qy,
                             -k * behind.ex,
                             -k * behind.ey,
                             -(behind.ex * here.qx + behind.ey * here.qy) - bending};
    if (j > 0) {
      ring_row *const last = &row[j - 1];
      pack masked[9];
      for (int i = 0; i < 9; ++i) {
        masked[i] = forward[i];
        if (j == 1) {
          masked[i] *= whole;
        }
      }
      pack next[9], over[9], new_left[9], new_to_separator[9];
      for (int c = 0; c < 3; ++c) {
        substitute(lu, masked + c, next + c, 3);
        substitute(lu, left + c, over + c, 3);
      }
      for (int i = 0; i < 9; ++i) {
        new_left[i] = new_to_separator[i] = zero;
        last->next[i] = next[i];
        last->left[i] = over[i];
        last->to_separator[i] = to_separator[i];
      }
      for (int c = 0; c < 3; ++c) {
        take_behind(back, k, next + c, d + c, 3);
        take_behind(back, k, over + c, new_left + c, 3);
      }
      take_product(to_separator, next, new_to_separator);
      take_product(to_separator, over, own);
      for (int i = 0; i < 9; ++i) {
        left[i] = new_left[i];
        to_separator[i] = new_to_separator[i];
      }
    }
    /* where an arc begins, its first link meets the separator before it */
    if (j < 2) {
      const pack begins = j == 0 ? whole : shorter;
      const pack behind_block[9] = {-k,      zero,    back[0], zero,   -k,
                                    back[1], back[2], back[3], back[4]};
      for (int i = 0; i < 9; ++i) {
        left[i] += begins * behind_block[i];
        to_separator[i] += begins * forward[i];
      }
    }
    if (j == 0) {
      for (int i = 0; i < 9; ++i) {
        d[i] = whole * d[i] + (i % 4 == 0 ? shorter : zero);
      }
    }
    if (j < m - 1) {
      decompose(lu, d);
      invert(lu, row[j].inverse);
    }
    behind = here;
  }
  /* the separator's row after the arc is that of the arc that follows */
  pack right[9];
  for (int i = 0; i < 9; ++i) {
    d[i] += from_after(own[i], 1);
    right[i] = from_after(to_separator[i], 1);
  }
  separators_factor(ring->ends, d, left, right);
}

/* --- solve ----------------------------------------------------------------------------------- */

/* x, y, p: right-hand side in, solution out. */
static void ring_solve(const bd_ring *ring, double k_joint, double *x, double *y, double *p) {
  const ring_row *const row = ring->rows;
  pack *const z = ring->scratch;
  const int m = ring->n_rows;
  ptrdiff_t at[BD_WIDTH];
  places_of(ring, at);
  const pack k = splat(k_joint), zero = splat(0.0);
  pack shorter;
  memcpy(&shorter, ring->shorter, sizeof shorter);
  double *const fields[] = {x, y, p};
  pack r[3], own[3] = {zero, zero, zero}, v[3];
  for (int i = 0; i < 3; ++i) {
    v[i] = zero;
  }
  for (int j = 0; j < m; ++j) {
    for (int i = 0; i < 3; ++i) {
      r[i] = lanes_from(fields[i] + j, at);
      if (j == 0) {
        r[i] -= shorter * r[i];
      }
    }
    take_behind(row[j].back, k, v, r, 1);
    if (j < m - 1) {
      for (int i = 0; i < 3; ++i) {
        const pack *const inverse = row[j].inverse + 3 * i;
        v[i] = inverse[0] * r[0] + inverse[1] * r[1] + inverse[2] * r[2];
        z[3 * j + i] = v[i];
      }
      take_column(row[j].to_separator, v, own);
    }
  }
  pack u[3], before[3], separator[3];
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
    take_column(row[j].left, before, v);
    take_column(row[j].next, u, v);
    for (int i = 0; i < 3; ++i) {
      lanes_to(fields[i] + j, at, v[i]);
      u[i] = v[i];
    }
  }
  /* last, for the identity rows of short arcs stand on the separators before them */
  for (int i = 0; i < 3; ++i) {
    lanes_to(fields[i] + m - 1, at, separator[i]);
  }
}
