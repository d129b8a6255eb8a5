/* SPDX-License-Identifier: MIT
 *
 * The Stribeck curve, MODEL section 4: what friction coefficients have above their kinetic value
 * mu_k at low slip velocity, (mu_s - mu_k) exp(-(v / v_stribeck)^2). A law that takes one ends its
 * parameters with BD_STRIBECK.
 */
#define BD_STRIBECK(X, law)                                                                        \
  X(law, mu_s, NONNEGATIVE, "1", "static friction coefficient; 0: no Stribeck curve")              \
  X(law, v_stribeck, NONNEGATIVE, "m/s", "slip velocity over which friction falls, > 0 if mu_s is")

#ifdef BD_LAW_FUNCTIONS

typedef struct stribeck {
  vec drop, per_v;
  int on;
} stribeck;

/* Equal coefficients need no exponential. */
INLINE stribeck stribeck_prepare(double mu_k, double mu_s, double v_stribeck) {
  const int on = mu_s > 0.0 && mu_s != mu_k;
  return (stribeck){
      .drop = splat(on ? mu_s - mu_k : 0.0), .per_v = splat(on ? 1.0 / v_stribeck : 0.0), .on = on};
}

INLINE vec stribeck_above(const stribeck *c, vec v) {
  const vec ratio = v * c->per_v;
  return c->on ? c->drop * exponential(-(ratio * ratio)) : splat(0.0);
}

INLINE vec stribeck_slope(const stribeck *c, vec v, vec above) {
  return -2.0 * (v * c->per_v) * c->per_v * above;
}

INLINE double stribeck_highest(double mu_k, double mu_s) {
  return mu_s > mu_k ? mu_s : mu_k;
}

#endif
