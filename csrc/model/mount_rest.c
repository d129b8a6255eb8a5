/* SPDX-License-Identifier: MIT
 *
 * Where mounts that move rest: in balance with the tension of the belt, which depends on where all
 * of them are (MODEL section 5). Each on its own is let go from the place of the scene until the
 * force on it changes sign; those of several together then by Newton's method.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "model/model.h"

static const double PRECISION = 1e-12; /* of forces, over the belt's tension */

typedef struct search {
  bd_model *model;
  int n;
  double stiffness;                             /* with which the belt holds a pulley [N/m] */
  double *q, *force, *other, *matrix, *factors; /* (n), (n), (n), (n, n), (n, n) */
} search;

static double unit_of(const search *s, int m) {
  return s->model->mounts[m].row->angle ? 1.0 : s->model->belt.length;
}

static void put(const search *s, int m, double q) {
  const bd_place at = bd_mount_place(&s->model->mounts[m], q);
  s->q[m] = q;
  s->model->cx[s->model->mounts[m].pulley] = at.c[0];
  s->model->cy[s->model->mounts[m].pulley] = at.c[1];
}

/* Force on mount m in the sense of its travel under the tension of the line that is laid. */
static double force_on(const search *s, int m, double tension) {
  const bd_mounted *mount = &s->model->mounts[m];
  const bd_place at = bd_mount_place(mount, s->q[m]);
  double pull[2], lost = 0.0;
  bd_belt_line_pull(&s->model->wraps[mount->pulley], pull);
  return tension * (at.a[0] * pull[0] + at.a[1] * pull[1]) + bd_mount_spring(mount, s->q[m]) +
         bd_mount_stop(mount, s->q[m], 0.0, &lost) + bd_mount_weight(s->model, mount, &at);
}

static double force_at(const search *s, int m, double q, bd_error *err) {
  put(s, m, q);
  const double tension = bd_model_tension(s->model, err);
  return isnan(tension) ? tension : force_on(s, m, tension);
}

static int fail(const search *s, int m, const char *why) {
  const int j = s->model->mounts[m].pulley;
  const char *name = s->model->name[j].text;
  char field[40];
  snprintf(field, sizeof field, "pulleys[%d].mount", j);
  return bd_fail_at(&s->model->geometry, BD_ERR_GEOMETRY, field, (double)NAN, -1, j, s->q[m],
                    "%s%s%s %s", name[0] ? "the mount of pulley \"" : field, name,
                    name[0] ? "\"" : "", why);
}

/* Between two travels whose forces have different signs: regula falsi with the step of Illinois
 * (M. Dowell, P. Jarratt, 1971). */
static void close_in(const search *s, int m, double a, double fa, double b, double fb) {
  bd_error ignored;
  for (int k = 0; k < 200 && fabs(b - a) > 4e-16 * fmax(fabs(a), fabs(b)) && fb != 0.0; ++k) {
    const double c = k % 4 == 3 ? 0.5 * (a + b) : b - fb * (b - a) / (fb - fa);
    const double fc = force_at(s, m, c, &ignored);
    if (isnan(fc)) {
      break;
    }
    if ((fc > 0.0) != (fb > 0.0)) {
      a = b;
      fa = fb;
    } else {
      fa *= 0.5;
    }
    b = c;
    fb = fc;
  }
  put(s, m, b);
}

/* Lets one mount go, the others standing. */
static int release(const search *s, int m) {
  const bd_mount_kind *row = s->model->mounts[m].row;
  const double unit = unit_of(s, m), begin = s->q[m];
  double q = begin, step = row->step * unit;
  bd_error line;
  double force = force_at(s, m, q, &line);
  if (isnan(force)) {
    s->model->geometry = line;
    return line.code;
  }
  if (force == 0.0) {
    return BD_OK;
  }
  const double sense = force > 0.0 ? 1.0 : -1.0;
  while (fabs(q - begin) < row->farthest * unit) {
    const double next = q + sense * step, there = force_at(s, m, next, &line);
    if (isnan(there)) {
      s->q[m] = q;
      char why[448];
      snprintf(why, sizeof why,
               "finds no balance with the belt: at a travel of %.4g %s the belt has no line any "
               "more (%.200s); another preload, stiffness or length of the belt, or stops",
               next, row->angle ? "rad" : "m", line.message);
      return fail(s, m, why);
    }
    if (there * sense <= 0.0) {
      close_in(s, m, q, force, next, there);
      return BD_OK;
    }
    q = next;
    force = there;
    step = fmin(1.3 * step, row->longest * unit);
  }
  return fail(
      s, m,
      "finds no balance with the belt: its spring, weight or preload moves the pulley away "
      "from the belt, or is too small for its tension, or far too large; look at the sign of "
      "preload");
}

