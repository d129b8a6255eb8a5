/* SPDX-License-Identifier: MIT
 *
 * A string of point masses, joined by bars that stretch along their chord and resist no bending,
 * with contact along the bars (MODEL section 2). Joint i is the bar between mass i - 1 and mass i.
 */
#include <math.h>

#include "belts/belts.h"

/* Of the three masses at the ends of the two bars that meet at mass i. */
static double distance(const bd_model *model, const bd_state *state, int i, const double point[2]) {
  const int n = model->lay.n;
  double least = (double)INFINITY;
  for (int k = i + n - 1; k <= i + n + 1; ++k) {
    least = fmin(least, hypot(state->x[k % n] - point[0], state->y[k % n] - point[1]));
  }
  return least;
}

/* Of the bar behind each mass. */
static void directions(const bd_layout *lay, const double *y, double *phi, double *vphi) {
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  double before = 0.0;
  for (int i = 0; i < lay->n; ++i) {
    const int next = i + 1 < lay->n ? i + 1 : 0;
    const double dx = x[next] - x[i], dy = yy[next] - yy[i];
    const double du = vx[next] - vx[i], dv = vy[next] - vy[i];
    before += remainder(atan2(dy, dx) - before, 2.0 * BD_PI);
    if (phi) {
      phi[i] = before;
    }
    if (vphi) {
      vphi[i] = (dx * dv - dy * du) / (dx * dx + dy * dy);
    }
  }
}

/* Masses on the circles of contact. */
static void lay_masses(const bd_model *model, const bd_route *line, double shift, double *x,
                       double *y, double *phi) {
  for (int i = 0; i < model->lay.n; ++i) {
    const bd_chord bar = bd_line_chord(model, line, shift, i, &phi[i]);
    x[i] = bar.x0;
    y[i] = bar.y0;
  }
}

/* Masses run towards where the next one stands, each in the time of one bar. On a circle, where
 * bars turn by 2 a, they are faster than a straight span by a / sin a. */
static void set_going(const bd_plan *plan, double *y, double speed) {
  const bd_layout *lay = &plan->model->lay;
  const double *x = bd_field(lay, y, F_X), *yy = bd_field(lay, y, F_Y);
  double *vx = bd_field(lay, y, F_VX), *vy = bd_field(lay, y, F_VY);
  for (int i = 0; i < lay->n; ++i) {
    const int before = i > 0 ? i - 1 : lay->n - 1, after = i + 1 < lay->n ? i + 1 : 0;
    const double ax = x[i] - x[before], ay = yy[i] - yy[before];
    const double bx = x[after] - x[i], by = yy[after] - yy[i];
    const double a = 0.5 * atan2(ax * by - ay * bx, ax * bx + ay * by);
    const double faster = fabs(a) > 1e-6 ? a / sin(a) : 1.0;
    const double chord = hypot(ax + bx, ay + by);
    vx[i] = speed * faster * (ax + bx) / chord;
    vy[i] = speed * faster * (ay + by) / chord;
  }
}

static void joints_at(const bd_plan *plan, const double *y, const double *co, const double *si,
                      bd_joint *out) {
  (void)co, (void)si;
  const bd_layout *lay = &plan->model->lay;
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const double *vx = bd_cfield(lay, y, F_VX), *vy = bd_cfield(lay, y, F_VY);
  for (int i = 0, l = lay->n - 1; i < lay->n; l = i++) {
    const double bx = x[i] - x[l], by = yy[i] - yy[l], length = hypot(bx, by);
    const double along = length - 2.0 * plan->links.half;
    const double rate = ((vx[i] - vx[l]) * bx + (vy[i] - vy[l]) * by) / length;
    out[i] = (bd_joint){.along = along,
                        .squared = along * along,
                        .force = plan->links.stiffness * along + plan->links.damping * rate};
  }
}

/* Of the bar behind a mass. */
static void direction(const bd_layout *lay, const double *y, int i, double e[2]) {
  const double *x = bd_cfield(lay, y, F_X), *yy = bd_cfield(lay, y, F_Y);
  const int next = i + 1 < lay->n ? i + 1 : 0;
  const double dx = x[next] - x[i], dy = yy[next] - yy[i], length = hypot(dx, dy);
  e[0] = dx / length;
  e[1] = dy / length;
}

/* Friction acts at the masses. */
static void contact_at(const bd_plan *plan, const double *y, int j, bd_touch *out, double force[2],
                       double *energy) {
  const bd_layout *lay = &plan->model->lay;
  bd_along_contact_at(plan, y, j, out, force, energy);
  for (int r = 0, i = -1; (i = bd_next_near(plan, j, &r, i)) >= 0;) {
    out[i].x = bd_cfield(lay, y, F_X)[i];
    out[i].y = bd_cfield(lay, y, F_Y)[i];
    out[i].vx = bd_cfield(lay, y, F_VX)[i];
    out[i].vy = bd_cfield(lay, y, F_VY)[i];
  }
}

static double stretch_difference(const bd_plan *plan, const double *y, const bd_plan *other,
                                 const double *v) {
  (void)other;
  const bd_layout *lay = &plan->model->lay;
  const double *x = bd_cfield(lay, y, F_X), *z = bd_cfield(lay, y, F_Y);
  const double *xv = bd_cfield(lay, v, F_X), *zv = bd_cfield(lay, v, F_Y);
  double sum = 0.0;
  for (int i = 0, l = lay->n - 1; i < lay->n; l = i++) {
    const double longer = hypot(xv[i] - xv[l], zv[i] - zv[l]) - hypot(x[i] - x[l], z[i] - z[l]);
    sum += longer * longer;
  }
  return sum;
}

const bd_belt_model bd_belt_string = {
    .facts = {BD_FACTS_ALONG, .name = "string",
              .text = "point masses, whose bars meet the pulleys along their length",
              .model = BD_BELT_STRING, .nodes = "point masses", .fields = BD_OF_MASSES,
              .lacks = BD_OF_CELLS, .stretches = 1, .explicit_share = 0.86},
    BD_NODES,
    .joints_text = {"string: axial spring-dampers between point masses"},
    BD_ALONG,
    .distance = distance,
    .directions = directions,
    .lay = lay_masses,
    .set_going = set_going,
    .contact = bd_contact_in_one_pass,
    .joints_at = joints_at,
    .direction = direction,
    .contact_at = contact_at,
    .stretch_difference = stretch_difference,
};
