/* SPDX-License-Identifier: MIT
 *
 * Prescribed motions (MODEL section 5): speeds and angles of pulleys as functions of time, with
 * their derivatives. Of a speed that is linear between times they are known, and so are its angle
 * and those of harmonics over that angle.
 *
 * Those of a call are of the polynomial of order 6 through NODES values of it, STEP apart: round t,
 * or to one side where the piece between two breaks, or the run, begins or ends, so that a kink
 * that is named, or a time outside the run, is never seen. At 500 Hz they err by 1e-7 of their
 * size; what rounding leaves of a speed of 100 rad/s gives accelerations to 1e-9, of an angle of
 * 100 rad speeds to 1e-9 rad/s and accelerations to 1e-5 rad/s^2.
 *
 * Guarded by tests/test_motion.py.
 */
#include <math.h>
#include <string.h>

#include "physics/physics.h"

enum { NODES = 7, N_DERIVATIVES = 4 }; /* of order 0 to 3 */
static const double STEP = 5e-5;       /* [s] */

void bd_motion_set_carve(bd_carver *carver, bd_motion_set *set, int np, const bd_torque *torque) {
  set->n = torque ? torque->n_motions : 0;
  if (set->n == 0) {
    return;
  }
  double **const arrays[] = {&set->theta, &set->omega, &set->alpha, &set->jerk};
  for (size_t k = 0; k < sizeof arrays / sizeof arrays[0]; ++k) {
    BD_CARVE(carver, *arrays[k], set->n);
  }
  BD_KEEP(carver, set->offset, set->n);
  BD_CARVE(carver, set->of_pulley, np);
  BD_CARVE(carver, set->motions, set->n);
  for (size_t k = 0; k < set->n; ++k) {
    const bd_motion *given = &torque->motions[k];
    const size_t n_t = given->kind == BD_MOTION_PIECEWISE ? given->n_t : 0;
    bd_motion copy = *given;
    double *data; /* speeds, and the angles that they come to */
    copy.n_t = n_t;
    copy.t = bd_carve_copy(carver, given->t, n_t);
    copy.values = BD_CARVE(carver, data, 2 * n_t);
    copy.harmonics = bd_harmonics_carve(carver, &given->harmonics);
    for (size_t i = 0; carver->base && i < n_t; ++i) {
      data[i] = given->values[i];
      if (i > 0) {
        const double mean = 0.5 * (data[i - 1] + data[i]);
        data[n_t + i] = data[n_t + i - 1] + mean * (given->t[i] - given->t[i - 1]);
      }
    }
    if (carver->base) {
      set->motions[k] = copy;
    }
  }
}

static int check_data(const bd_motion *motion, size_t k, bd_error *err) {
  if (motion->n_t < 1) {
    return bd_fail(err, BD_ERR_TORQUE_DATA, "motion", "motion %zu: t must not be empty", k);
  }
  for (size_t i = 0; i < motion->n_t; ++i) {
    if (!isfinite(motion->t[i]) || (i > 0 && motion->t[i] <= motion->t[i - 1])) {
      return bd_fail(err, BD_ERR_TORQUE_DATA, "motion",
                     "motion %zu: t must be finite and increasing, for a speed cannot jump; t[%zu] "
                     "is %g",
                     k, i, motion->t[i]);
    }
    if (!isfinite(motion->values[i])) {
      return bd_fail(err, BD_ERR_TORQUE_DATA, "motion",
                     "motion %zu: values must be finite, values[%zu] is %g", k, i,
                     motion->values[i]);
    }
  }
  const double *fade = motion->fade;
  if (!isfinite(fade[0]) || !isfinite(fade[1]) || fade[1] < fade[0]) {
    return bd_fail(err, BD_ERR_TORQUE_DATA, "motion",
                   "motion %zu: fade must be two finite times, the end not before the beginning; "
                   "got %g and %g",
                   k, fade[0], fade[1]);
  }
  return bd_harmonics_check(&motion->harmonics, "motion", "motion", k, err);
}

