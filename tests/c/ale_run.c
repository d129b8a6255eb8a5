/* SPDX-License-Identifier: MIT
 *
 * A drive of fixed axes with an ALE belt, run by RODAS4 without the rest of the core: what
 * steps cost and how many there are. `ale_run FILE CASE SPEED TORQUE T RTOL OUT`: pulley 0 starts
 * at SPEED [rad/s] and is driven against its sense of turning by TORQUE (1 + sin(100 pi t) / 2),
 * which a viscous load on pulley 1 balances at that speed.
 */
#include "ale_scene.h"

enum { STAGES = 6 };

static const double a_of[] = {
    1.544000000000000,   0.9466785280815826,  0.2557011698983284,
    3.314825187068521,   2.896124015972201,   0.9986419139977817,
    1.221224509226641,   6.019134481288629,   12.53708332932087,
    -0.6878860361058950, 1.221224509226641,   6.019134481288629,
    12.53708332932087,   -0.6878860361058950, 1.0,
};
static const double c_of[] = {
    -5.6688,
    -2.430093356833875,
    -0.2063599157091915,
    -0.1073529058151375,
    -9.594562251023355,
    -20.47028614809616,
    7.496443313967647,
    -10.24680431464352,
    -33.99990352819905,
    11.70890893206160,
    8.083246795921522,
    -7.981132988064893,
    -31.52159432874371,
    16.31930543123136,
    -6.058818238834054,
};
static const double times[] = {0.0, 0.386, 0.21, 0.63, 1.0, 1.0};
static const double slopes[] = {0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0};

typedef struct run {
  scene *s;
  const bd_ale_kernels *kernels;
  int n, np;                            /* unknowns of the ring; pulleys behind them */
  double torque, load;                  /* of the drive; of the load over speed */
  double *z, matrix[PULLEYS * PULLEYS]; /* columns of rims, solved; Schur's complement */
  double inertia[PULLEYS];
} run;

static double drive_at(const run *r, double t) {
  return r->torque * (1.0 + 0.5 * sin(100.0 * BD_PI * t));
}

static void rate(run *r, double t, const double *x, double *out) {
  scene *s = r->s;
  bd_ale_scatter(&s->newton, &s->ale, x, &s->y);
  for (int j = 0; j < r->np; ++j) {
    s->ale.arcs[j].axis.omega = x[r->n + j];
  }
  bd_ale_rate(&s->ale, r->kernels, &s->y, &s->dy);
  bd_ale_gather(&s->newton, &s->ale, &s->dy, out);
  for (int j = 0; j < r->np; ++j) {
    const double set = j == 0 ? drive_at(r, t) : j == 1 ? -r->load * x[r->n + 1] : 0.0;
    out[r->n + j] = (s->ale.arcs[j].torque + set) / r->inertia[j];
  }
}

static void factor(run *r, double g) {
  bd_ale_newton *newton = &r->s->newton;
  const int n = r->n, np = r->np;
  newton->ring.g = g;
  r->kernels->factor(&newton->ring);
  for (int j = 0; j < np; ++j) {
    memcpy(r->z + j * n, newton->column + j * n, (size_t)n * sizeof(double));
    r->kernels->solve(&newton->ring, r->z + j * n);
    for (int i = 0; i < np; ++i) {
      double sum =
          i == j ? 1.0 - g * (newton->own[j] - (j == 1 ? r->load : 0.0)) / r->inertia[j] : 0.0;
      double through = 0.0;
      for (int u = 0; u < n; ++u) {
        through += newton->row[i * n + u] * r->z[j * n + u];
      }
      r->matrix[i * np + j] = sum - g * g * through / r->inertia[i];
    }
  }
}

static void solve(run *r, double g, double *x) {
  bd_ale_newton *newton = &r->s->newton;
  const int n = r->n, np = r->np;
  double m[PULLEYS * PULLEYS], w[PULLEYS];
  memcpy(m, r->matrix, sizeof m);
  r->kernels->solve(&newton->ring, x);
  for (int i = 0; i < np; ++i) {
    double through = 0.0;
    for (int u = 0; u < n; ++u) {
      through += newton->row[i * n + u] * x[u];
    }
    w[i] = x[n + i] + g * through / r->inertia[i];
  }
  for (int k = 0; k < np; ++k) {
    for (int i = k + 1; i < np; ++i) {
      const double f = m[i * np + k] / m[k * np + k];
      for (int c = k; c < np; ++c) {
        m[i * np + c] -= f * m[k * np + c];
      }
      w[i] -= f * w[k];
    }
  }
  for (int k = np - 1; k >= 0; --k) {
    for (int c = k + 1; c < np; ++c) {
      w[k] -= m[k * np + c] * w[c];
    }
    w[k] /= m[k * np + k];
  }
  for (int j = 0; j < np; ++j) {
    x[n + j] = w[j];
    for (int u = 0; u < n; ++u) {
      x[u] += g * r->z[j * n + u] * w[j];
    }
  }
}

