/* SPDX-License-Identifier: MIT
 *
 * What is reported of a state: joint deformation and force (MODEL section 2), contact (sections 3
 * and 4), and the energy ledger (section 7).
 */
#include <float.h>
#include <math.h>
#include <string.h>

#include "physics/physics.h"

/* Of a quantity, over its size, by the operations that lead to it: some 60 of half a unit. */
#define ROUNDING (32.0 * DBL_EPSILON)

/* Where a link's contact acts: its centre; or the joint on its left, where friction acts, of a
 * string the mass itself. */
typedef struct contact_point {
  double x, y, vx, vy;
} contact_point;

typedef struct touch {
  contact_point at;
  double share, rho, normal, mu, friction, slip, velocity;
} touch;

static contact_point point_of(const bd_plan *plan, const double *y, int i) {
  const bd_layout *lay = &plan->model->lay;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  if (!plan->model->along_links || lay->string) {
    return (contact_point){x[i], yy[i], vx[i], vy[i]};
  }
  const double *w = bd_cfield(lay, y, F_VPHI);
  const int l = i > 0 ? i - 1 : lay->n - 1;
  const double q = 0.5 * plan->links.half;
  const double c = plan->seen.cos[i], s = plan->seen.sin[i];
  const double cl = plan->seen.cos[l], sl = plan->seen.sin[l];
  return (contact_point){0.5 * (x[l] + x[i]) + q * (cl - c), 0.5 * (yy[l] + yy[i]) + q * (sl - s),
                         0.5 * (vx[l] + vx[i]) + q * (w[i] * s - w[l] * sl),
                         0.5 * (vy[l] + vy[i]) + q * (w[l] * cl - w[i] * c)};
}

/* Goes through the links listed near pulley j: the first one after i, -1 past the last; *run is 0
 * and i -1 at the beginning. */
static int next_near(const bd_plan *plan, int j, int *run, int i) {
  const bd_run *runs = plan->search.runs + j * plan->search.max_runs;
  for (++i; *run < plan->search.n_runs[j]; ++*run) {
    i = i > runs[*run].begin ? i : runs[*run].begin;
    if (i < runs[*run].end && i < plan->model->lay.n) {
      return i;
    }
  }
  return -1;
}

/* Before `touching`, for all links of a pulley; returns the energy stored along links. */
static double look_at(const bd_plan *plan, const double *y, int j) {
  if (!plan->model->along_links) {
    return 0.0;
  }
  if (j == 0) {
    bd_link_contact_see(plan, y);
  }
  return bd_link_contact_press(plan, y, j);
}

/* Whether link i, or its joint, is in contact with pulley j, and the share of it that is; of it the
 * normal force alone, */
static int pressing(const bd_plan *plan, const double *y, int i, int j, touch *out) {
  const bd_contact_pulley *d = &plan->contact_pulleys[j];
  const contact_point at = out->at = point_of(plan, y, i);
  if (plan->model->along_links) {
    const bd_pressure *p = &plan->pressure;
    out->share = p->share_left[i] + p->share_right[i - 1];
    out->normal = p->left[i] + p->right[i - 1];
    return out->share > 0.0;
  }
  const double dx = at.x - d->x, dy = at.y - d->y;
  const double rho = hypot(dx, dy), p = d->radius - rho;
  const double apart = (at.vx - d->vx) * (dx / rho) + (at.vy - d->vy) * (dy / rho);
  const double elastic = (d->quadratic * p + d->linear) * p;
  const double raw = elastic - (d->damping + d->hunt_crossley * elastic) * apart;
  out->share = p > 0.0 ? 1.0 : 0.0;
  out->normal = raw > 0.0 && p > 0.0 ? raw : 0.0;
  return p > 0.0;
}

