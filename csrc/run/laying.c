/* SPDX-License-Identifier: MIT
 *
 * The links along the belt line, where settling begins.
 */
#include <math.h>
#include <string.h>

#include "run/run.h"

/* A belt line of which link 0 begins `shift` past its place [m]. */
typedef struct laying {
  const bd_model *model;
  bd_route line;
  double shift;
} laying;

/* The line's point and direction `links` of n links from its beginning. */
static void point_on(const laying *at, const double *raised, double links, double *x, double *y,
                     double *phi) {
  const bd_route *line = &at->line;
  double s = line->length * links / at->model->lay.n + at->shift, round = floor(s / line->length);
  bd_belt_line_point(line, raised, s - round * line->length, x, y, phi);
  *phi += round * line->turns * 2.0 * BD_PI;
}

/* Links with their ends on the circles of contact, which stand for the arcs of the line; of a
 * string the mass at the left end. */
static void lay_ends(const laying *at, int i, double *x, double *y, double *phi) {
  const double *raised = at->model->contact_radius;
  const int string = at->model->lay.string;
  double x0, y0, x1, y1, turned;
  point_on(at, raised, i, &x0, &y0, &turned);
  point_on(at, raised, i + 1, &x1, &y1, &turned);
  *phi += remainder(atan2(y1 - y0, x1 - x0) - *phi, 2.0 * BD_PI);
  *x = string ? x0 : 0.5 * (x0 + x1);
  *y = string ? y0 : 0.5 * (y0 + y1);
}

/* A hair inside the rims: exactly on them, rounding would decide which links touch at first, and
 * friction would keep a trace of it. */
static void place_on_line(const laying *at, double *x, double *y, double *phi) {
  const bd_model *model = at->model;
  double inward = 1e-3 * model->info.strain * model->info.link_length * at->line.direction;
  for (int i = 0; i < model->lay.n; ++i) {
    point_on(at, model->radius, i + 0.5, &x[i], &y[i], &phi[i]);
    if (model->along_links) {
      lay_ends(at, i, &x[i], &y[i], &phi[i]);
    }
    x[i] += model->origin[0] - inward * sin(phi[i]);
    y[i] += model->origin[1] + inward * cos(phi[i]);
  }
}

int bd_lay_belt(const bd_plan *plan, double shift, double *y, double *turns, bd_error *err) {
  const bd_model *model = plan->model;
  const bd_layout *lay = &model->lay;
  const size_t n = (size_t)lay->n, np = (size_t)lay->np, nm = (size_t)lay->nm;
  double *laid = bd_block_new((3 * n + lay->size + 2 * np + nm) * sizeof *laid);
  bd_wrap *wraps = bd_block_new(np * sizeof *wraps);
  if (!laid || !wraps) {
    bd_block_free(laid);
    bd_block_free(wraps);
    return bd_fail(err, BD_ERR_MEMORY, "simulation", "out of memory for a simulation");
  }
  double *zero = laid + 3 * n, *cx = zero + lay->size, *cy = cx + np, *travel = cy + np;
  for (size_t j = 0; j < np; ++j) {
    cx[j] = model->cx[j] + (plan->offset ? plan->offset[2 * j] : 0.0);
    cy[j] = model->cy[j] + (plan->offset ? plan->offset[2 * j + 1] : 0.0);
  }
  for (size_t m = 0; m < nm; ++m) {
    travel[m] = model->mounts[m].rest;
  }
  laying at = {.model = model,
               .shift = shift,
               .line = {.np = lay->np,
                        .cx = cx,
                        .cy = cy,
                        .radius = model->radius,
                        .side = model->side,
                        .name = model->name,
                        .wraps = wraps}};
  int code = bd_belt_line_lay(&at.line, err);
  if (code == BD_OK) {
    place_on_line(&at, laid, laid + n, laid + 2 * n);
    bd_state state = {
#define X(symbol, name, size, scale, unit, text) .name = zero,
        BD_STATE_FIELDS(X)
#undef X
    };
    state.x = laid;
    state.y = laid + n;
    state.phi = laid + 2 * n;
    state.travel = travel;
    code = bd_state_import(model, &state, y, turns, err);
  } else if (err && plan->offset) {
    memmove(err->field, "offset", sizeof "offset");
  }
  bd_block_free(laid);
  bd_block_free(wraps);
  return code;
}
