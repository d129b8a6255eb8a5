/* SPDX-License-Identifier: MIT
 *
 * The Jacobian of an ALE belt against differences of its rates, and solutions of its linear
 * systems by what they leave. `test_ale_jacobian FILE [NAME | timed]`.
 */
#include "ale_scene.h"

enum { LEVELS = 3 };

static const char *path;
static int timed;

/* --- the Jacobian ----------------------------------------------------------------------------- */

/* By what differences are taken and compared. */
static void set_scales(scene *s) {
  const bd_ale *ale = &s->ale;
  const double wave = sqrt(ale->axial * ale->density), H0 = ale->rest;
  for (int j = 0; j < s->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    for (int k = arc->begin; k <= arc->begin + arc->n; ++k) {
      s->scale.m[k] = s->y.m[k] * H0 / ale->axial;
      s->scale.v[k] = H0 / wave;
      for (int e = 0; e < arc->states; ++e) {
        const double z = arc->held ? 1.0 : H0 / arc->radius / 2e7;
        s->scale.z[0][e * s->y.stride + k] = s->scale.z[1][e * s->y.stride + k] = z;
      }
    }
    for (int n = 0; n < ale->modes; ++n) {
      const double S = ale->spans[j].length;
      s->scale.a[j * ale->modes + n] = 1e-3 * S;
      s->scale.p[j * ale->modes + n] = 1e-3 * BD_PI * sqrt(H0 / ale->density);
    }
  }
  bd_ale_gather(&s->newton, ale, &s->scale, s->sizes);
}

static void spread_out(const scene *s, double *dense) {
  const bd_ale_ring *ring = &s->newton.ring;
  const int n = ring->unknowns;
  memset(dense, 0, (size_t)(n * n) * sizeof *dense);
  for (int b = 0; b < ring->n; ++b) {
    const bd_ale_block *row = &ring->blocks[b];
    const bd_ale_block *const columns[] = {&ring->blocks[(b + ring->n - 1) % ring->n], row,
                                           &ring->blocks[(b + 1) % ring->n]};
    const double *const parts[] = {row->back, row->own, row->ahead};
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < row->n; ++i) {
        for (int l = 0; l < columns[c]->n; ++l) {
          dense[(row->at + i) * n + columns[c]->at + l] = parts[c][l * row->lead + i];
        }
      }
    }
  }
}

/* Rates at x, with an unknown changed; torques into `torque`. */
static double push_of(const bd_ale_arc *arc) {
  return arc->force[0] * arc->axis.lever[0] + arc->force[1] * arc->axis.lever[1];
}

static void rates_at(scene *s, const bd_ale_kernels *kernels, int u, double by, double *out,
                     double *torque) {
  const double kept = s->x[u];
  s->x[u] += by;
  bd_ale_scatter(&s->newton, &s->ale, s->x, &s->y);
  evaluate(s, kernels, 0);
  bd_ale_gather(&s->newton, &s->ale, &s->dy, out);
  for (int j = 0; j < s->np; ++j) {
    torque[j] = s->ale.arcs[j].torque;
    torque[PULLEYS + j] = push_of(&s->ale.arcs[j]);
  }
  s->x[u] = kept;
}

static double worst_entry;

/* Against differences: of every row the largest difference over its largest entry, by sizes. What
 * is left out is the speed's part of the cells' length. */
