/* SPDX-License-Identifier: MIT
 *
 * ALE belt: geometry of its mesh, tension and flow, the ends of wraps (MODEL sections 11.1
 * to 11.3).
 */

/* --- geometry -------------------------------------------------------------------------------- */

INLINE void note_axis(const bd_ale_axis *axis, double placed[4], int *is_new) {
  const double at[4] = {axis->c[0], axis->c[1], axis->v[0], axis->v[1]};
  *is_new |= memcmp(placed, at, sizeof at) != 0;
  memcpy(placed, at, sizeof at);
}

/* A sine wave along a span, of the stretch at rest. */
INLINE void place_along(const bd_ale *ale, bd_ale_span *span) {
  const double mass = ale->density * span->length / (1.0 + ale->rest / ale->axial);
  span->along_inertia = 0.5 * mass * BD_ALE_SHARE * BD_ALE_SHARE;
  span->along_stiffness = BD_PI / span->length * ale->axial;
  span->along_damping = BD_PI / span->length * ale->axial_damping;
}

/* If an axis has moved. */
INLINE void place_span(bd_ale *ale, int i) {
  bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *from = &ale->arcs[i], *to = &ale->arcs[from->next];
  span->is_new = 0;
  note_axis(&from->axis, span->placed[0], &span->is_new);
  note_axis(&to->axis, span->placed[1], &span->is_new);
  if (!span->is_new) {
    return;
  }
  const double D = ale->direction, b = from->side * from->line_radius - to->side * to->line_radius;
  const double dx = to->axis.c[0] - from->axis.c[0], dy = to->axis.c[1] - from->axis.c[1];
  const double vx = to->axis.v[0] - from->axis.v[0], vy = to->axis.v[1] - from->axis.v[1];
  const double square = dx * dx + dy * dy, length = sqrt(square - b * b), per = 1.0 / square;
  span->length = length;
  span->e[0] = (dx * length - dy * D * b) * per;
  span->e[1] = (dy * length + dx * D * b) * per;
  span->n[0] = D * span->e[1];
  span->n[1] = -D * span->e[0];
  span->turning = -D * (vx * span->n[0] + vy * span->n[1]) / length;
  span->length_rate = vx * span->e[0] + vy * span->e[1] - b * span->turning * D;
  span->sag = ale->gravity[0] * span->n[0] + ale->gravity[1] * span->n[1];
  const double first = from->axis.v[0] * span->n[0] + from->axis.v[1] * span->n[1];
  const double last = to->axis.v[0] * span->n[0] + to->axis.v[1] * span->n[1];
  for (int n = 0; n < BD_ALE_MODES; ++n) {
    const double wave = (n + 1) * BD_PI / length, sign = n % 2 == 0 ? -1.0 : 1.0;
    span->wave[n] = wave;
    const double moment =
        0.5 * ale->bending * wave * (span->curvature[0] - sign * span->curvature[1]);
    span->offset[n] = moment / (0.5 * length * ale->rest * wave * wave);
    span->moved[n] = ale->parts[0][n] * first + ale->parts[1][n] * last;
  }
  if (ale->along) {
    place_along(ale, span);
  }
}

