/* SPDX-License-Identifier: MIT
 *
 * Mounts (MODEL section 5), three effects: the axes are where the travels have them,
 * before contact; those that move do so by what acts on them, after it; and the travel of those
 * that are prescribed is the time.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "physics/physics.h"

static int axes_enabled(const bd_model *model, const bd_plan_options *options) {
  (void)options;
  return model->lay.nm > 0;
}

static int mounts_enabled(const bd_model *model, const bd_plan_options *options) {
  (void)options;
  return model->n_moving > 0;
}

static int paths_enabled(const bd_model *model, const bd_plan_options *options) {
  (void)options;
  return model->lay.nm > model->n_moving;
}

static void axes_carve(bd_carver *carver, bd_plan *plan, const bd_model *model) {
  BD_KEEP(carver, plan->hub, 2 * model->lay.nm);
  BD_CARVE(carver, plan->mount_inertia, model->lay.nm);
}

static void axes_carve_tangent(bd_carver *carver, bd_derivatives *out, const bd_model *model) {
  BD_CARVE(carver, out->axes, model->lay.np);
  BD_CARVE(carver, out->mounts, model->lay.nm);
}

static const char *mounts_label(const bd_plan *plan) {
  return plan->model->moving;
}

/* --- where the axes are ----------------------------------------------------------------------- */

void bd_mounts_put(const bd_plan *plan, const double *y) {
  const bd_layout *lay = &plan->model->lay;
  for (int m = 0; m < lay->nm; ++m) {
    const bd_place at = bd_mount_place(&plan->model->mounts[m], y[lay->travel + m]);
    const double v = y[lay->travel_speed + m];
    bd_contact_pulley *pulley = &plan->contact_pulleys[lay->mounted[m]];
    pulley->x = at.c[0];
    pulley->y = at.c[1];
    pulley->vx = v * at.a[0];
    pulley->vy = v * at.a[1];
  }
}

static int axes_rate(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_layout *lay = &plan->model->lay;
  bd_mounts_put(plan, y);
  for (int m = 0; m < lay->nm; ++m) { /* drag adds to it */
    dy[lay->travel_speed + m] = 0.0;
  }
  return BD_OK;
}

/* Where a path has its axis at t, as far as it can be told from the travel that y has. */
int bd_mounts_begin(const bd_plan *plan, double t, double *y, bd_error *err) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  for (int m = 0; m < lay->nm; ++m) {
    const bd_mounted *mount = &model->mounts[m];
    if (mount->row->moves) {
      continue;
    }
    const bd_place is = bd_mount_place(mount, y[lay->travel + m]), due = bd_mount_place(mount, t);
    const double apart = hypot(is.c[0] - due.c[0], is.c[1] - due.c[1]);
    if (apart > 1e-9 * model->belt.length) {
      return bd_fail_at(err, BD_ERR_STATE, "travel", t, -1, mount->pulley, apart,
                        "the axis of %s is %.3g m off its path at t = %g s: begin where "
                        "the path does, or from a state of a run at that time",
                        bd_pulley_label(model, mount->pulley).text, apart, t);
    }
    y[lay->travel + m] = t;
    y[lay->travel_speed + m] = 1.0;
  }
  return BD_OK;
}

/* --- rate ------------------------------------------------------------------------------------- */

static double sliding(const bd_mounted *mount, double v, double share) {
  return mount->adapts * (v - fabs(v) * share);
}

static int mounts_rate(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  double lost = 0.0;
  for (int m = 0; m < lay->nm; ++m) {
    const bd_mounted *mount = &model->mounts[m];
    if (!mount->row->moves) {
      continue;
    }
    const double q = y[lay->travel + m], v = y[lay->travel_speed + m];
    const bd_place at = bd_mount_place(mount, q);
    const double belt = plan->hub[2 * m] * at.a[0] + plan->hub[2 * m + 1] * at.a[1];
    dy[lay->travel + m] = v;
    const double share = plan->grip_on ? y[lay->mount_friction + m] : 0.0;
    /* settling has a damping of its own, and dampers no say in an equilibrium */
    const int settles = plan->mass_damping > 0.0;
    const double held = (settles ? 0.0 : mount->damping * v) + mount->friction * share;
    const double force = belt + bd_mount_spring(mount, q) - held +
                         bd_mount_stop(mount, q, settles ? 0.0 : v, &lost) +
                         bd_mount_weight(model, mount, &at);
    dy[lay->travel_speed + m] += force / plan->mount_inertia[m];
    dy[lay->mount_friction + m] = plan->grip_on ? sliding(mount, v, share) : 0.0;
    lost += held * v;
  }
  if (model->belt_model->carry) {
    model->belt_model->carry(plan, dy);
  }
  dy[lay->work + W_mount_loss] = lost;
  return BD_OK;
}