/* or all of it. */
static int touching(const bd_plan *plan, const double *y, int i, int j, touch *out) {
  const bd_layout *lay = &plan->model->lay;
  const bd_contact_pulley *d = &plan->contact_pulleys[j];
  if (!pressing(plan, y, i, j, out)) {
    return 0;
  }
  const contact_point at = out->at;
  double dx = at.x - d->x, dy = at.y - d->y;
  out->rho = hypot(dx, dy);
  double nx = dx / out->rho, ny = dy / out->rho;
  double ux = at.vx - d->vx, uy = at.vy - d->vy;
  out->velocity = uy * nx - ux * ny - y[lay->rim[j]] * out->rho;
  const int friction = d->law != BD_LAW_NONE;
  const double *states = bd_cfield(lay, y, bd_f_state(lay, d->slot)) + i;
  double z = d->states > 0 ? states[0] : 0.0;
  z = z > d->bound ? d->bound : z < -d->bound ? -d->bound : z;
  out->mu = z;
  out->friction = z * out->normal;
  if (bd_law_is_general(d->law)) {
    bd_law_point point;
    double force = 0.0;
    for (int e = 0; e < (d->states > 0 ? d->states : 1); ++e) {
      bd_friction_at(plan->model, j, e, e == 0 ? z : states[e * lay->stride], out->velocity,
                     out->normal / out->share, &point);
      force = e == 0 ? point.force : force + point.force;
    }
    out->friction = out->share * force;
    out->mu = out->normal > 0.0 ? out->friction / out->normal : 0.0;
  }
  out->slip = friction ? bd_cfield(lay, y, bd_f_slip(lay, d->slot))[i] : 0.0;
  return 1;
}

/* Stretch of a joint, the rate of that, its square with what is across, and the angle. */
typedef struct joint {
  double along, rate, squared, turn;
} joint;

/* Of the joint on the left of link i, along the mean direction of its links; of a string of the bar
 * between mass i - 1 and mass i, along its chord. */
static joint joint_state(const bd_plan *plan, const double *y, int i) {
  const bd_layout *lay = &plan->model->lay;
  const double half = plan->links.half;
  const int l = i > 0 ? i - 1 : lay->n - 1;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  if (lay->string) {
    const double bx = x[i] - x[l], by = yy[i] - yy[l], length = hypot(bx, by);
    const double along = length - 2.0 * half;
    const double rate = ((vx[i] - vx[l]) * bx + (vy[i] - vy[l]) * by) / length;
    return (joint){along, rate, along * along, 0.0};
  }
  const double *phi = bd_cfield(lay, y, F_PHI), *w = bd_cfield(lay, y, F_VPHI);
  double ci = cos(phi[i]), si = sin(phi[i]), cl = cos(phi[l]), sl = sin(phi[l]);
  double dx = x[i] - x[l] - half * (ci + cl), dy = yy[i] - yy[l] - half * (si + sl);
  double du = vx[i] - vx[l] + half * (si * w[i] + sl * w[l]);
  double dv = vy[i] - vy[l] - half * (ci * w[i] + cl * w[l]);
  double ex = ci + cl, ey = si + sl, norm = hypot(ex, ey);
  /* two links folded back on each other have no mean direction; take the right one's */
  ex = norm > 1e-12 ? ex / norm : ci;
  ey = norm > 1e-12 ? ey / norm : si;
  return (joint){.along = dx * ex + dy * ey,
                 .rate = du * ex + dv * ey,
                 .squared = dx * dx + dy * dy,
                 .turn = phi[i] - phi[l] + (i > 0 ? 0.0 : plan->links.wind)};
}

double bd_joint_force(const bd_plan *plan, const double *y, int i) {
  const joint at = joint_state(plan, y, i);
  return plan->links.stiffness * at.along + plan->links.damping * at.rate;
}

double bd_mean_force(const bd_plan *plan, const double *y) {
  const int n = plan->model->lay.n;
  double total = 0.0;
  for (int i = 0; i < n; ++i) {
    total += bd_joint_force(plan, y, i);
  }
  return total / n;
}

void bd_energy_of_joints(const bd_plan *plan, const double *y, double terms[BD_N_ENERGY]) {
  for (int i = 0; i < plan->model->lay.n; ++i) {
    const joint at = joint_state(plan, y, i);
    terms[BD_ENERGY_axial] += 0.5 * plan->links.stiffness * at.squared;
    terms[BD_ENERGY_bending] += 0.5 * plan->links.bending * at.turn * at.turn;
  }
}

void bd_energy_of_gravity(const bd_plan *plan, const double *y, double terms[BD_N_ENERGY]) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  for (int i = 0; i < lay->n; ++i) {
    terms[BD_ENERGY_gravity] -=
        model->info.link_mass * (model->gravity[0] * (x[i] + model->origin[0]) +
                                 model->gravity[1] * (yy[i] + model->origin[1]));
  }
}

static double stored_by(const bd_contact_pulley *d, double p) {
  return p * p * (d->quadratic * p / 3.0 + d->linear / 2.0);
}

