/* SPDX-License-Identifier: MIT
 *
 * ALE belt: momentum along it, modes of its spans, and what it does to axes (MODEL sections 11.5 to
 * 11.7).
 */

/* --- modes of a span, without the terms of c' ------------------------------------------------- */

/* Where the belt runs off a pulley, or on, its curvature rises to 1 / R as exp(x / l), and it sinks
 * in; dampers take what the rates of both, by the speed at which it runs there, are worth squared.
 */
INLINE void lose_at_ends(bd_ale *ale, int i) {
  bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int nodes[2] = {arc->begin + arc->n, ale->arcs[arc->next].begin};
  const double H = bd_at_least(span->pressing, BD_ALE_LEAST * ale->rest);
  const int loses = ale->bending_damping > 0.0 && ale->bending > 0.0;
  for (int end = 0; end < 2; ++end) {
    const double square = span->curvature[end] * span->curvature[end];
    double speed = ale->past[nodes[end]];
    for (int n = 0; n < BD_ALE_MODES; ++n) {
      speed += bd_ale_rolls(span, end, n) * span->da[n];
    }
    span->per_bending[end] =
        loses ? 0.5 * ale->bending_damping * square * sqrt(H / ale->bending) : 0.0;
    span->per_losing[end] = span->per_bending[end] + span->sinks[end];
    span->losing[end] = span->per_losing[end] * speed;
  }
}

INLINE void swing(bd_ale *ale, const bd_ale_state *y, const bd_ale_state *dy, int i) {
  bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int k = arc->begin + arc->n, K = BD_ALE_MODES;
  const double *a = y->a + i * K;
  const double c = span->past, S = span->length, m = y->m[k];
  const double per_mp = span->stretch / ale->density, fills = dy->m[k] / m;
  const double pull = span->elastic + span->damped;
  double first = 0.0, added = 0.0, lateral = 0.0, per_S = 1.0 / S;
  for (int n = 0; n < K; ++n) {
    double ga = 0.0, gda = 0.0;
    for (int r = 1 - n % 2; r < K; r += 2) {
      ga += ale->gyro[n][r] * a[r];
      gda += ale->gyro[n][r] * span->da[r];
    }
    span->ga[n] = ga * per_S;
    span->gda[n] = gda * per_S;
  }
  for (int n = 0; n < K; ++n) {
    const double k2 = span->wave[n] * span->wave[n], ab = span->ab[n], da = span->da[n];
    const double ga = span->ga[n], kappa = k2 * ab;
    const double resists =
        span->losing[0] * bd_ale_rolls(span, 0, n) + span->losing[1] * bd_ale_rolls(span, 1, n);
    const double dp = span->dp[n] =
        -2.0 * c * span->gda[n] - (pull * per_mp - c * c) * kappa -
        per_mp * k2 * k2 * (span->stiff[n] * ab + ale->bending_damping * da) +
        2.0 * per_mp * per_S * (span->moment[n] - resists) +
        ale->odd[n] * (4.0 * span->sag + 8.0 * ale->direction * span->turning * c) -
        fills * (da + c * ga);
    dy->a[i * K + n] = da;
    first += dp * ga + 2.0 * c * kappa * da;
    added += kappa * ab - ga * ga;
    lateral += da * da - c * c * kappa * ab;
  }
  span->first = 0.5 * ale->density * m * first;
  span->added = 0.5 * ale->density * m * added;
  span->lateral = 0.25 / per_mp * lateral;
}

/* --- momentum along the belt ----------------------------------------------------------------- */

/* What moves the nodes of an arc, over which the nodes' mass stands; a span's ends are to have more
 * yet. */
INLINE void pull_nodes(bd_ale *ale, const bd_ale_state *y, const bd_ale_state *dy, int j) {
  const bd_ale_arc *arc = &ale->arcs[j];
  const vec half_density = splat(0.5 * ale->density), D = splat(ale->direction);
  const vec gx = splat(ale->gravity[0]), gy = splat(ale->gravity[1]);
  for (int k = arc->begin; k <= arc->begin + arc->n; k += WIDTH) {
    const vec flow = load(ale->flow + k);
    const vec mass = half_density * (load(y->m + k) + load_unaligned(y->m + k - 1));
    const vec bends =
        (load(ale->bent + k) - load_unaligned(ale->bent + k - 1)) * load(ale->per_stretch + k);
    const vec pulls = load(ale->tension + k) - load_unaligned(ale->tension + k - 1) + bends;
    const vec rubs = load(ale->force_a + k) + load_unaligned(ale->force_b + k - 1);
    const vec carried = load(ale->carried_t + k) + load_unaligned(ale->carried_t + k - 1);
    const vec tx = load(ale->tx + k), ty = load(ale->ty + k);
    const vec weighs = fma_(gx, tx, gy * ty) - D * load(ale->turn + k) * load(ale->across + k);
    const vec total = fma_(mass, weighs, pulls - rubs - carried);
    store(ale->total + k, total);
    store(dy->v + k, total / mass);
    store(dy->m + k, flow - load_unaligned(ale->flow + k + 1));
  }
}