static int paths_rate(bd_plan *plan, double t, double *y, double *dy, bd_error *err) {
  (void)t, (void)err;
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  double given = 0.0;
  for (int m = 0; m < lay->nm; ++m) {
    if (model->mounts[m].row->moves) {
      continue;
    }
    const bd_place at = bd_mount_place(&model->mounts[m], y[lay->travel + m]);
    const double v = y[lay->travel_speed + m];
    dy[lay->travel + m] = v;
    dy[lay->travel_speed + m] = dy[lay->mount_friction + m] = 0.0;
    given += (plan->hub[2 * m] * at.a[0] + plan->hub[2 * m + 1] * at.a[1]) * v;
  }
  dy[lay->work + W_path_work] = given;
  return BD_OK;
}

/* --- derivatives ------------------------------------------------------------------------------ */

/* Samples may have been looked at since the last rate. */
static void axes_tangent(const bd_plan *plan, const double *y, bd_derivatives *out) {
  const bd_layout *lay = &plan->model->lay;
  bd_mounts_put(plan, y);
  for (int j = 0; j < lay->np; ++j) {
    out->axes[j].body = -1;
  }
  for (int m = 0; m < lay->nm; ++m) {
    out->mounts[m] = (bd_mount_tangent){0};
    out->axes[lay->mounted[m]] = (bd_moving_axis){
        .body = lay->np + m,
        .speed = y[lay->travel_speed + m],
        .at = bd_mount_place(&plan->model->mounts[m], y[lay->travel + m]),
    };
  }
}

static void mounts_tangent(const bd_plan *plan, const double *y, bd_derivatives *out) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  for (int m = 0; m < lay->nm; ++m) {
    const bd_mounted *mount = &model->mounts[m];
    bd_mount_tangent *to = &out->mounts[m];
    const double q = y[lay->travel + m], v = y[lay->travel_speed + m];
    if (!mount->row->moves) {
      continue;
    }
    const double fx = plan->hub[2 * m] + mount->mass * model->gravity[0];
    const double fy = plan->hub[2 * m + 1] + mount->mass * model->gravity[1];
    const double *bend = out->axes[mount->pulley].at.bend;
    to->stiffness = mount->stiffness - fx * bend[0] - fy * bend[1];
    const int settles = plan->mass_damping > 0.0;
    to->damping = settles ? 0.0 : mount->damping;
    double lost = 0.0;
    if (bd_mount_stop(mount, q, settles ? 0.0 : v, &lost) != 0.0) {
      to->stiffness += mount->stop_stiffness;
      to->damping += settles ? 0.0 : mount->stop_damping;
    }
    if (plan->grip_on && mount->friction > 0.0) {
      to->friction = mount->friction;
      to->gain = mount->adapts * (1.0 - (v < 0.0 ? -1.0 : 1.0) * y[lay->mount_friction + m]);
      to->decay = mount->adapts * fabs(v);
    }
  }
}

static void mounts_entries(const bd_plan *plan, const bd_derivatives *at, double g, int n,
                           double *w) {
  for (int m = 0; m < plan->model->lay.nm; ++m) {
    const bd_mount_tangent *k = &at->mounts[m];
    double *own = &w[(plan->model->lay.np + m) * (n + 1)];
    *own += g * (g * k->stiffness + k->damping);
    *own += g * g * k->friction * k->gain / (1.0 + g * k->decay);
  }
}

static void mounts_product(const bd_plan *plan, const bd_derivatives *at, double g, const double *c,
                           double *rhs, double *off) {
  const bd_layout *lay = &plan->model->lay;
  for (int m = 0; m < lay->nm; ++m) {
    const bd_mount_tangent *k = &at->mounts[m];
    const double grip = k->friction * c[lay->mount_friction + m] / (1.0 + g * k->decay);
    rhs[lay->np + m] += g * c[lay->travel_speed + m] * plan->mount_inertia[m];
    off[lay->np + m] += g * g * (k->stiffness * c[lay->travel + m] + grip);
  }
}

static void axes_finish(const bd_plan *plan, const bd_derivatives *at, double g, const double *rhs,
                        double *c) {
  const bd_layout *lay = &plan->model->lay;
  for (int m = 0; m < lay->nm; ++m) {
    const bd_mount_tangent *k = &at->mounts[m];
    const double pace = rhs[lay->np + m];
    double *share = &c[lay->mount_friction + m];
    c[lay->travel + m] = g * (c[lay->travel + m] + pace);
    c[lay->travel_speed + m] = pace;
    *share = g * (*share + k->gain * pace) / (1.0 + g * k->decay);
  }
}

/* What a linear system with g leaves out of the speed of mount m [rad/s or m/s], whose stop at
 * y_new is off the line from y: where it has come to the stop, or away. */
