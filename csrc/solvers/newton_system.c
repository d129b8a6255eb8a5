/* SPDX-License-Identifier: MIT
 *
 * Linear systems (1 - g J) k = g c of the implicit methods, J the Jacobian of the model, g = gamma
 * h.
 *
 * Unknowns are positions q, velocities v and states of friction z of the links, theta and omega
 * of the pulleys; slip rides along. With b = g c, J's rows q' = v and z' = gain v_T + gain_N N
 * - decay z give
 *
 *   k_q = b_q + g k_v,    k_z = (b_z + g gain dv_T[k] + g gain_N dN[k]) / (1 + g decay)
 *
 * so only velocities are left, links in 3 x 3 blocks round the ring and a border of one row and
 * column a shaft: (M - g F_v - g^2 F_q - ...) k_v = M b_v + g F_q b_q + ... The unknown angle of a
 * link is that of its end, half its length times phi, so that all blocks are masses. With W the
 * matrix on the left and Q = g^2 F_q, states eliminated, W k_v = g M c_v + Q c_q + ...: each belt
 * fills both as blocks of neighbouring nodes, and the rows of the bodies in both
 * (kernels/kernels.h); what solves is the same for every belt.
 *
 * Bodies of one degree of freedom are the shafts, one of each pulley, and those that effects bring
 * (rows of physics.h), with which an axis may move (axis_border.c). One whose motion is prescribed
 * has k_v = b_v for its row, and acts on the rest by its column as any other.
 *
 * Joint on the left of link i, e = (cos, sin) of its direction, e' across it, S = [1, -e'] at its
 * left and R = [1, e'] at its right end (MODEL section 2): g df = D^S_i k_i - D^R_l k_l with
 * D^S = [K 1 | q], D^R = [K 1 | -q], K = g^2 c + g b, q = -K e' + g^2 b w e (the end turns with w);
 * forces -S^T f on link i and R^T f on link l; and the pull of both joints turns a link back.
 *
 * Contact in the axes (n, t) of a link on its pulley (MODEL sections 3, 4): dN = -k_n dr_n - b dv_n
 * - (b v_t / rho) dr_t while pressed; of the friction force dF = F_N dN + F_z dz + F_v dv_T, by the
 * law's slopes (friction/laws.h); dF_n = dN + (F / rho) dr_t, dF_t = (N / rho) dr_t - dF, dv_T =
 * dv_t - (v_n / rho) dr_t - omega dr_n - rho d omega, dtau = rho dF + F dr_n. With k_z put in, F_N
 * and F_v stand for F_N + F_z g gain_N / (1 + g decay) and F_v + F_z g gain / (1 + g decay). Kinks
 * (touching, pressed, those of the law) are taken as they stand at the state that is linearised.
 *
 * Guarded by tests/test_jacobian.py: differences of the right-hand side, of the oracle's, on both
 * sides of every kink; solves against dense ones.
 */
#include <math.h>
#include <string.h>

#include "solvers/solvers.h"

/* --- linearisation --------------------------------------------------------------------------- */

/* The links that have a part in the contact of a pulley as linearised. */
static bd_run *runs_of(const bd_newton_system *system, int j) {
  return system->at.runs + j * system->at.max_runs;
}

int bd_newton_check(const bd_plan *plan, const char *method, bd_error *err) {
  for (int k = 0; k < plan->n_effects; ++k) {
    if (!plan->effects[k]->tangent) {
      return bd_fail(err, BD_ERR_OPTION, "method",
                     "method \"%s\" is implicit and needs derivatives, which \"%s\" does not give: "
                     "take \"tsit5\" or \"rk4\"",
                     method, plan->effects[k]->name);
    }
  }
  return BD_OK;
}

/* Of contact which links touch which pulley, of those that a step of the length searched for may
 * bring there: whether it is linearised as it stands or as a step of some length finds it depends
 * on the method (bd_newton_factor). */
