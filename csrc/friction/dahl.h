/* SPDX-License-Identifier: MIT
 *
 * Dahl friction, (2.9) and (2.10): F = z N, z' = sigma (v - |v| z / g), g = mu_k or, with a
 * Stribeck curve, what that adds to it.
 */
#define BD_LAW_dahl(X)                                                                             \
  X(dahl, mu_k, POSITIVE, "1", "kinetic friction coefficient (2.9)")                               \
  X(dahl, sigma, POSITIVE, "1/m", "Dahl stiffness, the slope dmu/ds at mu = 0 (2.9)")              \
  BD_STRIBECK(X, dahl)

#ifdef BD_LAW_FUNCTIONS

typedef struct dahl_constants {
  vec sigma, mu_k, per_mu_k;
  stribeck curve;
} dahl_constants;

INLINE dahl_constants dahl_prepare(const bd_dahl *p, double l0) {
  (void)l0;
  return (dahl_constants){.sigma = splat(p->sigma),
                          .mu_k = splat(p->mu_k),
                          .per_mu_k = splat(1.0 / p->mu_k),
                          .curve = stribeck_prepare(p->mu_k, p->mu_s, p->v_stribeck)};
}

INLINE vec dahl_per_g(const dahl_constants *c, vec above) {
  return c->curve.on ? 1.0 / (c->mu_k + above) : c->per_mu_k;
}

INLINE law_value dahl_value(const dahl_constants *c, const law_at *at) {
  const vec resisting = at->z * dahl_per_g(c, stribeck_above(&c->curve, at->v));
  return (law_value){.force = at->z * at->normal,
                     .rate = c->sigma * fma_(-magnitude(at->v), resisting, at->v)};
}

INLINE law_slopes dahl_slopes(const dahl_constants *c, const law_at *at) {
  const vec none = splat(0.0), one = splat(1.0), speed = magnitude(at->v);
  const vec above = stribeck_above(&c->curve, at->v), per_g = dahl_per_g(c, above);
  const vec against = choose(less(none, at->v), -at->z, where(less(at->v, none), at->z));
  vec by_slip = fma_(against, per_g, one);
  if (c->curve.on) {
    by_slip = fma_(speed * at->z * per_g * per_g, stribeck_slope(&c->curve, at->v, above), by_slip);
  }
  return (law_slopes){.by_normal = at->z,
                      .by_state = at->normal,
                      .rate_by_state = -(c->sigma * per_g * speed),
                      .rate_by_slip = c->sigma * by_slip};
}

INLINE double dahl_bound(const bd_dahl *p) {
  return stribeck_highest(p->mu_k, p->mu_s);
}

INLINE double dahl_kinetic(const bd_dahl *p, int element) {
  (void)element;
  return p->mu_k;
}

#endif