/* All forces at the present travels; the largest, over the levers. */
static double forces_of(const search *s, double *out) {
  bd_error ignored;
  const double tension = bd_model_tension(s->model, &ignored);
  double largest = 0.0;
  for (int m = 0; m < s->n; ++m) {
    const bd_mounted *mount = &s->model->mounts[m];
    out[m] = mount->row->moves ? force_on(s, m, tension) : 0.0;
    largest = mount->row->moves ? fmax(largest, fabs(out[m]) / mount->lever) : largest;
  }
  return isnan(tension) ? (double)INFINITY : largest;
}

/* Minus the derivatives of the forces, by central differences, symmetric but for their errors. */
static void linearise(const search *s) {
  const int n = s->n;
  double *ahead = s->other;
  for (int k = 0; k < n; ++k) {
    const double q = s->q[k], h = 1e-6 * unit_of(s, k);
    for (int side = -1; side <= 1; side += 2) {
      if (s->model->mounts[k].row->moves) {
        put(s, k, q + side * h);
        forces_of(s, ahead);
      }
      for (int m = 0; m < n; ++m) {
        double *entry = &s->matrix[m * n + k];
        *entry = (side < 0 ? 0.0 : *entry) - side * ahead[m] / (2.0 * h);
      }
    }
    if (!s->model->mounts[k].row->moves) {
      for (int m = 0; m < n; ++m) {
        s->matrix[m * n + k] = m == k;
      }
      continue;
    }
    put(s, k, q);
  }
}

/* The step of Newton's method into `other`, by Cholesky's factors, with what the belt holds a mount
 * with, times `more`, added to the diagonal (Levenberg); 0: that is not stable. */
static int newton_step(const search *s, double more) {
  const int n = s->n;
  double *a = s->factors, *x = s->other;
  for (int i = 0; i < n; ++i) {
    const double lever = s->model->mounts[i].lever;
    for (int k = 0; k <= i; ++k) {
      double sum = 0.5 * (s->matrix[i * n + k] + s->matrix[k * n + i]);
      sum += i == k ? more * s->stiffness * lever * lever : 0.0;
      for (int l = 0; l < k; ++l) {
        sum -= a[i * n + l] * a[k * n + l];
      }
      if (i == k && !(sum > 0.0)) {
        return 0;
      }
      a[i * n + k] = i == k ? sqrt(sum) : sum / a[k * n + k];
    }
  }
  for (int i = 0; i < n; ++i) {
    x[i] = s->force[i];
    for (int k = 0; k < i; ++k) {
      x[i] -= a[i * n + k] * x[k];
    }
    x[i] /= a[i * n + i];
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int k = i + 1; k < n; ++k) {
      x[i] -= a[k * n + i] * x[k];
    }
    x[i] /= a[i * n + i];
  }
  return 1;
}

/* What belt, springs, stops and weights store; the belt as if its contact did not yield. */
static double energy_of(const search *s) {
  const bd_model *model = s->model;
  bd_error ignored;
  const double tension = bd_model_tension(s->model, &ignored);
  double sum = 0.5 * tension * fmax(0.0, model->info.strain) * model->belt.length;
  for (int m = 0; m < s->n; ++m) {
    const bd_mounted *mount = &model->mounts[m];
    const bd_place at = bd_mount_place(mount, s->q[m]);
    sum += mount->row->moves
               ? bd_mount_stored(mount, s->q[m]) -
                     mount->mass * (model->gravity[0] * at.c[0] + model->gravity[1] * at.c[1])
               : 0.0;
  }
  return isnan(tension) ? (double)INFINITY : sum;
}

