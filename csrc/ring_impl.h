/* SPDX-License-Identifier: MIT
 *
 * The linear solver for the ring of links, compiled once per instruction level (BD_WIDTH: doubles
 * in a vector): cyclic block tridiagonal, 3 unknowns a link, O(n_b), no pivoting.
 *
 * The ring is cut into BD_WIDTH arcs that are eliminated in lockstep, one vector lane an arc, one
 * row of links (the j-th of every arc) at a time. The last link of an arc, its separator, stays:
 * elimination couples it to the separator of the arc before (F, E below), and the small dense
 * matrix of the separators is inverted. Arcs differ by one link at most; a shorter one begins with
 * a row of the identity that is coupled to nothing.
 *
 * Blocks (jacobian.c derives them), e' = (-sin, cos) of a link, q = -k e' + spin w e:
 *   diagonal            diag(2 k + mass + contact, ..., k22)
 *   link i to i - 1     [-k 1 | q_{i-1} ; k e'_i | -e'_i.q_{i-1} - bend]
 *   link i - 1 to i     [-k 1 | -q_i ; -k e'_{i-1} | -e'_{i-1}.q_i - bend]
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

enum { SEPARATED = 3 * BD_WIDTH };

/* What a row keeps for the solves, in packs. */
typedef struct ring_row {
  pack lu[9];   /* of the diagonal block: l10 l20 l21, u01 u02 u12, reciprocal pivots */
  pack next[9]; /* D^-1 U: what the link ahead is worth here */
  pack left[9]; /* D^-1 F: the same of the separator before the arc */
  pack back[5]; /* coupling to the link behind: q, k e', corner */
  pack rise[9]; /* E: coupling of the separator before the arc to this row */
} ring_row;

/* --- lanes ----------------------------------------------------------------------------------- */

#define AT(k) from[base[k]]
SPECIALISED pack lanes_from(const double *from, const int *base) {
#if BD_WIDTH == 8
  return (pack){AT(0), AT(1), AT(2), AT(3), AT(4), AT(5), AT(6), AT(7)};
#elif BD_WIDTH == 4
  return (pack){AT(0), AT(1), AT(2), AT(3)};
#elif BD_WIDTH == 2
  return (pack){AT(0), AT(1)};
#else
  return AT(0);
#endif
}
#undef AT

SPECIALISED void lanes_to(double *to, const int *base, pack value) {
  double lane[BD_WIDTH];
  memcpy(lane, &value, sizeof lane);
  for (int a = 0; a < BD_WIDTH; ++a) {
    to[base[a]] = lane[a];
  }
}

/* For every arc, what the arc before it has, or the one after it. */
SPECIALISED pack from_before(pack v) {
#if BD_WIDTH == 8
  return __builtin_shufflevector(v, v, 7, 0, 1, 2, 3, 4, 5, 6);
#elif BD_WIDTH == 4
  return __builtin_shufflevector(v, v, 3, 0, 1, 2);
#elif BD_WIDTH == 2
  return __builtin_shufflevector(v, v, 1, 0);
#else
  return v;
#endif
}

SPECIALISED pack from_after(pack v) {
#if BD_WIDTH == 8
  return __builtin_shufflevector(v, v, 1, 2, 3, 4, 5, 6, 7, 0);
#elif BD_WIDTH == 4
  return __builtin_shufflevector(v, v, 1, 2, 3, 0);
#else
  return from_before(v);
#endif
}

SPECIALISED pack splat(double value) {
  return (pack){0} + value;
}

/* --- 3 x 3 blocks, rows first ---------------------------------------------------------------- */

SPECIALISED void decompose(pack *lu, const pack *d) {
  lu[3] = d[1];
  lu[4] = d[2];
  lu[6] = 1.0 / d[0];
  lu[0] = d[3] * lu[6];
  lu[1] = d[6] * lu[6];
  const pack d11 = d[4] - lu[0] * d[1];
  lu[5] = d[5] - lu[0] * d[2];
  lu[7] = 1.0 / d11;
  lu[2] = (d[7] - lu[1] * d[1]) * lu[7];
  lu[8] = 1.0 / (d[8] - lu[1] * d[2] - lu[2] * lu[5]);
}

