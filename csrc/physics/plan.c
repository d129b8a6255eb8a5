/* SPDX-License-Identifier: MIT
 *
 * The plan of a simulation: which effects an evaluation of the right-hand side has, chosen once
 * from the table in effects.c, and what happens to contact and friction after a step. An effect
 * that is off has no pass; a kernel variant without bending, friction or ledger is a different
 * function, not a test inside the loop.
 */
#include <math.h>
#include <stdio.h>

#include "physics/physics.h"

/* --- making it ------------------------------------------------------------------------------- */

void bd_plan_carve(bd_carver *carver, bd_plan *plan, const bd_model *model) {
  const bd_layout *lay = &model->lay;
  bd_links *links = &plan->links;
  double *link_mask;
  BD_CARVE(carver, link_mask, lay->stride);
  links->link_mask = link_mask;
  double **const scratch[] = {&links->cos, &links->sin, &links->rx,
                              &links->ry,  &links->fx,  &links->fy};
  for (size_t k = 0; k < sizeof scratch / sizeof scratch[0]; ++k) {
    /* the directions are kept, with the rate that they belong to; the last vector of what is one
     * node further reads a number behind them */
    const size_t count = (size_t)lay->stride + BD_HALO;
    BD_CARVE(carver, *scratch[k], count);
    if (k < 2) {
      bd_keep(carver, (bd_kept){.place = *scratch[k], .size = count * sizeof **scratch[k]});
    }
    if (carver->base) {
      *scratch[k] += BD_HALO;
    }
  }
  for (int i = 0; carver->base && i < lay->n; ++i) {
    link_mask[i] = 1.0;
  }
  BD_KEEP_SPAN(carver, plan, t_piece, skip_power);
  BD_KEEP(carver, plan->torque, lay->np);
  bd_effects_carve(carver, plan, model);
}

/* "contact with Dahl and LuGre friction" */
static void name_contact(bd_plan *plan) {
  char *name = plan->contact_name;
  const size_t size = sizeof plan->contact_name;
  size_t used = (size_t)snprintf(name, size, "contact");
  int n = 0;
  for (int law = BD_LAW_NONE + 1; law < BD_N_LAWS; ++law) {
    int has = 0;
    for (int j = 0; j < plan->model->lay.np; ++j) {
      has |= plan->contact_pulleys[j].law == law;
    }
    if (has) {
      used += (size_t)snprintf(name + used, size - used, "%s%s", n > 0 ? " and " : " with ",
                               bd_law_text(law));
      ++n;
    }
  }
  snprintf(name + used, size - used, "%s", n > 0 ? " friction" : " without friction");
}

void bd_plan_make(bd_plan *plan, const bd_model *model, const bd_plan_options *options) {
  const bd_info *info = &model->info;
  bd_links *links = &plan->links;
  plan->model = model;
  plan->kernels = model->kernels;
  plan->ledger = options->ledger != 0;
  plan->bending_on = model->has_bending;
  plan->friction_on = options->friction && model->has_friction;
  plan->grip_on = options->friction;
  for (int m = 0; m < model->lay.nm; ++m) {
    plan->mount_inertia[m] = model->mounts[m].inertia;
  }
  plan->mass_damping = options->mass_damping;
  plan->circulation_inertia_scale = 1.0;
  plan->pulleys_locked = options->hold_pulleys;
  plan->no_power = plan->skip_power = options->no_power;
  plan->offset = options->offset;
  plan->move_time = options->move_time;
  plan->flow = options->flow;

  links->lay = model->lay;
  links->half = 0.5 * info->link_length;
  links->stiffness = info->joint_stiffness;
  links->damping = info->joint_damping;
  links->bending = info->bending_stiffness;
  links->bending_damping = info->bending_damping;
  links->inv_mass = 1.0 / info->link_mass;
  links->inv_inertia = 1.0 / info->link_inertia;
  links->wind = 2.0 * BD_PI * info->winding;
  double *const cosines = plan->seen.cos, *const sines = plan->seen.sin;
  plan->seen = *links;
  plan->seen.cos = cosines;
  plan->seen.sin = sines;
  for (int j = 0; j < model->lay.np; ++j) {
    plan->contact_pulleys[j] = (bd_contact_pulley){.x = model->cx[j],
                                                   .y = model->cy[j],
                                                   .radius = model->contact_radius[j],
                                                   .quadratic = info->contact_quadratic,
                                                   .linear = info->contact_linear,
                                                   .damping = info->contact_damping,
                                                   .hunt_crossley = model->contact.hunt_crossley,
                                                   .l0 = info->link_length,
                                                   .stride = model->lay.stride,
                                                   .slot = model->slot[j]};
    /* at rest a law without a state has no force: settling goes on without it */
    const int states = bd_friction_states(&model->friction[j]);
    if (plan->friction_on && (states > 0 || !options->settling)) {
      plan->contact_pulleys[j].law = model->friction[j].law;
      plan->contact_pulleys[j].friction = model->friction[j];
      plan->contact_pulleys[j].states = states;
      plan->contact_pulleys[j].bound = bd_friction_bound(model, j, 0);
    }
  }
  name_contact(plan);
  plan->n_effects = bd_effects_of(model, options, plan->effects);
  plan->n_columns = bd_model_energy_terms(model, plan->columns);
}

