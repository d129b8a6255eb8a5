/* SPDX-License-Identifier: MIT
 *
 * Times of the core's inner loops, for benchmarks/kernels.py, which compiles this against the core
 * and feeds it drives on stdin: how many rounds and drives, then for each its scene and a state.
 * Prints one line a figure: level, drive, links in contact, row, median time of a call [ns].
 *
 * To add a row: a function of a bench, and a line in `rows`. Rows are timed round after round, so
 * that a machine that slows down slows all. Compiled once more for each instruction level, with
 * BD_LIMITS its name, for what the machine can do at best: multiply-adds and loads of vectors.
 */
#define _POSIX_C_SOURCE 200809L
#include <stddef.h>

#define PASTE2(a, b) a##b
#define PASTE(a, b) PASTE2(a, b)

#ifdef BD_LIMITS

#ifdef __AVX512F__
enum { WIDTH = 8 };
#elif defined(__AVX__)
enum { WIDTH = 4 };
#else
enum { WIDTH = 2 };
#endif
typedef double vector __attribute__((vector_size(8 * WIDTH)));
typedef long long bits __attribute__((vector_size(8 * WIDTH)));

/* n multiply-adds of doubles, in chains enough to hide their latency. Contraction is on here. */
double PASTE(bench_fma_, BD_LIMITS)(long n, double factor);
double PASTE(bench_fma_, BD_LIMITS)(long n, double factor) {
  vector a, c[12];
  for (int lane = 0; lane < WIDTH; ++lane) {
    a[lane] = factor;
  }
  for (int chain = 0; chain < 12; ++chain) {
    c[chain] = a + chain;
  }
  for (long k = 0; k < n / (12 * WIDTH); ++k) {
    for (int chain = 0; chain < 12; ++chain) {
      c[chain] = c[chain] * a + a;
    }
  }
  double sum = 0.0;
  for (int chain = 0; chain < 12; ++chain) {
    sum += c[chain][0];
  }
  return sum;
}

/* Reads n doubles, a multiple of 64. */
double PASTE(bench_load_, BD_LIMITS)(size_t n, const double *data);
double PASTE(bench_load_, BD_LIMITS)(size_t n, const double *data) {
  const bits *v = (const void *)data;
  bits c[8] = {{0}};
  for (size_t k = 0; k < n / WIDTH; k += 8) {
    for (size_t chain = 0; chain < 8; ++chain) {
      c[chain] ^= v[k + chain];
    }
  }
  long long all = 0;
  for (int chain = 0; chain < 8; ++chain) {
    all ^= c[chain][0];
  }
  return (double)all;
}

#else

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "run/run.h"

enum { STAGES = 7, MAX_ROUNDS = 999, N_VALUES = 512 * 1024 / 8 };
static const char *const limit_names[] = {"multiply-add", "load from L1", "load from L2"};

#ifdef BD_X86_LEVELS
#define LEVELS(X) X(baseline) X(avx2) X(avx512)
#else
#define LEVELS(X) X(baseline)
#endif
#define X(level)                                                                                   \
  double bench_fma_##level(long n, double factor);                                                 \
  double bench_load_##level(size_t n, const double *data);
LEVELS(X)
#undef X

static const struct {
  const char *name;
  double (*fma)(long n, double factor);
  double (*load)(size_t n, const double *data);
} levels[] = {
#define X(level) {#level, bench_fma_##level, bench_load_##level},
    LEVELS(X)
#undef X
};
enum { N_LEVELS = sizeof levels / sizeof levels[0] };

typedef struct bench {
  const bd_model *model;
  bd_plan plan, ledger; /* the same drive without and with the energy ledger */
  double *y, *y_new, *weights, *stage[STAGES];
  bd_newton_system newton;
  bd_sim *runs[3]; /* one a method */
} bench;

static const char *const methods[] = {"tsit5", "lbdf2", "rodas4"};

static double sink; /* what is computed must be used */

static void die(const char *what) {
  fprintf(stderr, "%s\n", what);
  exit(EXIT_FAILURE);
}

/* --- rows ------------------------------------------------------------------------------------ */

static void row_rate(bench *b) {
  bd_plan_rate(&b->plan, 0.0, b->y, b->stage[0], NULL);
}

static void row_rate_ledger(bench *b) {
  bd_plan_rate(&b->ledger, 0.0, b->y, b->stage[0], NULL);
}

static void row_joints(bench *b) {
  sink += b->plan.kernels->joints[b->plan.bending_on][0](&b->plan.links, b->y, b->stage[0]);
}

static void contact(bench *b, int ledger) {
  b->plan.skip_power = !ledger;
  bd_effect_contact.rate(&b->plan, 0.0, b->y, b->stage[0], NULL);
  sink += b->plan.friction[0];
}

static void row_contact(bench *b) {
  contact(b, 0);
}

