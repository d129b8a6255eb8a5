/* SPDX-License-Identifier: MIT
 *
 * The public C interface under libFuzzer: bytes are read as edits of a drive of three pulleys (any
 * parameter of the table, layout, mounts, laws, loads, motions, options, settling, single numbers
 * of the state), which is then settled, run for some steps, recorded and continued. Whatever the
 * bytes say, a call gives a finite result or a named error; the sanitizers see the rest. No bytes:
 * the drive runs as it is.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene.h"

#define HOLDS(condition)                                                                           \
  do {                                                                                             \
    if (!(condition)) {                                                                            \
      fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #condition);               \
      abort();                                                                                     \
    }                                                                                              \
  } while (0)

enum { MOST_PULLEYS = 6, MOST_TERMS = 4, MOST_TIMES = 4, MOST_EDITS = 60, MOST_LINKS = 240 };
enum { FEW_LINKS = 18, SETTLING_STEPS = 300, STEPS = 24, SAMPLES = 4 };

/* --- bytes ----------------------------------------------------------------------------------- */

typedef struct bytes {
  const uint8_t *at;
  size_t left;
} bytes;

static unsigned byte(bytes *in) {
  return in->left ? (in->left--, *in->at++) : 0;
}

static size_t below(bytes *in, size_t most) {
  return byte(in) % most;
}

/* Mostly of the order of `usual`, either sign; or what is at an end of the numbers; or any bits. */
static double number(bytes *in, double usual) {
  static const double odd[] = {
      0.0,   -0.0,  1.0,  -1.0, (double)NAN, (double)INFINITY, 5e-324, 2.3e-308,          1e-150,
      1e-30, 1e-12, 1e12, 1e30, 1e150,       1.7e308,          -1e300, -(double)INFINITY, 3.0};
  const unsigned kind = byte(in);
  if (kind < 144) { /* 10^-3 to 10^3 of it, 0 leaves it */
    return usual * pow(10.0, (kind < 72 ? (double)kind : (double)kind - 144.0) / 24.0);
  }
  if (kind < 192) {
    return -usual * pow(10.0, ((double)kind - 168.0) / 12.0);
  }
  if (kind < 216) { /* of eight digits, to come close to what is exact */
    double share = 0.0;
    for (int k = 0; k < 4; ++k) {
      share = (share + byte(in)) / 256.0;
    }
    return usual * 2.0 * share;
  }
  if (kind < 254) {
    return odd[(kind - 216) % (sizeof odd / sizeof odd[0])];
  }
  double any;
  uint8_t raw[sizeof any];
  for (size_t k = 0; k < sizeof raw; ++k) {
    raw[k] = (uint8_t)byte(in);
  }
  memcpy(&any, raw, sizeof any);
  return any;
}

/* --- what is edited -------------------------------------------------------------------------- */

typedef struct edit {
  unsigned field, at;
  double value;
} edit;

typedef struct drive {
  bd_scene scene;
  bd_pulley pulleys[MOST_PULLEYS];
  bd_friction friction, own[MOST_PULLEYS];
  bd_mount mounts[MOST_PULLEYS];
  double path_t[MOST_TIMES], path[2 * MOST_TIMES], offset[2 * MOST_PULLEYS];
  char names[MOST_PULLEYS][40];
  bd_torque torque;
  bd_torque_term terms[MOST_TERMS];
  bd_motion motions[2];
  double t[MOST_TIMES], values[MOST_TIMES * MOST_PULLEYS], breakpoints[2];
  bd_options options;
  bd_settle_options settle;
  double t_end, times[SAMPLES];
  edit state[8];
  size_t n_edits;
  int settles;
  unsigned behaviour; /* of the torque function */
} drive;

static const double radii[MOST_PULLEYS] = {0.08, 0.035, 0.06, 0.03, 0.05, 0.02};
static const double centers[MOST_PULLEYS][2] = {{0.0, 0.0},    {0.16, 0.22}, {0.26, -0.04},
                                                {0.15, -0.07}, {0.3, 0.2},   {0.4, 0.0}};

static void fill_torque(const drive *d, double t, const double *omega, double *torque) {
  for (int j = 0; j < d->scene.n_pulleys; ++j) {
    torque[j] = -0.1 * omega[j];
  }
  switch (d->behaviour % 5) {
  case 1:
    torque[0] += t > 0.3 * d->t_end ? -10.0 : 0.0;
    break;
  case 2:
    torque[0] += (double)NAN;
    break;
  case 3:
    torque[0] += sin(1e9 * t);
    break;
  case 4:
    torque[0] = t > 0.5 * d->t_end ? 1e300 : 0.0;
    break;
  default:
    torque[0] -= 5.0;
  }
}

