/* SPDX-License-Identifier: MIT
 *
 * ALE belt: momentum along it, modes of its spans, and what it does to axes (MODEL sections 11.5 to
 * 11.7).
 */

/* --- modes of a span, without the terms of c' ------------------------------------------------- */

/* Where the belt runs off a pulley, or on, its curvature rises to 1 / R within l, and it sinks
 * in; dampers take what the rates of both, by the speed at which it runs there, are worth squared.
 */
INLINE void lose_at_ends(bd_ale *ale, int i) {
  bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int nodes[2] = {arc->begin + arc->n, ale->arcs[arc->next].begin};
  const double H = bd_at_least(span->pressing, BD_ALE_LEAST * ale->rest);
  const int loses = ale->bending_damping > 0.0 && ale->bending > 0.0;
  modes turns[2] = {each(0.0), each(0.0)};
  for (int n = 0; n < BD_ALE_MODES; n += MODES) {
    const modes rate = modes_at(span->wave + n) * modes_at(span->da + n);
    turns[0] = turns[0] + rate;
    turns[1] = turns[1] + turned_at(n) * rate;
  }
  for (int end = 0; end < 2; ++end) {
    const double square = span->curvature[end] * span->curvature[end];
    const double speed = ale->past[nodes[end]] + span->rolls[end] * sum_of_modes(turns[end]);
    span->per_bending[end] =
        loses ? 0.5 * ale->bending_damping * span->damps[end] * square * sqrt(H / ale->bending)
              : 0.0;
    span->per_losing[end] = span->per_bending[end] + span->sinks[end];
    span->losing[end] = span->per_losing[end] * speed;
  }
}

/* As a span grows longer at this rate: by its length X + E, and what its waves, which it spreads,
 * have of momentum along it, over rhoA m / S. */
INLINE double spread(const bd_ale *ale, const bd_ale_span *span, double *waves) {
  const double H = bd_at_least(span->pressing, BD_ALE_LEAST * ale->rest);
  const double o = span->tilt / H, o_0 = span->tilt / ale->rest, S = span->length;
  modes bent = each(0.0), carry = bent;
  for (int n = 0; n < BD_ALE_MODES; n += MODES) {
    const modes wave = modes_at(span->wave + n), k2 = wave * wave;
    const modes bends = modes_at(span->waves->stiff + n) * k2, held = stiff_at(span, n, H) + H;
    const modes ab = modes_at(span->ab + n), apart = ab - modes_at(span->rest + n);
    const modes rises = modes_at(span->waves->rises + n) + 1.0;
    bent = bent +
           k2 * apart * (rises * apart + 2.0 * modes_at(span->falls + n) * (held + 2.0 * bends));
    carry = carry + (modes_at(span->da + n) + modes_at(span->moved + n)) * modes_at(span->ga + n) +
            2.0 * span->past * k2 * ab * ab;
  }
  *waves = sum_of_modes(carry);
  return 0.5 * (o * o - o_0 * o_0) / (S * S) - 0.25 * sum_of_modes(bent);
}

/* What runs along a path that grows longer is slower: of the part of a span's that its nodes and
 * waves do not make, and of waves as the span grows longer; into what belongs to c'. */
INLINE void lengthen(bd_ale *ale, bd_ale_span *span, double m, double fills, double apart) {
  const double EA = ale->axial, c = span->past, S = span->length, by_H = span->by_pressing;
  const double carried = ale->density * c / span->stretch, rate = span->length_rate;
  const double by_T = 1.0 + carried * c / (span->stretch * EA);
  double waves = 0.0;
  const double by_S = rate != 0.0 ? spread(ale, span, &waves) : 0.0;
  const double draws = span->drawn - apart + rate * (1.0 + by_S);
  span->carried = carried;
  span->per_path = by_H * by_T * span->per_slope;
  const double grows = span->per_path * (draws - span->stretch * fills) + span->turns +
                       (by_S + span->bent / S) * rate -
                       ale->direction * span->turning * span->raised;
  span->first += carried * grows - 0.5 * ale->density * m * rate / S * waves;
  span->added -= 2.0 * carried * carried * by_H * (1.0 + by_H * by_T * span->per_slope);
}

