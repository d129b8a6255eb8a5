/* SPDX-License-Identifier: MIT
 *
 * The plan of a simulation: which passes an evaluation of the right-hand side needs, made once from
 * the scene, and run in order. An effect that is off has no pass; a kernel variant without bending,
 * friction or ledger is a different function, not a test inside the loop.
 */
#include <assert.h>
#include <math.h>
#include <string.h>

#include "physics/physics.h"

/* --- passes ---------------------------------------------------------------------------------- */

static int pass_place(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)y, (void)dy, (void)err;
  bd_plan_place(plan, t);
  return BD_OK;
}

static int pass_joints(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  double loss = plan->kernels->joints[plan->bending_on][!plan->skip_power](&plan->links, y, dy);
  dy[plan->model->lay.work + W_JOINT] = loss;
  return BD_OK;
}

static int pass_gravity(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)y, (void)err;
  const bd_layout *lay = &plan->model->lay;
  double *ax = bd_field(lay, dy, F_VX), *ay = bd_field(lay, dy, F_VY);
  const double gx = plan->model->gravity[0], gy = plan->model->gravity[1];
  for (int i = 0; i < lay->n; ++i) {
    ax[i] += gx;
    ay[i] += gy;
  }
  return BD_OK;
}

static int pass_contact(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_layout *lay = &plan->model->lay;
  double contact_loss = 0.0, friction_loss = 0.0;
  for (int j = 0; j < lay->np; ++j) {
    bd_sums sums;
    plan->contact_pulleys[j].omega = y[lay->omega + j];
    plan->kernels->contact[plan->friction_on][!plan->skip_power](
        &plan->links, &plan->contact_pulleys[j], plan->search.n_runs[j],
        plan->search.runs + j * plan->search.max_runs, y, dy, &sums);
    plan->friction[j] = sums.torque;
    contact_loss += sums.contact_loss;
    friction_loss += sums.friction_loss;
  }
  dy[lay->work + W_CONTACT] = contact_loss;
  dy[lay->work + W_FRICTION] = friction_loss;
  return BD_OK;
}

/* (2.12), MODEL section 5 */
static int pass_pulleys(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  const bd_layout *lay = &plan->model->lay;
  const double *omega = y + lay->omega;
  int code = bd_torque_set_eval(&plan->torques, t, plan->t_piece, y + lay->theta, omega,
                                plan->torque, err);
  if (code != BD_OK) {
    return code;
  }
  double drive = 0.0;
  for (int j = 0; j < lay->np; ++j) {
    dy[lay->theta + j] = omega[j];
    dy[lay->omega + j] = (plan->torque[j] + plan->friction[j]) / plan->model->inertia[j];
    drive += plan->torque[j] * omega[j];
  }
  dy[lay->work + W_DRIVE] = drive;
  return BD_OK;
}

/* Settling only. Speed of circulation: of the belt along itself and of the pulleys that friction
 * turns with it; from the velocities in y, or from the accelerations if y is a rate. */
double bd_plan_circulation(const bd_plan *plan, const double *y) {
  const bd_layout *lay = &plan->model->lay;
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *co = plan->links.cos, *si = plan->links.sin;
  double sum = 0.0, mass = lay->n;
  for (int i = 0; i < lay->n; ++i) {
    sum += vx[i] * co[i] + vy[i] * si[i];
  }
  for (int j = 0; plan->friction_on && !plan->pulleys_locked && j < lay->np; ++j) {
    double r = plan->model->radius[j];
    double rim = plan->model->inertia[j] / (r * r * plan->model->info.link_mass);
    sum += rim * y[lay->omega + j] * r * plan->model->info.winding;
    mass += rim;
  }
  return sum / mass;
}

/* Settling only (dynamic relaxation): mass-proportional damping of every motion but circulation, in
 * which all links run along the belt at one speed v and turn at kappa v; circulation has a damping
 * and an inertia of its own. */