/* Tangents along an arc, from that of the span before it on. */
INLINE void place_arc(bd_ale *ale, int j) {
  bd_ale_arc *arc = &ale->arcs[j];
  const bd_ale_span *in = &ale->spans[arc->before], *out = &ale->spans[j];
  const double across = in->e[0] * out->e[1] - in->e[1] * out->e[0];
  const double angle = atan2(arc->sense * across, in->e[0] * out->e[0] + in->e[1] * out->e[1]);
  arc->wrap = angle < 0.0 ? angle + 2.0 * BD_PI : angle;
  arc->cell_angle = arc->wrap / arc->n;
  arc->cell_turning = arc->sense * (out->turning - in->turning) / arc->n;
  const double co = cos(arc->cell_angle), si = arc->sense * sin(arc->cell_angle);
  double x[WIDTH], y[WIDTH], far_co = 1.0, far_si = 0.0;
  arc->half_turn = -arc->side * tan(0.5 * arc->cell_angle);
  for (int lane = 0; lane < WIDTH; ++lane) {
    x[lane] = far_co * in->e[0] - far_si * in->e[1];
    y[lane] = far_si * in->e[0] + far_co * in->e[1];
    const double kept = far_co;
    far_co = far_co * co - far_si * si;
    far_si = far_si * co + kept * si;
  }
  vec tx = load_unaligned(x), ty = load_unaligned(y);
  const vec D = splat(ale->direction), vx = splat(arc->axis.v[0]), vy = splat(arc->axis.v[1]);
  const vec turn_in = splat(in->turning), more = splat(out->turning - in->turning);
  for (int k = arc->begin; k < arc->begin + arc->slots; k += WIDTH) {
    store(ale->tx + k, tx);
    store(ale->ty + k, ty);
    store(ale->turn + k, fma_(load(ale->fraction + k), more, turn_in));
    store(ale->across + k, D * fnma_(vy, tx, vx * ty));
    const vec kept = tx;
    tx = fnma_(splat(far_si), ty, far_co * tx);
    ty = fma_(splat(far_si), kept, far_co * ty);
  }
}

static void place(bd_ale *ale) {
  for (int i = 0; i < ale->np; ++i) {
    place_span(ale, i);
  }
  for (int j = 0; j < ale->np; ++j) {
    if (ale->spans[j].is_new || ale->spans[ale->arcs[j].before].is_new) {
      place_arc(ale, j);
    }
  }
}

/* --- halos ----------------------------------------------------------------------------------- */

/* Behind the span's cell stands the node that follows it. */
INLINE void close_nodes(const bd_ale *ale, double *node) {
  for (int j = 0; j < ale->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    node[arc->begin + arc->n + 1] = node[ale->arcs[arc->next].begin];
  }
}

/* In front of a slab stands the cell of the span before it. */
INLINE void close_cells(const bd_ale *ale, double *cell) {
  for (int j = 0; j < ale->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    cell[arc->begin + arc->slots - 1] = cell[arc->begin + arc->n];
  }
  cell[-1] = cell[ale->slots - 1];
}

/* The padding of a state, all of it, so that nothing there is too small to divide by. */
INLINE void close_state(const bd_ale *ale, const bd_ale_state *y) {
  for (int j = 0; j < ale->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    const double next = y->v[ale->arcs[arc->next].begin], last = y->m[arc->begin + arc->n];
    for (int k = arc->begin + arc->n + 1; k < arc->begin + arc->slots; ++k) {
      y->v[k] = next;
      y->m[k] = last;
    }
  }
  y->m[-1] = y->m[ale->slots - 1];
}

/* --- tension --------------------------------------------------------------------------------- */

/* Depth, stretch and force of an arc's cells, c1' d^2 + c2' d = (T lambda - rhoA w^2) / rho, rho =
 * R
 * - d + p0. With T lambda = EA lambda (lambda - 1) and lambda = rho q, q the angle over m, only
 * what w does is no square of d: the root of what it is to first order, and a step by that slope.
 */
