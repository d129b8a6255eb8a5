/* SPDX-License-Identifier: MIT
 *
 * Drives side by side, one a vector lane (lanes_kernels.c), against the core's kernels, which put
 * links into the lanes and take one drive after the other: for benchmarks/lanes.py, which compiles
 * this and feeds it drives on stdin, as kernels.c reads them, each with its loads. Prints a line a
 * figure: level, set of eight drives, row, what the core, the core with short lists of links and
 * the lanes have; then of each drive the times of its steps under load.
 */
#define _POSIX_C_SOURCE 200809L
#include "benchmarks/lanes.h"

/* The drives and the core's side, as kernels.c has them. */
#define main kernels_main
int kernels_main(void);
#include "kernels.c"
#undef main

#define X(level) extern const lanes_kernels lanes_##level;
LEVELS(X)
#undef X
static const lanes_kernels *const lanes_levels[] = {
#define X(level) &lanes_##level,
    LEVELS(X)
#undef X
};

enum { SIDE_BY_SIDE = 8, MOST_GROUPS = SIDE_BY_SIDE / 2 };

/* Those who compute: the core; the core with lists of links as short as the lanes have; lanes. */
enum { CORE, TIGHT, LANES, N_SIDES };

/* Eight drives: on the core's side one bench each, on the other side groups of lanes. */
typedef struct both {
  bench core[SIDE_BY_SIDE], tight[SIDE_BY_SIDE];
  double g[SIDE_BY_SIDE];
  const lanes_kernels *lanes;
  int n_groups;
  void *groups[MOST_GROUPS];
} both;

/* --- rows: of one drive in the core, and of one group ------------------------------------------
 */

static void core_factor(bench *b, double g) {
  bd_newton_factor(&b->newton, &b->plan, g);
}

static void core_ring_factor(bench *b) {
  b->newton.ring_kernels->factor[1](&b->newton.ring, &b->newton.blocks);
}

static void core_ring_solve(bench *b) {
  const bd_layout *lay = &b->model->lay;
  bd_newton_system *s = &b->newton;
  double *const to[] = {s->x, s->y, s->p};
  for (int k = 0; k < 3; ++k) {
    memcpy(to[k], bd_cfield(lay, b->stage[0], F_VX + k), (size_t)lay->n * sizeof *to[k]);
  }
  s->ring_kernels->solve[1](&s->ring, s->blocks.k, s->x, s->y, s->p);
}

static void core_solve(bench *b) {
  memcpy(b->stage[1], b->stage[0], b->model->lay.size * sizeof *b->stage[0]);
  bd_newton_solve(&b->newton, &b->plan, b->stage[1]);
}

static const double coefficients[] = {0.5, -0.25, 0.125, 0.5, -0.25, 0.125, 0.0625};

static void core_combine(bench *b, int m) {
  b->plan.kernels->combine(b->model->lay.size, b->y_new, b->y, 1e-9, m, coefficients, b->stage);
}

static void core_error(bench *b, int m) {
  sink += b->plan.kernels->error_norm(&b->model->lay, 1e-9, m, coefficients, b->stage, b->weights);
}

/* All sums of a step: of the stages, and for Rosenbrock methods of their right-hand sides. */
static void core_combine_tsit5(bench *b) {
  for (int m = 1; m < 7; ++m) {
    core_combine(b, m);
  }
}

static void core_combine_rodas4(bench *b) {
  for (int m = 1; m < 6; ++m) {
    core_combine(b, m);
    core_combine(b, m);
  }
  core_combine(b, 1);
}

static void core_error_tsit5(bench *b) {
  core_error(b, 7);
}

static void core_error_rodas4(bench *b) {
  core_error(b, 1);
}

static void core_factor_again(bench *b) {
  core_factor(b, b->newton.stage.g);
}

static const lanes_kernels *lanes; /* of the level that is being timed */

static void lanes_combine_tsit5(void *group) {
  for (int m = 1; m < 7; ++m) {
    lanes->combine(group, m);
  }
}

