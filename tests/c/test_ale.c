/* SPDX-License-Identifier: MIT
 *
 * The ALE belt against its oracle: rates, energies, starts. `test_ale FILE [NAME | timed]`.
 */
#include "ale_scene.h"

enum { LEVELS = 3 };

static const char *path;
static int timed;

static void time_rate(scene *s, const bd_ale_kernels *kernels) {
  double best = INFINITY, with = INFINITY;
  for (int turn = 0; turn < 20; ++turn) {
    double begin = now();
    for (int k = 0; k < 200; ++k) {
      evaluate(s, kernels, 0);
    }
    best = fmin(best, (now() - begin) / 200.0);
    begin = now();
    for (int k = 0; k < 200; ++k) {
      evaluate(s, kernels, 1);
    }
    with = fmin(with, (now() - begin) / 200.0);
  }
  printf("%-28s %3d cells, %d pulleys: rate %5.0f ns, W %5.0f ns\n", s->name, s->cells, s->np,
         1e9 * best, 1e9 * (with - best));
}

/* --- all -------------------------------------------------------------------------------------- */

static void rates_are_the_oracle_s(void) {
  for (int level = 0; level < LEVELS; ++level) {
    static scene s;
    int cases = 0;
    file = fopen(path, "r");
    CHECK(file != NULL);
    worst_of_all = 0.0;
    while (file && read_scene(&s)) {
      make_scene(&s);
      for (int k = 0; k < s.np * s.modes && s.drive.bending_stiffness > 0.0; ++k) {
        const double is = s.ale.spans[k / s.modes].stiff[k % s.modes];
        compare(&s, -1, "stiffness of modes", fabs(is / s.stiff[k] - 1.0), tolerance);
      }
      for (int k = 0; k < s.states; ++k) {
        check_state(&s, k, level_of(level));
      }
      if (timed) {
        time_rate(&s, level_of(level));
      }
      bd_block_free(s.block);
      ++cases;
    }
    fclose(file);
    printf("level %d: %d cases, worst %.2g\n", level, cases, worst_of_all);
    CHECK(cases > 0);
  }
}

/* Started, a belt has its length; nothing moves at rest, and along itself alone at speed: what is
 * left of forces over the tension. Bending's part at mid span is the oracle's matter. */
static void starts_are_in_balance(void) {
  static scene s;
  file = fopen(path, "r");
  CHECK(file != NULL);
  while (file && read_scene(&s)) {
    make_scene(&s);
    for (int k = 0; k < s.states; ++k) {
      check_state(&s, k, &bd_ale_baseline);
    }
    bd_ale *ale = &s.ale;
    for (int j = 0; j < s.np; ++j) {
      memcpy(ale->arcs[j].axis.c, s.pulleys[j].center, sizeof s.pulleys[j].center);
      memset(ale->arcs[j].axis.v, 0, sizeof ale->arcs[j].axis.v);
      ale->arcs[j].friction.law = BD_LAW_NONE; /* its places are at radii of their own, and slip */
    }
    for (int end = 0; end < 2; ++end) {
      memset(s.y.z[end] - BD_HALO, 0, (size_t)(s.z_states * s.y.stride) * sizeof(double));
    }
    bd_ale_baseline.place(ale);
    memset(ale->gravity, 0, sizeof ale->gravity);
    ale->bending_damping = 0.0; /* takes power, of which there is none */
    for (int turn = -1; turn <= 1; ++turn) {
      const double speed = 5.0 * turn, H = bd_ale_start(ale, s.length, speed, &s.y);
      evaluate(&s, &bd_ale_baseline, 1);
      double length = 0.0, moves = 0.0, forces = 0.0, fills = 0.0, turned = 0.0;
      for (int j = 0; j < s.np; ++j) {
        const bd_ale_arc *arc = &ale->arcs[j];
        for (int k = arc->begin; k <= arc->begin + arc->n; ++k) {
          length += s.y.m[k];
          moves = fmax(moves, fabs(s.dy.v[k]) * ale->density * s.y.m[k - (k > arc->begin)]);
          fills = fmax(fills, fabs(s.dy.m[k]));
        }
        forces = fmax(forces, fabs(ale->spans[j].pressing / H - 1.0));
        turned = fmax(turned, fabs(arc->torque) / arc->radius);
      }
      CHECK(fabs(length / s.length - 1.0) < 1e-13);
      /* at speed the nodes where belt bends are taken to have the momentum of its mean stretch */
      double least = INFINITY;
      for (int j = 0; j < s.np; ++j) {
        least = fmin(least, ale->arcs[j].radius);
      }
      const double bends = 0.5 * ale->bending / (least * least);
      const double allowed = 4.0 * ale->density * speed * speed * bends / H + 1e-9 * H;
      CHECK(forces * H < allowed);
      CHECK(fills < 1e-11 + 1e-9 * fabs(speed));
      CHECK(moves < allowed && turned < allowed);
      if (turn == 0 || timed) {
        printf("%s: H %.6g at %g m/s, rest %.6g; left %.2g N, %.2g m/s\n", s.name, H, speed,
               ale->rest, moves, fills);
      }
    }
    bd_block_free(s.block);
  }
  fclose(file);
}