INLINE void stretch_cells(bd_ale *ale, const bd_ale_state *y, int j) {
  const bd_ale_arc *arc = &ale->arcs[j];
  const double outside = arc->radius + arc->raised;
  const vec EA = splat(ale->axial), c1 = splat(ale->quadratic), c2 = splat(ale->linear);
  const vec density = splat(ale->density), damping = splat(arc->damping);
  const vec none = splat(0.0), half = splat(0.5), one = splat(1.0), r0 = splat(outside);
  const vec angle = splat(arc->cell_angle), per_r0 = splat(1.0 / outside);
  const vec per_angle = splat(1.0 / arc->cell_angle);
  const vec bending = splat(0.5 * ale->bending);
  const double outward = 0.5 * ale->density * arc->sense / arc->cell_angle;
  const vec gx = splat(outward * ale->gravity[0]), gy = splat(outward * ale->gravity[1]);
  for (int k = arc->begin; k < arc->begin + arc->n; k += WIDTH) {
    const vec per_m = one / load(y->m + k), q = angle * per_m;
    const vec here = load(ale->slid + k), there = load_unaligned(ale->slid + k + 1);
    const vec w = half * (here + there), momentum = density * w * w;
    const vec pull = EA * q, stiff = fma_(pull, q, c2), lost = momentum * per_r0;
    const vec a = fma_(lost, per_r0, stiff), p = fma_(pull, fma_(r0, q, -one), -lost);
    vec root, inverse;
    root_and_inverse(fma_(a, a, 4.0 * c1 * larger(p, none)), &root, &inverse);
    vec d = 2.0 * p / (a + root);
    const vec rho = r0 - d, per_rho = one / rho, sunk = larger(d, none);
    const vec thrown = momentum * per_rho;
    const vec left = fma_(c1 * sunk, sunk, fma_(c2, d, fnma_(pull, fma_(rho, q, -one), thrown)));
    const vec more = left * inverse; /* what w does to that slope is 1e-5 of it */
    d = d - more;
    const vec per = fnma_(per_rho * per_rho, more, per_rho);
    const vec stretch = (r0 - d) * q, elastic = EA * (stretch - one);
    store(ale->per_m + k, per_m);
    store(ale->per_rho + k, per);
    const vec tension = fma_(damping * (there - here), per_m, elastic);
    store(ale->sink + k, d);
    store(ale->stretch + k, stretch);
    store(ale->elastic + k, elastic);
    store(ale->tension + k, tension);
    const vec tx = load(ale->tx + k) + load_unaligned(ale->tx + k + 1);
    const vec ty = load(ale->ty + k) + load_unaligned(ale->ty + k + 1);
    const vec m = load(y->m + k), lifts = m * fnma_(gy, tx, gx * ty);
    store(ale->pressing + k, tension - momentum * per * m * per_angle - lifts);
    const vec into = larger(d, none),
              pressed = fma_(c1 * into * splat(1.0 / 3.0) * into, into, half * c2 * d * d);
    store(ale->bent + k, load(ale->is_cell + k) * fma_(bending * q, q, -pressed));
  }
}

/* Of an end that waves turn by an angle, which goes with H by `by`: what it adds to the path as it
 * rolls on its pulley. */
INLINE void roll_on(const bd_ale_span *span, int end, double h, bd_ale_path *path) {
  const double by = span->waves->lifts[end], half = 0.5 * bd_ale_rolls_on(span, end);
  const double angle = span->lifted[end];
  path->x -= half * angle * angle * ((1.0 / 3.0) * angle + h * by);
  path->slope -= 2.0 * half * angle * by * (angle + h * by);
  path->bends -= 2.0 * half * by * by * (3.0 * angle + h * by);
}

/* Of modes from n on where they rest, A, by how much that falls with H, and the slope of that; l^2
 * and half of it over H, 0 where A is taken for a constant. */
INLINE void rest_at(const bd_ale_span *span, int n, double l, double half, double per,
                    modes rest[3]) {
  modes value = each(0.0), by = value, again = value;
  for (int k = BD_ALE_POWERS - 1; k >= 0; --k) { /* by log l */
    const double power = k + 2;
    const modes c = modes_at(span->bend[k] + n);
    value = value * l + c;
    by = by * l + power * c;
    again = again * l + power * power * c;
  }
  rest[0] = value * (l * l);
  rest[1] = by * half;
  rest[2] = (0.5 * again + by) * (-half * per);
}

