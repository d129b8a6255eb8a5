/* SPDX-License-Identifier: MIT
 *
 * Between the caller's arrays and the flat vector of base/base.h.
 */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "model/model.h"

/* Beyond this the angles of a long-running belt would cost digits of the joints' stretch, so whole
 * turns are kept apart; below it a state comes back to the last bit. */
#define MAX_ANGLE 50.0
#define FAR_STATE 300.0
#define LARGEST_ANGLE 1e9 /* beyond it an angle has no digits left for a step's turn */

/* --- the table ------------------------------------------------------------------------------- */

const bd_field_row bd_state_fields[BD_N_FIELDS] = {
#define X(symbol, name, size, scale, unit, text)                                                   \
  {#name, BD_SIZE_##size, BD_SCALE_##scale, offsetof(bd_state, name)},
    BD_STATE_FIELDS(X)
#undef X
};

size_t bd_size(const bd_info *of, int size) {
  switch (of->lacks >> size & 1u ? -1 : size) {
#define X(name, count)                                                                             \
  case BD_SIZE_##name:                                                                             \
    return (size_t)(count);
    BD_SIZES(X)
#undef X
  default:
    return 0;
  }
}

const char *bd_size_name(int size) {
  static const char *const names[] = {
#define X(name, count) #name,
      BD_SIZES(X)
#undef X
  };
  return size >= 0 && size < BD_N_SIZES ? names[size] : NULL;
}

int bd_field_pieces(const bd_layout *lay, int row) {
  const int size = bd_state_fields[row].size;
  const int each = size == BD_SIZE_STATES  ? lay->slots * lay->states
                   : size == BD_SIZE_SLOTS ? lay->slots
                                           : 1;
  return row >= F_THETA || (lay->fields >> row & 1u) ? each : 0;
}

int bd_field_length(const bd_layout *lay, int row) {
  switch (bd_state_fields[row].size) {
  case BD_SIZE_PULLEYS:
    return lay->np;
  case BD_SIZE_MOUNTS:
    return lay->nm;
  case BD_SIZE_COUPLINGS:
    return lay->nc;
  case BD_SIZE_MODES:
    return lay->n_modes;
  case BD_SIZE_ALONG:
    return lay->n_along;
  default:
    return lay->n;
  }
}

size_t bd_field_offset(const bd_layout *lay, int row, int k) {
  return (size_t)lay->offset[row] + (size_t)k * (size_t)lay->stride;
}

/* Blocks of links, then numbers of pulleys and parts. */
void bd_layout_fields(bd_layout *lay) {
  for (int row = 0; row < F_THETA; ++row) {
    const int block = bd_block(lay, row == F_SLIP ? bd_f_slip(lay, 0) : row);
    lay->offset[row] = block * lay->stride + BD_HALO;
  }
  lay->work = lay->offset[F_SLIP] - BD_HALO + bd_field_pieces(lay, F_SLIP) * lay->stride;
  for (int row = F_THETA; row < BD_N_FIELDS; ++row) {
    lay->offset[row] = lay->work;
    lay->work += bd_field_length(lay, row);
  }
}

/* Of value i of a row of the tail. */
static int pulley_at(const bd_layout *lay, int row, int i) {
  const int size = bd_state_fields[row].size;
  return size == BD_SIZE_MOUNTS      ? lay->mounted[i]
         : size == BD_SIZE_COUPLINGS ? lay->coupled[i]
         : size == BD_SIZE_MODES     ? i / lay->modes
                                     : i;
}

int bd_field_at(const bd_layout *lay, size_t entry, int *body, int *pulley) {
  const int at = (int)entry, block = at / lay->stride, link = at % lay->stride - BD_HALO;
  *body = *pulley = -1;
  if (at >= lay->work) {
    return -1;
  }
  for (int row = F_THETA; row < BD_N_FIELDS; ++row) {
    const int i = at - lay->offset[row];
    if (i >= 0 && i < bd_field_length(lay, row)) {
      *pulley = pulley_at(lay, row, i);
      return row;
    }
  }
  if (link < 0 || link >= lay->n) {
    return -1;
  }
  *body = link;
  if (block >= bd_block(lay, F_MU)) {
    return block < bd_block(lay, bd_f_slip(lay, 0)) ? F_MU : F_SLIP;
  }
  int row = F_X;
  while (!bd_has_field(lay, row) || bd_block(lay, row) < block) {
    ++row;
  }
  return row;
}

/* --- in and out ------------------------------------------------------------------------------ */

static double *member(const bd_state *state, int row) {
  double *array;
  memcpy(&array, (const char *)state + bd_state_fields[row].member, sizeof array);
  return array;
}

static int check_finite(const bd_layout *lay, const bd_state *state, bd_error *err) {
  for (int row = 0; row < BD_N_FIELDS; ++row) {
    const double *v = member(state, row);
    const int length = bd_field_length(lay, row), of_links = row < F_THETA;
    for (int i = 0; i < length * bd_field_pieces(lay, row); ++i) {
      if (!isfinite(v[i])) {
        return bd_fail_at(err, BD_ERR_STATE, bd_state_fields[row].name, (double)NAN,
                          of_links ? i % length : -1, of_links ? -1 : pulley_at(lay, row, i), v[i],
                          "state %s[%d] must be finite, got %g", bd_state_fields[row].name, i,
                          v[i]);
      }
    }
  }
  return BD_OK;
}

int bd_state_wrapped(const bd_model *model, const double *phi, double *turn) {
  const int n = model->lay.n;
  for (int i = 0; bd_has_field(&model->lay, F_PHI) && i < n; ++i) {
    double closing = i == 0 ? 2.0 * BD_PI * model->info.winding : 0.0;
    *turn = phi[i] - phi[i > 0 ? i - 1 : n - 1] + closing;
    if (fabs(*turn) > 1.5 * BD_PI || fabs(phi[i]) > LARGEST_ANGLE) {
      return i;
    }
  }
  return -1;
}

static int check_ring(const bd_model *model, const double *phi, bd_error *err) {
  double turn;
  const int i = bd_state_wrapped(model, phi, &turn);
  if (i >= 0) {
    return bd_fail_at(err, BD_ERR_STATE, "phi", (double)NAN, i, -1, turn,
                      "state phi must run on continuously round the ring, never wrapped, and "
                      "within +-1e9; from link %d to link %d it turns by %g rad",
                      i > 0 ? i - 1 : model->lay.n - 1, i, turn);
  }
  return BD_OK;
}

/* Whether the part of the belt that touches at node i touches pulley j. */
static int touches(const bd_model *model, const bd_state *state, int i, int j) {
  if (!model->belt_model->distance) {
    return 0;
  }
  const int m = model->mount_of ? model->mount_of[j] : -1;
  const bd_place at = m >= 0 ? bd_mount_place(&model->mounts[m], state->travel[m])
                             : (bd_place){.c = {model->cx[j], model->cy[j]}};
  const double axis[2] = {model->origin[0] + at.c[0], model->origin[1] + at.c[1]};
  return model->belt_model->distance(model, state, i, axis) < model->contact_radius[j];
}

/* Of a state's magnitude, by the law of the pulley that the node touches, else, where it will be
 * reset, the largest of the slot's; where a law has none FAR_STATE times its scale, which no state
 * of its own reaches. */
static double friction_bound(const bd_model *model, const bd_state *state, int slot, int element,
                             int i) {
  double largest = 0.0;
  for (int j = 0; j < model->lay.np; ++j) {
    if (!bd_in_slot(model, j, slot) || model->friction[j].law == BD_LAW_NONE) {
      continue;
    }
    /* a state that its law does not use becomes 0 when the run begins */
    const int used = element < bd_friction_states(&model->friction[j]);
    double bound = used ? bd_friction_bound(model, j, element) : (double)INFINITY;
    if (used && isinf(bound)) {
      bound = FAR_STATE * bd_friction_state_scale(model, j, element);
    }
    if (touches(model, state, i, j)) {
      return bound;
    }
    largest = fmax(largest, bound);
  }
  return largest;
}

static int check_friction(const bd_model *model, const bd_state *state, bd_error *err) {
  const int n = model->lay.n, states = model->lay.states;
  for (int k = 0; k < model->lay.slots * states * n; ++k) {
    const int row = k / n;
    const double bound = friction_bound(model, state, row / states, row % states, k % n);
    if (fabs(state->mu[k]) > bound * (1.0 + 1e-12)) {
      return bd_fail_at(err, BD_ERR_STATE, "mu", state->t, k % n, -1, state->mu[k],
                        "state mu[%d] must lie within +-%g, the bound of the friction law, got %g: "
                        "is it of a drive with another law?",
                        k, bound, state->mu[k]);
    }
  }
  return BD_OK;
}

void bd_state_put(const bd_layout *lay, const bd_state *state, double shift_x, double shift_y,
                  double *y) {
  for (int row = 0; row < BD_N_FIELDS; ++row) {
    const double *from = member(state, row);
    const double shift = row == F_X ? shift_x : row == F_Y ? shift_y : 0.0;
    const int length = bd_field_length(lay, row);
    for (int k = 0; k < bd_field_pieces(lay, row); ++k) {
      double *to = y + bd_field_offset(lay, row, k);
      for (int i = 0; i < length; ++i) {
        to[i] = from[k * length + i] + shift;
      }
    }
  }
}

int bd_state_import(const bd_model *model, const bd_state *state, double *y, double *turns,
                    bd_error *err) {
  const bd_layout *lay = &model->lay;
  if (check_finite(lay, state, err) != BD_OK) {
    return BD_ERR_STATE;
  }
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
  for (int m = 0; m < lay->nm; ++m) {
    if (fabs(state->mount_friction[m]) > 1.0 + 1e-12) {
      return bd_fail_at(err, BD_ERR_STATE, "mount_friction", state->t, -1, lay->mounted[m],
                        state->mount_friction[m],
                        "state mount_friction[%d] must lie within +-1, got %g", m,
                        state->mount_friction[m]);
    }
  }
  memset(y, 0, lay->size * sizeof *y);
  for (int f = F_X; f <= F_Y && bd_has_field(lay, f); ++f) {
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
  for (int row = 0; row < BD_N_FIELDS; ++row) {
    double *to = member(state, row); /* NULL: it is not wanted */
    const double shift = row == F_X     ? model->origin[0]
                         : row == F_Y   ? model->origin[1]
                         : row == F_PHI ? turns * 2.0 * BD_PI
                                        : 0.0;
    const int length = bd_field_length(lay, row);
    for (int k = 0; to && k < bd_field_pieces(lay, row); ++k) {
      const double *from = y + bd_field_offset(lay, row, k);
      for (int i = 0; i < length; ++i) {
        to[k * length + i] = from[i] + shift;
      }
    }
  }
  if (model->belt_model->directions) {
    model->belt_model->directions(lay, y, state->phi, state->vphi);
  }
}

void bd_state_wind(const bd_layout *lay, double *y, double *turns) {
  double *phi = bd_field(lay, y, F_PHI);
  if (!bd_has_field(lay, F_PHI) || fabs(phi[0]) <= MAX_ANGLE) {
    return;
  }
  double whole = rint(phi[0] / (2.0 * BD_PI));
  for (int i = 0; i < lay->n; ++i) {
    phi[i] -= whole * 2.0 * BD_PI;
  }
  *turns += whole;
}

/* Whether all of v are finite: adding 1 to the bits of an exponent of ones sets the sign. */
static int all_finite(const double *v, size_t n) {
  uint64_t found = 0;
  for (size_t k = 0; k < n; ++k) {
    uint64_t bits;
    memcpy(&bits, &v[k], sizeof bits);
    found |= (bits & 0x7ff0000000000000u) + 0x0010000000000000u;
  }
  return found >> 63 == 0;
}

const char *bd_state_bad(const bd_layout *lay, const double *y, int *body, int *pulley) {
  *body = *pulley = -1;
  if (all_finite(y, (size_t)lay->work)) {
    return NULL;
  }
  for (size_t entry = 0; entry < (size_t)lay->work; ++entry) {
    const int row = isfinite(y[entry]) ? -1 : bd_field_at(lay, entry, body, pulley);
    if (row >= 0) {
      return bd_state_fields[row].name;
    }
  }
  *body = *pulley = -1;
  return NULL;
}

double bd_state_scale(const bd_model *model, int row, int k) {
  const bd_field_row *field = &bd_state_fields[row];
  const double strain = model->geometry.code == BD_OK ? model->info.strain : 0.01;
  /* of an ALE belt errors are of it as a whole, not of a link's joint */
  const double whole = model->info.length,
               waves = sqrt(model->belt.axial_stiffness / model->belt.linear_density);
  const double stretch = strain * (model->drive ? whole : model->info.link_length);
  const double speed = model->drive ? strain * waves : bd_speed_scale(model);
  const bd_mounted *mount = field->size == BD_SIZE_MOUNTS ? &model->mounts[k] : NULL;
  const bd_coupled *coupled = field->size == BD_SIZE_COUPLINGS ? &model->couplings[k] : NULL;
  const double arm = mount                            ? mount->lever
                     : coupled                        ? model->radius[coupled->pulley]
                     : field->size == BD_SIZE_PULLEYS ? model->radius[k]
                                                      : 0.5 * model->info.link_length;
  const int states = model->lay.states;
  double least = INFINITY;
  if (mount && !mount->row->moves) {
    return INFINITY;
  }
  switch (field->scale) {
  case BD_SCALE_STRETCH:
    return stretch;
  case BD_SCALE_TURN:
    return stretch / arm;
  case BD_SCALE_SPEED:
    return speed;
  case BD_SCALE_SPIN:
    return speed / arm;
  case BD_SCALE_FRICTION:
    for (int j = 0; j < model->lay.np; ++j) {
      if (bd_in_slot(model, j, k / states)) {
        least = fmin(least, bd_friction_state_scale(model, j, k % states));
      }
    }
    return least;
  case BD_SCALE_GRIP:
    return model->belt.axial_stiffness * strain * arm / mount->friction;
  case BD_SCALE_WINDUP: /* of a stiff coupling what its torque is worth */
    return fmin(stretch / arm, model->belt.axial_stiffness * strain * arm / coupled->stiffness);
  default:
    return INFINITY;
  }
}