static void torque_function(double t, const double *theta, const double *omega, double *torque,
                            void *user) {
  (void)theta;
  fill_torque(user, t, omega, torque);
}

static int torque_call(double t, const double *theta, const double *omega, double *torque,
                       void *user) {
  const drive *d = user;
  torque_function(t, theta, omega, torque, user);
  return d->behaviour % 7 == 6 && t > 0.4 * d->t_end;
}

static int motion_call(double t, double *value, void *user) {
  const drive *d = user;
  *value = d->behaviour % 5 == 2 ? (double)NAN : 0.1 * t;
  return d->behaviour % 7 == 6 && t > 0.4 * d->t_end;
}

/* Numbers that are mostly allowed. */
static bd_friction usual_law(int law) {
  switch (law) {
  case BD_LAW_dahl:
    return test_friction;
  case BD_LAW_lugre:
    return (bd_friction){.law = law, .lugre = {0.6, 0.8, 0.05, 1e4, 0.1, 0.0}};
  case BD_LAW_elastic_plastic:
    return (bd_friction){.law = law,
                         .elastic_plastic = {.mu = 0.6, .stiffness = 2e7, .damping = 400}};
  case BD_LAW_coulomb:
    return (bd_friction){.law = law, .coulomb = {.mu = 0.6, .v_reg = 0.05}};
  case BD_LAW_creep_rate:
    return (bd_friction){.law = law, .creep_rate = {0.6, 0.05}};
  case BD_LAW_threlfall:
    return (bd_friction){.law = law, .threlfall = {0.6, 0.05}};
  case BD_LAW_maxwell_slip:
    return (bd_friction){.law = law,
                         .maxwell_slip = {.mu = {2, {0.3, 0.3}},
                                          .stiffness = {2, {2e7, 1e7}},
                                          .damping = {2, {400, 300}}}};
  default:
    return (bd_friction){.law = law};
  }
}

static void edit_parameter(drive *d, bytes *in) {
  const bd_parameter *row = &bd_parameters[((byte(in) << 8) + byte(in)) % bd_n_parameters];
  const size_t j = below(in, MOST_PULLEYS);
  bd_friction *law = byte(in) % 2 ? &d->friction : &d->own[j];
  const char *guide, *kind = bd_mount_name(d->mounts[j].kind, &guide);
  void *record = strcmp(row->group, "belt") == 0         ? (void *)&d->scene.belt
                 : strcmp(row->group, "contact") == 0    ? (void *)&d->scene.contact
                 : strcmp(row->group, "pulley") == 0     ? (void *)&d->pulleys[j]
                 : strcmp(row->group, "drag") == 0       ? (void *)&d->pulleys[j].drag
                 : kind && strcmp(row->group, kind) == 0 ? (void *)&d->mounts[j].numbers
                 : bd_law_find(row->group) == law->law   ? (void *)&law->dahl
                                                         : NULL;
  if (!record) {
    return;
  }
  char *const place = (char *)record + row->offset;
  if (row->kind == BD_IS_NUMBER) {
    double value;
    memcpy(&value, place, sizeof value);
    value = number(in, value != 0.0 && isfinite(value) ? value : 1.0);
    memcpy(place, &value, sizeof value);
  } else if (row->kind == BD_IS_INTEGER) {
    const int odd[] = {-1, 0, 2, BD_MAX_LINKS + 1, 1 << 30, 3};
    const unsigned any = byte(in);
    const int value = any < 6 ? odd[any] : (int)any % MOST_LINKS;
    memcpy(place, &value, sizeof value);
  } else {
    bd_numbers list;
    memcpy(&list, place, sizeof list);
    list.n = (int)byte(in) % 80 - 5;
    const size_t at = below(in, BD_MAX_ELEMENTS);
    list.at[at] = number(in, list.at[0]);
    memcpy(place, &list, sizeof list);
  }
}