static int pass_mass_damping(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_layout *lay = &plan->model->lay;
  const int n = lay->n;
  const double *phi = bd_field(lay, y, F_PHI), *vphi = bd_field(lay, y, F_VPHI);
  const double *vx = bd_field(lay, y, F_VX), *vy = bd_field(lay, y, F_VY);
  const double *co = plan->links.cos, *si = plan->links.sin, wind = plan->links.wind;
  double *ax = bd_field(lay, dy, F_VX), *ay = bd_field(lay, dy, F_VY);
  double *aphi = bd_field(lay, dy, F_VPHI);
  const double mass_damping = plan->mass_damping, pitch = 4.0 * plan->links.half;
  const double circulation_correction =
      (mass_damping - plan->circulation_damping) * bd_plan_circulation(plan, y) +
      (plan->circulation_inertia_scale - 1.0) * bd_plan_circulation(plan, dy);
  for (int i = 0; i < n; ++i) {
    double turn = phi[i + 1 < n ? i + 1 : 0] - phi[i > 0 ? i - 1 : n - 1] +
                  (i == 0 || i + 1 == n ? wind : 0.0);
    ax[i] -= mass_damping * vx[i] - circulation_correction * co[i];
    ay[i] -= mass_damping * vy[i] - circulation_correction * si[i];
    aphi[i] -= mass_damping * vphi[i] - circulation_correction * turn / pitch;
  }
  for (int j = 0; !plan->pulleys_locked && j < lay->np; ++j) {
    double round = plan->friction_on ? plan->model->info.winding / plan->model->radius[j] : 0.0;
    dy[lay->omega + j] -= mass_damping * y[lay->omega + j] - circulation_correction * round;
  }
  return BD_OK;
}

/* --- making it ------------------------------------------------------------------------------- */

void bd_plan_carve(bd_carver *carver, bd_plan *plan, const bd_layout *lay) {
  bd_links *links = &plan->links;
  double *link_mask;
  BD_CARVE(carver, link_mask, lay->stride);
  links->link_mask = link_mask;
  double **const scratch[] = {&links->cos, &links->sin, &links->rx, &links->ry,
                              &links->fx,  &links->fy,  &plan->best};
  for (size_t k = 0; k < sizeof scratch / sizeof scratch[0]; ++k) {
    BD_CARVE(carver, *scratch[k], lay->stride);
    if (carver->base) {
      *scratch[k] += BD_HALO;
    }
  }
  for (int i = 0; carver->base && i < lay->n; ++i) {
    link_mask[i] = 1.0;
  }
  BD_CARVE(carver, plan->contact_pulleys, lay->np);
  BD_CARVE(carver, plan->owner, lay->n8 * lay->slots);
  BD_CARVE(carver, plan->torque, lay->np);
  BD_CARVE(carver, plan->friction, lay->np);
  bd_search_carve(carver, &plan->search, lay);
}

static void add_pass(bd_plan *plan, bd_pass pass, const char *name) {
  assert(plan->n_passes < BD_MAX_PASSES);
  plan->passes[plan->n_passes] = pass;
  plan->names[plan->n_passes++] = name;
}

