/* SPDX-License-Identifier: MIT
 *
 * From a scene to a model: every parameter against its rule (fields.h), the constants per link
 * (MODEL section 6), the belt line, friction slots, and the spectral bound of the joints.
 *
 * Spectral bound. In a chain of links with I = m l0^2 / 12 rotation of all links in the same sense
 * shears the joints most (12 c / m), rotation of neighbours in opposite senses bends them most
 * (4 c_tor / I). The sums k = 12 c / m + 4 c_tor / I and d = 12 b / m + 4 b_tor / I bound both,
 * exactly without bending stiffness: |lambda| <= sqrt(k), or (d + sqrt(d^2 - 4 k)) / 2 when
 * over-damped. Explicit steps end at (the method's stability limit) / |lambda|.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "model/model.h"

/* Parameters that are pairs of numbers, and so no rows of the table. */
static int check_pair(const char *label, const double pair[2], const char *what, bd_error *err) {
  for (int k = 0; k < 2; ++k) {
    if (!isfinite(pair[k])) {
      char field[64];
      snprintf(field, sizeof field, "%s.%c", label, k ? 'y' : 'x');
      return bd_fail_at(err, BD_ERR_PARAMETER, field, (double)NAN, -1, -1, pair[k],
                        "%s must be finite (%s), got %.10g", field, what, pair[k]);
    }
  }
  return BD_OK;
}

static int check_scene(const bd_scene *scene, bd_error *err) {
  const bd_contact *contact = &scene->contact;
  char label[40];
  if (scene->n_pulleys < 1 || scene->n_pulleys > BD_MAX_PULLEYS) {
    return bd_fail(err, BD_ERR_PARAMETER, "pulleys", "pulleys must hold 1 to %d pulleys, got %d",
                   BD_MAX_PULLEYS, scene->n_pulleys);
  }
  if (bd_parameters_check("belt", "belt", &scene->belt, err) != BD_OK ||
      bd_parameters_check("contact", "contact", contact, err) != BD_OK ||
      (scene->friction && bd_friction_check(scene->friction, "friction", err) != BD_OK) ||
      check_pair("gravity", scene->gravity, "acceleration, m/s^2", err) != BD_OK) {
    return BD_ERR_PARAMETER;
  }
  for (int j = 0; j < scene->n_pulleys; ++j) {
    const bd_pulley *pulley = &scene->pulleys[j];
    snprintf(label, sizeof label, "pulleys[%d].center", j);
    int code = check_pair(label, pulley->center, "position of the axis, m", err);
    snprintf(label, sizeof label, "pulleys[%d]", j);
    code = code == BD_OK ? bd_parameters_check("pulley", label, pulley, err) : code;
    snprintf(label, sizeof label, "pulleys[%d].drag", j);
    code = code == BD_OK ? bd_parameters_check("drag", label, &pulley->drag, err) : code;
    snprintf(label, sizeof label, "pulleys[%d].friction", j);
    code =
        code == BD_OK && pulley->friction ? bd_friction_check(pulley->friction, label, err) : code;
    code = code == BD_OK && pulley->mount ? bd_mount_check(scene, j, err) : code;
    code = code == BD_OK && pulley->coupling ? bd_coupling_check(scene, j, err) : code;
    if (code != BD_OK) {
      return code;
    }
  }
  if (bd_names_check(scene, err) != BD_OK || bd_belt_check(&scene->belt, err) != BD_OK) {
    return BD_ERR_PARAMETER;
  }
  if (!(contact->linear > 0.0 || contact->quadratic > 0.0)) {
    return bd_fail(
        err, BD_ERR_PARAMETER, "contact.linear",
        "contact.linear and contact.quadratic must not both be 0: nothing would hold the "
        "belt off its pulleys");
  }
  return BD_OK;
}

static double spectral_bound(const bd_info *info, double shear) {
  double m = info->link_mass, inertia = info->link_inertia;
  double k = shear * info->joint_stiffness / m + 4.0 * info->bending_stiffness / inertia;
  double d = shear * info->joint_damping / m + 4.0 * info->bending_damping / inertia;
  double discriminant = d * d - 4.0 * k;
  return discriminant > 0.0 ? 0.5 * (d + sqrt(discriminant)) : sqrt(k);
}

/* Links whose ends lie on the circle of R a / sin a, a half the angle of a link, have the length of
 * the arcs of radius R that they stand for. A compensated contact begins so far outside that the
 * belt, under its preload, sinks in to these. */
