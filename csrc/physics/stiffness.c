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

/* On its own body: if it is more than all that add up, it is what messages name. */
static void add_own(bd_stiffness *own, double rate, const char *what, int pulley) {
  if (rate > own->bound) {
    *own = (bd_stiffness){rate, what, pulley};
  }
}

bd_stiffness bd_stiffness_of(const bd_model *model, const bd_torque_set *set) {
  const bd_info *info = &model->info;
  const int laid = model->geometry.code == BD_OK;
  const bd_effect *effects[BD_MAX_EFFECTS];
  const int n_effects = bd_effects_of(model, &(bd_plan_options){.friction = 1}, effects);
  bd_stiff_at at = {.model = model, .set = set};
  at.tension = 2.0 * model->belt.axial_stiffness * (laid ? info->strain + info->mesh_strain : 0.01);
  bd_stiffness most = {.pulley = -1}, own = {.pulley = -1};
  double bound = 0.0;
  for (int j = 0; j < model->lay.np; ++j) {
    double stiffness[2] = {0.0}, damping[2] = {0.0}; /* of a link, of the pulley */
    at.pulley = j;
    at.normal = at.tension * info->link_length / model->radius[j];
    at.wrap = laid ? model->wraps[j].wrap : BD_PI;
    at.inertia = set && bd_is_moved(set, j) ? (double)INFINITY : model->inertia[j];
    for (int e = 0; e < n_effects; ++e) {
      bd_stiff parts[BD_MOST_STIFF];
      const int n = effects[e]->stiffness ? effects[e]->stiffness(&at, parts) : 0;
      for (int k = 0; k < n; ++k) {
        const bd_stiff *p = &parts[k];
        const double rate = fmax(p->rate, bd_oscillator_rate(p->stiffness, p->damping));
        add_own(p->of == BD_STIFF_OWN ? &own : &most, rate, p->what,
                p->of == BD_STIFF_LINK ? -1 : j);
        if (p->of != BD_STIFF_OWN) {
          stiffness[p->of] += p->stiffness;
          damping[p->of] += p->damping;
          bound = fmax(bound, p->rate);
        }
      }
    }
    for (int of = 0; of < 2; ++of) {
      bound = fmax(bound, bd_oscillator_rate(stiffness[of], damping[of]));
    }
  }
  most.bound = bound;
  return own.bound > bound ? own : most;
}
