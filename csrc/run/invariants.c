/* SPDX-License-Identifier: MIT
 *
 * What holds of every accepted state, whatever the drive, the tolerance and the method. One pass at
 * the end of a run, and after every step where BD_CHECK_STEPS is defined (BELTDYN_DEBUG=1):
 *
 *   numbers    are finite, the works among them
 *   friction   a state is within the bound of its law, belongs to the pulley that the link touches,
 *              and is 0 where it touches none (MODEL section 4); that of a mount is within 1
 *   contact    normal forces do not pull; links that touch a pulley are on its list
 *   forces     mass times acceleration of all links is what pulleys and gravity exert: joints
 *              cancel. Torques of friction and forces on mounts are those of the same contact
 *   losses     no damper gives power; since the start it has lost energy, not gained it
 *
 * Joints, winding and the balance of energy have bounds of their own, in guards.c. These here are
 * exact, or bounded by rounding: accelerations come from the kernels, the forces they are compared
 * with from the code of the outputs, so that one would show what the other does wrong. A state that
 * breaks one of them is no inaccurate result but a wrong one.
 */
#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#include "run/run.h"

static int broken(bd_sim *sim, const char *field, int body, int pulley, double value,
                  const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 6, 7)))
#endif
    ;

static int broken(bd_sim *sim, const char *field, int body, int pulley, double value,
                  const char *format, ...) {
  char what[256];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(what, sizeof what, format, arguments);
  va_end(arguments);
  return bd_fail_at(&sim->stepper.report.failure, BD_ERR_INVARIANT, field, sim->stepper.t, body,
                    pulley, value,
                    "%s at t = %.9g s, which no drive does: results are wrong by an error of the "
                    "program, please report it with the scene; another method may do without it",
                    what, sim->stepper.t);
}

/* value, which must not be above bound: BD_OK, and the worst is kept. */
static int within(bd_sim *sim, double value, double bound) {
  const double share = value > 0.0 || isnan(value) ? value / fmax(bound, DBL_MIN) : 0.0;
  if (!(share <= 1.0)) {
    return 0;
  }
  sim->stats.invariant = fmax(sim->stats.invariant, share);
  return 1;
}

int bd_invariants_numbers(bd_sim *sim) {
  const bd_layout *lay = &sim->stepper.model->lay;
  const double *y = sim->stepper.y;
  int body, pulley;
  const char *name = bd_state_bad(lay, y, &body, &pulley);
  if (name) {
    return broken(sim, name, body, pulley, (double)NAN, "%s is not finite", name);
  }
  for (int k = 0; k < lay->n_work; ++k) {
    if (!isfinite(y[lay->work + k])) { /* products overflow before the state does */
      return bd_fail_at(&sim->stepper.report.failure, BD_ERR_NOT_FINITE, "energy", sim->stepper.t,
                        -1, -1, y[lay->work + k],
                        "the works of the energy ledger are not finite at t = %.9g s: look for "
                        "parameters, speeds or torques far out of scale",
                        sim->stepper.t);
    }
  }
  return BD_OK;
}

/* Of link i in a friction slot, which touches pulley j (-1: none). */
static int check_link(bd_sim *sim, int slot, int i, int j) {
  const bd_plan *plan = &sim->stepper.plan;
  const bd_layout *lay = &plan->model->lay;
  const double *states = bd_cfield(lay, sim->stepper.y, bd_f_state(lay, slot)) + i;
  const double slip = bd_cfield(lay, sim->stepper.y, bd_f_slip(lay, slot))[i];
  for (int e = 0; e < lay->states; ++e) {
    const bd_contact_pulley *pulley = j >= 0 ? &plan->contact_pulleys[j] : NULL;
    const double bound = pulley && e < pulley->states ? pulley->bound : 0.0;
    const double z = states[e * lay->stride];
    if (!(fabs(z) <= bound)) {
      return broken(sim, "mu", i, j, z, "the friction state of link %d is %.9g, where %.9g is most",
                    i, z, bound);
    }
  }
  return j >= 0 || slip == 0.0
             ? BD_OK
             : broken(sim, "slip", i, j, slip,
                      "the slip of link %d, which touches no pulley, is %.9g m", i, slip);
}