static double contact_radius(const bd_model *model, int j) {
  const int laid = model->geometry.code == BD_OK, sinks = model->contact.compensate && laid;
  const bd_belt_facts *is = &model->belt_model->facts;
  const double stretched = laid && is->stretches ? 1.0 + model->info.strain : 1.0;
  const double radius = model->radius[j];
  const double a = 0.5 * stretched * model->info.link_length / radius;
  const int chords = !is->tangents && !model->drive; /* or arcs */
  return (chords && a < 0.5 * BD_PI ? radius * a / sin(a) : radius) +
         (sinks ? bd_model_depth(model, radius, model->info.strain_tension, 0.0) : 0.0);
}

double bd_tangent_length(const bd_model *model, int j, int k, double apart) {
  const double r = model->contact_radius[j], other = model->contact_radius[k];
  const double apart_radii = model->side[j] == model->side[k] ? r - other : r + other;
  return apart < r + other ? 0.0 : sqrt(apart * apart - apart_radii * apart_radii);
}

static double tangent_between(const bd_model *model, int j, int k) {
  return bd_tangent_length(model, j, k,
                           hypot(model->cx[j] - model->cx[k], model->cy[j] - model->cy[k]));
}

double bd_tightest_radius(const bd_model *model) {
  double tightest = model->radius[0];
  for (int j = 1; j < model->lay.np; ++j) {
    tightest = fmin(tightest, model->radius[j]);
  }
  return tightest;
}

/* Of a span between pulleys that can hold one link, or joint, at once: its length in links. */
static double links_between(const bd_model *model, int j, int k) {
  return tangent_between(model, j, k) * model->belt.n_bodies / model->belt.length;
}

/* How far the belt dips into pulley j beyond its tangent: half a link as a chord, further as it
 * sinks in, here under twice the tension at rest [links]. */
static double dip(const bd_model *model, int j) {
  const double length = model->info.link_length;
  const double tension = 2.0 * model->info.strain_tension;
  const double depth = tension > 0.0 ? bd_model_depth(model, model->radius[j], tension, 0.0) : 0.0;
  return sqrt(0.25 + 2.0 * model->radius[j] * depth / (length * length));
}

/* A joint of two links touches two pulleys at once by their far ends. */
static double least_apart(const bd_model *model, int j, int k) {
  const double reach = model->belt_model->facts.reach;
  return reach > 0.0 ? 2.0 * reach + dip(model, j) + dip(model, k) : 0.0;
}

double bd_least_span(const bd_model *model, int j, int k) {
  const double least = model->belt_model->facts.least_span;
  const double links = model->slot[j] == model->slot[k] ? least_apart(model, j, k) : least;
  return links * model->belt.length / model->belt.n_bodies;
}

static int share_links(const bd_model *model, int j, int k) {
  const double ROOM = 0.5; /* for axes that move */
  const int moves = model->mount_of && (model->mount_of[j] >= 0 || model->mount_of[k] >= 0);
  return links_between(model, j, k) <= least_apart(model, j, k) + (moves ? ROOM : 0.0);
}

/* These need slots of their own; all others share: greedy colouring. */
static int colour_pulleys(const bd_model *model) {
  int np = model->lay.np, slots = 1;
  for (int j = 0; j < np; ++j) {
    int slot = 0;
    for (int again = 1; again;) {
      again = 0;
      for (int k = 0; k < j; ++k) {
        if (model->slot[k] == slot && share_links(model, j, k)) {
          ++slot;
          again = 1;
        }
      }
    }
    model->slot[j] = slot;
    slots = slot + 1 > slots ? slot + 1 : slots;
  }
  return slots;
}

static void lay_out(bd_model *model, int np, int slots, int states, int drag) {
  bd_layout *lay = &model->lay;
  const int n = model->info.n_bodies;
  bd_place_fields(lay, model->belt_model->facts.fields);
  lay->n = n;
  lay->n8 = (n + BD_LANES - 1) / BD_LANES * BD_LANES;
  lay->np = np;
  lay->slots = slots;
  lay->states = states;
  /* An odd number of cache lines, so that the same link's entries of all blocks do not share sets
   * of the cache. */
  lay->stride = BD_LANES * ((BD_HALO + n + 1 + BD_LANES - 1) / BD_LANES | 1);
  lay->mounted = model->mounted;
  bd_layout_fields(lay);
  lay->n_work = lay->nc > 0   ? MAX_WORK
                : lay->nm > 0 ? W_path_work + 1
                : drag        ? W_drag_loss + 1
                              : W_drag_loss;
  bd_model_place_rims(model);
  lay->size = (size_t)(lay->work + lay->n_work + BD_LANES - 1) / BD_LANES * BD_LANES;
}

