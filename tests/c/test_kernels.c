/* SPDX-License-Identifier: MIT
 *
 * Sums of vectors, at every kernel level that is built in and that the processor has, against plain
 * loops; solves of the ring by what they leave; the exponential against the library's.
 */
#define _POSIX_C_SOURCE 200809L
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "check.h"
#include "kernels/kernels.h"
#include "kernels/vector.h"
#include "solvers/solvers.h"

enum { LINKS = 13, PULLEYS = 3, STRIDE = BD_HALO + 16, THETA = 8 * STRIDE, SIZE = THETA + 16 };

/* Of at most 8 terms of size 1, weights up to 2: rounding takes 8 * 16 * 2^-53 at most. */
static const double tolerance = 1e-13;

static const bd_layout layout = {.n = LINKS,
                                 .fields = 63, /* all of the links' */
                                 .block = {0, 1, 2, 3, 4, 5, 6},
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

enum { LEVELS = 3 };

/* The kernels of a level; NULL if they are not built in, or the processor does not have it. */
static const bd_kernels *level_at(int k) {
  const char *const levels[LEVELS] = {"baseline", "avx2", "avx512"};
  setenv("BELTDYN_KERNELS", levels[k], 1);
  return bd_kernels_choose();
}

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
  int checked = 0;
  for (int k = 0; k < LEVELS; ++k) {
    const bd_kernels *kernels = level_at(k);
    if (kernels) {
      check_level(kernels);
      ++checked;
    }
  }
  CHECK(checked >= 1);
}

/* --- the ring's linear system ---------------------------------------------------------------- */

enum { MOST = 500, MOST_SIZE = 4, BLOCK = 16, PADDED = MOST + 2 * BD_HALO };
enum { BACK = BLOCK, FORWARD = 2 * BLOCK, ENTRIES = 3 * BLOCK };

/* A ring of n blocks of size x size, with all that couples them in arrays: its own block, and those
 * of the couplings to the block behind and from that one to it. Equations and unknowns are measured
 * in units of their own, those of a node's equations the same. */
typedef struct ring_case {
  int n, size;
  double entries[ENTRIES][PADDED], tiles[ENTRIES * PADDED];
  double right[MOST_SIZE][PADDED], x[MOST_SIZE][PADDED];
  double equation[PADDED], unit[MOST_SIZE][PADDED];
} ring_case;

/* Rings of 4 x 4 blocks at the levels of this program (ring4.c). */
extern const bd_newton_kernels bd_ring4_baseline;
#ifdef BD_X86_LEVELS
extern const bd_newton_kernels bd_ring4_avx2, bd_ring4_avx512;
#endif

static const bd_newton_kernels *ring_of(const bd_kernels *level, int size) {
  if (size < 4) {
    return level[size == 3 ? BD_BELT_MODEL_joint : BD_BELT_MODEL_string].newton;
  }
#ifdef BD_X86_LEVELS
  if (strcmp(level->level, "avx2") == 0) {
    return &bd_ring4_avx2;
  }
  if (strcmp(level->level, "avx512") == 0) {
    return &bd_ring4_avx512;
  }
#endif
  return &bd_ring4_baseline;
}

/* Entries of the couplings up to 1, of either sign; of a row those are at most 3 times as many as
 * the unknowns of a block, and its diagonal is twice as large as their sum can be. */
static void make_ring(ring_case *c, int n, int size) {
  c->n = n;
  c->size = size;
  for (int i = 0; i < n; ++i) {
    const int at = BD_HALO + i;
    for (int e = 0; e < ENTRIES; ++e) {
      const int on_diagonal = e < size * size && e % (size + 1) == 0;
      c->entries[e][at] = next_number() + (on_diagonal ? 2.0 * 3 * size : 0.0);
    }
    for (int u = 0; u < size; ++u) {
      c->right[u][at] = c->x[u][at] = next_number();
      c->unit[u][at] = 1.0;
    }
    c->equation[at] = 1.0;
  }
}

/* The equations of every node, and every unknown, in a unit of its own, from 1e-6 to 1e6. Pivots do
 * not see that: they are sought among the equations of a node, in one column. */
