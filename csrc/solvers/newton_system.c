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
 * Bodies of one degree of freedom are the shafts, one of each pulley, after them the mounts
 * (mount_border.c), and the rims and rings of couplings (physics/couplings.c). One whose motion is
 * prescribed has k_v = b_v for its row, and acts on the rest by its column as any other.
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

/* The links that could contact a pulley when the model was linearised: a later list may be another.
 */
static bd_run *runs_of(const bd_newton_system *system, int j) {
  return system->at.runs + j * system->at.max_runs;
}

static int mount_of(const bd_plan *plan, int j) {
  return plan->model->mount_of ? plan->model->mount_of[j] : -1;
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

void bd_newton_linearise(bd_newton_system *system, const bd_plan *plan, const double *y) {
  for (int k = 0; k < plan->n_effects; ++k) {
    plan->effects[k]->tangent(plan, y, &system->at);
  }
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

int bd_newton_is_prescribed(const bd_plan *plan, int body) {
  const int np = plan->model->lay.np;
  return body < np ? bd_is_moved(&plan->torques, body)
                   : bd_is_mount_body(&plan->model->lay, body) &&
                         !plan->model->mounts[body - np].row->moves;
}

/* The pulley at which the belt runs on this body, which is no mount; -1: it does not. */
static int pulley_of(const bd_layout *lay, int body) {
  const int j = body < lay->np ? body : lay->coupled[body - lay->np - lay->nm];
  return bd_belt_body(lay, j) == body ? j : -1;
}

/* A body's row times the velocities of the links. */
static double body_row(const bd_newton_system *system, const bd_plan *plan, int body,
                       const double *x, const double *y, const double *p) {
  const bd_layout *lay = &plan->model->lay;
  const int j = bd_is_mount_body(lay, body) ? lay->mounted[body - lay->np] : pulley_of(lay, body);
  if (j < 0) {
    return 0.0;
  }
  return bd_newton_row(system, plan, j, system->bodies[body].w, (const double *[]){x, y, p});
}

double bd_newton_entry(const bd_newton_system *system, const bd_plan *plan, int i, int j, double g,
                       double inertia) {
  const bd_layout *lay = &plan->model->lay;
  const int np = lay->np;
  if (bd_is_mount_body(lay, i) || bd_is_mount_body(lay, j)) {
    return bd_mount_entry(system, plan, i, j, g, inertia);
  }
  const int shafts = i < np && j < np, pulley = i == j ? pulley_of(lay, i) : -1;
  inertia += pulley >= 0 ? system->own[pulley] : 0.0;
  if (i == j && shafts && system->at.pulley_damping) {
    inertia += g * system->at.pulley_damping[i];
  }
  const double torque =
      shafts ? system->by_omega[i * np + j] + g * system->by_theta[i * np + j] : 0.0;
  double entry = inertia - g * torque;
  for (int e = 0; e < plan->n_effects; ++e) {
    if (plan->effects[e]->entry) {
      entry += plan->effects[e]->entry(&system->at, plan->model, i, j, g);
    }
  }
  return entry;
}

/* --- factorisation --------------------------------------------------------------------------- */

/* Of the shafts' small matrix: with pivots, whose reciprocals are kept, in place, by rows. */
static void decompose(int n, double *a, int *pivots) {
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

static void substitute(int n, const double *a, const int *pivots, double *x) {
  for (int k = 0; k < n; ++k) {
    double kept = x[pivots[k]];
    x[pivots[k]] = x[k];
    x[k] = kept;
  }
  for (int i = 0; i < n; ++i) {
    for (int c = 0; c < i; ++c) {
      x[i] -= a[i * n + c] * x[c];
    }
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int c = i + 1; c < n; ++c) {
      x[i] -= a[i * n + c] * x[c];
    }
    x[i] *= a[i * n + i];
  }
}

/* What contact will be beyond its tangent, as one pulley and its mount feel it, into a rate. */
static void correct_bodies(const bd_newton_system *system, const bd_plan *plan, int j,
                           const bd_fill_sums *sums, double *c) {
  const bd_layout *lay = &plan->model->lay;
  const int m = mount_of(plan, j);
  c[lay->rim[j]] += plan->pulleys_locked ? 0.0 : sums->torque / plan->model->rim_inertia[j];
  if (m >= 0 && plan->model->mounts[m].row->moves) {
    const double *a = system->at.mounts[m].at.a;
    c[lay->travel_speed + m] -=
        (a[0] * sums->force[0] + a[1] * sums->force[1]) / plan->mount_inertia[m];
  }
}

void bd_newton_fill(bd_newton_system *system, const bd_plan *plan, double *y, double g, double h,
                    double *c, double mass) {
  const bd_layout *lay = &plan->model->lay;
  const bd_links *links = &plan->links;
  const bd_newton_kernels *kernels = system->kernels;
  const bd_tangent *joints = &system->at.joints;
  const bd_fill fill = {y, g, h, c};
  const double inv_half = 1.0 / links->half;
  system->stage = (bd_stage){
      .g = g,
      .mass = mass,
      .slender = 0.25 * plan->model->belt_model->facts.shear,
      .k = g * (g * links->stiffness + links->damping),
      .bending = g * (g * links->bending + links->bending_damping) * inv_half * inv_half,
  };
  for (int body = 0; body < bd_count_bodies(lay); ++body) {
    memset(bd_newton_border(system, lay, body), 0,
           (size_t)(3 * lay->stride - BD_HALO) * sizeof(double));
  }
  bd_close_links(lay, y);
  if (plan->kernels->gather_points) {
    plan->kernels->gather_points(links, joints->cos, joints->sin, y, &system->scratch.points);
  }
  kernels->fill_ring(links, joints, &system->stage, &system->blocks);
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
    const int m = mount_of(plan, j);
    bd_axis axis;
    if (m >= 0) {
      axis = bd_mount_axis(system, plan, m, g);
    }
    const bd_fill_sums sums = kernels->fill_pulley[pulley->law](
        links, joints, pulley, system->at.n_runs[j], runs_of(system, j), &fill, &system->scratch,
        &system->blocks, &system->slots[j], &system->bodies[bd_belt_body(lay, j)],
        m >= 0 ? &axis : NULL);
    system->own[j] = sums.own;
    if (c) {
      correct_bodies(system, plan, j, &sums, c);
    }
    if (m >= 0) {
      bd_mount_border_add(system, plan, m, &axis);
    }
  }
}

void bd_newton_factor(bd_newton_system *system, bd_plan *plan, double *y, double g, double h,
                      double *c) {
  const bd_layout *lay = &plan->model->lay;
  const double damped = 1.0 + g * system->at.mass_damping;
  bd_newton_fill(system, plan, y, g, h, c, plan->model->info.link_mass * damped);
  system->ring_kernels->factor(&system->ring, system->blocks.w);
  const int first = first_body(plan), n = count_bodies(plan);
  for (int j = 0; j < n; ++j) {
    double *z = bd_newton_border(system, lay, first + j);
    system->ring_kernels->solve(&system->ring,
                                (double *const[]){z, z + lay->stride, z + 2 * lay->stride});
    for (int i = 0; i < n; ++i) {
      if (bd_newton_is_prescribed(plan, first + i)) {
        system->matrix[i * n + j] = i == j;
        continue;
      }
      const double inertia = i == j ? bd_freedom_of(plan, first + i).inertia * damped : 0.0;
      system->matrix[i * n + j] =
          bd_newton_entry(system, plan, first + i, first + j, g, inertia) -
          body_row(system, plan, first + i, z, z + lay->stride, z + 2 * lay->stride);
    }
  }
  decompose(n, system->matrix, system->pivots);
}

/* --- solve ----------------------------------------------------------------------------------- */

void bd_newton_close(const bd_layout *lay, double *c) {
  bd_close_links(lay, c);
  for (double *v = bd_field(lay, c, F_X); v < c + lay->theta; v += lay->stride) {
    v[lay->n] = v[0];
  }
}

/* Solutions do not move what stands there in a state, by rounding either, which differences of
 * states over a step's length make grow. */
static void clear_behind(const bd_layout *lay, double *c) {
  const int n = lay->n;
  for (double *v = bd_field(lay, c, F_X); v < c + lay->theta; v += lay->stride) {
    memset(v + n, 0, (size_t)(lay->stride - BD_HALO - n) * sizeof *v);
  }
}

double bd_newton_row(const bd_newton_system *system, const bd_plan *plan, int j, const double *row,
                     const double *const *v) {
  return system->kernels->row_runs(&plan->model->lay, system->at.n_runs[j], runs_of(system, j), row,
                                   v);
}

void bd_newton_product(bd_newton_system *system, const bd_plan *plan, double *c) {
  const bd_layout *lay = &plan->model->lay;
  const bd_newton_kernels *kernels = system->kernels;
  const double g = system->stage.g, m = g / plan->links.inv_mass;
  const double mass[3] = {m, m, m * plan->links.half / system->stage.slender};
  double *const r[3] = {system->x, system->y, system->p};
  const double *cq = bd_cfield(lay, c, F_X);
  memset(system->rhs, 0, (size_t)bd_count_bodies(lay) * sizeof *system->rhs);
  bd_newton_close(lay, c);
  kernels->blocks_product(lay, system->blocks.q, cq, bd_cfield(lay, c, F_VX), mass, r);
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
    const int body = bd_belt_body(lay, j);
    double sums[3] = {0.0, 0.0, 0.0}; /* torque and force of given states */
    if (pulley->law != BD_LAW_NONE) {
      const double *cz = bd_cfield(lay, c, bd_f_state(lay, pulley->slot));
      kernels->states_product(lay, &system->at.joints, system->at.n_runs[j], runs_of(system, j),
                              pulley->states, &system->slots[j], cz, system->bodies[body].q, cq, r,
                              sums);
    }
    system->rhs[body] = sums[0];
    if (mount_of(plan, j) >= 0) {
      bd_mount_product(system, plan, mount_of(plan, j), c, sums + 1, &system->rhs[body]);
    }
  }
  for (int e = 0; e < plan->n_effects; ++e) {
    if (plan->effects[e]->product) {
      plan->effects[e]->product(&system->at, plan->model, g, c, system->rhs);
    }
  }
}