/* x = D^-1 b, three entries `step` apart */
SPECIALISED void substitute(const pack *lu, const pack *b, pack *x, const int step) {
  const pack y1 = b[step] - lu[0] * b[0];
  const pack y2 = b[2 * step] - lu[1] * b[0] - lu[2] * y1;
  x[2 * step] = y2 * lu[8];
  x[step] = (y1 - lu[5] * x[2 * step]) * lu[7];
  x[0] = (b[0] - lu[3] * x[step] - lu[4] * x[2 * step]) * lu[6];
}

/* out -= L x for one column of x: L is the coupling to the link behind */
SPECIALISED void take_behind(const pack *back, pack k, const pack *x, pack *out, const int step) {
  out[0] += k * x[0] - back[0] * x[2 * step];
  out[step] += k * x[step] - back[1] * x[2 * step];
  out[2 * step] -= back[2] * x[0] + back[3] * x[step] + back[4] * x[2 * step];
}

/* out -= a b */
SPECIALISED void take_product(const pack *a, const pack *b, pack *out) {
  for (int i = 0; i < 3; ++i) {
    for (int c = 0; c < 3; ++c) {
      out[3 * i + c] -= a[3 * i] * b[c] + a[3 * i + 1] * b[3 + c] + a[3 * i + 2] * b[6 + c];
    }
  }
}

/* --- factorisation --------------------------------------------------------------------------- */

/* What the couplings of a link need of it. */
typedef struct ring_link {
  pack ex, ey; /* e' */
  pack qx, qy;
} ring_link;

SPECIALISED ring_link link_of(const bd_blocks *b, const int *base, pack k, pack spin) {
  const pack c = lanes_from(b->cos, base), s = lanes_from(b->sin, base);
  const pack turn = spin * lanes_from(b->spin, base);
  ring_link out = {.ex = -s, .ey = c, .qx = k * s + turn * c, .qy = turn * s - k * c};
  return out;
}

/* Adds blocks to the separators' matrix, which is kept transposed, so that the columns of its
 * inverse lie together: rows of this arc's separator, or the one before; columns likewise. */
SPECIALISED void couple(double *matrix, const int row_before, const int column_before,
                        const pack *block) {
  for (int i = 0; i < 9; ++i) {
    double lane[BD_WIDTH];
    memcpy(lane, &block[i], sizeof lane);
    for (int a = 0; a < BD_WIDTH; ++a) {
      const int before = a > 0 ? a - 1 : BD_WIDTH - 1;
      const int r = i / 3 * BD_WIDTH + (row_before ? before : a);
      const int c = i % 3 * BD_WIDTH + (column_before ? before : a);
      matrix[c * SEPARATED + r] += lane[a];
    }
  }
}

/* Gauss-Jordan in place, the pivots of one component of all separators: where the pivot's column
 * stands, `others` is 0 and the column of the inverse takes its place. */
SPECIALISED void invert_component(double *matrix, const int component) {
  pack *const rows = (pack *)matrix;
  for (int lane = 0; lane < BD_WIDTH; ++lane) {
    const int k = component * BD_WIDTH + lane;
    double mask[BD_WIDTH] = {0.0};
    mask[lane] = 1.0;
    pack here;
    memcpy(&here, mask, sizeof here);
    const pack others = 1.0 - here;
    const double scale = 1.0 / matrix[k * SEPARATED + k];
    pack pivot[3];
    for (int c = 0; c < 3; ++c) {
      pivot[c] = rows[3 * k + c];
      if (c == component) {
        pivot[c] = others * pivot[c] + here;
      }
      pivot[c] *= scale;
    }
    for (int i = 0; i < SEPARATED; ++i) {
      const double factor = matrix[i * SEPARATED + k];
      for (int c = 0; c < 3; ++c) {
        pack value = rows[3 * i + c];
        if (c == component) {
          value *= others;
        }
        rows[3 * i + c] = value - factor * pivot[c];
      }
    }
    for (int c = 0; c < 3; ++c) {
      rows[3 * k + c] = pivot[c];
    }
  }
}

