/* SPDX-License-Identifier: MIT
 *
 * Upper estimate of the largest eigenvalue of the drive, and which part causes it: what the effects
 * have to do with it, at twice the tension of rest, for a drive under load has a tight side.
 * Explicit fixed steps are chosen by it, and messages of runs that make no progress name that part.
 */
#include <math.h>

#include "physics/physics.h"

double bd_oscillator_rate(double stiffness, double damping) {
  double d2 = damping * damping, k4 = 4.0 * stiffness;
  return d2 > k4 ? 0.5 * (damping + sqrt(d2 - k4)) : sqrt(stiffness);
}

static void replace(bd_stiffness *largest, double rate, const char *what, int pulley) {
  if (rate > largest->bound) {
    *largest = (bd_stiffness){rate, what, pulley};
  }
}

void bd_stiffen(bd_stiffening *at, int of, const char *what, double stiffness, double damping,
                double adapts) {
  const double rate = fmax(adapts, bd_oscillator_rate(stiffness, damping));
  if (of == BD_STIFF_OWN) {
    replace(&at->own, rate, what, at->pulley);
    return;
  }
  replace(&at->most, rate, what, of == BD_STIFF_PULLEY ? at->pulley : -1);
  at->stiffness[of] += stiffness;
  at->damping[of] += damping;
  at->bound = fmax(at->bound, adapts);
}

bd_stiffness bd_stiffness_of(const bd_model *model, const bd_torque_set *set) {
  const bd_info *info = &model->info;
  const int laid = model->geometry.code == BD_OK;
  const bd_effect *effects[BD_MAX_EFFECTS];
  const int n_effects = bd_effects_of(model, &(bd_plan_options){.friction = 1}, effects);
  bd_stiffening at = {.model = model, .set = set, .most = {.pulley = -1}};
  at.tension = 2.0 * model->belt.axial_stiffness * (laid ? info->strain + info->mesh_strain : 0.01);
  for (int j = 0; j < model->lay.np; ++j) {
    at.pulley = j;
    at.normal = at.tension * info->link_length / model->radius[j];
    at.wrap = laid ? model->wraps[j].wrap : BD_PI;
    at.inertia = set && bd_is_moved(set, j) ? (double)INFINITY : model->inertia[j];
    for (int of = 0; of < 2; ++of) {
      at.stiffness[of] = at.damping[of] = 0.0;
    }
    for (int e = 0; e < n_effects; ++e) {
      if (effects[e]->stiffness) {
        effects[e]->stiffness(&at);
      }
    }
    for (int of = 0; of < 2; ++of) {
      at.bound = fmax(at.bound, bd_oscillator_rate(at.stiffness[of], at.damping[of]));
    }
  }
  at.most.bound = at.bound; /* a body of its own is named if it alone is more than all of these */
  return at.own.bound > at.bound ? at.own : at.most;
}
