/* SPDX-License-Identifier: MIT
 *
 * Mounts (MODEL section 5): their parameters, where they have the axis of their pulley, and what
 * springs, stops and gravity do to them.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "model/model.h"

/* Chosen: stops, over what the belt holds the mount with; the travel in which friction is
 * developed, of an arm [rad], of a slider over the radius of its pulley. */
static const double STOP = 50.0, PRESLIDING = 0.01;

/* --- rules ------------------------------------------------------------------------------------ */

static int refuse(bd_error *err, int j, const char *name, double value, const char *rule) {
  char field[64];
  snprintf(field, sizeof field, "pulleys[%d].mount.%s", j, name);
  return bd_fail_at(err, BD_ERR_PARAMETER, field, (double)NAN, -1, j, value, "%s %s, got %.10g",
                    field, rule, value);
}

static int check_path(const bd_pulley *pulley, int j, bd_error *err) {
  const bd_mount *mount = pulley->mount;
  if (mount->n_t < 2) {
    return refuse(err, j, "t", (double)mount->n_t, "must hold at least two times");
  }
  for (size_t k = 0; k < mount->n_t; ++k) {
    if (!isfinite(mount->t[k]) || (k > 0 && !(mount->t[k] > mount->t[k - 1]))) {
      return refuse(err, j, "t", mount->t[k], "must be finite and increase (s)");
    }
    for (size_t axis = 0; axis < 2; ++axis) {
      const double value = mount->displacement[2 * k + axis];
      if (!isfinite(value) || (k == 0 && value != 0.0)) {
        return refuse(err, j, "displacement", value,
                      k == 0 ? "must begin with (0, 0), the pulley's center (m)"
                             : "must be finite (m)");
      }
    }
  }
  return BD_OK;
}

static int check_arm(const bd_pulley *pulley, int j, bd_error *err) {
  const bd_mount *mount = pulley->mount;
  const double lever =
      hypot(pulley->center[0] - mount->guide[0], pulley->center[1] - mount->guide[1]);
  if (!(lever > 0.0) || !isfinite(lever)) {
    return refuse(err, j, "pivot", lever, "must be finite and off the pulley's axis, by > 0 m");
  }
  const double least = mount->numbers.mass * lever * lever;
  if (mount->numbers.inertia < least * (1.0 - 1e-9)) {
    char rule[120];
    snprintf(rule, sizeof rule,
             "must be at least %.6g kg m^2, that of its mass on the pulley's axis", least);
    return refuse(err, j, "inertia", mount->numbers.inertia, rule);
  }
  return BD_OK;
}

static int check_slider(const bd_pulley *pulley, int j, bd_error *err) {
  const double *direction = pulley->mount->guide, length = hypot(direction[0], direction[1]);
  return length > 0.0 && isfinite(length)
             ? BD_OK
             : refuse(err, j, "direction", length, "must be finite and of length > 0");
}

/* --- making them ------------------------------------------------------------------------------ */

/* Slopes of the cubic spline through the points that is at rest at both ends (C. de Boor, A
 * Practical Guide to Splines, IV): h_k m_{k-1} + 2 (h_{k-1} + h_k) m_k + h_{k-1} m_{k+1} =
 * 3 (h_k d_{k-1} + h_{k-1} d_k), h the intervals, d the divided differences. */
static void fill_path(bd_mounted *mount, const bd_model *model, const bd_mount *given) {
  (void)model;
  const size_t n = given->n_t;
  const double *t = mount->t, *p = mount->points;
  mount->n_t = n;
  for (size_t axis = 0; axis < 2; ++axis) {
    double *m = mount->slopes + axis, *upper = mount->scratch;
    m[0] = m[2 * (n - 1)] = upper[0] = 0.0;
    for (size_t k = 1; k + 1 < n; ++k) {
      const double before = t[k] - t[k - 1], after = t[k + 1] - t[k];
      const double d0 = (p[2 * k + axis] - p[2 * k - 2 + axis]) / before;
      const double d1 = (p[2 * k + 2 + axis] - p[2 * k + axis]) / after;
      const double pivot = 2.0 * (before + after) - after * upper[k - 1];
      upper[k] = before / pivot;
      m[2 * k] = (3.0 * (after * d0 + before * d1) - after * m[2 * k - 2]) / pivot;
    }
    for (size_t k = n - 1; k-- > 1;) {
      m[2 * k] -= upper[k] * m[2 * k + 2];
    }
  }
  /* a cubic is at most half again as fast as its secant, and half of its ends' slopes */
  for (size_t k = 0; k + 1 < n; ++k) {
    const double *m = mount->slopes + 2 * k, h = t[k + 1] - t[k];
    const double secant = hypot(p[2 * k + 2] - p[2 * k], p[2 * k + 3] - p[2 * k + 1]) / h;
    mount->fastest = fmax(mount->fastest, 1.5 * secant + hypot(m[0], m[1]) + hypot(m[2], m[3]));
  }
}