static void nodes_linearise(bd_newton_system *system, const bd_plan *plan, const double *y) {
  const bd_layout *lay = &plan->model->lay;
  bd_derivatives *at = &system->at;
  system->kernels->linearise_joints(&plan->links, y, &at->joints);
  for (int j = 0; j < lay->np; ++j) {
    at->contact_pulleys[j] = plan->contact_pulleys[j];
    at->contact_pulleys[j].omega = y[lay->rim[j]];
    at->n_runs[j] = bd_search_near(plan, y, j, at->ahead, plan->search.n_runs[j],
                                   bd_runs_of(plan, j), runs_of(system, j));
  }
}

void bd_newton_linearise(bd_newton_system *system, const bd_plan *plan, const double *y) {
  for (int k = 0; k < plan->n_effects; ++k) {
    plan->effects[k]->tangent(plan, y, &system->at);
  }
  plan->model->belt_model->newton->linearise(system, plan, y); /* with axes where mounts put them */
}

/* --- the border ------------------------------------------------------------------------------ */

/* Bodies are counted from the first that may move: shafts that are locked have no equation. */
static int first_body(const bd_plan *plan) {
  return plan->pulleys_locked ? plan->model->lay.np : 0;
}

static int count_bodies(const bd_plan *plan) {
  const bd_layout *lay = &plan->model->lay;
  return plan->pulleys_locked ? lay->nm : bd_count_bodies(lay);
}

/* A body's row times the velocities of the links. */
static double nodes_row(const bd_newton_system *system, const bd_plan *plan, int body,
                        const double *v) {
  const bd_layout *lay = &plan->model->lay;
  const int j = bd_freedom_of(plan, body).pulley;
  const bd_moving_axis *axis = bd_moving_axis_of(&system->at, j);
  if (body != bd_belt_body(lay, j) && !(axis && body == axis->body)) {
    return 0.0;
  }
  return bd_newton_row(system, plan, j, system->bodies[body].w,
                       (const double *[]){v, v + lay->stride, v + 2 * lay->stride});
}

void bd_newton_bodies(bd_newton_system *system, const bd_plan *plan, double g, double damped) {
  const bd_layout *lay = &plan->model->lay;
  const int np = lay->np, n = bd_count_bodies(lay);
  double *w = system->of_bodies;
  memset(w, 0, (size_t)(n * n) * sizeof *w);
  for (int body = 0; body < n; ++body) {
    w[body * n + body] = bd_freedom_of(plan, body).inertia * damped;
  }
  for (int j = 0; j < np; ++j) {
    w[bd_belt_body(lay, j) * (n + 1)] += system->own[j];
  }
  for (int e = plan->n_effects - 1; e >= 0; --e) {
    if (plan->effects[e]->entries) {
      plan->effects[e]->entries(plan, &system->at, g, n, w);
    }
  }
  for (int k = 0; k < np * np; ++k) {
    w[k / np * n + k % np] -= g * (system->by_omega[k] + g * system->by_theta[k]);
  }
  plan->model->belt_model->newton->bodies(system, lay, damped, n, w);
}

/* --- factorisation --------------------------------------------------------------------------- */

/* With pivots, whose reciprocals are kept. */
void bd_dense_factor(int n, double *a, int *pivots) {
  for (int k = 0; k < n; ++k) {
    int best = k;
    for (int i = k + 1; i < n; ++i) {
      best = fabs(a[i * n + k]) > fabs(a[best * n + k]) ? i : best;
    }
    pivots[k] = best;
    for (int c = 0; best != k && c < n; ++c) {
      double kept = a[k * n + c];
      a[k * n + c] = a[best * n + c];
      a[best * n + c] = kept;
    }
    a[k * n + k] = 1.0 / a[k * n + k];
    for (int i = k + 1; i < n; ++i) {
      double factor = a[i * n + k] *= a[k * n + k];
      for (int c = k + 1; c < n; ++c) {
        a[i * n + c] -= factor * a[k * n + c];
      }
    }
  }
}

