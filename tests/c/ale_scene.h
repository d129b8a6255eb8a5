/* SPDX-License-Identifier: MIT
 *
 * Cases of an ALE belt, which tests/ale_cases.py has written: drives, states and the oracle's
 * rates there, to which those of the kernels are held as they are read.
 */
#ifndef ALE_SCENE_H
#define ALE_SCENE_H

#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "belts/ale.h"
#include "check.h"

enum { MOST = 4096, PULLEYS = 16 };

/* --- reading ---------------------------------------------------------------------------------- */

static FILE *file;

static void no_memory(void) {
  printf("the file of cases cannot be read\n");
  exit(1);
}

/* The next numbers, which must have this name. */
static int read_numbers(const char *name, double *to) {
  char found[64], number[64];
  int n = 0;
  if (fscanf(file, "%63s %d", found, &n) != 2 || strcmp(found, name) != 0 || n > MOST) {
    printf("expected %s, found %s %d\n", name, found, n);
    no_memory();
  }
  for (int k = 0; k < n; ++k) {
    if (fscanf(file, "%63s", number) != 1) {
      no_memory();
    }
    to[k] = strtod(number, NULL);
  }
  return n;
}

static double read_number(const char *name) {
  double to[MOST];
  read_numbers(name, to);
  return to[0];
}

/* --- a case ----------------------------------------------------------------------------------- */

typedef struct scene {
  char name[64];
  int states, sprung, cells, np, modes, z_states;
  double length, stiff[PULLEYS * BD_ALE_MODES], inertia[PULLEYS];
  int mounted[PULLEYS];
  bd_ale_drive drive;
  bd_ale_pulley pulleys[PULLEYS];
  bd_friction laws[PULLEYS];
  bd_ale ale;
  bd_ale_state y, dy, scale; /* in slabs */
  bd_ale_newton newton;
  double *dense, *x, *up, *down, *sizes;
  void *block;
} scene;

static void read_law(bd_friction *law) {
  double to[MOST];
  const int n = read_numbers("law", to);
  memset(law, 0, sizeof *law);
  law->law = (int)to[0] == 0 ? BD_LAW_NONE : BD_LAW_NONE + (int)to[0];
  if (law->law == BD_LAW_maxwell_slip) {
    bd_maxwell_slip *p = &law->maxwell_slip;
    const int e = (int)to[1];
    p->mu.n = p->stiffness.n = p->damping.n = e;
    for (int k = 0; k < e; ++k) {
      p->mu.at[k] = to[2 + k];
      p->stiffness.at[k] = to[3 + e + k];
      p->damping.at[k] = to[4 + 2 * e + k];
    }
    p->mu_s = to[4 + 3 * e];
    p->v_stribeck = to[5 + 3 * e];
    return;
  }
  memcpy(&law->dahl, to + 1, (size_t)(n - 1) * sizeof(double));
}

static int read_scene(scene *s) {
  double to[MOST];
  char word[64];
  int n;
  if (fscanf(file, "%63s", word) != 1 || strcmp(word, "case") != 0) {
    return 0;
  }
  if (fscanf(file, "%63s %d", s->name, &n) != 2) {
    no_memory();
  }
  for (int k = 0; k < 3; ++k) {
    if (fscanf(file, "%63s", word) != 1) {
      no_memory();
    }
    to[k] = strtod(word, NULL);
  }
  s->states = (int)to[0];
  s->sprung = (int)to[1];
  bd_ale_drive *d = &s->drive;
  d->moving = (int)to[2];
  s->np = d->np = (int)read_number("n_p");
  s->cells = (int)read_number("n");
  s->modes = d->modes = (int)read_number("K");
  d->direction = (int)read_number("sense");
  read_numbers("sides", to);
  for (int j = 0; j < s->np; ++j) {
    s->pulleys[j].side = (int)to[j];
  }
  read_numbers("radii", to);
  for (int j = 0; j < s->np; ++j) {
    s->pulleys[j].radius = to[j];
  }
  s->length = read_number("length");
  d->linear_density = read_number("rhoA");
  d->axial_stiffness = read_number("EA");
  d->axial_damping = read_number("etaA");
  d->bending_stiffness = read_number("EI");
  d->bending_damping = read_number("etaI");
  read_numbers("contact", to);
  d->quadratic = to[0];
  d->linear = to[1];
  read_numbers("gravity", d->gravity);
  d->rest = read_number("h_0");
  read_numbers("p_0", to);
  for (int j = 0; j < s->np; ++j) {
    s->pulleys[j].raised = to[j];
  }
  read_numbers("on", to);
  for (int j = 0; j < s->np; ++j) {
    s->pulleys[j].cells = (int)to[j];
  }
  read_numbers("EI_n", s->stiff);
  read_numbers("inertias", s->inertia);
  read_numbers("sprung", to);
  for (int m = 0; m < s->sprung; ++m) {
    s->mounted[m] = (int)to[m];
  }
  read_numbers("centers", to);
  s->z_states = 1;
  for (int j = 0; j < s->np; ++j) {
    s->pulleys[j].center[0] = to[2 * j];
    s->pulleys[j].center[1] = to[2 * j + 1];
    read_law(&s->laws[j]);
    s->pulleys[j].friction = &s->laws[j];
    const int states = bd_friction_states(&s->laws[j]);
    s->z_states = states > s->z_states ? states : s->z_states;
  }
  d->pulleys = s->pulleys;
  return 1;
}

