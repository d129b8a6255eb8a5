/* SPDX-License-Identifier: MIT
 *
 * The Dahl coefficient in closed form, eq. (2.9): between two reversals of the slip velocity,
 * started at (x0, mu0) where the last one happened,
 *
 *   mu = (mu0 -+ mu_k) exp(-(sigma / mu_k) |x - x0|) +- mu_k        for v_T >= 0 / v_T < 0.
 *
 * Written with expm1, mu0 + (s mu_k - mu0) (1 - exp(-z)), because the form of the paper cancels
 * when z is small or mu_k large. The integrators carry the state form dmu/dt = sigma (v - |v| mu /
 * mu_k); this is the yardstick it is held against (tests/test_friction_path.py).
 */
#include <math.h>

#include "physics/physics.h"

double bd_dahl_slide(double dx, double mu0, double mu_k, double sigma) {
  double saturated = dx >= 0.0 ? mu_k : -mu_k;
  double mu = mu0 - (saturated - mu0) * expm1(-(sigma / mu_k) * fabs(dx));
  return mu > mu_k ? mu_k : mu < -mu_k ? -mu_k : mu;
}

void bd_dahl_path(size_t n, const double *x, double mu0, double mu_k, double sigma, double *mu) {
  double x_reversal = n > 0 ? x[0] : 0.0, mu_reversal = mu0;
  int direction = 0;
  for (size_t k = 0; k < n; ++k) {
    double step = k > 0 ? x[k] - x[k - 1] : 0.0;
    int heading = (step > 0.0) - (step < 0.0);
    if (heading != 0 && heading != direction) {
      x_reversal = x[k - 1];
      mu_reversal = k > 1 ? mu[k - 1] : mu0;
      direction = heading;
    }
    mu[k] = bd_dahl_slide(x[k] - x_reversal, mu_reversal, mu_k, sigma);
  }
}
