/* SPDX-License-Identifier: MIT
 *
 * Harmonics over an angle, sum_k A_k cos(n_k angle + phi_k) with real orders n_k > 0: of torques
 * (loads.c) and of prescribed motions (motion.c), MODEL section 5. Guarded by tests/test_loads.py.
 */
#include <math.h>

#include "physics/physics.h"

bd_harmonics bd_harmonics_carve(bd_carver *carver, const bd_harmonics *given) {
  bd_harmonics copy = {.n = given->n};
  copy.orders = bd_carve_copy(carver, given->orders, copy.n);
  copy.amplitudes = bd_carve_copy(carver, given->amplitudes, copy.n);
  copy.phases = bd_carve_copy(carver, given->phases, copy.n);
  return copy;
}

int bd_check_finite(const char *field, const char *whose, size_t k, const char *name,
                    const double *values, size_t n, bd_error *err) {
  for (size_t i = 0; i < n; ++i) {
    if (!isfinite(values[i])) {
      return bd_fail(err, BD_ERR_TORQUE_DATA, field, "%s %zu: %s must be finite, %s[%zu] is %g",
                     whose, k, name, name, i, values[i]);
    }
  }
  return BD_OK;
}

int bd_harmonics_check(const bd_harmonics *harmonics, const char *field, const char *whose,
                       size_t k, bd_error *err) {
  for (size_t i = 0; i < harmonics->n; ++i) {
    if (!isfinite(harmonics->orders[i]) || harmonics->orders[i] <= 0.0) {
      return bd_fail(err, BD_ERR_TORQUE_DATA, field,
                     "%s %zu: orders must be finite and > 0, orders[%zu] is %g", whose, k, i,
                     harmonics->orders[i]);
    }
  }
  const size_t n = harmonics->n;
  BD_TRY(bd_check_finite(field, whose, k, "amplitudes", harmonics->amplitudes, n, err));
  return bd_check_finite(field, whose, k, "phases", harmonics->phases, n, err);
}

void bd_harmonics_at(const bd_harmonics *harmonics, double angle, double sum[4]) {
  sum[0] = sum[1] = sum[2] = sum[3] = 0.0;
  for (size_t k = 0; k < harmonics->n; ++k) {
    const double order = harmonics->orders[k], at = order * angle + harmonics->phases[k];
    const double in_phase = harmonics->amplitudes[k] * cos(at),
                 ahead = harmonics->amplitudes[k] * sin(at);
    sum[0] += in_phase;
    sum[1] -= order * ahead;
    sum[2] -= order * order * in_phase;
    sum[3] += order * order * order * ahead;
  }
}

double bd_harmonics_highest(const bd_harmonics *harmonics) {
  double highest = 0.0;
  for (size_t k = 0; k < harmonics->n; ++k) {
    highest = fmax(highest, harmonics->orders[k]);
  }
  return highest;
}
