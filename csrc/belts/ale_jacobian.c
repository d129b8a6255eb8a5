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

#include "belts/ale.h"

/* --- entries ---------------------------------------------------------------------------------- */

/* An unknown. */
typedef struct place {
  int block, at;
} place;

typedef struct filling {
  bd_ale_newton *newton;
  const bd_ale *ale;
  const bd_ale_state *y, *dy;
} filling;

static place cell_at(const filling *f, int slot) {
  return (place){f->newton->cell_block[slot], f->newton->cell_at[slot]};
}

static place node_at(const filling *f, int slot) {
  return (place){f->newton->node_block[slot], f->newton->node_at[slot]};
}

/* The entry of a row; those of the unknowns beside are one further, of columns `lead` further. */
static double *entry(const filling *f, place row, place column) {
  const bd_ale_ring *ring = &f->newton->ring;
  const bd_ale_block *block = &ring->blocks[row.block];
  const int ahead = row.block + 1 < ring->n ? row.block + 1 : 0;
  double *of = column.block == row.block ? block->own
               : column.block == ahead   ? block->ahead
                                         : block->back;
  return of + column.at * block->lead + row.at;
}

/* An unknown's number in one of the vectors beside the ring, of pulley j. */
static double *beside(const filling *f, double *vectors, int j, place at) {
  const bd_ale_ring *ring = &f->newton->ring;
  return vectors + j * ring->unknowns + ring->blocks[at.block].at + at.at;
}

/* --- arcs ------------------------------------------------------------------------------------- */

/* The end of a span that loads a cell of arc j. */
static int end_at(const bd_ale *ale, int j, int k) {
  return 2 * k < ale->arcs[j].n ? 2 * ale->arcs[j].before + 1 : 2 * j;
}

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
  return -0.5 * span->length * span->wave[n] * span->wave[n] * span->ab[n] / span->stretch;
}

/* Rows of a cell's metres and states. What runs in is of the cell before it, or behind it. */
static void fill_cell(const filling *f, int j, int k) {
  static const double upwind[2][2][3] = {{{-3.0, -1.0, 4.0}, {3.0, -1.0, -2.0}},
                                         {{1.0, -3.0, 2.0}, {1.0, 3.0, -4.0}}};
  const bd_ale *ale = f->ale;
  const bd_ale_arc *arc = &ale->arcs[j], *behind = &ale->arcs[arc->before];
  const bd_ale_slopes *by = &f->newton->slopes;
  const int slot = arc->begin + k, states = arc->states;
  const int before = k > 0 ? slot - 1 : behind->begin + behind->n;
  const place row = cell_at(f, slot);
  const int lead = f->newton->ring.blocks[row.block].lead;
  double *const last = entry(f, row, cell_at(f, before)), *const own = entry(f, row, row);
  double *const next = entry(f, row, cell_at(f, slot + 1));
  double *const v = entry(f, row, node_at(f, slot)), *const v_next =
                                                         entry(f, row, node_at(f, slot + 1));
  double *const rim = beside(f, f->newton->column, j, row);
  double *const shear = beside(f, f->newton->shear_column, end_at(ale, j, k), row);
  const flow_slopes in = flow_by(f, slot), out = flow_by(f, slot + 1);
  const double per_m = 1.0 / f->y->m[slot];
  const double flow = 0.5 * per_m * (ale->flow[slot] + ale->flow[slot + 1]);
  const double lies = ale->lies[slot] / (ale->cut_b[slot] - ale->cut_a[slot]);
  const int back = flow < 0.0;
  last[0] = in.before;
  own[0] = in.here - out.before;
  next[0] = -out.here;
  v[0] = in.v;
  v_next[0] = -out.v;
  for (int e = 0; e < 2 * states; ++e) {
    const int end = e / states, row_e = 1 + e, at = e % states * f->y->stride + slot;
    const double share[3] = {lies * upwind[back][end][0], lies * upwind[back][end][1],
                             lies * upwind[back][end][2]};
    const double a = f->y->z[0][at], b = f->y->z[1][at];
    const double comes = back ? f->y->z[0][at + 1] : f->y->z[1][at - 1];
    const double moves = per_m * (share[0] * a + share[1] * b + share[2] * comes);
    last[row_e] = 0.5 * moves * in.before;
    own[row_e] = by->rate[end][BD_ALE_M][at] + 0.5 * moves * (in.here + out.before) - flow * moves;
    next[row_e] = 0.5 * moves * out.here;
    v[row_e] = by->rate[end][BD_ALE_V][at] + 0.5 * moves * in.v;
    v_next[row_e] = by->rate[end][BD_ALE_V_AFTER][at] + 0.5 * moves * out.v;
    rim[row_e] = by->rate[end][BD_ALE_RIM][at];
    shear[row_e] = by->rate[end][BD_ALE_SHEAR][at];
    own[(1 + e % states) * lead + row_e] = flow * share[0];
    own[(1 + states + e % states) * lead + row_e] = flow * share[1];
    own[row_e * lead + row_e] += by->rate_z[end][at];
    if (k > 0) {
      last[(1 + states + e % states) * lead + row_e] = back ? 0.0 : flow * share[2];
    }
    if (k + 1 < arc->n) {
      next[(1 + e % states) * lead + row_e] = back ? flow * share[2] : 0.0;
    }
  }
  /* a span's length is that of its modes as well */
  for (int n = 0; n < BD_ALE_MODES; ++n) {
    for (int r = 0; r <= 2 * states && k == 0; ++r) {
      last[(3 + n) * lead + r] = last[r] * stretch_by_mode(&ale->spans[arc->before], n);
    }
    for (int r = 0; r <= 2 * states && k + 1 == arc->n; ++r) {
      next[(3 + n) * lead + r] = next[r] * stretch_by_mode(&ale->spans[j], n);
    }
  }
}

