/* SPDX-License-Identifier: MIT
 *
 * Dahl friction, (2.9) and (2.10): F = z N, z' = sigma (v - |v| z / mu_k).
 */
#define BD_LAW_dahl(X)                                                                             \
  X(dahl, mu_k, POSITIVE, "1", "kinetic friction coefficient (2.9)")                               \
  X(dahl, sigma, POSITIVE, "1/m", "Dahl stiffness, the slope dmu/ds at mu = 0 (2.9)")

#ifdef BD_LAW_FUNCTIONS

typedef struct dahl_constants {
  vec sigma, per_mu_k;
} dahl_constants;

INLINE dahl_constants dahl_prepare(const bd_dahl *p, double l0) {
  (void)l0;
  return (dahl_constants){splat(p->sigma), splat(1.0 / p->mu_k)};
}

INLINE law_value dahl_value(const dahl_constants *c, const law_at *at) {
  const vec resisting = at->z * c->per_mu_k;
  return (law_value){.force = at->z * at->normal,
                     .rate = c->sigma * fma_(-magnitude(at->v), resisting, at->v)};
}

INLINE law_slopes dahl_slopes(const dahl_constants *c, const law_at *at) {
  const vec none = splat(0.0), one = splat(1.0);
  const vec against = choose(less(none, at->v), -at->z, where(less(at->v, none), at->z));
  return (law_slopes){.by_normal = at->z,
                      .by_state = at->normal,
                      .rate_by_state = -(c->sigma * c->per_mu_k * magnitude(at->v)),
                      .rate_by_slip = c->sigma * fma_(against, c->per_mu_k, one)};
}

INLINE double dahl_bound(const bd_dahl *p) {
  return p->mu_k;
}

INLINE double dahl_kinetic(const bd_dahl *p) {
  return p->mu_k;
}

#endif