static void make_scene(scene *s) {
  bd_carver carver = {.base = NULL};
  for (int pass = 0; pass < 2; ++pass) {
    if (pass == 1) {
      s->block = bd_block_new(carver.used);
      carver = (bd_carver){.base = s->block};
    }
    double *states[3];
    bd_ale_carve(&carver, &s->ale, &s->drive);
    for (int k = 0; k < 3; ++k) {
      BD_CARVE(&carver, states[k], bd_ale_state_size(&s->drive, s->z_states));
    }
    if (pass == 1) {
      bd_ale_make(&s->ale, &s->drive);
    }
    bd_ale_newton_carve(&carver, &s->newton, &s->drive, s->z_states);
    const int n = s->newton.ring.unknowns;
    BD_CARVE(&carver, s->dense, n * n);
    BD_CARVE(&carver, s->x, n);
    BD_CARVE(&carver, s->up, n);
    BD_CARVE(&carver, s->down, n);
    BD_CARVE(&carver, s->sizes, n);
    if (pass == 1) {
      s->scale = bd_ale_state_in(&s->ale, s->z_states, states[2]);
      s->y = bd_ale_state_in(&s->ale, s->z_states, states[0]);
      s->dy = bd_ale_state_in(&s->ale, s->z_states, states[1]);
    }
  }
}

/* The oracle's cells are span 0, arc 1, span 1, ..., arc 0: slot of its cell c. */
static int slot_of(const bd_ale *ale, int c) {
  for (int i = 0;; i = (i + 1) % ale->np) {
    const bd_ale_arc *from = &ale->arcs[i], *to = &ale->arcs[from->next];
    if (c == 0) {
      return from->begin + from->n;
    }
    if (c - 1 < to->n) {
      return to->begin + c - 1;
    }
    c -= 1 + to->n;
  }
}

/* Into, or out of, slabs: cells or nodes by number, or those on arcs alone. */
static void put_all(const scene *s, const double *from, double *to) {
  for (int c = 0; c < s->cells; ++c) {
    to[slot_of(&s->ale, c)] = from[c];
  }
}

static void put_arcs(const scene *s, const double *from, double *to) {
  for (int c = 0, k = 0; c < s->cells; ++c) {
    const int slot = slot_of(&s->ale, c);
    if (s->ale.is_cell[slot] > 0.0) {
      to[slot] = from[k++];
    }
  }
}

static int on_arcs(const scene *s) {
  return s->cells - s->np;
}

/* --- comparing -------------------------------------------------------------------------------- */

static double worst_of_all;

/* The largest difference over the largest number, or over what else is to be the measure. */
static double worst(int n, const double *is, const double *due, double least) {
  double apart = 0.0, most = least;
  for (int k = 0; k < n; ++k) {
    apart = fmax(apart, fabs(is[k] - due[k]));
    most = fmax(most, fabs(due[k]));
    if (!isfinite(is[k])) {
      return INFINITY;
    }
  }
  return most > 0.0 ? apart / most : apart;
}

static void compare(const scene *s, int state, const char *what, double apart, double tolerance) {
  worst_of_all = tolerance < 1e-11 ? fmax(worst_of_all, apart) : worst_of_all;
  if (!(apart <= tolerance)) {
    ++failures;
    printf("%s, state %d: %s is %.2g off\n", s->name, state, what, apart);
  }
}

/* In the oracle's order. */
static void take_all(const scene *s, const double *from, double *to) {
  for (int c = 0; c < s->cells; ++c) {
    to[c] = from[slot_of(&s->ale, c)];
  }
}

static void take_arcs(const scene *s, const double *from, double *to) {
  for (int c = 0, k = 0; c < s->cells; ++c) {
    const int slot = slot_of(&s->ale, c);
    if (s->ale.is_cell[slot] > 0.0) {
      to[k++] = from[slot];
    }
  }
}

/* --- one state -------------------------------------------------------------------------------- */