int bd_motion_set_check(bd_motion_set *set, int np, bd_error *err) {
  for (size_t k = 0; k < set->n; ++k) {
    const bd_motion *motion = &set->motions[k];
    const int kind = motion->kind;
    if (kind != BD_MOTION_PIECEWISE && kind != BD_MOTION_SPEED && kind != BD_MOTION_ANGLE) {
      return bd_fail(err, BD_ERR_TORQUE_DATA, "motion", "motion %zu: unknown kind %d", k, kind);
    }
    if (motion->pulley < 0 || motion->pulley >= np || set->of_pulley[motion->pulley]) {
      return bd_fail(err, BD_ERR_TORQUE_DATA, "motion",
                     "motion %zu: pulley must be one of 0 to %d that has no motion yet, got %d", k,
                     np - 1, motion->pulley);
    }
    if (kind == BD_MOTION_PIECEWISE ? check_data(motion, k, err) != BD_OK : !motion->call) {
      return kind == BD_MOTION_PIECEWISE
                 ? BD_ERR_TORQUE_DATA
                 : bd_fail(err, BD_ERR_TORQUE_DATA, "motion", "motion %zu: the call is NULL", k);
    }
    if (kind != BD_MOTION_PIECEWISE && motion->harmonics.n > 0) {
      return bd_fail(err, BD_ERR_TORQUE_DATA, "motion",
                     "motion %zu: harmonics are for a mean speed that is given by data", k);
    }
    set->of_pulley[motion->pulley] = 1;
    set->called |= kind != BD_MOTION_PIECEWISE;
  }
  set->t = (double)NAN;
  set->begin = -(double)INFINITY;
  set->end = (double)INFINITY;
  return BD_OK;
}

/* --- at a time ------------------------------------------------------------------------------- */

/* From 0 to 1 between two times, with its derivatives; those of first and second order are
 * continuous, so that speed and acceleration are. */
static void fade_in(const double fade[2], double t, double t_piece, double factor[N_DERIVATIVES]) {
  const double over = fade[1] - fade[0];
  const int before = t_piece < fade[0], within = !before && t_piece < fade[1];
  memset(factor, 0, N_DERIVATIVES * sizeof *factor);
  factor[0] = !before;
  if (over > 0.0 && within) {
    const double s = (t - fade[0]) / over;
    factor[0] = s * s * s * (10.0 + s * (6.0 * s - 15.0));
    factor[1] = 30.0 * s * s * (1.0 - s) * (1.0 - s) / over;
    factor[2] = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (over * over);
    factor[3] = 60.0 * (1.0 + s * (6.0 * s - 6.0)) / (over * over * over);
  }
}

/* Adds the harmonics of the mean angle, faded in, to the mean motion. */
static void fluctuate(bd_motion_set *set, size_t k, double t, double t_piece) {
  const bd_motion *motion = &set->motions[k];
  const double w = set->omega[k], a = set->alpha[k];
  double by_angle[N_DERIVATIVES], f[N_DERIVATIVES];
  bd_harmonics_at(&motion->harmonics, set->theta[k], by_angle);
  const double g[N_DERIVATIVES] = {
      by_angle[0],
      by_angle[1] * w,
      by_angle[2] * w * w + by_angle[1] * a,
      by_angle[3] * w * w * w + 3.0 * by_angle[2] * w * a,
  }; /* over time; the mean acceleration is constant */
  if (motion->fade[1] > motion->fade[0]) {
    fade_in(motion->fade, t, t_piece, f);
  } else {
    memcpy(f, (const double[N_DERIVATIVES]){1.0}, sizeof f);
  }
  set->theta[k] += f[0] * g[0];
  set->omega[k] += f[1] * g[0] + f[0] * g[1];
  set->alpha[k] += f[2] * g[0] + 2.0 * f[1] * g[1] + f[0] * g[2];
  set->jerk[k] += f[3] * g[0] + 3.0 * f[2] * g[1] + 3.0 * f[1] * g[2] + f[0] * g[3];
}

