/* SPDX-License-Identifier: MIT
 *
 * The Jacobian of an ALE belt, into blocks. Of its unknowns
 *
 *   m, z of both ends, v      a cell of an arc, and the node behind it in the first half of the
 * arc, before it in the second half m, z, v, m, z             the two cells in the middle of an arc
 * with the node between them m, v, v, a, p             a span with both its ends
 *
 * no block is coupled further than to its neighbours, but by the length of a cell, which the speed
 * of both its ends has to do with through v^2: 1e-5 of what else is there, left out here. W is
 * frozen in a step.
 */
#include <math.h>
#include <string.h>

#include "belts/ale.h"

/* --- entries ---------------------------------------------------------------------------------- */

/* An unknown; of a column beside the ring the pulley whose rim it is (block -1). */
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

static place state_at(const filling *f, int slot, int end, int e, int states) {
  return (place){f->newton->cell_block[slot], f->newton->cell_at[slot] + 1 + end * states + e};
}

static place rim_of(int j) {
  return (place){-1, j};
}

static void add(const filling *f, place row, place column, double value) {
  bd_ale_ring *ring = &f->newton->ring;
  const bd_ale_block *block = &ring->blocks[row.block];
  if (column.block < 0) {
    f->newton->column[column.at * ring->unknowns + block->at + row.at] += value;
    return;
  }
  const int ahead = row.block + 1 < ring->n ? row.block + 1 : 0;
  double *to = column.block == row.block ? block->own
               : column.block == ahead   ? block->ahead
                                         : block->back;
  to[column.at * block->n + row.at] += value;
}

/* The torque on a pulley by an unknown. */
static void add_torque(const filling *f, int j, place column, double value) {
  bd_ale_ring *ring = &f->newton->ring;
  if (column.block < 0) {
    f->newton->own[j] += value;
  } else {
    f->newton->row[j * ring->unknowns + ring->blocks[column.block].at + column.at] += value;
  }
}

/* The force along the lever of a pulley by an unknown. */
static void add_push(const filling *f, int j, place column, double value) {
  bd_ale_ring *ring = &f->newton->ring;
  if (column.block < 0) {
    f->newton->push_by_rim[j * f->ale->np + column.at] += value;
  } else {
    f->newton->push[j * ring->unknowns + ring->blocks[column.block].at + column.at] += value;
  }
}

/* So much more pulls an axis along t of a node of its arc, or bears on it along n, which is less.
 */
static void push_by(const filling *f, int j, int slot, place column, double along, double bears) {
  const bd_ale *ale = f->ale;
  const double *a = ale->arcs[j].axis.lever, D = ale->direction;
  if (ale->moving && (a[0] != 0.0 || a[1] != 0.0)) {
    const double tx = ale->tx[slot], ty = ale->ty[slot];
    add_push(f, j, column, along * (a[0] * tx + a[1] * ty) - bears * D * (a[0] * ty - a[1] * tx));
  }
}

static void add_answer(const filling *f, int i, int to, place column, double value) {
  const bd_ale_arc *arc = &f->ale->arcs[i];
  const bd_ale_answer *answer = &f->newton->answers[i][to];
  const int block = f->newton->cell_block[arc->begin + arc->n], K = f->ale->modes;
  for (int end = 0; end < 2; ++end) {
    add(f, (place){block, 1 + end}, column, answer->v[end] * value);
  }
  for (int n = 0; n < K; ++n) {
    add(f, (place){block, 3 + K + n}, column, answer->p[n] * value);
  }
}

/* Node k of an arc is moved by so much more. */
static void total_by(const filling *f, int j, int k, place column, double value) {
  const bd_ale_arc *arc = &f->ale->arcs[j];
  const int slot = arc->begin + k;
  if (k == 0) {
    add_answer(f, arc->before, BD_ALE_LAST, column, value);
  } else if (k == arc->n) {
    add_answer(f, j, BD_ALE_FIRST, column, value);
  } else {
    const double mass = 0.5 * f->ale->density * (f->y->m[slot] + f->y->m[slot - 1]);
    add(f, node_at(f, slot), column, value / mass);
  }
}

