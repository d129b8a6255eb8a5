/* SPDX-License-Identifier: MIT
 *
 * The Jacobian of an ALE belt, into blocks. Of its unknowns
 *
 *   m, z of both ends, v      a cell of an arc, and the node behind it in the first half of the
 * arc, before it in the second half m, z, v, m, z             the two cells in the middle of an arc
 * with the node between them m, v, v, a, p             a span with both its ends
 *
 * no block is coupled further than to its neighbours, but by the length of a cell, which the speed
 * of both its ends has to do with through v^2: 1e-5 of what else is there, left out here. Where
 * belt touches is frozen in a step; what of its load goes by the spans, cells deep, stands beside.
 */
#include <math.h>
#include <string.h>

#include "belts/ale_filling.h"

/* --- arcs ------------------------------------------------------------------------------------- */

/* Flow through a node by the metres of both its cells, and by its speed. */
typedef struct flow_slopes {
  double before, here, v;
} flow_slopes;

static flow_slopes flow_by(const filling *f, int slot) {
  const double *stretch = f->newton->slopes.stretch, per = f->ale->per_stretch[slot];
  const double falls = -0.5 * f->ale->flow[slot] * per;
  return (flow_slopes){falls * stretch[slot - 1], falls * stretch[slot], per};
}

/* Stretch of a span by a mode, over that by its metres. */
static double stretch_by_mode(const bd_ale_span *span, int n) {
  return -span->draws[n] / span->stretch;
}

/* Rows of a cell's metres and states. What runs in is of the cell before it, or behind it. */
static void fill_cell(const filling *f, int j, int k) {
  static const double upwind[2][2][3] = {{{-3.0, -1.0, 4.0}, {3.0, -1.0, -2.0}},
                                         {{1.0, -3.0, 2.0}, {1.0, 3.0, -4.0}}};
  const bd_ale *ale = f->ale;
  const bd_ale_arc *arc = &ale->arcs[j];
  const bd_ale_slopes *by = &f->newton->slopes;
  const int slot = arc->begin + k, states = arc->states;
  const bd_ale_row *row = &f->newton->cells[slot];
  const int lead = row->lead;
  double *const last = row->cells[0], *const own = row->cells[1], *const next = row->cells[2];
  double *const v = row->nodes[0], *const v_next = row->nodes[1];
  double *const rim = beside(f, f->newton->column, j, row->at);
  double *const shear = beside(f, f->newton->shear_column, end_at(ale, j, k), row->at);
  const flow_slopes in = flow_by(f, slot), out = flow_by(f, slot + 1);
  const double per_m = ale->per_m[slot];
  const double flow = 0.5 * per_m * (ale->flow[slot] + ale->flow[slot + 1]);
  const double lies = ale->lies[slot] / (ale->cut_b[slot] - ale->cut_a[slot]);
  const int back = flow < 0.0;
  last[0] = in.before;
  own[0] = in.here - out.before;
  next[0] = -out.here;
  v[0] = in.v;
  v_next[0] = -out.v;
  for (int end = 0; end < 2; ++end) {
    const double *const of = upwind[back][end];
    const double share[3] = {lies * of[0], lies * of[1], lies * of[2]};
    for (int e = 0; e < states; ++e) {
      const int r = 1 + end * states + e, at = e * f->y->stride + slot;
      const int a = (1 + e) * lead + r, b = (1 + states + e) * lead + r;
      const double comes = back ? f->y->z[0][at + 1] : f->y->z[1][at - 1];
      const double moves =
          per_m * (share[0] * f->y->z[0][at] + share[1] * f->y->z[1][at] + share[2] * comes);
      last[r] = 0.5 * moves * in.before;
      own[r] = by->rate[end][BD_ALE_M][at] + 0.5 * moves * (in.here + out.before) - flow * moves;
      next[r] = 0.5 * moves * out.here;
      v[r] = by->rate[end][BD_ALE_V][at] + 0.5 * moves * in.v;
      v_next[r] = by->rate[end][BD_ALE_V_AFTER][at] + 0.5 * moves * out.v;
      rim[r] = by->rate[end][BD_ALE_RIM][at];
      shear[r] = by->rate[end][BD_ALE_SHEAR][at];
      own[a] = flow * share[0];
      own[b] = flow * share[1];
      own[r * lead + r] += by->rate_z[end][at];
      if (k > 0) {
        last[b] = back ? 0.0 : flow * share[2];
      }
      if (k + 1 < arc->n) {
        next[a] = back ? flow * share[2] : 0.0;
      }
    }
  }
  /* a span's length is that of its modes as well */
  for (int n = 0; n < BD_ALE_MODES && k == 0; ++n) {
    const double by_mode = stretch_by_mode(&ale->spans[arc->before], n);
    for (int r = 0; r <= 2 * states; ++r) {
      last[(3 + n) * lead + r] = last[r] * by_mode;
    }
  }
  for (int n = 0; n < BD_ALE_MODES && k + 1 == arc->n; ++n) {
    const double by_mode = stretch_by_mode(&ale->spans[j], n);
    for (int r = 0; r <= 2 * states; ++r) {
      next[(3 + n) * lead + r] = next[r] * by_mode;
    }
  }
}

