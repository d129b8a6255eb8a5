/* SPDX-License-Identifier: MIT
 *
 * Linear systems (1 - g J) k = g c of the implicit methods, J the Jacobian of the model, g = gamma
 * h.
 *
 * Unknowns are positions q, velocities v and friction coefficients mu of the links, theta and omega
 * of the pulleys; slip rides along. With b = g c, J's rows q' = v and mu' = gain v_T - decay mu
 * give
 *
 *   k_q = b_q + g k_v,    k_mu = (b_mu + g gain v_T[k]) / (1 + g decay)
 *
 * so only velocities are left, links in 3 x 3 blocks round the ring and a border of one row and
 * column a pulley: (M - g F_v - g^2 F_q - ...) k_v = M b_v + g F_q b_q + ... The unknown angle of a
 * link is that of its end, half its length times phi, so that all blocks are masses.
 *
 * Joint on the left of link i, e = (cos, sin) of its direction, e' across it, S = [1, -e'] at its
 * left and R = [1, e'] at its right end (MODEL section 2): g df = D^S_i k_i - D^R_l k_l with
 * D^S = [K 1 | q], D^R = [K 1 | -q], K = g^2 c + g b, q = -K e' + g^2 b w e (the end turns with w);
 * forces -S^T f on link i and R^T f on link l; and the pull of both joints turns a link back.
 *
 * Contact in the axes (n, t) of a link on its pulley (MODEL sections 3, 4): dN = -k_n dr_n - b dv_n
 * - (b v_t / rho) dr_t while pressed, dF_n = dN + (mu N / rho) dr_t, dF_t = -mu dN + (N / rho) dr_t
 * - N dmu, dv_T = dv_t - (v_n / rho) dr_t - omega dr_n - rho d omega, dtau = mu rho dN + mu N dr_n
 * + N rho dmu. Kinks (touching, pressed, the sign of v_T) are taken as they stand at the state that
 * is linearised.
 *
 * Guarded by tests/test_jacobian.py: differences of the right-hand side, of the oracle's, on both
 * sides of every kink; solves against dense ones.
 */
#include <math.h>
#include <string.h>

#include "run/run.h"

/* A ring too short for the level's arcs is solved with two: the cyclic reduction of separators that
 * few links hold apart would cost digits where links weigh little against their joints. */
static const bd_linear_kernels *ring_kernels(const bd_model *model) {
  const bd_linear_kernels *best = model->kernels->linear;
  return model->lay.n >= 4 * best->width ? best : &bd_linear_baseline;
}

/* A block of `count` links' places with room for the halo. */
static void carve_links(bd_carver *carver, const bd_layout *lay, double **block) {
  BD_CARVE(carver, *block, lay->stride);
  if (carver->base) {
    *block += BD_HALO;
  }
}