void bd_plan_make(bd_plan *plan, const bd_model *model, const bd_plan_options *options) {
  const bd_info *info = &model->info;
  bd_links *links = &plan->links;
  plan->model = model;
  plan->kernels = model->kernels;
  plan->ledger = options->ledger != 0;
  plan->bending_on = model->has_bending;
  plan->friction_on = options->friction && model->has_friction;
  plan->mass_damping = options->mass_damping;
  plan->circulation_inertia_scale = 1.0;
  plan->pulleys_locked = options->hold_pulleys;
  plan->no_power = plan->skip_power = options->no_power;
  plan->offset = options->offset;
  plan->move_time = options->move_time;

  links->lay = model->lay;
  links->half = 0.5 * info->link_length;
  links->stiffness = info->joint_stiffness;
  links->damping = info->joint_damping;
  links->bending = info->bending_stiffness;
  links->bending_damping = info->bending_damping;
  links->inv_mass = 1.0 / info->link_mass;
  links->inv_inertia = 1.0 / info->link_inertia;
  links->wind = 2.0 * BD_PI * info->winding;
  for (int j = 0; j < model->lay.np; ++j) {
    plan->contact_pulleys[j] = (bd_contact_pulley){.x = model->cx[j],
                                                   .y = model->cy[j],
                                                   .radius = model->radius[j],
                                                   .quadratic = info->contact_quadratic,
                                                   .linear = info->contact_linear,
                                                   .damping = info->contact_damping,
                                                   .mu_k = model->dahl.mu_k,
                                                   .sigma = model->dahl.sigma,
                                                   .slot = model->slot[j]};
  }

  if (plan->offset) {
    add_pass(plan, pass_place, "moving centres");
  }
  add_pass(plan, pass_joints,
           plan->bending_on ? "joints: axial and bending spring-dampers"
                            : "joints: axial spring-dampers");
  if (model->has_gravity) {
    add_pass(plan, pass_gravity, "gravity");
  }
  add_pass(plan, pass_contact,
           plan->friction_on ? "contact with Dahl friction" : "contact without friction");
  if (!options->hold_pulleys) {
    add_pass(plan, pass_pulleys, "pulleys: set torques");
  }
  if (plan->mass_damping > 0.0) {
    add_pass(plan, pass_mass_damping, "mass-proportional damping");
  }
}

int bd_plan_rate(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  for (int k = 0; k < plan->n_passes; ++k) {
    int code = plan->passes[k](plan, t, y, dy, err);
    if (code != BD_OK) {
      return code;
    }
  }
  return BD_OK;
}

/* Smooth (quintic) motion of the centres from their offset to their place. */
void bd_plan_place(bd_plan *plan, double t) {
  double s = plan->move_time > 0.0 ? t / plan->move_time : 1.0;
  s = s < 0.0 ? 0.0 : s > 1.0 ? 1.0 : s;
  double left = 1.0 - s * s * s * (10.0 + s * (6.0 * s - 15.0));
  double speed =
      plan->move_time > 0.0 ? -30.0 * s * s * (1.0 - s) * (1.0 - s) / plan->move_time : 0.0;
  for (int j = 0; plan->offset && j < plan->model->lay.np; ++j) {
    bd_contact_pulley *pulley = &plan->contact_pulleys[j];
    pulley->x = plan->model->cx[j] + left * plan->offset[2 * j];
    pulley->y = plan->model->cy[j] + left * plan->offset[2 * j + 1];
    pulley->vx = speed * plan->offset[2 * j];
    pulley->vy = speed * plan->offset[2 * j + 1];
  }
}

/* --- after a step ---------------------------------------------------------------------------- */

/* Pulley whose friction state a slot stores: none; none any more since this step. */
enum { FREE = -1, RELEASED = -2 };

/* MODEL section 4: a link that touches no pulley has no friction state. */
static void reset_friction_state(const bd_layout *lay, double *y, int slot, double *owner,
                                 int begin, int end) {
  double *mu = bd_field(lay, y, F_MU + slot), *slip = bd_field(lay, y, bd_f_slip(lay) + slot);
  for (int i = begin; i < end; ++i) {
    mu[i] = owner[i] < 0 ? 0.0 : mu[i];
    slip[i] = owner[i] < 0 ? 0.0 : slip[i];
    owner[i] = owner[i] < 0 ? FREE : owner[i];
  }
}

