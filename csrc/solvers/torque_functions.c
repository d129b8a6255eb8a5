/* SPDX-License-Identifier: MIT
 *
 * Torque functions. They are known only where they are called, so what they do in between, and how
 * they depend on angles and speeds, is an assumption that has to be checked against their values.
 *
 * Calls along a step. A method that finds little to do makes steps as long as the run, and would
 * step over a pulse. A step longer than `interval` is accepted only if the function, called every
 * `interval` along it, has the impulse that the step has used (Simpson's rule on its two ends and
 * its middle), within the local error allowed; otherwise the step is made again, up to where the
 * function first leaves that parabola.
 *
 * A jump within a shorter step shows in implicit methods, whose estimates look at the solution or
 * at stages all along the step; of explicit ones the torque in the middle of a step is compared
 * with those at its ends, where these differ by what would matter.
 *
 * Derivatives. Implicit methods take them as differences over 1e-7, which turns noise, a jump or a
 * staircase into a very large damping. A derivative large enough to matter within a step is
 * therefore checked: it has to be the same over a difference a hundred thousand times as wide, on
 * both sides, and above what the function differs by when called twice with the same arguments; the
 * change with time likewise has to be that over half the step. After the step, the change that the
 * derivatives predicted is compared with that of the torque; where they were wrong they are left
 * out for some steps, and the torque is followed explicitly.
 *
 * Torques that jump all the time. A single jump is located to the tolerance, by some twenty short
 * steps. Noise or a relay would be chased without end: where short steps for its sake go on, steps
 * are not made shorter than a twenty-fifth of the interval, which averages noise and lets a relay
 * swing by what that time is worth, and a warning says so.
 *
 * Samples inside a step show the torque at times at which no step has called it: a difference that
 * would have moved a pulley, against its inertia and the damping that the step knew of, is a named
 * warning. The speed at a sample is right to the tolerance only, and a steep torque with it.
 *
 * Guarded by tests/test_opaque_torques.py.
 */
#include <math.h>
#include <string.h>

#include "solvers/solvers.h"

void bd_torque_functions_carve(bd_carver *carver, bd_torque_functions *functions, int np) {
  double **const scratch[] = {&functions->begin, &functions->middle, &functions->end,
                              &functions->theta, &functions->omega,  &functions->impulse,
                              &functions->look};
  double **const kept[] = {&functions->last, &functions->now, &functions->range, &functions->least,
                           &functions->most};
  BD_KEEP_SPAN(carver, functions, left_out, ranges);
  for (size_t k = 0; k < sizeof scratch / sizeof scratch[0]; ++k) {
    BD_CARVE(carver, *scratch[k], np);
  }
  for (size_t k = 0; k < sizeof kept / sizeof kept[0]; ++k) {
    BD_KEEP(carver, *kept[k], np);
  }
}

/* --- looks ----------------------------------------------------------------------------------- */

int bd_stepper_torque(bd_stepper *stepper, double t, const double *y, double *torque) {
  const bd_layout *lay = &stepper->model->lay;
  return bd_torque_set_eval(&stepper->plan.torques, t, stepper->plan.t_piece, y + lay->theta,
                            y + lay->omega, torque, &stepper->report.failure);
}

/* Torques at the fraction s of the step, angles and speeds along the straight line. */
static int torque_along(bd_stepper *stepper, double h, double s, double *torque) {
  const bd_layout *lay = &stepper->model->lay;
  bd_torque_functions *functions = &stepper->functions;
  for (int j = 0; j < lay->np; ++j) {
    double theta = stepper->y[lay->theta + j], omega = stepper->y[lay->omega + j];
    functions->theta[j] = theta + s * (stepper->y_new[lay->theta + j] - theta);
    functions->omega[j] = omega + s * (stepper->y_new[lay->omega + j] - omega);
  }
  return bd_torque_set_eval(&stepper->plan.torques, stepper->t + s * h, stepper->plan.t_piece,
                            functions->theta, functions->omega, torque, &stepper->report.failure);
}

