/* SPDX-License-Identifier: MIT
 *
 * Torques on single pulleys (MODEL section 5), each times a factor over time: against the rotation,
 * by coefficients or from a table over speed, harmonics over an angle, and the curve of a motor
 * over speed. Their derivatives are those of the formulas; on a kink of a table, of the piece above
 * it.
 *
 * Against the rotation is with the smooth sign of bearing drag, bd_coulomb_drag, so a load has a
 * slope at rest. Guarded by tests/test_loads.py.
 */
#include <float.h>
#include <math.h>

#include "physics/physics.h"

int bd_is_load(const bd_torque_term *term) {
  return term->kind == BD_TORQUE_LOAD || term->kind == BD_TORQUE_TABLE ||
         term->kind == BD_TORQUE_HARMONICS || term->kind == BD_TORQUE_CURVE;
}

int bd_has_points(const bd_torque_term *term) {
  return term->kind == BD_TORQUE_TABLE || term->kind == BD_TORQUE_CURVE;
}

/* --- rules ----------------------------------------------------------------------------------- */

static int check_against(const bd_drag *against, size_t k, bd_error *err) {
  const double values[] = {against->coulomb, against->viscous, against->quadratic};
  const char *const names[] = {"coulomb", "viscous", "quadratic"};
  for (int i = 0; i < 3; ++i) {
    if (!isfinite(values[i]) || values[i] < 0.0) {
      return BD_REFUSE_TERM(err, k,
                            "%s must be finite and >= 0, for it acts against the "
                            "rotation; got %g",
                            names[i], values[i]);
    }
  }
  return BD_OK;
}

static int check_table(const bd_torque_term *term, size_t k, bd_error *err) {
  if (term->n_points < 1) {
    return BD_REFUSE_TERM(err, k, "%s", "the table must have at least one point");
  }
  const double least = term->kind == BD_TORQUE_TABLE ? 0.0 : -DBL_MAX;
  for (size_t i = 0; i < term->n_points; ++i) {
    if (!isfinite(term->omega[i]) || term->omega[i] < least ||
        (i > 0 && term->omega[i] <= term->omega[i - 1])) {
      return BD_REFUSE_TERM(err, k, "omega must be finite, %sincreasing; omega[%zu] is %g",
                            least < 0.0 ? "" : ">= 0 and ", i, term->omega[i]);
    }
    if (!isfinite(term->torque[i]) || term->torque[i] < least) {
      return BD_REFUSE_TERM(err, k, "torque must be finite%s; torque[%zu] is %g",
                            least < 0.0 ? "" : " and >= 0, for it acts against the rotation", i,
                            term->torque[i]);
    }
  }
  return BD_OK;
}

int bd_load_check(const bd_torque_term *term, size_t k, int np, bd_error *err) {
  const int wrong = term->pulley < 0 || term->pulley >= np;
  if (wrong || term->of < 0 || term->of >= np) {
    return BD_REFUSE_TERM(err, k, "%s must be one of 0 to %d, got %d", wrong ? "pulley" : "of",
                          np - 1, wrong ? term->pulley : term->of);
  }
  for (size_t i = 0; i < term->n_t; ++i) {
    if (!isfinite(term->values[i])) {
      return BD_REFUSE_TERM(err, k, "the factor must be finite, values[%zu] is %g", i,
                            term->values[i]);
    }
  }
  return term->kind == BD_TORQUE_LOAD ? check_against(&term->against, k, err)
         : bd_has_points(term)        ? check_table(term, k, err)
         : term->harmonics.n > 0
             ? bd_harmonics_check(&term->harmonics, "torque", "torque term", k, err)
             : BD_REFUSE_TERM(err, k, "%s", "there must be at least one harmonic");
}

/* --- values ---------------------------------------------------------------------------------- */

/* Torque of the points at a speed, and its slope; constant outside. */
static void look_up(const bd_torque_term *term, double speed, double *torque, double *slope) {
  const size_t n = term->n_points, above = bd_first_above(term->omega, n, speed);
  *slope = 0.0;
  *torque = term->torque[above > 0 ? above - 1 : 0];
  if (above > 0 && above < n) {
    const double *w = &term->omega[above - 1], *m = &term->torque[above - 1];
    *slope = (m[1] - m[0]) / (w[1] - w[0]);
    *torque += *slope * (speed - w[0]);
  }
}

