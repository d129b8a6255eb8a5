/* SPDX-License-Identifier: MIT
 *
 * Coulomb friction in Threlfall's form (D. C. Threlfall, Mechanism and Machine Theory 13 (1978)
 * 475-483), MODEL section 4: F = mu N sign(v) (1 - exp(-3 |v| / v_reg)). No state.
 */
#define BD_LAW_threlfall(X)                                                                        \
  X(threlfall, mu, POSITIVE, "1", "friction coefficient")                                          \
  X(threlfall, v_reg, POSITIVE, "m/s", "slip velocity at which friction is 0.95 of its full force")

#ifdef BD_LAW_FUNCTIONS

typedef struct threlfall_constants {
  vec mu, per_v;
} threlfall_constants;

INLINE threlfall_constants threlfall_prepare(const bd_threlfall *p, double l0) {
  (void)l0;
  return (threlfall_constants){splat(p->mu), splat(3.0 / p->v_reg)};
}

/* What is missing to full friction, over that. */
INLINE vec threlfall_missing(const threlfall_constants *c, vec v) {
  return exponential(-(c->per_v * magnitude(v)));
}

INLINE vec threlfall_coefficient(const threlfall_constants *c, vec v, vec missing) {
  const vec mu = c->mu * (splat(1.0) - missing);
  return choose(less(v, splat(0.0)), -mu, mu);
}

INLINE law_value threlfall_value(const threlfall_constants *c, const law_at *at) {
  const vec mu = threlfall_coefficient(c, at->v, threlfall_missing(c, at->v));
  return (law_value){.force = mu * at->normal, .rate = splat(0.0)};
}

INLINE law_slopes threlfall_slopes(const threlfall_constants *c, const law_at *at) {
  const vec missing = threlfall_missing(c, at->v);
  return (law_slopes){.by_normal = threlfall_coefficient(c, at->v, missing),
                      .by_slip = c->mu * c->per_v * missing * at->normal};
}

INLINE double threlfall_bound(const bd_threlfall *p) {
  (void)p;
  return 0.0;
}

INLINE double threlfall_kinetic(const bd_threlfall *p, int element) {
  (void)element;
  return p->mu;
}

#endif