static void invert(double *matrix) {
  invert_component(matrix, 0);
  invert_component(matrix, 1);
  invert_component(matrix, 2);
}

static void ring_factor(const bd_ring *ring, const bd_blocks *b) {
  ring_row *const row = ring->rows;
  const int m = ring->n_rows;
  const pack k = splat(b->k), bend = splat(b->bend), spin = splat(b->damping), zero = splat(0.0);
  pack shorter;
  memcpy(&shorter, ring->shorter, sizeof shorter);
  const pack whole = 1.0 - shorter;
  int at[BD_WIDTH];
  for (int a = 0; a < BD_WIDTH; ++a) {
    at[a] = ring->base[a] - 1;
  }
  ring_link behind = link_of(b, at, k, spin);
  pack d[9], left[9], rise[9], own[9];
  for (int i = 0; i < 9; ++i) {
    left[i] = rise[i] = own[i] = zero;
  }
  for (int j = 0; j < m; ++j) {
    for (int a = 0; a < BD_WIDTH; ++a) {
      ++at[a];
    }
    const ring_link here = link_of(b, at, k, spin);
    pack *const back = row[j].back;
    back[0] = behind.qx;
    back[1] = behind.qy;
    back[2] = k * here.ex;
    back[3] = k * here.ey;
    back[4] = -(here.ex * behind.qx + here.ey * behind.qy) - bend;
    const pack ahead[9] = {-k,
                           zero,
                           -here.qx,
                           zero,
                           -k,
                           -here.qy,
                           -k * behind.ex,
                           -k * behind.ey,
                           -(behind.ex * here.qx + behind.ey * here.qy) - bend};
    d[0] = lanes_from(b->xx, at);
    d[1] = lanes_from(b->xy, at);
    d[2] = d[5] = d[6] = d[7] = zero;
    d[3] = lanes_from(b->yx, at);
    d[4] = lanes_from(b->yy, at);
    d[8] = lanes_from(b->pp, at);
    if (j > 0) {
      ring_row *const last = &row[j - 1];
      pack masked[9];
      for (int i = 0; i < 9; ++i) {
        masked[i] = ahead[i];
        if (j == 1) {
          masked[i] *= whole;
        }
      }
      pack next[9], over[9], new_left[9], new_rise[9];
      for (int c = 0; c < 3; ++c) {
        substitute(last->lu, masked + c, next + c, 3);
        substitute(last->lu, left + c, over + c, 3);
      }
      for (int i = 0; i < 9; ++i) {
        new_left[i] = new_rise[i] = zero;
        last->next[i] = next[i];
        last->left[i] = over[i];
        last->rise[i] = rise[i];
      }
      for (int c = 0; c < 3; ++c) {
        take_behind(back, k, next + c, d + c, 3);
        take_behind(back, k, over + c, new_left + c, 3);
      }
      take_product(rise, next, new_rise);
      take_product(rise, over, own);
      for (int i = 0; i < 9; ++i) {
        left[i] = new_left[i];
        rise[i] = new_rise[i];
      }
    }
    /* where an arc begins, its first link meets the separator before it */
    if (j < 2) {
      const pack begins = j == 0 ? whole : shorter;
      const pack behind_block[9] = {-k,      zero,    back[0], zero,   -k,
                                    back[1], back[2], back[3], back[4]};
      for (int i = 0; i < 9; ++i) {
        left[i] += begins * behind_block[i];
        rise[i] += begins * ahead[i];
      }
    }
    if (j == 0) {
      for (int i = 0; i < 9; ++i) {
        d[i] = whole * d[i] + (i % 4 == 0 ? shorter : zero);
      }
    }
    if (j < m - 1) {
      decompose(row[j].lu, d);
    }
    behind = here;
  }
  memset(ring->inverse, 0, (size_t)(SEPARATED * SEPARATED) * sizeof(double));
  for (int i = 0; i < 9; ++i) {
    d[i] += from_after(own[i]);
  }
  couple(ring->inverse, 0, 0, d);
  couple(ring->inverse, 0, 1, left);
  couple(ring->inverse, 1, 0, rise);
  invert(ring->inverse);
}

