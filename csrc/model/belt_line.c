/* SPDX-License-Identifier: MIT
 *
 * The tight belt line round pulleys that all lie inside the loop: common outer tangents between
 * consecutive pulleys and the arcs they leave.
 *
 * Running with direction D (+1 counter-clockwise, -1 clockwise) the pulleys lie on the inner side,
 * so the unit normal n from a centre to its tangent point satisfies d . n = r_i - r_j, d the vector
 * between the centres, and the line runs along n turned by D 90 degrees. The wrap on a pulley is
 * the turn from the normal of arrival to that of departure; a convex loop turns once in all, and a
 * loop that would turn more often leaves a pulley outside or crosses itself.
 */
#include <math.h>

#include "model/model.h"

static double turn_between(double from, double to, int direction) {
  double turn = fmod(direction * (to - from), 2.0 * BD_PI);
  return turn < 0.0 ? turn + 2.0 * BD_PI : turn;
}

/* Angle of the normal on the tangent from pulley i to j, and the length of the tangent. */
static double tangent_normal(const double *cx, const double *cy, const double *radius, int i, int j,
                             int direction, double *length) {
  double dx = cx[j] - cx[i], dy = cy[j] - cy[i];
  double distance = hypot(dx, dy);
  double along = (radius[i] - radius[j]) / distance;
  double across = -direction * sqrt(fmax(0.0, 1.0 - along * along));
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

int bd_belt_line_lay(int np, const double *cx, const double *cy, const double *radius,
                     bd_wrap *wraps, int *direction, double *length, bd_error *err) {
  double area = 0.0;
  for (int k = 0; k < np; ++k) {
    int l = (k + 1) % np;
    area += cx[k] * cy[l] - cx[l] * cy[k];
  }
  *direction = np > 2 && area > 0.0 ? 1 : -1;

  int a, b;
  if (bd_belt_line_overlap(np, cx, cy, radius, &a, &b)) {
    return bd_fail(err, BD_ERR_GEOMETRY, "pulleys",
                   "pulleys[%d] and pulleys[%d] overlap: their centres are %g m apart, their radii "
                   "add up to %g m",
                   a, b, hypot(cx[b] - cx[a], cy[b] - cy[a]), radius[a] + radius[b]);
  }
  if (np == 1) {
    wraps[0] = (bd_wrap){.arrive = 0.5 * BD_PI, .wrap = 2.0 * BD_PI, .span = 0.0};
    *length = 2.0 * BD_PI * radius[0];
    return BD_OK;
  }

  double first = 0.0, total = 0.0;
  *length = 0.0;
  int widest = 0, narrowest = 0;
  for (int k = 0; k < np; ++k) {
    int l = (k + 1) % np;
    double normal = tangent_normal(cx, cy, radius, k, l, *direction, &wraps[k].span);
    wraps[l].arrive = normal;
    if (k == 0) {
      first = normal;
    } else {
      wraps[k].wrap = turn_between(wraps[k].arrive, normal, *direction);
    }
  }
  wraps[0].wrap = turn_between(wraps[0].arrive, first, *direction);
  for (int k = 0; k < np; ++k) {
    total += wraps[k].wrap;
    *length += wraps[k].span + wraps[k].wrap * radius[k];
    widest = wraps[k].wrap > wraps[widest].wrap ? k : widest;
    narrowest = wraps[k].wrap < wraps[narrowest].wrap ? k : narrowest;
  }
  if (total > 3.0 * BD_PI || wraps[narrowest].wrap < 1e-9) {
    int missed = total > 3.0 * BD_PI ? widest : narrowest;
    return bd_fail(err, BD_ERR_GEOMETRY, "pulleys",
                   "pulleys[%d] cannot be reached by the belt: visiting the pulleys in the order "
                   "given, all inside the loop, the belt passes it by or crosses itself",
                   missed);
  }
  return BD_OK;
}

void bd_belt_line_point(int np, const double *cx, const double *cy, const double *radius,
                        const double *raised, const bd_wrap *wraps, int direction, double s,
                        double *x, double *y, double *phi) {
  double quarter = 0.5 * BD_PI * direction;
  double normal = wraps[0].arrive + direction * wraps[0].wrap;
  double angle = remainder(normal + quarter, 2.0 * BD_PI);
  for (int k = 0;; k = (k + 1) % np) {
    int next = (k + 1) % np;
    if (s <= wraps[k].span) {
      const double part = wraps[k].span > 0.0 ? s / wraps[k].span : 0.0;
      const double lift =
          (1.0 - part) * (raised[k] - radius[k]) + part * (raised[next] - radius[next]);
      *x = cx[k] + (radius[k] + lift) * cos(angle - quarter) + s * cos(angle);
      *y = cy[k] + (radius[k] + lift) * sin(angle - quarter) + s * sin(angle);
      *phi = angle;
      return;
    }
    s -= wraps[k].span;
    double arc = wraps[next].wrap * radius[next];
    /* rounding may leave a little more than the whole line */
    if (s <= arc || next == 0) {
      angle += direction * s / radius[next];
      *x = cx[next] + raised[next] * cos(angle - quarter);
      *y = cy[next] + raised[next] * sin(angle - quarter);
      *phi = angle;
      return;
    }
    s -= arc;
    angle += direction * wraps[next].wrap;
  }
}