static void row_contact_ledger(bench *b) {
  contact(b, 1);
}

static void row_combine(bench *b) {
  static const double a[] = {0.5, -0.25, 0.125, 0.5, -0.25, 0.125};
  b->plan.kernels->combine(b->model->lay.size, b->y_new, b->y, 1e-9, 6, a, b->stage);
}

static void row_error(bench *b) {
  static const double e[] = {0.5, -0.25, 0.125, 0.5, -0.25, 0.125, 0.0625};
  sink += b->plan.kernels->error_norm(&b->model->lay, 1e-9, STAGES, e, b->stage, b->weights);
}

static void row_after(bench *b) {
  int changed;
  bd_plan_after_step(&b->plan, 0.0, b->y, 1e-7, &changed, NULL);
}

static void row_search(bench *b) {
  bd_search_ready(&b->plan, b->y, 0.0);
}

static void row_linearise(bench *b) {
  bd_newton_linearise(&b->newton, &b->plan, b->y);
}

static void row_factor(bench *b) {
  bd_newton_factor(&b->newton, &b->plan, b->y, 1e-5, 0.0, NULL);
}

/* The parts of the linear systems that the friction law decides. */
static void row_add_contact(bench *b) {
  const bd_newton_system *system = &b->newton;
  const bd_fill fill = {b->y, system->stage.g, 0.0, NULL};
  for (int j = 0; j < b->model->lay.np; ++j) {
    const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
    sink += system->kernels
                ->fill_pulley[pulley->law](
                    &b->plan.links, &system->at.joints, pulley, system->at.n_runs[j],
                    system->at.runs + j * system->at.max_runs, &fill, &system->scratch,
                    &system->blocks, &system->slots[j], &system->bodies[j], NULL)
                .own;
  }
}

static void row_finish_contact(bench *b) {
  const bd_newton_system *system = &b->newton;
  const bd_layout *lay = &b->model->lay;
  double *c = b->stage[1];
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
    if (pulley->law != BD_LAW_NONE) {
      system->kernels->restore_states(
          lay, system->at.n_runs[j], system->at.runs + j * system->at.max_runs, pulley->states,
          &system->slots[j], b->plan.links.link_mask, 1.0, NULL, bd_cfield(lay, c, F_X),
          bd_cfield(lay, c, F_VX), bd_field(lay, c, bd_f_state(lay, pulley->slot)),
          bd_field(lay, c, bd_f_slip(lay, pulley->slot)));
    }
  }
}

/* of rates, which have to be fetched anew, for they become the solution */
static void row_solve(bench *b) {
  memcpy(b->stage[1], b->stage[0], b->model->lay.size * sizeof *b->stage[0]);
  bd_newton_solve(&b->newton, &b->plan, b->stage[1]);
}

static void step(bench *b, int method) {
  bd_error err;
  if (bd_sim_advance(b->runs[method], 1, &err) < BD_OK) {
    die(err.message);
  }
}

static void row_tsit5(bench *b) {
  step(b, 0);
}

static void row_lbdf2(bench *b) {
  step(b, 1);
}

static void row_rodas4(bench *b) {
  step(b, 2);
}

static const struct {
  const char *name;
  void (*call)(bench *);
} rows[] = {
    {"right-hand side", row_rate},
    {"  with ledger", row_rate_ledger},
    {"  joints", row_joints},
    {"  contact", row_contact},
    {"  contact + ledger", row_contact_ledger},
    {"combine 6 stages", row_combine},
    {"error norm", row_error},
    {"after step", row_after},
    {"search", row_search},
    {"Jacobian", row_linearise},
    {"factorisation", row_factor},
    {"  of contact", row_add_contact},
    {"solve", row_solve},
    {"  states of friction", row_finish_contact},
    {"step of tsit5", row_tsit5},
    {"step of lbdf2", row_lbdf2},
    {"step of rodas4", row_rodas4},
};
enum { N_ROWS = sizeof rows / sizeof rows[0] };

/* --- a drive --------------------------------------------------------------------------------- */

static double number(void) {
  double value;
  if (scanf("%lf", &value) != 1) {
    die("a number was expected");
  }
  return value;
}

static double *numbers(int n) {
  double *values = malloc((size_t)n * sizeof *values);
  for (int i = 0; values && i < n; ++i) {
    values[i] = number();
  }
  return values ? values : (die("out of memory"), NULL);
}

