/* SPDX-License-Identifier: MIT
 *
 * Torque functions: known only where they are called, so what they do in between, and how they
 * depend on angles and speeds, is a guess that has to be held against what they say.
 *
 * Looks. A method that finds nothing to do makes steps as long as a run, and would step over a
 * pulse. A step longer than `interval` is accepted only if the function, called every `interval`
 * along it, has the impulse that the step has seen (Simpson's rule on its two ends and its middle),
 * to within the local error allowed; else it is made again, up to where the function first parts
 * from that parabola.
 *
 * Derivatives. Implicit methods take them as differences over 1e-7, which make a huge damping of
 * noise, of a jump or of a staircase. One large enough to matter within a step is therefore looked
 * at again: it has to be the same over a difference a hundred thousand times as wide, on both
 * sides, and above what the function differs by when called twice with the same arguments; the
 * change with time likewise has to be that over half the step. After the step, what the derivatives
 * promised is compared with the torque that came; where they were wrong they are left out for some
 * steps, and the torque is followed explicitly.
 *
 * Roughness. A single jump is located to the tolerance, by some twenty short steps. What jumps all
 * the time, noise or a relay, would be chased for ever: where short steps for its sake go on and
 * on, steps are not made shorter than a twenty-fifth of the interval, which averages noise and lets
 * a relay swing by what that time is worth, and a warning says so.
 *
 * Samples inside a step show the torque at times at which no step has called it: a difference that
 * would have moved a pulley is a named warning.
 */
#include <math.h>
#include <string.h>

#include "solvers/solvers.h"

void bd_opaque_carve(bd_carver *carver, bd_opaque *opaque, int np) {
  double **const arrays[] = {&opaque->begin, &opaque->middle, &opaque->end,  &opaque->impulse,
                             &opaque->theta, &opaque->omega,  &opaque->last, &opaque->now,
                             &opaque->range, &opaque->least,  &opaque->most, &opaque->look};
  for (size_t k = 0; k < sizeof arrays / sizeof arrays[0]; ++k) {
    BD_CARVE(carver, *arrays[k], np);
  }
}

/* --- looks ----------------------------------------------------------------------------------- */

/* Torques at the fraction s of the step, angles and speeds along the straight line. */
static int torque_along(bd_stepper *stepper, double h, double s, double *torque) {
  const bd_layout *lay = &stepper->model->lay;
  bd_opaque *opaque = &stepper->opaque;
  for (int j = 0; j < lay->np; ++j) {
    double theta = stepper->y[lay->theta + j], omega = stepper->y[lay->omega + j];
    opaque->theta[j] = theta + s * (stepper->y_new[lay->theta + j] - theta);
    opaque->omega[j] = omega + s * (stepper->y_new[lay->omega + j] - omega);
  }
  return bd_torque_set_eval(&stepper->plan.torques, stepper->t + s * h, stepper->plan.t_piece,
                            opaque->theta, opaque->omega, torque, &stepper->report.failure);
}

/* What a torque acting for a time means for the speed of pulley j, in the units of local errors. */
static double meaning(const bd_stepper *stepper, int j, double torque, double time) {
  return stepper->weights[stepper->model->lay.omega + j] * fabs(torque) * time /
         stepper->model->inertia[j];
}

/* *until: the fraction of the step up to which nothing was missed, 1 if nothing was at all. */
static int look_along(bd_stepper *stepper, double h, double tolerance, double *until) {
  bd_opaque *opaque = &stepper->opaque;
  const int np = stepper->model->lay.np;
  const long n = 2 * (long)ceil(0.5 * h / opaque->interval);
  double *torque = opaque->look, parted = 0.0;
  int code = torque_along(stepper, h, 0.0, opaque->begin);
  if (code == BD_OK) {
    code = torque_along(stepper, h, 0.5, opaque->middle);
  }
  if (code == BD_OK) {
    code = torque_along(stepper, h, 1.0, opaque->end);
  }
  for (int j = 0; j < np; ++j) {
    opaque->impulse[j] = (opaque->begin[j] + opaque->end[j]) / (3.0 * (double)n) -
                         (opaque->begin[j] + 4.0 * opaque->middle[j] + opaque->end[j]) / 6.0;
  }
  for (long k = 1; code == BD_OK && k < n; ++k) {
    double s = (double)k / (double)n;
    code = torque_along(stepper, h, s, torque);
    for (int j = 0; code == BD_OK && j < np; ++j) {
      double parabola = opaque->begin[j] * (1.0 - s) * (1.0 - 2.0 * s) +
                        opaque->middle[j] * 4.0 * s * (1.0 - s) +
                        opaque->end[j] * s * (2.0 * s - 1.0);
      opaque->impulse[j] += (k % 2 ? 4.0 : 2.0) * torque[j] / (3.0 * (double)n);
      if (parted == 0.0 && meaning(stepper, j, torque[j] - parabola, h) > tolerance) {
        parted = (double)(k - 1) / (double)n;
        parted = fmax(parted, opaque->interval / h);
      }
    }
  }
  *until = 1.0;
  for (int j = 0; code == BD_OK && j < np; ++j) {
    if (meaning(stepper, j, opaque->impulse[j], h) > tolerance) {
      *until = parted > 0.0 ? fmin(parted, 0.5) : 0.5;
    }
  }
  return code;
}

