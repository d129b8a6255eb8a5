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
 * link is that of its end, half its length times phi, so that all blocks are masses.
 *
 * Bodies of one degree of freedom are the shafts, one of each pulley, and after them the mounts
 * (mount_border.c). One whose motion is prescribed has k_v = b_v for its row, and acts on the rest
 * by its column as any other.
 *
 * Joint on the left of link i, e = (cos, sin) of its direction, e' across it, S = [1, -e'] at its
 * left and R = [1, e'] at its right end (MODEL section 2): g df = D^S_i k_i - D^R_l k_l with
 * D^S = [K 1 | q], D^R = [K 1 | -q], K = g^2 c + g b, q = -K e' + g^2 b w e (the end turns with w);
 * forces -S^T f on link i and R^T f on link l; and the pull of both joints turns a link back.
 *
 * Contact in the axes (n, t) of a link on its pulley (MODEL sections 3, 4): dN = -k_n dr_n - b dv_n
 * - (b v_t / rho) dr_t while pressed; of the friction force dF = F_N dN + F_z dz + F_v dv_T, by the
 * law's slopes (friction/laws.h); dF_n = dN + (F / rho) dr_t, dF_t = (N / rho) dr_t - dF, dv_T =
 * dv_t
 * - (v_n / rho) dr_t - omega dr_n - rho d omega, dtau = rho dF + F dr_n. With k_z put in, F_N and
 * F_v stand for F_N + F_z g gain_N / (1 + g decay) and F_v + F_z g gain / (1 + g decay). Kinks
 * (touching, pressed, those of the law) are taken as they stand at the state that is linearised.
 *
 * Guarded by tests/test_jacobian.py: differences of the right-hand side, of the oracle's, on both
 * sides of every kink; solves against dense ones.
 */
#include <math.h>
#include <string.h>

#include "solvers/solvers.h"

/* A ring too short for the level's arcs is solved with two: the cyclic reduction of separators that
 * few links hold apart would cost digits where links weigh little against their joints. */
static const bd_newton_kernels *ring_kernels(const bd_model *model) {
  const bd_newton_kernels *best = model->kernels->newton;
  return model->lay.n >= 4 * best->width ? best
         : model->lay.string             ? &bd_newton_string_baseline
                                         : &bd_newton_baseline;
}

/* A law that is not general shares two arrays, and has no part of others; of states there are as
 * many rows as the law has. */
static void carve_contact(bd_carver *carver, const bd_layout *lay, bd_contact_tangent *contact,
                          const bd_friction *friction) {
  const int general = bd_law_is_general(friction->law), states = bd_friction_states(friction);
  double **const fields[] = {&contact->nx,
                             &contact->ny,
                             &contact->rho,
                             &contact->normal,
                             &contact->mu,
                             &contact->stiff,
                             &contact->damp,
                             &contact->normal_over_rho,
                             &contact->cross,
                             &contact->apart,
                             &contact->xx,
                             &contact->xy,
                             &contact->yx,
                             &contact->yy,
                             &contact->torque_x,
                             &contact->torque_y,
                             &contact->row_x,
                             &contact->row_y,
                             &contact->slide_x,
                             &contact->slide_y,
                             &contact->normal_correction};
  double **const of_states[] = {&contact->gain, &contact->decay, &contact->by_given_state,
                                &contact->state_by_slip, &contact->decay_factor};
  double **const more[] = {&contact->by_state, &contact->gain_normal, &contact->state_by_normal};
  for (size_t k = 0; k < sizeof fields / sizeof fields[0]; ++k) {
    bd_carve_links(carver, lay, fields[k]);
  }
  for (size_t k = 0; k < sizeof of_states / sizeof of_states[0]; ++k) {
    bd_carve_rows(carver, lay, states, of_states[k]);
  }
  if (general) {
    bd_carve_links(carver, lay, &contact->by_normal);
    bd_carve_links(carver, lay, &contact->by_slip);
  } else {
    contact->by_normal = contact->mu;
    contact->by_state = contact->normal;
  }
  for (size_t k = 0; general && k < sizeof more / sizeof more[0]; ++k) {
    bd_carve_rows(carver, lay, states, more[k]);
  }
}

static void carve_all(bd_carver *carver, const bd_layout *lay, double **const *arrays, size_t n) {
  for (size_t k = 0; k < n; ++k) {
    bd_carve_links(carver, lay, arrays[k]);
  }
}

/* The same of contact along the links. */
static void carve_links(bd_carver *carver, const bd_layout *lay, bd_link_tangent *t,
                        const bd_friction *friction) {
  const int states = bd_friction_states(friction);
  double **const single[] = {&t->joint_nx, &t->joint_ny, &t->rho,  &t->force,    &t->force_over_rho,
                             &t->apart,    &t->by_slip,  &t->slip, &t->by_normal};
  double **const of_states[] = {&t->by_state,    &t->gain,        &t->decay,
                                &t->gain_normal, &t->given_state, &t->state_by_slip,
                                &t->decay_factor};
  carve_all(carver, lay, single, sizeof single / sizeof single[0]);
  for (size_t k = 0; k < sizeof of_states / sizeof of_states[0]; ++k) {
    bd_carve_rows(carver, lay, states, of_states[k]);
  }
  for (int e = 0; e < 2; ++e) {
    double **const ends[] = {&t->nx[e],     &t->ny[e],        &t->normal[e], &t->normal_over_rho[e],
                             &t->around[e], &t->correction[e]};
    carve_all(carver, lay, ends, sizeof ends / sizeof ends[0]);
  }
  for (int m = 0; m < 8; ++m) {
    double **const by[] = {&t->by[m], &t->direct[m], &t->total[m]};
    carve_all(carver, lay, by, sizeof by / sizeof by[0]);
    bd_carve_rows(carver, lay, states, &t->gains[m]);
    bd_carve_rows(carver, lay, states, &t->state_by[m]);
  }
}

/* And what it needs once for all pulleys. */
static void carve_link_scratch(bd_carver *carver, const bd_layout *lay, bd_newton_system *system) {
  bd_link_scratch *s = &system->scratch;
  bd_blocks *b = &system->blocks;
  double **const single[] = {&system->points.x,
                             &system->points.y,
                             &system->points.vx,
                             &system->points.vy,
                             &s->turning,
                             &system->joint_x,
                             &system->joint_y,
                             &b->xp,
                             &b->yp,
                             &b->px,
                             &b->py};
  carve_all(carver, lay, single, sizeof single / sizeof single[0]);
  bd_carve_pressure(carver, lay, &s->pressure, &s->forces);
  for (int m = 0; m < 4; ++m) {
    bd_carve_links(carver, lay, &s->share_by[m]);
    bd_carve_links(carver, lay, &s->rate_by[m]);
  }
  for (int k = 0; k < 6; ++k) {
    bd_carve_links(carver, lay, &s->before[k]);
    bd_carve_links(carver, lay, &s->behind[k]);
  }
  for (int k = 0; k < 3; ++k) {
    bd_carve_links(carver, lay, &s->row_before[k]);
    bd_carve_links(carver, lay, &s->row_behind[k]);
  }
  for (int k = 0; k < 9; ++k) {
    bd_carve_links(carver, lay, &b->back[k]);
    bd_carve_links(carver, lay, &b->forward[k]);
  }
  BD_CARVE(carver, system->rows, 3 * (lay->np + lay->nm + lay->nc) * lay->stride);
  BD_CARVE(carver, system->mounts, lay->nm);
}

void bd_ring_carve(bd_carver *carver, bd_ring *ring, const bd_newton_kernels *kernels, int n) {
  const int width = kernels->width, rows = (n + width - 1) / width;
  BD_CARVE(carver, ring->base, width);
  BD_CARVE(carver, ring->shorter, width);
  ring->rows = bd_carve(carver, (size_t)rows, kernels->ring_row);
  ring->ends = bd_carve(carver, 1, kernels->ring_ends);
  double *scratch;
  BD_CARVE(carver, scratch, kernels->unknowns * width * rows);
  ring->scratch = scratch;
  if (!carver->base) {
    return;
  }
  ring->n_rows = rows;
  const int whole = n - width * (rows - 1); /* arcs of `rows` links; the rest have one less */
  for (int a = 0, first = 0; a < width; ++a) {
    int shorter = a >= whole;
    ring->base[a] = first - shorter;
    ring->shorter[a] = shorter;
    first += rows - shorter;
  }
}

void bd_newton_carve(bd_carver *carver, bd_newton_system *system, const bd_model *model) {
  const bd_layout *lay = &model->lay;
  const bd_newton_kernels *ring = ring_kernels(model);
  const int np = lay->np, bodies = np + lay->nm + lay->nc;
  bd_blocks *b = &system->blocks;
  bd_effects_carve_tangents(carver, &system->at, model);
  double **by_link[] = {&b->xx, &b->xy, &b->yx, &b->yy, &b->pp, &system->x, &system->y, &system->p};
  for (size_t k = 0; k < sizeof by_link / sizeof by_link[0]; ++k) {
    bd_carve_links(carver, lay, by_link[k]);
  }
  if (model->along_links) {
    BD_CARVE(carver, system->along, np);
    carve_link_scratch(carver, lay, system);
  } else {
    BD_CARVE(carver, system->contact, np);
  }
  for (int j = 0; j < np; ++j) {
    const bd_friction *friction = &model->friction[j];
    if (model->along_links) {
      carve_links(carver, lay, carver->base ? &system->along[j] : &(bd_link_tangent){0}, friction);
    } else {
      carve_contact(carver, lay, carver->base ? &system->contact[j] : &(bd_contact_tangent){0},
                    friction);
    }
  }
  bd_ring_carve(carver, &system->ring, ring, lay->n);
  BD_CARVE(carver, system->border, 3 * bodies * lay->stride);
  BD_CARVE(carver, system->own, np);
  BD_CARVE(carver, system->rhs, bodies);
  BD_CARVE(carver, system->matrix, bodies * bodies);
  BD_CARVE(carver, system->pivots, bodies);
  BD_CARVE(carver, system->by_theta, np * np);
  BD_CARVE(carver, system->by_omega, np * np);
  BD_CARVE(carver, system->by_time, np);
  if (!carver->base) {
    return;
  }
  system->ring_kernels = ring;
  b->cos = system->at.joints.cos;
  b->sin = system->at.joints.sin;
  b->spin = system->at.joints.spin;
}

/* --- linearisation --------------------------------------------------------------------------- */

/* The links that could contact a pulley when the model was linearised: a later list may be another.
 */
static bd_run *runs_of(const bd_newton_system *system, int j) {
  return system->at.runs + j * system->at.max_runs;
}

static int along_links(const bd_plan *plan) {
  return plan->model->along_links;
}

static int mount_of(const bd_plan *plan, int j) {
  return plan->model->mount_of ? plan->model->mount_of[j] : -1;
}

void bd_newton_linearise_contact(bd_newton_system *system, bd_plan *plan, double *y, double h) {
  const bd_newton_kernels *kernels = plan->kernels->newton;
  const bd_links *links = &plan->links;
  const bd_tangent *joints = &system->at.joints;
  if (along_links(plan)) {
    bd_close_links(&plan->model->lay, y);
    plan->kernels->gather_points(links, joints->cos, joints->sin, y, &system->points);
  }
  for (int j = 0; j < plan->model->lay.np; ++j) {
    const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
    const int n_runs = system->at.n_runs[j];
    if (along_links(plan)) {
      kernels->linearise_links[pulley->law](links, joints, pulley, n_runs, runs_of(system, j),
                                            &system->points, &system->scratch, y, &system->along[j],
                                            h);
    } else {
      kernels->linearise_contact[pulley->law](links, pulley, n_runs, runs_of(system, j), y,
                                              &system->contact[j], h);
    }
  }
}

void bd_newton_clear(const bd_layout *lay, double *const *blocks, size_t n) {
  for (size_t k = 0; k < n; ++k) {
    memset(blocks[k] - BD_HALO, 0, (size_t)lay->stride * sizeof **blocks);
  }
}

void bd_newton_add_normal_correction(const bd_newton_system *system, const bd_plan *plan,
                                     double *c) {
  const bd_layout *lay = &plan->model->lay;
  const bd_links *links = &plan->links;
  const bd_newton_kernels *kernels = plan->kernels->newton;
  const bd_end_forces *out = &system->scratch.forces;
  if (along_links(plan)) {
    bd_clear_end_forces(lay, out);
  }
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
    const int n_runs = system->at.n_runs[j], m = mount_of(plan, j);
    const bd_run *runs = runs_of(system, j);
    double before[2], after[2];
    if (m >= 0) {
      plan->kernels->sum_forces(n_runs, runs, out, before);
    }
    double torque =
        along_links(plan)
            ? kernels->add_link_correction(links, pulley, n_runs, runs, &system->along[j], out, c)
            : kernels->add_normal_correction[bd_law_form(pulley->law)](links, pulley, n_runs, runs,
                                                                       &system->contact[j], c);
    c[lay->rim[j]] += plan->pulleys_locked ? 0.0 : torque / plan->model->rim_inertia[j];
    if (m >= 0 && plan->model->mounts[m].kind != BD_MOUNT_PATH) {
      const double *a = system->at.mounts[m].at.a;
      plan->kernels->sum_forces(n_runs, runs, out, after);
      c[lay->travel_speed + m] -=
          (a[0] * (after[0] - before[0]) + a[1] * (after[1] - before[1])) / plan->mount_inertia[m];
    }
  }
  if (along_links(plan)) {
    plan->kernels->scatter_forces(links, system->at.joints.cos, system->at.joints.sin, out, c);
  }
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
  return plan->pulleys_locked ? lay->nm : lay->np + lay->nm + lay->nc;
}