/* "none", or a law's name and its parameters in their order. */
static void read_friction(bd_friction *friction) {
  char name[32];
  if (scanf("%31s", name) != 1 || (friction->law = bd_law_find(name)) < 0) {
    friction->law = BD_LAW_NONE;
  }
  for (size_t k = 0; k < bd_n_parameters; ++k) {
    if (friction->law != BD_LAW_NONE && strcmp(bd_parameters[k].group, name) == 0) {
      char *const place = (char *)&friction->dahl + bd_parameters[k].offset;
      if (bd_parameters[k].kind == BD_IS_LIST) {
        bd_numbers list = {(int)number(), {0.0}};
        for (int e = 0; e < list.n && e < BD_MAX_ELEMENTS; ++e) {
          list.at[e] = number();
        }
        memcpy(place, &list, sizeof list);
      } else {
        const double value = number();
        memcpy(place, &value, sizeof value);
      }
    }
  }
}

typedef struct drive {
  bd_scene scene;
  bd_friction friction;
  bd_state state;
} drive;

static void read_drive(drive *d) {
  bd_belt *belt = &d->scene.belt;
  belt->n_bodies = (int)number();
  belt->mesh = number() > 0.0 ? BD_MESH_JOINT : BD_MESH_PAPER;
  double *const fields[] = {&belt->length,
                            &belt->linear_density,
                            &belt->axial_stiffness,
                            &belt->axial_damping,
                            &belt->bending_stiffness,
                            &belt->bending_damping,
                            &d->scene.contact.quadratic,
                            &d->scene.contact.linear,
                            &d->scene.contact.damping};
  for (size_t k = 0; k < sizeof fields / sizeof fields[0]; ++k) {
    *fields[k] = number();
  }
  read_friction(&d->friction);
  int np = d->scene.n_pulleys = (int)number(), n = belt->n_bodies;
  bd_pulley *pulleys = calloc((size_t)np, sizeof *pulleys);
  for (int j = 0; j < np; ++j) {
    pulleys[j].center[0] = number();
    pulleys[j].center[1] = number();
    pulleys[j].radius = number();
    pulleys[j].inertia = number();
  }
  d->scene.pulleys = pulleys;
  double **const links[] = {&d->state.x,  &d->state.y,    &d->state.phi, &d->state.vx,
                            &d->state.vy, &d->state.vphi, &d->state.mu,  &d->state.slip};
  const int states = bd_friction_states(&d->friction);
  for (size_t k = 0; k < sizeof links / sizeof links[0]; ++k) {
    *links[k] = numbers(links[k] == &d->state.mu && states > 1 ? states * n : n);
  }
  d->state.theta = numbers(np);
  d->state.omega = numbers(np);
}

static void carve(bd_carver *carver, bench *b, const bd_torque *torque) {
  const bd_layout *lay = &b->model->lay;
  BD_CARVE(carver, b->y, lay->size);
  BD_CARVE(carver, b->y_new, lay->size);
  BD_CARVE(carver, b->weights, lay->size);
  for (int k = 0; k < STAGES; ++k) {
    BD_CARVE(carver, b->stage[k], lay->size);
  }
  bd_newton_carve(carver, &b->newton, b->model);
  bd_plan *const plans[] = {&b->plan, &b->ledger};
  for (int k = 0; k < 2; ++k) {
    bd_plan_carve(carver, plans[k], b->model);
    bd_torque_set_carve(carver, &plans[k]->torques, b->model, torque);
  }
}

static void open_bench(bench *b, const drive *d) {
  memset(b, 0, sizeof *b);
  bd_model *model;
  bd_error err = {0};
  drive copy = *d; /* the scene points to its friction */
  copy.scene.friction = copy.friction.law == BD_LAW_NONE ? NULL : &copy.friction;
  if (bd_model_create(&model, &copy.scene, &err) != BD_OK) {
    die(err.message);
  }
  b->model = model;
  double zero = 0.0, *none = calloc((size_t)model->lay.np, sizeof *none);
  const bd_torque_term term = {.kind = BD_TORQUE_PIECEWISE, .n_t = 1, .t = &zero, .values = none};
  const bd_torque torque = {.n_terms = 1, .terms = &term};
  bd_carver carver = {0};
  bench sizes = *b;
  carve(&carver, &sizes, &torque);
  char *block = bd_block_new(carver.used + carver.n_kept);
  carver = (bd_carver){.base = block, .kept = block + carver.used};
  carve(&carver, b, &torque);
  double turns;
  if (bd_state_import(model, &copy.state, b->y, &turns, &err) != BD_OK) {
    die(err.message);
  }
  for (size_t k = 0; k < model->lay.size; ++k) {
    b->weights[k] = 1.0;
  }
  bd_plan *const plans[] = {&b->plan, &b->ledger};
  for (int k = 0; k < 2; ++k) {
    bd_plan_make(plans[k], model, &(bd_plan_options){.ledger = k, .friction = 1});
    if (bd_torque_set_fill(&plans[k]->torques, &torque, &err) != BD_OK) {
      die(err.message);
    }
    bd_plan_place(plans[k], 0.0, b->y);
    bd_plan_assign_contacts(plans[k], b->y);
    plans[k]->search.travelled = (double)INFINITY;
    bd_search_ready(plans[k], b->y, 1e-5);
  }
  /* stages that are all alike, and no denormals among them */
  for (int k = STAGES - 1; k >= 0; --k) {
    bd_plan_rate(&b->plan, 0.0, b->y, b->stage[k], &err);
  }
  row_linearise(b);
  row_factor(b);
  /* whole steps, ledger and rejected ones included, of the drive left to itself */
  for (int k = 0; k < 3; ++k) {
    bd_options options;
    bd_options_default(&options);
    options.method = methods[k];
    options.rtol = 1e-3;
    options.step = k == 1 ? 1e-4 : 0.0;
    if (bd_sim_create(&b->runs[k], model, &copy.state, &torque, 1e6, &options, &err) != BD_OK) {
      die(err.message);
    }
  }
}