static void fill_arm(bd_mounted *mount, const bd_model *model, const bd_mount *given) {
  for (int k = 0; k < 2; ++k) {
    mount->guide[k] = given->guide[k] - model->origin[k];
  }
  mount->turning = 1.0;
  mount->lever = hypot(mount->drawn[0] - mount->guide[0], mount->drawn[1] - mount->guide[1]);
}

static void fill_slider(bd_mounted *mount, const bd_model *model, const bd_mount *given) {
  (void)model;
  const bd_slider *slider = &given->numbers;
  const double length = hypot(given->guide[0], given->guide[1]);
  for (int k = 0; k < 2; ++k) {
    mount->guide[k] = given->guide[k] / length;
  }
  mount->inertia = slider->mass + slider->weight;
  mount->preload = slider->preload + BD_GRAVITY * slider->weight;
}

/* Numbers as they are given; what is chosen where they are 0, over the lever. */
static void fill_sprung(bd_mounted *mount, const bd_sprung *given) {
  mount->inertia = given->inertia;
  mount->mass = given->mass;
#define X(group, name, rule, unit, text) mount->name = given->name;
  BD_SPRUNG(X, sprung, , , , , )
#undef X
}

static void choose(bd_mounted *mount, const bd_model *model) {
  const double unit = mount->row->angle ? 1.0 : model->radius[mount->pulley];
  const double held = 4.0 * model->belt.axial_stiffness / model->belt.length;
  if (mount->friction > 0.0) {
    mount->adapts = mount->friction_stiffness > 0.0 ? mount->friction_stiffness / mount->friction
                                                    : 1.0 / (PRESLIDING * unit);
  }
  mount->has_stops = mount->highest > mount->lowest;
  if (mount->stop_stiffness == 0.0) {
    mount->stop_stiffness = STOP * held * mount->lever * mount->lever;
    if (mount->stop_damping == 0.0) {
      mount->stop_damping = sqrt(mount->stop_stiffness * mount->inertia);
    }
  }
}

/* --- where the axis is ------------------------------------------------------------------------ */

/* A piece of the spline by its ends' values and slopes, at the share s of its length h. */
static void piece_of(const double p[2], const double m[2], double h, double s, double out[3]) {
  const double rise = p[1] - p[0], bow = h * m[0] - rise, end = rise - h * m[1];
  /* p0 + s rise + s (1 - s) (bow (1 - s) + end s) */
  const double inner = bow * (1.0 - s) + end * s, slope = end - bow;
  out[0] = p[0] + s * rise + s * (1.0 - s) * inner;
  out[1] = (rise + (1.0 - 2.0 * s) * inner + s * (1.0 - s) * slope) / h;
  out[2] = (-2.0 * inner + 2.0 * (1.0 - 2.0 * s) * slope) / (h * h);
}

static bd_place place_on_path(const bd_mounted *mount, double t) {
  const size_t n = mount->n_t;
  bd_place at = {.c = {mount->drawn[0], mount->drawn[1]}};
  size_t low = 0, high = n - 1;
  if (t <= mount->t[0] || t >= mount->t[n - 1]) {
    const size_t end = t <= mount->t[0] ? 0 : n - 1;
    at.c[0] += mount->points[2 * end];
    at.c[1] += mount->points[2 * end + 1];
    return at;
  }
  while (high - low > 1) {
    const size_t middle = (low + high) / 2;
    if (mount->t[middle] <= t) {
      low = middle;
    } else {
      high = middle;
    }
  }
  const double h = mount->t[high] - mount->t[low], s = (t - mount->t[low]) / h;
  for (size_t axis = 0; axis < 2; ++axis) {
    const double p[2] = {mount->points[2 * low + axis], mount->points[2 * high + axis]};
    const double m[2] = {mount->slopes[2 * low + axis], mount->slopes[2 * high + axis]};
    double found[3];
    piece_of(p, m, h, s, found);
    at.c[axis] += found[0];
    at.a[axis] = found[1];
    at.bend[axis] = found[2];
  }
  return at;
}

