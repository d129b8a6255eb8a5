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

/* Friction where a touch is, of which there is a share. */
typedef struct rubbing {
  double nx, ny, rho, mu, friction, slip, velocity;
} rubbing;

static rubbing rub(const bd_plan *plan, const double *y, int i, int j, const bd_touch *touch) {
  const bd_layout *lay = &plan->model->lay;
  const bd_contact_pulley *d = &plan->contact_pulleys[j];
  double dx = touch->x - d->x, dy = touch->y - d->y;
  rubbing out = {.rho = hypot(dx, dy)};
  double nx = out.nx = dx / out.rho, ny = out.ny = dy / out.rho;
  double ux = touch->vx - d->vx, uy = touch->vy - d->vy;
  out.velocity = uy * nx - ux * ny - y[lay->rim[j]] * out.rho;
  const int friction = d->law != BD_LAW_NONE;
  const double *states = bd_cfield(lay, y, bd_f_state(lay, d->slot)) + i;
  double z = d->states > 0 ? states[0] : 0.0;
  z = z > d->bound ? d->bound : z < -d->bound ? -d->bound : z;
  out.mu = z;
  out.friction = z * touch->normal;
  if (bd_law_is_general(d->law)) {
    bd_law_point point;
    double force = 0.0;
    for (int e = 0; e < (d->states > 0 ? d->states : 1); ++e) {
      bd_friction_at(plan->model, j, e, e == 0 ? z : states[e * lay->stride], out.velocity,
                     touch->normal / touch->share, &point);
      force = e == 0 ? point.force : force + point.force;
    }
    out.friction = touch->share * force;
    out.mu = touch->normal > 0.0 ? out.friction / touch->normal : 0.0;
  }
  out.slip = friction ? bd_cfield(lay, y, bd_f_slip(lay, d->slot))[i] : 0.0;
  return out;
}

/* All contact of pulley j, after bd_plan_see. Scratch. */
static const bd_touch *touches_of(const bd_plan *plan, const double *y, int j) {
  double force[2], energy = 0.0;
  plan->model->belt_model->contact_at(plan, y, j, plan->touches, force, &energy);
  return plan->touches;
}

const bd_joint *bd_joints(const bd_plan *plan, const double *y, int with_rate) {
  const double *co = with_rate ? plan->links.cos : NULL, *si = with_rate ? plan->links.sin : NULL;
  plan->model->belt_model->joints_at(plan, y, co, si, plan->joints);
  return plan->joints;
}

double bd_mean_force(const bd_plan *plan, const double *y) {
  const int n = plan->model->lay.n;
  const bd_joint *joints = bd_joints(plan, y, 0);
  double total = 0.0;
  for (int i = 0; i < n; ++i) {
    total += bd_joint_force(plan, &joints[i]);
  }
  return total / n;
}