/* The row of a node's speed, with an arc's cells on both sides. */
static void fill_node(const filling *f, int j, int k) {
  const bd_ale_arc *arc = &f->ale->arcs[j];
  const bd_ale_slopes *by = &f->newton->slopes;
  const int slot = arc->begin + k, states = arc->states;
  const place row = node_at(f, slot);
  const int lead = f->newton->ring.blocks[row.block].lead;
  double *const last = entry(f, row, cell_at(f, slot - 1)), *const next =
                                                                entry(f, row, cell_at(f, slot));
  const double per = 2.0 / (f->ale->density * (f->y->m[slot] + f->y->m[slot - 1]));
  double *const *const of_last = by->total[1], *const *const of_next = by->total[0];
  *last = per * of_last[BD_ALE_M][slot - 1];
  *next = per * of_next[BD_ALE_M][slot];
  *entry(f, row, node_at(f, slot - 1)) = per * of_last[BD_ALE_V][slot - 1];
  *entry(f, row, row) = per * (of_last[BD_ALE_V_AFTER][slot - 1] + of_next[BD_ALE_V][slot]);
  *entry(f, row, node_at(f, slot + 1)) = per * of_next[BD_ALE_V_AFTER][slot];
  *beside(f, f->newton->column, j, row) =
      per * (of_last[BD_ALE_RIM][slot - 1] + of_next[BD_ALE_RIM][slot]);
  double *const shear = f->newton->shear_column;
  *beside(f, shear, end_at(f->ale, j, k), row) = 0.0;
  *beside(f, shear, end_at(f->ale, j, k - 1), row) = per * of_last[BD_ALE_SHEAR][slot - 1];
  *beside(f, shear, end_at(f->ale, j, k), row) += per * of_next[BD_ALE_SHEAR][slot];
  for (int e = 0; e < states; ++e) {
    const int at = e * f->newton->stride + slot;
    for (int end = 0; end < 2; ++end) {
      const double *cut = end == 0 ? f->ale->cut_a : f->ale->cut_b;
      last[(1 + end * states + e) * lead] = per * by->total_z[end][at - 1] * cut[slot - 1];
      next[(1 + end * states + e) * lead] = per * by->total_z[end][at] * (1.0 - cut[slot]);
    }
  }
}