INLINE bd_ale_path path_at(const bd_ale *ale, bd_ale_span *span, double h) {
  const double least = BD_ALE_LEAST * ale->rest, most = BD_ALE_MOST * ale->rest;
  const double floored = bd_at_least(h, least), at = bd_at_most(floored, most), S = span->length;
  const double knot = log(BD_ALE_MOST / BD_ALE_LEAST) / (BD_ALE_KNOTS - 1), per = 1.0 / at;
  const double per_knot = 1.0 / knot, per_S = 1.0 / S, per_H = 1.0 / floored;
  double slope, curves;
  const double x = bd_ale_cubic(span->table->value, span->table->slope, log(at / least) * per_knot,
                                &slope, &curves);
  const double o = span->tilt * per, o_0 = span->tilt / ale->rest, lies = o * o * per_S;
  bd_ale_path out = {.x = x - 0.5 * (lies - o_0 * o_0 * per_S)};
  if (at == h) {
    out.slope = (slope * per_knot + lies) * per;
    out.bends = ((curves * per_knot - slope) * per_knot - 3.0 * lies) * per * per;
  }
  const double l = sqrt(ale->bending * per_H), half = h > least ? 0.5 * l * l * per_H : 0.0;
  modes path = each(0.0), by = path, bends = path;
  for (int n = 0; n < BD_ALE_MODES; n += MODES) {
    const modes wave = modes_at(span->wave + n), k2 = wave * wave;
    const modes rises = modes_at(span->waves->rises + n) + 1.0, held = stiff_at(span, n, h) + h;
    modes rest[3];
    rest_at(span, n, l, half, per_H, rest);
    const modes apart = modes_at(span->ab + n) - rest[0], falls = rest[1];
    modes_to(span->rest + n, rest[0]);
    modes_to(span->falls + n, falls);
    path = path + k2 * apart * (rises * apart + 2.0 * held * falls);
    by = by + k2 * (falls * (2.0 * rises * apart + held * falls) + held * apart * rest[2]);
    bends = bends + k2 * (rises * (falls * falls + apart * rest[2]) + held * falls * rest[2]);
  }
  out.x += 0.25 * S * sum_of_modes(path);
  out.slope += 0.5 * S * sum_of_modes(by);
  out.bends += 1.5 * S * sum_of_modes(bends);
  for (int end = 0; end < 2; ++end) {
    const bd_ale_waves *waves = span->waves;
    span->lifted[end] =
        span->slope[end] - waves->rest[end] + waves->lifts[end] * (h - waves->pressing);
    roll_on(span, end, h, &out);
  }
  return out;
}

static bd_ale_path path(const bd_ale *ale, bd_ale_span *span, double h) {
  return path_at(ale, span, h);
}

/* T of a span's cell, the root of m (1 + T / EA) = S + X(H) + E, from the H of the last step and by
 * steps of H0 / 2 at the most, for below it there are others. */
INLINE void begin_span(bd_ale *ale, const bd_ale_state *y, int i) {
  bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int k = arc->begin + arc->n, after = ale->arcs[arc->next].begin;
  modes square = each(0.0), begins = square, ends = square;
  for (int n = 0; n < BD_ALE_MODES; n += MODES) {
    const modes ab = modes_at(y->a + i * BD_ALE_MODES + n) + modes_at(span->offset + n);
    const modes slope = modes_at(span->wave + n) * ab;
    modes_to(span->ab + n, ab);
    square = square + slope * slope;
    begins = begins + slope;
    ends = ends + turned_at(n) * slope;
  }
  span->past = 0.5 * (ale->past[k] + ale->past[after]);
  span->bent = 0.25 * span->length * sum_of_modes(square);
  span->slope[0] = sum_of_modes(begins);
  span->slope[1] = sum_of_modes(ends);
  span->elastic = bd_at_least(ale->axial * (span->length / y->m[k] - 1.0),
                              span->waves->pressing + ale->density * span->past * span->past);
}

/* 1 / (dT of what is left over), by the slope of X + E; 0 where that is not to be trusted. */
INLINE double per_slope_of(const bd_ale *ale, double m, double by_pressing, double by_T) {
  const double alone = m / ale->axial, by = alone - by_pressing * by_T;
  return by > 0.1 * alone ? 1.0 / by : 0.0;
}

