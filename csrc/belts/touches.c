/* SPDX-License-Identifier: MIT
 *
 * Contact at the nodes of a belt, as outputs, guards and implicit steps see it (MODEL sections 3
 * and 4).
 */
#include <float.h>
#include <math.h>
#include <string.h>

#include "belts/belts.h"

/* Of a quantity, over its size, by the operations that lead to it: some 60 of half a unit. */
#define ROUNDING (32.0 * DBL_EPSILON)

/* Friction where a touch is, of which there is a share. */
typedef struct contact_friction {
  double nx, ny, rho, mu, friction, slip, velocity;
} contact_friction;

static contact_friction friction_of(const bd_plan *plan, const double *y, int i, int j,
                                    const bd_touch *touch) {
  const bd_layout *lay = &plan->model->lay;
  const bd_contact_pulley *d = &plan->contact_pulleys[j];
  double dx = touch->x - d->x, dy = touch->y - d->y;
  contact_friction out = {.rho = hypot(dx, dy)};
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

double bd_nodes_push(const bd_plan *plan, const double *y, int j, double force[2]) {
  double stored = 0.0, sum = 0.0;
  bd_plan_see(plan, y);
  plan->model->belt_model->contact_at(plan, y, j, plan->touches, force, &stored);
  for (int r = 0, i = -1; (i = bd_next_near(plan, j, &r, i)) >= 0;) {
    const bd_touch *touch = &plan->touches[i];
    if (touch->share > 0.0) {
      const contact_friction c = friction_of(plan, y, i, j, touch);
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
                             const bd_touch *touch, const contact_friction *c, double dv,
                             double dn) {
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

bd_contact_rounding bd_nodes_rounding(const bd_plan *plan, const double *y, int j) {
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
    const contact_friction c = friction_of(plan, y, i, j, at);
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

/* After plan->touched. */
static void outputs_of_spans(bd_plan *plan, const double *y, double *row) {
  const bd_layout *lay = &plan->model->lay;
  const bd_joint *joints = bd_joints(plan, y, 0);
  for (int i = 0; i < lay->n; ++i) {
    plan->best[i] = joints[i].force;
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
    bd_nodes_push(plan, y, j, force);
    row[2 * j] = -force[0];
    row[2 * j + 1] = -force[1];
  }
}

/* Newton's matrix divides what a link's friction is off the line from the begin of a step by how
 * steep that line is, so that a link that sticks, creeping up a steep law, goes on along the line
 * when it should break loose, and no error shows it. */
double bd_nodes_off_line(bd_plan *plan, const double *y, const double *y_new, double h) {
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
        const contact_friction c =
            normal > 0.0 ? friction_of(plan, at, i, j, &touches[i]) : (contact_friction){0};
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
void bd_nodes_contact_outputs(bd_plan *plan, const double *y, const bd_output *out, size_t k) {
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
      const contact_friction c =
          in_full ? friction_of(plan, y, i, j, &touches[i]) : (contact_friction){0};
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