static double stop_off_line(const bd_plan *plan, const double *y, const double *y_new, int m,
                            double g) {
  const bd_mounted *mount = &plan->model->mounts[m];
  const int travel = plan->model->lay.travel + m, speed = plan->model->lay.travel_speed + m;
  double lost = 0.0;
  if (!mount->has_stops) {
    return 0.0;
  }
  const double before = bd_mount_stop(mount, y[travel], y[speed], &lost);
  const double after = bd_mount_stop(mount, y_new[travel], y_new[speed], &lost);
  const double line = mount->stop_stiffness * (y_new[travel] - y[travel]) +
                      mount->stop_damping * (y_new[speed] - y[speed]);
  const double off = after - before + (before != 0.0 ? line : 0.0);
  const double stiff = g * (g * mount->stop_stiffness + mount->stop_damping);
  return g * off / (plan->mount_inertia[m] + (after != 0.0 ? stiff : 0.0));
}

/* A mount that meets a stop, or leaves it, goes on as if it had not. */
static double stops_unseen(const bd_plan *plan, const bd_step *step) {
  double most = 0.0;
  for (int m = 0; m < plan->model->lay.nm; ++m) {
    const double faster = stop_off_line(plan, step->y, step->y_new, m, step->g);
    most = fmax(most, step->weights[plan->model->lay.travel_speed + m] * fabs(faster));
  }
  return most;
}

static void mounts_stiffness(bd_stiffening *at) {
  const bd_model *model = at->model;
  const bd_info *info = &model->info;
  const int j = at->pulley, m = model->mount_of[j];
  if (m < 0 || !model->mounts[m].row->moves) {
    return;
  }
  const bd_mounted *mount = &model->mounts[m];
  const double square = mount->lever * mount->lever;
  const double links = model->geometry.code == BD_OK
                           ? model->wraps[j].wrap * model->radius[j] / info->link_length
                           : 0.0;
  const double contact =
      bd_contact_stiffness(info->contact_quadratic, info->contact_linear, at->normal);
  const double stiffness = mount->stiffness + mount->stop_stiffness * mount->has_stops +
                           mount->friction * mount->adapts + links * contact * square;
  const double damping =
      mount->damping + mount->stop_damping * mount->has_stops +
      links * square * bd_contact_damping(model, info->contact_damping, at->normal);
  bd_stiffen(at, BD_STIFF_OWN, "a mount of very small inertia", stiffness / mount->inertia,
             damping / mount->inertia, 0.0);
}

long bd_bounces(const bd_plan *plan, const double *y, const double *y_new) {
  const double LEAST = 0.2; /* of critical damping; below, half of the speed is left */
  const bd_layout *lay = &plan->model->lay;
  double lost = 0.0;
  long bounces = 0;
  for (int m = 0; m < lay->nm; ++m) {
    const bd_mounted *mount = &plan->model->mounts[m];
    const int q = lay->travel + m, v = lay->travel_speed + m;
    bounces += mount->stop_damping < 2.0 * LEAST * sqrt(mount->stop_stiffness * mount->inertia) &&
               bd_mount_stop(mount, y_new[q], y_new[v], &lost) != 0.0 &&
               bd_mount_stop(mount, y[q], y[v], &lost) == 0.0;
  }
  return bounces;
}

/* --- after a step ----------------------------------------------------------------------------- */

/* Contact of two pulleys is told apart by room that the scene has (model.c); a pulley that moves
 * must leave it. */
static int check_room(const bd_plan *plan, double t, int m, bd_error *err) {
  const bd_model *model = plan->model;
  const int j = model->mounts[m].pulley;
  const bd_contact_pulley *moved = &plan->contact_pulleys[j];
  for (int k = 0; k < model->lay.np; ++k) {
    const bd_contact_pulley *other = &plan->contact_pulleys[k];
    if (k == j) {
      continue;
    }
    const double apart = hypot(moved->x - other->x, moved->y - other->y);
    const double span = bd_tangent_length(model, j, k, apart);
    if (span == 0.0 || (plan->friction_on && span < bd_least_span(model, j, k))) {
      return bd_fail_at(
          err, BD_ERR_OFF_PULLEY, "mount", t, -1, j, apart,
          "%s on its mount has come within %.3g m of %s at t = %.9g s, %s: stops "
          "would hold it",
          bd_pulley_label(model, j).text, fmax(0.0, apart - moved->radius - other->radius),
          bd_pulley_label(model, k).text, t,
          span == 0.0 ? "they overlap" : "so near that two links could touch both at once");
    }
  }
  return BD_OK;
}

