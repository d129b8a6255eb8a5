/* SPDX-License-Identifier: MIT
 *
 * ALE belt (MODEL section 11): it flows through a mesh which stands still.
 */
#include <math.h>
#include <string.h>

#include "belts/ale.h"

/* --- layout ----------------------------------------------------------------------------------- */

int bd_ale_cells(double arc, double longest) {
  const int half = (int)ceil(0.5 * arc / longest);
  return half > 3 ? 2 * half : 6;
}

/* A slab has a node and a cell to copy behind its own. */
static int slots_of(int cells) {
  return (cells + 3 + BD_LANES - 1) / BD_LANES * BD_LANES;
}

int bd_ale_first_slot(const bd_ale_drive *drive, int j) {
  int slots = 0;
  for (int k = 0; k < j; ++k) {
    slots += slots_of(drive->pulleys[k].cells);
  }
  return slots;
}

static void carve_slots(bd_carver *carver, double **block, int slots) {
  double *begin = bd_carve(carver, (size_t)(BD_HALO + slots + BD_LANES), sizeof(double));
  *block = begin ? begin + BD_HALO : NULL;
}

void bd_ale_carve(bd_carver *carver, bd_ale *ale, const bd_ale_drive *drive) {
  bd_ale_table *tables;
  ale->np = drive->np;
  ale->slots = bd_ale_first_slot(drive, drive->np);
  ale->cells = 0;
  for (int j = 0; j < drive->np; ++j) {
    ale->cells += drive->pulleys[j].cells + 1;
  }
  BD_CARVE(carver, ale->arcs, drive->np);
  BD_CARVE(carver, ale->spans, drive->np);
  BD_CARVE(carver, tables, drive->np);
  BD_KEEP(carver, ale->waves, drive->np);
  for (int i = 0; i < drive->np && carver->base; ++i) {
    ale->spans[i].table = &tables[i];
    ale->spans[i].waves = &ale->waves[i];
  }
#define X(name) carve_slots(carver, &ale->name, ale->slots);
  BD_ALE_SLOTS(X)
#undef X
}

size_t bd_ale_state_size(const bd_ale_drive *drive, int states) {
  const int block = BD_HALO + bd_ale_first_slot(drive, drive->np) + BD_LANES;
  return (size_t)(block * (2 + 2 * states) + 2 * drive->np * (BD_ALE_MODES + 1));
}

bd_ale_state bd_ale_state_in(const bd_ale *ale, int states, double *block) {
  const int stride = BD_HALO + ale->slots + BD_LANES;
  bd_ale_state at = {.stride = stride};
  at.m = block + BD_HALO;
  at.v = at.m + stride;
  at.z[0] = at.v + stride;
  at.z[1] = at.z[0] + states * stride;
  at.a = at.z[1] + states * stride - BD_HALO;
  at.p = at.a + ale->np * BD_ALE_MODES;
  at.along = at.p + ale->np * BD_ALE_MODES;
  at.along_speed = at.along + ale->np;
  return at;
}

/* --- what of the path bends are worth --------------------------------------------------------- */

/* Slopes of a cubic spline through values at equal distances, times the distance; its third
 * derivative is continuous at the last knot but one of either end ("not a knot"). */
static void lay_spline(const double *value, double *slope) {
  enum { N = BD_ALE_KNOTS };
  double over[N], rhs[N];
  const double rise[2] = {value[1] - value[0], value[2] - value[1]};
  const double last[2] = {value[N - 1] - value[N - 2], value[N - 2] - value[N - 3]};
  over[0] = 2.0;
  rhs[0] = 0.5 * (5.0 * rise[0] + rise[1]);
  for (int i = 1; i < N - 1; ++i) {
    const double pivot = 4.0 - over[i - 1];
    over[i] = 1.0 / pivot;
    rhs[i] = (3.0 * (value[i + 1] - value[i - 1]) - rhs[i - 1]) / pivot;
  }
  slope[N - 1] = (0.5 * (5.0 * last[0] + last[1]) - 2.0 * rhs[N - 2]) / (1.0 - 2.0 * over[N - 2]);
  for (int i = N - 2; i >= 0; --i) {
    slope[i] = rhs[i] - over[i] * slope[i + 1];
  }
}