/* F (u' - u) of all cells: on an arc w' - w along t and, as t turns between, tan of half that angle
 * times w + w' along n, by which momentum, energy and torque are kept. */
INLINE void carry_speed(bd_ale *ale, const bd_ale_state *y, int j) {
  const bd_ale_arc *arc = &ale->arcs[j];
  const int last = arc->begin + arc->n, after = ale->arcs[arc->next].begin;
  const vec quarter = splat(0.25 * ale->density), turned = splat(arc->half_turn);
  for (int k = arc->begin; k < last; k += WIDTH) {
    const vec here = load(ale->slid + k), there = load_unaligned(ale->slid + k + 1);
    const vec through = quarter * (load(ale->past + k) + load_unaligned(ale->past + k + 1)) /
                        load(ale->stretch + k);
    store(ale->carried_t + k, through * (there - here));
    store(ale->carried_n + k, through * turned * (here + there));
  }
  const double through = 0.5 * ale->density * ale->spans[j].past / ale->stretch[last];
  ale->carried_t[last] = through * (y->v[after] - y->v[last]);
  ale->carried_n[last] = through * (ale->across[after] - ale->across[last]);
}

/* Both ends of a span: consistent mass and the reaction of its modes together. */
INLINE void pull_ends(bd_ale *ale, const bd_ale_state *y, const bd_ale_state *dy, int i) {
  bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int k = arc->begin + arc->n, after = ale->arcs[arc->next].begin, K = BD_ALE_MODES;
  const double density = ale->density, m = y->m[k], mu = density * m / 6.0;
  const double quarter = 0.25 * span->added, half = 0.5 * span->first;
  const double f_0 = ale->total[k] + span->lateral - half - span->losing[0];
  const double f_1 = ale->total[after] - span->lateral - half - span->losing[1];
  const double k_00 = 0.5 * density * (m + y->m[k - 1]) - mu + quarter;
  const double k_11 = 0.5 * density * (m + y->m[after]) - mu + quarter;
  const double k_01 = mu + quarter, per = 1.0 / (k_00 * k_11 - k_01 * k_01);
  span->matrix[0] = k_11 * per; /* its inverse */
  span->matrix[1] = -k_01 * per;
  span->matrix[2] = k_00 * per;
  dy->v[k] = per * (k_11 * f_0 - k_01 * f_1);
  dy->v[after] = per * (k_00 * f_1 - k_01 * f_0);
  span->quickens = 0.5 * (dy->v[k] + dy->v[after]);
  for (int n = 0; n < K; ++n) {
    span->dp[n] -= span->quickens * span->ga[n];
    dy->p[i * K + n] = span->dp[n];
  }
}

/* --- what the belt does to the axes ----------------------------------------------------------- */

/* Of the arc: cells, friction, and the inertia of its nodes, which at its ends have a cell of it on
 * one side only. */
INLINE void push_axis(bd_ale *ale, const bd_ale_state *y, int j) {
  bd_ale_arc *arc = &ale->arcs[j];
  const bd_ale_axis *axis = &arc->axis;
  const vec D = splat(ale->direction), half = splat(0.5 * ale->density), none = splat(0.0);
  const vec gx = splat(ale->gravity[0]), gy = splat(ale->gravity[1]);
  vec x = none, yy = none, inertia = none;
  for (int k = arc->begin; k <= arc->begin + arc->n; k += WIDTH) {
    const vec here = load(ale->is_cell + k), behind = load_unaligned(ale->is_cell + k - 1);
    const mask node = less(none, here + behind);
    const vec m = load(y->m + k), m_behind = load_unaligned(y->m + k - 1);
    const vec tx = load(ale->tx + k), ty = load(ale->ty + k), nx = D * ty, ny = -D * tx;
    const vec turn = D * load(ale->turn + k), own = half * fma_(here, m, behind * m_behind);
    const vec of_axis = splat(axis->known[0]) * nx + splat(axis->known[1]) * ny +
                        turn * (splat(axis->v[0]) * tx + splat(axis->v[1]) * ty);
    const vec bears = half * (m + m_behind) * (-turn * load(y->v + k) - gx * nx - gy * ny) +
                      load(ale->carried_n + k) + load_unaligned(ale->carried_n + k - 1) +
                      own * of_axis;
    const vec bends =
        (load(ale->bent + k) - load_unaligned(ale->bent + k - 1)) * load(ale->per_stretch + k);
    /* T (t' - t) of the cells, summed by nodes */
    const vec pulls = behind * load_unaligned(ale->tension + k - 1) - here * load(ale->tension + k);
    const vec rubs = load(ale->force_a + k) + load_unaligned(ale->force_b + k - 1);
    const vec along = pulls - bends + rubs;
    const vec lever = splat(axis->lever[0]) * nx + splat(axis->lever[1]) * ny;
    x = x + where(node, along * tx - bears * nx);
    yy = yy + where(node, along * ty - bears * ny);
    inertia = inertia + where(node, own * lever * lever);
  }
  arc->force[0] = sum(x);
  arc->force[1] = sum(yy);
  arc->inertia = sum(inertia);
}

