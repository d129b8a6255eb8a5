/* SPDX-License-Identifier: MIT
 *
 * The effects: what acts on belt and pulleys, one row each in the table at the end. A row names the
 * effect, says which scenes have it, and holds all that the rest of the core asks of it: its pass
 * of the rate, its derivatives, the energy it stores, its works.
 */
#include <string.h>

#include "physics/physics.h"

/* Of effects that do not depend on the state, or whose derivatives are taken elsewhere. */
static void tangent_none(const bd_plan *plan, const double *y, bd_derivatives *out) {
  (void)plan, (void)y, (void)out;
}

/* --- moving centres (settling) ---------------------------------------------------------------- */

static int moves_centres(const bd_model *model, const bd_plan_options *options) {
  (void)model;
  return options->offset != NULL;
}

static int pass_place(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)dy, (void)err;
  bd_plan_place(plan, t, y);
  return BD_OK;
}

/* --- joints ----------------------------------------------------------------------------------- */

static int always(const bd_model *model, const bd_plan_options *options) {
  (void)model, (void)options;
  return 1;
}

static const char *label_joints(const bd_plan *plan) {
  if (plan->model->lay.string) {
    return "string: axial spring-dampers between point masses";
  }
  return plan->bending_on ? "joints: axial and bending spring-dampers"
                          : "joints: axial spring-dampers";
}

static int pass_joints(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  double loss = plan->kernels->joints[plan->bending_on][!plan->skip_power](&plan->links, y, dy);
  dy[plan->model->lay.work + W_joint_loss] = loss;
  return BD_OK;
}

static void carve_joints_tangent(bd_carver *carver, bd_derivatives *out, const bd_model *model) {
  bd_tangent *t = &out->joints;
  double **const by_link[] = {&t->cos, &t->sin, &t->spin, &t->pull};
  for (size_t k = 0; k < sizeof by_link / sizeof by_link[0]; ++k) {
    bd_carve_links(carver, &model->lay, by_link[k]);
  }
}

static void tangent_joints(const bd_plan *plan, const double *y, bd_derivatives *out) {
  plan->kernels->newton->linearise_joints(&plan->links, y, &out->joints);
}

/* --- gravity ---------------------------------------------------------------------------------- */

static int has_gravity(const bd_model *model, const bd_plan_options *options) {
  (void)options;
  return model->has_gravity;
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

/* --- contact and friction --------------------------------------------------------------------- */

static const char *label_contact(const bd_plan *plan) {
  return plan->contact_name; /* with the laws of its friction */
}

static int pass_contact(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_layout *lay = &plan->model->lay;
  double contact_loss = 0.0, friction_loss = 0.0;
  for (int j = 0; j < lay->np; ++j) {
    plan->contact_pulleys[j].omega = y[lay->rim[j]];
  }
  if (plan->model->along_links && !lay->string) {
    bd_link_contact_rate(plan, y, dy);
    return BD_OK;
  }
  for (int j = 0; j < lay->np; ++j) {
    bd_sums sums;
    plan->kernels->contact[plan->contact_pulleys[j].law][!plan->skip_power](
        &plan->links, &plan->contact_pulleys[j], plan->search.n_runs[j],
        plan->search.runs + j * plan->search.max_runs, y, dy, &sums);
    plan->friction[j] = sums.torque;
    const int m = plan->model->mount_of ? plan->model->mount_of[j] : -1;
    if (m >= 0) { /* of a string */
      plan->hub[2 * m] = -sums.force[0];
      plan->hub[2 * m + 1] = -sums.force[1];
    }
    contact_loss += sums.contact_loss;
    friction_loss += sums.friction_loss;
  }
  dy[lay->work + W_contact_loss] = contact_loss;
  dy[lay->work + W_friction_loss] = friction_loss;
  return BD_OK;
}

static void carve_contact(bd_carver *carver, bd_plan *plan, const bd_model *model) {
  const bd_layout *lay = &model->lay;
  BD_CARVE(carver, plan->best, lay->n);
  BD_CARVE(carver, plan->touched, lay->n);
  if (model->along_links) {
    bd_link_contact_carve(carver, plan, lay);
  }
  BD_CARVE(carver, plan->contact_pulleys, lay->np);
  BD_KEEP(carver, plan->owner, lay->n8 * lay->slots);
  BD_KEEP(carver, plan->friction, lay->np);
  bd_search_carve(carver, &plan->search, lay);
}

static void carve_contact_tangent(bd_carver *carver, bd_derivatives *out, const bd_model *model) {
  const bd_layout *lay = &model->lay;
  out->max_runs = lay->n8 / BD_LANES;
  BD_CARVE(carver, out->contact_pulleys, lay->np);
  BD_CARVE(carver, out->n_runs, lay->np);
  BD_CARVE(carver, out->runs, lay->np * out->max_runs);
}

/* Which links are near which pulley: whether contact is linearised as it stands or as a step of
 * some length finds it depends on the method (bd_newton_factor). */
static void tangent_contact(const bd_plan *plan, const double *y, bd_derivatives *out) {
  const bd_layout *lay = &plan->model->lay;
  for (int j = 0; j < lay->np; ++j) {
    out->contact_pulleys[j] = plan->contact_pulleys[j];
    out->contact_pulleys[j].omega = y[lay->rim[j]];
    out->n_runs[j] = plan->search.n_runs[j];
    memcpy(out->runs + j * out->max_runs, plan->search.runs + j * plan->search.max_runs,
           (size_t)out->n_runs[j] * sizeof *out->runs);
  }
}

/* --- pulleys and set torques ------------------------------------------------------------------ */

static int turns_pulleys(const bd_model *model, const bd_plan_options *options) {
  (void)model;
  return !options->hold_pulleys;
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
    const double belt = bd_runs_on_shaft(lay, j) ? plan->friction[j] : 0.0;
    dy[lay->omega + j] = (plan->torque[j] + belt) / plan->model->inertia[j];
    drive += plan->torque[j] * omega[j];
  }
  dy[lay->work + W_drive] = drive;
  return BD_OK;
}

