/* SPDX-License-Identifier: MIT
 *
 * LuGre friction (C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, IEEE Trans. Automatic
 * Control 40, 1995), MODEL section 4: Dahl's bristles under a Stribeck curve g(v), with damping d
 * of the bristles and a viscous part e. With h = v - |v| z / g, z' = sigma h and F = N (z + d h + e
 * v).
 */
#define BD_LAW_lugre(X)                                                                            \
  X(lugre, mu_k, POSITIVE, "1", "kinetic friction coefficient")                                    \
  X(lugre, mu_s, POSITIVE, "1", "static friction coefficient, that of slip velocity 0")            \
  X(lugre, v_stribeck, POSITIVE, "m/s", "slip velocity in which friction falls from mu_s to mu_k") \
  X(lugre, sigma, POSITIVE, "1/m", "stiffness of the bristles, the slope dmu/ds at mu = 0")        \
  X(lugre, damping, NONNEGATIVE, "s/m", "of the bristles, over the normal force")                  \
  X(lugre, viscous, NONNEGATIVE, "s/m", "friction over slip velocity and normal force")

#ifdef BD_LAW_FUNCTIONS

typedef struct lugre_constants {
  vec mu_k, sigma, damping, viscous;
  stribeck curve;
} lugre_constants;

INLINE lugre_constants lugre_prepare(const bd_lugre *p, double l0) {
  (void)l0;
  return (lugre_constants){.mu_k = splat(p->mu_k),
                           .sigma = splat(p->sigma),
                           .damping = splat(p->damping),
                           .viscous = splat(p->viscous),
                           .curve = stribeck_prepare(p->mu_k, p->mu_s, p->v_stribeck)};
}

INLINE law_value lugre_value(const lugre_constants *c, const law_at *at) {
  const vec g = c->mu_k + stribeck_above(&c->curve, at->v);
  const vec h = fma_(-magnitude(at->v), at->z / g, at->v);
  const vec mu = fma_(c->damping, h, fma_(c->viscous, at->v, at->z));
  return (law_value){.force = mu * at->normal, .rate = c->sigma * h};
}

INLINE law_slopes lugre_slopes(const lugre_constants *c, const law_at *at) {
  const vec none = splat(0.0), one = splat(1.0);
  const vec above = stribeck_above(&c->curve, at->v), per_g = one / (c->mu_k + above);
  const vec share = at->z * per_g, speed = magnitude(at->v);
  const vec g_slope = stribeck_slope(&c->curve, at->v, above);
  const vec against = choose(less(none, at->v), -share, where(less(at->v, none), share));
  const vec h = fma_(-speed, share, at->v), h_by_state = -(speed * per_g);
  const vec h_by_slip = fma_(speed * share * per_g, g_slope, one + against);
  return (law_slopes){.by_normal = fma_(c->damping, h, fma_(c->viscous, at->v, at->z)),
                      .by_state = at->normal * fma_(c->damping, h_by_state, one),
                      .by_slip = at->normal * fma_(c->damping, h_by_slip, c->viscous),
                      .rate_by_state = c->sigma * h_by_state,
                      .rate_by_slip = c->sigma * h_by_slip};
}

INLINE double lugre_bound(const bd_lugre *p) {
  return stribeck_highest(p->mu_k, p->mu_s);
}

INLINE double lugre_kinetic(const bd_lugre *p, int element) {
  (void)element;
  return p->mu_k;
}

#endif