/* Speed error of pulley j that a torque acting for a time would cause, in the units of local
 * errors.
 */
static double speed_error(const bd_stepper *stepper, int j, double torque, double time) {
  return stepper->weights[stepper->model->lay.omega + j] * fabs(torque) * time /
         stepper->model->inertia[j];
}

/* *until: the fraction of the step up to which nothing was missed, 1 if nothing was at all. */
static int look_along(bd_stepper *stepper, double h, double tolerance, double *until) {
  bd_torque_functions *functions = &stepper->functions;
  const int np = stepper->model->lay.np;
  const long n = 2 * (long)ceil(0.5 * h / functions->interval);
  double *torque = functions->look, first_deviation = 0.0;
  BD_TRY(torque_along(stepper, h, 0.0, functions->begin));
  BD_TRY(torque_along(stepper, h, 0.5, functions->middle));
  BD_TRY(torque_along(stepper, h, 1.0, functions->end));
  for (int j = 0; j < np; ++j) {
    functions->impulse[j] =
        (functions->begin[j] + functions->end[j]) / (3.0 * (double)n) -
        (functions->begin[j] + 4.0 * functions->middle[j] + functions->end[j]) / 6.0;
  }
  for (long k = 1; k < n; ++k) {
    double s = (double)k / (double)n;
    BD_TRY(torque_along(stepper, h, s, torque));
    for (int j = 0; j < np; ++j) {
      double parabola = functions->begin[j] * (1.0 - s) * (1.0 - 2.0 * s) +
                        functions->middle[j] * 4.0 * s * (1.0 - s) +
                        functions->end[j] * s * (2.0 * s - 1.0);
      functions->impulse[j] += (k % 2 ? 4.0 : 2.0) * torque[j] / (3.0 * (double)n);
      if (first_deviation == 0.0 && speed_error(stepper, j, torque[j] - parabola, h) > tolerance) {
        first_deviation = (double)(k - 1) / (double)n;
        first_deviation = fmax(first_deviation, functions->interval / h);
      }
    }
  }
  *until = 1.0;
  for (int j = 0; j < np; ++j) {
    if (speed_error(stepper, j, functions->impulse[j], h) > tolerance) {
      *until = first_deviation > 0.0 ? fmin(first_deviation, 0.5) : 0.5;
    }
  }
  return BD_OK;
}

/* --- derivatives ----------------------------------------------------------------------------- */

/* The torque's change over a difference of one angle or speed, into functions->begin. */
static int change_by(bd_stepper *stepper, double *moving, double step) {
  double kept = *moving, *by = stepper->functions.begin;
  *moving = kept + step;
  int code = bd_stepper_torque(stepper, stepper->t, stepper->y, by);
  *moving = kept;
  for (int i = 0; code == BD_OK && i < stepper->model->lay.np; ++i) {
    by[i] -= stepper->functions.now[i];
  }
  return code;
}

/* Small derivatives are kept; large ones are verified with a wider difference. */
static int verify(bd_stepper *stepper, double *moving, double wide, double reach, double *column) {
  const bd_layout *lay = &stepper->model->lay;
  bd_torque_functions *functions = &stepper->functions;
  double *above = functions->middle, *below = functions->end, *noise = functions->impulse;
  int doubtful = 0;
  for (int i = 0; i < lay->np; ++i) {
    doubtful |= fabs(column[i * lay->np]) * reach > 0.1 * stepper->model->inertia[i];
  }
  if (!doubtful) {
    return BD_OK;
  }
  double *const into[] = {above, below, noise};
  const double steps[] = {wide, -wide, 0.0};
  for (int k = 0; k < 3; ++k) {
    BD_TRY(change_by(stepper, moving, steps[k]));
    memcpy(into[k], functions->begin, (size_t)lay->np * sizeof *above);
  }
  for (int i = 0; i < lay->np; ++i) {
    double *slope = &column[i * lay->np], a = above[i] / wide, b = -below[i] / wide;
    double least = fabs(a) < fabs(b) ? a : b, most = fmax(fabs(*slope), fmax(fabs(a), fabs(b)));
    if (fabs(*slope - a) > 0.25 * most || fabs(*slope - b) > 0.25 * most) {
      *slope = a * b > 0.0 && fabs(least) * wide > 4.0 * fabs(noise[i]) ? least : 0.0;
    }
  }
  return BD_OK;
}