int bd_add_contact_energy(const bd_plan *plan, const double *y, int j, double *energy) {
  const bd_layout *lay = &plan->model->lay;
  const bd_contact_pulley *d = &plan->contact_pulleys[j];
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  if (plan->model->along_links) {
    const double stored = look_at(plan, y, j);
    *energy += stored;
    return stored > 0.0;
  }
  int touched = 0;
  for (int r = 0, i = -1; (i = next_near(plan, j, &r, i)) >= 0;) {
    const double dx = x[i] - d->x, dy = yy[i] - d->y, rho2 = dx * dx + dy * dy;
    if (rho2 < d->radius * d->radius) {
      *energy += stored_by(d, d->radius - sqrt(rho2));
      touched = 1;
    }
  }
  return touched;
}

void bd_energy_of_contact(const bd_plan *plan, const double *y, double terms[BD_N_ENERGY]) {
  for (int j = 0; j < plan->model->lay.np; ++j) {
    if (plan->model->along_links) {
      bd_add_contact_energy(plan, y, j, &terms[BD_ENERGY_contact]);
      continue;
    }
    for (int r = 0, i = -1; (i = next_near(plan, j, &r, i)) >= 0;) {
      const bd_contact_pulley *d = &plan->contact_pulleys[j];
      touch c;
      if (touching(plan, y, i, j, &c)) {
        terms[BD_ENERGY_contact] += stored_by(d, d->radius - c.rho);
      }
    }
  }
}

double bd_friction_torque(const bd_plan *plan, const double *y, int j, double force[2]) {
  const bd_contact_pulley *d = &plan->contact_pulleys[j];
  const int along = plan->model->along_links;
  double unused[2], sum = 0.0;
  force = force ? force : unused;
  if (along) {
    bd_link_contact_see(plan, y);
    bd_clear_end_forces(&plan->model->lay, &plan->forces);
    bd_link_contact_press(plan, y, j);
  }
  force[0] = force[1] = 0.0;
  for (int r = 0, i = -1; along && (i = next_near(plan, j, &r, i)) >= 0;) {
    force[0] += plan->forces.left_x[i] + plan->forces.right_x[i];
    force[1] += plan->forces.left_y[i] + plan->forces.right_y[i];
  }
  for (int r = 0, i = -1; (i = next_near(plan, j, &r, i)) >= 0;) {
    touch c;
    if (touching(plan, y, i, j, &c)) {
      const double nx = (c.at.x - d->x) / c.rho, ny = (c.at.y - d->y) / c.rho;
      const double normal = along ? 0.0 : c.normal; /* along links at their ends, as above */
      sum += c.friction * c.rho;
      force[0] += normal * nx + c.friction * ny;
      force[1] += normal * ny - c.friction * nx;
    }
  }
  return sum;
}

/* What the friction of link i changes by where its slip velocity and its normal force, over its
 * share in contact, are off by so much. */
static double friction_shift(const bd_plan *plan, const double *y, int i, int j, const touch *c,
                             double dv, double dn) {
  const bd_layout *lay = &plan->model->lay;
  const bd_contact_pulley *d = &plan->contact_pulleys[j];
  const double *states = bd_cfield(lay, y, bd_f_state(lay, d->slot)) + i;
  if (!bd_law_is_general(d->law)) {
    return fabs(c->mu) * dn;
  }
  double sum = 0.0;
  for (int e = 0; e < (d->states > 0 ? d->states : 1); ++e) {
    const double z = d->states > 0 ? states[e * lay->stride] : 0.0, mean = c->normal / c->share;
    bd_law_point at, moved;
    double most = 0.0;
    bd_friction_at(plan->model, j, e, z, c->velocity, mean, &at);
    for (int corner = 0; corner < 4; ++corner) {
      bd_friction_at(plan->model, j, e, z, c->velocity + (corner & 1 ? dv : -dv),
                     fmax(0.0, mean + (corner & 2 ? dn : -dn)), &moved);
      most = fmax(most, fabs(moved.force - at.force));
    }
    sum += most + ROUNDING * (fabs(at.force) + fabs(at.by_state * z));
  }
  return c->share * sum;
}

