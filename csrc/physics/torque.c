/* SPDX-License-Identifier: MIT
 *
 * Set torques M_d of (2.12): a sum of terms that the core evaluates itself (those of single
 * pulleys: loads.c), compiled functions or callbacks, and the times at which they kink, where steps
 * end exactly.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "physics/physics.h"

/* A copy, whose arrays are carved: those that its kind has. */
static bd_torque_term carve_term(bd_carver *carver, const bd_torque_term *given, int np) {
  const int load = bd_is_load(given), harmonic = given->kind == BD_TORQUE_HARMONICS;
  const size_t width = load ? 1 : (size_t)np;
  bd_torque_term copy = *given;
  copy.n_t = load || given->kind == BD_TORQUE_PIECEWISE ? given->n_t : 0;
  copy.n_points = bd_has_points(given) ? given->n_points : 0;
  copy.of = load && !harmonic ? given->pulley : given->of;
  copy.t = bd_carve_copy(carver, given->t, copy.n_t);
  copy.values = bd_carve_copy(carver, given->values, copy.n_t * width);
  copy.coefficients =
      bd_carve_copy(carver, given->coefficients, given->kind == BD_TORQUE_VISCOUS ? width : 0);
  copy.omega = bd_carve_copy(carver, given->omega, copy.n_points);
  copy.torque = bd_carve_copy(carver, given->torque, copy.n_points);
  copy.harmonics = bd_harmonics_carve(carver, harmonic ? &given->harmonics : &(bd_harmonics){0});
  bd_given(carver, &copy.kind, sizeof copy.kind);
  if (load) {
    bd_given(carver, &copy.against, sizeof copy.against);
    bd_given(carver, (int[]){copy.pulley, copy.of}, 2 * sizeof(int));
  }
  return copy;
}

void bd_torque_set_carve(bd_carver *carver, bd_torque_set *set, const bd_model *model,
                         const bd_torque *torque) {
  const int np = model->lay.np;
  size_t n_terms = torque ? torque->n_terms : 0, n_breaks = torque ? torque->n_breakpoints : 0;
  BD_CARVE(carver, set->terms, n_terms);
  BD_CARVE(carver, set->part, np);
  BD_CARVE(carver, set->moved, np);
  BD_CARVE(carver, set->low, np);
  BD_CARVE(carver, set->high, np);
  for (size_t k = 0; k < n_terms; ++k) {
    const bd_torque_term term = carve_term(carver, &torque->terms[k], np);
    n_breaks += term.n_t;
    if (carver->base) {
      set->terms[k] = term;
    }
  }
  for (size_t k = 0; torque && k < torque->n_motions; ++k) {
    n_breaks += torque->motions[k].n_t + 2;
  }
  BD_CARVE(carver, set->breaks, n_breaks);
  if (torque) {
    bd_given(carver, torque->breakpoints, torque->n_breakpoints * sizeof *torque->breakpoints);
  }
  bd_motion_set_carve(carver, &set->motion, np, torque);
  set->np = np;
  set->model = model;
  set->n_terms = n_terms;
}

/* Times of a torque, or of a factor. */
static int check_times(const bd_torque_term *term, size_t k, bd_error *err) {
  for (size_t i = 0; i < term->n_t; ++i) {
    if (!isfinite(term->t[i]) || (i > 0 && term->t[i] < term->t[i - 1]) ||
        (i > 1 && term->t[i] <= term->t[i - 2])) {
      return BD_REFUSE_TERM(err, k,
                            "t must be finite and non-decreasing, a time given at most "
                            "twice (a jump); t[%zu] is %g",
                            i, term->t[i]);
    }
  }
  return BD_OK;
}

static int check_term(const bd_torque_term *term, size_t k, int np, bd_error *err) {
  switch (term->kind) {
  case BD_TORQUE_PIECEWISE:
    if (term->n_t < 1) {
      return BD_REFUSE_TERM(err, k, "%s", "t must not be empty");
    }
    for (size_t i = 0; i < term->n_t * (size_t)np; ++i) {
      if (!isfinite(term->values[i])) {
        return BD_REFUSE_TERM(err, k, "values must be finite, values[%zu, %zu] is %g",
                              i / (size_t)np, i % (size_t)np, term->values[i]);
      }
    }
    return check_times(term, k, err);
  case BD_TORQUE_VISCOUS:
    return bd_check_finite("torque", "torque term", k, "coefficients", term->coefficients,
                           (size_t)np, err);
  case BD_TORQUE_FUNCTION:
  case BD_TORQUE_CALL:
    if (term->kind == BD_TORQUE_FUNCTION ? !term->function : !term->call) {
      return BD_REFUSE_TERM(err, k, "%s", "the function is NULL");
    }
    return BD_OK;
  case BD_TORQUE_LOAD:
  case BD_TORQUE_TABLE:
  case BD_TORQUE_HARMONICS:
  case BD_TORQUE_CURVE:
    BD_TRY(bd_load_check(term, k, np, err));
    return check_times(term, k, err);
  default:
    return BD_REFUSE_TERM(err, k, "unknown kind %d", term->kind);
  }
}

