/* SPDX-License-Identifier: MIT
 *
 * The border of the Jacobian of an ALE belt: rows of torques on pulleys, and of the belt's forces
 * on axes that have a lever, by the ring's unknowns.
 */
#include <math.h>
#include <string.h>

#include "belts/ale_filling.h"

/* The torque on a pulley by its arc. */
void bd_ale_fill_torque(const filling *f, int j) {
  const bd_ale *ale = f->ale;
  const bd_ale_arc *arc = &ale->arcs[j];
  const bd_ale_slopes *by = &f->newton->slopes;
  const bd_ale_row *cells = f->newton->cells, *nodes = f->newton->nodes;
  double *const row = beside(f, f->newton->row, j, 0), *const *const torque = by->torque;
  double own = 0.0, shear[2] = {0.0, 0.0}, before = 0.0;
  memset(row, 0, (size_t)f->newton->ring.unknowns * sizeof *row);
  for (int slot = arc->begin; slot < arc->begin + arc->n; ++slot) {
    double *const cell = row + cells[slot].at;
    row[nodes[slot].at] = torque[BD_ALE_V][slot] + before;
    before = torque[BD_ALE_V_AFTER][slot];
    cell[0] = torque[BD_ALE_M][slot];
    own += torque[BD_ALE_RIM][slot];
    shear[2 * (slot - arc->begin) >= arc->n] += torque[BD_ALE_SHEAR][slot];
    for (int end = 0; end < 2; ++end) {
      const double deep = (end == 0 ? ale->deep_a : ale->deep_b)[slot];
      const double rho = -arc->sense * (arc->radius + arc->raised - ale->sink[slot] * deep);
      for (int e = 0; e < arc->states; ++e) {
        cell[1 + end * arc->states + e] = rho * by->total_z[end][e * f->newton->stride + slot];
      }
    }
  }
  row[nodes[arc->begin + arc->n].at] = before;
  f->newton->own[j] = own;
  f->newton->shear_torque[2 * arc->before + 1] = shear[0];
  f->newton->shear_torque[2 * j] = shear[1];
}

/* Of what pulls the axis along t of a node of its arc, and of what bears on it along n, which is
 * less, the part along the lever. */
static double along_lever(const bd_ale *ale, int j, int slot, double along, double bears) {
  const double *a = ale->arcs[j].axis.lever, tx = ale->tx[slot], ty = ale->ty[slot];
  return along * (a[0] * tx + a[1] * ty) - bears * ale->direction * (a[0] * ty - a[1] * tx);
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
void bd_ale_push_by_arc(const filling *f, int j) {
  const bd_ale *ale = f->ale;
  const bd_ale_arc *arc = &ale->arcs[j];
  const bd_ale_slopes *by = &f->newton->slopes;
  const bd_ale_row *cells = f->newton->cells, *nodes = f->newton->nodes;
  const double half = 0.5 * ale->density;
  double *const push = f->newton->push, *const by_rim = f->newton->push_by_rim + j * ale->np;
  memset(push + j * f->newton->ring.unknowns, 0, (size_t)f->newton->ring.unknowns * sizeof *push);
  f->newton->shear_push[end_at(ale, j, 0)] = f->newton->shear_push[2 * j] = 0.0;
  memset(by_rim, 0, (size_t)ale->np * sizeof *by_rim);
  for (int at = 0; at < 2 * arc->n; ++at) {
    const int slot = arc->begin + at / 2, end = at % 2, node = slot + end;
    double *const *const total = by->total[end], *const cell = beside(f, push, j, cells[slot].at);
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
      *beside(f, push, j, nodes[slot + c].at) +=
          along_lever(ale, j, node, -total[BD_ALE_V + c][slot] - lags,
                      arc->half_turn * (quarter * w + through));
    }
    by_rim[j] += along_lever(ale, j, node, -total[BD_ALE_RIM][slot], 0.0);
    f->newton->shear_push[end_at(ale, j, at / 2)] +=
        along_lever(ale, j, node, -total[BD_ALE_SHEAR][slot], 0.0);
    for (int e = 0; e < 2 * arc->states; ++e) {
      const int last = e >= arc->states, z = (e - last * arc->states) * f->newton->stride + slot;
      const double cut = (last ? ale->cut_b : ale->cut_a)[slot];
      cell[1 + e] +=
          along_lever(ale, j, node, -by->total_z[last][z] * (end == 0 ? 1.0 - cut : cut), 0.0);
    }
  }
}

void bd_ale_push_by_span(const filling *f, int i, int column, const span_move *by, double pressing,
                         const double bends[2]) {
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
  for (int c = 0; c < bd_ale_unknowns(f->ale->along); ++c) {
    row[c] += by * newton->shear_row[2 * i + end][c];
  }
}

/* By a column of a span's rates, that of a mode without what c' does. */
static double forced_by(const bd_ale_span *span, int n, const double *rates) {
  return rates[3 + BD_ALE_MODES + n] + 0.5 * span->ga[n] * (rates[1] + rates[2]);
}

/* What rates of a span's modes do to the axes at its ends, by all that they depend on. */
void bd_ale_push_by_modes(const filling *f, int i) {
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
          *beside(f, f->newton->push, j, ring->blocks[near[p]].at + c) +=
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

void bd_ale_add_shears(const filling *f, int i) {
  const bd_ale_newton *newton = f->newton;
  for (int end = 0; end < 2; ++end) {
    const int j = end == 0 ? i : f->ale->arcs[i].next;
    add_shear(f, i, end, beside(f, newton->row, j, 0), newton->shear_torque[2 * i + end]);
    if (has_lever(f->ale, j)) {
      add_shear(f, i, end, beside(f, newton->push, j, 0), newton->shear_push[2 * i + end]);
    }
  }
}
