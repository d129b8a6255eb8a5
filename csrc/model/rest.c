/* SPDX-License-Identifier: MIT
 *
 * The tension of a belt without load between its fixed axes, at rest or running along itself: that
 * of the strain of its path (MODEL section 6, "Tension at rest"). The path is the belt line, but
 * for the depth by which the belt sinks into its pulleys, what a compensated contact begins further
 * out, and the ends of the wraps, where it neither lies on the circle nor is straight.
 */
#include <math.h>

#include "model/model.h"

/* By how much the path is shorter at one end of a wrap than if the belt lay on its circle up to
 * there, at the depth p under the pull T: a beam of stiffness EI under T, on a foundation c that
 * only presses, from the wrap, of curvature 1 / R, to the straight span. With x the distance from
 * where contact begins,
 *
 *   in the wrap   p(x) - p: the solution of u'' + S u' + P u = 0, P = sqrt(c / EI),
 *                 S^2 = T / EI + 2 P, with u(0) = -p and u'(0) = b;
 *   in the span   the curvature K exp(x / m), m = sqrt(EI / T),
 *
 * curvature and shear continuous at x = 0. The belt line leaves its circle at x = R (b - K m). For
 * EI = 0: 5 / 12 p sqrt(p / R) longer. */
double bd_shorter_at_end(double pull, double bending, double radius, double depth) {
  const double p = depth, R = radius;
  if (!(bending > 0.0)) {
    return -5.0 / 12.0 * p * sqrt(p / R);
  }
  const double foundation = pull / (R * p), tau = pull / bending, m = 1.0 / sqrt(tau);
  const double P = sqrt(foundation / bending), S = sqrt(tau + 2.0 * P);
  const double b = (S * tau / P + (tau / P + 1.0) / m) / (R * (tau + P + S / m));
  const double K = 1.0 / R + P * p - S * b, leaves = R * (b - K * m);
  const double first = (b - S * p) / P, squared = 0.5 * (b * b + P * p * p) / S;
  return (first + p * leaves - leaves * leaves * leaves / (6.0 * R)) / R -
         0.25 * K * K * m * m * m - 0.5 * squared;
}

/* What presses a metre of stress-free belt on its pulley, times its radius: T lambda - rho v^2,
 * lambda = 1 + T / EA, because c1' and c2' are per metre of that belt. */
static double pull_of(const bd_model *model, double tension, double speed) {
  const double stretched = 1.0 + tension / model->belt.axial_stiffness;
  return fmax(0.0, tension * stretched - model->belt.linear_density * speed * speed);
}

static double depth_under(const bd_model *model, double radius, double pull) {
  return bd_contact_depth(model->contact.quadratic, model->contact.linear, pull / radius);
}

double bd_model_depth(const bd_model *model, double radius, double tension, double speed) {
  return depth_under(model, radius, pull_of(model, tension, speed));
}

/* Mounts that move give way to a belt that runs, so that the pull which presses it on its pulleys
 * stays what it was; between fixed axes the path decides. */
double bd_running_tension(const bd_model *model, double speed) {
  return model->n_moving > 0
             ? bd_rest_tension(model, 0.0) + model->belt.linear_density * speed * speed
             : bd_rest_tension(model, speed);
}

double bd_running_radius(const bd_model *model, int j, double tension, double speed) {
  const double radius = model->radius[j], sunk = bd_model_depth(model, radius, tension, speed);
  const double raised = model->contact.compensate
                            ? bd_model_depth(model, radius, model->info.strain_tension, 0.0)
                            : 0.0;
  return radius - (sunk - raised);
}

/* The length of a bend at the end of a wrap, sqrt(EI / T), up to where those of both ends take half
 * the span behind pulley k. */
static double bend_of(const bd_model *model, int k, double pull) {
  return fmin(sqrt(model->belt.bending_stiffness / pull), 0.25 * model->wraps[k].span);
}