static void carve(bd_carver *carver, bd_model *model, const bd_scene *scene, int drag) {
  const int np = scene->n_pulleys;
  BD_CARVE(carver, model->cx, np);
  BD_CARVE(carver, model->cy, np);
  BD_CARVE(carver, model->radius, np);
  BD_CARVE(carver, model->contact_radius, np);
  BD_CARVE(carver, model->inertia, np);
  BD_CARVE(carver, model->rim_inertia, np);
  BD_CARVE(carver, model->rim, np);
  if (drag) {
    BD_CARVE(carver, model->drag, np);
  }
  BD_CARVE(carver, model->friction, np);
  BD_CARVE(carver, model->slot, np);
  BD_CARVE(carver, model->side, np);
  BD_CARVE(carver, model->winding, np);
  BD_CARVE(carver, model->name, np);
  BD_CARVE(carver, model->wraps, np);
  const bd_belt_model *belt = bd_belt_model_of(&scene->belt);
  if (belt->carve_drive) {
    belt->carve_drive(carver, &model->drive, np);
  }
  bd_model_carve_mounts(carver, model, scene);
  bd_model_carve_couplings(carver, model, scene);
}

/* Of n links or cells of this length. */
static void derive(bd_model *model, int n, double l0) {
  const bd_belt *belt = &model->belt;
  bd_info *info = &model->info;
  info->n_bodies = n;
  info->lacks = model->belt_model->facts.lacks;
  info->n_pulleys = model->lay.np;
  info->length = belt->length;
  info->link_length = l0;
  info->link_mass = belt->linear_density * l0;
  info->link_inertia = info->link_mass * l0 * l0 / model->belt_model->facts.shear;
  info->joint_stiffness = belt->axial_stiffness / l0;
  info->joint_damping = belt->axial_damping / l0;
  info->bending_stiffness = belt->bending_stiffness / l0;
  info->bending_damping = belt->bending_damping / l0;
  info->contact_quadratic = model->contact.quadratic * l0;
  info->contact_linear = model->contact.linear * l0;
  info->contact_damping = model->contact.damping * l0;
  info->spectral_bound = spectral_bound(info, model->belt_model->facts.shear);
}

/* A link of angle 2 a lies as a tangent, longer than its arc by tan(a) / a - 1 (MODEL section 6);
 * infinite when it is too long to lie on the pulley at all. */
static double mesh_strain(const bd_model *model) {
  double longer = 0.0;
  for (int j = 0; model->belt_model->facts.tangents && j < model->lay.np; ++j) {
    double a = 0.5 * model->info.link_length / model->radius[j];
    double arc = model->wraps[j].wrap * model->radius[j];
    longer += a < 0.5 * BD_PI ? arc * (tan(a) / a - 1.0) : (double)INFINITY;
  }
  return longer / model->belt.length;
}

/* The belt lies on circles that the pressure T / R has made smaller, and is that much less
 * strained: T = EA (strain - sum of wrap p(T) / L), by bisection. Compensated, it lies on R. */
static double contact_strain(const bd_model *model) {
  if (model->contact.compensate) {
    return 0.0;
  }
  double low = 0.0, high = model->info.strain;
  for (int k = 0; k < 60; ++k) {
    double left = 0.5 * (low + high), sunk = 0.0;
    for (int j = 0; j < model->lay.np; ++j) {
      sunk += model->wraps[j].wrap *
              bd_model_depth(model, model->radius[j], model->belt.axial_stiffness * left, 0.0);
    }
    if (left > model->info.strain - sunk / model->belt.length) {
      high = left;
    } else {
      low = left;
    }
  }
  return model->info.strain - low;
}

/* Beyond this share of a radius the depth that a compensated contact is raised by is no longer
 * small against it. */
static const double MOST_RAISED = 0.1;