static void scale_ring(ring_case *c) {
  const int size = c->size, n = c->n;
  for (int i = 0; i < n; ++i) {
    c->equation[BD_HALO + i] = pow(10.0, 6.0 * next_number());
    for (int u = 0; u < size; ++u) {
      c->unit[u][BD_HALO + i] = pow(10.0, 6.0 * next_number());
    }
  }
  for (int i = 0; i < n; ++i) {
    const int at = BD_HALO + i, behind = BD_HALO + (i + n - 1) % n;
    for (int e = 0; e < size * size; ++e) {
      const int v = e % size;
      c->entries[e][at] *= c->equation[at] / c->unit[v][at];
      c->entries[BACK + e][at] *= c->equation[at] / c->unit[v][behind];
      c->entries[FORWARD + e][at] *= c->equation[behind] / c->unit[v][at];
    }
    for (int u = 0; u < size; ++u) {
      c->right[u][at] = c->x[u][at] *= c->equation[at];
    }
  }
}

static void exchange(double *a, double *b) {
  const double kept = *a;
  *a = *b;
  *b = kept;
}

/* The equations of x and y of every other link take each other's places, and the entries xx that
 * this gives are 0: the same unknowns, but those that contact leaves no stiffness of its own. */
static void exchange_equations(ring_case *c) {
  const int size = c->size;
  for (int i = 1; i < c->n; i += 2) {
    const int at = BD_HALO + i, ahead = BD_HALO + (i + 1) % c->n;
    for (int v = 0; v < size; ++v) {
      exchange(&c->entries[v][at], &c->entries[size + v][at]);
      exchange(&c->entries[BACK + v][at], &c->entries[BACK + size + v][at]);
      exchange(&c->entries[FORWARD + v][ahead], &c->entries[FORWARD + size + v][ahead]);
    }
    c->entries[0][at] = 0.0;
    exchange(&c->right[0][at], &c->right[1][at]);
    exchange(&c->x[0][at], &c->x[1][at]);
  }
}

/* Row i of the matrix, block by block, its columns wrapped round the ring; entries are added, for
 * in a short ring several blocks may be in one place. */
static void dense_row(const ring_case *c, int i, int u, double *row) {
  const int size = c->size, n = c->n;
  memset(row, 0, (size_t)(size * n) * sizeof *row);
  for (int v = 0; v < size; ++v) {
    const int e = size * u + v, behind = (i + n - 1) % n, ahead = (i + 1) % n;
    row[size * i + v] += c->entries[e][BD_HALO + i];
    row[size * behind + v] += c->entries[BACK + e][BD_HALO + i];
    row[size * ahead + v] += c->entries[FORWARD + e][BD_HALO + ahead];
  }
}

static void solve_ring(ring_case *c, const bd_kernels *level) {
  const bd_newton_kernels *kernels = ring_of(level, c->size);
  const int d2 = c->size * c->size;
  for (int i = 0; i < c->n; ++i) {
    double *tile = c->tiles + i / BD_LANES * (3 * d2 * BD_LANES) + i % BD_LANES;
    for (int e = 0; e < d2; ++e) { /* back, diagonal, and ahead, which stands with the one ahead */
      tile[e * BD_LANES] = c->entries[BACK + e][BD_HALO + i];
      tile[(d2 + e) * BD_LANES] = c->entries[e][BD_HALO + i];
      tile[(2 * d2 + e) * BD_LANES] = c->entries[FORWARD + e][BD_HALO + (i + 1) % c->n];
    }
  }
  bd_ring ring;
  bd_carver carver = {0};
  bd_ring_carve(&carver, &ring, kernels, c->n);
  void *memory = bd_block_new(carver.used);
  carver = (bd_carver){.base = memory};
  bd_ring_carve(&carver, &ring, kernels, c->n);
  kernels->factor(&ring, c->tiles);
  double *x[MOST_SIZE];
  for (int u = 0; u < c->size; ++u) {
    x[u] = c->x[u] + BD_HALO;
  }
  kernels->solve(&ring, x);
  bd_block_free(memory);
}

/* What the solution leaves of the equations: elimination without pivots between blocks leaves
 * nothing larger than the largest entries, of a matrix whose diagonal is twice the sum of the
 * others (make_ring) or that is symmetric and positive definite (make_bars). A row's entries and
 * right-hand side go through some 20 roundings, each 2^-53 of |A| |x| at most; nothing is lost to a
 * ratio of stiffnesses, by the order in which the equations of x and y of a link are written, or by
 * the units in which each is measured: with those taken out again the same is left. */
