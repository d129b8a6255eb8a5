/* SPDX-License-Identifier: MIT
 *
 * Creep-rate-dependent friction (M. J. Leamy, T. M. Wasfy, J. Appl. Mech. 69 (2002) 763-771), MODEL
 * section 4: the coefficient grows in proportion to the slip velocity up to mu at v_critical, and
 * is mu beyond. No state.
 */
#define BD_LAW_creep_rate(X)                                                                       \
  X(creep_rate, mu, POSITIVE, "1", "friction coefficient from v_critical on")                      \
  X(creep_rate, v_critical, POSITIVE, "m/s", "slip velocity at which friction is fully developed")

#ifdef BD_LAW_FUNCTIONS

typedef struct creep_rate_constants {
  vec mu, v_critical, slope;
} creep_rate_constants;

INLINE creep_rate_constants creep_rate_prepare(const bd_creep_rate *p, double l0) {
  (void)l0;
  return (creep_rate_constants){splat(p->mu), splat(p->v_critical), splat(p->mu / p->v_critical)};
}

INLINE vec creep_rate_coefficient(const creep_rate_constants *c, vec v) {
  const vec full = choose(less(v, splat(0.0)), -c->mu, c->mu);
  return choose(less(magnitude(v), c->v_critical), c->slope * v, full);
}

INLINE law_value creep_rate_value(const creep_rate_constants *c, const law_at *at) {
  return (law_value){.force = creep_rate_coefficient(c, at->v) * at->normal, .rate = splat(0.0)};
}

INLINE law_slopes creep_rate_slopes(const creep_rate_constants *c, const law_at *at) {
  const vec speed = magnitude(at->v), half = splat(0.5);
  const vec at_kink = choose(less(c->v_critical, speed), splat(0.0), half * c->slope);
  const vec slope = choose(less(speed, c->v_critical), c->slope, at_kink);
  return (law_slopes){.by_normal = creep_rate_coefficient(c, at->v), .by_slip = slope * at->normal};
}

INLINE double creep_rate_bound(const bd_creep_rate *p) {
  (void)p;
  return 0.0;
}

INLINE double creep_rate_kinetic(const bd_creep_rate *p, int element) {
  (void)element;
  return p->mu;
}

#endif