static void piecewise(bd_motion_set *set, size_t k, double t, double t_piece) {
  const bd_motion *motion = &set->motions[k];
  const double *times = motion->t, *speed = motion->values, *angle = speed + motion->n_t;
  const size_t after = bd_first_above(times, motion->n_t, t_piece),
               from = after > 0 ? after - 1 : 0;
  const double since = t - times[from];
  double slope = 0.0;
  if (after > 0 && after < motion->n_t) {
    slope = (speed[after] - speed[from]) / (times[after] - times[from]);
  }
  set->omega[k] = speed[from] + slope * since;
  set->alpha[k] = slope;
  set->jerk[k] = 0.0;
  set->theta[k] = angle[from] + 0.5 * (speed[from] + set->omega[k]) * since;
  if (motion->harmonics.n > 0) {
    fluctuate(set, k, t, t_piece);
  }
}

/* Weights of values at 0, 1, ... NODES - 1 in the derivatives at s (B. Fornberg, "Generation of
 * finite difference formulas on arbitrarily spaced grids", Math. Comp. 51 (1988) 699-706). */
static void weigh(double s, double weights[NODES][N_DERIVATIVES]) {
  double before = 1.0, last = -s;
  memset(weights, 0, sizeof(double[NODES][N_DERIVATIVES]));
  weights[0][0] = 1.0;
  for (int i = 1; i < NODES; ++i) {
    const int most = i < N_DERIVATIVES ? i : N_DERIVATIVES - 1;
    double product = 1.0, here = i - s;
    for (int j = 0; j < i; ++j) {
      const double apart = i - j;
      product *= apart;
      for (int d = most; j == i - 1 && d >= 0; --d) {
        double lower = d > 0 ? d * weights[j][d - 1] : 0.0;
        weights[i][d] = before * (lower - last * weights[j][d]) / product;
      }
      for (int d = most; d >= 0; --d) {
        weights[j][d] = (here * weights[j][d] - (d > 0 ? d * weights[j][d - 1] : 0.0)) / apart;
      }
    }
    before = product;
    last = here;
  }
}

static int call(const bd_torque_set *set, const bd_motion *motion, double t, double *value,
                bd_error *err) {
  int code = motion->call(t, value, motion->user);
  if (code != 0) {
    return bd_fail_at(err, BD_ERR_CALLBACK, "motion", t, -1, motion->pulley, (double)code,
                      "the motion of %s asked to stop at t = %.9g s",
                      bd_pulley_label(set->model, motion->pulley).text, t);
  }
  if (!isfinite(*value)) {
    return bd_fail_at(err, BD_ERR_TORQUE_VALUE, "motion", t, -1, motion->pulley, *value,
                      "the prescribed %s of %s is %g at t = %.9g s: it must be finite",
                      motion->kind == BD_MOTION_ANGLE ? "angle" : "speed",
                      bd_pulley_label(set->model, motion->pulley).text, *value, t);
  }
  return BD_OK;
}

/* The value at t and its derivatives. */
static int differentiate(const bd_torque_set *set, const bd_motion *motion, double t,
                         double derivatives[N_DERIVATIVES], bd_error *err) {
  const double least = fmin(t, fmax(set->after, set->motion.begin));
  const double most = fmax(t, fmin(set->before, set->motion.end));
  const double step = fmin(STEP, (most - least) / (NODES - 1));
  const double first = fmax(least, fmin(t - 0.5 * (NODES - 1) * step, most - (NODES - 1) * step));
  double weights[NODES][N_DERIVATIVES], scale = 1.0;
  weigh((t - first) / step, weights);
  memset(derivatives, 0, N_DERIVATIVES * sizeof *derivatives);
  int code = call(set, motion, t, &derivatives[0], err);
  for (int i = 0; code == BD_OK && i < NODES; ++i) {
    double value;
    code = call(set, motion, fmin(most, first + i * step), &value, err);
    for (int d = 1; d < N_DERIVATIVES; ++d) {
      derivatives[d] += weights[i][d] * (value - derivatives[0]);
    }
  }
  for (int d = 1; d < N_DERIVATIVES; ++d) {
    scale /= step;
    derivatives[d] *= scale;
  }
  return code;
}

