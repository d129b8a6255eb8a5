/* SPDX-License-Identifier: MIT
 *
 * The effects: what acts on belt and pulleys, a row each, which says which scenes have it and holds
 * all that the rest of the core asks of it. Here are those of every drive, and what is asked of all
 * of them; the others' are in files of their own.
 */
#include <string.h>

#include "physics/physics.h"

void bd_tangent_none(const bd_plan *plan, const double *y, bd_derivatives *out) {
  (void)plan, (void)y, (void)out;
}

/* --- joints ----------------------------------------------------------------------------------- */

static int always(const bd_model *model, const bd_plan_options *options) {
  (void)model, (void)options;
  return 1;
}

static const char *label_joints(const bd_plan *plan) {
  return plan->model->belt_model->joints_text[plan->bending_on];
}

static int pass_joints(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  dy[plan->model->lay.work + W_joint_loss] = plan->model->belt_model->joints(plan, y, dy);
  return BD_OK;
}

static void carve_joints_tangent(bd_carver *carver, bd_derivatives *out, const bd_model *model) {
  bd_tangent *t = &out->joints;
  double **const by_link[] = {&t->cos, &t->sin, &t->spin, &t->pull};
  for (size_t k = 0; k < sizeof by_link / sizeof by_link[0]; ++k) {
    bd_carve_links(carver, &model->lay, by_link[k]);
  }
}

static void stiffness_of_joints(bd_stiffening *at) {
  const bd_info *info = &at->model->info;
  const double shear = at->model->belt_model->facts.shear, m = info->link_mass,
               turned = info->link_inertia;
  bd_stiffen(at, BD_STIFF_LINK, "the belt's joints",
             shear * info->joint_stiffness / m + 4.0 * info->bending_stiffness / turned,
             shear * info->joint_damping / m + 4.0 * info->bending_damping / turned, 0.0);
}

const bd_effect bd_effect_joints = {
    .name = "joints",
    .asked_by = "belt",
    .label = label_joints,
    .enabled = always,
    .rate = pass_joints,
    .tangent = bd_tangent_none, /* the belt has its own (bd_newton_belt) */
    .carve_tangent = carve_joints_tangent,
    .stiffness = stiffness_of_joints,
    .outputs = bd_outputs_of_joints,
    .n_works = 1,
    .works = {BD_LOST_IN(joint_loss, "dampers of the joints have given", 1)},
};

/* --- gravity ---------------------------------------------------------------------------------- */

static int has_gravity(const bd_model *model, const bd_plan_options *options) {
  (void)options;
  return model->has_gravity;
}

static int pass_gravity(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)y, (void)err;
  plan->model->belt_model->fall(plan, dy);
  return BD_OK;
}

const bd_effect bd_effect_gravity = {
    .name = "gravity",
    .asked_by = "gravity",
    .enabled = has_gravity,
    .rate = pass_gravity,
    .tangent = bd_tangent_none,
};

/* --- contact and friction --------------------------------------------------------------------- */

static const char *label_contact(const bd_plan *plan) {
  return plan->contact_name; /* with the laws of its friction */
}

static int pass_contact(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_layout *lay = &plan->model->lay;
  const bd_belt_model *belt = plan->model->belt_model;
  double contact_loss = 0.0, friction_loss = 0.0;
  if (belt->contact_begin) {
    belt->contact_begin(plan, y);
  }
  for (int j = 0; j < lay->np; ++j) {
    const int m = plan->model->mount_of ? plan->model->mount_of[j] : -1;
    bd_sums sums;
    plan->contact_pulleys[j].omega = y[lay->rim[j]];
    belt->contact(plan, j, y, dy, &sums);
    plan->friction[j] = sums.torque;
    for (int k = 0; m >= 0 && k < 2; ++k) {
      plan->hub[2 * m + k] = -sums.force[k];
    }
    contact_loss += sums.contact_loss;
    friction_loss += sums.friction_loss;
  }
  if (belt->contact_end) {
    belt->contact_end(plan, dy);
  }
  dy[lay->work + W_contact_loss] = contact_loss;
  dy[lay->work + W_friction_loss] = friction_loss;
  return BD_OK;
}

static int after_step_of_contact(bd_plan *plan, double t, double *y, double tolerance, int *changed,
                                 bd_error *err) {
  return plan->model->belt_model->after_step(plan, t, y, tolerance, changed, err);
}

static void outputs_of_contact(bd_plan *plan, const double *y, const bd_output *out, size_t k) {
  plan->model->belt_model->contact_outputs(plan, y, out, k);
}

