/* SPDX-License-Identifier: MIT
 *
 * A belt that flows: derivatives of an arc's cells, of what they do to both their nodes, to the
 * pulley and to their states of friction, with W and the flow through them held;
 * the shear of the end of the wrap is an unknown beside.
 */

/* More of what presses, of slip, by a cell's metres, by the speeds of its nodes, by the rim, by the
 * shear. */
typedef struct sliding_slopes {
  vec normal[BD_ALE_BYS], slip[BD_ALE_BYS];
} sliding_slopes;

/* Friction at one end: the force of all elements, over the metres held; what states have of it. */
INLINE void slope_end(const law_constants *c, sliding *slides, const lying *on,
                      const sliding_slopes *by, vec *force, int n, int stride, int k,
                      const double *z, const bd_ale_slopes *out, const int end, const int law,
                      const int has_states) {
  vec by_normal = splat(0.0), by_slip = by_normal;
  for (int e = 0; e < (has_states ? n : 1); ++e) {
    const int at = e * stride + k;
    slides->at.element = e;
    slides->at.z = has_states ? load(z + at) : splat(0.0);
    const law_slopes slopes = law_slopes_of(c, &slides->at, law);
    by_normal = by_normal + slopes.by_normal;
    by_slip = by_slip + slopes.by_slip;
    if (has_states) {
      const vec seen = where(slides->moves, slopes.rate_by_slip);
      for (int u = 0; u < BD_ALE_BYS; ++u) {
        store(out->rate[end][u] + at,
              fma_(slopes.rate_by_normal, by->normal[u], seen * by->slip[u]));
      }
      store(out->rate_z[end] + at, slopes.rate_by_state);
      store(out->total_z[end] + at, -on->lies * on->half_m * slopes.by_state);
    }
  }
  for (int u = 0; u < BD_ALE_BYS; ++u) {
    force[u] = on->lies * on->half_m * fma_(by_normal, by->normal[u], by_slip * by->slip[u]);
  }
}

/* Weight and turning of a node less its rate: what half a cell's mass there is worth. */
INLINE vec by_mass(const bd_ale *ale, const bd_ale_state *dy, int k) {
  const vec gx = splat(ale->gravity[0]), gy = splat(ale->gravity[1]);
  const vec tx = load_unaligned(ale->tx + k), ty = load_unaligned(ale->ty + k);
  const vec turns = splat(ale->direction) * load_unaligned(ale->turn + k);
  return fma_(gx, tx, gy * ty) - turns * load_unaligned(ale->across + k) -
         load_unaligned(dy->v + k);
}

