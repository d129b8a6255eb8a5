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
static double shorter_at_end(double pull, double bending, double radius, double depth) {
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

/* What presses the belt on its pulleys, times their radius. */
static double pull_of(const bd_model *model, double tension, double speed) {
  const double stretched = 1.0 + tension / model->belt.axial_stiffness;
  return fmax(0.0, tension * stretched - model->belt.linear_density * speed * speed);
}

static double depth_of(const bd_model *model, int j, double pull) {
  return bd_contact_depth(model->contact.quadratic, model->contact.linear, pull / model->radius[j]);
}

/* Arms and sliders give way to a belt that runs, so that the pull which presses it on its pulleys
 * stays what it was; between fixed axes the path decides. */
double bd_running_tension(const bd_model *model, double speed) {
  return bd_model_gives_way(model)
             ? bd_rest_tension(model, 0.0) + model->belt.linear_density * speed * speed
             : bd_rest_tension(model, speed);
}

int bd_model_gives_way(const bd_model *model) {
  int moves = 0;
  for (int m = 0; m < model->lay.nm; ++m) {
    moves |= model->mounts[m].kind != BD_MOUNT_PATH;
  }
  return moves;
}

double bd_running_radius(const bd_model *model, int j, double tension, double speed) {
  const double sunk = depth_of(model, j, pull_of(model, tension, speed));
  const double raised = model->contact.compensate
                            ? depth_of(model, j, pull_of(model, model->info.strain_tension, 0.0))
                            : 0.0;
  return model->radius[j] - (sunk - raised);
}

/* At each end of the wrap on pulley j a bend, sqrt(EI / T) long, finds room on half of it. */
static double room_on(const bd_model *model, int j) {
  return 0.5 * model->wraps[j].wrap * model->radius[j];
}

static double bending_on(const bd_model *model, int j, double pull) {
  const double room = room_on(model, j);
  return fmin(model->belt.bending_stiffness, pull * room * room);
}

/* By how much bends of that length lift a span's end off its belt line, away from the axis: by
 * EI / (2 r T). Of longer ones only the pulley's middle is touched, and the belt turns there by
 * half the wrap along exp(-x / m): the belt line's corner is lifted by half the wrap times what has
 * no room, and the path is longer at each end by a sixteenth of the wrap's square times that. */
static double lift(const bd_model *model, int j, double bend, double *longer) {
  const double wrap = model->wraps[j].wrap, room = room_on(model, j);
  const double fits = fmin(bend, room), left = fmax(0.0, bend - room);
  *longer += wrap * wrap / 16.0 * left;
  return 0.5 * model->side[j] * (fits * fits / model->radius[j] + wrap * left);
}

/* By how much the path is shorter between pulleys j and k: where ends that are lifted turn the span
 * by an angle, the wraps, which stay on their circles, give less than the span loses. Bends count
 * up to where both take half the span: it is then shorter by less than they make it longer,
 * 2 (EI / H)^(3/2) / 12 r^2. */
static double shorter_in_span(const bd_model *model, int j, int k, double pull) {
  const double span = model->wraps[j].span;
  const double bend = fmin(sqrt(model->belt.bending_stiffness / pull), 0.25 * span);
  double longer = 0.0;
  const double off = lift(model, j, bend, &longer) - lift(model, k, bend, &longer);
  return j == k ? 0.0 : 0.5 * off * off / span - longer;
}

/* How much shorter than the belt line the path is under a tension at a speed. */
static double shorter(const bd_model *model, double tension, double speed) {
  const double pull = pull_of(model, tension, speed);
  double sum = 0.0;
  for (int j = 0; j < model->lay.np; ++j) {
    const double radius = model->radius[j], wrap = model->wraps[j].wrap;
    const double depth = depth_of(model, j, pull);
    sum += wrap * (radius - bd_running_radius(model, j, tension, speed));
    if (depth > 0.0) {
      sum += 2.0 * shorter_at_end(pull, bending_on(model, j, pull), radius, depth) +
             shorter_in_span(model, j, (j + 1) % model->lay.np, pull);
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