/* Whether the step, shortened if need be, brings the forces down, or the energy: where mounts go
 * together against a stop the forces stay until they are there. */
static int step_down(const search *s, double *largest) {
  const int n = s->n;
  const double energy = energy_of(s);
  double share = 1.0;
  for (int m = 0; m < n; ++m) {
    share = fmin(share, 0.1 * unit_of(s, m) / fmax(fabs(s->other[m]), 1e-300));
  }
  for (int tries = 0; tries < 12; ++tries, share *= 0.5) {
    for (int m = 0; m < n; ++m) {
      put(s, m, s->q[m] + share * s->other[m]);
    }
    const double now = forces_of(s, s->force);
    if (now < *largest || energy_of(s) < energy - 1e-9 * fabs(energy)) {
      *largest = now;
      return 1;
    }
    for (int m = 0; m < n; ++m) {
      put(s, m, s->q[m] - share * s->other[m]);
    }
  }
  *largest = forces_of(s, s->force);
  return 0;
}

static int release_all(const search *s) {
  int code = BD_OK;
  for (int m = 0; code == BD_OK && m < s->n; ++m) {
    code = s->model->mounts[m].row->moves ? release(s, m) : BD_OK;
  }
  return code;
}

static int balance(const search *s, double scale) {
  int code = release_all(s);
  if (code != BD_OK || s->model->n_moving < 2) {
    return code;
  }
  double largest = forces_of(s, s->force);
  for (int tries = 0; tries < 300 && code == BD_OK && largest > PRECISION * scale; ++tries) {
    linearise(s);
    const double before = largest;
    double more = 0.0;
    while (!newton_step(s, more) && more < 1.0) {
      more = more > 0.0 ? 10.0 * more : 1e-8;
    }
    if (!(more < 1.0) || !step_down(s, &largest)) {
      code = release_all(s);
      largest = forces_of(s, s->force);
      if (largest >= 0.999 * before) {
        break; /* rounding */
      }
    }
  }
  if (code == BD_OK && !(largest <= 1e-6 * scale)) {
    return fail(s, 0, "and the other mounts find no balance with the belt together");
  }
  return code;
}

void bd_model_rest(const bd_model *model, double *travel) {
  for (int m = 0; m < model->lay.nm; ++m) {
    travel[m] = model->mounts[m].rest;
  }
}

void bd_model_centers(const bd_model *model, const double *travel, double *centers) {
  for (int j = 0; j < model->lay.np; ++j) {
    const int m = model->mount_of ? model->mount_of[j] : -1;
    bd_place at = {.c = {model->cx[j], model->cy[j]}};
    if (m >= 0) {
      at = bd_mount_place(&model->mounts[m], travel[m]);
    }
    centers[2 * j] = at.c[0] + model->origin[0];
    centers[2 * j + 1] = at.c[1] + model->origin[1];
  }
}

int bd_mounts_rest(bd_model *model) {
  const int n = model->lay.nm;
  if (n == 0) {
    return BD_OK;
  }
  double *block = bd_block_new((size_t)(n * (2 * n + 3)) * sizeof(double));
  if (!block) {
    return bd_fail(&model->geometry, BD_ERR_MEMORY, "model", "out of memory for %d mounts", n);
  }
  search s = {.model = model,
              .n = n,
              .stiffness = 4.0 * model->belt.axial_stiffness / model->belt.length,
              .q = block,
              .force = block + n,
              .other = block + 2 * n,
              .matrix = block + 3 * n,
              .factors = block + 3 * n + n * n};
  const double scale = 0.01 * model->belt.axial_stiffness;
  int code = balance(&s, scale);
  bd_error line;
  if (code == BD_OK) {
    linearise(&s);
    const double tension = bd_model_tension(model, &line);
    for (int m = 0; m < n; ++m) {
      model->mounts[m].rest = s.q[m];
      model->mounts[m].held = s.matrix[m * n + m];
      if (model->mounts[m].row->moves && !(tension > 1e-9 * scale)) {
        code = fail(&s, m,
                    "cannot hold a tension: in its balance the belt is slack; take a shorter belt, "
                    "or a preload, a weight or stops that tighten it");
        break;
      }
    }
  }
  bd_block_free(block);
  return code;
}