INLINE void swing(bd_ale *ale, const bd_ale_state *y, const bd_ale_state *dy, int i) {
  bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int k = arc->begin + arc->n, at = i * BD_ALE_MODES;
  const double c = span->past, m = y->m[k], per_S = 1.0 / span->length;
  const double per_mp = span->stretch / ale->density, fills = dy->m[k] / m;
  const double lifts = (span->elastic + span->damped) * per_mp - c * c,
               drives = 2.0 * per_mp * per_S;
  const double resists[2] = {span->losing[0] * span->rolls[0], span->losing[1] * span->rolls[1]};
  const double falls = 4.0 * span->sag + 8.0 * ale->direction * span->turning * c;
  modes first = each(0.0), added = first, lateral = first;
  for (int n = 0; n < BD_ALE_MODES; n += MODES) {
    const modes wave = modes_at(span->wave + n), k2 = wave * wave;
    const modes ab = modes_at(span->ab + n), da = modes_at(span->da + n), kappa = k2 * ab;
    const modes ga = per_S * coupled(span->waves, n, y->a + at),
                gda = per_S * coupled(span->waves, n, span->da);
    const modes bends = stiff_at(span, n, span->pressing) * ab + ale->bending_damping * k2 * da;
    const modes rolls = wave * (resists[0] + resists[1] * turned_at(n));
    const modes driven = modes_at(span->pushed + n) + modes_at(span->turned + n) - rolls;
    const modes forced = (drives * driven - 2.0 * c * gda - lifts * kappa - per_mp * k2 * bends +
                          falls * modes_at(ale->odd + n)) *
                         modes_at(span->waves->eased + n);
    const modes dp = forced - fills * (da + c * ga);
    modes_to(span->ga + n, ga);
    modes_to(span->gda + n, gda);
    modes_to(span->forced + n, forced);
    modes_to(span->dp + n, dp);
    modes_to(dy->a + at + n, da);
    first = first + dp * ga + modes_at(span->moved + n) * gda + 2.0 * c * kappa * da;
    added = added + kappa * ab - ga * ga;
    lateral = lateral + da * da - c * c * kappa * ab;
  }
  const int after = ale->arcs[arc->next].begin;
  const double apart = y->v[after] - y->v[k], across = ale->across[after] - ale->across[k];
  span->first = 0.5 * ale->density * m * sum_of_modes(first);
  span->added = 0.5 * ale->density * m * sum_of_modes(added);
  span->lateral = 0.25 / per_mp * sum_of_modes(lateral) +
                  ale->density / 12.0 * (apart * apart + across * across);
  lengthen(ale, span, m, dy->m[k], apart);
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
    const vec friction = load(ale->force_a + k) + load_unaligned(ale->force_b + k - 1) +
                         load(ale->slows + k) + load_unaligned(ale->slows + k - 1);
    const vec carried = load(ale->carried_t + k) + load_unaligned(ale->carried_t + k - 1);
    const vec tx = load(ale->tx + k), ty = load(ale->ty + k);
    const vec weighs = fma_(gx, tx, gy * ty) - D * load(ale->turn + k) * load(ale->across + k);
    const vec total = fma_(mass, weighs, pulls - friction - carried);
    const vec per_mass = splat(1.0) / mass;
    store(ale->total + k, total);
    store(ale->per_mass + k, per_mass);
    store(dy->v + k, total * per_mass);
    store(dy->m + k, flow - load_unaligned(ale->flow + k + 1));
  }
}

/* F (u' - u) of all cells: on an arc w' - w along t and, as t turns between, tan of half that angle
 * times w + w' along n, by which momentum, energy and torque are kept. And what both nodes of a
 * cell lose as it grows longer between them: as more belt comes in, for less is stretched and
 * deep, and as the wrap does; as it is thrown out faster, by their own rates. */