/* The torque on a pulley by its arc. */
static void fill_torque(const filling *f, int j) {
  const bd_ale_arc *arc = &f->ale->arcs[j];
  const bd_ale_slopes *by = &f->newton->slopes;
  double *const row = f->newton->row, *const *const torque = by->torque;
  memset(row + j * f->newton->ring.unknowns, 0, (size_t)f->newton->ring.unknowns * sizeof *row);
  f->newton->own[j] = f->newton->shear_torque[end_at(f->ale, j, 0)] =
      f->newton->shear_torque[2 * j] = 0.0;
  for (int slot = arc->begin; slot < arc->begin + arc->n; ++slot) {
    const double part = f->ale->cut_b[slot] - f->ale->cut_a[slot];
    const double before = slot > arc->begin ? torque[BD_ALE_V_AFTER][slot - 1] : 0.0;
    double *const cell = beside(f, row, j, cell_at(f, slot));
    *beside(f, row, j, node_at(f, slot)) = torque[BD_ALE_V][slot] + before;
    *beside(f, row, j, node_at(f, slot + 1)) = torque[BD_ALE_V_AFTER][slot];
    cell[0] = torque[BD_ALE_M][slot];
    f->newton->own[j] += torque[BD_ALE_RIM][slot];
    f->newton->shear_torque[end_at(f->ale, j, slot - arc->begin)] += torque[BD_ALE_SHEAR][slot];
    for (int e = 0; e < 2 * arc->states; ++e) {
      const double more = (e < arc->states ? f->ale->end_a : f->ale->end_b)[slot];
      const double deep = bd_at_least(part + more, 0.0) / part;
      cell[1 + e] = -arc->sense * (arc->radius + arc->raised - f->ale->sink[slot] * deep) *
                    by->total_z[e / arc->states][e % arc->states * f->newton->stride + slot];
    }
  }
}

/* --- spans ------------------------------------------------------------------------------------ */

/* More of all that a span's rates depend on. */
typedef struct span_move {
  double m, past, pull, stretch, fills, total[2], losing[2], a[BD_ALE_MODES], p[BD_ALE_MODES];
} span_move;

/* What all answers of a span have in common; of modes k^2 (a + b), p~' without c', what bending of
 * waves and its damper pull, what bends and dampers at both ends do, by what these. */
typedef struct span_at {
  double m, per_mp, pull, fills, v[2], k2[BD_ALE_MODES], kappa[BD_ALE_MODES], own[BD_ALE_MODES];
  double bends[BD_ALE_MODES], driven[BD_ALE_MODES], rolls[2][BD_ALE_MODES];
} span_at;

static span_at at_span(const filling *f, int i) {
  const bd_ale *ale = f->ale;
  const bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int slot = arc->begin + arc->n;
  span_at at = {.m = f->y->m[slot],
                .per_mp = span->stretch / ale->density,
                .pull = span->elastic + span->damped,
                .fills = f->dy->m[slot] / f->y->m[slot],
                .v = {f->dy->v[slot], f->dy->v[ale->arcs[arc->next].begin]}};
  for (int n = 0; n < BD_ALE_MODES; ++n) {
    at.k2[n] = span->wave[n] * span->wave[n];
    at.kappa[n] = at.k2[n] * span->ab[n];
    at.own[n] = span->dp[n] + span->quickens * span->ga[n];
    at.bends[n] = span->stiff[n] * span->ab[n] + ale->bending_damping * span->da[n];
    at.rolls[0][n] = bd_ale_rolls(span, 0, n);
    at.rolls[1][n] = bd_ale_rolls(span, 1, n);
    at.driven[n] =
        span->moment[n] - (span->losing[0] * at.rolls[0][n] + span->losing[1] * at.rolls[1][n]);
  }
  return at;
}