/* The row of a node's speed, with an arc's cells on both sides. */
static void fill_node(const filling *f, int j, int k) {
  const bd_ale_arc *arc = &f->ale->arcs[j];
  const bd_ale_slopes *by = &f->newton->slopes;
  const int slot = arc->begin + k, states = arc->states;
  const bd_ale_row *row = &f->newton->nodes[slot];
  double *const last = row->cells[0], *const next = row->cells[1];
  const double per = f->ale->per_mass[slot];
  double *const *const of_last = by->total[1], *const *const of_next = by->total[0];
  const int middle = 2 * k == arc->n, of_end = end_at(f->ale, j, k);
  *last = per * of_last[BD_ALE_M][slot - 1];
  *next = per * of_next[BD_ALE_M][slot];
  *row->nodes[0] = per * of_last[BD_ALE_V][slot - 1];
  *row->nodes[1] = per * (of_last[BD_ALE_V_AFTER][slot - 1] + of_next[BD_ALE_V][slot]);
  *row->nodes[2] = per * of_next[BD_ALE_V_AFTER][slot];
  *beside(f, f->newton->column, j, row->at) =
      per * (of_last[BD_ALE_RIM][slot - 1] + of_next[BD_ALE_RIM][slot]);
  /* in the middle the cell before is loaded by the other span */
  const double before = per * of_last[BD_ALE_SHEAR][slot - 1];
  *beside(f, f->newton->shear_column, of_end, row->at) =
      per * of_next[BD_ALE_SHEAR][slot] + (middle ? 0.0 : before);
  if (middle) {
    *beside(f, f->newton->shear_column, 2 * arc->before + 1, row->at) = before;
  }
  for (int end = 0; end < 2; ++end) {
    const double *cut = end == 0 ? f->ale->cut_a : f->ale->cut_b;
    const double behind = per * cut[slot - 1], ahead = per * (1.0 - cut[slot]);
    for (int e = 0; e < states; ++e) {
      const int at = e * f->newton->stride + slot, column = (1 + end * states + e) * row->lead;
      last[column] = behind * by->total_z[end][at - 1];
      next[column] = ahead * by->total_z[end][at];
    }
  }
}

/* --- spans ------------------------------------------------------------------------------------ */

/* Rows of a span by an unknown beside it: of its metres the rate, and what moves an end. */
static void respond(const filling *f, int i, double *to, double fills, int end, double total) {
  const bd_ale_answers *answers = &f->newton->answers[i];
  const int K = BD_ALE_MODES, moved = end == 0 ? BD_ALE_FIRST : BD_ALE_LAST;
  to[0] = fills;
  for (int k = 0; k < 2; ++k) {
    to[1 + k] = total * answers->v[k][moved] + fills * answers->v[k][BD_ALE_FILLS];
  }
  for (int n = 0; n < K; ++n) {
    to[3 + K + n] = total * answers->p[n][moved] + fills * answers->p[n][BD_ALE_FILLS];
  }
}

/* Columns of the cell and the node next to one end, which are on arc j, and of its rim. */
static void fill_beside(const filling *f, int i, int end) {
  const bd_ale_slopes *by = &f->newton->slopes;
  const int j = end == 0 ? i : f->ale->arcs[i].next,
            span = f->ale->arcs[i].begin + f->ale->arcs[i].n;
  const bd_ale_arc *arc = &f->ale->arcs[j];
  const bd_ale_row *row = &f->newton->cells[span];
  const int cell = end == 0 ? span - 1 : arc->begin, states = arc->states;
  double *const *const total = by->total[1 - end], *const to = row->cells[2 * end];
  const double fills = end == 0 ? flow_by(f, span).before : -flow_by(f, arc->begin).here;
  respond(f, i, to, fills, end, total[BD_ALE_M][cell]);
  respond(f, i, row->nodes[2 * end], 0.0, end, total[end == 0 ? BD_ALE_V : BD_ALE_V_AFTER][cell]);
  respond(f, i, beside(f, f->newton->column, j, row->at), 0.0, end, total[BD_ALE_RIM][cell]);
  respond(f, i, beside(f, f->newton->shear_column, 2 * i + end, row->at), 0.0, end,
          total[BD_ALE_SHEAR][cell]);
  for (int e = 0; e < 2 * states; ++e) {
    const int last = e >= states;
    const double cut = (last ? f->ale->cut_b : f->ale->cut_a)[cell];
    respond(f, i, to + (1 + e) * row->lead, 0.0, end,
            by->total_z[last][(e - last * states) * f->newton->stride + cell] *
                (end == 0 ? cut : 1.0 - cut));
  }
}