static int is_listed(const bd_search *search, int j, int i) {
  const bd_run *runs = search->runs + j * search->max_runs;
  for (int r = 0; r < search->n_runs[j]; ++r) {
    if (i >= runs[r].begin && i < runs[r].end) {
      return 1;
    }
  }
  return 0;
}

/* Which links touch pulley j, against what the run has noted of them. */
static int check_touch(bd_sim *sim, int j) {
  const double RIM = 1e-9; /* over the radius: rounding where a link is on the rim */
  const bd_plan *plan = &sim->stepper.plan;
  const bd_layout *lay = &plan->model->lay;
  const bd_contact_pulley *pulley = &plan->contact_pulleys[j];
  const double *squared = bd_plan_distances(plan, sim->stepper.y, j);
  const double *owner = plan->owner + pulley->slot * lay->n8;
  for (int i = 0; i < lay->n; ++i) {
    const double depth = 1.0 - sqrt(squared[i]) / pulley->radius;
    if (depth > RIM && !is_listed(&plan->search, j, i)) {
      return broken(sim, "contact", i, j, depth, "link %d touches %s unseen", i,
                    bd_pulley_label(plan->model, j).text);
    }
    if (pulley->law != BD_LAW_NONE &&
        ((depth > RIM && owner[i] != j) || (depth < -RIM && owner[i] == j))) {
      return broken(sim, "contact", i, j, depth, "link %d %s %s, and friction has not noticed", i,
                    depth > 0.0 ? "touches" : "has left", bd_pulley_label(plan->model, j).text);
    }
  }
  return BD_OK;
}

static int check_friction(bd_sim *sim) {
  const bd_plan *plan = &sim->stepper.plan;
  const bd_layout *lay = &plan->model->lay;
  int code = BD_OK;
  bd_plan_see(plan, sim->stepper.y);
  for (int j = 0; code == BD_OK && j < lay->np; ++j) {
    code = check_touch(sim, j);
  }
  for (int s = 0; s < lay->slots; ++s) {
    for (int i = 0; code == BD_OK && i < lay->n; ++i) {
      code = check_link(sim, s, i, (int)plan->owner[s * lay->n8 + i]);
    }
  }
  for (int m = 0; code == BD_OK && m < lay->nm; ++m) {
    const double share = sim->stepper.y[lay->mount_friction + m];
    if (!(fabs(share) <= 1.0)) {
      code = broken(sim, "mount_friction", -1, lay->mounted[m], share,
                    "friction of the mount of %s is %.9g of what it can be",
                    bd_pulley_label(plan->model, lay->mounted[m]).text, share);
    }
  }
  return code;
}

/* What rounding does to the sum of n terms of this magnitude, each of some 60 operations. */
static double of_sum(int n, double magnitude) {
  return (n + 64.0) * DBL_EPSILON * magnitude;
}

/* The contact of pulley j as outputs have it, against that of the rate; its force is taken from
 * `sum`. */
static int check_pulley(bd_sim *sim, int j, double sum[2], bd_contact_rounding *all) {
  const bd_plan *plan = &sim->stepper.plan;
  const bd_model *model = plan->model;
  const int m = model->mount_of ? model->mount_of[j] : -1;
  double force[2];
  const double torque = bd_friction_torque(plan, sim->stepper.y, j, force);
  const bd_contact_rounding here = bd_contact_rounding_of(plan, sim->stepper.y, j);
  const double bound = of_sum(model->lay.n, here.magnitude) + here.shift;
  const double off = fabs(torque - plan->friction[j]) / plan->contact_pulleys[j].radius;
  const double pushed =
      m >= 0 ? fabs(plan->hub[2 * m] + force[0]) + fabs(plan->hub[2 * m + 1] + force[1]) : 0.0;
  all->magnitude += here.magnitude;
  all->shift += here.shift;
  sum[0] -= force[0];
  sum[1] -= force[1];
  if (!(here.least_normal >= 0.0)) {
    return broken(sim, "normal", here.least, j, here.least_normal,
                  "%s pulls at link %d with %.9g N", bd_pulley_label(model, j).text, here.least,
                  here.least_normal);
  }
  if (!within(sim, off, bound) || !within(sim, pushed, 2.0 * bound)) {
    return broken(
        sim, "contact", -1, j, fmax(off, pushed),
        "belt and %s exert forces on each other that differ by %.3g N, rounding by %.3g N",
        bd_pulley_label(model, j).text, fmax(off, pushed), bound);
  }
  return BD_OK;
}

