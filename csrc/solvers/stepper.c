/* SPDX-License-Identifier: MIT
 *
 * The stepper: what integration methods share, and what becomes of a state from step to step.
 */
#include <math.h>
#include <string.h>

#include "solvers/solvers.h"

/* Between two steps; y_new, y_mid, the Jacobian and all stages but the first are made anew. */
static void keep_state(bd_carver *carver, const bd_layout *lay, double **state) {
  bd_keep(carver, (bd_kept){BD_KEPT_BEHIND, state, lay->size * sizeof **state, 0, 0});
}

void bd_stepper_carve(bd_carver *carver, bd_stepper *stepper, const bd_model *model,
                      const bd_method *method, const bd_method *other, const bd_torque *torque) {
  const bd_layout *lay = &model->lay;
  int vectors = method->vectors, history = method->history, implicit = method->implicit;
  if (other) {
    vectors = other->vectors > vectors ? other->vectors : vectors;
    history = other->history > history ? other->history : history;
    implicit |= other->implicit;
  }
  BD_KEEP_INDEXES(carver, &stepper->n_history, 1, 0, history);
  BD_KEEP_SPAN(carver, stepper, history_h, report);
  keep_state(carver, lay, &stepper->y);
  keep_state(carver, lay, &stepper->stage[0]);
  BD_CARVE(carver, stepper->y, lay->size);
  BD_CARVE(carver, stepper->y_new, lay->size);
  BD_CARVE(carver, stepper->y_mid, lay->size);
  BD_CARVE(carver, stepper->weights, lay->size);
  BD_CARVE(carver, stepper->work_middle, lay->n_work);
  for (int k = 0; k < vectors; ++k) {
    BD_CARVE(carver, stepper->stage[k], lay->size);
  }
  for (int k = 0; k < history; ++k) {
    BD_CARVE(carver, stepper->history[k], lay->size);
    keep_state(carver, lay, &stepper->history[k]);
  }
  if (implicit) {
    bd_newton_carve(carver, &stepper->newton, model);
  }
  bd_plan_carve(carver, &stepper->plan, model);
  bd_torque_functions_carve(carver, &stepper->functions, lay->np);
  bd_torque_set_carve(carver, &stepper->plan.torques, model, torque);
  stepper->model = model;
  stepper->method = stepper->now = method;
}

/* 1 / scale for every unknown; 0 of what prescribed motions say, which has no error. */
void bd_stepper_weigh(bd_stepper *stepper) {
  const bd_model *model = stepper->model;
  const bd_layout *lay = &model->lay;
  memset(stepper->weights, 0, lay->size * sizeof *stepper->weights);
  for (int row = 0; row < BD_N_FIELDS; ++row) {
    for (int k = 0; k < bd_field_pieces(lay, row); ++k) {
      double *w = stepper->weights + bd_field_offset(lay, row, k);
      for (int i = 0; i < bd_field_length(lay, row); ++i) {
        w[i] = 1.0 / bd_state_scale(model, row, row < F_THETA ? k : i);
      }
    }
  }
  if (model->belt_model->weigh) {
    model->belt_model->weigh(model, stepper->weights);
  }
  const bd_motion_set *motion = &stepper->plan.torques.motion;
  for (size_t k = 0; k < motion->n; ++k) {
    const int j = motion->motions[k].pulley;
    stepper->weights[lay->omega + j] = 0.0;
    stepper->weights[lay->theta + j] *= !bd_knows_angle(motion, k);
  }
}

/* Where laws on the pulleys of a slot have states of different scales, that of the pulley that
 * holds a link counts; of links on no pulley the largest scale. */
