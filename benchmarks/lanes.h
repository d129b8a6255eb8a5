/* SPDX-License-Identifier: MIT
 *
 * Between lanes.c and the kernels that it calls, of lanes_kernels.c: plain numbers on both sides.
 */
#ifndef BELTDYN_BENCHMARKS_LANES_H
#define BELTDYN_BENCHMARKS_LANES_H

enum { MAX_PULLEYS = 8, MAX_RUNS = 64, TAIL = 2 };
/* What a group of drives has computed. */
enum { A_RATE, A_SOLUTION };

/* A drive as the lanes take it in. */
typedef struct lanes_drive {
  int n, np, blocks, stride;
  double half, stiffness, damping, bending, bending_damping, inv_mass, inv_inertia, wind;
  double mass, shear, g;
  struct {
    double x, y, radius, quadratic, linear, damping, l0, bound, mu_k, sigma, inertia;
  } pulleys[MAX_PULLEYS];
  const double *state; /* link 0 of the first block */
  const double *theta, *omega;
} lanes_drive;

/* Links near each pulley, of any of the drives, by link; the same for all groups. */
typedef struct lanes_runs {
  int n[MAX_PULLEYS], begin[MAX_PULLEYS][MAX_RUNS], end[MAX_PULLEYS][MAX_RUNS];
} lanes_runs;

/* The kernels of a level: of groups of `width` drives. */
typedef struct lanes_kernels {
  const char *level;
  int width;
  void *(*make)(const lanes_drive *drives, const lanes_runs *runs);
  void (*rate)(void *group);
  void (*linearise)(void *group);
  void (*factor)(void *group);
  void (*solve)(void *group);
  void (*ring_factor)(void *group);
  void (*ring_solve)(void *group);
  void (*combine)(void *group, int m);
  void (*error)(void *group, int m);
  void (*read)(void *group, int what, int lane, int n, double *out); /* blocks of n, then tail */
} lanes_kernels;

#define LANES_NAME2(level) lanes_##level
#define LANES_NAME(level) LANES_NAME2(level)

#endif