/* Transport of state e through a cell over its flow per metre, at both ends. */
static void carried(const filling *f, int slot, int e, double out[2]) {
  const bd_ale_state *y = f->y;
  const int at = e * y->stride + slot;
  const double a = y->z[0][at], b = y->z[1][at], mean = 0.5 * (a + b), apart = 0.5 * (a - b);
  const int back = f->ale->flow[slot] + f->ale->flow[slot + 1] < 0.0;
  const double r_1 = back ? apart : y->z[1][at - 1] - mean;
  const double r_2 = back ? mean - y->z[0][at + 1] : apart;
  out[0] = 4.0 * r_1 - 2.0 * r_2;
  out[1] = 4.0 * r_2 - 2.0 * r_1;
}

/* So much more flows through a cell's first node, or less through its last. */
static void fill_by(const filling *f, int j, int k, place column, double value) {
  const bd_ale_arc *arc = &f->ale->arcs[j];
  const int slot = arc->begin + k;
  add(f, cell_at(f, slot), column, value);
  if (k == arc->n) {
    add_answer(f, j, BD_ALE_FILLS, column, value);
  }
}

static void carry_by(const filling *f, int j, int k, place column, double value) {
  const bd_ale_arc *arc = &f->ale->arcs[j];
  const int slot = arc->begin + k;
  for (int e = 0; e < arc->states && k < arc->n; ++e) {
    double out[2];
    carried(f, slot, e, out);
    for (int end = 0; end < 2; ++end) {
      add(f, state_at(f, slot, end, e, arc->states), column,
          0.5 * value * out[end] / f->y->m[slot]);
    }
  }
}

/* So much more flows through node k. */
static void flow_by(const filling *f, int j, int k, place column, double value) {
  const bd_ale_arc *arc = &f->ale->arcs[j];
  const int before = k > 0 ? j : arc->before, last = k > 0 ? k - 1 : f->ale->arcs[before].n;
  fill_by(f, before, last, column, -value);
  carry_by(f, before, last, column, value);
  fill_by(f, j, k, column, value);
  carry_by(f, j, k, column, value);
}

/* What moves a node besides: weight and turning less the rate itself, per mass. */
static double by_mass(const filling *f, int slot) {
  const bd_ale *ale = f->ale;
  return ale->gravity[0] * ale->tx[slot] + ale->gravity[1] * ale->ty[slot] -
         ale->direction * ale->turn[slot] * ale->across[slot] - f->dy->v[slot];
}

/* A cell is longer by so much of its stretch: flow, and what bending pulls, at node k. */
static void stretch_by(const filling *f, int j, int k, place column, double value) {
  const bd_ale *ale = f->ale;
  const int slot = ale->arcs[j].begin + k;
  const double per = ale->per_stretch[slot];
  const double pull = (ale->bent[slot] - ale->bent[slot - 1]) * per;
  flow_by(f, j, k, column, -0.5 * ale->flow[slot] * per * value);
  push_by(f, j, slot, column, 0.5 * pull * per * value, 0.0);
  total_by(f, j, k, column, -0.5 * pull * per * value);
}

/* --- arcs ------------------------------------------------------------------------------------- */

/* Of a cell on an arc: depth, stretch, force and H by metres, by the speeds of both ends. */
typedef struct cell_slopes {
  double sink, stretch, tension, tension_by_v, pressing, pressing_by_v[2];
} cell_slopes;

