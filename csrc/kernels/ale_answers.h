/* SPDX-License-Identifier: MIT
 *
 * ALE belt: derivatives of what moves the two ends of a span and its modes, several unknowns at
 * once.
 */

/* What all unknowns have in common, of modes: k^2 (a + b), p~' without c', what bending of waves
 * and its damper pull, what bends and dampers at both ends do, by what these. */
typedef struct answering {
  double k2[BD_ALE_MODES], kappa[BD_ALE_MODES], own[BD_ALE_MODES], bends[BD_ALE_MODES];
  double stiff[BD_ALE_MODES], driven[BD_ALE_MODES], rolls[2][BD_ALE_MODES];
  double pressed[BD_ALE_MODES], slopes[2][BD_ALE_MODES];
} answering;

INLINE answering answering_of(const bd_ale *ale, const bd_ale_span *span) {
  answering at;
  for (int n = 0; n < BD_ALE_MODES; ++n) {
    at.k2[n] = span->wave[n] * span->wave[n];
    at.kappa[n] = at.k2[n] * span->ab[n];
    at.own[n] = span->dp[n] + span->quickens * span->ga[n];
    at.stiff[n] = bd_ale_stiff(span, n, span->pressing);
    at.bends[n] = at.stiff[n] * span->ab[n] + ale->bending_damping * at.k2[n] * span->da[n];
    at.rolls[0][n] = bd_ale_rolls(span, 0, n);
    at.rolls[1][n] = bd_ale_rolls(span, 1, n);
    at.driven[n] = span->pushed[n] + span->turned[n] -
                   (span->losing[0] * at.rolls[0][n] + span->losing[1] * at.rolls[1][n]);
    at.pressed[n] = 0.5 * span->length * at.k2[n] *
                    ((1.0 + span->waves->rises[n]) * span->rest[n] -
                     (at.stiff[n] + span->pressing) * span->falls[n]);
    at.slopes[0][n] = bd_ale_end_slope(span, 0, n);
    at.slopes[1][n] = bd_ale_end_slope(span, 1, n);
  }
  return at;
}

static void answer(const bd_ale *ale, int i, const bd_ale_state *y, const bd_ale_state *dy,
                   const bd_ale_moves *by, bd_ale_answers *out) {
  const bd_ale_span *span = &ale->spans[i];
  const bd_ale_arc *arc = &ale->arcs[i];
  const int slot = arc->begin + arc->n, after = ale->arcs[arc->next].begin;
  const answering at = answering_of(ale, span);
  const double m = y->m[slot], per_m = 1.0 / m, per_S = 1.0 / span->length, c = span->past;
  const double density = ale->density, per_mp = span->stretch / density;
  const double pull = span->elastic + span->damped, filled = dy->m[slot] * per_m;
  const double v[2] = {dy->v[slot], dy->v[after]}, lifts = pull * per_mp - c * c;
  const bd_ale_waves *waves = span->waves;
  double rolls[2];
  for (int end = 0; end < 2; ++end) {
    rolls[end] = 0.5 * bd_ale_rolls_on(span, end) * span->lifted[end];
  }
  for (int k = 0; k < BD_ALE_MOVES; k += WIDTH) {
    const vec by_m = load(by->m + k), past = load(by->past + k), stretch = load(by->stretch + k);
    const vec per_mp_by = stretch / density, fills = load(by->fills + k);
    const vec losing[2] = {load(by->losing[0] + k), load(by->losing[1] + k)};
    const vec pressing = load(by->pressing + k);
    vec turns[2];
    for (int end = 0; end < 2; ++end) {
      turns[end] = rolls[end] * (span->lifted[end] * pressing +
                                 2.0 * span->pressing * load(by->lifted[end] + k));
    }
    const vec fills_by = (fills - filled * by_m) * per_m;
    const vec lifts_by = load(by->pull + k) * per_mp + pull * per_mp_by - 2.0 * c * past;
    vec dp[BD_ALE_MODES];
    vec first = splat(0.0), added = first, lateral = first, draws = first, turned = first;
    for (int n = 0; n < BD_ALE_MODES; ++n) {
      vec ga = splat(0.0), gda = ga;
      for (int r = 1 - n % 2; r < BD_ALE_MODES; r += 2) {
        const double couples = per_S * waves->gyro[n][r];
        ga = ga + couples * load(by->a[r] + k);
        gda = gda + couples * load(by->p[r] + k);
      }
      const double k2 = at.k2[n], ab = span->ab[n], da = span->da[n], kappa = at.kappa[n];
      const vec a = load(by->a[n] + k), p = load(by->p[n] + k), kappa_by = k2 * a;
      const vec bends =
          at.stiff[n] * a + waves->rises[n] * ab * pressing + ale->bending_damping * k2 * p;
      const vec resists = losing[0] * at.rolls[0][n] + losing[1] * at.rolls[1][n];
      const vec driven = at.pressed[n] * pressing + turns[0] * at.slopes[0][n] +
                         turns[1] * at.slopes[1][n] - resists;
      const vec own = 2.0 * per_S * (at.driven[n] * per_mp_by + driven * per_mp) -
                      2.0 * (past * span->gda[n] + c * gda) - lifts_by * kappa - lifts * kappa_by -
                      k2 * (per_mp_by * at.bends[n] + per_mp * bends) +
                      ale->odd[n] * 8.0 * ale->direction * span->turning * past;
      const vec forced = waves->eased[n] * own - fills_by * (da + c * span->ga[n]) -
                         filled * (p + past * span->ga[n] + c * ga);
      const vec swings = kappa_by * ab + kappa * a;
      draws = draws + span->draws[n] * p;
      turned = turned + (span->draws[n] - 0.5 * span->length * kappa) * p;
      first = first + forced * span->ga[n] + at.own[n] * ga +
              2.0 * (past * (kappa * da) + c * (kappa_by * da + kappa * p));
      added = added + swings - 2.0 * span->ga[n] * ga;
      lateral = lateral + 2.0 * da * p - 2.0 * c * kappa * ab * past - c * c * swings;
      dp[n] = forced - span->quickens * ga;
    }
    first = 0.5 * density * m * first + span->first * per_m * by_m +
            span->carried * (span->per_path * (draws - span->stretch * fills) + turned);
    added = 0.25 * (0.5 * density * m * added + span->added * per_m * by_m);
    lateral = 0.25 / per_mp * lateral - span->lateral / span->stretch * stretch;
    const vec mu = density / 6.0 * by_m;
    const vec f_0 =
        load(by->total[0] + k) + lateral - 0.5 * first - (added - mu) * v[0] - (added + mu) * v[1];
    const vec f_1 =
        load(by->total[1] + k) - lateral - 0.5 * first - (added + mu) * v[0] - (added - mu) * v[1];
    const vec v_0 = span->matrix[0] * f_0 + span->matrix[1] * f_1;
    const vec v_1 = span->matrix[1] * f_0 + span->matrix[2] * f_1, quickens = 0.5 * (v_0 + v_1);
    store(out->v[0] + k, v_0);
    store(out->v[1] + k, v_1);
    for (int n = 0; n < BD_ALE_MODES; ++n) {
      store(out->p[n] + k, dp[n] - span->ga[n] * quickens);
    }
  }
}