/* --- prescribed motion ------------------------------------------------------------------------ */

static int has_motion(const bd_model *model, const bd_plan_options *options) {
  (void)model;
  return options->motion;
}

/* Before contact, which depends on the speeds. */
static int pass_motion(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)dy;
  return plan->torques.motion.from_rate ? bd_motion_set_eval(&plan->torques, t, plan->t_piece, err)
                                        : bd_motion_put(plan, t, y, err);
}

/* As exact as the time: a method gives what its formula does. */
static int motion_after_step(bd_plan *plan, double t, double *y, double tolerance, int *changed,
                             bd_error *err) {
  (void)tolerance, (void)changed;
  return bd_motion_put(plan, t, y, err);
}

/* After all that acts on a pulley: what is missing to the acceleration prescribed is the torque
 * that the motion needs. */
static int pass_motion_torque(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_motion_set *set = &plan->torques.motion;
  const bd_layout *lay = &plan->model->lay;
  for (size_t k = 0; k < set->n; ++k) {
    int j = set->motions[k].pulley;
    double torque = plan->model->inertia[j] * (set->alpha[k] - dy[lay->omega + j]);
    dy[lay->omega + j] = set->alpha[k];
    dy[lay->work + W_drive] += torque * y[lay->omega + j];
  }
  return BD_OK;
}

/* --- mass-proportional damping (settling) ----------------------------------------------------- */

static int has_mass_damping(const bd_model *model, const bd_plan_options *options) {
  (void)model;
  return options->mass_damping > 0.0;
}

/* Speed of circulation: of the belt along itself and of the pulleys that friction
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
    double rim = plan->model->rim_inertia[j] / (r * r * plan->model->info.link_mass);
    sum += rim * y[lay->rim[j]] * r * plan->model->wraps[j].sense;
    mass += rim;
  }
  return sum / mass;
}

/* Dynamic relaxation: mass-proportional damping of every motion but circulation, in
 * which all links run along the belt at one speed v and turn at kappa v; circulation has a damping
 * and an inertia of its own. */