/* By its metres, which cells beside it ask for. */
static void fill_stretch(const filling *f, int i) {
  const bd_ale_arc *arc = &f->ale->arcs[i];
  const bd_ale_span *span = &f->ale->spans[i];
  double *stretch = f->newton->slopes.stretch;
  stretch[arc->begin + arc->n] = -span->stretch * span->per_slope / f->ale->axial;
  stretch[f->ale->arcs[arc->next].begin - 1] = stretch[arc->begin + arc->n];
}

/* The shear of an end, H (1 - s R / e times the angle by which waves lift it). */
static double shear_by(const bd_ale *ale, int i, int end, const span_move *by) {
  const bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const double roll = ale->roll[end == 0 ? arc->begin + arc->n - 1 : ale->arcs[arc->next].begin];
  const double least = BD_ALE_LEAST * ale->rest,
               moves = span->pressing > least ? by->pressing : 0.0;
  return moves * (1.0 - roll * (span->lifted[end] - span->waves->rolled[end])) -
         bd_at_least(span->pressing, least) * roll * by->lifted[end];
}

/* What the rate at which waves draw a span out goes by with a mode, under one force. */
static double drawn_by_mode(const bd_ale_span *span, int n) {
  double by = 0.5 * span->length * span->wave[n] * span->wave[n] * (1.0 + span->waves->rises[n]) *
              span->da[n];
  for (int end = 0; end < 2; ++end) {
    double turns = 0.0;
    for (int r = 0; r < BD_ALE_MODES; ++r) {
      turns += bd_ale_end_slope(span, end, r) * span->da[r];
    }
    by -= bd_ale_rolls_on(span, end) *
          (span->lifted[end] + span->pressing * span->waves->lifts[end]) *
          bd_ale_end_slope(span, end, n) * turns;
  }
  return by;
}

/* As column c. */
static void put_move(bd_ale_moves *moves, int c, const span_move *by) {
  moves->m[c] = by->m;
  moves->past[c] = by->past;
  moves->pull[c] = by->pull;
  moves->stretch[c] = by->stretch;
  moves->fills[c] = by->fills;
  moves->pressing[c] = by->pressing;
  for (int end = 0; end < 2; ++end) {
    moves->total[end][c] = by->total[end];
    moves->losing[end][c] = by->losing[end];
    moves->lifted[end][c] = by->lifted[end];
  }
  for (int n = 0; n < BD_ALE_MODES; ++n) {
    moves->a[n][c] = by->a[n];
    moves->p[n][c] = by->p[n];
  }
}

/* What is beside a span. */
static void put_moves(bd_ale_moves *moves) {
  memset(moves, 0, sizeof *moves);
  moves->total[0][BD_ALE_FIRST] = moves->total[1][BD_ALE_LAST] = moves->fills[BD_ALE_FILLS] = 1.0;
}

/* Rows of the wave along a span, of column c; by it the force on either end. */
static double by_along(const bd_ale_span *span, int c, double *to) {
  const double rate = c == 1 || c == 2 ? -BD_ALE_SHARE : c == BD_ALE_ALONG + 1 ? 1.0 : 0.0;
  const double force =
      span->along_damping * rate + (c == BD_ALE_ALONG ? span->along_stiffness : 0.0);
  to[BD_ALE_ALONG] = rate;
  to[BD_ALE_ALONG + 1] =
      -BD_ALE_SHARE / span->along_inertia * force - span->length_rate / span->length * rate;
  return force;
}