INLINE void carry_speed(bd_ale *ale, const bd_ale_state *y, int j) {
  const bd_ale_arc *arc = &ale->arcs[j];
  const int last = arc->begin + arc->n, after = ale->arcs[arc->next].begin;
  const vec quarter = splat(0.25 * ale->density), turned = splat(arc->half_turn);
  const vec none = splat(0.0), half = splat(0.5), one = splat(1.0), R = splat(arc->radius);
  const vec r0 = splat(arc->radius + arc->raised), EA = splat(ale->axial), c2 = splat(ale->linear);
  const vec c1 = splat(2.0 * ale->quadratic), density = splat(ale->density);
  const vec angle = splat(arc->cell_angle), turning = splat(arc->cell_turning);
  const vec per_angle = splat(1.0 / arc->cell_angle);
  for (int k = arc->begin; k < last; k += WIDTH) {
    const vec here = load(ale->slid + k), there = load_unaligned(ale->slid + k + 1);
    const vec flow = load(ale->flow + k), leaves = load_unaligned(ale->flow + k + 1);
    const vec through = quarter * (flow + leaves);
    store(ale->carried_t + k, through * (there - here));
    store(ale->carried_n + k, through * turned * (here + there));
    const vec w = half * (here + there), d = load(ale->sink + k), rho = r0 - d;
    const vec per = load(ale->per_rho + k), per_m = load(ale->per_m + k), q = angle * per_m;
    const vec thrown = density * w * per;
    const vec stiff = fma_(EA * q, q, fma_(c1, larger(d, none), fma_(thrown * w, per, c2)));
    const vec per_stiff = one / stiff, by_q = EA * fma_(rho + rho, q, -one) * per_stiff;
    const vec sinks = by_q * per_m * (turning - q * (flow - leaves));
    const vec carried = half * density * w * per * load(y->m + k) * per_angle;
    store(ale->slows + k, carried * fnma_(sinks, angle, (rho - R) * turning));
    store(ale->lags + k, carried * thrown * per_stiff * angle);
  }
  const double through = 0.25 * ale->density * (ale->flow[last] + ale->flow[after]);
  ale->slows[last] = ale->lags[last] = 0.0;
  ale->carried_t[last] = through * (y->v[after] - y->v[last]);
  ale->carried_n[last] = through * (ale->across[after] - ale->across[last]);
}

/* A wave along a span, of whose rate its own speed is that less what both ends have of it; belt by
 * which the span grows longer has none of it. */
INLINE void ring_along(const bd_ale *ale, bd_ale_span *span, const bd_ale_state *y,
                       const bd_ale_state *dy, int i, double ends) {
  if (ale->along) {
    const double rate = y->along_speed[i] - BD_ALE_SHARE * ends;
    span->along_rate = dy->along[i] = rate;
    span->along_force = span->along_stiffness * y->along[i] + span->along_damping * rate -
                        bd_ale_hung_along(ale, span);
    dy->along_speed[i] = -BD_ALE_SHARE / span->along_inertia * span->along_force -
                         span->length_rate / span->length * rate;
  }
}