void bd_energy_of_joints(const bd_plan *plan, const double *y, double terms[BD_N_ENERGY]) {
  const bd_joint *at = bd_joints(plan, y, 0);
  for (int i = 0; i < plan->model->lay.n; ++i) {
    terms[BD_ENERGY_axial] += 0.5 * plan->links.stiffness * at[i].squared;
    terms[BD_ENERGY_bending] += 0.5 * plan->links.bending * at[i].turn * at[i].turn;
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

void bd_energy_of_contact(const bd_plan *plan, const double *y, double terms[BD_N_ENERGY]) {
  double force[2];
  bd_plan_see(plan, y);
  for (int j = 0; j < plan->model->lay.np; ++j) {
    plan->model->belt_model->contact_at(plan, y, j, plan->touches, force,
                                        &terms[BD_ENERGY_contact]);
  }
}

double bd_friction_torque(const bd_plan *plan, const double *y, int j, double force[2]) {
  double unused[2], stored = 0.0, sum = 0.0;
  force = force ? force : unused;
  bd_plan_see(plan, y);
  plan->model->belt_model->contact_at(plan, y, j, plan->touches, force, &stored);
  for (int r = 0, i = -1; (i = bd_next_near(plan, j, &r, i)) >= 0;) {
    const bd_touch *touch = &plan->touches[i];
    if (touch->share > 0.0) {
      const rubbing c = rub(plan, y, i, j, touch);
      sum += c.friction * c.rho;
      force[0] += touch->acts * c.nx + c.friction * c.ny;
      force[1] += touch->acts * c.ny - c.friction * c.nx;
    }
  }
  return sum;
}

/* What the friction of link i changes by where its slip velocity and its normal force, over its
 * share in contact, are off by so much. */
static double friction_shift(const bd_plan *plan, const double *y, int i, int j,
                             const bd_touch *touch, const rubbing *c, double dv, double dn) {
  const bd_layout *lay = &plan->model->lay;
  const bd_contact_pulley *d = &plan->contact_pulleys[j];
  const double *states = bd_cfield(lay, y, bd_f_state(lay, d->slot)) + i;
  if (!bd_law_is_general(d->law)) {
    return fabs(c->mu) * dn;
  }
  double sum = 0.0;
  for (int e = 0; e < (d->states > 0 ? d->states : 1); ++e) {
    const double z = d->states > 0 ? states[e * lay->stride] : 0.0,
                 mean = touch->normal / touch->share;
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
  return touch->share * sum;
}

bd_contact_rounding bd_contact_rounding_of(const bd_plan *plan, const double *y, int j) {
  const bd_layout *lay = &plan->model->lay;
  const bd_contact_pulley *d = &plan->contact_pulleys[j];
  const double *w = bd_find_field(lay, y, F_VPHI);
  bd_contact_rounding out = {.least = -1};
  bd_plan_see(plan, y);
  const bd_touch *touches = touches_of(plan, y, j);
  for (int r = 0, i = -1; (i = bd_next_near(plan, j, &r, i)) >= 0;) {
    const bd_touch *at = &touches[i];
    if (!(at->share > 0.0)) {
      continue;
    }
    const rubbing c = rub(plan, y, i, j, at);
    /* of places and velocities, before differences of them are taken; and of directions */
    const double off =
        ROUNDING * (fabs(at->x) + fabs(at->y) + fabs(d->x) + fabs(d->y) + 2.0 * plan->links.half);
    const double speed = fabs(at->vx) + fabs(at->vy) + fabs(d->vx) + fabs(d->vy) +
                         fabs(y[lay->rim[j]]) * c.rho +
                         (w ? 2.0 * plan->links.half * fabs(w[i]) : 0.0);
    const double dv = speed * (ROUNDING + off / c.rho);
    const double p = fmax(0.0, d->radius - c.rho), elastic = (d->quadratic * p + d->linear) * p;
    /* of lengths of belt normal forces are those of the same loops */
    const double dn =
        plan->model->belt_model->facts.smooth
            ? 0.0
            : (2.0 * d->quadratic * p + d->linear) * (1.0 + d->hunt_crossley * speed) * off +
                  (d->damping + d->hunt_crossley * elastic) * dv;
    out.magnitude += at->normal + fabs(c.friction) + elastic;
    out.shift += dn + friction_shift(plan, y, i, j, at, &c, dv, dn) +
                 (ROUNDING + off / c.rho) * (at->normal + fabs(c.friction));
    if (out.least < 0 || !(at->least >= out.least_normal)) {
      out.least_normal = at->least;
      out.least = i;
    }
  }
  return out;
}

static double kinetic_energy(const bd_model *model, const double *y) {
  const bd_layout *lay = &model->lay;
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  const double *w = bd_find_field(lay, y, F_VPHI);
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
  const size_t n = (size_t)plan->model->lay.n;
  const bd_joint *joints = out->deformation || out->force ? bd_joints(plan, y, 0) : NULL;
  for (size_t i = 0; joints && i < n; ++i) {
    if (out->deformation) {
      out->deformation[k * n + i] = joints[i].along;
    }
    if (out->force) {
      out->force[k * n + i] = bd_joint_force(plan, &joints[i]);
    }
  }
}

/* After plan->touched. */
static void outputs_of_spans(bd_plan *plan, const double *y, double *row) {
  const bd_layout *lay = &plan->model->lay;
  const bd_joint *joints = bd_joints(plan, y, 0);
  for (int i = 0; i < lay->n; ++i) {
    plan->best[i] = bd_joint_force(plan, &joints[i]);
  }
  bd_span_tension(lay->n, plan->touched, plan->best, lay->np, row);
}

/* After plan->touched. */
static double across(const bd_plan *plan, const double *y) {
  const bd_layout *lay = &plan->model->lay;
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  double sum = 0.0;
  for (int i = 0; i < lay->n; ++i) {
    if (plan->touched[i] < 0) {
      double e[2];
      plan->model->belt_model->direction(lay, y, i, e);
      const double v = vy[i] * e[0] - vx[i] * e[1];
      sum += v * v;
    }
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
      bd_plan_see(plan, at);
      const bd_touch *touches = touches_of(plan, at, j);
      for (int r = 0, i = -1; (i = bd_next_near(plan, j, &r, i)) >= 0;) {
        const double normal = touches[i].share > 0.0 ? touches[i].normal : 0.0;
        const rubbing c = normal > 0.0 ? rub(plan, at, i, j, &touches[i]) : (rubbing){0};
        if (!end) {
          plan->best[i] = normal > 0.0 ? c.velocity : (double)NAN;
        } else if (normal > 0.0 && isfinite(plan->best[i])) {
          bd_law_point begin, now;
          bd_friction_at(model, j, 0, 0.0, plan->best[i], normal, &begin);
          bd_friction_at(model, j, 0, 0.0, c.velocity, normal, &now);
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
  bd_plan_see(plan, y);
  for (int j = 0; j < lay->np; ++j) {
    const bd_touch *touches = touches_of(plan, y, j);
    for (int r = 0, i = -1; (i = bd_next_near(plan, j, &r, i)) >= 0;) {
      const double normal = touches[i].normal;
      if (!(touches[i].share > 0.0) || normal <= best[i]) {
        continue;
      }
      const rubbing c = in_full ? rub(plan, y, i, j, &touches[i]) : (rubbing){0};
      best[i] = normal;
      plan->touched[i] = j;
      const double values[] = {normal, c.friction, c.mu, c.slip, c.velocity};
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
  if (!model->belt_model->directions) {
    put(out->phi, k, lay->n, bd_cfield(lay, y, F_PHI), turns * 2.0 * BD_PI);
    put(out->vphi, k, lay->n, bd_cfield(lay, y, F_VPHI), 0.0);
  } else if (out->phi || out->vphi) {
    const size_t row = k * (size_t)lay->n;
    model->belt_model->directions(lay, y, out->phi ? out->phi + row : NULL,
                                  out->vphi ? out->vphi + row : NULL);
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