int bd_motion_set_eval(bd_torque_set *set, double t, double t_piece, bd_error *err) {
  bd_motion_set *motion = &set->motion;
  if (t == motion->t && t_piece == motion->t_piece) {
    return BD_OK;
  }
  motion->t = (double)NAN;
  for (size_t k = 0; k < motion->n; ++k) {
    double f[N_DERIVATIVES];
    if (motion->motions[k].kind == BD_MOTION_PIECEWISE) {
      piecewise(motion, k, t, t_piece);
      continue;
    }
    int code = differentiate(set, &motion->motions[k], t, f, err);
    if (code != BD_OK) {
      return code;
    }
    const int by = bd_knows_angle(motion, k); /* one derivative more */
    motion->theta[k] = f[0];
    motion->omega[k] = f[by];
    motion->alpha[k] = f[1 + by];
    motion->jerk[k] = f[2 + by];
  }
  motion->t = t;
  motion->t_piece = t_piece;
  return BD_OK;
}

/* --- on a plan ------------------------------------------------------------------------------- */

int bd_motion_put(bd_plan *plan, double t, double *y, bd_error *err) {
  const bd_layout *lay = &plan->model->lay;
  const bd_motion_set *set = &plan->torques.motion;
  int code = set->n > 0 ? bd_motion_set_eval(&plan->torques, t, plan->t_piece, err) : BD_OK;
  for (size_t k = 0; code == BD_OK && k < set->n; ++k) {
    const int j = set->motions[k].pulley;
    y[lay->omega + j] = set->omega[k];
    if (bd_knows_angle(set, k)) {
      y[lay->theta + j] = set->offset[k] + set->theta[k];
    }
  }
  return code;
}

int bd_motion_begin(bd_plan *plan, double t, double t_end, const double *y, bd_error *err) {
  /* A speed that is the difference of an angle has fewer digits. */
  const double OF_SPEED = 1e-9, OF_ANGLE = 1e-6;
  const bd_layout *lay = &plan->model->lay;
  bd_motion_set *set = &plan->torques.motion;
  set->begin = t;
  set->end = t_end;
  int code = set->n > 0 ? bd_motion_set_eval(&plan->torques, t, plan->t_piece, err) : BD_OK;
  for (size_t k = 0; code == BD_OK && k < set->n; ++k) {
    const int j = set->motions[k].pulley;
    const double given = set->omega[k], there = y[lay->omega + j];
    const double scale = bd_speed_scale(plan->model) / plan->model->radius[j];
    const double share = set->motions[k].kind == BD_MOTION_ANGLE ? OF_ANGLE : OF_SPEED;
    set->offset[k] = y[lay->theta + j] - set->theta[k];
    if (fabs(given - there) > share * fmax(scale, fmax(fabs(given), fabs(there)))) {
      return bd_fail_at(err, BD_ERR_STATE, "motion", t, -1, j, given,
                        "the prescribed motion of %s begins with %.10g rad/s at t = %g s, "
                        "but in the initial state it turns at %.10g rad/s: begin with that speed, "
                        "or start from a state that has the other (State.at_speed)",
                        bd_pulley_label(plan->model, j).text, given, t, there);
    }
  }
  return code;
}

void bd_outputs_of_motion(bd_plan *plan, const double *y, const bd_output *out, size_t k) {
  const bd_model *model = plan->model;
  const bd_motion_set *set = &plan->torques.motion;
  for (size_t m = 0; out->torque && m < set->n; ++m) {
    const int j = set->motions[m].pulley;
    double torque = model->inertia[j] * set->alpha[m];
    for (int e = 0; e < plan->n_effects; ++e) {
      torque -= plan->effects[e]->on_shaft ? plan->effects[e]->on_shaft(plan, y, j) : 0.0;
    }
    out->torque[k * (size_t)model->lay.np + (size_t)j] = torque;
  }
}