/* Both ends of a span: consistent mass, the reaction of its modes and its wave together. */
INLINE void pull_ends(bd_ale *ale, const bd_ale_state *y, const bd_ale_state *dy, int i) {
  bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int k = arc->begin + arc->n, after = ale->arcs[arc->next].begin;
  const double density = ale->density, m = y->m[k], mu = density * m / 6.0;
  const double quarter = 0.25 * span->added, half = 0.5 * span->first;
  const double lags[2] = {ale->lags[k - 1], ale->lags[after]}, lent = span->along_inertia;
  ring_along(ale, span, y, dy, i, y->v[k] + y->v[after]);
  const double both = span->along_force - half;
  const double f_0 =
      ale->total[k] + span->lateral + both - span->losing[0] - lags[0] * dy->v[k - 1];
  const double f_1 =
      ale->total[after] - span->lateral + both - span->losing[1] - lags[1] * dy->v[after + 1];
  const double k_00 = 0.5 * density * (m + y->m[k - 1]) - mu + quarter - lent + lags[0];
  const double k_11 = 0.5 * density * (m + y->m[after]) - mu + quarter - lent + lags[1];
  const double k_01 = mu + quarter - lent, per = 1.0 / (k_00 * k_11 - k_01 * k_01);
  span->matrix[0] = k_11 * per; /* its inverse */
  span->matrix[1] = -k_01 * per;
  span->matrix[2] = k_00 * per;
  dy->v[k] = per * (k_11 * f_0 - k_01 * f_1);
  dy->v[after] = per * (k_00 * f_1 - k_01 * f_0);
  span->quickens = 0.5 * (dy->v[k] + dy->v[after]);
  for (int n = 0; n < BD_ALE_MODES; n += MODES) {
    const modes dp = modes_at(span->dp + n) - span->quickens * modes_at(span->ga + n);
    modes_to(span->dp + n, dp);
    modes_to(dy->p + i * BD_ALE_MODES + n, dp);
  }
}

/* Nodes between an arc's cells: what these lose by their rates, 1e-5 of what moves them. */
INLINE void lag_nodes(bd_ale *ale, const bd_ale_state *dy, int j) {
  const bd_ale_arc *arc = &ale->arcs[j];
  const vec none = splat(0.0);
  const int last = arc->begin + arc->n;
  for (int k = arc->begin; k < last; k += WIDTH) {
    const vec lags = load(ale->lags + k) * (load(dy->v + k) + load_unaligned(dy->v + k + 1));
    store(ale->lags + k, lags);
    store(ale->slows + k, load(ale->slows + k) + lags);
  }
  for (int k = arc->begin; k < last; k += WIDTH) {
    const mask inner = less(none, load(ale->is_cell + k) * load_unaligned(ale->is_cell + k - 1));
    const vec lags = load(ale->lags + k) + load_unaligned(ale->lags + k - 1);
    store(dy->v + k, load(dy->v + k) - where(inner, lags * load(ale->per_mass + k)));
  }
}

/* --- what the belt does to the axes ----------------------------------------------------------- */

/* Whether the force on a pulley's axis is. */
INLINE int wanted(const bd_ale *ale, const bd_ale_arc *arc) {
  return ale->everywhere || arc->mounted;
}

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
    const vec friction = load(ale->force_a + k) + load_unaligned(ale->force_b + k - 1) +
                         load(ale->slows + k) + load_unaligned(ale->slows + k - 1);
    const vec along = pulls - bends + friction;
    const vec lever = splat(axis->lever[0]) * nx + splat(axis->lever[1]) * ny;
    x = x + where(node, along * tx - bears * nx);
    yy = yy + where(node, along * ty - bears * ny);
    inertia = inertia + where(node, own * lever * lever);
  }
  arc->force[0] = sum(x);
  arc->force[1] = sum(yy);
  arc->inertia = sum(inertia);
}

/* What waves pull along their span, which is longer by them, for its own length. */
INLINE double shorten(const bd_ale *ale, const bd_ale_span *span, double m) {
  const double H = bd_at_least(span->pressing, BD_ALE_LEAST * ale->rest), S = span->length;
  const double off = 1.0 - H / ale->rest, c = span->past;
  modes bears = each(0.0), momentum = bears;
  for (int n = 0; n < BD_ALE_MODES; n += MODES) {
    const modes wave = modes_at(span->wave + n), k2 = wave * wave;
    const modes bends = modes_at(span->waves->stiff + n) * k2, ab = modes_at(span->ab + n);
    const modes apart = ab - modes_at(span->rest + n), square = ab * ab;
    bears = bears + 0.25 * S * k2 * (H + 3.0 * bends) * apart * apart;
    momentum = momentum +
               (modes_at(span->da + n) + modes_at(span->moved + n)) * modes_at(span->ga + n) +
               c * k2 * square;
  }
  const double pulls = (span->elastic + span->damped - H) * span->bent +
                       span->tilt * span->tilt / H * off * off / (2.0 * S) + sum_of_modes(bears);
  return (pulls - 0.5 * ale->density * m * c * sum_of_modes(momentum)) / S;
}

