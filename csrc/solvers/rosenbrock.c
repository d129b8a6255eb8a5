/* SPDX-License-Identifier: MIT
 *
 * Rosenbrock methods: a row of coefficients each, stages by linear systems with one matrix,
 *
 *   (1 - gamma h J) u_i = gamma (h f(t + c_i h, Y_i) + sum C_ij u_j + D_i h^2 f_t),
 *   Y_i = y + sum A_ij u_j.
 *
 * The last two stages stand at t + h, Y_s = Y_{s-1} + u_{s-1}, and y_new = Y_s + u_s: the last
 * stage is the error estimate, too.
 */
#include <math.h>
#include <string.h>

#include "solvers/solvers.h"

/* The stages u_i stand in stepper->stage[1] ... */
int bd_rosenbrock_attempt(bd_stepper *stepper, double h, double *error) {
  const bd_rosenbrock *m = stepper->now->table;
  const size_t size = stepper->model->lay.size;
  const bd_kernels *kernels = stepper->plan.kernels;
  double **u = stepper->stage + 1, scaled[BD_MAX_STAGES];
  const double *a = m->a, *c = m->c, one = 1.0;
  int code = bd_implicit_linearise(stepper, 0.0);
  if (code == BD_OK) {
    code = bd_implicit_torque_by_time(stepper, h, 1);
  }
  if (code != BD_OK) {
    return code;
  }
  bd_newton_factor(&stepper->newton, &stepper->plan, stepper->y, m->gamma * h, 0.0, NULL);
  ++stepper->nlu;
  stepper->plan.skip_power = 1;
  /* the order of the stages is that of speeds which come from the same formula as all else */
  stepper->plan.torques.motion.from_rate = 1;
  for (int s = 0; s < m->stages; ++s) {
    if (s == 0) {
      memcpy(u[0], stepper->stage[0], size * sizeof *u[0]);
    } else {
      double *f = stepper->stage[m->stages + 1];
      kernels->combine(size, stepper->y_mid, stepper->y, 1.0, s, a, u);
      code = bd_stepper_rate(stepper, stepper->t + m->time[s] * h, stepper->y_mid, f);
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
    bd_implicit_add_torque_by_time(stepper, u[s], h * m->slope[s]);
    bd_newton_solve(&stepper->newton, &stepper->plan, u[s]);
  }
  stepper->plan.skip_power = stepper->plan.no_power;
  stepper->plan.torques.motion.from_rate = 0;
  if (code == BD_OK) {
    double *last = u[m->stages - 1];
    kernels->combine(size, stepper->y_new, stepper->y_mid, 1.0, 1, &one, &last);
    *error = bd_plan_error(&stepper->plan, &(bd_step_sum){1.0, 1, &one, &last, stepper->weights});
    *error = fmax(*error, bd_implicit_hidden_error(stepper, h, m->gamma * h, stepper->y_mid));
  }
  return code;
}

void bd_rosenbrock_inside(bd_stepper *stepper, double h, double s, double *y) {
  const bd_rosenbrock *m = stepper->now->table;
  const double *whole = m->a + (m->stages - 1) * (m->stages - 2) / 2;
  double b[BD_MAX_STAGES];
  for (int k = 0; k < m->stages; ++k) {
    double full = k < m->stages - 1 ? whole[k] : 1.0;
    b[k] = s * (full + (1.0 - s) * (m->dense[0][k] + s * m->dense[1][k]));
  }
  stepper->plan.kernels->combine(stepper->model->lay.size, y, stepper->y, 1.0, m->stages, b,
                                 stepper->stage + 1);
  bd_implicit_work_inside(stepper, h, s, y);
}