static int pass_mass_damping(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_layout *lay = &plan->model->lay;
  const int n = lay->n;
  const double *vx = bd_field(lay, y, F_VX), *vy = bd_field(lay, y, F_VY);
  const double *co = plan->links.cos, *si = plan->links.sin, wind = plan->links.wind;
  double *ax = bd_field(lay, dy, F_VX), *ay = bd_field(lay, dy, F_VY);
  const double mass_damping = plan->mass_damping, pitch = 4.0 * plan->links.half;
  const double circulation_correction =
      (mass_damping - plan->circulation_damping) * bd_plan_circulation(plan, y) +
      (plan->circulation_inertia_scale - 1.0) * bd_plan_circulation(plan, dy);
  for (int i = 0; i < n; ++i) {
    ax[i] -= mass_damping * vx[i] - circulation_correction * co[i];
    ay[i] -= mass_damping * vy[i] - circulation_correction * si[i];
  }
  if (!lay->string) {
    const double *phi = bd_field(lay, y, F_PHI), *vphi = bd_field(lay, y, F_VPHI);
    double *aphi = bd_field(lay, dy, F_VPHI);
    for (int i = 0; i < n; ++i) {
      double turn = phi[i + 1 < n ? i + 1 : 0] - phi[i > 0 ? i - 1 : n - 1] +
                    (i == 0 || i + 1 == n ? wind : 0.0);
      aphi[i] -= mass_damping * vphi[i] - circulation_correction * turn / pitch;
    }
  }
  for (int m = 0; m < lay->nm; ++m) {
    dy[lay->travel_speed + m] -= mass_damping * y[lay->travel_speed + m];
  }
  for (int j = 0; !plan->pulleys_locked && j < lay->np; ++j) {
    double round = plan->friction_on ? plan->model->wraps[j].sense / plan->model->radius[j] : 0.0;
    dy[lay->rim[j]] -= mass_damping * y[lay->rim[j]] - circulation_correction * round;
  }
  for (int c = 0; !plan->pulleys_locked && c < lay->nc; ++c) {
    const int free =
        bd_runs_on_shaft(lay, lay->coupled[c]) ? lay->rim_speed + c : lay->omega + lay->coupled[c];
    dy[free] -= mass_damping * y[free];
  }
  return BD_OK;
}

/* Of the damping alone: circulation, which it exempts, ties every link to every other. */
static void tangent_mass_damping(const bd_plan *plan, const double *y, bd_derivatives *out) {
  (void)y;
  out->mass_damping = plan->mass_damping;
}

/* --- the table -------------------------------------------------------------------------------- */

/* In the order of their passes: joints set the links' rates, and the pulleys' pass those of the
 * pulleys, others add to them; mass-proportional damping sees the accelerations of all. The
 * derivatives of set torques need checks that only a step can make (torque_functions.c). A pulley
 * whose motion is prescribed has no equation of its own to be derived (newton_system.c). */
