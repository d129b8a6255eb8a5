/* SPDX-License-Identifier: MIT
 *
 * Set torques M_d of (2.12): a sum of terms that the core evaluates itself, compiled functions or
 * callbacks, and the times at which they kink, where steps end exactly.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "physics/physics.h"

void bd_load_carve(bd_carver *carver, bd_load *load, int np, const bd_torque *torque) {
  size_t n_terms = torque ? torque->n_terms : 0, n_breaks = torque ? torque->n_breakpoints : 0;
  BD_CARVE(carver, load->terms, n_terms);
  BD_CARVE(carver, load->part, np);
  BD_CARVE(carver, load->moved, np);
  BD_CARVE(carver, load->low, np);
  BD_CARVE(carver, load->high, np);
  for (size_t k = 0; k < n_terms; ++k) {
    const bd_torque_term *term = &torque->terms[k];
    double *piece = NULL;
    if (term->kind == BD_TORQUE_PIECEWISE) {
      n_breaks += term->n_t;
      BD_CARVE(carver, piece, term->n_t * (size_t)(np + 1));
    } else if (term->kind == BD_TORQUE_VISCOUS) {
      BD_CARVE(carver, piece, np);
    }
    if (carver->base) {
      load->terms[k] = *term;
      load->terms[k].t = piece;
      load->terms[k].values = piece ? piece + term->n_t : NULL;
      load->terms[k].coefficients = piece;
      if (term->kind == BD_TORQUE_PIECEWISE && term->n_t > 0) {
        memcpy(piece, term->t, term->n_t * sizeof *piece);
        memcpy(piece + term->n_t, term->values, term->n_t * (size_t)np * sizeof *piece);
      } else if (term->kind == BD_TORQUE_VISCOUS) {
        memcpy(piece, term->coefficients, (size_t)np * sizeof *piece);
      }
    }
  }
  BD_CARVE(carver, load->breaks, n_breaks);
  load->np = np;
  load->n_terms = n_terms;
}

static int check_term(const bd_torque_term *term, size_t k, int np, bd_error *err) {
  switch (term->kind) {
  case BD_TORQUE_PIECEWISE:
    if (term->n_t < 1) {
      return bd_fail(err, BD_ERR_TORQUE_DATA, "torque", "torque term %zu: t must not be empty", k);
    }
    for (size_t i = 0; i < term->n_t; ++i) {
      if (!isfinite(term->t[i]) || (i > 0 && term->t[i] < term->t[i - 1]) ||
          (i > 1 && term->t[i] <= term->t[i - 2])) {
        return bd_fail(err, BD_ERR_TORQUE_DATA, "torque",
                       "torque term %zu: t must be finite and non-decreasing, a time given at most "
                       "twice (a jump); t[%zu] is %g",
                       k, i, term->t[i]);
      }
    }
    for (size_t i = 0; i < term->n_t * (size_t)np; ++i) {
      if (!isfinite(term->values[i])) {
        return bd_fail(err, BD_ERR_TORQUE_DATA, "torque",
                       "torque term %zu: values must be finite, values[%zu, %zu] is %g", k,
                       i / (size_t)np, i % (size_t)np, term->values[i]);
      }
    }
    return BD_OK;
  case BD_TORQUE_VISCOUS:
    for (int j = 0; j < np; ++j) {
      if (!isfinite(term->coefficients[j])) {
        return bd_fail(err, BD_ERR_TORQUE_DATA, "torque",
                       "torque term %zu: coefficients must be finite, coefficients[%d] is %g", k, j,
                       term->coefficients[j]);
      }
    }
    return BD_OK;
  case BD_TORQUE_FUNCTION:
  case BD_TORQUE_CALL:
    if (term->kind == BD_TORQUE_FUNCTION ? !term->function : !term->call) {
      return bd_fail(err, BD_ERR_TORQUE_DATA, "torque", "torque term %zu: the function is NULL", k);
    }
    return BD_OK;
  default:
    return bd_fail(err, BD_ERR_TORQUE_DATA, "torque", "torque term %zu: unknown kind %d", k,
                   term->kind);
  }
}

static int ascending(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

int bd_load_fill(bd_load *load, const bd_torque *torque, bd_error *err) {
  size_t n = 0;
  load->smooth = 1;
  load->stop = torque ? torque->stop : NULL;
  for (size_t k = 0; k < load->n_terms; ++k) {
    const bd_torque_term *term = &load->terms[k];
    load->smooth &= term->kind == BD_TORQUE_PIECEWISE || term->kind == BD_TORQUE_VISCOUS;
    if (check_term(term, k, load->np, err) != BD_OK) {
      return BD_ERR_TORQUE_DATA;
    }
    if (term->kind == BD_TORQUE_PIECEWISE) {
      memcpy(load->breaks + n, term->t, term->n_t * sizeof *term->t);
      n += term->n_t;
    }
  }
  for (size_t k = 0; torque && k < torque->n_breakpoints; ++k) {
    if (!isfinite(torque->breakpoints[k])) {
      return bd_fail(err, BD_ERR_TORQUE_DATA, "breakpoints",
                     "breakpoints must be finite, breakpoints[%zu] is %g", k,
                     torque->breakpoints[k]);
    }
    load->breaks[n++] = torque->breakpoints[k];
  }
  qsort(load->breaks, n, sizeof *load->breaks, ascending);
  load->n_breaks = 0;
  load->after = -(double)INFINITY;
  load->before = (double)INFINITY;
  for (size_t k = 0; k < n; ++k) {
    if (load->n_breaks == 0 || load->breaks[k] > load->breaks[load->n_breaks - 1]) {
      load->breaks[load->n_breaks++] = load->breaks[k];
    }
  }
  return BD_OK;
}

static void piecewise(const bd_torque_term *term, int np, double t, double t_piece,
                      double *torque) {
  const double *times = term->t;
  size_t n = term->n_t, low = 0, high = n; /* first time above t_piece */
  while (low < high) {
    size_t mid = low + (high - low) / 2;
    if (times[mid] > t_piece) {
      high = mid;
    } else {
      low = mid + 1;
    }
  }
  const double *after = term->values + (low < n ? low : n - 1) * (size_t)np;
  const double *before = low > 0 ? after - (low < n ? np : 0) : after;
  double width = low > 0 && low < n ? times[low] - times[low - 1] : 0.0;
  double part = width > 0.0 ? (t - times[low - 1]) / width : 0.0;
  for (int j = 0; j < np; ++j) {
    torque[j] += before[j] + part * (after[j] - before[j]);
  }
}