int bd_plan_rate(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  for (int k = 0; k < plan->n_effects; ++k) {
    int code = plan->effects[k]->rate(plan, t, y, dy, err);
    if (code != BD_OK) {
      return code;
    }
  }
  return BD_OK;
}

double bd_plan_unseen(const bd_plan *plan, const bd_step *step) {
  double most = 0.0;
  for (int k = 0; k < plan->n_effects; ++k) {
    if (plan->effects[k]->unseen) {
      most = fmax(most, plan->effects[k]->unseen(plan, step));
    }
  }
  return most;
}

double bd_plan_error(const bd_plan *plan, const bd_step_sum *of) {
  return plan->model->belt_model->error ? plan->model->belt_model->error(plan, of)
                                        : plan->kernels->error_norm(&plan->model->lay, of->h, of->m,
                                                                    of->a, of->k, of->weights);
}

bd_freedom bd_freedom_of(const bd_plan *plan, int body) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const int m = body - lay->np, c = m - lay->nm;
  if (m < 0) {
    const int moved = bd_is_moved(&plan->torques, body);
    return (bd_freedom){body,  lay->theta + body,  lay->omega + body, model->inertia[body],
                        moved, model->radius[body]};
  }
  if (c < 0) {
    const bd_mounted *mount = &model->mounts[m];
    return (bd_freedom){mount->pulley,          lay->travel + m,    lay->travel_speed + m,
                        plan->mount_inertia[m], !mount->row->moves, mount->lever};
  }
  const bd_coupled *k = &model->couplings[c];
  return (bd_freedom){k->pulley, lay->rim_angle + c,      lay->rim_speed + c, k->inertia,
                      0,         model->radius[k->pulley]};
}

int bd_plan_rate_of_belt(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  const int skipped = plan->skip_power;
  int code = BD_OK;
  plan->skip_power = 0;
  for (int k = 0; code == BD_OK && k < plan->n_effects; ++k) {
    if (!plan->effects[k]->calls) {
      code = plan->effects[k]->rate(plan, t, y, dy, err);
    }
  }
  plan->skip_power = skipped;
  return code;
}