static void check_compensation(bd_model *model) {
  for (int j = 0; model->contact.compensate && j < model->lay.np; ++j) {
    const double depth = bd_model_depth(model, model->radius[j], model->info.strain_tension, 0.0);
    if (!(depth <= MOST_RAISED * model->radius[j])) {
      bd_fail_at(&model->geometry, BD_ERR_GEOMETRY, "contact.compensate", (double)NAN, -1, j, depth,
                 "contact.compensate: at a tension of %.3g N the belt sinks %.3g m into %s, at "
                 "most %g of its radius can be compensated: contact.linear is too small",
                 model->info.strain_tension, depth, bd_pulley_label(model, j).text, MOST_RAISED);
      return;
    }
  }
}

static bd_route route_of(const bd_model *model) {
  return (bd_route){.np = model->lay.np,
                    .cx = model->cx,
                    .cy = model->cy,
                    .radius = model->radius,
                    .side = model->side,
                    .name = model->name,
                    .wraps = model->wraps};
}

double bd_model_tension(bd_model *model, bd_error *err) {
  bd_route route = route_of(model);
  if (bd_belt_line_lay(&route, err) != BD_OK) {
    return (double)NAN;
  }
  model->info.strain = route.length / model->belt.length - 1.0;
  model->info.strain_tension = model->belt.axial_stiffness * model->info.strain;
  return model->info.strain > 0.0 ? bd_rest_tension(model, 0.0) : 0.0;
}

static void check_line(bd_model *model) {
  bd_info *info = &model->info;
  bd_error *err = &model->geometry;
  const int np = model->lay.np;
  bd_route route = route_of(model);
  const int code = bd_belt_line_lay(&route, err);
  const double path = route.length;
  info->winding = route.turns;
  info->path_length = code == BD_OK ? path : (double)NAN;
  info->strain = info->path_length / model->belt.length - 1.0;
  info->strain_tension = model->belt.axial_stiffness * info->strain;
  model->longest_span = 0.0;
  for (int k = 0; k < np; ++k) {
    model->longest_span = fmax(model->longest_span, model->wraps[k].span);
  }
  for (int k = 0; k < np; ++k) {
    model->winding[k] = code == BD_OK ? bd_belt_line_winding(&route, k) : route.direction;
  }
  info->mean_tension = info->strain_tension;
  if (code != BD_OK) {
    return;
  }
  info->mesh_strain = mesh_strain(model);
  info->contact_strain = info->strain > 0.0 ? contact_strain(model) : 0.0;
  if (info->strain <= 0.0) {
    bd_fail_at(err, BD_ERR_GEOMETRY, "belt.length", (double)NAN, -1, -1, model->belt.length,
               "belt.length is too long for its pulleys: %g m, but the belt line round them is "
               "%g m, so the belt would be slack",
               model->belt.length, path);
  } else if (info->strain > BD_MAX_STRAIN) {
    bd_fail_at(err, BD_ERR_GEOMETRY, "belt.length", (double)NAN, -1, -1, model->belt.length,
               "belt.length is too short for its pulleys: %g m round a belt line of %g m is a "
               "strain of %.3g, at most %g is allowed",
               model->belt.length, path, info->strain, BD_MAX_STRAIN);
  } else if (info->mesh_strain > BD_MAX_STRAIN) {
    bd_fail_at(err, BD_ERR_GEOMETRY, "belt.n_bodies", (double)NAN, -1, -1, info->n_bodies,
               "belt.n_bodies is too small for its pulleys: %d links of %g m, laid round them as "
               "tangents, add a strain of %.3g, at most %g is allowed",
               info->n_bodies, info->link_length, info->mesh_strain, BD_MAX_STRAIN);
  } else {
    check_compensation(model);
  }
  if (err->code == BD_OK) {
    info->mean_tension = bd_rest_tension(model, 0.0);
  }
}

static void check_room(bd_model *model) {
  const bd_info *info = &model->info;
  const double least = model->belt_model->facts.least_span;
  int first = 0, second = 0;
  double shortest = (double)INFINITY;
  for (int j = 0; j < model->lay.np; ++j) {
    for (int k = 0; k < j; ++k) {
      const double links = links_between(model, k, j);
      if (links < shortest) {
        shortest = links;
        first = k;
        second = j;
      }
    }
  }
  if (model->geometry.code == BD_OK && model->has_friction &&
      (shortest == 0.0 || shortest < least)) {
    bd_fail_at(&model->geometry, BD_ERR_GEOMETRY, "belt.n_bodies", (double)NAN, -1, first,
               info->n_bodies,
               "belt.n_bodies is too small for its pulleys: two of %d links of %g m could touch "
               "%s at once; %s would be short enough",
               info->n_bodies, info->link_length, bd_pulleys_label(model, first, second).text,
               bd_links_label(least / shortest * info->n_bodies).text);
  }
}