/* At one end of a span: delta (MODEL section 11.2), and what the lower tension of an arc, which
 * here reaches to l / 2 from its end, is worth. As bd_shorter_at_end, but for the tension of the
 * arc on it and the free part as an elastica. */
static double shorter_at(const bd_ale *ale, double pull, double R) {
  const double stretch = 1.0 + pull / ale->axial, EI = ale->bending;
  if (!(EI > 0.0)) {
    const double deep = bd_contact_depth(ale->quadratic, ale->linear, pull * stretch / R);
    return bd_shorter_at_end(pull * stretch, 0.0, R, deep);
  }
  const double SHARPEST = 0.7; /* sine of half the angle by which belt turns before it touches */
  const double lower = fmax(pull - EI / (2.0 * R * R), 0.5 * pull);
  const double p = bd_contact_depth(ale->quadratic, ale->linear, lower * stretch / R);
  const double tau = lower / EI, l = sqrt(EI / pull), P = sqrt(tau / (R * p));
  const double S = sqrt(tau + 2.0 * P);
  double b = 0.0, half = 0.0;
  for (int k = 0; k < 40; ++k) { /* by more than a digit a turn */
    const double along = sqrt(1.0 - half * half) / l;
    b = (S * tau / P + (tau / P + 1.0) * along) / (R * (tau + P + S * along));
    half = fmin(0.5 * l * (1.0 / R + P * p - S * b), SHARPEST);
  }
  const double foot = 2.0 * asin(half) - b;
  return (b - S * p) / (P * R) + (R - p) * foot - R * sin(foot) -
         2.0 * l * (1.0 - sqrt(1.0 - half * half)) - 0.25 * (b * b + P * p * p) / S +
         l * EI / (4.0 * ale->axial * R * R);
}

static void lay_table(const bd_ale *ale, int i, bd_ale_table *table) {
  const double knot = log(BD_ALE_MOST / BD_ALE_LEAST) / (BD_ALE_KNOTS - 1);
  for (int k = 0; k < BD_ALE_KNOTS; ++k) {
    const double H = ale->rest * BD_ALE_LEAST * exp(k * knot);
    table->value[k] = -shorter_at(ale, H, ale->arcs[i].radius) -
                      shorter_at(ale, H, ale->arcs[ale->arcs[i].next].radius);
    table->by_knot[k] = table->value[k] * H * knot;
  }
  lay_spline(table->value, table->slope);
  /* the integral of X dH = X H du, by a spline of its own */
  lay_spline(table->by_knot, table->by_slope);
  table->sum[0] = 0.0;
  for (int k = 0; k + 1 < BD_ALE_KNOTS; ++k) {
    table->sum[k + 1] = table->sum[k] + 0.5 * (table->by_knot[k] + table->by_knot[k + 1]) +
                        (table->by_slope[k] - table->by_slope[k + 1]) / 12.0;
  }
}

/* --- make ------------------------------------------------------------------------------------- */

static void make_modes(bd_ale *ale) {
  const double third[3] = {1.0 / 3.0, 1.0 / 6.0, 1.0 / 3.0};
  memcpy(ale->left_over, third, sizeof third);
  for (int i = 0; i < BD_ALE_MODES; ++i) {
    const double n = i + 1, odd = i % 2 == 0 ? 1.0 : 0.0;
    ale->odd[i] = odd / (n * BD_PI);
    ale->parts[0][i] = 2.0 / (n * BD_PI);
    ale->parts[1][i] = (2.0 * odd - 1.0) * ale->parts[0][i];
    ale->left_over[0] -= 0.5 * ale->parts[0][i] * ale->parts[0][i];
    ale->left_over[1] -= 0.5 * ale->parts[0][i] * ale->parts[1][i];
    ale->left_over[2] -= 0.5 * ale->parts[1][i] * ale->parts[1][i];
  }
}

/* Of a cell that is stretched belt sinks in by k R / (1 + k) of what it is drawn out by, k by their
 * stiffness; the rest is its own. */
