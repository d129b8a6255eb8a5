/* SPDX-License-Identifier: MIT
 *
 * What every run is watched for, whatever was asked of it. Now and then, and at the end, one pass
 * over links and pulleys at a state whose rate was the last to be evaluated:
 *
 *   joints that gape          the belt would have torn, or the numbers have
 *   winding round a pulley    the belt has left it, or was never laid round it
 *   contact with a pulley     a pulley between two links touches none
 *   balance of energy         E(t) - E(0) - work: 0 but for the error of integration (MODEL
 *                             section 7); it needs no reference, and no ledger was asked for it
 *   progress                  steps so short that the end is out of reach
 *
 * What cannot be a belt drive any more ends the run; what may still be one is a warning by name.
 */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "run/run.h"

/* Between two looks: steps, and the part of the run. A look costs as much as one to two steps. */
enum { STEPS = 256, PARTS = 64 };

void bd_guard_carve(bd_carver *carver, bd_guard *guard, int np) {
  BD_KEEP_SPAN(carver, guard, fed, bounces);
  BD_KEEP(carver, guard->touched, np);
}

int bd_guard_winding(const bd_plan *plan, const double *y, bd_error *err, double t) {
  const bd_model *model = plan->model;
  bd_mounts_put(plan, y);
  for (int j = 0; j < model->lay.np; ++j) {
    const int turns = model->belt_model->turns(plan, y, j);
    if (turns != model->winding[j]) {
      return bd_fail_at(err, BD_ERR_OFF_PULLEY, "contact", t, -1, j, turns,
                        "the belt no longer runs round %s by t = %.9g s: %s",
                        bd_pulley_label(model, j).text, t,
                        2.0 * model->info.link_length > model->radius[j]
                            ? "its links are too long for this radius, raise belt.n_bodies"
                            : "it has come off, for want of tension, or pushed through by more "
                              "force than the contact can hold: tension it more, or look for a "
                              "torque or a speed out of scale");
    }
  }
  return BD_OK;
}

/* A joint's stretch as a vector against the length of a link; *link: its right one. */
static double widest_gap(const bd_plan *plan, const bd_joint *joints, int *link) {
  double widest = 0.0;
  *link = 0;
  for (int i = 0; i < plan->model->lay.n; ++i) {
    *link = joints[i].squared > widest ? i : *link;
    widest = fmax(widest, joints[i].squared);
  }
  return sqrt(widest) / plan->model->info.link_length;
}

/* Cells hold all of a belt, and none holds nothing. */
static int check_cells(const bd_plan *plan, const double *y, bd_error *err, double t) {
  const double ROUNDING = 1e-9;
  const bd_layout *lay = &plan->model->lay;
  const double *m = bd_find_field(lay, y, F_M), length = plan->model->belt.length;
  double sum = 0.0;
  for (int c = 0; m && c < lay->n; ++c) {
    sum += m[c];
    if (!(m[c] > 0.0)) {
      return bd_fail_at(err, BD_ERR_STATE, "initial", t, c, -1, m[c],
                        "the initial state has %g m of belt in cell %d, which must be > 0", m[c],
                        c);
    }
  }
  if (m && !(fabs(sum - length) <= ROUNDING * length)) {
    return bd_fail_at(err, BD_ERR_STATE, "initial", t, -1, -1, sum,
                      "the initial state does not belong to this belt: its cells hold %.10g m of "
                      "it, of %.10g m",
                      sum, length);
  }
  return BD_OK;
}

int bd_guard_initial(const bd_plan *plan, const double *y, bd_error *err, double t) {
  int link;
  BD_TRY(check_cells(plan, y, err, t));
  const double gap = widest_gap(plan, bd_joints(plan, y, 0), &link);
  if (gap > 1.0) {
    return bd_fail_at(
        err, BD_ERR_STATE, "initial", t, link, -1, gap,
        "the initial state does not belong to this belt: the joint on the left of "
        "link %d is stretched by %.3g times a link's length; x, y and phi must belong together",
        link, gap);
  }
  bd_error off;
  if (bd_guard_winding(plan, y, &off, t) != BD_OK) {
    return bd_fail_at(
        err, BD_ERR_STATE, "initial", t, -1, off.pulley, off.value,
        "the initial state does not belong to this drive: its belt does not run round "
        "%s in the direction of its links",
        bd_pulley_label(plan->model, off.pulley).text);
  }
  return BD_OK;
}

