/* SPDX-License-Identifier: MIT
 *
 * What is asked of a friction law besides its forces: by name, of a pulley at rest under preload,
 * at a single link. Laws are rows of friction/laws.h.
 */
#include <math.h>
#include <string.h>

#include "model/model.h"

static const struct {
  const char *name, *text;
  int general;
} laws[] = {[BD_LAW_NONE] = {"none", "no", 0},
#define LAW(name, class, general, text) [BD_LAW_##name] = {#name, text, general},
            BD_LAWS(LAW)
#undef LAW
};

const char *bd_law_name(int law) {
  return laws[law].name;
}

int bd_law_find(const char *name) {
  for (int law = BD_LAW_NONE + 1; law < BD_N_LAWS; ++law) {
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

/* The union's members begin where it begins. */
int bd_friction_check(const bd_friction *friction, const char *label, bd_error *err) {
  if (friction->law <= BD_LAW_NONE || friction->law >= BD_N_LAWS) {
    return bd_fail(err, BD_ERR_PARAMETER, label, "%s: there is no friction law of number %d", label,
                   friction->law);
  }
  return bd_parameters_check(laws[friction->law].name, label, &friction->dahl, err);
}

int bd_friction_evaluate(const bd_friction *friction, double l0, double z, double v, double normal,
                         bd_law_point *out, bd_error *err) {
  const bd_kernels *kernels = bd_kernels_choose();
  if (bd_friction_check(friction, "friction", err) != BD_OK) {
    return BD_ERR_PARAMETER;
  }
  if (!(l0 > 0.0) || !isfinite(l0) || !isfinite(z) || !isfinite(v) || !(normal >= 0.0) ||
      !isfinite(normal)) {
    return bd_fail(err, BD_ERR_OPTION, "friction",
                   "a link's length must be > 0, its normal force >= 0, and all finite, got l0 = "
                   "%g m, z = %g, v = %g m/s, N = %g N",
                   l0, z, v, normal);
  }
  if (!kernels) {
    return bd_fail(err, BD_ERR_OPTION, "BELTDYN_KERNELS", "no such kernel level");
  }
  kernels->law[friction->law](friction, l0, z, v, normal, out);
  return BD_OK;
}

void bd_friction_at(const bd_model *model, int j, double z, double v, double normal,
                    bd_law_point *out) {
  const bd_friction *friction = &model->friction[j];
  memset(out, 0, sizeof *out);
  if (friction->law != BD_LAW_NONE) {
    model->kernels->law[friction->law](friction, model->info.link_length, z, v, normal, out);
  }
}

double bd_friction_bound(const bd_model *model, int j) {
  const bd_friction *friction = &model->friction[j];
  return friction->law == BD_LAW_NONE ? 0.0 : model->kernels->bound[friction->law](friction);
}

double bd_friction_kinetic(const bd_model *model, int j) {
  const bd_friction *friction = &model->friction[j];
  return friction->law == BD_LAW_NONE ? 0.0 : model->kernels->kinetic[friction->law](friction);
}

bd_friction_stiffness bd_friction_stiffness_of(const bd_model *model, int j, double normal) {
  bd_law_point rest, slips;
  bd_friction_at(model, j, 0.0, 0.0, normal, &rest);
  const double far =
      rest.by_state > 0.0 ? 2.0 * bd_friction_kinetic(model, j) * normal / rest.by_state : 0.0;
  bd_friction_at(model, j, far, 1.0, normal, &slips);
  return (bd_friction_stiffness){
      .stiffness = rest.by_state * rest.rate_by_slip,
      .damping = rest.by_slip,
      .adapts = bd_law_is_general(model->friction[j].law) ? -slips.rate_by_state : 0.0};
}

/* Of a link on the pulley at rest under preload. */
static double rest_normal(const bd_model *model, int j) {
  const double strain = model->geometry.code == BD_OK ? model->info.strain : 0.01;
  return model->belt.axial_stiffness * strain * model->info.link_length / model->radius[j];
}

double bd_friction_slip(const bd_model *model, int j) {
  const double normal = rest_normal(model, j);
  bd_law_point rest;
  bd_friction_at(model, j, 0.0, 0.0, normal, &rest);
  return bd_friction_kinetic(model, j) * normal / (rest.by_state * rest.rate_by_slip);
}

int bd_model_friction(const bd_model *model, int pulley, double *kinetic, double *slip) {
  const int law = model->friction[pulley].law;
  *kinetic = bd_friction_kinetic(model, pulley);
  *slip = law == BD_LAW_NONE ? (double)INFINITY : bd_friction_slip(model, pulley);
  return law;
}

int bd_friction_scales_differ(const bd_model *model) {
  double least = (double)INFINITY, most = 0.0;
  for (int j = 0; j < model->lay.np; ++j) {
    if (model->friction[j].law != BD_LAW_NONE) {
      const double scale = bd_friction_state_scale(model, j);
      least = fmin(least, scale);
      most = fmax(most, scale);
    }
  }
  return most > least;
}

double bd_least_slip(const bd_model *model) {
  double least = INFINITY;
  for (int j = 0; j < model->lay.np; ++j) {
    least = model->friction[j].law == BD_LAW_NONE ? least : fmin(least, bd_friction_slip(model, j));
  }
  return least;
}

double bd_friction_state_scale(const bd_model *model, int j) {
  const double normal = rest_normal(model, j);
  bd_law_point rest;
  bd_friction_at(model, j, 0.0, 0.0, normal, &rest);
  return normal / rest.by_state;
}