bd_load_value bd_load_at(const bd_torque_set *set, const bd_torque_term *term, const double *theta,
                         const double *omega) {
  const double speed = omega[term->pulley], w0 = bd_turning_speed(set->model, term->pulley);
  if (term->kind == BD_TORQUE_HARMONICS) {
    double sum[4];
    bd_harmonics_at(&term->harmonics, theta[term->of], sum);
    return (bd_load_value){.torque = sum[0], .by_theta = sum[1]};
  }
  if (term->kind == BD_TORQUE_LOAD) {
    const bd_resisting at = bd_resistance(&term->against, speed, w0);
    return (bd_load_value){.torque = -at.torque, .by_omega = -at.slope};
  }
  double torque, slope;
  if (term->kind == BD_TORQUE_CURVE) {
    look_up(term, speed, &torque, &slope);
    return (bd_load_value){.torque = torque, .by_omega = slope};
  }
  /* the slope over |omega|: over omega it is that times the sign */
  look_up(term, fabs(speed), &torque, &slope);
  const bd_resisting at = bd_coulomb_drag(torque, speed, w0);
  return (bd_load_value){.torque = -at.torque,
                         .by_omega = -at.slope - bd_coulomb_drag(slope, fabs(speed), w0).torque};
}

double bd_load_factor(const bd_torque_term *term, double t, double t_piece) {
  double factor = 0.0;
  if (term->n_t == 0) {
    return 1.0;
  }
  bd_add_interpolated(term->t, term->values, term->n_t, 1, t, t_piece, &factor);
  return factor;
}

/* --- bounds ---------------------------------------------------------------------------------- */

/* A table is nowhere above M(0) + L omega, with its steepest slope L, and steepest with it below
 * M(0) / omega_0 + 1.09 L: omega s(omega) is steepest where omega = sqrt(2) omega_0. A curve has no
 * sign of the speed in it. */
static double steepest_of_table(const bd_torque_term *term, const bd_model *model) {
  double slope = 0.0;
  for (size_t i = 1; i < term->n_points; ++i) {
    slope = fmax(slope, fabs((term->torque[i] - term->torque[i - 1]) /
                             (term->omega[i] - term->omega[i - 1])));
  }
  if (term->kind == BD_TORQUE_CURVE) {
    return slope;
  }
  return term->torque[0] / bd_turning_speed(model, term->pulley) + 1.09 * slope;
}

void bd_load_steepest(const bd_torque_term *term, const bd_model *model, double tension,
                      double *stiffness, double *damping) {
  double most = term->n_t > 0 ? 0.0 : 1.0; /* factor */
  for (size_t i = 0; i < term->n_t; ++i) {
    most = fmax(most, fabs(term->values[i]));
  }
  if (term->kind == BD_TORQUE_LOAD) {
    *damping += most * bd_steepest_resistance(&term->against, model, term->pulley, tension);
  } else if (bd_has_points(term)) {
    *damping += most * steepest_of_table(term, model);
  } else {
    for (size_t i = 0; i < term->harmonics.n; ++i) {
      *stiffness += most * fabs(term->harmonics.amplitudes[i]) * term->harmonics.orders[i];
    }
  }
}

const bd_torque_term *bd_load_beyond_table(const bd_torque_set *set, double t, double t_piece,
                                           const double *omega) {
  const double MARGIN = 0.01; /* torques over speed are not known better */
  for (size_t k = 0; k < set->n_terms; ++k) {
    const bd_torque_term *term = &set->terms[k];
    if (!bd_has_points(term) || bd_is_moved(set, term->pulley)) {
      continue;
    }
    const double first = term->omega[0], last = term->omega[term->n_points - 1];
    const double w = omega[term->pulley], excess = MARGIN * fmax(fabs(first), fabs(last));
    const int beyond = term->kind == BD_TORQUE_TABLE ? fabs(w) > last + excess
                                                     : w > last + excess || w < first - excess;
    if (beyond && bd_load_factor(term, t, t_piece) != 0.0) {
      return term;
    }
  }
  return NULL;
}
