/* SPDX-License-Identifier: MIT
 *
 * The model at one state, without a run: its rate, its outputs, its Jacobian by the systems it
 * solves; the same state with the belt running; torques and prescribed speeds at a moment.
 */
#include <math.h>

#include "run/run.h"

/* A simulation that stands at the state, with the links near the pulleys listed. */
static int sim_at_state(bd_sim **out, const bd_model *model, const bd_state *state,
                        const double *torque, const char *method, bd_error *err) {
  double moment = 0.0;
  const bd_torque given = {
      .n_terms = torque ? 1 : 0,
      .terms =
          &(bd_torque_term){.kind = BD_TORQUE_PIECEWISE, .n_t = 1, .t = &moment, .values = torque}};
  bd_options options;
  bd_options_default(&options);
  options.method = method;
  options.guards = 0;
  double later = state->t + fmax(1.0, fabs(state->t));
  int code = bd_sim_create_unchecked(out, model, state, &given, later, &options, err);
  if (code == BD_OK) {
    bd_sim *sim = *out;
    bd_plan_place(&sim->stepper.plan, sim->stepper.t, sim->stepper.y);
    sim->stepper.plan.search.travelled = INFINITY;
    bd_plan_list(&sim->stepper.plan, sim->stepper.y, 0.0);
    code = bd_plan_rate(&sim->stepper.plan, sim->stepper.t, sim->stepper.y, sim->stepper.stage[0],
                        err);
  }
  return code;
}

/* Rates know neither origin nor turns; angles that follow from places are no unknowns and have
 * none: 0. */
static void export_rate(const bd_model *model, const double *dy, bd_state *out) {
  bd_model moved = *model;
  moved.origin[0] = moved.origin[1] = 0.0;
  bd_state_export(&moved, dy, 0.0, out);
  for (int i = 0; model->belt_model->directions && i < model->lay.n; ++i) {
    out->phi[i] = out->vphi[i] = 0.0;
  }
}

int bd_model_rate(const bd_model *model, const bd_state *state, const double *torque, bd_state *out,
                  bd_error *err) {
  bd_sim *sim = NULL;
  int code = sim_at_state(&sim, model, state, torque, "tsit5", err);
  if (code == BD_OK) {
    out->t = 1.0;
    export_rate(model, sim->stepper.stage[0], out);
  }
  bd_sim_free(sim);
  return code;
}

static bd_torque_set *carve_torques(bd_carver *carver, const bd_model *model,
                                    const bd_torque *given) {
  bd_torque_set *out, none = {0};
  BD_CARVE(carver, out, 1);
  bd_torque_set_carve(carver, carver->base ? out : &none, model, given);
  return out;
}

int bd_model_torques(const bd_model *model, const bd_torque *given, double t, double until,
                     const double *theta, double *omega, double *torque, bd_error *err) {
  bd_carver carver = {0};
  carve_torques(&carver, model, given);
  void *block = bd_block_new(carver.used);
  if (!block) {
    return bd_fail(err, BD_ERR_MEMORY, "torque", "out of memory for torques");
  }
  carver = (bd_carver){.base = block};
  bd_torque_set *set = carve_torques(&carver, model, given);
  int code = bd_torque_set_fill(set, given, err);
  set->motion.begin = t;
  set->motion.end = until;
  code = code == BD_OK ? bd_motion_set_eval(set, t, t, err) : code;
  for (size_t k = 0; code == BD_OK && k < set->motion.n; ++k) {
    omega[set->motion.motions[k].pulley] = set->motion.omega[k];
  }
  code = code == BD_OK ? bd_torque_set_eval(set, t, t, theta, omega, torque, err) : code;
  bd_block_free(block);
  return code;
}

int bd_model_observe(const bd_model *model, const bd_state *state, const bd_output *output,
                     bd_error *err) {
  bd_sim *sim = NULL;
  int code = sim_at_state(&sim, model, state, NULL, "tsit5", err);
  if (code == BD_OK) {
    bd_stepper *stepper = &sim->stepper;
    bd_observe(&stepper->plan, stepper->y, stepper->turns, stepper->plan.torque, 0.0, output, 0);
  }
  bd_sim_free(sim);
  return code;
}