static bd_ale_answer answer_of(const filling *f, int i, const span_at *at, const span_move *by) {
  const bd_ale *ale = f->ale;
  const bd_ale_span *span = &ale->spans[i];
  const int K = BD_ALE_MODES;
  const double m = at->m, per_S = 1.0 / span->length, c = span->past, density = ale->density;
  const double per_mp = at->per_mp, per_mp_by = by->stretch / density, *v = at->v;
  const double fills_by = (by->fills - at->fills * by->m) / m;
  const double lifts = at->pull * per_mp - c * c;
  const double lifts_by = by->pull * per_mp + at->pull * per_mp_by - 2.0 * c * by->past;
  double dp[BD_ALE_MODES], first = 0.0, added = 0.0, lateral = 0.0, draws = 0.0;
  for (int n = 0; n < K; ++n) {
    double ga_by = 0.0, gda_by = 0.0;
    for (int r = 1 - n % 2; r < K; r += 2) {
      ga_by += ale->gyro[n][r] * by->a[r];
      gda_by += ale->gyro[n][r] * by->p[r];
    }
    ga_by *= per_S;
    gda_by *= per_S;
    const double k2 = at->k2[n], ab = span->ab[n], da = span->da[n], ga = span->ga[n];
    const double kappa = at->kappa[n], kappa_by = k2 * by->a[n];
    const double bends_by = span->stiff[n] * by->a[n] + ale->bending_damping * by->p[n];
    const double resists_by = by->losing[0] * at->rolls[0][n] + by->losing[1] * at->rolls[1][n];
    dp[n] = -2.0 * (by->past * span->gda[n] + c * gda_by) - lifts_by * kappa - lifts * kappa_by -
            k2 * k2 * (per_mp_by * at->bends[n] + per_mp * bends_by) +
            2.0 * per_S * (at->driven[n] * per_mp_by - resists_by * per_mp) +
            ale->odd[n] * 8.0 * ale->direction * span->turning * by->past -
            fills_by * (da + c * ga) - at->fills * (by->p[n] + by->past * ga + c * ga_by);
    draws += bd_ale_draws(span, n) * by->p[n];
    first += dp[n] * ga + at->own[n] * ga_by +
             2.0 * (by->past * kappa * da + c * kappa_by * da + c * kappa * by->p[n]);
    added += kappa_by * ab + kappa * by->a[n] - 2.0 * ga * ga_by;
    lateral += 2.0 * da * by->p[n] - 2.0 * c * by->past * kappa * ab -
               c * c * (kappa_by * ab + kappa * by->a[n]);
    dp[n] -= span->quickens * ga_by;
  }
  first = 0.5 * density * m * first + span->first * by->m / m +
          span->carried * span->per_path * (draws - span->stretch * by->fills);
  added = 0.25 * (0.5 * density * m * added + span->added * by->m / m);
  lateral = 0.25 / per_mp * lateral - span->lateral * by->stretch / span->stretch;
  const double mu = density * by->m / 6.0;
  const double f_0 =
      by->total[0] + lateral - 0.5 * first - (added - mu) * v[0] - (added + mu) * v[1];
  const double f_1 =
      by->total[1] - lateral - 0.5 * first - (added + mu) * v[0] - (added - mu) * v[1];
  bd_ale_answer out;
  out.v[0] = span->matrix[0] * f_0 + span->matrix[1] * f_1;
  out.v[1] = span->matrix[1] * f_0 + span->matrix[2] * f_1;
  for (int n = 0; n < K; ++n) {
    out.p[n] = dp[n] - 0.5 * (out.v[0] + out.v[1]) * span->ga[n];
  }
  return out;
}

/* Rows of a span by an unknown beside it: of its metres the rate, and what moves an end. */
static void respond(const filling *f, int i, double *to, double fills, int end, double total) {
  const bd_ale_answer *moved = &f->newton->answers[i][end == 0 ? BD_ALE_FIRST : BD_ALE_LAST];
  const bd_ale_answer *filled = &f->newton->answers[i][BD_ALE_FILLS];
  const int K = BD_ALE_MODES;
  to[0] = fills;
  for (int k = 0; k < 2; ++k) {
    to[1 + k] = total * moved->v[k] + fills * filled->v[k];
  }
  for (int n = 0; n < K; ++n) {
    to[3 + K + n] = total * moved->p[n] + fills * filled->p[n];
  }
}