/* One step, Halley's, whose error falls by the third power; returns whether it was the last. */
INLINE int step_span(const bd_ale *ale, bd_ale_span *span, double m) {
  const double EA = ale->axial, H0 = ale->rest, momentum = ale->density * span->past * span->past;
  const double stretch = 1.0 + span->elastic / EA, thrown = momentum / stretch;
  const double by_T = 1.0 + thrown / (stretch * EA);
  span->pressing = span->elastic - thrown;
  const bd_ale_path at = path_at(ale, span, span->pressing);
  const double left = m * stretch - span->length - at.x;
  const double per_slope = per_slope_of(ale, m, at.slope, by_T);
  span->by_pressing = at.slope;
  span->bends = at.bends;
  double step = -left * (per_slope > 0.0 ? per_slope : EA / m);
  const double curved = 1.0 - 0.5 * step * at.bends * by_T * by_T * per_slope;
  const int follows = per_slope > 0.0 && curved > 0.5 && curved < 2.0;
  step = (follows ? step / curved : step) / H0;
  span->elastic += H0 * bd_at_most(bd_at_least(step, -0.5), 0.5);
  return fabs(step) < (follows ? 1e-5 : 1e-8);
}

INLINE void end_span(bd_ale *ale, const bd_ale_state *y, int i) {
  bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int k = arc->begin + arc->n, after = ale->arcs[arc->next].begin;
  span->stretch = 1.0 + span->elastic / ale->axial;
  const double thrown = ale->density * span->past * span->past / span->stretch;
  const double more = span->elastic - thrown - span->pressing; /* by the last step */
  span->pressing += more;
  span->path = y->m[k] * span->stretch - span->length;
  span->by_pressing += span->bends * more;
  const double per_slope =
      per_slope_of(ale, y->m[k], span->by_pressing, 1.0 + thrown / (span->stretch * ale->axial));
  span->per_slope = per_slope > 0.0 ? per_slope : ale->axial / y->m[k];
  ale->stretch[k] = span->stretch;
  ale->elastic[k] = span->elastic;
  const double H = span->pressing, half_S = 0.5 * span->length;
  double turns[2], rolls[2]; /* moments of ends that roll, and what they draw out */
  for (int end = 0; end < 2; ++end) {
    const double by = span->waves->lifts[end], angle = span->lifted[end] += by * more;
    const double half = 0.5 * bd_ale_rolls_on(span, end) * angle;
    turns[end] = half * angle * H;
    rolls[end] = -half * (angle + 2.0 * H * by);
  }
  modes drawn = each(0.0), wound = drawn;
  for (int n = 0; n < BD_ALE_MODES; n += MODES) {
    const modes wave = modes_at(span->wave + n), ab = modes_at(span->ab + n), last = turned_at(n);
    const modes falls = modes_at(span->falls + n), rest = modes_at(span->rest + n) - more * falls;
    const modes da = modes_at(y->p + i * BD_ALE_MODES + n) - modes_at(span->moved + n);
    const modes half = half_S * wave * wave, held = stiff_at(span, n, H) + H;
    const modes rises = modes_at(span->waves->rises + n) + 1.0;
    const modes draws =
        half * (rises * (ab - rest) + held * falls) + wave * (rolls[0] + rolls[1] * last);
    modes_to(span->rest + n, rest);
    modes_to(span->da + n, da);
    modes_to(span->pushed + n, half * held * rest);
    modes_to(span->turned + n, wave * (turns[0] + turns[1] * last));
    modes_to(span->draws + n, draws);
    drawn = drawn + draws * da;
    wound = wound + half * ab * da;
  }
  const double by_waves = sum_of_modes(drawn);
  span->drawn = y->v[after] - y->v[k] + by_waves;
  span->turns = by_waves - sum_of_modes(wound);
  span->damped = span->damping * span->drawn / y->m[k];
  ale->tension[k] = span->elastic + span->damped;
  ale->pressing[k] = span->pressing;
  ale->bent[k] = 0.0;
}

/* What a free part bears on a half of a wrap; as waves lift a span the end rolls on. */
INLINE void shear_of_end(bd_ale *ale, const bd_ale_span *span, double lifted, int from, int to) {
  const double H = bd_at_least(span->pressing, BD_ALE_LEAST * ale->rest);
  double *const shear = ale->shear;
  const double *const roll = ale->roll;
  for (int k = from; k < to; ++k) {
    shear[k] = H - H * lifted * roll[k];
  }
}

