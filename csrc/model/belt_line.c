/* SPDX-License-Identifier: MIT
 *
 * The tight belt line round pulleys on either side of the belt: tangents between consecutive
 * pulleys and the arcs they leave.
 *
 * Running with direction D (+1 counter-clockwise, -1 clockwise) the belt turns by D on pulleys
 * inside its loop, side s = +1, and by -D on those outside, s = -1. With d the vector between two
 * centres, the unit normal n across the span, D 90 degrees behind its direction, satisfies
 * d . n = s_i r_i - s_j r_j, and the belt meets the pulleys at s_i r_i n and s_j r_j n from their
 * centres. The wrap on a pulley is the turn from the normal of arrival to that of departure.
 *
 * Which sides and orders are a drive: on a loop that does not cross itself all turns add up to one
 * (H. Hopf 1935). Two pulleys may be crossed, a figure of eight whose turns add up to none; of
 * more, that would be what a pulley on the belt's back gets which the belt misses: a loop of its
 * own. No span may pass through a pulley.
 */
#include <math.h>
#include <stdio.h>

#include "model/model.h"

static double turn_between(double from, double to, int direction) {
  double turn = fmod(direction * (to - from), 2.0 * BD_PI);
  return turn < 0.0 ? turn + 2.0 * BD_PI : turn;
}

/* Angle of the normal across the span from pulley i to j, and the length of the span; NaN where
 * there is none. */
static double span_normal(const bd_route *route, int i, int j, double *length) {
  double dx = route->cx[j] - route->cx[i], dy = route->cy[j] - route->cy[i];
  double distance = hypot(dx, dy);
  double along = (route->side[i] * route->radius[i] - route->side[j] * route->radius[j]) / distance;
  double across = -route->direction * sqrt(fmax(0.0, 1.0 - along * along));
  *length = distance * fabs(across);
  double ux = dx / distance, uy = dy / distance;
  return atan2(along * uy + across * ux, along * ux - across * uy);
}

int bd_belt_line_overlap(int np, const double *cx, const double *cy, const double *radius, int *i,
                         int *j) {
  for (int a = 0; a < np; ++a) {
    for (int b = a + 1; b < np; ++b) {
      if (hypot(cx[b] - cx[a], cy[b] - cy[a]) < radius[a] + radius[b]) {
        *i = a;
        *j = b;
        return 1;
      }
    }
  }
  return 0;
}

/* Angle seen from the centre at which the belt meets pulley k, the span's normal being given. */
static double met_at(const bd_route *route, int k, double normal) {
  return route->side[k] > 0 ? normal : normal + BD_PI;
}

/* Lays the line with the direction that the route has; gives the sum of its turns. */
static double lay(bd_route *route) {
  const int np = route->np;
  double total = 0.0, depart[2] = {0.0, 0.0};
  route->length = 0.0;
  for (int k = 0; k < np; ++k) {
    route->wraps[k].sense = route->direction * route->side[k];
  }
  for (int k = 0; k < np; ++k) {
    int l = (k + 1) % np;
    bd_wrap *wrap = &route->wraps[k];
    double normal = span_normal(route, k, l, &wrap->span);
    route->wraps[l].arrive = met_at(route, l, normal);
    depart[k > 0] = met_at(route, k, normal);
    if (k > 0) {
      wrap->wrap = turn_between(wrap->arrive, depart[1], route->wraps[k].sense);
    }
  }
  bd_wrap *first = &route->wraps[0];
  first->wrap = turn_between(first->arrive, depart[0], first->sense);
  for (int k = 0; k < np; ++k) {
    total += route->wraps[k].sense * route->wraps[k].wrap;
    route->length += route->wraps[k].span + route->wraps[k].wrap * route->radius[k];
  }
  return total;
}

/* The points of two rims at these angles. */
static void ends_of(const bd_route *route, int i, double leave, int j, double arrive,
                    double ends[4]) {
  ends[0] = route->cx[i] + route->radius[i] * cos(leave);
  ends[1] = route->cy[i] + route->radius[i] * sin(leave);
  ends[2] = route->cx[j] + route->radius[j] * cos(arrive);
  ends[3] = route->cy[j] + route->radius[j] * sin(arrive);
}