/* The largest rms of the groups m, v, z of arcs; of spans; modes; pulleys. */
static double norm(const run *r, const double *error, const double *scale) {
  const scene *s = r->s;
  const bd_ale_ring *ring = &s->newton.ring;
  double sum[5] = {0.0};
  int count[5] = {0};
  for (int b = 0; b < ring->n; ++b) {
    const bd_ale_block *block = &ring->blocks[b];
    const int span = block->n == 3 + 2 * s->ale.modes && block->n != 3 + 4 * s->z_states;
    for (int u = 0; u < block->n; ++u) {
      const double e = error[block->at + u] / scale[block->at + u];
      const int group = !span ? 0 : u < 3 ? 1 : 2;
      sum[group] += e * e;
      ++count[group];
    }
  }
  for (int j = 0; j < r->np; ++j) {
    const double e = error[r->n + j] / scale[r->n + j];
    sum[3] += e * e;
    ++count[3];
  }
  double most = 0.0;
  for (int k = 0; k < 4; ++k) {
    most = fmax(most, count[k] > 0 ? sqrt(sum[k] / count[k]) : 0.0);
  }
  return most;
}

static void bound_states(const scene *s, const double *mu) {
  for (int j = 0; j < s->np; ++j) {
    const bd_ale_arc *arc = &s->ale.arcs[j];
    for (int e = 0; e < arc->states && arc->held; ++e) {
      for (int k = arc->begin; k < arc->begin + arc->n; ++k) {
        for (int end = 0; end < 2; ++end) {
          double *z = &s->y.z[end][e * s->y.stride + k];
          *z = fmin(fmax(*z, -mu[j]), mu[j]);
        }
      }
    }
  }
}

static char **arguments;