static int is_mount(const bd_layout *lay, int body) {
  return body >= lay->np && body < lay->np + lay->nm;
}

static int is_prescribed(const bd_plan *plan, int body) {
  const int np = plan->model->lay.np;
  return body < np ? bd_is_moved(&plan->torques, body)
                   : is_mount(&plan->model->lay, body) &&
                         plan->model->mounts[body - np].kind == BD_MOUNT_PATH;
}

/* The pulley at which the belt runs on this body, which is no mount; -1: it does not. */
static int pulley_of(const bd_layout *lay, int body) {
  const int j = body < lay->np ? body : lay->coupled[body - lay->np - lay->nm];
  return bd_belt_body(lay, j) == body ? j : -1;
}

/* The inertia of a shaft or a rim, and what its own acceleration does to the forces on it. */
static double body_inertia(const bd_newton_system *system, const bd_plan *plan, int body,
                           double g) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const int shaft = body < lay->np, j = pulley_of(lay, body);
  double inertia =
      (shaft ? model->inertia[body] : model->couplings[body - lay->np - lay->nm].inertia) *
          (1.0 + g * system->at.mass_damping) +
      (j >= 0 ? system->own[j] : 0.0);
  if (shaft && system->at.pulley_damping) {
    inertia += g * system->at.pulley_damping[body];
  }
  return inertia;
}

