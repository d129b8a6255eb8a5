/* SPDX-License-Identifier: MIT
 *
 * Mounts in the linear systems (newton_system.c): bodies of one degree of freedom that follow the
 * shafts in the border.
 *
 * The contact of the pulley knows where links are against its axis. A velocity s of the travel and
 * the travel g s that comes with it move the axis by g a s at (a + g q' a') s, a = dc/dq, and so
 * all links by as much the other way. The column of a mount is the contact's answer to that; its
 * row is what moves of the links do to the force on the axis along a; and where the axis has moved,
 * a has turned by a' under the force that there is.
 * Column and row are filled with the contact of the pulley (kernels/contact_points.h).
 */
#include "solvers/solvers.h"

static bd_run *runs_of(const bd_newton_system *system, int j) {
  return system->at.runs + j * system->at.max_runs;
}

static double along(const bd_mount_tangent *at, const double force[2]) {
  return at->at.a[0] * force[0] + at->at.a[1] * force[1];
}

bd_axis bd_mount_axis(const bd_newton_system *system, const bd_plan *plan, int m, double g) {
  const bd_mount_tangent *at = &system->at.mounts[m];
  const double turned = g * at->speed;
  return (bd_axis){.a = {at->at.a[0], at->at.a[1]},
                   .bend = {turned * at->at.bend[0], turned * at->at.bend[1]},
                   .body = &system->bodies[plan->model->lay.np + m]};
}

/* The sums along x and y of what stands with the nodes near a mount's pulley. */
static void sum_xy(const bd_newton_system *system, const bd_plan *plan, int m, const double *array,
                   double sum[2]) {
  const int j = plan->model->lay.mounted[m];
  for (int k = 0; k < 2; ++k) {
    sum[k] = system->kernels->sum_runs(system->at.n_runs[j], runs_of(system, j),
                                       array + k * plan->model->lay.stride);
  }
}

void bd_mount_border_add(bd_newton_system *system, const bd_plan *plan, int m,
                         const bd_axis *axis) {
  const bd_layout *lay = &plan->model->lay;
  const bd_body *pulley = &system->bodies[bd_belt_body(lay, lay->mounted[m])], *own = axis->body;
  const bd_mount_tangent *at = &system->at.mounts[m];
  bd_mount_border *border = &system->mounts[m];
  double column[2], given[2], spun[2], w[2], q[2];
  sum_xy(system, plan, m, own->column, column);
  sum_xy(system, plan, m, own->given, given);
  sum_xy(system, plan, m, pulley->column, spun);
  sum_xy(system, plan, m, pulley->w, w);
  sum_xy(system, plan, m, pulley->q, q);
  border->own = -along(at, column);
  border->given = along(at, given);
  border->by_spin = -along(at, spun);
  const double turned = axis->bend[0] * (w[0] + q[0]) + axis->bend[1] * (w[1] + q[1]);
  border->torque = -(along(at, w) + turned);
  border->given_torque = turned - along(at, q);
}

double bd_mount_entry(const bd_newton_system *system, const bd_plan *plan, int row, int column,
                      double g, double inertia) {
  const bd_layout *lay = &plan->model->lay;
  const int of_row = bd_is_mount_body(lay, row);
  const int m = (of_row ? row : column) - lay->np, j = lay->mounted[m];
  const int other = of_row ? column : row;
  const bd_mount_border *border = &system->mounts[m];
  const bd_mount_tangent *at = &system->at.mounts[m];
  /* of the bearings that it turns, by its speed and by that of the shaft */
  const double turning = plan->model->mounts[m].turning;
  const double drag = system->at.pulley_damping ? g * turning * system->at.pulley_damping[j] : 0.0;
  /* the belt acts on the rim, drag on the shaft */
  const double belt =
      other == bd_belt_body(lay, j) ? of_row ? border->by_spin : border->torque : 0.0;
  if (!of_row) {
    return belt - (other == j ? drag : 0.0);
  }
  if (row != column) {
    return belt - (other == j ? drag : 0.0);
  }
  const double grip = g * g * at->friction * at->gain / (1.0 + g * at->decay);
  return inertia + g * (g * at->stiffness + at->damping) + grip + turning * drag + border->own;
}

void bd_mount_product(bd_newton_system *system, const bd_plan *plan, int m, const double *c,
                      const double states[2], double *torque) {
  const bd_layout *lay = &plan->model->lay;
  const bd_mount_tangent *at = &system->at.mounts[m];
  const bd_mount_border *border = &system->mounts[m];
  const int j = lay->mounted[m], body = lay->np + m;
  const double g = system->stage.g, travel = c[lay->travel + m];
  const double *cq = bd_cfield(lay, c, F_X);
  system->kernels->add_column(lay, system->at.n_runs[j], runs_of(system, j),
                              system->bodies[body].given, travel,
                              (double *const[]){system->x, system->y, system->p});
  *torque += border->given_torque * travel;
  double *rhs = &system->rhs[body];
  *rhs = g * c[lay->travel_speed + m];
  if (plan->model->mounts[m].row->moves) {
    const double grip = at->friction * c[lay->mount_friction + m] / (1.0 + g * at->decay);
    *rhs *= plan->mount_inertia[m];
    *rhs += bd_newton_row(system, plan, j, system->bodies[body].q,
                          (const double *[]){cq, cq + lay->stride, cq + 2 * lay->stride});
    *rhs -= along(at, states) + border->given * travel + g * g * (at->stiffness * travel + grip);
  }
}

void bd_mount_finish(const bd_newton_system *system, const bd_plan *plan, int m, double pace,
                     double *c) {
  const bd_layout *lay = &plan->model->lay;
  const bd_mount_tangent *at = &system->at.mounts[m];
  const double g = system->stage.g;
  double *share = &c[lay->mount_friction + m];
  c[lay->travel + m] = g * (c[lay->travel + m] + pace);
  c[lay->travel_speed + m] = pace;
  *share = g * (*share + at->gain * pace) / (1.0 + g * at->decay);
}

double *bd_mount_move(const bd_newton_system *system, const bd_plan *plan, int m, const double *c,
                      double move[4]) {
  const bd_layout *lay = &plan->model->lay;
  const bd_mount_tangent *at = &system->at.mounts[m];
  const double travel = c[lay->travel + m], pace = c[lay->travel_speed + m];
  for (int k = 0; k < 2; ++k) {
    move[k] = -travel * at->at.a[k];
    move[2 + k] = -(pace * at->at.a[k] + travel * at->speed * at->at.bend[k]);
  }
  return move;
}