/* Columns of the cell and the node next to one end, which are on arc j, and of its rim. */
static void fill_beside(const filling *f, int i, int end) {
  const bd_ale_slopes *by = &f->newton->slopes;
  const int j = end == 0 ? i : f->ale->arcs[i].next,
            span = f->ale->arcs[i].begin + f->ale->arcs[i].n;
  const bd_ale_arc *arc = &f->ale->arcs[j];
  const int cell = end == 0 ? span - 1 : arc->begin, node = end == 0 ? span - 1 : arc->begin + 1;
  const place row = {f->newton->cell_block[span], 0};
  const int lead = f->newton->ring.blocks[row.block].lead, states = arc->states;
  double *const *const total = by->total[1 - end], *const to = entry(f, row, cell_at(f, cell));
  const double fills = end == 0 ? flow_by(f, span).before : -flow_by(f, arc->begin).here;
  respond(f, i, to, fills, end, total[BD_ALE_M][cell]);
  respond(f, i, entry(f, row, node_at(f, node)), 0.0, end,
          total[end == 0 ? BD_ALE_V : BD_ALE_V_AFTER][cell]);
  respond(f, i, beside(f, f->newton->column, j, row), 0.0, end, total[BD_ALE_RIM][cell]);
  respond(f, i, beside(f, f->newton->shear_column, 2 * i + end, row), 0.0, end,
          total[BD_ALE_SHEAR][cell]);
  for (int e = 0; e < 2 * states; ++e) {
    const double cut = (e < states ? f->ale->cut_a : f->ale->cut_b)[cell];
    respond(f, i, to + (1 + e) * lead, 0.0, end,
            by->total_z[e / states][e % states * f->newton->stride + cell] *
                (end == 0 ? cut : 1.0 - cut));
  }
}

/* --- axes ------------------------------------------------------------------------------------- */

static int has_lever(const bd_ale *ale, int j) {
  const double *a = ale->arcs[j].axis.lever;
  return ale->moving && (a[0] != 0.0 || a[1] != 0.0);
}

/* Of what pulls the axis along t of a node of its arc, and of what bears on it along n, which is
 * less, the part along the lever. */
static double along_lever(const bd_ale *ale, int j, int slot, double along, double bears) {
  const double *a = ale->arcs[j].axis.lever, tx = ale->tx[slot], ty = ale->ty[slot];
  return along * (a[0] * tx + a[1] * ty) - bears * ale->direction * (a[0] * ty - a[1] * tx);
}

/* What moves a node besides: weight and turning less the rate itself, per mass. */
static double by_mass(const filling *f, int slot) {
  const bd_ale *ale = f->ale;
  return ale->gravity[0] * ale->tx[slot] + ale->gravity[1] * ale->ty[slot] -
         ale->direction * ale->turn[slot] * ale->across[slot] - f->dy->v[slot];
}

/* What a node's mass bears on its axis along n, over it; of an arc's own part with what its axis
 * adds. */
static double bears_of(const filling *f, int j, int slot, int own) {
  const bd_ale *ale = f->ale;
  const bd_ale_axis *axis = &ale->arcs[j].axis;
  const double D = ale->direction, tx = ale->tx[slot], ty = ale->ty[slot], nx = D * ty;
  const double ny = -D * tx, turn = D * ale->turn[slot];
  const double of_axis =
      axis->known[0] * nx + axis->known[1] * ny + turn * (axis->v[0] * tx + axis->v[1] * ty);
  return -turn * f->y->v[slot] - ale->gravity[0] * nx - ale->gravity[1] * ny + own * of_axis;
}

