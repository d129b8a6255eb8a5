/* SPDX-License-Identifier: MIT
 *
 * Blocks of d x d, d = 2, 3 or 4, rows first: products, and their factors (ring.h). d is a constant
 * wherever these are put in place.
 */

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