void bd_plan_assign_contacts(bd_plan *plan, double *y) {
  const bd_layout *lay = &plan->model->lay;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  for (int k = 0; k < lay->n8 * lay->slots; ++k) {
    plan->owner[k] = FREE;
  }
  for (int j = 0; lay->slots > 0 && j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &plan->contact_pulleys[j];
    for (int i = 0; i < lay->n; ++i) {
      double dx = x[i] - pulley->x, dy = yy[i] - pulley->y;
      if (dx * dx + dy * dy < pulley->radius * pulley->radius) {
        plan->owner[pulley->slot * lay->n8 + i] = j;
      }
    }
  }
  for (int s = 0; s < lay->slots; ++s) {
    reset_friction_state(lay, y, s, plan->owner + s * lay->n8, 0, lay->n);
  }
}

/* One block of links at pulley j where something has happened. */
static int resolve_contact_events(bd_plan *plan, double t, double *y, int j, int begin,
                                  double tolerance, int *changed, bd_error *err) {
  const bd_layout *lay = &plan->model->lay;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const bd_contact_pulley *pulley = &plan->contact_pulleys[j];
  const double limit = pulley->mu_k, rim2 = pulley->radius * pulley->radius;
  double *mu = plan->friction_on ? bd_field(lay, y, F_MU + pulley->slot) : NULL;
  double *slip = plan->friction_on ? bd_field(lay, y, bd_f_slip(lay) + pulley->slot) : NULL;
  double *owner = plan->owner + pulley->slot * lay->n8;
  for (int i = begin; i < begin + BD_LANES && i < lay->n; ++i) {
    double dx = x[i] - pulley->x, dy = yy[i] - pulley->y;
    double rho2 = dx * dx + dy * dy;
    if (rho2 < 0.25 * rim2) {
      return bd_fail_at(err, BD_ERR_PASSED_THROUGH, "contact", t, i, j, sqrt(rho2),
                        "link %d sank past half the radius of pulley %d at t = %.9g s: the "
                        "contact is too soft for this tension, or a torque or a speed out of scale",
                        i, j, t);
    }
    if (!mu) {
      continue;
    }
    int in_contact = rho2 < rim2;
    if (in_contact && owner[i] != j && owner[i] != FREE) {
      mu[i] = slip[i] = 0.0; /* from one pulley straight on to the next */
      *changed = 1;
    }
    plan->contacts_changed += in_contact != (owner[i] == j);
    owner[i] = in_contact ? j : owner[i] == j ? RELEASED : owner[i];
    if (in_contact && fabs(mu[i]) > limit) {
      *changed |= fabs(mu[i]) > limit * (1.0 + tolerance);
      mu[i] = copysign(limit, mu[i]);
    }
  }
  return BD_OK;
}

int bd_plan_after_step(bd_plan *plan, double t, double *y, double tolerance, int *changed,
                       bd_error *err) {
  const bd_layout *lay = &plan->model->lay;
  int found = 0;
  *changed = 0;
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &plan->contact_pulleys[j];
    const double *owner = plan->owner + pulley->slot * lay->n8;
    const bd_run *runs = plan->search.runs + j * plan->search.max_runs;
    for (int r = 0; r < plan->search.n_runs[j]; ++r) {
      for (int begin = runs[r].begin; begin < runs[r].end; begin += BD_LANES) {
        begin = plan->kernels->find_contact_event[plan->friction_on](lay, pulley, j, owner, y,
                                                                     begin, runs[r].end);
        if (begin == runs[r].end) {
          break;
        }
        found = 1;
        int code = resolve_contact_events(plan, t, y, j, begin, tolerance, changed, err);
        if (code != BD_OK) {
          return code;
        }
      }
    }
  }
  for (int j = 0; found && plan->friction_on && j < lay->np; ++j) {
    const int slot = plan->contact_pulleys[j].slot;
    const bd_run *runs = plan->search.runs + j * plan->search.max_runs;
    for (int r = 0; r < plan->search.n_runs[j]; ++r) {
      reset_friction_state(lay, y, slot, plan->owner + slot * lay->n8, runs[r].begin,
                           runs[r].end < lay->n ? runs[r].end : lay->n);
    }
  }
  return BD_OK;
}