void bd_dense_solve(int n, const double *a, const int *pivots, double *x) {
  for (int k = 0; k < n; ++k) {
    double kept = x[pivots[k]];
    x[pivots[k]] = x[k];
    x[k] = kept;
  }
  for (int c = 0; c < n; ++c) { /* rows do not wait for each other */
    for (int i = c + 1; i < n; ++i) {
      x[i] -= a[i * n + c] * x[c];
    }
  }
  for (int i = n - 1; i >= 0; --i) {
    double left = x[i];
    for (int c = i + 1; c < n; ++c) {
      left -= a[i * n + c] * x[c];
    }
    x[i] = left * a[i * n + i];
  }
}

/* What contact will be beyond its tangent, as one pulley and its axis feel it, into a rate. */
static void correct_bodies(const bd_newton_system *system, const bd_plan *plan, int j,
                           const bd_fill_sums *sums, double *c) {
  const bd_layout *lay = &plan->model->lay;
  const bd_moving_axis *axis = bd_moving_axis_of(&system->at, j);
  c[lay->rim[j]] += plan->pulleys_locked ? 0.0 : sums->torque / plan->model->rim_inertia[j];
  if (axis && !bd_freedom_of(plan, axis->body).prescribed) {
    const bd_freedom body = bd_freedom_of(plan, axis->body);
    const double *a = axis->at.a;
    c[body.speed] -= (a[0] * sums->force[0] + a[1] * sums->force[1]) / body.inertia;
  }
}

/* Mass of a link over what its inertia is worth at its ends. */
static double slenderness(const bd_plan *plan) {
  return 0.25 * plan->model->belt_model->facts.shear;
}

void bd_newton_fill(bd_newton_system *system, const bd_plan *plan, double *y, double g, double h,
                    double *c, double mass) {
  const bd_layout *lay = &plan->model->lay;
  const bd_links *links = &plan->links;
  const bd_newton_kernels *kernels = system->kernels;
  const bd_tangent *joints = &system->at.joints;
  const bd_fill fill = {y, g, h, c};
  const double bend = 1.0 / (links->half * links->half), slender = slenderness(plan);
  bd_matrix *w = &system->blocks.w, *q = &system->blocks.q;
  system->g = g;
  w->mass = mass;
  w->inertia = mass / slender;
  w->k = g * (g * links->stiffness + links->damping);
  w->spin = g * g * links->damping;
  w->bend = g * (g * links->bending + links->bending_damping) * bend;
  w->pull = g * g;
  w->arm = 1.0;
  q->k = -g * g * links->stiffness;
  q->spin = -g * g * links->damping;
  q->bend = -g * g * links->bending * bend;
  q->pull = -g * g;
  q->arm = links->half;
  for (double **v = (double *[]){joints->cos, joints->sin, joints->spin, joints->pull, NULL}; *v;
       ++v) {
    (*v)[lay->n] = (*v)[0];
  }
  for (int body = 0; body < bd_count_bodies(lay); ++body) {
    memset(bd_newton_border(system, body), 0, (size_t)(3 * lay->stride - BD_HALO) * sizeof(double));
  }
  bd_close_links(lay, y);
  if (plan->kernels->gather_points) {
    plan->kernels->gather_points(links, joints->cos, joints->sin, y, &system->scratch.points);
  }
  kernels->fill_ring(lay, w);
  kernels->fill_ring(lay, q);
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
    bd_axis axis;
    const int moves = bd_axis_at(system, j, g, &axis);
    const bd_fill_sums sums = kernels->fill_pulley[pulley->law](
        links, joints, pulley, system->at.n_runs[j], runs_of(system, j), &fill, &system->scratch,
        &system->blocks, &system->slots[j], &system->bodies[bd_belt_body(lay, j)],
        moves ? &axis : NULL);
    system->own[j] = sums.own;
    if (c) {
      correct_bodies(system, plan, j, &sums, c);
    }
    if (moves) {
      bd_axis_fill(system, lay, j, &axis);
    }
  }
}