static void edit_mount(drive *d, bytes *in) {
  const size_t j = below(in, MOST_PULLEYS);
  bd_mount *mount = &d->mounts[j];
  *mount = (bd_mount){.kind = (int)below(in, 4)};
  const double *center = d->pulleys[j].center;
  if (mount->kind == BD_MOUNT_ARM) {
    mount->numbers =
        (bd_arm){.inertia = 0.01, .mass = 0.2, .stiffness = 50, .preload = 20, .damping = 1};
  } else if (mount->kind == BD_MOUNT_SLIDER) {
    mount->numbers = (bd_slider){.mass = 1, .stiffness = 1e5, .preload = 1000, .damping = 100};
  }
  for (int k = 0; k < 2; ++k) {
    const double pivot = center[k] + number(in, k ? 0.1 : -0.08);
    const double direction = number(in, k ? -1.0 : 0.7);
    mount->guide[k] = mount->kind == BD_MOUNT_ARM ? pivot : direction;
  }
  mount->n_t = below(in, MOST_TIMES + 1);
  mount->t = d->path_t;
  mount->displacement = d->path;
  for (size_t k = 0; k < mount->n_t; ++k) {
    d->path_t[k] = k ? d->path_t[k - 1] + number(in, 1e-3) : number(in, 0.0);
    d->path[2 * k] = k ? number(in, 1e-4) : 0.0;
    d->path[2 * k + 1] = k ? number(in, 1e-4) : 0.0;
  }
  d->pulleys[j].mount = byte(in) % 8 == 7 ? NULL : mount;
}

static bd_harmonics harmonics(const drive *d, bytes *in) {
  return (bd_harmonics){
      .n = below(in, MOST_TIMES + 1), .orders = d->t, .amplitudes = d->values, .phases = d->values};
}

static void add_term(drive *d, bytes *in) {
  if (d->torque.n_terms == MOST_TERMS) {
    return;
  }
  bd_torque_term *term = &d->terms[d->torque.n_terms++];
  *term = (bd_torque_term){.kind = (int)below(in, 10) - 1,
                           .n_t = below(in, MOST_TIMES + 1),
                           .t = d->t,
                           .values = d->values,
                           .coefficients = d->values,
                           .function = torque_function,
                           .call = torque_call,
                           .user = d,
                           .pulley = (int)below(in, 5) - 1,
                           .of = (int)below(in, 5) - 1,
                           .n_points = below(in, MOST_TIMES + 1),
                           .omega = d->t,
                           .torque = d->values};
  term->against = (bd_drag){number(in, 1.0), number(in, 0.1), number(in, 1e-3)};
  term->harmonics = harmonics(d, in);
}

static void add_motion(drive *d, bytes *in) {
  if (d->torque.n_motions == 2) {
    return;
  }
  bd_motion *motion = &d->motions[d->torque.n_motions++];
  *motion = (bd_motion){.pulley = (int)below(in, 5) - 1,
                        .kind = (int)below(in, 5) - 1,
                        .n_t = below(in, MOST_TIMES + 1),
                        .t = d->t,
                        .values = d->values,
                        .harmonics = harmonics(d, in),
                        .fade = {number(in, 0.0), number(in, 1e-3)},
                        .call = motion_call,
                        .user = d};
}

static void edit_options(drive *d, bytes *in) {
  size_t methods = 0;
  while (bd_method_name(methods)) {
    ++methods;
  }
  const size_t k = below(in, methods + 2);
  d->options.method = k < methods ? bd_method_name(k) : k == methods ? NULL : "heun";
  switch (below(in, 6)) {
  case 1:
    d->options.rtol = number(in, 1e-4);
    break;
  case 2:
    d->options.step = number(in, 1e-6);
    break;
  case 3:
    d->options.max_step = number(in, 1e-5);
    break;
  case 4:
    d->options.max_steps = (long)byte(in) - 2;
    break;
  case 5:
    d->options.torque_interval = number(in, 1e-3);
    break;
  default:
    d->options.ledger = (int)byte(in) % 3;
    d->options.guards = (int)byte(in) % 2;
  }
}

static void edit_settling(drive *d, bytes *in) {
  bd_settle_options *s = &d->settle;
  s->friction = (int)byte(in) % 2;
  s->free_pulleys = (int)byte(in) % 2;
  switch (below(in, 6)) {
  case 1:
    s->offset = d->offset;
    d->offset[below(in, sizeof d->offset / sizeof *d->offset)] = number(in, 1e-3);
    s->move_time = number(in, 0.01);
    break;
  case 2:
    s->shift = number(in, 0.01);
    break;
  case 3:
    s->tolerance = number(in, 1e-6);
    break;
  case 4:
    s->max_time = number(in, 1.0);
    break;
  case 5:
    s->speed = number(in, 10.0);
    break;
  default:
    d->settles = (int)byte(in) % 3;
  }
}