/* Stored energy (MODEL section 7), with the directions of the links as last evaluated; the widest
 * joint; and when each pulley was last touched. */
static double survey(bd_sim *sim, double *gap, int *link) {
  const bd_plan *plan = &sim->stepper.plan;
  const bd_joint *joints = bd_joints(plan, sim->stepper.y, 1);
  double terms[BD_N_ENERGY];
  const double energy =
      bd_energy(plan, sim->stepper.t, sim->stepper.y, joints, sim->guard.touched, terms);
  *gap = widest_gap(plan, joints, link);
  return energy;
}

static int check_joints(bd_sim *sim, double gap, int link) {
  const double strain = sim->stepper.model->info.strain;
  if (gap > 1.0) {
    return BD_FAIL(sim, BD_ERR_JOINT_GAP, "joints", link, -1, gap,
                   "the joint on the left of link %d is stretched by %.3g times a link's length at "
                   "t = %.9g s, which no belt stretches: %s",
                   link, gap, sim->stepper.t,
                   sim->stepper.fixed
                       ? "take a shorter step or an adaptive method, or look for a "
                         "torque or a speed out of scale"
                       : "look for a torque or a speed out of scale, or for a load of the wrong "
                         "sign (its torque is opposite to omega)");
  }
  if (gap > fmax(0.1, 3.0 * strain)) {
    BD_WARN(sim, BD_WARN_stretch, sim->stepper.t, link, -1,
            "a joint is stretched by %.3g %% of a link at t = %.6g s, %.2g %% at rest: few "
            "belts bear that, and none is linear up to there",
            100.0 * gap, sim->stepper.t, 100.0 * strain);
  }
  return BD_OK;
}

/* Energy that passed so far: fed in, lost or stored, whichever is more; and, for drives in which
 * hardly anything happens, a twentieth of what preload holds: 2 % of that is 0.05 % of the tension;
 * more where tensions may be off by more than a fortieth, which is twice as much of their energy.
 */
double bd_guard_energy(const bd_sim *sim) {
  const double share = fmax(0.05, 2.0 * sim->stepper.rtol);
  const bd_model *model = sim->stepper.model;
  const double strain = model->geometry.code == BD_OK ? model->info.strain : 0.0;
  const double preload = 0.5 * model->belt.axial_stiffness * strain * strain * model->belt.length;
  return sim->guard.passed + share * preload + 1e-12 * fabs(sim->e0);
}

int bd_guard_out_of_balance(bd_sim *sim, const char *field, double energy, const char *what) {
  return BD_FAIL(sim, BD_ERR_BALANCE, field, -1, -1, energy,
                 "%s %.3g J by t = %.9g s, where %.3g J passed through the drive: %s", what,
                 fabs(energy), sim->stepper.t, sim->guard.passed,
                 sim->stepper.fixed
                     ? "the fixed step is too long, take a shorter one or an adaptive method"
                     : "take a tighter rtol or another method");
}

static int check_balance(bd_sim *sim, double energy) {
  bd_guard *guard = &sim->guard;
  const double *work = sim->stepper.y + sim->stepper.model->lay.work;
  double losses = bd_losses(&sim->stepper.model->lay, sim->stepper.y);
  double residual = energy - sim->e0 - (work[W_drive] - losses);
  guard->fed += fmax(0.0, work[W_drive] - guard->drive);
  guard->drive = work[W_drive];
  guard->passed = fmax(guard->passed, fmax(guard->fed, fmax(losses, fabs(energy - sim->e0))));
  double share = residual / bd_guard_energy(sim);
  /* without a ledger power is summed by the trapezoidal rule, which is off by as much as 8 % */
  const double most = sim->stepper.plan.ledger ? 0.02 : 0.15;
  sim->stats.balance = fabs(share) > fabs(sim->stats.balance) ? share : sim->stats.balance;
  /* the work of a torque that jumps all the time is known no better than the torque */
  if (!(share <= BD_MOST_BALANCE) && !sim->stepper.report.warned[BD_WARN_rough_torque].message[0]) {
    return bd_guard_out_of_balance(sim, "energy", residual, "the integration has added");
  }
  /* and needs no second warning */
  if (fabs(share) > most && !sim->stepper.report.warned[BD_WARN_rough_torque].message[0]) {
    BD_WARN(sim, BD_WARN_balance, sim->stepper.t, -1, -1,
            "%.3g J, %.*g %% of the energy that passed through the drive, %s by t = %.6g s: "
            "take %s, or compare with another method",
            fabs(residual), fabs(share) < 0.0995 ? 2 : 3, 100.0 * fabs(share),
            residual < 0.0 ? "have been lost by the integration"
                           : "have been added by the integration",
            sim->stepper.t, sim->stepper.fixed ? "a shorter step" : "a tighter rtol");
  }
  return BD_OK;
}

