/* SPDX-License-Identifier: MIT
 *
 * What the implicit methods share: the Jacobian where it is due, the set torques' change with time,
 * and the ledger, whose power is a quadrature that no stage needs: it is taken at the ends of a
 * step, and in its middle where the method is of an order that would notice.
 */
#include <math.h>
#include <string.h>

#include "solvers/solvers.h"

int bd_implicit_linearise(bd_stepper *stepper, double ahead) {
  if (stepper->jacobian_known && ahead <= stepper->newton.at.ahead) {
    return BD_OK;
  }
  if (!stepper->rate_known) {
    int code = bd_stepper_ensure_rate(stepper);
    if (code != BD_OK) {
      return code;
    }
  }
  stepper->newton.at.ahead = ahead;
  bd_newton_linearise(&stepper->newton, &stepper->plan, stepper->y);
  const int watched = stepper->plan.torques.watched;
  stepper->plan.torques.watched = 0; /* what is asked for derivatives is not the step's */
  int code = stepper->plan.pulleys_locked ? BD_OK : bd_torque_functions_derive(stepper);
  stepper->plan.torques.watched = watched;
  stepper->jacobian_known = code == BD_OK;
  ++stepper->njev;
  return code;
}

int bd_implicit_torque_by_time(bd_stepper *stepper, double h, int at_start) {
  bd_newton_system *system = &stepper->newton;
  const bd_layout *lay = &stepper->model->lay;
  if (stepper->plan.pulleys_locked) {
    return BD_OK;
  }
  double dt = at_start ? 1e-4 * h : h;
  int code = bd_torque_set_by_time(
      &stepper->plan.torques, stepper->t, dt, stepper->plan.t_piece, stepper->y + lay->theta,
      stepper->y + lay->omega, stepper->functions.now, system->by_time, &stepper->report.failure);
  if (code == BD_OK && at_start && !stepper->plan.torques.smooth) {
    code = bd_torque_functions_by_time(stepper, h);
  }
  const bd_motion_set *motion = &stepper->plan.torques.motion;
  if (code == BD_OK && at_start && motion->n > 0) {
    code = bd_motion_set_eval(&stepper->plan.torques, stepper->t, stepper->plan.t_piece,
                              &stepper->report.failure);
  }
  for (size_t k = 0; code == BD_OK && at_start && k < motion->n; ++k) {
    int j = motion->motions[k].pulley;
    system->by_time[j] = stepper->model->inertia[j] * motion->jerk[k];
  }
  return code;
}

int bd_implicit_prescribe(bd_stepper *stepper, double h, double g, double *c) {
  const bd_layout *lay = &stepper->model->lay;
  const bd_motion_set *motion = &stepper->plan.torques.motion;
  int code = motion->n == 0 ? BD_OK
                            : bd_motion_set_eval(&stepper->plan.torques, stepper->t + h,
                                                 stepper->plan.t_piece, &stepper->report.failure);
  for (size_t k = 0; code == BD_OK && k < motion->n; ++k) {
    const int j = motion->motions[k].pulley;
    const double faster = motion->omega[k] - stepper->y[lay->omega + j];
    c[lay->omega + j] = faster / g;
    if (bd_knows_angle(motion, k)) {
      double turned = motion->offset[k] + motion->theta[k] - stepper->y[lay->theta + j];
      c[lay->theta + j] = turned / g - faster;
    }
  }
  return code;
}

void bd_implicit_add_torque_by_time(const bd_stepper *stepper, double *c, double factor) {
  for (int j = 0; !stepper->plan.pulleys_locked && j < stepper->model->lay.np; ++j) {
    c[stepper->model->lay.omega + j] +=
        factor * stepper->newton.by_time[j] / stepper->model->inertia[j];
  }
}

/* These are errors that come once, so it is what was asked for that limits them. */
double bd_implicit_hidden_error(const bd_stepper *stepper, double h, double g,
                                const double *y_new) {
  const bd_step step = {.t = stepper->t + h,
                        .h = h,
                        .g = g,
                        .y = stepper->y,
                        .y_new = y_new,
                        .weights = stepper->weights,
                        .implicit = 1};
  const double most = bd_plan_unseen(&stepper->plan, &step);
  return stepper->fixed ? most
                        : most / stepper->rtol *
                              bd_method_tolerance(stepper->now, stepper->model, stepper->rtol);
}

int bd_implicit_middle(bd_stepper *stepper, double h) {
  const bd_layout *lay = &stepper->model->lay;
  double *rate = stepper->stage[stepper->now->vectors - 1];
  if (stepper->now->middle && stepper->plan.ledger) {
    stepper->now->inside(stepper, h, 0.5, stepper->y_mid);
    BD_TRY(bd_stepper_rate(stepper, stepper->t + 0.5 * h, stepper->y_mid, rate));
    memcpy(stepper->work_middle, rate + lay->work, (size_t)lay->n_work * sizeof *rate);
  }
  return BD_OK;
}

int bd_implicit_finish(bd_stepper *stepper, double h, double t_new) {
  const bd_layout *lay = &stepper->model->lay;
  double *rate = stepper->stage[stepper->now->vectors - 1];
  const double *before = stepper->stage[0] + lay->work, *after = rate + lay->work;
  const int middle = stepper->now->middle && stepper->plan.ledger;
  int code = bd_stepper_rate(stepper, t_new, stepper->y_new, rate);
  if (code != BD_OK) {
    return code;
  }
  for (int k = 0; k < lay->n_work; ++k) {
    double mean = middle ? stepper->work_middle[k] : 0.5 * (before[k] + after[k]);
    stepper->work_middle[k] = mean;
    stepper->y_new[lay->work + k] =
        stepper->y[lay->work + k] + h * (before[k] + 4.0 * mean + after[k]) / 6.0;
  }
  return BD_OK;
}

/* Integral up to s of a step of length h, of the parabola through the step's three powers; where it
 * dips to the other side of 0 though none of them is there, that of straight lines between them, to
 * the same end. */
static double work_up_to(const double p[3], double h, double s) {
  const double linear = -3.0 * p[0] + 4.0 * p[1] - p[2];
  const double quadratic = 2.0 * p[0] - 4.0 * p[1] + 2.0 * p[2];
  const double turn = quadratic != 0.0 ? -0.5 * linear / quadratic : -1.0;
  const double there = p[0] + turn * (linear + turn * quadratic);
  if (turn > 0.0 && turn < 1.0 && there * p[0] < 0.0 && there * p[1] < 0.0 && there * p[2] < 0.0) {
    const double left = fmin(s, 0.5), right = fmax(s - 0.5, 0.0);
    const double lines =
        left * (p[0] + left * (p[1] - p[0])) + right * (p[1] + right * (p[2] - p[1]));
    return h * lines * (p[0] + 4.0 * p[1] + p[2]) / (1.5 * (p[0] + 2.0 * p[1] + p[2]));
  }
  return h * s * (p[0] + s * (0.5 * linear + s * quadratic / 3.0));
}

void bd_implicit_work_inside(const bd_stepper *stepper, double h, double s, double *y) {
  const bd_layout *lay = &stepper->model->lay;
  const double *before = stepper->stage[0] + lay->work;
  const double *after = stepper->stage[stepper->now->vectors - 1] + lay->work;
  for (int k = 0; k < lay->n_work; ++k) {
    const double powers[3] = {before[k], stepper->work_middle[k], after[k]};
    y[lay->work + k] = stepper->y[lay->work + k] + work_up_to(powers, h, s);
  }
}
