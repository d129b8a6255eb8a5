/* SPDX-License-Identifier: MIT
 *
 * ALE belt: modes of a span, as many at once as a vector has.
 */

enum { MODES = (int)WIDTH < (int)BD_ALE_MODES ? (int)WIDTH : (int)BD_ALE_MODES };
#if !defined(__GNUC__) || defined(BD_SCALAR)
typedef double modes;
#else
typedef double modes __attribute__((vector_size(8 * MODES)));
#endif

INLINE modes modes_at(const double *p) {
  modes out;
  memcpy(&out, p, sizeof out);
  return out;
}

INLINE void modes_to(double *p, modes a) {
  memcpy(p, &a, sizeof a);
}

INLINE modes each(double a) {
  return a - (modes){0.0};
}

/* +1, -1, +1, -1 from mode n on: their slopes at a span's end by those at its beginning. */
INLINE modes turned_at(int n) {
  static const double signs[BD_ALE_MODES] = {1.0, -1.0, 1.0, -1.0};
  return modes_at(signs + n);
}

INLINE double sum_of_modes(modes a) {
  double all[MODES];
  modes_to(all, a);
  for (int half = MODES / 2; half > 0; half /= 2) {
    for (int n = 0; n < half; ++n) {
      all[n] += all[n + half];
    }
  }
  return all[0];
}

/* Of modes from n on lambda_n / k^2 less H. */
INLINE modes stiff_at(const bd_ale_span *span, int n, double pressing) {
  const bd_ale_waves *waves = span->waves;
  const modes wave = modes_at(span->wave + n);
  return (pressing - waves->pressing) * modes_at(waves->rises + n) +
         modes_at(waves->stiff + n) * wave * wave;
}

/* Of modes from n on G S a, whose matrix is antisymmetric. */
INLINE modes coupled(const bd_ale_waves *waves, int n, const double *a) {
  modes sum = each(0.0);
  for (int r = 0; r < BD_ALE_MODES; ++r) {
    sum = sum - a[r] * modes_at(waves->gyro[r] + n);
  }
  return sum;
}