/* A pulley that no link has touched for ten rounds of a wave. */
static void check_contact(bd_sim *sim) {
  for (int j = 0; j < sim->stepper.model->lay.np; ++j) {
    double since = sim->stepper.t - sim->guard.touched[j];
    if (since > 10.0 * bd_round_time(sim->stepper.model)) {
      BD_WARN(sim, BD_WARN_no_contact, sim->guard.touched[j], -1, j,
              "no link touches %s from t = %.6g s to %.6g s: the belt is slack there, or "
              "its links are too long for that pulley (raise belt.n_bodies)",
              bd_pulley_label(sim->stepper.model, j).text, sim->guard.touched[j], sim->stepper.t);
    }
  }
}

void bd_guard_begin(bd_sim *sim) {
  bd_guard *guard = &sim->guard;
  guard->t_look = guard->t_window = sim->twin.t_events = sim->stepper.t;
  for (int j = 0; j < sim->stepper.model->lay.np; ++j) {
    guard->touched[j] = sim->stepper.t;
    sim->twin.theta[j] = sim->stepper.y[sim->stepper.model->lay.theta + j];
  }
}

/* Warns of fixed steps with errors above half the tension, and of inaccurate steps that only the
 * method of first order could make. */
static void check_steps(bd_sim *sim) {
  const double error = sim->stats.local_error;
  if (sim->stepper.fixed && error > 0.5) {
    const bd_method *method = sim->stepper.method;
    BD_WARN(sim, BD_WARN_fixed_step, sim->stepper.t, -1, -1,
            "steps of %.3g s have errors of up to %.2g of the tension%s, seen by t = %.6g s: take "
            "a shorter step, or leave step out and ask for an rtol",
            sim->options.step > 0.0 ? sim->options.step : sim->stepper.h, error,
            method->error_order > method->order ? "" : ", by a formula of lower order than theirs",
            sim->stepper.t);
  }
  if (!sim->stepper.fixed && sim->stats.fallbacks > 0 && error > 5.0 * sim->stepper.rtol) {
    BD_WARN(
        sim, BD_WARN_fallback, sim->stepper.t, -1, -1,
        "%ld steps could only be made by the method of first order, with an error of %.2g where "
        "%.2g was asked, seen by t = %.6g s: look for a jump or a stiffness out of scale",
        sim->stats.fallbacks, error, sim->stepper.rtol, sim->stepper.t);
  }
}

/* By how much local errors add up. A vibration that steps follow, of about a radian in each, keeps
 * them for 2 EA h / d steps of h under the axial damping d, in which they make a random walk. Not
 * all of them go into it: a third bounds what came out on the plain drive of the tests without
 * damping, 1 to 85 times the local error in 1400 to 46 000 steps, as it ran up or was shaken. */
double bd_guard_adds_up(const bd_sim *sim) {
  const double SHARE = 1.0 / 3.0, steps = (double)sim->stats.steps;
  const bd_belt *belt = &sim->stepper.model->belt;
  const double step = (sim->stepper.t - sim->t0) / fmax(1.0, steps);
  const double kept = belt->axial_damping > 0.0
                          ? 2.0 * belt->axial_stiffness * step / belt->axial_damping
                          : (double)INFINITY;
  return SHARE * sqrt(fmin(steps, kept));
}

/* Said where claims are of another order than what was asked. */
static void check_damping(bd_sim *sim) {
  const double MANY = 20.0, adds_up = bd_guard_adds_up(sim);
  if (sim->stepper.fixed || adds_up <= MANY) {
    return;
  }
  BD_WARN(sim, BD_WARN_undamped, (double)NAN, -1, -1,
          "vibrations along the belt hardly decay, so that errors of steps add up, to some %.0f "
          "times what was asked (stats.error): take a tighter rtol, or more axial_damping",
          adds_up);
}