/* The force on an axis by its arc: what does not move the nodes, less F (u' - u) and weight. */
static void push_by_arc(const filling *f, int j) {
  const bd_ale *ale = f->ale;
  const bd_ale_arc *arc = &ale->arcs[j];
  const bd_ale_slopes *by = &f->newton->slopes;
  const double half = 0.5 * ale->density;
  double *const push = f->newton->push, *const by_rim = f->newton->push_by_rim + j * ale->np;
  memset(push + j * f->newton->ring.unknowns, 0, (size_t)f->newton->ring.unknowns * sizeof *push);
  f->newton->shear_push[end_at(ale, j, 0)] = f->newton->shear_push[2 * j] = 0.0;
  memset(by_rim, 0, (size_t)ale->np * sizeof *by_rim);
  for (int at = 0; at < 2 * arc->n; ++at) {
    const int slot = arc->begin + at / 2, end = at % 2, node = slot + end;
    double *const *const total = by->total[end], *const cell = beside(f, push, j, cell_at(f, slot));
    const double per = 1.0 / ale->stretch[slot], stretched = per * by->stretch[slot];
    const double w = ale->slid[slot] + ale->slid[slot + 1];
    const double apart = ale->slid[slot + 1] - ale->slid[slot], quarter = 0.25 * ale->density * per;
    const double through = quarter * (ale->past[slot] + ale->past[slot + 1]);
    cell[0] += along_lever(ale, j, node,
                           ale->carried_t[slot] * stretched + half * by_mass(f, node) -
                               total[BD_ALE_M][slot],
                           half * bears_of(f, j, node, 1) - ale->carried_n[slot] * stretched);
    for (int c = 0; c < 2; ++c) {
      const double lags = quarter * apart + (c == 0 ? -through : through);
      *beside(f, push, j, node_at(f, slot + c)) +=
          along_lever(ale, j, node, -total[BD_ALE_V + c][slot] - lags,
                      arc->half_turn * (quarter * w + through));
    }
    by_rim[j] += along_lever(ale, j, node, -total[BD_ALE_RIM][slot], 0.0);
    f->newton->shear_push[end_at(ale, j, at / 2)] +=
        along_lever(ale, j, node, -total[BD_ALE_SHEAR][slot], 0.0);
    for (int e = 0; e < 2 * arc->states; ++e) {
      const double cut = (e < arc->states ? ale->cut_a : ale->cut_b)[slot];
      cell[1 + e] +=
          along_lever(ale, j, node,
                      -by->total_z[e / arc->states][e % arc->states * f->newton->stride + slot] *
                          (end == 0 ? 1.0 - cut : cut),
                      0.0);
    }
  }
}

/* Of span i the forces on both axes by a column, but for what its modes' rates add. */
static void push_by_span(const filling *f, int i, place column, const span_move *by,
                         double pressing, const double bends[2]) {
  const bd_ale *ale = f->ale;
  const bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arcs[2] = {&ale->arcs[i], &ale->arcs[ale->arcs[i].next]};
  const int nodes[2] = {arcs[0]->begin + arcs[0]->n, arcs[1]->begin};
  const double lift = pressing / ale->rest * span->tilt / span->length;
  const double per = 4.0 * ale->density / span->stretch, half = 0.5 * ale->density;
  const double across = ale->across[nodes[1]] - ale->across[nodes[0]];
  const double sided = (arcs[0]->side * arcs[0]->radius * by->losing[0] +
                        arcs[1]->side * arcs[1]->radius * by->losing[1]) /
                       span->length;
  double rates[2], sum = 0.0, sum_by = 0.0;
  for (int end = 0; end < 2; ++end) {
    const bd_ale_axis *axis = &arcs[end]->axis;
    rates[end] =
        axis->known[0] * span->n[0] + axis->known[1] * span->n[1] +
        ale->direction * span->turning * (axis->v[0] * span->e[0] + axis->v[1] * span->e[1]);
  }
  for (int n = 0; n < BD_ALE_MODES; ++n) {
    sum += ale->odd[n] * span->da[n];
    sum_by += ale->odd[n] * by->p[n];
  }
  const double swings =
      per * (by->past * sum + span->past * sum_by - by->stretch / span->stretch * span->past * sum);
  const double carries =
      half / span->stretch * across * (by->past - span->past * by->stretch / span->stretch);
  for (int end = 0; end < 2; ++end) {
    double gives = ale->left_over[end] * rates[0] + ale->left_over[1 + end] * rates[1];
    for (int n = 0; n < BD_ALE_MODES; ++n) {
      gives += 0.5 * ale->parts[end][n] * span->forced[n];
    }
    const double sign = end == 0 ? 1.0 : -1.0;
    const double push = ale->density * by->m * gives + sign * (swings - lift - sided);
    const int j = end == 0 ? i : ale->arcs[i].next;
    const double bears = half * by->m * bears_of(f, j, nodes[end], 0);
    *beside(f, f->newton->push, j, column) +=
        along_lever(ale, j, nodes[end], by->losing[end] + bends[end], push + bears + carries);
  }
}

/* A row of what follows the shear of an end, by the span's unknowns. */
static void add_shear(const filling *f, int i, int end, double *row, double by) {
  const bd_ale_arc *arc = &f->ale->arcs[i];
  const bd_ale_newton *newton = f->newton;
  row += newton->ring.blocks[newton->cell_block[arc->begin + arc->n]].at;
  for (int c = 0; c < BD_ALE_OF_SPAN; ++c) {
    row[c] += by * newton->shear_row[2 * i + end][c];
  }
}