static void lanes_combine_rodas4(void *group) {
  for (int m = 1; m < 6; ++m) {
    lanes->combine(group, m);
    lanes->combine(group, m);
  }
  lanes->combine(group, 1);
}

static void lanes_error_tsit5(void *group) {
  lanes->error(group, 7);
}

static void lanes_error_rodas4(void *group) {
  lanes->error(group, 1);
}

#define OF_LEVEL(what)                                                                             \
  static void lanes_##what(void *group) {                                                          \
    lanes->what(group);                                                                            \
  }
OF_LEVEL(rate)
OF_LEVEL(linearise)
OF_LEVEL(factor)
OF_LEVEL(ring_factor)
OF_LEVEL(ring_solve)
OF_LEVEL(solve)

/* All passes of a step in their order, with data that come from where a step has left them. */
static void core_step_tsit5(bench *b) {
  for (int m = 1; m < 7; ++m) {
    core_combine(b, m);
    row_rate(b);
  }
  core_error(b, 7);
}

static void lanes_step_tsit5(void *group) {
  for (int m = 1; m < 7; ++m) {
    lanes->combine(group, m);
    lanes->rate(group);
  }
  lanes->error(group, 7);
}

static void core_step_rodas4(bench *b) {
  row_linearise(b);
  core_factor_again(b);
  core_solve(b);
  for (int m = 1; m < 6; ++m) {
    core_combine(b, m);
    row_rate(b);
    core_combine(b, m);
    core_solve(b);
  }
  core_combine(b, 1);
  core_error(b, 1);
  row_rate(b);
}

static void lanes_step_rodas4(void *group) {
  lanes->linearise(group);
  lanes->factor(group);
  lanes->solve(group);
  for (int m = 1; m < 6; ++m) {
    lanes->combine(group, m);
    lanes->rate(group);
    lanes->combine(group, m);
    lanes->solve(group);
  }
  lanes->combine(group, 1);
  lanes->error(group, 1);
  lanes->rate(group);
}

static const struct {
  const char *name;
  void (*core)(bench *);
  void (*lanes)(void *);
} pairs[] = {
    {"rate", row_rate, lanes_rate},
    {"Jacobian", row_linearise, lanes_linearise},
    {"factorisation", core_factor_again, lanes_factor},
    {"  of it the ring", core_ring_factor, lanes_ring_factor},
    {"solve", core_solve, lanes_solve},
    {"  of it the ring's", core_ring_solve, lanes_ring_solve},
    {"sums of tsit5", core_combine_tsit5, lanes_combine_tsit5},
    {"sums of rodas4", core_combine_rodas4, lanes_combine_rodas4},
    {"error of tsit5", core_error_tsit5, lanes_error_tsit5},
    {"error of rodas4", core_error_rodas4, lanes_error_rodas4},
    {"all passes of tsit5", core_step_tsit5, lanes_step_tsit5},
    {"all passes of rodas4", core_step_rodas4, lanes_step_rodas4},
};
enum { N_PAIRS = sizeof pairs / sizeof pairs[0] };

/* --- eight drives ------------------------------------------------------------------------------
 */

static lanes_drive as_lane(const bench *b, double g) {
  const bd_model *m = b->model;
  const bd_layout *lay = &m->lay;
  const bd_links *l = &b->plan.links;
  lanes_drive d = {.n = lay->n,
                   .np = lay->np,
                   .blocks = lay->theta / lay->stride,
                   .stride = lay->stride,
                   .half = l->half,
                   .stiffness = l->stiffness,
                   .damping = l->damping,
                   .bending = l->bending,
                   .bending_damping = l->bending_damping,
                   .inv_mass = l->inv_mass,
                   .inv_inertia = l->inv_inertia,
                   .wind = l->wind,
                   .mass = m->info.link_mass,
                   .shear = m->shear,
                   .g = g,
                   .state = bd_cfield(lay, b->y, F_X),
                   .theta = b->y + lay->theta,
                   .omega = b->y + lay->omega};
  if (lay->np > MAX_PULLEYS || lay->nm > 0 || lay->slots != 1 || !m->along_links) {
    die("a drive that the lanes do not know");
  }
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *p = &b->plan.contact_pulleys[j];
    if (p->law != BD_LAW_dahl || p->friction.dahl.mu_s > 0.0 || p->hunt_crossley > 0.0) {
      die("a contact that the lanes do not know");
    }
    d.pulleys[j].x = p->x;
    d.pulleys[j].y = p->y;
    d.pulleys[j].radius = p->radius;
    d.pulleys[j].quadratic = p->quadratic;
    d.pulleys[j].linear = p->linear;
    d.pulleys[j].damping = p->damping;
    d.pulleys[j].l0 = p->l0;
    d.pulleys[j].bound = p->bound;
    d.pulleys[j].mu_k = p->friction.dahl.mu_k;
    d.pulleys[j].sigma = p->friction.dahl.sigma;
    d.pulleys[j].inertia = m->inertia[j];
  }
  return d;
}