void bd_stepper_weigh_friction(bd_stepper *stepper) {
  const bd_model *model = stepper->model;
  const bd_layout *lay = &model->lay;
  for (int k = 0; model->friction_scales_differ && k < lay->slots * lay->states; ++k) {
    const int slot = k / lay->states, element = k % lay->states;
    double *w = stepper->weights + bd_field_offset(lay, F_MU, k);
    const double *owner = stepper->plan.owner + slot * lay->n8;
    double least = (double)INFINITY;
    for (int j = 0; j < lay->np; ++j) {
      if (bd_in_slot(model, j, slot) && model->friction[j].law != BD_LAW_NONE) {
        least = fmin(least, 1.0 / bd_friction_state_scale(model, j, element));
      }
    }
    least = isfinite(least) ? least : 0.0; /* no law is here, no state moves */
    for (int i = 0; i < lay->n; ++i) {
      const int j = (int)owner[i];
      w[i] = j >= 0 ? 1.0 / bd_friction_state_scale(model, j, element) : least;
    }
  }
}

int bd_stepper_rate(bd_stepper *stepper, double t, double *y, double *dy) {
  ++stepper->nfev;
  return bd_plan_rate(&stepper->plan, t, y, dy, &stepper->report.failure);
}

int bd_stepper_ensure_rate(bd_stepper *stepper) {
  if (stepper->rate_known) {
    return BD_OK;
  }
  int code = bd_stepper_rate(stepper, stepper->t, stepper->y, stepper->stage[0]);
  stepper->rate_known = code == BD_OK;
  bd_torque_functions_set_torque(stepper);
  return code;
}

double bd_stepper_longest(const bd_stepper *stepper, double h) {
  const double MOST_LOOKS = 1000.0; /* in a step, between two answers to Ctrl-C */
  if (!stepper->fixed && stepper->method->stability > 0.0) {
    h = fmin(h, bd_method_longest(stepper->method, stepper->model));
  }
  if (!stepper->plan.torques.smooth && !stepper->fixed) {
    h = fmin(h, MOST_LOOKS * stepper->functions.interval);
  }
  if (stepper->plan.torques.motion.called && !stepper->fixed) {
    h = fmin(h, stepper->functions.interval);
  }
  if (!stepper->fixed) {
    h = fmin(h,
             bd_torque_set_longest(&stepper->plan.torques, stepper->y + stepper->model->lay.omega));
  }
  return stepper->max_step > 0.0 ? fmin(h, stepper->max_step) : h;
}

void bd_stepper_advance(bd_stepper *stepper, double h, double t_new, int rate_holds) {
  const int last = stepper->now->vectors - 1;
  double *first = stepper->stage[0];
  bd_history_push(stepper, h);
  stepper->stage[0] = stepper->stage[last];
  stepper->stage[last] = first;
  stepper->t = t_new;
  stepper->rate_known = rate_holds;
  stepper->jacobian_known = 0;
  bd_history_rebase(stepper);
}

void bd_stepper_reset(bd_stepper *stepper) {
  stepper->rate_known = stepper->jacobian_known = 0;
  bd_plan_place(&stepper->plan, stepper->t, stepper->y);
  stepper->plan.search.margin = 0.0;
  stepper->plan.search.travelled = INFINITY;
  bd_stepper_weigh_friction(stepper);
}

void bd_stepper_copy(bd_stepper *to, const bd_stepper *from) {
  const bd_layout *lay = &from->model->lay;
  memcpy(to->y, from->y, lay->size * sizeof *to->y);
  const int kept = to->history[0] ? from->n_history : 0; /* by a method that looks back */
  for (int k = 0; k < kept; ++k) {
    memcpy(to->history[k], from->history[k], lay->size * sizeof *to->y);
    to->history_h[k] = from->history_h[k];
  }
  memcpy(to->plan.owner, from->plan.owner, (size_t)(lay->n8 * lay->slots) * sizeof *to->plan.owner);
  bd_motion_set *motion = &to->plan.torques.motion;
  for (size_t k = 0; k < motion->n; ++k) {
    motion->offset[k] = from->plan.torques.motion.offset[k];
  }
  motion->begin = from->plan.torques.motion.begin;
  motion->end = from->plan.torques.motion.end;
  to->n_history = kept;
  to->method = to->now = from->method;
  to->t = from->t;
  to->turns = from->turns;
  bd_stepper_reset(to);
}