/* A body's row times the velocities of the links. */
static double body_row(const bd_newton_system *system, const bd_plan *plan, int body,
                       const double *x, const double *y, const double *p) {
  const bd_layout *lay = &plan->model->lay;
  const int j = is_mount(lay, body) ? body : pulley_of(lay, body);
  if (j < 0) {
    return 0.0;
  }
  if (along_links(plan)) {
    const double *row = system->rows + (size_t)(3 * body) * (size_t)lay->stride + BD_HALO;
    const double *const parts[3] = {row, row + lay->stride, row + 2 * lay->stride};
    return plan->kernels->newton->ring_product(lay, parts, x, y, p);
  }
  return plan->kernels->newton->border_row(system->at.n_runs[j], runs_of(system, j),
                                           &system->contact[j], x, y);
}

/* The part of a body's column that the ring takes: T^-1 B, three blocks. */
static double *border_of(const bd_newton_system *system, const bd_layout *lay, int body) {
  return system->border + (size_t)(3 * body) * (size_t)lay->stride + BD_HALO;
}

/* Of the small matrix of the bodies, but for what the links do. */
static double body_entry(const bd_newton_system *system, const bd_plan *plan, int i, int j,
                         double g) {
  const bd_layout *lay = &plan->model->lay;
  const int np = lay->np;
  if (is_mount(lay, i) || is_mount(lay, j)) {
    return bd_mount_entry(system, plan, i, j, g);
  }
  const int shafts = i < np && j < np;
  const double torque =
      shafts ? system->by_omega[i * np + j] + g * system->by_theta[i * np + j] : 0.0;
  return (i == j ? body_inertia(system, plan, i, g) : 0.0) - g * torque +
         (lay->nc > 0 ? bd_coupling_entry(&system->at, plan->model, i, j, g) : 0.0);
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

/* Contact along the links, into the matrix and its border. */
static void add_along_links(bd_newton_system *system, const bd_plan *plan, double g) {
  const bd_layout *lay = &plan->model->lay;
  const bd_links *links = &plan->links;
  const bd_newton_kernels *kernels = plan->kernels->newton;
  const bd_tangent *joints = &system->at.joints;
  const bd_link_scratch *scratch = &system->scratch;
  const bd_blocks *b = &system->blocks;
  bd_newton_clear(lay, (double *const[]){b->xp, b->yp, b->px, b->py}, 4);
  bd_newton_clear(lay, scratch->before, 6);
  bd_newton_clear(lay, scratch->behind, 6);
  bd_clear_end_forces(lay, &scratch->forces);
  for (int j = 0; j < lay->np; ++j) {
    const int body = bd_belt_body(lay, j);
    double *z = border_of(system, lay, body);
    double *row = system->rows + (size_t)(3 * body) * (size_t)lay->stride + BD_HALO;
    bd_newton_clear(lay, (double *const[]){system->joint_x, system->joint_y}, 2);
    bd_newton_clear(lay, scratch->row_before, 3);
    bd_newton_clear(lay, scratch->row_behind, 3);
    system->own[j] = kernels->add_links(links, joints, &system->at.contact_pulleys[j],
                                        system->at.n_runs[j], runs_of(system, j), &system->along[j],
                                        g, b, scratch, system->joint_x, system->joint_y, row);
    kernels->joints_to_links(links, joints, system->joint_x, system->joint_y, z, z + lay->stride,
                             z + 2 * lay->stride);
    if (mount_of(plan, j) >= 0) {
      const int m = mount_of(plan, j);
      bd_mount_border_add(system, plan, m, g, border_of(system, lay, lay->np + m));
    }
  }
  kernels->assemble(links, joints, g, scratch, b);
}

void bd_newton_factor(bd_newton_system *system, bd_plan *plan, double g) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const bd_links *links = &plan->links;
  const bd_newton_kernels *kernels = plan->kernels->newton;
  bd_blocks *b = &system->blocks;
  double inv_half = 1.0 / links->half;
  system->stage.g = g;
  system->stage.mass = model->info.link_mass * (1.0 + g * system->at.mass_damping);
  system->stage.slender = 0.25 * model->shear;
  b->k = g * (g * links->stiffness + links->damping);
  b->damping = g * g * links->damping;
  b->bending = g * (g * links->bending + links->bending_damping) * inv_half * inv_half;
  kernels->diagonal(links, &system->at.joints, &system->stage, b);
  for (int body = 0; body < lay->np + lay->nm + lay->nc; ++body) {
    memset(border_of(system, lay, body), 0, (size_t)(3 * lay->stride - BD_HALO) * sizeof(double));
  }
  const int along = along_links(plan);
  if (along) {
    add_along_links(system, plan, g);
  }
  for (int j = 0; !along && j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
    double *z = border_of(system, lay, bd_belt_body(lay, j));
    system->own[j] = kernels->add_contact[bd_law_form(pulley->law)](
        pulley, system->at.n_runs[j], runs_of(system, j), &system->contact[j], g, b, z,
        z + lay->stride);
  }
  system->ring_kernels->factor[along](&system->ring, b);
  const int first = first_body(plan), n = count_bodies(plan);
  for (int j = 0; j < n; ++j) {
    double *z = border_of(system, lay, first + j);
    system->ring_kernels->solve[along](&system->ring, b->k, z, z + lay->stride,
                                       z + 2 * lay->stride);
    for (int i = 0; i < n; ++i) {
      if (is_prescribed(plan, first + i)) {
        system->matrix[i * n + j] = i == j;
        continue;
      }
      system->matrix[i * n + j] =
          body_entry(system, plan, first + i, first + j, g) -
          body_row(system, plan, first + i, z, z + lay->stride, z + 2 * lay->stride);
    }
  }
  decompose(n, system->matrix, system->pivots);
}