int bd_torque_functions_derive(bd_stepper *stepper) {
  bd_newton_system *system = &stepper->newton;
  const bd_layout *lay = &stepper->model->lay;
  bd_torque_functions *functions = &stepper->functions;
  bd_torque_set *set = &stepper->plan.torques;
  double *theta = stepper->y + lay->theta, *omega = stepper->y + lay->omega;
  BD_TRY(bd_torque_set_derive(set, stepper->t, stepper->plan.t_piece, theta, omega, functions->now,
                              system->by_theta, system->by_omega, &stepper->report.failure));
  if (set->smooth) {
    return BD_OK;
  }
  if (functions->left_out > 0) {
    --functions->left_out;
    memset(system->by_theta, 0, (size_t)(lay->np * lay->np) * sizeof *system->by_theta);
    memset(system->by_omega, 0, (size_t)(lay->np * lay->np) * sizeof *system->by_omega);
    return BD_OK;
  }
  for (int j = 0; j < lay->np; ++j) {
    double wide = 0.01 * fmax(fabs(omega[j]), bd_state_scale(stepper->model, F_OMEGA, j));
    BD_TRY(verify(stepper, &omega[j], wide, stepper->h, system->by_omega + j));
    wide = 0.01 * bd_state_scale(stepper->model, F_THETA, j);
    BD_TRY(verify(stepper, &theta[j], wide, stepper->h * stepper->h, system->by_theta + j));
  }
  return BD_OK;
}

int bd_torque_functions_by_time(bd_stepper *stepper, double h) {
  const bd_layout *lay = &stepper->model->lay;
  bd_newton_system *system = &stepper->newton;
  double *over = stepper->functions.begin;
  BD_TRY(bd_torque_set_by_time(&stepper->plan.torques, stepper->t, 0.5 * h, stepper->plan.t_piece,
                               stepper->y + lay->theta, stepper->y + lay->omega,
                               stepper->functions.now, over, &stepper->report.failure));
  for (int j = 0; j < lay->np; ++j) {
    double apart = fabs(system->by_time[j] - over[j]);
    if (apart > 0.5 * fmax(fabs(system->by_time[j]), fabs(over[j])) &&
        speed_error(stepper, j, apart * h, h) >
            bd_method_tolerance(stepper->now, stepper->model, stepper->rtol)) {
      system->by_time[j] = over[j];
    }
  }
  return BD_OK;
}

/* Whether the torque at the step's end is not what the derivatives that shaped the step said. */
static int contradicted(bd_stepper *stepper, double h, double t_new, double tolerance, int *wrong) {
  const bd_layout *lay = &stepper->model->lay;
  const bd_newton_system *system = &stepper->newton;
  bd_torque_functions *functions = &stepper->functions;
  int matters = 0;
  for (int i = 0; i < lay->np; ++i) {
    double predicted = 0.0;
    for (int j = 0; j < lay->np; ++j) {
      predicted += system->by_theta[i * lay->np + j] *
                   (stepper->y_new[lay->theta + j] - stepper->y[lay->theta + j]);
      predicted += system->by_omega[i * lay->np + j] *
                   (stepper->y_new[lay->omega + j] - stepper->y[lay->omega + j]);
    }
    functions->impulse[i] = predicted;
    matters |= speed_error(stepper, i, predicted, h) > tolerance;
  }
  if (matters) {
    BD_TRY(bd_stepper_torque(stepper, t_new, stepper->y_new, functions->look));
  }
  for (int i = 0; matters && i < lay->np; ++i) {
    double predicted = functions->impulse[i];
    double actual = functions->look[i] - functions->now[i] - h * system->by_time[i];
    *wrong |= speed_error(stepper, i, predicted, h) > tolerance &&
              fabs(actual - predicted) > 0.5 * fabs(predicted);
  }
  return BD_OK;
}