INLINE void shear_of_ends(bd_ale *ale, int j) {
  const bd_ale_arc *arc = &ale->arcs[j];
  const bd_ale_span *in = &ale->spans[arc->before], *out = &ale->spans[j];
  const int middle = arc->begin + arc->n / 2;
  shear_of_end(ale, in, in->lifted[1] - in->waves->rolled[1], arc->begin, middle);
  shear_of_end(ale, out, out->lifted[0] - out->waves->rolled[0], middle, arc->begin + arc->n);
}

/* All together: no step waits for that of another. */
INLINE void stretch_spans(bd_ale *ale, const bd_ale_state *y) {
  enum { MOST_STEPS = 30 };
  int last = 0;
  for (int i = 0; i < ale->np; ++i) {
    begin_span(ale, y, i);
  }
  for (int turn = 0; turn < MOST_STEPS && !last; ++turn) {
    last = 1;
    for (int i = 0; i < ale->np; ++i) {
      last &= step_span(ale, &ale->spans[i], y->m[ale->arcs[i].begin + ale->arcs[i].n]);
    }
  }
  for (int i = 0; i < ale->np; ++i) {
    end_span(ale, y, i);
  }
}

static void stretch(bd_ale *ale, const bd_ale_state *y) {
  const vec half = splat(0.5), one = splat(1.0);
  close_state(ale, y);
  for (int j = 0; j < ale->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    const vec vx = splat(arc->axis.v[0]), vy = splat(arc->axis.v[1]);
    const vec rim = splat(arc->sense * arc->radius);
    for (int k = arc->begin; k < arc->begin + arc->slots; k += WIDTH) {
      const vec tx = load(ale->tx + k), ty = load(ale->ty + k), v = load(y->v + k);
      const vec slid = v - fma_(vx, tx, vy * ty);
      store(ale->slid + k, slid);
      store(ale->past + k, fnma_(rim, load(ale->turn + k), slid));
    }
    stretch_cells(ale, y, j);
  }
  stretch_spans(ale, y);
  for (int j = 0; j < ale->np; ++j) {
    shear_of_ends(ale, j);
  }
  close_cells(ale, ale->stretch);
  close_cells(ale, ale->tension);
  close_cells(ale, ale->bent);
  for (int j = 0; j < ale->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    for (int k = arc->begin; k <= arc->begin + arc->n; k += WIDTH) {
      const vec at_node = half * (load_unaligned(ale->stretch + k - 1) + load(ale->stretch + k));
      const vec per = one / at_node;
      store(ale->per_stretch + k, per);
      store(ale->flow + k, load(ale->past + k) * per);
    }
  }
  close_nodes(ale, ale->past);
  close_nodes(ale, ale->flow);
}

/* --- the ends of wraps ----------------------------------------------------------------------- */

/* An end of a wrap: the belt touches from `begin` on, e and what waves have rolled it by. There its
 * pressure begins, and what it lacks stands further in, as what a beam does that is bent from 1 / R
 * to none. */
typedef struct wrap_end {
  bd_ale_roots roots;
  double begin, touch, over; /* what goes with the sine */
  double leans;              /* R / d times the integral of the square of its slope */
  double x, co, si;          /* the last of these, */
  double apart, by[2];       /* and what leads from it to the end of the next cell, so far on */
} wrap_end;

INLINE wrap_end end_of(const bd_ale *ale, const bd_ale_arc *arc, int span, double most,
                       double apart) {
  const bd_ale_span *of = &ale->spans[span];
  const double H = bd_at_least(of->pressing, BD_ALE_LEAST * ale->rest);
  const double c1 = ale->quadratic, c2 = ale->linear;
  const double stiff = 0.5 * (c2 + sqrt(c2 * c2 + 4.0 * c1 * H / arc->radius)); /* N / d */
  wrap_end end = {.roots = bd_ale_roots_of(ale->bending, H, stiff)};
  end.touch = bd_at_most(end.roots.touch, most);
  const int which = span == arc->before;
  const double lift = arc->side * arc->radius;
  end.begin = bd_at_most(
      bd_at_least(end.touch + lift * of->lifted[which], bd_at_most(end.touch, 0.0)), most);
  of->waves->rolled[which] = (end.begin - end.touch) / lift;
  end.over = (1.0 + end.roots.p * end.touch) / end.roots.q;
  end.leans = H / stiff * bd_ale_sloping(&end.roots);
  end.x = (double)NAN;
  end.apart = end.roots.turns > 0.0 ? apart : (double)NAN;
  bd_ale_fade(&end.roots, end.roots.turns > 0.0 ? apart : 0.0, &end.by[0], &end.by[1]);
  return end;
}