/* dy: the rate of the belt. */
static int check_forces(bd_sim *sim, const double *dy) {
  const bd_plan *plan = &sim->stepper.plan;
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const double m = model->info.link_mass;
  const double *ax = bd_cfield(lay, dy, F_VX), *ay = bd_cfield(lay, dy, F_VY);
  double sum[2] = {0.0, 0.0};
  const bd_joint *joints = bd_joints(plan, sim->stepper.y, 0);
  bd_contact_rounding all = {0};
  for (int i = 0; i < lay->n; ++i) {
    sum[0] += m * (ax[i] - model->gravity[0]);
    sum[1] += m * (ay[i] - model->gravity[1]);
    all.magnitude +=
        m * (fabs(ax[i]) + fabs(ay[i]) + fabs(model->gravity[0]) + fabs(model->gravity[1])) +
        fabs(bd_joint_force(plan, &joints[i]));
  }
  for (int j = 0; j < lay->np; ++j) {
    const int code = check_pulley(sim, j, sum, &all);
    if (code != BD_OK) {
      return code;
    }
  }
  const double off = fabs(sum[0]) + fabs(sum[1]);
  const double bound = 2.0 * (of_sum(lay->n, all.magnitude) + all.shift);
  return within(sim, off, bound)
             ? BD_OK
             : broken(sim, "force", -1, -1, off,
                      "%.3g N of the forces on the belt come from nowhere, of rounding %.3g N", off,
                      bound);
}

/* Friction of mounts may give back what it stored: of a state that goes from 1 to 0 along Dahl's
 * curve (1 - ln 2) / adapts times the friction. */
static double given_back(const bd_model *model) {
  double sum = 0.0;
  for (int m = 0; m < model->lay.nm; ++m) {
    const bd_mounted *mount = &model->mounts[m];
    sum += mount->friction > 0.0 ? (1.0 - log(2.0)) * mount->friction / mount->adapts : 0.0;
  }
  return sum;
}

/* dy: the rate of the belt. Powers are sums of squares, but for the rounding of contact's elastic
 * force; what was lost since the start is as good as the balance of energy, and a matter of it. */
static int check_losses(bd_sim *sim, const double *dy) {
  const bd_plan *plan = &sim->stepper.plan;
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  double elastic = 0.0;
  for (int j = 0; j < lay->np; ++j) {
    elastic += bd_contact_rounding_of(plan, sim->stepper.y, j).magnitude;
  }
  const double speed = sqrt(plan->kernels->fastest(lay, sim->stepper.y));
  for (int k = 0; k < 2 * plan->n_effects; ++k) {
    const bd_work *work = &plan->effects[k / 2]->works[k % 2];
    if (!work->given) {
      continue;
    }
    const double gained = -sim->stepper.y[lay->work + work->row];
    const double power = work->never ? -dy[lay->work + work->row] : 0.0;
    if (!within(sim, power, of_sum(lay->n, elastic * speed))) {
      return broken(sim, work->name, -1, -1, -power, "dampers of %s give %.3g W", work->name,
                    power);
    }
    if (!within(sim, gained, BD_MOST_BALANCE * bd_guard_energy(sim) + given_back(model))) {
      return bd_guard_out_of_balance(sim, work->name, -gained, work->given);
    }
  }
  return BD_OK;
}

int bd_invariants_check(bd_sim *sim) {
  bd_stepper *stepper = &sim->stepper;
  double *dy = stepper->y_mid;
  int code = check_friction(sim);
  if (code == BD_OK) {
    bd_mounts_put(&stepper->plan, stepper->y);
    code =
        bd_plan_rate_of_belt(&stepper->plan, stepper->t, stepper->y, dy, &stepper->report.failure);
  }
  if (code == BD_OK) {
    code = check_forces(sim, dy);
  }
  return code == BD_OK ? check_losses(sim, dy) : code;
}