static void nodes_factor(bd_newton_system *system) {
  system->ring_kernels->factor(&system->ring, &system->blocks.w);
}

static void nodes_solve(const bd_newton_system *system, const bd_layout *lay, int n, double *v) {
  for (int k = 0; k < n; ++k, v += system->width) {
    system->ring_kernels->solve(&system->ring,
                                (double *const[]){v, v + lay->stride, v + 2 * lay->stride});
  }
}

void bd_newton_factor(bd_newton_system *system, bd_plan *plan, double *y, double g, double h,
                      double *c) {
  const bd_layout *lay = &plan->model->lay;
  const double damped = 1.0 + g * system->at.mass_damping;
  const bd_newton_belt *belt = plan->model->belt_model->newton;
  belt->fill(system, plan, y, g, h, c, plan->model->info.link_mass * damped);
  belt->factor(system);
  bd_newton_bodies(system, plan, g, damped);
  const int first = first_body(plan), n = count_bodies(plan), all = bd_count_bodies(lay);
  belt->solve(system, lay, n, bd_newton_border(system, first));
  for (int j = 0; j < n; ++j) {
    const double *z = bd_newton_border(system, first + j);
    for (int i = 0; i < n; ++i) {
      system->matrix[i * n + j] = bd_freedom_of(plan, first + i).prescribed
                                      ? i == j
                                      : system->of_bodies[(first + i) * all + first + j] -
                                            belt->row(system, plan, first + i, z);
    }
  }
  bd_dense_factor(n, system->matrix, system->pivots);
}

/* --- solve ----------------------------------------------------------------------------------- */

void bd_newton_close(const bd_layout *lay, double *c) {
  bd_close_links(lay, c);
  for (double *v = bd_field(lay, c, F_X); v < c + lay->theta; v += lay->stride) {
    v[lay->n] = v[0];
  }
}

double bd_newton_row(const bd_newton_system *system, const bd_plan *plan, int j, const double *row,
                     const double *const *v) {
  return system->kernels->row_runs(&plan->model->lay, system->at.n_runs[j], runs_of(system, j), row,
                                   v);
}

static void nodes_product(bd_newton_system *system, const bd_plan *plan, double *c) {
  const bd_layout *lay = &plan->model->lay;
  const bd_newton_kernels *kernels = system->kernels;
  const double g = system->g, m = g / plan->links.inv_mass;
  const double mass[3] = {m, m, m * plan->links.half / slenderness(plan)};
  double *const r[3] = {system->x, system->y, system->p};
  const double *cq = bd_cfield(lay, c, F_X);
  bd_newton_close(lay, c);
  kernels->blocks_product(lay, &system->blocks.q, cq, bd_cfield(lay, c, F_VX), mass, r);
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
    const int body = bd_belt_body(lay, j);
    double sums[3]; /* torque and force of given states */
    kernels->states_product(lay, &system->at.joints, system->at.n_runs[j], runs_of(system, j),
                            pulley->states, &system->slots[j],
                            bd_cfield(lay, c, bd_f_state(lay, pulley->slot)),
                            system->bodies[body].q, cq, r, sums);
    system->rhs[body] = sums[0];
    if (bd_moving_axis_of(&system->at, j)) {
      bd_axis_product(system, plan, j, c, sums + 1);
    }
  }
}

void bd_newton_product(bd_newton_system *system, const bd_plan *plan, double *c) {
  const int bodies = bd_count_bodies(&plan->model->lay);
  memset(system->rhs, 0, (size_t)bodies * sizeof *system->rhs);
  memset(system->off, 0, (size_t)bodies * sizeof *system->off);
  plan->model->belt_model->newton->product(system, plan, c);
  for (int e = 0; e < plan->n_effects; ++e) {
    if (plan->effects[e]->product) {
      plan->effects[e]->product(plan, &system->at, system->g, c, system->rhs, system->off);
    }
  }
  for (int body = 0; body < bodies; ++body) {
    system->rhs[body] -= system->off[body];
  }
}