static void check_jacobian(scene *s, int k, const bd_ale_kernels *kernels, double allowed) {
  const int n = s->newton.ring.unknowns;
  static const double EPS = 1e-7; /* less than any place is off its sense of slip: a kink */
  double above[2 * PULLEYS], below[2 * PULLEYS];
  int worst_of_push[PULLEYS] = {0};
  double most[2 * PULLEYS] = {0.0}, off[2 * PULLEYS] = {0.0};
  set_scales(s);
  bd_ale_gather(&s->newton, &s->ale, &s->y, s->x);
  evaluate(s, kernels, 1);
  bd_ale_linearise(&s->newton, &s->ale, kernels, &s->y, &s->dy);
  spread_out(s, s->dense);
  double *row_most = calloc((size_t)n, sizeof *row_most),
         *row_off = calloc((size_t)n, sizeof *row_off);
  int *at = calloc((size_t)n, sizeof *at);
  for (int u = 0; u < n; ++u) {
    const double h = EPS * s->sizes[u];
    rates_at(s, kernels, u, h, s->up, above);
    rates_at(s, kernels, u, -h, s->down, below);
    for (int i = 0; i < n; ++i) {
      const double slope = (s->up[i] - s->down[i]) / (2.0 * EPS);
      const double apart = fabs(slope - s->dense[i * n + u] * s->sizes[u]);
      row_most[i] = fmax(row_most[i], fabs(slope));
      if (apart > row_off[i]) {
        row_off[i] = apart;
        at[i] = u;
      }
    }
    for (int j = 0; j < s->np; ++j) {
      const double slope = (above[j] - below[j]) / (2.0 * EPS);
      off[j] = fmax(off[j], fabs(slope - s->newton.row[j * n + u] * s->sizes[u]));
      most[j] = fmax(most[j], fabs(slope));
      const int at_push = PULLEYS + j;
      const double pushes = (above[at_push] - below[at_push]) / (2.0 * EPS);
      const double apart = fabs(pushes - s->newton.push[j * n + u] * s->sizes[u]);
      if (apart > off[at_push]) {
        off[at_push] = apart;
        worst_of_push[j] = u;
      }
      most[at_push] = fmax(most[at_push], fabs(pushes));
    }
  }
  int told = 0;
  for (int i = 0; i < n; ++i) {
    const double apart = row_off[i] / (row_most[i] + 1e-300);
    worst_entry = fmax(worst_entry, apart);
    if (!(apart <= allowed)) {
      ++failures;
      if (told++ < 6) {
        int rb = 0, cb = 0;
        while (rb + 1 < s->newton.ring.n && s->newton.ring.blocks[rb + 1].at <= i)
          ++rb;
        while (cb + 1 < s->newton.ring.n && s->newton.ring.blocks[cb + 1].at <= at[i])
          ++cb;
        printf("%s, state %d: row %d.%d (of %d) column %d.%d (of %d) %.2g off of %.3g; has %g\n",
               s->name, k, rb, i - s->newton.ring.blocks[rb].at, s->newton.ring.blocks[rb].n, cb,
               at[i] - s->newton.ring.blocks[cb].at, s->newton.ring.blocks[cb].n, apart,
               row_most[i], s->dense[i * n + at[i]] * s->sizes[at[i]]);
      }
    }
  }
  for (int j = 0; j < s->np; ++j) {
    const double apart = off[j] / (most[j] + 1e-300);
    worst_entry = fmax(worst_entry, apart);
    if (!(apart <= allowed)) {
      ++failures;
      printf("%s, state %d: torque %d by the belt %.2g off\n", s->name, k, j, apart);
    }
  }
  for (int j = 0; j < s->np; ++j) {
    const double apart = off[PULLEYS + j] / (most[PULLEYS + j] + 1e-300);
    worst_entry = fmax(worst_entry, apart);
    if (!(apart <= allowed)) {
      const int u = worst_of_push[j];
      int cb = 0;
      while (cb + 1 < s->newton.ring.n && s->newton.ring.blocks[cb + 1].at <= u)
        ++cb;
      ++failures;
      printf("%s, state %d: push %d by %d.%d (of %d) %.2g off of %g; has %g\n", s->name, k, j, cb,
             u - s->newton.ring.blocks[cb].at, s->newton.ring.blocks[cb].n, apart,
             most[PULLEYS + j], s->newton.push[j * n + u] * s->sizes[u]);
    }
  }
  /* columns of the rims */
  for (int j = 0; j < s->np; ++j) {
    const double h =
        EPS * s->ale.rest / sqrt(s->ale.axial * s->ale.density) / s->ale.arcs[j].radius;
    double *omega = &s->ale.arcs[j].axis.omega, kept = *omega, largest = 0.0, apart = 0.0;
    *omega = kept + h;
    rates_at(s, kernels, 0, 0.0, s->up, above);
    *omega = kept - h;
    rates_at(s, kernels, 0, 0.0, s->down, below);
    *omega = kept;
    for (int i = 0; i < n; ++i) {
      const double slope = (s->up[i] - s->down[i]) / (2.0 * h) / s->sizes[i];
      apart = fmax(apart, fabs(slope - s->newton.column[j * n + i] / s->sizes[i]));
      largest = fmax(largest, fabs(slope));
    }
    compare(s, k, "column of a rim", largest > 0.0 ? apart / largest : apart, allowed);
    for (int i = 0; i < s->np; ++i) {
      const double pushes = (above[PULLEYS + i] - below[PULLEYS + i]) / (2.0 * h);
      const double has = s->newton.push_by_rim[i * s->np + j];
      compare(s, k, "push by a rim",
              fabs(pushes - has) / (fabs(pushes) + 1e-3 * s->ale.rest / h * EPS), allowed);
    }
    const double slope = (above[j] - below[j]) / (2.0 * h);
    compare(s, k, "torque by the rim", fabs(slope - s->newton.own[j]) / (fabs(slope) + 1e-12),
            allowed);
  }
  rates_at(s, kernels, 0, 0.0, s->up, above);
  free(row_most);
  free(row_off);
  free(at);
}