int bd_model_set_going(const bd_model *model, const bd_state *state, double speed, bd_state *going,
                       bd_error *err) {
  if (!isfinite(speed)) {
    return bd_fail(err, BD_ERR_OPTION, "speed", "speed must be finite, got %g m/s", speed);
  }
  bd_sim *sim = NULL;
  int code = sim_at_state(&sim, model, state, NULL, "tsit5", err);
  if (code == BD_OK) {
    bd_set_going(&sim->stepper.plan, sim->stepper.y, speed);
    bd_state_export(model, sim->stepper.y, sim->stepper.turns, going);
    going->t = state->t;
  }
  bd_sim_free(sim);
  return code;
}

int bd_model_solve(const bd_model *model, const bd_state *state, double g, const bd_state *c,
                   bd_state *k, bd_error *err) {
  if (!(g > 0.0) || !isfinite(g)) {
    return bd_fail(err, BD_ERR_OPTION, "g", "g must be finite and > 0, got %g", g);
  }
  bd_sim *sim = NULL;
  int code = sim_at_state(&sim, model, state, NULL, "lie", err);
  if (code == BD_OK) {
    bd_newton_linearise(&sim->stepper.newton, &sim->stepper.plan, sim->stepper.y);
    bd_state_put(&model->lay, c, 0.0, 0.0, sim->stepper.stage[1]);
    bd_newton_factor(&sim->stepper.newton, &sim->stepper.plan, sim->stepper.y, g, 0.0, NULL);
    bd_newton_solve(&sim->stepper.newton, &sim->stepper.plan, sim->stepper.stage[1]);
    k->t = g;
    export_rate(model, sim->stepper.stage[1], k);
  }
  bd_sim_free(sim);
  return code;
}

/* Numbers of the unknowns, by entry of the vector; how many there are. */
static size_t number_unknowns(const bd_model *model, int *place) {
  const bd_layout *lay = &model->lay;
  size_t next = 0;
  for (int row = 0; row < BD_N_FIELDS; ++row) {
    const int length = bd_field_length(lay, row), pieces = bd_field_pieces(lay, row);
    for (int k = 0; k < pieces; ++k) {
      for (int i = 0; i < length; ++i) {
        place[bd_field_offset(lay, row, k) + (size_t)i] = (int)next + k * length + i;
      }
    }
    /* directions of a string are in the caller's arrays all the same */
    next += bd_size(&model->info, bd_state_fields[row].size);
  }
  return next;
}

static bd_jacobian *carve_jacobian(bd_carver *carver, const bd_layout *lay, size_t n, int **place) {
  bd_jacobian *out, none;
  BD_CARVE(carver, out, 1);
  bd_jacobian *to = carver->base ? out : &none;
  BD_CARVE(carver, to->values, n);
  BD_CARVE(carver, to->rows, n);
  BD_CARVE(carver, to->columns, n);
  BD_CARVE(carver, *place, lay->size);
  return out;
}

int bd_model_jacobian(const bd_model *model, const bd_state *state, bd_jacobian **out,
                      bd_error *err) {
  bd_sim *sim = NULL;
  *out = NULL;
  int code = sim_at_state(&sim, model, state, NULL, "lie", err);
  if (code == BD_OK) {
    bd_stepper *at = &sim->stepper;
    bd_newton_linearise(&at->newton, &at->plan, at->y);
    bd_entries counted = {.n = 0};
    model->belt_model->newton->entries(&at->newton, &at->plan, at->y, at->stage[1], &counted);
    bd_carver carver = {0};
    int *place;
    carve_jacobian(&carver, &model->lay, counted.n, &place);
    void *block = bd_block_new(carver.used);
    if (block) {
      carver = (bd_carver){.base = block};
      *out = carve_jacobian(&carver, &model->lay, counted.n, &place);
      (*out)->size = number_unknowns(model, place);
      (*out)->n = counted.n;
      bd_entries entries = {place, 0, (*out)->rows, (*out)->columns, (*out)->values};
      model->belt_model->newton->entries(&at->newton, &at->plan, at->y, at->stage[1], &entries);
      for (size_t k = 0; code == BD_OK && k < counted.n; ++k) {
        if (!isfinite((*out)->values[k])) {
          code = bd_fail(err, BD_ERR_NOT_FINITE, "state",
                         "the Jacobian is not finite at this state: its numbers are too large");
        }
      }
    } else {
      code = bd_fail(err, BD_ERR_MEMORY, "jacobian", "out of memory for a Jacobian");
    }
  }
  if (code != BD_OK) {
    bd_jacobian_free(*out);
    *out = NULL;
  }
  bd_sim_free(sim);
  return code;
}

void bd_jacobian_free(bd_jacobian *jacobian) {
  bd_block_free(jacobian);
}