void bd_linear_carve(bd_carver *carver, bd_linear *lin, const bd_model *model) {
  const bd_layout *lay = &model->lay;
  const bd_linear_kernels *ring = ring_kernels(model);
  const int width = ring->width, rows = (lay->n + width - 1) / width, np = lay->np;
  bd_tangent *t = &lin->tangent;
  bd_blocks *b = &lin->blocks;
  double **by_link[] = {&t->end_x, &t->end_y, &t->cos, &t->sin, &t->spin, &t->pull, &b->xx,
                        &b->xy,    &b->yx,    &b->yy,  &b->pp,  &lin->x,  &lin->y,  &lin->p};
  for (size_t k = 0; k < sizeof by_link / sizeof by_link[0]; ++k) {
    carve_links(carver, lay, by_link[k]);
  }
  BD_CARVE(carver, lin->touch, np);
  for (int j = 0; j < np; ++j) {
    bd_touch none, *touch = carver->base ? &lin->touch[j] : &none;
    double **fields[] = {&touch->nx,    &touch->ny,       &touch->rho,      &touch->normal,
                         &touch->bend,  &touch->mu,       &touch->stiff,    &touch->damp,
                         &touch->cross, &touch->apart,    &touch->gain,     &touch->decay,
                         &touch->xx,    &touch->xy,       &touch->yx,       &touch->yy,
                         &touch->by_mu, &touch->torque_x, &touch->torque_y, &touch->row_x,
                         &touch->row_y, &touch->slide_x,  &touch->slide_y,  &touch->rise,
                         &touch->keep,  &touch->ahead};
    for (size_t k = 0; k < sizeof fields / sizeof fields[0]; ++k) {
      carve_links(carver, lay, fields[k]);
    }
  }
  BD_CARVE(carver, lin->ring.base, width);
  BD_CARVE(carver, lin->ring.shorter, width);
  lin->ring.rows = bd_carve(carver, (size_t)rows, ring->ring_row);
  lin->ring.ends = bd_carve(carver, 1, ring->ring_ends);
  double *scratch;
  BD_CARVE(carver, scratch, 3 * width * rows);
  lin->ring.scratch = scratch;
  BD_CARVE(carver, lin->border, 3 * np * lay->stride);
  BD_CARVE(carver, lin->drums, np);
  BD_CARVE(carver, lin->n_runs, np);
  BD_CARVE(carver, lin->runs, np * (lay->n8 / BD_LANES));
  BD_CARVE(carver, lin->own, np);
  BD_CARVE(carver, lin->rhs, np);
  BD_CARVE(carver, lin->matrix, np * np);
  BD_CARVE(carver, lin->pivots, np);
  BD_CARVE(carver, lin->by_theta, np * np);
  BD_CARVE(carver, lin->by_omega, np * np);
  BD_CARVE(carver, lin->slope, np);
  BD_CARVE(carver, lin->torque, np);
  if (!carver->base) {
    return;
  }
  lin->ring.n_rows = rows;
  lin->ring_kernels = ring;
  const int whole = lay->n - width * (rows - 1); /* arcs of `rows` links; the rest have one less */
  for (int a = 0, first = 0; a < width; ++a) {
    int shorter = a >= whole;
    lin->ring.base[a] = first - shorter;
    lin->ring.shorter[a] = shorter;
    first += rows - shorter;
  }
  b->cos = t->cos;
  b->sin = t->sin;
  b->spin = t->spin;
}

/* --- linearisation --------------------------------------------------------------------------- */

/* The links that could touch a pulley when the model was linearised: a later list may be another.
 */
static bd_run *runs_of(const bd_linear *lin, const bd_layout *lay, int j) {
  return lin->runs + j * (lay->n8 / BD_LANES);
}

void bd_linear_look_ahead(bd_linear *lin, bd_plan *plan, const double *y, double h) {
  const bd_layout *lay = &plan->model->lay;
  for (int j = 0; j < lay->np; ++j) {
    plan->kernels->linear->keep_contact(&plan->links, &lin->drums[j], lin->n_runs[j],
                                        runs_of(lin, lay, j), y, &lin->touch[j], plan->friction_on,
                                        h);
  }
}

void bd_linear_add_ahead(const bd_linear *lin, const bd_plan *plan, double *c) {
  const bd_layout *lay = &plan->model->lay;
  for (int j = 0; j < lay->np; ++j) {
    double torque = plan->kernels->linear->add_ahead(&plan->links, lin->n_runs[j],
                                                     runs_of(lin, lay, j), &lin->touch[j], c);
    c[lay->omega + j] += plan->held ? 0.0 : torque / plan->model->inertia[j];
  }
}

void bd_linearise(bd_linear *lin, const bd_plan *plan, const double *y) {
  const bd_layout *lay = &plan->model->lay;
  plan->kernels->linear->keep_joints(&plan->links, y, &lin->tangent);
  for (int j = 0; j < lay->np; ++j) {
    lin->drums[j] = plan->drums[j];
    lin->drums[j].omega = y[lay->omega + j];
    lin->n_runs[j] = plan->search.n_runs[j];
    memcpy(runs_of(lin, lay, j), plan->search.runs + j * plan->search.max_runs,
           (size_t)lin->n_runs[j] * sizeof *lin->runs);
  }
}

/* --- factorisation --------------------------------------------------------------------------- */

/* Of the pulleys' small matrix: with pivots, whose reciprocals are kept, in place, by rows. */
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

/* The part of a pulley's column that the ring takes: T^-1 B, three blocks. */
static double *border_of(const bd_linear *lin, const bd_layout *lay, int j) {
  return lin->border + (size_t)(3 * j) * (size_t)lay->stride + BD_HALO;
}