/* Where the belt leaves pulley k, and where it arrives at the next. */
static void span_ends(const bd_route *route, int k, double ends[4]) {
  const int l = (k + 1) % route->np;
  const bd_wrap *wrap = &route->wraps[k];
  ends_of(route, k, wrap->arrive + wrap->sense * wrap->wrap, l, route->wraps[l].arrive, ends);
}

static double distance_to_span(const double e[4], double x, double y) {
  const double dx = e[2] - e[0], dy = e[3] - e[1], length = hypot(dx, dy);
  const double along = length > 0.0 ? ((x - e[0]) * dx + (y - e[1]) * dy) / (length * length) : 0.0;
  const double part = fmax(0.0, fmin(1.0, along));
  return hypot(x - e[0] - part * dx, y - e[1] - part * dy);
}

static double left_of(const double e[4], double x, double y) {
  return (e[2] - e[0]) * (y - e[1]) - (e[3] - e[1]) * (x - e[0]);
}

static int cross(const double a[4], const double b[4]) {
  return left_of(a, b[0], b[1]) * left_of(a, b[2], b[3]) < 0.0 &&
         left_of(b, a[0], a[1]) * left_of(b, a[2], a[3]) < 0.0;
}

/* The first span that passes through a pulley at which it does not end. */
static int passes_through(const bd_route *route, int *span, int *pulley) {
  for (int k = 0; k < route->np; ++k) {
    double ends[4];
    span_ends(route, k, ends);
    for (int j = 0; j < route->np; ++j) {
      if (j != k && j != (k + 1) % route->np &&
          distance_to_span(ends, route->cx[j], route->cy[j]) < (1.0 - 1e-9) * route->radius[j]) {
        *span = k;
        *pulley = j;
        return 1;
      }
    }
  }
  return 0;
}

/* How often the line crosses itself; *first, *last: of the spans that meet, those with the fewest
 * pulleys on the way from one to the other. */
static int crossings(const bd_route *route, int *first, int *last) {
  int found = 0;
  for (int k = 0; k < route->np; ++k) {
    double a[4], b[4];
    span_ends(route, k, a);
    for (int j = 0; j < k; ++j) {
      span_ends(route, j, b);
      if (cross(a, b) && (found++ == 0 || k - j < *last - *first)) {
        *first = j;
        *last = k;
      }
    }
  }
  return found;
}

/* A pulley outside the loop that the belt misses, by *gap, so that it could come there in a loop of
 * its own alone: the line crosses itself before and behind it, and perhaps others; of these the one
 * nearest to the span that there would be without them. -1: none. */
static int missed(const bd_route *route, double *gap) {
  int first, last, nearest = -1;
  if (crossings(route, &first, &last) == 0 || (last + 1) % route->np == first) {
    return -1;
  }
  const int next = (last + 1) % route->np;
  double length, ends[4];
  const double normal = span_normal(route, first, next, &length);
  const double leave = met_at(route, first, normal), arrive = met_at(route, next, normal);
  ends_of(route, first, leave, next, arrive, ends);
  for (int k = first + 1; k <= last; ++k) {
    const double away = distance_to_span(ends, route->cx[k], route->cy[k]) - route->radius[k];
    if (route->side[k] < 0 && away > 0.0 && (nearest < 0 || away < *gap)) {
      nearest = k;
      *gap = away;
    }
  }
  return nearest;
}

static int all_inside(const bd_route *route) {
  int inside = 0;
  for (int k = 0; k < route->np; ++k) {
    inside += route->side[k] > 0;
  }
  return inside == route->np;
}

/* What messages call a pulley: its name, or its place among the parameters. */
static bd_label entry(const bd_route *route, int pulley) {
  bd_label label;
  if (route->name && route->name[pulley].text[0]) {
    snprintf(label.text, sizeof label.text, "pulley \"%s\"", route->name[pulley].text);
  } else {
    snprintf(label.text, sizeof label.text, "pulleys[%d]", pulley);
  }
  return label;
}

static int refuse(bd_error *err, const bd_route *route, int pulley, const char *why) {
  return bd_fail_at(err, BD_ERR_GEOMETRY, "pulleys", (double)NAN, -1, pulley, (double)NAN,
                    "%s cannot be reached by the belt: visiting the pulleys in the order given, %s",
                    entry(route, pulley).text, why);
}

static int turns_once(const bd_route *route, double total) {
  return fabs(total - route->direction * 2.0 * BD_PI) < 1e-6;
}