/* --- timing ---------------------------------------------------------------------------------- */

static double seconds(void) {
  struct timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double time_row(bench *b, int row, long calls) {
  double from = seconds();
  for (long k = 0; k < calls; ++k) {
    rows[row].call(b);
  }
  return 1e9 * (seconds() - from) / (double)calls;
}

static int compare(const void *a, const void *b) {
  double left = *(const double *)a, right = *(const double *)b;
  return (left > right) - (left < right);
}

static double median(int n, double *values) {
  qsort(values, (size_t)n, sizeof *values, compare);
  return values[n / 2];
}

static int in_contact(const bench *b) {
  const bd_layout *lay = &b->model->lay;
  const double *x = bd_cfield(lay, b->y, F_X), *y = bd_cfield(lay, b->y, F_Y);
  int count = 0;
  for (int i = 0; i < lay->n; ++i) {
    for (int j = 0; j < lay->np; ++j) {
      const bd_contact_pulley *pulley = &b->plan.contact_pulleys[j];
      count += hypot(x[i] - pulley->x, y[i] - pulley->y) < pulley->radius;
    }
  }
  return count;
}

static void time_level(const char *level, int rounds, int n_drives, const drive *drives) {
  for (int d = 0; d < n_drives; ++d) {
    bench b;
    open_bench(&b, &drives[d]);
    static double times[N_ROWS][MAX_ROUNDS];
    long calls[N_ROWS];
    for (int row = 0; row < N_ROWS; ++row) {
      calls[row] = 1 + (long)(2e5 / time_row(&b, row, 100));
    }
    for (int round = 0; round < rounds; ++round) {
      for (int row = 0; row < N_ROWS; ++row) {
        times[row][round] = time_row(&b, row, calls[row]);
      }
    }
    for (int row = 0; row < N_ROWS; ++row) {
      printf("%s,%d,%d,%s,%.6g\n", level, d, in_contact(&b), rows[row].name,
             median(rounds, times[row]));
    }
    for (int k = 0; k < 3; ++k) {
      bd_sim_free(b.runs[k]);
    }
  }
}

/* Per vector of the widest kind, 8 doubles; 16 KiB for the first cache, 512 KiB for the second. */
static double time_limit(int level, int limit, const double *data) {
  long calls = limit < 2 ? 100 : 4;
  size_t n = limit == 1 ? 2048 : N_VALUES;
  double from = seconds();
  for (long k = 0; k < calls; ++k) {
    sink += limit == 0 ? levels[level].fma((long)n, 0.5) : levels[level].load(n, data);
  }
  return 1e9 * (seconds() - from) / (double)(calls * (long)(n / BD_LANES));
}

int main(void) {
  int rounds = (int)number(), n_drives = (int)number();
  if (rounds < 1 || rounds > MAX_ROUNDS) {
    die("1 to 999 rounds");
  }
  drive *drives = calloc((size_t)n_drives, sizeof *drives);
  for (int d = 0; d < n_drives; ++d) {
    read_drive(&drives[d]);
  }
  double *data = bd_block_new(N_VALUES * sizeof *data);
  for (int level = 0; level < N_LEVELS; ++level) {
    const char *name = levels[level].name;
    setenv("BELTDYN_KERNELS", name, 1);
    if (strcmp(bd_kernel_level(), name) != 0) {
      continue; /* the processor does not have it */
    }
    time_level(name, rounds, n_drives, drives);
    double times[3][MAX_ROUNDS];
    for (int round = 0; round < rounds; ++round) {
      for (int limit = 0; limit < 3; ++limit) {
        times[limit][round] = time_limit(level, limit, data);
      }
    }
    for (int limit = 0; limit < 3; ++limit) {
      printf("%s,%d,%d,%s,%.6g\n", name, 0, 0, limit_names[limit],
             median(rounds, times[limit]) / BD_LANES);
    }
  }
  return sink == 1.0; /* never, but the compiler cannot know */
}

#endif