/* Origin of the core's coordinates along one axis: 0 for a scene near it, so that positions pass
 * through unchanged to the last bit, else near the pulleys, so that distance costs no digits. */
static double origin_along(const bd_scene *scene, int axis) {
  double low = scene->pulleys[0].center[axis], high = low;
  for (int j = 1; j < scene->n_pulleys; ++j) {
    low = fmin(low, scene->pulleys[j].center[axis]);
    high = fmax(high, scene->pulleys[j].center[axis]);
  }
  double unit = exp2(2.0 + ceil(log2(high - low + scene->belt.length)));
  return unit * rint(0.5 * (low + high) / unit);
}

/* Of the speed that errors are measured by (bd_stepper_weigh): a creep of it is far below what slip
 * there is in a drive, and steps can still follow the change of sign. */
static const double DRAG_SPEED = 1e-3;

static int has_drag(const bd_scene *scene) {
  int found = 0;
  for (int j = 0; j < scene->n_pulleys; ++j) {
    const bd_drag *drag = &scene->pulleys[j].drag;
    found |= drag->coulomb > 0.0 || drag->viscous > 0.0 || drag->quadratic > 0.0;
  }
  return found;
}

/* What follows from numbers that keep their rules: a link's mass and stiffness must be numbers that
 * can be computed with, and so must squares of distances. */
static const double LARGEST_DISTANCE = 1e150;

static int check_derived(const bd_model *model, bd_error *err) {
  const bd_info *info = &model->info;
  const struct {
    const char *field;
    int kept;
    double value;
  } rows[] = {
      {"belt.length", info->link_inertia > 0.0, model->belt.length},
      {"belt.length", model->belt.length <= LARGEST_DISTANCE, model->belt.length},
      {"belt.linear_density", isfinite(info->link_inertia), model->belt.linear_density},
      {"belt.axial_stiffness", isfinite(info->joint_stiffness), model->belt.axial_stiffness},
      {"belt.axial_damping", isfinite(info->joint_damping), model->belt.axial_damping},
      {"belt.bending_stiffness", isfinite(info->bending_stiffness), model->belt.bending_stiffness},
      {"belt.bending_damping", isfinite(info->bending_damping), model->belt.bending_damping},
      {"belt.linear_density", isfinite(info->spectral_bound), model->belt.linear_density},
      {"contact.quadratic", isfinite(info->contact_quadratic), model->contact.quadratic},
      {"contact.linear", isfinite(info->contact_linear), model->contact.linear},
      {"contact.damping", isfinite(info->contact_damping), model->contact.damping},
      {"pulleys", model->far_away <= LARGEST_DISTANCE, model->far_away},
  };
  for (size_t k = 0; k < sizeof rows / sizeof rows[0]; ++k) {
    if (!rows[k].kept) {
      return bd_fail_at(err, BD_ERR_PARAMETER, rows[k].field, (double)NAN, -1, -1, rows[k].value,
                        "%s: out of all scale with the rest of the drive (%d links), %g is beyond "
                        "what double precision can compute with",
                        rows[k].field, model->belt.n_bodies, rows[k].value);
    }
  }
  return BD_OK;
}