static bd_place place_on_slider(const bd_mounted *mount, double q) {
  const double *along = mount->guide;
  return (bd_place){.c = {mount->drawn[0] + q * along[0], mount->drawn[1] + q * along[1]},
                    .a = {along[0], along[1]}};
}

static bd_place place_on_arm(const bd_mounted *mount, double q) {
  const double dx = mount->drawn[0] - mount->guide[0], dy = mount->drawn[1] - mount->guide[1];
  const double x = cos(q) * dx - sin(q) * dy, y = sin(q) * dx + cos(q) * dy;
  return (bd_place){
      .c = {mount->guide[0] + x, mount->guide[1] + y}, .a = {-y, x}, .bend = {-x, -y}};
}

/* --- the table -------------------------------------------------------------------------------- */

static const bd_mount_kind kinds[] = {
    [BD_MOUNT_ARM] = {.name = "arm",
                      .many = "arms",
                      .guide = "pivot",
                      .moves = 1,
                      .angle = 1,
                      .step = 1e-3,
                      .longest = 3e-2,
                      .farthest = BD_PI,
                      .check = check_arm,
                      .fill = fill_arm,
                      .place = place_on_arm},
    [BD_MOUNT_SLIDER] = {.name = "slider",
                         .many = "sliders",
                         .guide = "direction",
                         .moves = 1,
                         .step = 2e-4,
                         .longest = 5e-3,
                         .farthest = 1.0,
                         .check = check_slider,
                         .fill = fill_slider,
                         .place = place_on_slider},
    [BD_MOUNT_PATH] = {.name = "path",
                       .many = "paths",
                       .check = check_path,
                       .fill = fill_path,
                       .place = place_on_path},
};

const char *bd_mount_name(int kind, const char **guide) {
  const int known = kind >= 0 && kind < BD_N_MOUNTS;
  *guide = known ? kinds[kind].guide : NULL;
  return known ? kinds[kind].name : NULL;
}

int bd_mount_check(const bd_scene *scene, int j, bd_error *err) {
  const bd_mount *mount = scene->pulleys[j].mount;
  const bd_belt_model *belt = bd_belt_model_of(&scene->belt);
  const char *guide, *name = bd_mount_name(mount->kind, &guide);
  char label[40];
  snprintf(label, sizeof label, "pulleys[%d].mount", j);
  if (belt && !belt->facts.mounts) {
    return bd_fail_at(err, BD_ERR_PARAMETER, label, (double)NAN, -1, j, (double)NAN,
                      "%s: a pulley with a mount needs belt.mesh \"joint\" or \"ale\"", label);
  }
  if (!name) {
    return refuse(err, j, "kind", mount->kind, "must be one of BD_MOUNT_...");
  }
  const double lowest = mount->numbers.lowest, highest = mount->numbers.highest;
  int code = bd_parameters_check(name, label, &mount->numbers, err);
  code = code == BD_OK ? kinds[mount->kind].check(&scene->pulleys[j], j, err) : code;
  return code != BD_OK || highest > lowest || (lowest == 0.0 && highest == 0.0)
             ? code
             : refuse(err, j, "highest", highest, "must be > lowest");
}

void bd_model_carve_mounts(bd_carver *carver, bd_model *model, const bd_scene *scene) {
  int n = 0;
  for (int j = 0; j < scene->n_pulleys; ++j) {
    n += scene->pulleys[j].mount != NULL;
  }
  model->lay.nm = n;
  if (n == 0) {
    return;
  }
  BD_CARVE(carver, model->mounts, n);
  BD_CARVE(carver, model->mounted, n);
  BD_CARVE(carver, model->mount_of, scene->n_pulleys);
  for (int j = 0, m = 0; j < scene->n_pulleys; ++j) {
    const bd_mount *mount = scene->pulleys[j].mount;
    if (!mount) {
      continue;
    }
    bd_mounted *made = carver->base ? &model->mounts[m++] : &(bd_mounted){0};
    bd_given(carver, &mount->kind, sizeof mount->kind);
    bd_given(carver, mount->guide, sizeof mount->guide);
    bd_given(carver, &mount->numbers, sizeof mount->numbers);
    made->t = bd_carve_copy(carver, mount->t, mount->n_t);
    made->points = bd_carve_copy(carver, mount->displacement, 2 * mount->n_t);
    BD_CARVE(carver, made->slopes, 2 * mount->n_t);
    BD_CARVE(carver, made->scratch, mount->n_t);
  }
}