/* By a column of a span's rates, that of a mode without what c' does. */
static double forced_by(const bd_ale_span *span, int n, const double *rates) {
  return rates[3 + BD_ALE_MODES + n] + 0.5 * span->ga[n] * (rates[1] + rates[2]);
}

/* What rates of a span's modes do to the axes at its ends, by all that they depend on. */
static void push_by_modes(const filling *f, int i) {
  const bd_ale *ale = f->ale;
  const bd_ale_ring *ring = &f->newton->ring;
  const bd_ale_span *span = &ale->spans[i];
  const int K = BD_ALE_MODES, slot = ale->arcs[i].begin + ale->arcs[i].n;
  const int b = f->newton->cell_block[slot];
  const bd_ale_block *block = &ring->blocks[b];
  const int near[3] = {(b + ring->n - 1) % ring->n, b, (b + 1) % ring->n};
  const double *const parts[3] = {block->back, block->own, block->ahead};
  for (int end = 0; end < 2; ++end) {
    const int j = end == 0 ? i : ale->arcs[i].next;
    const double *a = ale->arcs[j].axis.lever;
    const double lever = a[0] * span->n[0] + a[1] * span->n[1];
    for (int n = 0; n < K && lever != 0.0; ++n) {
      const double share = -0.5 * ale->density * f->y->m[slot] * ale->parts[end][n] * lever;
      for (int p = 0; p < 3; ++p) {
        for (int c = 0; c < ring->blocks[near[p]].n; ++c) {
          *beside(f, f->newton->push, j, (place){near[p], c}) +=
              share * forced_by(span, n, parts[p] + c * block->lead);
        }
      }
      for (int e = 0; e < 2; ++e) {
        const double by =
            forced_by(span, n, f->newton->shear_column + (2 * i + e) * ring->unknowns + block->at);
        add_shear(f, i, e, f->newton->push + j * ring->unknowns, share * by);
      }
      for (int rim = 0; rim < ale->np; ++rim) {
        f->newton->push_by_rim[j * ale->np + rim] +=
            share * forced_by(span, n, f->newton->column + rim * ring->unknowns + block->at);
      }
    }
  }
}

/* --- all -------------------------------------------------------------------------------------- */

static void prepare_span(const filling *f, int i) {
  static const span_move moves[BD_ALE_ANSWERS] = {
      [BD_ALE_FIRST] = {.total = {1.0, 0.0}},
      [BD_ALE_LAST] = {.total = {0.0, 1.0}},
      [BD_ALE_FILLS] = {.fills = 1.0},
  };
  const bd_ale_arc *arc = &f->ale->arcs[i];
  const bd_ale_span *span = &f->ale->spans[i];
  const span_at at = at_span(f, i);
  double *stretch = f->newton->slopes.stretch;
  for (int k = 0; k < BD_ALE_ANSWERS; ++k) {
    f->newton->answers[i][k] = answer_of(f, i, &at, &moves[k]);
  }
  stretch[arc->begin + arc->n] = -span->stretch * span->per_slope / f->ale->axial;
  stretch[f->ale->arcs[arc->next].begin - 1] = stretch[arc->begin + arc->n];
}

/* The shear of an end, H (1 - s R / e times the angle by which waves lift it). */
static double shear_by(const bd_ale *ale, int i, int end, const span_move *by, double pressing) {
  const bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const double roll = ale->roll[end == 0 ? arc->begin + arc->n - 1 : ale->arcs[arc->next].begin];
  const double least = BD_ALE_LEAST * ale->rest, moves = span->pressing > least ? pressing : 0.0;
  double lifted = 0.0;
  for (int n = 0; n < BD_ALE_MODES; ++n) {
    const double k = span->wave[n], stiff = span->pressing + span->stiff[n] * k * k;
    const double slope = k * (by->a[n] + (moves != 0.0 ? span->rest[n] * moves / stiff : 0.0));
    lifted += end == 0 || n % 2 == 0 ? slope : -slope;
  }
  return moves * (1.0 - roll * span->lifted[end]) -
         bd_at_least(span->pressing, least) * roll * lifted;
}