static void nodes_finish(const bd_newton_system *system, const bd_plan *plan, int n,
                         const double *columns, const double *factors, double *c) {
  system->kernels->finish_nodes(&plan->links, system->g, n, columns, factors, system->x, system->y,
                                system->p, c);
}

void bd_newton_restore(const bd_newton_system *system, const bd_plan *plan, double *c) {
  const bd_layout *lay = &plan->model->lay;
  const int along = plan->model->belt_model->facts.reach > 0.0; /* neighbours move points */
  if (along) {
    bd_newton_close(lay, c);
  }
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
    if (pulley->law == BD_LAW_NONE) {
      continue;
    }
    const bd_moving_axis *axis = bd_moving_axis_of(&system->at, j);
    double move[4];
    system->kernels->restore_states(
        lay, system->at.n_runs[j], runs_of(system, j), pulley->states, &system->slots[j],
        plan->links.link_mask, plan->pulleys_locked ? 0.0 : system->rhs[bd_belt_body(lay, j)],
        axis ? bd_axis_move(plan, axis, c, move) : NULL, bd_cfield(lay, c, F_X),
        bd_cfield(lay, c, F_VX), bd_field(lay, c, bd_f_state(lay, pulley->slot)),
        bd_field(lay, c, bd_f_slip(lay, pulley->slot)));
  }
  for (double *v = bd_field(lay, c, F_X); along && v < c + lay->theta; v += lay->stride) {
    v[lay->n] = 0.0;
  }
}

const bd_newton_belt bd_newton_nodes = {.carve = bd_nodes_newton_carve,
                                        .linearise = nodes_linearise,
                                        .fill = bd_newton_fill,
                                        .factor = nodes_factor,
                                        .solve = nodes_solve,
                                        .row = nodes_row,
                                        .bodies = bd_axis_entries,
                                        .product = nodes_product,
                                        .finish = nodes_finish,
                                        .restore = bd_newton_restore,
                                        .entries = bd_newton_entries};

void bd_newton_solve(bd_newton_system *system, bd_plan *plan, double *c) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const double g = system->g;
  const int first = first_body(plan), n = count_bodies(plan);
  const bd_newton_belt *belt = model->belt_model->newton;
  double *x = system->x, *rhs = system->rhs;
  bd_newton_product(system, plan, c);
  belt->solve(system, lay, 1, x);
  for (int body = first; body < first + n; ++body) {
    const int j = body < lay->np ? body : -1;
    const bd_freedom freedom = bd_freedom_of(plan, body);
    if (freedom.prescribed) {
      rhs[body] = g * c[freedom.speed];
      continue;
    }
    if (j >= 0) {
      rhs[j] += g * model->inertia[j] * c[lay->omega + j];
    }
    for (int k = 0; j >= 0 && k < lay->np; ++k) {
      rhs[j] += g * g * system->by_theta[j * lay->np + k] * c[lay->theta + k];
    }
    rhs[body] -= belt->row(system, plan, body, x);
  }
  bd_dense_solve(n, system->matrix, system->pivots, rhs + first);
  belt->finish(system, plan, n, bd_newton_border(system, first), rhs + first, c);
  for (int e = 0; e < plan->n_effects; ++e) {
    if (plan->effects[e]->finish) {
      plan->effects[e]->finish(plan, &system->at, g, rhs, c);
    }
  }
  for (int j = 0; j < lay->np; ++j) {
    const double angular_acceleration = plan->pulleys_locked ? 0.0 : rhs[j];
    c[lay->theta + j] = plan->pulleys_locked ? 0.0 : g * (c[lay->theta + j] + angular_acceleration);
    c[lay->omega + j] = angular_acceleration;
  }
  belt->restore(system, plan, c);
  for (int k = 0; k < lay->n_work; ++k) {
    c[lay->work + k] = 0.0; /* the ledger follows the steps (implicit.c) */
  }
}