/* Whether the torque jumps within a step of an explicit method by more than the tolerance allows.
 * Its estimate has next to no weight on what changes between 0.16 and 0.9 of the step, where the
 * step itself is off by up to MISSED of it; in the middle a jump is half of it off the mean of both
 * ends, what is smooth is off by its curvature alone. */
static int jumps_within(bd_stepper *stepper, double h, double tolerance, int *jumps) {
  const double MISSED = 0.3;
  const int np = stepper->model->lay.np;
  bd_torque_functions *functions = &stepper->functions;
  const double *begin = functions->now, *end = stepper->plan.torque;
  int matters = 0;
  for (int j = 0; j < np; ++j) {
    matters |= speed_error(stepper, j, MISSED * (end[j] - begin[j]), h) > tolerance;
  }
  if (matters) {
    BD_TRY(torque_along(stepper, h, 0.5, functions->look));
  }
  for (int j = 0; matters && j < np; ++j) {
    const double off = 2.0 * functions->look[j] - (begin[j] + end[j]);
    *jumps |= speed_error(stepper, j, MISSED * off, h) > tolerance;
  }
  return BD_OK;
}

/* --- roughness ------------------------------------------------------------------------------- */

/* Short steps in excess from which a torque counts as one that jumps all the time. */
static const double JUMP_BUDGET = 800.0;
/* Short steps taken off the excess per interval. */
static const double JUMP_REFUND = 25.0;
/* Intervals until the next check, the factor by which they grow, and the share of JUMP_BUDGET that
 * is kept after a check. */
static const double CHECK_INTERVALS = 20.0, CHECK_GROWTH = 4.0, BUDGET_KEPT = 0.9;

/* The shortest step for the sake of a torque that jumps all the time; never one in which a stretch
 * wave runs through more than a sixtieth of the belt. */
static double shortest_for_jumps(const bd_stepper *stepper) {
  double most = fmin(stepper->functions.interval / 25.0, bd_round_time(stepper->model) / 60.0);
  return bd_stepper_longest(stepper, most);
}

/* The torque of pulley j has jumped: adds the short steps since its last jump to the excess. */
static void count_jump(bd_stepper *stepper, int j, double change) {
  bd_torque_functions *functions = &stepper->functions;
  const double least = shortest_for_jumps(stepper);
  double paid = JUMP_REFUND * fmax(0.0, stepper->t - functions->t_owed) / functions->interval;
  functions->owed = fmax(0.0, functions->owed - paid) + (double)functions->short_tries;
  functions->short_tries = 0;
  functions->t_owed = fmax(functions->t_owed, stepper->t);
  functions->jump = fmax(functions->jump, speed_error(stepper, j, change, 1.0));
  if (functions->owed < JUMP_BUDGET || stepper->t < functions->rough_until) {
    return;
  }
  functions->rough_for =
      fmax(CHECK_INTERVALS * functions->interval, CHECK_GROWTH * functions->rough_for);
  functions->t_owed = functions->rough_until = stepper->t + functions->rough_for;
  functions->owed = BUDGET_KEPT * JUMP_BUDGET;
  bd_warn(&stepper->report, BD_WARN_rough_torque, stepper->t, -1, j,
          "the torque function of %s jumps all the time (noise, a relay, a staircase), by "
          "%.3g N m round t = %.6g s: steps are not made shorter than %.2g s, worth %.2g rad/s "
          "each; let it change over a range of time or speed, or name its jumps in "
          "breakpoints",
          bd_pulley_label(stepper->model, j).text, fabs(change), stepper->t, least,
          fabs(change) * least / stepper->model->inertia[j]);
}

/* The torques of a try into the range of the present stretch, as long as the shortest step; a
 * smooth torque changes over a short step by a part of what it changes over such a stretch. */