int bd_model_create(bd_model **out, const bd_scene *scene, bd_error *err) {
  *out = NULL;
  if (check_scene(scene, err) != BD_OK) {
    return BD_ERR_PARAMETER;
  }
  const bd_kernels *kernels = bd_kernels_choose();
  if (!kernels) {
    return bd_fail(
        err, BD_ERR_OPTION, "BELTDYN_KERNELS",
        "BELTDYN_KERNELS must name a kernel level this processor has, of baseline, avx2, "
        "avx512, or be unset");
  }
  int np = scene->n_pulleys;
  bd_model *model = NULL;
  bd_carver carver = {0};
  bd_model sizes;
  bd_carve(&carver, 1, sizeof *model);
  const int drag = has_drag(scene);
  carve(&carver, &sizes, scene, drag);
  char *block = bd_block_new(carver.used);
  if (!block) {
    return bd_fail(err, BD_ERR_MEMORY, "model", "out of memory for a model of %zu bytes",
                   carver.used);
  }
  carver = (bd_carver){.base = block, .given = bd_scene_sum(scene)};
  model = bd_carve(&carver, 1, sizeof *model);
  carve(&carver, model, scene, drag);
  model->given = carver.given;

  model->belt = scene->belt;
  model->contact = scene->contact;
  bd_names_copy(model->name, np, scene->pulleys);
  model->has_bending = scene->belt.bending_stiffness > 0.0 || scene->belt.bending_damping > 0.0;
  model->has_gravity = scene->gravity[0] != 0.0 || scene->gravity[1] != 0.0;
  for (int k = 0; k < 2; ++k) {
    model->gravity[k] = scene->gravity[k];
    model->origin[k] = origin_along(scene, k);
  }
  for (int j = 0; j < np; ++j) {
    model->cx[j] = scene->pulleys[j].center[0] - model->origin[0];
    model->cy[j] = scene->pulleys[j].center[1] - model->origin[1];
    model->radius[j] = scene->pulleys[j].radius;
    model->inertia[j] = model->rim_inertia[j] = scene->pulleys[j].inertia;
    model->side[j] = scene->pulleys[j].outside ? -1 : 1;
    if (drag) {
      model->drag[j] = scene->pulleys[j].drag;
    }
    const bd_friction *friction = scene->pulleys[j].friction;
    friction = friction ? friction : scene->friction;
    if (friction && friction->law != BD_LAW_NONE) {
      model->friction[j] = *friction;
      model->has_friction = 1;
    }
  }
  model->far_away = 1e6;
  for (int j = 0; j < np; ++j) {
    double reach = fabs(model->cx[j]) + fabs(model->cy[j]) + model->radius[j];
    double far = 1e3 * (reach + model->belt.length);
    model->far_away = far <= model->far_away ? model->far_away : far; /* or NaN, to be refused */
  }
  model->belt_model = bd_belt_model_of(&scene->belt);
  model->lay.np = np;
  derive(model, scene->belt.n_bodies, scene->belt.length / scene->belt.n_bodies);
  if (check_derived(model, err) != BD_OK) {
    bd_model_free(model);
    return BD_ERR_PARAMETER;
  }
  bd_model_fill_couplings(model, scene);
  bd_model_fill_mounts(model, scene);
  if (bd_mounts_rest(model) == BD_OK) {
    check_line(model);
  }
  for (int j = 0; j < np; ++j) {
    model->contact_radius[j] = contact_radius(model, j);
  }
  model->colours = colour_pulleys(model);
  if (model->belt_model->shape) {
    const double shortest = model->belt_model->shape(model);
    derive(model, model->lay.n, shortest);
    model->info.n_modes = model->lay.n_modes;
    model->info.n_along = model->lay.n_along;
  }
  check_room(model);
  lay_out(model, np, model->has_friction ? model->colours : 0, bd_friction_most_states(model),
          drag);
  model->info.n_slots = model->lay.slots;
  model->info.n_states = model->lay.states;
  model->info.n_mounts = model->lay.nm;
  model->info.n_couplings = model->lay.nc;
  model->info.drag_speed = DRAG_SPEED * bd_speed_scale(model);
  model->kernels = &kernels[bd_model_belt(model)];
  model->friction_scales_differ = bd_friction_scales_differ(model);
  *out = model;
  return BD_OK;
}

void bd_model_free(bd_model *model) {
  bd_block_free(model);
}

int bd_model_check_geometry(const bd_model *model, bd_error *err) {
  if (err) {
    *err = model->geometry;
  }
  return model->geometry.code;
}

void bd_model_info(const bd_model *model, bd_info *info) {
  *info = model->info;
}

double bd_speed_scale(const bd_model *model) {
  const double LINKS_OF_THE_PAPER = 60.0;
  double strain = model->geometry.code == BD_OK ? model->info.strain : 0.01;
  return strain * sqrt(model->belt.axial_stiffness / model->belt.linear_density) /
         LINKS_OF_THE_PAPER;
}

double bd_round_time(const bd_model *model) {
  return model->belt.length * sqrt(model->belt.linear_density / model->belt.axial_stiffness);
}

double bd_wave_life(const bd_model *model) {
  const double omega = 2.0 * BD_PI / bd_round_time(model);
  return 2.0 * model->belt.axial_stiffness / (model->belt.axial_damping * omega * omega);
}