/* --- solve ----------------------------------------------------------------------------------- */

/* x, y, p: right-hand side in, solution out. */
static void ring_solve(const bd_ring *ring, double k_joint, double *x, double *y, double *p) {
  const ring_row *const row = ring->rows;
  pack *const z = ring->scratch;
  const int m = ring->n_rows;
  const pack k = splat(k_joint);
  pack shorter;
  memcpy(&shorter, ring->shorter, sizeof shorter);
  int at[BD_WIDTH];
  memcpy(at, ring->base, sizeof at);
  pack r[3], own[3] = {splat(0.0), splat(0.0), splat(0.0)};
  for (int j = 0; j < m; ++j) {
    r[0] = lanes_from(x, at);
    r[1] = lanes_from(y, at);
    r[2] = lanes_from(p, at);
    if (j == 0) {
      for (int i = 0; i < 3; ++i) {
        r[i] -= shorter * r[i];
      }
    } else {
      take_behind(row[j].back, k, z + 3 * (j - 1), r, 1);
    }
    if (j < m - 1) {
      substitute(row[j].lu, r, z + 3 * j, 1);
      const pack *const e = row[j].rise, *const v = z + 3 * j;
      for (int i = 0; i < 3; ++i) {
        own[i] -= e[3 * i] * v[0] + e[3 * i + 1] * v[1] + e[3 * i + 2] * v[2];
      }
    }
    for (int a = 0; a < BD_WIDTH; ++a) {
      ++at[a];
    }
  }
  /* the separators */
  double rhs[SEPARATED];
  for (int i = 0; i < 3; ++i) {
    r[i] += from_after(own[i]);
    memcpy(rhs + i * BD_WIDTH, &r[i], sizeof r[i]);
  }
  const pack *const columns = (const pack *)ring->inverse;
  pack u[3] = {splat(0.0), splat(0.0), splat(0.0)}, even[3] = {u[0], u[0], u[0]};
  for (int c = 0; c + 1 < SEPARATED + SEPARATED % 2; c += 2) {
    for (int i = 0; i < 3; ++i) {
      u[i] += columns[3 * c + i] * rhs[c];
      if (c + 1 < SEPARATED) {
        even[i] += columns[3 * (c + 1) + i] * rhs[c + 1];
      }
    }
  }
  pack before[3];
  for (int i = 0; i < 3; ++i) {
    u[i] += even[i];
    before[i] = from_before(u[i]);
  }
  const pack separator[3] = {u[0], u[1], u[2]};
  for (int j = m - 2; j >= 0; --j) {
    const pack *const n = row[j].next, *const l = row[j].left;
    pack v[3];
    for (int i = 0; i < 3; ++i) {
      v[i] = z[3 * j + i] -
             (l[3 * i] * before[0] + l[3 * i + 1] * before[1] + l[3 * i + 2] * before[2]);
      v[i] -= n[3 * i] * u[0] + n[3 * i + 1] * u[1] + n[3 * i + 2] * u[2];
    }
    for (int a = 0; a < BD_WIDTH; ++a) {
      at[a] = ring->base[a] + j;
    }
    lanes_to(x, at, v[0]);
    lanes_to(y, at, v[1]);
    lanes_to(p, at, v[2]);
    for (int i = 0; i < 3; ++i) {
      u[i] = v[i];
    }
  }
  /* last, for the identity rows of short arcs stand on the separators before them */
  for (int a = 0; a < BD_WIDTH; ++a) {
    at[a] = ring->base[a] + m - 1;
  }
  lanes_to(x, at, separator[0]);
  lanes_to(y, at, separator[1]);
  lanes_to(p, at, separator[2]);
}