/* Whether an end of a link is within a pulley's rim, or no further from it than `margin`. */
static int touches(const bench *b, int i, int j, double margin) {
  const bd_layout *lay = &b->model->lay;
  const bd_contact_pulley *p = &b->plan.contact_pulleys[j];
  const double half = b->plan.links.half, *at = bd_cfield(lay, b->y, F_X) + i;
  const double x = at[0] - p->x, y = at[lay->stride] - p->y, phi = at[2 * lay->stride];
  for (int end = -1; end <= 1; end += 2) {
    if (hypot(x + end * half * cos(phi), y + end * half * sin(phi)) < p->radius + margin) {
      return 1;
    }
  }
  return 0;
}

/* In front of every run of links stands one that is far from the pulley (kernels/link_geometry.h),
 * behind it the joint that it shares with the next. */
static int is_near(const bench *b, int i, int j) {
  const double margin = 0.4 * b->plan.links.half;
  const int n = b->model->lay.n;
  return touches(b, i, j, margin) || touches(b, (i + 1) % n, j, margin) ||
         touches(b, (i + n - 1) % n, j, margin);
}

/* Of a group of drives whatever one of them needs, so that lanes share the work. */
static lanes_runs runs_of(const bench *drives, int width) {
  const bd_layout *lay = &drives->model->lay;
  lanes_runs runs = {0};
  for (int j = 0; j < lay->np; ++j) {
    int *n = &runs.n[j], open = 0;
    for (int i = 0; i < lay->n; ++i) {
      int near = 0;
      for (int lane = 0; lane < width; ++lane) {
        near |= is_near(&drives[lane], i, j);
      }
      if (near && !open) {
        runs.begin[j][*n] = i;
      }
      if (near) {
        runs.end[j][*n] = i + 1;
      }
      *n += open && !near;
      open = near;
    }
    *n += open;
  }
  return runs;
}

/* Lists as short as those of a lane, in whole vectors of the level. */
static void tighten(bench *b) {
  const int width = b->plan.kernels->newton->width, np = b->model->lay.np;
  const lanes_runs own = runs_of(b, 1);
  for (int j = 0; j < np; ++j) {
    bd_run *runs = b->plan.search.runs + j * b->plan.search.max_runs;
    int n = 0;
    for (int r = 0; r < own.n[j]; ++r) {
      const int begin = own.begin[j][r] / width * width;
      const int end = (own.end[j][r] + width - 1) / width * width;
      if (n > 0 && runs[n - 1].end >= begin) {
        runs[n - 1].end = end;
      } else if (n < b->plan.search.max_runs) {
        runs[n++] = (bd_run){begin, end};
      } else {
        die("more runs of links than the core has room for");
      }
    }
    b->plan.search.n_runs[j] = n;
  }
}

static void ready(bench *b, double g) {
  bd_error err;
  b->plan.skip_power = 1; /* as within steps */
  bd_plan_rate(&b->plan, 0.0, b->y, b->stage[0], &err);
  row_linearise(b);
  core_factor(b, g);
  core_solve(b);
}