INLINE void fade_to(wrap_end *end, double x) {
  if (fabs(x - end->x - end->apart) < 1e-9 * fabs(end->apart)) {
    const double co = end->co;
    end->co = co * end->by[0] - end->si * end->by[1];
    end->si = co * end->by[1] + end->si * end->by[0];
  } else if (x != end->x) {
    bd_ale_fade(&end->roots, x, &end->co, &end->si);
  }
  end->x = x;
}

/* What is carried more than H / R from x behind the touching point on, less, over that; and its
 * integral, both 0 far from there. Added to those of the other end. */
INLINE void carry_end(wrap_end *end, double x, double sign, double *carried, double *sum) {
  if (bd_ale_slowest(&end->roots) * x < 50.0) {
    const double p = end->roots.p, q = end->roots.q, turns = end->roots.turns;
    const double e = end->touch, B = end->over;
    fade_to(end, x);
    const double co = end->co, si = end->si;
    *carried -= sign * (e * co + B * si);
    *sum += (e * (p * co - turns * q * si) + B * (p * si + q * co)) / (p * p + turns * q * q);
  }
}

/* An end of a cell as far as it lies, and what is carried there. */
typedef struct cell_end {
  double s, carried, sum;
} cell_end;

INLINE cell_end cell_end_at(wrap_end ends[2], double whole, double s) {
  const double begin = ends[0].begin, until = whole - ends[1].begin;
  cell_end at = {.s = bd_at_most(bd_at_least(s, begin), until)};
  carry_end(&ends[0], at.s - begin, 1.0, &at.carried, &at.sum);
  carry_end(&ends[1], until - at.s, -1.0, &at.carried, &at.sum);
  return at;
}

/* States that are linear between two places of a cell and 0 in the rest of what lies of it, from
 * 0 to 1: the linear ones with the same mean and first moment. */
INLINE void spread_states(double begin, double end, double *z_a, double *z_b) {
  const double part = end - begin, sum = part * (*z_a + *z_b);
  const double last = part * (begin * (*z_a + *z_b) + part * (*z_a + 2.0 * *z_b) / 3.0);
  *z_a = 2.0 * sum - 3.0 * last;
  *z_b = 3.0 * last - sum;
}

/* What lies of a cell has changed: belt that lifts off forgets its friction, what comes has the
 * states of its neighbour as far as the flow has brought it, else none. */
INLINE void lay_cell(const bd_ale *ale, const bd_ale_arc *arc, const bd_ale_state *y, int slot,
                     double from, double to, double length) {
  const double flown = 0.5 * (ale->past[slot] + ale->past[slot + 1]) * ale->elapsed / length;
  const double was_from = ale->cut_a[slot], was_to = ale->cut_b[slot], part = to - from;
  const double left = bd_at_least(from, was_from + bd_at_most(flown, 0.0));
  const double right = bd_at_most(to, was_to + bd_at_least(flown, 0.0));
  const int first = slot == arc->begin, last = slot + 1 == arc->begin + arc->n;
  for (int e = 0; e < arc->states; ++e) {
    double *a = y->z[0] + e * y->stride + slot, *b = y->z[1] + e * y->stride + slot;
    if (!(part > 0.0)) {
      *a = *b = 0.0;
    } else if (!(ale->lies[slot] > 0.0)) {
      const double comes = flown > 0.0 ? (first ? 0.0 : b[-1]) : last ? 0.0 : a[1];
      *a = *b = comes * bd_at_most(fabs(flown) / part, 1.0);
    } else {
      const double slope = (*b - *a) / (was_to - was_from);
      *b = *a + slope * (right - was_from);
      *a += slope * (left - was_from);
      if (left > from || right < to) {
        spread_states((left - from) / part, (right - from) / part, a, b);
      }
    }
  }
}