static void run_all(void) {
  static scene s;
  char **const argv = arguments;
  const double speed = atof(argv[3]), t_end = atof(argv[5]), rtol = atof(argv[6]);
  file = fopen(argv[1], "r");
  int found = 0;
  while (file && !found && read_scene(&s)) {
    make_scene(&s);
    for (int k = 0; k < s.states; ++k) {
      check_state(&s, k, &bd_ale_baseline);
    }
    found = strcmp(s.name, argv[2]) == 0;
    if (!found) {
      bd_block_free(s.block);
    }
  }
  if (!found) {
    ++failures;
    return;
  }
  run r = {.s = &s, .kernels = level_of(1), .n = s.newton.ring.unknowns, .np = s.np};
  const int all = r.n + r.np;
  memcpy(r.inertia, s.inertia, sizeof(double) * (size_t)r.np);
  for (int end = 0; end < 2; ++end) {
    memset(s.y.z[end] - BD_HALO, 0, (size_t)(s.z_states * s.y.stride) * sizeof(double));
  }
  r.kernels->place(&s.ale);
  const double along = speed * s.ale.arcs[0].radius * s.ale.arcs[0].sense;
  bd_ale_start(&s.ale, s.length, along, &s.y);
  r.torque = atof(argv[4]);
  double *x = calloc((size_t)(14 * all + r.n * r.np), sizeof *x), *mid = x + all,
         *fresh = mid + all;
  double *f0 = fresh + all, *f = f0 + all, *scale = f + all, *u[STAGES];
  for (int k = 0; k < STAGES; ++k) {
    u[k] = scale + (k + 1) * all;
  }
  r.z = scale + (STAGES + 1) * all;
  double mu[PULLEYS];
  for (int j = 0; j < s.np; ++j) {
    mu[j] = bd_kernels_baseline->bound[s.laws[j].law](&s.laws[j]);
    x[r.n + j] = s.ale.arcs[j].axis.omega;
  }
  r.load = -r.torque * s.ale.arcs[1].radius / s.ale.arcs[0].radius * s.ale.arcs[0].sense *
           s.ale.arcs[1].sense / -fabs(x[r.n + 1]);
  r.load = fabs(r.load);
  const double wave = s.ale.rest / sqrt(s.ale.axial * s.ale.density);
  for (int j = 0; j < s.np; ++j) {
    const bd_ale_arc *arc = &s.ale.arcs[j];
    for (int k = arc->begin; k <= arc->begin + arc->n; ++k) {
      s.scale.m[k] = s.y.m[k] * s.ale.rest / s.ale.axial;
      s.scale.v[k] = wave;
      for (int e = 0; e < 2 * arc->states; ++e) {
        s.scale.z[e / arc->states][e % arc->states * s.y.stride + k] = 1.0;
      }
    }
    for (int n = 0; n < s.modes; ++n) {
      s.scale.a[j * s.modes + n] = 1e-3 * s.ale.spans[j].length;
      s.scale.p[j * s.modes + n] = 1e-3 * BD_PI * sqrt(s.ale.rest / s.ale.density);
    }
    scale[r.n + j] = wave / arc->radius;
  }
  bd_ale_gather(&s.newton, &s.ale, &s.scale, scale);
  bd_ale_gather(&s.newton, &s.ale, &s.y, x);
  FILE *out = fopen(argv[7], "w");
  double t = 0.0, h = 1e-6;
  long steps = 0, rejected = 0;
  const double begin = now();
  r.kernels->stretch(&s.ale, &s.y);
  r.kernels->freeze(&s.ale, NULL);
  while (t < t_end) {
    const double g = 0.25 * h;
    rate(&r, t, x, f0);
    bd_ale_linearise(&s.newton, &s.ale, r.kernels, &s.y, &s.dy);
    if (out) {
      fprintf(out, "%.9g %.9g %.9g %.9g %.9g\n", t,
              s.ale.tension[s.ale.arcs[0].begin + s.ale.arcs[0].n],
              s.ale.tension[s.ale.arcs[1].begin + s.ale.arcs[1].n], x[r.n], x[r.n + 1]);
    }
    double error = INFINITY;
    s.ale.elapsed = -t;
    while (error > 1.0) {
      const double gamma = 0.25 * h,
                   bent = 50.0 * BD_PI * r.torque * cos(100.0 * BD_PI * t) / r.inertia[0];
      const double *a = a_of, *c = c_of;
      factor(&r, gamma);
      for (int k = 0; k < STAGES; ++k) {
        if (k == 0) {
          memcpy(u[0], f0, (size_t)all * sizeof *f0);
        } else {
          for (int i = 0; i < all; ++i) {
            mid[i] = x[i];
            for (int l = 0; l < k; ++l) {
              mid[i] += a[l] * u[l][i];
            }
          }
          rate(&r, t + times[k] * h, mid, u[k]);
          for (int i = 0; i < all; ++i) {
            for (int l = 0; l < k; ++l) {
              u[k][i] += c[l] / h * u[l][i];
            }
          }
          a += k;
          c += k;
        }
        u[k][r.n] += h * slopes[k] * bent;
        for (int i = 0; i < all; ++i) {
          u[k][i] *= gamma;
        }
        solve(&r, gamma, u[k]);
      }
      error = norm(&r, u[STAGES - 1], scale) / rtol;
      error = isfinite(error) ? error : 1e6;
      const double next = h * fmin(5.0, fmax(0.2, 0.9 * pow(error + 1e-12, -0.25)));
      if (error <= 1.0) {
        t += h;
        for (int i = 0; i < all; ++i) {
          x[i] = mid[i] + u[STAGES - 1][i];
        }
      } else {
        ++rejected;
      }
      h = next;
    }
    (void)g;
    ++steps;
    bd_ale_scatter(&s.newton, &s.ale, x, &s.y);
    bound_states(&s, mu);
    r.kernels->stretch(&s.ale, &s.y);
    s.ale.elapsed += t;
    r.kernels->freeze(&s.ale, &s.y);
    bd_ale_gather(&s.newton, &s.ale, &s.y, x);
  }
  const double took = now() - begin;
  double length = 0.0;
  for (int j = 0; j < s.np; ++j) {
    for (int k = 0; k <= s.ale.arcs[j].n; ++k) {
      length += s.y.m[s.ale.arcs[j].begin + k];
    }
  }
  printf("%s at %g rad/s: %ld steps, %ld rejected, %.0f steps/s, %.1f ms of CPU per s; sum of m "
         "off %.1g\n",
         s.name, speed, steps, rejected, (double)steps / t_end, 1e3 * took / t_end,
         length / s.length - 1.0);
  fclose(out);
  fclose(file);
  free(x);
  bd_block_free(s.block);
}

int main(int argc, char **argv) {
  const test tests[] = {{"run", run_all}};
  arguments = argv;
  return argc < 8 || run_tests(1, argv, tests, 1);
}