static void open_both(both *all, const drive *drives, const lanes_kernels *level) {
  all->lanes = lanes = level;
  all->n_groups = SIDE_BY_SIDE / level->width;
  lanes_drive as_lanes[SIDE_BY_SIDE];
  for (int d = 0; d < SIDE_BY_SIDE; ++d) {
    bench *const benches[] = {&all->core[d], &all->tight[d]};
    all->g[d] = 1e-5 * (1.0 + 0.1 * d);
    for (int k = 0; k < 2; ++k) {
      open_bench(benches[k], &drives[d]);
      if (k == TIGHT) {
        tighten(benches[k]);
      }
      ready(benches[k], all->g[d]);
    }
    as_lanes[d] = as_lane(&all->core[d], all->g[d]);
  }
  for (int k = 0; k < all->n_groups; ++k) {
    const lanes_runs runs = runs_of(&all->core[k * level->width], level->width);
    all->groups[k] = level->make(&as_lanes[k * level->width], &runs);
    lanes_rate(all->groups[k]);
    lanes_linearise(all->groups[k]);
    lanes_factor(all->groups[k]);
    lanes_solve(all->groups[k]);
  }
}

/* Largest difference of a block of links, or of the shafts, over the largest value there. */
static double difference_of(const both *all, int d, int what, const double *got) {
  const bench *core = &all->core[d];
  const bd_layout *lay = &core->model->lay;
  const int n = lay->n, blocks = lay->theta / lay->stride;
  const double *expected = what == A_RATE ? core->stage[0] : core->stage[1];
  double most = 0.0;
  for (int k = 0; k < blocks + TAIL; ++k) {
    const double *a = k < blocks ? expected + k * lay->stride + BD_HALO
                                 : expected + lay->theta + (k - blocks) * lay->np;
    const double *b = k < blocks ? got + k * n : got + blocks * n + (k - blocks) * lay->np;
    double scale = 0.0, off = 0.0;
    for (int i = 0; i < (k < blocks ? n : lay->np); ++i) {
      scale = fmax(scale, fabs(a[i]));
      off = isfinite(b[i]) ? fmax(off, fabs(a[i] - b[i])) : (double)INFINITY;
    }
    most = off > 0.0 ? fmax(most, off / scale) : most;
  }
  return most;
}

/* Of the core with short lists, or of the lanes. */
static double difference(const both *all, int side, int what) {
  const bd_layout *lay = &all->core->model->lay;
  const int n = lay->n, blocks = lay->theta / lay->stride, width = all->lanes->width;
  double *got = malloc((size_t)(blocks * n + TAIL * lay->np) * sizeof *got), most = 0.0;
  for (int d = 0; d < SIDE_BY_SIDE; ++d) {
    if (side == LANES) {
      all->lanes->read(all->groups[d / width], what, d % width, n, got);
    } else {
      const double *from = all->tight[d].stage[what == A_RATE ? 0 : 1];
      for (int k = 0; k < blocks; ++k) {
        memcpy(got + k * n, from + k * lay->stride + BD_HALO, (size_t)n * sizeof *got);
      }
      memcpy(got + blocks * n, from + lay->theta, (size_t)(TAIL * lay->np) * sizeof *got);
    }
    most = fmax(most, difference_of(all, d, what, got));
  }
  free(got);
  return most;
}

static int listed(const bench *b) {
  int links = 0;
  for (int j = 0; j < b->model->lay.np; ++j) {
    for (int r = 0; r < b->plan.search.n_runs[j]; ++r) {
      const bd_run *run = &b->plan.search.runs[j * b->plan.search.max_runs + r];
      links += run->end - run->begin;
    }
  }
  return links;
}