/* Columns of a span's own unknowns. */
static void fill_span(const filling *f, const bd_ale_kernels *kernels, int i) {
  const bd_ale *ale = f->ale;
  const bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int slot = arc->begin + arc->n, after = ale->arcs[arc->next].begin, K = BD_ALE_MODES;
  const int nodes[2] = {slot, after};
  const double EA = ale->axial, m = f->y->m[slot], damped = span->damping / m;
  const double apart = f->y->v[after] - f->y->v[slot], half = 0.5 * ale->density;
  const double through = half * span->past / span->stretch;
  const bd_ale_row *row = &f->newton->cells[slot];
  bd_ale_answers *answers = &f->newton->answers[i];
  const double of_v[2] = {f->newton->slopes.total[1][BD_ALE_V_AFTER][slot - 1],
                          f->newton->slopes.total[0][BD_ALE_V][after]};
  const int unknowns = bd_ale_unknowns(ale->along);
  for (int c = 0; c < unknowns; ++c) {
    const int n = c < 3 + K ? c - 3 : c - 3 - K;
    double *const to = row->cells[1] + c * row->lead;
    span_move by = {.m = c == 0 ? 1.0 : 0.0, .past = c == 1 || c == 2 ? 0.5 : 0.0};
    double elastic = 0.0, damping = 0.0, carries = 0.0, bends[2];
    if (c == 0) {
      elastic = -span->stretch * span->per_slope;
      damping = -span->damped / m;
    } else if (c < 3) {
      damping = c == 1 ? -damped : damped;
      carries = half * 0.5 * apart / span->stretch + (c == 1 ? -through : through);
    } else if (c < 3 + K) {
      by.a[n] = 1.0;
      elastic = -span->stretch * span->per_slope * stretch_by_mode(span, n);
      damping = damped * drawn_by_mode(span, n);
    } else if (c < BD_ALE_ALONG) {
      by.p[n] = 1.0;
      to[3 + n] = 1.0;
      damping = damped * span->draws[n];
    }
    const double along = ale->along ? by_along(span, c, to) : 0.0;
    by.pull = elastic + damping;
    by.stretch = elastic / EA;
    carries -= through * apart / span->stretch * by.stretch;
    const double thrown = ale->density * span->past / span->stretch;
    const double pressing =
        elastic + thrown * span->past / span->stretch * by.stretch - 2.0 * thrown * by.past;
    by.pressing = pressing;
    for (int end = 0; end < 2; ++end) {
      by.lifted[end] = span->waves->lifts[end] * pressing +
                       (c >= 3 && c < 3 + K ? bd_ale_end_slope(span, end, n) : 0.0);
    }
    const double rises = span->pressing > BD_ALE_LEAST * ale->rest ? 0.5 / span->pressing : 0.0;
    for (int end = 0; end < 2; ++end) {
      const int node = nodes[end];
      const double sign = end == 0 ? 1.0 : -1.0, per = ale->per_stretch[node];
      const double own = c == 1 + end ? 1.0 : 0.0;
      bends[end] = 0.5 * (ale->bent[node] - ale->bent[node - 1]) * per * per * by.stretch;
      const double rolls = c < 3 + K || c >= BD_ALE_ALONG ? own : bd_ale_rolls(span, end, n);
      by.losing[end] = rolls * span->per_losing[end];
      if (span->per_bending[end] > 0.0) {
        by.losing[end] +=
            span->losing[end] * span->per_bending[end] / span->per_losing[end] * rises * pressing;
      }
      by.total[end] = sign * by.pull - carries + (c == 0 ? half * by_mass(f, node) : 0.0) -
                      by.losing[end] - bends[end] + own * of_v[end] + along;
      f->newton->shear_row[2 * i + end][c] = shear_by(ale, i, end, &by);
      by.fills += sign * per * (own - 0.5 * ale->flow[node] * by.stretch);
    }
    put_move(f->newton->moves, c, &by);
    to[0] = by.fills;
    if (has_lever(ale, i) || has_lever(ale, arc->next)) {
      bd_ale_push_by_span(f, i, row->at + c, &by, pressing, bends);
    }
  }
  kernels->answer(ale, i, f->y, f->dy, f->newton->moves, answers);
  for (int c = 0; c < unknowns; ++c) {
    double *const to = row->cells[1] + c * row->lead;
    to[1] = answers->v[0][c];
    to[2] = answers->v[1][c];
    for (int n = 0; n < K; ++n) {
      to[3 + K + n] = answers->p[n][c];
    }
  }
}

void bd_ale_linearise(bd_ale_newton *newton, const bd_ale *ale, const bd_ale_kernels *kernels,
                      const bd_ale_state *y, const bd_ale_state *dy) {
  const filling f = {newton, ale, y, dy};
  for (int j = 0; j < ale->np; ++j) {
    kernels->slopes[ale->arcs[j].friction.law](ale, j, y, dy, &newton->slopes);
  }
  for (int i = 0; i < ale->np; ++i) {
    fill_stretch(&f, i);
  }
  for (int j = 0; j < ale->np; ++j) {
    const int n = ale->arcs[j].n;
    for (int k = 0; k < n; ++k) {
      fill_cell(&f, j, k);
      if (k > 0) {
        fill_node(&f, j, k);
      }
    }
    bd_ale_fill_torque(&f, j);
    if (has_lever(ale, j)) {
      bd_ale_push_by_arc(&f, j);
    }
  }
  put_moves(newton->moves);
  for (int i = 0; i < ale->np; ++i) {
    fill_span(&f, kernels, i);
    fill_beside(&f, i, 0);
    fill_beside(&f, i, 1);
    bd_ale_push_by_modes(&f, i);
    bd_ale_add_shears(&f, i);
  }
}