static void edit_drive(drive *d, bytes *in) {
  const size_t j = below(in, MOST_PULLEYS);
  const size_t k = below(in, 2);
  switch (below(in, 16)) {
  case 0:
  case 1:
  case 2:
    edit_parameter(d, in);
    break;
  case 3:
    d->pulleys[j].center[k] = number(in, centers[j][k] != 0.0 ? centers[j][k] : 0.1);
    break;
  case 4:
    d->scene.n_pulleys = (int)(j + k);
    break;
  case 5:
    d->scene.belt.mesh = (int)below(in, 4) - 1;
    d->scene.belt.model = (int)below(in, 5) - 1;
    break;
  case 6:
    d->pulleys[j].outside = (int)below(in, 3);
    break;
  case 7:
    *(k ? &d->own[j] : &d->friction) = usual_law((int)below(in, BD_N_LAWS + 2) - 1);
    d->pulleys[j].friction = k ? &d->own[j] : NULL;
    break;
  case 8:
    edit_mount(d, in);
    break;
  case 9:
    add_term(d, in);
    break;
  case 10:
    add_motion(d, in);
    break;
  case 11: { /* what the terms and motions share */
    const size_t at = below(in, MOST_TIMES);
    d->t[at] = (k && at ? d->t[at - 1] : 0.0) + number(in, 1e-3);
    d->values[below(in, sizeof d->values / sizeof *d->values)] = number(in, 5.0);
    d->torque.n_breakpoints = below(in, 3);
    d->breakpoints[k] = number(in, 1e-3);
    d->behaviour = byte(in);
    break;
  }
  case 12:
    edit_options(d, in);
    break;
  case 13:
    edit_settling(d, in);
    break;
  case 14:
    if (d->n_edits < sizeof d->state / sizeof *d->state) {
      d->state[d->n_edits].field = byte(in);
      d->state[d->n_edits].at = byte(in);
      d->state[d->n_edits++].value = number(in, 0.01);
    }
    break;
  default:
    if (k) {
      for (size_t c = below(in, sizeof d->names[j]), i = 0; i < c; ++i) {
        d->names[j][i] = (char)byte(in);
      }
      d->pulleys[j].name = d->names[j];
    } else if (j < SAMPLES) {
      d->times[j] = number(in, 1e-3);
    } else {
      d->t_end = number(in, 1e-3);
      d->scene.gravity[1] = number(in, -9.81);
    }
  }
}

static void read_drive(drive *d, bytes *in) {
  *d = (drive){.scene = test_scene(), .friction = test_friction, .t_end = 2e-3, .settles = 1};
  d->scene.belt.n_bodies = FEW_LINKS;
  d->scene.pulleys = d->pulleys;
  d->scene.friction = &d->friction;
  for (int j = 0; j < MOST_PULLEYS; ++j) {
    d->own[j] = test_friction;
    d->pulleys[j] =
        (bd_pulley){.center = {centers[j][0], centers[j][1]}, .radius = radii[j], .inertia = 0.001};
    d->pulleys[j].drag.viscous = 1e-3;
  }
  for (int k = 0; k < MOST_TIMES; ++k) {
    d->t[k] = 1e-3 * k;
  }
  for (int k = 0; k < SAMPLES; ++k) {
    d->times[k] = 1e-4 * k;
  }
  d->torque = (bd_torque){.terms = d->terms, .motions = d->motions, .breakpoints = d->breakpoints};
  bd_options_default(&d->options);
  bd_settle_options_default(&d->settle);
  for (int k = 0; k < MOST_EDITS && in->left; ++k) {
    edit_drive(d, in);
  }
}

/* --- states, in blocks of just their size ---------------------------------------------------- */

#define X(symbol, name, size, scale, unit, text) FIELD_OF_##symbol,
enum { BD_STATE_FIELDS(X) STATE_FIELDS };
#undef X

static size_t state_sizes(const bd_info *info, size_t sizes[STATE_FIELDS]) {
  size_t n = 0;
#define X(symbol, name, size, scale, unit, text) sizes[n++] = bd_size(info, BD_SIZE_##size);
  BD_STATE_FIELDS(X)
#undef X
  return n;
}

static void state_places(bd_state *state, double **places[STATE_FIELDS]) {
  size_t n = 0;
#define X(symbol, name, size, scale, unit, text) places[n++] = &state->name;
  BD_STATE_FIELDS(X)
#undef X
}