/* Belt that sinks in goes along the rim by the cosine of its slope only: the first place of
 * friction that lies, and the last, slip by that, as if they were less deep. No depth is negative.
 */
INLINE void lean_ends(bd_ale *ale, const bd_ale_arc *arc, const wrap_end ends[2], double length) {
  int first = arc->begin, last = arc->begin + arc->n - 1;
  while (first < last && !(ale->lies[first] > 0.0)) {
    ++first;
  }
  while (last > first && !(ale->lies[last] > 0.0)) {
    --last;
  }
  ale->deep_a[first] -= ends[0].leans / (length * (ale->cut_b[first] - ale->cut_a[first]));
  ale->deep_b[last] -= ends[1].leans / (length * (ale->cut_b[last] - ale->cut_a[last]));
  for (int k = arc->begin; k < arc->begin + arc->n; ++k) {
    ale->deep_a[k] = bd_at_least(ale->deep_a[k], 0.0);
    ale->deep_b[k] = bd_at_least(ale->deep_b[k], 0.0);
  }
}

/* What lies of an arc's cells, W at its ends, by what is carried up to there and its mean between,
 * and states; cells in the direction of the flow. */
INLINE void freeze_arc(bd_ale *ale, const bd_ale_state *y, int j) {
  const bd_ale_arc *arc = &ale->arcs[j];
  static const double LEAST = 0.02; /* of a cell that counts */
  const double whole = arc->radius * arc->wrap, length = whole / arc->n;
  const int back = ale->past[arc->begin] < 0.0;
  const double apart = back ? -length : length;
  wrap_end ends[2] = {end_of(ale, arc, arc->before, 0.45 * whole, apart),
                      end_of(ale, arc, j, 0.45 * whole, -apart)};
  /* belt may touch a little before the wrap begins */
  const double start = bd_at_most(ends[0].begin, 0.0);
  const double stop = whole - bd_at_most(ends[1].begin, 0.0);
  cell_end next = cell_end_at(ends, whole, back ? stop : start);
  for (int n = 0; n < arc->n; ++n) {
    const int k = back ? arc->n - 1 - n : n, slot = arc->begin + k;
    const cell_end near = next;
    const double far = n + 1 < arc->n ? (back ? k : k + 1) * length : back ? start : stop;
    next = cell_end_at(ends, whole, far);
    const cell_end a = back ? next : near, b = back ? near : next;
    const double part = b.s - a.s, mean = (b.sum - a.sum) / part;
    const int lies = part > LEAST * length;
    const double from = lies ? a.s / length - k : 0.0, to = lies ? b.s / length - k : 0.0;
    if (y) {
      lay_cell(ale, arc, y, slot, from, to, length);
    }
    ale->lies[slot] = lies ? 1.0 : 0.0;
    ale->cut_a[slot] = from;
    ale->cut_b[slot] = lies ? to : 1.0;
    ale->end_a[slot] = lies ? 2.0 * (mean - a.carried) / length : 0.0;
    ale->end_b[slot] = lies ? 2.0 * (b.carried - mean) / length : 0.0;
    ale->deep_a[slot] = lies ? 1.0 + ale->end_a[slot] / (to - from) : 1.0;
    ale->deep_b[slot] = lies ? 1.0 + ale->end_b[slot] / (to - from) : 1.0;
    const wrap_end *end = &ends[2 * k >= arc->n];
    ale->roll[slot] =
        arc->side * arc->radius / bd_at_least(end->touch, 0.5 / bd_ale_slowest(&end->roots));
  }
  lean_ends(ale, arc, ends, length);
}

static void freeze(bd_ale *ale, const bd_ale_state *y) {
  for (int j = 0; j < ale->np; ++j) {
    freeze_arc(ale, y, j);
  }
}