/* Of a span: what its modes do not carry of the consistent mass, and they themselves; and the lift
 * of its line, which follows H. */
INLINE void push_ends(bd_ale *ale, const bd_ale_state *y, int i) {
  bd_ale_span *span = &ale->spans[i];
  bd_ale_arc *arcs[2] = {&ale->arcs[i], &ale->arcs[ale->arcs[i].next]};
  const double mass = ale->density * y->m[arcs[0]->begin + arcs[0]->n];
  const double lift = (span->pressing / ale->rest - 1.0) * span->tilt / span->length;
  const double sided = (arcs[0]->side * arcs[0]->radius * span->losing[0] +
                        arcs[1]->side * arcs[1]->radius * span->losing[1]) /
                       span->length;
  double rates[2], gives[2], levers[2], swings = 0.0;
  for (int end = 0; end < 2; ++end) {
    const bd_ale_axis *axis = &arcs[end]->axis;
    rates[end] =
        axis->known[0] * span->n[0] + axis->known[1] * span->n[1] +
        ale->direction * span->turning * (axis->v[0] * span->e[0] + axis->v[1] * span->e[1]);
    levers[end] = axis->lever[0] * span->n[0] + axis->lever[1] * span->n[1];
  }
  for (int end = 0; end < 2; ++end) {
    gives[end] = ale->left_over[end] * rates[0] + ale->left_over[1 + end] * rates[1];
  }
  for (int n = 0; n < BD_ALE_MODES; ++n) {
    gives[0] += 0.5 * ale->parts[0][n] * span->dp[n];
    gives[1] += 0.5 * ale->parts[1][n] * span->dp[n];
    swings += ale->odd[n] * span->da[n];
  }
  swings *= 4.0 * ale->density / span->stretch * span->past;
  for (int end = 0; end < 2; ++end) {
    const double sign = end == 0 ? 1.0 : -1.0;
    const double push = mass * gives[end] + sign * (swings - lift - sided);
    arcs[end]->force[0] += span->losing[end] * span->e[0] - push * span->n[0];
    arcs[end]->force[1] += span->losing[end] * span->e[1] - push * span->n[1];
    arcs[end]->inertia += mass * ale->left_over[2 * end] * levers[end] * levers[end];
  }
  span->coupling = mass * ale->left_over[1] * levers[0] * levers[1];
}

/* --- all ------------------------------------------------------------------------------------- */

static void move(bd_ale *ale, const bd_ale_state *y, const bd_ale_state *dy) {
  close_cells(ale, ale->force_b);
  for (int j = 0; j < ale->np; ++j) {
    carry_speed(ale, y, j);
  }
  close_cells(ale, ale->carried_t);
  close_cells(ale, ale->carried_n);
  for (int j = 0; j < ale->np; ++j) {
    pull_nodes(ale, y, dy, j);
  }
  for (int i = 0; i < ale->np; ++i) {
    lose_at_ends(ale, i);
    swing(ale, y, dy, i);
    pull_ends(ale, y, dy, i);
  }
  for (int j = 0; ale->moving && j < ale->np; ++j) {
    push_axis(ale, y, j);
  }
  for (int i = 0; ale->moving && i < ale->np; ++i) {
    push_ends(ale, y, i);
  }
  for (int j = 0; j < ale->np; ++j) { /* the padding stays */
    const bd_ale_arc *arc = &ale->arcs[j];
    for (int k = arc->begin + arc->n + 1; k < arc->begin + arc->slots; ++k) {
      dy->m[k] = dy->v[k] = 0.0;
    }
  }
}