static void damp_arc(const bd_ale *ale, bd_ale_arc *arc, double damping) {
  const double R = arc->radius,
               depth = bd_contact_depth(ale->quadratic, ale->linear, ale->rest / R);
  const double k = ale->axial / ((ale->linear + 2.0 * ale->quadratic * depth) * R * R);
  const double own = 1.0 / (1.0 + k), sinks = k * R * own;
  arc->axial_part = ale->axial_damping * own * own;
  arc->damping = arc->axial_part + damping * sinks * sinks;
}

/* Depth behind where belt touches, and its slope. */
static double depth_at(const bd_ale_roots *end, double depth, double in, double *slope) {
  const bd_ale_fading sunk = bd_ale_sinks(end), slopes = bd_ale_slope_of(end, sunk);
  double co, si;
  bd_ale_fade(end, in, &co, &si);
  *slope = depth * (slopes.co * co + slopes.si * si);
  return depth * (1.0 + sunk.co * co + sunk.si * si);
}

/* What contact dampers of one take at the end of a wrap: of belt that runs on or off there, over
 * the speed squared, the integral of d'^2; as the force rises, by Simpson's rule, that of its rate
 * squared, less what the arc's cells take. */
static void sinks_at(const bd_ale *ale, double R, double *running, double *pressed) {
  enum { STEPS = 1000 };
  const double SMALL = 1e-5, FAR = 16.0, H = ale->rest, per = 0.5 / (SMALL * H);
  double depth[3];
  bd_ale_roots end[3];
  for (int k = 0; k < 3; ++k) {
    const double force = H * (1.0 + (k - 1) * SMALL);
    depth[k] = bd_contact_depth(ale->quadratic, ale->linear, force / R);
    end[k] = bd_ale_roots_of(ale->bending, force, force / (R * depth[k]));
  }
  const double step = FAR / (bd_ale_slowest(&end[1]) * STEPS),
               rolls = (end[2].touch - end[0].touch) * per;
  const double everywhere = (depth[2] - depth[0]) * per;
  *running = depth[1] * depth[1] * bd_ale_sloping(&end[1]);
  *pressed = -end[1].touch * everywhere * everywhere;
  for (int k = 0; k <= STEPS; ++k) {
    const double part = step / 3.0 * (k == 0 || k == STEPS ? 1.0 : k % 2 == 1 ? 4.0 : 2.0);
    double slope, unused;
    depth_at(&end[1], depth[1], k * step, &slope);
    const double rises = (depth_at(&end[2], depth[2], k * step, &unused) -
                          depth_at(&end[0], depth[0], k * step, &unused)) *
                             per -
                         slope * rolls;
    *pressed += part * (rises * rises - everywhere * everywhere);
  }
}

/* The integral of the square of the curvature's slope at the end of a wrap, over 1 / 2 R^2 l: up to
 * where it touches curvature rises as exp(x / l), not to 1 / R, which it has far behind only. */
static double bends_at(const bd_ale *ale, double R) {
  const double H = ale->rest, depth = bd_contact_depth(ale->quadratic, ale->linear, H / R);
  const bd_ale_roots end = bd_ale_roots_of(ale->bending, H, H / (R * depth));
  const bd_ale_fading slope = bd_ale_slope_of(&end, bd_ale_sinks(&end)),
                      bend = bd_ale_slope_of(&end, slope);
  const double touches = 1.0 + R * depth * bend.co, off = R * depth;
  return touches * touches + 2.0 * sqrt(ale->bending / H) * off * off *
                                 bd_ale_square_of(&end, bd_ale_slope_of(&end, bend));
}

/* The straight part's line is off the pulley by what bending and contact store per metre of belt
 * on it, over the force: as a wrap grows, the work of that is what they gain. */
static void raise_line(const bd_ale *ale, bd_ale_arc *arc) {
  const double stretch = 1.0 + ale->rest / ale->axial, R = arc->radius;
  const double depth = bd_contact_depth(ale->quadratic, ale->linear, ale->rest * stretch / R);
  arc->moment = ale->bending * stretch / (2.0 * R) + bd_ale_pressed(ale, depth) * R / stretch;
  arc->line_radius = R + arc->raised - depth + arc->moment / ale->rest;
}

