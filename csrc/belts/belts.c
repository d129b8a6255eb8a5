/* SPDX-License-Identifier: MIT
 *
 * The table of belt models, which of them a scene asks for, and what several rows share.
 */
#include <math.h>

#include "belts/belts.h"

static const bd_belt_model *const rows[BD_N_BELT_MODELS] = {
#define X(symbol) [BD_BELT_MODEL_##symbol] = &bd_belt_##symbol,
    BD_BELTS(X)
#undef X
};

const bd_belt_facts *bd_belt_facts_at(int row) {
  return row >= 0 && row < BD_N_BELT_MODELS ? &rows[row]->facts : NULL;
}

int bd_model_belt(const bd_model *model) {
  int row = 0;
  while (rows[row] != model->belt_model) {
    ++row;
  }
  return row;
}

int bd_model_cells(const bd_model *model, int32_t *pulley, double *share) {
  if (model->belt_model->cells) {
    model->belt_model->cells(model, pulley, share);
  }
  return model->belt_model->cells != NULL;
}

static int resists_bending(const bd_belt *belt) {
  return belt->bending_stiffness > 0.0 || belt->bending_damping > 0.0;
}

/* Nothing turns links against each other where joints do not resist bending: a model without angles
 * is taken where the scene leaves it open. */
const bd_belt_model *bd_belt_model_of(const bd_belt *belt) {
  const bd_belt_model *found = NULL;
  for (int k = 0; k < BD_N_BELT_MODELS; ++k) {
    const bd_belt_facts *is = &rows[k]->facts;
    const int open = belt->model == BD_BELT_AUTO && (is->bends || !resists_bending(belt));
    found = is->mesh == belt->mesh && (open || is->model == belt->model) ? rows[k] : found;
  }
  return found;
}

int bd_belt_check(const bd_belt *belt, bd_error *err) {
  const bd_belt_model *row = bd_belt_model_of(belt);
  if (belt->mesh < BD_MESH_PAPER || belt->mesh > BD_MESH_ALE) {
    return bd_fail(err, BD_ERR_PARAMETER, "belt.mesh",
                   "belt.mesh must be paper, joint or ale, got %d", belt->mesh);
  }
  if (belt->model < BD_BELT_AUTO || belt->model > BD_BELT_STRING) {
    return bd_fail(err, BD_ERR_PARAMETER, "belt.model",
                   "belt.model must be auto, links or string, got %d", belt->model);
  }
  if (!row) {
    const int string = belt->model == BD_BELT_STRING;
    return bd_fail(err, BD_ERR_PARAMETER, "belt.model",
                   "belt.model \"%s\" needs belt.mesh \"joint\"%s: %s", string ? "string" : "links",
                   string ? "" : " or \"paper\"",
                   belt->mesh == BD_MESH_ALE ? "the ALE mesh has cells alone, model \"auto\""
                                             : "the paper's mesh is one of rigid links");
  }
  if (!row->facts.bends && resists_bending(belt)) {
    return bd_fail(err, BD_ERR_PARAMETER, "belt.model",
                   "belt.model \"%s\" resists no bending: belt.bending_stiffness and "
                   "belt.bending_damping must be 0, got %g and %g; take \"links\" or \"auto\"",
                   row->facts.name, belt->bending_stiffness, belt->bending_damping);
  }
  return BD_OK;
}

void bd_line_point(const bd_model *model, const bd_route *line, const double *radius, double nodes,
                   double shift, double *x, double *y, double *phi) {
  double s = line->length * nodes / model->lay.n + shift, round = floor(s / line->length);
  bd_belt_line_point(line, radius, s - round * line->length, x, y, phi);
  *phi += round * line->turns * 2.0 * BD_PI;
}

bd_chord bd_line_chord(const bd_model *model, const bd_route *line, double shift, int i,
                       double *phi) {
  const double *raised = model->contact_radius;
  double middle[2], turned;
  bd_chord c;
  bd_line_point(model, line, model->radius, i + 0.5, shift, &middle[0], &middle[1], phi);
  bd_line_point(model, line, raised, i, shift, &c.x0, &c.y0, &turned);
  bd_line_point(model, line, raised, i + 1, shift, &c.x1, &c.y1, &turned);
  *phi += remainder(atan2(c.y1 - c.y0, c.x1 - c.x0) - *phi, 2.0 * BD_PI);
  return c;
}

void bd_contact_in_one_pass(bd_plan *plan, int j, double *y, double *dy, bd_sums *sums) {
  plan->kernels->contact[plan->contact_pulleys[j].law][!plan->skip_power](
      &plan->links, &plan->contact_pulleys[j], plan->search.n_runs[j], bd_runs_of(plan, j), y, dy,
      sums);
}