/* Links ring on their contact where they land, at sqrt(c / rho A). Long implicit steps damp that
 * within a step, and the friction that ringing takes away is missed: span means of a drive came out
 * off by 12 % at 0.3 %, 4 % at 6 % and nothing at 10 % of critical damping (tests/test_guards.py).
 * The kinks of contact of the links' centres do not let steps become so long. */
static void check_contact_damping(bd_sim *sim) {
  const double LEAST = 0.15, ALLOWED = 1.0; /* of critical damping; step times frequency */
  enum { LANDED = 3 };                      /* links, on each pulley: fewer change no tension */
  const bd_model *model = sim->stepper.model;
  const bd_contact *contact = &model->contact;
  double smallest = model->radius[0];
  for (int j = 1; j < model->lay.np; ++j) {
    smallest = fmin(smallest, model->radius[j]);
  }
  const double pressure = fmax(0.0, model->info.strain_tension) / smallest;
  const double stiffness = bd_contact_stiffness(contact->quadratic, contact->linear, pressure);
  const double damping = bd_contact_damping(model, contact->damping, pressure);
  const double density = model->belt.linear_density, critical = 2.0 * sqrt(stiffness * density);
  if (!model->belt_model->facts.smooth || !sim->stepper.method->implicit ||
      sim->stepper.plan.contacts_changed < 2 * LANDED * (long)model->lay.np ||
      damping >= LEAST * critical ||
      sim->stats.largest_step * sqrt(stiffness / density) < ALLOWED) {
    return;
  }
  sim->guard.rings = 1;
  BD_WARN(
      sim, BD_WARN_undamped, (double)NAN, -1, -1,
      "links that come to a pulley vibrate on its contact with %.2g of critical damping, which "
      "steps of %s, up to %.2g s, are too long to follow, so friction and tensions may be off by "
      "several percent: compare with method=\"tsit5\", or give contact.damping >= %.3g N s/m^2",
      damping / critical, sim->stepper.method->name, sim->stats.largest_step, LEAST * critical);
}

int bd_guard_look(bd_sim *sim, int now) {
  bd_guard *guard = &sim->guard;
  if (!now && sim->stats.steps - guard->steps_look < STEPS &&
      sim->stepper.t - guard->t_look < (sim->t_end - sim->t0) / PARTS) {
    return BD_OK;
  }
  guard->t_look = sim->stepper.t;
  guard->steps_look = sim->stats.steps;
  int link;
  double gap, energy = survey(sim, &gap, &link);
  int code = now ? bd_invariants_numbers(sim) : BD_OK;
  if (code == BD_OK) {
    code = check_joints(sim, gap, link);
  }
  if (code == BD_OK) {
    code = bd_guard_winding(&sim->stepper.plan, sim->stepper.y, &sim->stepper.report.failure,
                            sim->stepper.t);
  }
  if (code == BD_OK) {
    code = check_balance(sim, energy);
  }
  check_contact(sim);
  check_steps(sim);
  check_damping(sim);
  check_contact_damping(sim);
  return code == BD_OK && now ? bd_invariants_check(sim) : code;
}

int bd_guard_check(bd_sim *sim) {
  const bd_plan *plan = &sim->stepper.plan;
  int link;
  BD_TRY(bd_invariants_numbers(sim));
  const double gap = widest_gap(plan, bd_joints(plan, sim->stepper.y, 0), &link);
  BD_TRY(gap > 1.0 ? check_joints(sim, gap, link) : BD_OK);
  BD_TRY(bd_guard_winding(plan, sim->stepper.y, &sim->stepper.report.failure, sim->stepper.t));
  return bd_invariants_check(sim);
}

/* --- progress -------------------------------------------------------------------------------- */

/* Tries between two checks. A run stalls if it needs more than A_ROUND tries (the paper's drive
 * takes 64, one that chatters 700), plus ten times those of an explicit method limited by the
 * joints, while a wave runs once round the belt, and TO_GO steps remain; or more than the ANY_CAUSE
 * limits in any case. */
static const long WINDOW = 20000;
static const double A_ROUND = 20000.0, TO_GO = 1e6, ANY_CAUSE_ROUND = 40000.0,
                    ANY_CAUSE_TO_GO = 1e7;