static const bd_effect table[] = {
    {
        .name = "moving centres",
        .enabled = moves_centres,
        .rate = pass_place,
        .tangent = tangent_none,
    },
    {
        .name = "joints",
        .asked_by = "belt",
        .label = label_joints,
        .enabled = always,
        .rate = pass_joints,
        .tangent = tangent_joints,
        .carve_tangent = carve_joints_tangent,
        .outputs = bd_outputs_of_joints,
        .energy = bd_energy_of_joints,
        .n_works = 1,
        .works = {W_joint_loss},
    },
    {
        .name = "gravity",
        .asked_by = "gravity",
        .enabled = has_gravity,
        .rate = pass_gravity,
        .tangent = tangent_none,
        .energy = bd_energy_of_gravity,
    },
    {
        .name = "centrifugal force",
        .enabled = bd_centrifugal_enabled,
        .rate = bd_centrifugal_rate,
        .tangent = tangent_none, /* weaker than the tension, which is stiff enough for settling */
    },
    {
        .name = "prescribed motion",
        .asked_by = "motion",
        .enabled = has_motion,
        .rate = pass_motion,
        .calls = 1,
        .tangent = tangent_none,
        .after_step = motion_after_step,
    },
    {
        .name = "axes on mounts",
        .asked_by = "arm slider path",
        .enabled = bd_axes_enabled,
        .rate = bd_axes_rate,
        .tangent = bd_axes_tangent,
        .carve = bd_axes_carve,
        .carve_tangent = bd_axes_carve_tangent,
        .after_step = bd_axes_after_step,
        .outputs = bd_axes_outputs,
    },
    {
        .name = "contact",
        .asked_by = "contact friction",
        .label = label_contact,
        .enabled = always,
        .rate = pass_contact,
        .tangent = tangent_contact,
        .carve = carve_contact,
        .carve_tangent = carve_contact_tangent,
        .after_step = bd_contact_after_step,
        .outputs = bd_outputs_of_contact,
        .energy = bd_energy_of_contact,
        .n_works = 2,
        .works = {W_contact_loss, W_friction_loss},
    },
    {
        .name = "pulleys: set torques",
        .asked_by = "torque",
        .enabled = turns_pulleys,
        .rate = pass_pulleys,
        .calls = 1,
        .tangent = tangent_none,
        .n_works = 1,
        .works = {W_drive},
    },
    {
        .name = "couplings of shafts and rims",
        .asked_by = "isolator clutch damper",
        .label = bd_couplings_label,
        .enabled = bd_couplings_enabled,
        .rate = bd_couplings_rate,
        .tangent = bd_couplings_tangent,
        .carve_tangent = bd_couplings_carve_tangent,
        .after_step = bd_couplings_after_step,
        .outputs = bd_couplings_outputs,
        .energy = bd_couplings_energy,
        .n_works = 1,
        .works = {W_coupling_loss},
        .store = BD_ENERGY_coupling,
    },
    {
        .name = "bearing drag",
        .asked_by = "drag",
        .enabled = bd_drag_enabled,
        .rate = bd_drag_rate,
        .tangent = bd_drag_tangent,
        .carve_tangent = bd_drag_carve_tangent,
        .n_works = 1,
        .works = {W_drag_loss},
    },
    {
        .name = "mounts",
        .asked_by = "arm slider",
        .label = bd_mounts_label,
        .enabled = bd_mounts_enabled,
        .rate = bd_mounts_rate,
        .tangent = bd_mounts_tangent,
        .energy = bd_mounts_energy,
        .n_works = 1,
        .works = {W_mount_loss},
        .store = BD_ENERGY_mount,
    },
    {
        .name = "prescribed paths",
        .asked_by = "path",
        .enabled = bd_paths_enabled,
        .rate = bd_paths_rate,
        .tangent = tangent_none,
        .n_works = 1,
        .works = {W_path_work},
    },
    {
        .name = "torques of prescribed motion",
        .asked_by = "motion",
        .enabled = has_motion,
        .rate = pass_motion_torque,
        .calls = 1,
        .tangent = tangent_none,
        .outputs = bd_outputs_of_motion,
    },
    {
        .name = "mass-proportional damping",
        .enabled = has_mass_damping,
        .rate = pass_mass_damping,
        .tangent = tangent_mass_damping,
    },
};
enum { N_EFFECTS = sizeof table / sizeof table[0] };
_Static_assert((int)N_EFFECTS <= (int)BD_MAX_EFFECTS, "a plan must have room for every effect");

int bd_effects_of(const bd_model *model, const bd_plan_options *options,
                  const bd_effect *effects[BD_MAX_EFFECTS]) {
  int n = 0;
  for (int k = 0; k < N_EFFECTS; ++k) {
    if (table[k].enabled(model, options)) {
      effects[n++] = &table[k];
    }
  }
  return n;
}

int bd_effect_row(const bd_effect *effect) {
  return (int)(effect - table);
}

const char *bd_effect_name(int row) {
  return row >= 0 && row < N_EFFECTS ? table[row].name : NULL;
}

const char *bd_effect_asked_by(int row) {
  return row >= 0 && row < N_EFFECTS && table[row].asked_by ? table[row].asked_by : "";
}

/* All that a plan of this model may be made with. */
static int all_effects_of(const bd_model *model, const bd_effect *effects[BD_MAX_EFFECTS]) {
  const double somewhere[2] = {0.0, 0.0};
  return bd_effects_of(
      model,
      &(bd_plan_options){.ledger = 1, .friction = 1, .mass_damping = 1.0, .offset = somewhere},
      effects);
}

void bd_effects_carve(bd_carver *carver, bd_plan *plan, const bd_model *model) {
  const bd_effect *effects[BD_MAX_EFFECTS];
  const int n = all_effects_of(model, effects);
  for (int k = 0; k < n; ++k) {
    if (effects[k]->carve) {
      effects[k]->carve(carver, plan, model);
    }
  }
}

void bd_effects_carve_tangents(bd_carver *carver, bd_derivatives *out, const bd_model *model) {
  const bd_effect *effects[BD_MAX_EFFECTS];
  const int n = all_effects_of(model, effects);
  for (int k = 0; k < n; ++k) {
    if (effects[k]->carve_tangent) {
      effects[k]->carve_tangent(carver, out, model);
    }
  }
}