static int axes_after_step(bd_plan *plan, double t, double *y, double tolerance, int *changed,
                           bd_error *err) {
  const bd_layout *lay = &plan->model->lay;
  int code = BD_OK;
  for (int m = 0; m < lay->nm; ++m) {
    double *share = &y[lay->mount_friction + m];
    if (!plan->model->mounts[m].row->moves) { /* as exact as the time */
      y[lay->travel + m] = y[lay->travel_speed + m] != 0.0 ? t : y[lay->travel + m];
    } else if (fabs(*share) > 1.0) {
      *changed |= fabs(*share) > 1.0 + tolerance;
      *share = copysign(1.0, *share);
    }
  }
  bd_mounts_put(plan, y);
  for (int m = 0; code == BD_OK && m < lay->nm; ++m) {
    code = check_room(plan, t, m, err);
  }
  return code;
}

/* --- energy and outputs ----------------------------------------------------------------------- */

static void mounts_energy(const bd_plan *plan, const double *y, double terms[BD_N_ENERGY]) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  for (int m = 0; m < lay->nm; ++m) {
    const bd_mounted *mount = &model->mounts[m];
    const double q = y[lay->travel + m], v = y[lay->travel_speed + m];
    const bd_place at = bd_mount_place(mount, q);
    terms[BD_ENERGY_kinetic] += 0.5 * mount->inertia * v * v;
    terms[BD_ENERGY_mount] += bd_mount_stored(mount, q);
    terms[BD_ENERGY_gravity] -= mount->mass * (model->gravity[0] * (at.c[0] + model->origin[0]) +
                                               model->gravity[1] * (at.c[1] + model->origin[1]));
  }
}

double bd_mount_belt_force(const bd_plan *plan, const double *y, int m) {
  const bd_mounted *mount = &plan->model->mounts[m];
  const bd_place at = bd_mount_place(mount, y[plan->model->lay.travel + m]);
  double force[2];
  bd_friction_torque(plan, y, mount->pulley, force);
  return -(force[0] * at.a[0] + force[1] * at.a[1]);
}

static void axes_outputs(bd_plan *plan, const double *y, const bd_output *out, size_t k) {
  const bd_layout *lay = &plan->model->lay;
  for (int m = 0; m < lay->nm; ++m) {
    const bd_mounted *mount = &plan->model->mounts[m];
    const size_t at = k * (size_t)lay->nm + (size_t)m;
    const double q = y[lay->travel + m], v = y[lay->travel_speed + m];
    double lost = 0.0;
    bd_put(out->spring_force, at, bd_mount_spring(mount, q));
    bd_put(out->damper_force, at, mount->row->moves ? -mount->damping * v : 0.0);
    bd_put(out->friction_force, at,
           mount->row->moves ? -mount->friction * y[lay->mount_friction + m] : 0.0);
    bd_put(out->stop_force, at, bd_mount_stop(mount, q, v, &lost));
    bd_put(out->belt_force, at, out->belt_force ? bd_mount_belt_force(plan, y, m) : 0.0);
  }
}

static void axes_states(const bd_derivatives *at, const bd_layout *lay,
                        const bd_state_entries *to) {
  for (int m = 0; m < lay->nm; ++m) {
    const int travel = lay->travel + m, share = lay->mount_friction + m;
    const int speed = lay->travel_speed + m;
    to->column(to->reading, travel);
    to->column(to->reading, share);
    to->put(to->reading, travel, speed, 1.0);
    to->put(to->reading, share, speed, at->mounts[m].gain);
    to->put(to->reading, share, share, -at->mounts[m].decay);
  }
}

const bd_effect bd_effect_axes = {
    .name = "axes on mounts",
    .asked_by = BD_MOUNTS(BD_KIND_NAME),
    .enabled = axes_enabled,
    .rate = axes_rate,
    .tangent = axes_tangent,
    .carve = axes_carve,
    .carve_tangent = axes_carve_tangent,
    .finish = axes_finish,
    .states = axes_states,
    .after_step = axes_after_step,
    .unseen = stops_unseen,
    .outputs = axes_outputs,
};

const bd_effect bd_effect_mounts = {
    .name = "mounts",
    .asked_by = BD_SPRUNG_MOUNTS(BD_KIND_NAME),
    .label = mounts_label,
    .enabled = mounts_enabled,
    .rate = mounts_rate,
    .tangent = mounts_tangent,
    .entries = mounts_entries,
    .product = mounts_product,
    .stiffness = mounts_stiffness,
    .energy = mounts_energy,
    .n_works = 1,
    .works = {BD_LOST_IN(mount_loss, "dampers of mounts have given", 0)},
    .store = BD_ENERGY_mount,
};

const bd_effect bd_effect_paths = {
    .name = "prescribed paths",
    .asked_by = "path",
    .enabled = paths_enabled,
    .rate = paths_rate,
    .tangent = bd_tangent_none,
    .n_works = 1,
    .works = {{.row = W_path_work}},
};