static cell_slopes slopes_of_cell(const bd_ale *ale, const bd_ale_arc *arc, double m, int slot) {
  const double d = ale->sink[slot], rho = arc->radius + arc->raised - d, q = arc->cell_angle / m;
  const double stretch = ale->stretch[slot], EA = ale->axial, q_by_m = -q / m;
  const double apart = ale->slid[slot + 1] - ale->slid[slot];
  const double w = 0.5 * (ale->slid[slot + 1] + ale->slid[slot]), momentum = ale->density * w * w;
  const double stiff =
      2.0 * ale->quadratic * fmax(d, 0.0) + ale->linear + EA * q * q + momentum / (rho * rho);
  cell_slopes by;
  by.sink = EA * (2.0 * stretch - 1.0) / stiff * q_by_m;
  by.stretch = rho * q_by_m - q * by.sink;
  by.tension = EA * by.stretch - ale->axial_damping * apart / (m * m);
  by.tension_by_v = ale->axial_damping / m;
  by.pressing = by.tension + momentum / (stretch * stretch) * by.stretch;
  const double thrown = ale->density * w / stretch;
  by.pressing_by_v[0] = -by.tension_by_v - thrown;
  by.pressing_by_v[1] = by.tension_by_v - thrown;
  return by;
}

/* Friction at one end of a cell. */
static void rub_by(const filling *f, int j, int k, int end, const cell_slopes *by) {
  const bd_ale *ale = f->ale;
  const bd_ale_slopes *law = &f->newton->slopes;
  const bd_ale_arc *arc = &ale->arcs[j];
  const int slot = arc->begin + k, states = arc->states;
  const double m = f->y->m[slot], H = ale->pressing[slot], half = 0.5 * m;
  const double rho = arc->radius + arc->raised - ale->sink[slot];
  const double share = (end == 0 ? ale->share_a : ale->share_b)[slot];
  const double presses = H > 0.0 ? arc->cell_angle * share / m : 0.0;
  const place metres = cell_at(f, slot), nodes[2] = {node_at(f, slot), node_at(f, slot + 1)};
  const double by_n = law->by_normal[end][slot], by_s = law->by_slip[end][slot];
  const double n_by_m = presses * (by->pressing - H / m);
  const double slip_by_m = arc->sense * arc->axis.omega * by->sink;
  const double slip_by_rim = -arc->sense * rho;
  /* columns of both nodes, metres, and the rim; states follow */
  const place columns[4] = {nodes[0], nodes[1], metres, rim_of(j)};
  double normal[4], slip[4];
  for (int c = 0; c < 2; ++c) {
    normal[c] = presses * by->pressing_by_v[c];
    slip[c] = c == end ? 1.0 : 0.0;
  }
  normal[2] = n_by_m;
  slip[2] = slip_by_m;
  normal[3] = 0.0;
  slip[3] = slip_by_rim;
  for (int c = 0; c < 4; ++c) {
    double force = half * (by_n * normal[c] + by_s * slip[c]);
    force += c == 2 ? 0.5 * law->force[end][slot] : 0.0;
    total_by(f, j, k + end, columns[c], -force);
    push_by(f, j, slot + end, columns[c], force, 0.0);
    add_torque(f, j, columns[c], arc->sense * rho * force);
    for (int e = 0; e < states; ++e) {
      const int at = e * f->newton->stride + slot;
      add(f, state_at(f, slot, end, e, states), columns[c],
          law->rate_by_normal[end][at] * normal[c] + law->rate_by_slip[end][at] * slip[c]);
    }
  }
  const double rubs = (end == 0 ? ale->force_a : ale->force_b)[slot];
  add_torque(f, j, metres, -arc->sense * by->sink * rubs);
  for (int e = 0; e < states; ++e) {
    const int at = e * f->newton->stride + slot;
    const place z = state_at(f, slot, end, e, states);
    const double force = half * law->by_state[end][at];
    total_by(f, j, k + end, z, -force);
    push_by(f, j, slot + end, z, force, 0.0);
    add_torque(f, j, z, arc->sense * rho * force);
    add(f, z, z, law->rate_by_state[end][at]);
  }
}