void bd_linear_factor(bd_linear *lin, bd_plan *plan, double g) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const bd_links *links = &plan->links;
  const bd_linear_kernels *kernels = plan->kernels->linear;
  bd_blocks *b = &lin->blocks;
  double inv_half = 1.0 / links->half;
  lin->stage.g = g;
  lin->stage.mass = model->info.link_mass * (1.0 + g * plan->bath);
  b->k = g * (g * links->stiffness + links->damping);
  b->damping = g * g * links->damping;
  b->bend = g * (g * links->bending + links->bending_damping) * inv_half * inv_half;
  kernels->diagonal(links, &lin->tangent, &lin->stage, b);
  for (int j = 0; j < lay->np; ++j) {
    double *z = border_of(lin, lay, j);
    memset(z, 0, (size_t)(3 * lay->stride - BD_HALO) * sizeof *z);
    lin->own[j] = kernels->add_contact(&lin->drums[j], lin->n_runs[j], runs_of(lin, lay, j),
                                       &lin->touch[j], g, b, z, z + lay->stride);
  }
  lin->ring_kernels->factor(&lin->ring, b);
  const int np = plan->held ? 0 : lay->np;
  for (int j = 0; j < np; ++j) {
    double *z = border_of(lin, lay, j);
    lin->ring_kernels->solve(&lin->ring, b->k, z, z + lay->stride, z + 2 * lay->stride);
    for (int i = 0; i < np; ++i) {
      double inertia = i == j ? model->inertia[i] * (1.0 + g * plan->bath) + lin->own[i] : 0.0;
      double torque = lin->by_omega[i * np + j] + g * lin->by_theta[i * np + j];
      lin->matrix[i * np + j] = inertia - g * torque -
                                kernels->border_row(lin->n_runs[i], runs_of(lin, lay, i),
                                                    &lin->touch[i], z, z + lay->stride);
    }
  }
  decompose(np, lin->matrix, lin->pivots);
}

/* --- solve ----------------------------------------------------------------------------------- */

void bd_linear_solve(bd_linear *lin, bd_plan *plan, double *c) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const bd_links *links = &plan->links;
  const bd_linear_kernels *kernels = plan->kernels->linear;
  const double g = lin->stage.g;
  const int np = plan->held ? 0 : lay->np;
  double *x = lin->x, *y = lin->y, *p = lin->p, *rhs = lin->rhs;
  kernels->joints_product(links, &lin->tangent, &lin->stage, c, x, y, p);
  for (int j = 0; j < lay->np; ++j) {
    rhs[j] = kernels->contact_product(lay, &lin->drums[j], lin->n_runs[j], runs_of(lin, lay, j),
                                      &lin->touch[j], plan->friction_on, c, x, y);
  }
  lin->ring_kernels->solve(&lin->ring, lin->blocks.k, x, y, p);
  for (int j = 0; j < np; ++j) {
    rhs[j] += g * model->inertia[j] * c[lay->omega + j];
    for (int k = 0; k < np; ++k) {
      rhs[j] += g * g * lin->by_theta[j * np + k] * c[lay->theta + k];
    }
    rhs[j] -= kernels->border_row(lin->n_runs[j], runs_of(lin, lay, j), &lin->touch[j], x, y);
  }
  substitute(np, lin->matrix, lin->pivots, rhs);
  kernels->finish_links(links, &lin->stage, np, border_of(lin, lay, 0), rhs, x, y, p, c);
  for (int j = 0; j < lay->np; ++j) {
    double spin_up = plan->held ? 0.0 : rhs[j];
    c[lay->theta + j] = plan->held ? 0.0 : g * (c[lay->theta + j] + spin_up);
    c[lay->omega + j] = spin_up;
    if (plan->friction_on) {
      kernels->finish_contact(lay, &lin->drums[j], lin->n_runs[j], runs_of(lin, lay, j),
                              &lin->touch[j], g, spin_up, c);
    }
  }
  for (int k = 0; k < N_WORK; ++k) {
    c[lay->work + k] = 0.0; /* the ledger follows the steps (implicit.c) */
  }
}
