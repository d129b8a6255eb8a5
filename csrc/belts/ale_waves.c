/* SPDX-License-Identifier: MIT
 *
 * ALE belt: waves across its spans, which end in the wraps (MODEL section 11.6).
 */
#include <math.h>
#include <string.h>

#include "belts/ale.h"

/* A wave of a span that ends in the wraps, clamped l beyond the tangent points: its number, its
 * stiffness, which is H k^2 of a string, mass over that of a sine of the span's own length. */
typedef struct clamped {
  double wave, stiff, mass;
} clamped;

static clamped clamp(const bd_ale *ale, double H, double turns, double length, double guess) {
  const double l = sqrt(ale->bending / H), whole = length + 2.0 * l;
  double wave = guess, u2 = 0.0, root = 1.0;
  for (double step = wave; fabs(step) > 1e-9 * wave; wave -= step) {
    const double u = wave * l;
    u2 = u * u;
    root = sqrt(1.0 + u2);
    step = (whole * wave - turns - 2.0 * atan(u / root)) /
           (whole - 2.0 * l / ((1.0 + 2.0 * u2) * root));
  }
  u2 = wave * wave * l * l;
  root = sqrt(1.0 + u2);
  const double both = 1.0 + 2.0 * u2;
  return (clamped){wave, (H + ale->bending * wave * wave) * wave * wave,
                   1.0 + 2.0 * l / length * (1.0 - root / both + u2 / (both * root))};
}

/* Solves for the coefficients of a polynomial through values at places, in their place. */
static void interpolate(int n, const double *place, double *value) {
  for (int k = 1; k < n; ++k) { /* divided differences */
    for (int i = n - 1; i >= k; --i) {
      value[i] = (value[i] - value[i - 1]) / (place[i] - place[i - k]);
    }
  }
  for (int k = n - 2; k >= 0; --k) {
    for (int i = k; i < n - 1; ++i) {
      value[i] -= place[k] * value[i + 1];
    }
  }
}

/* Constants of waves. In the wraps the belt is bent to exp(-x / l) / R, and what H changes of that
 * moves where waves rest, by its projection on them: what moments at the tangent points would do,
 * epsilon_n times that. Over d(1 / H) it is a cubic of l, whose integral A_n is. Without bending
 * waves are sines. */
void bd_ale_fit_waves(const bd_ale *ale, bd_ale_span *span) {
  static const double AT[BD_ALE_POWERS] = {0.5, 1.0, 1.5, 2.0}; /* of l under H0 */
  bd_ale_waves *waves = span->waves;
  const double S = span->length, EI = ale->bending;
  *waves = (bd_ale_waves){.pressing = ale->rest};
  for (int n = 0; n < BD_ALE_MODES; ++n) {
    const double turns = (n + 1) * BD_PI, k = span->wave[n] = turns / S, k2 = k * k;
    const double moment =
        0.5 * (k * span->curvature[0] + bd_ale_end_slope(span, 1, n) * span->curvature[1]);
    double place[BD_ALE_POWERS], rate[BD_ALE_POWERS];
    waves->number[n] = k;
    waves->eased[n] = 1.0;
    for (int r = 1 - n % 2; r < BD_ALE_MODES; r += 2) {
      waves->gyro[n][r] = 4.0 * (n + 1) * (r + 1) / ((n + 1) * (n + 1) - (r + 1) * (r + 1));
    }
    for (int p = 0; p < BD_ALE_POWERS; ++p) {
      rate[p] = 0.0;
      if (EI > 0.0) {
        const double H = ale->rest / (AT[p] * AT[p]);
        const clamped at = clamp(ale, H, turns, S, k);
        const double u2 = at.wave * at.wave * EI / H, root = sqrt(1.0 + u2);
        const double works = 2.0 * (root - 1.0) * sqrt(1.0 + 2.0 * u2) / (root * root * u2);
        const double driven = works * at.wave / k * at.stiff / (k2 * H) / sqrt(at.mass);
        const double over = k * H / at.stiff * k;
        place[p] = sqrt(EI / H);
        rate[p] = driven * moment * over * over * 2.0 / (S * k2);
      }
    }
    if (EI > 0.0) {
      interpolate(BD_ALE_POWERS, place, rate);
    }
    for (int p = 0; p < BD_ALE_POWERS; ++p) {
      span->bend[p][n] = 2.0 / (p + 2) * rate[p];
    }
  }
}

/* Ends that turn draw the belt between them along; waves are coupled by their curvature where they
 * are clamped. */
void bd_ale_hold_waves(const bd_ale *ale, bd_ale_span *span, double pressing) {
  bd_ale_waves *waves = span->waves;
  const double EI = ale->bending, H = bd_at_least(pressing, BD_ALE_LEAST * ale->rest);
  const double l2 = EI / H, l = sqrt(l2), S = span->length;
  double bent[BD_ALE_MODES], stiff[BD_ALE_MODES];
  bd_ale_baseline.path(ale, span, H); /* where they rest */
  waves->pressing = H;
  memset(waves->rest, 0, sizeof waves->rest);
  memset(waves->lifts, 0, sizeof waves->lifts);
  for (int n = 0; n < BD_ALE_MODES && EI > 0.0; ++n) {
    const double k = span->wave[n], k2 = k * k;
    const clamped at = clamp(ale, H, (n + 1) * BD_PI, S, waves->number[n]);
    const double wave = at.wave, u2 = wave * wave * l2;
    const double free = 1.0 - 1.0 / ((1.0 + 2.0 * u2) * sqrt(1.0 + u2));
    const double by_H = wave * l * free / (S + 2.0 * l * free) / H;
    const double rises = (wave + (2.0 * H + 4.0 * EI * wave * wave) * by_H) * wave / k2;
    const double first = 0.5 * EI / H * k * span->curvature[0],
                 last = 0.5 * EI / H * bd_ale_end_slope(span, 1, n) * span->curvature[1];
    stiff[n] = at.stiff;
    bent[n] = wave * sqrt((1.0 + 2.0 * u2) / at.mass) / l;
    waves->number[n] = wave;
    waves->stiff[n] = (at.stiff / k2 - H) / k2;
    waves->rises[n] = rises - 1.0;
    waves->eased[n] = 1.0 / (1.0 + 2.0 / 3.0 * (first * first - first * last + last * last));
    for (int end = 0; end < 2; ++end) {
      waves->rest[end] += bd_ale_end_slope(span, end, n) * span->rest[n];
      waves->lifts[end] += bd_ale_end_slope(span, end, n) * span->falls[n];
    }
  }
  for (int n = 0; n < BD_ALE_MODES && EI > 0.0; ++n) {
    for (int r = 1 - n % 2; r < BD_ALE_MODES; r += 2) {
      waves->gyro[n][r] = 4.0 * EI * bent[n] * bent[r] / (stiff[n] - stiff[r]);
    }
  }
}