/* --- solve ----------------------------------------------------------------------------------- */

/* Of the right-hand side near a pulley, on links and at joints. */
static void sum_of(const bd_newton_system *system, const bd_plan *plan, int j, double sum[2]) {
  const bd_newton_kernels *kernels = plan->kernels->newton;
  const int n_runs = system->at.n_runs[j];
  const bd_run *runs = runs_of(system, j);
  sum[0] =
      kernels->sum_runs(n_runs, runs, system->x) + kernels->sum_runs(n_runs, runs, system->joint_x);
  sum[1] =
      kernels->sum_runs(n_runs, runs, system->y) + kernels->sum_runs(n_runs, runs, system->joint_y);
}

void bd_newton_solve(bd_newton_system *system, bd_plan *plan, double *c) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const bd_links *links = &plan->links;
  const bd_newton_kernels *kernels = plan->kernels->newton;
  const double g = system->stage.g;
  const int first = first_body(plan), n = count_bodies(plan);
  double *x = system->x, *y = system->y, *p = system->p, *rhs = system->rhs;
  kernels->joints_product(links, &system->at.joints, &system->stage, c, x, y, p);
  const bd_tangent *joints = &system->at.joints;
  const int along = along_links(plan);
  if (along) {
    bd_newton_clear(lay, (double *const[]){system->joint_x, system->joint_y}, 2);
    bd_close_links(lay, c);
  }
  memset(rhs, 0, (size_t)(lay->np + lay->nm + lay->nc) * sizeof *rhs);
  for (int j = 0; j < lay->np; ++j) {
    const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
    const int n_runs = system->at.n_runs[j], m = mount_of(plan, j);
    const bd_run *runs = runs_of(system, j);
    double before[2], given[2], *of_belt = &rhs[bd_belt_body(lay, j)];
    if (m >= 0) {
      sum_of(system, plan, j, before);
    }
    *of_belt =
        along ? kernels->link_product(links, joints, pulley, n_runs, runs, &system->along[j], g, c,
                                      system->joint_x, system->joint_y, x, y, p)
              : kernels->contact_product(lay, pulley, n_runs, runs, &system->contact[j], c, x, y);
    if (m >= 0) {
      sum_of(system, plan, j, given);
      given[0] -= before[0];
      given[1] -= before[1];
      bd_mount_product(system, plan, m, c, given, of_belt);
    }
  }
  if (lay->nc > 0 && !plan->pulleys_locked) {
    bd_coupling_product(&system->at, model, g, c, rhs);
  }
  if (along) {
    kernels->joints_to_links(links, joints, system->joint_x, system->joint_y, x, y, p);
    kernels->add_turning(lay, system->scratch.turning, g, c, p);
  }
  system->ring_kernels->solve[along](&system->ring, system->blocks.k, x, y, p);
  for (int body = first; body < first + n; ++body) {
    const int j = body < lay->np ? body : -1;
    if (is_prescribed(plan, body)) {
      rhs[body] = g * (j >= 0 ? c[lay->omega + j] : c[lay->travel_speed + body - lay->np]);
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
  kernels->finish_links(links, &system->stage, n, border_of(system, lay, first), rhs + first, x, y,
                        p, c);
  for (int m = 0; m < lay->nm; ++m) {
    bd_mount_finish(system, plan, m, rhs[lay->np + m], c);
  }
  if (lay->nc > 0 && !plan->pulleys_locked) {
    bd_coupling_finish(&system->at, model, g, rhs, c);
  }
  if (along) {
    bd_close_links(lay, c);
  }
  for (int j = 0; j < lay->np; ++j) {
    double angular_acceleration = plan->pulleys_locked ? 0.0 : rhs[j];
    c[lay->theta + j] = plan->pulleys_locked ? 0.0 : g * (c[lay->theta + j] + angular_acceleration);
    c[lay->omega + j] = angular_acceleration;
    angular_acceleration = plan->pulleys_locked ? 0.0 : rhs[bd_belt_body(lay, j)];
    const bd_contact_pulley *pulley = &system->at.contact_pulleys[j];
    if (pulley->law == BD_LAW_NONE) {
      continue;
    }
    const int n_runs = system->at.n_runs[j];
    if (along) {
      kernels->finish_joints(links, joints, pulley, n_runs, runs_of(system, j), &system->along[j],
                             g, angular_acceleration, c);
      if (mount_of(plan, j) >= 0) {
        bd_mount_finish_joints(system, plan, mount_of(plan, j), c);
      }
    } else {
      kernels->finish_contact[bd_law_form(pulley->law)](
          lay, pulley, n_runs, runs_of(system, j), &system->contact[j], g, angular_acceleration, c);
    }
  }
  for (int k = 0; k < lay->n_work; ++k) {
    c[lay->work + k] = 0.0; /* the ledger follows the steps (implicit.c) */
  }
}