int bd_load_eval(bd_load *load, double t, double t_piece, const double *theta, const double *omega,
                 double *torque, bd_error *err) {
  int np = load->np;
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
  double t_inside = t <= load->after    ? nextafter(load->after, (double)INFINITY)
                    : t >= load->before ? nextafter(load->before, -(double)INFINITY)
                                        : t;
  for (size_t k = 0; k < load->n_terms; ++k) {
    const bd_torque_term *term = &load->terms[k];
    int code = 0;
    switch (term->kind) {
    case BD_TORQUE_PIECEWISE:
      piecewise(term, np, t, t_piece, torque);
      continue;
    case BD_TORQUE_VISCOUS:
      for (int j = 0; j < np; ++j) {
        torque[j] -= term->coefficients[j] * omega[j];
      }
      continue;
    case BD_TORQUE_FUNCTION:
      memset(load->part, 0, (size_t)np * sizeof *load->part);
      term->function(t_inside, theta, omega, load->part, term->user);
      code = load->stop && *load->stop;
      break;
    default:
      memset(load->part, 0, (size_t)np * sizeof *load->part);
      code = term->call(t_inside, theta, omega, load->part, term->user);
      break;
    }
    if (code != 0) {
      return bd_fail_at(err, BD_ERR_CALLBACK, "torque", t, -1, -1, (double)code,
                        "the torque function asked to stop at t = %.9g s", t);
    }
    for (int j = 0; j < np; ++j) {
      torque[j] += load->part[j];
    }
  }
  for (int j = 0; j < np; ++j) {
    if (!isfinite(torque[j])) {
      return bd_fail_at(err, BD_ERR_TORQUE_VALUE, "torque", t, -1, j, torque[j],
                        "the torque on pulley %d is %g at t = %.9g s: the torque function must "
                        "return finite values",
                        j, torque[j], t);
    }
    if (load->watched) {
      load->low[j] = fmin(load->low[j], torque[j]);
      load->high[j] = fmax(load->high[j], torque[j]);
    }
  }
  return BD_OK;
}

/* One column by a difference, the step small against what a torque could mean to notice. */
static int derive_by(bd_load *load, double t, double t_piece, double *theta, double *omega,
                     double *moving, const double *torque, double *by, int j, bd_error *err) {
  double kept = *moving;
  *moving = kept + 1e-7 * fmax(1.0, fabs(kept));
  double step = *moving - kept;
  int code = bd_load_eval(load, t, t_piece, theta, omega, load->moved, err);
  *moving = kept;
  for (int i = 0; code == BD_OK && i < load->np; ++i) {
    by[i * load->np + j] = (load->moved[i] - torque[i]) / step;
  }
  return code;
}

int bd_load_derive(bd_load *load, double t, double t_piece, double *theta, double *omega,
                   const double *torque, double *by_theta, double *by_omega, bd_error *err) {
  int np = load->np;
  memset(by_theta, 0, (size_t)(np * np) * sizeof *by_theta);
  memset(by_omega, 0, (size_t)(np * np) * sizeof *by_omega);
  if (load->smooth) {
    for (size_t k = 0; k < load->n_terms; ++k) {
      for (int j = 0; load->terms[k].kind == BD_TORQUE_VISCOUS && j < np; ++j) {
        by_omega[j * np + j] -= load->terms[k].coefficients[j];
      }
    }
    return BD_OK;
  }
  for (int j = 0; j < np; ++j) {
    int code = derive_by(load, t, t_piece, theta, omega, &theta[j], torque, by_theta, j, err);
    if (code == BD_OK) {
      code = derive_by(load, t, t_piece, theta, omega, &omega[j], torque, by_omega, j, err);
    }
    if (code != BD_OK) {
      return code;
    }
  }
  return BD_OK;
}

int bd_load_slope(bd_load *load, double t, double dt, double t_piece, const double *theta,
                  const double *omega, const double *torque, double *slope, bd_error *err) {
  int code = bd_load_eval(load, t + dt, t_piece, theta, omega, load->moved, err);
  for (int j = 0; code == BD_OK && j < load->np; ++j) {
    slope[j] = (load->moved[j] - torque[j]) / dt;
  }
  return code;
}