static void time_solves(scene *s) {
  for (int level = 0; level < LEVELS; ++level) {
    const bd_ale_kernels *kernels = level_of(level);
    double best[3] = {INFINITY, INFINITY, INFINITY};
    s->newton.ring.g = 1e-4;
    for (int turn = 0; turn < 20; ++turn) {
      for (int what = 0; what < 3; ++what) {
        const double begin = now();
        for (int k = 0; k < 100; ++k) {
          if (what == 0) {
            bd_ale_linearise(&s->newton, &s->ale, kernels, &s->y, &s->dy);
          } else if (what == 1) {
            kernels->factor(&s->newton.ring);
          } else {
            memcpy(s->x, s->up, (size_t)s->newton.ring.unknowns * sizeof *s->x);
            kernels->solve(&s->newton.ring, s->x);
          }
        }
        best[what] = fmin(best[what], (now() - begin) / 100.0);
      }
    }
    printf("%-28s level %d: linearise %6.0f, factor %6.0f, solve %5.0f ns\n", s->name, level,
           1e9 * best[0], 1e9 * best[1], 1e9 * best[2]);
  }
}

static void jacobian_is_that_of_differences(void) {
  static scene s;
  file = fopen(path, "r");
  CHECK(file != NULL);
  while (file && read_scene(&s)) {
    make_scene(&s);
    worst_entry = 0.0;
    for (int k = 0; k < s.states; ++k) {
      check_state(&s, k, &bd_ale_baseline);
      double fastest = 0.0;
      for (int i = 0; i < s.ale.slots; ++i) {
        fastest = fmax(fastest, fabs(s.y.v[i]));
      }
      /* of waves of stretch, whose square is EA over rhoA */
      const double slower = fastest * sqrt(s.ale.density / s.ale.axial);
      check_jacobian(&s, k, &bd_ale_baseline, 1e-4 + 0.3 * slower);
    }
    printf("%s: Jacobian %.2g\n", s.name, worst_entry);
    bd_block_free(s.block);
  }
  fclose(file);
}

/* (1 - g J) x = b, by what is left, over the sum of magnitudes in each row. */
static void solutions_leave_nothing(void) {
  static scene s;
  double most = 0.0;
  file = fopen(path, "r");
  CHECK(file != NULL);
  while (file && read_scene(&s)) {
    make_scene(&s);
    for (int k = 0; k < s.states; ++k) {
      check_state(&s, k, &bd_ale_baseline);
      bd_ale_linearise(&s.newton, &s.ale, &bd_ale_baseline, &s.y, &s.dy);
      spread_out(&s, s.dense);
      set_scales(&s);
      const int n = s.newton.ring.unknowns;
      for (int power = -7; power <= -2; ++power) {
        const double g = s.newton.ring.g = pow(10.0, power);
        for (int i = 0; i < n; ++i) {
          s.up[i] = s.x[i] = s.sizes[i] * sin(1.0 + 3.0 * i);
        }
        bd_ale_baseline.factor(&s.newton.ring);
        bd_ale_baseline.solve(&s.newton.ring, s.x);
        for (int i = 0; i < n; ++i) {
          double left = s.up[i] - s.x[i], all = fabs(s.up[i]) + fabs(s.x[i]);
          for (int l = 0; l < n; ++l) {
            left += g * s.dense[i * n + l] * s.x[l];
            all += g * fabs(s.dense[i * n + l] * s.x[l]);
          }
          most = fmax(most, fabs(left) / all);
        }
      }
    }
    if (timed) {
      time_solves(&s);
    }
    bd_block_free(s.block);
  }
  fclose(file);
  printf("left by solves: %.2g\n", most);
  CHECK(most < 1e-9); /* no pivots are sought: some digits are lost, no more */
}

int main(int argc, char **argv) {
  path = argc > 1 ? argv[1] : "ale_cases.txt";
  timed = argc > 2 && strcmp(argv[2], "timed") == 0;
  const int only = argc > 2 && !timed ? 2 : 1;
  static const test tests[] = {{"jacobian", jacobian_is_that_of_differences},
                               {"solves", solutions_leave_nothing}};
  return run_tests(only, argv + argc - only, tests, 2);
}
