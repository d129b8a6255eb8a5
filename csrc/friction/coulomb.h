/* SPDX-License-Identifier: MIT
 *
 * Coulomb friction, regularised, MODEL section 4: F = mu N v / sqrt(v^2 + v_reg^2), a function of
 * the slip velocity that has no state; with a Stribeck curve, mu is what that makes of it. Without
 * one its slope is largest at v = 0, mu N / v_reg.
 */
#define BD_LAW_coulomb(X)                                                                          \
  X(coulomb, mu, POSITIVE, "1", "friction coefficient")                                            \
  X(coulomb, v_reg, POSITIVE, "m/s", "slip velocity at which friction is 0.71 of its full force")  \
  BD_STRIBECK(X, coulomb)

#ifdef BD_LAW_FUNCTIONS

typedef struct coulomb_constants {
  vec mu, v_reg2;
  stribeck curve;
} coulomb_constants;

INLINE coulomb_constants coulomb_prepare(const bd_coulomb *p, double l0) {
  (void)l0;
  return (coulomb_constants){splat(p->mu), splat(p->v_reg * p->v_reg),
                             stribeck_prepare(p->mu, p->mu_s, p->v_stribeck)};
}

INLINE law_value coulomb_value(const coulomb_constants *c, const law_at *at) {
  vec root, inverse;
  root_and_inverse(fma_(at->v, at->v, c->v_reg2), &root, &inverse);
  const vec mu = c->mu + stribeck_above(&c->curve, at->v);
  return (law_value){.force = mu * at->normal * (at->v * inverse), .rate = splat(0.0)};
}

INLINE law_slopes coulomb_slopes(const coulomb_constants *c, const law_at *at) {
  vec root, inverse;
  root_and_inverse(fma_(at->v, at->v, c->v_reg2), &root, &inverse);
  const vec above = stribeck_above(&c->curve, at->v), mu = c->mu + above, side = at->v * inverse;
  const vec falls = stribeck_slope(&c->curve, at->v, above) * side;
  const vec by_slip = mu * at->normal * (c->v_reg2 * inverse * inverse * inverse);
  return (law_slopes){.by_normal = mu * side, .by_slip = fma_(falls, at->normal, by_slip)};
}

INLINE double coulomb_bound(const bd_coulomb *p) {
  (void)p;
  return 0.0;
}

INLINE double coulomb_kinetic(const bd_coulomb *p, int element) {
  (void)element;
  return p->mu;
}

#endif