/* Lays the line in the direction in which the centres go round. With pulleys outside the loop the
 * centres may go round the other way: then the shorter line that turns once and does not cross
 * itself. If there is none, that which crosses itself less: it says best what is wrong. */
static double lay_either_way(bd_route *route) {
  double total = lay(route);
  if (all_inside(route) || route->np == 2) {
    return total;
  }
  double length[2];
  int crossed[2], first, last;
  for (int k = 0; k < 2; ++k) { /* the other way, and this one again */
    crossed[k] = crossings(route, &first, &last);
    length[k] = turns_once(route, total) && crossed[k] == 0 ? route->length : (double)INFINITY;
    route->direction = -route->direction;
    total = lay(route);
  }
  if (length[1] < length[0] || (isinf(length[0]) && crossed[1] < crossed[0])) {
    route->direction = -route->direction;
    total = lay(route);
  }
  return total;
}

int bd_belt_line_lay(bd_route *route, bd_error *err) {
  const int np = route->np;
  double area = 0.0;
  for (int k = 0; k < np; ++k) {
    int l = (k + 1) % np;
    area += route->cx[k] * route->cy[l] - route->cx[l] * route->cy[k];
  }
  route->direction = route->turns = np > 2 && area > 0.0 ? 1 : -1;
  int a, b;
  if (bd_belt_line_overlap(np, route->cx, route->cy, route->radius, &a, &b)) {
    return bd_fail(err, BD_ERR_GEOMETRY, "pulleys",
                   "%s and %s overlap: their centres are %g m apart, their radii add up to %g m",
                   entry(route, a).text, entry(route, b).text,
                   hypot(route->cx[b] - route->cx[a], route->cy[b] - route->cy[a]),
                   route->radius[a] + route->radius[b]);
  }
  if (route->side[0] < 0) {
    return bd_fail(err, BD_ERR_GEOMETRY, "pulleys",
                   "%s must be inside the loop, where counting begins", entry(route, 0).text);
  }
  if (np == 1) {
    route->wraps[0] = (bd_wrap){.arrive = 0.5 * BD_PI, .wrap = 2.0 * BD_PI, .sense = -1};
    route->length = 2.0 * BD_PI * route->radius[0];
    return BD_OK;
  }
  const double total = lay_either_way(route);
  route->turns = (int)lrint(total / (2.0 * BD_PI));
  int widest = 0, narrowest = 0;
  for (int k = 0; k < np; ++k) {
    widest = route->wraps[k].wrap > route->wraps[widest].wrap ? k : widest;
    narrowest = route->wraps[k].wrap < route->wraps[narrowest].wrap ? k : narrowest;
  }
  const int inside = all_inside(route);
  if (inside && (fabs(total) > 3.0 * BD_PI || route->wraps[narrowest].wrap < 1e-9)) {
    return refuse(err, route, fabs(total) > 3.0 * BD_PI ? widest : narrowest,
                  "all inside the loop, the belt passes it by or crosses itself");
  }
  int span, pulley;
  if (passes_through(route, &span, &pulley)) {
    return bd_fail_at(
        err, BD_ERR_GEOMETRY, "pulleys", (double)NAN, -1, pulley, (double)NAN,
        "the belt from %s to %s would pass through %s: another order, or another side",
        entry(route, span).text, entry(route, (span + 1) % np).text, entry(route, pulley).text);
  }
  if (inside) {
    return BD_OK;
  }
  if (route->wraps[narrowest].wrap < 1e-9) {
    return refuse(err, route, narrowest, "on the sides given, the belt passes it by");
  }
  double gap = 0.0;
  const int loop = np > 2 ? missed(route, &gap) : -1;
  if (loop >= 0) {
    char why[128];
    snprintf(why, sizeof why,
             "the belt misses it by %.3g m: move it towards the belt by more than that, or take it "
             "out",
             gap);
    return refuse(err, route, loop, why);
  }
  int first, last;
  const int crossed = crossings(route, &first, &last);
  if (np > 2 ? crossed > 0 || route->turns != route->direction
             : crossed != 1 || route->turns != 0) {
    return refuse(err, route, widest,
                  "on the sides given, the belt winds round it in a loop of its own: is it, or one "
                  "next to it, on the other side of the belt?");
  }
  return BD_OK;
}