static void make_arc(bd_ale *ale, const bd_ale_drive *drive, int j, int begin) {
  bd_ale_arc *arc = &ale->arcs[j];
  const bd_ale_pulley *pulley = &drive->pulleys[j];
  *arc = (bd_ale_arc){
      .begin = begin,
      .n = pulley->cells,
      .slots = slots_of(pulley->cells),
      .before = (j + ale->np - 1) % ale->np,
      .next = (j + 1) % ale->np,
      .side = pulley->side,
      .sense = drive->direction * pulley->side,
      .radius = pulley->radius,
      .raised = pulley->raised,
      .axis = {.c = {pulley->center[0], pulley->center[1]}},
  };
  raise_line(ale, arc);
  if (pulley->friction) {
    const int law = pulley->friction->law;
    arc->friction = *pulley->friction;
    arc->states = bd_friction_states(pulley->friction);
    arc->held = law != BD_LAW_NONE && isfinite(bd_kernels_baseline->bound[law](pulley->friction));
  }
  damp_arc(ale, arc, pulley->damping);
  for (int k = 0; k < arc->slots; ++k) {
    ale->fraction[begin + k] = (double)k / arc->n;
    ale->is_cell[begin + k] = k < arc->n ? 1.0 : 0.0;
    ale->end_a[begin + k] = ale->end_b[begin + k] = ale->roll[begin + k] = 0.0;
    ale->deep_a[begin + k] = ale->deep_b[begin + k] = 1.0;
    ale->cut_a[begin + k] = 0.0;
    ale->cut_b[begin + k] = 1.0;
    ale->lies[begin + k] = ale->is_cell[begin + k];
  }
}

void bd_ale_make(bd_ale *ale, const bd_ale_drive *drive) {
  ale->direction = drive->direction;
  ale->density = drive->linear_density;
  ale->axial = drive->axial_stiffness;
  ale->axial_damping = drive->axial_damping;
  ale->bending = drive->bending_stiffness;
  ale->bending_damping = drive->bending_damping;
  ale->quadratic = drive->quadratic;
  ale->linear = drive->linear;
  memcpy(ale->gravity, drive->gravity, sizeof ale->gravity);
  ale->rest = drive->rest;
  ale->moving = drive->moving;
  ale->along = drive->along;
  make_modes(ale);
  for (int j = 0, begin = 0; j < ale->np; begin += ale->arcs[j++].slots) {
    make_arc(ale, drive, j, begin);
  }
  for (int i = 0; i < ale->np; ++i) {
    bd_ale_span *span = &ale->spans[i];
    const bd_ale_arc *from = &ale->arcs[i], *to = &ale->arcs[from->next];
    span->curvature[0] = from->side / from->radius;
    span->curvature[1] = to->side / to->radius;
    span->tilt = from->side * from->moment - to->side * to->moment;
    span->raised =
        from->side * (from->line_radius - from->radius) - to->side * (to->line_radius - to->radius);
    const double *a = from->axis.c, *b = to->axis.c;
    const double rises = from->side * from->line_radius - to->side * to->line_radius;
    const double apart = hypot(b[0] - a[0], b[1] - a[1]);
    span->length = sqrt(apart * apart - rises * rises);
    bd_ale_fit_waves(ale, span);
    for (int end = 0; end < 2; ++end) {
      const bd_ale_pulley *on = &drive->pulleys[end == 0 ? i : from->next];
      double pressed;
      sinks_at(ale, on->radius, &span->sinks[end], &pressed);
      span->sinks[end] *= on->damping;
      span->damps[end] = ale->bending > 0.0 ? bends_at(ale, on->radius) : 0.0;
      span->pressed += on->damping * pressed;
    }
    span->rolls[0] = from->side * from->radius;
    span->rolls[1] = -to->side * to->radius;
    lay_table(ale, i, (bd_ale_table *)span->table);
    bd_ale_hold_waves(ale, span, ale->rest);
  }
}

/* A span's path grows shorter as its tension rises, so that its ends move further apart than it is
 * stretched: at rest by 1 / share, and the damper feels the square of that. */