/* States by themselves and by those that run in, and by metres, with the flow held. */
static void carry_cell(const filling *f, int j, int k) {
  const bd_ale *ale = f->ale;
  const bd_ale_arc *arc = &ale->arcs[j];
  const int slot = arc->begin + k, states = arc->states;
  const double m = f->y->m[slot], flow = 0.5 * (ale->flow[slot] + ale->flow[slot + 1]) / m;
  const int back = flow < 0.0;
  /* r_1, r_2 by z_a, z_b, and by what runs in */
  const double r[2][3] = {{back ? 0.5 : -0.5, -0.5, back ? 0.0 : 1.0},
                          {0.5, back ? 0.5 : -0.5, back ? -1.0 : 0.0}};
  const int from = back ? k + 1 : k - 1;
  for (int e = 0; e < states; ++e) {
    double out[2];
    carried(f, slot, e, out);
    for (int end = 0; end < 2; ++end) {
      const place row = state_at(f, slot, end, e, states);
      const double *near = r[end], *other = r[1 - end];
      add(f, row, cell_at(f, slot), -flow * out[end] / m);
      for (int c = 0; c < 3; ++c) {
        const double value = flow * (4.0 * near[c] - 2.0 * other[c]);
        if (c < 2) {
          add(f, row, state_at(f, slot, c, e, states), value);
        } else if (from >= 0 && from < arc->n) {
          add(f, row, state_at(f, arc->begin + from, back ? 0 : 1, e, states), value);
        }
      }
    }
  }
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

static void fill_cell(const filling *f, int j, int k) {
  const bd_ale *ale = f->ale;
  const bd_ale_arc *arc = &ale->arcs[j];
  const int slot = arc->begin + k;
  const double m = f->y->m[slot], stretch = ale->stretch[slot], half = 0.5 * ale->density;
  const cell_slopes by = slopes_of_cell(ale, arc, m, slot);
  const place metres = cell_at(f, slot);
  const double apart = ale->slid[slot + 1] - ale->slid[slot];
  const double quarter = 0.25 * ale->density / stretch;
  const double through = quarter * (ale->past[slot] + ale->past[slot + 1]);
  const double carries[2] = {quarter * apart - through, quarter * apart + through};
  for (int end = 0; end < 2; ++end) {
    const double sign = end == 0 ? 1.0 : -1.0, per = ale->per_stretch[slot + end];
    stretch_by(f, j, k + end, metres, by.stretch);
    total_by(f, j, k + end, metres,
             sign * (by.tension - 2.0 * ale->bent[slot] / m * per) +
                 through * apart / stretch * by.stretch + half * by_mass(f, slot + end));
    push_by(f, j, slot + end, metres, -sign * (by.tension - 2.0 * ale->bent[slot] / m * per),
            half * bears_of(f, j, slot + end, 1) - ale->carried_n[slot] / stretch * by.stretch);
    for (int c = 0; c < 2; ++c) {
      const double pulls = c == 0 ? -by.tension_by_v : by.tension_by_v;
      total_by(f, j, k + end, node_at(f, slot + c), sign * pulls - carries[c]);
      push_by(f, j, slot + end, node_at(f, slot + c), -sign * pulls,
              arc->half_turn * (quarter * (ale->slid[slot] + ale->slid[slot + 1]) + through));
    }
    if (arc->friction.law != BD_LAW_NONE) {
      rub_by(f, j, k, end, &by);
    }
  }
  carry_cell(f, j, k);
}

/* --- spans ------------------------------------------------------------------------------------ */

/* More of all that a span's rates depend on. */
typedef struct span_move {
  double m, past, elastic, stretch, fills, total[2], a[BD_ALE_MODES], p[BD_ALE_MODES];
} span_move;

static bd_ale_answer answer_of(const filling *f, int i, const span_move *by) {
  const bd_ale *ale = f->ale;
  const bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int slot = arc->begin + arc->n, after = ale->arcs[arc->next].begin, K = ale->modes;
  const double m = f->y->m[slot], S = span->length, c = span->past, density = ale->density;
  const double per_mp = span->stretch / density, per_mp_by = by->stretch / density;
  const double fills = f->dy->m[slot] / m, fills_by = (by->fills - fills * by->m) / m;
  const double v[2] = {f->dy->v[slot], f->dy->v[after]};
  double dp[BD_ALE_MODES], first = 0.0, added = 0.0, lateral = 0.0;
  for (int n = 0; n < K; ++n) {
    double ga_by = 0.0, gda = 0.0, gda_by = 0.0;
    for (int r = 1 - n % 2; r < K; r += 2) {
      ga_by += ale->gyro[n][r] / S * by->a[r];
      gda += ale->gyro[n][r] / S * span->da[r];
      gda_by += ale->gyro[n][r] / S * by->p[r];
    }
    const double k2 = span->wave[n] * span->wave[n], k4 = k2 * k2, ab = span->ab[n];
    const double da = span->da[n], ga = span->ga[n], kappa = k2 * ab, kappa_by = k2 * by->a[n];
    const double own = span->dp[n] + span->quickens * ga; /* without c' */
    const double bends = span->stiff[n] * ab + ale->bending_damping * da;
    const double bends_by = span->stiff[n] * by->a[n] + ale->bending_damping * by->p[n];
    dp[n] = -2.0 * (by->past * gda + c * gda_by) -
            (by->elastic * per_mp + span->elastic * per_mp_by - 2.0 * c * by->past) * kappa -
            (span->elastic * per_mp - c * c) * kappa_by -
            k4 * (per_mp_by * bends + per_mp * bends_by) + 2.0 * span->moment[n] * per_mp_by / S +
            ale->odd[n] * 8.0 * ale->direction * span->turning * by->past -
            fills_by * (da + c * ga) - fills * (by->p[n] + by->past * ga + c * ga_by);
    first += dp[n] * ga + own * ga_by +
             2.0 * (by->past * kappa * da + c * kappa_by * da + c * kappa * by->p[n]);
    added += kappa_by * ab + kappa * by->a[n] - 2.0 * ga * ga_by;
    lateral += 2.0 * da * by->p[n] - 2.0 * c * by->past * kappa * ab -
               c * c * (kappa_by * ab + kappa * by->a[n]);
    dp[n] -= span->quickens * ga_by;
  }
  first = 0.5 * density * m * first + span->first * by->m / m;
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

static void prepare_answers(const filling *f, int i) {
  const span_move moves[BD_ALE_ANSWERS] = {
      [BD_ALE_FIRST] = {.total = {1.0, 0.0}},
      [BD_ALE_LAST] = {.total = {0.0, 1.0}},
      [BD_ALE_FILLS] = {.fills = 1.0},
  };
  for (int k = 0; k < BD_ALE_ANSWERS; ++k) {
    f->newton->answers[i][k] = answer_of(f, i, &moves[k]);
  }
}

/* Of span i the forces on both axes by a column, but for what its modes' rates add. */
static void push_by_span(const filling *f, int i, place column, const span_move *by,
                         double pressing, const double losing[2]) {
  const bd_ale *ale = f->ale;
  const bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arcs[2] = {&ale->arcs[i], &ale->arcs[ale->arcs[i].next]};
  const int nodes[2] = {arcs[0]->begin + arcs[0]->n, arcs[1]->begin};
  const double lift = pressing / ale->rest * span->tilt / span->length;
  const double per = 4.0 * ale->density / span->stretch, half = 0.5 * ale->density;
  const double across = ale->across[nodes[1]] - ale->across[nodes[0]];
  const double sided =
      (arcs[0]->side * arcs[0]->radius * losing[0] + arcs[1]->side * arcs[1]->radius * losing[1]) /
      span->length;
  double rates[2], sum = 0.0, sum_by = 0.0;
  for (int end = 0; end < 2; ++end) {
    const bd_ale_axis *axis = &arcs[end]->axis;
    rates[end] =
        axis->known[0] * span->n[0] + axis->known[1] * span->n[1] +
        ale->direction * span->turning * (axis->v[0] * span->e[0] + axis->v[1] * span->e[1]);
  }
  for (int n = 0; n < ale->modes; ++n) {
    sum += ale->odd[n] * span->da[n];
    sum_by += ale->odd[n] * by->p[n];
  }
  const double swings =
      per * (by->past * sum + span->past * sum_by - by->stretch / span->stretch * span->past * sum);
  const double carries =
      half / span->stretch * across * (by->past - span->past * by->stretch / span->stretch);
  for (int end = 0; end < 2; ++end) {
    double gives = ale->left_over[end] * rates[0] + ale->left_over[1 + end] * rates[1];
    for (int n = 0; n < ale->modes; ++n) {
      gives += 0.5 * ale->parts[end][n] * span->dp[n];
    }
    const double sign = end == 0 ? 1.0 : -1.0;
    const double push = ale->density * by->m * gives + sign * (swings - lift - sided);
    const int j = end == 0 ? i : ale->arcs[i].next;
    const double bears = half * by->m * bears_of(f, j, nodes[end], 0);
    push_by(f, j, nodes[end], column, losing[end], push + bears + carries);
  }
}

/* What rates of a span's modes do to the axes at its ends, by all that they depend on. */
static void push_by_modes(const filling *f, int i) {
  const bd_ale *ale = f->ale;
  const bd_ale_ring *ring = &f->newton->ring;
  const bd_ale_span *span = &ale->spans[i];
  const int K = ale->modes, slot = ale->arcs[i].begin + ale->arcs[i].n;
  const int b = f->newton->cell_block[slot];
  const bd_ale_block *block = &ring->blocks[b];
  const int beside[3] = {(b + ring->n - 1) % ring->n, b, (b + 1) % ring->n};
  const double *const parts[3] = {block->back, block->own, block->ahead};
  for (int end = 0; end < 2; ++end) {
    const int j = end == 0 ? i : ale->arcs[i].next;
    const double *a = ale->arcs[j].axis.lever;
    const double lever = a[0] * span->n[0] + a[1] * span->n[1];
    for (int n = 0; n < K && lever != 0.0; ++n) {
      const double share = -0.5 * ale->density * f->y->m[slot] * ale->parts[end][n] * lever;
      for (int p = 0; p < 3; ++p) {
        for (int c = 0; c < ring->blocks[beside[p]].n; ++c) {
          add_push(f, j, (place){beside[p], c}, share * parts[p][c * block->n + 3 + K + n]);
        }
      }
      for (int rim = 0; rim < ale->np; ++rim) {
        add_push(f, j, rim_of(rim),
                 share * f->newton->column[rim * ring->unknowns + block->at + 3 + K + n]);
      }
    }
  }
}

static void fill_span(const filling *f, int i) {
  const bd_ale *ale = f->ale;
  const bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int slot = arc->begin + arc->n, after = ale->arcs[arc->next].begin, K = ale->modes;
  const double EA = ale->axial, m = f->y->m[slot], damped = ale->axial_damping / m;
  const double apart = f->y->v[after] - f->y->v[slot], half = 0.5 * ale->density;
  const double through = half * span->past / span->stretch;
  const int block = f->newton->cell_block[slot];
  for (int c = 0; c < 3 + 2 * K; ++c) {
    const int n = c < 3 + K ? c - 3 : c - 3 - K;
    const place column = {block, c};
    span_move by = {.m = c == 0 ? 1.0 : 0.0, .past = c == 1 || c == 2 ? 0.5 : 0.0};
    double damping = 0.0, carries = 0.0;
    if (c == 0) {
      by.elastic = -span->stretch * span->per_slope;
      damping = -damped * apart / m;
    } else if (c < 3) {
      damping = c == 1 ? -damped : damped;
      carries = half * 0.5 * apart / span->stretch + (c == 1 ? -through : through);
    } else if (c < 3 + K) {
      by.a[n] = 1.0;
      by.elastic =
          0.5 * span->length * span->wave[n] * span->wave[n] * span->ab[n] * span->per_slope;
    } else {
      by.p[n] = 1.0;
      add(f, (place){block, 3 + n}, column, 1.0);
    }
    by.stretch = by.elastic / EA;
    carries -= through * apart / span->stretch * by.stretch;
    const double thrown = ale->density * span->past / span->stretch;
    const double pressing =
        by.elastic + thrown * span->past / span->stretch * by.stretch - 2.0 * thrown * by.past;
    const double rises = span->pressing > BD_ALE_LEAST * ale->rest ? 0.5 / span->pressing : 0.0;
    double losing[2];
    for (int end = 0; end < 2; ++end) {
      losing[end] =
          span->losing[end] * rises * pressing + (c == 1 + end ? span->per_losing[end] : 0.0);
    }
    push_by_span(f, i, column, &by, pressing, losing);
    const bd_ale_answer own = answer_of(f, i, &by);
    for (int end = 0; end < 2; ++end) {
      const int j = end == 0 ? i : arc->next, k = end == 0 ? arc->n : 0;
      const double sign = end == 0 ? 1.0 : -1.0;
      const double mass = c == 0 ? half * by_mass(f, end == 0 ? slot : after) : 0.0;
      add(f, (place){block, 1 + end}, column, own.v[end]);
      total_by(f, j, k, column, sign * (by.elastic + damping) - carries + mass - losing[end]);
      stretch_by(f, j, k, column, by.stretch);
    }
    for (int r = 0; r < K; ++r) {
      add(f, (place){block, 3 + K + r}, column, own.p[r]);
    }
  }
}

/* --- all -------------------------------------------------------------------------------------- */

void bd_ale_linearise(bd_ale_newton *newton, const bd_ale *ale, const bd_ale_kernels *kernels,
                      const bd_ale_state *y, const bd_ale_state *dy) {
  const bd_ale_ring *ring = &newton->ring;
  const filling f = {newton, ale, y, dy};
  for (int b = 0; b < ring->n; ++b) {
    const bd_ale_block *block = &ring->blocks[b];
    memset(block->back, 0, (size_t)(block->inverse - block->back) * sizeof(double));
  }
  memset(newton->column, 0, (size_t)(ale->np * ring->unknowns) * sizeof(double));
  memset(newton->row, 0, (size_t)(ale->np * ring->unknowns) * sizeof(double));
  memset(newton->own, 0, (size_t)ale->np * sizeof(double));
  memset(newton->push, 0, (size_t)(ale->np * ring->unknowns) * sizeof(double));
  memset(newton->push_by_rim, 0, (size_t)(ale->np * ale->np) * sizeof(double));
  for (int i = 0; i < ale->np; ++i) {
    prepare_answers(&f, i);
  }
  for (int j = 0; j < ale->np; ++j) {
    const bd_ale_arc *arc = &ale->arcs[j];
    if (arc->friction.law != BD_LAW_NONE) {
      kernels->slopes[arc->friction.law](ale, j, y, &newton->slopes);
    }
    for (int k = 0; k <= arc->n; ++k) {
      const int slot = arc->begin + k;
      flow_by(&f, j, k, node_at(&f, slot), ale->per_stretch[slot]);
      if (k < arc->n) {
        fill_cell(&f, j, k);
      }
    }
    fill_span(&f, j);
  }
  for (int j = 0; ale->moving && j < ale->np; ++j) {
    push_by_modes(&f, j);
  }
}
