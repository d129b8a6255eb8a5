/* SPDX-License-Identifier: MIT
 *
 * Every allocation fails in turn: a clear error, nothing leaked, nothing crashed. base.c is built
 * with BD_MALLOC=counting_malloc and BD_FREE=counting_free.
 */
#include <stdlib.h>

#include "check.h"
#include "scene.h"

void *counting_malloc(size_t size);
void counting_free(void *block);

static long asked, fail_at, alive;
static int running;

void *counting_malloc(size_t size) {
  CHECK(!running); /* no allocation while running */
  if (++asked == fail_at) {
    return NULL;
  }
  ++alive;
  return malloc(size);
}

void counting_free(void *block) {
  --alive;
  free(block);
}

/* A whole session: model, settling from a slack position, run with samples. */
static int session(bd_error *err) {
  static room r;
  static double force[3 * N];
  bd_model *model = NULL;
  bd_sim *sim = NULL;
  bd_settling *settling = NULL;
  bd_scene scene = test_scene();
  bd_state state = state_in(&r);
  const double offset[2 * NP] = {0, 0, -2e-3, -2e-3, 0, 0};
  bd_settle_options options;
  bd_settle_options_default(&options);
  options.offset = offset;
  options.move_time = 0.01;
  options.friction = 1;
  int code = bd_model_create(&model, &scene, err);
  if (code == BD_OK) {
    code = bd_settle_create(&settling, model, NULL, &options, err);
  }
  if (code == BD_OK) {
    running = 1;
    code = come_to_rest(settling, err);
    running = 0;
    bd_sim_state(bd_settle_sim(settling), &state);
  }
  bd_settle_free(settling);
  const double drag[NP] = {1, 1, 1}, t[] = {0, 1e-3}, values[2 * NP] = {0, 0, 0, -5, 0, 0};
  const bd_torque_term terms[] = {
      {.kind = BD_TORQUE_VISCOUS, .coefficients = drag},
      {.kind = BD_TORQUE_PIECEWISE, .n_t = 2, .t = t, .values = values},
      {.kind = BD_TORQUE_LOAD, .pulley = 1, .against = {1, 1, 1}, .n_t = 2, .t = t, .values = drag},
      {.kind = BD_TORQUE_TABLE, .pulley = 1, .n_points = 1, .omega = drag, .torque = drag},
      {.kind = BD_TORQUE_HARMONICS, .harmonics = {2, drag, drag, drag}}};
  const bd_motion motion = {
      .pulley = 2, .n_t = 1, .t = t, .values = values, .harmonics = {1, drag, drag, drag}};
  const bd_torque torque = {.n_terms = 5, .terms = terms, .n_motions = 1, .motions = &motion};
  if (code == BD_OK) {
    code = bd_sim_create(&sim, model, &state, &torque, 2e-3, NULL, err);
  }
  if (code == BD_OK) {
    const double times[] = {0.0, 1e-3, 2e-3};
    const bd_output out = {.force = force};
    code = bd_sim_set_output(sim, 3, times, &out, err);
  }
  if (code == BD_OK) {
    running = 1;
    code = finish(sim, err);
    running = 0;
  }
  if (code == BD_OK) {
    static room r2;
    bd_state rate = state_in(&r2);
    const double none[NP] = {0};
    code = bd_model_rate(model, &state, none, &rate, err);
  }
  bd_sim_free(sim);
  bd_model_free(model);
  return code;
}

static void every_allocation_may_fail(void) {
  bd_error err;
  fail_at = 0;
  asked = 0;
  CHECK(session(&err) == BD_OK);
  long total = asked;
  CHECK(total >= 5);
  CHECK(alive == 0);
  for (fail_at = 1; fail_at <= total; ++fail_at) {
    asked = 0;
    CHECK(session(&err) == BD_ERR_MEMORY);
    CHECK(strstr(err.message, "out of memory") != NULL);
    CHECK(alive == 0);
  }
}

/* A law of the table with numbers that its parameters' units suggest. */
static bd_friction typical(int law) {
  static const struct {
    const char *unit;
    double value;
  } values[] = {{"1", 0.6},   {"1/m", 1e4},   {"m/s", 0.05},
                {"s/m", 0.1}, {"N/m^2", 2e7}, {"N s/m^2", 400.0}};
  bd_friction friction = {.law = law};
  for (size_t k = 0; k < bd_n_parameters; ++k) {
    const bd_parameter *p = &bd_parameters[k];
    for (size_t u = 0; u < sizeof values / sizeof values[0]; ++u) {
      char *const place = (char *)&friction.dahl + p->offset;
      const bd_numbers two = {2, {values[u].value, values[u].value}};
      if (strcmp(p->group, bd_law_name(law)) != 0 || strcmp(p->unit, values[u].unit) != 0) {
        continue;
      }
      if (p->kind == BD_IS_LIST) {
        memcpy(place, &two, sizeof two);
      } else {
        memcpy(place, &values[u].value, sizeof values[u].value);
      }
    }
  }
  return friction;
}

/* By every law of friction, both kinds of contact damping and every method: counting_malloc fails
 * the test while `running`. */
static void nothing_is_allocated_while_running(void) {
  static room r;
  static double row[2][N], span[2][NP], mu[64 * N], slip[8 * N];
  const double t[] = {0.0, 1e-3};
  fail_at = 0;
  for (int law = BD_LAW_NONE; law < BD_N_LAWS; ++law) {
    for (int by_force = 0; by_force < 2; ++by_force) {
      const bd_friction friction = law == BD_LAW_NONE ? test_friction : typical(law);
      bd_scene scene = test_scene();
      bd_model *model = NULL;
      bd_state state = state_in(&r);
      state.mu = mu;
      state.slip = slip;
      scene.friction = law == BD_LAW_NONE ? NULL : &friction;
      scene.contact.hunt_crossley = by_force ? 0.3 : 0.0;
      CHECK(bd_model_create(&model, &scene, NULL) == BD_OK);
      CHECK(settle_into(model, &state, NULL) == BD_OK);
      for (size_t k = 0; bd_method_name(k); ++k) {
        bd_options options;
        bd_sim *sim = NULL;
        bd_options_default(&options);
        options.method = bd_method_name(k);
        const bd_output out = {.normal = row[0], .span_tension = span[0]};
        CHECK(bd_sim_create(&sim, model, &state, NULL, 1e-3, &options, NULL) == BD_OK);
        CHECK(bd_sim_set_output(sim, 2, t, &out, NULL) == BD_OK);
        running = 1;
        CHECK(finish(sim, NULL) == BD_OK);
        running = 0;
        bd_sim_free(sim);
      }
      bd_model_free(model);
    }
  }
}

static const test tests[] = {
    {"every_allocation_may_fail", every_allocation_may_fail},
    {"nothing_is_allocated_while_running", nothing_is_allocated_while_running},
};

int main(int argc, char **argv) {
  return run_tests(argc, argv, tests, 2);
}