/* Links listed near pulleys, a drive, on the three sides, and those of which an end touches. */
static void print_lists(const both *all, const char *level, int set) {
  const int width = all->lanes->width, np = all->core->model->lay.np;
  double links[N_SIDES] = {0.0}, touching = 0.0;
  for (int d = 0; d < SIDE_BY_SIDE; ++d) {
    const lanes_runs own = runs_of(&all->core[d / width * width], width);
    links[CORE] += listed(&all->core[d]);
    links[TIGHT] += listed(&all->tight[d]);
    for (int j = 0; j < np; ++j) {
      for (int r = 0; r < own.n[j]; ++r) {
        links[LANES] += own.end[j][r] - own.begin[j][r];
      }
      for (int i = 0; i < all->core[d].model->lay.n; ++i) {
        touching += touches(&all->core[d], i, j, 0.0);
      }
    }
  }
  printf("%s,%d,listed,%.6g,%.6g,%.6g\n", level, set, links[CORE] / SIDE_BY_SIDE,
         links[TIGHT] / SIDE_BY_SIDE, links[LANES] / SIDE_BY_SIDE);
  printf("%s,%d,touching,%.6g,0,0\n", level, set, touching / SIDE_BY_SIDE);
}

/* --- timing ------------------------------------------------------------------------------------
 */

/* A call for each of the eight drives [ns], over and over of one, as runs one after the other are.
 */
static double time_side(both *all, int row, int side, long calls) {
  bench *const benches = side == CORE ? all->core : all->tight;
  const int n = side == LANES ? all->n_groups : SIDE_BY_SIDE;
  double from = seconds();
  for (int k = 0; k < n; ++k) {
    for (long call = 0; call < calls; ++call) {
      if (side == LANES) {
        pairs[row].lanes(all->groups[k]);
      } else {
        pairs[row].core(&benches[k]);
      }
    }
  }
  return 1e9 * (seconds() - from) / (double)calls;
}

/* A drive under a torque that stays and a load in proportion to the speed. */
static bd_sim *loaded_run(const bench *b, const drive *d, const double *loads, const char *method,
                          double t_end) {
  const double zero = 0.0;
  const bd_torque_term terms[] = {
      {.kind = BD_TORQUE_PIECEWISE, .n_t = 1, .t = &zero, .values = loads},
      {.kind = BD_TORQUE_VISCOUS, .coefficients = loads + d->scene.n_pulleys},
  };
  const bd_torque torque = {.n_terms = 2, .terms = terms};
  bd_options options;
  bd_options_default(&options);
  options.method = method;
  options.rtol = 1e-3;
  bd_error err = {0};
  bd_sim *run;
  if (bd_sim_create(&run, b->model, &d->state, &torque, t_end, &options, &err) != BD_OK) {
    die(err.message);
  }
  return run;
}

/* CPU time of a step in such a run, with all that stands round its passes, rejected ones counted
 * [ns]. */
static double time_run(const bench *b, const drive *d, const double *loads, const char *method,
                       double t_end) {
  bd_sim *run = loaded_run(b, d, loads, method, t_end);
  bd_error err = {0};
  bd_stats stats;
  const double from = seconds();
  while (bd_sim_time(run) < t_end) {
    if (bd_sim_advance(run, 1000, &err) < BD_OK) {
      die(err.message);
    }
  }
  const double taken = 1e9 * (seconds() - from);
  bd_sim_stats(run, &stats);
  bd_sim_free(run);
  return taken / (double)(stats.steps + stats.rejected);
}

static const char *const run_methods[] = {"tsit5", "rodas4"};