/* Smooth (quintic) motion of the centres from their offset to their place. */
void bd_plan_place(bd_plan *plan, double t, const double *y) {
  bd_mounts_put(plan, y);
  double s = plan->move_time > 0.0 ? t / plan->move_time : 1.0;
  s = s < 0.0 ? 0.0 : s > 1.0 ? 1.0 : s;
  double left = 1.0 - s * s * s * (10.0 + s * (6.0 * s - 15.0));
  double speed =
      plan->move_time > 0.0 ? -30.0 * s * s * (1.0 - s) * (1.0 - s) / plan->move_time : 0.0;
  for (int j = 0; plan->offset && j < plan->model->lay.np; ++j) {
    bd_contact_pulley *pulley = &plan->contact_pulleys[j];
    if (plan->model->mount_of && plan->model->mount_of[j] >= 0) {
      continue;
    }
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
  double *slip = bd_field(lay, y, bd_f_slip(lay, slot));
  for (int e = 0; e < lay->states; ++e) {
    double *mu = bd_field(lay, y, bd_f_state(lay, slot) + e);
    for (int i = begin; i < end; ++i) {
      mu[i] = owner[i] < 0 ? 0.0 : mu[i];
    }
  }
  for (int i = begin; i < end; ++i) {
    slip[i] = owner[i] < 0 ? 0.0 : slip[i];
    owner[i] = owner[i] < 0 ? FREE : owner[i];
  }
}

void bd_plan_see(const bd_plan *plan, const double *y) {
  if (plan->kernels->directions) {
    plan->kernels->directions(&plan->seen, y);
  }
}

void bd_plan_near(const bd_plan *plan, const double *y, int j, int n_runs, const bd_run *runs) {
  if (plan->kernels->nearest_ends) {
    plan->kernels->nearest_ends(&plan->seen, &plan->contact_pulleys[j], n_runs, runs, y,
                                plan->nearest);
  }
}

const double *bd_plan_distances(const bd_plan *plan, const double *y, int j) {
  const bd_layout *lay = &plan->model->lay;
  const bd_run all = {0, lay->n8};
  bd_plan_near(plan, y, j, 1, &all);
  plan->model->belt_model->distances(plan, y, j, 0, lay->n, plan->best);
  return plan->best;
}

void bd_plan_assign_contacts(bd_plan *plan, double *y) {
  const bd_layout *lay = &plan->model->lay;
  for (int k = 0; k < lay->n8 * lay->slots; ++k) {
    plan->owner[k] = FREE;
  }
  bd_plan_see(plan, y);
  for (int j = 0; lay->slots > 0 && j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &plan->contact_pulleys[j];
    const double *squared = bd_plan_distances(plan, y, j);
    for (int i = 0; pulley->law != BD_LAW_NONE && i < lay->n; ++i) {
      if (squared[i] < pulley->radius * pulley->radius) {
        plan->owner[pulley->slot * lay->n8 + i] = j;
        for (int e = pulley->states; e < lay->states; ++e) {
          bd_field(lay, y, bd_f_state(lay, pulley->slot) + e)[i] = 0.0;
        }
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
  const bd_contact_pulley *pulley = &plan->contact_pulleys[j];
  const double rim2 = pulley->radius * pulley->radius;
  const int friction = pulley->law != BD_LAW_NONE;
  double *mu = friction ? bd_field(lay, y, bd_f_state(lay, pulley->slot)) : NULL;
  double *slip = friction ? bd_field(lay, y, bd_f_slip(lay, pulley->slot)) : NULL;
  double *owner = plan->owner + pulley->slot * lay->n8, squared[BD_LANES];
  const int end = begin + BD_LANES < lay->n ? begin + BD_LANES : lay->n;
  plan->model->belt_model->distances(plan, y, j, begin, end, squared);
  for (int i = begin; i < end; ++i) {
    const double rho2 = squared[i - begin];
    if (rho2 < 0.25 * rim2) {
      return bd_fail_at(err, BD_ERR_PASSED_THROUGH, "contact", t, i, j, sqrt(rho2),
                        "link %d sank past half the radius of %s at t = %.9g s: the "
                        "contact is too soft for this tension: raise contact.linear, or look for a "
                        "torque or a speed out of scale",
                        i, bd_pulley_label(plan->model, j).text, t);
    }
    if (!friction) {
      continue;
    }
    int in_contact = rho2 < rim2;
    const int moved_on = in_contact && owner[i] != j && owner[i] != FREE;
    if (moved_on) { /* from one pulley straight to the next */
      slip[i] = 0.0;
      *changed = 1;
    }
    plan->contacts_changed += in_contact != (owner[i] == j);
    owner[i] = in_contact ? j : owner[i] == j ? RELEASED : owner[i];
    for (int e = 0; in_contact && e < lay->states; ++e) {
      double *z = &mu[e * lay->stride + i];
      const double limit = e < pulley->states ? pulley->bound : 0.0;
      *z = moved_on ? 0.0 : *z;
      if (fabs(*z) > limit) {
        *changed |= fabs(*z) > limit * (1.0 + tolerance);
        *z = copysign(limit, *z);
      }
    }
  }
  return BD_OK;
}

int bd_plan_after_step(bd_plan *plan, double t, double *y, double tolerance, int *changed,
                       bd_error *err) {
  int code = BD_OK;
  *changed = 0;
  for (int e = 0; code == BD_OK && e < plan->n_effects; ++e) {
    if (plan->effects[e]->after_step) {
      code = plan->effects[e]->after_step(plan, t, y, tolerance, changed, err);
    }
  }
  return code;
}

int bd_contact_after_step(bd_plan *plan, double t, double *y, double tolerance, int *changed,
                          bd_error *err) {
  const bd_layout *lay = &plan->model->lay;
  int found = 0;
  bd_plan_see(plan, y);
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &plan->contact_pulleys[j];
    const double *owner = plan->owner + pulley->slot * lay->n8;
    const bd_run *runs = bd_runs_of(plan, j);
    bd_plan_near(plan, y, j, plan->search.n_runs[j], runs);
    for (int r = 0; r < plan->search.n_runs[j]; ++r) {
      for (int begin = runs[r].begin; begin < runs[r].end; begin += BD_LANES) {
        begin = plan->kernels->find_contact_event[pulley->law != BD_LAW_NONE](
            &plan->links, pulley, j, owner, plan->nearest, y, begin, runs[r].end);
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
    const bd_run *runs = bd_runs_of(plan, j);
    for (int r = 0; r < plan->search.n_runs[j]; ++r) {
      reset_friction_state(lay, y, slot, plan->owner + slot * lay->n8, runs[r].begin,
                           runs[r].end < lay->n ? runs[r].end : lay->n);
    }
  }
  return BD_OK;
}