void bd_belt_line_point(const bd_route *route, const double *raised, double s, double *x, double *y,
                        double *phi) {
  const int np = route->np;
  const double quarter = 0.5 * BD_PI * route->direction, *radius = route->radius;
  const bd_wrap *wraps = route->wraps;
  double angle = remainder(wraps[0].arrive + wraps[0].sense * wraps[0].wrap + quarter, 2.0 * BD_PI);
  for (int k = 0;; k = (k + 1) % np) {
    const int next = (k + 1) % np, outer = route->side[k], other = route->side[next];
    if (s <= wraps[k].span) {
      const double part = wraps[k].span > 0.0 ? s / wraps[k].span : 0.0;
      const double lift = (1.0 - part) * outer * (raised[k] - radius[k]) +
                          part * other * (raised[next] - radius[next]);
      *x = route->cx[k] + (outer * radius[k] + lift) * cos(angle - quarter) + s * cos(angle);
      *y = route->cy[k] + (outer * radius[k] + lift) * sin(angle - quarter) + s * sin(angle);
      *phi = angle;
      return;
    }
    s -= wraps[k].span;
    double arc = wraps[next].wrap * radius[next];
    /* rounding may leave a little more than the whole line */
    if (s <= arc || next == 0) {
      angle += wraps[next].sense * s / radius[next];
      *x = route->cx[next] + other * raised[next] * cos(angle - quarter);
      *y = route->cy[next] + other * raised[next] * sin(angle - quarter);
      *phi = angle;
      return;
    }
    s -= arc;
    angle += wraps[next].sense * wraps[next].wrap;
  }
}

void bd_belt_line_pull(const bd_wrap *wrap, double pull[2]) {
  const double leave = wrap->arrive + wrap->sense * wrap->wrap;
  pull[0] = wrap->sense * (sin(wrap->arrive) - sin(leave));
  pull[1] = wrap->sense * (cos(leave) - cos(wrap->arrive));
}

/* Arcs as polygons of this many corners: none passes a pulley's centre on the wrong side. */
enum { CORNERS = 16 };

int bd_belt_line_winding(const bd_route *route, int pulley) {
  const double cx = route->cx[pulley], cy = route->cy[pulley];
  double turned = 0.0, before = 0.0, first = 0.0;
  for (int k = 0; k < route->np; ++k) {
    for (int c = 0; c <= CORNERS; ++c) {
      const double at =
          route->wraps[k].arrive + route->wraps[k].sense * route->wraps[k].wrap * c / CORNERS;
      const double seen = atan2(route->cy[k] + route->radius[k] * sin(at) - cy,
                                route->cx[k] + route->radius[k] * cos(at) - cx);
      if (k == 0 && c == 0) {
        first = before = seen;
      }
      turned += remainder(seen - before, 2.0 * BD_PI);
      before = seen;
    }
  }
  turned += remainder(first - before, 2.0 * BD_PI);
  return (int)lrint(turned / (2.0 * BD_PI));
}

int bd_belt_line(int n_pulleys, const bd_pulley *pulleys, bd_wrap *wraps, double *length,
                 int *turns, bd_error *err) {
  const size_t each = 3 * sizeof(double) + sizeof(int) + sizeof(bd_name);
  double *numbers = bd_block_new((size_t)n_pulleys * each);
  if (!numbers) {
    return bd_fail(err, BD_ERR_MEMORY, "pulleys", "out of memory for %d pulleys", n_pulleys);
  }
  double *cx = numbers, *cy = cx + n_pulleys, *radius = cy + n_pulleys;
  int *side = (int *)(radius + n_pulleys);
  bd_name *name = (bd_name *)(side + n_pulleys);
  bd_names_copy(name, n_pulleys, pulleys);
  for (int j = 0; j < n_pulleys; ++j) {
    cx[j] = pulleys[j].center[0];
    cy[j] = pulleys[j].center[1];
    radius[j] = pulleys[j].radius;
    side[j] = pulleys[j].outside ? -1 : 1;
  }
  bd_route route = {.np = n_pulleys,
                    .cx = cx,
                    .cy = cy,
                    .radius = radius,
                    .side = side,
                    .name = name,
                    .wraps = wraps};
  const int code = bd_belt_line_lay(&route, err);
  *length = route.length;
  *turns = route.turns;
  bd_block_free(numbers);
  return code;
}
