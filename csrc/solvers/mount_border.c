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
 */
#include <string.h>

#include "solvers/solvers.h"

static bd_run *runs_of(const bd_newton_system *system, int j) {
  return system->at.runs + j * system->at.max_runs;
}

static int is_path(const bd_plan *plan, int m) {
  return plan->model->mounts[m].kind == BD_MOUNT_PATH;
}

/* The move of all links against the axis for a speed `pace` and a travel of the mount. */
static void against_axis(const bd_mount_tangent *at, double travel, double pace, double move[4]) {
  for (int k = 0; k < 2; ++k) {
    move[k] = -travel * at->at.a[k];
    move[2 + k] = -(pace * at->at.a[k] + travel * at->speed * at->at.bend[k]);
  }
}

static double along(const bd_mount_tangent *at, const double force[2]) {
  return at->at.a[0] * force[0] + at->at.a[1] * force[1];
}

void bd_mount_border_add(bd_newton_system *system, const bd_plan *plan, int m, double g,
                         double *column) {
  const bd_layout *lay = &plan->model->lay;
  const bd_links *links = &plan->links;
  const bd_newton_kernels *kernels = plan->kernels->newton;
  const bd_tangent *joints = &system->at.joints;
  const bd_link_scratch *scratch = &system->scratch;
  const bd_mount_tangent *at = &system->at.mounts[m];
  bd_mount_border *border = &system->mounts[m];
  const int j = lay->mounted[m], n_runs = system->at.n_runs[j];
  const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
  const bd_run *runs = runs_of(system, j);
  const int friction = pulley->law != BD_LAW_NONE;
  /* of the pulley's own column; the joint after the last link, which is the first one, counts once
   */
  system->joint_x[lay->n] = system->joint_y[lay->n] = 0.0;
  const double spun[2] = {kernels->sum_runs(n_runs, runs, system->joint_x),
                          kernels->sum_runs(n_runs, runs, system->joint_y)};
  border->by_spin = friction ? -along(at, spun) : 0.0;
  double move[4], force[2];
  against_axis(at, g, 1.0, move);
  bd_newton_clear(lay, (double *const[]){system->joint_x, system->joint_y}, 2);
  border->torque = kernels->move_links(links, joints, pulley, n_runs, runs, &system->along[j], move,
                                       -g, system->joint_x, system->joint_y, column,
                                       column + lay->stride, column + 2 * lay->stride, force);
  kernels->joints_to_links(links, joints, system->joint_x, system->joint_y, column,
                           column + lay->stride, column + 2 * lay->stride);
  border->own = -along(at, force);
  if (is_path(plan, m)) {
    return;
  }
  bd_newton_clear(lay, scratch->row_before, 3);
  bd_newton_clear(lay, scratch->row_behind, 3);
  kernels->mount_row(links, joints, pulley, n_runs, runs, &system->along[j], scratch, g, at->at.a,
                     system->rows + (size_t)(3 * (lay->np + m)) * (size_t)lay->stride + BD_HALO);
}

/* Slope of the drag between pulley and arm. */
static double drag_of(const bd_newton_system *system, const bd_plan *plan, int m) {
  const int j = plan->model->lay.mounted[m];
  return system->at.pulley_damping && bd_arm_of(plan->model, j) ? system->at.pulley_damping[j]
                                                                : 0.0;
}

double bd_mount_entry(const bd_newton_system *system, const bd_plan *plan, int row, int column,
                      double g) {
  const bd_layout *lay = &plan->model->lay;
  const int of_row = row >= lay->np && row < lay->np + lay->nm;
  const int m = (of_row ? row : column) - lay->np, j = lay->mounted[m];
  const int other = of_row ? column : row;
  const bd_mount_border *border = &system->mounts[m];
  const bd_mount_tangent *at = &system->at.mounts[m];
  const double drag = g * drag_of(system, plan, m);
  /* the belt acts on the rim, drag on the shaft */
  const double belt =
      other == bd_belt_body(lay, j) ? of_row ? border->by_spin : border->torque : 0.0;
  if (!of_row) {
    return belt - (other == j ? drag : 0.0);
  }
  if (is_path(plan, m)) {
    return row == column;
  }
  if (row != column) {
    return belt - (other == j ? drag : 0.0);
  }
  const double grip = g * g * at->friction * at->gain / (1.0 + g * at->decay);
  return plan->mount_inertia[m] * (1.0 + g * system->at.mass_damping) +
         g * (g * at->stiffness + at->damping) + grip + drag + border->own;
}

void bd_mount_product(bd_newton_system *system, const bd_plan *plan, int m, const double *c,
                      const double given[2], double *torque) {
  const bd_layout *lay = &plan->model->lay;
  const bd_mount_tangent *at = &system->at.mounts[m];
  const double g = system->stage.g, travel = c[lay->travel + m];
  const int j = lay->mounted[m];
  double move[4], force[2];
  against_axis(at, travel, 0.0, move);
  *torque += plan->kernels->newton->move_links(
      &plan->links, &system->at.joints, &system->at.contact_pulleys[j], system->at.n_runs[j],
      runs_of(system, j), &system->along[j], move, g * g, system->joint_x, system->joint_y,
      system->x, system->y, system->p, force);
  double *rhs = &system->rhs[lay->np + m];
  *rhs = g * c[lay->travel_speed + m];
  if (!is_path(plan, m)) {
    const double grip = at->friction * c[lay->mount_friction + m] / (1.0 + g * at->decay);
    *rhs *= plan->mount_inertia[m];
    *rhs -= along(at, given) + along(at, force) + g * g * (at->stiffness * travel + grip);
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

void bd_mount_finish_joints(const bd_newton_system *system, const bd_plan *plan, int m, double *c) {
  const bd_layout *lay = &plan->model->lay;
  const int j = lay->mounted[m];
  double move[4];
  against_axis(&system->at.mounts[m], c[lay->travel + m], c[lay->travel_speed + m], move);
  plan->kernels->newton->finish_moved(lay, &system->at.contact_pulleys[j], system->at.n_runs[j],
                                      runs_of(system, j), &system->along[j], system->stage.g, move,
                                      c);
}