/* As H of all spans falls and rises again without a flow, belt lifts off and is laid on: it has
 * forgotten its friction, what stays on has not: of states that were 1 the sum over what lies is
 * what has stayed. */
static void belt_that_lifts_off_forgets(void) {
  static scene s;
  int lifted = 0, laid = 0, stayed = 0;
  file = fopen(path, "r");
  CHECK(file != NULL);
  while (file && read_scene(&s)) {
    make_scene(&s);
    for (int k = 0; k < s.states; ++k) {
      check_state(&s, k, &bd_ale_baseline);
    }
    bd_ale *ale = &s.ale;
    double before[3][MOST];
    for (int turn = 0; turn < 2; ++turn) {
      for (int i = 0; i < s.np; ++i) {
        ale->spans[i].pressing = turn == 0 ? 0.3 * ale->rest : ale->rest;
      }
      memcpy(before[0], ale->cut_a, sizeof(double) * (size_t)ale->slots);
      memcpy(before[1], ale->cut_b, sizeof(double) * (size_t)ale->slots);
      memcpy(before[2], ale->lies, sizeof(double) * (size_t)ale->slots);
      for (int k = 0; k < ale->slots; ++k) {
        s.y.z[0][k] = s.y.z[1][k] = ale->lies[k];
      }
      bd_ale_baseline.freeze(ale, &s.y);
      for (int j = 0; j < s.np && s.drive.bending_stiffness > 0.0; ++j) {
        const bd_ale_arc *arc = &ale->arcs[j];
        for (int k = arc->begin; arc->states > 0 && k < arc->begin + arc->n; ++k) {
          const double part = ale->cut_b[k] - ale->cut_a[k];
          const double stays =
              fmin(ale->cut_b[k], before[1][k]) - fmax(ale->cut_a[k], before[0][k]);
          const int on = ale->lies[k] > 0.0, was = before[2][k] > 0.0;
          const double sum = 0.5 * part * (s.y.z[0][k] + s.y.z[1][k]);
          lifted += was && !on;
          laid += on && (!was || stays < part);
          stayed += on && was && stays == part;
          CHECK(fabs(sum - (on && was ? stays : 0.0)) < 1e-12);
        }
      }
    }
    bd_block_free(s.block);
  }
  fclose(file);
  CHECK(lifted > 0 && laid > 0 && stayed > 0);
}

int main(int argc, char **argv) {
  path = argc > 1 ? argv[1] : "ale_cases.txt";
  timed = argc > 2 && strcmp(argv[2], "timed") == 0;
  const int only = argc > 2 && !timed ? 2 : 1;
  static const test tests[] = {{"rates", rates_are_the_oracle_s},
                               {"starts", starts_are_in_balance},
                               {"laying", belt_that_lifts_off_forgets}};
  return run_tests(only, argv + argc - only, tests, 3);
}