void bd_model_fill_mounts(bd_model *model, const bd_scene *scene) {
  int has[BD_N_MOUNTS] = {0};
  for (int j = 0, m = 0; model->lay.nm > 0 && j < scene->n_pulleys; ++j) {
    const bd_mount *given = scene->pulleys[j].mount;
    model->mount_of[j] = given ? m : -1;
    if (!given) {
      continue;
    }
    bd_mounted *mount = &model->mounts[m];
    model->mounted[m++] = mount->pulley = j;
    mount->kind = given->kind;
    mount->row = &kinds[given->kind];
    mount->drawn[0] = model->cx[j];
    mount->drawn[1] = model->cy[j];
    mount->lever = 1.0;
    fill_sprung(mount, &given->numbers);
    mount->row->fill(mount, model, given);
    if (mount->row->moves) {
      choose(mount, model);
      ++model->n_moving;
      has[mount->kind] = 1;
    }
  }
  size_t at = 0;
  for (int k = 0; k < BD_N_MOUNTS; ++k) {
    if (has[k]) {
      at += (size_t)snprintf(model->moving + at, sizeof model->moving - at, "%s%s",
                             at > 0 ? " and " : "mounts: ", kinds[k].many);
    }
  }
}

void bd_mount_direction(const bd_mount *given, const double center[2], double direction[2]) {
  static const bd_model nowhere;
  bd_mounted mount = {.row = &kinds[given->kind], .drawn = {center[0], center[1]}};
  mount.row->fill(&mount, &nowhere, given);
  const bd_place at = bd_mount_place(&mount, 0.0);
  memcpy(direction, at.a, sizeof at.a);
}

bd_mount_numbers bd_model_mount(const bd_model *model, int m) {
  const bd_mounted *mount = &model->mounts[m];
  return (bd_mount_numbers){.inertia = mount->inertia,
                            .friction_stiffness = mount->friction * mount->adapts,
                            .stop_stiffness = mount->stop_stiffness,
                            .stop_damping = mount->stop_damping};
}

/* --- what acts on it -------------------------------------------------------------------------- */

double bd_mount_spring(const bd_mounted *mount, double q) {
  return mount->preload - mount->stiffness * q;
}

/* One stop, p deep and going deeper at the rate `pace`: a force that never pulls. */
static double stop_force(const bd_mounted *mount, double p, double pace, double *loss) {
  if (!(p > 0.0)) {
    return 0.0;
  }
  const double elastic = mount->stop_stiffness * p;
  const double force = fmax(0.0, elastic + mount->stop_damping * pace);
  *loss += (force - elastic) * pace;
  return force;
}

double bd_mount_stop(const bd_mounted *mount, double q, double v, double *loss) {
  return mount->has_stops ? stop_force(mount, mount->lowest - q, -v, loss) -
                                stop_force(mount, q - mount->highest, v, loss)
                          : 0.0;
}

double bd_mount_weight(const bd_model *model, const bd_mounted *mount, const bd_place *at) {
  return mount->mass * (model->gravity[0] * at->a[0] + model->gravity[1] * at->a[1]);
}

double bd_mount_stored(const bd_mounted *mount, double q) {
  const double low = mount->has_stops ? fmax(0.0, mount->lowest - q) : 0.0;
  const double high = mount->has_stops ? fmax(0.0, q - mount->highest) : 0.0;
  return 0.5 * mount->stiffness * q * q - mount->preload * q +
         0.5 * mount->stop_stiffness * (low * low + high * high);
}

void bd_model_mount_forces(const bd_model *model, const double *travel, double *force) {
  for (int m = 0; m < model->lay.nm; ++m) {
    const bd_mounted *mount = &model->mounts[m];
    double loss = 0.0;
    force[m] = mount->row->moves
                   ? bd_mount_spring(mount, travel[m]) + bd_mount_stop(mount, travel[m], 0.0, &loss)
                   : 0.0;
  }
}
