/* SPDX-License-Identifier: MIT
 *
 * What is asked of a friction law besides its forces: by name, of a pulley at rest under preload,
 * at a single link. Laws are rows of friction/laws.h.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "model/model.h"

/* Stretches of an element, over that of its full slip, at which it slips under any Stribeck curve.
 */
#define FAR_SLIP 1e3

static const struct {
  const char *name, *text;
  int general, states;
} laws[] = {[BD_LAW_NONE] = {"none", "no", 0, 0},
#define LAW(name, class, general, states, text) [BD_LAW_##name] = {#name, text, general, states},
            BD_LAWS(LAW)
#undef LAW
};

const char *bd_law_name(int law) {
  return laws[law].name;
}

int bd_law_find(const char *name) {
  for (int law = BD_LAW_NONE; law < BD_N_LAWS; ++law) {
    if (strcmp(laws[law].name, name) == 0) {
      return law;
    }
  }
  return -1;
}

const char *bd_law_text(int law) {
  return laws[law].text;
}

int bd_law_is_general(int law) {
  return laws[law].general;
}

int bd_friction_states(const bd_friction *friction) {
  const int states = laws[friction->law].states;
  return states == BD_SEVERAL ? bd_parameters_list_length(laws[friction->law].name, &friction->dahl)
                              : states;
}

/* Of a law without a state 1, and without friction. */
static int elements_of(const bd_friction *friction) {
  const int states = bd_friction_states(friction);
  return states > 1 ? states : 1;
}

int bd_friction_most_states(const bd_model *model) {
  int most = 0;
  for (int j = 0; j < model->lay.np; ++j) {
    const int states = bd_friction_states(&model->friction[j]);
    most = states > most ? states : most;
  }
  return most;
}

/* Of a law without a Stribeck curve 0. */
static void stribeck_of(const bd_friction *friction, double *mu_s, double *v_stribeck) {
  *mu_s = *v_stribeck = 0.0;
  for (size_t k = 0; k < bd_n_parameters; ++k) {
    const bd_parameter *row = &bd_parameters[k];
    if (strcmp(row->group, laws[friction->law].name) == 0) {
      double *const value = strcmp(row->name, "mu_s") == 0         ? mu_s
                            : strcmp(row->name, "v_stribeck") == 0 ? v_stribeck
                                                                   : NULL;
      if (value) {
        bd_parameter_values(row, &friction->dahl, value);
      }
    }
  }
}

/* A static coefficient and the slip velocity over which friction falls from it make a Stribeck
 * curve together. */
static int check_stribeck(const bd_friction *friction, const char *label, bd_error *err) {
  double mu_s, v_stribeck;
  stribeck_of(friction, &mu_s, &v_stribeck);
  if ((mu_s > 0.0) == (v_stribeck > 0.0)) {
    return BD_OK;
  }
  const char *lacks = mu_s > 0.0 ? "v_stribeck" : "mu_s";
  char field[64];
  snprintf(field, sizeof field, "%s.%s", label, lacks);
  return bd_fail(err, BD_ERR_PARAMETER, field,
                 "%s must be > 0, too: a Stribeck curve needs mu_s and v_stribeck", field);
}

/* The union's members begin where it begins. */
int bd_friction_check(const bd_friction *friction, const char *label, bd_error *err) {
  if (friction->law == BD_LAW_NONE) {
    return BD_OK;
  }
  if (friction->law < BD_LAW_NONE || friction->law >= BD_N_LAWS) {
    return bd_fail(err, BD_ERR_PARAMETER, label, "%s: there is no friction law of number %d", label,
                   friction->law);
  }
  if (bd_parameters_check(laws[friction->law].name, label, &friction->dahl, err) != BD_OK) {
    return BD_ERR_PARAMETER;
  }
  return check_stribeck(friction, label, err);
}

int bd_friction_evaluate(const bd_friction *friction, double l0, int element, double z, double v,
                         double normal, bd_law_point *out, bd_error *err) {
  const bd_kernels *kernels = bd_kernels_choose();
  if (bd_friction_check(friction, "friction", err) != BD_OK) {
    return BD_ERR_PARAMETER;
  }
  if (friction->law == BD_LAW_NONE) {
    return bd_fail(err, BD_ERR_PARAMETER, "friction", "friction must be a law, got none");
  }
  if (!(l0 > 0.0) || !isfinite(l0) || !isfinite(z) || !isfinite(v) || !(normal >= 0.0) ||
      !isfinite(normal)) {
    return bd_fail(err, BD_ERR_OPTION, "friction",
                   "a link's length must be > 0, its normal force >= 0, and all finite, got l0 = "
                   "%g m, z = %g, v = %g m/s, N = %g N",
                   l0, z, v, normal);
  }
  const int elements = elements_of(friction);
  if (element < 0 || element >= elements) {
    return bd_fail(err, BD_ERR_OPTION, "element", "element must lie in 0 to %d, got %d",
                   elements - 1, element);
  }
  if (!kernels) {
    return bd_fail(err, BD_ERR_OPTION, "BELTDYN_KERNELS", "no such kernel level");
  }
  kernels->law[friction->law](friction, l0, element, z, v, normal, out);
  return BD_OK;
}