/* By how much bends lift a span's end off its belt line, to the left of its way: by EI / (2 r T)
 * away from the axis, where half the wrap has room for one. Where it has not, only the pulley's
 * middle is touched, and the belt turns there by half the wrap along exp(-x / m): its straight part
 * is lifted by half the wrap times what has no room. */
static double lift(const bd_model *model, int j, double wrap, double bend) {
  const double room = 0.5 * wrap * model->radius[j];
  const double fits = fmin(bend, room), left = fmax(0.0, bend - room);
  return 0.5 * model->side[j] * (fits * fits / model->radius[j] + wrap * left);
}

/* The wrap on pulley j, which the spans beside it change as their ends are lifted. */
static double wrap_of(const bd_model *model, int j, double pull) {
  const int n = model->lay.np, beside[2] = {(j + n - 1) % n, (j + 1) % n};
  double wrap = model->wraps[j].wrap;
  for (int k = 0; k < 2 && n > 1; ++k) {
    const int at = k == 0 ? beside[0] : j, other = beside[k];
    const double bend = bend_of(model, at, pull);
    const double off = lift(model, j, model->wraps[j].wrap, bend) -
                       lift(model, other, model->wraps[other].wrap, bend);
    wrap += model->side[j] * off / model->wraps[at].span;
  }
  return fmax(0.0, wrap);
}

/* What the wrap has of the bending stiffness, as both its ends must find room on it. */
static double bending_on(const bd_model *model, int j, double wrap, double pull) {
  const double room = 0.5 * wrap * model->radius[j];
  return fmin(model->belt.bending_stiffness, pull * room * room);
}

/* By how much the path is shorter between pulleys j and k: where lifted ends turn the span by an
 * angle, the wraps, which stay on their circles, give less than the span loses; and longer where a
 * bend has no room, at each end by a sixteenth of the wrap's square times what has none. */
static double shorter_in_span(const bd_model *model, int j, int k, const double wrap[2],
                              double pull) {
  const double span = model->wraps[j].span, bend = bend_of(model, j, pull);
  const double off = lift(model, j, wrap[0], bend) - lift(model, k, wrap[1], bend);
  double longer = 0.0;
  for (int end = 0; end < 2; ++end) {
    const double room = 0.5 * wrap[end] * model->radius[end == 0 ? j : k];
    longer += wrap[end] * wrap[end] / 16.0 * fmax(0.0, bend - room);
  }
  return j == k ? 0.0 : 0.5 * off * off / span - longer;
}

/* How much shorter than the belt line the path is under a tension at a speed. */
static double shorter(const bd_model *model, double tension, double speed) {
  const double pull = pull_of(model, tension, speed);
  double sum = 0.0;
  for (int j = 0; j < model->lay.np; ++j) {
    const double radius = model->radius[j], wrap = model->wraps[j].wrap;
    const double depth = depth_under(model, radius, pull);
    sum += wrap * (radius - bd_running_radius(model, j, tension, speed));
    if (depth > 0.0) {
      const int next = (j + 1) % model->lay.np;
      const double bent[2] = {wrap_of(model, j, pull), wrap_of(model, next, pull)};
      sum += 2.0 * bd_shorter_at_end(pull, bending_on(model, j, bent[0], pull), radius, depth) +
             shorter_in_span(model, j, next, bent, pull);
    }
  }
  return sum;
}

/* The more tension, the shorter the path: by bisection, from 0 to what twice the strain gives. The
 * belt is never lifted by more than it would have sunk in. */
double bd_rest_tension(const bd_model *model, double speed) {
  const double EA = model->belt.axial_stiffness;
  const double strain = model->info.strain + model->info.mesh_strain;
  double low = 0.0, high = EA * strain;
  while (high < EA * (strain - shorter(model, high, speed) / model->belt.length)) {
    high *= 2.0;
  }
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    if (middle > EA * (strain - shorter(model, middle, speed) / model->belt.length)) {
      high = middle;
    } else {
      low = middle;
    }
  }
  return 0.5 * (low + high);
}
