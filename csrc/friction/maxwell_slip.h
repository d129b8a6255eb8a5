/* SPDX-License-Identifier: MIT
 *
 * Generalised Maxwell slip, MODEL section 4 (W. D. Iwan, J. Appl. Mech. 33 (1966) 893-900; F.
 * Al-Bender, V. Lampaert, J. Swevers, IEEE Trans. Automatic Control 50 (2005) 1883-1887): elements
 * of elastic/perfectly plastic friction side by side, each with a stretch of its own. A Stribeck
 * curve is that of all together, and each has its part.
 */
#define BD_LAW_maxwell_slip(X)                                                                     \
  X(maxwell_slip, mu, POSITIVES, "1", "friction coefficient of each element")                      \
  X(maxwell_slip, stiffness, POSITIVES, "N/m^2", "of each spring, per metre of belt")              \
  X(maxwell_slip, damping, POSITIVES, "N s/m^2", "of each damper, per metre of belt")              \
  BD_STRIBECK(X, maxwell_slip)

#ifdef BD_LAW_FUNCTIONS

typedef struct maxwell_slip_constants {
  const bd_maxwell_slip *p;
  double l0, static_share; /* mu_s over the kinetic coefficient of all; 0: no Stribeck curve */
} maxwell_slip_constants;

INLINE double maxwell_slip_kinetic(const bd_maxwell_slip *p, int element) {
  return p->mu.at[element];
}

INLINE maxwell_slip_constants maxwell_slip_prepare(const bd_maxwell_slip *p, double l0) {
  double all = 0.0;
  for (int e = 0; e < p->mu.n; ++e) {
    all += maxwell_slip_kinetic(p, e);
  }
  return (maxwell_slip_constants){p, l0, p->mu_s == all ? 0.0 : p->mu_s / all};
}

INLINE elastic_plastic_constants maxwell_slip_element(const maxwell_slip_constants *c,
                                                      int element) {
  const double mu = c->p->mu.at[element];
  const bd_elastic_plastic one = {mu, c->p->stiffness.at[element], c->p->damping.at[element],
                                  c->static_share * mu, c->p->v_stribeck};
  return elastic_plastic_prepare(&one, c->l0);
}

INLINE law_value maxwell_slip_value(const maxwell_slip_constants *c, const law_at *at) {
  const elastic_plastic_constants one = maxwell_slip_element(c, at->element);
  return elastic_plastic_value(&one, at);
}

INLINE law_slopes maxwell_slip_slopes(const maxwell_slip_constants *c, const law_at *at) {
  const elastic_plastic_constants one = maxwell_slip_element(c, at->element);
  return elastic_plastic_slopes(&one, at);
}

INLINE double maxwell_slip_bound(const bd_maxwell_slip *p) {
  (void)p;
  return INFINITY;
}

#endif