static void evaluate(scene *s, const bd_ale_kernels *kernels, int freeze) {
  bd_ale *ale = &s->ale;
  kernels->place(ale);
  kernels->stretch(ale, &s->y);
  if (freeze) {
    kernels->freeze(ale, NULL);
  }
  for (int j = 0; j < s->np; ++j) {
    kernels->rub[ale->arcs[j].friction.law](ale, j, &s->y, &s->dy);
  }
  kernels->move(ale, &s->y, &s->dy);
}

static void read_state(scene *s) {
  double to[MOST];
  read_numbers("m", to);
  put_all(s, to, s->y.m);
  read_numbers("v", to);
  put_all(s, to, s->y.v);
  const int n = read_numbers("z", to) / (2 * on_arcs(s));
  for (int e = 0; e < n && e < s->z_states; ++e) {
    for (int end = 0; end < 2; ++end) {
      put_arcs(s, to + (2 * e + end) * on_arcs(s), s->y.z[end] + e * s->y.stride);
    }
  }
  read_numbers("a", s->y.a);
  read_numbers("p", s->y.p);
  read_numbers("omega", to);
  for (int j = 0; j < s->np; ++j) {
    s->ale.arcs[j].axis.omega = to[j];
  }
}

/* Tension is known to EA times rounding, 1e-16 / 5e-3 of itself; where it is EA (lambda - 1) /
 * lambda over metres and masses, noise of states of 5 % has it ten times as large. */
static const double tolerance = 1e-12;

/* Mounts at both ends of a span feel each other. */
static void solve_two(int n, const double *a, const double *b, double *x) {
  if (n == 1) {
    x[0] = b[0] / a[0];
    return;
  }
  const double determinant = a[0] * a[3] - a[1] * a[2];
  x[0] = (a[3] * b[0] - a[1] * b[1]) / determinant;
  x[1] = (a[0] * b[1] - a[2] * b[0]) / determinant;
}