bd_contact_rounding bd_contact_rounding_of(const bd_plan *plan, const double *y, int j) {
  const bd_layout *lay = &plan->model->lay;
  const bd_contact_pulley *d = &plan->contact_pulleys[j];
  const double *w = lay->string ? NULL : bd_cfield(lay, y, F_VPHI);
  const int along = plan->model->along_links;
  bd_contact_rounding out = {.least = -1};
  if (along) {
    bd_link_contact_see(plan, y);
    bd_link_contact_press(plan, y, j);
  }
  for (int r = 0, i = -1; (i = next_near(plan, j, &r, i)) >= 0;) {
    touch c;
    if (!touching(plan, y, i, j, &c)) {
      continue;
    }
    const double least =
        along ? fmin(plan->pressure.left[i], plan->pressure.right[i - 1]) : c.normal;
    /* of places and velocities, before differences of them are taken; and of directions */
    const double off =
        ROUNDING * (fabs(c.at.x) + fabs(c.at.y) + fabs(d->x) + fabs(d->y) + 2.0 * plan->links.half);
    const double speed = fabs(c.at.vx) + fabs(c.at.vy) + fabs(d->vx) + fabs(d->vy) +
                         fabs(y[lay->rim[j]]) * c.rho +
                         (w ? 2.0 * plan->links.half * fabs(w[i]) : 0.0);
    const double dv = speed * (ROUNDING + off / c.rho);
    const double p = fmax(0.0, d->radius - c.rho), elastic = (d->quadratic * p + d->linear) * p;
    /* along links normal forces are those of the same loops */
    const double dn =
        along ? 0.0
              : (2.0 * d->quadratic * p + d->linear) * (1.0 + d->hunt_crossley * speed) * off +
                    (d->damping + d->hunt_crossley * elastic) * dv;
    out.magnitude += c.normal + fabs(c.friction) + elastic;
    out.shift += dn + friction_shift(plan, y, i, j, &c, dv, dn) +
                 (ROUNDING + off / c.rho) * (c.normal + fabs(c.friction));
    if (out.least < 0 || !(least >= out.least_normal)) {
      out.least_normal = least;
      out.least = i;
    }
  }
  return out;
}

static double kinetic_energy(const bd_model *model, const double *y) {
  const bd_layout *lay = &model->lay;
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *w = lay->string ? NULL : bd_cfield(lay, y, F_VPHI);
  const double m = model->info.link_mass, inertia = model->info.link_inertia;
  double sum = 0.0;
  for (int i = 0; i < lay->n; ++i) {
    const double spin = w ? w[i] : 0.0;
    sum += 0.5 * m * (vx[i] * vx[i] + vy[i] * vy[i]) + 0.5 * inertia * spin * spin;
  }
  for (int j = 0; j < lay->np; ++j) {
    double omega = y[lay->omega + j];
    sum += 0.5 * model->inertia[j] * omega * omega;
  }
  return sum;
}

enum { IS_STORED, IS_SUPPLIED, IS_LOST, IS_CHECK };

/* Of every work integral, its column of the ledger. */
static const int column_of[MAX_WORK] = {
#define X(name, kind, text) BD_WORK_##kind([W_##name] = BD_ENERGY_##name, )
    BD_ENERGY_TERMS(X)
#undef X
};

static const int is_stored[BD_N_ENERGY] = {
#define X(name, kind, text) [BD_ENERGY_##name] = IS_##kind == IS_STORED,
    BD_ENERGY_TERMS(X)
#undef X
};

int bd_model_energy_terms(const bd_model *model, int *terms) {
  const bd_effect *effects[BD_MAX_EFFECTS];
  const int n_effects = bd_effects_of(model, &(bd_plan_options){.friction = 1}, effects);
  int n = 0;
  for (int c = 0; c < BD_N_ENERGY; ++c) {
    int has = c <= BD_ENERGY_residual;
    for (int e = 0; e < n_effects; ++e) {
      has |= effects[e]->store > 0 && effects[e]->store == c;
      for (int k = 0; k < effects[e]->n_works; ++k) {
        has |= column_of[effects[e]->works[k].row] == c;
      }
    }
    if (has && terms) {
      terms[n] = c;
    }
    n += has;
  }
  return n;
}

double bd_energy(const bd_plan *plan, const double *y, double terms[BD_N_ENERGY]) {
  double stored = 0.0;
  memset(terms, 0, BD_N_ENERGY * sizeof *terms);
  bd_mounts_put(plan, y);
  terms[BD_ENERGY_kinetic] = kinetic_energy(plan->model, y);
  for (int e = 0; e < plan->n_effects; ++e) {
    const bd_effect *effect = plan->effects[e];
    if (effect->energy) {
      effect->energy(plan, y, terms);
    }
    for (int k = 0; k < effect->n_works; ++k) {
      const int work = effect->works[k].row;
      terms[column_of[work]] = y[plan->model->lay.work + work];
    }
  }
  for (int c = 0; c < BD_N_ENERGY; ++c) {
    stored += is_stored[c] ? terms[c] : 0.0;
  }
  return stored;
}