static void check_ring(const bd_kernels *kernels, ring_case *c) {
  const int size = c->size, all = size * c->n;
  double row[MOST_SIZE * MOST], norm = 0.0, largest_x = 0.0, worst = 0.0;
  solve_ring(c, kernels);
  for (int i = 0; i < all; ++i) {
    const int u = i % size, at = BD_HALO + i / size;
    double left = c->right[u][at], sum = 0.0;
    dense_row(c, i / size, u, row);
    for (int j = 0; j < all; ++j) {
      left -= row[j] * c->x[j % size][BD_HALO + j / size];
      sum += fabs(row[j]) * c->unit[j % size][BD_HALO + j / size];
    }
    CHECK(isfinite(left));
    norm = fmax(norm, sum / c->equation[at]);
    worst = fmax(worst, fabs(left) / c->equation[at]);
    largest_x = fmax(largest_x, fabs(c->x[u][at]) / c->unit[u][at]);
  }
  CHECK(largest_x > 0.001);
  CHECK(worst <= 10.0 * DBL_EPSILON * norm * largest_x);
}

/* A taut string in a circle as a long step sees it: unit masses, bars whose stiffness along them is
 * 1e6 and across them, from their tension, 1e3. */
static void make_bars(ring_case *c, int n) {
  make_ring(c, n, 2);
  memset(c->entries, 0, sizeof c->entries);
  for (int i = 0; i < n; ++i) {
    const double angle = 2.0 * BD_PI * i / n, ux = cos(angle), uy = sin(angle);
    const double u[] = {ux * ux, ux * uy, ux * uy, uy * uy};
    for (int e = 0; e < 4; ++e) {
      const double one = e % 3 == 0 ? 1.0 : 0.0, bar = 1e6 * u[e] + 1e3 * (one - u[e]);
      c->entries[e][BD_HALO + i] += one + bar;
      c->entries[e][BD_HALO + (i + n - 1) % n] += bar;
      c->entries[BACK + e][BD_HALO + i] = c->entries[FORWARD + e][BD_HALO + i] = -bar;
    }
  }
}

/* Every length from 3 nodes (the shortest belt) or one node an arc on to 33, then longer ones: arcs
 * of the same and of different lengths. Of 2, 3 and 4 unknowns a node, in two orders, and badly
 * scaled; and stiff strings. */
static void rings_are_solved(void) {
  enum { PLAIN, EXCHANGED, SCALED, KINDS };
  const int longer[] = {33, 60, 61, MOST};
  ring_case *c = bd_block_new(sizeof *c);
  for (int k = 0; k < LEVELS; ++k) {
    const bd_kernels *kernels = level_at(k);
    for (int kind = 0; kernels && kind <= 3 * KINDS; ++kind) {
      const int least = kernels->newton->width > 3 ? kernels->newton->width : 3;
      for (int m = kind < 3 * KINDS ? least - 33 : 0; m < 4; ++m) {
        const int n = m < 0 ? 33 + m : longer[m];
        if (kind == 3 * KINDS) {
          make_bars(c, n);
        } else {
          make_ring(c, n, 2 + kind % 3);
        }
        if (kind / 3 == EXCHANGED) {
          exchange_equations(c);
        } else if (kind / 3 == SCALED) {
          scale_ring(c);
        }
        check_ring(kernels, c);
      }
    }
  }
  bd_block_free(c);
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
  const bd_friction friction = {BD_LAW_lugre, .lugre = {1e-306, 1.0, 1.0, 1.0, 0.0, 0.0}};
  for (int k = 0; k < LEVELS; ++k) {
    const bd_kernels *kernels = level_at(k);
    double worst = 0.0;
    for (int i = 1; kernels && i <= 66000; ++i) {
      const double v = sqrt(1e-2 * i), exact = (double)expl(-(long double)(v * v));
      bd_law_point at;
      kernels->law[BD_LAW_lugre](&friction, 0.02, 0, 0.0, v, 1.0, &at);
      worst = fmax(worst, fabs(-v / at.rate_by_state - exact) / exact);
    }
    CHECK(worst <= 4.0 * DBL_EPSILON);
  }
}

static const test tests[] = {
    {"sums_of_any_number_of_vectors", sums_of_any_number_of_vectors},
    {"rings_are_solved", rings_are_solved},
    {"exponentials_have_their_digits", exponentials_have_their_digits},
    {"exponentials_of_every_level", exponentials_of_every_level},
};

int main(int argc, char **argv) {
  return run_tests(argc, argv, tests, (int)(sizeof tests / sizeof tests[0]));
}
