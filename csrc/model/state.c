/* SPDX-License-Identifier: MIT
 *
 * Between the caller's arrays and the flat vector of base/base.h.
 */
#include <math.h>
#include <string.h>

#include "model/model.h"

/* Beyond this the angles of a long-running belt would cost digits of the joints' stretch, so whole
 * turns are kept apart; below it a state comes back to the last bit. */
#define MAX_ANGLE 50.0
#define LARGEST_ANGLE 1e9 /* beyond it an angle has no digits left for a step's turn */

static int field_index(const char *name) {
  int k = 0;
#define X(field, size)                                                                             \
  if (strcmp(name, #field) == 0) {                                                                 \
    return k;                                                                                      \
  }                                                                                                \
  ++k;
  BD_STATE_FIELDS(X)
#undef X
  return -1;
}

static int finite_block(const double *v, int n, const char *name, bd_error *err) {
  for (int i = 0; i < n; ++i) {
    if (!isfinite(v[i])) {
      return bd_fail_at(err, BD_ERR_STATE, name, (double)NAN, field_index(name) < 8 ? i : -1,
                        field_index(name) < 8 ? -1 : i, v[i], "state %s[%d] must be finite, got %g",
                        name, i, v[i]);
    }
  }
  return BD_OK;
}

#define COUNT_LINKS lay->n
#define COUNT_SLOTS (lay->n * lay->slots)
#define COUNT_PULLEYS lay->np

static void put_links(const bd_layout *lay, double *y, int f, const double *v, double shift) {
  double *block = bd_field(lay, y, f);
  for (int i = 0; i < lay->n; ++i) {
    block[i] = v[i] + shift;
  }
}

static void get_links(const bd_layout *lay, const double *y, int f, double *v, double shift) {
  const double *block = bd_cfield(lay, y, f);
  for (int i = 0; i < lay->n; ++i) {
    v[i] = block[i] + shift;
  }
}

/* Angles run on continuously and close with the winding: a step near a turn is one wrapped away. */
static int check_ring(const bd_model *model, const double *phi, bd_error *err) {
  const int n = model->lay.n;
  for (int i = 0; i < n; ++i) {
    double closing = i == 0 ? 2.0 * BD_PI * model->info.winding : 0.0;
    double turn = phi[i] - phi[i > 0 ? i - 1 : n - 1] + closing;
    if (fabs(turn) > 1.5 * BD_PI || fabs(phi[i]) > LARGEST_ANGLE) {
      return bd_fail_at(err, BD_ERR_STATE, "phi", (double)NAN, i, -1, turn,
                        "state phi must run on continuously round the ring, never wrapped, and "
                        "within +-1e9; from link %d to link %d it turns by %g rad",
                        i > 0 ? i - 1 : n - 1, i, turn);
    }
  }
  return BD_OK;
}

/* The state of friction, within the largest bound of the pulleys that a slot serves. */
static int check_friction(const bd_model *model, const bd_state *state, bd_error *err) {
  const bd_layout *lay = &model->lay;
  for (int s = 0; s < lay->slots; ++s) {
    double bound = 0.0;
    for (int j = 0; j < lay->np; ++j) {
      bound = model->slot[j] == s ? fmax(bound, bd_friction_bound(model, j)) : bound;
    }
    for (int k = s * lay->n; k < (s + 1) * lay->n; ++k) {
      if (fabs(state->mu[k]) > bound * (1.0 + 1e-12)) {
        return bd_fail_at(
            err, BD_ERR_STATE, "mu", state->t, k % lay->n, -1, state->mu[k],
            "state mu[%d] must lie within +-%g, the bound of the friction law, got %g", k, bound,
            state->mu[k]);
      }
    }
  }
  return BD_OK;
}

void bd_state_put(const bd_layout *lay, const bd_state *state, double shift_x, double shift_y,
                  double *y) {
  put_links(lay, y, F_X, state->x, shift_x);
  put_links(lay, y, F_Y, state->y, shift_y);
  put_links(lay, y, F_PHI, state->phi, 0.0);
  put_links(lay, y, F_VX, state->vx, 0.0);
  put_links(lay, y, F_VY, state->vy, 0.0);
  put_links(lay, y, F_VPHI, state->vphi, 0.0);
  for (int s = 0; s < lay->slots; ++s) {
    put_links(lay, y, F_MU + s, state->mu + s * lay->n, 0.0);
    put_links(lay, y, bd_f_slip(lay) + s, state->slip + s * lay->n, 0.0);
  }
  memcpy(y + lay->theta, state->theta, (size_t)lay->np * sizeof *y);
  memcpy(y + lay->omega, state->omega, (size_t)lay->np * sizeof *y);
}

int bd_state_import(const bd_model *model, const bd_state *state, double *y, double *turns,
                    bd_error *err) {
  const bd_layout *lay = &model->lay;
#define X(name, size)                                                                              \
  if (finite_block(state->name, COUNT_##size, #name, err) != BD_OK) {                              \
    return BD_ERR_STATE;                                                                           \
  }
  BD_STATE_FIELDS(X)
#undef X
  if (!isfinite(state->t)) {
    return bd_fail(err, BD_ERR_STATE, "t", "state t must be finite, got %g", state->t);
  }
  if (check_friction(model, state, err) != BD_OK) {
    return BD_ERR_STATE;
  }
  if (check_ring(model, state->phi, err) != BD_OK) {
    return BD_ERR_STATE;
  }
  for (int j = 0; j < lay->np; ++j) {
    if (fabs(state->theta[j]) > LARGEST_ANGLE) {
      return bd_fail_at(err, BD_ERR_STATE, "theta", state->t, -1, j, state->theta[j],
                        "state theta[%d] must be within +-%g, got %g", j, LARGEST_ANGLE,
                        state->theta[j]);
    }
  }
  memset(y, 0, lay->size * sizeof *y);
  for (int f = F_X; f <= F_Y; ++f) {
    double *block = bd_field(lay, y, f);
    for (int i = lay->n; i < lay->stride - BD_HALO; ++i) {
      block[i] = model->far_away;
    }
  }
  *turns = 0.0;
  bd_state_put(lay, state, -model->origin[0], -model->origin[1], y);
  bd_state_wind(lay, y, turns);
  return BD_OK;
}

void bd_state_export(const bd_model *model, const double *y, double turns, bd_state *state) {
  const bd_layout *lay = &model->lay;
  get_links(lay, y, F_X, state->x, model->origin[0]);
  get_links(lay, y, F_Y, state->y, model->origin[1]);
  get_links(lay, y, F_PHI, state->phi, turns * 2.0 * BD_PI);
  get_links(lay, y, F_VX, state->vx, 0.0);
  get_links(lay, y, F_VY, state->vy, 0.0);
  get_links(lay, y, F_VPHI, state->vphi, 0.0);
  for (int s = 0; s < lay->slots; ++s) {
    get_links(lay, y, F_MU + s, state->mu + s * lay->n, 0.0);
    get_links(lay, y, bd_f_slip(lay) + s, state->slip + s * lay->n, 0.0);
  }
  memcpy(state->theta, y + lay->theta, (size_t)lay->np * sizeof *y);
  memcpy(state->omega, y + lay->omega, (size_t)lay->np * sizeof *y);
}

void bd_state_wind(const bd_layout *lay, double *y, double *turns) {
  double *phi = bd_field(lay, y, F_PHI);
  if (fabs(phi[0]) <= MAX_ANGLE) {
    return;
  }
  double whole = rint(phi[0] / (2.0 * BD_PI));
  for (int i = 0; i < lay->n; ++i) {
    phi[i] -= whole * 2.0 * BD_PI;
  }
  *turns += whole;
}

const char *bd_state_bad(const bd_layout *lay, const double *y, int *body, int *pulley) {
  static const char *const names[] = {"x", "y", "phi", "vx", "vy", "vphi", "mu", "slip"};
  *body = *pulley = -1;
  for (int f = F_X; f < F_MU + 2 * lay->slots; ++f) {
    const double *block = bd_cfield(lay, y, f);
    for (int i = 0; i < lay->n; ++i) {
      if (!isfinite(block[i])) {
        *body = i;
        return f < F_MU ? names[f] : f < F_MU + lay->slots ? "mu" : "slip";
      }
    }
  }
  for (int j = 0; j < lay->np; ++j) {
    if (!isfinite(y[lay->theta + j]) || !isfinite(y[lay->omega + j])) {
      *pulley = j;
      return isfinite(y[lay->omega + j]) ? "theta" : "omega";
    }
  }
  return NULL;
}
