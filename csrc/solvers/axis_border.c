/* SPDX-License-Identifier: MIT
 *
 * Pulleys whose axis moves with a body, in the linear systems (newton_system.c): of that body the
 * column and the row by the links, and its part of the small matrix that is due to contact.
 *
 * The contact of the pulley knows where links are against its axis. A velocity s of the body and
 * the travel g s that comes with it move the axis by g a s at (a + g q' a') s, a = dc/dq, and so
 * all links by as much the other way. The column of the body is the contact's answer to that; its
 * row is what moves of the links do to the force on the axis along a; and where the axis has moved,
 * a has turned by a' under the force that there is.
 * Column and row are filled with the contact of the pulley (kernels/contact_points.h).
 */
#include "solvers/solvers.h"

static bd_run *runs_of(const bd_newton_system *system, int j) {
  return system->at.runs + j * system->at.max_runs;
}

static double along(const bd_moving_axis *axis, const double force[2]) {
  return axis->at.a[0] * force[0] + axis->at.a[1] * force[1];
}

int bd_axis_at(const bd_newton_system *system, int j, double g, bd_axis *out) {
  const bd_moving_axis *axis = bd_moving_axis_of(&system->at, j);
  for (int k = 0; axis && k < 2; ++k) {
    out->a[k] = axis->at.a[k];
    out->bend[k] = g * axis->speed * axis->at.bend[k];
  }
  out->body = axis ? &system->bodies[axis->body] : NULL;
  return axis != NULL;
}

/* The sums along x and y of what stands with the nodes near a pulley. */
static void sum_xy(const bd_newton_system *system, const bd_layout *lay, int j, const double *array,
                   double sum[2]) {
  for (int k = 0; k < 2; ++k) {
    sum[k] = system->kernels->sum_runs(system->at.n_runs[j], runs_of(system, j),
                                       array + k * lay->stride);
  }
}

void bd_axis_fill(bd_newton_system *system, const bd_layout *lay, int j, const bd_axis *at) {
  const bd_body *pulley = &system->bodies[bd_belt_body(lay, j)], *own = at->body;
  const bd_moving_axis *axis = bd_moving_axis_of(&system->at, j);
  double column[2], given[2], spun[2], w[2], q[2];
  sum_xy(system, lay, j, own->column, column);
  sum_xy(system, lay, j, own->given, given);
  sum_xy(system, lay, j, pulley->column, spun);
  sum_xy(system, lay, j, pulley->w, w);
  sum_xy(system, lay, j, pulley->q, q);
  const double turned = at->bend[0] * (w[0] + q[0]) + at->bend[1] * (w[1] + q[1]);
  system->axes[j] = (bd_axis_border){
      .own = -along(axis, column),
      .given = along(axis, given),
      .by_spin = -along(axis, spun),
      .torque = -(along(axis, w) + turned),
      .given_torque = turned - along(axis, q),
  };
}

void bd_axis_entries(const bd_newton_system *system, const bd_layout *lay, double damped, int n,
                     double *w) {
  (void)damped;
  for (int j = 0; j < lay->np; ++j) {
    const bd_moving_axis *axis = bd_moving_axis_of(&system->at, j);
    const int belt = bd_belt_body(lay, j), own = axis ? axis->body : -1;
    if (axis) {
      w[own * n + own] += system->axes[j].own;
      w[own * n + belt] += system->axes[j].by_spin;
      w[belt * n + own] += system->axes[j].torque;
    }
  }
}

void bd_axis_product(bd_newton_system *system, const bd_plan *plan, int j, const double *c,
                     const double states[2]) {
  const bd_layout *lay = &plan->model->lay;
  const bd_moving_axis *axis = bd_moving_axis_of(&system->at, j);
  const bd_axis_border *border = &system->axes[j];
  const double travel = c[bd_freedom_of(plan, axis->body).place];
  const double *cq = bd_cfield(lay, c, F_X);
  system->kernels->add_column(lay, system->at.n_runs[j], runs_of(system, j),
                              system->bodies[axis->body].given, travel,
                              (double *const[]){system->x, system->y, system->p});
  system->rhs[bd_belt_body(lay, j)] += border->given_torque * travel;
  system->rhs[axis->body] =
      bd_newton_row(system, plan, j, system->bodies[axis->body].q,
                    (const double *[]){cq, cq + lay->stride, cq + 2 * lay->stride});
  system->off[axis->body] = along(axis, states) + border->given * travel;
}

double *bd_axis_move(const bd_plan *plan, const bd_moving_axis *axis, const double *c,
                     double move[4]) {
  const bd_freedom body = bd_freedom_of(plan, axis->body);
  const double travel = c[body.place], pace = c[body.speed];
  for (int k = 0; k < 2; ++k) {
    move[k] = -travel * axis->at.a[k];
    move[2 + k] = -(pace * axis->at.a[k] + travel * axis->speed * axis->at.bend[k]);
  }
  return move;
}