void bd_ale_damp_spans(bd_ale *ale) {
  for (int i = 0; i < ale->np; ++i) {
    bd_ale_span *span = &ale->spans[i];
    memcpy(span->slope, span->waves->rest, sizeof span->slope);
    bd_ale_baseline.path(ale, span, ale->rest); /* where waves rest, and they rest there */
    memcpy(span->ab, span->rest, sizeof span->ab);
    const bd_ale_path path = bd_ale_baseline.path(ale, span, ale->rest);
    const double stretches = (span->length + path.x) / (ale->axial + ale->rest);
    const double share = stretches / fmax(stretches - path.slope, 0.1 * stretches);
    const double pressed = span->pressed * ale->axial / stretches; /* as H rises */
    span->axial_part = ale->axial_damping * share * share;
    span->damping = span->axial_part + pressed * share * share;
  }
}

/* --- energy ----------------------------------------------------------------------------------- */

/* The integral of X(H) from the table's beginning, without the part of 1/S. */
static double sum_of_x(const bd_ale *ale, const bd_ale_table *table, double h) {
  const double least = BD_ALE_LEAST * ale->rest, most = BD_ALE_MOST * ale->rest;
  const double knot = log(BD_ALE_MOST / BD_ALE_LEAST) / (BD_ALE_KNOTS - 1);
  const double at = log(fmin(fmax(h, least), most) / least) / knot;
  const int i = at < BD_ALE_KNOTS - 2 ? (int)at : BD_ALE_KNOTS - 2;
  const double s = at - i, first = table->by_slope[i], last = table->by_slope[i + 1];
  const double rise = table->by_knot[i + 1] - table->by_knot[i];
  const double b = 3.0 * rise - 2.0 * first - last, c = first + last - 2.0 * rise;
  return table->sum[i] + s * (table->by_knot[i] + s * (0.5 * first + s * (b / 3.0 + 0.25 * s * c)));
}

/* What bending stores in a span as H changes, and in its waves. */
static double bending_of_span(const bd_ale *ale, const bd_ale_span *span) {
  const double h = span->pressing, S = span->length, off = 1.0 - h / ale->rest;
  double sum = sum_of_x(ale, span->table, h) + span->tilt * span->tilt / h * off * off / (2.0 * S);
  for (int n = 0; n < BD_ALE_MODES; ++n) {
    const double apart = span->ab[n] - span->rest[n], k2 = span->wave[n] * span->wave[n];
    sum += 0.25 * S * k2 * (h + bd_ale_stiff(span, n, h)) * apart * apart;
  }
  for (int end = 0; end < 2; ++end) {
    const double angle = span->lifted[end];
    sum -= h * bd_ale_rolls_on(span, end) * angle * angle * angle / 6.0;
  }
  return sum - h * span->path;
}

static void energy_of_span(const bd_ale *ale, const bd_ale_state *y, int i, bd_ale_energy *sum) {
  const bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *from = &ale->arcs[i], *to = &ale->arcs[from->next];
  const int k = from->begin + from->n, after = to->begin;
  const double mass = ale->density * y->m[k], apart = y->v[after] - y->v[k];
  const double first = ale->across[k], last = ale->across[after], c = span->past;
  sum->bending += bending_of_span(ale, span);
  sum->kinetic += 0.5 * mass *
                      (ale->left_over[0] * first * first + 2.0 * ale->left_over[1] * first * last +
                       ale->left_over[2] * last * last) -
                  mass / 12.0 * apart * apart;
  for (int n = 0; n < BD_ALE_MODES; ++n) {
    const double p = y->p[i * BD_ALE_MODES + n] + c * span->ga[n];
    const double slope = span->wave[n] * span->ab[n];
    const double along = 1.0 / span->waves->eased[n] - 1.0;
    sum->lateral += 0.25 * mass *
                    (along * span->da[n] * span->da[n] + p * p +
                     c * c * (slope * slope - span->ga[n] * span->ga[n]));
  }
  if (ale->along) {
    const double w = y->along[i], rate = span->along_rate, per = 0.5 / BD_ALE_SHARE;
    const double ends = BD_ALE_SHARE * (y->v[k] + y->v[after]);
    sum->axial += per * span->along_stiffness * w * w;
    sum->kinetic += per / BD_ALE_SHARE * span->along_inertia * rate * (rate + 2.0 * ends);
  }
}

