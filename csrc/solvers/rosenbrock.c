/* SPDX-License-Identifier: MIT
 *
 * Rosenbrock methods: a row of coefficients each, stages by linear systems with one matrix,
 *
 *   (1 - gamma h J) u_i = gamma (h f(t + c_i h, Y_i) + sum C_ij u_j + D_i h^2 f_t),
 *   Y_i = y + sum A_ij u_j.
 *
 * The last two stages stand at t + h, Y_s = Y_{s-1} + u_{s-1}, and y_new = Y_s + u_s: the last
 * stage is the error estimate, too. rodas4: RODAS of E. Hairer and G. Wanner, Solving ODEs II,
 * IV.7, order 4(3), stiffly accurate, L-stable, with its interpolant of order 3. Guarded by
 * tests/test_implicit.py: order conditions, observed order, dense output.
 */
#include <string.h>

#include "run/run.h"

static const double rodas4_a[] = {
    1.544000000000000,   0.9466785280815826,  0.2557011698983284,
    3.314825187068521,   2.896124015972201,   0.9986419139977817,
    1.221224509226641,   6.019134481288629,   12.53708332932087,
    -0.6878860361058950, 1.221224509226641,   6.019134481288629,
    12.53708332932087,   -0.6878860361058950, 1.0,
};
static const double rodas4_c[] = {
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
static const double rodas4_time[] = {0.0, 0.386, 0.21, 0.63, 1.0, 1.0};
static const double rodas4_slope[] = {0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0};
static const double rodas4_d2[] = {10.12623508344586,  -7.487995877610167, -34.80091861555747,
                                   -7.992771707568823, 1.025137723295662,  0.0};
static const double rodas4_d3[] = {-0.6762803392801253, 6.087714651680015,  16.43084320892478,
                                   24.76722511418386,   -6.594389125716872, 0.0};

const bd_rosenbrock bd_rodas4 = {
    .stages = 6,
    .gamma = 0.25,
    .a = rodas4_a,
    .c = rodas4_c,
    .time = rodas4_time,
    .slope = rodas4_slope,
    .dense = {rodas4_d2, rodas4_d3},
};

/* The stages u_i stand in sim->stage[1] ... */
int bd_rosenbrock_attempt(bd_sim *sim, double h, double *error) {
  const bd_rosenbrock *m = sim->now->table;
  const size_t size = sim->model->lay.size;
  const bd_kernels *kernels = sim->plan.kernels;
  double **u = sim->stage + 1, scaled[BD_MAX_STAGES];
  const double *a = m->a, *c = m->c, one = 1.0;
  int code = bd_sim_linearise(sim);
  if (code == BD_OK) {
    code = bd_sim_torque_by_time(sim, h, 1);
  }
  if (code != BD_OK) {
    return code;
  }
  bd_newton_linearise_contact(&sim->newton, &sim->plan, sim->y, 0.0);
  bd_newton_factor(&sim->newton, &sim->plan, m->gamma * h);
  ++sim->stats.nlu;
  sim->plan.skip_power = 1;
  for (int s = 0; s < m->stages; ++s) {
    if (s == 0) {
      memcpy(u[0], sim->stage[0], size * sizeof *u[0]);
    } else {
      double *f = sim->stage[m->stages + 1];
      kernels->combine(size, sim->y_mid, sim->y, 1.0, s, a, u);
      code = bd_sim_rate(sim, sim->t + m->time[s] * h, sim->y_mid, f);
      if (code != BD_OK) {
        break;
      }
      for (int k = 0; k < s; ++k) {
        scaled[k] = c[k] / h;
      }
      kernels->combine(size, u[s], f, 1.0, s, scaled, u);
      a += s;
      c += s;
    }
    bd_sim_add_torque_by_time(sim, u[s], h * m->slope[s]);
    bd_newton_solve(&sim->newton, &sim->plan, u[s]);
  }
  sim->plan.skip_power = 0;
  if (code == BD_OK) {
    double *last = u[m->stages - 1];
    kernels->combine(size, sim->y_new, sim->y_mid, 1.0, 1, &one, &last);
    *error = kernels->error_norm(&sim->model->lay, 1.0, 1, &one, &last, sim->weights);
  }
  return code;
}

void bd_rosenbrock_inside(bd_sim *sim, double h, double s, double *y) {
  const bd_rosenbrock *m = sim->now->table;
  const double *whole = m->a + (m->stages - 1) * (m->stages - 2) / 2;
  double b[BD_MAX_STAGES];
  for (int k = 0; k < m->stages; ++k) {
    double full = k < m->stages - 1 ? whole[k] : 1.0;
    b[k] = s * (full + (1.0 - s) * (m->dense[0][k] + s * m->dense[1][k]));
  }
  sim->plan.kernels->combine(sim->model->lay.size, y, sim->y, 1.0, m->stages, b, sim->stage + 1);
  bd_sim_work_inside(sim, h, s, y);
}

int bd_rosenbrock_finish(bd_sim *sim, double h, double t_new) {
  return bd_sim_finish_step(sim, h, t_new, 1);
}