void bd_friction_at(const bd_model *model, int j, int element, double z, double v, double normal,
                    bd_law_point *out) {
  const bd_friction *friction = &model->friction[j];
  memset(out, 0, sizeof *out);
  if (friction->law != BD_LAW_NONE) {
    model->kernels->law[friction->law](friction, model->info.link_length, element, z, v, normal,
                                       out);
  }
}

double bd_friction_bound(const bd_model *model, int j, int element) {
  const bd_friction *friction = &model->friction[j];
  return element < bd_friction_states(friction) ? model->kernels->bound[friction->law](friction)
                                                : 0.0;
}

static double kinetic_of(const bd_model *model, int j, int element) {
  const bd_friction *friction = &model->friction[j];
  return friction->law == BD_LAW_NONE ? 0.0
                                      : model->kernels->kinetic[friction->law](friction, element);
}

double bd_friction_kinetic(const bd_model *model, int j) {
  double kinetic = 0.0;
  for (int e = 0; e < elements_of(&model->friction[j]); ++e) {
    kinetic += kinetic_of(model, j, e);
  }
  return kinetic;
}

int bd_friction_falls(const bd_model *model) {
  for (int j = 0; j < model->lay.np; ++j) {
    double mu_s, v_stribeck;
    stribeck_of(&model->friction[j], &mu_s, &v_stribeck);
    if (mu_s > bd_friction_kinetic(model, j)) {
      return 1;
    }
  }
  return 0;
}

/* Of a function of the slip velocity: its largest slope, which with a Stribeck curve need not be at
 * rest. */
static double steepest(const bd_model *model, int j, double normal) {
  double most = 0.0;
  for (int k = -1; k < 160; ++k) { /* 0, and 1e-12 to 1e4 m/s, ten of them a decade */
    bd_law_point at;
    bd_friction_at(model, j, 0, 0.0, k < 0 ? 0.0 : pow(10.0, 0.1 * k - 12.0), normal, &at);
    most = fmax(most, at.by_slip);
  }
  return most;
}

bd_friction_stiffness bd_friction_stiffness_of(const bd_model *model, int j, double normal) {
  bd_friction_stiffness all = {0.0, 0.0, 0.0};
  for (int e = 0; e < elements_of(&model->friction[j]); ++e) {
    bd_law_point rest, slips;
    bd_friction_at(model, j, e, 0.0, 0.0, normal, &rest);
    const double far =
        rest.by_state > 0.0 ? FAR_SLIP * kinetic_of(model, j, e) * normal / rest.by_state : 0.0;
    bd_friction_at(model, j, e, far, 1.0, normal, &slips);
    all.stiffness += rest.by_state * rest.rate_by_slip;
    all.damping +=
        bd_friction_states(&model->friction[j]) > 0 ? rest.by_slip : steepest(model, j, normal);
    if (bd_law_is_general(model->friction[j].law)) {
      all.adapts = fmax(all.adapts, -slips.rate_by_state);
    }
  }
  return all;
}

/* Of a link on the pulley at rest under preload. */
static double rest_normal(const bd_model *model, int j) {
  const double strain = model->geometry.code == BD_OK ? model->info.strain : 0.01;
  return model->belt.axial_stiffness * strain * model->info.link_length / model->radius[j];
}

/* In which an element's friction is fully developed. */
static double slip_of(const bd_model *model, int j, int element) {
  const double normal = rest_normal(model, j);
  bd_law_point rest;
  bd_friction_at(model, j, element, 0.0, 0.0, normal, &rest);
  return kinetic_of(model, j, element) * normal / (rest.by_state * rest.rate_by_slip);
}

double bd_friction_slip(const bd_model *model, int j) {
  double slip = 0.0;
  for (int e = 0; e < bd_friction_states(&model->friction[j]); ++e) {
    slip = fmax(slip, slip_of(model, j, e));
  }
  return slip;
}

int bd_model_friction(const bd_model *model, int pulley, double *kinetic, double *slip) {
  const int law = model->friction[pulley].law;
  *kinetic = bd_friction_kinetic(model, pulley);
  *slip = law == BD_LAW_NONE ? (double)INFINITY : bd_friction_slip(model, pulley);
  return law;
}

int bd_friction_scales_differ(const bd_model *model) {
  for (int e = 0; e < model->lay.states; ++e) {
    double least = (double)INFINITY, most = 0.0;
    for (int j = 0; j < model->lay.np; ++j) {
      if (model->friction[j].law != BD_LAW_NONE) {
        const double scale = bd_friction_state_scale(model, j, e);
        least = fmin(least, scale);
        most = fmax(most, scale);
      }
    }
    if (most > least) {
      return 1;
    }
  }
  return 0;
}

double bd_least_slip(const bd_model *model) {
  double least = INFINITY;
  for (int j = 0; j < model->lay.np; ++j) {
    for (int e = 0; e < bd_friction_states(&model->friction[j]); ++e) {
      least = fmin(least, slip_of(model, j, e));
    }
  }
  return least;
}

double bd_friction_state_scale(const bd_model *model, int j, int element) {
  const double normal = rest_normal(model, j);
  bd_law_point rest;
  if (element >= bd_friction_states(&model->friction[j])) {
    return (double)INFINITY;
  }
  bd_friction_at(model, j, element, 0.0, 0.0, normal, &rest);
  return normal / rest.by_state;
}