/* Of a span: what its modes do not carry of the consistent mass, and they themselves; and the lift
 * of its line, which follows H. */
INLINE void push_ends(bd_ale *ale, const bd_ale_state *y, int i) {
  bd_ale_span *span = &ale->spans[i];
  bd_ale_arc *arcs[2] = {&ale->arcs[i], &ale->arcs[ale->arcs[i].next]};
  const double m = y->m[arcs[0]->begin + arcs[0]->n], mass = ale->density * m;
  const double reaction = 0.5 * (span->first + span->added * span->quickens);
  const double takes[2] = {span->losing[0] + reaction, span->losing[1] + reaction};
  const double pulls = shorten(ale, span, m);
  const double lift = (span->pressing / ale->rest - 1.0) * span->tilt / span->length;
  const double sided =
      (arcs[0]->side * arcs[0]->radius * takes[0] + arcs[1]->side * arcs[1]->radius * takes[1]) /
      span->length;
  double rates[2], gives[2], levers[2];
  modes given[2] = {each(0.0), each(0.0)}, odd = each(0.0);
  for (int end = 0; end < 2; ++end) {
    const bd_ale_axis *axis = &arcs[end]->axis;
    rates[end] =
        axis->known[0] * span->n[0] + axis->known[1] * span->n[1] +
        ale->direction * span->turning * (axis->v[0] * span->e[0] + axis->v[1] * span->e[1]);
    levers[end] = axis->lever[0] * span->n[0] + axis->lever[1] * span->n[1];
  }
  for (int n = 0; n < BD_ALE_MODES; n += MODES) {
    const modes forced = modes_at(span->forced + n);
    given[0] = given[0] + modes_at(ale->parts[0] + n) * forced;
    given[1] = given[1] + modes_at(ale->parts[1] + n) * forced;
    odd = odd + modes_at(ale->odd + n) * modes_at(span->da + n);
  }
  for (int end = 0; end < 2; ++end) {
    gives[end] = ale->left_over[end] * rates[0] + ale->left_over[1 + end] * rates[1] +
                 0.5 * sum_of_modes(given[end]);
  }
  const double swings = 4.0 * ale->density / span->stretch * span->past * sum_of_modes(odd);
  for (int end = 0; end < 2; ++end) {
    if (!wanted(ale, arcs[end])) {
      continue;
    }
    const double sign = end == 0 ? 1.0 : -1.0;
    const double push = mass * gives[end] + sign * (swings - lift - sided);
    const double along = takes[end] - sign * pulls;
    arcs[end]->force[0] += along * span->e[0] - push * span->n[0];
    arcs[end]->force[1] += along * span->e[1] - push * span->n[1];
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
  close_cells(ale, ale->slows);
  for (int j = 0; j < ale->np; ++j) {
    pull_nodes(ale, y, dy, j);
  }
  for (int i = 0; i < ale->np; ++i) {
    lose_at_ends(ale, i);
    swing(ale, y, dy, i);
    pull_ends(ale, y, dy, i);
  }
  for (int j = 0; j < ale->np; ++j) {
    lag_nodes(ale, dy, j);
  }
  close_cells(ale, ale->slows);
  for (int j = 0; j < ale->np; ++j) {
    if (wanted(ale, &ale->arcs[j])) {
      push_axis(ale, y, j);
    }
  }
  for (int i = 0; i < ale->np; ++i) {
    if (wanted(ale, &ale->arcs[i]) || wanted(ale, &ale->arcs[ale->arcs[i].next])) {
      push_ends(ale, y, i);
    }
  }
  for (int j = 0; j < ale->np; ++j) { /* the padding stays */
    const bd_ale_arc *arc = &ale->arcs[j];
    for (int k = arc->begin + arc->n + 1; k < arc->begin + arc->slots; ++k) {
      dy->m[k] = dy->v[k] = 0.0;
    }
  }
}