double bd_losses(const bd_layout *lay, const double *y) {
  double sum = 0.0;
  for (int k = W_drive + 1; k < lay->n_work; ++k) {
    sum += y[lay->work + k];
  }
  return sum;
}

static void put(double *to, size_t k, int width, const double *from, double shift) {
  for (int i = 0; to && i < width; ++i) {
    to[k * (size_t)width + (size_t)i] = from[i] + shift;
  }
}

void bd_outputs_of_joints(bd_plan *plan, const double *y, const bd_output *out, size_t k) {
  int n = plan->model->lay.n;
  for (int i = 0; (out->deformation || out->force) && i < n; ++i) {
    const joint at = joint_state(plan, y, i);
    const size_t place = k * (size_t)n + (size_t)i;
    if (out->deformation) {
      out->deformation[place] = at.along;
    }
    if (out->force) {
      out->force[place] = plan->links.stiffness * at.along + plan->links.damping * at.rate;
    }
  }
}

/* After plan->touched. */
static void outputs_of_spans(bd_plan *plan, const double *y, double *row) {
  const bd_layout *lay = &plan->model->lay;
  for (int i = 0; i < lay->n; ++i) {
    plan->best[i] = bd_joint_force(plan, y, i);
  }
  bd_span_tension(lay->n, plan->touched, plan->best, lay->np, row);
}

/* After plan->touched. Of a mass of a string, across the bar behind it. */
static double across(const bd_plan *plan, const double *y) {
  const bd_layout *lay = &plan->model->lay;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *phi = lay->string ? NULL : bd_cfield(lay, y, F_PHI);
  double sum = 0.0;
  for (int i = 0; i < lay->n; ++i) {
    if (plan->touched[i] >= 0) {
      continue;
    }
    double c, s;
    if (phi) {
      c = cos(phi[i]);
      s = sin(phi[i]);
    } else {
      const int next = i + 1 < lay->n ? i + 1 : 0;
      const double dx = x[next] - x[i], dy = yy[next] - yy[i], length = hypot(dx, dy);
      c = dx / length;
      s = dy / length;
    }
    const double v = vy[i] * c - vx[i] * s;
    sum += v * v;
  }
  return sum / lay->n;
}

/* Of every pulley, also where one link touches two of them. */
static void outputs_of_loads(const bd_plan *plan, const double *y, double *row) {
  for (int j = 0; j < plan->model->lay.np; ++j) {
    double force[2];
    bd_friction_torque(plan, y, j, force);
    row[2 * j] = -force[0];
    row[2 * j + 1] = -force[1];
  }
}

/* Newton's matrix divides what a link's friction is off the line from the begin of a step by how
 * steep that line is, so that a link that sticks, creeping up a steep law, goes on along the line
 * when it should break loose, and no error shows it. */
double bd_friction_off_line(bd_plan *plan, const double *y, const double *y_new, double h) {
  const bd_model *model = plan->model;
  const double mass = model->belt.linear_density * model->info.link_length;
  double most = 0.0;
  for (int j = 0; j < model->lay.np; ++j) {
    const bd_contact_pulley *d = &plan->contact_pulleys[j];
    if (d->law == BD_LAW_NONE || d->states > 0) {
      continue;
    }
    double off = 0.0;
    for (int end = 0; end < 2; ++end) {
      const double *at = end ? y_new : y;
      if (model->along_links) {
        bd_link_contact_see(plan, at);
        bd_link_contact_press(plan, at, j);
      }
      for (int r = 0, i = -1; (i = next_near(plan, j, &r, i)) >= 0;) {
        touch c = {0};
        if (!touching(plan, at, i, j, &c)) {
          c.normal = 0.0;
        }
        if (!end) {
          plan->best[i] = c.normal > 0.0 ? c.velocity : (double)NAN;
        } else if (c.normal > 0.0 && isfinite(plan->best[i])) {
          bd_law_point begin, now;
          bd_friction_at(model, j, 0, 0.0, plan->best[i], c.normal, &begin);
          bd_friction_at(model, j, 0, 0.0, c.velocity, c.normal, &now);
          const double stiff = h * fmax(begin.by_slip, 0.0) / mass;
          const double line = begin.force + begin.by_slip * (c.velocity - plan->best[i]);
          off += fabs(now.force - line) * stiff / (1.0 + stiff);
        }
      }
    }
    most = fmax(most, off);
  }
  return most / (model->belt.axial_stiffness * model->info.strain);
}