bd_ale_energy bd_ale_energy_of(const bd_ale *ale, const bd_ale_state *y) {
  const double EA = 0.5 * ale->axial, half = 0.5 * ale->density;
  const double *const m = y->m, *const on = ale->is_cell;
  bd_ale_energy sum = {.axial = 0.0};
  for (int j = 0; j < ale->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    double axial = 0.0, kinetic = 0.0, contact = 0.0, bending = 0.0;
    for (int k = arc->begin; k <= arc->begin + arc->n; ++k) {
      const double strain = ale->stretch[k] - 1.0, v = y->v[k], across = ale->across[k];
      const double mass = half * (m[k] + m[k - 1]);
      const double own = half * (on[k] * m[k] + on[k - 1] * m[k - 1]);
      axial += EA * strain * strain * m[k];
      kinetic += 0.5 * (mass * v * v + own * across * across);
    }
    for (int k = arc->begin; k < arc->begin + arc->n; ++k) {
      const double pressed = bd_ale_pressed(ale, ale->sink[k]);
      contact += pressed * m[k];
      bending += (ale->bent[k] + pressed) * m[k];
    }
    sum.axial += axial;
    sum.kinetic += kinetic;
    sum.contact += contact;
    sum.bending += bending;
    energy_of_span(ale, y, j, &sum);
  }
  return sum;
}

/* What a damper of one along the cells of an arc takes. */
static double drawn_on(const bd_ale *ale, const bd_ale_state *y, int j) {
  const bd_ale_arc *arc = &ale->arcs[j];
  double sum = 0.0;
  for (int k = arc->begin; k < arc->begin + arc->n; ++k) {
    const double apart = ale->slid[k + 1] - ale->slid[k];
    sum += apart * apart / y->m[k];
  }
  return sum;
}

/* At which belt runs off (end 0), or on. */
static double end_speed(const bd_ale_span *span, int end) {
  return span->per_losing[end] > 0.0 ? span->losing[end] / span->per_losing[end] : 0.0;
}

void bd_ale_lose_in_contact(bd_ale *ale, const bd_ale_state *y) {
  for (int j = 0; j < ale->np; ++j) {
    bd_ale_arc *arc = &ale->arcs[j];
    const bd_ale_span *in = &ale->spans[arc->before], *out = &ale->spans[j];
    const double on = end_speed(in, 1), off = end_speed(out, 0);
    const double m = y->m[arc->begin + arc->n]; /* both ends of a span are pressed together */
    arc->contact_loss = drawn_on(ale, y, j) * (arc->damping - arc->axial_part) +
                        out->drawn * out->drawn / m * (out->damping - out->axial_part) +
                        in->sinks[1] * on * on + out->sinks[0] * off * off;
  }
}

/* Damping along the belt and of its spans, and friction. */
bd_ale_losses bd_ale_losses_of(const bd_ale *ale, const bd_ale_state *y) {
  bd_ale_losses lost = {.axial = 0.0};
  for (int j = 0; j < ale->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    const bd_ale_span *span = &ale->spans[j];
    const double m = y->m[arc->begin + arc->n];
    lost.axial +=
        span->drawn * span->drawn / m * span->axial_part + drawn_on(ale, y, j) * arc->axial_part;
    for (int n = 0; n < BD_ALE_MODES; ++n) {
      const double k2 = span->wave[n] * span->wave[n];
      lost.bending +=
          0.5 * ale->bending_damping * span->length * k2 * k2 * span->da[n] * span->da[n];
    }
    for (int end = 0; end < 2; ++end) {
      const double speed = end_speed(span, end);
      lost.bending += span->per_bending[end] * speed * speed;
    }
    lost.axial += span->along_damping * span->along_rate * span->along_rate / BD_ALE_SHARE;
    lost.friction += arc->slip_loss;
  }
  return lost;
}