static int ascending(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

int bd_torque_set_fill(bd_torque_set *set, const bd_torque *torque, bd_error *err) {
  size_t n = 0;
  set->smooth = 1;
  set->stop = torque ? torque->stop : NULL;
  for (size_t k = 0; k < set->n_terms; ++k) {
    const bd_torque_term *term = &set->terms[k];
    set->smooth &= term->kind != BD_TORQUE_FUNCTION && term->kind != BD_TORQUE_CALL;
    BD_TRY(check_term(term, k, set->np, err));
    if ((term->kind == BD_TORQUE_PIECEWISE || bd_is_load(term)) && term->n_t > 0) {
      memcpy(set->breaks + n, term->t, term->n_t * sizeof *term->t);
      n += term->n_t;
    }
  }
  for (size_t k = 0; torque && k < torque->n_breakpoints; ++k) {
    if (!isfinite(torque->breakpoints[k])) {
      return bd_fail(err, BD_ERR_TORQUE_DATA, "breakpoints",
                     "breakpoints must be finite, breakpoints[%zu] is %g", k,
                     torque->breakpoints[k]);
    }
    set->breaks[n++] = torque->breakpoints[k];
  }
  BD_TRY(bd_motion_set_check(&set->motion, set->np, err));
  for (size_t k = 0; k < set->motion.n; ++k) {
    const bd_motion *motion = &set->motion.motions[k];
    for (size_t i = 0; i < motion->n_t; ++i) {
      set->breaks[n++] = motion->t[i];
    }
    for (int i = 0; motion->harmonics.n > 0 && i < 2; ++i) {
      set->breaks[n++] = motion->fade[i];
    }
  }
  qsort(set->breaks, n, sizeof *set->breaks, ascending);
  set->n_breaks = 0;
  set->after = -(double)INFINITY;
  set->before = (double)INFINITY;
  for (size_t k = 0; k < n; ++k) {
    if (set->n_breaks == 0 || set->breaks[k] > set->breaks[set->n_breaks - 1]) {
      set->breaks[set->n_breaks++] = set->breaks[k];
    }
  }
  return BD_OK;
}

size_t bd_first_above(const double *times, size_t n, double t) {
  size_t low = 0, high = n;
  while (low < high) {
    size_t mid = low + (high - low) / 2;
    if (times[mid] > t) {
      high = mid;
    } else {
      low = mid + 1;
    }
  }
  return low;
}

void bd_add_interpolated(const double *times, const double *values, size_t n, size_t width,
                         double t, double t_piece, double *out) {
  const size_t low = bd_first_above(times, n, t_piece);
  const double *after = values + (low < n ? low : n - 1) * width;
  const double *before = low > 0 ? after - (low < n ? width : 0) : after;
  double apart = low > 0 && low < n ? times[low] - times[low - 1] : 0.0;
  double part = apart > 0.0 ? (t - times[low - 1]) / apart : 0.0;
  for (size_t j = 0; j < width; ++j) {
    out[j] += before[j] + part * (after[j] - before[j]);
  }
}

int bd_torque_set_eval(bd_torque_set *set, double t, double t_piece, const double *theta,
                       const double *omega, double *torque, bd_error *err) {
  int np = set->np;
  memset(torque, 0, (size_t)np * sizeof *torque);
  for (int j = 0; j < np; ++j) {
    if (!isfinite(theta[j]) || !isfinite(omega[j])) {
      /* a trial step gone astray: no torque for it, the step will be refused */
      for (int k = 0; k < np; ++k) {
        torque[k] = (double)NAN;
      }
      return BD_OK;
    }
  }
  /* A function cannot know which side of its jump is meant: show it a time just inside the piece.
   */
  double t_inside = t <= set->after    ? nextafter(set->after, (double)INFINITY)
                    : t >= set->before ? nextafter(set->before, -(double)INFINITY)
                                       : t;
  for (size_t k = 0; k < set->n_terms; ++k) {
    const bd_torque_term *term = &set->terms[k];
    int code = 0;
    switch (term->kind) {
    case BD_TORQUE_PIECEWISE:
      bd_add_interpolated(term->t, term->values, term->n_t, (size_t)np, t, t_piece, torque);
      continue;
    case BD_TORQUE_VISCOUS:
      for (int j = 0; j < np; ++j) {
        torque[j] -= term->coefficients[j] * omega[j];
      }
      continue;
    case BD_TORQUE_FUNCTION:
    case BD_TORQUE_CALL:
      break;
    default:
      torque[term->pulley] +=
          bd_load_factor(term, t, t_piece) * bd_load_at(set, term, theta, omega).torque;
      continue;
    }
    memset(set->part, 0, (size_t)np * sizeof *set->part);
    if (term->kind == BD_TORQUE_CALL) {
      code = term->call(t_inside, theta, omega, set->part, term->user);
    } else {
      term->function(t_inside, theta, omega, set->part, term->user);
      code = set->stop && *set->stop;
    }
    if (code != 0) {
      return bd_fail_at(err, BD_ERR_CALLBACK, "torque", t, -1, -1, (double)code,
                        "the torque function asked to stop at t = %.9g s", t);
    }
    for (int j = 0; j < np; ++j) {
      torque[j] += set->part[j];
    }
  }
  for (size_t k = 0; k < set->motion.n; ++k) {
    double *none = &torque[set->motion.motions[k].pulley];
    if (*none != 0.0) {
      set->motion.ignored = set->motion.motions[k].pulley + 1;
      set->motion.ignored_torque = *none;
      *none = 0.0;
    }
  }
  for (int j = 0; j < np; ++j) {
    if (!isfinite(torque[j])) {
      return bd_fail_at(err, BD_ERR_TORQUE_VALUE, "torque", t, -1, j, torque[j],
                        "the torque on %s is %g at t = %.9g s: the torque function must "
                        "return finite values",
                        bd_pulley_label(set->model, j).text, torque[j], t);
    }
    if (set->watched) {
      set->low[j] = fmin(set->low[j], torque[j]);
      set->high[j] = fmax(set->high[j], torque[j]);
    }
  }
  return BD_OK;
}

/* One column by a difference, the step small against what a torque could mean to notice. */
static int derive_by(bd_torque_set *set, double t, double t_piece, double *theta, double *omega,
                     double *moving, const double *torque, double *by, int j, bd_error *err) {
  double kept = *moving;
  *moving = kept + 1e-7 * fmax(1.0, fabs(kept));
  double step = *moving - kept;
  int code = bd_torque_set_eval(set, t, t_piece, theta, omega, set->moved, err);
  *moving = kept;
  for (int i = 0; code == BD_OK && i < set->np; ++i) {
    by[i * set->np + j] = (set->moved[i] - torque[i]) / step;
  }
  return code;
}

int bd_torque_set_derive(bd_torque_set *set, double t, double t_piece, double *theta, double *omega,
                         const double *torque, double *by_theta, double *by_omega, bd_error *err) {
  int np = set->np;
  memset(by_theta, 0, (size_t)(np * np) * sizeof *by_theta);
  memset(by_omega, 0, (size_t)(np * np) * sizeof *by_omega);
  if (set->smooth) {
    for (size_t k = 0; k < set->n_terms; ++k) {
      const bd_torque_term *term = &set->terms[k];
      for (int j = 0; term->kind == BD_TORQUE_VISCOUS && j < np; ++j) {
        by_omega[j * np + j] -= term->coefficients[j];
      }
      if (bd_is_load(term)) {
        const double factor = bd_load_factor(term, t, t_piece);
        const bd_load_value load = bd_load_at(set, term, theta, omega);
        by_omega[term->pulley * np + term->pulley] += factor * load.by_omega;
        by_theta[term->pulley * np + term->of] += factor * load.by_theta;
      }
    }
    return BD_OK;
  }
  for (int j = 0; j < np; ++j) {
    BD_TRY(derive_by(set, t, t_piece, theta, omega, &theta[j], torque, by_theta, j, err));
    BD_TRY(derive_by(set, t, t_piece, theta, omega, &omega[j], torque, by_omega, j, err));
  }
  return BD_OK;
}

int bd_torque_set_by_time(bd_torque_set *set, double t, double dt, double t_piece,
                          const double *theta, const double *omega, const double *torque,
                          double *slope, bd_error *err) {
  int code = bd_torque_set_eval(set, t + dt, t_piece, theta, omega, set->moved, err);
  for (int j = 0; code == BD_OK && j < set->np; ++j) {
    slope[j] = (set->moved[j] - torque[j]) / dt;
  }
  return code;
}

/* --- bounds ---------------------------------------------------------------------------------- */

void bd_torque_set_steepest(const bd_torque_set *set, int j, double tension, double *stiffness,
                            double *damping) {
  *stiffness = *damping = 0.0;
  for (size_t k = 0; k < set->n_terms; ++k) {
    const bd_torque_term *term = &set->terms[k];
    if (term->kind == BD_TORQUE_VISCOUS) {
      *damping += fabs(term->coefficients[j]);
    } else if (bd_is_load(term) && term->pulley == j) {
      bd_load_steepest(term, set->model, tension, stiffness, damping);
    }
  }
}

double bd_torque_set_longest(const bd_torque_set *set, const double *omega) {
  double fastest = 0.0; /* [rad/s] */
  for (size_t k = 0; k < set->n_terms; ++k) {
    const bd_torque_term *term = &set->terms[k];
    if (term->kind == BD_TORQUE_HARMONICS) {
      fastest = fmax(fastest, bd_harmonics_highest(&term->harmonics) * fabs(omega[term->of]));
    }
  }
  for (size_t k = 0; k < set->motion.n; ++k) {
    const bd_motion *motion = &set->motion.motions[k];
    fastest = fmax(fastest, bd_harmonics_highest(&motion->harmonics) * fabs(omega[motion->pulley]));
  }
  return fastest > 0.0 ? BD_PI / fastest : (double)INFINITY;
}
