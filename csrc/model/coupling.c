/* SPDX-License-Identifier: MIT
 *
 * Couplings between the shafts of pulleys and their rims (MODEL section 5): isolators, overrunning
 * clutches, and the free rings of torsional dampers. Guarded by tests/test_coupling.py.
 */
#include <math.h>
#include <stdio.h>

#include "model/model.h"

const char *bd_coupling_name(int kind) {
  static const char *const names[] = {
#define KIND(KIND, name) #name,
      BD_COUPLINGS(KIND)
#undef KIND
  };
  return kind >= 0 && kind < BD_N_COUPLINGS ? names[kind] : NULL;
}

int bd_coupling_check(const bd_scene *scene, int j, bd_error *err) {
  const bd_coupling *coupling = scene->pulleys[j].coupling;
  char label[40];
  snprintf(label, sizeof label, "pulleys[%d].coupling", j);
  if (!bd_coupling_name(coupling->kind)) {
    return bd_fail_at(err, BD_ERR_PARAMETER, label, (double)NAN, -1, j, coupling->kind,
                      "%s.kind must be isolator, clutch or damper, got %d", label, coupling->kind);
  }
  return bd_parameters_check(bd_coupling_name(coupling->kind), label, &coupling->isolator, err);
}

void bd_model_carve_couplings(bd_carver *carver, bd_model *model, const bd_scene *scene) {
  int n = 0;
  for (int j = 0; j < scene->n_pulleys; ++j) {
    n += scene->pulleys[j].coupling != NULL;
  }
  model->lay.nc = n;
  if (n > 0) {
    BD_CARVE(carver, model->couplings, n);
    BD_CARVE(carver, model->coupled, n);
  }
}

/* Rollers on which the hub alone would swing at this rate: a degree or less under what belts
 * transmit, and no stiffer than the joints of their links. */
static const double ROLLERS = 2.0 * BD_PI * 300.0;
static const double CLUTCH_DAMPING = 0.05; /* of critical, of the hub on its spring */

void bd_model_fill_couplings(bd_model *model, const bd_scene *scene) {
  for (int j = 0, c = 0; j < scene->n_pulleys; ++j) {
    const bd_coupling *given = scene->pulleys[j].coupling;
    if (!given) {
      continue;
    }
    bd_coupled *to = &model->couplings[c];
    to->pulley = model->coupled[c] = j;
    to->kind = given->kind;
    to->sense = 1.0;
    to->inertia = model->rim_inertia[j];
    if (given->kind == BD_COUPLING_DAMPER) {
      to->inertia = given->damper.inertia;
      to->stiffness = given->damper.stiffness;
      to->damping = given->damper.damping;
    } else if (given->kind == BD_COUPLING_ISOLATOR) {
      model->inertia[j] = given->isolator.inertia;
      to->stiffness = given->isolator.stiffness;
      to->damping = given->isolator.damping;
    } else {
      const bd_clutch *clutch = &given->clutch;
      const double k = clutch->stiffness, d = clutch->damping;
      model->inertia[j] = clutch->inertia;
      to->sense = clutch->clockwise ? -1.0 : 1.0;
      to->stiffness = k > 0.0 ? k : clutch->inertia * ROLLERS * ROLLERS;
      to->damping = d > 0.0 ? d : 2.0 * CLUTCH_DAMPING * sqrt(to->stiffness * clutch->inertia);
    }
    ++c;
  }
}

void bd_model_place_rims(bd_model *model) {
  bd_layout *lay = &model->lay;
  lay->coupled = model->coupled;
  lay->rim = model->rim;
  for (int j = 0; j < lay->np; ++j) {
    model->rim[j] = lay->omega + j;
  }
  for (int c = 0; c < lay->nc; ++c) {
    if (model->couplings[c].kind != BD_COUPLING_DAMPER) {
      model->rim[model->couplings[c].pulley] = lay->rim_speed + c;
    }
  }
}

bd_coupling_state bd_coupling_at(const bd_model *model, const double *y, int c) {
  const bd_layout *lay = &model->lay;
  const bd_coupled *k = &model->couplings[c];
  const double ahead = k->sense * (y[lay->rim_speed + c] - y[lay->omega + k->pulley]);
  const double spring = k->stiffness * y[lay->windup + c];
  const double torque = spring + k->damping * ahead;
  if (k->kind == BD_COUPLING_CLUTCH && !(torque > 0.0)) {
    return (bd_coupling_state){.ahead = ahead, .winds = -spring / k->damping};
  }
  return (bd_coupling_state){.ahead = ahead, .winds = ahead, .torque = torque, .engaged = 1};
}
