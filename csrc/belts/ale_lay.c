/* SPDX-License-Identifier: MIT
 *
 * An ALE belt that runs along itself without friction, or stands: its metres, speeds and waves
 * (MODEL section 11.9).
 */
#include <math.h>
#include <string.h>

#include "belts/ale.h"

/* On an arc T + (EI theta'^2 / 2 m^2 - energy of contact) / lambda~ - rhoA J^2 lambda is that of a
 * span, lambda~ that of the node between: metres of a cell, its stretch into `stretch`, the radius
 * on which it runs. */
static double lay_cell(const bd_ale *ale, const bd_ale_arc *arc, double pressing, double flow,
                       double of_span, double *stretch, double *rho) {
  const double EA = ale->axial, square = ale->density * flow * flow;
  double low = of_span, m = arc->cell_angle * arc->radius / low, depth = 0.0;
  *rho = arc->radius + arc->raised;
  for (int turn = 0; turn < 50; ++turn) {
    const double bent = arc->cell_angle / m;
    const double bends =
        (ale->bending * bent * bent - 2.0 * bd_ale_pressed(ale, depth)) / (of_span + low);
    const double tension = pressing + square * low - bends;
    low = 1.0 + tension / EA;
    const double pressure = (tension * low - square * low * low) / *rho;
    depth = bd_contact_depth(ale->quadratic, ale->linear, fmax(0.0, pressure));
    *rho = arc->radius + arc->raised - depth;
    m = arc->cell_angle * *rho / low;
  }
  *stretch = low;
  return m;
}

static double span_stretch(const bd_ale *ale, double pressing, double flow) {
  double stretch = 1.0;
  for (int turn = 0; turn < 50; ++turn) {
    stretch = 1.0 + (pressing + ale->density * flow * flow * stretch) / ale->axial;
  }
  return stretch;
}

/* By how much H of a cell is more than that of the first one for the weight of the metres y has,
 * into `total`. The loop is closed; what its nodes leave over of that is spread over all. */
static void hang(bd_ale *ale, const bd_ale_state *y) {
  double sum = 0.0;
  for (int pass = 0; pass < 2; ++pass) {
    const double left = pass == 0 ? 0.0 : sum / ale->cells;
    sum = 0.0;
    for (int j = 0; j < ale->np; ++j) {
      const bd_ale_arc *arc = &ale->arcs[j], *behind = &ale->arcs[arc->before];
      double before = y->m[behind->begin + behind->n];
      for (int k = arc->begin; k <= arc->begin + arc->n; ++k) {
        const double mass = 0.5 * ale->density * (before + y->m[k]);
        before = y->m[k];
        sum -= mass * (ale->gravity[0] * ale->tx[k] + ale->gravity[1] * ale->ty[k]) + left;
        ale->total[k] = sum;
      }
    }
  }
}

/* Modes of a span that hangs, whose ends have rolled as it turns them: X + E. */
static double hang_span(const bd_ale *ale, bd_ale_span *span, double H, double stretch) {
  memcpy(span->slope, span->waves->rest, sizeof span->slope);
  bd_ale_baseline.path(ale, span, H); /* where waves rest */
  double path = 0.0;
  for (int turn = 0; turn < 20; ++turn) {
    double turns[2];
    for (int end = 0; end < 2; ++end) {
      const double angle = turn > 0 ? span->lifted[end] : 0.0;
      turns[end] = bd_ale_rolls_on(span, end) * angle * angle * H / span->length;
      span->slope[end] = 0.0;
    }
    for (int n = 0; n < BD_ALE_MODES; ++n) {
      const double first = bd_ale_end_slope(span, 0, n), last = bd_ale_end_slope(span, 1, n);
      const double held = first * first * (H + bd_ale_stiff(span, n, H));
      const double sags = 4.0 * ale->odd[n] * span->sag * ale->density / stretch;
      span->ab[n] = span->rest[n] + (sags + turns[0] * first + turns[1] * last) / held;
      span->slope[0] += first * span->ab[n];
      span->slope[1] += last * span->ab[n];
    }
    path = bd_ale_baseline.path(ale, span, H).x;
  }
  return path;
}

double bd_ale_lay(bd_ale *ale, double pressing, double flow, const bd_ale_state *y) {
  double length = 0.0;
  hang(ale, y);
  for (int j = 0; j < ale->np; ++j) {
    bd_ale_arc *arc = &ale->arcs[j];
    bd_ale_span *span = &ale->spans[j];
    const bd_ale_arc *behind = &ale->arcs[arc->before];
    const int last = arc->begin + arc->n;
    const double H = pressing + ale->total[last], stretch = span_stretch(ale, H, flow);
    const double of_last =
        span_stretch(ale, pressing + ale->total[behind->begin + behind->n], flow);
    double low = of_last, rho = arc->radius;
    for (int k = arc->begin; k < last; ++k) {
      const double before = low;
      if (k == arc->begin || ale->total[k] != ale->total[k - 1]) {
        y->m[k] = lay_cell(ale, arc, pressing + ale->total[k], flow, of_last, &low, &rho);
      } else {
        y->m[k] = y->m[k - 1];
      }
      y->v[k] = flow * 0.5 * (before + low);
      length += y->m[k];
    }
    y->v[last] = flow * 0.5 * (low + stretch);
    bd_ale_hold_waves(ale, span, H);
    y->m[last] = (span->length + hang_span(ale, span, H, stretch)) / stretch;
    for (int n = 0; n < BD_ALE_MODES; ++n) {
      y->a[j * BD_ALE_MODES + n] = span->ab[n] - span->offset[n];
      y->p[j * BD_ALE_MODES + n] = span->moved[n];
    }
    arc->axis.omega = arc->sense * flow * low / rho;
    length += y->m[last];
  }
  for (int i = 0; i < ale->np && ale->along; ++i) {
    const bd_ale_arc *arc = &ale->arcs[i];
    const double ends = y->v[arc->begin + arc->n] + y->v[ale->arcs[arc->next].begin];
    y->along[i] = bd_ale_hung_along(ale, &ale->spans[i]) / ale->spans[i].along_stiffness;
    y->along_speed[i] = BD_ALE_SHARE * ends;
  }
  return length;
}

/* Secants, from the tension at rest: a belt that is too short by a share has that times EA more.
 * The sum of many cells is no closer than its rounding. */
double bd_ale_start(bd_ale *ale, double length, double speed, const bd_ale_state *y) {
  static const double ROUNDING = 1e-13;
  double H = ale->rest, before = 0.0, short_before = 0.0;
  bd_ale_lay(ale, H, speed, y); /* metres, to be weighed */
  for (int turn = 0; turn < 50; ++turn) {
    double flow = speed;
    for (int k = 0; k < 50; ++k) {
      flow = speed / (1.0 + (H + ale->density * flow * speed) / ale->axial);
    }
    const double shorter = bd_ale_lay(ale, H, flow, y) / length - 1.0;
    if (!isfinite(shorter)) { /* what hangs so far that its ends roll off */
      return (double)NAN;
    }
    const int rounds = fabs(shorter) < ROUNDING && fabs(shorter) >= fabs(short_before);
    if (fabs(shorter) < 4e-16 ||
        (turn > 0 && (rounds || !(fabs(H - before) > 1e-12 * ale->rest)))) {
      return H;
    }
    const double slope = turn == 0 ? -1.0 / ale->axial : (shorter - short_before) / (H - before);
    before = H;
    short_before = shorter;
    H = fmax(0.5 * H, H - shorter / slope);
  }
  return (double)NAN;
}