/* Columns of a span's own unknowns. */
static void fill_span(const filling *f, int i) {
  const bd_ale *ale = f->ale;
  const bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int slot = arc->begin + arc->n, after = ale->arcs[arc->next].begin, K = BD_ALE_MODES;
  const int nodes[2] = {slot, after};
  const double EA = ale->axial, m = f->y->m[slot], damped = span->damping / m;
  const double apart = f->y->v[after] - f->y->v[slot], half = 0.5 * ale->density;
  const double through = half * span->past / span->stretch;
  const int block = f->newton->cell_block[slot];
  const span_at at = at_span(f, i);
  const double of_v[2] = {f->newton->slopes.total[1][BD_ALE_V_AFTER][slot - 1],
                          f->newton->slopes.total[0][BD_ALE_V][after]};
  for (int c = 0; c < 3 + 2 * K; ++c) {
    const int n = c < 3 + K ? c - 3 : c - 3 - K;
    double *const to = entry(f, (place){block, 0}, (place){block, c});
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
      damping = damped * 0.5 * span->length * span->wave[n] * span->wave[n] * span->da[n];
    } else {
      by.p[n] = 1.0;
      to[3 + n] = 1.0;
      damping = damped * bd_ale_draws(span, n);
    }
    by.pull = elastic + damping;
    by.stretch = elastic / EA;
    carries -= through * apart / span->stretch * by.stretch;
    const double thrown = ale->density * span->past / span->stretch;
    const double pressing =
        elastic + thrown * span->past / span->stretch * by.stretch - 2.0 * thrown * by.past;
    const double rises = span->pressing > BD_ALE_LEAST * ale->rest ? 0.5 / span->pressing : 0.0;
    for (int end = 0; end < 2; ++end) {
      const int node = nodes[end];
      const double sign = end == 0 ? 1.0 : -1.0, per = ale->per_stretch[node];
      const double own = c == 1 + end ? 1.0 : 0.0;
      bends[end] = 0.5 * (ale->bent[node] - ale->bent[node - 1]) * per * per * by.stretch;
      const double rolls = c < 3 + K ? own : bd_ale_rolls(span, end, n);
      by.losing[end] = rolls * span->per_losing[end];
      if (span->per_bending[end] > 0.0) {
        by.losing[end] +=
            span->losing[end] * span->per_bending[end] / span->per_losing[end] * rises * pressing;
      }
      by.total[end] = sign * by.pull - carries + (c == 0 ? half * by_mass(f, node) : 0.0) -
                      by.losing[end] - bends[end] + own * of_v[end];
      f->newton->shear_row[2 * i + end][c] = shear_by(ale, i, end, &by, pressing);
      by.fills += sign * per * (own - 0.5 * ale->flow[node] * by.stretch);
    }
    const bd_ale_answer out = answer_of(f, i, &at, &by);
    to[0] = by.fills;
    memcpy(to + 1, out.v, sizeof out.v);
    memcpy(to + 3 + K, out.p, (size_t)K * sizeof *out.p);
    if (has_lever(ale, i) || has_lever(ale, arc->next)) {
      push_by_span(f, i, (place){block, c}, &by, pressing, bends);
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
    prepare_span(&f, i);
  }
  for (int j = 0; j < ale->np; ++j) {
    const int n = ale->arcs[j].n;
    for (int k = 0; k < n; ++k) {
      fill_cell(&f, j, k);
      if (k > 0) {
        fill_node(&f, j, k);
      }
    }
    fill_torque(&f, j);
    if (has_lever(ale, j)) {
      push_by_arc(&f, j);
    }
  }
  for (int i = 0; i < ale->np; ++i) {
    fill_span(&f, i);
    fill_beside(&f, i, 0);
    fill_beside(&f, i, 1);
    push_by_modes(&f, i);
    for (int end = 0; end < 2; ++end) {
      const int j = end == 0 ? i : ale->arcs[i].next, at = j * newton->ring.unknowns;
      add_shear(&f, i, end, newton->row + at, newton->shear_torque[2 * i + end]);
      if (has_lever(ale, j)) {
        add_shear(&f, i, end, newton->push + at, newton->shear_push[2 * i + end]);
      }
    }
  }
}
