/* SPDX-License-Identifier: MIT
 *
 * The links along the belt line, where settling begins.
 */
#include <math.h>
#include <string.h>

#include "run/run.h"

/* A hair inside the rims: exactly on them, rounding would decide which links touch at first, and
 * friction would keep a trace of it. */
static void lay(const bd_model *model, const bd_route *line, double shift, double *x, double *y,
                double *phi) {
  double inward = 1e-3 * model->info.strain * model->info.link_length * line->direction;
  model->belt_model->lay(model, line, shift, x, y, phi);
  for (int i = 0; i < model->lay.n; ++i) {
    x[i] += model->origin[0] - inward * sin(phi[i]);
    y[i] += model->origin[1] + inward * cos(phi[i]);
  }
}

int bd_lay_belt(const bd_plan *plan, double shift, double *y, double *turns, bd_error *err) {
  const bd_model *model = plan->model;
  const bd_layout *layout = &model->lay;
  const size_t n = (size_t)layout->n, np = (size_t)layout->np, nm = (size_t)layout->nm;
  double *laid = bd_block_new((3 * n + layout->size + 2 * np + nm) * sizeof *laid);
  bd_wrap *wraps = bd_block_new(np * sizeof *wraps);
  if (!laid || !wraps) {
    bd_block_free(laid);
    bd_block_free(wraps);
    return bd_fail(err, BD_ERR_MEMORY, "simulation", "out of memory for a simulation");
  }
  double *zero = laid + 3 * n, *cx = zero + layout->size, *cy = cx + np, *travel = cy + np;
  for (size_t j = 0; j < np; ++j) {
    cx[j] = model->cx[j] + (plan->offset ? plan->offset[2 * j] : 0.0);
    cy[j] = model->cy[j] + (plan->offset ? plan->offset[2 * j + 1] : 0.0);
  }
  for (size_t m = 0; m < nm; ++m) {
    travel[m] = model->mounts[m].rest;
  }
  bd_route line = {.np = layout->np,
                   .cx = cx,
                   .cy = cy,
                   .radius = model->radius,
                   .side = model->side,
                   .name = model->name,
                   .wraps = wraps};
  int code = bd_belt_line_lay(&line, err);
  if (code == BD_OK) {
    lay(model, &line, shift, laid, laid + n, laid + 2 * n);
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
