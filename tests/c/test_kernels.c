/* SPDX-License-Identifier: MIT
 *
 * Sums of vectors, at every kernel level that is built in and that the processor has, against plain
 * loops; the exponential against the library's; built with sanitizers by tests/test_c.py.
 */
#define _POSIX_C_SOURCE 200809L
#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "check.h"
#include "kernels/kernels.h"
#include "kernels/vector.h"

enum { LINKS = 13, PULLEYS = 3, STRIDE = BD_HALO + 16, THETA = 8 * STRIDE, SIZE = THETA + 16 };

/* Of at most 8 terms of size 1, weights up to 2: rounding takes 8 * 16 * 2^-53 at most. */
static const double tolerance = 1e-13;

static const bd_layout layout = {.n = LINKS,
                                 .n8 = 16,
                                 .np = PULLEYS,
                                 .slots = 1,
                                 .stride = STRIDE,
                                 .theta = THETA,
                                 .omega = THETA + PULLEYS,
                                 .work = THETA + 2 * PULLEYS,
                                 .size = SIZE};

typedef struct data {
  double *vectors[MAX_VECTORS], *y, *weights, *out, factors[MAX_VECTORS];
} data;

/* Between -1 and 1, the same in every run. */
static double next_number(void) {
  static uint32_t state = 1;
  state = state * 1664525u + 1013904223u;
  return (double)state / 2147483648.0 - 1.0;
}

static int is_padding(int place) {
  int link = place % STRIDE - BD_HALO;
  return place < THETA && (link < 0 || link >= LINKS);
}

static data make_data(void) {
  data d = {.y = bd_block_new(SIZE * sizeof(double)),
            .weights = bd_block_new(SIZE * sizeof(double)),
            .out = bd_block_new(SIZE * sizeof(double))};
  for (int j = 0; j < MAX_VECTORS; ++j) {
    d.vectors[j] = bd_block_new(SIZE * sizeof(double));
    d.factors[j] = next_number();
    for (int i = 0; i < SIZE; ++i) {
      d.vectors[j][i] = is_padding(i) ? 0.0 : next_number();
    }
  }
  for (int i = 0; i < SIZE; ++i) {
    d.y[i] = next_number();
    d.weights[i] = 1.5 + 0.5 * next_number();
  }
  return d;
}

static void free_data(data *d) {
  for (int j = 0; j < MAX_VECTORS; ++j) {
    bd_block_free(d->vectors[j]);
  }
  bd_block_free(d->y);
  bd_block_free(d->weights);
  bd_block_free(d->out);
}

static double sum_at(const data *d, int m, int place) {
  double total = 0.0;
  for (int j = 0; j < m; ++j) {
    total += d->factors[j] * d->vectors[j][place];
  }
  return total;
}

/* The largest weighted sum, positions and velocities as vectors that have the weight of their first
 * component. */
static double largest_error(const data *d, int m) {
  double worst = 0.0;
  for (int i = 0; i < SIZE; ++i) {
    int field = i < THETA ? i / STRIDE : -1;
    if (field != F_Y && field != F_VY) {
      double other = field == F_X || field == F_VX ? sum_at(d, m, i + STRIDE) : 0.0;
      worst = fmax(worst, d->weights[i] * hypot(sum_at(d, m, i), other));
    }
  }
  return worst;
}

static void check_level(const bd_kernels *kernels) {
  data d = make_data();
  for (int m = 1; m <= MAX_VECTORS; ++m) {
    memset(d.out, 0, SIZE * sizeof *d.out);
    kernels->combine(SIZE, d.out, d.y, 0.5, m, d.factors, d.vectors);
    for (int i = 0; i < SIZE; ++i) {
      CHECK(fabs(d.out[i] - (d.y[i] + 0.5 * sum_at(&d, m, i))) <= tolerance);
    }
    double norm = kernels->error_norm(&layout, 0.5, m, d.factors, d.vectors, d.weights);
    CHECK(fabs(norm - 0.5 * largest_error(&d, m)) <= tolerance);
    const int places[] = {BD_HALO, BD_HALO + LINKS - 1 + F_VPHI * STRIDE, THETA + PULLEYS};
    for (int k = 0; k < 3; ++k) {
      double *place = &d.vectors[m - 1][places[k]], kept = *place;
      *place = (double)NAN;
      CHECK(isinf(kernels->error_norm(&layout, 0.5, m, d.factors, d.vectors, d.weights)));
      *place = kept;
    }
  }
  free_data(&d);
}

static void sums_of_any_number_of_vectors(void) {
  const char *const levels[] = {"baseline", "avx2", "avx512"};
  int checked = 0;
  for (int k = 0; k < 3; ++k) {
    setenv("BELTDYN_KERNELS", levels[k], 1);
    const bd_kernels *kernels = bd_kernels_choose();
    if (kernels) {
      check_level(kernels);
      ++checked;
    }
  }
  CHECK(checked >= 1);
}

/* The friction laws' exponential as this file is compiled, against the library's of long doubles
 * (of doubles, to an ulp, where there are no longer ones): an ulp or two, as it says of itself. */
static void exponentials_have_their_digits(void) {
  const double places[] = {0.0, -0.0, -5e-324, -1e-300, -1e-16, -0.34657, -0.34658, -699.9999};
  double worst = 0.0;
  for (int k = 0; k < 700000 + 8; ++k) {
    double a = k < 8 ? places[k] : -1e-3 * (k - 8) - 1e-3 * fabs(next_number());
    a = fmax(a, -700.0);
    const double exact = (double)expl((long double)a), got = first_of(exponential(splat(a)));
    worst = fmax(worst, fabs(got - exact) / exact);
  }
  CHECK(worst <= 2.0 * DBL_EPSILON);
  CHECK(first_of(exponential(splat(0.0))) == 1.0);
  const double beyond[] = {-700.0, -745.0, -1e5, -1e300, -(double)INFINITY};
  for (int k = 0; k < 5; ++k) {
    const double got = first_of(exponential(splat(beyond[k])));
    CHECK(got >= 0.0 && got < 1e-304);
  }
}

/* The same of every level, seen through LuGre's law: with mu_s = 1 and next to nothing for mu_k,
 * g(v) = exp(-v^2), and -dG/dz = |v| / g(v), to two ulp more. */
static void exponentials_of_every_level(void) {
  const char *const levels[] = {"baseline", "avx2", "avx512"};
  const bd_friction friction = {BD_LAW_lugre, .lugre = {1e-306, 1.0, 1.0, 1.0, 0.0, 0.0}};
  for (int k = 0; k < 3; ++k) {
    setenv("BELTDYN_KERNELS", levels[k], 1);
    const bd_kernels *kernels = bd_kernels_choose();
    double worst = 0.0;
    for (int i = 1; kernels && i <= 66000; ++i) {
      const double v = sqrt(1e-2 * i), exact = (double)expl(-(long double)(v * v));
      bd_law_point at;
      kernels->law[BD_LAW_lugre](&friction, 0.02, 0.0, v, 1.0, &at);
      worst = fmax(worst, fabs(-v / at.rate_by_state - exact) / exact);
    }
    CHECK(worst <= 4.0 * DBL_EPSILON);
  }
}

static const test tests[] = {
    {"sums_of_any_number_of_vectors", sums_of_any_number_of_vectors},
    {"exponentials_have_their_digits", exponentials_have_their_digits},
    {"exponentials_of_every_level", exponentials_of_every_level},
};

int main(int argc, char **argv) {
  return run_tests(argc, argv, tests, (int)(sizeof tests / sizeof tests[0]));
}