/* Tries in which the explicit method spans the same, if it is held by the joints alone. */
static double explicit_round(const bd_sim *sim) {
  double stability = sim->stepper.method->implicit ? 0.0 : sim->stepper.method->stability;
  return stability > 0.0 ? bd_round_time(sim->stepper.model) *
                               sim->stepper.model->info.spectral_bound / stability
                         : 0.0;
}

/* What asks for such steps, and what to try. */
static void explain_short_steps(const bd_sim *sim, double mean_step, char *text, size_t size,
                                int *pulley) {
  bd_stiffness stiff = bd_stiffness_of(sim->stepper.model, &sim->stepper.plan.torques);
  const double joints = sim->stepper.model->info.spectral_bound;
  const char *what = NULL;
  int asked = 0; /* by the tolerance */
  *pulley = bd_torque_functions_jumping(&sim->stepper);
  if (sim->stepper.max_step > 0.0 && mean_step > 0.5 * sim->stepper.max_step) {
    *pulley = -1;
    snprintf(text, size, "max_step = %.3g s is far below what the drive asks for",
             sim->stepper.max_step);
  } else if (sim->stepper.fixed && sim->options.step > 0.0) {
    *pulley = -1;
    snprintf(text, size, "step = %.3g s is far below what the drive asks for", sim->options.step);
  } else if (*pulley >= 0) {
    snprintf(
        text, size,
        "the torque function of %s jumps from step to step (a switch, a relay, noise); "
        "let it change over a range of time or speed, name its jumps in breakpoints, or loosen "
        "rtol",
        bd_pulley_label(sim->stepper.model, *pulley).text);
  } else if (stiff.bound > 3.0 * joints) {
    *pulley = stiff.pulley;
    what = stiff.what;
  } else if (!sim->stepper.plan.torques.smooth && mean_step * joints < 0.3) {
    what = "the torque function, which depends on angle or speed";
  } else if (sim->stepper.now->implicit) {
    asked = 1;
  } else {
    what = "the belt's joints";
  }
  const char *name = sim->stepper.now->name;
  const char *advice =
      strcmp(name, "lbdf2") == 0 || strcmp(name, "lie") == 0
          ? "loosen rtol, or look for parameters out of scale"
      : sim->stepper.now->implicit
          ? "loosen rtol, take method=\"lbdf2\", or look for parameters out of scale"
      : sim->choice.method[0] ? "take method=\"rodas4\" or \"lbdf2\", or loosen rtol"
                              : "take method=\"rodas4\", \"lbdf2\" or \"auto\", or loosen rtol";
  if (what) {
    snprintf(text, size, "the fastest motion is that of %s; %s", what, advice);
  } else if (asked) {
    snprintf(text, size, "the tolerance requires such short steps; %s", advice);
  }
}

int bd_guard_progress(bd_sim *sim) {
  bd_guard *guard = &sim->guard;
  long tries = sim->stats.steps + sim->stats.rejected, since = tries - guard->tries_window;
  if (since < WINDOW) {
    return BD_OK;
  }
  double gone = sim->stepper.t - guard->t_window, a_second = (double)since / fmax(gone, DBL_MIN);
  guard->t_window = sim->stepper.t;
  guard->tries_window = tries;
  double a_round = a_second * bd_round_time(sim->stepper.model),
         to_go = a_second * (sim->t_end - sim->stepper.t);
  /* Euler's method needs many steps for a tight tolerance, whatever the drive */
  double usual = sim->stepper.method->order == 1 ? 4.0 * A_ROUND : A_ROUND;
  int slow = a_round > usual + 10.0 * explicit_round(sim) && to_go > TO_GO;
  int endless = a_round > ANY_CAUSE_ROUND && to_go > ANY_CAUSE_TO_GO;
  /* "auto" has not tried its other method yet */
  int untried = sim->choice.method[0] && !(sim->choice.per_second[AUTO_IMPLICIT] > 0.0);
  if (sim->options.max_steps > 0 || untried || !(slow || endless) || bd_auto_leave_explicit(sim)) {
    return BD_OK;
  }
  char text[320];
  int pulley;
  explain_short_steps(sim, gone / (double)since, text, sizeof text, &pulley);
  return BD_FAIL(sim, BD_ERR_STALLED, "step", -1, pulley, gone,
                 "no progress at t = %.9g s: %ld steps covered %.3g s, the end is %.2g steps away; "
                 "%s (or set max_steps to go on all the same)",
                 sim->stepper.t, since, gone, to_go, text);
}