static void carve_contact(bd_carver *carver, bd_plan *plan, const bd_model *model) {
  const bd_layout *lay = &model->lay;
  BD_CARVE(carver, plan->best, lay->n);
  BD_CARVE(carver, plan->touched, lay->n);
  BD_CARVE(carver, plan->joints, lay->n);
  BD_CARVE(carver, plan->touches, lay->n);
  if (model->belt_model->carve) {
    model->belt_model->carve(carver, plan, model);
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

static double torque_of_contact(const bd_plan *plan, const double *y, int j) {
  return bd_runs_on_shaft(&plan->model->lay, j) ? bd_friction_torque(plan, y, j, NULL) : 0.0;
}

/* Of friction that settling leaves out. */
static void rest_contact(const bd_plan *plan, double *y) {
  const bd_layout *lay = &plan->model->lay;
  for (int row = F_MU; !plan->friction_on && row <= F_SLIP; ++row) {
    for (int k = 0; k < bd_field_pieces(lay, row); ++k) {
      memset(y + bd_field_offset(lay, row, k), 0, (size_t)lay->n * sizeof *y);
    }
  }
}

static void stiffness_of_contact(bd_stiffening *at) {
  const bd_model *model = at->model;
  const bd_info *info = &model->info;
  const double m = info->link_mass, r = model->radius[at->pulley];
  const double rim =
      bd_runs_on_shaft(&model->lay, at->pulley) ? at->inertia : model->rim_inertia[at->pulley];
  /* of all links on the wrap together, on the pulley's inertia */
  const double of_wrap = at->wrap * r * r * r / (info->link_length * rim);
  const double contact =
      bd_contact_stiffness(info->contact_quadratic, info->contact_linear, at->normal);
  const bd_friction_stiffness friction = bd_friction_stiffness_of(model, at->pulley, at->normal);
  bd_stiffen(at, BD_STIFF_PULLEY, "friction whose damper is very small", 0.0, 0.0, friction.adapts);
  bd_stiffen(at, BD_STIFF_LINK, "the contact", contact / m,
             bd_contact_damping(model, info->contact_damping, at->normal) / m, 0.0);
  bd_stiffen(at, BD_STIFF_LINK, "friction", friction.stiffness / m, friction.damping / m, 0.0);
  bd_stiffen(at, BD_STIFF_PULLEY, "a pulley with very small inertia", friction.stiffness * of_wrap,
             friction.damping * of_wrap, 0.0);
}

const bd_effect bd_effect_contact = {
    .name = "contact",
    .asked_by = "contact friction",
    .label = label_contact,
    .enabled = always,
    .rate = pass_contact,
    .tangent = bd_tangent_none,
    .carve = carve_contact,
    .carve_tangent = carve_contact_tangent,
    .after_step = after_step_of_contact,
    .stiffness = stiffness_of_contact,
    .rest = rest_contact,
    .on_shaft = torque_of_contact,
    .outputs = outputs_of_contact,
    .n_works = 2,
    .works = {BD_LOST_IN(contact_loss, "dampers of the contact have given", 1),
              {.row = W_friction_loss}},
};

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

static void stiffness_of_torques(bd_stiffening *at) {
  double angular = 0.0, viscous = 0.0;
  if (at->set) {
    bd_torque_set_steepest(at->set, at->pulley, at->tension, &angular, &viscous);
  }
  bd_stiffen(at, BD_STIFF_PULLEY, "harmonics of very high order", angular / at->inertia, 0.0, 0.0);
  bd_stiffen(at, BD_STIFF_PULLEY, "a load whose torque rises very steeply with its speed", 0.0,
             viscous / at->inertia, 0.0);
}

/* The derivatives of set torques need checks that only a step can make (torque_functions.c). */
const bd_effect bd_effect_pulleys = {
    .name = "pulleys: set torques",
    .asked_by = "torque",
    .enabled = turns_pulleys,
    .rate = pass_pulleys,
    .calls = 1,
    .tangent = bd_tangent_none,
    .unseen = bd_resistance_unseen,
    .stiffness = stiffness_of_torques,
    .n_works = 1,
    .works = {{.row = W_drive}},
};

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

/* A pulley whose motion is prescribed has no equation of its own to be derived (newton_system.c).
 */
const bd_effect bd_effect_motion = {
    .name = "prescribed motion",
    .asked_by = "motion",
    .enabled = has_motion,
    .rate = pass_motion,
    .calls = 1,
    .tangent = bd_tangent_none,
    .after_step = motion_after_step,
};

const bd_effect bd_effect_motion_torques = {
    .name = "torques of prescribed motion",
    .asked_by = "motion",
    .enabled = has_motion,
    .rate = pass_motion_torque,
    .calls = 1,
    .tangent = bd_tangent_none,
    .outputs = bd_outputs_of_motion,
};

/* --- the table -------------------------------------------------------------------------------- */

static const bd_effect *const table[] = {
#define X(name) &bd_effect_##name,
    BD_EFFECTS(X)
#undef X
};
enum { N_EFFECTS = BD_MAX_EFFECTS };

int bd_effects_of(const bd_model *model, const bd_plan_options *options,
                  const bd_effect *effects[BD_MAX_EFFECTS]) {
  int n = 0;
  for (int k = 0; k < N_EFFECTS; ++k) {
    if (table[k]->enabled(model, options)) {
      effects[n++] = table[k];
    }
  }
  return n;
}

int bd_effect_row(const bd_effect *effect) {
  int row = 0;
  while (table[row] != effect) {
    ++row;
  }
  return row;
}

const char *bd_effect_name(int row) {
  return row >= 0 && row < N_EFFECTS ? table[row]->name : NULL;
}

const char *bd_effect_asked_by(int row) {
  return row >= 0 && row < N_EFFECTS && table[row]->asked_by ? table[row]->asked_by : "";
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

void bd_effects_rest(const bd_plan *plan, double *y) {
  const bd_effect *effects[BD_MAX_EFFECTS];
  const int n = all_effects_of(plan->model, effects);
  for (int k = 0; k < n; ++k) {
    if (effects[k]->rest) {
      effects[k]->rest(plan, y);
    }
  }
}