static void *room_of(size_t count, size_t size) {
  void *room = calloc(count ? count : 1, size);
  HOLDS(room);
  return room;
}

static bd_state new_state(const bd_info *info) {
  size_t sizes[STATE_FIELDS];
  double **places[STATE_FIELDS];
  bd_state state = {0};
  state_places(&state, places);
  for (size_t k = 0, n = state_sizes(info, sizes); k < n; ++k) {
    *places[k] = room_of(sizes[k], sizeof(double));
  }
  return state;
}

static void free_state(bd_state *state, const bd_info *info) {
  size_t sizes[STATE_FIELDS];
  double **places[STATE_FIELDS];
  state_places(state, places);
  for (size_t k = 0, n = state_sizes(info, sizes); k < n; ++k) {
    free(*places[k]);
  }
}

static int is_finite(bd_state *state, const bd_info *info) {
  size_t sizes[STATE_FIELDS];
  double **places[STATE_FIELDS];
  int finite = isfinite(state->t) != 0;
  state_places(state, places);
  for (size_t k = 0, n = state_sizes(info, sizes); k < n; ++k) {
    for (size_t i = 0; i < sizes[k]; ++i) {
      if (!isfinite((*places[k])[i])) {
        fprintf(stderr, "field %zu of the state, number %zu: %g\n", k, i, (*places[k])[i]);
        finite = 0;
      }
    }
  }
  return finite;
}

static void edit_state(const drive *d, bd_state *state, const bd_info *info) {
  size_t sizes[STATE_FIELDS];
  double **places[STATE_FIELDS];
  state_places(state, places);
  const size_t n = state_sizes(info, sizes);
  for (size_t e = 0; e < d->n_edits; ++e) {
    const size_t k = d->state[e].field % (n + 1);
    if (k == n) {
      state->t = d->state[e].value;
    } else if (sizes[k] && d->state[e].field >= 128) { /* moved */
      (*places[k])[d->state[e].at % sizes[k]] += d->state[e].value;
    } else if (sizes[k]) {
      (*places[k])[d->state[e].at % sizes[k]] = d->state[e].value;
    }
  }
}

/* --- use ------------------------------------------------------------------------------------- */

/* A code is of the table and breaks no invariant, and an error says which. FUZZ_SAYS in the
 * environment prints them. */
static int said(int code, const bd_error *err) {
  if (getenv("FUZZ_SAYS")) {
    fprintf(stderr, "%d %s\n", code, code < 0 ? err->message : "");
  }
  HOLDS(code == BD_OK || code == BD_MORE || strncmp(bd_error_symbol(code), "BD_ERR_", 7) == 0);
  HOLDS(code != BD_ERR_INVARIANT);
  if (code < 0) {
    HOLDS(err->code == code && err->message[0]);
    HOLDS(memchr(err->message, 0, sizeof err->message) && memchr(err->field, 0, sizeof err->field));
  }
  return code;
}