static void widen(bd_stepper *stepper, const double *low, const double *high) {
  bd_torque_functions *functions = &stepper->functions;
  const int np = stepper->model->lay.np;
  int over = stepper->t >= functions->t_range + shortest_for_jumps(stepper);
  for (int j = 0; j < np; ++j) {
    if (over) {
      functions->range[j] = functions->ranges > 0 ? functions->most[j] - functions->least[j] : 0.0;
      functions->least[j] = functions->most[j] = low[j];
    }
    functions->least[j] = fmin(functions->least[j], low[j]);
    functions->most[j] = fmax(functions->most[j], high[j]);
  }
  functions->t_range = over ? stepper->t : functions->t_range;
  functions->ranges += over;
}

/* Most error of a try of length h that a torque which jumps, by a speed error of `jump` over unit
 * time, can be blamed for. */
static double blamed(double jump, double h) {
  return 4.0 * h * jump;
}

/* Largest changes of the torques over a quarter of the step, into functions->impulse. */
static int change_by_quarters(bd_stepper *stepper, double h) {
  bd_torque_functions *functions = &stepper->functions;
  const int np = stepper->model->lay.np;
  double *from = functions->begin, *to = functions->end;
  memset(functions->impulse, 0, (size_t)np * sizeof *functions->impulse);
  BD_TRY(torque_along(stepper, h, 0.0, from));
  for (int k = 1; k <= 4; ++k) {
    BD_TRY(torque_along(stepper, h, 0.25 * k, to));
    for (int j = 0; j < np; ++j) {
      functions->impulse[j] = fmax(functions->impulse[j], fabs(to[j] - from[j]));
    }
    double *const kept = from;
    from = to;
    to = kept;
  }
  return BD_OK;
}

/* Counts the torques that jump, by what would matter over the shortest step. A try of length h that
 * errs by more than the torque can be blamed for does so for another reason: then it may be the
 * speeds that jump, and the torque with them. What jumps does so within a quarter of the step; what
 * follows time and speeds changes there by less than half as much, a parabola by 7/16. */
static int count_changes(bd_stepper *stepper, double h, double error, const double *one,
                         const double *other) {
  const bd_torque_functions *functions = &stepper->functions;
  const double tolerance = bd_method_tolerance(stepper->method, stepper->model, stepper->rtol),
               least = shortest_for_jumps(stepper);
  int looked = 0;
  for (int j = 0; functions->ranges > 1 && j < stepper->model->lay.np; ++j) {
    double change = fabs(other[j] - one[j]);
    double range = fmax(functions->range[j], functions->most[j] - functions->least[j]);
    if (!(speed_error(stepper, j, change, least) > tolerance && change > 0.5 * range &&
          error <= blamed(speed_error(stepper, j, change, 1.0), h))) {
      continue;
    }
    BD_TRY(looked ? BD_OK : change_by_quarters(stepper, h));
    looked = 1;
    if (functions->impulse[j] > 0.5 * change) {
      count_jump(stepper, j, change);
    }
  }
  return BD_OK;
}

void bd_torque_functions_before_try(bd_stepper *stepper) {
  bd_torque_set *set = &stepper->plan.torques;
  set->watched = !set->smooth && !stepper->plan.pulleys_locked;
  for (int j = 0; set->watched && j < stepper->model->lay.np; ++j) {
    set->low[j] = set->high[j] = stepper->functions.now[j];
  }
}

int bd_torque_functions_after_try(bd_stepper *stepper, double h, double error) {
  bd_torque_set *set = &stepper->plan.torques;
  const double least = shortest_for_jumps(stepper);
  const int watched = set->watched;
  set->watched = 0;
  if (watched) {
    widen(stepper, set->low, set->high);
  }
  if (!watched || h > 1.1 * least) {
    return BD_OK;
  }
  stepper->functions.short_tries += h < 0.5 * least;
  return count_changes(stepper, h, error, set->low, set->high);
}

double bd_torque_functions_shortest_step(const bd_stepper *stepper) {
  return stepper->t < stepper->functions.rough_until ? shortest_for_jumps(stepper) : 0.0;
}

double bd_torque_functions_extra_error(const bd_stepper *stepper, double h) {
  return stepper->t < stepper->functions.rough_until && h <= 1.1 * shortest_for_jumps(stepper)
             ? blamed(stepper->functions.jump, h)
             : 0.0;
}