static void check_state(scene *s, int k, const bd_ale_kernels *kernels) {
  double dm[MOST], dv[MOST], dz[MOST], da[MOST], dp[MOST], torque[MOST], share[MOST], axis[MOST];
  double tension[MOST], flow[MOST], pressing[MOST], span[MOST], wrap[MOST], is[MOST] = {0.0},
                                                                            lever[MOST];
  double known[MOST], places[MOST];
  const int N = on_arcs(s);
  read_state(s);
  read_numbers("d_m", dm);
  read_numbers("d_v", dv);
  const int nz = read_numbers("d_z", dz) / (2 * N);
  read_numbers("d_a", da);
  read_numbers("d_p", dp);
  read_numbers("torque_of_belt", torque);
  read_numbers("W", share);
  read_numbers("ax_tension", tension);
  read_numbers("ax_flow", flow);
  read_numbers("ax_pressing", pressing);
  read_numbers("geo_span", span);
  read_numbers("geo_wrap", wrap);
  read_numbers("geo_axis", axis);
  read_numbers("geo_lever", lever);
  read_numbers("geo_known", known);
  double works[MOST], stored[5];
  read_numbers("d_works", works);
  const char *const terms[] = {"E_elastic", "E_contact", "E_bending", "E_kinetic", "E_lateral"};
  for (int e = 0; e < 5; ++e) {
    stored[e] = read_number(terms[e]);
  }
  double bend[MOST], speed[MOST];
  read_numbers("places", places);
  read_numbers("bend", bend);
  read_numbers("speed", speed);
  for (int j = 0; j < s->np; ++j) {
    for (int x = 0; x < 2; ++x) {
      s->ale.arcs[j].axis.c[x] = places[2 * j + x];
      s->ale.arcs[j].axis.v[x] = axis[2 * j + x];
      s->ale.arcs[j].axis.lever[x] = lever[2 * j + x];
      s->ale.arcs[j].axis.known[x] = known[2 * j + x];
      s->ale.arcs[j].axis.bend[x] = bend[2 * j + x];
    }
    s->ale.arcs[j].axis.speed = speed[j];
  }
  evaluate(s, kernels, 1);
  const bd_ale_energy has = bd_ale_energy_of(&s->ale, &s->y);
  const double energy[5] = {has.axial, has.contact, has.bending, has.kinetic, has.lateral};
  for (int e = 0; e < 5;
       ++e) { /* A_n is that of the last step of the root for T, at most 1e-8 H0 before it */
    compare(s, k, terms[e], worst(1, &energy[e], &stored[e], fmax(stored[0], stored[3])), 1e-10);
  }
  const bd_ale_losses lost = bd_ale_losses_of(&s->ale, &s->y);
  const double losses[3] = {lost.axial, lost.bending, lost.friction};
  compare(s, k, "losses", worst(3, losses, works + 1, 0.0), tolerance);
  for (int j = 0; j < s->np; ++j) {
    is[j] = s->ale.spans[j].length;
  }
  compare(s, k, "span", worst(s->np, is, span, 0.0), tolerance);
  for (int j = 0; j < s->np; ++j) {
    is[j] = s->ale.arcs[j].wrap;
  }
  compare(s, k, "wrap", worst(s->np, is, wrap, 0.0), tolerance);
  take_all(s, s->ale.tension, is);
  compare(s, k, "tension", worst(s->cells, is, tension, 0.0), tolerance);
  take_all(s, s->ale.pressing, is);
  compare(s, k, "H", worst(s->cells, is, pressing, 0.0), tolerance);
  take_all(s, s->ale.flow, is);
  compare(s, k, "flow", worst(s->cells, is, flow, 0.0), tolerance);
  take_arcs(s, s->ale.share_a, is);
  take_arcs(s, s->ale.share_b, is + N);
  take_arcs(s, s->ale.cut_a, is + 2 * N);
  take_arcs(s, s->ale.cut_b, is + 3 * N);
  for (int c = 0; c < N; ++c) { /* of what does not lie the oracle has twice 0 */
    is[3 * N + c] = share[3 * N + c] > 0.0 ? is[3 * N + c] : 1.0 - is[3 * N + c];
  }
  compare(s, k, "W", worst(4 * N, is, share, 0.0), tolerance);
  take_all(s, s->dy.m, is);
  compare(s, k, "m'", worst(s->cells, is, dm, 0.0), tolerance);
  for (int e = 0; e < nz && e < s->z_states; ++e) {
    double most = 0.0; /* of a law's element, the largest on any arc */
    for (int c = 0; c < 2 * N; ++c) {
      most = fmax(most, fabs(dz[2 * N * e + c]));
    }
    for (int end = 0; end < 2; ++end) {
      take_arcs(s, s->dy.z[end] + e * s->dy.stride, is);
      compare(s, k, "z'", worst(N, is, dz + (2 * e + end) * N, most), tolerance);
    }
  }
  for (int j = 0; j < s->np; ++j) {
    is[j] = s->ale.arcs[j].torque;
  }
  compare(s, k, "torque", worst(s->np, is, torque, 0.0), tolerance);
  take_all(s, s->dy.v, is);
  compare(s, k, "v'", worst(s->cells, is, dv, 0.0), tolerance);
  compare(s, k, "a'", worst(s->np * s->modes, s->dy.a, da, 0.0), tolerance);
  compare(s, k, "p'", worst(s->np * s->modes, s->dy.p, dp, 0.0), tolerance);
  if (s->sprung > 0) {
    double matrix[4] = {0.0}, load[2] = {0.0};
    const int n = s->sprung;
    for (int i = 0; i < n; ++i) {
      const bd_ale_arc *arc = &s->ale.arcs[s->mounted[i]];
      load[i] = arc->force[0] * arc->axis.lever[0] + arc->force[1] * arc->axis.lever[1];
      matrix[i * n + i] = arc->inertia;
      for (int l = 0; l < n; ++l) {
        for (int j = 0; j < s->np; ++j) {
          const int ends[2] = {j, s->ale.arcs[j].next};
          if ((ends[0] == s->mounted[i] && ends[1] == s->mounted[l] && i != l) ||
              (ends[1] == s->mounted[i] && ends[0] == s->mounted[l] && i != l)) {
            matrix[i * n + l] += s->ale.spans[j].coupling;
          }
        }
      }
    }
    double due[MOST], own[MOST], found[2];
    read_numbers("mount_own", own);
    read_numbers("d_dq", due);
    for (int i = 0; i < n; ++i) {
      matrix[i * n + i] += own[2 * i];
      load[i] += own[2 * i + 1];
    }
    solve_two(n, matrix, load, found);
    /* of forces as large as the tension */
    const double least = s->ale.rest / fmin(matrix[0], matrix[n * n - 1]);
    compare(s, k, "q''", worst(n, found, due, least), tolerance);
  }
}

/* --- programs --------------------------------------------------------------------------------- */

/* At every instruction level that is built in and that the processor has. */
static const bd_ale_kernels *level_of(int level) {
#ifdef BD_X86_LEVELS
  const bd_ale_kernels *const levels[] = {
      &bd_ale_baseline,
      __builtin_cpu_supports("avx2") ? &bd_ale_avx2 : &bd_ale_baseline,
      __builtin_cpu_supports("avx512f") ? &bd_ale_avx512 : &bd_ale_baseline,
  };
  return levels[level];
#else
  (void)level;
  return &bd_ale_baseline;
#endif
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

#endif