static void run(const drive *d, const bd_model *model, const bd_info *info, const bd_state *state) {
  bd_error err = {0}, again = {0};
  bd_sim *sim = NULL, *next = NULL;
  if (said(bd_sim_create(&sim, model, state, &d->torque, d->t_end, &d->options, &err), &err)) {
    return;
  }
  bd_output out = {0};
  double *force = room_of(SAMPLES * (size_t)info->n_bodies, sizeof *force);
  double *tension = room_of(SAMPLES * (size_t)info->n_pulleys, sizeof *tension);
  double *energy = room_of(SAMPLES * (size_t)bd_model_energy_terms(model, NULL), sizeof *energy);
  out.force = force;
  out.span_tension = tension;
  out.energy = d->options.ledger ? energy : NULL;
  const int sampled = said(bd_sim_set_output(sim, SAMPLES, d->times, &out, &err), &err) == BD_OK;
  int code = BD_MORE;
  for (int k = 0; k < 3 && code == BD_MORE; ++k) {
    code = said(bd_sim_advance(sim, STEPS / 3, &err), &err);
  }
  if (code < 0) {
    HOLDS(bd_sim_advance(sim, 1, &again) == code && strcmp(again.message, err.message) == 0);
  }
  bd_state end = new_state(info);
  HOLDS(bd_sim_state(sim, &end) == BD_OK && is_finite(&end, info));
  HOLDS(bd_sim_samples(sim) <= (sampled ? SAMPLES : 0));
  for (size_t k = 0; k < bd_sim_samples(sim) * (size_t)info->n_bodies; ++k) {
    HOLDS(isfinite(force[k]));
  }
  bd_warning warning;
  for (size_t k = 0; bd_sim_warning(sim, k, &warning); ++k) {
    HOLDS(warning.message[0] && warning.body < info->n_bodies && warning.pulley < info->n_pulleys);
  }
  char text[512];
  bd_stats stats;
  bd_sim_explain(sim, text, sizeof text);
  bd_sim_stats(sim, &stats);
  HOLDS(stats.steps >= 0 && stats.steps <= STEPS + 1 && bd_sim_method(sim));

  /* What goes on from its record; from one with a byte changed, or cut short, it does not. */
  const size_t size = code < 0 ? 0 : bd_sim_export(sim, NULL);
  if (size) {
    char *record = room_of(size, 1);
    HOLDS(bd_sim_export(sim, record) == size);
    const int made = bd_sim_create(&next, model, state, &d->torque, d->t_end, &d->options, &again);
    HOLDS(made == BD_OK || d->behaviour); /* a function may say no later */
    if (made == BD_OK) {
      record[size / 2] = (char)(record[size / 2] ^ 1);
      HOLDS(said(bd_sim_import(next, record, size, &again), &again) < 0);
      record[size / 2] = (char)(record[size / 2] ^ 1);
      HOLDS(said(bd_sim_import(next, record, size - 1, &again), &again) < 0);
      HOLDS(said(bd_sim_import(next, record, size, &again), &again) == BD_OK);
      said(bd_sim_advance(next, 5, &again), &again);
    }
    free(record);
  }
  bd_sim_free(next);
  bd_sim_free(sim);
  free_state(&end, info);
  free(force);
  free(tension);
  free(energy);
}

/* Of a state that is asked once. */
static void ask(const drive *d, const bd_model *model, const bd_info *info, const bd_state *state) {
  bd_error err = {0};
  bd_state out = new_state(info);
  double *force = room_of((size_t)info->n_bodies, sizeof *force);
  const bd_output output = {.force = force};
  said(bd_model_rate(model, state, d->values, &out, &err), &err);
  said(bd_model_observe(model, state, &output, &err), &err);
  said(bd_model_solve(model, state, d->times[1], state, &out, &err), &err);
  said(bd_model_set_going(model, state, d->times[2], &out, &err), &err);
  free(force);
  free_state(&out, info);
}

static void use(const drive *d, const bd_model *model) {
  bd_error err = {0};
  bd_info info;
  double kinetic, slip;
  bd_model_info(model, &info);
  HOLDS((info.n_bodies == d->scene.belt.n_bodies || d->scene.belt.mesh == BD_MESH_ALE) &&
        info.n_pulleys == d->scene.n_pulleys);
  double *travel = room_of((size_t)info.n_mounts, sizeof *travel);
  double *places = room_of(2 * (size_t)info.n_pulleys, sizeof *places);
  bd_model_rest(model, travel);
  bd_model_centers(model, travel, places);
  for (int j = 0; j < info.n_pulleys; ++j) {
    bd_model_friction(model, j, &kinetic, &slip);
    HOLDS(bd_pulley_label(model, j).text[0]);
  }
  bd_state state = new_state(&info);
  int code = said(bd_model_check_geometry(model, &err), &err);
  if (code == BD_OK && d->settles) {
    bd_settling *settling = NULL;
    code = said(bd_settle_create(&settling, model, NULL, &d->settle, &err), &err);
    if (code == BD_OK) {
      code = said(bd_settle_advance(settling, d->settles == 2 ? SETTLING_STEPS : 5, &err), &err);
      HOLDS(bd_sim_state(bd_settle_sim(settling), &state) == BD_OK && is_finite(&state, &info));
    }
    bd_settle_free(settling);
  }
  edit_state(d, &state, &info);
  run(d, model, &info, &state);
  ask(d, model, &info, &state);
  free_state(&state, &info);
  free(travel);
  free(places);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  static drive d;
  bytes in = {data, size};
  bd_error err = {0};
  bd_model *model = NULL;
  bd_wrap wraps[MOST_PULLEYS];
  double length;
  int turns;
  read_drive(&d, &in);
  if (said(bd_model_create(&model, &d.scene, &err), &err) == BD_OK) {
    said(bd_belt_line(d.scene.n_pulleys, d.pulleys, wraps, &length, &turns, &err), &err);
    use(&d, model);
  } else {
    HOLDS(!model);
  }
  bd_model_free(model);
  return 0;
}
