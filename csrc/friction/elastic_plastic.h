/* SPDX-License-Identifier: MIT
 *
 * Elastic/perfectly plastic friction, MODEL section 4: a spring and a damper side by side, per
 * metre of belt, in series with a slider that slips at mu N; with a Stribeck curve, mu is what that
 * makes of it. The state is the spring's stretch [m].
 */
#define BD_LAW_elastic_plastic(X)                                                                  \
  X(elastic_plastic, mu, POSITIVE, "1", "friction coefficient")                                    \
  X(elastic_plastic, stiffness, POSITIVE, "N/m^2", "of the friction spring, per metre of belt")    \
  X(elastic_plastic, damping, POSITIVE, "N s/m^2", "of the friction damper, per metre of belt")    \
  BD_STRIBECK(X, elastic_plastic)

#ifdef BD_LAW_FUNCTIONS

typedef struct elastic_plastic_constants {
  vec mu, stiffness, damping, per_damping; /* of a link */
  stribeck curve;
} elastic_plastic_constants;

INLINE elastic_plastic_constants elastic_plastic_prepare(const bd_elastic_plastic *p, double l0) {
  return (elastic_plastic_constants){.mu = splat(p->mu),
                                     .stiffness = splat(p->stiffness * l0),
                                     .damping = splat(p->damping * l0),
                                     .per_damping = splat(1.0 / (p->damping * l0)),
                                     .curve = stribeck_prepare(p->mu, p->mu_s, p->v_stribeck)};
}

/* The force of spring and damper if the link sticks, and whether it does. */
INLINE vec elastic_plastic_trial(const elastic_plastic_constants *c, const law_at *at, vec limit,
                                 mask *sticks) {
  const vec trial = fma_(c->damping, at->v, c->stiffness * at->z);
  *sticks = less(magnitude(trial), limit);
  return trial;
}

INLINE law_value elastic_plastic_value(const elastic_plastic_constants *c, const law_at *at) {
  mask sticks;
  const vec limit = (c->mu + stribeck_above(&c->curve, at->v)) * at->normal;
  const vec trial = elastic_plastic_trial(c, at, limit, &sticks);
  const vec force = choose(sticks, trial, choose(less(trial, splat(0.0)), -limit, limit));
  const vec slipping = fma_(-c->stiffness, at->z, force) * c->per_damping;
  return (law_value){.force = force, .rate = where(at->touch, choose(sticks, at->v, slipping))};
}

INLINE law_slopes elastic_plastic_slopes(const elastic_plastic_constants *c, const law_at *at) {
  const vec none = splat(0.0), one = splat(1.0);
  mask sticks;
  const vec above = stribeck_above(&c->curve, at->v), mu = c->mu + above;
  const vec trial = elastic_plastic_trial(c, at, mu * at->normal, &sticks);
  const vec side = choose(less(none, trial), one, where(less(trial, none), -one));
  const vec limit_by_slip = side * stribeck_slope(&c->curve, at->v, above) * at->normal;
  return (law_slopes){.by_normal = choose(sticks, none, side * mu),
                      .by_state = where(sticks, c->stiffness),
                      .by_slip = choose(sticks, c->damping, limit_by_slip),
                      .rate_by_normal = choose(sticks, none, side * mu * c->per_damping),
                      .rate_by_state = choose(sticks, none, -c->stiffness * c->per_damping),
                      .rate_by_slip = choose(sticks, one, limit_by_slip * c->per_damping)};
}

INLINE double elastic_plastic_bound(const bd_elastic_plastic *p) {
  (void)p;
  return INFINITY;
}

INLINE double elastic_plastic_kinetic(const bd_elastic_plastic *p, int element) {
  (void)element;
  return p->mu;
}

#endif