/* --- a step, and its samples ----------------------------------------------------------------- */

int bd_torque_functions_check_step(bd_stepper *stepper, double h, double t_new, double tolerance,
                                   double *shrink) {
  enum { FIRST = 8, MOST = 4096 };
  bd_torque_functions *functions = &stepper->functions;
  int wrong = 0;
  *shrink = 1.0;
  if (stepper->plan.torques.smooth || stepper->plan.pulleys_locked) {
    return BD_OK;
  }
  if (stepper->now->implicit) {
    BD_TRY(contradicted(stepper, h, t_new, fmin(tolerance, 1.0), &wrong));
  } else if (!stepper->fixed && h > 1.1 * bd_torque_functions_shortest_step(stepper)) {
    int jumps = 0;
    BD_TRY(jumps_within(stepper, h, fmin(tolerance, 1.0), &jumps));
    *shrink = jumps ? 0.5 : 1.0;
  }
  if (wrong) {
    functions->next_left_out = functions->next_left_out ? 2 * functions->next_left_out : FIRST;
    functions->next_left_out = functions->next_left_out < MOST ? functions->next_left_out : MOST;
    functions->left_out = functions->next_left_out;
    stepper->jacobian_known = 0;
    *shrink = 0.5;
  } else if (*shrink == 1.0 && h > functions->interval) {
    return look_along(stepper, h, fmin(tolerance, 1.0), shrink);
  }
  return BD_OK;
}

void bd_torque_functions_set_torque(bd_stepper *stepper) {
  memcpy(stepper->functions.now, stepper->plan.torque,
         (size_t)stepper->model->lay.np * sizeof(double));
}

int bd_torque_functions_push_torque(bd_stepper *stepper, double h) {
  memcpy(stepper->functions.last, stepper->functions.now,
         (size_t)stepper->model->lay.np * sizeof(double));
  bd_torque_functions_set_torque(stepper);
  if (!stepper->plan.torques.smooth && h <= 1.1 * shortest_for_jumps(stepper)) {
    return count_changes(stepper, h, 0.0, stepper->functions.last, stepper->functions.now);
  }
  return BD_OK;
}

int bd_torque_functions_jumping(const bd_stepper *stepper) {
  const bd_torque_functions *functions = &stepper->functions;
  double tolerance = bd_method_tolerance(stepper->method, stepper->model, stepper->rtol);
  for (int j = 0; !stepper->plan.torques.smooth && j < stepper->model->lay.np; ++j) {
    if (speed_error(stepper, j, functions->now[j] - functions->last[j], stepper->h) >
        0.1 * tolerance) {
      return j;
    }
  }
  return -1;
}

void bd_torque_functions_check_sample(bd_stepper *stepper, double t, double h) {
  const bd_layout *lay = &stepper->model->lay;
  const bd_torque_set *set = &stepper->plan.torques;
  const bd_torque_functions *functions = &stepper->functions;
  for (int j = 0; j < lay->np; ++j) {
    double torque = stepper->plan.torque[j];
    double low = fmin(set->low[j], functions->now[j]), high = fmax(set->high[j], functions->now[j]);
    double beyond = fmax(low - torque, torque - high);
    double scale = fmax(fabs(stepper->y[lay->omega + j]), 1.0 / stepper->weights[lay->omega + j]);
    double damping =
        stepper->now->implicit ? fmax(0.0, -stepper->newton.by_omega[j * lay->np + j]) : 0.0;
    if (beyond * h > 0.02 * scale * (stepper->model->inertia[j] + h * damping)) {
      bd_warn(&stepper->report, BD_WARN_torque, t, -1, j,
              "the torque function gives %.4g N m on %s at t = %.9g s, where the step "
              "round it saw %.4g to %.4g N m: it changes faster than steps of %.3g s follow; "
              "name the times of its jumps in breakpoints, or take a smaller max_step",
              torque, bd_pulley_label(stepper->model, j).text, t, low, high, h);
    }
  }
}