/* --- derivatives ----------------------------------------------------------------------------- */

/* The torque's change over a difference of one angle or speed, into opaque->begin. */
static int change_by(bd_stepper *stepper, double *moving, double step) {
  const bd_layout *lay = &stepper->model->lay;
  double kept = *moving, *by = stepper->opaque.begin;
  *moving = kept + step;
  int code = bd_torque_set_eval(&stepper->plan.torques, stepper->t, stepper->plan.t_piece,
                                stepper->y + lay->theta, stepper->y + lay->omega, by,
                                &stepper->report.failure);
  *moving = kept;
  for (int i = 0; code == BD_OK && i < lay->np; ++i) {
    by[i] -= stepper->opaque.now[i];
  }
  return code;
}

/* A column that is small enough to do no harm stays; another must stand up to a second look. */
static int verify(bd_stepper *stepper, double *moving, double wide, double reach, double *column) {
  const bd_layout *lay = &stepper->model->lay;
  bd_opaque *opaque = &stepper->opaque;
  double *above = opaque->middle, *below = opaque->end, *noise = opaque->impulse;
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
    int code = change_by(stepper, moving, steps[k]);
    if (code != BD_OK) {
      return code;
    }
    memcpy(into[k], opaque->begin, (size_t)lay->np * sizeof *above);
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

int bd_opaque_derive(bd_stepper *stepper) {
  bd_newton_system *system = &stepper->newton;
  const bd_layout *lay = &stepper->model->lay;
  bd_opaque *opaque = &stepper->opaque;
  bd_torque_set *set = &stepper->plan.torques;
  double *theta = stepper->y + lay->theta, *omega = stepper->y + lay->omega;
  int code = bd_torque_set_derive(set, stepper->t, stepper->plan.t_piece, theta, omega, opaque->now,
                                  system->by_theta, system->by_omega, &stepper->report.failure);
  if (set->smooth || code != BD_OK) {
    return code;
  }
  if (opaque->left_out > 0) {
    --opaque->left_out;
    memset(system->by_theta, 0, (size_t)(lay->np * lay->np) * sizeof *system->by_theta);
    memset(system->by_omega, 0, (size_t)(lay->np * lay->np) * sizeof *system->by_omega);
    return BD_OK;
  }
  for (int j = 0; code == BD_OK && j < lay->np; ++j) {
    double wide = 0.01 * fmax(fabs(omega[j]), 1.0 / stepper->weights[lay->omega + j]);
    code = verify(stepper, &omega[j], wide, stepper->h, system->by_omega + j);
    if (code == BD_OK) {
      wide = 0.01 / stepper->weights[lay->theta + j];
      code = verify(stepper, &theta[j], wide, stepper->h * stepper->h, system->by_theta + j);
    }
  }
  return code;
}

int bd_opaque_by_time(bd_stepper *stepper, double h) {
  const bd_layout *lay = &stepper->model->lay;
  bd_newton_system *system = &stepper->newton;
  double *over = stepper->opaque.begin;
  int code = bd_torque_set_by_time(
      &stepper->plan.torques, stepper->t, 0.5 * h, stepper->plan.t_piece, stepper->y + lay->theta,
      stepper->y + lay->omega, stepper->opaque.now, over, &stepper->report.failure);
  for (int j = 0; code == BD_OK && j < lay->np; ++j) {
    double apart = fabs(system->by_time[j] - over[j]);
    if (apart > 0.5 * fmax(fabs(system->by_time[j]), fabs(over[j])) &&
        meaning(stepper, j, apart * h, h) > bd_method_tolerance(stepper->now, stepper->rtol)) {
      system->by_time[j] = over[j];
    }
  }
  return code;
}

/* Whether the torque at the step's end is not what the derivatives that shaped the step said. */
static int contradicted(bd_stepper *stepper, double h, double t_new, double tolerance, int *wrong) {
  const bd_layout *lay = &stepper->model->lay;
  const bd_newton_system *system = &stepper->newton;
  bd_opaque *opaque = &stepper->opaque;
  int matters = 0, code = BD_OK;
  for (int i = 0; i < lay->np; ++i) {
    double promised = 0.0;
    for (int j = 0; j < lay->np; ++j) {
      promised += system->by_theta[i * lay->np + j] *
                  (stepper->y_new[lay->theta + j] - stepper->y[lay->theta + j]);
      promised += system->by_omega[i * lay->np + j] *
                  (stepper->y_new[lay->omega + j] - stepper->y[lay->omega + j]);
    }
    opaque->impulse[i] = promised;
    matters |= meaning(stepper, i, promised, h) > tolerance;
  }
  if (matters) {
    code = bd_torque_set_eval(&stepper->plan.torques, t_new, stepper->plan.t_piece,
                              stepper->y_new + lay->theta, stepper->y_new + lay->omega,
                              opaque->look, &stepper->report.failure);
  }
  for (int i = 0; matters && code == BD_OK && i < lay->np; ++i) {
    double promised = opaque->impulse[i];
    double came = opaque->look[i] - opaque->now[i] - h * system->by_time[i];
    *wrong |= meaning(stepper, i, promised, h) > tolerance &&
              fabs(came - promised) > 0.5 * fabs(promised);
  }
  return code;
}

/* --- roughness ------------------------------------------------------------------------------- */

/* Short tries that may be owed, those that an interval pays back, and intervals until the next look
 * whether it is still so; every time that it is, so many times as long, and fewer tries to see it.
 */
static const double OWED = 800.0, PAID = 100.0, ROUGH = 20.0, AGAIN = 4.0, NEARLY = 0.9;

/* The shortest step for the sake of a torque that jumps all the time; never one in which a stretch
 * wave runs through more than a sixtieth of the belt. */
static double grain(const bd_stepper *stepper) {
  double most = fmin(stepper->opaque.interval / 25.0, bd_round_time(stepper->model) / 60.0);
  return bd_stepper_longest(stepper, most);
}

/* The torque of pulley j has jumped: owed are the short tries since it did so last. */
static void count_jump(bd_stepper *stepper, int j, double change) {
  bd_opaque *opaque = &stepper->opaque;
  const double least = grain(stepper);
  double paid = PAID * fmax(0.0, stepper->t - opaque->t_owed) / opaque->interval;
  opaque->owed = fmax(0.0, opaque->owed - paid) + (double)opaque->short_tries;
  opaque->short_tries = 0;
  opaque->t_owed = fmax(opaque->t_owed, stepper->t);
  opaque->jump = fmax(opaque->jump, meaning(stepper, j, change, 1.0));
  if (opaque->owed < OWED || stepper->t < opaque->rough_until) {
    return;
  }
  opaque->rough_for = fmax(ROUGH * opaque->interval, AGAIN * opaque->rough_for);
  opaque->t_owed = opaque->rough_until = stepper->t + opaque->rough_for;
  opaque->owed = NEARLY * OWED;
  bd_warn(&stepper->report, BD_WARN_rough_torque, stepper->t, -1, j,
          "the torque function of pulley %d jumps all the time (noise, a relay, a staircase), by "
          "%.3g N m round t = %.6g s: it is followed in steps of %.2g s, each worth %.2g rad/s, "
          "and no closer; let it change over a range of time or speed, or name its jumps in "
          "breakpoints",
          j, fabs(change), stepper->t, least, fabs(change) * least / stepper->model->inertia[j]);
}

/* The torques of a try into the range of the present stretch, as long as the shortest step; a
 * smooth torque changes over a short step by a part of what it changes over such a stretch. */
static void widen(bd_stepper *stepper, const double *low, const double *high) {
  bd_opaque *opaque = &stepper->opaque;
  const int np = stepper->model->lay.np;
  int over = stepper->t >= opaque->t_range + grain(stepper);
  for (int j = 0; j < np; ++j) {
    if (over) {
      opaque->range[j] = opaque->ranges > 0 ? opaque->most[j] - opaque->least[j] : 0.0;
      opaque->least[j] = opaque->most[j] = low[j];
    }
    opaque->least[j] = fmin(opaque->least[j], low[j]);
    opaque->most[j] = fmax(opaque->most[j], high[j]);
  }
  opaque->t_range = over ? stepper->t : opaque->t_range;
  opaque->ranges += over;
}

/* Counts the torques that jump, by what would matter over the shortest step. */
static void count_changes(bd_stepper *stepper, const double *one, const double *other) {
  const bd_opaque *opaque = &stepper->opaque;
  const double tolerance = bd_method_tolerance(stepper->method, stepper->rtol),
               least = grain(stepper);
  for (int j = 0; opaque->ranges > 1 && j < stepper->model->lay.np; ++j) {
    double change = fabs(other[j] - one[j]);
    double range = fmax(opaque->range[j], opaque->most[j] - opaque->least[j]);
    if (meaning(stepper, j, change, least) > tolerance && change > 0.5 * range) {
      count_jump(stepper, j, change);
    }
  }
}

void bd_opaque_try(bd_stepper *stepper) {
  bd_torque_set *set = &stepper->plan.torques;
  set->watched = !set->smooth && !stepper->plan.pulleys_locked;
  for (int j = 0; set->watched && j < stepper->model->lay.np; ++j) {
    set->low[j] = set->high[j] = stepper->opaque.now[j];
  }
}

void bd_opaque_tried(bd_stepper *stepper, double h) {
  bd_torque_set *set = &stepper->plan.torques;
  const double least = grain(stepper);
  if (set->watched) {
    widen(stepper, set->low, set->high);
  }
  if (!set->watched || h > 1.1 * least) {
    set->watched = 0;
    return;
  }
  set->watched = 0;
  stepper->opaque.short_tries += h < 0.5 * least;
  count_changes(stepper, set->low, set->high);
}

double bd_opaque_least(const bd_stepper *stepper) {
  return stepper->t < stepper->opaque.rough_until ? grain(stepper) : 0.0;
}

double bd_opaque_allowance(const bd_stepper *stepper, double h) {
  return stepper->t < stepper->opaque.rough_until && h <= 1.1 * grain(stepper)
             ? 4.0 * h * stepper->opaque.jump
             : 0.0;
}

/* --- a step, and its samples ----------------------------------------------------------------- */

int bd_opaque_check(bd_stepper *stepper, double h, double t_new, double tolerance, double *shrink) {
  enum { FIRST = 8, MOST = 4096 };
  bd_opaque *opaque = &stepper->opaque;
  int code = BD_OK, wrong = 0;
  *shrink = 1.0;
  if (stepper->plan.torques.smooth || stepper->plan.pulleys_locked) {
    return BD_OK;
  }
  if (stepper->now->implicit) {
    code = contradicted(stepper, h, t_new, fmin(tolerance, 1.0), &wrong);
  }
  if (wrong) {
    opaque->next_left_out = opaque->next_left_out ? 2 * opaque->next_left_out : FIRST;
    opaque->next_left_out = opaque->next_left_out < MOST ? opaque->next_left_out : MOST;
    opaque->left_out = opaque->next_left_out;
    stepper->jacobian_known = 0;
    *shrink = 0.5;
  } else if (code == BD_OK && h > opaque->interval) {
    code = look_along(stepper, h, fmin(tolerance, 1.0), shrink);
  }
  return code;
}

void bd_opaque_began(bd_stepper *stepper) {
  memcpy(stepper->opaque.now, stepper->plan.torque,
         (size_t)stepper->model->lay.np * sizeof(double));
}

void bd_opaque_keep(bd_stepper *stepper, double h) {
  double *spare = stepper->opaque.last;
  stepper->opaque.last = stepper->opaque.now;
  stepper->opaque.now = spare;
  bd_opaque_began(stepper);
  if (!stepper->plan.torques.smooth && h <= 1.1 * grain(stepper)) {
    count_changes(stepper, stepper->opaque.last, stepper->opaque.now);
  }
}

int bd_opaque_jumps(const bd_stepper *stepper) {
  const bd_opaque *opaque = &stepper->opaque;
  double tolerance = bd_method_tolerance(stepper->method, stepper->rtol);
  for (int j = 0; !stepper->plan.torques.smooth && j < stepper->model->lay.np; ++j) {
    if (meaning(stepper, j, opaque->now[j] - opaque->last[j], stepper->h) > 0.1 * tolerance) {
      return j;
    }
  }
  return -1;
}

void bd_opaque_sampled(bd_stepper *stepper, double t, double h) {
  const bd_layout *lay = &stepper->model->lay;
  const bd_torque_set *set = &stepper->plan.torques;
  const bd_opaque *opaque = &stepper->opaque;
  for (int j = 0; j < lay->np; ++j) {
    double torque = stepper->plan.torque[j];
    double low = fmin(set->low[j], opaque->now[j]), high = fmax(set->high[j], opaque->now[j]);
    double beyond = fmax(low - torque, torque - high);
    double scale = fmax(fabs(stepper->y[lay->omega + j]), 1.0 / stepper->weights[lay->omega + j]);
    if (beyond * h / stepper->model->inertia[j] > 0.02 * scale) {
      bd_warn(&stepper->report, BD_WARN_torque, t, -1, j,
              "the torque function gives %.4g N m on pulley %d at t = %.9g s, where the step "
              "round it saw %.4g to %.4g N m: it changes faster than steps of %.3g s follow; "
              "name the times of its jumps in breakpoints, or take a smaller max_step",
              torque, j, t, low, high, h);
    }
  }
}