INLINE void slopes_of(const bd_ale *ale, int j, const bd_ale_state *y, const bd_ale_state *dy,
                      const bd_ale_slopes *out, const int law, const int has_states) {
  const bd_ale_arc *arc = &ale->arcs[j];
  const law_constants c = law_prepare(&arc->friction, 1.0, law);
  const vec none = splat(0.0), half = splat(0.5), one = splat(1.0), two = splat(2.0);
  const vec r0 = splat(arc->radius + arc->raised), EA = splat(ale->axial);
  const vec density = splat(ale->density), damping = splat(arc->damping);
  const vec sense = splat(arc->sense), speed = splat(arc->sense * arc->axis.omega);
  const vec per_angle = splat(1.0 / arc->cell_angle);
  for (int k = arc->begin; k < arc->begin + arc->n; k += WIDTH) {
    const vec m = load(y->m + k), per_m = load(ale->per_m + k);
    const vec angle = splat(arc->cell_angle), q = angle * per_m;
    const vec d = load(ale->sink + k), rho = r0 - d, per_rho = load(ale->per_rho + k);
    const vec per = per_rho * m * per_angle, H = load(ale->pressing + k);
    const vec here = load(ale->slid + k), there = load_unaligned(ale->slid + k + 1);
    const vec w = half * (here + there), apart = there - here, thrown = density * w * per;
    /* the depth by metres, v^2 held; the stretch; the force; H */
    const vec stiff =
        fma_(EA * q, q, splat(ale->linear)) +
        fma_(two * splat(ale->quadratic), larger(d, none), density * w * w * per_rho * per_rho);
    const vec stretched = rho * q, sink = EA * (one - two * stretched) / stiff * q * per_m;
    const vec stretch = -q * fma_(rho, per_m, sink), damped = damping * per_m;
    const vec pull = fnma_(damped * per_m, apart, EA * stretch);
    /* F (u' - u) */
    const vec quarter = splat(0.25) * density * per, lags = quarter * apart;
    const vec through = quarter * (load(ale->past + k) + load_unaligned(ale->past + k + 1));
    const lying on = lying_at(ale, arc, y, k);
    const vec presses = on.lies * where(less(none, H), angle * per_m);
    const vec normal[BD_ALE_BYS] = {
        [BD_ALE_M] = fma_(thrown * w * per, stretch, pull) - H * per_m,
        [BD_ALE_V] = -damped - thrown,
        [BD_ALE_V_AFTER] = damped - thrown,
        [BD_ALE_RIM] = none,
        [BD_ALE_SHEAR] = none,
    };
    const vec pressed = fma_(splat(ale->quadratic) * d, larger(d, none), splat(ale->linear) * d);
    const vec bent = fma_(splat(ale->bending) * q * q, per_m, pressed * sink);
    /* what both nodes lose as more belt comes in */
    const vec lost = half * thrown * angle * sink;
    /* friction of both places, of which a part acts on the node behind */
    const vec before = load(ale->force_a + k), after = load(ale->force_b + k);
    vec torque[BD_ALE_BYS] = {none, none, none, none, none};
    vec on_nodes[2][BD_ALE_BYS] = {{none, none, none, none, none}, {none, none, none, none, none}};
    for (int end = 0; law != BD_LAW_NONE && end < 2; ++end) {
      const vec at_last = (after - load(ale->cut_a + k) * (before + after)) * on.per_part;
      const vec now = end == 0 ? before + after - at_last : at_last;
      sliding slides = sliding_at(ale, arc, &on, k, end);
      sliding_slopes by = {.slip = {speed * slides.deep * sink, one - slides.from, slides.from,
                                    -sense * slides.rho, none}};
      vec force[BD_ALE_BYS];
      for (int u = 0; u < BD_ALE_BYS; ++u) {
        by.normal[u] = where(less(none, slides.at.normal), presses * normal[u]);
      }
      const vec more = load((end == 0 ? ale->end_a : ale->end_b) + k) * on.per_part;
      by.normal[BD_ALE_SHEAR] = where(less(none, slides.at.normal), on.lies * angle * per_m * more);
      by.normal[BD_ALE_M] =
          fnma_(by.normal[BD_ALE_SHEAR], load(ale->shear + k) * per_m, by.normal[BD_ALE_M]);
      slope_end(&c, &slides, &on, &by, force, arc->states, y->stride, k, y->z[end], out, end, law,
                has_states);
      force[BD_ALE_M] = fma_(now, per_m, force[BD_ALE_M]);
      torque[BD_ALE_M] = fnma_(slides.deep * sink, now, torque[BD_ALE_M]);
      for (int u = 0; u < BD_ALE_BYS; ++u) {
        torque[u] = fma_(slides.rho, force[u], torque[u]);
        on_nodes[0][u] = fma_(one - slides.from, force[u], on_nodes[0][u]);
        on_nodes[1][u] = fma_(slides.from, force[u], on_nodes[1][u]);
      }
    }
    for (int end = 0; end < 2; ++end) {
      const vec sign = splat(end == 0 ? 1.0 : -1.0),
                at_node = load_unaligned(ale->per_stretch + k + end);
      const vec bends =
          (load_unaligned(ale->bent + k + end) - load_unaligned(ale->bent + k + end - 1)) * at_node;
      const vec total[BD_ALE_BYS] = {
          fma_(sign, fnma_(bent, at_node, pull), through * apart * per * stretch) -
              half * bends * at_node * stretch + half * density * by_mass(ale, dy, k + end),
          fma_(lost, load_unaligned(ale->per_stretch + k), through - lags - sign * damped),
          fnma_(lost, load_unaligned(ale->per_stretch + k + 1), sign * damped - lags - through),
          none, none};
      for (int u = 0; u < BD_ALE_BYS; ++u) {
        store(out->total[end][u] + k, total[u] - on_nodes[end][u]);
      }
    }
    for (int u = 0; u < BD_ALE_BYS; ++u) {
      store(out->torque[u] + k, sense * torque[u]);
    }
    store(out->stretch + k, stretch);
  }
}

#define SLOPES(name, class, general, states, text)                                                 \
  static void slopes_##name(const bd_ale *ale, int j, const bd_ale_state *y,                       \
                            const bd_ale_state *dy, const bd_ale_slopes *out) {                    \
    slopes_of(ale, j, y, dy, out, BD_LAW_##name, (states) != 0);                                   \
  }
SLOPES(NONE, none, none, 0, none)
BD_LAWS(SLOPES)
#undef SLOPES