/* Of a link on two pulleys, those of the larger normal force. What the law of friction gives is
 * evaluated only where it is asked for. */
void bd_outputs_of_contact(bd_plan *plan, const double *y, const bd_output *out, size_t k) {
  const bd_layout *lay = &plan->model->lay;
  const size_t n = (size_t)lay->n, row = k * n;
  double *columns[] = {out->normal, out->friction, out->mu, out->slip, out->velocity};
  const int in_full = out->friction || out->mu || out->slip || out->velocity;
  double *best = plan->best; /* the largest N so far */
  if (out->load) {
    outputs_of_loads(plan, y, out->load + 2 * k * (size_t)lay->np);
  }
  if (!in_full && !out->normal && !out->pulley && !out->span_tension && !out->across) {
    return;
  }
  for (size_t i = 0; i < n; ++i) {
    best[i] = -1.0;
    plan->touched[i] = -1;
  }
  for (size_t c = 0; c < sizeof columns / sizeof columns[0]; ++c) {
    if (columns[c]) {
      memset(columns[c] + row, 0, n * sizeof(double));
    }
  }
  for (int j = 0; j < lay->np; ++j) {
    look_at(plan, y, j);
    for (int r = 0, i = -1; (i = next_near(plan, j, &r, i)) >= 0;) {
      touch c = {0};
      const int touched = (in_full ? touching : pressing)(plan, y, i, j, &c);
      if (!touched || c.normal <= best[i]) {
        continue;
      }
      best[i] = c.normal;
      plan->touched[i] = j;
      const double values[] = {c.normal, c.friction, c.mu, c.slip, c.velocity};
      for (size_t q = 0; q < sizeof columns / sizeof columns[0]; ++q) {
        if (columns[q]) {
          columns[q][row + (size_t)i] = values[q];
        }
      }
    }
  }
  if (out->pulley) {
    memcpy(out->pulley + row, plan->touched, n * sizeof *out->pulley);
  }
  if (out->span_tension) {
    outputs_of_spans(plan, y, out->span_tension + k * (size_t)lay->np);
  }
  if (out->across) {
    out->across[k] = across(plan, y);
  }
}

void bd_observe(bd_plan *plan, double *y, double turns, const double *torque, double e0,
                const bd_output *out, size_t k) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  bd_mounts_put(plan, y);
  put(out->theta, k, lay->np, y + lay->theta, 0.0);
  put(out->omega, k, lay->np, y + lay->omega, 0.0);
  put(out->torque, k, lay->np, torque, 0.0);
  put(out->x, k, lay->n, bd_cfield(lay, y, F_X), model->origin[0]);
  put(out->y, k, lay->n, bd_cfield(lay, y, F_Y), model->origin[1]);
  put(out->vx, k, lay->n, bd_cfield(lay, y, F_VX), 0.0);
  put(out->vy, k, lay->n, bd_cfield(lay, y, F_VY), 0.0);
  if (lay->string && (out->phi || out->vphi)) {
    const size_t row = k * (size_t)lay->n;
    bd_state_directions(lay, y, out->phi ? out->phi + row : NULL,
                        out->vphi ? out->vphi + row : NULL);
  } else if (!lay->string) {
    put(out->phi, k, lay->n, bd_cfield(lay, y, F_PHI), turns * 2.0 * BD_PI);
    put(out->vphi, k, lay->n, bd_cfield(lay, y, F_VPHI), 0.0);
  }
  for (int e = 0; e < plan->n_effects; ++e) {
    if (plan->effects[e]->outputs) {
      plan->effects[e]->outputs(plan, y, out, k);
    }
  }
  if (out->energy) {
    double terms[BD_N_ENERGY], *row = out->energy + k * (size_t)plan->n_columns;
    double total = bd_energy(plan, y, terms), supplied = y[lay->work + W_drive];
    for (int w = W_drive + 1; w < lay->n_work; ++w) {
      supplied -= y[lay->work + w];
    }
    terms[BD_ENERGY_residual] = total - e0 - supplied;
    for (int c = 0; c < plan->n_columns; ++c) {
      row[c] = terms[plan->columns[c]];
    }
  }
}