void bd_newton_restore(const bd_newton_system *system, const bd_plan *plan, double *c) {
  const bd_layout *lay = &plan->model->lay;
  bd_newton_close(lay, c);
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
    if (pulley->law == BD_LAW_NONE) {
      continue;
    }
    const int m = mount_of(plan, j);
    double move[4];
    system->kernels->restore_states(
        lay, system->at.n_runs[j], runs_of(system, j), pulley->states, &system->slots[j],
        plan->links.link_mask, plan->pulleys_locked ? 0.0 : system->rhs[bd_belt_body(lay, j)],
        m >= 0 ? bd_mount_move(system, plan, m, c, move) : NULL, bd_cfield(lay, c, F_X),
        bd_cfield(lay, c, F_VX), bd_field(lay, c, bd_f_state(lay, pulley->slot)),
        bd_field(lay, c, bd_f_slip(lay, pulley->slot)));
  }
}

void bd_newton_solve(bd_newton_system *system, bd_plan *plan, double *c) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const double g = system->stage.g;
  const int first = first_body(plan), n = count_bodies(plan);
  double *x = system->x, *y = system->y, *p = system->p, *rhs = system->rhs;
  bd_newton_product(system, plan, c);
  system->ring_kernels->solve(&system->ring, (double *const[]){x, y, p});
  for (int body = first; body < first + n; ++body) {
    const int j = body < lay->np ? body : -1;
    if (bd_newton_is_prescribed(plan, body)) {
      rhs[body] = g * c[bd_freedom_of(plan, body).speed];
      continue;
    }
    if (j >= 0) {
      rhs[j] += g * model->inertia[j] * c[lay->omega + j];
    }
    for (int k = 0; j >= 0 && k < lay->np; ++k) {
      rhs[j] += g * g * system->by_theta[j * lay->np + k] * c[lay->theta + k];
    }
    rhs[body] -= body_row(system, plan, body, x, y, p);
  }
  substitute(n, system->matrix, system->pivots, rhs + first);
  system->kernels->finish_nodes(&plan->links, &system->stage, n,
                                bd_newton_border(system, lay, first), rhs + first, x, y, p, c);
  for (int m = 0; m < lay->nm; ++m) {
    bd_mount_finish(system, plan, m, rhs[lay->np + m], c);
  }
  for (int e = 0; e < plan->n_effects; ++e) {
    if (plan->effects[e]->finish) {
      plan->effects[e]->finish(&system->at, model, g, rhs, c);
    }
  }
  for (int j = 0; j < lay->np; ++j) {
    const double angular_acceleration = plan->pulleys_locked ? 0.0 : rhs[j];
    c[lay->theta + j] = plan->pulleys_locked ? 0.0 : g * (c[lay->theta + j] + angular_acceleration);
    c[lay->omega + j] = angular_acceleration;
  }
  bd_newton_restore(system, plan, c);
  clear_behind(lay, c);
  for (int k = 0; k < lay->n_work; ++k) {
    c[lay->work + k] = 0.0; /* the ledger follows the steps (implicit.c) */
  }
}