static void compare_level(const lanes_kernels *level, int set, int rounds, const drive *drives,
                          double *const *loads, double window) {
  static both all;
  static double times[N_PAIRS][N_SIDES][MAX_ROUNDS], in_runs[2][MAX_ROUNDS];
  long calls[N_PAIRS];
  open_both(&all, drives, level);
  printf("%s,%d,width,%d,0,0\n", level->level, set, level->width);
  for (int side = TIGHT; side <= LANES; ++side) {
    printf("%s,%d,difference %d,%.3g,%.3g,0\n", level->level, set, side,
           difference(&all, side, A_RATE), difference(&all, side, A_SOLUTION));
  }
  print_lists(&all, level->level, set);
  for (int row = 0; row < N_PAIRS; ++row) {
    calls[row] = 1 + (long)(1e6 / time_side(&all, row, CORE, 20));
  }
  for (int round = 0; round < rounds; ++round) {
    for (int row = 0; row < N_PAIRS; ++row) {
      for (int side = 0; side < N_SIDES; ++side) {
        times[row][side][round] = time_side(&all, row, side, calls[row]);
      }
    }
    for (int k = 0; k < 2; ++k) {
      in_runs[k][round] = 0.0;
      for (int d = 0; d < SIDE_BY_SIDE; ++d) {
        in_runs[k][round] +=
            time_run(&all.core[d], &drives[d], loads[d], run_methods[k], 0.1 * window);
      }
    }
  }
  for (int row = 0; row < N_PAIRS; ++row) {
    printf("%s,%d,%s,%.6g,%.6g,%.6g\n", level->level, set, pairs[row].name,
           median(rounds, times[row][CORE]), median(rounds, times[row][TIGHT]),
           median(rounds, times[row][LANES]));
  }
  for (int k = 0; k < 2; ++k) {
    printf("%s,%d,step in a run of %s,%.6g,0,0\n", level->level, set, run_methods[k],
           median(rounds, in_runs[k]));
  }
  for (int d = 0; d < SIDE_BY_SIDE; ++d) {
    for (int k = 0; k < 3; ++k) {
      bd_sim_free(all.core[d].runs[k]);
      bd_sim_free(all.tight[d].runs[k]);
    }
  }
}

/* --- what steps the drives take under load -----------------------------------------------------
 */

/* Times of accepted steps' ends, and of rejected ones' beginnings, negative. */
static void record_steps(const bench *b, const drive *d, const double *loads, int set, int which,
                         const char *method, double t_end) {
  bd_sim *run = loaded_run(b, d, loads, method, t_end);
  bd_error err = {0};
  long accepted = 0, rejected = 0;
  printf("%s,%d,steps,%d,0,0", method, set, which);
  while (bd_sim_time(run) < t_end) {
    bd_stats stats;
    const double from = bd_sim_time(run);
    if (bd_sim_advance(run, 1, &err) < BD_OK) {
      die(err.message);
    }
    bd_sim_stats(run, &stats);
    for (; rejected < stats.rejected; ++rejected) {
      printf(" -%.9g", from);
    }
    if (stats.steps > accepted) {
      printf(" %.9g", bd_sim_time(run));
      accepted = stats.steps;
    }
  }
  printf("\n");
  bd_sim_free(run);
}

int main(void) {
  const int rounds = (int)number(), n_sets = (int)number();
  const double window = number();
  if (rounds < 1 || rounds > MAX_ROUNDS) {
    die("1 to 999 rounds");
  }
  drive *drives = calloc((size_t)(n_sets * SIDE_BY_SIDE), sizeof *drives);
  double **loads = calloc((size_t)(n_sets * SIDE_BY_SIDE), sizeof *loads);
  for (int d = 0; d < n_sets * SIDE_BY_SIDE; ++d) {
    read_drive(&drives[d]);
    loads[d] = numbers(2 * drives[d].scene.n_pulleys); /* torques, then those per rad/s */
  }
  for (int level = 0; level < N_LEVELS; ++level) {
    setenv("BELTDYN_KERNELS", lanes_levels[level]->level, 1);
    for (int set = 0; strcmp(bd_kernel_level(), lanes_levels[level]->level) == 0 && set < n_sets;
         ++set) {
      compare_level(lanes_levels[level], set, rounds, &drives[set * SIDE_BY_SIDE],
                    &loads[set * SIDE_BY_SIDE], window);
    }
  }
  unsetenv("BELTDYN_KERNELS");
  for (int d = 0; d < n_sets * SIDE_BY_SIDE; ++d) {
    static bench b;
    open_bench(&b, &drives[d]);
    for (int k = 0; k < 2; ++k) {
      record_steps(&b, &drives[d], loads[d], d / SIDE_BY_SIDE, d % SIDE_BY_SIDE, run_methods[k],
                   window);
    }
  }
  return sink == 1.0; /* never, but the compiler cannot know */
}
