/* SPDX-License-Identifier: MIT
 *
 * Upper estimate of the largest eigenvalue of the drive, and which part causes it: the joints'
 * closed form (model.c), and what contact, friction, the pulleys' inertia, their drag and loads
 * add, at twice the tension of rest, for a drive under load has a tight side. Explicit fixed steps
 * are chosen by it, and messages of runs that make no progress name that part.
 */
#include <math.h>

#include "solvers/solvers.h"

/* |lambda| of an oscillator of unit mass. */
static double lambda(double stiffness, double damping) {
  double d2 = damping * damping, k4 = 4.0 * stiffness;
  return d2 > k4 ? 0.5 * (damping + sqrt(d2 - k4)) : sqrt(stiffness);
}

bd_stiffness bd_stiffness_of(const bd_model *model, const bd_torque_set *set) {
  const bd_info *info = &model->info;
  const double m = info->link_mass;
  double strain = model->geometry.code == BD_OK ? info->strain + info->mesh_strain : 0.01;
  double tension = 2.0 * model->belt.axial_stiffness * strain;
  double joints_k =
      model->shear * info->joint_stiffness / m + 4.0 * info->bending_stiffness / info->link_inertia;
  double joints_d =
      model->shear * info->joint_damping / m + 4.0 * info->bending_damping / info->link_inertia;
  bd_stiffness stiff = {.bound = 0.0, .pulley = -1};
  double most = 0.0;
  for (int j = 0; j < model->lay.np; ++j) {
    double r = model->radius[j], normal = tension * info->link_length / r;
    double contact = bd_contact_stiffness(info->contact_quadratic, info->contact_linear, normal);
    double wrap = model->geometry.code == BD_OK ? model->wraps[j].wrap : BD_PI;
    const bd_friction_stiffness friction = bd_friction_stiffness_of(model, j, normal);
    const double inertia = set && bd_is_moved(set, j) ? (double)INFINITY : model->inertia[j];
    const double rim = bd_runs_on_shaft(&model->lay, j) ? inertia : model->rim_inertia[j];
    /* of all links on the wrap together, on the pulley's inertia */
    const double of_wrap = wrap * r * r * r / (info->link_length * rim);
    double angular = 0.0, viscous = 0.0;
    if (set) {
      bd_torque_set_steepest(set, j, tension, &angular, &viscous);
    }
    double drag = model->drag ? bd_steepest_resistance(&model->drag[j], model, j, tension) : 0.0;
    const struct {
      double k, d;
      const char *what;
      int pulley;
    } parts[] = {
        {joints_k, joints_d, "the belt's joints", -1},
        {contact / m, bd_contact_damping(model, info->contact_damping, normal) / m, "the contact",
         -1},
        {friction.stiffness / m, friction.damping / m, "friction", -1},
        {friction.stiffness * of_wrap, friction.damping * of_wrap,
         "a pulley with very small inertia", j},
        {angular / inertia, 0.0, "harmonics of very high order", j},
        {0.0, viscous / inertia, "a load whose torque rises very steeply with its speed", j},
        {0.0, drag / inertia, "a pulley with very large bearing drag", j},
    };
    enum { N_PARTS = sizeof parts / sizeof parts[0] };
    double link_k = 0.0, link_d = 0.0;
    if (friction.adapts > most) {
      most = friction.adapts;
      stiff.what = "friction whose damper is very small";
      stiff.pulley = j;
    }
    for (int p = 0; p < N_PARTS; ++p) {
      double own = lambda(parts[p].k, parts[p].d);
      if (own > most) {
        most = own;
        stiff.what = parts[p].what;
        stiff.pulley = parts[p].pulley;
      }
      link_k += p < 3 ? parts[p].k : 0.0;
      link_d += p < 3 ? parts[p].d : 0.0;
    }
    stiff.bound = fmax(stiff.bound, fmax(friction.adapts, lambda(link_k, link_d)));
    stiff.bound =
        fmax(stiff.bound, lambda(parts[3].k + parts[4].k, parts[3].d + parts[5].d + parts[6].d));
  }
  for (int k = 0; k < model->lay.nm; ++k) {
    const bd_mounted *mount = &model->mounts[k];
    if (mount->kind == BD_MOUNT_PATH) {
      continue;
    }
    const int j = mount->pulley;
    const double r = model->radius[j], square = mount->lever * mount->lever;
    const double links =
        model->geometry.code == BD_OK ? model->wraps[j].wrap * r / info->link_length : 0.0;
    const double normal = tension * info->link_length / r;
    const double contact =
        bd_contact_stiffness(info->contact_quadratic, info->contact_linear, normal);
    const double stiffness = mount->stiffness + mount->stop_stiffness * mount->has_stops +
                             mount->friction * mount->adapts + links * contact * square;
    const double damping =
        mount->damping + mount->stop_damping * mount->has_stops +
        links * square * bd_contact_damping(model, info->contact_damping, normal);
    const double own = lambda(stiffness / mount->inertia, damping / mount->inertia);
    if (own > stiff.bound) {
      stiff = (bd_stiffness){.bound = own, .what = "a mount of very small inertia", .pulley = j};
    }
  }
  for (int c = 0; c < model->lay.nc; ++c) {
    const bd_coupled *coupled = &model->couplings[c];
    const int j = coupled->pulley, moved = set && bd_is_moved(set, j);
    const double light = 1.0 / coupled->inertia + (moved ? 0.0 : 1.0 / model->inertia[j]);
    double own = lambda(coupled->stiffness * light, coupled->damping * light);
    if (coupled->kind == BD_COUPLING_CLUTCH) {
      own = fmax(own, coupled->stiffness / coupled->damping);
    }
    if (own > stiff.bound) {
      stiff = (bd_stiffness){.bound = own, .what = "a very stiff coupling", .pulley = j};
    }
  }
  return stiff;
}
